"""Short-lived shapes by the hundred thousand through everything that keeps something of a shape: memory stays.

    python tests/soak/soak_memory.py --shapes 100000 [--seed 1] [--uses impact,world]

Shapes of every kind of `soak_pairs.py` are made, asked in pairs, first and second, alone or beside one that stays, and
dropped: booleans, distances, limits, margins, contacts, impacts, batches, sets, casts, rays, certificates, volumes,
Worlds, checkers of robots, and the drop-ins for FCL and coal. Prints a memory curve: shapes so far, resident memory,
how many shapes outlived their users. Ends with status 1 where any did, or where memory grew by more than 1 MB in the
second half of the curve. Python's search for cycles is off: what waits for it, a user's program pays for.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

sys.path.append(str(Path(__file__).resolve().parents[1] / "oracles"))

import numpy as np
from soak_pairs import WORLD_KINDS, shape

import collide
from collide import UnsupportedQuery
from collide.adapters.hosts import coal_api, fcl_api
from collide.errors import InvalidArgument, InvalidShape
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape, Robot

#: Samples of the curve, and what its second half may grow by [bytes].
SAMPLES, MOST_GROWTH = 20, 1 << 20
#: Of so many questions one is about a shape that stays; there are so many of these of each kind.
_KEPT_EVERY = 4
I = np.eye(4)
NEAR, FAR = collide.pose((0.3, 0.1, 0.2)), collide.pose((3, 0.1, 0.2))
_ONE, _OTHER = np.array([0]), np.array([1])


def impacts(A, B) -> None:
    for _ in range(2):
        collide.time_of_impact(A, B, I, I, collide.pose((2, 0, 0)), collide.pose((0.2, 0, 0)))


def world(A, B) -> None:
    w = collide.World()
    w.add(A, margin=0.01)
    other = w.add(B, NEAR)
    w.collides(), w.collisions(), w.distances(0.1), w.nearest([[0, 0, 1.0]]), w.raycast([[0, 0, 5.0]], [[0, 0, -1.0]])
    w.set_pose(other, FAR)
    w.minimum(), w.query(A, FAR), w.contacts(0.1)


def checker(A, B) -> None:
    joint = Joint("slide", "prismatic", "base", "hand", axis=np.array([0, 0, 1.0]))
    robot = Robot("one", ["base", "hand"], [joint], {"hand": [LinkShape(A, I, None, "soak")]})
    surroundings = collide.World()
    surroundings.add(B, NEAR)
    made, Q = collide.RobotChecker(robot, surroundings), np.array([[0.0], [1.0]])
    made.collides(Q), made.distances(Q), made.certify_edges(Q[:1], Q[1:]), made.explain(Q[0])


def drop_in(api) -> Callable:
    """The same shapes as a drop-in has them."""

    def ask(A, B) -> None:
        a, b = _as_host(api, A), _as_host(api, B)
        transform = api.Transform if api is fcl_api else api.Transform3s
        for t in ((0.0, 0.0, 0.0), (3.0, 0.1, 0.2)):
            one = api.CollisionObject(a, transform(np.eye(3), np.zeros(3)))
            other = api.CollisionObject(b, transform(np.eye(3), np.array(t)))
            api.collide(one, other, api.CollisionRequest(), api.CollisionResult())
            api.distance(one, other, api.DistanceRequest(), api.DistanceResult())

    return ask


def _as_host(api, made):
    if isinstance(made, collide.Sphere):
        return api.Sphere(made.radius)
    if isinstance(made, (collide.Capsule, collide.Cylinder, collide.Cone)):
        return getattr(api, type(made).__name__)(made.radius, made.length)
    if isinstance(made, collide.Halfspace):
        return api.Halfspace(made.normal / np.linalg.norm(made.normal), made.offset / np.linalg.norm(made.normal))
    if isinstance(made, collide.Mesh) and api is fcl_api:
        model = api.BVHModel()
        model.beginModel(len(made.faces), len(made.vertices))
        model.addSubModel(made.vertices, made.faces)
        model.endModel()
        return model
    if isinstance(made, collide.Ellipsoid):
        return api.Ellipsoid(*made.radii.tolist())
    return api.Box(*(made.size.tolist() if isinstance(made, collide.Box) else (0.2, 0.3, 0.4)))


def sets(A, B) -> None:
    both = collide.ShapeSet([A, B])
    collide.collide(both[_ONE], both[_OTHER], I[None], NEAR[None])


#: What is asked of two shapes.
USES: dict[str, Callable] = {
    "collide": lambda A, B: [collide.collide(A, B, I, X) for X in (NEAR, NEAR, FAR)],
    "distance": lambda A, B: [collide.distance(A, B, I, X) for X in (FAR, FAR, NEAR)],
    "limit": lambda A, B: [collide.distance(A, B, I, X, max_distance=0.1) for X in (FAR, NEAR)],
    "margin": lambda A, B: [collide.collide(A, B, I, X, security_margin=0.1) for X in (NEAR, FAR)],
    "contacts": lambda A, B: [collide.contacts(A, B, I, NEAR, margin=0.01) for _ in range(2)],
    "impact": impacts,
    "batch": lambda A, B: collide.distance([A, B], [B, A], np.array([I, I]), np.array([NEAR, FAR])),
    "set": sets,
    "cast": lambda A, B: collide.shape_cast(A, FAR, (-1, 0, 0), B, I),
    "ray": lambda A, B: [collide.raycast(S, I, (0, 0, 5.0), (0, 0, -1.0), all_hits=True) for S in (A, B)],
    "contains": lambda A, B: [collide.contains(S, I, (0.0, 0.0, 0.1)) for S in (A, B)],
    "volume": lambda A, B: collide.overlap_volume(A, B, I, NEAR),
    "certificate": lambda A, B: collide.distance(A, B, I, FAR).certificate,
    "world": world,
    "checker": checker,
    "FCL": drop_in(fcl_api),
    "coal": drop_in(coal_api),
}


class Sample(NamedTuple):
    """shapes : so far.   resident : memory [bytes].   alive : shapes so far that outlived their last user."""

    shapes: int
    resident: int
    alive: int


class Survivor(NamedTuple):
    """A shape that outlived its last user."""

    use: str
    kinds: tuple[str, str]


def resident() -> int:
    """Resident memory of this process [bytes]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE")


