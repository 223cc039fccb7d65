"""What a Compound costs beside its parts asked one by one, through the same interface with the same poses.

    python benchmarks/compounds.py               # about two minutes
    python benchmarks/compounds.py --quick       # fewer parts and poses

Compounds of random boxes against a box, and against each other (every part against every part), at poses of which about
half overlap ("near") or few do ("far"). Parts stand where the compound has them: their poses are multiplied out
beforehand. Both
are asked in turn, and the medians of their times compared: a ratio of 1 is the sum of the parts.
"""

from __future__ import annotations

import csv
import gc
import itertools
import statistics
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

import collide

ROOT = Path(__file__).resolve().parents[1]
REPEATS = 15
SPREAD = {"near": 0.8, "far": 3.0}
QUESTIONS = {
    "collide": collide.collide,
    "distance": collide.distance,
    "gap": lambda *asked, **named: collide.distance(*asked, signed=False, **named),
}
HEADER = ["interface", "question", "poses", "parts", "batch", "compound_us", "parts_us", "ratio"]


def random_poses(rng, n: int, spread: float) -> np.ndarray:
    return np.array([collide.pose(rng.uniform(-spread, spread, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(n)])


def compound(rng, parts: int) -> collide.Compound:
    return collide.Compound(
        [(collide.Box(rng.uniform(0.2, 0.6, 3)), random_poses(rng, 1, 0.7)[0]) for _ in range(parts)]
    )


def compared(whole, parts, poses: int) -> list[str]:
    """[µs a pose of the compound, of its parts, their ratio], asked in turn."""
    times: tuple[list[float], list[float]] = ([], [])
    gc.disable()  # as `timeit` does: collections would fall to whoever makes more results
    for _ in range(REPEATS + 1):
        for question, taken in zip((whole, parts), times):
            started = time.perf_counter()
            question()
            taken.append((time.perf_counter() - started) / poses * 1e6)
    gc.enable()
    median_a, median_b = (statistics.median(taken[1:]) for taken in times)
    return [f"{median_a:.3f}", f"{median_b:.3f}", f"{median_a / median_b:.2f}"]


def pairs_of(A: collide.Compound, B, X_WA: np.ndarray, X_WB: np.ndarray) -> list[tuple]:
    """Every part of A against every part of B: (shape, shape, poses, poses)."""
    parts_a, parts_b = ([(shape, X @ X_SP) for shape, X_SP in parts_of(S)] for S, X in ((A, X_WA), (B, X_WB)))
    return [(shape_a, shape_b, X, Y) for (shape_a, X), (shape_b, Y) in itertools.product(parts_a, parts_b)]


def parts_of(shape) -> list[tuple]:
    return list(shape.items) if isinstance(shape, collide.Compound) else [(shape, np.eye(4))]


def one_by_one(ask, pairs: list[tuple], **named) -> None:
    for pair in pairs:
        ask(*pair, **named)


def batches(rng, counts, sizes):
    box = collide.Box((0.5, 0.5, 0.5))
    for parts, (name, spread) in itertools.product(counts, SPREAD.items()):
        A = compound(rng, parts)
        for n in sizes:
            X = random_poses(rng, n, spread), random_poses(rng, n, spread)
            pairs = pairs_of(A, box, *X)
            for what, ask in QUESTIONS.items():
                yield [
                    "batch",
                    what,
                    name,
                    parts,
                    n,
                    *compared(partial(ask, A, box, *X), partial(one_by_one, ask, pairs), n),
                ]


def singles(rng, counts, n: int):
    box = collide.Box((0.5, 0.5, 0.5))
    for parts, (name, spread) in itertools.product(counts, SPREAD.items()):
        A = compound(rng, parts)
        asked = list(zip(random_poses(rng, n, spread), random_poses(rng, n, spread)))
        whole = [(A, box, *X) for X in asked]
        pairs = [pair for X in asked for pair in pairs_of(A, box, *X)]
        for what, ask in QUESTIONS.items():
            measured = compared(partial(one_by_one, ask, whole), partial(one_by_one, ask, pairs), n)
            yield ["single", what, name, parts, 1, *measured]


def others(rng, parts: int, n: int):
    """Compound against Compound, two threads, a ShapeSet, a list."""
    box, A, B = collide.Box((0.5, 0.5, 0.5)), compound(rng, parts), compound(rng, parts)
    library = [compound(rng, parts) for _ in range(8)]
    corners = rng.integers(0, 8, n)
    shapes = collide.ShapeSet([*library, box, *(shape for S in library for shape, _ in S.items)])
    boxes = shapes[np.full(n, len(library))]
    for name, spread in SPREAD.items():
        X_WA, X_WB = random_poses(rng, n, spread), random_poses(rng, n, spread)
        X_WPs = [np.array([X @ library[c].items[k][1] for X, c in zip(X_WA, corners)]) for k in range(parts)]
        picked = [(shapes[len(library) + 1 + parts * corners + k], boxes, X, X_WB) for k, X in enumerate(X_WPs)]
        listed = [([library[c].items[k][0] for c in corners], box, X, X_WB) for k, X in enumerate(X_WPs)]
        cases = {
            "both": ((A, B, X_WA, X_WB), pairs_of(A, B, X_WA, X_WB), {}),
            "threads=2": ((A, box, X_WA, X_WB), pairs_of(A, box, X_WA, X_WB), {"threads": 2}),
            "ShapeSet": ((shapes[corners], boxes, X_WA, X_WB), picked, {}),
            "list": (([library[c] for c in corners], box, X_WA, X_WB), listed, {}),
        }
        for (interface, (whole, pairs, named)), (what, ask) in itertools.product(cases.items(), QUESTIONS.items()):
            measured = compared(partial(ask, *whole, **named), partial(one_by_one, ask, pairs, **named), n)
            yield [interface, what, name, parts, n, *measured]


def main(quick: bool) -> None:
    rng = np.random.default_rng(0)
    counts = (2, 4) if quick else (1, 2, 4, 16, 64)
    measured = [HEADER]
    print("  ".join(f"{cell:>11}" for cell in HEADER))
    for row in itertools.chain(
        singles(rng, counts, 50), batches(rng, counts, (1, 10, 100) if quick else (1, 10, 100, 1000, 10000)),
        others(rng, 4, 1000 if quick else 5000),
    ):  # fmt: skip
        measured.append([str(cell) for cell in row])
        print("  ".join(f"{cell:>11}" for cell in measured[-1]), flush=True)
    ratios = np.array([float(row[-1]) for row in measured[1:]])
    print(
        f"\nmedian ratio {np.median(ratios):.2f}, largest {ratios.max():.2f}, above 1.2: {int((ratios > 1.2).sum())} "
        f"of {len(ratios)}"
    )
    target = ROOT / "benchmarks" / "results" / "compounds.csv"
    target.parent.mkdir(exist_ok=True)
    with target.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(measured)


if __name__ == "__main__":
    main("--quick" in sys.argv[1:])
