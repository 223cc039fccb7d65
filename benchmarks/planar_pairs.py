"""Convex polygons in the plane beside shapely (prepared), Box2D and our own flat hulls; rounds to 10⁶ corners.

    python benchmarks/planar_pairs.py            # two minutes; pip install shapely box2d, what is missing is left out
    python benchmarks/planar_pairs.py --quick    # a look, no CSV

Round polygons of n corners each in random poses: "random", their origins 1.2 to 2.6 radii apart; "near", within 1 % of
touching; "touching", a corner on a corner in numbers that need no rounding, in a third of the pairs one unit in the
last place apart. One polygon against itself in all poses of a batch, one thread each; µs of the processor a pair.

shapely has no poses: A is prepared and stays where it is, and "placed" has B's corners moved ahead of time, which is
not counted; "shapely" moves them and makes the polygons in its time. Box2D takes up to 16 corners, one call a pair, in
single precision, and a skin of 0.01 around every polygon. "flat hull" is `collide.collide` of hulls at z = 0. "wrong"
counts answers unlike ours, each of which was proven by a certificate that was checked in fractions.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

import collide
from collide.adapters.bench.claims import Claim, Options, Race, check, grid, installed, main
from collide.polytopes import planar_pose, polygon_distance, polygons_meet, verify_polygons

PAIRS = ("random", "near", "touching")


def round_polygon(n: int, rng: np.random.Generator) -> np.ndarray:
    """n corners on the unit circle, counter-clockwise, in multiples of 2⁻⁴⁶."""
    angles = 2 * np.pi * (np.arange(n) + rng.uniform(0.1, 0.9, n)) / n
    return np.round(np.c_[np.cos(angles), np.sin(angles)] * 2.0**46) * 2.0**-46


def poses(kind: str, corners: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Poses of B (count, 3, 3); A's is the unit matrix."""
    if kind == "touching":  # B is A's mirror image: corner k of both in one place
        X = np.tile(np.eye(3), (count, 1, 1))
        rows = np.argsort(corners[:, 0])[-max(len(corners) // 8, 1) :]
        X[:, :2, 2] = 2 * corners[rng.choice(rows, count)]
        X[: count // 3, 0, 2] = np.nextafter(X[: count // 3, 0, 2], np.inf)
        return X
    angle, around = rng.uniform(0, 2 * np.pi, (2, count))
    far = rng.uniform(1.2, 2.6, count) if kind == "random" else rng.uniform(1.98, 2.02, count)
    return np.array([planar_pose((r * np.cos(a), r * np.sin(a)), t) for r, a, t in zip(far, around, angle)])


def in_space(X: np.ndarray) -> np.ndarray:
    full = np.tile(np.eye(4), (len(X), 1, 1))
    full[:, :2, :2], full[:, :2, 3] = X[:, :2, :2], X[:, :2, 2]
    return full


def shapely_tasks(A: np.ndarray, B: np.ndarray, X: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    import shapely

    prepared = shapely.Polygon(A)
    shapely.prepare(prepared)

    def placed():
        return shapely.polygons(np.einsum("nij,kj->nki", X[:, :2, :2], B) + X[:, None, :2, 2])

    ready = placed()
    return {
        "shapely, placed": lambda: shapely.intersects(prepared, ready),
        "shapely": lambda: shapely.intersects(prepared, placed()),
    }


def box2d_tasks(A: np.ndarray, B: np.ndarray, X: np.ndarray) -> dict[str, Callable[[], np.ndarray]]:
    import Box2D

    shapes = [Box2D.b2PolygonShape(vertices=corners.tolist()) for corners in (A, B)]
    here = Box2D.b2Transform()
    here.Set((0, 0), 0)
    places = []
    for R, t in zip(X[:, :2, :2], X[:, :2, 2]):
        there = Box2D.b2Transform()
        there.Set(t.tolist(), float(np.arctan2(R[1, 0], R[0, 0])))
        places.append(there)
    overlap = Box2D.b2TestOverlap
    return {"Box2D": lambda: np.array([overlap(shapes[0], 0, shapes[1], 0, here, there) for there in places])}


def compared(options: Options, corners: int, pairs: str) -> Race:
    """All contestants on the same pairs."""
    count = max((2000 if options.quick else 20_000) // max(corners // 64, 1), 200)
    rng = np.random.default_rng(corners)
    outline = round_polygon(corners, rng)
    A, B = collide.ConvexPolygon(outline), collide.ConvexPolygon(-outline if pairs == "touching" else outline)
    X = poses(pairs, outline, count, rng)
    hulls = [collide.ConvexHull(np.c_[p.vertices, np.zeros(len(p.vertices))]) for p in (A, B)]
    spatial = in_space(X)
    tasks: dict[str, Callable[[], np.ndarray]] = {
        "collide": lambda: polygons_meet(A, B, np.eye(3), X).hit,
        "flat hull": lambda: collide.collide(*hulls, np.eye(4), spatial),
    }
    peers = installed(shapely="shapely", Box2D="Box2D")
    tasks |= shapely_tasks(A.vertices, B.vertices, X) if "shapely" in peers else {}
    tasks |= box2d_tasks(A.vertices, B.vertices, X) if "Box2D" in peers and corners <= 16 else {}
    ours, answers = polygons_meet(A, B, np.eye(3), X), {name: np.asarray(task()) for name, task in tasks.items()}
    for k in np.flatnonzero(np.any([answer != ours.hit for answer in answers.values()], axis=0)):
        verify_polygons(A, B, np.eye(3), X[k], ours.certificate(int(k)))
    beside = {name: {"wrong": int((answer != ours.hit).sum())} for name, answer in answers.items()}
    tasks["distance"] = lambda: polygon_distance(A, B, np.eye(3), X).distance
    return Race(tasks, count, {"of": count, "hits": float(ours.hit.mean())}, beside)


def rounds(options: Options, n: int, pairs: str) -> list[dict]:
    """The most rounds and vertices read beside their bounds."""
    rng = np.random.default_rng(n)
    outline = round_polygon(n, rng)
    A, B = collide.ConvexPolygon(outline), collide.ConvexPolygon(-outline if pairs == "touching" else outline)
    r = polygons_meet(A, B, np.eye(3), poses(pairs, outline, 2000 if options.quick else 20_000, rng))
    bound = 2 * np.log2(len(A.vertices))
    check(bool((r.rounds <= bound + 6).all() and (r.vertices_read <= 12 * bound + 60).all()), f"bounds at {n} {pairs}")
    return [{"corners": len(A.vertices), "mean_rounds": float(r.rounds.mean()), "max_rounds": int(r.rounds.max()),
             "bound_rounds": bound + 6, "mean_read": float(r.vertices_read.mean()),
             "max_read": int(r.vertices_read.max()), "bound_read": 12 * bound + 60}]


CLAIMS = [
    Claim("rounds", "rounds and vertices read", lambda o: grid(
        n=(10, 1000, 10**5) if o.quick else (10, 100, 1000, 10**4, 10**5, 10**6), pairs=PAIRS), rounds,
          file="planar-rounds", everywhere=True),
    Claim("pairs", "µs a pair of polygons", lambda o: grid(
        corners=(4, 16, 128) if o.quick else (4, 8, 16, 128, 1024, 8192), pairs=PAIRS), compared, turns=5,
          file="planar-pairs", everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
