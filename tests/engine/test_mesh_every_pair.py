"""Every kind of shape against meshes, through every call: answers that agree with each other, or a refusal by name."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import block_ring, box, bumpy_sphere

import collide

HULL = np.random.default_rng(0).normal(size=(9, 3))
BALL = collide.Mesh(*bumpy_sphere(120))
SHAPES = {
    "solid": BALL, "surface": collide.Mesh(*box(), solid=False), "ring": collide.Mesh(*block_ring()),
    "sphere": collide.Sphere(0.4), "box": collide.Box((0.5, 0.6, 0.7)), "capsule": collide.Capsule(0.2, 0.5),
    "cylinder": collide.Cylinder(0.3, 0.8), "cone": collide.Cone(0.3, 0.8),
    "ellipsoid": collide.Ellipsoid((0.3, 0.5, 0.2)),
    "half-space": collide.Halfspace((0, 0, 1), 0.0), "hull": collide.ConvexHull(HULL),
    "rounded hull": collide.ConvexHull(HULL, radius=0.1),
    "planes": collide.HPolytope(np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1]]]), [0.3] * 6 + [0.6]),
    "union": collide.Compound([(collide.Box((1, 1, 1)), np.eye(4)), (collide.Sphere(0.5), collide.pose((1, 0, 0)))]),
    "union of meshes": collide.Compound([
        (BALL, np.eye(4)), (collide.Cylinder(0.3, 0.4), collide.pose((1, 0, 0), rpy=(0.1, 0.2, 0.3))),
    ]),
}
#: Far apart, near, and into each other.
AWAY = (7.0, 0.9, 0.0)


@pytest.mark.many(6)
@pytest.mark.parametrize("second", SHAPES)
@pytest.mark.parametrize("first", ["solid", "ring", "union of meshes"])
def test_every_call(first, second):
    A, B = SHAPES[first], SHAPES[second]
    rng = np.random.default_rng(list(SHAPES).index(second))
    hits = []
    for away in AWAY:
        X = collide.pose(rng.normal(size=3) * 0.1, rpy=rng.uniform(-3, 3, 3))
        Y = collide.pose((away, 0.1, 0.2), rpy=rng.uniform(-3, 3, 3))
        told = f"{first}, {second}: X, Y = {X.tolist()}, {Y.tolist()}"
        hits.append(hit := collide.collide(A, B, X, Y))
        r = collide.distance(A, B, X, Y)
        assert hit == collide.collide(B, A, Y, X) == r.hit and r.lower <= r.distance <= r.upper, told
        assert (r.distance <= 0.0) == hit and abs(np.linalg.norm(r.normal) - 1.0) < 1e-9, told
        assert (
            collide.distance(A, B, X, Y, signed=False).hit == collide.distance(A, B, X, Y, max_distance=0.05).hit == hit
        ), told
        c = collide.contacts(A, B, X, Y, margin=0.05)
        assert (len(c) > 0) == (r.distance <= 0.05), told
        assert hit or not len(c) or abs(c.distance.min() - r.distance) < 1e-9, told
        if r.certificate is not None:
            collide.verify(A, B, X, Y, r)
        world = collide.World()
        world.add(A, X, name="a")
        world.add(B, Y, name="b")
        assert world.collides() == hit and len(world.collisions()) == hit, told
        assert len(world.distances(0.05)) == (r.distance <= 0.05) and len(world.contacts(0.05)) == len(c), told
        for ask in (collide.facet_pairs, collide.overlay):
            if second in ("solid", "surface", "ring", "box", "hull", "planes") and first != "union of meshes":
                assert hit or not len(ask(A, B, X, Y).pairs), told
            else:
                with pytest.raises(collide.UnsupportedQuery, match=ask.__name__):
                    ask(A, B, X, Y)
    assert len(set(hits)) == 2 or second == "half-space", f"{first}, {second}: {hits}"
