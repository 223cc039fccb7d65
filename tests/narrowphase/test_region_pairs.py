"""Regions of half-spaces in pair queries: as if closed by a far box by hand, exact at touching, refused by name."""

from __future__ import annotations

import pickle
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, one_of_each, pose, random_pose, rng_of
from regions import FAMILIES, by_far_box, region_rows, unit
from reproduction import reproducing

import collide
from collide import polytopes
from collide.certificates.certificate import CertificateRefused
from collide.errors import InvalidPose, InvalidShape, UnsupportedQuery

AGAIN = """import numpy as np, collide
region = collide.HPolytope({normals}, {offsets}, bounded=False)  # against one_of_each(...)["{kind}"]
X_WA, X_WB = np.array({X_WA}), np.array({X_WB})"""
#: Corners of the far box are rounded once; curved shapes are known to 2⁻²⁶ of the size, with that box in it.
ROUNDING, ROUNDING_CURVED = 1e-11, 1e-5
CURVED = ("Cylinder", "Cone", "Ellipsoid", "Compound", "Mesh")


def partners(rng) -> dict[str, collide.Shape]:
    shapes = one_of_each(rng)
    del shapes["Halfspace"]
    shapes["Mesh"] = collide.Mesh(*collide.tessellate(collide.Box((0.6, 0.4, 0.3))))
    return shapes


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES)
def test_as_closed_by_a_far_box(family):
    rng, seen = rng_of("region", family), {True: 0, False: 0}
    for _ in range(4):
        normals, offsets = region_rows(rng, family)
        region = collide.HPolytope(normals, offsets, bounded=False)
        # Corners of many planes in integers would take minutes.
        closed = region.closed(64.0) if family == "many" else by_far_box(normals, offsets)
        for kind, shape in partners(rng).items():
            X_WA, X_WB = random_pose(rng, 0.5), random_pose(rng, 0.8)
            with reproducing(AGAIN, normals=normals, offsets=offsets, kind=kind, X_WA=X_WA, X_WB=X_WB):
                r, known = (collide.distance(A, shape, X_WA, X_WB) for A in (region, closed))
                slack = ROUNDING_CURVED if kind in CURVED else ROUNDING
                if kind in ("Compound", "Mesh") and r.hit:  # a length that separates, not the least one
                    assert known.hit
                else:
                    assert known.lower - slack <= r.upper and r.lower <= known.upper + slack
                    assert abs(r.distance - known.distance) <= slack
                assert r.hit == known.hit == collide.collide(region, shape, X_WA, X_WB)
                assert r.certified or kind in ("Compound", "Mesh")
                turned = collide.distance(shape, region, X_WB, X_WA)
                assert turned.distance == r.distance and (turned.normal == -r.normal).all()
                assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-9 or kind in CURVED
                if r.certificate is not None:
                    collide.verify(region, shape, X_WA, X_WB, r)
                near = collide.contacts(region, shape, X_WA, X_WB, margin=0.05)
                assert (len(near.distance) > 0) == (r.distance <= 0.05)
                seen[bool(r.hit)] += 1
    assert min(seen.values()) >= 3, seen


def test_batches_sets_and_threads_give_the_same_bits():
    rng = rng_of("region batches")
    region = collide.HPolytope(*region_rows(rng, "frustum"), bounded=False)
    shapes = [region, *partners(rng).values()]
    X_WA = np.array([random_pose(rng) for _ in range(60)])
    X_WB = np.array([random_pose(rng, 0.7 if k % 5 else 3000.0) for k in range(60)])
    which = rng.integers(1, len(shapes), 60)
    one_by_one = [collide.distance(region, shapes[k], X, Y) for k, X, Y in zip(which, X_WA, X_WB)]
    library = collide.ShapeSet(shapes)
    zeros = np.zeros(60, dtype=int)
    for threads in (1, 2):
        r = collide.distance(library[zeros], library[which], X_WA, X_WB, threads=threads)
        assert r.rows.tobytes() == np.concatenate([single.rows for single in one_by_one]).tobytes()
        hits = collide.collide(library[which], library[zeros], X_WB, X_WA, threads=threads)
        assert hits.tolist() == r.hit.tolist() and 5 <= hits.sum() <= 55
    axes = np.zeros((60, 3))
    box = shapes[2]
    hits = collide.collide(region, box, X_WA, X_WB, axes=axes)
    assert (hits == collide.collide(region, box, X_WA, X_WB, axes=axes)).all() and axes[~hits].any()


