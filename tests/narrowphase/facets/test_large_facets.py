"""Boxes before facets larger than they are: gaps beside alternating projections, which no bound exceeds; and how much
of a finely cut body is looked at before a large facet."""

from __future__ import annotations

import numpy as np
import pytest
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of

import collide
from collide.lowering.facet_bodies import body_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import TreeView, open_tree
from collide.narrowphase.facets.facet_queries import first_hits, surface_distances
from collide.narrowphase.facets.large_facets import gap_to_facet, world_box
from collide.narrowphase.facets.surface_distance import NODES, TRIANGLES
from collide.numerics.vec3 import Vec3


def nearest_on_triangle(x: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Of corners, edges and, where its foot is within, the plane."""
    found = list(T)
    for k in range(3):
        e = T[(k + 1) % 3] - T[k]
        if e.any():
            found.append(T[k] + e * np.clip(np.sum((x - T[k]) * e) / np.sum(e * e), 0.0, 1.0))
    n = np.cross(T[1] - T[0], T[2] - T[0])
    if n.any():
        foot = x - n * (np.sum((x - T[0]) * n) / np.sum(n * n))
        sides = [np.sum(np.cross(T[(k + 1) % 3] - T[k], foot - T[k]) * n) for k in range(3)]
        if min(sides) >= 0.0:
            found.append(foot)
    return min(found, key=lambda p: np.sum(np.square(x - p)))


def distance_by_projections(low: np.ndarray, high: np.ndarray, T: np.ndarray) -> float:
    """What a box and a triangle are apart at most: alternating projections of convex sets come down to the distance."""
    x = 0.5 * (low + high)
    for _ in range(40):
        y = nearest_on_triangle(x, T)
        x = np.clip(y, low, high)
    return float(np.linalg.norm(x - y))


def view_of(tree) -> TreeView:
    return open_tree(tree.address)


def test_gaps_to_a_facet_are_no_larger_than_distances():
    rng, near, positive = rng_of("gaps to a facet"), 0, 0
    for case in range(150):
        T = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-1, 1)
        if case % 5 == 0:
            T[2] = T[0] + rng.uniform(0, 1) * (T[1] - T[0]) + 1e-9 * rng.normal(size=3)  # a sliver
        if case % 25 == 0:
            T[2] = T[1]  # without area
        middle, half = 3.0 * rng.normal(size=3), 10.0 ** rng.uniform(-2, 0) * rng.uniform(0.1, 1.0, 3)
        corners = middle + half * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        tree = build_mesh_tree(corners, np.array([[0, 1, 2], [5, 6, 7]]))
        X, Y = random_pose(rng, 2.0), random_pose(rng, 2.0)
        shift = Y[:3, 3] - X[:3, 3]
        box = world_box(X.ravel(), Vec3(0.0, 0.0, 0.0), view_of(tree), 0)
        gap = gap_to_facet(box, Y.ravel(), Vec3(*shift.tolist()), T.ravel(), 0)
        in_box = (T @ Y[:3, :3].T + shift) @ X[:3, :3]  # the triangle in the box's frame
        apart = distance_by_projections(middle - half, middle + half, in_box)
        assert gap <= apart * (1.0 + 1e-9) + 1e-5 * half.max(), (case, T.tolist(), middle.tolist(), half.tolist())
        positive += gap > 0.0
        near += gap > 0.7 * apart
    assert positive >= 90 and near >= 75, (positive, near)


@pytest.mark.parametrize("exchanged", [False, True])
def test_little_of_a_finely_cut_ball_is_looked_at_in_a_valley(exchanged):
    """Boxes and slabs around leaves of a terrain hold all of the ball, its facets do not: with a limit just below the
    distance every pair of boxes has to be left out."""
    x, y = np.meshgrid(*[np.linspace(-50.0, 50.0, 10)] * 2)
    heights = 5 * np.sin(0.09 * x) * np.cos(0.07 * y)
    ground = body_of(collide.HeightField(heights, (100 / 9, 100 / 9), bottom=-30.0)).tree
    vertices, faces = bumpy_sphere(4000, 1)
    ball = build_mesh_tree(vertices / np.abs(vertices).max(), faces)
    X, looked_at = collide.pose(rpy=(0.3, -0.2, 0.5)), []
    for shift in ((3.0, 2.0), (-20.0, 7.0), (11.0, -30.0), (25.0, 25.0)):
        at = (*shift, float(5 * np.sin(0.09 * shift[0]) * np.cos(0.07 * shift[1])) + 4.0)
        Y = X @ collide.pose(at, rpy=(0.1, 0.2, 0.3))
        apart = float(surface_distances(ground, ball, X, Y).lower[0])
        assert apart > 0.1
        for limit in (0.999 * apart, 0.2 * apart):
            asked = (ball, ground, Y, X) if exchanged else (ground, ball, X, Y)
            r = surface_distances(*asked, limit)
            assert r.facets[0].tolist() == [-1, -1] and r.lower[0] == limit
            looked_at.append(r.counters[0, [NODES - 3, TRIANGLES - 3]])
    assert len(faces) > 3900 and np.sum(looked_at, axis=1).max() < 800, looked_at


def test_distances_to_large_facets_are_those_of_each():
    """Facets of the large body one by one, near its edges and corners, in valleys and on ridges."""
    rng, apart = rng_of("distances to large facets"), 0
    for case in range(12):
        (va, fa), (vb, fb) = bumpy_sphere(12, case), bumpy_sphere(150, 50 + case)
        va = va * 10.0 ** rng.uniform(0.5, 3)
        X, Y = random_pose(rng, 1.0), random_pose(rng, 1.0)
        corner, other = va[fa[0, 0]], va[fa[0, 1]]
        on = corner + (other - corner) * rng.choice([0.0, 0.3, 0.5])
        Y[:3, 3] = X[:3, 3] + X[:3, :3] @ (on + rng.uniform(1.5, 3.0) * np.abs(vb).max() * on / np.linalg.norm(on))
        B = build_mesh_tree(vb, fb)
        r = surface_distances(build_mesh_tree(va, fa), B, X, Y)
        each = [surface_distances(build_mesh_tree(va, fa[k : k + 1]), B, X, Y) for k in range(len(fa))]
        told = (case, X.tolist(), Y.tolist())
        least = min(float(one.distance[0]) for one in each)
        assert abs(float(r.distance[0]) - least) <= 1e-13 * np.abs(va).max(), told  # facets tie at corners
        assert r.lower[0] <= min(float(one.upper[0]) for one in each), told
        apart += not r.meets[0]
        if not r.meets[0]:
            limited = surface_distances(build_mesh_tree(va, fa), B, X, Y, 0.999 * float(r.lower[0]))
            assert limited.facets[0].tolist() == [-1, -1], told
            within = surface_distances(build_mesh_tree(va, fa), B, X, Y, 1.001 * float(r.distance[0]))
            assert abs(float(within.distance[0]) - least) <= 1e-13 * np.abs(va).max(), told
    assert apart >= 8, apart


@pytest.mark.parametrize("size", [1e-9, 1e-7, 1.0, 1e7])
def test_a_point_in_a_mesh_meets_few_boxes(size):
    """A point has no size to be a unit of: boxes of meshes of any size are told apart before it."""
    vertices, faces = bumpy_sphere(3000, 2)
    mesh = build_mesh_tree(size * vertices, faces)
    point = body_of(collide.Sphere(1.0)).tree
    X_WB, looked_at = collide.pose((0.2, 0.1, 0.3), rpy=(0.1, 0.2, 0.3)), []
    for away in (0.0, 0.3, 0.7, 1.5):
        X_WA = collide.pose(X_WB[:3, 3] + size * away * np.array([0.6, 0.48, 0.64]))
        looked_at.append(int(first_hits(point, mesh, X_WA, X_WB).counters[0, :2].sum()))
        r = surface_distances(point, mesh, X_WA, X_WB)
        looked_at.append(int(r.counters[0, :2].sum()) // 4)
        corners = (size * vertices) @ X_WB[:3, :3].T + X_WB[:3, 3]
        each = [nearest_on_triangle(X_WA[:3, 3] / size, T / size) for T in corners[faces[:: max(1, len(faces) // 300)]]]
        nearest = min(float(np.linalg.norm(p - X_WA[:3, 3] / size)) for p in each)
        assert r.lower[0] <= nearest * size + 1e-15, (size, away)
    assert max(looked_at) < 200, looked_at
