"""Polygons of coplanar hull triangles, and the polygons at each vertex, in kernels: what `hull_faces.py` keeps.

Python and C (`native/capi_faces.c`) call the two entries in turn: `make_faces` works in the caller's memory, and tells
how many bytes to keep; `keep_faces` writes the faces into a block, and where each array stands.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.hull.box_corners import BOX_FACES, are_box_corners, box_corner
from collide.hull.quickhull import (
    FACETS_AT,
    HULL_EACH,
    HULL_FIXED,
    N_FACETS,
    N_VERTICES,
    VERTICES_AT,
    grow_hull,
)
from collide.hull.triangle_neighbours import (
    SIDE_WORDS_FIXED,
    SIDE_WORDS_OF_POINT,
    SIDE_WORDS_OF_TRIANGLE,
    SideWorkspace,
    find_neighbours,
    side_workspace,
)
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.counting_sort import order_by_key
from collide.numerics.vec3 import Vec3, cross, divide, dot, neg, put_vec3, scale, sub, vec3_at

#: Neighbouring triangles are one face where neither leaves the other's plane by more than this part of the size: points
#: that were coplanar before they were turned and rounded are taken as coplanar, and how far they are off is measured.
#: Triangles no wider are slivers: the normal of one may be any vector across its longest side.
_COPLANAR = 2.0**-46
#: Of the square of its longest side: triangles of less than so much of it, twice their area, have their normals made
#: perpendicular to that side. A product of sides of length l is off by 2⁻⁵²·l² any way, the normal by l/width ulps:
#: along the side that takes corners off the plane, about it by no more than an ulp of l.
_THIN = 2.0**-6
#: Coordinates are filled up to a multiple of so many (`packed_convex.BLOCK`).
_BLOCK = 8

#: Integers of a row of a `HullFaceTable`: `hull_faces.py` names their places.
FACE_INTS = 14
#: Integers of the header: how many faces, corners of faces, and vertices that have some; doubles to be kept; most
#: corners of a face.
FACES, CORNERS, IDS, N_DOUBLES, LARGEST = range(5)
_HEADER = 8


class _Making(NamedTuple):
    """A hull's triangles, and the faces made of them: views.

    points, facets, vertices : of the hull of n points.   header : counts of what has been made.
    units, areas, longest : unit normals, twice the areas, and the longest side of each triangle.
    plane_of : the triangle whose plane each is in, −1 of slivers that are in none yet.
    sides : what is across the sides of triangles.   component : the least triangle of the face of each.
    order, starts : triangles by component.   normals ... corners : of faces, as `hull_faces.HullFaces` has them.
    ahead, behind, face_of, sizes, bent : corners of faces, linked, while some are left out (`_straighten`).
    fan_starts, fans, mark : by vertex.
    """

    points: Any
    facets: Any
    vertices: Any
    header: Any
    units: Any
    areas: Any
    longest: Any
    plane_of: Any
    sides: SideWorkspace
    component: Any
    order: Any
    normals: Any
    flatness: Any
    triangles: Any
    starts: Any
    corners: Any
    ahead: Any
    behind: Any
    face_of: Any
    sizes: Any
    bent: Any
    fans: Any
    class_starts: Any
    fan_starts: Any
    mark: Any


@kernel
def _making(points_at, n, memory_at, facets_at, vertices_at):
    """(where all stands in memory, where it ends): a header, the hull, numbers of triangles, of points.

    A hull of n points has fewer than 2 n triangles.
    """
    m = 2 * n + 2
    at = memory_at + 8 * _HEADER + HULL_EACH * n + HULL_FIXED
    units, areas, longest, plane_of, component, order = (
        view_f64(at, 3 * m), view_f64(at + 24 * m, m), view_i64(at + 32 * m, m), view_i64(at + 40 * m, m),
        view_i64(at + 48 * m, m), view_i64(at + 56 * m, m),
    )
    at += 64 * m
    normals, flatness, triangles, starts, corners = (
        view_f64(at, 3 * m), view_f64(at + 24 * m, m), view_i64(at + 32 * m, m), view_i64(at + 40 * m, m),
        view_i64(at + 48 * m, 3 * m),
    )
    at += 72 * m
    ahead, behind, face_of, sizes, bent = (
        view_i64(at, 3 * m), view_i64(at + 24 * m, 3 * m), view_i64(at + 48 * m, 3 * m), view_i64(at + 72 * m, m),
        view_f64(at + 80 * m, 3 * m),
    )
    at += 104 * m
    fans, class_starts, fan_starts, mark = (
        view_i64(at, 3 * m), view_i64(at + 24 * m, m), view_i64(at + 32 * m, n + 1),
        view_i64(at + 32 * m + 8 * n + 8, n + 1),
    )
    at += 32 * m + 16 * n + 16
    making = _Making(
        view_f64(points_at, 3 * n), view_i32(facets_at, 6 * n), view_i32(vertices_at, n), view_i64(memory_at, _HEADER),
        units, areas, longest, plane_of, side_workspace(at, n, m), component, order, normals, flatness, triangles,
        starts, corners, ahead, behind, face_of, sizes, bent, fans, class_starts, fan_starts, mark,
    )
    return making, at + 8 * (SIDE_WORDS_OF_TRIANGLE * m + SIDE_WORDS_OF_POINT * n + SIDE_WORDS_FIXED)


@kernel
def _made(points_at, n, memory_at):
    """The same of a hull that has been made in this memory."""
    hull = view_i64(memory_at + 8 * _HEADER, 4)
    return _making(points_at, n, memory_at, hull[FACETS_AT], hull[VERTICES_AT])[0]


@entry("int64(int64)")
def faces_memory(n):
    """Bytes that `make_faces` works in, of n points."""
    return _making(0, n, 0, 0, 0)[1]


@entry("int64(int64, int64, int64)")
def make_faces(points_at, n, memory_at):
    """Make the faces of the hull of points (n, 3); −1 where `grow_hull` says so, else 0. O(n log n).

    memory : as many bytes as `faces_memory` says, out: what `keep_faces` copies; its header first.
    """
    return find_faces(points_at, n, memory_at)


@kernel
def find_faces(points_at, n, memory_at):
    """`make_faces` for kernels."""
    hull_at = memory_at + 8 * _HEADER
    if are_box_corners(points_at, n):
        _put_box(points_at, n, memory_at)
        return 0
    dimension = grow_hull(points_at, n, hull_at)
    if dimension < 0:
        return -1
    making = _made(points_at, n, memory_at)
    hull, header = view_i64(hull_at, 4), making.header
    for k in range(_HEADER):
        header[k] = 0
    making.starts[0] = 0
    n_triangles = hull[N_FACETS]
    tolerance = _tolerance(making, n_triangles)
    if _put_normals(making, n_triangles, tolerance) == 0:
        _put_segment(making, hull[N_VERTICES])
    else:
        if dimension == 2:
            _put_two_sides(making, n, n_triangles // 2)
        else:
            find_neighbours(making.facets, n, n_triangles, making.sides)
            _join_coplanar(making, n_triangles, tolerance)
            _put_merged(making, n, n_triangles, tolerance)
        _straighten(making, n, tolerance)
    _count(making, n)
    return 0


@kernel
def _put_box(points_at, n, memory_at):
    """The faces of a box, as merging its triangles makes them."""
    hull = view_i64(memory_at + 8 * _HEADER, 4)
    hull[FACETS_AT] = hull[VERTICES_AT] = memory_at  # nobody reads them
    making = _made(points_at, n, memory_at)
    for k in range(_HEADER):
        making.header[k] = 0
    making.starts[0] = 0
    for face in range(BOX_FACES):
        side = 1.0 if face % 2 == 1 else -1.0
        for k in range(4):
            making.corners[4 * face + k] = box_corner(face, k)
        normal = Vec3(side if face < 2 else 0.0, side if face // 2 == 1 else 0.0, side if face > 3 else 0.0)
        _put_face(making, 4, normal, 0.0, 2 * face)
    _count(making, n)


@kernel
def _corner(making, triangle, k):
    return vec3_at(making.points, 3 * making.facets[3 * triangle + k])


@kernel
def _tolerance(making, n_triangles):
    """What length counts as rounding [m]."""
    largest = 0.0
    for k in range(3 * n_triangles):
        off = sub(_corner(making, k // 3, k % 3), _corner(making, 0, 0))
        largest = max(largest, max(abs(off.x), abs(off.y), abs(off.z)))
    return _COPLANAR * largest


@kernel
def _put_normals(making, n_triangles, tolerance):
    """Unit normals, areas, longest sides; returns how many triangles are no slivers."""
    n_wide = 0
    for k in range(n_triangles):
        p, q, r = _corner(making, k, 0), _corner(making, k, 1), _corner(making, k, 2)
        u = cross(sub(q, p), sub(r, p))
        area = math.sqrt(dot(u, u))
        side, longest, square = sub(q, p), 0, dot(sub(q, p), sub(q, p))
        if dot(sub(r, q), sub(r, q)) > square:
            side, longest, square = sub(r, q), 1, dot(sub(r, q), sub(r, q))
        if dot(sub(p, r), sub(p, r)) > square:
            side, longest, square = sub(p, r), 2, dot(sub(p, r), sub(p, r))
        u = divide(u, area if area > 0.0 else 1.0)
        wide = area > tolerance * math.sqrt(square)
        if wide and area < _THIN * square:
            u = sub(u, scale(dot(u, side) / square, side))
            u = divide(u, math.sqrt(dot(u, u)))
        put_vec3(making.units, 3 * k, u)
        making.areas[k] = area
        making.longest[k] = longest
        making.plane_of[k] = k if wide else -1
        n_wide += 1 if wide else 0
    return n_wide


@kernel
def _off_plane(making, triangle, plane):
    """How far the corners of a triangle are from the plane of another [m]."""
    off = 0.0
    for k in range(3):
        away = sub(_corner(making, triangle, k), _corner(making, plane, 0))
        off = max(off, abs(dot(away, vec3_at(making.units, 3 * plane))))
    return off


@kernel
def _all_off_plane(making, first, last, plane):
    """The same of several, by their order."""
    off = 0.0
    for k in range(first, last):
        off = max(off, _off_plane(making, making.order[k], plane))
    return off


# --- triangles of one face ----------------------------------------------------------------------


@kernel
def _root_of(parent, k):
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def _join(parent, a, b):
    i, j = _root_of(parent, a), _root_of(parent, b)
    parent[max(i, j)] = min(i, j)


@kernel
def _are_coplanar(making, a, b, tolerance):
    """Whether the smaller of two neighbours lies in the plane of the larger, and neither is a sliver."""
    if making.plane_of[a] < 0 or making.plane_of[b] < 0:
        return False
    larger, smaller = (a, b) if making.areas[a] >= making.areas[b] else (b, a)
    along = dot(vec3_at(making.units, 3 * a), vec3_at(making.units, 3 * b))
    return _off_plane(making, smaller, larger) <= tolerance and along > 0.0


@kernel
def _join_coplanar(making, n_triangles, tolerance):
    """Name each triangle by the least triangle of its face: neighbours joined where coplanar.

    A sliver joins a single face beside it, whose plane its corners do not leave, and so never joins two faces.
    """
    parent, plane_of = making.component, making.plane_of
    for k in range(n_triangles):
        parent[k] = k
    for side in range(3 * n_triangles):
        neighbour = making.sides.beside[side]
        if side // 3 < neighbour and _are_coplanar(making, side // 3, neighbour, tolerance):
            _join(parent, side // 3, neighbour)
    joined = 1
    while joined > 0:
        joined = 0
        for k in range(n_triangles):
            for side in range(3):
                plane = plane_of[making.sides.beside[3 * k + (making.longest[k] + side) % 3]]
                if plane_of[k] < 0 and plane >= 0 and _off_plane(making, k, plane) <= tolerance:
                    plane_of[k] = plane
                    _join(parent, k, making.sides.beside[3 * k + (making.longest[k] + side) % 3])
                    joined += 1
    for k in range(n_triangles):
        parent[k] = _root_of(parent, k)


@kernel
def _put_boundary(making, first, last):
    """Append the corners around the triangles of a component to the corners of all faces, from the least on.

    Returns how many; 0 where they are no simple loop.
    """
    facets, following, loop, at = making.facets, making.mark, making.corners, making.header[CORNERS]
    component = making.component[making.order[first]]
    n_rim = 0
    least = -1
    is_simple = True
    for i in range(first, last):
        triangle = making.order[i]
        for k in range(3):
            neighbour = making.sides.beside[3 * triangle + k]
            if neighbour < 0 or making.component[neighbour] != component:
                tail = facets[3 * triangle + k]
                is_simple = is_simple and following[tail] < 0
                following[tail] = facets[3 * triangle + (k + 1) % 3]
                least = tail if least < 0 else min(least, tail)
                n_rim += 1
    length = 0
    corner = least
    while is_simple and corner >= 0 and length < n_rim:
        loop[at + length] = corner
        length += 1
        corner = following[corner]
        if corner == least:
            break
    for i in range(first, last):
        for k in range(3):
            following[facets[3 * making.order[i] + k]] = -1
    return length if is_simple and corner == least and length == n_rim else 0


# --- faces --------------------------------------------------------------------------------------


@kernel
def _put_face(making, length, normal, flatness, triangle):
    """A face whose corners stand behind those of the faces before."""
    header = making.header
    face = header[FACES]
    put_vec3(making.normals, 3 * face, normal)
    making.flatness[face] = flatness
    making.triangles[face] = triangle
    header[FACES] += 1
    header[CORNERS] += length
    making.starts[face + 1] = header[CORNERS]


@kernel
def _widest(making, first, last):
    """Of some triangles the one of the largest area, of equal ones the first."""
    widest = making.order[first]
    for k in range(first + 1, last):
        if making.areas[making.order[k]] > making.areas[widest]:
            widest = making.order[k]
    return widest


@kernel
def _put_piece(making, first, last, length, is_wide):
    """A face of some triangles; a sliver's normal is 0."""
    widest = _widest(making, first, last)
    if is_wide:
        off = _all_off_plane(making, first, last, widest)
        _put_face(making, length, vec3_at(making.units, 3 * widest), off, making.order[first])
    else:
        _put_face(making, length, Vec3(0.0, 0.0, 0.0), 0.0, making.order[first])


