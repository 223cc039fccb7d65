"""Meshes in motion: judged by sampling of the convex pieces they are made of, and beside the same bodies as hulls."""

from __future__ import annotations

import motion_oracle as oracle
import motions
import numpy as np
import pytest
from motions import L_BOXES, l_gap, l_mesh

import collide


def box_mesh(size, centre=(0.0, 0.0, 0.0)) -> collide.Mesh:
    vertices, faces = collide.tessellate(collide.Box(size), tolerance=1.0)
    return collide.Mesh(vertices + np.array(centre), faces)


def judge(A, B, gap, seed: int, n: int = 50, least_hits: int = 10, **options):
    """Ask and judge; returns the answer."""
    group = motions.random_group("meshes", np.random.default_rng(seed), n, (A, B, gap, 4.0), spread=2.0, **options)
    r = collide.time_of_impact(A, B, *group.poses, omega_WA=group.omega_WA, omega_WB=group.omega_WB)
    verdict = oracle.judge(gap, *group.motions(), r.lower, r.upper, tolerance=1e-10)
    for k in np.flatnonzero(verdict.missed):
        raise AssertionError(
            f"missed by {verdict.depth[k]:.3g} m at {verdict.time[k]!r}: seed {seed}, motion {k}, {r.lower[k]!r}, "
            f"{[X[k].tolist() for X in group.poses]}"
        )
    moving = r.hit & (r.lower > 0.0)
    proven = moving & np.isfinite(r.upper)
    assert (verdict.at_upper[proven] <= 1e-10).all()
    assert moving.sum() >= least_hits and (~r.hit).sum() >= 5
    assert r.certified.mean() >= 0.95
    return r, group


def test_an_l_and_a_box():
    size = (0.6, 0.4, 0.3)
    judge(l_mesh(), collide.Box(size), l_gap(oracle.box_features(size)), 1)


def test_an_l_spins_around_a_tetrahedron():
    points = np.array([(0, 0, 0), (0.4, 0, 0), (0, 0.4, 0), (0, 0, 0.4)])
    gap = l_gap(oracle.simplex_features(points))
    judge(l_mesh(), collide.ConvexHull(points), gap, 2, n=30, omega=30.0, least_hits=8)


def test_two_meshes():
    size = (0.5, 0.5, 0.9)
    r, _ = judge(l_mesh(), box_mesh(size), l_gap(oracle.box_features(size)), 3)
    assert (r.part_a >= 0).all() and r.part_a[r.hit].max() > 0


def test_an_open_surface():
    """Two triangles that make no solid: bodies may pass beside them, not through."""
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.5)], dtype=float)
    faces = np.array([(0, 1, 2), (1, 3, 2)])
    size = (0.5, 0.4, 0.3)
    gap = oracle.union_gap(
        [oracle.polytope_gap(*oracle.simplex_features(points[f]), *oracle.box_features(size)) for f in faces]
    )
    judge(collide.Mesh(points, faces), collide.Box(size), gap, 4, n=80)


UNION = collide.Compound([(collide.Box((0.3, 0.3, 1)), collide.pose((0, 0.4, 0))), (collide.Sphere(0.2), np.eye(4))])
OTHERS = [
    collide.Sphere(0.3), collide.Capsule(0.2, 0.6), collide.Cylinder(0.3, 0.5), collide.Cone(0.3, 0.8),
    collide.Ellipsoid((0.3, 0.2, 0.5)), collide.Halfspace((0.2, 0.1, 1), -1.0), UNION,
]


@pytest.mark.parametrize("other", OTHERS, ids=lambda shape: type(shape).__name__)
def test_a_box_of_facets_moves_as_a_box(other):
    """Every other kind of shape: brackets of both overlap, for the truth is one."""
    size = (1.0, 0.8, 0.6)
    group = motions.random_group("twins", np.random.default_rng(5), 50, (None, other, None, 3.0), spread=1.5)
    mesh, box = (collide.time_of_impact(A, other, *group.poses) for A in (box_mesh(size), collide.Box(size)))
    moving = box.hit & (box.lower > 0.0)
    assert moving.sum() >= 8
    both = mesh.certified & box.certified
    assert both.mean() >= 0.9
    assert (mesh.hit == box.hit)[both].all()
    assert (mesh.lower <= box.upper + 1e-14)[both].all() and (box.lower <= mesh.upper + 1e-14)[both].all()
    swapped = collide.time_of_impact(other, box_mesh(size), *(group.poses[k] for k in (2, 3, 0, 1)))
    for x, y in ((mesh.lower, swapped.lower), (mesh.upper, swapped.upper), (mesh.point_a, swapped.point_b)):
        assert x.tobytes() == y.tobytes()
    assert (mesh.normal + 0.0).tobytes() == (0.0 - swapped.normal).tobytes()


