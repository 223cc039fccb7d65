"""Faces of a polytope as contacts need them: polygons of coplanar hull triangles, and which faces meet at a vertex.

`native/capi_faces.c` does the same to the last bit: sums of products go from left to right, by no library's routine.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull, convex_hull
from collide.kernels import address_of
from collide.lowering.packed_convex import BLOCK, POINTS, PackedConvex, on_cache_lines
from collide.lowering.shape_table import ShapeTable

#: Neighbouring triangles are one face where neither leaves the other's plane by more than this part of the size: points
#: that were coplanar before they were turned and rounded are taken as coplanar, and how far they are off is measured.
#: Triangles no wider are slivers: the normal of one may be any vector across its longest side.
_COPLANAR = 2.0**-46
#: Of the square of its longest side: triangles of less than so much of it, twice their area, have their normals made
#: perpendicular to that side. A product of sides of length l is off by 2⁻⁵²·l² any way, the normal by l/width ulps:
#: along the side that takes corners off the plane, about it by no more than an ulp of l.
_THIN = 2.0**-6

# One row of integers a shape: counts, then addresses of the arrays of `HullFaces`.
(
    N_VERTICES, PADDED, N_FACES, COLUMNS_AT, VERTEX_IDS_AT, NORMALS_AT, FLATNESS_AT, TRIANGLES_AT, STARTS_AT,
    CORNERS_AT, EDGES_AT, FACE_OF_AT, FAN_STARTS_AT, FANS_AT,
) = range(14)
FACE_INTS = 14


class HullFaces(NamedTuple):
    """The polygons that bound a hull of n points; ids are rows of those points. Of a segment, one polygon of two, and
    so of a hull all of whose triangles are slivers.

    Vertices that two faces share alone, and that lie on the line between their neighbours but for rounding, are left
    out: an edge has two ends.

    columns : (3, m) coordinates of the vertices, axis by axis, m a multiple of BLOCK, filled up with the first.
    vertex_ids : (h,) their ids.
    normals : (f, 3) unit normals, outward; 0 of a segment, and of slivers that no face takes in.
    flatness : (f,) how far the hull's points there are from the polygon's plane and edges at most, measured [m].
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
    triangles = _Triangles.of(points, hull)
    if not triangles.wide.any():
        faces = _segment(points, hull.vertices.astype(np.int64))
    else:
        flat = hull.dimension == 2
        loops, normals, flatness, firsts = (_two_sides if flat else _merged)(points, triangles)
        loops, flatness = _straightened(points, loops, flatness, triangles.tolerance)
        faces = loops, normals, flatness, firsts
    return _linked(points, hull, *faces)


class _Triangles(NamedTuple):
    """Triangles of a hull: corners (k, 3) by id and (k, 3, 3), unit normals, twice the areas, the longest side of each,
    whether a triangle is no sliver; and what length counts as rounding [m]."""

    facets: np.ndarray
    T: np.ndarray
    units: np.ndarray
    areas: np.ndarray
    longest: np.ndarray
    wide: np.ndarray
    tolerance: float

    @staticmethod
    def of(points: np.ndarray, hull: Hull) -> _Triangles:
        facets = hull.facets.astype(np.int64) if hull.dimension > 1 else np.zeros((0, 3), dtype=np.int64)
        T = points[facets]
        tolerance = _COPLANAR * float(np.abs(T - T[0, 0]).max()) if len(T) else 0.0
        n = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
        areas = np.sqrt(np.square(n).sum(axis=1))
        sides = T[:, [1, 2, 0]] - T
        squares = np.square(sides).sum(axis=2)
        longest = np.argmax(squares, axis=1) if len(T) else np.zeros(0, dtype=np.int64)
        square = squares.max(axis=1, initial=0.0)
        wide = areas > tolerance * np.sqrt(square)
        n /= np.where(areas > 0.0, areas, 1.0)[:, None]
        thin = wide & (areas < _THIN * square)
        e, u = sides[thin, longest[thin]], n[thin]
        u = u - ((u * e).sum(axis=1) / square[thin])[:, None] * e
        n[thin] = u / np.sqrt(np.square(u).sum(axis=1))[:, None]
        return _Triangles(facets, T, n, areas, longest, wide, tolerance)

    def off_plane(self, members: np.ndarray, plane: int) -> float:
        """How far the corners of some triangles are from the plane of one [m]."""
        return float(np.abs(((self.T[members] - self.T[plane, 0]) * self.units[plane]).sum(axis=2)).max())


