"""Whether tetrahedra lie in a solid mesh once their points have moved by little: the facets decide, exactly."""

from __future__ import annotations

import numpy as np

from collide.shapes.mesh import Mesh
from collide.spheres.body_facets import BodyPart, shells_of
from collide.surface_queries.facet_pairs import facet_pairs
from collide.surface_queries.signed_distances import signed_distances

_FACES = np.array([(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])


class SolidFacets:
    """The facets of a solid mesh, and a corner of each shell.

    part : of a body.   slack : far above the rounding of placed points [m].
    """

    def __init__(self, part: BodyPart, slack: float):
        self._mesh, self._slack = part.mesh, slack
        _, first = np.unique(shells_of(part), return_index=True)
        self._shells = part.corners[first, 0]

    def hold_moved(self, cells: np.ndarray, way: float, share: float) -> np.ndarray:
        """(k,) whether tetrahedra (k, 4, 3) lie in the solid after no point moved by more than a way [m]: a share of
        the way towards the middle, the rest against the normal of the facet nearest to the outermost corner.

        So they do where the middle lies inside and no facet meets the tetrahedron: every facet that enters meets a
        face, unless the tetrahedron holds the whole shell of the facet.
        """
        if not len(cells):
            return np.zeros(0, dtype=bool)
        middles = cells.mean(axis=1, keepdims=True)
        reach = np.sqrt(np.square(cells - middles).sum(axis=2)).max(axis=1)
        moved = middles - ((1.0 - share) * way) * self._normals(cells)[:, None]
        smaller = moved + np.maximum(1.0 - share * way / reach, 0.0)[:, None, None] * (cells - middles)
        inside = signed_distances(self._mesh, moved[:, 0]).upper < -self._slack
        rows = np.flatnonzero(inside)
        if len(rows):
            faces = (4 * np.arange(len(rows))[:, None, None] + _FACES).reshape(-1, 3)
            soup = Mesh(smaller[rows].reshape(-1, 3), faces, solid=False)
            met = facet_pairs(self._mesh, soup, np.eye(4), np.eye(4), check_poses=False).pairs[:, 1]
            inside[rows[met // 4]] = False
            rows = np.flatnonzero(inside)
            inside[rows] = ~_may_hold(smaller[rows], self._shells)
        return inside

    def _normals(self, cells: np.ndarray) -> np.ndarray:
        """(k, 3) no longer than 1: outwards from the facets nearest to the outermost corners of tetrahedra."""
        corners = cells.reshape(-1, 3)
        near = signed_distances(self._mesh, corners)
        k = 4 * np.arange(len(cells)) + near.distance.reshape(-1, 4).argmax(axis=1)
        outwards = (near.point[k] - corners[k]) * np.where(near.distance[k] < 0.0, 1.0, -1.0)[:, None]
        length = np.sqrt(np.square(outwards).sum(axis=1))
        return outwards / np.maximum(length, self._slack)[:, None]


def _may_hold(cells: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) whether a tetrahedron (k, 4, 3) holds one of points (n, 3), or nearly so: true unless proven otherwise.

    A point inside makes four tetrahedra with the faces, all turned as the whole is.
    """
    ends = cells[:, None] - points[:, None]
    a, b, c, d = (ends[:, :, k] for k in range(4))
    volumes = np.stack([_volume(a, b, c), -_volume(b, c, d), _volume(c, d, a), -_volume(d, a, b)])
    # Products of three lengths, rounded a few times by 2^-53: 1e-12 of the longest cubed is far above that.
    rounding = 1e-12 * np.sqrt(np.square(ends).sum(axis=3)).max(axis=2) ** 3
    return ((volumes >= -rounding).all(axis=0) | (volumes <= rounding).all(axis=0)).any(axis=1)


def _volume(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
    return np.einsum("ijk,ijk->ij", a, np.cross(b, c))
