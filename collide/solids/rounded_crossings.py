"""Crossings among the facets of a rounded solid, asked only of facets that rounding could have made cross.

Facets of an arrangement do not cross; rounding moves a vertex by half a unit in the last place, e, along each axis.
Two whole facets of a body do not cross afterwards where the body's mesh proves both steady (`steady_facets`) with a
margin of ‖R⁻¹‖ e in the body's frame, row sums. Two whole facets of different bodies do not where they are farther
apart than 2√3 e. All other facets are asked, among themselves and against facets whose boxes come near theirs.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import facets_within, self_hits
from collide.shapes.mesh import Mesh
from collide.solids.arrangement import Arrangement, crossings_of, steadiness_of
from collide.solids.facets_near import CELLS, take_near

#: Facets of a solid, for each pair of bodies, below which all are asked: looking for steady ones takes as long.
_MIN_FACETS = 1000


def shaken_facets(arrangement: Arrangement, unit: float, n_triangles: int) -> np.ndarray | None:
    """(F,) bool: facets of the arrangement that rounding might make cross others, if they are whole; ``None`` for all.

    unit : in the last place of the largest rounded coordinate [m].   n_triangles : of the solid.
    """
    facets, r = arrangement.facets, len(arrangement.facets.operands)
    if n_triangles < _MIN_FACETS * max(r * (r - 1) // 2, 1):
        return None
    shaken = np.zeros(len(facets.corners), dtype=bool)
    for k, operand in enumerate(facets.operands):
        known = steadiness_of(operand.mesh)
        if not _inverse_size(operand.X) * 0.5 * unit <= known.margin:
            return None
        rows = facets.rows_of(k, np.flatnonzero(~known.is_steady))
        shaken[rows[rows >= 0]] = True
    for i in range(r):
        for j in range(i + 1, r):
            A, B = facets.operands[i], facets.operands[j]
            max_pairs = 4 * arrangement.n_meeting + n_triangles
            near = facets_within(A.body.tree, B.body.tree, A.X, B.X, 4.0 * unit, max_pairs)
            if near is None:
                return None
            for k, numbers in zip((i, j), near.facets.T):
                rows = facets.rows_of(k, numbers)
                shaken[rows[rows >= 0]] = True
    return shaken


def _inverse_size(X: np.ndarray) -> float:
    """More than the largest row sum of |R⁻¹|, infinite where R is nearly singular: with C R = I + D the inverse is
    (I + D)⁻¹ C, whose rows sum to no more than |C| / (1 − |D|).
    """
    try:
        C = np.linalg.inv(X[:3, :3])
    except np.linalg.LinAlgError:
        return math.inf
    size = float(np.abs(C).sum(axis=1).max())
    D = float(np.abs(C @ X[:3, :3] - np.eye(3)).sum(axis=1).max()) + 2.0**-40
    return size / (1.0 - D) * (1.0 + 2.0**-40) if D < 0.5 else math.inf


def rounded_crossings(mesh: Mesh, asked: np.ndarray | None) -> np.ndarray:
    """(k, 2) all pairs of crossing facets of a mesh.

    asked : (m,) bool, the facets but for a set without crossings in the set; ``None`` for all facets.
    """
    if asked is None:
        return crossings_of(mesh)
    rows = np.flatnonzero(_with_near(mesh.vertices, mesh.faces, asked))
    if len(rows) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    return rows[self_hits(build_mesh_tree(mesh.vertices, mesh.faces[rows]))[0]]


def _with_near(vertices: np.ndarray, faces: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """(m,) bool: facets asked, and facets whose boxes might meet boxes of those."""
    taken = asked.astype(np.uint8)
    n_asked = int(taken.sum())
    if n_asked:
        faces = np.ascontiguousarray(faces, dtype=np.int32)
        cells = np.empty(CELLS * n_asked + 64, dtype=np.uint8)
        take_near(
            address_of(vertices), len(vertices), address_of(faces), len(faces), address_of(taken), n_asked,
            address_of(cells), len(cells),
        )
    return taken != 0
