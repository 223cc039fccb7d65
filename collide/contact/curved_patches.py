"""Patches of a mesh's facets against one curved convex set: where they begin, how they grow, and their points.

A facet starts a patch where its nearest points, or the points of its least translation, are local minima: no facet
around comes nearer along the normal (`internal_edges.py`). The patch grows over facets linked by corners and over the
part of the curved set supporting the normal (`support_face.py`); its points are the corners of both overlaps.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.contact.clip_polygons import Clipped
from collide.contact.contact_facets import PosedFacets, posed_corner
from collide.contact.contact_points import PatchPoints
from collide.contact.internal_edges import edge_slopes, fan_allows
from collide.contact.manifold_points import (
    GAP,
    HEIGHT,
    POINT,
    ManifoldPoints,
    V,
    height_at,
    line_of,
    overlap_points,
    put_line_ends,
    runs_along,
    side_of,
)
from collide.contact.support_face import EDGE, FACE, VERTEX, SupportFace, seen_along
from collide.kernels import kernel
from collide.narrowphase.rows import DISTANCE, HIT, NORMAL, POINT_A, ROW, view_row
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, put_vec3, scale, sub, vec3_at

# What a facet is, bits: it is in a patch, or in the one in hand; a search looked at it.
COVERED, REACHED, TRIED = 1, 2, 4
#: Sines of angles between normals that are the same: those of gaps of curved sets are good to 2⁻²⁶, but of gaps that
#: are next to nothing. A normal leaves a facet at right angles up to the first, and belongs to a patch up to the
#: second; those of depths up to so many times as much.
_SAME, _SAME_PATCH, _OF_DEPTHS = 2.0**-20, 2.0**-12, 16.0
#: Nearest points this near to a corner or an edge, in lengths of the longest edge, are on it.
_ON = 2.0**-16
#: So far beside its place, in units of the pair's size, a facet's normal may lay the point of the set.
_BESIDE = 2.0**-33
#: A facet is across the normal down to this cosine; of a steeper one an edge, up to this sine, is.
_ACROSS = 0.7
#: A facet that looks away from the normal by this cosine shows nothing.
_AWAY = -(2.0**-10)
#: Facets narrower, seen along the normal, than so many errors of a coordinate are edges.
_MIN_ERRORS = 256.0
#: The bit of this patch, and of all that follow it.
LAST_BIT = 62


class NearFacets(NamedTuple):
    """n facets of a mesh near a curved set, at one pair of poses, and space for patches of them.

    mesh : all facets.   facets : (n,) numbers.   rows_at : address of their rows of `distance`, against the set.
    corners, normals : 9 and 3 doubles a facet, seen from the mesh's origin; the normal of a facet without area is 0.
    states : bits.   queue : of a search.   patches : bits of the patches that each is in.
    slots : a word a facet of the mesh, 1 + its place among these, else 0.   seen : a word a corner of the mesh, marks.
    origin : of the mesh in the world.   error : of a coordinate [m].   shift : of the set's origin from the mesh's [m].
    axis : of a cylinder, a unit vector; 0 of other sets.
    points : of the patch in hand.   face, face_features : of the facet in hand, seen along the normal.
    first, second, overlap : space for one overlap.
    """

    n: int
    mesh: PosedFacets
    facets: Any
    rows_at: int
    corners: Any
    normals: Any
    states: Any
    queue: Any
    patches: Any
    slots: Any
    seen: Any
    origin: Vec3
    error: float
    shift: Vec3
    axis: Vec3
    points: PatchPoints
    face: Any
    face_features: Any
    face_edges: Any
    first: Clipped
    second: Clipped
    overlap: ManifoldPoints


class Look(NamedTuple):
    """Along what, and within which gaps, points are looked for: axes, and two bounds [m]."""

    axes: Any
    low: float
    high: float


@kernel
def pose_facets(near):
    """Fill in corners and normals, and mark the facets in ``slots``."""
    for k in range(near.n):
        facet = near.facets[k]
        near.slots[facet] = k + 1
        near.states[k] = 0
        near.patches[k] = 0
        place = int(near.mesh.places[facet])
        for j in range(3):
            put_vec3(near.corners, 9 * k + 3 * j, posed_corner(near.mesh, place, j))
        p = vec3_at(near.corners, 9 * k)
        e, f = sub(vec3_at(near.corners, 9 * k + 3), p), sub(vec3_at(near.corners, 9 * k + 6), p)
        n = cross(e, f)
        length = norm(n)
        flat = length > 2.0**-44 * (norm(e) * norm(f))
        put_vec3(near.normals, 3 * k, scale(1.0 / length, n) if flat else Vec3(0.0, 0.0, 0.0))


@kernel
def forget_facets(near):
    """Take the marks from ``slots``."""
    for k in range(near.n):
        near.slots[near.facets[k]] = 0


# --- where patches begin ------------------------------------------------------------------------


@kernel
def seed_of(near, k):
    """(whether facet k starts a patch, its normal, what of the facet is nearest) from its row of `distance`."""
    row = view_row(near.rows_at + ROW * k)
    u, n = vec3_at(row.doubles, NORMAL), vec3_at(near.normals, 3 * k)
    facet = near.facets[k]
    nothing = np.int64(-1)
    slack = _OF_DEPTHS * _SAME if row.flags[HIT] != 0 else _SAME
    if not abs(dot(u, u) - 1.0) < _SAME:
        return False, u, nothing
    p = sub(vec3_at(row.doubles, POINT_A), near.origin)
    on = _ON
    first, second = _feature_at(near.corners, 9 * k, p, on)
    # Within a facet the nearest point has the facet's normal: another normal is of an edge or a corner, beside which
    # rounding has put the point, of a facet tiny beside the set.
    while first < 0 and on < 1.0 and norm(cross(n, u)) > _OF_DEPTHS * _SAME_PATCH * norm(n):
        on *= 4.0
        first, second = _feature_at(near.corners, 9 * k, p, on)
    facing, turned = dot(n, u), norm(cross(n, u))
    # At a corner or an edge, the facet's normal lays the point of the set beside it by the gap times the angle.
    beside = turned * max(row.doubles[DISTANCE], 0.0)
    is_facets = turned <= slack and beside <= _BESIDE * (norm(p) + abs(row.doubles[DISTANCE]))
    if dot(n, n) > 0.0 and (first < 0 or is_facets):
        return facing > 0.0 or not near.mesh.solid, n if facing > 0.0 else neg(n), 4 * facet + FACE
    if first < 0:
        return False, u, nothing
    corner = int(near.mesh.corners[3 * facet + first])
    end = int(near.mesh.corners[3 * facet + second]) if second >= 0 else -1
    feature = 4 * int(near.mesh.edges[3 * facet + first]) + EDGE if second >= 0 else 4 * corner + VERTEX
    if second >= 0:
        u = _across_lines(near, _corner(near.corners, 9 * k, first), _corner(near.corners, 9 * k, second), u)
    return fan_allows(near.mesh, corner, end, p, u, slack), u, np.int64(feature)


@kernel
def _across_lines(near, p, q, u):
    """A normal at an edge, better known where the edge is along a cylinder's axis: from the edge to the axis."""
    e, axis = sub(q, p), near.axis
    if dot(axis, axis) == 0.0 or norm(cross(e, axis)) > _SAME * norm(e):
        return u
    w = sub(near.shift, p)
    w = sub(w, scale(dot(w, axis), axis))
    length = norm(w)
    if not length > 0.0:
        return u
    v = scale((1.0 if dot(w, u) > 0.0 else -1.0) / length, w)
    return v if norm(cross(u, v)) <= _SAME_PATCH else u


