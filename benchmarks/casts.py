"""Casts: rays against primitive shapes and Worlds beside pybullet's batches, shape casts beside FCL's continuous query.

    python benchmarks/casts.py              # a minute; needs pybullet and python-fcl, leaves out what is not installed
    python benchmarks/casts.py --quick      # a look, no CSV

Contestants take turns in one run, one thread each; times are medians over the turns, per ray or cast, × is theirs
divided by ours. Before it times anything it compares the answers: "differ" counts rays or casts for which a peer says
hit where we proved a miss, or the other way round, or names a distance that is off by more than 1e-3.

FCL's continuous query moves along the whole segment by conservative advancement; ours gets the segment as direction and
max_distance=1. Its loop is Python, one call a cast; its kernels cannot be timed alone from there.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import collide

RESULTS = Path(__file__).parent / "results"
SHAPES = {
    "sphere": collide.Sphere(0.5), "box": collide.Box((1.0, 0.8, 0.6)), "capsule": collide.Capsule(0.3, 0.6),
    "cylinder": collide.Cylinder(0.4, 0.8), "cone": collide.Cone(0.4, 0.8),
    "ellipsoid": collide.Ellipsoid((0.5, 0.3, 0.4)),
}  # fmt: skip
Row = dict[str, object]


def poses(rng: np.random.Generator, n: int, spread: float) -> np.ndarray:
    """(n, 4, 4) random ones, positions uniform in a cube."""
    q = rng.normal(size=(n, 4))
    w, x, y, z = (q / np.linalg.norm(q, axis=1)[:, None]).T
    X = np.tile(np.eye(4), (n, 1, 1))
    X[:, :3, :3] = np.stack(
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
         1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
         1 - 2 * (x * x + y * y)],
        axis=-1,
    ).reshape(n, 3, 3)  # fmt: skip
    X[:, :3, 3] = rng.uniform(-spread, spread, size=(n, 3))
    return X


def medians(tasks: dict[str, Callable[[], object]], turns: int) -> dict[str, float]:
    """Median seconds of each, taking turns."""
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for _ in range(turns):
        for name, task in tasks.items():
            started = time.perf_counter()
            task()
            times[name].append(time.perf_counter() - started)
    return {name: float(np.median(values)) for name, values in times.items()}


def report(table: str, case: str, count: int, seconds: dict[str, float], differ: dict[str, int]) -> list[Row]:
    rows: list[Row] = []
    for engine, total in seconds.items():
        each, ratio = total / count * 1e6, total / seconds["collide"]
        rows.append(
            {"table": table, "case": case, "engine": engine, "us_each": f"{each:.3f}", "ratio": f"{ratio:.2f}",
             "differ": differ.get(engine, "")}
        )  # fmt: skip
        count_of = differ.get(engine, "-")
        print(f"{table:8} {case:22} {engine:9} {each:9.3f} µs, {ratio:6.2f} ×, differ {count_of}", flush=True)
    return rows


# --- pybullet -----------------------------------------------------------------------------------


def bullet_world(bodies: list[tuple[collide.Shape, np.ndarray]]):
    """A client with these bodies, None where pybullet is not installed; ellipsoids are left out."""
    try:
        import pybullet
    except ImportError:
        return None
    client = pybullet.connect(pybullet.DIRECT)
    kinds = {
        "Sphere": (pybullet.GEOM_SPHERE, lambda s: {"radius": s.radius}),
        "Box": (pybullet.GEOM_BOX, lambda s: {"halfExtents": (np.asarray(s.size) / 2).tolist()}),
        "Capsule": (pybullet.GEOM_CAPSULE, lambda s: {"radius": s.radius, "height": s.length}),
        "Cylinder": (pybullet.GEOM_CYLINDER, lambda s: {"radius": s.radius, "height": s.length}),
    }
    for shape, X in bodies:
        kind, arguments = kinds[type(shape).__name__]
        made = pybullet.createCollisionShape(kind, physicsClientId=client, **arguments(shape))
        body = pybullet.createMultiBody(0, made, physicsClientId=client)
        place = X[:3, 3].tolist(), quaternion(X).tolist()
        pybullet.resetBasePositionAndOrientation(body, *place, physicsClientId=client)
    return client


def quaternion(X: np.ndarray) -> np.ndarray:
    """x, y, z, w of a rotation: the eigenvector of its symmetric matrix."""
    R = X[:3, :3]
    K = np.array(
        [[R[0, 0] - R[1, 1] - R[2, 2], R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[2, 1] - R[1, 2]],
         [0, R[1, 1] - R[0, 0] - R[2, 2], R[1, 2] + R[2, 1], R[0, 2] - R[2, 0]],
         [0, 0, R[2, 2] - R[0, 0] - R[1, 1], R[1, 0] - R[0, 1]], [0, 0, 0, R[0, 0] + R[1, 1] + R[2, 2]]]
    )  # fmt: skip
    return np.linalg.eigh(K, UPLO="U")[1][:, -1]


def bullet_rays(client, origins: np.ndarray, motions: np.ndarray) -> Callable[[], np.ndarray]:
    """A task: fractions of the motions, inf for misses."""
    import pybullet

    starts, ends = origins.tolist(), (origins + motions).tolist()
    max_rays = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE

    def ask() -> np.ndarray:
        fractions: list[float] = []
        for k in range(0, len(starts), max_rays):
            replies = pybullet.rayTestBatch(
                starts[k : k + max_rays], ends[k : k + max_rays], numThreads=1, physicsClientId=client
            )
            fractions += [np.inf if reply[0] < 0 else reply[2] for reply in replies]
        return np.array(fractions)

    return ask


def differing(ours: np.ndarray, theirs: np.ndarray) -> int:
    hit = np.isfinite(ours)
    both = hit & np.isfinite(theirs)
    return int((hit != np.isfinite(theirs)).sum() + (np.abs(ours[both] - theirs[both]) > 1e-3).sum())


# --- tables -------------------------------------------------------------------------------------


def rays_at_shapes(n: int, turns: int) -> list[Row]:
    """n rays at one posed shape, half of which hit."""
    rows: list[Row] = []
    for name, shape in SHAPES.items():
        rng = np.random.default_rng(1)
        X = poses(rng, 1, 0.5)[0]
        origins = rng.normal(size=(n, 3)) * 3
        motions = 2 * (X[:3, 3] + 0.5 * rng.normal(size=(n, 3)) - origins)

        def ask(shape=shape, X=X, origins=origins, motions=motions) -> np.ndarray:
            return collide.raycast(shape, X, origins, motions, max_distance=1.0).distance

        tasks: dict[str, Callable[[], np.ndarray]] = {"collide": ask}
        client = None if name in ("cone", "ellipsoid") else bullet_world([(shape, X)])
        if client is not None:
            tasks["pybullet"] = bullet_rays(client, origins, motions)
        outside = ~collide.contains(shape, X, origins)  # Bullet's rays say nothing of what they begin in
        answers = {engine: task() for engine, task in tasks.items()}
        differ = {engine: differing(answers["collide"][outside], values[outside]) for engine, values in answers.items()}
        rows += report("rays", name, n, medians(tasks, turns), differ)
    return rows


def rays_at_worlds(sizes: list[int], n: int, turns: int) -> list[Row]:
    """n rays through worlds of so many boxes, spheres, capsules and cylinders, 4 % of the space full."""
    rows: list[Row] = []
    for size in sizes:
        rng = np.random.default_rng(2)
        X = poses(rng, size, 0.5 * (size / 0.12) ** (1 / 3))
        shapes = [SHAPES[name] for name in ("sphere", "box", "capsule", "cylinder")]
        bodies = [(shapes[k % 4], X[k]) for k in range(size)]
        world = collide.World()
        for shape, X_WB in bodies:
            world.add(shape, X_WB)
        reach = float(np.abs(X[:, :3, 3]).max())
        origins = rng.uniform(-1.2 * reach, 1.2 * reach, size=(n, 3))
        motions = rng.normal(size=(n, 3))
        motions *= 2 * reach / np.linalg.norm(motions, axis=1)[:, None]

        def ask(world=world, origins=origins, motions=motions) -> np.ndarray:
            return world.raycast(origins, motions, max_distance=1.0)["distance"]

        tasks: dict[str, Callable[[], np.ndarray]] = {"collide": ask}
        client = bullet_world(bodies)
        if client is not None:
            tasks["pybullet"] = bullet_rays(client, origins, motions)
        free = world.nearest(origins)["distance"] > 0
        answers = {engine: task() for engine, task in tasks.items()}
        differ = {engine: differing(answers["collide"][free], values[free]) for engine, values in answers.items()}
        rows += report("world", f"{size} bodies", n, medians(tasks, turns), differ)
    return rows


def fcl_casts(A, B, X_WA, X_WB, motions) -> Callable[[], np.ndarray] | None:
    """A task: fractions of the motions by FCL's continuous query, inf for misses; None where it is not installed."""
    try:
        import fcl
    except ImportError:
        return None

    def geometry(shape):
        name = type(shape).__name__
        if name == "Sphere":
            return fcl.Sphere(shape.radius)
        if name == "Box":
            return fcl.Box(*np.asarray(shape.size).tolist())
        return {"Capsule": fcl.Capsule, "Cylinder": fcl.Cylinder, "Cone": fcl.Cone}[name](shape.radius, shape.length)

    def placed(shape, X):
        return fcl.CollisionObject(geometry(shape), fcl.Transform(X[:3, :3], X[:3, 3]))

    pairs = [(placed(A, X), placed(B, Y)) for X, Y in zip(X_WA, X_WB)]
    goals = [fcl.Transform(X[:3, :3], X[:3, 3] + d) for X, d in zip(X_WA, motions)]
    stays = [fcl.Transform(Y[:3, :3], Y[:3, 3]) for Y in X_WB]
    request = fcl.ContinuousCollisionRequest(
        ccd_motion_type=fcl.CCDMotionType.CCDM_TRANS, ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT
    )

    def ask() -> np.ndarray:
        fractions = []
        for (a, b), goal, stay in zip(pairs, goals, stays):
            result = fcl.ContinuousCollisionResult()
            fcl.continuousCollide(a, goal, b, stay, request, result)
            fractions.append(result.time_of_contact if result.is_collide else np.inf)
        return np.array(fractions)

    return ask


