"""The shapes of a drawing: triangles and points as text, once for all bodies of a shape, large meshes simplified.

A shape is drawn in the frame B of its body, in single precision. Triangles of shapes come from `collide.tessellate`;
clouds are points (`drawn_points.py`).
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.pages import drawn_points
from collide.pages.drawn_points import MAX_POINTS, Points, as_base64
from collide.pages.vertex_clustering import simplified
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.hpolytope import HPolytope
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Box, Halfspace
from collide.shapes.shape import Shape
from collide.shapes.tessellation import tessellate

#: Facets that a page holds, of all its shapes: larger meshes are drawn with fewer. 24 bytes a facet in the file.
MAX_FACETS = 120_000
#: Meshes of so few are drawn whole, unless there are thousands of them.
_SMALL = 1_000
#: Even of small ones a page holds no more.
_ALL_FACETS = 1_000_000
#: Coordinates beyond are drawn there [m]: single precision ends at 3.4e38.
_LARGEST = 1e30

#: A shape, and its pose X_BS in the frame of its body.
PosedShape = tuple[Shape, np.ndarray]


class Drawn(NamedTuple):
    """A shape before writing: vertices (V, 3) in B [m], faces (F, 3), their distance from the shape [m], its look, and
    the balls of its clouds."""

    vertices: np.ndarray
    faces: np.ndarray
    deviation: float
    smooth: bool
    unbounded: bool
    points: Points | None = None


class ShapeTable:
    """The shapes of one page, gathered first, written together: how much each may take depends on all of them.

    size : edge length of what stands for a body without end [m]: a square for a half-space, a box around a region.
    max_facets : see `MAX_FACETS`.
    """

    def __init__(self, size: float, max_facets: int = MAX_FACETS):
        self._size, self._max_facets = size, max_facets
        self._rows: dict[tuple, int] = {}
        self._of_bytes: dict[bytes, int] = {}
        self._seen: list[Sequence[PosedShape]] = []  # kept alive, so that no other shape gets the id of a seen shape
        self._shapes: list[Drawn] = []

    def row(self, shapes: Sequence[PosedShape]) -> int:
        """The row of what several posed shapes look like together; the same for the same ones, or equal looks."""
        key = tuple((id(shape), X_BS.tobytes()) for shape, X_BS in shapes)
        if key not in self._rows:
            self._seen.append(shapes)
            self._rows[key] = self._new_row(drawn(shapes, self._size))
        return self._rows[key]

    def _new_row(self, drawn: Drawn) -> int:
        flags = np.array((drawn.smooth, drawn.unbounded, len(drawn.vertices), len(drawn.faces)))
        made = hashlib.sha256()
        for array in (flags, drawn.vertices, drawn.faces, *(drawn.points or ())):
            made.update(array.tobytes())
        digest = made.digest()
        if digest not in self._of_bytes:
            self._of_bytes[digest] = len(self._shapes)
            self._shapes.append(drawn)
        return self._of_bytes[digest]

    def boxes(self) -> list[np.ndarray | None]:
        """(2, 3) lowest and highest corner of each shape in its frame [m]; None of unbounded and of empty ones."""
        return [None if drawn.unbounded else _box(drawn) for drawn in self._shapes]

    def is_empty(self, row: int) -> bool:
        """Whether a shape has neither triangles nor points: a segment, or what cannot be tessellated."""
        return not len(self._shapes[row].faces) and self._shapes[row].points is None

    def written(self) -> list[dict]:
        """The table as plain data, simplified to about ``max_facets`` facets."""
        cap = facet_cap([len(drawn.faces) for drawn in self._shapes], self._max_facets)
        sizes = sorted(len(drawn.points.centres) for drawn in self._shapes if drawn.points is not None)
        return [_written(drawn, cap, max(_level(sizes, MAX_POINTS), 1)) for drawn in self._shapes]


def drawn(shapes: Sequence[PosedShape], size: float) -> Drawn:
    """What posed shapes look like together; empty of what has neither triangles nor points.   size : see `ShapeTable`.
    """
    vertices, faces, deviations, n = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], [0.0], 0
    clouds = []
    for shape, X_BS in shapes:
        if isinstance(shape, PointCloud):
            clouds.append(Points(shape.points @ X_BS[:3, :3].T + X_BS[:3, 3], shape.radii))
            continue
        try:
            points, corners = made = tessellate(shape, size=size)
        except (InvalidArgument, UnsupportedQuery):  # no triangles of its kind, or too many
            continue
        vertices.append(points @ X_BS[:3, :3].T + X_BS[:3, 3])
        faces.append(np.asarray(corners, dtype=np.int64) + n)
        deviations.append(made.deviation)
        n += len(points)
    return Drawn(
        np.concatenate(vertices), np.concatenate(faces), max(deviations), any(is_smooth(shape) for shape, _ in shapes),
        any(isinstance(shape, Halfspace) or shape.is_region for shape, _ in shapes), drawn_points.together(clouds),
    )


def is_smooth(shape: Shape) -> bool:
    """Whether facets stand for something round, or are so many that they do: all but flat-sided convex shapes."""
    if hasattr(shape, "items"):
        return any(is_smooth(part) for part, _ in shape.items)
    if isinstance(shape, (ConvexHull, HPolytope)):
        return bool(getattr(shape, "radius", 0.0))
    return not isinstance(shape, (Box, Halfspace))


def facet_cap(counts: Iterable[int], max_facets: int = MAX_FACETS) -> int:
    """The most facets a shape may have, so that all take ``max_facets``; small shapes stay whole, below a million."""
    counts = sorted(counts)
    return max(_level(counts, max_facets), min(_SMALL, _level(counts, max(max_facets, _ALL_FACETS))))


def _level(counts: list[int], total: int) -> int:
    """The largest cap with sum(min(count, cap)) ≤ total; counts are sorted."""
    for k, count in enumerate(counts):
        share = total // (len(counts) - k)
        if count > share:
            return max(share, 1)
        total -= count
    return counts[-1] if counts else 0


def _box(drawn: Drawn) -> np.ndarray | None:
    ends = np.concatenate([drawn.vertices, *([] if drawn.points is None else [drawn.points.box])])
    return np.array([ends.min(axis=0), ends.max(axis=0)]) if len(ends) else None


def _written(drawn: Drawn, cap: int, max_points: int) -> dict:
    vertices, faces, moved = simplified(drawn.vertices, drawn.faces, max(cap, 1))
    positions = np.clip(vertices, -_LARGEST, _LARGEST).astype("<f4")
    points, off = (None, 0.0) if drawn.points is None else drawn_points.written(drawn.points, max_points)
    return {
        "positions": as_base64(positions),
        "triangles": as_base64(faces.astype("<u4")),
        "vertex_count": len(vertices),
        "triangle_count": len(faces),
        "smooth": drawn.smooth,
        "simplified_from": len(drawn.faces) if len(faces) < len(drawn.faces) else None,
        "deviation": max(float(drawn.deviation + moved), off),
        "unbounded": drawn.unbounded,
        "points": points,
    }
