"""Times of impact: `collide.time_of_impact` beside FCL's continuous collision, with the misses of both.

    python benchmarks/impacts.py [--quick]      # a minute; needs python-fcl for its columns

Random motions of two boxes and of two hulls of 48 vertices, of a box and a mesh, and thin plates that fast needles fly
through. Engines take turns; times are the medians of several turns, a motion. Ours is one call of a batch; FCL is a
Python loop over objects and requests made beforehand, by conservative advancement with screw motions, tolerance 1e-4,
its own default. Its linear interpolation of rotations is its own, so answers are compared where the motion is a
translation: "missed" counts motions with a contact that the judge of the tests finds, and that an engine says is free
or later by a thousandth.

coal has no continuous collision any more (coal#421), pybullet gives its convex cast no function, MuJoCo has none.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
import time
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests"
sys.path[:0] = [str(Path(__file__).parent), str(TESTS / "oracles"), str(TESTS / "families")]
import motion_oracle as oracle
import motions
from meshes import RESULTS

import collide

SEED = 21


def box_group(n: int, *, still: bool) -> motions.Group:
    rng = np.random.default_rng(SEED)
    return motions.random_group("boxes", rng, n, motions.boxes(rng), turn=0.0 if still else None)


def hull_group(n: int) -> motions.Group:
    rng = np.random.default_rng(SEED + 1)
    A, B = (collide.ConvexHull(rng.normal(size=(48, 3)) * 0.4) for _ in range(2))
    return motions.random_group("hulls", rng, n, (A, B, None, 3.0))


def needle_group(n: int) -> motions.Group:
    rng = np.random.default_rng(SEED + 2)
    pair = motions.needle_and_plate(rng)
    return motions.random_group("needles", rng, n, pair, spread=0.3, turn=0.0, fast=1e4)


def fcl_geometry(fcl, shape: collide.Shape):
    if isinstance(shape, collide.Box):
        return fcl.Box(*shape.size.tolist())
    vertices, faces = collide.tessellate(shape, tolerance=1.0)
    padded = np.concatenate([[3, *face] for face in faces.tolist()])
    return fcl.Convex(vertices, len(faces), padded)


def ask_fcl(fcl, group: motions.Group) -> tuple[np.ndarray, float]:
    """(times, −1 where free; seconds a motion)."""
    n = len(group.X_WA0)
    A, B = (fcl_geometry(fcl, shape) for shape in (group.A, group.B))
    ends = [[fcl.Transform(X[:3, :3], X[:3, 3]) for X in poses] for poses in group.poses]
    objects = [(fcl.CollisionObject(A, ends[0][k]), fcl.CollisionObject(B, ends[2][k])) for k in range(n)]
    request = fcl.ContinuousCollisionRequest(
        ccd_motion_type=fcl.CCDMotionType.CCDM_LINEAR,
        ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT,
    )
    times = np.full(n, -1.0)
    begin = time.perf_counter()
    for k in range(n):
        result = fcl.ContinuousCollisionResult()
        fcl.continuousCollide(objects[k][0], ends[1][k], objects[k][1], ends[3][k], request, result)
        if result.is_collide:
            times[k] = result.time_of_contact
    return times, (time.perf_counter() - begin) / n


def ask_collide(group: motions.Group) -> tuple[np.ndarray, float]:
    begin = time.perf_counter()
    r = collide.time_of_impact(group.A, group.B, *group.poses)
    return np.where(r.hit, r.time, -1.0), (time.perf_counter() - begin) / len(r.hit)


def misses(group: motions.Group, times: np.ndarray) -> int:
    """Motions in which there is a contact before the time said, but for a thousandth."""
    lower = np.where(times < 0.0, 1.0, np.maximum(times - 1e-3, 0.0))
    return int(oracle.judge(group.gap, *group.motions(), lower, lower, tolerance=1e-6).missed.sum())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer motions, fewer turns, no file")
    quick = parser.parse_args().quick
    n, turns = (200, 2) if quick else (3000, 7)
    try:
        import fcl
    except ImportError:
        fcl = None
        print("python-fcl is not installed: its columns stay empty")
    groups = {
        "two boxes": (box_group(n, still=False), False),
        "two boxes, translations": (box_group(n, still=True), True),
        "two hulls of 48": (hull_group(n), False),
        "needle and plate, 10 km": (needle_group(n), True),
    }
    rows = []
    for name, (group, judged) in groups.items():
        ask_collide(group)  # tables, and what is loaded when first used
        seconds: dict[str, list[float]] = {"collide": [], "fcl": []}
        answers = {}
        for _ in range(turns):
            answers["collide"], spent = ask_collide(group)
            seconds["collide"].append(spent)
            if fcl is not None:
                answers["fcl"], spent = ask_fcl(fcl, group)
                seconds["fcl"].append(spent)
        medians = {engine: statistics.median(spent) * 1e6 for engine, spent in seconds.items() if spent}
        missed = {engine: misses(group, times) if judged else "" for engine, times in answers.items()}
        ratio = medians["fcl"] / medians["collide"] if "fcl" in medians else float("nan")
        hits = int((answers["collide"] >= 0.0).sum())
        of_fcl = medians.get("fcl", float("nan"))
        rows.append([name, n, hits, medians["collide"], of_fcl, ratio, missed["collide"], missed.get("fcl", "")])
        print(
            f"{name:26} {hits:5} of {n} hit; µs: collide {medians['collide']:8.2f}  fcl {of_fcl:8.2f}  "
            f"ratio {ratio:6.1f}; missed: {missed}"
        )
    if not quick:
        with (RESULTS / "impacts.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["motions", "n", "hits", "collide µs", "fcl µs", "ratio", "collide missed", "fcl missed"])
            writer.writerows(rows)


if __name__ == "__main__":
    main()
