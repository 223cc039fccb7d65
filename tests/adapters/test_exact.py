"""The exact oracle against brute force, closed forms, Qhull and published hard cases.

Brute force: the signed distance of two convex bodies is the maximum over all directions n of
gap(n) / |n|, gap(n) = min over B of n.x - max over A of n.x.  A maximum is attained along the
closest points of two features (apart) or along the normal of a facet of the Minkowski difference
(together), so it is enough to try, for bodies of at most eight vertices, every direction that any
features could give.  A direction too many never hurts: it only stays below the maximum.
"""

import ast
import inspect
import json
import math
import sys
from dataclasses import replace
from decimal import Context, Decimal
from fractions import Fraction
from itertools import combinations, product
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import LATTICE_ROTATIONS, rotation

from collide.adapters.peers import exact, exact_search

IDENTITY = np.eye(3)
ORIGIN = np.zeros(3)
BOX = np.array(list(product((-0.5, 0.5), repeat=3)))
TETRAHEDRON = np.array([(1, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)], dtype=float)
AXES = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]


# Brute force, sharing no code with the oracle ------------------------------------------------------------


def world_fractions(P, R, t):
    F = Fraction
    return [
        tuple(sum(F(float(R[k][m])) * F(float(x[m])) for m in range(3)) + F(float(t[k])) for k in range(3)) for x in P
    ]


def common_integers(A, B):
    """Both bodies times the common denominator of all coordinates, and that denominator."""
    scale = math.lcm(*(x.denominator for point in A + B for x in point))
    return *([tuple(int(x * scale) for x in p) for p in body] for body in (A, B)), scale


def minus(p, q):
    return tuple(x - y for x, y in zip(p, q))


def cross(p, q):
    return (p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0])


def candidate_directions(A, B):
    """Up to sign and length, every direction between closest features and every facet normal."""
    edges_a, edges_b = ([(p, minus(q, p)) for p, q in combinations(set(X), 2)] for X in (A, B))
    yield from AXES
    for p, q in product(A, B):
        yield minus(q, p)
    for X in (A, B):
        for p, q, r in combinations(set(X), 3):
            yield cross(minus(q, p), minus(r, p))
    for (_, u), (_, v) in product(edges_a, edges_b):
        yield cross(u, v)
    for edges, others in ((edges_a, B), (edges_b, A)):
        for p, u in edges:
            yield from (cross(u, axis) for axis in AXES)
            yield from (cross(u, cross(minus(q, p), u)) for q in others)


