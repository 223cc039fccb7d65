"""A mesh and another single body, whatever its kind: states and rows. Unions are taken apart in `composite/`.

Bodies of facets go to `facet_kernel_calls.py`, curved shapes to `mesh_curved.py`; a half-space meets a mesh where it
meets the mesh's hull.
"""

from __future__ import annotations

import numpy as np

from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import as_given, body_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.narrowphase.convex_batches import convex_hits, convex_rows
from collide.narrowphase.convex_kernel_calls import number_of_poses
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.facets.facet_kernel_calls import body_rows, states
from collide.narrowphase.facets.mesh_collide_kernel import APART, HIT
from collide.narrowphase.facets.mesh_curved import curved_rows, curved_states
from collide.results import flipped
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.transforms import as_poses


def mesh_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4) or (1, 4, 4) of two shapes, a mesh among them.

    check : refuse matrices that are no rotation. Raises InvalidPose, UnsupportedQuery.
    """
    method = method_of(kind_of(A), kind_of(B))
    if method is Method.FACETS:
        return states(body_of(A), body_of(B), X_WA, X_WB, check=check)
    if method is Method.HULL:
        return np.where(convex_hits(hull_shape(A), hull_shape(B), *checked_poses(X_WA, X_WB, check)), HIT, APART)
    if kind_of(A) is not Kind.MESH:
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    return curved_states(body_of(A), enclosure_of(B), X_WA, X_WB, check=check)


def mesh_rows(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool = True, check: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4) or (1, 4, 4); part_a and part_b are facets, 0 where no facet decided.

    limit, depths : as in `distance`.   check : refuse matrices that are no rotation.   out : rows to fill, zeroed,
    where both are bodies of facets. Raises InvalidPose, UnsupportedQuery.
    """
    method = method_of(kind_of(A), kind_of(B))
    if method is Method.FACETS:
        return body_rows(body_of(A), body_of(B), X_WA, X_WB, limit=limit, depths=depths, check=check, out=out)
    if method is Method.HULL:
        X_WA, X_WB = checked_poses(X_WA, X_WB, check)
        rows = convex_rows(hull_shape(A), hull_shape(B), X_WA, X_WB, limit=limit, depths=depths)
        rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1  # of the hull, not of the mesh
        return rows
    if kind_of(A) is not Kind.MESH:
        return flipped(mesh_rows(B, A, X_WB, X_WA, limit=limit, depths=depths, check=check))
    PA, PB = map(as_given, checked_poses(X_WA, X_WB, check))
    return curved_rows(body_of(A), enclosure_of(B), PA, PB, limit=limit, depths=depths)


def hull_shape(shape: Shape) -> Shape:
    """The hull of a mesh, any other shape itself."""
    return shape.convex_hull if isinstance(shape, Mesh) else shape


def checked_poses(X_WA: np.ndarray, X_WB: np.ndarray, check: bool) -> list[np.ndarray]:
    """Both checked, and as long as each other; check: refuse matrices that are no rotation. Raises InvalidPose."""
    n = number_of_poses(X_WA, X_WB)
    poses = as_poses(X_WA, "X_WA", check=check), as_poses(X_WB, "X_WB", check=check)
    return [np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4))) for X in poses]
