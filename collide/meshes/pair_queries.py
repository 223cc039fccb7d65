"""What pair queries and worlds ask of a pair of shapes with a mesh in it: unions, or two single bodies."""

from __future__ import annotations

import numpy as np

from collide.meshes.answers import given, mesh_hits, mesh_rows
from collide.meshes.union_pairs import part_states
from collide.meshes.union_parts import is_union
from collide.meshes.unions import union_hits, union_rows, union_states
from collide.shapes.base import Shape


def pair_hits(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool for poses (n, 4, 4): whether two shapes, a mesh among them or in one, share a point; True where open."""
    if is_union(A) or is_union(B):
        return union_hits(A, B, X_WA, X_WB)
    return mesh_hits(A, B, X_WA, X_WB)


def pair_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4): what `pair_hits` says, and whether that is proven."""
    if is_union(A) or is_union(B):
        return union_states(A, B, X_WA, X_WB, open_ones=True)
    return part_states(A, B, given(X_WA), given(X_WB))


def pair_rows(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool = True) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4); limit, depths as in `distance`.

    part_a, part_b : of a `Compound` the number of its part, in the order of its items, nested ones in their place; of
    any other shape the facet.
    """
    if is_union(A) or is_union(B):
        return union_rows(A, B, X_WA, X_WB, limit=limit, depths=depths)
    return mesh_rows(A, B, X_WA, X_WB, limit=limit, depths=depths)
