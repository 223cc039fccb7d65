"""Overlays: pairs, kinds and pieces against brute force in fractions; areas of triangulations of one polygon add up."""

from __future__ import annotations

from fractions import Fraction
from itertools import combinations, pairwise

import numpy as np
import pytest
from mesh_families import FAMILIES, random_pose, right_angle_pose
from mesh_shapes import box, bumpy_sphere
from naive_triangles import cross, inner, minus, triangles_meet, world_points

import collide
from collide.errors import InvalidArgument, UnsupportedQuery

ZERO = [0, 0, 0]


def in_triangle(p, T) -> bool:
    """Whether a point is in a closed triangle, whatever it is."""
    n = cross(minus(T[1], T[0]), minus(T[2], T[0]))
    if n == ZERO:
        return any(on_segment(p, T[k], T[(k + 1) % 3]) for k in range(3))
    if inner(n, minus(p, T[0])) != 0:
        return False
    return all(inner(n, cross(minus(T[(k + 1) % 3], T[k]), minus(p, T[k]))) >= 0 for k in range(3))


def on_segment(p, a, b) -> bool:
    e, w = minus(b, a), minus(p, a)
    return cross(e, w) == ZERO and 0 <= inner(e, w) <= inner(e, e) and (e != ZERO or w == ZERO)


def crossings(a, b, T):
    """Points where the segment from a to b may enter or leave the triangle, but for its ends."""
    found = []
    n, e = cross(minus(T[1], T[0]), minus(T[2], T[0])), minus(b, a)
    slope = inner(n, e)
    if slope != 0:
        t = Fraction(inner(n, minus(T[0], a)), slope)
        found.append([x + t * y for x, y in zip(a, e)])
    for k in range(3):
        f, w = minus(T[(k + 1) % 3], T[k]), minus(T[k], a)
        m = cross(e, f)
        if m != ZERO and inner(m, w) == 0:
            t = Fraction(inner(cross(w, f), m), inner(m, m))
            found.append([x + t * y for x, y in zip(a, e)])
    return [p for p in found if on_segment(p, a, b) and in_triangle(p, T)]


def common_points(P, Q):
    """The extreme points of what two triangles share, and some more of it."""
    found = [p for p in P if in_triangle(p, Q)] + [q for q in Q if in_triangle(q, P)]
    for S, T in ((P, Q), (Q, P)):
        for k in range(3):
            found += crossings(S[k], S[(k + 1) % 3], T)
    return [list(p) for p in {tuple(map(Fraction, p)) for p in found}]


def described(points):
    """(kind, length or twice the area squared, ends or extreme points) of the hull of points in one plane."""
    if len(points) == 1:
        return 1, Fraction(0), points
    n = next((m for a, b, c in combinations(points, 3) if (m := cross(minus(b, a), minus(c, a))) != ZERO), None)
    if n is None:
        a, b = max(combinations(points, 2), key=lambda pair: inner(*[minus(*pair)] * 2))
        return 2, inner(minus(a, b), minus(a, b)), [a, b]
    corners = [
        p for p in points if not any(in_triangle(p, T) for T in combinations([q for q in points if q != p], 3))
    ]
    centre = [sum(x) / len(corners) for x in zip(*corners)]
    first = minus(corners[0], centre)
    side = cross(n, first)

    def angle(p):
        x, y = (
            Fraction(inner(minus(p, centre), first), inner(first, first)),
            Fraction(inner(minus(p, centre), side), inner(side, side)),
        )
        # `side` is |n| times as long as `first`: other quadrants' order is the same.
        return np.arctan2(float(y) * float(inner(n, n)) ** 0.5, float(x))

    order = sorted(corners, key=angle)
    total = ZERO
    for p, q in pairwise(order[1:]):
        total = [x + y for x, y in zip(total, cross(minus(p, order[0]), minus(q, order[0])))]
    return 3, inner(total, total), order