def brute_signed_square(case):
    """Signed distance times its absolute value, a Fraction."""
    P, R1, t1, Q, R2, t2 = case
    A, B, scale = common_integers(world_fractions(P, R1, t1), world_fractions(Q, R2, t2))
    best = None
    for n in {tuple(x // (math.gcd(*d) or 1) for x in d) for d in candidate_directions(A, B)} - {(0, 0, 0)}:
        on_a = [n[0] * x + n[1] * y + n[2] * z for x, y, z in A]
        on_b = [n[0] * x + n[1] * y + n[2] * z for x, y, z in B]
        gap = max(min(on_b) - max(on_a), min(on_a) - max(on_b))
        top, bottom = gap * abs(gap), n[0] ** 2 + n[1] ** 2 + n[2] ** 2
        if best is None or top * best[1] > best[0] * bottom:
            best = top, bottom
    return Fraction(*best) / scale**2


# Families of small cases (P, R1, t1, Q, R2, t2) ------------------------------------------------------------


def dyadic(rng, size):
    return rng.integers(-16, 17, size) / 8.0


def lattice_rotation(rng):
    return LATTICE_ROTATIONS[rng.integers(len(LATTICE_ROTATIONS))]


def lattice_body(rng, dim=None, most=6):
    """Integer points that span at most `dim` dimensions, sometimes with a duplicate."""
    dim = rng.integers(4) if dim is None else dim
    basis = rng.integers(-2, 3, (dim, 3))
    points = rng.integers(-1, 2, 3) + rng.integers(-2, 3, (rng.integers(dim + 1, most), dim)) @ basis
    repeats = points[:1] if rng.random() < 0.3 else points[:0]
    return np.vstack([points, repeats]).astype(float)


def solid(rng):
    a, b = (rng.normal(size=(rng.integers(4, 9), 3)) for _ in range(2))
    return a, rotation(rng), ORIGIN, b, rotation(rng), rng.normal(size=3)


def lattice(rng, dims=(None, None), reach=1):
    a, b = (lattice_body(rng, dim) for dim in dims)
    t = rng.integers(-reach, reach + 1, 3)
    return a, lattice_rotation(rng), ORIGIN, b, lattice_rotation(rng), t.astype(float)


def projected(rng, kept, reach):
    """Polygons, segments and points in one plane or on one line, which an exact pose tilts."""
    a, b = (lattice_body(rng, 2) * kept for _ in range(2))
    R = lattice_rotation(rng) @ np.array([(1, 2, 0), (0, 1, 0), (1, -3, 1)])
    return a, R, ORIGIN, b, R, R @ (rng.integers(-reach, reach + 1, 3) * kept)


def posed_degenerate(rng):
    """Flat bodies, segments and solids in general pose: coplanar in the body frame, no longer in the world."""
    a, b = lattice_body(rng, rng.integers(2, 4)), lattice_body(rng, rng.integers(1, 4))
    return a / 7, rotation(rng), ORIGIN, b / 7, rotation(rng), rng.normal(size=3) * 0.05


def contact_features(rng, kind):
    """A in z <= 0 and B in z >= 0 that share the origin: a face, an edge or a vertex of each."""
    features = {
        "face": [(3, -1, 0), (-1, 3, 0), (-2, -2, 0)],
        "edge": [(2, 1, 0), (-2, -1, 0)],
        "edge across": [(1, -3, 0), (-1, 3, 0)],
        "vertex": [(0, 0, 0)],
    }
    first, second = kind
    a, b = np.array(features[first]), np.array(features[second])
    below, above = (rng.integers((-3, -3, 1), (4, 4, 4), (rng.integers(1, 4), 3)) for _ in range(2))
    return np.vstack([a, below * (1, 1, -1)]).astype(float), np.vstack([b, above]).astype(float)


CONTACTS = [
    ("face", "vertex"),
    ("edge", "edge across"),
    ("face", "face"),
    ("vertex", "vertex"),
    ("vertex", "edge"),
    ("face", "edge"),
]


def touching(rng, shear=True):
    """Exactly touching across a lattice plane, in an exact pose that may be sheared."""
    a, b = contact_features(rng, CONTACTS[rng.integers(len(CONTACTS))])
    R = lattice_rotation(rng)
    if shear:
        R = R @ np.array([(1, 2, 0), (0, 1, 0), (1, 0, 1)]) @ np.array([(1, 0, -1), (0, 1, 1), (0, 0, 1)])
    t, offset = dyadic(rng, 3), dyadic(rng, 3)
    return a, R, t, b - offset, R, t + R @ offset


def one_ulp(rng):
    """Touching across the plane z = 0 in the frame of R, then B moved by one ulp towards or away."""
    a, R, t1, b, _, t2 = touching(rng, shear=False)
    k = int(np.argmax(np.abs(R[:, 2])))
    t2 = t2.copy()
    t2[k] = np.nextafter(t2[k], math.inf if rng.random() < 0.5 else -math.inf)
    return a, R, t1, b, R, t2


def nested(rng):
    a = rng.normal(size=(6, 3))
    scale = 10 ** rng.uniform(-3, -0.3)
    return a, rotation(rng), ORIGIN, rng.normal(size=(6, 3)) * scale, rotation(rng), ORIGIN


def identical(rng):
    a, R, t = rng.normal(size=(rng.integers(1, 7), 3)), rotation(rng), rng.normal(size=3)
    return a, R, t, a, R, t


def concentric(rng):
    return BOX, rotation(rng), ORIGIN, TETRAHEDRON * rng.uniform(0.1, 2), rotation(rng), ORIGIN


def scaled(rng):
    """Bodies whose sizes differ by up to 1e8, with a matrix that is no rotation."""
    a, b = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)) * 10.0 ** -rng.integers(0, 9)
    return a, rotation(rng) + 1e-7 * rng.normal(size=(3, 3)), ORIGIN, b, rotation(rng), rng.normal(size=3) * 0.1


FAMILIES = {
    "solid": solid,
    "lattice": lattice,
    "lattice solids": lambda rng: lattice(rng, (3, 3), reach=2),
    "coplanar": lambda rng: projected(rng, (1, 1, 0), reach=3),
    "collinear": lambda rng: projected(rng, (1, 0, 0), reach=7),
    "posed degenerate": posed_degenerate,
    "touching": touching,
    "one ulp": one_ulp,
    "nested": nested,
    "identical": identical,
    "concentric": concentric,
    "scaled": scaled,
}


