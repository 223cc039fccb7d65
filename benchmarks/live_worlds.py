"""How long readers of a World wait while another thread exchanges a cloud of 10⁵ points again and again.

    python benchmarks/live_worlds.py             # half a minute

Readers ask what is near a box. "wait" is what a question takes until it has tables to read, "question" all of it; ms.
"""

from __future__ import annotations

import threading
import time

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, grid, main

_POINTS, _SECONDS = 100_000, 3.0


def scans(n: int) -> list[np.ndarray]:
    """The walls of a room, n times, each with noise of its own."""
    rng = np.random.default_rng(0)
    d = rng.normal(size=(_POINTS, 3))
    walls = 3.0 * d / np.abs(d).max(axis=1)[:, None]
    return [walls + rng.normal(0.0, 0.003, walls.shape) for _ in range(n)]


class _World(collide.World):
    """Notes how long questions wait."""

    delays: list[float]

    def _pack(self):
        started = time.perf_counter()
        packed = super()._pack()
        self.delays.append(time.perf_counter() - started)
        return packed


def asked(world: _World, seen: list[np.ndarray], n_readers: int) -> dict[str, float]:
    """What readers and the writer took, ms."""
    questions, writes, ended = [], [], threading.Event()
    tool, X_WT = collide.Box((0.1, 0.1, 0.3)), collide.pose((0.5, 0.2, 2.9))

    def read() -> None:
        while not ended.is_set():
            started = time.perf_counter()
            world.query(tool, X_WT, 0.05)
            questions.append(time.perf_counter() - started)

    readers = [threading.Thread(target=read) for _ in range(n_readers)]
    for reader in readers:
        reader.start()
    time.sleep(0.2)
    world.delays.clear()
    end = time.monotonic() + _SECONDS
    while time.monotonic() < end:
        started = time.perf_counter()
        world.replace("scan", collide.PointCloud(seen[len(writes) % len(seen)], 0.01))
        writes.append(time.perf_counter() - started)
        time.sleep(0.01)
    ended.set()
    for reader in readers:
        reader.join()
    delays, taken, written = (1e3 * np.sort(times) for times in (world.delays, questions, writes))
    return {
        "questions": len(delays), "wait_ms": float(np.median(delays)), "longest_wait_ms": float(delays[-1]),
        "question_ms": float(np.median(taken)), "replaced": len(written), "replace_ms": float(np.median(written)),
    }


def asked_meanwhile(_options, boxes: int, readers: int) -> list[dict[str, float]]:
    """Readers of a World of a cloud and boxes."""
    seen, rng, world = scans(4), np.random.default_rng(1), _World()
    world.delays = []
    world.add(collide.PointCloud(seen[0], 0.01), name="scan")
    for _ in range(boxes):
        world.add(collide.Box(rng.uniform(0.05, 0.2, 3)), collide.pose(rng.uniform(-2.5, 2.5, 3)))
    return [asked(world, seen, readers)]


CLAIMS = [
    Claim("waits", "how long readers wait while a cloud is exchanged", lambda o: grid(boxes=(30, 3000), readers=(1, 4)),
          asked_meanwhile, file="live-worlds"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
