"""Simplified surfaces: as few facets as wanted, and nowhere farther off than is said."""

from __future__ import annotations

import numpy as np
import pytest

from collide import Box, Cylinder, Sphere, tessellate
from collide.pages.vertex_clustering import simplified


def bumpy(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A rough sheet of 2 n² facets."""
    draw = np.random.default_rng(seed)
    x, y = (k.ravel() / n for k in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    vertices = np.column_stack([3 * x, y, 0.05 * draw.normal(size=len(x))])
    k = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    halves = ([k, k + n + 1, k + 1], [k + 1, k + n + 1, k + n + 2])
    return vertices, np.concatenate([np.column_stack(half) for half in halves])


def repeated(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Every facet three hundred times."""
    return vertices, np.repeat(faces, 300, axis=0)


def distance_to_triangles(p: np.ndarray, triangles: np.ndarray) -> float:
    """From a point to the nearest of (F, 3, 3) triangles: by their planes, edges and corners."""
    a, b, c = triangles.transpose(1, 0, 2)
    best = np.inf
    for s, e in ((a, b), (b, c), (c, a)):
        d = e - s
        t = np.clip(((p - s) * d).sum(axis=1) / np.maximum((d * d).sum(axis=1), 1e-300), 0, 1)
        best = min(best, np.linalg.norm(s + t[:, None] * d - p, axis=1).min())
    n = np.cross(b - a, c - a)
    size = np.linalg.norm(n, axis=1)
    within = np.ones(len(a), dtype=bool)
    for s, e in ((a, b), (b, c), (c, a)):
        within &= (np.cross(e - s, p - s) * n).sum(axis=1) >= 0
    heights = np.abs(((p - a) * n).sum(axis=1)) / np.maximum(size, 1e-300)
    return min(best, heights[within & (size > 0)].min(initial=np.inf))


SURFACES = {
    "ball": tessellate(Sphere(1.0), tolerance=1e-3),
    "can": tessellate(Cylinder(0.1, 3.0), tolerance=1e-6),
    "sheet": bumpy(40, 5),
    "box of many facets": repeated(*tessellate(Box((1, 2, 3)))),
}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("wanted", [1000, 200])
def test_no_point_drawn_is_farther_off_than_said(name, wanted):
    vertices, faces = SURFACES[name]
    points, corners, off = simplified(vertices, faces, wanted)
    assert 0 < len(corners) <= wanted < len(faces) and corners.max() < len(points)
    assert off < 0.5 * np.ptp(vertices, axis=0).max()
    draw = np.random.default_rng(7)
    weights = draw.dirichlet((1, 1, 1), 60)
    some = draw.integers(len(corners), size=60)
    furthest = 0.0
    for p, k in zip((weights[:, :, None] * points[corners[some]]).sum(axis=1), some):
        gap = distance_to_triangles(p, vertices[faces])
        assert gap <= off * (1 + 1e-9) + 1e-12, f"simplified(*SURFACES[{name!r}], {wanted}): facet {k}, {gap} > {off}"
        furthest = max(furthest, gap)
    assert furthest > 0 or name == "box of many facets"


def test_small_surfaces_are_themselves():
    vertices, faces = SURFACES["sheet"]
    points, corners, off = simplified(vertices, faces, len(faces))
    assert points is vertices and corners is faces and off == 0.0


def test_most_of_what_is_wanted_is_there():
    """A round surface takes 85 % of the facets it may, and keeps its roundness better than its grid."""
    vertices, faces = tessellate(Sphere(1.0), tolerance=1e-4)
    points, corners, _ = simplified(vertices, faces, 2000)
    assert 1700 <= len(corners) <= 2000
    assert np.abs(np.linalg.norm(points, axis=1) - 1).max() < 0.01
    a, b, c = (points[corners[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", np.cross(a, b), c).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.02), "turned inside out"


def test_corners_of_a_box_stay_sharp():
    """Cells with a corner in them put their vertex on it: where three planes meet."""
    side = np.linspace(0, 1, 31)
    u, v = (k.ravel() for k in np.meshgrid(side, side, indexing="ij"))
    k = (np.arange(30)[:, None] * 31 + np.arange(30)).ravel()
    square = np.concatenate([np.column_stack([k, k + 31, k + 1]), np.column_stack([k + 1, k + 31, k + 32])])
    sides = [np.column_stack([u, v, np.full_like(u, height)]) for height in (0, 1)]
    vertices = np.concatenate([np.roll(points, axis, axis=1) for axis in range(3) for points in sides])
    faces = np.concatenate([square + 961 * n for n in range(6)])
    points, corners, _ = simplified(vertices, faces, 500)
    assert len(corners) < 501
    for corner in np.array(np.meshgrid((0, 1), (0, 1), (0, 1))).reshape(3, 8).T:
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-6, corner


def test_surfaces_of_no_size():
    point = np.zeros((300, 3))
    faces = np.arange(300).reshape(100, 3)
    points, corners, off = simplified(point, faces, 10)
    assert len(corners) == 100 and not points.any() and off == 0.0, "whole, where nothing would be left"
