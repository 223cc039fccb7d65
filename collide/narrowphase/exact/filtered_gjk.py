"""The search of `exact_gjk.py` in double-doubles with proven bounds: integers are asked where a sign stays unproven.

Step by step the same search: the same subsets of the simplex, the same vertices, the same end. Every sign is proven
(`bounded.sign`); an unproven sign ends the search, and integers begin from the first simplex. The signs are Johnson's
Δ, written for their meaning:

* Δ_j(X ∪ j) = ΣΔ · v·(y_k − y_j), v the nearest point of the plane, the line or the point spanned by X and k in X. The
  direction d is a positive multiple of v, so the sign is the sign of d·(y_k − y_j): of degree 3, 4 or 2 instead of 6,
  4, 2.
* Three points with Δ_i > 0 for all three are independent (ΣΔ is the square of twice the area), the nearest point is a
  sum with positive weights in a single way, and no smaller subset can have the nearest point.
* d is across the simplex, so an axis of a body's frame is across d where differences of the simplex's points say so to
  the last bit (`_axes_across`): vertices of a face of a box, and boxes turned alike. Vertices that differ along these
  axes alone are level, as are vertices of two points with the same vertex of the other body: zeros, hidden by rounding.
* The nearest point of four independent points has positive weights for a single subset: any proven subset will do.

`side_of_facets` proves the same way which facet's plane is nearest to the origin of an overlap.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.lowering.shape_table import INTS, LOWEST, POSE_SLOP, POSE_TERMS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.exact.johnson import count_of, has_pair
from collide.numerics import bounded
from collide.numerics.bounded import UNKNOWN, Bounded, BoundedVec3
from collide.numerics.vec3 import Vec3, column_at, cross, dot, neg, norm, norm1, rotate_back, scale, sub

#: How a search ends: a sign is left to integers; the cores share a point; they do not.
OPEN, MEET, APART = range(3)
#: Of facets that may be nearest: nothing is proven; one lies in a plane through the origin with no vertex beyond it, so
#: that the depth is 0; the only one is nearest, the origin behind it and no vertex beyond its plane.
NOTHING, THROUGH_ORIGIN, OUTERMOST = range(3)
#: Rounds after which integers take over.
_ROUNDS = 16
#: Doubles of a point; doubles of workspace.
_POINT = 9
DOUBLES = 4 * _POINT
#: Where the first simplex stands behind the simplex.
_FIRST_AT = 8
# What goes in: entries of poses are 0 or at least so large, with no bit below 2⁻¹¹³; no bit of a vertex is below
# 2^_LOWEST_BIT. So no bit of a point is below 2⁻²¹³, and of no product of four points, the highest degree here, below
# 2⁻⁸⁵². Bounds of errors are sums of bits rounded off, and of parts 2⁻⁵¹ of those: none is below 2⁻⁹⁶⁰ but 0.
_SMALLEST_ENTRY, _LOWEST_BIT, _LARGEST_SIZE = 2.0**-60, -100, 2.0**60
#: What doubles leave in doubt, in units of the terms named at each sign: 2⁶u.
_ROUNDED = 2.0**-47
#: A direction is good enough to propose vertices by: as good as `direction_double`.
_GOOD_DIRECTION = 2.0**-52


class FilteredSearch(NamedTuple):
    """How the search ended, with how many points, after how many rounds."""

    end: int
    n: int
    rounds: int


class Simplex(NamedTuple):
    """n points by their vertex pairs, from ids[at] on."""

    ids: Any
    at: int
    n: int


class Direction(NamedTuple):
    """The sign of d, 0 or 1, or UNKNOWN; and d, a positive multiple of the nearest point of a simplex."""

    sign: int
    d: BoundedVec3


@kernel
def is_filtered(ordered):
    """Whether the filter takes an `OrderedPair`: poses as given, nothing tiny or huge, cores that are scanned."""
    pair = ordered.pair
    A, B = pair.A, pair.B
    if A.tree != 0 or B.tree != 0 or not 0.0 < ordered.size <= _LARGEST_SIZE:
        return False
    lowest = min(ordered.ints[INTS * A.shape + LOWEST], ordered.ints[INTS * B.shape + LOWEST])
    return lowest >= _LOWEST_BIT and _is_plain(pair.poses, A.pose_at) and _is_plain(pair.poses, B.pose_at)


@kernel(inline=True)
def _is_plain(poses, p):
    is_plain = poses[p + POSE_SLOP] == 0.0 and poses[p + POSE_TERMS] < 0.0
    for k in range(12):
        is_plain = is_plain and (poses[p + k] == 0.0 or abs(poses[p + k]) >= _SMALLEST_ENTRY)
    return is_plain


@kernel
def search_filtered(ordered, ids, points):
    """The `FilteredSearch` of an `OrderedPair` taken by `is_filtered`.

    ids : in, three vertex pairs; out, the vertex pairs of the deciding simplex, in the order of `touch_exactly`; as
    before where the end is OPEN.   points : view of DOUBLES doubles.
    """
    for k in range(6):
        ids[_FIRST_AT + k] = ids[k]
    search = _search(ordered, ids, points)
    if search.end == OPEN:
        for k in range(6):
            ids[k] = ids[_FIRST_AT + k]
    return search


@kernel
def _search(ordered, ids, points):
    pair = ordered.pair
    error = ERROR * ordered.size + ordered.slop
    for k in range(3):
        _put_point(pair, points, k, ids[2 * k], ids[2 * k + 1])
    n = 3
    mask = _nearest_subset(points, n, -1)
    for rounds in range(1, _ROUNDS + 1):
        n = _reduce(points, ids, mask, n)
        if n == 0:
            return FilteredSearch(OPEN, 0, rounds)
        direction = _direction(points, n)
        if direction.sign == 0:
            return FilteredSearch(MEET, n, rounds)
        i, j = (-1, -1) if direction.sign == UNKNOWN else _support_pair(pair, ids, n, direction.d, error)
        if i < 0 or j < 0:
            return FilteredSearch(OPEN, n, rounds)
        if has_pair(ids, n, i, j):
            return FilteredSearch(APART, n, rounds)
        ids[2 * n] = i
        ids[2 * n + 1] = j
        _put_point(pair, points, n, i, j)
        beyond = 0
        nearer = _side_of_difference(direction.d, points, 0, n)
        if nearer == UNKNOWN and n == 3:  # integers go on from an edge's search: there the first simplex is to stay
            nearer = _side_of_vertices(pair, Simplex(ids, 0, n), direction.d, i, j)
        if nearer == UNKNOWN:
            return FilteredSearch(OPEN, n, rounds)
        if nearer <= 0:
            return FilteredSearch(APART, n, rounds)
        if n == 3:
            beyond = _separating_faces(points)
            if beyond == 0:
                return FilteredSearch(MEET, 4, rounds)
            if beyond >= 8:
                return FilteredSearch(OPEN, n, rounds)
            if beyond & (beyond - 1) == 0:
                n = _reduce(points, ids, 15 & ~beyond, 4) - 1
        mask = _nearest_subset(points, n + 1, n) if n < 3 else _nearest_of_four(points, beyond)
        n += 1
    return FilteredSearch(OPEN, n, _ROUNDS)


# --- points ---------------------------------------------------------------------------------------


@kernel
def _put_point(pair, points, k, i, j):
    """Point k becomes R_A a − R_B b − (p_WB − p_WA) of vertices i of A and j of B."""
    A, B, poses = pair.A, pair.B, pair.poses
    a, b = column_at(A.coords, A.padded, i), column_at(B.coords, B.padded, j)
    for axis in range(3):
        p, q = A.pose_at + 3 * axis, B.pose_at + 3 * axis
        total = Bounded(poses[A.pose_at + 9 + axis], 0.0, 0.0)
        total = bounded.add_product(total, -1.0, poses[B.pose_at + 9 + axis])
        total = _add_product(total, poses[p], a.x)
        total = _add_product(total, poses[p + 1], a.y)
        total = _add_product(total, poses[p + 2], a.z)
        total = _add_product(total, -poses[q], b.x)
        total = _add_product(total, -poses[q + 1], b.y)
        total = _add_product(total, -poses[q + 2], b.z)
        bounded.put(points, _POINT * k + 3 * axis, bounded.settled(total))


@kernel(inline=True)
def _add_product(total, x, y):
    """`bounded.add_product`, left out where an entry of a rotation is 0: two of three, of bodies along the axes."""
    return total if x == 0.0 else bounded.add_product(total, x, y)


@kernel(inline=True)
def _point(points, k):
    return bounded.vec3_at(points, _POINT * k)


@kernel
def face_at(points):
    """Point 0, and a normal of points 0, 1, 2: (y₁ − y₀) × (y₂ − y₁)."""
    p, q = _point(points, 0), _point(points, 1)
    return p, bounded.cross(bounded.sub_vec3(q, p), bounded.sub_vec3(_point(points, 2), q))


@kernel(inline=True)
def _leading(points, k):
    """Point k as doubles have it: the sum of its coordinates is off by 2u of its `_size`."""
    return Vec3(points[_POINT * k], points[_POINT * k + 3], points[_POINT * k + 6])


@kernel(inline=True)
def _size(points, k):
    """The sum of point k's coordinates, and 2⁵³ times that of their errors."""
    at = _POINT * k
    return norm1(_leading(points, k)) + 2.0**53 * (points[at + 2] + points[at + 5] + points[at + 8])


