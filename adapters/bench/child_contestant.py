"""An object in a process of its own, whose methods are called from here: an engine that aborts or hangs costs its own
answers, and all have the same around them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from collide.base.child_process import ChildProcess

#: How long a child may take to be made ready [s].
START_TIMEOUT = 60.0


class InChild:
    """make(*arguments), made in a child process when its first method is called, and anew after a death.

    make : a function or class of a module, which the child imports.   timeout : of a call [s].
    """

    def __init__(self, make: Callable[..., Any], *arguments: Any, timeout: float = 120.0):
        self._made_from, self._timeout = (_module_of(make), make.__qualname__, *arguments), timeout
        #: (method, arguments) → how the child ended on it, "hang" or "abort". Such a call is not repeated.
        self.failures: dict[tuple, str] = {}
        self._child: ChildProcess | None = None

    def call(self, method: str, *arguments: Any) -> Any:
        """What the method gives; None where the child died of it or was silent for too long."""
        question, limit = (method, arguments), self._timeout
        if question in self.failures:
            return None
        if self._child is None:
            self._child = ChildProcess(f"{__name__}:answer_calls", *self._made_from)
            limit += START_TIMEOUT
        self._child.send(question)
        try:
            return self._child.receive(limit)
        except TimeoutError:
            self.failures[question] = "hang"
        except EOFError:
            self.failures[question] = "abort"
        self.close()
        return None

    def close(self) -> None:
        """End the child."""
        if self._child is not None:
            self._child.close()
            self._child = None


def _module_of(make: Callable[..., Any]) -> str:
    """Under which name the child imports it: that of a script which is run, `__main__` here, is its file's."""
    script = sys.modules["__main__"].__dict__.get("__file__")
    return Path(script).stem if make.__module__ == "__main__" and script else make.__module__


def answer_calls(
    calls: Iterator[tuple[str, tuple]], send: Callable[[Any], None], module: str, name: str, *arguments: Any
) -> None:
    """The child: make the object, and answer calls of its methods."""
    made = getattr(import_module(module), name)(*arguments)
    for method, values in calls:
        send(getattr(made, method)(*values))
