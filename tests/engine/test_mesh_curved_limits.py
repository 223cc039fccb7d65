"""`max_distance` beside curved shapes: a small mesh between a shape and the polytope around it is seen.

The engine puts a polytope around a cylinder, cone or ellipsoid and looks for facets near its surface. A mesh far
smaller than
the room between the two, and wholly within it, came no nearer to that surface than the limit, and was told to be
beyond it.
"""

from __future__ import annotations

import naive
import numpy as np
import pytest

import collide

TETRAHEDRON = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
FACES = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
CURVED = {
    "ellipsoid": collide.Ellipsoid((1, 0.8, 0.9)),
    "cylinder": collide.Cylinder(1, 2),
    "cone": collide.Cone(1, 2),
    "planes": collide.HPolytope(
        np.r_[np.eye(3), -np.eye(3), [[1.0, 1.0, 1.0]]] * [[1.1, 0.7, 0.9]], np.array([1.0, 1, 1, 1, 1, 1, 2.1])
    ),
}


def small_mesh(size: float) -> collide.Mesh:
    return collide.Mesh(TETRAHEDRON * size, FACES)


def test_a_part_beside_a_tank_is_within_the_clearance():
    tank, part, X = collide.Ellipsoid((5, 5, 5)), small_mesh(0.005), collide.pose((3.0015, 0, 4.002))
    known = collide.distance(tank, part, np.eye(4), X)
    assert known.certified and 0.0024 < known.distance < 0.0026
    for A, B, X_WA, X_WB in ((tank, part, np.eye(4), X), (part, tank, X, np.eye(4))):
        r = collide.distance(A, B, X_WA, X_WB, max_distance=0.01)
        assert not r.beyond and r.distance == known.distance and r.lower == known.lower
    world = collide.World()
    world.add(tank, name="tank")
    world.add(part, X, name="part")
    assert world.distances(0.01).names == [("tank", "part")]
    assert len(world.contacts(0.01)) == 1


@pytest.mark.many(10)
@pytest.mark.parametrize("size", (1e-2, 1e-3, 1e-4, 1e-6, 1e-9))
@pytest.mark.parametrize("kind", CURVED)
def test_limits_change_nothing_but_what_is_beyond_them(kind, size):
    """Gaps of 0.1 to 1 sizes of the mesh, limits of 1.05 to 3 gaps; swapped, in a compound, in a world."""
    S, part = CURVED[kind], small_mesh(size)
    union = collide.Compound([(part, np.eye(4))])
    rng = naive.rng_of("small meshes", kind, size)
    seen = 0
    for _ in range(25):
        direction = rng.normal(size=3)
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = naive.rotation(rng), 3.0 * direction / np.linalg.norm(direction)
        r = collide.distance(S, part, np.eye(4), X)
        X[:3, 3] -= (r.distance - size * rng.uniform(0.1, 1.0)) * r.normal
        r = collide.distance(S, part, np.eye(4), X)
        told = f"{S} size={size} X=np.array({X.tolist()})"
        if r.lower <= 0.0:
            continue
        seen += 1
        limit = float(r.upper * rng.uniform(1.05, 3.0))
        within = collide.distance(S, part, np.eye(4), X, max_distance=limit)
        assert within.rows.tobytes() == r.rows.tobytes(), f"{told} limit={limit!r}"
        assert not collide.distance(part, S, X, np.eye(4), max_distance=limit).beyond, f"{told} limit={limit!r}"
        assert not collide.distance(union, S, X, np.eye(4), max_distance=limit).beyond, f"{told} limit={limit!r}"
        beyond = collide.distance(S, part, np.eye(4), X, max_distance=float(r.lower * 0.9))
        assert beyond.beyond and r.lower * 0.9 <= beyond.lower <= r.upper, told
        world = collide.World()
        world.add(S)
        world.add(part, X)
        assert len(world.distances(limit)) == 1 and len(world.distances(float(r.lower * 0.9))) == 0, told
    assert seen >= 15


@pytest.mark.parametrize("size", (1e-20, 1e-12, 1e-6, 1.0))
@pytest.mark.parametrize(
    "shape", (collide.Ellipsoid((1, 1, 1)), collide.Cylinder(1e-15, 1e-15), collide.Box((1, 1, 1)), collide.Sphere(0.5))
)
def test_limits_beyond_what_boxes_can_tell(shape, size):
    """Boxes in floats reach 1e20 of the smaller body's sizes; limits beyond that were told to be exceeded by nearer
    bodies."""
    part = small_mesh(size)
    asked = 0
    for far in (1e3, 1e10, 1e15, 1e20, 1e24, 1e30, 1e40):
        for limit in (0.5 * far, 2.0 * far, 1e6 * far):
            r = collide.distance(shape, part, np.eye(4), collide.pose((far, 0, 0)), max_distance=limit)
            assert r.beyond == (limit < 0.9 * far), (shape, size, far, limit)
            assert r.lower <= far, (shape, size, far, limit)
            asked += 1
    assert asked == 21
