"""Nearest or deepest features of two convex sets, a cylinder, cone or ellipsoid among them, by Newton's method.

GJK leaves the direction n of a gap about √u off, and EPA the direction of a depth; with a smooth set the bracket, too.
The signed distance g, the nearest points a, b and the unit vector n solve

    b − a = g n,   |n|² = 1,   n·d = 0 for every flat direction d that a or b moves along,

a being a point of A farthest along n and b a point of B farthest along −n. Each set has a *feature*: a vertex, the rim
of an end, an ellipsoid's surface, which turn with n (their derivative by n is the Hessian of the support function),
plus flat directions: an edge or facet of a polytope, an end, the side of a cylinder, a line of a cone from rim to tip.
Newton's method, residuals in double-doubles and the matrix in doubles, gains 2⁵³ a step once it is near.

The solution is a proposal; `curved_gap.py` and `curved_depth.py` prove it. Each support and each point is good to 2⁻⁹⁰
of the pair's size S: some dozen operations in double-doubles, of 16u² each, of numbers below 4 S. All lengths are
scaled by a power of two to pairs of size about 1, so that answers scale with the pair.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.lowering.packed_convex import CONE, CYLINDER, ELLIPSOID, POINTS
from collide.narrowphase.gap.precise_pair import is_composed, unit_scale
from collide.narrowphase.gap.tied_vertices import MAX_TIES, tied_vertices, vertices_of
from collide.narrowphase.gjk.minkowski_difference import POINT_OF_A, POINT_OF_B, weighted_sum
from collide.narrowphase.posed_pair import reach_of
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.vec3 import (
    Vec3,
    add,
    column_at,
    dot,
    neg,
    norm,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Of a support and of a point, in units of S.
ERROR = 2.0**-90
#: How near to the border of a flat feature, in units of the set, a proposal is taken to lie beyond it.
_INSIDE = 1e-6
_STEPS = 5
#: What ends the search, besides ``across``: flat directions lean to n by so much of g.
_ALONG = 2.0**-56
# Unknowns: n, g, up to two flat coordinates of each set.
_MAX_UNKNOWNS = 8
#: Points off the normal by more than this, in units of the pair's size, are brought together along their lines.
_ASIDE = 2.0**-45
#: Doubles of workspace.
DOUBLES = _MAX_UNKNOWNS * (_MAX_UNKNOWNS + 1)

VERTEX, SMOOTH, RIM, SIDE, END, TIP = range(6)
_ZERO = DD(0.0, 0.0)


class Feature(NamedTuple):
    """What of a set is nearest to the other one.

    kind : VERTEX, SMOOTH (an ellipsoid), RIM, SIDE, END or TIP.   end : ±1, of a rim or end.   flat : directions.
    i, j, k : vertices of a polytope: the point is p_i + s (p_j − p_i) + t (p_k − p_i).   s, t : flat coordinates.
    """

    kind: int
    end: float
    flat: int
    i: int
    j: int
    k: int
    s: DD
    t: DD


class Placed(NamedTuple):
    """A feature at a direction: the point, its flat directions, the Hessian's six entries, all in W's axes.

    bend : no entry of the Hessian was worked out from larger numbers [m].   ratio : largest support of what turns over
    its support here, which says how fast the Hessian changes (`curved_depth.py`).
    """

    point: DDVec3
    d: DDVec3
    e: DDVec3
    xx: float
    yy: float
    zz: float
    xy: float
    yz: float
    zx: float
    bend: float
    ratio: float


class Nearest(NamedTuple):
    """A solution: is_found, features f, h of A and B, placed as p, q; n from A to B; t from A's origin to B's.

    size : of the pair, scaled by ``unit``, as all lengths here.
    """

    is_found: bool
    f: Feature
    h: Feature
    p: Placed
    q: Placed
    n: DDVec3
    t: DDVec3
    size: float
    unit: float


@kernel
def nearest_features(ordered, work, n_points, named, nhat, flat, across, memory_at):
    """The `Nearest` features of two cores near n points of the workspace, weighted, and the direction n̂ from A to B.

    named : the points name vertices of polytopes; else polytopes are boxes and segments, and there is a single point.
    flat : how near to a flat feature, in radians, n̂ is for that to be taken.   across : the search ends where b − a is
    off g n by so much of g.   memory_at : of DOUBLES doubles.
    """
    pair = ordered.pair
    A, B, poses = pair.A, pair.B, pair.poses
    unit = unit_scale(ordered.size)
    size = unit * ordered.size
    a = weighted_sum(work.points, work.weights, n_points, POINT_OF_A)
    b = weighted_sum(work.points, work.weights, n_points, POINT_OF_B)
    w, u = rotate_back(poses, A.pose_at, nhat), rotate_back(poses, A.pose_at, a)
    f = _feature(pair, A, work, n_points if named else 0, 0, w, u, unit, flat)
    w, u = neg(rotate_back(poses, B.pose_at, nhat)), rotate_back(poses, B.pose_at, b)
    h = _feature(pair, B, work, n_points if named else 0, 1, w, u, unit, flat)
    t = dd.scale_vec3(unit, dd.difference(vec3_at(poses, B.pose_at + 9), vec3_at(poses, A.pose_at + 9)))
    n = dd.exact_vec3(nhat)
    gap = DD(unit * dot(nhat, sub(add(b, pair.t), a)), 0.0)
    M = view_f64(memory_at, DOUBLES)
    p, q = placed(pair, A, f, n, unit), placed(pair, B, h, dd.neg_vec3(n), unit)
    is_found = not (is_composed(poses, A.pose_at) or is_composed(poses, B.pose_at))
    for _ in range(_STEPS if is_found else 0):
        residual = dd.sub_vec3(dd.sub_vec3(dd.add_vec3(q.point, t), p.point), dd.times_vec3(gap, n))
        off = norm(dd.leading(residual))
        if off <= across * abs(gap.high) and _lean(f, h, p, q, n) <= _ALONG * abs(gap.high):
            break
        if not off < size:
            is_found = False
            break
        _fill(M, f, h, p, q, n, gap, residual)
        m = 4 + f.flat + h.flat
        _solve(M, m)
        n = DDVec3(_moved(n.x, M, 0, m), _moved(n.y, M, 1, m), _moved(n.z, M, 2, m))
        gap = _moved(gap, M, 3, m)
        f = _with_flats(f, M, 4, m)
        h = _with_flats(h, M, 4 + f.flat, m)
        p, q = placed(pair, A, f, n, unit), placed(pair, B, h, dd.neg_vec3(n), unit)
    away = dd.neg_vec3(n)
    inner_f, inner_h = _within(pair, A, f, unit), _within(pair, B, h, unit)
    if _is_moved(f, inner_f):
        p = placed(pair, A, inner_f, n, unit)
    if _is_moved(h, inner_h):
        q = placed(pair, B, inner_h, away, unit)
    # Parallel lines share a stretch: where a point was moved back onto its own, the opposite point follows.
    for _ in range(2):
        aside = _aside(dd.sub_vec3(dd.add_vec3(q.point, t), p.point), n)
        if norm(aside) <= _ASIDE * size:
            break
        if inner_h.flat == 1:
            inner_h = _within(pair, B, _along(inner_h, q, neg(aside)), unit)
            q = placed(pair, B, inner_h, away, unit)
            aside = _aside(dd.sub_vec3(dd.add_vec3(q.point, t), p.point), n)
        if inner_f.flat == 1:
            inner_f = _within(pair, A, _along(inner_f, p, aside), unit)
            p = placed(pair, A, inner_f, n, unit)
    return Nearest(is_found, inner_f, inner_h, p, q, n, t, size, unit)


@kernel(inline=True)
def _aside(v, n):
    """What of v is across n."""
    m, w = dd.leading(n), dd.leading(v)
    return sub(w, scale(dot(w, m) / dot(m, m), m))


@kernel(inline=True)
def _along(f, placed_f, step):
    """A feature with its flat coordinate moved as near to a step as its line goes."""
    d = dd.leading(placed_f.d)
    s = dd.add(f.s, DD(dot(step, d) / dot(d, d), 0.0))
    return Feature(f.kind, f.end, f.flat, f.i, f.j, f.k, s, f.t)


@kernel(inline=True)
def _lean(f, h, p, q, n):
    """How far the flat directions are from being across n, at most [m]."""
    largest = 0.0
    if f.flat > 0:
        largest = abs(dd.inner(n, p.d).high)
    if f.flat > 1:
        largest = max(largest, abs(dd.inner(n, p.e).high))
    if h.flat > 0:
        largest = max(largest, abs(dd.inner(n, q.d).high))
    if h.flat > 1:
        largest = max(largest, abs(dd.inner(n, q.e).high))
    return largest


@kernel(inline=True)
def _moved(x, M, row, m):
    return dd.add(x, DD(M[(m + 1) * row + m], 0.0))


@kernel(inline=True)
def _with_flats(f, M, row, m):
    s = _moved(f.s, M, row, m) if f.flat > 0 else f.s
    t = _moved(f.t, M, row + 1, m) if f.flat > 1 else f.t
    return Feature(f.kind, f.end, f.flat, f.i, f.j, f.k, s, t)


# --- features -----------------------------------------------------------------------------------


@kernel
def _feature(pair, body, work, n_points, which, w, u, unit, flat):
    """The `Feature` of a body.   n_points : in the workspace that name vertices.

    w : outward, in its frame, of unit length.   u : the nearest point, about.
    """
    numbers, at = pair.numbers, body.params_at
    if body.kind == POINTS:
        return _vertices_below(pair, body, u) if n_points == 0 else _vertices(work, n_points, which)
    if body.kind == ELLIPSOID:
        return Feature(SMOOTH, 0.0, 0, -1, -1, -1, _ZERO, _ZERO)
    radius, half = numbers[at], numbers[at + 1]
    across = math.sqrt(w.x * w.x + w.y * w.y)
    beside = math.sqrt(u.x * u.x + u.y * u.y)
    end = 1.0 if w.z > 0.0 else -1.0
    if body.kind == CONE:
        share = 0.5 * (u.z + half) / half
        lean = (2.0 * half * w.z - radius * across) / math.sqrt(4.0 * half * half + radius * radius)
        if abs(lean) < flat and _INSIDE < share < 1.0 - _INSIDE:
            return Feature(SIDE, -1.0, 1, -1, -1, -1, DD(share, 0.0), _ZERO)
        if lean > 0.0:
            return Feature(TIP, 1.0, 0, -1, -1, -1, _ZERO, _ZERO)
        end = -1.0
    elif abs(w.z) < flat and abs(u.z) < half * (1.0 - _INSIDE):
        return Feature(SIDE, 0.0, 1, -1, -1, -1, DD(unit * u.z, 0.0), _ZERO)
    if across < flat and beside < radius * (1.0 - _INSIDE):
        return Feature(END, end, 2, -1, -1, -1, DD(unit * u.x, 0.0), DD(unit * u.y, 0.0))
    return Feature(RIM, end, 0, -1, -1, -1, _ZERO, _ZERO)


@kernel
def _vertices(work, n_points, which):
    """The vertex, edge or triangle of a polytope that GJK's simplex has the nearest point in."""
    ids, weights = work.ids, work.weights
    i, j, k = int(ids[which]), -1, -1
    s, t = 0.0, 0.0
    for m in range(1, n_points):
        v, share = int(ids[2 * m + which]), weights[m]
        if v == i:
            continue
        if j < 0 or v == j:
            j, s = v, s + share
        elif k < 0 or v == k:
            k, t = v, t + share
    flat = (1 if j >= 0 else 0) + (1 if k >= 0 else 0)
    return Feature(VERTEX, 0.0, flat, i, j, k, DD(s, 0.0), DD(t, 0.0))


