"""Compounds against meshes and with meshes in them, nested; lists of shapes; judged exactly.

The oracle multiplies nested poses out in fractions and looks at all pairs of facets, and at winding numbers.
"""

from __future__ import annotations

import math
from fractions import Fraction

import naive
import numpy as np
import pytest
from mesh_families import RIGHT_ANGLES
from mesh_shapes import block_ring, box
from naive import pose, random_pose, rng_of
from naive_triangles import as_integers, facet_pairs, surface_distance, winding, world_points
from surfaces import joined

import collide
from collide.lowering.shape_table import moved_pose
from collide.narrowphase.composite.composite_parts import compound_parts

EYE = np.eye(4)
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)
#: (shape, vertices, faces, solid)
BODIES = [
    (collide.Mesh(*block_ring()), *block_ring(), True),
    (collide.Mesh(*box((-0.5,) * 3, (0.5,) * 3)), *box((-0.5,) * 3, (0.5,) * 3), True),
    (collide.Mesh(box()[0], box()[1][2:]), box()[0], box()[1][2:], False),
    (collide.Box((0.5, 0.5, 0.5)), *box((-0.25,) * 3, (0.25,) * 3), True),
    (collide.ConvexHull(TETRAHEDRON[0]), *TETRAHEDRON, True),
]


def exactly(X) -> np.ndarray:
    out = np.empty((4, 4), dtype=object)
    out[:] = [[Fraction(v) for v in row] for row in np.asarray(X).tolist()]
    return out


def leaves(given, X):
    """Yields (vertices, faces, solid, exact pose) of a tree of (items, None) and bodies."""
    if isinstance(given, list):
        for item, X_CS in given:
            yield from leaves(item, X.dot(exactly(X_CS)))
    else:
        yield (*given[1:], X)


def shape_of(given):
    if isinstance(given, list):
        return collide.Compound([(shape_of(item), X) for item, X in given])
    return given[0]


def parts_meet(a, b) -> bool:
    (va, fa, sa, X), (vb, fb, sb, Y) = a, b
    if facet_pairs(va, fa, X, vb, fb, Y):
        return True
    for (v, f, solid, P), (w, Q) in (((va, fa, sa, X), (vb, Y)), ((vb, fb, sb, Y), (va, X))):
        if solid:
            one, other = as_integers(world_points(v, P), world_points(w, Q))
            if any(winding([[one[k] for k in face] for face in f.tolist()], p) not in (0,) for p in other[:1]):
                return True
    return False


def truth(A, B, X, Y) -> bool:
    return any(parts_meet(a, b) for a in leaves(A, exactly(X)) for b in leaves(B, exactly(Y)))


def gap(A, B, X, Y) -> Fraction:
    return min(
        surface_distance(*a[:2], a[3], *b[:2], b[3])[0] for a in leaves(A, exactly(X)) for b in leaves(B, exactly(Y))
    )


def any_pose(rng, spread):
    return random_pose(rng, spread)


def lattice_pose(rng, spread):
    return collide.pose(rng.integers(-4, 5, 3) / 4 * spread, R=RIGHT_ANGLES[rng.integers(3)])


def random_compound(rng, poser, depth=2):
    items = []
    for _ in range(int(rng.integers(1, 3))):
        deeper = depth > 0 and rng.random() < 0.4
        items.append(
            (random_compound(rng, poser, depth - 1) if deeper else BODIES[rng.integers(len(BODIES))], poser(rng, 1.5))
        )
    return items


def has_mesh(given) -> bool:
    return any(has_mesh(item) for item, _ in given) if isinstance(given, list) else given[0].meshed


def snippet(A, B, X, Y) -> str:
    return f"A, B = {A!r}, {B!r}\nX_WA = {X.tolist()}\nX_WB = {Y.tolist()}"


