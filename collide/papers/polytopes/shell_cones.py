"""The shell simplices at a vertex (lemma 6.1 of Barba and Langerman 2015): its normal cone, cut into simplicial cones.

A plane tangent to a polytope at v has its normal in the cone of the normals of the facets at v. Cut into cones of d
normals each, some cone holds the normal; the d half-spaces of the cone's facets have v as their corner, and their
common part lies on the polytope's side of the plane. (The text cuts the whole polar into simplices; tangent planes are
points of its boundary, so that d half-spaces do for each of the text's d + 1.)
"""

from __future__ import annotations

import numpy as np

#: Normals spanning less than this, relative to their lengths, make no cone.
_FLAT = 1e-13


def cones_at(vertex: int, facets: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """The normal cone at a vertex as simplicial cones: (c, d) rows of planes.

    Parameters
    ----------
    vertex : int
        Row of a point.
    facets : (f, d) integers
        Of a simplicial boundary, ascending rows.
    planes : (f, d + 1) float64
        Their half-spaces (a, b).
    """
    at = np.flatnonzero((facets == vertex).any(axis=1))
    local = facets[at]
    names = np.unique(local)
    others = np.searchsorted(names, local[local != vertex].reshape(len(local), -1))  # the link, with small numbers
    cones = at[simplices_of_dual(others)]
    normals = planes[cones, :-1]
    sizes = np.prod(np.linalg.norm(normals, axis=2), axis=1)
    return cones[np.abs(np.linalg.det(normals)) > _FLAT * sizes].astype(np.int32)


def coefficients_in(cones: np.ndarray, planes: np.ndarray, g: np.ndarray) -> np.ndarray:
    """(c, d) coefficients of a vector as combinations of the normals of each cone; all ≥ 0 in a cone with the
    vector.
    """
    normals = planes[cones, :-1].transpose(0, 2, 1)
    return np.linalg.solve(normals, np.broadcast_to(g[:, None], (len(cones), len(g), 1)))[:, :, 0]


def simplices_of_dual(link: np.ndarray) -> np.ndarray:
    """The dual of a simplicial sphere as simplices: (c, k + 1) rows of ``link`` (f, k), by pulling the first facets.

    The dual face of a face has the facets around the face as its corners. Its least corner is joined to the
    simplices of all sides without the least corner.
    """
    if link.shape[1] == 1:  # two points: an edge of the dual
        return np.array([[0, 1]])
    if link.shape[1] == 2:
        return _fan(link)
    everything = []
    first = link[0]
    for u in np.unique(link).tolist():
        if u in first:
            continue
        at = np.flatnonzero((link == u).any(axis=1))
        inner = simplices_of_dual(link[at][link[at] != u].reshape(len(at), -1))
        cones = at[inner]
        everything.append(np.column_stack((np.zeros(len(cones), dtype=np.int64), cones)))
    return np.concatenate(everything)


def _fan(edges: np.ndarray) -> np.ndarray:
    """A cycle of edges: its dual is a polygon, cut from its first corner."""
    first = edges[0]
    simplices = []
    at: dict[int, list[int]] = {}
    for row, (u, v) in enumerate(edges.tolist()):
        at.setdefault(u, []).append(row)
        at.setdefault(v, []).append(row)
    for u, rows in at.items():
        if u != first[0] and u != first[1]:
            simplices.append((0, *rows))
    return np.array(simplices, dtype=np.int64)