def drops(n_shapes: int, seed: int = 1, uses=tuple(USES), sample: Callable[[Sample], None] | None = None):
    """(shapes that outlived their users, how many questions were answered, refused) of n shapes; ``sample`` is told
    the curve."""
    random, survivors, answered, refused = np.random.default_rng([seed, 3]), [], 0, 0
    kept = {kind: shape(kind, 0.6, random) for kind in WORLD_KINDS}
    gc.collect()
    gc.disable()
    try:
        for n in range(0, n_shapes, 2):
            kinds = str(random.choice(WORLD_KINDS)), str(random.choice(WORLD_KINDS))
            pair = [shape(kind, 10.0 ** random.uniform(-0.5, 0), random) for kind in kinds]
            gone = [weakref.ref(made) for made in pair]
            if n // 2 % _KEPT_EVERY == 0:
                which = int(random.integers(2))
                pair[which], gone = kept[kinds[which]], [gone[1 - which]]
            use = uses[n // 2 % len(uses)]
            try:
                USES[use](*pair)
                answered += 1
            except (UnsupportedQuery, InvalidArgument, InvalidShape):
                refused += 1
            del pair
            if any(reference() is not None for reference in gone):
                survivors.append(Survivor(use, kinds))
            if sample is not None and (n // 2 + 1) % max(n_shapes // 2 // SAMPLES, 1) == 0:
                sample(Sample(n + 2, resident(), len(survivors)))
    finally:
        gc.enable()
    return survivors, answered, refused


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--shapes", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--uses", help=f"of {', '.join(USES)}")
    asked = parser.parse_args(arguments)
    uses = tuple(asked.uses.split(",")) if asked.uses else tuple(USES)
    if unknown := set(uses) - set(USES):
        parser.error(f"--uses: {', '.join(sorted(unknown))}: there are {', '.join(USES)}")
    curve: list[Sample] = []
    began = time.monotonic()

    def say(point: Sample) -> None:
        curve.append(point)
        megabytes = point.resident / 2**20
        print(f"{point.shapes:8d} shapes  {megabytes:8.1f} MB resident  {point.alive:6d} outlived", flush=True)

    survivors, answered, refused = drops(asked.shapes, asked.seed, uses, say)
    half = curve[len(curve) // 2 :]
    growth = half[-1].resident - half[0].resident
    print(
        f"{answered} answered, {refused} refused in {time.monotonic() - began:.0f} s; second half: "
        f"{growth / 2**20:+.2f} MB, {growth / max(half[-1].shapes - half[0].shapes, 1):.1f} bytes a shape"
    )
    for survivor in sorted(set(survivors))[:20]:
        print(f"outlived its last user: {survivor.use}, {survivor.kinds}")
    return bool(survivors or growth > MOST_GROWTH)


if __name__ == "__main__":
    sys.exit(main())
