"""Work in pieces, done by several threads: the caller's own and others that are kept."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import lru_cache
from typing import Any

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument

#: The most threads that may be asked for: what fits in 32 bits. Where the system has fewer, fewer are started.
_MAX_INT = 2**31 - 1
#: Work whose length is not known is begun by the caller alone, and shared only if this much of it remains [s].
_ALONE = 50e-3
#: It is then shared in pieces that last between these two [s]: handing over a piece costs about a millisecond.
_SHORTEST, _LONGEST = 20e-3, 100e-3
#: Threads waiting for each other, for example for Python's lock, are no faster than a single thread, and cost more.
#: Helpers stop unless all threads together get this many times the processor time of a single thread.
_GAIN = 1.3


def check_threads(threads) -> int:
    """A number of threads, as an integer. Raises InvalidArgument."""
    number = checks.integer("threads", threads, 1)
    if number > _MAX_INT:
        raise InvalidArgument(
            f"threads must be an integer from 1 to {_MAX_INT}, got {checks.brief(number)}; more than there are "
            "processors cannot help"
        )
    return number


def share(pieces: Iterable, work: Callable[[Any], None], workers: int) -> None:
    """Work on every piece in ``workers`` threads; returns when no thread works on a piece any more.

    An error of a piece is raised, and pieces not begun are left.
    """
    waiting = iter(pieces)

    def go_on() -> None:
        for piece in waiting:  # a thread takes the next as it becomes free: pieces do not all cost the same
            work(piece)

    def leave() -> None:
        for _ in waiting:
            pass

    _in_threads(go_on, go_on, leave, workers)


def answers_in_order(pieces: Sequence, work: Callable[[Any], Any], workers: int) -> list:
    """What ``work`` returns for every piece, in the pieces' order; in ``workers`` threads, as `share`."""
    if workers < 2 or len(pieces) < 2:
        return [work(piece) for piece in pieces]
    answers: list[Any] = [None] * len(pieces)

    def answer(number: int) -> None:
        answers[number] = work(pieces[number])

    share(range(len(pieces)), answer, workers)
    return answers


def share_if_it_helps(n: int, work: Callable[[slice], None], workers: int) -> None:
    """As `share` of n > 0 units, where their duration is unknown, and whether threads can work at once.

    The caller begins alone, with a sixteenth, and goes on alone if little is left. A helper mostly waiting
    for the processor leaves the rest to the others; without helpers the caller takes the whole rest at once.
    """
    rest = _Rest(n)
    start = time.perf_counter()
    work(rest.take(-(-n // 16)))  # type: ignore[arg-type]
    pace = max(time.perf_counter() - start, 1e-9) / (n - rest.remaining)
    if pace * rest.remaining < _ALONE:
        if rest.remaining:
            work(rest.take(rest.remaining))  # type: ignore[arg-type]
        return
    rest.helpers = workers - 1

    def help_out() -> None:
        wall, busy = time.perf_counter(), time.thread_time()
        try:
            while (piece := rest.share(pace, workers)) is not None:
                work(piece)
                if (time.thread_time() - busy) * workers < _GAIN * (time.perf_counter() - wall):
                    return
        finally:
            rest.helpers -= 1

    def go_on() -> None:
        while (piece := rest.share(pace, workers)) is not None:
            work(piece)

    _in_threads(help_out, go_on, rest.drop, workers)


class _Rest:
    """What is left of n units, handed out from the front."""

    def __init__(self, n: int):
        self.remaining, self._n, self._lock = n, n, threading.Lock()
        self.helpers = 0

    def take(self, n_wanted: int) -> slice | None:
        """The next ``n_wanted`` units, or the rest if fewer; ``None`` without units left."""
        with self._lock:
            if not self.remaining:
                return None
            first = self._n - self.remaining
            self.remaining -= min(n_wanted, self.remaining)
            return slice(first, self._n - self.remaining)

    def share(self, pace: float, workers: int) -> slice | None:
        """The next piece for one of so many threads: ever smaller ones, where a unit takes ``pace`` seconds."""
        if not self.helpers:
            return self.take(self._n)
        fair = self.remaining // (2 * workers)
        return self.take(max(int(min(max(fair, _SHORTEST / pace), _LONGEST / pace)), 1))

    def drop(self) -> None:
        """Hand out no more."""
        self.take(self._n)


def _in_threads(
    help_out: Callable[[], None], own_work: Callable[[], Any], leave: Callable[[], None], workers: int
) -> None:
    """Run ``own_work`` here and ``help_out`` in workers − 1 threads; ``leave`` makes all of them come to their end."""
    at_work: list[Future] = []
    try:
        try:
            at_work.extend(_pool(workers - 1).submit(help_out) for _ in range(workers - 1))
        except RuntimeError:  # no more threads are to be had, or Python is ending: this one does what is left
            pass
        own_work()
        for helper in at_work:
            helper.result()
    finally:  # after an error as well nobody writes into the caller's arrays any more
        leave()
        wait(at_work)


def pieces_of(n: int, workers: int, fewest: int) -> list[slice]:
    """The pieces of n units, handed out in order: shrinking shares of the rest, at least ``fewest`` units each.

    A piece costs some 30 µs beside its answers. Large pieces first, for few pieces; small pieces last, so that no
    thread waits long for the others, though a core may be somebody else's now and then.
    """
    pieces, done = [], 0
    while done < n:
        remaining = n - done
        max_pieces = max(remaining // fewest, 1)  # so many pieces can be made of it
        share = -(-remaining // max_pieces) if max_pieces <= workers else max(remaining // (2 * workers), fewest)
        pieces.append(slice(done, done + share))
        done += share
    return pieces


@lru_cache(maxsize=4)
def _pool(workers: int) -> ThreadPoolExecutor:
    """Threads are kept, and their workspaces with them."""
    return ThreadPoolExecutor(workers, thread_name_prefix="collide")


if hasattr(os, "register_at_fork"):  # a forked child has none of its parent's threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
