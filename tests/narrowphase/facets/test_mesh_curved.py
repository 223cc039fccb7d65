"""Meshes against cylinders, cones, ellipsoids and polytopes with rounded corners.

The oracle is rational: a polytope inside the curved shape and one around it, against every facet by brute force
(`adapters/peers/exact.py`), and winding numbers for what lies inside. Tighter, but of the engine: the least of all
facets asked about one by one as hulls.
"""

from __future__ import annotations

import math
from fractions import Fraction

import naive
import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import Case, pose, random_pose, rng_of
from naive_triangles import as_integers, winding, world_points
from surfaces import joined

import collide
from collide.hull.exact_hull import convex_hull
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import PosesWithSlop, body_of
from collide.narrowphase.facets import mesh_curved
from collide.narrowphase.facets import near_facets as near_facets_module
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT
from collide.narrowphase.facets.mesh_curved import settle_curved
from collide.narrowphase.facets.near_facets import near_facets
from collide.results import UNDECIDED

KINDS = ("Cylinder", "Cone", "Ellipsoid", "HPolytope")
EYE = np.eye(4)
SIDES, RINGS = 24, 8


def hollow_box():
    vertices, faces = box((-0.7,) * 3, (0.7,) * 3)
    return joined(box(), (vertices, faces[:, ::-1]))


def open_box():
    vertices, faces = box()
    return vertices, faces[2:]


#: name: (vertices, faces, whether a solid)
MESHES = {
    "box": (*box(), True),
    "ring": (*block_ring(), True),
    "hollow": (*hollow_box(), True),
    "overlapping": (*joined(box(), box((0, 0, 0), (2, 2, 2))), True),
    "open": (*open_box(), False),
    "soup": (*soup(np.random.default_rng(5), 9), False),
}


def shape_of(kind, rng):
    a, b, c = (float(x) for x in rng.uniform(0.05, 0.45, 3))
    if kind == "HPolytope":
        normals = np.vstack([np.eye(3), -np.eye(3), rng.normal(size=(3, 3))])
        return collide.HPolytope(normals, [a, b, c, a, b, c, *rng.uniform(0.1, 0.4, 3)])
    return {
        "Cylinder": lambda: collide.Cylinder(a, 2 * b),
        "Cone": lambda: collide.Cone(a, 2 * b),
        "Ellipsoid": lambda: collide.Ellipsoid((a, b, c)),
    }[kind]()


def polytopes(shape):
    """(inside, around), coarse: exact arithmetic has to look at all facets with them."""
    if isinstance(shape, collide.HPolytope):
        return collide.ConvexHull(shape.vertices), collide.ConvexHull(shape.vertices)
    if isinstance(shape, collide.Ellipsoid):
        polar, around = np.meshgrid(np.linspace(0, np.pi, RINGS + 1), np.arange(2 * RINGS) * np.pi / RINGS)
        ball = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
        points, factor = ball.reshape(-1, 3) * shape.radii, 1 / math.cos(math.sqrt(0.5) * math.pi / RINGS)
        return collide.ConvexHull(points), collide.ConvexHull(points * factor)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    ring = np.stack([shape.radius * np.cos(angle), shape.radius * np.sin(angle), 0 * angle], axis=1)
    low, high = (0, 0, -shape.length / 2), (0, 0, shape.length / 2)
    points = np.vstack([ring + low, [high] if isinstance(shape, collide.Cone) else ring + high])
    factor = 1 / math.cos(math.pi / SIDES)
    return collide.ConvexHull(points), collide.ConvexHull(points * (factor, factor, 1.0))


def within(vertices, faces, X, shape, Y) -> bool:
    """Whether a point of the shape lies in the solid."""
    own = shape.vertices[0] if isinstance(shape, collide.HPolytope) else np.zeros(3)
    a, b = as_integers(world_points(vertices, X), world_points(own[None], Y))
    return winding([[a[v] for v in face] for face in faces.tolist()], b[0]) not in (0,)


