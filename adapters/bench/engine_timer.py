"""An engine timed in a process of its own, ours too: all have the same around them, and a crash costs one class.

The child makes every pair ready, then repeats them whenever the parent says that it is this engine's turn.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide.adapters.bench.child_contestant import InChild
from collide.adapters.bench.timed_calls import Pair, batch_call, timed_call
from collide.adapters.bench.turns import mean_seconds, repeats_of
from collide.adapters.peers.protocol import Peer, load_engine

#: Rows of a batch: the pairs over and over, where that takes no longer than so many seconds.
BATCH_ROWS, MAX_BATCH_SECONDS = 2000, 0.2
#: collide asked about all pairs at once; a setting of the timing, not of the engine.
BATCH = "collide:batch"


class EngineTimer:
    """One engine's child process, started when it is first asked, and anew after one that died.

    name, spec : the engine, and the ``module:class`` to load it from.
    groups : lists of pairs, those of each class that the engine has answered once already.
    timeout : of one turn through a group [s].
    """

    def __init__(self, name: str, spec: str, groups: list[list[Pair]], timeout: float):
        self.name, self._sizes = name, [len(group) for group in groups]
        self._child = InChild(_Turns, name, spec, groups, timeout=timeout)
        self.close = self._child.close

    @property
    def failures(self) -> dict[int, str]:
        """Group → how the child ended on it, "hang" or "abort"."""
        return {group: how for (_, (group,)), how in self._child.failures.items()}

    def seconds(self, group: int) -> np.ndarray:
        """(n,) seconds of a call for each pair of a group; NaN where it refuses, and for all once a child has died."""
        answer = self._child.call("seconds", group) if self._sizes[group] else None
        return np.full(self._sizes[group], np.nan) if answer is None else np.asarray(answer)


class _Turns:
    """The child: an engine, and a turn through a group of pairs for every question."""

    def __init__(self, name: str, spec: str, groups: list[list[Pair]]):
        self._ready, self._groups = _batch if name == BATCH else _singles, groups
        self._peer = load_engine(spec)
        self._peer.prepare()
        open_client(self._peer)
        self._made: dict[int, Callable[[], list[float]]] = {}

    def seconds(self, group: int) -> list[float]:
        if group not in self._made:
            self._made[group] = self._ready(self._peer, self._groups[group])
        return self._made[group]()


def _singles(peer: Peer, pairs: list[Pair]) -> Callable[[], list[float]]:
    """A turn through pairs, each asked by itself."""
    calls: list[Any] = []
    for pair in pairs:
        try:
            calls.append(timed_call(peer, pair))
        except Exception:  # noqa: BLE001 - whatever a binding throws costs this pair alone
            calls.append(None)
    repeats = [repeats_of(call) for call in calls]
    return lambda: [mean_seconds(call, count) for call, count in zip(calls, repeats)]


def _batch(peer: Peer, pairs: list[Pair]) -> Callable[[], list[float]]:
    """A turn of one call for all pairs, over and over where that is quick; each has the mean."""
    call, copies = batch_call(pairs), max(1, BATCH_ROWS // len(pairs))
    if mean_seconds(call, repeats_of(call)) * copies < MAX_BATCH_SECONDS:
        call = batch_call(pairs, copies)
    else:
        copies = 1
    repeats = repeats_of(call)
    return lambda: [mean_seconds(call, repeats) / (copies * len(pairs))] * len(pairs)


def open_client(peer: Peer) -> None:
    """pybullet asks a client, which its adapter opens for a question; here it stays open."""
    if peer.package == "pybullet":
        import pybullet

        peer._client = pybullet.connect(pybullet.DIRECT)  # type: ignore[attr-defined]