def test_unions_of_meshes_and_hulls():
    """An L as one mesh, as a compound of two meshes, and of a mesh and a box: one truth."""
    parts = [(box_mesh(size), collide.pose(at)) for size, at in L_BOXES]
    mixed = [parts[0], (collide.Box(L_BOXES[1][0]), collide.pose(L_BOXES[1][1]))]
    other = collide.Box((0.5, 0.4, 0.3))
    group = motions.random_group("unions", np.random.default_rng(6), 25, (None, other, None, 3.0), spread=1.5)
    answers = [
        collide.time_of_impact(A, other, *group.poses)
        for A in (l_mesh(), collide.Compound(parts), collide.Compound(mixed))
    ]
    for r in answers[1:]:
        assert (r.hit == answers[0].hit).all()
        assert (r.lower <= answers[0].upper + 1e-14).all() and (answers[0].lower <= r.upper + 1e-14).all()
    parts_met = {int(p) for p in answers[2].part_a[answers[2].hit & (answers[2].lower > 0.0)]}
    assert parts_met == {0, 1}


def test_a_rod_flies_through_a_ring():
    """A ring of facets is no hull: what flies through its hole is free, what is a little off is not."""
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    profile = np.array([(1.0, -0.1), (1.2, 0.0), (1.0, 0.1)])
    r, z = profile[:, 0], profile[:, 1]
    rings = np.outer(np.cos(angle), r), np.outer(np.sin(angle), r), np.tile(z, (24, 1))
    vertices = np.stack(rings, axis=-1).reshape(-1, 3)
    faces = []
    for k in range(24):
        for j in range(3):
            a, b = 3 * k + j, 3 * k + (j + 1) % 3
            c, d = 3 * ((k + 1) % 24) + j, 3 * ((k + 1) % 24) + (j + 1) % 3
            faces += [(a, c, d), (a, d, b)]
    ring = collide.Mesh(vertices, np.array(faces))
    assert ring.solid
    rod = collide.Capsule(0.05, 1.0)
    through = collide.time_of_impact(
        ring, rod, np.eye(4), np.eye(4), collide.pose((0, 0, 2)), collide.pose((0.3, 0, -2), rpy=(0.4, 0, 1))
    )
    I = np.eye(4)
    against = collide.time_of_impact(ring, rod, I, I, collide.pose((1.05, 0, 2)), collide.pose((1.05, 0, -2)))
    far = collide.time_of_impact(ring, rod, I, I, collide.pose((3e3, 0, 2)), collide.pose((-3e3, 0, 2)))
    assert not through.hit and not far.hit and through.certified
    assert against.hit and against.certified and 0.3 < against.time < 0.5
    assert against.normal[2] > 0.5


def test_one_inside_a_solid_starts_in_contact():
    here = [np.eye(4)] * 4
    inside = collide.time_of_impact(box_mesh((2, 2, 2)), collide.Sphere(0.1), *here)
    assert inside.hit and inside.time == 0.0 and inside.upper == 0.0 and inside.certified


def bumpy_cap(n: int) -> collide.Mesh:
    """2 n² facets of a blunt tip that looks down, within 0.05 of its axis."""
    x, y = np.meshgrid(*[np.linspace(-0.05, 0.05, n + 1)] * 2, indexing="ij")
    vertices = np.stack([x, y, 2.0 * (x * x + y * y)], axis=-1).reshape(-1, 3)
    k = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([k, k + n + 1, k + 1], 1), np.stack([k + 1, k + n + 1, k + n + 2], 1)])
    return collide.Mesh(vertices, faces)


def test_a_fine_tip_between_a_polytope_and_the_ball_in_it():
    """Curved shapes are culled by a polytope around them, percents away from them in the middle of its facets; spans
    against a fine mesh are so short that what moves in between would be overlooked, were that not counted."""
    tip, rng = bumpy_cap(60), np.random.default_rng(12)
    round_body, ball = collide.Ellipsoid((1.0, 1.0, 1.0)), collide.Sphere(1.0)
    for _ in range(4):
        X = collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))
        at = collide.pose((0.01, 0.02, 1.1)), collide.pose((0.01, 0.02, 0.95))
        curved = collide.time_of_impact(tip, round_body, *at, X, X)
        exact = collide.time_of_impact(tip, ball, *at, X, X)
        assert exact.hit and exact.certified and 0.6 < exact.time < 0.7
        assert curved.hit and curved.lower <= exact.upper and exact.lower <= curved.upper
        assert abs(curved.lower - exact.lower) <= 1e-6


