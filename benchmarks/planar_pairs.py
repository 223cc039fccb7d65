"""Convex polygons in the plane beside shapely (prepared), Box2D and our own flat hulls; rounds to 10⁶ corners.

    python benchmarks/planar_pairs.py            # two minutes; pip install shapely box2d, what is missing is left out
    python benchmarks/planar_pairs.py --quick    # a look, no CSV

Round polygons of n corners each in random poses: "random", their origins 1.2 to 2.6 radii apart; "near", within 1 % of
touching; "touching", a corner on a corner in numbers that need no rounding, in a third of the pairs one unit in the
last place apart. One polygon against itself in all poses of a batch, one thread each; contestants take turns, times
are medians over the turns in µs of the processor a pair, × is theirs divided by ours.

shapely has no poses: A is prepared and stays where it is, and "placed" has B's corners moved ahead of time, which is
not counted; "shapely" moves them and makes the polygons in its time. Box2D takes up to 16 corners, one call a pair, in
single precision, and a skin of 0.01 around every polygon. "flat hull" is `collide.collide` of hulls at z = 0. "wrong"
counts answers unlike ours, each of which was proven by a certificate that was checked in fractions.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import collide
from collide.polytopes import planar_pose, polygon_distance, polygons_meet, verify_polygons

RESULTS = Path(__file__).parent / "results"
Row = dict[str, object]


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
    try:
        import shapely
    except ImportError:
        return {}
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
    try:
        import Box2D
    except ImportError:
        return {}
    if len(A) > 16:
        return {}
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


def medians(tasks: dict[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Median seconds of the processor for each, taking turns."""
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(turns):
        for name, task in tasks.items():
            started = time.process_time()
            task()
            times[name].append(time.process_time() - started)
    return {name: float(np.median(values)) for name, values in times.items()}


def compare(n: int, kind: str, count: int, turns: int) -> list[Row]:
    """One case: all contestants on the same pairs."""
    rng = np.random.default_rng(n)
    corners = round_polygon(n, rng)
    mirrored = -corners if kind == "touching" else corners
    A, B = collide.ConvexPolygon(corners), collide.ConvexPolygon(mirrored)
    X = poses(kind, corners, count, rng)
    hulls = [collide.ConvexHull(np.c_[p.vertices, np.zeros(len(p.vertices))]) for p in (A, B)]
    spatial = in_space(X)
    tasks: dict[str, Callable[[], np.ndarray]] = {
        "collide": lambda: polygons_meet(A, B, np.eye(3), X).hit,
        "flat hull": lambda: collide.collide(*hulls, np.eye(4), spatial),
        **shapely_tasks(A.vertices, B.vertices, X),
        **box2d_tasks(A.vertices, B.vertices, X),
    }
    answers = {name: np.asarray(task()) for name, task in tasks.items()}
    ours = polygons_meet(A, B, np.eye(3), X)
    for k in np.flatnonzero(np.any([answer != ours.hit for answer in answers.values()], axis=0)):
        verify_polygons(A, B, np.eye(3), X[k], ours.certificate(int(k)))
    tasks["distance"] = lambda: polygon_distance(A, B, np.eye(3), X).distance
    seconds = medians(tasks, turns)
    rows: list[Row] = []
    for name, total in seconds.items():
        wrong = int((answers[name] != ours.hit).sum()) if name in answers else ""
        ratio = total / seconds["collide"]
        rows.append(
            {"corners": n, "pairs": kind, "engine": name, "us_a_pair": f"{total / count * 1e6:.3f}",
             "ratio": f"{ratio:.2f}", "wrong": wrong, "of": count, "hits": f"{ours.hit.mean():.2f}"}
        )  # fmt: skip
        print(f"{n:6} {kind:9} {name:16} {total / count * 1e6:9.3f} µs, {ratio:7.2f} ×, wrong {wrong}", flush=True)
    return rows


def rounds(sizes: list[int], count: int) -> list[Row]:
    """The most rounds and vertices read beside their bounds."""
    rows: list[Row] = []
    for n in sizes:
        rng = np.random.default_rng(n)
        corners = round_polygon(n, rng)
        polygon = collide.ConvexPolygon(corners)
        m = len(polygon.vertices)
        for kind in ("random", "near", "touching"):
            other_way = collide.ConvexPolygon(-corners) if kind == "touching" else polygon
            r = polygons_meet(polygon, other_way, np.eye(3), poses(kind, corners, count, rng))
            bound = 2 * np.log2(m)
            assert (r.rounds <= bound + 6).all() and (r.vertices_read <= 12 * bound + 60).all()
            rows.append({"corners": m, "pairs": kind, "mean_rounds": f"{r.rounds.mean():.2f}",
                         "max_rounds": int(r.rounds.max()), "bound_rounds": f"{bound + 6:.1f}",
                         "mean_read": f"{r.vertices_read.mean():.1f}", "max_read": int(r.vertices_read.max()),
                         "bound_read": f"{12 * bound + 60:.0f}"})  # fmt: skip
            print(*(f"{key} {value}," for key, value in rows[-1].items()), flush=True)
    return rows


def write(name: str, rows: list[Row]) -> None:
    path = RESULTS / f"{name}.csv"
    about = f"{platform.processor() or platform.machine()}, {len(os.sched_getaffinity(0))} cores"
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, [*rows[0], "machine"])
        table.writeheader()
        table.writerows([{**row, "machine": about} for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="fewer pairs and turns, no CSV")
    options = parser.parse_args()
    count, turns = (2_000, 3) if options.quick else (20_000, 5)
    print("rounds and vertices read")
    counted = rounds([10, 1000, 10**5] if options.quick else [10, 100, 1000, 10**4, 10**5, 10**6], count)
    print("µs a pair")
    timed = []
    for n in (4, 16, 128) if options.quick else (4, 8, 16, 128, 1024, 8192):
        for kind in ("random", "near", "touching"):
            timed += compare(n, kind, max(count // max(n // 64, 1), 200), turns)
    if not options.quick:
        write("planar-rounds", counted)
        write("planar-pairs", timed)


if __name__ == "__main__":
    main()
