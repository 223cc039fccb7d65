"""What a Compound costs beside its parts asked one by one, through the same interface with the same poses.

    python benchmarks/compounds.py               # about two minutes
    python benchmarks/compounds.py --quick       # fewer parts and poses

Compounds of random boxes against a box, and against each other (every part against every part), at poses of which about
half overlap ("near") or few do ("far"). Parts stand where the compound has them: their poses are multiplied out
beforehand. µs of the processor a pose; × is the parts' time by the compound's: at 1 it is the sum of the parts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cache, partial

import numpy as np
from inputs import poses

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, main

SPREAD = {"near": 0.8, "far": 3.0}
QUESTIONS: dict[str, Callable] = {
    "collide": collide.collide, "distance": collide.distance, "gap": partial(collide.distance, signed=False),
}
BOX = collide.Box((0.5, 0.5, 0.5))


@cache
def compound(parts: int, seed: int = 0) -> collide.Compound:
    rng = np.random.default_rng([parts, seed])
    return collide.Compound([(collide.Box(rng.uniform(0.2, 0.6, 3)), X) for X in poses(rng, parts, 0.7)])


def parts_of(shape) -> list[tuple]:
    return list(shape.items) if isinstance(shape, collide.Compound) else [(shape, np.eye(4))]


def pairs_of(A: collide.Compound, B, X_WA: np.ndarray, X_WB: np.ndarray) -> list[tuple]:
    """Every part of A against every part of B: (shape, shape, poses, poses)."""
    parts_a, parts_b = ([(shape, X @ X_SP) for shape, X_SP in parts_of(S)] for S, X in ((A, X_WA), (B, X_WB)))
    return [(shape_a, shape_b, X, Y) for (shape_a, X), (shape_b, Y) in itertools.product(parts_a, parts_b)]


def one_by_one(ask: Callable, pairs: list[tuple], **named) -> None:
    for pair in pairs:
        ask(*pair, **named)


def picked(rng, n: int, parts: int, X: np.ndarray, as_set: bool) -> tuple:
    """(compounds, one a pose of eight, and a box; the same, part by part): of a ShapeSet, or listed."""
    library, which = [compound(parts, seed) for seed in range(8)], rng.integers(0, 8, n)
    X_WPs = [np.array([x @ library[c].items[k][1] for x, c in zip(X, which)]) for k in range(parts)]
    if not as_set:
        whole = [library[c] for c in which], BOX
        return whole, [([library[c].items[k][0] for c in which], BOX, x) for k, x in enumerate(X_WPs)]
    shapes = collide.ShapeSet([*library, BOX, *(shape for S in library for shape, _ in S.items)])
    boxes = shapes[np.full(n, 8)]
    return (shapes[which], boxes), [(shapes[9 + parts * which + k], boxes, x) for k, x in enumerate(X_WPs)]


def measure(options: Options, interface: str, question: str, where: str, parts: int, batch: int) -> Race:
    rng, ask, A = np.random.default_rng(batch), QUESTIONS[question], compound(parts)
    n = 50 if interface == "single" else batch
    X, Y = poses(rng, n, SPREAD[where]), poses(rng, n, SPREAD[where])
    named = {"threads": 2} if interface == "threads=2" else {}
    if interface == "single":
        pairs = [pair for at in zip(X, Y) for pair in pairs_of(A, BOX, *at)]
        return Race({"compound": partial(one_by_one, ask, [(A, BOX, *at) for at in zip(X, Y)]),
                     "parts": partial(one_by_one, ask, pairs)}, n)
    if interface in ("ShapeSet", "list"):
        whole, each = picked(rng, n, parts, X, interface == "ShapeSet")
        whole, pairs = (*whole, X, Y), [(S, B, x, Y) for S, B, x in each]
    else:
        B = compound(parts, 1) if interface == "both" else BOX
        whole, pairs = (A, B, X, Y), pairs_of(A, B, X, Y)
    return Race({"compound": partial(ask, *whole, **named), "parts": partial(one_by_one, ask, pairs, **named)}, n)


def cases(options: Options):
    counts, sizes = ((2, 4), (1, 100)) if options.quick else ((1, 2, 4, 16, 64), (1, 10, 100, 1000, 10_000))
    yield from grid(interface=["single"], question=QUESTIONS, where=SPREAD, parts=counts, batch=[1])
    yield from grid(interface=["batch"], question=QUESTIONS, where=SPREAD, parts=counts, batch=sizes)
    several, n = ("both", "threads=2", "ShapeSet", "list"), 1000 if options.quick else 5000
    yield from grid(interface=several, question=QUESTIONS, where=SPREAD, parts=[4], batch=[n])


def notes(rows):
    ratios = np.array([1 / row["ratio"] for row in rows if row["engine"] == "parts"])
    yield f"a compound's time by its parts': median {np.median(ratios):.2f}, largest {ratios.max():.2f}, above 1.2: " \
          f"{int((ratios > 1.2).sum())}"


CLAIMS = [Claim("compounds", "µs a pose", cases, measure, turns=15, seconds=3.0, notes=notes)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
