"""Bodies of several convex parts: the translation that is reported does separate them."""

from __future__ import annotations

import math
from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide
from collide.adapters.peers import exact
from collide.lowering import parts as lowering_parts

#: One compound is a bracket open to the right: ][ shapes catch each other.
BRACKET = collide.Compound(
    [
        (collide.Box((0.2, 1.0, 1.0)), pose(t=(-0.4, 0, 0))),
        (collide.Box((1.0, 0.2, 1.0)), pose(t=(0, 0.4, 0))),
        (collide.Box((1.0, 0.2, 1.0)), pose(t=(0, -0.4, 0))),
    ]
)


def random_compound(rng) -> collide.Compound:
    kinds = [kind for kind in naive.KINDS if kind not in ("Halfspace", "Compound")]
    chosen = rng.choice(kinds, int(rng.integers(2, 5)))
    return collide.Compound([(naive.one_of_each(rng)[kind], random_pose(rng, 0.5)) for kind in chosen])


def parts_of(shape: collide.Shape) -> list[tuple[collide.Shape, np.ndarray]]:
    if isinstance(shape, collide.Compound):
        return [(part, X @ X_SP) for item, X in shape.items for part, X_SP in parts_of(item)]
    return [(shape, np.eye(4))]


def case_of(rng, k: int) -> Case:
    A = random_compound(rng)
    B = random_compound(rng) if k % 2 else naive.one_of_each(rng)[naive.KINDS[k // 2 % 6]]
    return Case(A, B, random_pose(rng, 0.5), random_pose(rng, 1.0))


def test_overlapping_unions_come_apart_along_the_normal():
    rng = rng_of("unions")
    hits = []
    for k in range(120):
        case = case_of(rng, k)
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            assert r.lower <= r.distance <= r.upper and math.isfinite(r.distance)
            assert r.hit == collide.collide(*case)
            assert abs(np.linalg.norm(r.normal) - 1) < 1e-14
            if r.hit:
                extra = 1e-9 - r.distance
                assert not collide.collide(*case.with_b_moved(extra * r.normal)), "still together"
            else:
                moved = case.with_b_moved(-(r.distance + 1e-6) * r.normal)
                assert collide.collide(*moved), "moved by the distance, they do not touch"
    assert 0.4 < naive.share(hits) < 0.95


def test_distance_of_unions_is_the_least_of_their_parts():
    rng = rng_of("least")
    hits = []
    for k in range(60):
        case = case_of(rng, k)
        with naive.reproducible(case):
            rows = [
                collide.distance(S, T, case.X_WA @ X, case.X_WB @ Y)
                for S, X in parts_of(case.A)
                for T, Y in parts_of(case.B)
            ]
            r = collide.distance(*case)
            hits.append(r.hit)
            assert r.hit == any(row.hit for row in rows)
            least = min(row.distance for row in rows)
            if r.hit:
                # The union is at least as hard to separate as its deepest pair of parts.
                assert r.distance <= least + 1e-8 and r.upper <= min(row.upper for row in rows) + 1e-8
                assert r.lower >= -(radius_around(case.A) + radius_around(case.B) + 3.0), "far beyond both bodies"
            else:
                assert r.distance == pytest.approx(least, abs=1e-8)
                assert r.normal @ rows[int(np.argmin([row.distance for row in rows]))].normal > 0.999
    assert 0.3 < naive.share(hits) < 0.95


def radius_around(shape: collide.Shape) -> float:
    parts = lowering_parts.parts_of(shape)
    return max(packed.reach + packed.radius + float(np.linalg.norm(X[:3, 3])) for packed, X in parts)


def test_upper_bound_is_what_the_parts_need():
    """The truth lies between the deepest pair of parts and the way out that is reported."""
    rng = rng_of("sampled way out")
    for _ in range(12):
        case = Case(random_compound(rng), random_compound(rng), random_pose(rng, 0.2), random_pose(rng, 0.3))
        r = collide.distance(*case)
        if not r.hit:
            continue
        with naive.reproducible(case):
            # Along no direction is a step shorter than −upper enough.
            for n in rng.normal(size=(60, 3)):
                shift = -r.upper * (1 - 1e-6) * naive.unit(n)
                assert collide.collide(*case.with_b_moved(shift)), "a shorter way out than the bound allows"


def test_the_bound_of_the_way_out_counts_its_own_rounding():
    """Moved by −lower along the reported normal, exactly: integers find every pair of parts apart."""
    rng = rng_of("exact way out")
    hits = []
    for _ in range(40):
        unions = [
            collide.Compound([(collide.Box(rng.uniform(0.2, 1, 3)), random_pose(rng, 0.5)) for _ in range(3)])
            for _ in range(2)
        ]
        case = Case(*unions, np.eye(4), np.eye(4))  # at the origin parts keep the poses given
        r = collide.distance(*case)
        hits.append(r.hit)
        if not r.hit:
            continue
        with naive.reproducible(case):
            n = [Fraction(x) for x in r.normal.tolist()]
            # The normal is a unit vector to rounding only, and √x ≤ (1 + x) / 2.
            length = Fraction(-r.lower) / ((1 + sum(x * x for x in n)) / 2)
            for A in exact_corners(unions[0]):
                for B in exact_corners(unions[1]):
                    moved = [[x + length * y for x, y in zip(p, n)] for p in B]
                    digits = max(x.denominator.bit_length() - 1 for p in A + moved for x in p)
                    integers = [[tuple(int(x * 2 ** (digits + 80)) for x in p) for p in side] for side in (A, moved)]
                    assert any(exact.gjk(*integers).v), "still together"
    assert naive.share(hits) > 0.5


def exact_corners(union: collide.Compound) -> list[list[list[Fraction]]]:
    """Of each box its corners."""
    found = []
    for box, X in union.items:
        points, e = exact.world_points(naive.corners(box)[0], X[:3, :3], X[:3, 3])
        found.append([[x * Fraction(2) ** e for x in p] for p in points])
    return found


def test_brackets_that_hook_into_each_other():
    """Hulls overlap, the bodies need not: an arm of each stands in the pocket of the other."""
    turned = np.diag([-1.0, -1.0, 1.0])
    free = collide.distance(BRACKET, BRACKET, np.eye(4), pose(turned, (0.6, 0.3, 0.0)))
    assert not free.hit and free.distance == pytest.approx(0.1, abs=1e-12)
    # 0.2 lower both arms are caught by 0.1, and 0.1 along y sets them free; what is reported is a bound.
    caught = collide.distance(BRACKET, BRACKET, np.eye(4), pose(turned, (0.6, 0.1, 0.0)))
    assert caught.hit and caught.lower <= -0.1 + 1e-12 and caught.upper >= -0.1 - 1e-12
    moved = pose(turned, np.array([0.6, 0.1, 0.0]) + (1e-9 - caught.distance) * caught.normal)
    assert not collide.collide(BRACKET, BRACKET, np.eye(4), moved)


def test_compound_of_one_part_is_that_part():
    rng = rng_of("one part")
    for kind in ("Sphere", "Box", "Cylinder", "ConvexHull", "HPolytope"):
        for _ in range(10):
            part, other = naive.one_of_each(rng)[kind], naive.one_of_each(rng)["Box"]
            X, Y = random_pose(rng), random_pose(rng)
            one = collide.distance(collide.Compound([(part, np.eye(4))]), other, X, Y)
            assert not naive.same_bits(one.rows, collide.distance(part, other, X, Y).rows)
            shifted = collide.distance(collide.Compound([(part, random_pose(rng, 0.2))]), other, X, Y)
            assert shifted.lower <= shifted.distance <= shifted.upper


def test_nested_compounds_count_the_rounding_of_their_poses():
    """A pose split over three levels gives a bracket around the answer of the pose at once."""
    rng = rng_of("nested")
    for _ in range(40):
        box, other = collide.Box(rng.uniform(0.2, 1, 3)), naive.one_of_each(rng)["ConvexHull"]
        X1, X2, X_WA, X_WB = (random_pose(rng) for _ in range(4))
        inner = collide.Compound([(box, X2)])
        case = Case(collide.Compound([(inner, X1)]), other, X_WA, X_WB)
        with naive.reproducible(case):
            r = collide.distance(*case)
            flat = collide.distance(box, other, X_WA @ X1 @ X2, X_WB)
            assert r.lower <= flat.upper and flat.lower <= r.upper
            assert r.distance == pytest.approx(flat.distance, abs=1e-14)
            truth = exact_of_nested(box, (X_WA, X1, X2), other, X_WB)
            assert r.lower <= truth <= r.upper


def exact_of_nested(box, poses, other, X_WB) -> float:
    """Signed distance with the product of poses taken exactly: the box's corners as integers of their own."""
    moved = [[Fraction(float(x)) for x in p] for p in naive.corners(box)[0]]
    for X in reversed(poses):
        entries = [[Fraction(float(x)) for x in row] for row in X]
        moved = [[sum(r * x for r, x in zip(row, (*p, 1))) for row in entries[:3]] for p in moved]
    points, radius = naive.corners(other)
    B, e = exact.world_points(points, X_WB[:3, :3], X_WB[:3, 3])
    shift = max(max(x.denominator.bit_length() - 1 for p in moved for x in p), -e)
    A = [tuple(int(x * 2**shift) for x in p) for p in moved]
    B = [tuple(x << (e + shift) for x in p) for p in B]
    nearest = exact.gjk(A, B)
    if any(nearest.v):
        core = math.sqrt(Fraction(exact.dot(nearest.v, nearest.v), nearest.total**2 * 4**shift))
    else:
        core = -float(exact.epa(A, B, -shift, nearest.pairs, 30).depth)
    return core - radius


def test_union_against_a_halfspace_is_as_deep_as_its_lowest_point():
    rng = rng_of("half-space")
    floor = collide.Halfspace((0, 0, 1), 0.0)
    hits = []
    for _ in range(30):
        union, X = random_compound(rng), random_pose(rng, 0.8)
        case = Case(floor, union, np.eye(4), X)
        with naive.reproducible(case):
            r = collide.distance(*case)
            hits.append(r.hit)
            assert r.distance == pytest.approx(naive.extent_along(union, X, np.array([0, 0, 1.0])), abs=1e-14)
            assert np.array_equal(r.normal, (0, 0, 1)) and r.certified
    assert 0.2 < naive.share(hits) < 0.95


def test_halfspaces_inside_a_compound():
    """A corridor of two half-spaces: bounded overlap is not in sight, and says so."""
    corridor = collide.Compound(
        [(collide.Halfspace((0, 0, 1), -1.0), np.eye(4)), (collide.Halfspace((0, 0, -1), -1.0), np.eye(4))]
    )
    ball = collide.Sphere(0.5)
    r = collide.distance(corridor, ball, np.eye(4), pose(t=(3, 4, 0.25)))
    assert not r.hit and r.distance == pytest.approx(0.25, abs=1e-14)
    assert collide.collide(corridor, ball, np.eye(4), pose(t=(3, 4, 0.75)))


@pytest.mark.parametrize("of_meshes", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize(
    ("width", "beside", "height", "shortest"),
    [(1.0, 2.0, 0.45, 0.1), (1.0, 0.0, 0.45, 0.1), (1.0, 0.0, 0.0, 0.25), (0.4, 2.0, 0.3, 0.25), (0.4, 0.0, 0.3, 0.35)],
)
def test_there_is_a_way_out_between_half_spaces_that_face_each_other(width, beside, height, shortest, of_meshes):
    """A long way led into the other half-space, whatever its direction: unions with meshes were refused.

    A corridor with a cube in it, and a cube of the same size; no way out is shorter than ``shortest``.
    """
    cube = collide.Box((0.3, 0.3, 0.3))
    mesh = collide.Mesh(*collide.tessellate(cube)[:2])
    inner, B = (mesh if is_mesh else cube for is_mesh in of_meshes)
    walls = [(collide.Halfspace((0, 0, z), -width / 2), np.eye(4)) for z in (1, -1)]
    corridor = collide.Compound([*walls, (inner, pose(t=(beside, 0, 0)))])
    X = pose(t=(0.05, 0, height))
    for case in (Case(corridor, B, np.eye(4), X), Case(B, corridor, X, np.eye(4))):
        r = collide.distance(*case)
        assert r.hit and -r.lower >= shortest - 1e-9
        moved = case.X_WB.copy()
        moved[:3, 3] += (1e-12 - r.lower) * r.normal
        assert not collide.collide(case.A, case.B, case.X_WA, moved)


def test_a_corridor_too_narrow_says_what_else_to_ask():
    cube = collide.Box((0.3, 0.3, 0.3))
    mesh = collide.Mesh(*collide.tessellate(cube)[:2])
    walls = [(collide.Halfspace((0, 0, z), -0.1), np.eye(4)) for z in (1, -1)]
    for inner in (cube, mesh):
        corridor = collide.Compound([*walls, (inner, pose(t=(2, 0, 0)))])
        with pytest.raises(collide.UnsupportedQuery, match=r"no translation was found .* distance\(signed=False\)"):
            collide.distance(corridor, cube, np.eye(4), np.eye(4))
        assert collide.distance(corridor, cube, np.eye(4), np.eye(4), signed=False).hit
        assert len(collide.contacts(corridor, cube, np.eye(4), np.eye(4))) == 8


def test_gaps_alone_of_overlapping_unions_name_a_point_of_both():
    """Both points in one place, which lies in a part of either body: the parts that are named."""
    rng = rng_of("common points of unions")
    hits = []
    for _ in range(20):
        A, B = (
            collide.Compound([(collide.Box(rng.uniform(0.2, 1, 3)), random_pose(rng, 0.5)) for _ in range(4)])
            for _ in range(2)
        )
        X_WA, X_WB = (np.array([random_pose(rng, 0.6) for _ in range(20)]) for _ in range(2))
        rows = collide.distance(A, B, X_WA, X_WB, signed=False).rows
        hits.extend(rows["hit"])
        for row, X, Y in zip(rows, X_WA, X_WB):
            if not row["hit"]:
                continue
            assert row["distance"] == row["lower"] == row["upper"] == 0.0 and (row["point_a"] == row["point_b"]).all()
            for union, X_WC, part in ((A, X, row["part_a"]), (B, Y, row["part_b"])):
                box, X_CP = union.items[part]
                inside = np.linalg.inv(X_WC @ X_CP) @ np.append(row["point_a"], 1.0)
                assert (np.abs(inside[:3]) <= 0.5 * np.array(box.size) + 1e-12).all(), (A, B, X, Y)
    assert 0.2 < naive.share(hits) < 0.95


def test_a_union_of_more_parts_than_a_block_has_room_for():
    """5,000 balls, of which one or two are near: the least of their distances, which formulas tell."""
    rng = rng_of("many parts")
    centres = rng.uniform(-1, 1, (5000, 3))
    cloud = collide.Compound([(collide.Sphere(0.001), pose(t=c)) for c in centres])
    where = rng.uniform(-1, 1, (30, 3))
    X = np.array([pose(t=t) for t in where])
    rows = collide.distance(cloud, collide.Sphere(0.03), np.eye(4), X).rows
    apart = np.linalg.norm(centres[None] - where[:, None], axis=2)
    assert (rows["hit"] == (apart.min(axis=1) <= 0.031)).all()
    free = ~rows["hit"]  # among the others, a way out of the whole cloud is long
    assert np.abs(rows["distance"] - (apart.min(axis=1) - 0.031))[free].max() < 1e-14
    assert (rows["part_a"] == apart.argmin(axis=1))[free].all()
    assert (collide.collide(cloud, collide.Sphere(0.03), np.eye(4), X) == rows["hit"]).all()
    assert 3 <= free.sum() <= 27