@kernel
def _feature_at(corners, at, p, on):
    """Feature of a triangle under a point on its surface: (a corner, −1), both ends of an edge, or (−1, −1).

    on : a point this near to a corner or an edge, in lengths of the longest edge, is on it.
    """
    longest = 0.0
    for i in range(3):
        longest = max(longest, norm(sub(_corner(corners, at, i + 1), _corner(corners, at, i))))
    for i in range(3):
        if norm(sub(p, _corner(corners, at, i))) <= on * longest:
            return i, -1
    best, edge = on * longest, -1
    for i in range(3):
        q = _corner(corners, at, i)
        e, w = sub(_corner(corners, at, i + 1), q), sub(p, q)
        square = dot(e, e)
        t = min(max(dot(w, e) / square, 0.0), 1.0) if square > 0.0 else 0.0
        off = norm(sub(w, scale(t, e)))
        if off <= best:
            best, edge = off, i
    return edge, (edge + 1) % 3 if edge >= 0 else -1


@kernel(inline=True)
def _corner(corners, at, i):
    return vec3_at(corners, at + 3 * (i % 3))


# --- points -------------------------------------------------------------------------------------


@kernel
def _empty_face(near):
    """No corners."""
    zero = np.int64(0)
    return SupportFace(
        zero, zero, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, near.face, near.face_features, near.face_edges,
        np.int64(-1),
    )


