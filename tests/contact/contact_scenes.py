"""Meshes for tests of contacts whose contacts are known: tables of many facets, a gripper, wedges."""

from __future__ import annotations

import numpy as np


def table(cells=7, size=2.0, thick=0.25, seed=None):
    """A closed slab, its top at z = 0 cut into cells × cells × 2 facets; seed: their inner corners moved within the
    top."""
    xs = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(xs, xs)
    if seed is not None:
        rng = np.random.default_rng(seed)
        x[1:-1, 1:-1] += rng.uniform(-0.3, 0.3, (cells - 1, cells - 1)) * size / cells
        y[1:-1, 1:-1] += rng.uniform(-0.3, 0.3, (cells - 1, cells - 1)) * size / cells
    top = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    n, row = len(top), cells + 1
    faces = []
    for j in range(cells):
        for i in range(cells):
            a, b, c, d = j * row + i, j * row + i + 1, (j + 1) * row + i, (j + 1) * row + i + 1
            faces += [(a, b, d), (a, d, c), (n + a, n + d, n + b), (n + a, n + c, n + d)]
    rim = [(k, k + 1) for k in range(cells)] + [(k * row + cells, (k + 1) * row + cells) for k in range(cells)]
    rim += [(cells * row + k + 1, cells * row + k) for k in range(cells)] + [
        ((k + 1) * row, k * row) for k in range(cells)
    ]
    for a, b in rim:
        faces += [(n + a, n + b, b), (n + a, b, a)]
    return np.concatenate([top, top - (0, 0, thick)]), np.array(faces)


def gripper(width=1.0, wall=0.25, height=0.5, length=0.5):
    """A U: two jaws of inner distance ``width`` along x, open upwards, extruded along y. The gap's floor is z = 0."""
    w = width / 2
    outline = [
        (-w - wall, -wall),
        (w + wall, -wall),
        (w + wall, height),
        (w, height),
        (w, 0),
        (-w, 0),
        (-w, height),
        (-w - wall, height),
    ]
    caps = [(0, 1, 4), (0, 4, 5), (1, 2, 3), (1, 3, 4), (0, 5, 6), (0, 6, 7)]
    n = len(outline)
    vertices = [(x, y, z) for y in (-length / 2, length / 2) for x, z in outline]
    faces = [*caps, *((n + a, n + c, n + b) for a, b, c in caps)]
    for i in range(n):
        j = (i + 1) % n
        faces += [(i, n + i, n + j), (i, n + j, j)]
    return np.array(vertices), np.array(faces)


def wedge(length=2.0, half=0.5, height=0.5):
    """A roof: its ridge along x at z = 0, 2·half wide at z = −height."""
    x = length / 2
    vertices = np.array(
        [(-x, 0, 0), (x, 0, 0), (-x, half, -height), (x, half, -height), (-x, -half, -height), (x, -half, -height)]
    )
    faces = np.array([(0, 1, 3), (0, 3, 2), (0, 4, 5), (0, 5, 1), (2, 3, 5), (2, 5, 4), (0, 2, 4), (1, 5, 3)])
    return vertices, faces


def world_corners(vertices, X):
    return np.asarray(vertices) @ X[:3, :3].T + X[:3, 3]


def as_set(points, digits=7):
    return {tuple(p) for p in (np.round(np.asarray(points), digits) + 0.0).tolist()}
