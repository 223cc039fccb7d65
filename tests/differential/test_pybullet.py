"""Closest points and rays answered by Bullet and by a mirror of its client: what differs is judged.

Of polytopes rationals say who is right, asked about the vertices and poses that Bullet has; of other pairs the oracle,
in decimals of 80 digits. A second mirror takes over Bullet's margins, so that what is due to them is told from what is
wrong. Rays are judged by where they meet balls in closed form.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

p = pytest.importorskip("pybullet", reason="pybullet is not installed")
from curved_oracle import bracket
from host_pairs import CORNERS, FACETS, calls
from samples import sizes, told

import collide
from collide.adapters.hosts.pybullet_mirror import Mirror
from collide.adapters.peers import exact
from collide.adapters.peers.pybullet_peer import quaternion_xyzw

KINDS = ("Box", "Sphere", "Capsule", "Cylinder", "Convex", "BVHModel")
#: How far Bullet's rounded edges and its search may bring a gap off, beyond margins [m].
ROUNDED = 1.6e-3
SEED = 22


def body(pybullet, client: int, kind: str, s: np.ndarray, R: np.ndarray, t: np.ndarray) -> int:
    """A body of a kind and three lengths."""
    arguments = {
        "Box": {"shapeType": p.GEOM_BOX, "halfExtents": (s / 2).tolist()},
        "Sphere": {"shapeType": p.GEOM_SPHERE, "radius": s[0] / 2},
        "Capsule": {"shapeType": p.GEOM_CAPSULE, "radius": s[0] / 2, "height": s[1]},
        "Cylinder": {"shapeType": p.GEOM_CYLINDER, "radius": s[0] / 2, "height": s[1]},
        "Convex": {"shapeType": p.GEOM_MESH, "vertices": (CORNERS * s).tolist()},
        "BVHModel": {
            "shapeType": p.GEOM_MESH, "vertices": (CORNERS * s).tolist(), "indices": np.ravel(FACETS).tolist(),
            "flags": p.GEOM_FORCE_CONCAVE_TRIMESH,
        },
    }[kind]
    number = pybullet.createCollisionShape(**arguments, physicsClientId=client)
    mass = float(kind != "BVHModel")
    return pybullet.createMultiBody(
        mass, number, basePosition=t.tolist(), baseOrientation=quaternion_xyzw(R), physicsClientId=client
    )


def judged(mirror: Mirror, kinds: set[str], theirs: float, ours: float, grown: float) -> str:
    """Who is right where signs differ; grown : our distance with Bullet's margins."""
    first, second = (mirror.world.body(row) for row in (0, 1))
    if kinds <= {"Box", "Convex"}:
        bodies = [(points_of(b.shape), b.X_WB[:3, :3], b.X_WB[:3, 3]) for b in (first, second)]
        truth = exact.hit(*bodies[0], *bodies[1])
    else:
        proven = bracket(first.shape, second.shape, first.X_WB, second.X_WB, depths=False)
        if proven.lower <= 0 <= proven.upper:
            return "touching within rounding"
        truth = proven.upper < 0
    if truth != (ours <= 0.0):
        return "OURS WRONG"
    return "Bullet wrong, by its margins" if (theirs <= 0.0) == (grown <= 0.0) else "Bullet wrong"


def points_of(shape) -> np.ndarray:
    return CORNERS * shape.size if isinstance(shape, collide.Box) else shape.points


