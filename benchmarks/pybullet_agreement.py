"""The same calls answered by Bullet and by a mirror of its client: which differ, judged; and what a call costs.

python benchmarks/pybullet_agreement.py [--calls 10000] [--rays 10000] [--seed 22]

Two bodies a call, a quarter of them on a grid where bodies touch. Verdicts are signs of getClosestPoints. Of polytopes
rationals say who is right, asked about the vertices and poses that Bullet has; of other pairs the tests' oracle, in
decimals of 80 digits. A second mirror takes over Bullet's margins, so that what is due to them is told from what is
wrong. Rays are judged by where they meet balls in closed form.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pybullet as p

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[1] / "tests" / "oracles")]
from curved_oracle import bracket
from host_agreement import CORNERS, FACETS, calls

import collide
from collide.adapters.hosts.pybullet_mirror import Mirror
from collide.adapters.peers import exact
from collide.adapters.peers.pybullet_peer import quaternion_xyzw

KINDS = ("Box", "Sphere", "Capsule", "Cylinder", "Convex", "BVHModel")
#: How far Bullet's rounded edges and its search may bring a gap off, beyond margins [m].
ROUNDED = 1.6e-3


def body(pybullet, kind: str, s: np.ndarray, R: np.ndarray, t: np.ndarray) -> int:
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
    }[kind]  # fmt: skip
    number = pybullet.createCollisionShape(**arguments)
    mass = float(kind != "BVHModel")
    return pybullet.createMultiBody(mass, number, basePosition=t.tolist(), baseOrientation=quaternion_xyzw(R))


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


def compare_pairs(n: int, seed: int) -> None:
    client = p.connect(p.DIRECT)
    verdicts: Counter = Counter()
    gaps: dict[str, list[tuple[float, float]]] = {}
    spent: tuple[list[float], ...] = ([], [], [])
    n_hits = unanswered = 0
    for pair in calls(n, seed, KINDS):
        both = "–".join(sorted(kind for kind, *_ in pair))
        p.resetSimulation(physicsClientId=client)
        A, B = (body(p, *arguments) for arguments in pair)
        shapes = {
            (number, -1): collide.Mesh(CORNERS * s, np.array(FACETS), solid=False)
            for number, (kind, s, _, _) in zip((A, B), pair) if kind == "BVHModel"
        }  # fmt: skip
        plain = Mirror(client, shapes=shapes)
        rows = []
        for ask in (p, plain, Mirror(client, shapes=shapes, margins="bullet")):
            ask.getClosestPoints(A, B, 10.0)
            begin = time.perf_counter()
            rows.append(ask.getClosestPoints(A, B, 10.0))
            spent[len(rows) - 1].append(time.perf_counter() - begin)
        if not rows[0]:
            unanswered += 1  # two meshes of triangles: Bullet has no answer
            continue
        theirs, ours, ours_grown = (min(row[8] for row in answer) for answer in rows)
        n_hits += ours <= 0.0
        if (theirs <= 0.0) != (ours <= 0.0):
            verdicts[both, judged(plain, {kind for kind, *_ in pair}, theirs, ours, ours_grown)] += 1
        elif ours > 0.0:
            gaps.setdefault(both, []).append((abs(theirs - ours), abs(theirs - ours_grown)))
    p.disconnect(client)
    print(f"{n} calls of getClosestPoints, {n_hits} overlaps, {unanswered} that Bullet does not answer")
    print(f"{sum(verdicts.values())} verdicts differ:")
    for (both, verdict), count in sorted(verdicts.items()):
        print(f"  {both:22} {verdict:30} {count}")
    print("gaps: greatest difference [m]   as they are   with Bullet's margins   beyond its rounding")
    for both, differences in sorted(gaps.items()):
        bare, same = np.array(differences).max(axis=0)
        beyond = int((np.array(differences)[:, 1] > ROUNDED).sum())
        print(f"  {both:28} {bare:.2e}      {same:.2e}                {beyond} of {len(differences)}")
    names = ("Bullet", "mirror", "mirror with margins")
    print(", ".join(f"{name} {1e6 * np.median(times):.2f} µs" for name, times in zip(names, spent)), "a second call")


def compare_rays(n: int, seed: int) -> None:
    """Rays at one ball and one box each, after a step and before."""
    random = np.random.default_rng(seed)
    counts: Counter = Counter()
    off = np.zeros(2)
    for stepped in (False, True):
        for _ in range(n // 200):
            client = p.connect(p.DIRECT)
            for _ in range(5):
                place, s = random.uniform(-1, 1, 3), random.uniform(0.2, 0.8, 3)
                number = p.createCollisionShape(p.GEOM_SPHERE, radius=s[0] / 2, physicsClientId=client)
                p.createMultiBody(
                    1.0, number, basePosition=place.tolist(), physicsClientId=client,
                    baseInertialFramePosition=random.uniform(-0.3, 0.3, 3).tolist(),
                )  # fmt: skip
            if stepped:
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
                for side, answers in enumerate(both):
                    name = ("ours", "Bullet")[side] + (", after a step" if stepped else ", before one")
                    if answers[k][0] != who:
                        counts[name + ": wrong body"] += 1
                    elif who >= 0:
                        length = float(np.linalg.norm(ends[k] - origins[k]))
                        off[side] = max(off[side], abs(answers[k][2] - fraction) * length)
                counts["hits"] += who >= 0
            p.disconnect(client)
    print(f"{2 * (n // 200) * 100} rays:", dict(sorted(counts.items())))
    print(f"places of hits off by up to {off[0]:.1e} m, Bullet's by {off[1]:.1e} m")


def first_ball(origin: np.ndarray, end: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> tuple[int, float]:
    """(ball, fraction) that a ray meets first from outside; (-1, 1) for none. Rays that graze are left to rounding."""
    d, m = end - origin, origin - centers
    a, b, c = d @ d, m @ d, np.einsum("ki,ki->k", m, m) - radii**2
    with np.errstate(invalid="ignore"):
        t = (-b - np.sqrt(b * b - a * c)) / a
    t[~((c > 0) & (t >= 0) & (t <= 1))] = np.inf
    k = int(np.argmin(t))
    return (k, float(t[k])) if np.isfinite(t[k]) else (-1, 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=10000)
    parser.add_argument("--rays", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=22)
    arguments = parser.parse_args()
    compare_pairs(arguments.calls, arguments.seed)
    compare_rays(arguments.rays, arguments.seed)


if __name__ == "__main__":
    main()