@kernel
def _side_of_difference(d, points, i, j):
    """Sign of d·(point i − point j), or UNKNOWN.

    Doubles first: with P the `_size` of the points, d off by u|d| and its error, and the difference, of at most 2P, by
    4uP, they are off by 14u·P·|d| and 2P times the error.
    """
    leading = Vec3(d.x.high, d.y.high, d.z.high)
    side = dot(leading, sub(_leading(points, i), _leading(points, j)))
    error = d.x.error + d.y.error + d.z.error
    if abs(side) > (_ROUNDED * norm1(leading) + 4.0 * error) * max(_size(points, i), _size(points, j)):
        return 1 if side > 0.0 else -1
    return bounded.sign(bounded.dot(d, bounded.sub_vec3(_point(points, i), _point(points, j))))


@kernel
def _reduce(points, ids, mask, n):
    """Drop all but the points of the subset; returns how many remain."""
    n_kept = 0
    for k in range(n):
        if (mask >> k) & 1:
            if n_kept != k:
                ids[2 * n_kept] = ids[2 * k]
                ids[2 * n_kept + 1] = ids[2 * k + 1]
                for j in range(_POINT):
                    points[_POINT * n_kept + j] = points[_POINT * k + j]
            n_kept += 1
    return n_kept


# --- subsets --------------------------------------------------------------------------------------