def cases(family, count=80):
    rng = np.random.default_rng([ord(letter) for letter in family])
    return [FAMILIES[family](rng) for _ in range(count)]


def signed_square(case):
    """The oracle's signed distance times its absolute value, its certificates verified on the way."""
    answer = exact.distance(*case)
    exact.verify(answer, *case)
    if not answer.hit:
        return answer.distance_squared
    depth = exact.depth(*case)
    exact.verify(depth, *case)
    return -depth.depth_squared


@pytest.mark.many(10)
@pytest.mark.parametrize("family", FAMILIES)
def test_equals_brute_force_exactly(family):
    for case in cases(family):
        expected = brute_signed_square(case)
        assert signed_square(case) == expected
        assert exact.hit(*case) == (expected <= 0)
        assert_root(exact.signed_distance(*case), expected)


def assert_root(value, signed_square, digits=28):
    error = abs(Fraction(value) * abs(Fraction(value)) - signed_square)
    assert error <= abs(signed_square) / 10**digits


@pytest.mark.parametrize("family", ["solid", "lattice solids", "coplanar", "collinear", "one ulp", "nested"])
def test_families_are_neither_all_hits_nor_all_misses(family):
    assert 30 <= sum(exact.hit(*case) for case in cases(family, 100)) <= 70


def test_touching_by_construction_is_a_hit_at_distance_zero():
    for case in cases("touching", 100):
        assert exact.hit(*case)
        assert exact.signed_distance(*case) == 0
        assert exact.depth(*case).depth_squared == 0


def test_one_ulp_away_is_apart_by_that_ulp():
    for case in cases("one ulp", 100):
        a, R, t1, b, _, t2 = case
        up = [int(x) for x in R[:, 2]]
        lowest_b = min(sum(n * x for n, x in zip(up, p)) for p in world_fractions(b, R, t2))
        highest_a = max(sum(n * x for n, x in zip(up, p)) for p in world_fractions(a, R, t1))
        shift = lowest_b - highest_a
        assert 0 < abs(shift) < 1e-14
        if shift > 0:
            assert exact.distance(*case).distance_squared == shift**2
        else:
            assert signed_square(case) >= -(shift**2)


def test_order_of_bodies_only_turns_the_answer_around():
    for family in FAMILIES:
        for P, R1, t1, Q, R2, t2 in cases(family, 5):
            assert exact.signed_distance(P, R1, t1, Q, R2, t2) == exact.signed_distance(Q, R2, t2, P, R1, t1)


# Closed forms -----------------------------------------------------------------------------------------------

QUARTERS = st.integers(-12, 12).map(lambda k: k / 4)


@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.tuples(QUARTERS, QUARTERS, QUARTERS))
def test_unit_boxes_at_an_offset(offset):
    case = BOX, IDENTITY, ORIGIN, BOX, IDENTITY, offset
    gaps = [Fraction(abs(x)) - 1 for x in offset]
    if max(gaps) > 0:
        assert signed_square(case) == sum(max(g, Fraction(0)) ** 2 for g in gaps)
    else:
        assert signed_square(case) == -(max(gaps) ** 2)


def test_direction_and_points_run_from_a_to_b():
    apart = exact.distance(BOX, IDENTITY, ORIGIN, BOX, IDENTITY, (3, 0, 0))
    assert apart.certificate.axis == (1, 0, 0)
    assert (apart.point_a[0], apart.point_b[0]) == (Fraction(1, 2), Fraction(5, 2))
    deep = exact.depth(BOX, IDENTITY, ORIGIN, BOX, IDENTITY, (0, 0, 0.75))
    assert deep.normal == (0, 0, 1)
    assert deep.depth == Decimal("0.25")


def test_moving_by_the_depth_along_the_normal_makes_touch():
    case = BOX, IDENTITY, ORIGIN, BOX, IDENTITY, (0.25, -0.625, 0.125)
    deep = exact.depth(*case)
    assert deep.normal == (0, -1, 0)
    moved = (*case[:5], np.array(case[5]) + float(deep.depth) * np.array(deep.normal))
    assert exact.hit(*moved) and exact.signed_distance(*moved) == 0


