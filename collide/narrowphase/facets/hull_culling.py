"""Pairs with a mesh within a distance: hulls that are proven farther apart answer for the bodies in them.

Most pairs of a scene that come near are still apart by their hulls, and then no facet is looked at, no tree is
built, and no kernel for triangles is compiled.
"""

from __future__ import annotations

import math

import numpy as np

from collide.narrowphase.convex_bodies import convex_rows
from collide.narrowphase.facets.mesh_pairs import convex_cover, pair_rows
from collide.shapes.shape import Shape


def rows_within(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> np.ndarray:
    """What `pair_rows` gives for poses (n, 4, 4), but for pairs beyond ``limit`` [m]: these are any proven bound.

    Raises UnsupportedQuery where the hulls are not enough and the shapes are not answered.
    """
    hulls = convex_cover(A), convex_cover(B)
    if limit == math.inf or None in hulls:
        return pair_rows(A, B, X_WA, X_WB, limit=limit)
    rows = convex_rows(*hulls, X_WA, X_WB, limit=limit, depths=False)
    near = np.flatnonzero(~(rows["beyond"] | (rows["lower"] > limit)))
    rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1  # of the hulls, not of the meshes
    rows["part_a"], rows["part_b"] = 0, 0
    if len(near):
        rows[near] = pair_rows(A, B, X_WA[near], X_WB[near], limit=limit)
    return rows
