"""A line about long work, on stderr, so that a pipe of results stays clean.

On a terminal the line is rewritten with the seconds passed and cleared at the end. Elsewhere a
stage longer than the delay is named twice: after the delay, and at its end.
"""

from __future__ import annotations

import sys
import threading
import time
from contextlib import contextmanager, nullcontext

_TERMINAL_DELAY = 0.4
_TICK = 0.2


def silent(label: str):
    """A progress that says nothing."""
    return nullcontext()


class Progress:
    """``progress = Progress()``, then ``with progress("reading the scene"): ...``

    Stages nest: the innermost is shown. ``with`` gives a function for changing the label, ``None`` from a silent
    `Progress`. ``delay`` is the longest unannounced stage [s] where stderr is no terminal.
    """

    def __init__(self, stream=None, delay: float = 2.0):
        self.stream = sys.stderr if stream is None else stream
        self.terminal = bool(getattr(self.stream, "isatty", lambda: False)())
        self.delay = delay
        self._stages: list[_Stage] = []
        self._wake = threading.Event()
        self._visible = False

    @contextmanager
    def __call__(self, label: str):
        stage = _Stage(label)
        self._stages.append(stage)
        if len(self._stages) == 1:
            self._start()
        try:
            yield stage.rename
        finally:
            self._stages.remove(stage)
            if not self._stages:
                self._stop()
            if stage.announced:
                self._write(f"collide: {label}: done in {stage.seconds:.1f} s\n")

    def _start(self) -> None:
        self._wake.clear()
        self._thread = threading.Thread(target=self._watch, args=(self._wake,), daemon=True)
        self._thread.start()

    def _stop(self) -> None:
        self._wake.set()
        self._thread.join()
        self._wake = threading.Event()
        if self._visible:
            self._write("\r\x1b[2K")
            self._visible = False

    def _watch(self, wake: threading.Event) -> None:
        while not wake.wait(_TICK):
            stages = self._stages[-1:]  # a copy: the other thread may empty the list meanwhile
            for stage in stages:
                self._show(stage)

    def _show(self, stage: _Stage) -> None:
        if self.terminal:
            if stage.seconds >= _TERMINAL_DELAY:
                self._visible = True
                self._write(f"\r\x1b[2K{stage.label} … {stage.seconds:.0f} s")
        elif stage.seconds >= self.delay and not stage.announced:
            stage.announced = True
            self._write(f"collide: {stage.name} ...\n")

    def _write(self, text: str) -> None:
        try:
            self.stream.write(text)
            self.stream.flush()
        except UnicodeEncodeError:
            self.stream.write(text.replace("…", "..."))
        except (OSError, ValueError):  # stderr closed: progress is not worth an error
            self.terminal = False


class _Stage:
    def __init__(self, label: str):
        self.name = self.label = label
        self.started, self.announced = time.monotonic(), False

    def rename(self, label: str) -> None:
        self.label = label

    @property
    def seconds(self) -> float:
        return time.monotonic() - self.started