def test_tetrahedron_against_itself_is_as_deep_as_its_facet_distance():
    # A - A of the regular tetrahedron is a cuboctahedron; its square faces are nearest, at 2.
    assert signed_square((TETRAHEDRON, IDENTITY, ORIGIN, TETRAHEDRON, IDENTITY, ORIGIN)) == -4


def test_point_inside_a_box_and_segment_through_it():
    point = [(0.0, 0.125, 0.0)]
    assert exact.signed_distance(BOX, IDENTITY, ORIGIN, point, IDENTITY, ORIGIN) == Decimal("-0.375")
    segment = [(0.0, 0.0, -9.0), (0.0, 0.0, 9.0)]
    assert exact.signed_distance(BOX, IDENTITY, ORIGIN, segment, IDENTITY, ORIGIN) == Decimal("-0.5")


def test_solid_boxes_that_touch_have_a_proper_facet_at_depth_zero():
    for k, sign, slide in product(range(3), (-1, 1), (-0.5, -0.125, 0.25)):
        offset = np.roll([sign, slide, 0.125], k)
        deep = exact.depth(BOX, IDENTITY, ORIGIN, BOX, IDENTITY, offset)
        assert deep.depth == 0 and deep.normal == tuple(sign * (m == k) for m in range(3))
        assert len(deep.facet) == 3 and deep.shell


def test_crossing_flat_bodies_have_no_depth_but_meet():
    square = BOX[BOX[:, 2] > 0] - (0, 0, 0.5)
    for other in (square, square[:2], square[:1]):
        deep = exact.depth(square, IDENTITY, ORIGIN, other, IDENTITY, ORIGIN)
        assert deep.depth == 0 and deep.shell == () and any(deep.normal)
        exact.verify(deep, square, IDENTITY, ORIGIN, other, IDENTITY, ORIGIN)


def test_roots_are_rounded_to_the_digits_asked_for():
    far = (BOX, IDENTITY, ORIGIN, BOX, IDENTITY, (2.0, 2.0, 0.0))
    root = Decimal(math.isqrt(2 * 10**120))
    for digits in (5, 30, 50):
        rounded = Context(prec=digits).scaleb(Context(prec=digits).plus(root), -60)
        assert exact.signed_distance(*far, digits=digits) == rounded
        assert exact.distance(*far, digits=digits).distance == rounded


# Swept radii ------------------------------------------------------------------------------------------------


def test_radii_shrink_the_gap_and_deepen_the_overlap():
    def signed(offset, **radii):
        return exact.signed_distance(BOX, IDENTITY, ORIGIN, BOX, IDENTITY, offset, **radii)

    assert signed((3, 0, 0), radius_a=0.5, radius_b=0.25) == Decimal("1.25")
    assert signed((3, 0, 0), radius_a=1.5, radius_b=1.5) == -1
    assert signed((1, 0, 0), radius_a=0.5) == Decimal("-0.5")
    assert signed((0.5, 0, 0), radius_a=0.5, radius_b=0.5) == Decimal("-1.5")


def test_swept_bodies_meet_exactly_at_the_sum_of_radii():
    case = [(0.0, 0.0, 0.0)], IDENTITY, ORIGIN, [(3.0, 4.0, 0.0)], IDENTITY, ORIGIN
    assert exact.hit(*case, radius_a=2.0, radius_b=3.0)
    assert not exact.hit(*case, radius_a=2.0, radius_b=math.nextafter(3.0, 0))
    assert exact.hit(*case, radius_a=2.0, radius_b=math.nextafter(3.0, 4))


def test_gap_near_the_sum_of_radii_loses_no_digits():
    case = [(0.0, 0.0, 0.0)], IDENTITY, ORIGIN, [(1.0, 1.0, 0.0)], IDENTITY, ORIGIN
    radius = math.sqrt(2)
    reference = Fraction(math.isqrt(2 * 10**160), 10**80) - Fraction(radius)
    gap = exact.signed_distance(*case, radius_a=radius)
    assert abs(Fraction(gap) / reference - 1) < Fraction(1, 10**28)
    assert exact.hit(*case, radius_a=radius) == (reference <= 0)


# Certificates -----------------------------------------------------------------------------------------------

APART = BOX, IDENTITY, ORIGIN, TETRAHEDRON, IDENTITY, (2.5, 0.5, 0.25)
TOGETHER = BOX, IDENTITY, ORIGIN, TETRAHEDRON, IDENTITY, (0.75, 0.5, 0.25)


