"""A mesh and another single body, whatever its kind: states and rows. Unions are taken apart in `composite/`.

Bodies of facets go to `body_pairs.py`, curved shapes to `mesh_curved.py`; a half-space meets a mesh where it meets the
mesh's hull.
"""

from __future__ import annotations

import numpy as np

from collide.batches import ask
from collide.lowering.composite_parts import is_union
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import Body, as_given, body_of, has_facets, is_halfspace
from collide.narrowphase.convex_queries import number_of_poses
from collide.narrowphase.facets.body_pairs import body_rows, states
from collide.narrowphase.facets.mesh_curved import curved_rows, curved_states
from collide.narrowphase.facets.surface_pairs import APART, HIT
from collide.results import flipped
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape


def facet_bodies(A: Shape, B: Shape) -> tuple[Body, Body] | None:
    """Both bodies, where both shapes have facets and are no unions."""
    bodies = getattr(A, "_surface", None), getattr(B, "_surface", None)  # made already, more often than not
    if type(bodies[0]) is Body and type(bodies[1]) is Body:
        return bodies
    if any(is_union(shape) or is_halfspace(shape) or not has_facets(shape) for shape in (A, B)):
        return None
    return body_of(A), body_of(B)


def mesh_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4) or (1, 4, 4) of two shapes, a mesh among them.

    check : refuse matrices that are no rotation. Raises InvalidPose, UnsupportedQuery.
    """
    bodies = facet_bodies(A, B)
    if bodies is not None:
        return states(*bodies, X_WA, X_WB, check=check)
    if is_halfspace(A) or is_halfspace(B):
        return np.where(ask(hull_shape(A), hull_shape(B), X_WA, X_WB, True, 0.0, check, 1), HIT, APART)
    if not has_facets(A):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    return curved_states(body_of(A), enclosure_of(B), X_WA, X_WB, check=check)


def mesh_rows(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool = True, check: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:  # fmt: skip
    """Rows (PAIR_DTYPE) for poses (n, 4, 4) or (1, 4, 4); part_a and part_b are facets, 0 where none decided.

    limit, depths : as in `distance`.   check : refuse matrices that are no rotation.   out : rows to fill, zeroed,
    where both are bodies of facets. Raises InvalidPose, UnsupportedQuery.
    """
    bodies = facet_bodies(A, B)
    if bodies is not None:
        return body_rows(*bodies, X_WA, X_WB, limit=limit, depths=depths, check=check, out=out)
    if is_halfspace(A) or is_halfspace(B):
        rows = ask(hull_shape(A), hull_shape(B), X_WA, X_WB, False, limit, check, 1, depths=depths)
        rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1  # of the hull, not of the mesh
        return rows
    if not has_facets(A):
        return flipped(mesh_rows(B, A, X_WB, X_WA, limit=limit, depths=depths, check=check))
    n = number_of_poses(X_WA, X_WB)
    PA, PB = (as_given(np.ascontiguousarray(np.broadcast_to(X, (n, 4, 4)))) for X in (X_WA, X_WB))
    return curved_rows(body_of(A), enclosure_of(B), PA, PB, limit=limit, depths=depths, check=check)


def hull_shape(shape: Shape) -> Shape:
    """The hull of a mesh, any other shape itself."""
    return shape.convex_hull if isinstance(shape, Mesh) else shape