@kernel
def _face_of(near, k, axes):
    """The feature of facet k across the normal: (its `SupportFace`, a bound of the error of its heights [m]).

    The whole facet, or the least steep edge of a steep facet, or nothing.
    """
    facet = near.facets[k]
    normal = vec3_at(near.normals, 3 * k)
    cosine = dot(normal, axes.nhat)
    if near.mesh.solid and cosine < _AWAY:
        return _empty_face(near), 0.0
    for i in range(3):
        put_vec3(near.face, 3 * i, seen_along(axes, vec3_at(near.corners, 9 * k + 3 * i)))
    if abs(cosine) >= _ACROSS:
        p, q, r = vec3_at(near.face, 0), vec3_at(near.face, 3), vec3_at(near.face, 6)
        e, f = sub(q, p), sub(r, p)
        area = e.x * f.y - e.y * f.x
        longest = max(norm(e), norm(f), norm(sub(f, e)))
        if abs(area) > _MIN_ERRORS * near.error * longest:
            turned = area < 0.0  # counter-clockwise seen from the curved set
            if turned:
                put_vec3(near.face, 3, r)
                put_vec3(near.face, 6, q)
            for i in range(3):
                corner = 3 - i if turned and i > 0 else i
                edge = 2 - i if turned else i
                near.face_features[i] = 4 * int(near.mesh.corners[3 * facet + corner]) + VERTEX
                near.face_edges[i] = 4 * int(near.mesh.edges[3 * facet + edge]) + EDGE
            slope_u, slope_v = (e.z * f.y - f.z * e.y) / area, (e.x * f.z - f.x * e.z) / area
            spread = max(p.z, q.z, r.z) - min(p.z, q.z, r.z)
            face = SupportFace(
                np.int64(3), np.int64(facet), p.x, p.y, p.z, slope_u, slope_v, 0.0, 0.0, 0.0, near.face,
                near.face_features, near.face_edges, np.int64(4 * facet + FACE),
            )
            return face, 32.0 * near.error + 64.0 * near.error * longest * spread / abs(area)
    return _edge_of(near, facet)


@kernel
def _edge_of(near, facet):
    """The same of the least steep edge of a facet whose corners are seen; nothing where all are steep."""
    least, best = _ACROSS, -1
    for i in range(3):
        e = sub(_corner(near.face, 0, i + 1), _corner(near.face, 0, i))
        length = norm(e)
        if length > _MIN_ERRORS * near.error and abs(e.z) <= least * length:
            least, best = abs(e.z) / length, i
    if best < 0:
        return _empty_face(near), 0.0
    p, q = _corner(near.face, 0, best), _corner(near.face, 0, best + 1)
    put_vec3(near.face, 0, p)
    put_vec3(near.face, 3, q)
    near.face_features[0] = 4 * int(near.mesh.corners[3 * facet + best]) + VERTEX
    near.face_features[1] = 4 * int(near.mesh.corners[3 * facet + (best + 1) % 3]) + VERTEX
    edge = np.int64(4 * int(near.mesh.edges[3 * facet + best]) + EDGE)
    near.face_edges[0] = edge
    near.face_edges[1] = edge
    return SupportFace(
        np.int64(2), np.int64(facet), p.x, p.y, p.z, 0.0, 0.0, 0.0, 0.0, 0.0, near.face, near.face_features,
        near.face_edges, edge,
    ), 32.0 * near.error


@kernel
def _put_facet(near, k, of_set, look, n):
    """Append the points of facet k to n; how many there are then.   of_set : the curved set's `SupportFace`."""
    face, bound = _face_of(near, k, look.axes)
    if face.n == 0:
        return n
    bound += 2.0 * of_set.flatness
    if of_set.n > 1:
        m, off = overlap_points(face, of_set, 16.0 * near.error, -math.inf, near.first, near.second, near.overlap)
        bound += off
        if face.n == 3 and of_set.n == 2 and of_set.round_p > 0.0:
            m = _put_ends(near, face, of_set, look.axes, m)
    else:
        m = _vertex_over(face, of_set, 16.0 * near.error, near.overlap)
    points, overlap = near.points, near.overlap
    for i in range(m):
        gap = overlap.points[POINT * i + GAP]
        if gap < look.low - bound or gap > look.high + bound:
            continue
        for j in range(POINT):
            points.manifold.points[POINT * n + j] = overlap.points[POINT * i + j]
        for j in range(2):
            points.manifold.features[2 * n + j] = overlap.features[2 * i + j]
        points.errors[n] = bound
        points.pairs[n] = k
        n += 1
    return n