@kernel
def _put_triangle_loop(making, triangle):
    for k in range(3):
        making.corners[making.header[CORNERS] + k] = making.facets[3 * triangle + k]
    return 3


@kernel
def _put_merged(making, n, n_triangles, tolerance):
    """Faces of a hull with an inside: triangles of no simple polygon, or of a curved polygon, are a face each."""
    order = making.order
    for k in range(n_triangles):
        making.ahead[k] = k
    order_by_key(making.component, making.ahead, n_triangles, n_triangles, making.class_starts, order)
    for vertex in range(n):
        making.mark[vertex] = -1
    first = 0
    while first < n_triangles:
        last = first + 1
        while last < n_triangles and making.component[order[last]] == making.component[order[first]]:
            last += 1
        if last == first + 1:
            length = _put_triangle_loop(making, order[first])
        else:
            length = _put_boundary(making, first, last)
        widest = _widest(making, first, last)
        if length > 0 and _all_off_plane(making, first, last, widest) <= 4.0 * tolerance:
            _put_piece(making, first, last, length, _is_wide(making, widest, tolerance))
        else:
            for k in range(first, last):
                length = _put_triangle_loop(making, order[k])
                _put_piece(making, k, k + 1, length, _is_wide(making, order[k], tolerance))
        first = last


