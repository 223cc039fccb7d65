"""Faces of a polytope as contacts need them: polygons of coplanar hull triangles, and which faces meet at a vertex.

`native/capi_faces.c` does the same to the last bit: sums of products go from left to right, by no library's routine.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull, convex_hull
from collide.kernels import address_of
from collide.lowering.packed_convex import BLOCK, POINTS, PackedConvex, on_cache_lines
from collide.lowering.shape_table import ShapeTable

#: Neighbouring triangles are one face where neither leaves the other's plane by more than this part of the size: points
#: that were coplanar before they were turned and rounded are taken as coplanar, and how far they are off is measured.
_COPLANAR = 2.0**-46

# One row of integers a shape: counts, then addresses of the arrays of `HullFaces`.
(
    N_VERTICES, PADDED, N_FACES, COLUMNS_AT, VERTEX_IDS_AT, NORMALS_AT, FLATNESS_AT, TRIANGLES_AT, STARTS_AT,
    CORNERS_AT, EDGES_AT, FACE_OF_AT, FAN_STARTS_AT, FANS_AT,
) = range(14)  # fmt: skip
FACE_INTS = 14


class HullFaces(NamedTuple):
    """The polygons that bound a hull of n points; ids are rows of those points. Of a segment, one polygon of two.

    columns : (3, m) coordinates of the vertices, axis by axis, m a multiple of BLOCK, filled up with the first.
    vertex_ids : (h,) their ids.
    normals : (f, 3) unit normals, outward; 0 of a segment.
    flatness : (f,) how far corners are from a plane across the normal, at most [m].
    triangles : (f,) the first of the hull's triangles (`exact_hull.convex_hull`) that makes up the face.
    starts : (f + 1,) where the corners of a face begin.   corners : ids, counter-clockwise seen from outside.
    edges : number of the edge from each corner to the next, the same from both of its faces.
    face_of : the face of each corner.
    fan_starts : (n + 1,) where the fan of a vertex begins.   fans : places among ``corners``.
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


def hull_faces(points: np.ndarray) -> HullFaces:
    """Faces of the hull of points (n, 3). O(n log n)."""
    hull = convex_hull(points)
    facets = hull.facets.astype(np.int64)
    if hull.dimension < 2:
        loops = [_ends(points, hull)] if hull.dimension else []
        faces = loops, np.zeros((len(loops), 3)), np.zeros(len(loops)), np.full(len(loops), -1)
    elif hull.dimension == 2:
        faces = _two_sides(points, facets)
    else:
        faces = _merged(points, facets)
    return _linked(points, hull, *faces)


def _ends(points: np.ndarray, hull: Hull) -> np.ndarray:
    """The two ends of a segment."""
    some = hull.vertices.astype(np.int64)
    axis = int(np.argmax(np.ptp(points[some], axis=0)))
    along = points[some, axis]
    return some[[int(np.argmin(along)), int(np.argmax(along))]]


