"""`nested_hulls`: hulls of few facets around a body and of few vertices within the body, and bounds of the distance.

What is proven, and how: the hull of an outer level's corners and the next level's corners is found exactly, and has
corners of the outer level only, so it contains the next level; the finest contains the body's vertices likewise. Inner
levels are hulls of the body's vertices. The distance of a point from a convex set is convex, so that over a hull it is
largest at a corner: brackets of corners' distances, as `distance` proves them, bracket the distance between two levels.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.hull.exact_hull import convex_hull
from collide.hull_levels.body_hull import BodyHull, rows_beside
from collide.hull_levels.inner_hulls import inner_vertices
from collide.hull_levels.outer_hulls import FIRST_MARGIN, outer_corners
from collide.lowering.packed_convex import POINTS
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.hpolytope import HPolytope
from collide.shapes.mesh import Mesh
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape, checked_shape

#: Sizes of the levels where none are said.
SIZES = (8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096)
_LEAST = 8
#: Where rounding was larger than the margin, the margin grows by this factor, so often at most.
_WIDER, _TRIES = 64.0, 6


class NestedHull(NamedTuple):
    """A level.

    size : the largest number of planes of the outer hull, and of vertices of the inner.
    outer : a `ConvexHull` that contains the body, proven. It has at most 2·planes − 4 vertices.
    planes : of the outer hull, ≤ size; rounded corners may split a side of more than three corners into facets.
        Of the body's hull as it is, the number of its triangles.
    inner : a `ConvexHull` of at most ``size`` vertices of the body.
    outer_within : no point of the outer hull is farther from the body's hull [m]; a proven bound.
    inner_within : no point of the body's hull is farther from the inner hull [m]; a proven bound.
    gap : (lower, upper), a proven bracket of the Hausdorff distance of the outer and the inner hull [m].
    """

    size: int
    outer: ConvexHull
    planes: int
    inner: ConvexHull
    outer_within: float
    inner_within: float
    gap: tuple[float, float]


def nested_hulls(shape: Shape, sizes: Sequence[int] = SIZES) -> tuple[NestedHull, ...]:
    """Convex hulls around a body and within it, from coarse to fine: levels of detail that are proven.

    Parameters
    ----------
    shape : Shape
        A `ConvexHull` without a radius, a `Box`, a `Mesh`, or a `PointCloud` of points without radii.
    sizes : sequence of int
        Of the levels, ascending, each ≥ 8: the largest number of planes of an outer hull, and of vertices of an inner.

    Returns
    -------
    tuple of NestedHull
        A level for each size. Each level's outer hull contains the next level's, and all contain the body; each inner
        hull is within the next level's, and all are within the body's hull. All in the frame of the shape [m].

    Raises
    ------
    UnsupportedQuery
        For other shapes: curved ones, unions, and sets without an end.
    InvalidArgument
        For sizes below 8, or not ascending.

    Notes
    -----
    From as many planes on as the body's hull has triangles, the outer hull is that hull, and the inner from its number
    of vertices on. Planes and vertices are chosen greedily, where the body is farthest: of a sphere, the distance
    falls as 1/size, as the best does. O(k log n) questions for n vertices and k planes and vertices, after the hull in
    O(n log n). Nested polytopes of a body are the hierarchies of D. Dobkin and D. Kirkpatrick (L. Barba and S.
    Langerman, "Optimal detection of intersections between convex polyhedra", section 4); their levels are chosen for
    queries, and lie two to four times as far from the body at the same size (docs/nested_hulls.md).
    """
    checked_shape("nested_hulls: shape", shape)
    sizes = _checked_sizes(sizes)
    body = BodyHull(_points_of(shape))
    outers = _proven_outer(body, [size for size in sizes if size < body.n_facets])
    made: list[NestedHull] = []
    for size, rows in zip(sizes, inner_vertices(body, sizes)):
        planes = body.n_facets if body.n_facets <= size else max(n for n in outers if n <= size)
        if made and (planes, len(rows)) == (made[-1].planes, len(made[-1].inner.points)):
            made.append(made[-1]._replace(size=size))
        else:
            corners = outers.get(planes, body.vertices)
            made.append(_level(size, ConvexHull(corners), planes, ConvexHull(body.vertices[rows]), body))
    return tuple(made)


def _level(size: int, outer: ConvexHull, planes: int, inner: ConvexHull, body: BodyHull) -> NestedHull:
    between = rows_beside(inner, outer.points)
    return NestedHull(
        size, outer, planes, inner, _largest(body.nearest(outer.points)["upper"]),
        _largest(rows_beside(inner, body.vertices)["upper"]), (_largest(between["lower"]), _largest(between["upper"])),
    )


def _largest(distances: np.ndarray) -> float:
    """0 where all points are inside."""
    return max(0.0, float(distances.max()))


def _proven_outer(body: BodyHull, sizes: list[int]) -> dict[int, np.ndarray]:
    """Number of planes → corners; each body contains the next, the last contains the hull, proven."""
    margin = FIRST_MARGIN
    for _ in range(_TRIES):
        outers = outer_corners(body, sizes, margin)
        within = [*outers.values(), body.vertices]
        if all(_contains(outer, inner) for outer, inner in pairwise(within)):
            return outers
        margin *= _WIDER
    raise AssertionError("nested_hulls: no planes are proven to contain the body; please report it")


def _contains(outer: np.ndarray, inner: np.ndarray) -> bool:
    """Whether the hull of points is proven to contain others: their common hull, exact, has vertices of these alone."""
    return bool((convex_hull(np.concatenate([outer, inner])).vertices < len(outer)).all())


def _points_of(shape: Shape) -> np.ndarray:
    if isinstance(shape, Mesh):
        return shape.vertices
    if isinstance(shape, PointCloud) and not np.any(shape.radius):
        return shape.points
    if is_single_convex(shape) and not isinstance(shape, HPolytope):
        packed = convex_set_of(shape)
        if packed.kind == POINTS and packed.radius == 0.0:
            return packed.points
    raise UnsupportedQuery(
        f"nested_hulls: {type(shape).__name__} is no set of points: take a ConvexHull without a radius, a Box, a Mesh "
        "or a PointCloud without radii; of other shapes, ConvexHull(collide.tessellate(shape, tolerance=…).vertices)"
    )


def _checked_sizes(sizes: Sequence[int]) -> list[int]:
    entries = checks.listed_entries("nested_hulls: sizes", sizes, "numbers of planes, such as [16, 64]")
    checked = [checks.integer(f"nested_hulls: sizes[{k}]", size, _LEAST) for k, size in enumerate(entries)]
    if not checked or sorted(set(checked)) != checked:
        raise InvalidArgument(f"nested_hulls: sizes must ascend, one or more, got {checks.brief(sizes)}")
    return checked
