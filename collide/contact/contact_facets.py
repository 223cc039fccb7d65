"""Facets of a body as contacts need them: which share corners, where they are in the world, which way they face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.mesh.bvh import REACH
from collide.narrowphase.facets.facet_queries import NearPairs, facets_within
from collide.shapes.mesh import Mesh

_U = 2.0**-53
#: Most pairs of facets looked at: they take a gigabyte.
MAX_PAIRS = 1 << 18


class Topology(NamedTuple):
    """Which facets of a body of m share corners.

    corners : (m, 3) ids, equal for equal points.   n_corners : ids are below this.
    place : (m,) where facet k stands in the tree.   fans : (3 m,) facets around corner after corner.
    starts : (n_corners + 1,) where the fan of a corner begins.   solid : facets have an outer side.
    """

    corners: np.ndarray
    n_corners: int
    place: np.ndarray
    fans: np.ndarray
    starts: np.ndarray
    solid: bool


def topology_of(body: Body) -> Topology:
    """Made when first asked for, and kept with the shape. O(m log m)."""
    shape = body.shape
    try:
        return shape._topology
    except AttributeError:
        made = _topology(body)
        shape._store(_topology=made)
        return made


def _topology(body: Body) -> Topology:
    tree = body.tree
    place = np.empty(len(tree.ids), dtype=np.int64)
    place[tree.ids] = np.arange(len(place))
    if isinstance(body.shape, Mesh):
        corners = body.shape.survey.corners
    else:
        points = tree.triangles[place].reshape(-1, 3) + 0.0
        corners = np.unique(points, axis=0, return_inverse=True)[1].reshape(-1, 3)
    corners = np.asarray(corners, dtype=np.int64)
    n_corners = int(corners.max()) + 1
    order = np.argsort(corners.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(corners.ravel(), minlength=n_corners))])
    return Topology(corners, n_corners, place, order // 3, starts, body.solid)


class Side(NamedTuple):
    """One body's facets of k pairs: numbers, corners (k, 3, 3) seen from A's origin, unit normals, ids of corners.

    Facets without area have the normal 0.
    """

    facets: np.ndarray
    corners: np.ndarray
    normals: np.ndarray
    ids: np.ndarray

    def take(self, which) -> Side:
        return Side(*(array[which] for array in self))


class Pairs(NamedTuple):
    """k pairs of facets near each other: `NearPairs`, and both sides posed."""

    near: NearPairs
    a: Side
    b: Side

    def take(self, which) -> Pairs:
        return Pairs(NearPairs(*(array[which] for array in self.near)), self.a.take(which), self.b.take(which))

    def __len__(self) -> int:  # type: ignore[override]
        return len(self.near.length)


class ContactFrame(NamedTuple):
    """Two bodies at a pair of poses (4, 4), seen from A's origin.   error : bound of a coordinate's rounding there
    [m].
    """

    A: Body
    B: Body
    X_WA: np.ndarray
    X_WB: np.ndarray
    error: float

    def pairs(self, reach: float) -> Pairs | None:
        """All pairs of facets within ``reach``; None where they are too many to be looked at."""
        near = facets_within(self.A.tree, self.B.tree, self.X_WA, self.X_WB, reach, MAX_PAIRS)
        if near is None:
            return None
        shift = self.X_WB[:3, 3] - self.X_WA[:3, 3]
        a = _side(self.A, near.facets[:, 0], self.X_WA[:3, :3], np.zeros(3))
        return Pairs(near, a, _side(self.B, near.facets[:, 1], self.X_WB[:3, :3], shift))


def contact_frame(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> ContactFrame:
    size = np.abs(X_WA[:3, 3]) + np.abs(X_WB[:3, 3])
    for body, X in ((A, X_WA), (B, X_WB)):
        size = size + (np.abs(X[:3, :3]) * body.tree.numbers[REACH : REACH + 3]).sum(axis=1)
    return ContactFrame(A, B, X_WA, X_WB, 8.0 * _U * float(size.max()))


def rotated(R: np.ndarray, points: np.ndarray) -> np.ndarray:
    """R p of points (…, 3), summed from x to z."""
    return (R * points[..., None, :]).sum(axis=-1)


def _side(body: Body, facets: np.ndarray, R: np.ndarray, shift: np.ndarray) -> Side:
    topology = topology_of(body)
    corners = rotated(R, body.tree.triangles[topology.place[facets]].reshape(-1, 3, 3)) + shift
    return Side(facets, corners, normals_of(corners), topology.corners[facets])


def normals_of(corners: np.ndarray) -> np.ndarray:
    """(k, 3) unit normals of triangles (k, 3, 3); 0 of those without area, and of those that rounding may have made."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = cross(u, v)
    lengths = lengths_of(n)
    least = 2.0**-44 * lengths_of(u) * lengths_of(v)
    return np.where((lengths > least)[:, None], n / np.where(lengths > 0.0, lengths, 1.0)[:, None], 0.0)


def cross(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Cross products of vectors (…, 3): what np.cross gives, in a third of its time for few of them."""
    a, b, c = u[..., 0], u[..., 1], u[..., 2]
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def lengths_of(v: np.ndarray) -> np.ndarray:
    """Lengths of vectors (…, 3)."""
    return np.sqrt(np.square(v).sum(axis=-1))


def facing(normals: np.ndarray, n: np.ndarray, solid: bool) -> np.ndarray:
    """(k,) cosines of facets' normals (k, 3) with n; facets of a surface have two sides: the one that faces n
    counts.
    """
    cosines = (normals * n).sum(axis=1)
    return cosines if solid else np.abs(cosines)
