"""Polytopes around and within convex shapes: all of one is in the shape, all of the shape in the other."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from naive import one_of_each, rng_of
from reproduction import reproducing

import collide
from collide.lowering.enclosures import enclosure_of
from collide.lowering.extents import extent_of

CURVED = ("Cylinder", "Cone", "Ellipsoid")


def excess(shape, p: list[Fraction]) -> Fraction:
    """Above 0 outside of a curved shape, exactly."""
    x, y, z = p
    if isinstance(shape, collide.Ellipsoid):
        return sum((c / Fraction(r)) ** 2 for c, r in zip(p, shape.radii.tolist())) - 1
    half, radius = Fraction(shape.length) / 2, Fraction(shape.radius)
    width = radius if isinstance(shape, collide.Cylinder) else radius * (half - z) / (2 * half)
    return max(x * x + y * y - width * width, z - half, -half - z)


def facet_planes(tree) -> tuple[np.ndarray, np.ndarray]:
    """Unit outward normals and offsets of a closed convex surface."""
    corners = tree.triangles.reshape(-1, 3, 3)
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    n /= np.linalg.norm(n, axis=1)[:, None]
    return n, np.einsum("ij,ij->i", n, corners[:, 0])


@pytest.mark.parametrize("kind", CURVED)
@pytest.mark.parametrize("thin", [False, True])
def test_curved_shapes_are_between_their_polytopes(kind, thin):
    rng = rng_of("enclosures", kind, thin)
    shape = one_of_each(rng)[kind]
    if thin:
        shape = collide.Ellipsoid((1.0, 1e-3, 0.3)) if kind == "Ellipsoid" else type(shape)(1e-3, 2.0)
    found = enclosure_of(shape)
    assert enclosure_of(shape) is found and found.outer.shape is shape and found.outer.solid and found.inner.solid
    n, offsets = facet_planes(found.outer.tree)
    with reproducing("print({shape})", shape=repr(shape)):
        for normal, offset in zip(n, offsets):
            reach = extent_of(found.packed, np.eye(4), normal)
            assert reach <= offset + 1e-15, "the shape sticks out"
            assert offset <= 1.1 * reach + 0.1 * found.packed.reach
        corners = found.inner.tree.triangles.reshape(-1, 3)
        assert all(excess(shape, [Fraction(c) for c in p]) < 0 or kind != "Ellipsoid" for p in corners.tolist())
        assert all(excess(shape, [Fraction(c) for c in p]) <= 0 for p in corners.tolist())
        inner_n, inner_offsets = facet_planes(found.inner.tree)
        deep = [extent_of(found.packed, np.eye(4), v) - b for v, b in zip(inner_n, inner_offsets)]
        assert max(deep) < 0.1 * found.packed.reach


def prisms(rng) -> collide.HPolytope:
    """One with corners that no doubles are."""
    sides = rng.normal(size=(7, 3))
    normals = np.vstack([sides / np.linalg.norm(sides, axis=1)[:, None], np.eye(3), -np.eye(3)])
    return collide.HPolytope(normals, rng.uniform(0.3, 1.0, len(normals)))


@pytest.mark.parametrize("seed", range(3))
def test_polytopes_of_planes_are_between_corners_that_may_be_rounded(seed):
    rng = rng_of("enclosed planes", seed)
    shape = prisms(rng)
    found = enclosure_of(shape)
    assert found.packed.slop > 0.0 and found.inner is not None
    planes = [([Fraction(c) for c in n], Fraction(b)) for n, b in zip(shape.normals.tolist(), shape.offsets.tolist())]
    for p in found.inner.tree.triangles.reshape(-1, 3).tolist():
        x = [Fraction(c) for c in p]
        assert all(sum(a * c for a, c in zip(n, x)) <= b for n, b in planes)
    cube = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    stored = [[[Fraction(c) + Fraction(found.packed.slop) * int(s) for c, s in zip(p, corner)] for corner in cube]
              for p in shape.vertices.tolist()]
    for a, b, c in found.outer.tree.triangles.reshape(-1, 3, 3).tolist():
        u, v = ([Fraction(x) - Fraction(y) for x, y in zip(q, a)] for q in (b, c))
        n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        offset = sum(x * Fraction(y) for x, y in zip(n, a))
        corner = [int(x > 0) for x in n]
        assert all(
            sum(x * y for x, y in zip(n, p[4 * corner[0] + 2 * corner[1] + corner[2]])) <= offset for p in stored
        )
    outer = found.outer.tree.triangles.reshape(-1, 3)
    assert max(np.linalg.norm(shape.vertices - p, axis=1).min() for p in outer) < 1e-14
    inner = found.inner.tree.triangles.reshape(-1, 3)
    np.testing.assert_allclose(np.ptp(inner, axis=0), np.ptp(shape.vertices, axis=0), rtol=1e-2)


def test_flat_polytopes_have_none_within():
    sides = np.vstack([np.eye(3), -np.eye(3), [(1, 1, 1)]])
    flat = collide.HPolytope(sides, [1.0, 1.0, 0.1, 1.0, 1.0, -0.1, 1.0 / 3.0])
    found = enclosure_of(flat)
    assert found.inner is None and found.outer.solid
    assert np.array_equal(found.outer.points[0], found.packed.points[0]) or found.packed.slop == 0.0


def test_keys_order_enclosures_by_their_numbers():
    one, same, other = (enclosure_of(collide.Cone(0.5, length)) for length in (1.0, 1.0, 2.0))
    assert one.key == same.key != other.key and one.key == one.outer.key
