"""Functions whose refusal of an unknown argument says what to write.

The words are in `foreign_names.py`, imported when a call has failed: starts and kernels do not depend on the words.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

from collide.base.lazy_modules import lazy_module

foreign_names = lazy_module("collide.base.foreign_names")

F = TypeVar("F", bound=Callable[..., Any])


def foreign_arguments(function: F) -> F:
    """The function, whose TypeError about an argument it does not have says what to write. About 0.1 µs a call."""

    @wraps(function)
    def call(*args, **kwargs):
        try:
            return function(*args, **kwargs)
        except TypeError as error:
            if error.__traceback__ is not None and error.__traceback__.tb_next is not None:
                raise  # by the function itself
            advice = foreign_names.advice_on_arguments(function.__qualname__, str(error), kwargs)
            if not advice:
                raise
            raise TypeError(f"{error}: write {advice}") from None

    return call  # type: ignore[return-value]
