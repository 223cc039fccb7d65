"""`collide.certify`: what `PairResult.certificate` gives, made of a result and its question."""

from __future__ import annotations

import pickle

import naive
import numpy as np
import pytest
from naive import random_pose, rng_of

import collide
from collide.certificates import winding_number as winding_rays
from collide.certificates.exact_parts import exact_parts
from collide.certificates.nearest_to_origin import nearest_to_origin, nearest_vertex_pairs
from collide.certificates.winding_number import winding_number
from collide.numerics.exact_points import PlacedPoints
from collide.numerics.exact_vectors import inner

EYE = np.eye(4)


def test_single_results_and_batches():
    rng = rng_of("certify")
    shapes = naive.one_of_each(rng)
    X_WB = np.array([random_pose(rng, 1.5) for _ in range(6)])
    made = 0
    for A in shapes.values():
        for B in (shapes["Box"], shapes["Compound"]):
            try:
                batch = collide.distance(A, B, EYE, X_WB)
            except collide.UnsupportedQuery:
                continue
            certificates = collide.certify(A, B, EYE, X_WB, batch)
            assert certificates == batch.certificate and len(certificates) == len(X_WB)
            for k, certificate in enumerate(certificates):
                assert collide.certify(A, B, EYE, X_WB[k], batch[k]) == batch[k].certificate == certificate
                if certificate is not None:
                    collide.verify(A, B, EYE, X_WB[k], batch[k], certificate=certificate)
                    made += 1
            assert collide.certify(A, B, EYE, X_WB[1:3], batch[1:3]) == certificates[1:3]
    assert made > 30


def test_lists_of_shapes():
    rng = rng_of("certify lists")
    A, B = ([naive.one_of_each(rng)[kind] for kind in ("Box", "Capsule", "ConvexHull")] for _ in range(2))
    X_WA, X_WB = (np.array([random_pose(rng, 1.0) for _ in range(3)]) for _ in range(2))
    r = collide.distance(A, B, X_WA, X_WB)
    assert collide.certify(A, B, X_WA, X_WB, r) == r.certificate == [r[k].certificate for k in range(3)]
    copied = pickle.loads(pickle.dumps(r))
    assert copied.certificate == r.certificate


def test_what_does_not_belong_together_is_refused():
    box = collide.Box((1, 1, 1))
    r = collide.distance(box, box, EYE, np.array([EYE, collide.pose((2, 0, 0))]))
    for arguments in (
        (None, box, EYE, EYE, r), (box, [box], EYE, np.array([EYE] * 3), r), (box, box, EYE, np.array([EYE] * 3), r),
        (box, box, EYE, EYE, True), (box, box, EYE, EYE, collide.collide(box, box, EYE, EYE)),
        ([box] * 3, box, EYE, EYE, r),
    ):
        with pytest.raises(collide.InvalidArgument, match="certify"):
            collide.certify(*arguments)


def test_rows_of_a_world_keep_their_certificates_while_bodies_move():
    world = collide.World()
    for k in range(4):
        world.add(collide.Box((1, 1, 1)), collide.pose((1.5 * k, 0.1 * k, 0)))
    rows = world.distances()
    before = [rows.pair(k).certificate for k in range(len(rows))]
    names, questions = rows.names, [rows.pair(k).question[2:] for k in range(len(rows))]
    copied = pickle.loads(pickle.dumps(rows))
    world.set_poses(world.ids, np.array([EYE] * 4))
    world.remove(0)
    world.add(collide.Sphere(1.0))
    world.collides()
    for result in (rows, copied):
        assert result.names == names
        for k in range(len(rows)):
            pair = result.pair(k)
            assert pair.certificate == before[k] and all(map(np.array_equal, pair.question[2:], questions[k]))
            collide.verify(*pair.question, pair)


# --- the exact parts ----------------------------------------------------------------------------


def test_nearest_points_are_nearest():
    """Against the definition: v·p ≥ v·v for all points, and v in the hull of its carrier."""
    rng = rng_of("nearest to the origin")
    inside = 0
    for _ in range(400):
        points = [tuple(p) for p in rng.integers(-6, 7, (int(rng.integers(1, 5)), 3)).tolist()]
        v, scale, carrier = nearest_to_origin(points)
        assert scale > 0 and 1 <= len(carrier) <= len(points)
        assert all(inner(v, p) * scale >= inner(v, v) for p in points), points
        alone = nearest_to_origin([points[k] for k in carrier])
        assert all(a * scale == b * alone.scale for a, b in zip(alone.vector, v)), points
        inside += not any(v)
    assert 10 < inside < 200


def test_nearest_vertex_pairs_agree_with_all_pairs():
    rng = rng_of("nearest vertex pairs")
    for _ in range(60):
        A, B = (
            PlacedPoints(rng.integers(-9, 10, (7, 3)) + np.array(shift, dtype=float), []).on_grid(-60)
            for shift in ((0, 0, 0), (14, 3, 0))
        )
        pairs = nearest_vertex_pairs(A, B, [(0, 0)])
        v, scale, _ = nearest_to_origin([tuple(a - b for a, b in zip(A[i], B[j])) for i, j in pairs])
        least = min(inner(v, a) for a in A) - max(inner(v, b) for b in B)
        assert least * scale == inner(v, v)


def test_winding_numbers_of_a_box():
    """Inside 1, outside 0, on the surface 1; of a box inside out −1 within."""
    corners = np.array([[x, y, z] for x in (0, 4) for y in (0, 4) for z in (0, 4)])
    hull = collide.ConvexHull(corners.astype(float))
    faces = hull.hull.facets
    for point, number in (
        ((1, 2, 3), 1),
        ((5, 1, 1), 0),
        ((2, 2, 4), 1),
        ((0, 0, 0), 1),
        ((-1, -1, -1), 0),
        ((4, 2, 0), 1),
    ):
        vertices = PlacedPoints((corners - point).astype(float), [])
        assert winding_number(vertices, faces) == number, point
    turned_inside_out = faces[:, ::-1]
    assert winding_number(PlacedPoints((corners - (1, 2, 3)).astype(float), []), turned_inside_out) == -1


def test_a_winding_number_is_not_guessed():
    """Corners stand in the way of every ray: no number is told, though the solid holds the origin."""
    away = np.array([np.array(d) * (10**9 // max(map(abs, d))) for d in winding_rays._DIRECTIONS], dtype=float)
    corners = np.concatenate([away, -away])
    faces = collide.ConvexHull(corners).hull.facets
    assert len(np.unique(faces)) == 8
    assert winding_number(PlacedPoints(corners, []), faces) is None
    assert winding_number(PlacedPoints(corners + np.array([1.0, 0.0, 0.0]), []), faces) == 1


def test_planes_and_vertices_of_nested_poses_are_exact():
    """A half-space within a Compound: n·x − offset of points that its frame places on the plane is exactly 0."""
    rng = rng_of("nested planes")
    X_WA, X_AP = random_pose(rng), random_pose(rng)
    half = collide.Halfspace((0.0, 0.0, 1.0), 0.25)
    points = collide.ConvexHull(np.column_stack([rng.integers(-8, 9, (5, 2)) / 8, np.full(5, 0.25)]))
    (plane,), (hull,) = (exact_parts(collide.Compound([(shape, X_AP)]), X_WA) for shape in (half, points))
    n, offset = plane.plane
    vertices, grid = hull.vertices, hull.vertices.grid
    assert {inner(n, p) * 2**grid if grid >= 0 else inner(n, p) / 2**-grid for p in vertices} == {offset}