@pytest.mark.many(2)
@pytest.mark.parametrize("poser", [any_pose, lattice_pose])
def test_unions_answer_as_all_pairs_of_parts_do(poser):
    """Turned any way, poses of parts are rounded products; by right angles they are exact, and much touches."""
    rng = rng_of("unions", poser.__name__)
    told, open_rows, gaps = [], 0, 0
    for _ in range(20):
        A = random_compound(rng, poser)
        B = random_compound(rng, poser) if rng.random() < 0.5 else BODIES[rng.integers(len(BODIES))]
        if not (has_mesh(A) or has_mesh(B)):
            continue
        X, Y = poser(rng, 1.0), poser(rng, 2.5 if poser is any_pose else 1.0)
        one, other = shape_of(A), shape_of(B)
        hit, r = collide.collide(one, other, X, Y), collide.distance(one, other, X, Y)
        want, case = truth(A, B, X, Y), snippet(A, B, X, Y)
        assert hit == r.hit == collide.collide(other, one, Y, X), case
        unsure = r.how == 0
        open_rows += unsure
        assert r.lower <= r.distance <= r.upper, case
        assert hit == want or unsure, case
        told.append(hit)
        swapped = collide.distance(other, one, Y, X)
        assert (swapped.distance, swapped.lower, swapped.upper) == (r.distance, r.lower, r.upper), case
        assert np.array_equal(swapped.normal, 0.0 - r.normal) and (swapped.part_a, swapped.part_b) == (
            r.part_b,
            r.part_a,
        ), case
        if not hit:
            gaps += 1
            square = gap(A, B, X, Y)
            assert Fraction(max(r.lower, 0.0)) ** 2 <= square <= Fraction(r.upper) ** 2, case
            assert r.certified and r.upper - r.lower < 1e-12
            limited = collide.distance(one, other, X, Y, max_distance=0.3)
            assert limited.beyond == (r.lower > 0.3) and limited.lower <= r.upper, case
        elif not unsure:
            apart = Y.copy()
            apart[:3, 3] -= (r.lower * (1 + 1e-9) - 1e-12) * r.normal
            assert not truth(A, B, X, apart), case
    assert 0.2 < np.mean(told) < 0.95 and gaps >= 4, (np.mean(told), gaps)
    assert open_rows == 0 if poser is any_pose else open_rows <= len(told) // 4, open_rows


def test_part_numbers_count_through_the_nesting():
    small = collide.Mesh(*box((-0.1,) * 3, (0.1,) * 3))
    inner = collide.Compound([(collide.Sphere(0.1), pose(t=(5.0, 0, 0))), (small, pose(t=(10.0, 0, 0)))])
    outer = collide.Compound([(small, EYE), (inner, EYE), (collide.Cylinder(0.1, 0.2), pose(t=(15.0, 0, 0)))])
    for number, x in enumerate((0.0, 5.0, 10.0, 15.0)):
        for probe in (small, collide.Sphere(0.1), collide.Box((0.2, 0.2, 0.2)), collide.Cone(0.1, 0.2)):
            r = collide.distance(outer, probe, EYE, pose(t=(x, 1.0, 0)))
            assert r.part_a == number and abs(r.distance - 0.8) < 0.01 and not r.hit
            swapped = collide.distance(probe, outer, pose(t=(x, 1.0, 0)), EYE)
            assert swapped.part_b == number
    facet = collide.distance(small, collide.Compound([(collide.Sphere(0.1), EYE)]), EYE, pose(t=(1.0, 0.05, 0.02)))
    assert facet.part_b == 0 and (small.vertices[small.faces[facet.part_a]][:, 0] == 0.1).all()


def test_exact_products_are_answered_exactly_and_rounded_ones_within_their_rounding():
    """Cubes side by side: by right angles touching is decided; turned, a gap above the rounding is proven."""
    cube = collide.Mesh(*box((-0.5,) * 3, (0.5,) * 3))
    both = collide.Compound([(cube, pose(t=(0.25, 0.5, 0.0))), (collide.Box((1, 1, 1)), pose(t=(0.25, 4.5, 0.0)))])
    X = collide.pose((0.125, 2.0, -1.0), R=RIGHT_ANGLES[1])
    for step, want in ((0.0, True), (2.0**-50, False), (-(2.0**-50), True)):
        Y = X.copy()
        Y[:3, 3] += X[:3, :3] @ np.array([1.25 + step, 0.5, 0.0])
        r = collide.distance(both, cube, X, Y)
        assert r.hit == want and r.how != 0 and r.part_a == 0, (step, r)
    rng = rng_of("turned cubes")
    for _ in range(4):
        X = random_pose(rng, 1.0)
        for step, want in ((1e-12, False), (-1e-12, True), (0.0, None)):
            Y = X.copy()
            Y[:3, 3] = X[:3, :3] @ np.array([1.25 + step, 0.53, 0.02]) + X[:3, 3]
            r = collide.distance(both, cube, X, Y)
            assert want is None or (r.hit == want and r.how != 0), (step, r)
            assert r.lower <= step + 1e-15 and (r.hit or r.upper >= step - 1e-15)


