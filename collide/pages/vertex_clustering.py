"""Fewer facets for a picture: vertices in the same cell of a grid are merged. For display only.

J. Rossignac, P. Borrel, "Multi-resolution 3D approximations for rendering complex scenes" (1993), with the vertex of a
cell where P. Lindstrom, "Out-of-core simplification of large polygonal models" (2000), puts the vertex: nearest to the
planes of the facets around, so that edges stay sharp. No package but numpy is needed, and the displacement of every
vertex is known. Collapses of edges by quadrics (the package fast-simplification) came as near with as many facets,
measured on links of a robot, without a bound of the distance.
"""

from __future__ import annotations

import numpy as np

#: Tries of a grid until it gives about as many facets as are wanted.
_TRIES = 12
#: A grid is good that gives this part of the facets wanted, and no more than all of them.
_ENOUGH = 0.85
#: Of a cell's planes those directions count whose weight is this part of the heaviest.
_FLAT = 1e-3


def simplified(vertices: np.ndarray, faces: np.ndarray, max_faces: int) -> tuple[np.ndarray, np.ndarray, float]:
    """A surface of at most ``max_faces`` facets, and its distance from the given surface [m].

    Parameters
    ----------
    vertices : (V, 3) float64 [m].
    faces : (F, 3) integers, rows of ``vertices``.
    max_faces : wanted number of facets, ≥ 1.

    Returns
    -------
    vertices (v, 3), faces (f, 3), and a length [m]: every facet left is the image of a row of ``faces`` whose corners
    moved no farther, so that no point drawn is farther from the surface. Parts thinner than a cell may vanish.
    The surface itself, and 0, for at most ``max_faces`` facets, or if all facets would vanish. O((V + F) log V).
    """
    if len(faces) <= max_faces:
        return vertices, faces, 0.0
    vertices, faces = _compact(vertices, faces)
    ids = _clusters(vertices, faces, max_faces) if len(faces) > max_faces else None
    if ids is None:
        return vertices, faces, 0.0
    points = _representatives(vertices, faces, ids)
    moved = float(np.sqrt(np.square(points[ids] - vertices).sum(axis=1).max()))
    return *_compact(points, ids[faces]), moved


def _clusters(vertices: np.ndarray, faces: np.ndarray, max_faces: int) -> np.ndarray | None:
    """(V,) number of each vertex's cell, of a grid leaving 1 to ``max_faces`` facets; ``None`` if all facets vanish."""
    low, size = vertices.min(axis=0), float(np.ptp(vertices, axis=0).max())
    if size == 0.0:
        return None
    cell, too_small, too_large = size / max(1.0, np.sqrt(max_faces / 2)), 0.0, np.inf
    best, max_left = None, 0
    for _ in range(_TRIES):
        ids = _cells(vertices, low, cell, size)
        n = _remaining(ids[faces])
        if n > max_faces:
            too_small = cell
        else:
            too_large = cell
            if n > max_left:
                best, max_left = ids, n
            if n >= _ENOUGH * max_faces:
                break
        cell = _next_cell(cell, n / max_faces, too_small, too_large)
    return best


def _next_cell(cell: float, part: float, too_small: float, too_large: float) -> float:
    """The cell size to try next: the number of facets falls with its square. part : facets left over facets wanted."""
    guess = cell * np.sqrt(max(part, 1e-3) / 0.93)
    if too_small < guess < too_large:
        return guess
    if 0 < too_small and too_large < np.inf:
        return np.sqrt(too_small * too_large)
    return cell * 2 if part > 1 else cell / 2


def _cells(vertices: np.ndarray, low: np.ndarray, cell: float, size: float) -> np.ndarray:
    """(V,) number of the cell that each vertex lies in, 0 … cells − 1."""
    steps = min(size / cell + 2.0, 2.0**20)  # three of them make an int64
    k = np.minimum(np.floor((vertices - low) / cell), steps).astype(np.int64)
    width = int(steps) + 1
    return np.unique((k[:, 0] * width + k[:, 1]) * width + k[:, 2], return_inverse=True)[1].reshape(-1)


def _remaining(corners: np.ndarray) -> int:
    """How many facets keep three different corners."""
    a, b, c = corners.T
    return int(np.count_nonzero((a != b) & (b != c) & (c != a)))


def _representatives(vertices: np.ndarray, faces: np.ndarray, ids: np.ndarray) -> np.ndarray:
    """(cells, 3) the vertex of each cell: nearest to the planes of its facets, and no farther out than its vertices."""
    n = int(ids.max()) + 1
    weight = np.bincount(ids, minlength=n)
    means = np.column_stack([np.bincount(ids, vertices[:, k], n) for k in range(3)]) / weight[:, None]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)  # their squares weigh planes by the squares of areas
    scale = float(np.abs(normals).max(initial=0.0)) or 1.0
    normals /= scale
    A = np.zeros((n, 3, 3))
    right = np.zeros((n, 3))
    for corner in range(3):
        cells = ids[faces[:, corner]]
        offsets = np.einsum("ij,ij->i", normals, a - means[cells])
        for i in range(3):
            right[:, i] += np.bincount(cells, normals[:, i] * offsets, n)
            for j in range(i, 3):
                A[:, i, j] += np.bincount(cells, normals[:, i] * normals[:, j], n)
    A += np.triu(A, 1).transpose(0, 2, 1)
    values, axes = np.linalg.eigh(A)
    useful = values > _FLAT * np.maximum(values[:, 2:], 1e-300)
    inverse = np.where(useful, 1.0 / np.where(useful, values, 1.0), 0.0)
    moves = np.einsum("nij,nj,nkj,nk->ni", axes, inverse, axes, right)
    reach = np.zeros(n)
    np.maximum.at(reach, ids, np.square(vertices - means[ids]).sum(axis=1))
    inside = np.square(moves).sum(axis=1) <= reach
    return means + np.where(inside[:, None], moves, 0.0)


def _compact(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Facets that are left, each once, and the points they use."""
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    first = np.argmin(corners, axis=1)
    turned = np.take_along_axis(corners, (first[:, None] + np.arange(3)) % 3, axis=1)
    turned = turned[np.sort(np.unique(turned, axis=0, return_index=True)[1])]
    used, rows = np.unique(turned, return_inverse=True)
    return points[used], rows.reshape(-1, 3)