def tampered_answers(answer):
    axis, pairs = answer.certificate
    (i, j, w), rest = pairs[0], pairs[1:]
    small = Fraction(1, 10**40)
    yield "not hit", replace(answer, hit=not answer.hit)
    yield "another distance", replace(answer, distance_squared=answer.distance_squared + small)
    yield "another root", replace(answer, distance=answer.distance + Decimal("1e-15"))
    yield "moved point", replace(answer, point_a=(answer.point_a[0] + small, *answer.point_a[1:]))
    swapped = (1, 0, 0) if answer.hit else None
    yield "opposite claim", replace(answer, hit=not answer.hit, certificate=exact.Certificate(swapped, pairs))
    forged = {
        "unknown vertex": (axis, ((i + 99, j, w), *rest)),
        "negative id": (axis, ((i - 99, j, w), *rest)),
        "weight sum": (axis, ((i, j, w + small), *rest)),
        "negative weight": (axis, ((i, j, w + 1), (i, j, Fraction(-1)), *rest)),
        "no pairs": (axis, ()),
        "axis swapped in or out": (swapped, pairs),
    }
    if axis:
        forged["turned axis"] = (tuple(-x for x in axis), pairs)
        forged["tilted axis"] = ((axis[0], axis[1] + 1, axis[2]), pairs)
        forged["zero axis"] = ((0, 0, 0), pairs)
    for name, (axis_, pairs_) in forged.items():
        yield name, replace(answer, certificate=exact.Certificate(axis_, pairs_))


def tampered_depths(deep):
    yield "turned normal", replace(deep, normal=tuple(-x for x in deep.normal))
    yield "zero normal", replace(deep, normal=(0, 0, 0))
    yield "another depth", replace(deep, depth_squared=deep.depth_squared * 2)
    yield "another root", replace(deep, depth=deep.depth * 2)
    yield "zero depth", replace(deep, depth_squared=Fraction(0), depth=Decimal(0))
    yield "unknown vertex", replace(deep, facet=((99, 0), *deep.facet[1:]))
    yield "no facet", replace(deep, facet=())
    (i, j), *others = deep.facet
    yield "facet off its plane", replace(deep, facet=((7 - i, j), *others))
    yield "open shell", replace(deep, shell=deep.shell[1:])
    yield "no shell", replace(deep, shell=())
    yield "inverted shell", replace(deep, shell=tuple((p, r, q) for p, q, r in deep.shell))
    yield "doubled triangle", replace(deep, shell=(*deep.shell, deep.shell[0]))
    yield "collapsed shell", replace(deep, shell=((deep.facet[0],) * 3,))
    corner = deep.shell[0][0]
    pulled = {corner: (corner[0], 1 - corner[1])}
    yield "pulled vertex", replace(deep, shell=tuple(tuple(pulled.get(p, p) for p in tri) for tri in deep.shell))


def assert_rejected(name, forged, case):
    try:
        exact.verify(forged, *case)
    except ValueError:
        return
    pytest.fail(f"accepted: {name}")


@pytest.mark.parametrize("case", [APART, TOGETHER], ids=["apart", "together"])
def test_tampered_answers_are_rejected(case):
    answer = exact.distance(*case)
    exact.verify(answer, *case)
    for name, forged in tampered_answers(answer):
        assert forged != answer, name
        assert_rejected(name, forged, case)


def test_tampered_depths_are_rejected():
    deep = exact.depth(*TOGETHER)
    exact.verify(deep, *TOGETHER)
    for name, forged in tampered_depths(deep):
        assert forged != deep, name
        assert_rejected(name, forged, TOGETHER)


def test_a_facet_that_is_not_the_nearest_is_rejected():
    # Each face of the box supports the difference of two boxes; only one is nearest.
    case = BOX, IDENTITY, ORIGIN, BOX, IDENTITY, (0.5, 0.25, 0.0)
    deep = exact.depth(*case)
    facet = tuple((i, j) for i in range(8) for j in range(8) if BOX[i][1] > 0 > BOX[j][1])[:3]
    wrong = replace(deep, normal=(0, 1, 0), depth_squared=Fraction(9, 16), depth=Decimal("0.75"), facet=facet)
    with pytest.raises(ValueError, match="shell is nearer"):
        exact.verify(wrong, *case)