@kernel
def _nearest_subset(points, n, newest):
    """`johnson.nearest_subset` of up to three points; 0 where a sign it goes by is not proven."""
    if n == 3 and _has_foot(points, 0, 1, 2):
        return 7
    for count in range(1, 3):
        for mask in range(1, 1 << n):
            if count_of(mask) != count or (newest >= 0 and not (mask >> newest) & 1):
                continue
            answer = _is_nearest(points, n, mask)
            if answer == UNKNOWN:
                return 0
            if answer == 1:
                return mask
    return 0


@kernel
def _nearest_of_four(points, beyond):
    """`johnson.nearest_subset` of four independent points if the subset is a face with the last point; else 0.

    beyond : of `_separating_faces`. The points lie behind a face named here, the origin before the face: the origin's
        foot on the plane is the nearest point if the foot lies within the face.
    """
    for k in range(3):
        if (beyond >> k) & 1 and _has_foot(points, 0 if k != 0 else 1, 2 if k != 2 else 1, 3):
            return 15 & ~(1 << k)
    return 0


@kernel
def _has_foot(points, i, j, k):
    """Whether Δ > 0 is proven for three points: Δ of a point is normal · (the product of the next two).

    Doubles first. With P the `_size` of the points, the edges e and f are off by 4uP each, and their product by
    15uP·(|e| + |f|) of at most P·(|e| + |f|); a product of two points is off by 11uP² of at most P².
    """
    p, q, r = _leading(points, i), _leading(points, j), _leading(points, k)
    e, f = sub(q, p), sub(r, q)
    normal = cross(e, f)
    least = min(min(dot(normal, cross(q, r)), dot(normal, cross(r, p))), dot(normal, cross(p, q)))
    size = max(max(_size(points, i), _size(points, j)), _size(points, k))
    rounded = _ROUNDED * (size * size * size) * (norm1(e) + norm1(f))
    if abs(least) > rounded:
        return least > 0.0
    return _has_fine_foot(_point(points, i), _point(points, j), _point(points, k))


@kernel
def _has_fine_foot(p, q, r):
    normal = bounded.cross(bounded.sub_vec3(q, p), bounded.sub_vec3(r, q))
    if bounded.sign(bounded.dot(normal, bounded.cross(q, r))) != 1:
        return False
    if bounded.sign(bounded.dot(normal, bounded.cross(r, p))) != 1:
        return False
    return bounded.sign(bounded.dot(normal, bounded.cross(p, q))) == 1