@pytest.mark.slow
@pytest.mark.parametrize("n_more", [0, 3, 90])
def test_touching_is_decided_on_the_planes_as_given(n_more):
    """A vertex on a plane, one unit in the last place of an offset either side, as `polytopes.meets` has it."""
    rng, seen = rng_of("region touching", n_more), {True: 0, False: 0}
    for k in range(24):
        n = rng.integers(-9, 10, 3) + np.array([10, 0, 0])
        corner = rng.integers(-40, 40, 3)
        points = corner + np.vstack((np.zeros(3), rng.integers(-9, 10, (6, 3)) + 12 * n))
        more = rng.integers(-99, 100, (n_more, 3)) - 30 * n
        normals = np.vstack((n, more)).astype(float)
        R, shift = LATTICE_ROTATIONS[k % 24], rng.integers(-50, 50, 3)
        X_WA, X_WB = pose(R, shift), pose(R, shift)
        beside = (more @ corner + rng.integers(1, 50, n_more)).astype(float)
        exact = float(n @ corner)
        for offset in (np.nextafter(exact, -np.inf), exact, np.nextafter(exact, np.inf)):
            offsets = np.append(offset, beside)
            with reproducing(AGAIN, normals=normals, offsets=offsets, kind=points.tolist(), X_WA=X_WA, X_WB=X_WB):
                region, hull = collide.HPolytope(normals, offsets, bounded=False), collide.ConvexHull(points)
                expected = polytopes.meets(points.astype(float), normals, offsets)
                hit = collide.collide(region, hull, X_WA, X_WB)
                assert hit is bool(expected.hit)
                r = collide.distance(hull, region, X_WB, X_WA)
                assert r.hit == hit and r.certified and (r.lower > 0.0 or r.upper > 0.0 or hit)
                assert r.lower <= expected.lower and (hit or r.upper >= expected.upper)
                collide.verify(hull, region, X_WB, X_WA, r)
                seen[hit] += 1
    assert min(seen.values()) >= 12, seen


def test_balls_touch_exactly():
    """n·c − b = radius |n| in fractions: a unit of the radius decides."""
    normals, seen = np.array([(3.0, 4.0, 0.0), (0.0, 0.0, -1.0), (-1.0, 1e-3, 1.0)]), []
    region = collide.HPolytope(normals, (1.0, 100.0, 90.0), bounded=False)
    for radius in (np.nextafter(0.7, 0.0), 0.7, np.nextafter(0.7, 1.0)):
        centre = np.array([1.5, 0.0, 2.0])  # (4.5 − 1) / 5 = 0.7, which no double is
        hit = collide.collide(region, collide.Sphere(radius), np.eye(4), pose(t=centre))
        assert hit == (Fraction(radius) >= Fraction(7, 10))
        near = collide.collide(region, collide.Sphere(radius - 0.25), np.eye(4), pose(t=centre), security_margin=0.25)
        assert near == (Fraction(radius - 0.25) + Fraction(1, 4) >= Fraction(7, 10))
        seen.append(hit)
    assert seen == [False, Fraction(0.7) >= Fraction(7, 10), True]


