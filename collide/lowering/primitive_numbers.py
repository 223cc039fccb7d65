"""The eight numbers of a convex set; no shape and no kernel is imported."""

from __future__ import annotations

#: A set by eight numbers: its kind; how many core points; the radius of the ball swept over the core; the reach of a
#: curved core, 0 of others; then half sizes of the box whose corners the points are (`convex_sets.corners_of`), or the
#: four numbers of a set of another kind (`packed_convex.PackedConvex`).
PrimitiveNumbers = tuple[int, int, float, float, float, float, float, float]
