"""Batches of mesh pairs beside coal's loop: what a call and a pose cost, from 1 pose to 12,000.

    python benchmarks/mesh_batches.py            # some minutes; prints a table and writes results/mesh_batches_*.csv
    python benchmarks/mesh_batches.py --quick    # fewer repeats, no file

A torus of 2304 facets against itself, a box and a sphere; poses far apart (none within the limit), mixed or near (some
overlap, some are a little apart). Asked are booleans, and gaps no farther than a limit of a hundredth of the size.
coal (OBBRSS) is asked in a loop over transforms and requests made beforehand. Both take turns; compared are medians.
"""

from __future__ import annotations

import csv
import gc
import os
import platform
import statistics
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

import collide
from collide.adapters.peers.coal_peer import CoalPeer

RESULTS = Path(__file__).resolve().parent / "results"
SIZES = (1, 12, 120, 1200, 12000)
#: Distances of the bodies' middles, in radii of the torus.
SPREADS = {"far": (4.0, 40.0), "mixed": (1.0, 8.0), "near": (0.5, 2.0)}
LIMIT = 0.02
HEADER = ["pair", "question", "poses", "n", "collide_us", "coal_us", "ratio", "collide_us_a_pose", "hits"]


def torus(major: float = 0.7, minor: float = 0.3, n: int = 48, m: int = 24) -> collide.Mesh:
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring = major + minor * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), minor * np.sin(v)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m), indexing="ij")
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = (i + 1) % n * m + (j + 1) % m, i * m + (j + 1) % m
    faces = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    return collide.Mesh(vertices, faces)


def poses(rng: np.random.Generator, n: int, spread: tuple[float, float]) -> np.ndarray:
    """(n, 4, 4) random rotations, at distances from the origin within the spread."""
    q = rng.normal(size=(n, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    X = np.tile(np.eye(4), (n, 1, 1))
    X[:, 0, :3] = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    X[:, 1, :3] = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    X[:, 2, :3] = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1)
    way = rng.normal(size=(n, 3))
    X[:, :3, 3] = way / np.linalg.norm(way, axis=1)[:, None] * rng.uniform(*spread, (n, 1))
    return X


class Coal:
    """The same pair as coal knows it, at poses made ready."""

    def __init__(self, A: collide.Mesh, B: collide.Shape, X_WA: np.ndarray, X_WB: np.ndarray):
        import coal

        peer = CoalPeer()
        self._coal, self._A, self._B = coal, peer.build(A), peer.build(B)
        self._poses = [tuple(coal.Transform3s(X[:3, :3], X[:3, 3]) for X in pair) for pair in zip(X_WA, X_WB)]

    def ask(self, question: str) -> None:
        coal, A, B = self._coal, self._A, self._B
        request = coal.CollisionRequest()
        request.break_distance, request.enable_contact, request.num_max_contacts = 0.0, False, 1
        if question == "distance":  # as far as the limit: a security margin that no pair of facets within it escapes
            request.security_margin = LIMIT
        for X_WA, X_WB in self._poses:
            coal.collide(A, X_WA, B, X_WB, request, coal.CollisionResult())


def medians(repeats: int, *asks) -> list[float]:
    """Median seconds of questions asked in turn."""
    times: list[list[float]] = [[] for _ in asks]
    gc.disable()
    for _ in range(repeats + 1):
        for ask, taken in zip(asks, times):
            started = time.perf_counter()
            ask()
            taken.append(time.perf_counter() - started)
    gc.enable()
    return [statistics.median(taken[1:]) for taken in times]


def main() -> None:
    quick = "--quick" in sys.argv
    mesh = torus()
    partners = {"torus": mesh, "box": collide.Box((1, 1, 1)), "sphere": collide.Sphere(0.6)}
    rows = []
    print("  ".join(f"{name:>17}" for name in HEADER))
    for name, partner in partners.items():
        for kind, spread in SPREADS.items():
            for n in SIZES:
                rng = np.random.default_rng(n)
                X_WA, X_WB = poses(rng, n, (0.0, 0.0)), poses(rng, n, spread)
                peer = Coal(mesh, partner, X_WA, X_WB)
                pair = mesh, partner, X_WA, X_WB
                questions = {
                    "boolean": partial(collide.collide, *pair),
                    "distance": partial(collide.distance, *pair, max_distance=LIMIT, signed=False),
                }
                for question, ask in questions.items():
                    repeats = max(5, (40 if quick else 400) // (1 + n // 30))
                    ours, theirs = medians(repeats, ask, partial(peer.ask, question))
                    hits = int(np.count_nonzero(collide.collide(*pair)))
                    row = [name, question, kind, n, ours * 1e6, theirs * 1e6, theirs / ours, ours * 1e6 / n, hits]
                    rows.append([f"{value:.3f}" if isinstance(value, float) else value for value in row])
                    print("  ".join(f"{value:>17}" for value in rows[-1]), flush=True)
    if not quick:
        cpu = platform.processor() or platform.machine()
        file = RESULTS / f"mesh_batches_{cpu}_{len(os.sched_getaffinity(0))}.csv"
        with file.open("w", newline="", encoding="utf-8") as out:
            csv.writer(out).writerows([HEADER, *rows])


if __name__ == "__main__":
    main()