def _segment(points: np.ndarray, some: np.ndarray):
    """The two ends of a hull that is a line but for rounding, as its one face; none of a single point."""
    if len(some) < 2:
        return [], np.zeros((0, 3)), np.zeros(0), np.zeros(0)
    axis = int(np.argmax(np.ptp(points[some], axis=0)))
    along = points[some, axis]
    ends = some[[int(np.argmin(along)), int(np.argmax(along))]]
    p, q = (points[k].tolist() for k in ends)
    off = max(_off_line(points[k].tolist(), p, q) for k in some.tolist())
    return [ends], np.zeros((1, 3)), np.array([off]), np.array([-1])


def _off_line(v: list[float], p: list[float], q: list[float]) -> float:
    """How far a point is from the line between two others [m]."""
    w, e = [v[0] - p[0], v[1] - p[1], v[2] - p[2]], [q[0] - p[0], q[1] - p[1], q[2] - p[2]]
    square = e[0] * e[0] + e[1] * e[1] + e[2] * e[2]
    t = (w[0] * e[0] + w[1] * e[1] + w[2] * e[2]) / square if square > 0.0 else 0.0
    t = min(max(t, 0.0), 1.0)
    x, y, z = w[0] - t * e[0], w[1] - t * e[1], w[2] - t * e[2]
    return math.sqrt(x * x + y * y + z * z)


def _two_sides(points: np.ndarray, triangles: _Triangles):
    """A flat hull's polygon, and the same seen from behind: the second half of its triangles mirrors the first."""
    n = len(triangles.facets) // 2
    loop = _boundary(triangles.facets[:n])
    assert loop is not None, "a flat hull is one polygon"
    widest = int(np.argmax(triangles.areas[:n]))
    off = triangles.off_plane(np.arange(n), widest)
    normal = triangles.units[widest]
    return [loop, loop[::-1]], np.stack([normal, -normal]), np.array([off, off]), np.array([0, n])


def _merged(points: np.ndarray, triangles: _Triangles):
    """(loops, unit normals, flatness, first triangles) of faces."""
    facets = triangles.facets
    face_of = _components(triangles, _twins(facets))
    order = np.argsort(face_of, kind="stable")
    loops, normals, flatness, firsts = [], [], [], []
    for members in np.split(order, np.flatnonzero(np.diff(face_of[order])) + 1):
        loop = facets[members[0]] if len(members) == 1 else _boundary(facets[members])
        widest = members[int(np.argmax(triangles.areas[members]))]
        if loop is None or triangles.off_plane(members, widest) > 4.0 * triangles.tolerance:
            pieces = [(facets[k], np.array([k])) for k in members]  # no polygon, or curved: a face each
        else:
            pieces = [(loop, members)]
        for loop, some in pieces:
            widest = some[int(np.argmax(triangles.areas[some]))]
            is_wide = bool(triangles.wide[widest])
            loops.append(loop)
            normals.append(triangles.units[widest] if is_wide else np.zeros(3))
            flatness.append(triangles.off_plane(some, widest) if is_wide else 0.0)
            firsts.append(some[0])
    return loops, np.array(normals), np.array(flatness), np.array(firsts)


def _twins(facets: np.ndarray) -> np.ndarray:
    """(3 f,) of the edge from corner k of each triangle to the next the same edge of its neighbour, other way round."""
    tail, head = facets.ravel(), facets[:, [1, 2, 0]].ravel()
    size = int(facets.max()) + 1
    forward, backward = tail * size + head, head * size + tail
    order = np.argsort(forward, kind="stable")
    return order[np.searchsorted(forward, backward, sorter=order)]


