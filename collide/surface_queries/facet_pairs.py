"""Pairs of facets with a common point: of two posed bodies, and within a mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.narrowphase.facets.facet_queries import all_hits, first_hits, self_hits
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.surface_queries.checked_arguments import two_bodies


class FacetPairs(NamedTuple):
    """Pairs of facets with a common point, at N pairs of poses.

    pairs : (k, 2) int64 facet numbers of A and of B; the pairs of a pose stand together, sorted.
    starts : (N + 1,) int64: the pairs of pose i are rows starts[i] to starts[i + 1].
    counters : (N, 3) int64: nodes compared with a box (a node against up to eight boxes counts once), pairs of facets
        tested, pairs decided in integers.
    """

    pairs: np.ndarray
    starts: np.ndarray
    counters: np.ndarray


class SelfCollisions(NamedTuple):
    """Pairs of facets of a mesh with more in common than whole corners and edges.

    pairs : (k, 2) int64 facet numbers, the smaller first, sorted.
    counters : (3,) int64: nodes compared with a box, pairs of facets tested, pairs decided in integers.
    """

    pairs: np.ndarray
    counters: np.ndarray

    @property
    def hit(self) -> bool:
        """Whether there is any."""
        return len(self.pairs) > 0

    @property
    def facets(self) -> np.ndarray:
        """(m,) the facets concerned, each once, sorted."""
        return np.unique(self.pairs)


def facet_pairs(A: Shape, B: Shape, X_WA, X_WB, *, first: bool = False, check_poses: bool = True) -> FacetPairs:
    """All pairs of facets of two bodies with a common point, decided exactly.

    Parameters
    ----------
    A, B : shapes, at least a `Mesh` among them. A `Box` or a `ConvexHull` without a radius takes part with the
        triangles of its hull, numbered as in the facets of distances.
    X_WA, X_WB : (4, 4) poses in the world W [m], or batches (N, 4, 4); a single pose goes with every pose of the
        other's batch.
    first : at most a single pair a pose, the same in every call; several times faster.
    check_poses : refuse matrices other than rotations.

    Returns
    -------
    FacetPairs. Facets are closed: touching in a point is meeting. A body wholly inside a solid has no pairs with the
    solid, though `collide` is True. Swapped arguments give the same pairs, swapped; ``first`` may give another pair.

    Raises
    ------
    InvalidArgument : no mesh among the shapes, batches of different lengths.
    InvalidPose : matrices other than poses.
    UnsupportedQuery : shapes without facets, by name.

    Notes
    -----
    O(n log n) pairs of boxes for local meshes (J. Erickson, "Local polyhedra and geometric graphs" (2005), theorem 3.6;
    counted in docs/locality.md), n² for any others at worst.
    """
    first = checks.true_or_false("facet_pairs: first", first)
    body_a, body_b, X_WA, X_WB = two_bodies("facet_pairs", A, B, X_WA, X_WB, check_poses)
    return FacetPairs(*(first_hits if first else all_hits)(body_a.tree, body_b.tree, X_WA, X_WB))


def self_collisions(mesh: Mesh) -> SelfCollisions:
    """Pairs of facets of a mesh with more in common than whole corners and edges, decided exactly.

    Parameters
    ----------
    mesh : corners with equal coordinates are the same corner, as everywhere.

    Returns
    -------
    SelfCollisions : facet numbers are rows of ``mesh.faces``. A mesh without any pair is embedded, as simulators and
    booleans of solids want it.

    Raises
    ------
    InvalidArgument : anything but a Mesh.

    Notes
    -----
    Facets without a common corner must not meet at all. With one common corner, neither may reach across the side of
    the other opposite to the corner. With two, they must not be folded flat onto each other. With three they are the
    same facet twice: duplicates and back-to-back facets are pairs. 25 ms for 69,451 facets of a scan, O(n log n) for
    local meshes without pairs.
    """
    if not isinstance(mesh, Mesh):
        raise InvalidArgument(
            f"self_collisions: mesh must be a Mesh, got {checks.brief(mesh)}: convex shapes do not cross themselves"
        )
    return SelfCollisions(*self_hits(mesh.tree))
