"""Facets of a body as contacts need them: which share corners, how they stand in the world, which way they face."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.mesh.bvh import REACH
from collide.narrowphase.facets.facet_queries import NearPairs, facets_within
from collide.shapes.mesh import Mesh

_U = 2.0**-53
#: Pairs of facets looked at: a gigabyte at most.
MOST_PAIRS = 1 << 18


class Topology(NamedTuple):
    """What hangs together in a body of m facets.

    corners : (m, 3) ids, equal for equal points.   many : ids are below this.
    place : (m,) where facet k stands in the tree.   fans : (3 m,) facets around corner after corner.
    starts : (many + 1,) where the fan of a corner begins.   solid : facets have an outer side.
    """

    corners: np.ndarray
    many: int
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
    many = int(corners.max()) + 1
    order = np.argsort(corners.ravel(), kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(corners.ravel(), minlength=many))])
    return Topology(corners, many, place, order // 3, starts, body.solid)


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


class Posed(NamedTuple):
    """Two bodies at a pair of poses (4, 4).   error : of a coordinate seen from A's origin, at most [m]."""

    A: Body
    B: Body
    X_WA: np.ndarray
    X_WB: np.ndarray
    error: float

    def pairs(self, reach: float) -> Pairs | None:
        """All pairs of facets within ``reach``; None where they are too many to be looked at."""
        near = facets_within(self.A.tree, self.B.tree, self.X_WA, self.X_WB, reach, MOST_PAIRS)
        if near is None:
            return None
        shift = self.X_WB[:3, 3] - self.X_WA[:3, 3]
        a = _side(self.A, near.facets[:, 0], self.X_WA[:3, :3], np.zeros(3))
        return Pairs(near, a, _side(self.B, near.facets[:, 1], self.X_WB[:3, :3], shift))


def posed(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> Posed:
    size = np.abs(X_WA[:3, 3]) + np.abs(X_WB[:3, 3])
    for body, X in ((A, X_WA), (B, X_WB)):
        size = size + (np.abs(X[:3, :3]) * body.tree.numbers[REACH : REACH + 3]).sum(axis=1)
    return Posed(A, B, X_WA, X_WB, 8.0 * _U * float(size.max()))


def turned(R: np.ndarray, points: np.ndarray) -> np.ndarray:
    """R p of points (…, 3), summed in one order."""
    return (R * points[..., None, :]).sum(axis=-1)


def _side(body: Body, facets: np.ndarray, R: np.ndarray, shift: np.ndarray) -> Side:
    topology = topology_of(body)
    corners = turned(R, body.tree.triangles[topology.place[facets]].reshape(-1, 3, 3)) + shift
    return Side(facets, corners, normals_of(corners), topology.corners[facets])


def normals_of(corners: np.ndarray) -> np.ndarray:
    """(k, 3) unit normals of triangles (k, 3, 3); 0 of those without area, and of those that rounding may have made."""
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    n = crossed(u, v)
    lengths = lengths_of(n)
    least = 2.0**-44 * lengths_of(u) * lengths_of(v)
    return np.where((lengths > least)[:, None], n / np.where(lengths > 0.0, lengths, 1.0)[:, None], 0.0)


def crossed(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Cross products of vectors (…, 3): what np.cross gives, in a third of its time for few of them."""
    a, b, c = u[..., 0], u[..., 1], u[..., 2]
    x, y, z = v[..., 0], v[..., 1], v[..., 2]
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=-1)


def lengths_of(v: np.ndarray) -> np.ndarray:
    """Lengths of vectors (…, 3)."""
    return np.sqrt(np.square(v).sum(axis=-1))


def facing(normals: np.ndarray, n: np.ndarray, solid: bool) -> np.ndarray:
    """Cosines of facets' normals with n; a surface's facets have two sides, and turn the one that faces it."""
    cosines = (normals * n).sum(axis=1)
    return cosines if solid else np.abs(cosines)