@kernel
def _is_wide(making, triangle, tolerance):
    """Whether a triangle is no sliver."""
    side = making.longest[triangle]
    along = sub(_corner(making, triangle, (side + 1) % 3), _corner(making, triangle, side))
    return making.areas[triangle] > tolerance * math.sqrt(dot(along, along))


@kernel
def _put_two_sides(making, n, half):
    """A flat hull's polygon, and the same seen from behind: the second half of its triangles mirrors the first."""
    find_neighbours(making.facets, n, half, making.sides)
    for k in range(half):
        making.order[k] = k
        making.component[k] = 0
    for vertex in range(n):
        making.mark[vertex] = -1
    length = _put_boundary(making, 0, half)
    widest = _widest(making, 0, half)
    off = _all_off_plane(making, 0, half, widest)
    normal = vec3_at(making.units, 3 * widest)
    _put_face(making, length, normal, off, 0)
    for k in range(length):
        making.corners[length + k] = making.corners[length - 1 - k]
    _put_face(making, length, neg(normal), off, half)


@kernel
def _put_segment(making, n_vertices):
    """The two ends of a hull on a line but for rounding, as its single face; no face of a single point."""
    points, vertices = making.points, making.vertices
    if n_vertices < 2:
        return
    low = vec3_at(points, 3 * vertices[0])
    high = low
    for k in range(1, n_vertices):
        p = vec3_at(points, 3 * vertices[k])
        low = Vec3(min(low.x, p.x), min(low.y, p.y), min(low.z, p.z))
        high = Vec3(max(high.x, p.x), max(high.y, p.y), max(high.z, p.z))
    extent = sub(high, low)
    axis = 0 if extent.x >= extent.y and extent.x >= extent.z else 1 if extent.y >= extent.z else 2
    first = vertices[0]
    last = vertices[0]
    for k in range(1, n_vertices):
        if points[3 * vertices[k] + axis] < points[3 * first + axis]:
            first = vertices[k]
        if points[3 * vertices[k] + axis] > points[3 * last + axis]:
            last = vertices[k]
    off = 0.0
    for k in range(n_vertices):
        off = max(off, _off_line(making, vertices[k], first, last))
    making.corners[0] = first
    making.corners[1] = last
    _put_face(making, 2, Vec3(0.0, 0.0, 0.0), off, -1)


