"""Contestants that take turns, so that what else the machine does meets all of them; the clock around a call."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

Contestant = TypeVar("Contestant")
#: A call is repeated for so long at least [s], and so often at most: the mean of its repeats is its time.
SPAN, MAX_REPEATS = 50e-6, 100


class Seconds(float):
    """What a task gives that has measured itself, as one in another process does; NaN where its engine died."""


def turns(
    contestants: Sequence[Contestant], min_turns: int, max_turns: int, seconds: float
) -> Iterator[list[Contestant]]:
    """All contestants of each turn, the first one another each time, until time is up and `min_turns` are over."""
    started = time.perf_counter()
    for k in range(max_turns if contestants else 0):
        if k >= min_turns and time.perf_counter() - started > seconds:
            return
        first = k % len(contestants)
        yield [*contestants[first:], *contestants[:first]]


def mean_seconds(call: Any, repeats: int, clock: Callable[[], float] = time.process_time) -> float:
    """Time of some calls in a row, a call; NaN for none. By default the processor's: what else it does is not in it."""
    if call is None:
        return float("nan")
    started = clock()
    for _ in range(repeats):
        call()
    return (clock() - started) / repeats


def repeats_of(call: Any) -> int:
    """How often a call fits into `SPAN`, after one that fills caches."""
    if call is None:
        return 0
    call()
    return int(min(MAX_REPEATS, max(1.0, SPAN / max(mean_seconds(call, 1), 1e-9))))


def race(
    tasks: dict[str, Callable[[], Any]], *, clock: Callable[[], float] = time.process_time, min_turns: int = 3,
    max_turns: int = 9, seconds: float = 20.0,
) -> dict[str, list[float]]:
    """Seconds of every task's call, a turn each, after one that fills caches.

    tasks : name → a call; what gives `Seconds` is asked once a turn, and says itself how long that took.
    min_turns, max_turns : how many.   seconds : after how long no further turn begins.
    """
    taken: dict[str, list[float]] = {name: [] for name in tasks}
    asked = {name: isinstance(task(), Seconds) for name, task in tasks.items()}
    repeats = {name: 1 if itself else repeats_of(tasks[name]) for name, itself in asked.items()}
    gc.collect()
    gc.disable()  # collections would fall to whoever makes more results
    try:
        for names in turns(list(tasks), min_turns, max_turns, seconds):
            for name in names:
                task = tasks[name]
                taken[name].append(float(task()) if asked[name] else mean_seconds(task, repeats[name], clock))
    finally:
        gc.enable()
    return taken
