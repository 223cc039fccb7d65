"""Convex parts of shapes, rows of tables that grow, and what is prepared of points: against loops and definitions."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise, product

import numpy as np
import pytest
from naive import one_of_each, random_pose, rng_of

import collide
from collide.errors import UnsupportedQuery
from collide.lowering import parts as P
from collide.lowering.convex_sets import convex_set
from collide.lowering.lazy_structures import MIN_FOR_TREE, coarse_address, may_have_tree, support_tree_of
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, HALFSPACE, POINTS, pack_points
from collide.lowering.shape_table import COARSE_AT, INTS, NUMBERS, RANK, TREE, ShapeTable
from collide.shapes.shape import IDENTITY

REGION = collide.HPolytope([(0, 0, 2), (3, 4, 0)], [1.0, 1.0], bounded=False)


def on_sphere(rng, n: int) -> np.ndarray:
    p = rng.normal(size=(n, 3))
    return p / np.linalg.norm(p, axis=1)[:, None]


def test_each_class_has_the_numbers_of_its_definition():
    half_sizes = np.array((0.5, 1.0, 1.5))
    ((packed, X),) = P.parts_of(collide.Box(2 * half_sizes))
    assert X is IDENTITY and packed.kind == POINTS and packed.params.tolist() == [*half_sizes.tolist(), 0.0]
    assert packed.points.tolist() == [list(s * half_sizes) for s in np.array(list(product((-1, 1), repeat=3)))]
    assert P.convex_set_of(collide.Sphere(0.5)).points.tolist() == [[0, 0, 0]]
    capsule = P.convex_set_of(collide.Capsule(0.5, 3.0))
    assert capsule.points.tolist() == [[0, 0, -1.5], [0, 0, 1.5]] and capsule.radius == 0.5
    assert len(P.convex_set_of(collide.Capsule(0.5, 0.0)).points) == 1
    for cls, kind in ((collide.Cylinder, CYLINDER), (collide.Cone, CONE)):
        packed = P.convex_set_of(cls(3.0, 8.0))
        assert (
            packed.kind == kind and packed.params.tolist() == [3.0, 4.0, 0.0, 0.0] and 5.0 <= packed.reach < 5.0 + 1e-12
        )
    packed = P.convex_set_of(collide.Ellipsoid((1.0, 3.0, 2.0)))
    assert (
        packed.kind == ELLIPSOID
        and packed.params.tolist() == [1.0, 3.0, 2.0, 0.0]
        and 3.0 <= packed.reach < 3.0 + 1e-12
    )
    packed = P.convex_set_of(collide.Halfspace((0, 3, 4), 2.0))
    assert packed.kind == HALFSPACE and packed.params.tolist()[3] == 2.0
    hull = collide.ConvexHull(on_sphere(rng_of("h"), 9), radius=0.25)
    assert np.array_equal(P.convex_set_of(hull).points, hull.points) and P.convex_set_of(hull).radius == 0.25


def test_shapes_of_equal_numbers_share_parts():
    """Of the seven classes of few numbers, for as many as are remembered; derived classes share nothing."""
    makers = (
        lambda r: collide.Sphere(r), lambda r: collide.Box((1.0, r, 2.0)), lambda r: collide.Capsule(r, 0.0),
        lambda r: collide.Cylinder(r, 1.0), lambda r: collide.Cone(r, 1.0), lambda r: collide.Ellipsoid((r, 1.0, 2.0)),
        lambda r: collide.Halfspace((0.0, 0.0, 1.0), r),
    )
    for make in makers:
        assert P.parts_of(make(0.75)) is P.parts_of(make(0.75)) is not P.parts_of(make(0.5))
        wanted = P._packed(convex_set(make(0.75)))
        for field, value, other in zip(wanted._fields, P.convex_set_of(make(0.75)), wanted):
            if field not in ("block", "address", "prepared"):
                assert np.array_equal(value, other), (make(0.75), field)
    for flat in (collide.Halfspace((0.0, -0.0, 1.0), 0.75), collide.Halfspace((0.0, 0.0, 1.0), -0.75)):
        assert P.parts_of(flat) is not P.parts_of(collide.Halfspace((0.0, 0.0, 1.0), 0.75))
    zeros = [P.convex_set_of(collide.Halfspace((0.0, 0.0, 1.0), zero)) for zero in (0.0, -0.0)]
    assert zeros[0] is not zeros[1] and np.signbit([packed.params[3] for packed in zeros]).tolist() == [False, True]
    assert P.parts_of(collide.Cylinder(1.0, 2.0)) is not P.parts_of(collide.Cone(1.0, 2.0))

    class Ball(collide.Sphere):
        __slots__ = ()

    assert P.parts_of(Ball(0.75)) is not P.parts_of(Ball(0.75))
    first = P.parts_of(collide.Sphere(0.75))
    for k in range(P.MAX_SHARED):
        P.parts_of(collide.Sphere(1.0 + k))
    assert len(P._parts_of_numbers) <= P.MAX_SHARED
    assert P.parts_of(collide.Sphere(0.75)) is not first, "all are forgotten at times"


def test_unions_hold_the_parts_of_their_items_in_order():
    rng = rng_of("parts of unions")
    ball, cone = collide.Sphere(0.5), collide.Cone(0.3, 0.6)
    X, Y, Z = (random_pose(rng) for _ in range(3))
    inner = collide.Compound([(cone, Y), (ball, np.eye(4))])
    found = P.parts_of(collide.Compound([(ball, X), (inner, Z)]))
    assert [packed.kind for packed, _ in found] == [POINTS, CONE, POINTS]
    for (_, at), expected in zip(found, (X, Z @ Y, Z)):
        np.testing.assert_allclose(at, expected, rtol=0, atol=1e-15)
    # A product of poses rounds: the slop of that part alone holds it, exactly.
    assert found[0][0].slop == found[2][0].slop == 0.0 < found[1][0].slop < 1e-13
    exact = [[sum(Fraction(a) * Fraction(b) for a, b in zip(row, column)) for column in zip(*Y.tolist())]
             for row in Z.tolist()]
    off = [
        [abs(Fraction(v) - e) for v, e in zip(row, exact_row)] for row, exact_row in zip(found[1][1].tolist(), exact)
    ]
    for row in off[:3]:
        assert sum(row[:3]) * Fraction(found[1][0].reach) + row[3] <= Fraction(found[1][0].slop)


@pytest.mark.parametrize("kind", [*one_of_each(rng_of("kinds")), "Mesh", "Region", "Shifted", "Wrapped"])
def test_single_convex_and_bounding_parts(kind):
    rng = rng_of("single", kind)
    each = one_of_each(rng)
    mesh = collide.Mesh(*collide.tessellate(each["Ellipsoid"])[:2])
    each |= {"Mesh": mesh, "Region": REGION, "Shifted": collide.Compound([(each["Box"], random_pose(rng))]),
             "Wrapped": collide.Compound([(each["Box"], np.eye(4))])}
    shape = each[kind]
    assert P.is_single_convex(shape) == (kind not in ("Compound", "Mesh", "Region", "Shifted"))
    bounds = P.bounding_parts_of(shape)
    if kind not in ("Mesh", "Region"):
        assert bounds is P.parts_of(shape)
        return
    assert P.bounding_parts_of(shape) is bounds and len(bounds) == 1
    with pytest.raises(
        UnsupportedQuery, match="Mesh: a mesh is no union" if kind == "Mesh" else "a region has no corners"
    ):
        P.parts_of(shape)
    if kind == "Region":  # is no item of unions
        return
    around = P.bounding_parts_of(collide.Compound([(shape, random_pose(rng)), (each["Sphere"], np.eye(4))]))
    assert around[0][0].content == bounds[0][0].content and len(around) == 2


def test_regions_are_within_the_half_space_that_reaches_least():
    """Of z ≤ ½ and 3x + 4y ≤ 1, a plane at 0.2 from the origin: in lengths, whatever the normals' own."""
    ((packed, _),) = P.bounding_parts_of(REGION)
    n, b = packed.params[:3], packed.params[3]
    assert packed.kind == HALFSPACE and b / np.linalg.norm(n) == pytest.approx(0.2)
    huge = collide.HPolytope([(0, 0, 2e49), (3e-40, 4e-40, 0)], [1e49, 1e-40], bounded=False)
    ((packed, _),) = P.bounding_parts_of(huge)
    assert packed.params[3] / np.linalg.norm(packed.params[:3]) == pytest.approx(0.2)