@kernel
def _off_line(making, vertex, start, end):
    """How far a point is from the line between two others [m]."""
    p = vec3_at(making.points, 3 * start)
    w, e = sub(vec3_at(making.points, 3 * vertex), p), sub(vec3_at(making.points, 3 * end), p)
    square = dot(e, e)
    t = dot(w, e) / square if square > 0.0 else 0.0
    off = sub(w, scale(min(max(t, 0.0), 1.0), e))
    return math.sqrt(dot(off, off))


@kernel
def _straighten(making, n, tolerance):
    """Leave out corners of two faces alone, on the line between their neighbours but for rounding.

    Corners left out before lie within ``bent`` of a side at the corner. This side lies within the corner's distance of
    the new side, since the two share an end: the new side is off all left-out corners by no more than the sum.
    """
    corners, starts, ahead, behind = making.corners, making.starts, making.ahead, making.behind
    face_of, sizes, bent, flatness = making.face_of, making.sizes, making.bent, making.flatness
    fan_starts, fans = making.fan_starts, making.fans
    _put_fans(making, n)
    for face in range(making.header[FACES]):
        sizes[face] = starts[face + 1] - starts[face]
        for k in range(starts[face], starts[face + 1]):
            ahead[k] = k + 1 if k + 1 < starts[face + 1] else starts[face]
            behind[k] = k - 1 if k > starts[face] else starts[face + 1] - 1
            bent[k] = 0.0
    for vertex in range(n):
        if fan_starts[vertex + 1] - fan_starts[vertex] != 2:
            continue
        i, j = fans[fan_starts[vertex]], fans[fan_starts[vertex] + 1]
        p, q = corners[behind[i]], corners[ahead[i]]
        if corners[ahead[j]] != p or corners[behind[j]] != q or min(sizes[face_of[i]], sizes[face_of[j]]) <= 3:
            continue
        off = _off_line(making, vertex, p, q) + max(bent[behind[i]], bent[i])
        if off > tolerance:
            continue
        for side in range(2):
            at = i if side == 0 else j
            bent[behind[at]] = off
            ahead[behind[at]] = ahead[at]
            behind[ahead[at]] = behind[at]
            sizes[face_of[at]] -= 1
            flatness[face_of[at]] = max(flatness[face_of[at]], off)
            corners[at] = -1
    n_corners = 0
    k = 0
    for face in range(making.header[FACES]):
        while k < starts[face + 1]:
            if corners[k] >= 0:
                corners[n_corners] = corners[k]
                n_corners += 1
            k += 1
        starts[face + 1] = n_corners
    making.header[CORNERS] = n_corners