def check(A, B, X, Y):
    """An overlay against brute force; returns how many of each kind."""
    meshes = [collide.Mesh(*m, solid=False) for m in (A, B)]
    got = collide.overlay(*meshes, X, Y, check_poses=False)
    case = (A[0].tolist(), A[1].tolist(), X.tolist(), B[0].tolist(), B[1].tolist(), Y.tolist())
    points = [world_points(v, Z) for (v, _), Z in ((A, X), (B, Y))]
    corners = [[[points[k][v] for v in f] for f in faces.tolist()] for k, (_, faces) in enumerate((A, B))]
    kinds = np.zeros(4, dtype=int)
    want = []
    for i, P in enumerate(corners[0]):
        for j, Q in enumerate(corners[1]):
            common = common_points(P, Q)
            if common:
                want.append((i, j, common))
    assert got.pairs.tolist() == [[i, j] for i, j, _ in want], case
    assert got.starts.tolist() == [0, len(want)] and got.corner_starts[-1] == len(got.corners)
    for k, (i, j, common) in enumerate(want):
        kind, square, extreme = described(common)
        piece = got.corners[got.corner_starts[k] : got.corner_starts[k + 1]]
        assert got.kind[k] == kind and len(piece) == len(extreme), (i, j, case)
        largest = max(abs(float(x)) for T in (corners[0][i], corners[1][j]) for p in T for x in p)
        true = np.array([[float(x) for x in p] for p in extreme])
        for row in piece:
            assert np.abs(true - row).max(axis=1).min() <= 2.0**-40 * largest, (i, j, case)
        for row in true:
            assert np.abs(piece - row).max(axis=1).min() <= 2.0**-40 * largest, (i, j, case)
        if kind == 3:  # A's way round
            ring, (a, b, c) = piece - piece[0], np.array([[float(x) for x in p] for p in corners[0][i]])
            assert np.cross(ring[1:-1], ring[2:]).sum(axis=0) @ np.cross(b - a, c - a) > 0.0, (i, j, case)
        size = float(square) ** 0.5 * (0.5 if kind == 3 else 1.0)
        slack = 2.0**-36 * largest if kind == 2 else 0.0
        assert abs(got.size[k] - size) <= slack + 1e-14 * size, (i, j, got.size[k], size, case)
        kinds[kind] += 1
    return kinds


@pytest.mark.many(6)
@pytest.mark.parametrize("name", FAMILIES)
def test_pieces_are_those_of_brute_force(name):
    make, _ = FAMILIES[name]
    rng = np.random.default_rng(list(FAMILIES).index(name) + 90)
    kinds = np.zeros(4, dtype=int)
    for _ in range(4):
        A, B, X, Y = make(rng)
        A, B = (A[0], A[1][:8]), (B[0], B[1][:8])
        kinds += check(A, B, X, Y)
    least = {
        "grid": (3, 3, 1),
        "flat": (0, 0, 3),
        "identical": (0, 3, 3),
        "degenerate": (3, 1, 0),
        "touching": (3, 0, 0),
    }
    assert (kinds[1:] >= least.get(name, (0, 1, 0))).all(), kinds


def polygon_triangulated(rng, n):
    """A triangulation of the square of side 4 with corners on a grid of 16ths: cut again and again."""
    triangles = [np.array([[0, 0], [4, 0], [4, 4.0]]), np.array([[0, 0], [4, 4], [0, 4.0]])]
    while len(triangles) < n:
        k = int(
            np.argmax(
                [abs((t[1] - t[0])[0] * (t[2] - t[0])[1] - (t[1] - t[0])[1] * (t[2] - t[0])[0]) for t in triangles]
            )
        )
        a, b, c = np.roll(triangles.pop(k), rng.integers(3), axis=0)
        middle = np.round((0.5 * a + 0.25 * b + 0.25 * c) * 64) / 64
        triangles += [np.array(t) for t in ((a, b, middle), (b, c, middle), (c, a, middle))]
    corners = np.concatenate(triangles)
    return np.concatenate([corners, np.full((len(corners), 1), 0.75)], axis=1), np.arange(len(corners)).reshape(-1, 3)


def exact_area(got) -> Fraction:
    """Twice the area of the polygons in the plane, from the corners as given."""
    total = Fraction(0)
    for k in np.flatnonzero(got.kind == 3):
        ring = [[Fraction(x) for x in p] for p in got.corners[got.corner_starts[k] : got.corner_starts[k + 1]].tolist()]
        total += sum(p[0] * q[1] - p[1] * q[0] for p, q in zip(ring, [*ring[1:], ring[0]]))
    return total


def test_areas_of_one_polygon_triangulated_twice_add_up():
    rng = np.random.default_rng(8)
    A, B = (collide.Mesh(*polygon_triangulated(rng, n), solid=False) for n in (24, 17))
    got = collide.overlay(A, B, np.eye(4), np.eye(4))
    areas = got.size[got.kind == 3]
    assert abs(areas.sum() - 16.0) < 1e-13 and (areas > 0).all() and len(areas) > 40
    assert abs(exact_area(got) - 32) < Fraction(1, 2**45)  # all of one sense of turn, and no gap
    per_facet = np.zeros(len(A.faces))
    np.add.at(per_facet, got.pairs[:, 0], np.where(got.kind == 3, got.size, 0.0))
    corners = A.vertices[A.faces]
    areas = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    assert np.allclose(per_facet, areas, rtol=1e-13)
    X = random_pose(rng)
    turned = collide.overlay(A, B, X, X)
    assert np.array_equal(turned.pairs, got.pairs) and np.array_equal(turned.kind, got.kind)
    shifted = collide.overlay(A, B, np.eye(4), collide.pose((1.5, 1, 0)))
    assert abs(shifted.size[shifted.kind == 3].sum() - 2.5 * 3) < 1e-13