@kernel
def _vertices_below(pair, body, u):
    """The vertex, edge or face of a box below a point u, or the vertices of a segment: for a single weighted point.

    Bits of a box's vertices tell their sides along x, y, z, z being the lowest bit (`hull/box_corners.py`).
    """
    if body.n <= 2:
        first, last = column_at(body.coords, body.padded, 0), column_at(body.coords, body.padded, body.n - 1)
        e = sub(last, first)
        square = dot(e, e)
        share = dot(sub(u, first), e) / square if square > 0.0 else 0.0
        inside = _INSIDE < share < 1.0 - _INSIDE
        i, j = (body.n - 1 if share > 0.5 else 0), (1 if inside else -1)
        return Feature(VERTEX, 0.0, 1 if inside else 0, 0 if inside else i, j, -1, DD(share, 0.0), _ZERO)
    i = (4 if u.x > 0.0 else 0) + (2 if u.y > 0.0 else 0) + (1 if u.z > 0.0 else 0)
    j, k, s, t = -1, -1, 0.0, 0.0
    for axis in range(3):
        half = pair.numbers[body.params_at + axis]
        share = 0.5 * (half - abs(u.x if axis == 0 else u.y if axis == 1 else u.z)) / half
        across = i ^ (4 >> axis)
        if share > _INSIDE and j < 0:
            j, s = across, share
        elif share > _INSIDE and k < 0:
            k, t = across, share
    return Feature(VERTEX, 0.0, (1 if j >= 0 else 0) + (1 if k >= 0 else 0), i, j, k, DD(s, 0.0), DD(t, 0.0))