@kernel
def _put_ends(near, face, of_set, axes, n):
    """Append the ends of what the set's round line shares with sharp edges of a facet, or the mesh's rim, to n points
    of the overlap in hand; how many there are then.
    """
    line = line_of(of_set)
    for k in range(3):
        edge = side_of(face, k)
        if not runs_along(edge, line):
            continue
        p, q = _unseen(axes, edge.p), _unseen(axes, edge.q)
        slopes = edge_slopes(near.mesh, edge.feature_p // 4, edge.feature_q // 4, p, q, axes.nhat, _SAME)
        if slopes.supports and max(slopes.left_slope, slopes.right_slope) > _SAME:
            n = put_line_ends(edge, line, False, slopes, 16.0 * near.error, near.overlap, n)
    return n


@kernel(inline=True)
def _unseen(axes, p):
    """Where a point (u, v, h) seen along the normal is."""
    return add(add(scale(p.x, axes.e), scale(p.y, axes.f)), scale(p.z, axes.nhat))


@kernel
def _vertex_over(face, of_set, tolerance, overlap):
    """Put the set's single point where it is over a facet; how many."""
    if face.n != 3:
        return 0
    u, v, h = of_set.corners[0], of_set.corners[1], of_set.corners[2]
    for i in range(3):
        at, to = 3 * i, 3 * i + 3 if i < 2 else 0
        du, dv = face.corners[to] - face.corners[at], face.corners[to + 1] - face.corners[at + 1]
        aside = du * (v - face.corners[at + 1]) - dv * (u - face.corners[at])
        if aside < -tolerance * math.sqrt(du * du + dv * dv):
            return 0
    height = height_at(face, u, v)
    overlap.points[0] = u
    overlap.points[V] = v
    overlap.points[GAP] = h - height
    overlap.points[HEIGHT] = 0.5 * (h + height)
    overlap.features[0] = face.feature
    overlap.features[1] = of_set.features[0]
    return 1


# --- growing ------------------------------------------------------------------------------------


@kernel
def grow_over(near, n_seeds, of_set, look):
    """Mark as REACHED the first ``n_seeds`` facets of the queue, and linked facets with points; how many points.
    """
    _forget_search(near)
    n, end = 0, n_seeds
    for i in range(n_seeds):
        near.states[near.queue[i]] |= REACHED | TRIED
        n = _put_facet(near, near.queue[i], of_set, look, n)
    begin = 0
    while begin < end:
        facet = near.facets[near.queue[begin]]
        begin += 1
        for i in range(3 * facet, 3 * facet + 3):
            corner = int(near.mesh.corners[i])
            if near.seen[corner] != 0:
                continue
            near.seen[corner] = 1
            for at in range(int(near.mesh.fan_starts[corner]), int(near.mesh.fan_starts[corner + 1])):
                k = near.slots[int(near.mesh.fans[at])] - 1
                if k < 0 or near.states[k] & TRIED:
                    continue
                near.states[k] |= TRIED
                n_before = n
                n = _put_facet(near, k, of_set, look, n)
                if n > n_before:
                    near.states[k] |= REACHED
                    near.queue[end] = k
                    end += 1
    return n


@kernel
def cover_facets(near, nhat, number):
    """Put REACHED facets, and those linked with them whose own normal is the same, into a patch."""
    for k in range(near.n):
        for i in range(3):
            near.seen[int(near.mesh.corners[3 * near.facets[k] + i])] = 0
    end = 0
    for k in range(near.n):
        if near.states[k] & REACHED:
            near.queue[end] = k
            end += 1
    begin = 0
    while begin < end:
        k = near.queue[begin]
        begin += 1
        near.patches[k] |= 1 << min(number, LAST_BIT)
        near.states[k] |= COVERED
        for i in range(3 * near.facets[k], 3 * near.facets[k] + 3):
            corner = int(near.mesh.corners[i])
            if near.seen[corner] != 0:
                continue
            near.seen[corner] = 1
            for at in range(int(near.mesh.fan_starts[corner]), int(near.mesh.fan_starts[corner + 1])):
                linked = near.slots[int(near.mesh.fans[at])] - 1
                if linked < 0 or near.states[linked] & (COVERED | REACHED):
                    continue
                row = view_row(near.rows_at + ROW * linked)
                same = _OF_DEPTHS * _SAME_PATCH if row.flags[HIT] != 0 else _SAME_PATCH
                if norm(sub(vec3_at(row.doubles, NORMAL), nhat)) <= same:
                    near.states[linked] |= REACHED
                    near.queue[end] = linked
                    end += 1


@kernel
def _forget_search(near):
    for k in range(near.n):
        near.states[k] &= ~(REACHED | TRIED)
        for i in range(3):
            near.seen[int(near.mesh.corners[3 * near.facets[k] + i])] = 0


@kernel
def highest_of(near, n):
    """How high REACHED facets stand along a direction [m]."""
    highest = -math.inf
    for k in range(near.n):
        if near.states[k] & REACHED:
            for i in range(3):
                highest = max(highest, dot(n, vec3_at(near.corners, 9 * k + 3 * i)))
    return highest
