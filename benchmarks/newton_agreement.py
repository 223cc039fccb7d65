"""Contacts of random pairs by Newton's own pipeline and by collide's: verdicts and separations, judged.

python benchmarks/newton_agreement.py [--calls 10000] [--seed 22]

Each call is a pair of bodies near each other; 200 pairs of a model are asked at once, kept apart by their groups. A
verdict is whether the least separation is below 0. Where it differs from the proven sign by more than single precision,
it is wrong; rationals have the last word for boxes and hulls, the tests' oracle in decimals for others. Poses are those
that Newton's state holds.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

import newton
import numpy as np
import warp as wp

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).resolve().parents[1] / "tests" / "oracles")]
from curved_oracle import bracket
from host_agreement import CORNERS, FACETS

import collide
from collide.adapters.hosts.newton import Pipeline
from collide.adapters.peers import exact

KINDS = ("box", "sphere", "capsule", "cylinder", "cone", "ellipsoid", "convex")
N_PAIRS = 200
#: Single precision at lengths of a metre, after some arithmetic [m].
SINGLE = 2e-6


def add_shape(builder, body: int, kind: str, s: np.ndarray, group: int) -> None:
    """A shape of a kind and three lengths; pairs of equal groups are tested."""
    config = newton.ModelBuilder.ShapeConfig(collision_group=group, gap=0.5)
    if kind == "box":
        builder.add_shape_box(body, hx=s[0] / 2, hy=s[1] / 2, hz=s[2] / 2, cfg=config)
    elif kind == "sphere":
        builder.add_shape_sphere(body, radius=s[0] / 2, cfg=config)
    elif kind == "ellipsoid":
        builder.add_shape_ellipsoid(body, rx=s[0] / 2, ry=s[1] / 2, rz=s[2] / 2, cfg=config)
    elif kind == "convex":
        mesh = newton.Mesh((CORNERS * s).astype(np.float32), np.ravel(FACETS))
        builder.add_shape_convex_hull(body, mesh=mesh, cfg=config)
    else:
        add = getattr(builder, f"add_shape_{kind}")
        add(body, radius=s[0] / 2, half_height=s[1] / 2, cfg=config)


def model_of(random: np.random.Generator):
    """A model of pairs, and the two kinds of each."""
    builder, kinds = newton.ModelBuilder(), []
    for pair in range(N_PAIRS):
        kinds.append(tuple(KINDS[k] for k in random.integers(len(KINDS), size=2)))
        for kind in kinds[-1]:
            add_shape(builder, builder.add_body(), kind, random.uniform(0.2, 1.0, 3), pair + 1)
    return builder.finalize(device="cpu"), kinds


def least_separations(model, state, contacts) -> np.ndarray:
    """(pairs,) the least of each pair, as Newton works separations out of contacts; infinite where there is none."""
    n = int(contacts.rigid_contact_count.numpy()[0])
    gaps = wp.zeros(len(contacts.rigid_contact_shape0), dtype=float, device="cpu")
    newton.eval_rigid_contact_kinematics(model, state, contacts, out_distance=gaps)
    out = np.full(N_PAIRS, np.inf)
    np.minimum.at(out, contacts.rigid_contact_shape0.numpy()[:n] // 2, gaps.numpy()[:n])
    return out


def verdict(shapes: list, poses: list, gap: float, who: str) -> str | None:
    """None where a separation has the right sign, or is within single precision of it."""
    r = collide.distance(*shapes, *poses)
    if abs(r.distance) <= SINGLE or (gap < 0.0) == (r.upper < 0.0):
        return None
    if all(isinstance(shape, collide.Box | collide.ConvexHull) for shape in shapes):
        points = [CORNERS * s.size if isinstance(s, collide.Box) else s.points for s in shapes]
        truth = exact.hit(points[0], poses[0][:3, :3], poses[0][:3, 3], points[1], poses[1][:3, :3], poses[1][:3, 3])
    else:
        truth = bracket(*shapes, *poses, depths=False).upper < 0
    return "OURS WRONG: proven sign" if truth == (gap < 0.0) else f"{who} wrong"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--calls", type=int, default=10000)
    parser.add_argument("--seed", type=int, default=22)
    arguments = parser.parse_args()
    wp.config.quiet = True
    random = np.random.default_rng(arguments.seed)
    verdicts: Counter = Counter()
    off: dict[str, list[float]] = {"Newton": [], "collide": []}
    spent, n_hits, missed = np.zeros(2), 0, []
    model, kinds = model_of(random)
    pipelines = newton.CollisionPipeline(model), Pipeline(model, rigid_contact_max=20_000)
    state, buffers = model.state(), [pipeline.contacts() for pipeline in pipelines]
    world = pipelines[1].world
    for _ in range(arguments.calls // N_PAIRS):
        q = random.normal(size=(2 * N_PAIRS, 4))
        places = random.uniform(-0.5, 0.5, (2 * N_PAIRS, 3))
        state.body_q.numpy()[:] = np.hstack([places, q / np.linalg.norm(q, axis=1)[:, None]])
        gaps = []
        for k, (pipeline, contacts) in enumerate(zip(pipelines, buffers)):
            pipeline.collide(state, contacts)
            begin = time.perf_counter()
            pipeline.collide(state, contacts)
            spent[k] += time.perf_counter() - begin
        X_WB = np.array([world.body(k).X_WB for k in range(2 * N_PAIRS)])
        gaps = [least_separations(model, state, contacts) for contacts in buffers]
        for pair in range(N_PAIRS):
            shapes = [world.body(2 * pair + k).shape for k in (0, 1)]
            poses = [X_WB[2 * pair], X_WB[2 * pair + 1]]
            truth = collide.distance(*shapes, *poses)
            n_hits += truth.upper < 0.0
            for who, gap in zip(off, (gaps[0][pair], gaps[1][pair])):
                wrong = verdict(shapes, poses, gap, who)
                if wrong:
                    verdicts["–".join(sorted(kinds[pair])), wrong] += 1
                    missed.append((gap, truth.distance))
                elif 0.0 < truth.lower < 0.5:
                    off[who].append(abs(gap - truth.distance))
    n = arguments.calls // N_PAIRS * N_PAIRS
    print(f"{n} pairs, {n_hits} overlap; wrong verdicts:")
    for (both, wrong), count in sorted(verdicts.items()):
        print(f"  {both:22} {wrong:26} {count}")
    if missed:
        (low, true_low), (high, true_high) = np.min(missed, axis=0), np.max(missed, axis=0)
        print(f"said to be {low:.1e} to {high:.1e} m apart, and are {true_low:.3f} to {true_high:.3f} m")
    for who, differences in off.items():
        print(f"gaps of {who}: median off by {np.median(differences):.1e} m, greatest {np.max(differences):.1e} m")
    print(f"a pair: Newton {1e6 * spent[0] / n:.2f} µs, collide {1e6 * spent[1] / n:.2f} µs")


if __name__ == "__main__":
    main()