@kernel
def _put_fans(making, n):
    """Name the face of each corner, and put corners in order by their vertices."""
    n_corners = making.header[CORNERS]
    for face in range(making.header[FACES]):
        for k in range(making.starts[face], making.starts[face + 1]):
            making.face_of[k] = face
    for k in range(n_corners):
        making.ahead[k] = k
    order_by_key(making.corners, making.ahead, n_corners, n, making.fan_starts, making.fans)


@kernel
def _count(making, n):
    """How many vertices have corners, how many doubles are to be kept, and the most corners of a face."""
    header = making.header
    _put_fans(making, n)
    for vertex in range(n):
        if making.fan_starts[vertex + 1] > making.fan_starts[vertex]:
            header[IDS] += 1
    header[IDS] = max(header[IDS], 1)
    for face in range(header[FACES]):
        header[LARGEST] = max(header[LARGEST], making.starts[face + 1] - making.starts[face])
    header[N_DOUBLES] = 3 * _padded(header) + header[IDS] + 6 * header[FACES] + 1 + 4 * header[CORNERS] + n + 1


@kernel
def _padded(header):
    return (header[IDS] + _BLOCK - 1) // _BLOCK * _BLOCK


# --- what is kept -------------------------------------------------------------------------------


@entry("void(int64, int64, int64, int64, int64)")
def keep_faces(points_at, n, memory_at, block_at, row_at):
    """Write what `make_faces` left in memory into a block of as many doubles as its header says.

    row : FACE_INTS integers, out: counts, and where each array of `hull_faces.HullFaces` stands in the block.
    """
    copy_faces(points_at, n, memory_at, block_at, row_at)