def test_swapped_arguments_give_the_same_pieces():
    rng = np.random.default_rng(31)
    A, B = collide.Mesh(*box()), collide.Mesh(*bumpy_sphere(200))
    for X, Y in ((random_pose(rng, 0.1), random_pose(rng, 0.2)), (right_angle_pose(rng), np.eye(4))):
        one, other = collide.overlay(A, B, X, Y), collide.overlay(B, A, Y, X)
        order = np.lexsort((other.pairs[:, 0], other.pairs[:, 1]))
        assert len(one.pairs) > 20 and np.array_equal(one.pairs, other.pairs[order][:, ::-1])
        assert np.array_equal(one.kind, other.kind[order]) and np.allclose(
            one.size, other.size[order], rtol=1e-9, atol=1e-12
        )


def test_batches_and_shapes():
    rng = np.random.default_rng(32)
    mesh, cube = collide.Mesh(*bumpy_sphere(300)), collide.Box((1, 1.5, 2))
    poses = np.array([random_pose(rng, 0.4) for _ in range(6)])
    together = collide.overlay(mesh, cube, np.eye(4), poses)
    for k, X in enumerate(poses):
        alone = collide.overlay(mesh, cube, np.eye(4), X)
        rows = slice(*together.starts[k : k + 2])
        ends = slice(*together.corner_starts[[rows.start, rows.stop]])
        for name in ("pairs", "kind", "size"):
            assert getattr(alone, name).tobytes() == getattr(together, name)[rows].tobytes()
        assert alone.corners.tobytes() == together.corners[ends].tobytes() and len(alone.pairs) > 5
    pairs = collide.facet_pairs(mesh, cube, np.eye(4), poses)
    assert np.array_equal(pairs.pairs, together.pairs) and np.array_equal(pairs.starts, together.starts)


def test_facet_pairs_are_those_of_brute_force():
    rng = np.random.default_rng(33)
    total = met = 0
    for name in ("grid", "random", "flat", "degenerate"):
        for _ in range(2):
            A, B, X, Y = FAMILIES[name][0](rng)
            corners = [
                [[p[v] for v in f] for f in m[1].tolist()] for m, Z in ((A, X), (B, Y)) for p in [world_points(m[0], Z)]
            ]
            want = [[i, j] for i, P in enumerate(corners[0]) for j, Q in enumerate(corners[1]) if triangles_meet(P, Q)]
            one, other = (collide.Mesh(*m, solid=False) for m in (A, B))
            got, first = collide.facet_pairs(one, other, X, Y), collide.facet_pairs(one, other, X, Y, first=True)
            assert got.pairs.tolist() == want and got.counters.shape == (1, 3)
            assert len(first.pairs) == bool(want) and all(pair in want for pair in first.pairs.tolist())
            swapped = collide.facet_pairs(other, one, Y, X)
            assert sorted(swapped.pairs[:, ::-1].tolist()) == want
            total, met = total + len(A[1]) * len(B[1]), met + len(want)
    assert 0.03 < met / total < 0.9


def test_self_collisions_of_a_mesh():
    clean = collide.self_collisions(collide.Mesh(*box()))
    assert not clean.hit and clean.facets.shape == (0,) and clean.pairs.shape == (0, 2)
    twice = np.concatenate([box()[0], box()[0] + 0.5]), np.concatenate([box()[1], box()[1] + 8])
    found = collide.self_collisions(collide.Mesh(*twice))
    assert found.hit and (found.pairs[:, 0] < 12).all() and (found.pairs[:, 1] >= 12).all()
    assert np.array_equal(found.facets, np.unique(found.pairs)) and found.counters[1] >= len(found.pairs)
    with pytest.raises(InvalidArgument, match="mesh must be a Mesh"):
        collide.self_collisions(collide.Box((1, 1, 1)))


def test_what_is_refused():
    mesh = collide.Mesh(*box())
    for call in (collide.facet_pairs, collide.overlay):
        with pytest.raises(InvalidArgument, match="must be a Mesh"):
            call(collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), np.eye(4), np.eye(4))
        with pytest.raises(InvalidArgument, match="must be a shape"):
            call(mesh, 3, np.eye(4), np.eye(4))
        for shape in (collide.Sphere(1), collide.Cone(1, 1), collide.Halfspace((0, 0, 1), 0)):
            with pytest.raises(UnsupportedQuery, match=type(shape).__name__):
                call(mesh, shape, np.eye(4), np.eye(4))
        with pytest.raises(InvalidArgument, match="lengths do not match"):
            call(mesh, mesh, np.tile(np.eye(4), (2, 1, 1)), np.tile(np.eye(4), (3, 1, 1)))
