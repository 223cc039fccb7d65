"""An object in a process of its own, whose methods are called from here: an engine that aborts or hangs costs its own
answers, and all have the same around them.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: How long a child may take to be made ready [s].
START_TIMEOUT = 60.0


class InChild:
    """make(*arguments), made in a child process when its first method is called, and anew after a death.

    make : a function or class of a module, which the child imports.   timeout : of a call [s].
    """

    def __init__(self, make: Callable[..., Any], *arguments: Any, timeout: float = 120.0):
        self._job, self._timeout = (make, arguments), timeout
        #: (method, arguments) → how the child ended on it, "hang" or "abort". Such a call is not repeated.
        self.failures: dict[tuple, str] = {}
        self._process: Any = None
        self._pipe: Any = None

    def call(self, method: str, *arguments: Any) -> Any:
        """What the method gives; None where the child died of it or was silent for too long."""
        question, limit = (method, arguments), self._timeout
        if question in self.failures:
            return None
        if self._process is None:
            self._start()
            limit += START_TIMEOUT
        try:
            self._pipe.send(question)
            if self._pipe.poll(limit):
                return self._pipe.recv()
            self.failures[question] = "hang"
        except (EOFError, OSError):
            self.failures[question] = "abort"
        self.close()
        return None

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, child_end = context.Pipe()
        # Through a file: a pipe that is full would hold this process up for as long as a child does not read.
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "job"
            place.write_bytes(pickle.dumps(self._job))
            self._process = context.Process(target=_serve, args=(child_end, str(place)), daemon=True)
            self._process.start()
            child_end.close()
            if self._pipe.poll(START_TIMEOUT):
                try:
                    self._pipe.recv()
                except (EOFError, OSError):
                    pass  # it died, which the first question tells

    def close(self) -> None:
        """End the child."""
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._pipe.close()
            self._process = None


def _serve(pipe: Any, place: str) -> None:
    """Make the object, and answer what comes down the pipe."""
    for stream in (1, 2):  # some engines print when they are imported
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    make, arguments = pickle.loads(Path(place).read_bytes())
    pipe.send("read")
    made = make(*arguments)
    while True:
        try:
            method, arguments = pipe.recv()
        except EOFError:
            return
        pipe.send(getattr(made, method)(*arguments))
