"""`raycast` against every shape: brackets judged by exact membership, misses by exact samples, semantics by hand."""

from __future__ import annotations

import numpy as np
import pytest
from cast_oracles import holds, on_ray
from naive import random_pose, rng_of
from reproduction import reproducing

import collide

EYE = np.eye(4)
SHAPES = {
    "Sphere": collide.Sphere(0.5), "Capsule": collide.Capsule(0.3, 0.8), "Cylinder": collide.Cylinder(0.4, 0.7),
    "Cone": collide.Cone(0.5, 0.8), "Ellipsoid": collide.Ellipsoid((0.6, 0.3, 0.2)),
    "Halfspace": collide.Halfspace((0.2, -0.3, 0.9), 0.1), "Box": collide.Box((0.6, 0.8, 0.5)),
}
AGAIN = "import collide, numpy as np; print(collide.raycast(collide.{shape!r}, np.array({X}), {o}, {d}, all_hits=True))"


def rays_about(rng, X, n):
    """At random, past the edge, along the axes of the shape, and from inside."""
    origins = X[:3, 3] + rng.normal(size=(n, 3)) * rng.choice([0.07, 2.0, 50.0], size=(n, 1))
    directions = X[:3, 3] + 0.45 * rng.normal(size=(n, 3)) - origins
    along = rng.random(n) < 0.3
    directions[along] = X[:3, rng.integers(3)] * rng.choice([-1.0, 1.0], size=(int(along.sum()), 1))
    beside = 0.3 * rng.normal(size=(int(along.sum()), 3))
    origins[along] = X[:3, 3] + beside - 3.0 * directions[along]
    return origins, directions * 2.0 ** rng.integers(-20, 20, size=(n, 1))


@pytest.mark.many(6)
@pytest.mark.parametrize("kind", SHAPES)
def test_brackets_hold_the_surface(kind):
    """Just before the first bracket the ray is not inside, just behind it it is; nowhere on a miss."""
    rng = rng_of(f"rays at {kind}")
    shape, hits, inside, narrow = SHAPES[kind], 0, 0, 0
    for _ in range(6):
        X = random_pose(rng, 0.5)
        origins, directions = rays_about(rng, X, 20)
        every = collide.raycast(shape, X, origins, directions, all_hits=True)
        first = collide.raycast(shape, X, origins, directions)
        for k, (o, d) in enumerate(zip(origins, directions)):
            with reproducing(AGAIN, shape=shape, X=X, o=o, d=d):
                rows = slice(*every.starts[k : k + 2])
                starts_inside = holds(shape, X, on_ray(o, d, 0), strictly=True)
                assert first.hit[k] == every.hit[k] == (rows.start < rows.stop)
                inside += starts_inside
                if not first.hit[k]:
                    assert first.certified[k] and (kind == "Halfspace" or not starts_inside)
                    if starts_inside:
                        continue
                    size = (np.linalg.norm(o - X[:3, 3]) + 2.0) / np.linalg.norm(d)
                    assert not any(holds(shape, X, on_ray(o, d, t)) for t in np.linspace(0, 2 * size, 40))
                    continue
                hits += 1
                assert first.distance[k] == every.distance[rows.start]
                assert first.lower[k] <= first.distance[k] <= first.upper[k]
                narrow += bool(first.certified[k])
                if not first.certified[k]:
                    continue
                before, behind = (holds(shape, X, on_ray(o, d, t), True) for t in (first.lower[k], first.upper[k]))
                assert (before, behind) == ((True, False) if starts_inside else (False, True)) or kind == "Box"
                assert abs(np.linalg.norm(first.normal[k]) - 1) < 1e-12
                assert (first.normal[k] @ d > 0) == starts_inside
                assert np.allclose(first.point[k], o + first.distance[k] * d, rtol=1e-15, atol=0)
    assert hits > 40 and inside > 5 and narrow > 0.95 * hits, (hits, inside, narrow)