def test_a_depth_forged_for_bodies_apart_is_rejected():
    answer, deep = exact.distance(*APART), exact.depth(*TOGETHER)
    forged = replace(deep, normal=answer.certificate.axis, depth_squared=answer.distance_squared, depth=answer.distance)
    with pytest.raises(ValueError, match="apart along the normal"):
        exact.verify(forged, *APART)


@pytest.mark.parametrize("query", [exact.distance, exact.depth])
def test_an_answer_does_not_fit_another_pose(query):
    case = TOGETHER
    moved = (*case[:5], (0.75, 0.5, math.nextafter(0.25, 1)))
    with pytest.raises(ValueError):
        exact.verify(query(*case), *moved)


# Larger bodies, published cases, inputs ---------------------------------------------------------------------


@pytest.mark.parametrize("n", [12, 40])
def test_depth_agrees_with_qhull(n):
    spatial = pytest.importorskip("scipy.spatial")
    rng = np.random.default_rng(n)
    for _ in range(8):
        case = *posed_sphere(rng, n, 0.0), *posed_sphere(rng, n, 0.5)
        A, B = (X @ np.transpose(R) + t for X, R, t in (case[:3], case[3:]))
        hull = spatial.ConvexHull((A[:, None] - B[None]).reshape(-1, 3))
        expected = hull.equations[:, 3].max()
        assert math.isclose(exact.signed_distance(*case), expected, abs_tol=1e-12)


def posed_sphere(rng, n, spread):
    points = rng.normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1)[:, None], rotation(rng), spread * rng.normal(size=3)


def test_three_hundred_vertices_verify():
    rng = np.random.default_rng(300)
    for spread in (0.0, 0.4, 3.0):
        signed_square((*posed_sphere(rng, 300, 0.0), *posed_sphere(rng, 300, spread)))


def published_failures():
    path = Path(__file__).resolve().parents[3] / "shared" / "data" / "cases" / "peer_failures.json"
    if not path.exists():
        pytest.skip("shared/data with the published peer failures is not beside this checkout")
    return json.loads(path.read_text())


def test_published_peer_failures_to_25_digits():
    records = published_failures()
    assert len(records) == 43
    for record in records:
        case = [record[key] for key in ("P", "R1", "t1", "Q", "R2", "t2")]
        reference = Fraction(record["exact"]) * (-1 if record["hit"] else 1)
        value = Fraction(exact.signed_distance(*case, digits=40))
        assert exact.hit(*case) == record["hit"]
        assert abs(value - reference) <= abs(reference) / 10**38
        signed_square(case)


@pytest.mark.parametrize("scale", [5e-324, 1e-300, 1e-5, 1.0, 1e300])
def test_world_points_are_exact(scale):
    rng = np.random.default_rng(7)
    P, R, t = rng.normal(size=(5, 3)) * scale, rotation(rng), rng.normal(size=3)
    points, e = exact.world_points(P, R, t)
    assert all(type(x) is int for p in points for x in p)
    assert [tuple(x * Fraction(2) ** e for x in p) for p in points] == world_fractions(P, R, t)


def test_lists_and_arrays_are_the_same_input():
    case = cases("solid", 1)[0]
    assert exact.distance(*case) == exact.distance(*(x.tolist() for x in case))


@pytest.mark.parametrize(
    "points", [[], [(0.0, 0.0)], [(math.nan, 0, 0)], [(math.inf, 0, 0)]], ids=["none", "plane", "nan", "inf"]
)
def test_what_is_no_body_is_refused(points):
    with pytest.raises((ValueError, OverflowError)):
        exact.hit(points, IDENTITY, ORIGIN, BOX, IDENTITY, ORIGIN)


def test_depth_of_bodies_apart_and_negative_radii_are_refused():
    with pytest.raises(ValueError, match="apart"):
        exact.depth(*APART)
    with pytest.raises(ValueError, match="negative"):
        exact.hit(*APART, radius_a=-1.0)


def test_the_oracle_imports_nothing_but_the_standard_library():
    """And its own searches, of which the same holds."""
    for module, own in ((exact, {exact_search.__name__}), (exact_search, set())):
        tree = ast.parse(inspect.getsource(module))
        imported = {a.name for node in ast.walk(tree) if isinstance(node, ast.Import) for a in node.names}
        imported |= {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and not node.level}
        assert imported and {name.split(".")[0] for name in imported - own} <= sys.stdlib_module_names
        assert not any(isinstance(node, ast.ImportFrom) and node.level for node in ast.walk(tree))
