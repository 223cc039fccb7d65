"""Limits of long work on solids: memory, time, and progress told on the way.

Nothing is written to files and no thread is started, so that work stopped half-way, by a limit, an interrupt or an
error raised in `progress`, leaves nothing behind: shapes keep finished results alone.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack
from typing import TypeVar

from collide.errors import InvalidArgument, UnsupportedQuery, brief

#: Bytes of a meeting pair of facets during exact cuts, with its share of points, segments and triangles; measured by
#: `python benchmarks/combined_solids.py --only memory`.
BYTES_PER_PAIR = 1000
#: The same of a pair of segments in the plane.
BYTES_PER_CROSSING = 500
#: Seconds between two reports.
_REPORTS = 0.5
_Item = TypeVar("_Item")


class Limits:
    """Limits of a piece of work.   with Limits(…) as limits: …

    caller : the function's name, for messages.
    progress : called with a label, returns a context manager of a function that changes the label; or ``None``.
    time_limit : seconds, ``None`` for no limit.   memory : bytes, ``None`` for no limit.
    """

    def __init__(self, caller: str, progress=None, time_limit: float | None = None, memory: int | None = None):
        for name, value in (("time_limit", time_limit), ("memory", memory)):
            if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float)) or not value > 0):
                raise InvalidArgument(f"{caller}: {name} must be a positive number or None, got {brief(value)}")
        if progress is not None and not callable(progress):
            raise InvalidArgument(f"{caller}: progress must be called with a label, got {brief(progress)}")
        self.caller, self.progress, self.time_limit, self.memory = caller, progress, time_limit, memory
        self._rename: Callable[[str], object] | None = None
        self._stack = ExitStack()
        self._start = self._reported = time.monotonic()

    def __enter__(self) -> Limits:  # noqa: PYI034 - typing.Self is of Python 3.11
        self._start = self._reported = time.monotonic()
        if self.progress is not None:
            self._rename = self._stack.enter_context(self.progress(self.caller))
        return self

    def __exit__(self, *error) -> None:
        self._stack.__exit__(*error)

    def stage(self, label: str) -> None:
        """A new part of the work begins."""
        self._check_time(label, 0, 0)
        if self._rename is not None:
            self._rename(f"{self.caller}: {label}")

    def watched(self, label: str, items: Collection[_Item]) -> Iterator[_Item]:
        """The items in order; between items the time limit is checked and the share done is reported."""
        self.stage(label)
        began = time.monotonic()
        for done, item in enumerate(items):
            now = time.monotonic()
            if self.time_limit is not None and now - self._start > self.time_limit:
                self._check_time(label, done, len(items), began)
            if self._rename is not None and now - self._reported > _REPORTS:
                self._reported = now
                self._rename(f"{self.caller}: {label}, {100 * done // len(items)} %")
            yield item

    def check_memory(self, bytes_needed: int, of: str) -> None:
        """Refuse work that would take more."""
        if self.memory is not None and bytes_needed > self.memory:
            raise UnsupportedQuery(
                f"{self.caller}: {of} would take about {bytes_needed:,} bytes, more than memory={self.memory:,}; "
                "raise it, or ask of coarser solids"
            )

    def _check_time(self, label: str, done: int, total: int, began: float | None = None) -> None:
        now = time.monotonic()
        if self.time_limit is None or now - self._start <= self.time_limit:
            return
        status = ""
        if done and began is not None:
            status = f" ({done} of {total}: this part would take about {(now - began) * total / done:.3g} s)"
        raise UnsupportedQuery(
            f"{self.caller}: not done after time_limit={self.time_limit:g} s, while {label}{status}; raise it, "
            "or ask of coarser solids"
        )


#: No limit, and nothing told.
UNLIMITED = Limits("solids")