def test_swept_hulls_are_their_definition():
    """A hull swept by a ball is met where the ball, cast along the ray, meets the hull."""
    rng = rng_of("rays at swept hulls")
    core = collide.ConvexHull(0.5 * rng.normal(size=(12, 3)))
    swept, ball = collide.ConvexHull(core.points, radius=0.2), collide.Sphere(0.2)
    X = np.array([random_pose(rng, 0.4) for _ in range(60)])
    origins = 4.0 * rng.normal(size=(60, 3))
    directions = 0.6 * rng.normal(size=(60, 3)) - origins
    r = collide.raycast(swept, X, origins, directions)
    c = collide.shape_cast(ball, [collide.pose(o) for o in origins], directions, core, X)
    ahead = ~c.at_start
    assert (r.hit == c.hit)[ahead].all() and 0.3 < r.hit.mean() < 1.0
    both = ahead & r.hit & r.certified & c.certified
    assert both.sum() > 20
    assert (np.maximum(r.lower, c.lower)[both] <= np.minimum(r.upper, c.upper)[both]).all()


def test_polytopes_of_a_compound_are_decided_exactly():
    """Through edges, along faces, an ulp beside: as facets of the box alone say."""
    box = collide.Box((2, 2, 2))
    union = collide.Compound([(box, EYE)])
    edge = np.nextafter(1.0, 2)
    origins = [(3, 1, 0.3), (3, edge, 0.3), (3, 1, 1), (3, 0.3, 0.2), (1, 0, 0), (0, 0, 0), (3, 0, 1)]
    for o in origins:
        alone, within = (collide.raycast(shape, EYE, o, (-1, 0, 0)) for shape in (box, union))
        assert (alone.hit, alone.distance, alone.certified) == (within.hit, within.distance, within.certified)
        assert within.lower <= within.distance <= within.upper
    assert not collide.raycast(union, EYE, (3, edge, 0.3), (-1, 0, 0)).hit


def test_what_is_met_inside_and_on_the_surface():
    ball = collide.Sphere(1.0)
    assert collide.raycast(ball, EYE, (0, 0, 0), (2, 0, 0)).distance == 0.5
    on = collide.raycast(ball, EYE, (-1, 0, 0), (1, 0, 0))
    assert on.hit and on.distance == 0.0 and not on.certified
    assert not collide.raycast(ball, EYE, (2, 0, 0), (1, 0, 0)).hit
    touching = collide.raycast(ball, EYE, (-3, 1, 0), (1, 0, 0))
    assert touching.hit and not touching.certified and touching.lower <= 3.0 <= touching.upper
    limited = collide.raycast(ball, EYE, (-3, 0, 0), (1, 0, 0), max_distance=1.9)
    assert not limited.hit and limited.certified
    every = collide.raycast(ball, EYE, [(-3, 0, 0), (0, 0, 0), (0, 5, 0)], (1, 0, 0), all_hits=True)
    assert every.starts.tolist() == [0, 2, 3, 3] and every.distance.tolist() == [2.0, 4.0, 1.0]
    floor = collide.Halfspace((0, 0, 1), 0.0)
    r = collide.raycast(floor, EYE, [(0, 0, 1), (0, 0, 0), (0, 0, 1e-300), (0, 0, -1)], (1, 0, 0))
    assert r.hit.tolist() == [False, True, False, False] and r.certified.all() and r.distance[1] == 0.0


def test_sides_and_items():
    can, cone, pill = collide.Cylinder(1, 2), collide.Cone(1, 2), collide.Capsule(1, 2)
    for shape, o, d, side in (
        (can, (3, 0, 0), (-1, 0, 0), 0), (can, (0.1, 0, 3), (0, 0, -1), 2), (can, (0.1, 0, -3), (0, 0, 1), 1),
        (cone, (0.1, 0, -3), (0, 0, 1), 1), (cone, (0.1, 0, 3), (0, 0, -1), 0), (pill, (3, 0, 0.5), (-1, 0, 0), 0),
        (pill, (0.1, 0, 5), (0, 0, -1), 2), (pill, (0.1, 0, -5), (0, 0, 1), 1),
    ):
        assert collide.raycast(shape, EYE, o, d).facet == side
    mesh = collide.Mesh(*collide.tessellate(collide.Box((1, 1, 1)), tolerance=1e-3)[:2])
    ball = collide.Sphere(0.5)
    union = collide.Compound([(ball, collide.pose((-3, 0, 0))), (mesh, EYE), (can, collide.pose((4, 0, 0)))])
    r = collide.raycast(union, EYE, (-9, 0.1, 0.2), (1, 0, 0), all_hits=True)
    assert r.item.tolist() == [0, 0, 1, 1, 2, 2] and r.certified.all()
    assert r.facet[2] >= 0 and np.allclose(r.distance[2:4], [8.5, 9.5])
    assert collide.raycast(union, EYE, (-9, 0.1, 0.2), (1, 0, 0)).item == 0