@kernel
def _is_nearest(points, n, mask):
    """1 if the nearest point of n points lies in a subset of a point or two, with every Δ > 0; else 0, or UNKNOWN."""
    i = 0 if mask & 1 else 1 if mask & 2 else 2
    j = i if mask == 1 << i else 2 if mask & 4 else 1
    d = _point(points, i)
    answer = 1
    if i != j:
        e = _point(points, j)
        along = bounded.sub_vec3(e, d)
        of_d, of_e = bounded.dot(e, along), bounded.neg(bounded.dot(d, along))
        answer = _both(answer, _is_positive(of_d))
        answer = _both(answer, _is_positive(of_e))
        if answer == 0:
            return 0
        d = bounded.add_vec3(bounded.scale_vec3(of_d, d), bounded.scale_vec3(of_e, e))
    for k in range(n):
        if answer != 0 and not (mask >> k) & 1:
            nearer = _side_of_difference(d, points, i, k)
            answer = _both(answer, UNKNOWN if nearer == UNKNOWN else 1 if nearer <= 0 else 0)
    return answer


@kernel(inline=True)
def _is_positive(a):
    side = bounded.sign(a)
    return UNKNOWN if side == UNKNOWN else 1 if side == 1 else 0


@kernel(inline=True)
def _both(a, b):
    """a and b, of 0, 1 and UNKNOWN."""
    return 0 if a == 0 or b == 0 else max(a, b)


@kernel
def _direction(points, n):
    """The `Direction` of n points, every point with Δ > 0."""
    p = _point(points, 0)
    d = p
    if n == 2:
        q = _point(points, 1)
        along = bounded.sub_vec3(q, p)
        d = bounded.add_vec3(
            bounded.scale_vec3(bounded.dot(q, along), p), bounded.scale_vec3(bounded.neg(bounded.dot(p, along)), q)
        )
    if n == 3:
        p, d = face_at(points)
        side = bounded.sign(bounded.dot(d, p))
        if side == -1:
            return Direction(1, bounded.neg_vec3(d))
        return Direction(side, d)
    x, y, z = bounded.sign(d.x), bounded.sign(d.y), bounded.sign(d.z)
    if abs(x) == 1 or abs(y) == 1 or abs(z) == 1:
        return Direction(1, d)
    return Direction(max(x, y, z), d)


@kernel
def _separating_faces(points):
    """`exact_gjk._separating_faces`; 8 or more where a sign is 0 or not proven."""
    beyond = _is_beyond(points, 1, 2, 0)
    beyond |= _is_beyond(points, 2, 0, 1) << 1
    return beyond | _is_beyond(points, 0, 1, 2) << 2


@kernel
def _is_beyond(points, i, j, k):
    """1 where the face through point 3, i and j parts the origin from point k, 0 where not, or 8.

    Doubles first: with P the `_size` of the points, the edges f and g are off by 4uP each, and their product by
    15uP·(|f| + |g|) of at most P·(|f| + |g|); along the third edge, of at most 2P, that makes 42u·P²·(|f| + |g|).
    """
    apex = _leading(points, 3)
    f, g = sub(_leading(points, i), apex), sub(_leading(points, j), apex)
    normal = cross(f, g)
    origin, side = dot(normal, neg(apex)), dot(normal, sub(_leading(points, k), apex))
    size = max(max(_size(points, 3), _size(points, i)), max(_size(points, j), _size(points, k)))
    if min(abs(origin), abs(side)) > _ROUNDED * (size * size) * (norm1(f) + norm1(g)):
        return 1 if (origin > 0.0) != (side > 0.0) else 0
    return _is_beyond_finely(_point(points, 3), _point(points, i), _point(points, j), _point(points, k))


@kernel
def _is_beyond_finely(apex, p, q, r):
    normal = bounded.cross(bounded.sub_vec3(p, apex), bounded.sub_vec3(q, apex))
    origin = bounded.sign(bounded.dot(normal, bounded.neg_vec3(apex)))
    side = bounded.sign(bounded.dot(normal, bounded.sub_vec3(r, apex)))
    if origin == 0 or origin == UNKNOWN or side == 0 or side == UNKNOWN:
        return 8
    return 1 if origin != side else 0


# --- supports -------------------------------------------------------------------------------------


@kernel
def _support_pair(pair, ids, n, d, error):
    """`exact_supports.support_pair`: vertices (i, j); −1 where a comparison is not proven.   ids, n : the simplex."""
    direction = Vec3(d.x.high, d.y.high, d.z.high)
    if not d.x.error + d.y.error + d.z.error <= _GOOD_DIRECTION * norm1(direction):
        return -1, -1
    slack = 2.0 * error * norm(direction)
    simplex = Simplex(ids, 0, n)
    i = _extreme_vertex(pair, 0, simplex, d, direction, slack, 1.0)
    return i, _extreme_vertex(pair, 1, simplex, d, direction, slack, -1.0) if i >= 0 else -1


