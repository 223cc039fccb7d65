"""Distances with derivatives beside distances alone, and beside coal with finite differences.

    python benchmarks/derivatives.py                     # microseconds a pair, by kinds and by share of overlaps
    python benchmarks/derivatives.py --table errors      # gradients beside differences of distances, by kinds

coal takes six one-sided differences along B's pose beside the distance, seven calls a pair; ours are of both poses.
"""

from __future__ import annotations

import numpy as np
from inputs import poses

import collide
from collide.adapters.bench.claims import Claim, Options, Race, main

_RNG = np.random.default_rng(5)
SHAPES = {
    "sphere": collide.Sphere(0.5),
    "capsule": collide.Capsule(0.3, 1.0),
    "box": collide.Box((1.0, 1.2, 1.4)),
    "hull": collide.ConvexHull(0.6 * _RNG.normal(size=(24, 3))),
    "cylinder": collide.Cylinder(0.5, 1.0),
    "ellipsoid": collide.Ellipsoid((0.4, 0.5, 0.7)),
    "mesh": collide.Mesh(*collide.tessellate(collide.Sphere(0.6), tolerance=0.01)),
}
PAIRS = (
    ("sphere", "capsule"), ("box", "sphere"), ("box", "box"), ("hull", "hull"), ("capsule", "hull"),
    ("box", "cylinder"), ("cylinder", "cylinder"), ("ellipsoid", "ellipsoid"), ("mesh", "box"),
)
#: Of the differences, rad and m.
_STEP = 1e-6


def placed(n: int, spread: float, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 4, 4) poses of A and of B, turned at random, shifted by up to a spread along each axis [m]."""
    rng = np.random.default_rng(seed)
    return poses(rng, n, 0.1), poses(rng, n, spread)


def cases(options: Options):
    for a, b in PAIRS:
        for spread in (0.5, 2.0):
            yield {"a": a, "b": b, "spread": spread}


def speed(options: Options, a: str, b: str, spread: float) -> Race:
    n = 100 if "mesh" in (a, b) else 2000
    A, B, (X_WA, X_WB) = SHAPES[a], SHAPES[b], placed(n, spread, 3)
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    tasks = {
        "with derivatives": lambda: collide.distance(A, B, X_WA, X_WB, derivatives=True),
        "distance alone": lambda: collide.distance(A, B, X_WA, X_WB),
    }
    if "mesh" not in (a, b):
        try:
            tasks["coal, differences"] = coal_differences(A, B, X_WA, X_WB)
        except ImportError:
            pass
    columns = {"hits": float(r.hit.mean()), "unique": float(r.unique.mean())}
    return Race(tasks, per=n, columns=columns)


def coal_differences(A, B, X_WA: np.ndarray, X_WB: np.ndarray):
    """A call that asks coal for the gradients by B's poses, of pairs whose matrices are made before."""
    import coal

    from collide.adapters.peers.coal_peer import CoalPeer

    peer = CoalPeer()
    a, b = peer.build(A), peer.build(B)
    changed = [X_WB] + [turned(X_WB, axis) for axis in range(6)]
    of_a = [coal.Transform3s(X[:3, :3], X[:3, 3]) for X in X_WA]
    of_b = [[coal.Transform3s(X[:3, :3], X[:3, 3]) for X in poses_b] for poses_b in changed]
    request, result = coal.DistanceRequest(), coal.DistanceResult()

    def ask() -> np.ndarray:
        d = np.empty((7, len(of_a)))
        for j, moved in enumerate(of_b):
            for k, (X_a, X_b) in enumerate(zip(of_a, moved)):
                result.clear()
                d[j, k] = coal.distance(a, X_a, b, X_b, request, result)
        return (d[1:] - d[0]) / _STEP

    return ask


def turned(X: np.ndarray, axis: int, step: float = _STEP) -> np.ndarray:
    """Poses turned about an axis of the world through their origins, or shifted along an axis."""
    out = X.copy()
    if axis >= 3:
        out[:, axis - 3, 3] += step
        return out
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(step)
    R[j, i], R[i, j] = np.sin(step), -np.sin(step)
    out[:, :3, :3] = R @ X[:, :3, :3]
    return out


def errors(options: Options, a: str, b: str, spread: float) -> list[dict]:
    """Of coal's differences and ours: the largest number of a gradient by B's pose that is off, by quantile."""
    n = 200 if options.quick else 2000
    A, B, (X_WA, X_WB) = SHAPES[a], SHAPES[b], placed(n, spread, 7)
    r = collide.distance(A, B, X_WA, X_WB, derivatives=True)
    h = 1e-4
    truth = np.stack(
        [
            (4.0 * central(A, B, X_WA, X_WB, axis, h) - central(A, B, X_WA, X_WB, axis, 2 * h)) / 3.0
            for axis in range(6)
        ]
    ).T
    row: dict = {"pairs": n, "hits": float(r.hit.mean()), "unique": float(r.unique.mean())}
    off = np.abs(r.d_distance_B - truth).max(axis=1)[r.unique]
    row |= {"median": np.median(off), "p90": np.quantile(off, 0.9), "p99": np.quantile(off, 0.99)}
    try:
        theirs = np.abs(coal_differences(A, B, X_WA, X_WB)().T - truth).max(axis=1)[r.unique]
    except (ImportError, TypeError):
        return [row]
    return [row | {"coal_median": np.median(theirs), "coal_p90": np.quantile(theirs, 0.9)}]


def central(A, B, X_WA: np.ndarray, X_WB: np.ndarray, axis: int, h: float) -> np.ndarray:
    low, high = (collide.distance(A, B, X_WA, turned(X_WB, axis, s * h)).distance for s in (-1, 1))
    return (high - low) / (2.0 * h)


CLAIMS = [
    Claim("derivatives", "distances with derivatives, in batches, microseconds a pair", cases, speed),
    Claim(
        "errors", "gradients by B's pose beside fourth-order differences of distances", cases, errors, asked_for=True,
        file="derivative-errors", everywhere=True,
    ),
]
if __name__ == "__main__":
    main(__doc__, CLAIMS)