def least(vertices, faces, X, shape, Y) -> float:
    """The exact signed distance of the nearest facet."""
    facets = (collide.ConvexHull(vertices[face]) for face in faces)
    return min(float(naive.exact_distance(Case(facet, shape, X, Y))) for facet in facets)


def snippet(name, shape, X, Y) -> str:
    vertices, faces, _ = MESHES[name]
    return (
        f"A = collide.Mesh({vertices.tolist()}, {faces.tolist()})\nB = {naive.spell(shape)}\n"
        f"X_WA = {X.tolist()}\nX_WB = {Y.tolist()}"
    )


@pytest.fixture(params=["as it is", "hulls first"])
def order(request, monkeypatch):
    """Hulls and a likely facet are asked first where many facets may be near only; here everywhere."""
    if request.param == "hulls first":
        monkeypatch.setattr(mesh_curved, "_MAX_NEAR_FACETS", 0)


@pytest.mark.slow
@pytest.mark.usefixtures("order")
@pytest.mark.parametrize("kind", KINDS)
def test_between_the_polytopes_inside_and_around(kind):
    rng = rng_of("mesh", "between", kind)
    told = {"hit": 0, "apart": 0, "within": 0}
    for name, (vertices, faces, solid) in MESHES.items():
        mesh = collide.Mesh(vertices, faces)
        assert mesh.solid == solid
        for case in range(5):
            shape = shape_of(kind, rng)
            X, Y = random_pose(rng, 0.2), random_pose(rng, (2.0, 1.2, 0.4, 0.1, 3.0)[case])
            r, inside_out = collide.distance(mesh, shape, X, Y), snippet(name, shape, X, Y)
            inner, outer = polytopes(shape)
            above, below = least(vertices, faces, X, inner, Y), least(vertices, faces, X, outer, Y)
            assert collide.collide(mesh, shape, X, Y) == r.hit, inside_out
            if below > 1e-12:
                contained = solid and within(vertices, faces, X, shape, Y)
                assert r.hit == contained, inside_out
                told["within" if contained else "apart"] += 1
            elif above < -1e-12:
                assert r.hit, inside_out
                told["hit"] += 1
            assert r.lower <= r.distance <= r.upper
            if not r.hit:
                assert below - 1e-14 <= r.upper and r.lower <= above + 1e-14, inside_out
                assert r.certified and r.upper - r.lower < 2.0**-26 * 8, inside_out
                assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-13
                assert 0 <= r.part_a < len(faces) and r.part_b == 0
            else:
                assert r.upper == 0.0 and (r.distance < 0.0 or r.lower < 0.0)
    assert min(told.values()) >= 3, told


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", KINDS)
def test_gaps_are_those_of_all_facets_one_by_one(kind):
    rng = rng_of("mesh", "one by one", kind)
    vertices, faces = bumpy_sphere(300)
    mesh = collide.Mesh(vertices, faces)
    gaps = 0
    for k in range(14):
        shape = shape_of(kind, rng)
        X, Y = random_pose(rng, 0.2), random_pose(rng, 0.2)
        Y[:3, 3] += naive.unit(rng.normal(size=3)) * (1.2 + 0.1 * k)
        r = collide.distance(mesh, shape, X, Y)
        if r.hit:
            continue
        gaps += 1
        rows = collide.distance(
            [collide.ConvexHull(vertices[face]) for face in faces], [shape] * len(faces), [X] * len(faces), Y
        )
        assert rows.lower.min() <= r.upper and r.lower <= rows.upper.min(), snippet_of(mesh, shape, X, Y)
        assert abs(r.distance - rows.distance.min()) < 1e-9, snippet_of(mesh, shape, X, Y)
        assert rows.lower[r.part_a] <= r.upper
    assert gaps >= 6, gaps


