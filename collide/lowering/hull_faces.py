"""Faces of a polytope as contacts need them, made by `hull_polygons.py` when first asked for, and kept."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.hull_polygons import FACE_INTS, LARGEST, N_DOUBLES, faces_memory, keep_faces, make_faces
from collide.lowering.packed_convex import POINTS, PackedConvex, on_cache_lines
from collide.lowering.shape_table import ShapeTable

# One row of integers a shape: counts, then addresses of the arrays of `HullFaces`.
(
    N_VERTICES, PADDED, N_FACES, COLUMNS_AT, VERTEX_IDS_AT, NORMALS_AT, FLATNESS_AT, TRIANGLES_AT, STARTS_AT,
    CORNERS_AT, EDGES_AT, FACE_OF_AT, FAN_STARTS_AT, FANS_AT,
) = range(14)


class HullFaces(NamedTuple):
    """The polygons around a hull of n points; ids are rows of the points. A segment has a single polygon, of two
    corners, and so has a hull of slivers alone.

    Vertices of two faces alone, on the line between their neighbours but for rounding, are left out: an edge has two
    ends.

    columns : (3, m) coordinates of the vertices, axis by axis, m a multiple of BLOCK, filled up with the first.
    vertex_ids : (h,) their ids.
    normals : (f, 3) unit normals, outward; 0 of a segment, and of slivers that no face takes in.
    flatness : (f,) how far the face's points are from the polygon's plane and edges at most, measured [m].
    triangles : (f,) the first of the face's triangles in the hull (`exact_hull.convex_hull`).
    starts : (f + 1,) where the corners of a face begin.   corners : ids, counter-clockwise seen from outside.
    edges : number of the edge from each corner to the next, the same from both of its faces.
    face_of : the face of each corner.
    fan_starts : (n + 1,) where the fan of a vertex begins.   fans : places among ``corners``.
    largest : most corners of a face.
    """

    columns: np.ndarray
    vertex_ids: np.ndarray
    normals: np.ndarray
    flatness: np.ndarray
    triangles: np.ndarray
    starts: np.ndarray
    corners: np.ndarray
    edges: np.ndarray
    face_of: np.ndarray
    fan_starts: np.ndarray
    fans: np.ndarray
    largest: int


class KeptFaces(NamedTuple):
    """The same in one block of memory.

    block : what the addresses are of.   row : FACE_INTS integers.   largest : most corners of a face.
    """

    block: np.ndarray
    row: np.ndarray
    largest: int

    @property
    def arrays(self) -> HullFaces:
        """Views of the block."""
        ids, padded, faces = self.row[:COLUMNS_AT].tolist()
        places = ((self.row[COLUMNS_AT:] - address_of(self.block)) // 8).tolist()
        block, integers = self.block, self.block.view(np.int64)
        columns, ids_at, normals, flatness = places[:4]
        return HullFaces._make((
            block[columns:ids_at].reshape(3, padded), integers[ids_at : ids_at + ids],
            block[normals : normals + 3 * faces].reshape(faces, 3), block[flatness : flatness + faces],
            *(integers[i:j] for i, j in zip(places[4:], [*places[5:], len(block)])), self.largest,
        ))


def kept_faces(points: np.ndarray) -> KeptFaces:
    """Faces of the hull of points (n, 3). O(n log n)."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    n, points_at = len(points), address_of(points)
    memory = np.empty(faces_memory(n) // 8, dtype=np.int64)
    memory_at = address_of(memory)
    if make_faces(points_at, n, memory_at) < 0:
        raise AssertionError("quickhull: the rim of a visible region is no simple cycle")
    block, row = on_cache_lines(memory.item(N_DOUBLES)), np.empty(FACE_INTS, dtype=np.int64)
    keep_faces(points_at, n, memory_at, address_of(block), address_of(row))
    return KeptFaces(block, row, memory.item(LARGEST))


def hull_faces(points: np.ndarray) -> HullFaces:
    """Faces of the hull of points (n, 3). O(n log n)."""
    return kept_faces(points).arrays


def faces_of(packed: PackedConvex) -> KeptFaces:
    """The faces of a packed set of points, made when first asked for and kept with it."""
    made = packed.prepared.made
    return made["faces"] if "faces" in made else made.setdefault("faces", kept_faces(packed.points))


class HullFaceTable:
    """A row of FACE_INTS integers a convex set, as kernels read them; 0 of sets other than hulls of points, and of
    those not made yet.

    largest : most corners of a face of these sets, at least as many as a curved set's end has (`support_face.py`).
    """

    def __init__(self, packed: Sequence[PackedConvex], least: int):
        self.ints = np.zeros((len(packed), FACE_INTS), dtype=np.int64)
        self.faces: list[KeptFaces | None] = [None] * len(packed)
        self.largest, self._packed = least, packed

    def make(self, rows: Iterable[int]) -> HullFaceTable:
        """Itself, with the faces of these sets."""
        for k in rows:
            packed = self._packed[k]
            if packed.kind == POINTS and self.faces[k] is None:
                self.faces[k] = faces = faces_of(packed)
                self.ints[k] = faces.row
                self.largest = max(self.largest, faces.largest)
        return self


def face_table_of(table: ShapeTable, least: int) -> HullFaceTable:
    """The faces of a table's sets, made when first asked for and kept with it."""
    if table.faces is None:
        table.faces = HullFaceTable(table.packed, least).make(range(len(table.packed)))
    return table.faces