def test_finely_cut_faces_come_together_at_once():
    """Thousands of pairs of facets touch in the same moment: no span is so short that they are few."""
    k, cells = 24, np.linspace(-0.5, 0.5, 25)
    x, y = np.meshgrid(cells, cells, indexing="ij")
    flat = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    at = (np.arange(k)[:, None] * (k + 1) + np.arange(k)).ravel()
    faces = np.concatenate([np.stack([at, at + k + 1, at + 1], 1), np.stack([at + 1, at + k + 1, at + k + 2], 1)])
    sheet = collide.Mesh(flat, faces)
    r = collide.time_of_impact(sheet, sheet, np.eye(4), np.eye(4), collide.pose((0.01, 0, 1)), collide.pose((0, 0, -1)))
    assert r.hit and r.lower <= 0.5 and r.lower >= 0.5 - 1e-9
    flush = collide.time_of_impact(sheet, collide.Box((1, 1, 1)), *[np.eye(4)] * 2, *(
        collide.pose((0, 0, z)) for z in (1.0, 0.25)
    ))
    assert flush.hit and flush.certified and flush.lower <= 2 / 3 <= flush.upper


def test_a_ball_drops_on_a_height_field():
    rng = np.random.default_rng(14)
    field, ball, n = collide.HeightField(rng.uniform(0.0, 0.5, (12, 12)), 0.25), collide.Sphere(0.2), 60
    X0, X1 = np.tile(np.eye(4), (2, n, 1, 1))
    X0[:, :3, 3] = rng.uniform((-1, -1, 1), (1, 1, 3), (n, 3))
    X1[:, :3, 3] = rng.uniform((-1, -1, -1), (1, 1, 1), (n, 3))
    r = collide.time_of_impact(field, ball, np.eye(4), np.eye(4), X0, X1)
    twin = collide.time_of_impact(collide.Mesh(field.vertices, field.faces), ball, np.eye(4), np.eye(4), X0, X1)
    assert (r.hit == twin.hit).all() and r.hit.sum() >= 40 and (~r.hit).sum() >= 3
    assert (r.lower <= twin.upper).all() and (twin.lower <= r.upper).all()
    for share, is_apart in ((0.999, True), (1.0, False)):
        X = collide.poses_in_motion(X0, X1, share * r.lower)
        gaps = collide.distance(field, ball, np.eye(4), X).distance[r.hit]
        assert (gaps > 0.0).all() if is_apart else (np.abs(gaps) < 1e-8).all()


def test_few_facets_and_many_say_the_same():
    """The L facet by facet, and one so finely cut that its motions are looked at span by span."""
    coarse, box = l_mesh(), collide.Box((0.5, 0.4, 0.3))
    corners = np.asarray(coarse.vertices)[np.asarray(coarse.faces)]
    for _ in range(2):  # every facet into four
        a, b, c = corners.transpose(1, 0, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        corners = np.concatenate([np.stack(of, 1) for of in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    fine = collide.Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    assert len(coarse.faces) <= 96 < len(fine.faces) and fine.solid
    g = motions.random_group("cut", np.random.default_rng(15), 60, (None, box, None, 4.0), spread=2.0)
    r, s = (collide.time_of_impact(mesh, box, *g.poses) for mesh in (coarse, fine))
    assert (r.hit == s.hit).all() and (r.hit & (r.lower > 0.0)).sum() >= 8
    assert (r.lower <= s.upper + 1e-14).all() and (s.lower <= r.upper + 1e-14).all()


def test_swapped_meshes_and_unions_of_one_shape():
    """Equal shapes are told apart by their poses: the answer is mirrored exactly."""
    mesh = l_mesh()
    union = collide.Compound([(collide.Box(size), collide.pose(at)) for size, at in L_BOXES])
    for shape in (mesh, union):
        g = motions.random_group("equal", np.random.default_rng(13), 30, (shape, shape, None, 4.0), spread=2.0)
        r = collide.time_of_impact(shape, shape, *g.poses)
        s = collide.time_of_impact(shape, shape, *(g.poses[k] for k in (2, 3, 0, 1)))
        for x, y in zip((r.lower, r.upper, r.point_a, r.part_a), (s.lower, s.upper, s.point_b, s.part_b)):
            assert x.tobytes() == y.tobytes()
        assert (r.normal + 0.0).tobytes() == (0.0 - s.normal).tobytes() and r.hit.sum() >= 8


def test_threads_give_the_same_bits():
    group = motions.random_group("threads", np.random.default_rng(8), 60, (None, None, None, 3.0), spread=1.5)
    A, B = l_mesh(), collide.Box((0.5, 0.4, 0.3))
    one, two = (collide.time_of_impact(A, B, *group.poses, threads=t) for t in (1, 2))
    lists = collide.time_of_impact([A] * 60, B, *group.poses)
    for x, y, z in zip(one, two, lists):
        assert x.tobytes() == y.tobytes() == z.tobytes()
