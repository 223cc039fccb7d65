"""Faces of hulls: closed, flat, complete, and linked at their vertices."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from collide.hull.exact_hull import convex_hull
from collide.kernels import address_of
from collide.lowering.hull_faces import hull_faces
from collide.lowering.hull_polygons import faces_memory, make_faces


def cloud(seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    kind = seed % 4
    if kind == 0:
        return rng.normal(size=(int(rng.integers(4, 40)), 3))
    if kind == 1:  # many coplanar points, on faces and edges, too
        return rng.integers(-2, 3, size=(60, 3)).astype(float)
    if kind == 2:
        angles = np.arange(int(rng.integers(3, 30)))
        ring = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=1), 3)
        return np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for z in (0.0, 1.0)])
    return np.array(list(itertools.product((-1.0, 1.0), repeat=3))) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]


def area_vector(loop: np.ndarray) -> np.ndarray:
    return 0.5 * np.cross(loop - loop[0], np.roll(loop, -1, axis=0) - loop[0]).sum(axis=0)


@pytest.mark.parametrize("seed", range(40))
def test_faces_close_the_hull(seed):
    points = cloud(seed)
    hull, faces = convex_hull(points), hull_faces(points)
    assert hull.dimension == 3
    loops = [faces.corners[i:j] for i, j in itertools.pairwise(faces.starts)]
    edges = {}
    for face, loop in enumerate(loops):
        for tail, head in zip(loop.tolist(), np.roll(loop, -1).tolist()):
            assert (tail, head) not in edges
            edges[tail, head] = face
    assert all((head, tail) in edges for tail, head in edges)
    assert len(faces.vertex_ids) - len(edges) // 2 + len(loops) == 2  # Euler
    size = np.abs(points).max()
    T = points[hull.facets]
    whole = 0.5 * np.linalg.norm(np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0]), axis=1).sum()
    assert abs(sum(np.linalg.norm(area_vector(points[loop])) for loop in loops) - whole) < 1e-9 * whole
    for loop, normal, flatness in zip(loops, faces.normals, faces.flatness):
        along = (points - points[loop[0]]) @ normal
        assert along.max() <= flatness + 1e-13 * size and np.abs(along[loop]).max() <= flatness + 1e-15 * size
        assert area_vector(points[loop]) @ normal > 0.0 and flatness < 1e-13 * size
    assert max(len(loop) for loop in loops) > 3 or seed % 4 == 0


@pytest.mark.parametrize("seed", range(8))
def test_fans_and_numbers_of_edges(seed):
    points = cloud(seed)
    faces = hull_faces(points)
    for vertex in range(len(points)):
        fan = faces.fans[faces.fan_starts[vertex] : faces.fan_starts[vertex + 1]]
        assert (faces.corners[fan] == vertex).all()
        assert len(fan) == (faces.corners == vertex).sum()
    for face, (i, j) in enumerate(itertools.pairwise(faces.starts)):
        assert (faces.face_of[i:j] == face).all()
    ends = {}
    for i, j in itertools.pairwise(faces.starts):
        loop = faces.corners[i:j]
        for edge, *pair in zip(faces.edges[i:j].tolist(), loop.tolist(), np.roll(loop, -1).tolist()):
            assert ends.setdefault(edge, frozenset(pair)) == frozenset(pair)
    assert len(set(ends.values())) == len(ends) == len(faces.corners) // 2
    assert np.array_equal(faces.columns[:, : len(faces.vertex_ids)].T, points[faces.vertex_ids])


def test_flat_hulls_have_two_sides_and_segments_one_edge():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], dtype=float)
    faces = hull_faces(square)
    assert faces.starts.tolist() == [0, 4, 8] and np.array_equal(faces.normals[0], -faces.normals[1])
    assert faces.corners[:4].tolist() == faces.corners[4:].tolist()[::-1]
    segment = hull_faces(np.array([[0, 0, 0], [2, 2, 2], [1, 1, 1]], dtype=float))
    assert segment.corners.tolist() == [0, 1] and segment.vertex_ids.tolist() == [0, 1]
    assert hull_faces(np.ones((3, 3))).vertex_ids.tolist() in ([0], [1], [2])


def nearly_collinear(rng) -> np.ndarray:
    """Points of a line, off it by up to 1e-12 of its length by rounding or more."""
    points = np.outer(rng.integers(-8, 9, int(rng.integers(3, 9))) / 8.0, rng.uniform(-1, 1, 3))
    points += rng.integers(-2, 3, points.shape) * 10.0 ** rng.uniform(-18, -12)
    return points + (np.arange(len(points)) == 0)[:, None] * rng.uniform(-1, 1, 3) * 1e-15


def off_in_fractions(points, corners, normal) -> float:
    p, *others = [[Fraction(x) for x in points[k].tolist()] for k in corners.tolist()]
    n = [Fraction(x) for x in normal.tolist()]
    return float(max(abs(sum((a - b) * c for a, b, c in zip(q, p, n))) for q in others))


def test_normals_of_slivers_are_as_good_as_their_flatness_says():
    """In fractions, corners of each face lie within its flatness of a plane across its normal; a hull without a face is
    a segment, and all of its points lie as near to it."""
    segments = planes = 0
    for seed in range(400):
        points = nearly_collinear(np.random.default_rng(seed))
        size, faces = np.ptp(points, axis=0).max(), hull_faces(points)
        if size < 0.1:
            continue
        rounding = 2.0**-50 * size
        assert faces.flatness.max() <= 2.0**-43 * size, f"nearly_collinear(np.random.default_rng({seed}))"
        for face, (i, j) in enumerate(itertools.pairwise(faces.starts)):
            corners = faces.corners[i:j]
            if faces.normals[face].any():
                off = off_in_fractions(points, corners, faces.normals[face])
                assert off <= 2.0 * faces.flatness[face] + rounding, (seed, off, faces.flatness[face])
                planes += 1
        if len(faces.starts) == 2:
            p, q = points[faces.corners]
            t = np.clip((points - p) @ (q - p) / ((q - p) @ (q - p)), 0, 1)
            off = np.linalg.norm(points - p - t[:, None] * (q - p), axis=1).max()
            assert off <= faces.flatness[0] + rounding and len(faces.corners) == 2, seed
            segments += 1
    assert segments > 100 and planes > 100, (segments, planes)


@pytest.mark.parametrize("seed", range(12))
def test_points_on_edges_but_for_rounding_are_no_corners(seed):
    rng = np.random.default_rng(seed)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    extra = np.array([[t, a, b] for t in rng.uniform(-0.9, 0.9, 3) for a, b in ((1, 1), (-1, 1))])
    points = np.concatenate([corners, extra, extra[:, [2, 0, 1]]]) @ np.linalg.qr(rng.normal(size=(3, 3)))[0]
    faces = hull_faces(points)
    assert faces.vertex_ids.tolist() == list(range(8)) and np.diff(faces.starts).tolist() == [4] * 6
    assert len(set(faces.edges.tolist())) == 12 and faces.flatness.max() < 1e-14


@pytest.mark.parametrize("points", [
    np.zeros((1, 3)), np.eye(3)[:2], np.eye(3), np.eye(4)[:, :3],
    *(np.random.default_rng(n).normal(size=(n, 3)) * (1.0, 1.0, z) for n in (5, 64, 301) for z in (1.0, 0.0)),
    np.array([(np.cos(t), np.sin(t), z) for t in np.arange(50) for z in (0.0, 1.0)]),
], ids=len)
def test_making_stays_in_its_memory(points):
    """Of spheres, discs and prisms all points are corners, and so many triangles as can be: nothing is written behind
    the memory that is asked for."""
    points = points / np.maximum(np.linalg.norm(points[:, :2], axis=1), 1e-9)[:, None] if len(points) > 5 else points
    n_words = faces_memory(len(points)) // 8
    memory = np.full(n_words + 1024, -7, dtype=np.int64)
    points = np.ascontiguousarray(points)
    assert make_faces(address_of(points), len(points), address_of(memory)) == 0
    assert (memory[n_words:] == -7).all() and (memory[:n_words] != -7).any()