def _components(triangles: _Triangles, twins: np.ndarray) -> np.ndarray:
    """(f,) the least triangle of the face of each: neighbours joined where coplanar.

    A sliver joins one face beside it, whose plane its corners do not leave, and so never two of them.
    """
    T, units, areas, wide, tolerance = (
        triangles.T, triangles.units, triangles.areas, triangles.wide, triangles.tolerance,
    )
    a = np.repeat(np.arange(len(T)), 3)
    b = twins // 3
    larger, smaller = np.where(areas[a] >= areas[b], a, b), np.where(areas[a] >= areas[b], b, a)
    off = np.abs(((T[smaller] - T[larger, 0][:, None]) * units[larger][:, None]).sum(axis=2)).max(axis=1)
    flat = (off <= tolerance) & ((units[a] * units[b]).sum(axis=1) > 0.0) & (a < b) & wide[a] & wide[b]
    parent = list(range(len(T)))

    def root(k: int) -> int:
        while parent[k] != k:
            parent[k] = parent[parent[k]]
            k = parent[k]
        return k

    def join(i: int, j: int) -> None:
        i, j = root(i), root(j)
        parent[max(i, j)] = min(i, j)

    for i, j in zip(a[flat].tolist(), b[flat].tolist()):
        join(i, j)
    plane_of = np.where(wide, np.arange(len(T)), -1).tolist()
    remaining = np.flatnonzero(~wide).tolist()
    while remaining:
        still = []
        for k in remaining:
            for side in range(3):
                beside = int(b[3 * k + (int(triangles.longest[k]) + side) % 3])
                plane = plane_of[beside]
                if plane >= 0 and triangles.off_plane(np.array([k]), plane) <= tolerance:
                    plane_of[k] = plane
                    join(k, beside)
                    break
            else:
                still.append(k)
        if len(still) == len(remaining):
            break
        remaining = still
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


def _straightened(points: np.ndarray, loops, flatness: np.ndarray, tolerance: float):
    """(loops, flatness) without corners of two faces alone that lie on the line between their neighbours, but for
    rounding.

    What was left out before lies within ``bent`` of a side that the corner ends, and the side within the corner's
    distance of the new one, of which it has one end: the new one is off all by no more than the sum.
    """
    corners = np.concatenate(loops).astype(np.int64)
    lengths = np.array([len(loop) for loop in loops])
    face_of = np.repeat(np.arange(len(loops)), lengths).tolist()
    counts = np.bincount(corners)
    if not (counts == 2).any():
        return loops, flatness
    starts = np.cumsum(lengths) - lengths
    place = np.arange(len(corners))
    ahead, behind = place + 1, place - 1
    ahead[starts + lengths - 1], behind[starts] = starts, starts + lengths - 1
    ahead, behind, sizes = ahead.tolist(), behind.tolist(), lengths.tolist()
    bent, flatness, ids = [0.0] * len(corners), flatness.copy(), corners.tolist()
    order = np.argsort(corners, kind="stable")
    first = np.cumsum(counts) - counts
    for v in np.flatnonzero(counts == 2).tolist():
        i, j = int(order[first[v]]), int(order[first[v] + 1])
        p, q = ids[behind[i]], ids[ahead[i]]
        if ids[ahead[j]] != p or ids[behind[j]] != q or min(sizes[face_of[i]], sizes[face_of[j]]) <= 3:
            continue
        off = _off_line(points[v].tolist(), points[p].tolist(), points[q].tolist()) + max(bent[behind[i]], bent[i])
        if off > tolerance:
            continue
        for at in (i, j):
            bent[behind[at]] = off
            ahead[behind[at]], behind[ahead[at]] = ahead[at], behind[at]
            sizes[face_of[at]] -= 1
            flatness[face_of[at]] = max(flatness[face_of[at]], off)
            ids[at] = -1
    remaining = np.array(ids)
    loops = [remaining[s : s + n] for s, n in zip(starts, lengths)]
    return [loop[loop >= 0] for loop in loops], flatness


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
    )


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