def test_bodies_without_end_either():
    up = collide.HPolytope([(0, 0, 1.0)], [0.0], bounded=False)
    corridor = collide.HPolytope([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0.0)], [1, 1, 1, 1.0], bounded=False)
    down, tilted = collide.Halfspace((0, 0, -1.0), -1.0), collide.Halfspace((1e-12, 0, -1.0), -1.0)
    X = np.eye(4)
    r = collide.distance(up, down, X, X)
    assert not r.hit and r.certified and r.lower <= 1.0 <= r.upper and r.upper - r.lower < 1e-12
    assert (collide.distance(down, up, X, X).normal == -r.normal).all() and r.certificate is None
    assert collide.collide(up, tilted, X, X) and not collide.collide(up, down, X, X)
    touching = collide.Halfspace((0, 0, -1.0), 0.0)
    assert collide.collide(up, touching, X, X) and not collide.collide(up, touching, X, pose(t=(0, 0, 5e-324)))
    for unbounded in (tilted, up):
        with pytest.raises(UnsupportedQuery, match="overlap has no end"):
            collide.distance(up, unbounded, X, X)
    assert collide.distance(corridor, up, X, X, signed=False).distance == 0.0
    side = collide.Halfspace((1.0, 0, 0), -0.25)  # 0.75 deep: sideways the corridor comes free
    r = collide.distance(corridor, side, X, X)
    assert r.hit and r.lower <= r.distance <= r.upper and abs(r.distance + 0.75) < 1e-12 and not r.certified
    across = collide.HPolytope(corridor.normals[:, [2, 1, 0]], corridor.offsets, bounded=False)
    r = collide.distance(corridor, across, X, pose(t=(0, 2.5, 0)))
    assert abs(r.distance - 0.5) < 1e-9 and r.certified
    with pytest.raises(UnsupportedQuery, match="neither has an end"):
        collide.contacts(up, down, X, X)
    with pytest.raises(UnsupportedQuery, match="regions"):
        collide.time_of_impact(up, down, X, X, X, X)


def test_many_half_spaces():
    """Tangent planes of a ball: 100,000 are a shape at once and have no corner; 8,000 are answered as the ball is."""
    rng = rng_of("region of many")
    normals = unit(rng.normal(size=(100_000, 3)))
    region = collide.HPolytope(normals, np.ones(100_000) + normals @ (0.5, 0.0, 0.0), bounded=False)
    assert not hasattr(region, "vertices") and not hasattr(region, "_closed")
    assert 0.49 < region.boundary_within < 0.51
    few = collide.HPolytope(normals[:8000], region.offsets[:8000], bounded=False)
    ball, box = collide.Sphere(1.0), collide.Box((1, 1, 1))
    X_WBs = np.array([pose(t=t) for t in rng.normal(size=(40, 3)) * 1.6])
    r = collide.distance(few, box, np.eye(4), X_WBs, signed=False)
    of_ball = collide.distance(ball, box, pose(t=(0.5, 0, 0)), X_WBs, signed=False)
    assert np.abs(r.distance - of_ball.distance).max() < 3e-3 and 5 < r.hit.sum() < 35 and r.certified.all()
    assert (r.distance <= of_ball.distance + 1e-12).all()


BAD = {
    r"normals\[1\] is zero": ([(1, 0, 0), (0, 0, 0)], [1, 1]),
    r"normals\[0, 2\] is nan": ([(1, 0, float("nan"))], [1]),
    r"offsets\[0\] is inf": ([(1, 0, 0)], [float("inf")]),
    r"offsets must have shape \(2,\)": ([(1, 0, 0), (0, 1, 0)], [1]),
    r"normals must have shape \(N, 3\)": ([(1, 0)], [1]),
    r"normals is empty": (np.zeros((0, 3)), []),
    r"normals\[0, 0\] is 1e\+150": ([(1e150, 0, 0)], [1]),
    r"half-space 0 is farther than 1e\+50": ([(1e-150, 0, 0)], [1]),
    r"empty: half-spaces 1 and 2 contradict": ([(0, 1, 0), (1, 0, 0), (-1, 0, 0)], [5, -1, 0.5]),
    r"empty: half-spaces 0, 1 and 2 contradict": ([(1, 0, 0), (0, 1, 0), (-1, -1, 0)], [-1, -1, 1]),
    r"empty: half-spaces 0, 1, 2 and 3": ([(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, -1, -1)], [-1, -1, -1, 2]),
}


