"""Parts of unions: exact products of nested poses, boxes and balls that hold them, extents that no point exceeds."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from mesh_shapes import bumpy_sphere
from naive import extent_along, pose, random_pose, rng_of, unit

import collide
from collide.lowering.extents import extent_of
from collide.narrowphase.composite import composite_parts
from collide.narrowphase.composite.composite_parts import CompoundParts, compound_parts

MESH = collide.Mesh(*bumpy_sphere(30))
EYE = np.eye(4)


def nested(rng, depth: int):
    """A tree of compounds with spheres, boxes and meshes in it."""
    leaf = (collide.Sphere(0.2), collide.Box((0.3, 0.2, 0.5)), MESH)
    items = []
    for _ in range(int(rng.integers(1, 4))):
        deeper = depth > 0 and rng.random() < 0.6
        items.append((nested(rng, depth - 1) if deeper else leaf[int(rng.integers(3))], random_pose(rng)))
    return collide.Compound(items)


def leaves(shape, X):
    """(shape, exact pose of 4 × 4 fractions), depth first."""
    if not isinstance(shape, collide.Compound):
        yield shape, X
        return
    for item, Y in shape.items:
        Y = [[Fraction(y) for y in row] for row in Y.tolist()]
        yield from leaves(item, [[sum(X[i][k] * Y[k][j] for k in range(4)) for j in range(4)] for i in range(4)])


def corners_of(shape) -> np.ndarray:
    """Points whose hull, swept by `radius_of`, holds the shape."""
    if isinstance(shape, collide.Sphere):
        return np.zeros((1, 3))
    if isinstance(shape, collide.Box):
        return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * shape.size
    return shape.vertices


def radius_of(shape) -> float:
    return getattr(shape, "radius", 0.0)


def test_poses_of_parts_are_exact_products_rounded_once():
    rng = rng_of("composite parts")
    rounded = 0
    for _ in range(30):
        shape = nested(rng, 2)
        known = list(leaves(shape, [[Fraction(int(i == j)) for j in range(4)] for i in range(4)]))
        union = compound_parts(shape)
        assert [part.shape for part in union.parts] == [leaf for leaf, _ in known]
        for part, (_, X) in zip(union.parts, known):
            assert part.X.tolist() == [[float(v) for v in row] for row in X]
            lost = [[abs(Fraction(a) - b) for a, b in zip(*rows)] for rows in zip(part.X.tolist(), X)]
            assert sum(v for row in lost[:3] for v in row[:3]) <= part.rotation < 1e-14
            assert sum(row[3] for row in lost[:3]) <= part.shift < 1e-14
            rounded += part.shift > 0.0
        assert union.numbers.tolist() == [k for k, (leaf, _) in enumerate(known) if not leaf.meshed]
        assert (union.convex is None) == (not len(union.numbers)) and compound_parts(shape) is union
        if union.convex is not None:
            assert not union.convex.meshed
            assert [leaf for leaf, _ in leaves(union.convex, X)] == [leaf for leaf, _ in known if not leaf.meshed]
    assert rounded > 20


def test_boxes_balls_and_extents_hold_all_points():
    rng = rng_of("extents of unions")
    for _ in range(25):
        shape, X_WB, n = nested(rng, 1), random_pose(rng, 2.0), unit(rng.normal(size=3))
        union = compound_parts(shape)
        at_poses = [part.at(X_WB[None], np.zeros(1)).X[0] for part in union.parts]
        reached = []
        boxes = union.boxes(X_WB[None])[0]
        assert boxes.shape == (len(union.parts), 6)
        centre, radius = union.ball[:3], union.ball[6]
        middle = X_WB[:3, :3] @ centre + X_WB[:3, 3]
        for part, X, box in zip(union.parts, at_poses, boxes):
            points, r = corners_of(part.shape) @ X[:3, :3].T + X[:3, 3], radius_of(part.shape)
            assert (box[:3] <= points.min(axis=0) - r).all() and (points.max(axis=0) + r <= box[3:]).all()
            assert np.linalg.norm(points - middle, axis=1).max() + r <= radius * (1 + 1e-12)
            reached.append((points @ n).max() + r)
        (value,), error = union.extents(X_WB, n[None])
        assert abs(value - max(reached)) <= error + 1e-13 and error < 1e-12


def test_swapped_keys_and_half_spaces():
    ball, plane = collide.Sphere(0.5), collide.Halfspace((0, 0, 1), 0.25)
    A, B = CompoundParts(collide.Compound([(ball, EYE)])), CompoundParts(collide.Compound([(ball, pose(t=(1, 0, 0)))]))
    assert A.key != B.key and A.key == CompoundParts(collide.Compound([(collide.Sphere(0.5), EYE)])).key
    union = CompoundParts(collide.Compound([(plane, EYE), (ball, EYE)]))
    assert union.unbounded and union.ball is None and not A.unbounded
    n = unit([1.0, 2.0, 3.0])
    (value,), error = A.extents(EYE, n[None])
    assert abs(value + extent_along(ball, EYE, -n)) <= error


def test_extents_of_many_parts_ask_few_of_them(monkeypatch):
    """Of 300 balls along a line the support values of those are worked out that others' do not exceed by their balls;
    values are those of all parts."""
    rng = rng_of("few supports")
    places = np.linspace(0.0, 10.0, 300)
    union = CompoundParts(collide.Compound([(collide.Sphere(0.02), pose(t=(x, 0.1 * np.sin(x), 0.0))) for x in places]))
    directions, asked = np.array([unit(rng.normal(size=3)) for _ in range(20)]), []
    monkeypatch.setattr(composite_parts, "extent_of", lambda *given: asked.append(1) or extent_of(*given))
    X = random_pose(rng, 2.0)
    values, error = union.extents(X, directions)
    centres = np.array([part.X[:3, 3] for part in union.parts]) @ X[:3, :3].T + X[:3, 3]
    assert np.abs(values - ((directions @ centres.T).max(axis=1) + 0.02)).max() <= error + 1e-12
    assert len(asked) < 20 * 10


def test_parts_are_placed_together_as_one_by_one():
    """`placed` of many parts is `Part.at` of each, to the bit; identities and half-spaces among them."""
    rng = rng_of("placed together")
    for _ in range(10):
        items = [(shape, EYE if k % 3 == 0 else random_pose(rng, 1.0)) for k, shape in enumerate(
            (collide.Box((1, 1, 1)), collide.Sphere(0.2), collide.Halfspace((0, 0, 1), 0.25), collide.Cone(0.1, 0.3))
        )]
        union = CompoundParts(collide.Compound(items))
        which = rng.integers(0, len(union.parts), 30)
        X, about = np.array([random_pose(rng, 2.0) for _ in which]), rng.uniform(0, 3, 30)
        placed = union.placed(which, X, about)
        for k, part in enumerate(which.tolist()):
            alone = union.parts[part].at(X[k : k + 1], about[k : k + 1])
            assert placed.X[k].tobytes() == alone.X[0].tobytes() and placed.slop[k] == alone.slop[0]