def snippet_of(mesh, shape, X, Y) -> str:
    return f"vertices, faces = bumpy_sphere(300)\nB = {naive.spell(shape)}\nX_WA = {X.tolist()}\nX_WB = {Y.tolist()}"


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", KINDS)
def test_overlaps_come_apart_by_the_translation_told(kind):
    rng = rng_of("mesh", "depth", kind)
    deep = 0
    for name in ("box", "ring", "hollow", "open"):
        vertices, faces, solid = MESHES[name]
        mesh = collide.Mesh(vertices, faces)
        for _ in range(3):
            shape = shape_of(kind, rng)
            X, Y = random_pose(rng, 0.2), random_pose(rng, 0.8)
            r = collide.distance(mesh, shape, X, Y)
            if not r.hit:
                continue
            deep += 1
            assert r.distance < 0.0 and r.upper == 0.0 and not r.certified
            apart = Y.copy()
            apart[:3, 3] -= (r.lower * (1 + 1e-9) - 1e-12) * r.normal
            again = collide.distance(mesh, shape, X, apart)
            told = snippet(name, shape, X, Y)
            assert not again.hit or again.lower > -1e-9, told
            _, outer = polytopes(shape)
            assert least(vertices, faces, X, outer, apart) > -0.12, told
            assert not (solid and within(vertices, faces, X, shape, apart)), told
            free = collide.distance(mesh, shape, X, Y, signed=False)
            assert free.distance == 0.0 and free.certified and not free.normal.any()
    assert deep >= 6, deep


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", KINDS)
def test_swapped_batched_threaded_and_listed_answers_are_the_same_bits(kind):
    rng = rng_of("mesh", "bits", kind)
    shape = shape_of(kind, rng)
    for name in ("ring", "soup"):
        mesh = collide.Mesh(*MESHES[name][:2])
        X, Y = (np.stack([random_pose(rng, 0.9) for _ in range(12)]) for _ in range(2))
        rows, hits = collide.distance(mesh, shape, X, Y), collide.collide(mesh, shape, X, Y)
        assert 0 < hits.sum() < 12 and (rows.hit == hits).all()
        swapped = collide.distance(shape, mesh, Y, X)
        assert np.array_equal(swapped.point_a, rows.point_b) and np.array_equal(swapped.normal, 0.0 - rows.normal)
        assert swapped.rows["distance"].tobytes() == rows.rows["distance"].tobytes()
        for k in range(12):
            one = collide.distance(mesh, shape, X[k], Y[k])
            assert one.rows.tobytes() == rows[k].rows.tobytes(), snippet(name, shape, X[k], Y[k])
            assert collide.collide(mesh, shape, X[k], Y[k]) == hits[k]
            limited = collide.distance(mesh, shape, X[k], Y[k], max_distance=0.2)
            assert limited.beyond == (not one.hit and one.lower > 0.2)
            assert limited.hit == one.hit and (not limited.beyond or 0.2 < limited.lower <= one.upper)
        many = np.tile(X, (3, 1, 1)), np.tile(Y, (3, 1, 1))
        assert collide.distance(mesh, shape, *many, threads=2).rows.tobytes() == np.tile(rows.rows, 3).tobytes()
        listed = collide.distance([mesh] * 12, [shape] * 12, X, Y)
        assert listed.rows.tobytes() == rows.rows.tobytes()


def test_touching_and_a_hair_beside_it_are_decided():
    """A gap of 1e-9 is proven, an overlap too, and so is a touch of flat ends, tips and round sides."""
    mesh = collide.Mesh(*box())
    for shape, half in (
        (collide.Cylinder(0.25, 0.5), 0.25), (collide.Cone(0.25, 0.5), 0.25),
        (collide.Ellipsoid((0.5, 0.75, 0.25)), 0.25),
    ):
        for shift, want in ((1e-9, False), (0.0, True), (-1e-9, True)):
            Y = pose(t=(0.125, 0.25, 1.0 + half + shift))
            r = collide.distance(mesh, shape, EYE, Y)
            assert r.hit == want == collide.collide(mesh, shape, EYE, Y), (shape, shift)
            assert abs(r.distance - shift) < 1e-10 or want, (shape, shift, r)
            exact = (Y[2, 3] - half) - 1.0  # 1 + half + shift is rounded
            assert r.lower <= exact <= r.upper or shift < 0.0
            if want:
                assert r.distance > -1e-8 and r.how != UNDECIDED, (shape, shift, r)
        deep = collide.distance(mesh, shape, EYE, pose(t=(0.125, 0.25, 1.0 + half - 0.01)))
        assert -0.0101 < deep.distance <= -0.01 and np.abs(deep.normal - (0, 0, 1)).max() < 1e-6