@pytest.mark.parametrize("message", BAD)
def test_bad_input_is_refused_by_name(message):
    with pytest.raises(InvalidShape, match=message):
        collide.HPolytope(*BAD[message], bounded=False)


def test_what_is_no_question_is_refused_by_name():
    region = collide.HPolytope([(0, 0, 1.0)], [0.0], bounded=False)
    with pytest.raises(InvalidPose, match="X_WB"):
        collide.collide(region, collide.Sphere(1.0), np.eye(4), 2.0 * np.eye(4))
    with pytest.raises(InvalidShape, match=r"items\[0\] is an HPolytope with bounded=False"):
        collide.Compound([(region, np.eye(4))])
    with pytest.raises(UnsupportedQuery, match="cannot be cast"):
        collide.shape_cast(region, np.eye(4), (1, 0, 0), collide.Sphere(1.0), np.eye(4))
    with pytest.raises(UnsupportedQuery, match="give the size"):
        collide.tessellate(region)
    with pytest.raises(UnsupportedQuery):
        collide.collide(region, collide.Box((1, 1, 1)), np.eye(4), np.eye(4), algorithm="barba-langerman")
    assert not hasattr(region, "vertices")
    far = pose(t=(0, 0, -5e49))
    with pytest.raises(UnsupportedQuery, match="may be 1"):
        collide.collide(region, collide.Sphere(1.0), np.eye(4), far)


def test_shapes_are_values():
    region = collide.HPolytope([(0, 0, 1.0)], [0.0], bounded=False)
    assert pickle.loads(pickle.dumps(region)) == region == eval(repr(region), {"HPolytope": collide.HPolytope})
    cube = np.vstack((np.eye(3), -np.eye(3)))
    assert collide.HPolytope(cube, np.ones(6)) != collide.HPolytope(cube, np.ones(6), bounded=False)
    assert region.boundary_within == 0.0 and region.is_region and not region.meshed
    scaled = collide.HPolytope([(0, 0, 1e-40)], [1e-45], bounded=False)
    assert collide.distance(scaled, collide.Sphere(1e-5), np.eye(4), pose(t=(0, 0, 1e-4))).distance == pytest.approx(
        8e-5, rel=1e-9
    )


def test_tampered_certificates_are_refused():
    rng = rng_of("region certificates")
    region = collide.HPolytope(*region_rows(rng, "slab"), bounded=False)
    box, kinds = collide.Box((0.5, 0.4, 0.3)), set()
    for _ in range(20):
        X_WA, X_WB = random_pose(rng, 0.3), random_pose(rng, 0.5)
        r = collide.distance(region, box, X_WA, X_WB)
        c = r.certificate
        written = [c.kind, c.vertices, list(map(str, c.weights)), c.halfspaces, list(map(str, c.multipliers))]
        collide.verify(region, box, X_WA, X_WB, r, certificate=written)
        lies = [c._replace(kind="apart" if c.kind == "together" else "together"), c._replace(vertices=(99,))]
        if c.kind == "together":
            lies.append(c._replace(weights=tuple(2 * w for w in c.weights)))
        else:
            lies.append(c._replace(multipliers=tuple(-m for m in c.multipliers)))
            lies.append(c._replace(multipliers=tuple(0 * m for m in c.multipliers)))
        for lie in lies:
            with pytest.raises(CertificateRefused):
                collide.verify(region, box, X_WA, X_WB, r, certificate=lie)
        kinds.add(c.kind)
    assert kinds == {"apart", "together"}
