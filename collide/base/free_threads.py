"""Whether threads run Python at once, and workspaces that rely on Python's lock."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache, wraps
from threading import local
from typing import TypeVar

T = TypeVar("T")

#: Whether this process runs without Python's lock: a free-threaded build, with the lock left off.
FREE_THREADED = not getattr(sys, "_is_gil_enabled", lambda: True)()


def workspace_under_lock(make: Callable[..., T]) -> Callable[..., T]:
    """Decorates what makes a workspace for kernels that keep Python's lock: made once for given arguments, and for all
    threads; without a lock, once a thread."""
    if not FREE_THREADED:
        return cache(make)
    of_thread = local()

    @wraps(make)
    def made(*arguments) -> T:
        known = of_thread.__dict__.setdefault("known", {})
        return known[arguments] if arguments in known else known.setdefault(arguments, make(*arguments))

    return made