def test_far_tiny_and_huge():
    """At 1e8 m, nanometres beside kilometres, and farther than boxes in floats tell."""
    vertices, faces, _ = MESHES["ring"]
    for kind in KINDS:
        rng = rng_of("mesh", "sizes", kind)
        shape = shape_of(kind, rng)
        mesh = collide.Mesh(vertices, faces)
        X, Y = random_pose(rng, 0.1), random_pose(rng, 0.1)
        Y[:3, 3] += (3.0, 0.5, 0.2)
        near = collide.distance(mesh, shape, X, Y)
        shift = 2.0**27  # the shifts below are exact to 2**-25
        X[:3, 3], Y[:3, 3] = np.round(X[:3, 3] * 2**20) / 2**20, np.round(Y[:3, 3] * 2**20) / 2**20
        near = collide.distance(mesh, shape, X, Y)
        X[:3, 3] += shift
        Y[:3, 3] += shift
        far = collide.distance(mesh, shape, X, Y)
        assert (near.lower, near.upper, near.hit) == (far.lower, far.upper, far.hit), kind
        away = collide.distance(mesh, shape, EYE, np.stack([pose(t=(x, 0, 0)) for x in (1e12, 1e25, 1e40)]))
        assert (
            not away.hit.any()
            and (np.abs(away.distance / [1e12, 1e25, 1e40] - 1) < 1e-9).all()
            and away.certified.all()
        )
    small, large = collide.Mesh(*box((-1e-9,) * 3, (1e-9,) * 3)), collide.Cylinder(1e3, 2e3)
    for z, want in ((1e3 + 1.0, False), (1e3 - 1.0, True), (1e3 + 3e-9, None)):
        r = collide.distance(small, large, pose(t=(10.0, 20.0, z)), EYE)
        assert (want is None or r.hit == want) and r.lower <= z - 1e3 - 1e-9 + 1e-9, z
    tiny = collide.Ellipsoid((1e-9, 2e-9, 3e-9))
    huge = collide.Mesh(*box((-1e3,) * 3, (1e3,) * 3))
    assert collide.collide(huge, tiny, EYE, pose(t=(1.0, 2.0, 3.0)))
    gap = collide.distance(huge, tiny, EYE, pose(t=(1.0, 2.0, 1e3 + 1e-3)))
    assert not gap.hit and abs(gap.distance - 1e-3 + 3e-9) < 1e-10


@pytest.mark.usefixtures("order")
def test_matrices_that_are_no_rotations_are_used_as_they_stand():
    rng = rng_of("mesh", "sheared")
    told = []
    for kind in KINDS:
        for name in ("box", "hollow", "soup"):
            vertices, faces, solid = MESHES[name]
            mesh, shape = collide.Mesh(vertices, faces), shape_of(kind, rng)
            X, Y = random_pose(rng, 0.3), random_pose(rng, 1.2)
            X[:3, :3] += rng.normal(size=(3, 3)) * 0.15
            Y[:3, :3] = Y[:3, :3] * 1.5 + rng.normal(size=(3, 3)) * 0.15
            r = collide.distance(mesh, shape, X, Y, check_poses=False)
            inner, outer = polytopes(shape)
            below, above = least(vertices, faces, X, outer, Y), least(vertices, faces, X, inner, Y)
            if below > 1e-12:
                assert r.hit == (solid and within(vertices, faces, X, shape, Y)), snippet(name, shape, X, Y)
            elif above < -1e-12:
                assert r.hit, snippet(name, shape, X, Y)
            assert r.hit or (r.lower <= above + 1e-14 and below <= r.upper + 1e-14), snippet(name, shape, X, Y)
            told.append(r.hit)
            for bad in (np.diag([1.0, 1, -1, 1]), np.diag([1.0, 1, 0, 1])):
                with pytest.raises(collide.InvalidPose):
                    collide.collide(mesh, shape, X, bad, check_poses=False)
    assert 0.1 < np.mean(told) < 0.9