@pytest.mark.parametrize("n", [1, 512, 513, 3000])
@pytest.mark.parametrize("kind", ["ball", "flat", "one place"])
def test_bounds_of_many_points_hold_them(n, kind):
    points = on_sphere(rng_of("bounds", n, kind), n) * (1.0, 2.0, 0.0 if kind == "flat" else 3.0)
    points = np.full((n, 3), 0.25) if kind == "one place" else points
    found = P._points_around(points)
    if n <= 512:
        assert found is points
        return
    assert len(found) <= min(8 * 6**3, n * 8)
    v = np.vstack([on_sphere(rng_of("v"), 40), np.eye(3), -np.eye(3)])
    inner, outer = (points @ v.T).max(axis=0), (found @ v.T).max(axis=0)
    assert (inner <= outer + 1e-15).all() and (outer <= inner + 0.6).all()
    np.testing.assert_array_equal([found.min(axis=0), found.max(axis=0)], [points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("scale, shift", [(1.0, 0.0), (1e49, 0.0), (1e-300, 0.0), (1.0, 1e9)])
def test_boxes_of_cells_are_those_of_points_sorted_into_cells(scale, shift):
    points = rng_of("cells", scale, shift).normal(size=(4000, 3)) * (1.0, 0.0, 3.0) * scale + shift
    low, side = 0.5 * points.min(axis=0), 0.5 * points.max(axis=0) - 0.5 * points.min(axis=0)
    cells = np.minimum((0.5 * points - low) / np.where(side > 0.0, side, 1.0) * 6, 5).astype(int)
    groups = [points[(cells == cell).all(axis=1)] for cell in np.unique(cells, axis=0)]
    corners = [np.where(list(np.ndindex(2, 2, 2)), group.max(axis=0), group.min(axis=0)) for group in groups]
    assert len(groups) > 20 and np.array_equal(P._points_around(points), np.unique(np.concatenate(corners), axis=0))


def test_what_is_no_shape_of_ours_is_named():
    class Other(collide.Shape):
        __slots__ = ()
        _fields = ()

    with pytest.raises(TypeError, match="Other cannot be asked about"):
        P.parts_of(Other())

    class Mine(collide.Sphere):
        __slots__ = ()

    assert P.convex_set_of(Mine(0.5)).radius == 0.5


def test_few_points_are_scanned_and_many_get_a_tree():
    rng = rng_of("prepared")
    for n in (63, 64, MIN_FOR_TREE - 1, MIN_FOR_TREE):
        points = on_sphere(rng, n)
        for with_tree in (False, True):
            packed = pack_points(points.copy(), with_tree=with_tree)
            assert may_have_tree(packed) == (with_tree and n >= MIN_FOR_TREE)
            address = coarse_address(packed)
            assert (address != 0) == (n >= 64) and coarse_address(packed) == address
            assert coarse_address(packed._replace(slop=1.0)) == address  # shared by copies
            assert support_tree_of(packed) is support_tree_of(packed._replace(radius=2.0))
    assert collide.collide(collide.ConvexHull(points), collide.Sphere(0.1), np.eye(4), np.eye(4))


def packed_sets(rng, n: int) -> list:
    sets = [
        pack_points(rng.normal(size=(int(rng.integers(1, 70)), 3)), radius=float(rng.integers(0, 2))) for _ in range(n)
    ]
    return [sets[k] for k in rng.integers(0, n, n)]  # some of them twice


@pytest.mark.parametrize("pieces", [(10, 1, 30), (1,) * 40, (40, 0, 1)])
def test_tables_that_grow_have_the_rows_of_new_ones(pieces):
    rng = rng_of("growing tables", pieces)
    sets = packed_sets(rng, sum(pieces))
    table, at = ShapeTable(sets[: pieces[0]]), pieces[0]
    for n in pieces[1:]:
        table.append(sets[at : at + n])
        at += n
        assert len(table.ints) == len(table.numbers) >= at and table.ints.shape[1] == INTS
    whole = ShapeTable(sets)
    columns = [k for k in range(INTS) if k != RANK]
    assert table.packed == sets and np.array_equal(table.ints[:at, columns], whole.ints[:, columns])
    assert np.array_equal(table.numbers[:at], whole.numbers) and table.numbers.shape[1] == NUMBERS
    for ranks in (table.ints[:at, RANK].tolist(), whole.ints[:, RANK].tolist()):  # ordered as contents are
        order = sorted(range(at), key=lambda k: sets[k].content)
        for i, j in pairwise(order):
            assert (ranks[i] == ranks[j]) if sets[i].content == sets[j].content else ranks[i] < ranks[j]


def test_ranks_are_written_anew_where_nothing_fits_between():
    """Contents that come in order each halve the room above, or below, until there is none."""
    sets = sorted((pack_points(np.array([[float(k), 0.0, 0.0]])) for k in range(80)), key=lambda p: p.content)
    low, *between, high = sets
    for order in (between, between[::-1]):
        table = ShapeTable([low, high])
        for packed in order:
            table.append([packed])
        ranks = dict(zip((p.content for p in table.packed), table.ints[:80, RANK].tolist()))
        assert [ranks[p.content] for p in sets] == sorted(set(ranks.values()))


def test_trees_are_built_of_the_rows_asked_about():
    rng = rng_of("trees of rows")
    sets = [pack_points(on_sphere(rng, n), with_tree=True) for n in (300, 20, 300)]
    table = ShapeTable(sets)
    assert (
        not table.is_built
        and not table.ints[:, TREE].any()
        and (table.ints[:, COARSE_AT] != 0).tolist() == [True, False, True]
    )
    table.build_trees(np.array([[1, 2], [2, 1]]))
    assert (table.ints[:, TREE] != 0).tolist() == [False, False, True] and not table.is_built
    table.build_trees(np.array([0]))
    assert (table.ints[:, TREE] != 0).tolist() == [True, False, True] and table.is_built