@sizes(120, 10_000)
def test_signs_of_closest_points_are_judged_in_our_favour(n):
    client, verdicts, gaps = p.connect(p.DIRECT), Counter(), Counter()
    n_hits = n_unanswered = 0
    for k, pair in enumerate(calls(n, SEED, KINDS)):
        kinds = {kind for kind, *_ in pair}
        p.resetSimulation(physicsClientId=client)
        A, B = (body(p, client, *arguments) for arguments in pair)
        shapes = {
            (number, -1): collide.Mesh(CORNERS * s, np.array(FACETS), solid=False)
            for number, (kind, s, _, _) in zip((A, B), pair) if kind == "BVHModel"
        }
        plain, grown = Mirror(client, shapes=shapes), Mirror(client, shapes=shapes, margins="bullet")
        rows = [ask.getClosestPoints(A, B, 10.0, physicsClientId=client) for ask in (p, plain, grown)]
        if not rows[0]:
            n_unanswered += 1  # two meshes of triangles: Bullet has no answer
            continue
        theirs, ours, with_margins = (min(row[8] for row in answer) for answer in rows)
        n_hits += ours <= 0.0
        if (theirs <= 0.0) != (ours <= 0.0):
            who = judged(plain, kinds, theirs, ours, with_margins)
            verdicts[who] += 1
            assert who != "OURS WRONG", f"[*calls({n}, {SEED}, KINDS)][{k}]: {ours}, Bullet {theirs}"
        elif ours > 0.0:
            gaps["beyond Bullet's rounding" if abs(theirs - with_margins) > ROUNDED else "within it"] += 1
    p.disconnect(client)
    told(f"{n} calls of getClosestPoints, {n_hits} overlaps, {n_unanswered} not answered; signs that differ:", verdicts)
    told("gaps beside Bullet's with its margins", gaps)
    assert 0.3 * n < n_hits < 0.8 * n and gaps["within it"] > 0.1 * n


def first_ball(origin: np.ndarray, end: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> tuple[int, float]:
    """(ball, fraction) that a ray meets first from outside; (-1, 1) for none. Rays that graze are left to rounding."""
    d, m = end - origin, origin - centers
    a, b, c = d @ d, m @ d, np.einsum("ki,ki->k", m, m) - radii**2
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(b * b - a * c)) / a
    t[~((c > 0) & (t >= 0) & (t <= 1))] = np.inf
    k = int(np.argmin(t))
    return (k, float(t[k])) if np.isfinite(t[k]) else (-1, 1.0)


@sizes(200, 10_000)
def test_rays_at_balls_hit_the_right_ones(n):
    """Before a step Bullet knows no bodies at new places; ours are right before and after."""
    random, counts, off = np.random.default_rng(SEED), Counter(), np.zeros(2)
    for round_ in range(max(2, n // 100)):
        client = p.connect(p.DIRECT)
        for _ in range(5):
            place, s = random.uniform(-1, 1, 3), random.uniform(0.2, 0.8)
            number = p.createCollisionShape(p.GEOM_SPHERE, radius=s / 2, physicsClientId=client)
            inertial = random.uniform(-0.3, 0.3, 3).tolist()
            p.createMultiBody(1.0, number, basePosition=place.tolist(), physicsClientId=client,
                              baseInertialFramePosition=inertial)
        if round_ % 2:
            p.performCollisionDetection(client)
        mirror = Mirror(client)
        centers = np.array([mirror.world.body(k).X_WB[:3, 3] for k in range(5)])
        radii = np.array([mirror.world.body(k).shape.radius for k in range(5)])
        origins = random.normal(size=(100, 3)) * 3.0
        ends = -origins + random.normal(size=(100, 3))
        theirs = p.rayTestBatch(origins.tolist(), ends.tolist(), physicsClientId=client)
        both = mirror.rayTestBatch(origins, ends), theirs
        for k in range(100):
            who, fraction = first_ball(origins[k], ends[k], centers, radii)
            counts["hits"] += who >= 0
            for side, name in enumerate(("ours", "Bullet")):
                reply = both[side][k]
                if reply[0] != who:
                    counts[name, "wrong body", "after a step" if round_ % 2 else "before one"] += 1
                elif who >= 0:
                    off[side] = max(off[side], abs(reply[2] - fraction) * float(np.linalg.norm(ends[k] - origins[k])))
        p.disconnect(client)
    told(f"rays; places of hits off by up to {off[0]:.1e} m, Bullet's by {off[1]:.1e} m", counts)
    assert not [key for key in counts if key[0] == "ours"] and off[0] < 1e-6 and counts["hits"] > 20
