"""Casts: rays against primitive shapes and Worlds beside pybullet's batches, shape casts beside FCL's continuous query.

    python benchmarks/casts.py              # a minute; needs pybullet and python-fcl, leaves out what is not installed
    python benchmarks/casts.py --quick      # a look, no CSV

One thread each, µs of the processor a ray or cast. Before it times anything it compares the answers: "differ" counts
rays or casts for which a peer says hit where we proved a miss, or the other way round, or names a distance that is off
by more than 1e-3. Bullet's rays say nothing of what they begin in: such rays are not compared.

FCL's continuous query moves along the whole segment by conservative advancement; ours gets the segment as direction and
max_distance=1. Its loop is Python, one call a cast; its kernels cannot be timed alone from there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from inputs import poses

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.peers.fcl_peer import FclPeer
from collide.adapters.peers.protocol import ENGINES, load_engine
from collide.adapters.peers.pybullet_peer import quaternion_xyzw

SHAPES = {
    "sphere": collide.Sphere(0.5), "box": collide.Box((1.0, 0.8, 0.6)), "capsule": collide.Capsule(0.3, 0.6),
    "cylinder": collide.Cylinder(0.4, 0.8), "cone": collide.Cone(0.4, 0.8),
    "ellipsoid": collide.Ellipsoid((0.5, 0.3, 0.4)),
}
PAIRS = ("box box", "sphere box", "capsule box", "capsule capsule", "cylinder box", "cylinder cylinder",
         "ellipsoid ellipsoid", "hull48 hull48")


def bullet_rays(bodies: list, origins: np.ndarray, motions: np.ndarray) -> tuple[Callable, Callable]:
    """(a task: fractions of the motions, inf for misses; what ends its client)."""
    import pybullet

    peer = load_engine(ENGINES["pybullet:margins"])  # without its margin a box is another one to its rays
    client = peer._client = pybullet.connect(pybullet.DIRECT)
    for shape, X in bodies:
        body, X_SB, *_ = peer.build(shape)
        X = X @ X_SB
        pybullet.resetBasePositionAndOrientation(body, X[:3, 3].tolist(), quaternion_xyzw(X[:3, :3]), client)
    starts, ends, max_rays = origins.tolist(), (origins + motions).tolist(), pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE

    def ask() -> np.ndarray:
        fractions: list[float] = []
        for k in range(0, len(starts), max_rays):
            replies = pybullet.rayTestBatch(starts[k : k + max_rays], ends[k : k + max_rays], 1, physicsClientId=client)
            fractions += [np.inf if reply[0] < 0 else reply[2] for reply in replies]
        return np.array(fractions)

    return ask, partial(pybullet.disconnect, client)


def raced(tasks: dict, count: int, compared, close=bool) -> Race:
    """compared : the rays or casts whose answers are counted."""
    answers = {name: task()[compared] for name, task in tasks.items()}
    ours = answers["collide"]
    beside = {}
    for name, theirs in answers.items():
        both = np.isfinite(ours) & np.isfinite(theirs)
        n = (np.isfinite(ours) != np.isfinite(theirs)).sum() + (np.abs(ours[both] - theirs[both]) > 1e-3).sum()
        beside[name] = {"differ": int(n)}
    return Race(tasks, count, beside=beside, close=close)


def rays(options: Options, shape: str, rays: int) -> Race:
    """Rays at one shape, half of which hit."""
    rng, body = np.random.default_rng(1), SHAPES[shape]
    X = poses(rng, 1, 0.5)[0]
    origins = rng.normal(size=(rays, 3)) * 3
    motions = 2 * (X[:3, 3] + 0.5 * rng.normal(size=(rays, 3)) - origins)
    tasks: dict = {"collide": lambda: collide.raycast(body, X, origins, motions, max_distance=1.0).distance}
    close: Callable = bool
    if shape not in ("cone", "ellipsoid") and installed(pybullet="pybullet"):
        tasks["pybullet"], close = bullet_rays([(body, X)], origins, motions)
    return raced(tasks, rays, ~collide.contains(body, X, origins), close)


def world(options: Options, bodies: int, rays: int) -> Race:
    """Rays through boxes, spheres, capsules and cylinders, 4 % of the space full."""
    rng = np.random.default_rng(2)
    X = poses(rng, bodies, 0.5 * (bodies / 0.12) ** (1 / 3))
    kinds = [SHAPES[name] for name in ("sphere", "box", "capsule", "cylinder")]
    placed = [(kinds[k % 4], X[k]) for k in range(bodies)]
    around = collide.World()
    for shape, X_WB in placed:
        around.add(shape, X_WB)
    reach = float(np.abs(X[:, :3, 3]).max())
    origins, motions = rng.uniform(-1.2 * reach, 1.2 * reach, size=(rays, 3)), rng.normal(size=(rays, 3))
    motions *= 2 * reach / np.linalg.norm(motions, axis=1)[:, None]
    tasks: dict = {"collide": lambda: around.raycast(origins, motions, max_distance=1.0)["distance"]}
    close: Callable = bool
    if installed(pybullet="pybullet"):
        tasks["pybullet"], close = bullet_rays(placed, origins, motions)
    return raced(tasks, rays, around.nearest(origins)["distance"] > 0, close)


def fcl_casts(A, B, X_WA, X_WB, motions) -> Callable[[], np.ndarray]:
    """A task: fractions of the motions by FCL's continuous query, inf for misses."""
    import fcl

    build = FclPeer().build

    def placed(shape, Xs):
        return [fcl.CollisionObject(build(shape), fcl.Transform(X[:3, :3], X[:3, 3])) for X in Xs]

    goals = [fcl.Transform(X[:3, :3], X[:3, 3] + d) for X, d in zip(X_WA, motions)]
    stays = [fcl.Transform(Y[:3, :3], Y[:3, 3]) for Y in X_WB]
    asked = list(zip(placed(A, X_WA), goals, placed(B, X_WB), stays))
    request = fcl.ContinuousCollisionRequest(
        ccd_motion_type=fcl.CCDMotionType.CCDM_TRANS, ccd_solver_type=fcl.CCDSolverType.CCDC_CONSERVATIVE_ADVANCEMENT
    )

    def ask() -> np.ndarray:
        fractions = []
        for motion in asked:
            result = fcl.ContinuousCollisionResult()
            fcl.continuousCollide(*motion, request, result)
            fractions.append(result.time_of_contact if result.is_collide else np.inf)
        return np.array(fractions)

    return ask