@pytest.mark.parametrize("kind", SHAPES)
def test_one_by_one_and_in_batches(kind):
    rng = rng_of(f"ray batches {kind}")
    shape = SHAPES[kind]
    X = np.array([random_pose(rng, 0.5) for _ in range(30)])
    origins, directions = rays_about(rng, X[0], 30)
    together = collide.raycast(shape, X, origins, directions)
    for k in range(30):
        alone = collide.raycast(shape, X[k], origins[k], directions[k])
        for name in ("hit", "distance", "lower", "upper", "point", "normal", "facet", "certified", "item"):
            assert np.asarray(getattr(alone, name)).tobytes() == getattr(together, name)[k].tobytes()


@pytest.mark.parametrize("scale", [1e-40, 1e-12, 1e12, 1e40])
def test_any_size(scale):
    """All lengths multiplied: t is the same, and proven as well."""
    core = scale * np.array([(0, 0, 0.4), (0.5, 0, -0.4), (-0.5, 0.4, 0), (0, -0.5, 0)])
    for shape in (
        collide.Capsule(0.3 * scale, 0.8 * scale), collide.Cylinder(0.4 * scale, 0.7 * scale),
        collide.Cone(0.5 * scale, 0.8 * scale), collide.Ellipsoid(scale * np.array([0.6, 0.3, 0.2])),
        collide.ConvexHull(core, radius=0.1 * scale),
    ):
        r = collide.raycast(shape, EYE, np.array([-3, 0.05, 0.02]) * scale, (scale, 0, 0))
        assert r.hit and r.certified and 2.2 < r.distance < 3.0, shape
        r = collide.raycast(shape, EYE, np.array([-3, 2, 0.02]) * scale, (scale, 0, 0))
        assert r.certified and not r.hit, shape


def test_rays_along_axes_and_nearly_so():
    """Where a quadric's leading coefficient vanishes, and where it is all rounding."""
    shapes = collide.Cylinder(0.5, 2.0), collide.Cone(0.5, 2.0), collide.Capsule(0.5, 2.0)
    for shape, length in zip(shapes, (2.0, None, None)):
        for tilt in (0.0, 1e-17, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3):
            for X in (EYE, collide.pose((0.1, 0.2, 0.3), rpy=(0.3, -0.7, 1.9))):
                d = X[:3, :3] @ np.array([tilt, 0, 1.0])
                o = X[:3, 3] + X[:3, :3] @ np.array([0.2, 0.1, -5.0])
                r = collide.raycast(shape, X, o, d)
                assert r.hit and r.certified, (shape, tilt)
                every = collide.raycast(shape, X, o, d, all_hits=True)
                assert len(every.distance) == 2 and every.certified.all()
                if length is not None:
                    assert abs(every.distance[1] - every.distance[0] - length) < 1e-2
                o = X[:3, 3] + X[:3, :3] @ np.array([0.6, 0.1, -5.0])
                beside = collide.raycast(shape, X, o, d)
                assert not beside.hit and beside.certified


def test_the_first_hit_has_the_same_bits_among_all_hits():
    """Facets that were not first had it worked out exactly, or not: an ulp between the two in one of a hundred rays."""
    rng = rng_of(31)
    vertices, faces = collide.tessellate(collide.Sphere(1.0))[:2]
    n_hits = 0
    for _ in range(6):
        mesh, X = collide.Mesh(vertices * rng.uniform(0.3, 1.5, 3), faces), random_pose(rng)
        origins = X[:3, 3] + 4.0 * rng.normal(size=(200, 3))
        directions = X[:3, 3] + 0.3 * rng.normal(size=(200, 3)) - origins
        one, every = (collide.raycast(mesh, X, origins, directions, all_hits=all_hits) for all_hits in (False, True))
        assert np.array_equal(one.hit, every.hit)
        first = every.starts[:-1][one.hit]
        for name in ("distance", "lower", "upper", "point", "normal", "facet"):
            assert np.array_equal(getattr(one, name)[one.hit], getattr(every, name)[first]), name
        n_hits += int(one.hit.sum())
    assert n_hits > 600