def casts_of_pairs(n: int, turns: int) -> list[Row]:
    """n casts of a pair of shapes, aimed at each other, nine in ten of which hit."""
    rows: list[Row] = []
    rng = np.random.default_rng(3)
    hull = collide.ConvexHull(0.5 * rng.normal(size=(48, 3)))
    pairs = [(SHAPES[a], SHAPES[b], f"{a} {b}") for a, b in (
        ("box", "box"), ("sphere", "box"), ("capsule", "box"), ("capsule", "capsule"), ("cylinder", "box"),
        ("cylinder", "cylinder"), ("ellipsoid", "ellipsoid"),
    )]  # fmt: skip
    for A, B, name in [*pairs, (hull, hull, "hull48 hull48")]:
        X_WA, X_WB = poses(rng, n, 4.0), poses(rng, n, 0.2)
        motions = 1.5 * (X_WB[:, :3, 3] + 0.4 * rng.normal(size=(n, 3)) - X_WA[:, :3, 3])

        def ask(A=A, B=B, X_WA=X_WA, X_WB=X_WB, motions=motions) -> np.ndarray:
            return collide.shape_cast(A, X_WA, motions, B, X_WB, max_distance=1.0).distance

        tasks: dict[str, Callable[[], np.ndarray]] = {"collide": ask}
        theirs = None if name.startswith(("hull", "ellipsoid")) else fcl_casts(A, B, X_WA, X_WB, motions)
        if theirs is not None:
            tasks["fcl"] = theirs
        answers = {engine: task() for engine, task in tasks.items()}
        differ = {engine: differing(answers["collide"], values) for engine, values in answers.items()}
        rows += report("casts", name, n, medians(tasks, turns), differ)
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few rays and turns, no CSV")
    quick = parser.parse_args().quick
    n, sizes = (1000, [100, 1000]) if quick else (10_000, [100, 1000, 5000, 20_000])
    rows = rays_at_shapes(n, 3 if quick else 15)
    rows += rays_at_worlds(sizes, n, 3 if quick else 9)
    rows += casts_of_pairs(200 if quick else 2000, 3 if quick else 9)
    if not quick:
        cpu = "amd-epyc" if "EPYC" in platform.processor() or Path("/proc/cpuinfo").read_text().count("EPYC") else "cpu"
        cores = len(os.sched_getaffinity(0))
        with open(RESULTS / f"casts_{cpu}_{cores}-cores.csv", "w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