@kernel
def placed(pair, body, f, u, unit):
    """The `Placed` feature of a body in the outward direction u, lengths times ``unit``."""
    poses, at, numbers, params = pair.poses, body.pose_at, pair.numbers, body.params_at
    none = DDVec3(_ZERO, _ZERO, _ZERO)
    if f.kind == VERTEX:
        x = dd.exact_vec3(scale(unit, column_at(body.coords, body.padded, f.i)))
        d = e = none
        if f.flat > 0:
            d = _edge(body, f.i, f.j, unit)
            x = dd.add_vec3(x, dd.times_vec3(f.s, d))
        if f.flat > 1:
            e = _edge(body, f.i, f.k, unit)
            x = dd.add_vec3(x, dd.times_vec3(f.t, e))
        return _flat_placed(turned(poses, at, x), turned(poses, at, d), turned(poses, at, e))
    if f.kind == SMOOTH:
        return _placed_ellipsoid(pair, body, u, unit)
    radius, half = DD(unit * numbers[params], 0.0), DD(unit * numbers[params + 1], 0.0)
    end = dd.scale(f.end, half)
    if f.kind == TIP:
        return _flat_placed(turned(poses, at, DDVec3(_ZERO, _ZERO, half)), none, none)
    if f.kind == END:
        d, e = DDVec3(DD(1.0, 0.0), _ZERO, _ZERO), DDVec3(_ZERO, DD(1.0, 0.0), _ZERO)
        x = DDVec3(f.s, f.t, end)
        return _flat_placed(turned(poses, at, x), turned(poses, at, d), turned(poses, at, e))
    w = turned_back(poses, at, u)
    across = dd.sqrt(dd.add(dd.mul(w.x, w.x), dd.mul(w.y, w.y)))
    if not across.high > 0.0:
        across = DD(1.0, 0.0)
    c, s = dd.div(w.x, across), dd.div(w.y, across)
    x = DDVec3(dd.mul(radius, c), dd.mul(radius, s), end)
    d = none
    bend = radius.high / across.high
    if f.kind == SIDE and body.kind == CYLINDER:
        d = DDVec3(_ZERO, _ZERO, DD(1.0, 0.0))
        x = DDVec3(x.x, x.y, f.s)
    elif f.kind == SIDE:
        d = DDVec3(dd.neg(x.x), dd.neg(x.y), dd.scale(2.0, half))
        x = dd.add_vec3(x, dd.times_vec3(f.s, d))
        bend *= 1.0 - f.s.high
    around = rotate(poses, at, Vec3(-s.high, c.high, 0.0))
    return Placed(
        turned(poses, at, x), turned(poses, at, d), none, bend * around.x * around.x, bend * around.y * around.y,
        bend * around.z * around.z, bend * around.x * around.y, bend * around.y * around.z, bend * around.z * around.x,
        bend, 1.0 / across.high,
    )


