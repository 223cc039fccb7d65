"""An engine timed in a process of its own, ours too: all have the same around them, and a crash costs one class.

The child makes every pair ready, then repeats them whenever the parent says that it is this engine's turn.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from collide.adapters.bench.timed_calls import Pair, batch_call, timed_call
from collide.adapters.peers.protocol import Peer, load_engine

#: A pair is repeated for so long at least, and the mean of its repeats is its time [s].
SPAN = 50e-6
#: How long an engine may take to be imported [s].
START_TIMEOUT = 60.0
#: More repeats than this the clock does not need.
MAX_REPEATS = 100
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
        self.name, self._spec, self._groups, self._timeout = name, spec, groups, timeout
        #: Group → how the child ended on it, "hang" or "abort".
        self.failures: dict[int, str] = {}
        self._process: Any = None
        self._pipe: Any = None

    def seconds(self, group: int) -> np.ndarray:
        """(n,) seconds of a call for each pair of a group; NaN where it refuses, and for all once a child has died."""
        n = len(self._groups[group])
        if group in self.failures or not n:
            return np.full(n, np.nan)
        limit = self._timeout
        if self._process is None:
            self._start()
            limit += START_TIMEOUT
        try:
            self._pipe.send(group)
            if self._pipe.poll(limit):
                return np.asarray(self._pipe.recv())
            self.failures[group] = "hang"
        except (EOFError, OSError):
            self.failures[group] = "abort"
        self.close()
        return np.full(n, np.nan)

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, child_end = context.Pipe()
        # Through a file: a pipe that is full would hold this process up for as long as a child does not read.
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "pairs"
            place.write_bytes(pickle.dumps(self._groups))
            arguments = child_end, self.name, self._spec, str(place)
            self._process = context.Process(target=_child, args=arguments, daemon=True)
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


def _child(pipe: Any, name: str, spec: str, place: str) -> None:
    """Load the engine and the pairs, then a turn through a group for every number that comes down the pipe."""
    sys.stdout.flush()
    for stream in (1, 2):  # some engines print when they are imported
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    groups = pickle.loads(Path(place).read_bytes())
    pipe.send("read")
    peer = load_engine(spec)
    peer.prepare()
    open_client(peer)
    ready: dict[int, Callable[[], list[float]]] = {}
    while True:
        try:
            group = pipe.recv()
        except EOFError:
            return
        if group not in ready:
            ready[group] = (_batch if name == BATCH else _singles)(peer, groups[group])
        pipe.send(ready[group]())


def _singles(peer: Peer, pairs: list[Pair]) -> Callable[[], list[float]]:
    """A turn through pairs, each asked by itself."""
    calls: list[Any] = []
    for pair in pairs:
        try:
            calls.append(timed_call(peer, pair))
        except Exception:  # noqa: BLE001 - whatever a binding throws costs this pair alone
            calls.append(None)
    repeats = [_repeats(call) for call in calls]
    return lambda: [mean_seconds(call, count) for call, count in zip(calls, repeats)]


def _batch(peer: Peer, pairs: list[Pair]) -> Callable[[], list[float]]:
    """A turn of one call for all pairs, over and over where that is quick; each has the mean."""
    call, copies = batch_call(pairs), max(1, BATCH_ROWS // len(pairs))
    if mean_seconds(call, _repeats(call)) * copies < MAX_BATCH_SECONDS:
        call = batch_call(pairs, copies)
    else:
        copies = 1
    repeats = _repeats(call)
    return lambda: [mean_seconds(call, repeats) / (copies * len(pairs))] * len(pairs)


def open_client(peer: Peer) -> None:
    """pybullet asks a client, which its adapter opens for a question; here it stays open."""
    if peer.package == "pybullet":
        import pybullet

        peer._client = pybullet.connect(pybullet.DIRECT)  # type: ignore[attr-defined]


def _repeats(call: Any) -> int:
    """How often a call fits into `SPAN`, after one that fills caches."""
    if call is None:
        return 0
    call()
    return int(min(MAX_REPEATS, max(1.0, SPAN / max(mean_seconds(call, 1), 1e-9))))


def mean_seconds(call: Any, repeats: int) -> float:
    """CPU time of some calls in a row, a call; NaN for none. What else the machine does is not in it."""
    if call is None:
        return float("nan")
    started = time.process_time()
    for _ in range(repeats):
        call()
    return (time.process_time() - started) / repeats