@kernel
def _extreme_vertex(pair, body, simplex, d, direction, slack, sign):
    """`exact_supports._extreme_vertex` of A (body 0) or B (body 1); −1 where a comparison is not proven."""
    hull = pair.A if body == 0 else pair.B
    g = scale(sign, rotate_back(pair.poses, hull.pose_at, direction))
    least = math.inf
    for i in range(hull.n):
        least = min(least, dot(column_at(hull.coords, hull.padded, i), g))
    best = -1
    is_turned = False
    turned = d
    for i in range(hull.n):
        if dot(column_at(hull.coords, hull.padded, i), g) > least + slack:
            continue
        if best < 0:
            best = i
            continue
        if not is_turned:
            turned = _rotate_back(pair.poses, hull.pose_at, d)
            is_turned = True
        side = _compare(pair, body, simplex, turned, i, best)
        if side == UNKNOWN:
            return -1
        if side * sign < 0:
            best = i
    return best


@kernel(cold=True)
def _side_of_vertices(pair, simplex, d, i, j):
    """`_side_of_difference` of the simplex's first point and the support point (i, j), body by body, or UNKNOWN.

    No vertex of the first point lies before the support's vertex of the same body, so a body's sign is 1 or 0.
    """
    at = simplex.at
    side_of_a = _compare(pair, 0, simplex, _rotate_back(pair.poses, pair.A.pose_at, d), simplex.ids[at], i)
    side_of_b = _compare(pair, 1, simplex, _rotate_back(pair.poses, pair.B.pose_at, d), j, simplex.ids[at + 1])
    return 1 if side_of_a == 1 or side_of_b == 1 else max(side_of_a, side_of_b)


@kernel
def _rotate_back(poses, p, d):
    """Rᵀd."""
    return BoundedVec3(_along(poses, p, d), _along(poses, p + 1, d), _along(poses, p + 2, d))


@kernel
def _along(poses, at, d):
    """A column of R times d."""
    x, y, z = Bounded(poses[at], 0.0, 0.0), Bounded(poses[at + 3], 0.0, 0.0), Bounded(poses[at + 6], 0.0, 0.0)
    return bounded.sparse_dot(BoundedVec3(x, y, z), d)


@kernel
def _compare(pair, body, simplex, turned, i, j):
    """Sign of (Rᵀd)·(a_i − a_j), or UNKNOWN.   turned : Rᵀd.   simplex : that d is across."""
    hull = pair.A if body == 0 else pair.B
    difference = _difference(hull, i, j)
    side = bounded.sign(bounded.sparse_dot(difference, turned))
    if side == UNKNOWN:
        is_level = _is_side(body, simplex, i, j) or _axes_of(difference) & ~_axes_across(pair, body, simplex) == 0
        return 0 if is_level else UNKNOWN
    return side


@kernel(cold=True)
def _is_side(body, simplex, i, j):
    """Whether vertices i and j of a body make two points of the simplex with the same vertex of the other body."""
    for k in range(simplex.n):
        for m in range(simplex.n):
            at, other_at = simplex.at + 2 * k, simplex.at + 2 * m
            is_pair = simplex.ids[at + body] == i and simplex.ids[other_at + body] == j
            if is_pair and simplex.ids[at + 1 - body] == simplex.ids[other_at + 1 - body]:
                return True
    return False


@kernel
def _difference(hull, i, j):
    a, b = column_at(hull.coords, hull.padded, i), column_at(hull.coords, hull.padded, j)
    return BoundedVec3(
        bounded.exact_difference(a.x, b.x), bounded.exact_difference(a.y, b.y), bounded.exact_difference(a.z, b.z)
    )


@kernel
def _axes_of(v):
    """The axes along which an exact vector is not 0: bit 0 for x."""
    return (1 if v.x.high != 0.0 else 0) | (2 if v.y.high != 0.0 else 0) | (4 if v.z.high != 0.0 else 0)


