"""Least depths of bodies, convex or not: which search answers a pair.

Regions are closed by a box, and fields become the union of the items in reach. Both exchanges leave booleans the same
for all translations up to the length of the shortest known; longer translations are of no interest.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument
from collide.lowering.closed_regions import closed, sizes_at
from collide.lowering.kind_of_shape import kind_of
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.known_depth import Depth
from collide.pairs.batches import answer_batch
from collide.pairs.pair_arguments import pose_at, shape_at
from collide.results import UNDECIDED
from collide.shapes.shape import Shape
from collide.shapes.swept_mesh import SweptMesh

#: Loaded when a least depth is first asked for.
facet_bodies = lazy_module("collide.lowering.facet_bodies")
of_unions = lazy_module("collide.narrowphase.composite.least_depth")
of_mesh_unions = lazy_module("collide.narrowphase.composite.least_mesh_depth")
of_facets = lazy_module("collide.narrowphase.facets.least_facet_depth")
of_fields = lazy_module("collide.narrowphase.fields.items_in_reach")
#: How depths of bodies that are not convex are searched.
DepthSearch = Literal["quick", "least"]
_DEPTHS = {"quick": False, "least": True}
#: Brackets narrower than this are left as they are.
_NARROW = 1.0 + 2.0**-10


def checked_depth(depth: Any) -> bool:
    """Whether the least depth is asked for. Raises InvalidArgument."""
    if not isinstance(depth, str) or depth not in _DEPTHS:
        raise InvalidArgument(f'depth must be "quick" or "least", got {checks.brief(depth)}')
    return _DEPTHS[depth]


def shorten_depths(rows: np.ndarray, A, B, X_WA: np.ndarray, X_WB: np.ndarray) -> None:
    """Make depths of rows (n,) of overlapping bodies that are not convex the least ones known, in place; shapes and
    poses as of `distance`."""
    is_wide = (rows["upper"] <= 0.0) & np.isfinite(rows["lower"]) & (rows["lower"] < rows["upper"] * _NARROW)
    for k in np.flatnonzero(is_wide & (rows["how"] != UNDECIDED)).tolist():
        rows[k : k + 1] = _shortest(rows[k : k + 1], shape_at(A, k), shape_at(B, k), pose_at(X_WA, k), pose_at(X_WB, k))


def _shortest(row: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """A row (1,) with the least depth known; of swapped bodies the same, flipped."""
    known = Depth(-float(row["distance"][0]), -float(row["lower"][0]), row["normal"][0].copy(), -float(row["upper"][0]))
    a, b, is_same = _with_a_search(A, B, X_WA, X_WB, known.proven)
    search = _search_of(a, b)
    if search is None:
        return row
    if (search.key_of(b), X_WB.tolist()) < (search.key_of(a), X_WA.tolist()):
        depth = search.least_depth(b, a, X_WB, X_WA, known._replace(normal=-known.normal))
        depth = depth._replace(normal=-depth.normal)
    else:
        depth = search.least_depth(a, b, X_WA, X_WB, known)
    if not is_same:  # a way out of some items need not be a way out of the field
        depth = known.at_least(depth.least)
        if not (A.meshed or B.meshed or (A.is_field and B.is_field)):  # of these a boolean takes milliseconds
            meet = Question(True, check=False)
            depth = of_facets.shorter_depth(lambda X, Y: answer_batch(A, B, X, Y, meet), X_WA, X_WB, depth)
    return _row_of(row, depth)


def _with_a_search(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, length: float) -> tuple[Shape, Shape, bool]:
    """(shapes within A and within B without regions and fields; whether B, moved by no more than a length [m], meets
    these exactly where it meets A)."""
    if A.is_region or B.is_region:
        size = float(sizes_at(A, B, X_WA[None], X_WB[None], length)[0])
        A, B = (closed(S, size) if S.is_region else S for S in (A, B))
    are_same = True
    if not _are_of_facets(A, B):
        if A.is_field:
            A, are_same = of_fields.union_in_reach(A, B, X_WA, X_WB, length)
        if B.is_field:
            B, is_same = of_fields.union_in_reach(B, A, X_WB, X_WA, length)
            are_same &= is_same
    return A, B, are_same


def _are_of_facets(*shapes: Shape) -> bool:
    """Whether shapes are facets with a ball swept over them."""
    return all(isinstance(shape, SweptMesh) or facet_bodies.has_facets(shape) for shape in shapes)


def _search_of(A: Shape, B: Shape):
    """The module that searches the least depth of two shapes, with ``key_of``, to order bodies by, and ``least_depth``;
    ``None`` where the row of the two is the least, as of convex sets."""
    method = method_of(kind_of(A), kind_of(B))
    if method in (Method.FACETS, Method.FIELD):
        return of_facets
    return {Method.PARTS: of_unions, Method.CURVED: of_mesh_unions, Method.MESH_PARTS: of_mesh_unions}.get(method)


def _row_of(row: np.ndarray, depth: Depth) -> np.ndarray:
    """A row (1,) of an overlap with another depth."""
    row = row.copy()
    row["upper"], row["lower"] = -depth.least, -depth.proven
    row["distance"], row["normal"] = min(-depth.length, -depth.least), depth.normal + 0.0
    middle, half = 0.5 * (row["point_a"] + row["point_b"]), 0.5 * row["distance"] * row["normal"]
    row["point_a"], row["point_b"] = middle - half, middle + half
    return row
