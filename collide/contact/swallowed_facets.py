"""Facets of a mesh wholly within a curved set, and the choice of some for the convex engine.

The engine tells the least translation of one facet in some tens of microseconds, and a finely cut mesh sunk into a set
has ten thousands of facets within. Few of them can start a patch, and a patch grows over facets without rows of
`distance`. So of many facets the engine is asked about some, spread over the mesh: of each run of facets in the order
of the tree the facet along whose own normal the set is left soonest. For a facet of normal n the least translation is
no longer than h_facet(n) + h_set(−n), with h the support function (along n the two are apart by minus this sum), and
exactly as long where the facet starts a patch with n.
"""

from __future__ import annotations

import numpy as np

from collide.curved.curved_kinds import CURVED
from collide.lowering.enclosures import Enclosure
from collide.lowering.facet_bodies import Body, PosesWithSlop
from collide.lowering.packed_convex import PackedConvex
from collide.mesh.bvh import REACH, MeshTree
from collide.narrowphase.facets.near_facets import Facets

#: Of facets within a set the engine is asked about so many a pose, picked from so many; of no more, about all.
MAX_ASKED, _MAX_LOOKED_AT = 512, 4096
#: Boxes of a tree that are looked at together, at most, before a mesh is taken to reach out of a set.
_MAX_BOXES = 256
#: Rounding of a coordinate, of the numbers met; what poses stretch slops by is in the second.
_ROUNDING, _STRETCH = 2.0**-40, 1.001
_SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


class Insides:
    """Proofs of points of a mesh's frame within a curved set, at n pairs of poses.

    Each coordinate of a point as placed in the set's frame is off by ``errors`` (n,) at most [m]: a point deeper in the
    set than its error is within the set.
    """

    def __init__(self, tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop):
        self.tree, self.packed = tree, packed
        self.X_BA = np.linalg.inv(B.X) @ A.X
        size = np.abs(A.X[:, :3, 3]).sum(axis=1) + np.abs(B.X[:, :3, 3]).sum(axis=1) + packed.reach
        size += np.abs(tree.numbers[REACH : REACH + 3]).sum()
        self.errors = _STRETCH * (A.slop + B.slop + packed.slop) + _ROUNDING * size

    def placed(self, k: int, points: np.ndarray) -> np.ndarray:
        """(3, m): points (m, 3) of the mesh's frame in the set's, at poses k, axis by axis."""
        return self.X_BA[k, :3, :3] @ points.T + self.X_BA[k, :3, 3, None]

    def of_points(self, k: int, points: np.ndarray) -> np.ndarray:
        """(m,) bool: whether points (m, 3) are proven within, at poses k."""
        return self._are_within(self.placed(k, points), self.errors[k])

    def _are_within(self, placed: np.ndarray, error) -> np.ndarray:
        """The same of points (3, m) of the set's frame whose coordinates are off by ``error``, a number or one each."""
        return CURVED[self.packed.kind].within(self.packed.params, placed, error)

    def of_meshes(self) -> np.ndarray:
        """(n,) bool: whether the whole mesh is proven within: a corner of it first, then boxes of its tree."""
        placed = self.X_BA[:, :3, :3] @ self.tree.triangles[0, :3] + self.X_BA[:, :3, 3]
        within = self._are_within(placed.T, self.errors)
        for k in np.flatnonzero(within).tolist():
            within[k] = self._is_mesh_within(k)
        return within

    def _is_mesh_within(self, k: int) -> bool:
        """The same at poses k: some facets first, then boxes from the root down, as far as they are not within."""
        tree = self.tree
        if not self.of_points(k, tree.triangles[:: -(-len(tree.ids) // 8)].reshape(-1, 3)).all():
            return False
        links, at, scale = tree.links(), np.zeros(1, dtype=np.int64), np.ldexp(1.0, tree.exponent)
        while 0 < len(at) <= _MAX_BOXES:
            used = tree.used(at)
            centres, half_lengths = (of[used] * scale for of in tree.boxes(at))
            corners = tree.centre + centres[:, None] + half_lengths[:, None] * _SIGNS
            reach_out = ~self.of_points(k, corners.reshape(-1, 3)).reshape(-1, 8).all(axis=1)
            at = links[at][used][reach_out].astype(np.int64)
            if (at < 0).any():
                return False
        return not len(at)


def meshes_within(body: Body, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop) -> np.ndarray | None:
    """(n,) bool: whether a mesh of many facets is proven within a set, at n pairs of poses; None where at no pose."""
    # A ball around the mesh's box is less than twice as large as what holds the box.
    if not _knows(body, packed) or body.reach > 2.0 * packed.reach:
        return None
    return Insides(body.tree, packed, A, B).of_meshes()


def _knows(body: Body, packed: PackedConvex) -> bool:
    """Whether there are many facets, and a formula tells what is within the set."""
    return len(body.tree.ids) > MAX_ASKED and packed.kind in CURVED


def facets_asked(
    body: Body, enclosure: Enclosure, A: PosesWithSlop, B: PosesWithSlop, candidates: Facets, counts: np.ndarray
) -> np.ndarray:
    """(k,) bool: about which of the facets near a set, at n pairs of poses, the engine is asked. All others lie within
    the set, proven.   counts : (n,) facets a pose."""
    tree, asked = body.tree, np.ones(len(candidates.pose), dtype=bool)
    if not _knows(body, enclosure.packed) or counts.max() <= MAX_ASKED:
        return asked
    insides = Insides(tree, enclosure.packed, A, B)
    starts = np.concatenate([[0], np.cumsum(counts)])
    for k in np.flatnonzero(counts > MAX_ASKED).tolist():
        places = candidates.place[starts[k] : starts[k + 1]]
        corners = tree.triangles[places].reshape(-1, 3)
        within = np.flatnonzero(insides.of_points(k, corners).reshape(-1, 3).all(axis=1))
        if len(within) > MAX_ASKED:
            asked[starts[k] + within] = False
            within = within[np.argsort(places[within])][:: -(-len(within) // _MAX_LOOKED_AT)]
            triangles = insides.placed(k, tree.triangles[places[within]].reshape(-1, 3)).T.reshape(-1, 3, 3)
            asked[starts[k] + within[_soonest_of_runs(_ways_out(triangles, enclosure, body.solid))]] = True
    return asked


def _ways_out(triangles: np.ndarray, enclosure: Enclosure, solid: bool) -> np.ndarray:
    """(m,) how far a set has to be moved along the normals of triangles (m, 3, 3) of its frame to be clear of their
    planes, but for the distance of the polytope within from the set's surface [m]; ∞ without an area.
    """
    assert enclosure.inner is not None
    points = np.unique(enclosure.inner.tree.triangles.reshape(-1, 3), axis=0)
    p = triangles[:, 0]
    n = np.cross(triangles[:, 1] - p, triangles[:, 2] - p)
    lengths = np.sqrt(np.square(n).sum(axis=1))
    flat = lengths == 0.0
    n /= np.where(flat, 1.0, lengths)[:, None]
    heights, along = (n * p).sum(axis=1), n @ points.T
    ways = heights - along.min(axis=1)
    if not solid:
        ways = np.minimum(ways, along.max(axis=1) - heights)
    ways[flat] = np.inf
    return ways


def _soonest_of_runs(ways: np.ndarray) -> np.ndarray:
    """(at most MAX_ASKED,) where in each run of facets the least way out is."""
    run = np.arange(len(ways)) * MAX_ASKED // len(ways)
    order = np.lexsort((ways, run))
    return order[np.flatnonzero(np.diff(run, prepend=-1))]