def test_half_spaces_and_unions():
    rng = rng_of("union and half-space")
    ground = collide.Halfspace((0.0, 0.0, 2.0), -1.0)
    made = [
        (BODIES[0], any_pose(rng, 1.0)),
        ([(BODIES[1], any_pose(rng, 1.0))], any_pose(rng, 1.0)),
        (BODIES[3], any_pose(rng, 1.0)),
    ]
    union = shape_of(made)
    for z in (-3.0, 0.0, 1.0, 4.0, 30.0):
        X, Y = random_pose(rng, 0.5), EYE
        X[2, 3] = z
        r = collide.distance(union, ground, X, Y)
        want = (
            min(float(world_points(v, P)[k][2]) for v, _, _, P in leaves(made, exactly(X)) for k in range(len(v))) + 0.5
        )
        assert (
            abs(r.distance - want) < 1e-13
            and r.hit == (want <= 0)
            and r.lower <= want + 1e-15
            and want - 1e-15 <= r.upper
        )
        assert r.certified and collide.collide(ground, union, Y, X) == r.hit
    floor = collide.Compound([(ground, EYE), (BODIES[1][0], pose(t=(0, 0, 3.0)))])
    assert collide.collide(floor, BODIES[0][0], EYE, EYE)  # the ring stands on it
    sunk = collide.distance(floor, BODIES[0][0], EYE, pose(t=(0, 0, -1.0)))
    assert sunk.hit and -math.inf < sunk.lower <= sunk.distance <= sunk.upper <= 0.0
    out = pose(t=(0, 0, -1.0))
    out[:3, 3] -= sunk.lower * sunk.normal
    assert not collide.collide(floor, BODIES[0][0], EYE, out)
    assert collide.distance(floor, BODIES[0][0], EYE, pose(t=(0, 0, -1.0)), signed=False).distance == 0.0
    assert abs(collide.distance(floor, BODIES[1][0], EYE, pose(t=(0, 0, 1.0))).distance - 1.0) < 1e-12


def test_curved_parts_and_deep_nesting():
    """A peg in the hole of a ring, both parts of unions within unions, turned: gaps by formula."""
    ring, peg = BODIES[0][0], collide.Cylinder(0.3, 4.0)
    rng = rng_of("peg")
    for _ in range(5):
        P, Q, W = random_pose(rng, 1.0), random_pose(rng, 1.0), random_pose(rng, 1.0)
        Qi = np.linalg.inv(Q)
        Qi[3] = (0, 0, 0, 1)
        A = collide.Compound([(collide.Compound([(ring, P)]), Q)])
        B = collide.Compound([(collide.Compound([(peg, P)]), Q)])
        r = collide.distance(A, B, W, W)
        assert not r.hit and abs(r.distance - 0.2) < 1e-9 and r.certified
        assert not collide.collide(A, B, W, W) and collide.collide(A, collide.Sphere(9.0), W, W)


def test_bits_of_batches_threads_and_lists():
    rng = rng_of("unions", "bits")
    union = shape_of([(BODIES[0], any_pose(rng, 1.0)), (BODIES[3], any_pose(rng, 1.0))])
    curved = collide.Compound([(collide.Cylinder(0.2, 1.0), EYE), (collide.Sphere(0.2), pose(t=(1.0, 0, 0)))])
    mesh, plain = BODIES[1][0], collide.Capsule(0.2, 0.5)
    shapes = [union, curved, mesh, plain, collide.Cone(0.3, 0.5), collide.Box((0.3, 0.2, 0.1))]
    library = collide.ShapeSet(shapes)
    n = 48
    i, j = rng.integers(0, len(shapes), (2, n))
    X, Y = (np.stack([random_pose(rng, 1.3) for _ in range(n)]) for _ in range(2))
    listed = [shapes[k] for k in i], [shapes[k] for k in j]
    rows, hits = collide.distance(*listed, X, Y), collide.collide(*listed, X, Y)
    assert 0 < hits.sum() < n
    for other in (
        collide.distance(library[i], library[j], X, Y),
        collide.distance(*listed, X, Y, threads=2),
        collide.distance(library[i], listed[1], X, Y, threads=3),
    ):
        assert other.rows.tobytes() == rows.rows.tobytes()
    assert (collide.collide(library[i], library[j], X, Y, threads=2) == hits).all()
    for k in range(n):
        one = collide.distance(listed[0][k], listed[1][k], X[k], Y[k])
        assert one.rows.tobytes() == rows[k].rows.tobytes(), (k, one, rows[k])
        assert collide.collide(listed[0][k], listed[1][k], X[k], Y[k]) == hits[k] == one.hit
    convex = np.flatnonzero((i == 3) | (i == 5))
    assert collide.distance(library[i[convex]], plain, X[convex], Y[convex]).rows.tobytes() == collide.distance(
        [shapes[k] for k in i[convex]], plain, X[convex], Y[convex]
    ).rows.tobytes()
    against_one = collide.distance(listed[0], mesh, X, Y[0])
    assert all(against_one[k].distance == collide.distance(listed[0][k], mesh, X[k], Y[0]).distance for k in range(n))