@kernel
def copy_faces(points_at, n, memory_at, block_at, row_at):
    """`keep_faces` for kernels."""
    making = _made(points_at, n, memory_at)
    header = making.header
    n_faces, n_corners, n_ids, padded = header[FACES], header[CORNERS], header[IDS], _padded(header)
    row = view_i64(row_at, FACE_INTS)
    row[0] = n_ids
    row[1] = padded
    row[2] = n_faces
    row[3] = block_at
    row[4] = row[3] + 24 * padded
    row[5] = row[4] + 8 * n_ids
    row[6] = row[5] + 24 * n_faces
    row[7] = row[6] + 8 * n_faces
    row[8] = row[7] + 8 * n_faces
    row[9] = row[8] + 8 * n_faces + 8
    for k in range(10, 13):
        row[k] = row[k - 1] + 8 * n_corners
    row[13] = row[12] + 8 * n + 8
    _put_columns(making, n, padded, view_i64(row[4], n_ids), view_f64(row[3], 3 * padded))
    normals, flatness = view_f64(row[5], 3 * n_faces), view_f64(row[6], n_faces)
    for k in range(3 * n_faces):
        normals[k] = making.normals[k]
    for k in range(n_faces):
        flatness[k] = making.flatness[k]
    _copy(making.triangles, n_faces, row[7])
    _copy(making.starts, n_faces + 1, row[8])
    _copy(making.corners, n_corners, row[9])
    _copy(making.face_of, n_corners, row[11])
    _copy(making.fan_starts, n + 1, row[12])
    _copy(making.fans, n_corners, row[13])
    _number_edges(making, n, view_i64(row[10], n_corners))


@kernel
def _copy(integers, n, at):
    out = view_i64(at, n)
    for k in range(n):
        out[k] = integers[k]


@kernel
def _put_columns(making, n, padded, ids, columns):
    """Vertices with corners, or the first vertex where no vertex has corners, and their coordinates axis by axis."""
    n_ids = 0
    for vertex in range(n):
        if making.fan_starts[vertex + 1] > making.fan_starts[vertex]:
            ids[n_ids] = vertex
            n_ids += 1
    if n_ids == 0:
        ids[0] = making.vertices[0]
        n_ids = 1
    for k in range(padded):
        for axis in range(3):
            columns[axis * padded + k] = making.points[3 * ids[k if k < n_ids else 0] + axis]


@kernel
def _number_edges(making, n, edges):
    """Number each corner's edge to the next, the same from both faces, in the order of the ends, the lesser first.

    Two passes of a counting sort: by the larger ends, then by the lesser.
    """
    n_corners, corners, starts = making.header[CORNERS], making.corners, making.starts
    low, high, by_high, by_low = making.behind, making.face_of, making.ahead, making.fans
    for face in range(making.header[FACES]):
        for k in range(starts[face], starts[face + 1]):
            here, following = corners[k], corners[k + 1 if k + 1 < starts[face + 1] else starts[face]]
            low[k] = min(here, following)
            high[k] = max(here, following)
            by_low[k] = k
    order_by_key(high, by_low, n_corners, n, making.mark, by_high)
    order_by_key(low, by_high, n_corners, n, making.mark, by_low)
    number = -1
    for k in range(n_corners):
        at = by_low[k]
        before = by_low[k - 1] if k > 0 else at
        if k == 0 or low[before] != low[at] or high[before] != high[at]:
            number += 1
        edges[at] = number