def _two_sides(points: np.ndarray, facets: np.ndarray):
    """A flat hull's polygon, and the same seen from behind: the second half of its triangles mirrors the first."""
    front = facets[: len(facets) // 2]
    loop = _boundary(front)
    assert loop is not None, "a flat hull is one polygon"
    normals, areas = _normals(points[front])
    widest = int(np.argmax(areas))
    off = np.abs(((points[loop] - points[front[widest, 0]]) * normals[widest]).sum(axis=1)).max()
    both = np.stack([normals[widest], -normals[widest]])
    return [loop, loop[::-1]], both, np.array([off, off]), np.array([0, len(front)])


def _normals(T: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit normals and twice the areas of triangles (k, 3, 3)."""
    n = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
    areas = np.sqrt(np.square(n).sum(axis=1))
    return n / np.where(areas > 0.0, areas, 1.0)[:, None], areas


def _merged(points: np.ndarray, facets: np.ndarray):
    """(loops, unit normals, flatness, first triangles) of faces."""
    T = points[facets]
    units, areas = _normals(T)
    tolerance = _COPLANAR * float(np.abs(T - T[0, 0]).max())
    face_of = _components(T, units, areas, _twins(facets), tolerance)
    order = np.argsort(face_of, kind="stable")
    loops, normals, flatness, triangles = [], [], [], []
    for members in np.split(order, np.flatnonzero(np.diff(face_of[order])) + 1):
        loop = facets[members[0]] if len(members) == 1 else _boundary(facets[members])
        widest = members[int(np.argmax(areas[members]))]
        off = np.abs(((T[members] - T[widest, 0]) * units[widest]).sum(axis=2)).max()
        if loop is None or off > 4.0 * tolerance:  # no polygon, or curved: its triangles are faces each
            for k in members:
                loops.append(facets[k])
                normals.append(units[k])
                flatness.append(tolerance)
                triangles.append(k)
            continue
        loops.append(loop)
        normals.append(units[widest])
        flatness.append(off)
        triangles.append(members[0])
    return loops, np.array(normals), np.array(flatness), np.array(triangles)


def _twins(facets: np.ndarray) -> np.ndarray:
    """(3 f,) of the edge from corner k of each triangle to the next the same edge of its neighbour, other way round."""
    tail, head = facets.ravel(), facets[:, [1, 2, 0]].ravel()
    size = int(facets.max()) + 1
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward, kind="stable")
    return order[np.searchsorted(forward, backward, sorter=order)]


def _components(T: np.ndarray, units: np.ndarray, areas: np.ndarray, twins: np.ndarray, tolerance: float) -> np.ndarray:
    """(f,) the least triangle of the face of each: neighbours joined where coplanar."""
    a = np.repeat(np.arange(len(T)), 3)
    b = twins // 3
    larger, smaller = np.where(areas[a] >= areas[b], a, b), np.where(areas[a] >= areas[b], b, a)
    off = np.abs(((T[smaller] - T[larger, 0][:, None]) * units[larger][:, None]).sum(axis=2)).max(axis=1)
    flat = (off <= tolerance) & ((units[a] * units[b]).sum(axis=1) > 0.0) & (a < b)
    parent = list(range(len(T)))

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    for i, j in zip(a[flat].tolist(), b[flat].tolist()):
        i, j = root(i), root(j)
        parent[max(i, j)] = min(i, j)
    return np.array([root(k) for k in range(len(T))])


def _boundary(facets: np.ndarray) -> np.ndarray | None:
    """The corners around a patch of triangles; None where that is no simple loop."""
    edges = {(int(t[k]), int(t[(k + 1) % 3])) for t in facets for k in range(3)}
    rim = [(tail, head) for tail, head in edges if (head, tail) not in edges]
    following = dict(rim)
    if not rim or len(following) < len(rim):
        return None
    start = min(following)
    loop = [start]
    while (corner := following.get(loop[-1], -1)) != start:
        if corner < 0 or len(loop) > len(following):
            return None
        loop.append(corner)
    return np.array(loop) if len(loop) == len(following) else None


def _linked(points: np.ndarray, hull: Hull, loops, normals, flatness, triangles) -> HullFaces:
    lengths = np.array([len(loop) for loop in loops], dtype=np.int64)
    starts = np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64)
    corners = np.concatenate([np.zeros(0, dtype=np.int64), *loops])
    face_of = np.repeat(np.arange(len(loops)), lengths)
    place = np.arange(len(corners))
    following = np.where(place + 1 == starts[face_of + 1], starts[face_of], place + 1) if len(corners) else place
    ends = np.sort(np.stack([corners, corners[following]], axis=1), axis=1)
    edges = np.unique(ends[:, 0] * len(points) + ends[:, 1], return_inverse=True)[1].ravel()
    fans = np.argsort(corners, kind="stable")
    counts = np.bincount(corners, minlength=len(points))
    ids = np.flatnonzero(counts) if len(corners) else hull.vertices[:1].astype(np.int64)
    columns = on_cache_lines(3, -(-len(ids) // BLOCK) * BLOCK)
    columns[:, : len(ids)] = points[ids].T
    columns[:, len(ids) :] = points[ids[0]][:, None]
    integers = (ids, triangles, starts, corners, edges, face_of, np.concatenate([[0], np.cumsum(counts)]), fans)
    ids, triangles, starts, corners, edges, face_of, fan_starts, fans = (
        np.ascontiguousarray(array, dtype=np.int64) for array in integers
    )
    return HullFaces(
        columns, ids, np.ascontiguousarray(normals, dtype=np.float64), np.asarray(flatness, dtype=np.float64),
        triangles, starts, corners, edges, face_of, fan_starts, fans,
    )  # fmt: skip


def faces_of(packed: PackedConvex) -> HullFaces:
    """The faces of a packed set of points, made when first asked for and kept with it."""
    made = packed.prepared.made
    return made["faces"] if "faces" in made else made.setdefault("faces", hull_faces(packed.points))


class HullFaceTable:
    """A row of FACE_INTS integers a convex set, as kernels read them; 0 of sets that are no hulls of points.

    largest : most corners that a face of these has, at least as many as a curved set's end has (`support_face.py`).
    """

    def __init__(self, packed: list[PackedConvex], least: int):
        self.ints = np.zeros((len(packed), FACE_INTS), dtype=np.int64)
        self.faces = [faces_of(p) if p.kind == POINTS else None for p in packed]
        self.largest = least
        for row, faces in zip(self.ints, self.faces):
            if faces is not None:
                row[:COLUMNS_AT] = len(faces.vertex_ids), faces.columns.shape[1], len(faces.triangles)
                row[COLUMNS_AT:] = [address_of(array) for array in faces]
                self.largest = max(self.largest, int(np.diff(faces.starts).max(initial=0)))


def face_table_of(table: ShapeTable, least: int) -> HullFaceTable:
    """The faces of a table's sets, made when first asked for and kept with it."""
    if table.faces is None:
        table.faces = HullFaceTable(table.packed, least)
    return table.faces