def test_identical_unions_at_any_order_of_poses():
    rng = rng_of("identical unions")
    union = shape_of([(BODIES[0], any_pose(rng, 1.0)), (BODIES[1], any_pose(rng, 1.0))])
    for spread in (0.5, 3.0, 6.0):
        X, Y = random_pose(rng, spread), random_pose(rng, spread)
        r, s = collide.distance(union, union, X, Y), collide.distance(union, union, Y, X)
        assert (
            r.distance == s.distance
            and np.array_equal(r.normal, 0.0 - s.normal)
            and np.array_equal(r.point_a, s.point_b)
        )
    assert collide.collide(union, union, X, X)


def test_compounds_of_meshes_are_values():
    import pickle

    union = shape_of([(BODIES[0], pose(t=(1.0, 0, 0))), ([(BODIES[1], EYE)], EYE)])
    copy = pickle.loads(pickle.dumps(union))
    assert copy == union and hash(copy) == hash(union) and not union.convex and union.meshed
    assert not collide.Compound([(collide.Sphere(1.0), EYE)]).meshed


def test_products_of_poses_are_bounded_and_said_to_be_exact_only_where_they_are():
    rng = rng_of("products of poses")
    exact = 0
    for k in range(60):
        poser = (any_pose, lattice_pose)[k % 2]
        X, Y = poser(rng, 10.0 ** rng.integers(-3, 7)), poser(rng, 2.0)
        X[:3, :3] *= float(rng.choice([1.0, 1.0, 3.0]))
        points = rng.normal(size=(5, 3))
        reach = np.array([np.sqrt(np.square(points).sum(axis=1)).max()])
        moved, slop = moved_pose(X[None], Y, reach)
        truly, stored = world_points(points, exactly(X).dot(exactly(Y))), world_points(points, moved[0])
        off = max(sum((a - b) ** 2 for a, b in zip(p, q)) for p, q in zip(truly, stored))
        assert off <= Fraction(float(slop[0])) ** 2, (X.tolist(), Y.tolist())
        exact += slop[0] == 0.0
    assert 15 <= exact <= 30, exact
    nested = shape_of([([([(BODIES[0], any_pose(rng, 3.0))], any_pose(rng, 3.0))], any_pose(rng, 3.0))])
    part, X = compound_parts(nested).parts[0], random_pose(rng, 100.0)
    (given, P), = nested.items
    (inner, Q), = given.items
    (mesh, R), = inner.items
    pose_of_it = part.at(X[None], np.zeros(1))
    truly = world_points(mesh.vertices, exactly(X).dot(exactly(P)).dot(exactly(Q)).dot(exactly(R)))
    stored = world_points(mesh.vertices, pose_of_it.X[0])
    off = max(sum((a - b) ** 2 for a, b in zip(p, q)) for p, q in zip(truly, stored))
    assert 0 < off <= Fraction(float(pose_of_it.slop[0])) ** 2 and pose_of_it.slop[0] < 1e-11