@pytest.mark.parametrize("kind", ["Cylinder", "Cone", "Ellipsoid"])
def test_a_large_mesh_between_the_polytopes_is_not_gone_through(kind, monkeypatch):
    """A mesh of 1 m before the curved side of a shape of 1e6 m lies between both polytopes wholly: all of its facets
    may be near. One that meets the shape, or the hull that does not, decides."""
    mesh = collide.Mesh(*bumpy_sphere(2000))
    r = 1e6
    side = 2 * math.pi * 1.5 / 32  # halfway between two corners of the ring: the inner polytope is 0.5 % away
    shape, y = {
        "Cylinder": (collide.Cylinder(r, r), r), "Cone": (collide.Cone(r, 2 * r), 0.5 * r),
        "Ellipsoid": (collide.Ellipsoid((r, r, r)), r),
    }[kind]
    gone_through = []
    bounds = near_facets_module._Spans.of_triangles
    monkeypatch.setattr(
        near_facets_module._Spans, "of_triangles", lambda *args: gone_through.append(len(args[1])) or bounds(*args)
    )
    asked, rows_of = [], mesh_curved.facet_rows
    monkeypatch.setattr(mesh_curved, "facet_rows", lambda *a, **o: asked.append(len(a[4])) or rows_of(*a, **o))
    told = []
    for gap in (-100.0, -10.0, 10.0, 100.0):
        X = pose(t=((y + gap) * math.cos(side), (y + gap) * math.sin(side), 0.0))
        assert collide.collide(mesh, shape, X, EYE) == (gap < 0)
        # poses with slop, as parts of unions have, are not asked of the kernel
        poses = (PosesWithSlop(Y[None], np.full(1, 1e-9)) for Y in (X, EYE))
        told.append(int(settle_curved(body_of(mesh), enclosure_of(shape), *poses).state[0]))
    assert told == [HIT, HIT, APART, APART]
    assert sum(gone_through) <= 100 and 1 <= sum(asked) <= 100, (gone_through, asked)


# --- the polytopes themselves ---------------------------------------------------------------------


def exact_planes(points: np.ndarray):
    """Outward (normal, offset) of the facets of a hull, in fractions."""
    exact = [[Fraction(x) for x in p] for p in points.tolist()]
    for a, b, c in convex_hull(points).facets.tolist():
        u, v = ([exact[k][i] - exact[a][i] for i in range(3)] for k in (b, c))
        n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        yield n, sum(x * y for x, y in zip(n, exact[a]))


@pytest.mark.parametrize(
    "sizes", [(1.0, 1.0, 1.0), (1e-9, 1e3, 0.1), (1e3, 1e-9, 7.0), (1e-40, 3e-41, 1e-40), (1e45, 1e40, 1e45 / 3)]
)
def test_the_polytopes_hold_the_shapes_and_are_held_exactly(sizes):
    a, b = sizes[:2]
    for shape in (collide.Cylinder(a, b), collide.Cone(a, b), collide.Ellipsoid(sizes)):
        both = enclosure_of(shape)
        corners = [np.unique(body.tree.triangles.reshape(-1, 3), axis=0) for body in (both.outer, both.inner)]
        for p in corners[1].tolist():
            x, y, z = map(Fraction, p)
            if isinstance(shape, collide.Ellipsoid):
                assert sum((v / Fraction(r)) ** 2 for v, r in zip((x, y, z), shape.radii.tolist())) <= 1
                continue
            r, h = Fraction(shape.radius), Fraction(shape.length) / 2
            share = (h - z) / (2 * h) if isinstance(shape, collide.Cone) else Fraction(1)
            assert abs(z) <= h and x * x + y * y <= (r * share) ** 2
        for n, d in exact_planes(corners[0]):
            if isinstance(shape, collide.Ellipsoid):
                assert d > 0 and sum((v * Fraction(r)) ** 2 for v, r in zip(n, shape.radii.tolist())) <= d * d
                continue
            r, h = Fraction(shape.radius), Fraction(shape.length) / 2
            heights = [-h * n[2]] if isinstance(shape, collide.Cone) else [h * abs(n[2])]
            if isinstance(shape, collide.Cone):
                assert h * n[2] <= d
            for height in heights:
                assert d - height >= 0 and (n[0] ** 2 + n[1] ** 2) * r * r <= (d - height) ** 2


