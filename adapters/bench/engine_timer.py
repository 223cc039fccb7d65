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
    """One engine's child process, ready with the pairs of one class.

    Parameters
    ----------
    name, spec : str
        The engine, and the ``module:class`` to load it from.
    pairs : list of (A, B, X_WA, X_WB)
        Those that it has answered once already.
    timeout : float
        Of one turn through all pairs, and of making them ready [s].
    """

    def __init__(self, name: str, spec: str, pairs: list[Pair], timeout: float):
        self.name, self.failure, self._n, self._timeout = name, "", len(pairs), timeout
        context = multiprocessing.get_context("spawn")
        self._pipe, child_end = context.Pipe()
        # Through a file: a pipe that is full would hold this process up for as long as a child does not read.
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / "pairs"
            place.write_bytes(pickle.dumps(pairs))
            self._process = context.Process(target=_child, args=(child_end, name, spec, str(place)), daemon=True)
            self._process.start()
            child_end.close()
            self._receive(START_TIMEOUT + timeout)

    def seconds(self) -> np.ndarray:
        """(n,) seconds of a call for each pair; NaN where it refuses, and for all once the child is dead or hangs."""
        if not self.failure:
            try:
                self._pipe.send("go")
            except OSError:
                pass
        taken = None if self.failure else self._receive(self._timeout)
        return np.full(self._n, np.nan) if taken is None else np.asarray(taken)

    def _receive(self, timeout: float) -> Any:
        try:
            if self._pipe.poll(timeout):
                return self._pipe.recv()
            self.failure = "hang"
        except (EOFError, OSError):
            self.failure = "abort"
        self.close()
        return None

    def close(self) -> None:
        """End the child."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def _child(pipe: Any, name: str, spec: str, place: str) -> None:
    """Make the pairs ready, then a turn through all of them for every word that comes down the pipe."""
    sys.stdout.flush()
    for stream in (1, 2):  # some engines print when they are imported
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    peer = load_engine(spec)
    peer.prepare()
    open_client(peer)
    pairs = pickle.loads(Path(place).read_bytes())
    calls: list[Any] = []
    for pair in pairs:
        try:
            calls.append(timed_call(peer, pair))
        except Exception:  # noqa: BLE001 - whatever a binding throws costs this pair alone
            calls.append(None)
    rows = len(pairs)
    if name == BATCH:
        calls = [batch_call(pairs)]
        copies = max(1, BATCH_ROWS // rows)
        if copies > 1 and mean_seconds(calls[0], _repeats(calls[0])) * copies < MAX_BATCH_SECONDS:
            calls, rows = [batch_call(pairs, copies)], rows * copies
    repeats = [_repeats(call) for call in calls]
    pipe.send("ready")
    while True:
        try:
            pipe.recv()
        except EOFError:
            return
        taken = [mean_seconds(call, count) for call, count in zip(calls, repeats)]
        pipe.send([taken[0] / rows] * len(pairs) if name == BATCH else taken)


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