def test_products_of_poses_are_decided_within_rounding():
    """Cubes side by side, the pose of one a product that is rounded: steps of an ulp across contact, judged in
    fractions."""
    rng = rng_of("within rounding")
    cube = BODIES[1]
    hits, tested = 0, 0
    for _ in range(4):
        P, X = any_pose(rng, 1.0), any_pose(rng, 1.0)
        union, deep = [(cube, P)], [([(cube, P)], EYE)]
        Z = (exactly(X).dot(exactly(P)) + 0).astype(float)
        for step in (0.0, 1e-16, -1e-16, 3e-16, -3e-16):
            Y = Z.copy()
            Y[:3, 3] += Z[:3, :3] @ np.array([1.0 + step, 0.21, 0.13])
            want = truth(union, cube, X, Y)
            r = collide.distance(shape_of(union), cube[0], X, Y)
            assert r.hit == collide.collide(shape_of(deep), cube[0], X, Y)
            assert r.hit == want and r.how != 0, (P.tolist(), X.tolist(), Y.tolist())
            hits, tested = hits + want, tested + 1
    assert 3 < hits < tested - 3, (hits, tested)


def test_only_narrow_brackets_are_certified():
    """Rounded products of poses far from the world's origin: brackets hold, and are as wide as rounding there."""
    rng = rng_of("far unions")
    cube, plane = collide.Mesh(*box()), collide.Halfspace((0.0, 0.0, 1.0), 0.0)
    told = []
    for away in (0.0, 1e3, 1e6, 1e8):
        union = collide.Compound([(cube, any_pose(rng, 1.0)), (cube, any_pose(rng, 1.0))])
        X, Y = any_pose(rng, 1.0), any_pose(rng, 1.0)
        X[:3, 3] += away
        Y[:3, 3] = X[:3, 3] - 9.0 * Y[:3, 2]
        for other in (cube, collide.Box((1, 1, 1)), collide.Sphere(0.5), plane, union):
            r = collide.distance(union, other, X, Y)
            size = 40.0
            assert not r.hit and (not r.certified or r.upper - r.lower <= 2.0**-43 * size), (
                away,
                other,
                r.lower,
                r.upper,
            )
            told.append((away, bool(r.certified)))
    assert all(sure for away, sure in told if away == 0.0) and not any(sure for away, sure in told if away > 1e5), told


def test_curved_parts_inside_solids():
    """Their poses are rounded products, so that no polytope answers: a point inside does."""
    rng = rng_of("curved inside")
    solid, hollow = (
        collide.Mesh(*box()),
        collide.Mesh(*joined(box(), (box((-0.7,) * 3, (0.7,) * 3)[0], box()[1][:, ::-1]))),
    )
    for shape in (collide.Cylinder(0.05, 0.1), collide.Cone(0.05, 0.1), collide.Ellipsoid((0.05, 0.1, 0.02))):
        union = collide.Compound([(shape, any_pose(rng, 0.2))])
        X = any_pose(rng, 0.2)
        for mesh, want in ((solid, True), (hollow, False)):
            r = collide.distance(union, mesh, X, EYE)
            assert r.hit == want == collide.collide(mesh, union, EYE, X) and r.how != 0
            assert want or (0.0 < r.lower and r.certified)


def test_no_row_of_bodies_that_touch_far_from_the_origin_holds_nan():
    """1e3 … 1e7 m away, brought to touch within rounding: every number of a row is one, of Worlds too."""
    rng = rng_of("touching far away")
    cube = collide.Mesh(*box())
    hits = 0
    for k in range(45):
        kinds = {**naive.one_of_each(rng), "Mesh": cube, "Point": collide.ConvexHull([[0.0, 0.0, 0.0]])}
        first, second = (kinds[str(name)] for name in rng.choice([n for n in kinds if n != "Halfspace"], 2))
        A = collide.Compound([(cube, naive.pose(t=(4, 0, 0))), (first, np.eye(4))]) if k % 3 else first
        X, Y = any_pose(rng, 1.0), any_pose(rng, 1.0)
        X[:3, 3] += rng.normal(size=3) * 10.0 ** rng.uniform(3, 7)
        Y[:3, 3] = X[:3, 3] + 0.3 * rng.normal(size=3)
        for _ in range(3):
            r = collide.distance(A, second, X, Y)
            if not np.isfinite(r.distance):
                break
            Y[:3, 3] -= r.distance * r.normal
        with naive.reproducible(naive.Case(A, second, X, Y)):
            world = collide.World()
            world.add(A, X), world.add(second, Y)
            for rows in (collide.distance(A, second, X, Y).rows, world.distances(max_distance=0.1).rows):
                for name in ("distance", "lower", "upper", "normal", "point_a", "point_b"):
                    assert not np.isnan(rows[name]).any(), name
            hits += r.hit
    assert hits > 10, hits
