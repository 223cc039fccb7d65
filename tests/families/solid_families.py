"""Pairs of solids for booleans: shells that overlap, flush and stacked boxes, cavities, rings, corners that touch."""

from __future__ import annotations

import numpy as np
from mesh_families import (
    degenerate_case,
    grid_case,
    identical_case,
    random_case,
    random_pose,
    right_angle_pose,
    rounded_case,
    scaled_case,
    touching_case,
    turned_grid_case,
)
from mesh_shapes import block_ring, box, bumpy_sphere

import collide


def thickened(rng, mesh, on_grid: bool):
    """A tetrahedron over each of some facets, the right way round; where no apex has a volume, none. Shells overlap."""
    vertices, faces = np.asarray(mesh[0], dtype=float), np.asarray(mesh[1])[:5]
    corners = []
    size = float(np.abs(vertices).max()) or 1.0
    for face in faces:
        a, b, c = vertices[face]
        if on_grid:
            d = vertices[rng.integers(len(vertices))]
        else:
            d = vertices[face].mean(axis=0) + rng.normal(size=3) * 0.5 * np.abs(vertices[face] - a).max()
        volume = np.dot(np.cross(b - a, c - a), d - a)
        if abs(volume) > 1e-3 * np.abs(vertices[face] - a).max() ** 3:
            corners += [a, c, b, d] if volume > 0 else [a, b, c, d]
    if not corners:
        return box(high=(size, size, size))
    solid = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    return np.array(corners), np.concatenate([solid + 4 * k for k in range(len(corners) // 4)])


def of_facets(case, on_grid):
    """Solids of the facets of a case of `mesh_families.py`."""

    def make(rng):
        a, b, X, Y = case(rng)
        A = thickened(rng, a, on_grid)
        same = a is b or (np.array_equal(a[0], b[0]) and np.array_equal(a[1], b[1]))
        return A, A if same else thickened(rng, b, on_grid), X, Y

    return make


def grid_box(rng, cells=4):
    low = rng.integers(0, cells, 3)
    return box(low.astype(float), (low + rng.integers(1, 3, 3)).astype(float))


def joined(*meshes):
    """Several meshes as one."""
    starts = np.cumsum([0] + [len(v) for v, _ in meshes])
    return np.concatenate([v for v, _ in meshes]), np.concatenate([f + s for (_, f), s in zip(meshes, starts)])


def turned_over(mesh):
    return mesh[0], np.asarray(mesh[1])[:, ::-1]


def boxes_case(rng):
    """Boxes on a grid: flush, stacked, nested, equal, touching in an edge or a corner; several in a body."""
    parts = [joined(*(grid_box(rng) for _ in range(rng.integers(1, 3)))) for _ in range(2)]
    X = right_angle_pose(rng, (0.0, 1.0)) if rng.random() < 0.6 else random_pose(rng)
    Y = X if rng.random() < 0.5 else right_angle_pose(rng, (0.0, 1.0, 0.5))
    return *parts, X, Y


def cavity_case(rng):
    """A box with a cavity, against a box or another such, inside, across, flush with the wall of the cavity."""

    def hollow():
        return joined(box((0, 0, 0), (4, 4, 4)), turned_over(box((1, 1, 1), (3, 3, 3))))

    B = hollow() if rng.random() < 0.5 else grid_box(rng, 4)
    if rng.random() < 0.5:
        return hollow(), B, np.eye(4), collide.pose(rng.integers(-2, 3, 3).astype(float))
    return hollow(), B, random_pose(rng), random_pose(rng, 2.0)


def ring_case(rng):
    """A square ring and a bar, or two rings: holes, and walls in one plane."""
    bar = box((-0.5, -0.5, -2), (0.5, 0.5, 2)) if rng.random() < 0.5 else block_ring()
    Y = right_angle_pose(rng, (-0.5, 0.0, 0.5, 1.0)) if rng.random() < 0.6 else random_pose(rng)
    return block_ring(), bar, np.eye(4), Y


def touching_boxes_case(rng):
    """Boxes that touch in a corner, an edge or a side, or miss by an ulp; turned as one."""
    shift = rng.choice([-2.0, 0.0, 2.0], 3)
    shift *= 1.0 + rng.choice([0.0, 2.0**-52, -(2.0**-52)], 3)
    X = np.eye(4) if rng.random() < 0.5 else random_pose(rng)
    Y = X.copy()
    Y[:3, 3] += X[:3, :3] @ shift
    return box(), box(), X, Y


def smooth_case(rng):
    """Two closed surfaces of some fifty facets, as scans are."""
    n = int(rng.integers(24, 70))
    A = bumpy_sphere(n, int(rng.integers(1000)))
    B = A if rng.random() < 0.3 else bumpy_sphere(n, int(rng.integers(1000)))
    X = random_pose(rng, 0.5)
    near = X @ collide.pose(rng.normal(size=3) * 10.0 ** -rng.integers(0, 12))
    Y = random_pose(rng, 0.5) if rng.random() < 0.7 else near
    return A, B, X, Y


SOLIDS = {
    "smooth": smooth_case,
    "boxes": boxes_case,
    "cavities": cavity_case,
    "rings": ring_case,
    "touching boxes": touching_boxes_case,
    "random shells": of_facets(random_case, False),
    "grid shells": of_facets(grid_case, True),
    "turned grid shells": of_facets(turned_grid_case, True),
    "identical shells": of_facets(identical_case, False),
    "degenerate shells": of_facets(degenerate_case, True),
    "touching shells": of_facets(touching_case, False),
    "rounded shells": of_facets(rounded_case, False),
    "scaled shells": of_facets(scaled_case, False),
}