@kernel(inline=True)
def _flat_placed(point, d, e):
    """A feature that does not turn with the direction."""
    return Placed(point, d, e, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel(inline=True)
def _edge(body, i, j, unit):
    """From vertex i to vertex j."""
    start, end = column_at(body.coords, body.padded, i), column_at(body.coords, body.padded, j)
    return dd.scale_vec3(unit, dd.difference(end, start))


@kernel
def _placed_ellipsoid(pair, body, u, unit):
    poses, at, numbers, params = pair.poses, body.pose_at, pair.numbers, body.params_at
    none = DDVec3(_ZERO, _ZERO, _ZERO)
    w = turned_back(poses, at, u)
    a, b, c = DD(unit * numbers[params], 0.0), DD(unit * numbers[params + 1], 0.0), DD(unit * numbers[params + 2], 0.0)
    g = DDVec3(dd.mul(a, w.x), dd.mul(b, w.y), dd.mul(c, w.z))
    h = dd.sqrt(dd.inner(g, g))
    x = DDVec3(dd.div(dd.mul(a, g.x), h), dd.div(dd.mul(b, g.y), h), dd.div(dd.mul(c, g.z), h))
    p = turned(poses, at, x)
    y, over = dd.leading(p), 1.0 / h.high
    ax = scale(a.high, Vec3(poses[at], poses[at + 3], poses[at + 6]))
    ay = scale(b.high, Vec3(poses[at + 1], poses[at + 4], poses[at + 7]))
    az = scale(c.high, Vec3(poses[at + 2], poses[at + 5], poses[at + 8]))
    largest = max(max(a.high, b.high), c.high)
    return Placed(
        p, none, none, over * (ax.x * ax.x + ay.x * ay.x + az.x * az.x - y.x * y.x),
        over * (ax.y * ax.y + ay.y * ay.y + az.y * az.y - y.y * y.y),
        over * (ax.z * ax.z + ay.z * ay.z + az.z * az.z - y.z * y.z),
        over * (ax.x * ax.y + ay.x * ay.y + az.x * az.y - y.x * y.y),
        over * (ax.y * ax.z + ay.y * ay.z + az.y * az.z - y.y * y.z),
        over * (ax.z * ax.x + ay.z * ay.x + az.z * az.x - y.z * y.x),
        over * largest * largest, over * largest,
    )


@kernel(inline=True)
def turned(poses, at, x):
    """R x."""
    return DDVec3(
        dd.inner_vec3(vec3_at(poses, at), x), dd.inner_vec3(vec3_at(poses, at + 3), x),
        dd.inner_vec3(vec3_at(poses, at + 6), x)
    )


@kernel(inline=True)
def turned_back(poses, at, x):
    """Rᵀ x."""
    return DDVec3(
        dd.inner_vec3(Vec3(poses[at], poses[at + 3], poses[at + 6]), x),
        dd.inner_vec3(Vec3(poses[at + 1], poses[at + 4], poses[at + 7]), x),
        dd.inner_vec3(Vec3(poses[at + 2], poses[at + 5], poses[at + 8]), x)
    )


# --- Newton's step ------------------------------------------------------------------------------


@kernel
def _fill(M, f, h, p, q, n, gap, residual):
    """The equations of a step, an (m, m + 1) matrix."""
    m = 4 + f.flat + h.flat
    for k in range(m * (m + 1)):
        M[k] = 0.0
    w, y = m + 1, dd.leading(n)
    xy, yz, zx = -(p.xy + q.xy), -(p.yz + q.yz), -(p.zx + q.zx)
    _put(M, w, 0, -(p.xx + q.xx) - gap.high, xy, zx, -y.x, -residual.x.high)
    _put(M, w, 1, xy, -(p.yy + q.yy) - gap.high, yz, -y.y, -residual.y.high)
    _put(M, w, 2, zx, yz, -(p.zz + q.zz) - gap.high, -y.z, -residual.z.high)
    square = dd.sub(DD(1.0, 0.0), dd.inner(n, n))
    _put(M, w, 3, y.x, y.y, y.z, 0.0, 0.5 * square.high)
    row = 4
    for k in range(4):
        flats = f.flat if k < 2 else h.flat
        if k % 2 < flats:
            d = p.d if k == 0 else p.e if k == 1 else q.d if k == 2 else q.e
            z = dd.leading(d)
            sign = -1.0 if k < 2 else 1.0
            M[row], M[w + row], M[2 * w + row] = sign * z.x, sign * z.y, sign * z.z
            _put(M, w, row, z.x, z.y, z.z, 0.0, -dd.inner(n, d).high)
            row += 1


@kernel(inline=True)
def _put(M, w, row, x, y, z, g, right):
    at = w * row
    M[at], M[at + 1], M[at + 2], M[at + 3], M[at + w - 1] = x, y, z, g, right


@kernel
def _solve(M, m):
    """Gauss–Jordan with full pivots among the rows; the solution stands in the last column, 0 where a pivot is none."""
    w = m + 1
    for k in range(m):
        best = k
        for i in range(k + 1, m):
            if abs(M[w * i + k]) > abs(M[w * best + k]):
                best = i
        largest = 0.0
        for j in range(m):
            largest = max(largest, abs(M[w * best + j]))
        if not abs(M[w * best + k]) > 1e-13 * largest or largest == 0.0:
            for i in range(m):
                M[w * i + k] = 0.0
            M[w * k + k] = 1.0
            for j in range(k + 1, w):
                M[w * k + j] = 0.0
            continue
        if best != k:
            for j in range(k, w):
                M[w * k + j], M[w * best + j] = M[w * best + j], M[w * k + j]
        over = 1.0 / M[w * k + k]
        for j in range(k, w):
            M[w * k + j] *= over
        for i in range(m):
            factor = M[w * i + k]
            if i != k and factor != 0.0:
                for j in range(k, w):
                    M[w * i + j] -= factor * M[w * k + j]


@kernel(inline=True)
def _is_moved(f, g):
    """Whether flat coordinates differ."""
    return f.s.high != g.s.high or f.s.low != g.s.low or f.t.high != g.t.high or f.t.low != g.t.low


@kernel
def _within(pair, body, f, unit):
    """The feature with its flat coordinates within the set."""
    numbers, params = pair.numbers, body.params_at
    s, t = f.s, f.t
    if f.kind == VERTEX and f.flat > 0:
        s, t = _clamped(s, 0.0, 1.0), _clamped(t, 0.0, 1.0)
        total = dd.add(s, t)  # in doubles a sum of 1 may be rounded down from more, and the point is beyond the edge
        if dd.less(DD(1.0, 0.0), total):
            share = (1.0 - 2.0**-50) / total.high
            s, t = DD(s.high * share, 0.0), DD(t.high * share, 0.0)
    elif f.kind == SIDE:
        half = unit * numbers[params + 1]
        s = _clamped(s, -half, half) if body.kind == CYLINDER else _clamped(s, 0.0, 1.0)
    elif f.kind == END:
        beside = math.sqrt(s.high * s.high + t.high * t.high)
        radius = unit * numbers[params] * (1.0 - 2.0**-50)
        if beside > radius:
            s, t = DD(s.high * radius / beside, 0.0), DD(t.high * radius / beside, 0.0)
    return Feature(f.kind, f.end, f.flat, f.i, f.j, f.k, s, t)


@kernel(inline=True)
def _clamped(x, low, high):
    if x.high <= low:
        return DD(low, 0.0)
    return DD(high, 0.0) if x.high >= high else x


@kernel
def beyond(pair, body, p, u, unit, work):
    """How much farther a body reaches along u than its placed feature does.

    A rim and an ellipsoid's point are where the reach is taken: nothing, but for an end of a cylinder or cone that is
    reached farther: 2 h |u_z| for a cylinder, the tip's lead over the rim for a cone.
    """
    poses, at = pair.poses, body.pose_at
    if body.kind == POINTS:
        reach = _reach_of_vertices(body, turned_back(poses, at, u), reach_of(pair, body), work)
        return dd.sub(dd.scale(unit, reach), dd.inner(u, p.point))
    if body.kind == ELLIPSOID:
        return _ZERO
    return dd.sub(curved_reach(pair, body, turned_back(poses, at, u), unit), dd.inner(u, p.point))


@kernel
def curved_reach(pair, body, w, unit):
    """How far a cylinder, cone or ellipsoid reaches along w, in its frame, times |w|, lengths times ``unit``."""
    numbers, params = pair.numbers, body.params_at
    if body.kind == ELLIPSOID:
        a, b, c = numbers[params], numbers[params + 1], numbers[params + 2]
        g = DDVec3(
            dd.mul(DD(unit * a, 0.0), w.x), dd.mul(DD(unit * b, 0.0), w.y), dd.mul(DD(unit * c, 0.0), w.z)
        )
        return dd.sqrt(dd.inner(g, g))
    across = dd.sqrt(dd.add(dd.mul(w.x, w.x), dd.mul(w.y, w.y)))
    rim, along = dd.mul(DD(unit * numbers[params], 0.0), across), dd.mul(DD(unit * numbers[params + 1], 0.0), w.z)
    if body.kind == CYLINDER:
        return dd.add(rim, along if along.high > 0.0 else dd.neg(along))
    reach = dd.sub(rim, along)
    return along if dd.less(reach, along) else reach


@kernel
def _reach_of_vertices(body, w, farthest, work):
    """farthest : of a vertex from the frame's origin; doubles are off by 8u of that along w."""
    ties = view_i64(work.ties_at, MAX_TIES + 1)
    g = neg(dd.leading(w))
    best, at = math.inf, 0
    for k in range(body.n):
        value = dot(column_at(body.coords, body.padded, k), g)
        if value < best:
            best, at = value, k
    ties[0] = at
    n_tied, _ = tied_vertices(vertices_of(body), ties, g, 2.0**-48 * farthest)
    largest = DD(-math.inf, 0.0)
    if n_tied > MAX_TIES:
        return DD(math.inf, 0.0)
    for k in range(n_tied):
        value = dd.inner(dd.exact_vec3(column_at(body.coords, body.padded, ties[k])), w)
        if dd.less(largest, value):
            largest = value
    return largest
