"""Contacts of random pairs by Newton's own pipeline and by collide's: verdicts and separations, judged.

200 pairs of a model are asked at once, kept apart by their groups. A verdict is whether the least separation is below
0; it is wrong where it differs from the proven sign by more than single precision. Rationals have the last word for
boxes and hulls, the oracle in decimals for others. Poses are those that Newton's state holds.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

newton = pytest.importorskip("newton", reason="newton is not installed")
import warp as wp
from curved_oracle import bracket
from host_pairs import CORNERS, FACETS
from samples import sizes, told

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


@sizes(200, 10_000)
def test_verdicts_and_separations_are_right(n):
    wp.config.quiet = True
    random, verdicts, off, n_hits = np.random.default_rng(22), Counter(), {"Newton": [], "collide": []}, 0
    model, kinds = model_of(random)
    pipelines = newton.CollisionPipeline(model), Pipeline(model, rigid_contact_max=20_000)
    state, buffers = model.state(), [pipeline.contacts() for pipeline in pipelines]
    world = pipelines[1].world
    for _ in range(max(1, n // N_PAIRS)):
        q, places = random.normal(size=(2 * N_PAIRS, 4)), random.uniform(-0.5, 0.5, (2 * N_PAIRS, 3))
        state.body_q.numpy()[:] = np.hstack([places, q / np.linalg.norm(q, axis=1)[:, None]])
        for pipeline, contacts in zip(pipelines, buffers):
            pipeline.collide(state, contacts)
        gaps = [least_separations(model, state, contacts) for contacts in buffers]
        for pair in range(N_PAIRS):
            bodies = [world.body(2 * pair + k) for k in (0, 1)]
            shapes, poses = [body.shape for body in bodies], [body.X_WB for body in bodies]
            truth = collide.distance(*shapes, *poses)
            n_hits += truth.upper < 0.0
            for who, gap in zip(off, (gaps[0][pair], gaps[1][pair])):
                wrong = verdict(shapes, poses, gap, who)
                assert not wrong or wrong == "Newton wrong", f"{shapes}, {poses}: {gap}, {wrong}"
                if wrong:
                    verdicts["–".join(sorted(kinds[pair])), wrong] += 1
                elif 0.0 < truth.lower < 0.5:
                    off[who].append(abs(gap - truth.distance))
    told(f"{n} pairs of Newton, {n_hits} overlap; wrong verdicts", verdicts)
    print({who: f"gaps off by at most {max(differences):.1e} m" for who, differences in off.items()})
    assert n_hits > 0.05 * n and len(off["collide"]) > 0.1 * n and max(off["collide"]) < 1e-6
