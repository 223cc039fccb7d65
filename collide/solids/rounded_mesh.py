"""The solid that triangles of an arrangement enclose, their points rounded to doubles, once."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.mesh.mesh_survey import EMPTY, INSIDE_OUT
from collide.mesh.weld import weld
from collide.shapes.mesh import Mesh
from collide.solids.cut_points import CutPoints
from collide.solids.rounded_points import rounded_points


class RoundedMesh(NamedTuple):
    """A triangulated surface after rounding to doubles.

    mesh : a solid, ``None`` where nothing remains.   rows : (k,) numbers of its facets among the triangles.
    moved : the farthest a vertex was moved by rounding [m].
    n_collapsed, n_thin : triangles, and shells, left out of the mesh: rounding made them flat.
    """

    mesh: Mesh | None
    rows: np.ndarray
    moved: float
    n_collapsed: int
    n_thin: int


def rounded_mesh(points: CutPoints, triangles: np.ndarray) -> RoundedMesh:
    """The solid of triangles (k, 3) that close, vertices rounded to the nearest doubles of W."""
    ids, faces = used_points(triangles, len(points))
    vertices, moved = rounded_points(points, ids)
    corners, proper = welded(vertices, faces)
    mesh, remaining, n_thin = solid_of_facets(vertices, corners[proper] if len(proper) < len(faces) else corners)
    return RoundedMesh(mesh, proper[remaining], moved, len(faces) - len(proper), n_thin)


def solid_of_facets(vertices: np.ndarray, faces: np.ndarray) -> tuple[Mesh | None, np.ndarray, int]:
    """(the solid of faces that close, ``None`` where nothing remains, their rows (k,), number of flat shells left out).
    """
    rows, n_thin = np.arange(len(faces)), 0
    while len(rows):
        used, compact = used_points(faces[rows], len(vertices))
        mesh = Mesh(vertices, faces) if len(used) == len(vertices) else Mesh(vertices[used], compact)
        if mesh.solid:
            return mesh, rows, n_thin
        survey = mesh.survey
        spoilt = survey.flags & (EMPTY | INSIDE_OUT) != 0
        n_thin += len(np.unique(survey.shells[spoilt]))
        rows = rows[~spoilt] if spoilt.any() else rows[:0]
    return None, rows, n_thin


def welded(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(the faces with equal vertices named by the first, and those with three distinct corners)."""
    same = weld(vertices) if len(vertices) else np.zeros(0, dtype=np.int32)
    if (same == np.arange(len(same))).all():
        return faces, np.arange(len(faces))
    corners = same[faces]
    a, b, c = corners.T
    return corners, np.flatnonzero((a != b) & (b != c) & (c != a))


def used_points(triangles: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(the ids below n that triangles (k, 3) use, the triangles in their numbers); O(n + k)."""
    used = np.zeros(n, dtype=bool)
    used[triangles] = True
    ids = np.flatnonzero(used)
    place = np.empty(n, dtype=np.int32)
    place[ids] = np.arange(len(ids))
    return ids, place[triangles]
