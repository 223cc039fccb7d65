"""The feature of a convex body supporting the normal of a contact: a face, an edge, or a vertex.

Taken is, of the faces around a vertex farthest along the normal, the face most across the normal; where all are too
steep, the least steep edge at the vertex; where all edges are too steep, the vertex. For a cylinder or a cone the
feature is a polygon within an end, or a line on the side.

Everything is seen along the normal: coordinates (u, v) across, and the height h along the normal, from A's origin.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.curved.curved_kinds import curved_support
from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.hull_faces import (
    COLUMNS_AT,
    CORNERS_AT,
    EDGES_AT,
    FACE_INTS,
    FACE_OF_AT,
    FAN_STARTS_AT,
    FANS_AT,
    FLATNESS_AT,
    N_FACES,
    N_VERTICES,
    NORMALS_AT,
    PADDED,
    STARTS_AT,
    TRIANGLES_AT,
    VERTEX_IDS_AT,
)
from collide.lowering.packed_convex import CONE, CYLINDER, POINTS
from collide.narrowphase.posed_pair import reach_of
from collide.numerics.vec3 import Vec3, add, column_at, cross, dot, norm, put_vec3, rotate, scale, sub, vec3_at
from collide.support.support_mapping import settled_vertex, support_vertex
from collide.support.support_tree_query import extreme_vertex_listed

#: A face, or a line, is across the normal down to this cosine, or up to this sine.
ACROSS = 0.7
#: Corners of the polygon within a cylinder's end or a cone's base.
ROUND = 8
#: Corners are good to this part of the body's size: the direction of an edge is known to so much over its length.
_BLUR = 2.0**-46
#: Faces and edges whose direction is known worse than to this angle show no more than their nearest point when swept.
KNOWN = 2.0**-20
#: Sines below this count as 0: a cylinder stands upright. At rest it tilts this way and that by less (a can of 5 cm
#: whose rim moves by a micrometre by 2e-5), and corners that went around with its lowest point would never let it rest.
_UPRIGHT = 2.0**-15
#: Of the radius and the sine: by so much the lowest point may be lower than the lowest corner of an upright octagon.
_SAGITTA = 1.0 - math.cos(math.pi / ROUND) + 2.0**-50

#: What a feature number names: number · 4 + one of these. CURVED numbers the corners of a polygon within an end.
VERTEX, EDGE, FACE, CURVED = range(4)


class ContactAxes(NamedTuple):
    """Two unit vectors across the normal and the normal itself, right-handed, from A to B."""

    e: Vec3
    f: Vec3
    nhat: Vec3


class SupportFace(NamedTuple):
    """Corners of a body supporting a direction, in a buffer: three doubles (u, v, h) each, and a feature each.

    n : of corners: 1 a vertex, 2 an edge, more a face, counter-clockwise seen from outside the body.
    triangle : of the hull, or −1.
    u, v, h : a point of the face's plane.   slope_u, slope_v : of the height h in the plane; 0 but of faces.
    flatness : how far the body's true feature may be off the plane, or off an edge between the corners [m].
    round_p, round_q : radius of the body's surface across an edge at its first and its second corner, linear in
    between, 0 where the edge is sharp [m].
    corners : view of the coordinates.   features, edges : of each corner, and of the edge from each to the next.
    feature : of the face as a whole.
    """

    n: int
    triangle: int
    u: float
    v: float
    h: float
    slope_u: float
    slope_v: float
    flatness: float
    round_p: float
    round_q: float
    corners: Any
    features: Any
    edges: Any
    feature: int


@kernel(inline=True)
def axes_across(nhat):
    """`ContactAxes` of a unit vector."""
    smallest = min(abs(nhat.x), abs(nhat.y), abs(nhat.z))
    if abs(nhat.x) == smallest:
        e = Vec3(0.0, nhat.z, -nhat.y)
    elif abs(nhat.y) == smallest:
        e = Vec3(-nhat.z, 0.0, nhat.x)
    else:
        e = Vec3(nhat.y, -nhat.x, 0.0)
    e = scale(1.0 / norm(e), e)
    return ContactAxes(e, cross(nhat, e), nhat)


@kernel(inline=True)
def seen_along(axes, p):
    """(u, v, h) of a point."""
    return Vec3(dot(axes.e, p), dot(axes.f, p), dot(axes.nhat, p))


@kernel(inline=True)
def _view_buffers(doubles_at, integers_at, capacity):
    return view_f64(doubles_at, 3 * capacity), view_i64(integers_at, capacity), view_i64(
        integers_at + 8 * capacity, capacity
    )


@kernel
def support_face(pair, body, faces_at, axes, sign, shift, capacity, doubles_at, integers_at):
    """The `SupportFace` of a body for the direction sign · nhat.

    faces_at : rows of `HullFaceTable`.   shift : the body's origin from A's [m].
    capacity : corners that the buffers have room for.   doubles, integers : 3 and 2 of them a corner.
    """
    R = pair.poses
    at = body.pose_at
    corners, features, edges = _view_buffers(doubles_at, integers_at, capacity)
    c0, c1, c2 = Vec3(R[at], R[at + 3], R[at + 6]), Vec3(R[at + 1], R[at + 4], R[at + 7]), Vec3(
        R[at + 2], R[at + 5], R[at + 8]
    )
    direction = scale(sign, axes.nhat)
    g = Vec3(dot(c0, direction), dot(c1, direction), dot(c2, direction))
    # Normals of faces eighth with the cofactors of a matrix, which need be no rotation.
    cofactors = cross(c1, c2), cross(c2, c0), cross(c0, c1)
    facing = Vec3(dot(cofactors[0], direction), dot(cofactors[1], direction), dot(cofactors[2], direction))
    normal = Vec3(0.0, 0.0, 0.0)
    flatness = 0.0
    round_p, round_q = 0.0, 0.0
    triangle = np.int64(-1)
    feature = np.int64(-1)
    if body.kind == POINTS:
        blur = _BLUR * reach_of(pair, body)
        n, triangle, normal, flatness, feature = _hull_corners(
            body, faces_at, g, facing, blur, corners, features, edges
        )
    elif body.kind == CYLINDER or body.kind == CONE:
        n, normal, flatness = _round_corners(pair, body, g, corners, features, edges)
        if n == 2:
            round_p, round_q = _side_radii(pair, body)
    else:
        n = 1
        put_vec3(corners, 0, curved_support(body.kind, pair.numbers, body.params_at, g))
        features[0] = -1
    for k in range(n):
        p = add(rotate(R, at, vec3_at(corners, 3 * k)), shift)
        put_vec3(corners, 3 * k, seen_along(axes, p))
    base = vec3_at(corners, 0)
    if n < 3:
        return SupportFace(
            n, triangle, base.x, base.y, base.z, 0.0, 0.0, flatness, round_p, round_q, corners, features, edges, feature
        )
    N = add(
        add(scale(normal.x, cofactors[0]), scale(normal.y, cofactors[1])), scale(normal.z, cofactors[2])
    )
    N = seen_along(axes, N)
    return SupportFace(
        n, triangle, base.x, base.y, base.z, -N.x / N.z, -N.y / N.z, flatness, 0.0, 0.0, corners, features, edges,
        feature,
    )


@kernel
def swept_face(face, sign, radius, error):
    """The `SupportFace` of a body swept by a ball, from its core's: the same corners moved by the radius along the
    normal of a face, along nhat's part across an edge, along nhat for a vertex.

    The corners lie on the surface then, however far the core leans.   sign : as in `support_face`.
    error : of a coordinate [m]. With this error, or the flatness, the direction of an edge of length l is known to
    2·error/l, the normal of a face of area A and longest side l to 2·error·l/A; the swept face is off by the same share
    of the radius.
    """
    if radius == 0.0 or face.n == 0:
        return face
    corners, n = face.corners, face.n
    shift = Vec3(0.0, 0.0, sign)
    unknown = 0.0
    if n == 2:
        e = sub(vec3_at(corners, 3), vec3_at(corners, 0))
        square = dot(e, e)
        unknown = 2.0 * error / math.sqrt(square) if square > 0.0 else 1.0
        if unknown <= KNOWN:
            shift = sub(Vec3(0.0, 0.0, 1.0), scale(e.z / square, e))
            shift = scale(sign / norm(shift), shift)
    elif n > 2:
        area, longest = _extent_of(corners, n)
        unknown = 4.0 * (error + face.flatness) * longest / area if area > 0.0 else 1.0
        shift = Vec3(-face.slope_u, -face.slope_v, 1.0)
        shift = scale(sign / norm(shift), shift)
    if unknown > KNOWN:
        n = np.int64(1)
    for k in range(n):
        put_vec3(corners, 3 * k, add(vec3_at(corners, 3 * k), scale(radius, shift)))
    base = add(Vec3(face.u, face.v, face.h), scale(radius, shift))
    return SupportFace(
        n, face.triangle, base.x, base.y, base.z, face.slope_u, face.slope_v, face.flatness + unknown * radius,
        radius if n == 2 else 0.0, radius if n == 2 else 0.0, corners, face.features, face.edges, face.feature,
    )


@kernel(inline=True)
def _extent_of(corners, n):
    """(twice the area of a polygon seen along the normal, the longest way from its first corner to another)."""
    area, square = 0.0, 0.0
    for k in range(1, n):
        u, v = corners[3 * k] - corners[0], corners[3 * k + 1] - corners[1]
        square = max(square, u * u + v * v)
        if k + 1 < n:
            area += u * (corners[3 * k + 4] - corners[1]) - v * (corners[3 * k + 3] - corners[0])
    return abs(area), math.sqrt(square)


@kernel(inline=True)
def _hull_vertex(body, row, g):
    """Id of a hull's vertex farthest in direction g of the body's own frame."""
    if body.tree != 0:
        listed = extreme_vertex_listed(body.tree, -1, g, view_i64(0, 0))
        vertex = settled_vertex(body.coords, body.padded, body.tree, listed.id, g)
        fan_starts = view_i64(row[FAN_STARTS_AT], body.n + 1)
        if fan_starts[vertex] < fan_starts[vertex + 1] or row[N_FACES] == 0:
            return vertex  # else it lies within a face, or on an edge, but for rounding
    padded = row[PADDED]
    k = support_vertex(view_f64(row[COLUMNS_AT], 3 * padded), padded, g)
    return view_i64(row[VERTEX_IDS_AT], row[N_VERTICES])[k]


@kernel(inline=True)
def _hull_corners(body, faces_at, g, facing, blur, corners, features, edges):
    """Put the corners of a hull's support into the buffers; (their number, triangle, normal, flatness, feature).

    blur : rounding of an edge's end [m]: edges count as steep as this rounding may make them, so an edge between points
    equal up to rounding never goes before a long edge.
    """
    row = view_i64(faces_at + 8 * FACE_INTS * body.shape, FACE_INTS)
    n_faces = row[N_FACES]
    starts = view_i64(row[STARTS_AT], n_faces + 1)
    n_corners = starts[n_faces]
    loop = view_i64(row[CORNERS_AT], n_corners)
    loop_edges = view_i64(row[EDGES_AT], n_corners)
    face_of = view_i64(row[FACE_OF_AT], n_corners)
    fan_starts = view_i64(row[FAN_STARTS_AT], body.n + 1)
    fans = view_i64(row[FANS_AT], n_corners)
    normals = view_f64(row[NORMALS_AT], 3 * n_faces)
    triangles = view_i64(row[TRIANGLES_AT], n_faces)
    vertex = _hull_vertex(body, row, g)
    p = column_at(body.coords, body.padded, vertex)
    best = np.int64(-1)
    best_cosine = ACROSS
    for k in range(fan_starts[vertex], fan_starts[vertex + 1]):
        face = face_of[fans[k]]
        cosine = dot(vec3_at(normals, 3 * face), facing)
        if cosine > best_cosine:
            best_cosine = cosine
            best = face
    if best >= 0:
        begin = starts[best]
        n = starts[best + 1] - begin
        for k in range(n):
            put_vec3(corners, 3 * k, column_at(body.coords, body.padded, loop[begin + k]))
            features[k] = 4 * loop[begin + k] + VERTEX
            edges[k] = 4 * loop_edges[begin + k] + EDGE
        flatness = view_f64(row[FLATNESS_AT], n_faces)[best]
        return n, triangles[best], vec3_at(normals, 3 * best), flatness, 4 * best + FACE
    best_edge = np.int64(-1)
    length = norm(g)
    least_steep = -ACROSS * length
    for k in range(fan_starts[vertex], fan_starts[vertex + 1]):
        at = fans[k]
        face = face_of[at]
        following = at + 1 if at + 1 < starts[face + 1] else starts[face]
        e = sub(column_at(body.coords, body.padded, loop[following]), p)
        slope = (dot(e, g) - blur * length) / norm(e)
        if slope > least_steep:
            least_steep = slope
            best_edge = at
    put_vec3(corners, 0, p)
    features[0] = 4 * vertex + VERTEX
    first = fan_starts[vertex]
    triangle = np.int64(-1)
    if first < fan_starts[vertex + 1]:
        triangle = triangles[face_of[fans[first]]]
    zero = Vec3(0.0, 0.0, 0.0)
    if best_edge < 0:
        return np.int64(1), triangle, zero, 0.0, features[0]
    face = face_of[best_edge]
    following = best_edge + 1 if best_edge + 1 < starts[face + 1] else starts[face]
    put_vec3(corners, 3, column_at(body.coords, body.padded, loop[following]))
    features[1] = 4 * loop[following] + VERTEX
    edges[0] = 4 * loop_edges[best_edge] + EDGE
    edges[1] = edges[0]
    return np.int64(2), triangles[face], zero, view_f64(row[FLATNESS_AT], n_faces)[face], edges[0]


@kernel(inline=True)
def _round_corners(pair, body, g, corners, features, edges):
    """The same of a cylinder or a cone; (their number, the normal of an end, its flatness)."""
    radius = pair.numbers[body.params_at]
    half = pair.numbers[body.params_at + 1]
    aside = math.sqrt(g.x * g.x + g.y * g.y)
    length = norm(g)
    x, y = 1.0, 0.0
    flatness = _SAGITTA * radius * aside / length
    if aside > _UPRIGHT * length:
        x = g.x / aside
        y = g.y / aside
        flatness = 0.0
    up = g.z / length
    normal = Vec3(0.0, 0.0, 0.0)
    is_cone = body.kind == CONE
    if -up >= ACROSS or (up >= ACROSS and not is_cone):
        z = half if up > 0.0 else -half
        _put_disc(x, y, radius, z, corners, features, edges)
        return np.int64(ROUND), Vec3(0.0, 0.0, 1.0 if up > 0.0 else -1.0), flatness
    # A line on the side, from the lower end to the upper one; a cone's apex where that is what is in front.
    put_vec3(corners, 0, Vec3(x * radius, y * radius, -half))
    if is_cone:
        put_vec3(corners, 3, Vec3(0.0, 0.0, half))
    else:
        put_vec3(corners, 3, Vec3(x * radius, y * radius, half))
    for k in range(2):
        features[k] = 4 * k + CURVED
        edges[k] = 4 * (ROUND + k) + CURVED
    line = sub(vec3_at(corners, 3), vec3_at(corners, 0))
    slope = dot(line, g) / (norm(line) * length)
    if abs(slope) <= ACROSS:
        return np.int64(2), normal, 0.0
    if slope > 0.0:
        put_vec3(corners, 0, vec3_at(corners, 3))
        features[0] = features[1]
    return np.int64(1), normal, 0.0


@kernel(inline=True)
def _side_radii(pair, body):
    """Radii of curvature across a line on the side, at its lower end and at its upper one.

    Of a cone with half angle α the radius at s from the apex, along the side, is s · tan α.
    """
    radius = pair.numbers[body.params_at]
    if body.kind == CYLINDER:
        return radius, radius
    height = 2.0 * pair.numbers[body.params_at + 1]
    return radius * math.sqrt(radius * radius + height * height) / height, 0.0


@kernel(inline=True)
def _put_disc(x, y, radius, z, corners, features, edges):
    """Corners of a regular octagon within a disc, one corner towards (x, y); counter-clockwise seen from outside.

    Numbers of corners turn with the body, and so do the corners, up to the least angle to bring a corner to (x, y): at
    rest (x, y) is the direction of a tilt of rounding size, different each time.
    """
    turn_c, turn_s = -1.0, 0.0
    for k in range(ROUND):
        c, s = _cosine_of_eighths(k), _cosine_of_eighths(k + ROUND - 2)
        if x * c + y * s > turn_c:
            turn_c, turn_s = x * c + y * s, y * c - x * s
    for k in range(ROUND):
        eighth = k if z > 0.0 else ROUND - 1 - k
        c, s = _cosine_of_eighths(eighth), _cosine_of_eighths(eighth + ROUND - 2)
        put_vec3(corners, 3 * k, Vec3(radius * (turn_c * c - turn_s * s), radius * (turn_c * s + turn_s * c), z))
        features[k] = 4 * eighth + CURVED
        edges[k] = 4 * (ROUND + eighth) + CURVED


@kernel(inline=True)
def _cosine_of_eighths(k):
    """Of k eighths of a full rotation."""
    k = k % ROUND
    if k % 4 == 2:
        return 0.0
    value = 1.0 if k % 4 == 0 else math.sqrt(0.5)
    return value if k < 2 or k == 7 else -value