def casts(options: Options, pair: str, casts: int) -> Race:
    """Casts of a pair of shapes, aimed at each other, nine in ten of which hit."""
    rng = np.random.default_rng([3, len(pair)])
    shapes = SHAPES | {"hull48": collide.ConvexHull(0.5 * rng.normal(size=(48, 3)))}
    A, B = (shapes[name] for name in pair.split())
    X_WA, X_WB = poses(rng, casts, 4.0), poses(rng, casts, 0.2)
    motions = 1.5 * (X_WB[:, :3, 3] + 0.4 * rng.normal(size=(casts, 3)) - X_WA[:, :3, 3])
    asked = A, X_WA, motions, B, X_WB
    tasks: dict = {"collide": lambda: collide.shape_cast(*asked, max_distance=1.0).distance}
    if not pair.startswith(("hull", "ellipsoid")) and installed(fcl="fcl"):
        tasks["fcl"] = fcl_casts(A, B, X_WA, X_WB, motions)
    return raced(tasks, casts, slice(None))


def cases(options: Options, **columns):
    """`columns` first, then how many rays or casts."""
    n = 10 if options.quick else 1
    (last, count), *others = reversed(columns.items())
    return grid(**dict(others), **{last: [count // n]})


BODIES = (100, 1000, 5000, 20_000)
CLAIMS = [
    Claim("rays", "µs a ray at a shape", partial(cases, shape=SHAPES, rays=10_000), rays, file="casts-rays", turns=15),
    Claim("world", "µs a ray through a World", partial(cases, bodies=BODIES, rays=10_000), world, file="casts-world"),
    Claim("casts", "µs a cast of a pair", partial(cases, pair=PAIRS, casts=2000), casts, file="casts-pairs"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
