"""Points of an arrangement rounded to doubles, once, and the solid that triangles of such points enclose."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.mesh.mesh_survey import EMPTY, INSIDE_OUT
from collide.mesh.weld import weld
from collide.shapes.mesh import Mesh
from collide.solids.cut_points import CutPoints

#: Products of smaller numbers are not split into two doubles without an error.
_SMALLEST = 2.0**-480
#: Three products and three sums in two doubles each are off by less than this share of their largest term.
_TAIL = 2.0**-98


class RoundedMesh(NamedTuple):
    """What is there after rounding.

    mesh : a solid, None where nothing remains.   rows : (k,) which of the triangles its facets are.
    moved : how far the farthest vertex was moved by rounding [m].
    n_collapsed : triangles, and n_thin shells, that rounding left without an inside: they are not in the mesh.
    """

    mesh: Mesh | None
    rows: np.ndarray
    moved: float
    n_collapsed: int
    n_thin: int


def rounded_mesh(points: CutPoints, triangles: np.ndarray) -> RoundedMesh:
    """The solid of triangles (k, 3) that close, vertices rounded to the nearest doubles of W."""
    ids, faces = np.unique(triangles, return_inverse=True)
    faces = faces.reshape(-1, 3)
    vertices, moved = rounded_points(points, ids)
    same = weld(vertices) if len(vertices) else np.zeros(0, dtype=np.int32)
    corners = same[faces]
    proper = np.flatnonzero(
        (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    )
    rows, n_thin = proper, 0
    while len(rows):
        used, compact = np.unique(corners[rows], return_inverse=True)
        mesh = Mesh(vertices[used], compact.reshape(-1, 3))
        if mesh.solid:
            return RoundedMesh(mesh, rows, moved, len(faces) - len(proper), n_thin)
        survey = mesh.survey
        spoilt = survey.flags & (EMPTY | INSIDE_OUT) != 0
        n_thin += len(np.unique(survey.shells[spoilt]))
        rows = rows[~spoilt] if spoilt.any() else rows[:0]
    return RoundedMesh(None, rows, moved, len(faces) - len(proper), n_thin)


def rounded_points(points: CutPoints, ids: np.ndarray) -> tuple[np.ndarray, float]:
    """((k, 3) points in W, how far the farthest was moved)."""
    out = np.empty((len(ids), 3))
    facets = points.facets
    is_vertex = ids < points.n_vertices
    vertices = ids[is_vertex]
    n = len(vertices)
    coordinates, off, proven = np.empty((n, 3)), np.empty(n), np.zeros(n, dtype=bool)
    for k, operand in enumerate(facets.operands):
        rows = np.flatnonzero(facets.body_of[vertices] == k)
        coordinates[rows], off[rows], proven[rows] = placed_vertices(operand.X, facets.local[vertices[rows]])
    out[is_vertex] = coordinates
    moved = float(off[proven].max(initial=0.0))
    open_rows = np.concatenate([np.flatnonzero(is_vertex)[~proven], np.flatnonzero(~is_vertex)])
    facets.load(ids[open_rows[ids[open_rows] < points.n_vertices]].tolist())
    for row, point in zip(open_rows.tolist(), ids[open_rows].tolist()):
        out[row], distance = points.in_world(point)
        moved = max(moved, distance)
    return out + 0.0, moved


def placed_vertices(X: np.ndarray, vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((k, 3) R v + t rounded to the nearest doubles, (k,) how far that is off, (k,) bool: proven to be so)."""
    shape = (len(vertices), 3)
    total, tail, size = np.broadcast_to(X[:3, 3], shape).copy(), np.zeros(shape), np.zeros(shape)
    size += np.abs(X[:3, 3])
    exact = np.ones(len(vertices), dtype=bool)
    for j in range(3):
        factor = np.broadcast_to(X[:3, j], shape)
        value = np.broadcast_to(vertices[:, j : j + 1], shape)
        product, error = _two_product(factor, value)
        exact &= ((product == 0.0) | (np.abs(product) > _SMALLEST)).all(axis=1)
        exact &= ((factor == 0.0) | (value == 0.0) | (product != 0.0)).all(axis=1)
        total, rest = _two_sum(total, product)
        tail += rest + error
        size += np.abs(product)
    nearest = total + tail
    off = (total - nearest) + tail
    slack = _TAIL * size
    proven = exact & ((nearest + (off + slack) == nearest) & (nearest + (off - slack) == nearest)).all(axis=1)
    return nearest, np.sqrt(np.square(off).sum(axis=1)) * (1 + 2.0**-40), proven


def _two_sum(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    s = a + b
    back = s - a
    return s, (a - (s - back)) + (b - back)


def _two_product(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    product = a * b
    (a_high, a_low), (b_high, b_low) = _split(a), _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Halves of the 53 bits of doubles (T. J. Dekker, 1971)."""
    c = 134217729.0 * a
    high = c - (c - a)
    return high, a - high