@kernel(cold=True)
def _axes_across(pair, body, simplex):
    """Axes of a body's frame proven to be across every direction across the simplex, three independent points or two.

    A difference of two points is R w where their vertices of the other body are the same, or both bodies are turned
    alike. If only one coordinate of w is not 0, its axis is across; and two are, if w of three points has no third.
    """
    axes, axes_of_all = 0, 0
    for k in range(simplex.n):
        others = _axes_between(pair, body, simplex, k, k + 1 if k + 1 < simplex.n else 0)
        if others == 1 or others == 2 or others == 4:
            axes |= others
        axes_of_all |= others
    if simplex.n == 3 and axes_of_all < 7:  # 3, 5, 6: three points along a single axis are not independent
        axes |= axes_of_all
    return axes


@kernel
def _axes_between(pair, body, simplex, k, m):
    """`_axes_of` w, where points k and m of the simplex differ by R w of a body; else 7, all axes."""
    at, other_at = simplex.at + 2 * k, simplex.at + 2 * m
    i, j = simplex.ids[at], simplex.ids[other_at]
    r, s = simplex.ids[at + 1], simplex.ids[other_at + 1]
    of_a, of_b = _difference(pair.A, i, j), _difference(pair.B, r, s)
    if r == s and body == 0:
        return _axes_of(of_a)
    if i == j and body == 1:
        return _axes_of(of_b)
    for axis in range(9):
        if pair.poses[pair.A.pose_at + axis] != pair.poses[pair.B.pose_at + axis]:
            return 7
    return _axes_of(bounded.sub_vec3(of_a, of_b)) | _axes_of_errors(bounded.sub_vec3(of_a, of_b))


@kernel
def _axes_of_errors(v):
    return (1 if v.x.error > 0.0 else 0) | (2 if v.y.error > 0.0 else 0) | (4 if v.z.error > 0.0 else 0)


# --- depths ---------------------------------------------------------------------------------------


@kernel
def side_of_facets(ordered, requests, request_at, points):
    """What is proven of the facets asked for, as `nearest_plane` judges them: NOTHING, THROUGH_ORIGIN or OUTERMOST.

    Arguments as in `nearest_plane` and `search_filtered`. Vertices of both bodies are judged apart: (i, j) is extreme
    among all pairs where i is among the vertices of A and j among those of B.
    """
    pair, n_facets = ordered.pair, requests[request_at + 1]
    error = ERROR * ordered.size + ordered.slop
    for k in range(n_facets):
        facet = Simplex(requests, request_at + 2 + 6 * k, 3)
        for corner in range(3):
            at = facet.at + 2 * corner
            _put_point(pair, points, corner, requests[at], requests[at + 1])
        p, outwards = face_at(points)
        side = bounded.sign(bounded.dot(outwards, p))
        if side == 1 and n_facets == 1 and requests[request_at] == 1:
            return OUTERMOST if _is_outermost(pair, facet, outwards, error) else NOTHING
        x, y, z = bounded.sign(outwards.x), bounded.sign(outwards.y), bounded.sign(outwards.z)
        if side != 0 or not (abs(x) == 1 or abs(y) == 1 or abs(z) == 1):
            continue
        if _is_outermost(pair, facet, outwards, error) or _is_outermost(
            pair, facet, bounded.neg_vec3(outwards), error
        ):
            return THROUGH_ORIGIN
    return NOTHING


@kernel
def _is_outermost(pair, facet, normal, error):
    """Whether no vertex of A ⊖ B is proven to lie beyond a facet along its normal."""
    i, j = facet.ids[facet.at], facet.ids[facet.at + 1]
    return _is_extreme(pair, 0, facet, normal, i, 1, error) and _is_extreme(pair, 1, facet, normal, j, -1, error)


@kernel
def _is_extreme(pair, body, facet, normal, i, sign, error):
    """Whether no vertex of a body lies farther along the facet's normal, or against it (sign −1), than vertex i."""
    hull = pair.A if body == 0 else pair.B
    turned = _rotate_back(pair.poses, hull.pose_at, normal)
    # Doubles first, as for `_extreme_vertex`: what they put behind vertex i by more than they round is behind.
    g = Vec3(turned.x.high, turned.y.high, turned.z.high)
    is_good = turned.x.error + turned.y.error + turned.z.error <= _GOOD_DIRECTION * norm1(g)
    limit = dot(column_at(hull.coords, hull.padded, i), g) * sign - (2.0 * error * norm1(g) if is_good else math.inf)
    for k in range(hull.n):
        if k != i and dot(column_at(hull.coords, hull.padded, k), g) * sign >= limit:
            side = _compare(pair, body, facet, turned, k, i)
            if side == UNKNOWN or side * sign > 0:
                return False
    return True
