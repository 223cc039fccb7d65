"""Support trees against brute force in Python integers: settled answers are exact maxima, for every hull and
direction."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hull_families import HULLS, directions_for, farthest_of, hull_of, integers, made, snippet

from collide.kernels import address_of, entry, view_f64
from collide.numerics.exact_dot_sign import exact_sign
from collide.numerics.vec3 import put_vec3, vec3_at
from collide.support.build_support_tree import build_support_tree
from collide.support.extreme_vertex import settle_vertex
from collide.support.support_tree_query import extreme_vertex, extreme_vertices

pytest.importorskip("scipy.spatial")


@pytest.mark.many(6)
@pytest.mark.parametrize("name", HULLS)
def test_settled_answers_are_exact(name):
    points, facets, tree = made(name)
    directions = directions_for(points, facets, seed=1)
    whole = integers(points)
    for g, found in zip(directions, extreme_vertices(tree, directions).tolist()):
        assert found in farthest_of(whole, g), snippet(name, g)


@pytest.mark.many(6)
@pytest.mark.parametrize("name", HULLS)
def test_unsettled_answers_are_almost_always_right(name):
    points, _, tree = made(name)
    directions = np.random.default_rng(2).normal(size=(4000, 3))
    values = sum(points[:, axis, None] * directions[:, axis] for axis in range(3))
    found = extreme_vertices(tree, directions, settled=False)
    scale = np.abs(points).max() * np.abs(directions).max(axis=1)
    wrong = values[found, np.arange(4000)] < values.max(axis=0) - 1e-14 * scale
    assert wrong.sum() < 4, snippet(name, directions[wrong][0])
    # An answer within rounding of the best may still be another vertex; rarely, unless points are far away.
    assert (found != values.argmax(axis=0)).sum() < 4 or name == "far away"


def _settle_from(tree_at, points_at, n, starts_at, directions_at, m, out_at):
    from_view = view_f64(starts_at, m)
    g = view_f64(directions_at, 3 * m)
    out = view_f64(out_at, 4 * m)
    for i in range(m):
        if from_view[i] < 0:
            put_vec3(out, 4 * i + 1, extreme_vertex(tree_at, vec3_at(g, 3 * i)).point)
            continue
        out[4 * i] = settle_vertex(tree_at, int(from_view[i]), vec3_at(g, 3 * i))


settle_from = entry("void(int64, int64, int64, int64, int64, int64, int64)")(_settle_from)


@pytest.mark.own_kernels
@pytest.mark.parametrize(
    "name", ["sphere", "pancake", "prism", "bipyramid", "cone", "polygon", "gridded box", "gridded square", "lattice"]
)
def test_climbing_from_anywhere_is_exact(name):
    """From vertices that are far from right, apexes of thousands of neighbours and hubs of flat fans among them."""
    points, facets, tree = made(name)
    directions = directions_for(points, facets, seed=3, each=20)
    degree = np.diff(tree.ring_starts)
    starts = np.random.default_rng(4).choice(np.flatnonzero(degree), size=len(directions)).astype(float)
    starts[::2] = np.argsort(-degree, kind="stable")[: 2][np.arange(len(starts[::2])) % 2]
    out = np.zeros((len(directions), 4))
    settle_from(
        tree.address, address_of(tree.points), len(points), address_of(starts), address_of(directions),
        len(directions), address_of(out),
    )
    whole = integers(points)
    for g, start, found in zip(directions, starts, out[:, 0]):
        assert int(found) in farthest_of(whole, g), f"from {start}: {snippet(name, g)}"


@pytest.mark.own_kernels
def test_coordinates_come_with_the_vertex():
    points, _, tree = made("sphere")
    directions = np.random.default_rng(5).normal(size=(200, 3))
    out, starts = np.zeros((200, 4)), np.full(200, -1.0)
    settle_from(
        tree.address,
        address_of(tree.points),
        len(points),
        address_of(starts),
        address_of(directions),
        200,
        address_of(out),
    )
    assert np.array_equal(out[:, 1:], points[extreme_vertices(tree, directions, settled=False)])


# --- directions that cannot be proven -----------------------------------------------------------


def test_what_cannot_be_proven_is_said():
    points, _, tree = made("small sphere")
    directions = np.array([(1e-308, 1e300, 1.0), (5e-324, 1e308, 0.0), (np.pi, 1e-280, 1e-300), (5e-324, 0.0, 5e-324)])
    whole = integers(points)
    for g, found in zip(directions, extreme_vertices(tree, directions).tolist()):
        assert -len(points) <= found < len(points)
        assert found < 0 or found in farthest_of(whole, g), g.tolist()
    tiny = points * 1e-300
    tree = build_support_tree(tiny, np.arange(100), hull_of(points))
    found = extreme_vertices(tree, np.array([(1.0, 2.0, 3.0), (1.0, 1e-200, 0.0)]))
    assert found[0] == extreme_vertices(made("small sphere")[2], np.array([(1.0, 2.0, 3.0)]))[0]
    with pytest.raises(ValueError, match="larger"):
        build_support_tree(points * 1e200, np.arange(100), hull_of(points))


@pytest.mark.own_kernels
def test_no_number_is_no_proof_and_no_endless_loop():
    points, _, tree = made("small sphere")
    starts, out = np.zeros(3), np.zeros((3, 4))
    directions = np.array([(np.nan, 1.0, 0.0), (np.inf, 1.0, 0.0), (1.0, np.nan, np.nan)])
    settle_from(
        tree.address,
        address_of(tree.points),
        len(points),
        address_of(starts),
        address_of(directions),
        3,
        address_of(out),
    )
    assert (out[:, 0] == -1).all()
    with pytest.raises(ValueError, match="finite"):
        extreme_vertices(tree, directions)


@pytest.mark.own_kernels
def test_a_point_inside_proves_nothing():
    points, _, tree = made("points inside")
    inside = int(np.flatnonzero(np.diff(tree.ring_starts) == 0)[0])
    starts, out, g = np.array([float(inside)]), np.zeros((1, 4)), np.array([(1.0, 2.0, 3.0)])
    settle_from(
        tree.address, address_of(tree.points), len(points), address_of(starts), address_of(g), 1, address_of(out)
    )
    assert out[0, 0] == -1 - inside


def _signs(rows_at, n, out_at):
    rows = view_f64(rows_at, 9 * n)
    out = view_f64(out_at, n)
    for i in range(n):
        out[i] = exact_sign(vec3_at(rows, 9 * i), vec3_at(rows, 9 * i + 3), vec3_at(rows, 9 * i + 6))


signs = entry("void(int64, int64, int64)")(_signs)


@pytest.mark.own_kernels
def test_exact_sign_against_fractions():
    """Ties, near ties, cancellation, and differences of points that are no doubles."""
    rng = np.random.default_rng(6)
    rows = []
    for _ in range(3000):
        a, b, g = (rng.normal(size=3) * 10.0 ** rng.integers(-12, 12, size=3) for _ in range(3))
        kind = rng.integers(0, 6)
        if kind == 0:
            a, b, g = (rng.integers(-9, 10, size=3).astype(float) for _ in range(3))
        elif kind == 1:  # tie by symmetry
            b, g = np.array([a[1], a[0], a[2]]), np.array([g[0], g[0], g[2]])
        elif kind == 2:  # the same, off by an ulp
            b, g = np.array([a[1], a[0], np.nextafter(a[2], 9e9)]), np.array([g[0], g[0], g[2]])
        elif kind == 3:
            g[2] = -((a[0] - b[0]) * g[0] + (a[1] - b[1]) * g[1]) / (a[2] - b[2])
        elif kind == 4:
            b = a + rng.integers(-2, 3, size=3) * np.spacing(a)
        rows.append([*a, *b, *g])
    rows = np.array(rows)
    out = np.zeros(len(rows))
    signs(address_of(rows), len(rows), address_of(out))
    seen = set()
    for row, sign in zip(rows.tolist(), out.tolist()):
        exact = [Fraction(c) for c in row]
        value = sum((exact[k] - exact[3 + k]) * exact[6 + k] for k in range(3))
        assert sign == (value > 0) - (value < 0), row
        seen.add(sign)
    assert seen == {-1, 0, 1}