def test_the_polytopes_of_rounded_corners():
    rng = rng_of("mesh", "rounded corners")
    solid = 0
    for _ in range(6):
        shape = shape_of("HPolytope", rng)
        assert shape.slop > 0.0
        both = enclosure_of(shape)
        solid += both.inner is not None
        points = np.unique(both.inner.tree.triangles.reshape(-1, 3), axis=0)
        for p in points.tolist():
            for n, o in zip(shape.normals.tolist(), shape.offsets.tolist()):
                assert sum(Fraction(x) * Fraction(y) for x, y in zip(n, p)) <= Fraction(o)
        planes = list(exact_planes(np.unique(both.outer.tree.triangles.reshape(-1, 3), axis=0)))
        for v in shape.vertices.tolist():  # a cube of side 2·slop around each corner is inside
            for n, d in planes:
                reach = Fraction(shape.slop) * max(abs(x) for x in n)
                assert sum(x * Fraction(y) for x, y in zip(n, v)) + reach <= d
    assert solid == 6
    flat = collide.HPolytope([[1, 0, 0], [-1, 0, 0], [0, 3, 1], [0, -3, 1], [0, 0, -1]], [1 / 3, -1 / 3, 1, 1, 0.1])
    mesh = collide.Mesh(*box())
    assert collide.collide(mesh, flat, EYE, EYE) and not collide.collide(mesh, flat, EYE, pose(t=(3, 0, 0)))
    assert abs(collide.distance(mesh, flat, EYE, pose(t=(3, 0, 0))).distance - 7 / 3) < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_bounds_of_facets_never_exceed_their_distance(kind):
    """What leaves facets out is a lower bound, and not a poor one."""
    rng = rng_of("mesh", "bounds", kind)
    shares = []
    for name in ("ring", "soup"):
        vertices, faces, _ = MESHES[name]
        mesh = collide.Mesh(vertices, faces)
        for case in range(4):
            shape = shape_of(kind, rng)
            X, Y = random_pose(rng, 0.3), random_pose(rng, 0.3)
            if case == 0:
                X, Y = EYE, EYE.copy()
            Y[:3, 3] += naive.unit(rng.normal(size=3)) * 3.0
            if case == 3:
                X[:3, :3] += rng.normal(size=(3, 3)) * 0.1
            still, along = np.zeros(1), Y[None, :3, 3] - X[None, :3, 3]
            posed = PosesWithSlop(X[None], still), PosesWithSlop(Y[None], still)
            found = near_facets(mesh.tree, enclosure_of(shape).packed, *posed, along, np.full(1, np.inf))
            assert sorted(found.place.tolist()) == list(range(len(faces)))
            hulls = [collide.ConvexHull(vertices[faces[k]]) for k in mesh.tree.ids[found.place]]
            true = collide.distance(hulls, [shape] * len(hulls), X, Y, check_poses=False)
            assert (found.bound <= true.upper).all(), snippet(name, shape, X, Y)
            shares += (found.bound / true.upper).tolist()
    assert np.mean(shares) > 0.9 and max(shares) > 0.999, (np.mean(shares), max(shares))
