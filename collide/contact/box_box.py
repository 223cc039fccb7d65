"""A box and a box, a sphere or a capsule by separating axes: rows of `distance` good enough for contacts where a face
decides.

Of the 15 axes (S. Gottschalk, M. Lin, D. Manocha, "OBBTree", 1996, theorem 1) the axis of least overlap, or of widest
gap, is the normal. Along a face's axis the answer is proven here; edges against edges, and matrices farther from a
rotation than rounding, are left to the general narrowphase.

The segment of a capsule and the centre of a sphere are boxes without width, swept by a ball. Axes that are normals of
no facet of the Minkowski difference do no harm: along no axis is the gap wider than the distance, or the overlap less
than the depth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.contact.posed_box import box_at
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, RANK
from collide.narrowphase.rows import (
    BEYOND,
    CERTIFIED,
    DISTANCE,
    HIT,
    HOW,
    LOWER,
    NORMAL,
    POINT_A,
    POINT_B,
    UPPER,
    view_row,
)
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    add,
    component,
    cross,
    dot,
    neg,
    norm1,
    put_vec3,
    scale,
    sub,
    vec3_at,
)
from collide.results import PLANE, SIMPLEX

_U = 2.0**-53
#: Matrices farther from a rotation than this are none.
_ORTHONORMAL = 2.0**-44
#: Edges are parallel where the sine of their angle is below this: what their axis could tell is bounded instead.
_PARALLEL = 2.0**-46
#: A bracket wider than this part of the size is left to the general narrowphase.
_WIDEST = 2.0**-40


class EdgeAxes(NamedTuple):
    """The widest gap along axes across two edges.

    gap, sine : along the axis, and of the edges' angle.   a, b : the boxes' axes along these edges.
    upper : bound of all gaps measured.   missed : bound of the excess of gaps left out, of edges too nearly parallel.
    """

    gap: float
    sine: float
    a: int
    b: int
    upper: float
    missed: float


class FaceAxis(NamedTuple):
    """The face axis of widest gap: 0, 1, 2 of A, 3, 4, 5 of B; the gap along it, negative where boxes overlap."""

    axis: int
    gap: float


class BoxEnd(NamedTuple):
    """What an axis of a box adds to the box's lowest corner along a direction, and, for an axis across the direction
    (is_flat 1.0), from the corner to the middle of the axis's edge; else 0."""

    corner: Vec3
    side: Vec3
    is_flat: float


@kernel(inline=True)
def _in_frame(box, v):
    return Vec3(dot(box.x, v), dot(box.y, v), dot(box.z, v))


@entry("boolean(int64, int64, int64, int64, float64, int64)")
def box_row(ints_at, numbers_at, XA_at, XB_at, limit, row_at):
    """`put_box_row` of rows 0 and 1 of a `ShapeTable`, by itself: for tests and measurements."""
    return put_box_row(ints_at, numbers_at, 0, 1, view_f64(XA_at, 16), view_f64(XB_at, 16), limit, view_row(row_at))


@kernel(inline=True)
def put_box_row(ints_at, numbers_at, sa, sb, X_WA, X_WB, limit, row):
    """The row of one pair, by their rows of the `ShapeTable` (`has_box_row`); False where no face decides.

    XA, XB : matrices.   limit : larger gaps are said to be beyond, without bracket [m].   row : of PAIR_DTYPE, zeroed.
    Of a decided row the numbers, the normal and two points are set, as a manifold needs, no vertices.
    """
    n = max(sa, sb) + 1
    ints, numbers = view_i64(ints_at, INTS * n), view_f64(numbers_at, NUMBERS * n)
    A, B = box_at(ints, numbers, sa, X_WA), box_at(ints, numbers, sb, X_WB)
    # The same numbers are worked on whichever way round the pair is asked; a box is before what has no faces.
    flip = ints[INTS * sb + RANK] < ints[INTS * sa + RANK]
    if A.half.x == 0.0 or B.half.x == 0.0:
        flip = A.half.x == 0.0
    elif ints[INTS * sb + RANK] == ints[INTS * sa + RANK]:
        for k in range(12):
            if X_WA[k] != X_WB[k]:
                flip = X_WB[k] < X_WA[k]
                break
    if not flip:
        return _put_row(A, B, limit, row)
    is_decided = _put_row(B, A, limit, row)
    doubles = row.doubles
    on_a, on_b, nhat = vec3_at(doubles, POINT_A), vec3_at(doubles, POINT_B), vec3_at(doubles, NORMAL)
    put_vec3(doubles, POINT_A, on_b)
    put_vec3(doubles, POINT_B, on_a)
    put_vec3(doubles, NORMAL, add(neg(nhat), Vec3(0.0, 0.0, 0.0)))
    return is_decided


@kernel
def _put_row(A, B, limit, row):
    """Write the row of two boxes; False where it takes more than faces."""
    off = max(A.off, B.off)
    if not off <= _ORTHONORMAL:
        return False
    t = sub(B.p, A.p)
    radius = A.radius + B.radius
    size = norm1(A.half) + norm1(B.half) + norm1(t) + radius
    # Each gap is a sum of products of columns: 16u of the size, and what the matrices are off.
    error = (16.0 * _U + 2.0 * off) * size
    c0, c1, c2 = _in_frame(A, B.x), _in_frame(A, B.y), _in_frame(A, B.z)  # columns: B's axes in A
    r0, r1, r2 = Vec3(c0.x, c1.x, c2.x), Vec3(c0.y, c1.y, c2.y), Vec3(c0.z, c1.z, c2.z)
    t_A, t_B = _in_frame(A, t), _in_frame(B, t)
    best = _best_face(A, B, r0, r1, r2, c0, c1, c2, t_A, t_B, error)
    if best.gap - error - radius > limit:
        row.doubles[LOWER] = best.gap - error - radius
        row.doubles[DISTANCE] = best.gap - error - radius
        row.doubles[UPPER] = math.inf
        put_vec3(row.doubles, NORMAL, _axis_towards(A, B, best.axis, t))
        row.flags[BEYOND] = 1
        row.flags[HOW] = PLANE
        return True
    row.doubles[LOWER] = best.gap - error
    row.doubles[UPPER] = best.gap + error
    row.doubles[DISTANCE] = best.gap
    is_proven = best.gap > error
    if best.axis < 3:
        is_proven = _put_face(A, B, best, t, error, False, row) and is_proven
    else:
        of_b = FaceAxis(best.axis - 3, best.gap)
        is_proven = _put_face(B, A, of_b, neg(t), error, True, row) and is_proven
    if not is_proven:  # what is over a face, at its distance, needs no look at edges
        edges = _edges(A, B, c0, c1, c2, t_A, error)
        if edges.gap - error / edges.sine > row.doubles[UPPER]:
            row.doubles[LOWER] = edges.gap - error / edges.sine
            row.doubles[DISTANCE] = edges.gap
            is_proven = _put_edges(A, B, edges, t, error, row)
        else:
            is_proven = best.gap < 0.0
        row.doubles[UPPER] = max(row.doubles[UPPER], edges.upper) + edges.missed
    # Cores that touch, or nearly, have no clear direction.
    is_proven = is_proven and (row.doubles[LOWER] > 0.0 or row.doubles[UPPER] < 0.0)
    if radius > 0.0:
        _sweep(A.radius, B.radius, row)
    lower, upper = row.doubles[LOWER], row.doubles[UPPER]
    row.flags[HIT] = 1 if upper < 0.0 else 0
    row.flags[CERTIFIED] = 1
    row.flags[HOW] = SIMPLEX if upper < 0.0 else PLANE
    # What touches, or nearly, is left to exact arithmetic, and so is what may be beyond the limit.
    is_decided = (lower > 0.0 or upper < 0.0) and upper <= limit
    return is_proven and is_decided and upper - lower <= _WIDEST * size


@kernel(inline=True)
def _sweep(radius_a, radius_b, row):
    """From the row of cores to that of what balls swept over them cover."""
    doubles = row.doubles
    nhat = vec3_at(doubles, NORMAL)
    doubles[DISTANCE] -= radius_a + radius_b
    doubles[LOWER] -= radius_a + radius_b
    doubles[UPPER] -= radius_a + radius_b
    put_vec3(doubles, POINT_A, add(vec3_at(doubles, POINT_A), scale(radius_a, nhat)))
    put_vec3(doubles, POINT_B, sub(vec3_at(doubles, POINT_B), scale(radius_b, nhat)))


@kernel(inline=True)
def _best_face(A, B, r0, r1, r2, c0, c1, c2, t_A, t_B, error):
    """The `FaceAxis` of widest gap; of equal ones but for rounding, one of A."""
    hA, hB = A.half, B.half
    a0 = abs(t_A.x) - hA.x - dot(hB, absolute(r0))
    a1 = abs(t_A.y) - hA.y - dot(hB, absolute(r1))
    a2 = abs(t_A.z) - hA.z - dot(hB, absolute(r2))
    b0 = abs(t_B.x) - hB.x - dot(hA, absolute(c0))
    b1 = abs(t_B.y) - hB.y - dot(hA, absolute(c1))
    b2 = abs(t_B.z) - hB.z - dot(hA, absolute(c2))
    of_a, of_b = FaceAxis(0, a0), FaceAxis(3, b0)
    if a1 > of_a.gap:
        of_a = FaceAxis(1, a1)
    if a2 > of_a.gap:
        of_a = FaceAxis(2, a2)
    if b1 > of_b.gap:
        of_b = FaceAxis(4, b1)
    if b2 > of_b.gap:
        of_b = FaceAxis(5, b2)
    return of_b if of_b.gap > of_a.gap + 2.0 * error else of_a


@kernel(inline=True)
def _edges(A, B, c0, c1, c2, t, error):
    """`EdgeAxes` of all nine.   c0, c1, c2, t : B's axes and centre in A."""
    h = B.half
    first = _edges_along(A, c0, 0, h.x, h.y, c2, h.z, c1, t, error)
    second = _edges_along(A, c1, 1, h.y, h.z, c0, h.x, c2, t, error)
    third = _edges_along(A, c2, 2, h.z, h.x, c1, h.y, c0, t, error)
    return _wider(_wider(first, second), third)


@kernel(inline=True)
def _wider(a, b):
    widest = a if a.gap >= b.gap else b
    upper, missed = max(a.upper, b.upper), a.missed + b.missed
    return EdgeAxes(widest.gap, widest.sine, widest.a, widest.b, upper, missed)


@kernel(inline=True)
def _edges_along(A, c, b, length, h, c_of_h, k, c_of_k, t, error):
    """`EdgeAxes` of B's edges along its axis b, with A's three.

    c, length : axis b in A, and B's half size along b.
    h, k : half sizes of B along its other axes, each with a column of B in A: the product of a × c with the second axis
    is, up to sign, a times the third column, and the reverse.
    """
    x = _edge_pair(0, b, c.y, c.z, A.half.y, A.half.z, t.y, t.z, h * abs(c_of_h.x) + k * abs(c_of_k.x), length, error)
    y = _edge_pair(1, b, c.z, c.x, A.half.z, A.half.x, t.z, t.x, h * abs(c_of_h.y) + k * abs(c_of_k.y), length, error)
    z = _edge_pair(2, b, c.x, c.y, A.half.x, A.half.y, t.x, t.y, h * abs(c_of_h.z) + k * abs(c_of_k.z), length, error)
    return _wider(_wider(x, y), z)


@kernel(inline=True)
def _edge_pair(a, b, u, v, h_u, h_v, t_u, t_v, radius, length, error):
    """`EdgeAxes` of an edge of A and an edge of B whose direction has the components (u, v) across A's.

    Nearly parallel edges span a facet of the Minkowski difference, as narrow as either edge is off the other's
    direction. With parallel edges the difference would move by this width at most, and all its facets would be among
    the other axes.
    """
    sine = math.sqrt(u * u + v * v)
    if sine < _PARALLEL:
        return EdgeAxes(-math.inf, 1.0, a, b, -math.inf, 2.0 * length * (sine + 8.0 * _U))
    gap = (abs(t_u * v - t_v * u) - h_u * abs(v) - h_v * abs(u) - radius) / sine
    return EdgeAxes(gap, sine, a, b, gap + error / sine, 0.0)


@kernel(inline=True)
def _put_face(F, G, face, t, error, exchanged, row):
    """Normal and points of the row, from the corner, edge or face of G nearest to a face of F; whether some of this
    feature is over the face.

    t : from F's centre to G's.   exchanged : F is B.
    Axes of G in the face's plane, but for rounding, make an edge or a face of the nearest corner: its points are higher
    by at most twice the error for each axis. The feature is over the face where no axis in the plane parts the two,
    their own axes and axes across the edges (S. Gottschalk et al., theorem 1, in the plane).
    """
    i, j, k = face.axis, (face.axis + 1) % 3, (face.axis + 2) % 3
    a, e, f = _axis_of(F, i), _axis_of(F, j), _axis_of(F, k)
    h_e, h_f = component(F.half, j), component(F.half, k)
    n = scale((1.0 if dot(a, t) >= 0.0 else -1.0) / math.sqrt(dot(a, a)), a)
    x, y, z = _end_of(G.x, G.half.x, n, error), _end_of(G.y, G.half.y, n, error), _end_of(G.z, G.half.z, n, error)
    p = _in_plane(add(t, add(add(x.corner, y.corner), z.corner)), e, f)
    end = p
    # Corners of other bodies' faces show where these overlap; a segment has no face, and its point is the corner's.
    is_corner_over = (h_e > 0.0 and h_f > 0.0) or (abs(p.x) <= h_e + 4.0 * error and abs(p.y) <= h_f + 4.0 * error)
    # Middle of the edge or face, and half of its sides; of a corner these are 0.
    gx, gy, gz = _in_plane(x.side, e, f), _in_plane(y.side, e, f), _in_plane(z.side, e, f)
    p = Vec3(p.x + gx.x + gy.x + gz.x, p.y + gx.y + gy.y + gz.y, 0.0)
    slack = 4.0 * error
    is_over = is_corner_over and abs(p.x) + slack <= h_e + abs(gx.x) + abs(gy.x) + abs(gz.x)
    is_over = is_over and abs(p.y) + slack <= h_f + abs(gx.y) + abs(gy.y) + abs(gz.y)
    is_over = is_over and _is_met_across(gx, gy, gz, p, h_e, h_f, slack)
    is_over = is_over and _is_met_across(gy, gz, gx, p, h_e, h_f, slack)
    is_over = is_over and _is_met_across(gz, gx, gy, p, h_e, h_f, slack)
    if face.gap > 0.0:
        row.doubles[UPPER] = face.gap + error * (1.0 + 2.0 * (x.is_flat + y.is_flat + z.is_flat))
    on_g = add(add(t, F.p), add(add(x.corner, y.corner), z.corner))
    if G.half.x == 0.0 and z.is_flat != 0.0:
        # A ball swept along this segment is nearest beneath it: the place over the face that is nearest to the end.
        first = max(_first_over(end.x, 2.0 * gz.x, h_e), _first_over(end.y, 2.0 * gz.y, h_f))
        on_g = add(on_g, scale(2.0 * min(first, 1.0), z.side))
    on_f = sub(on_g, scale(face.gap, n))
    put_vec3(row.doubles, NORMAL, add(scale(-1.0 if exchanged else 1.0, n), Vec3(0.0, 0.0, 0.0)))
    put_vec3(row.doubles, POINT_B if exchanged else POINT_A, on_f)
    put_vec3(row.doubles, POINT_A if exchanged else POINT_B, on_g)
    return is_over


@kernel(inline=True)
def _end_of(axis, half, n, error):
    """The `BoxEnd` of an axis of a box least along n."""
    along = dot(axis, n)
    corner = scale(-half if along > 0.0 else half, axis)
    if abs(half * along) <= error:
        return BoxEnd(corner, neg(corner), 1.0)
    return BoxEnd(corner, Vec3(0.0, 0.0, 0.0), 0.0)


@kernel(inline=True)
def _first_over(start, along, half):
    """Least part of a segment's length from which a coordinate is within ±half, or 0."""
    if start > half and along < 0.0:
        return (half - start) / along
    if start < -half and along > 0.0:
        return (-half - start) / along
    return 0.0


@kernel(inline=True)
def _in_plane(v, e, f):
    return Vec3(dot(e, v), dot(f, v), 0.0)


@kernel(inline=True)
def _is_met_across(side, second, third, p, h_e, h_f, slack):
    """Whether a rectangle around 0 and a shape around p come within each other along what is across a side of it."""
    reach = h_e * abs(side.y) + h_f * abs(side.x)
    reach += abs(side.x * second.y - side.y * second.x) + abs(side.x * third.y - side.y * third.x)
    return abs(side.x * p.y - side.y * p.x) + slack * (abs(side.x) + abs(side.y)) <= reach


@kernel
def _put_edges(A, B, edges, t, error, row):
    """Normal and points of the row, from two edges; False where their nearest places may lie beyond an end.

    t : from A's centre to B's. Products are good to the error, the places to that over the square of the sine.
    """
    a, b = _axis_of(A, edges.a), _axis_of(B, edges.b)
    c = cross(a, b)
    n = scale((1.0 if dot(c, t) >= 0.0 else -1.0) / math.sqrt(dot(c, c)), c)
    h_a, h_b = component(A.half, edges.a), component(B.half, edges.b)
    # The middles of the edges farthest towards each other: corners less what lies along the edge itself.
    p = sub(_farthest_corner(A, n), scale(h_a * _sign(dot(a, n)), a))
    q = add(sub(t, _farthest_corner(B, n)), scale(h_b * _sign(dot(b, n)), b))
    w = sub(q, p)
    along = dot(a, b)
    square = dot(c, c)
    at_a = (dot(a, w) - along * dot(b, w)) / square
    at_b = (along * dot(a, w) - dot(b, w)) / square
    off = error / square
    on_a = add(add(p, scale(at_a, a)), A.p)
    put_vec3(row.doubles, NORMAL, add(n, Vec3(0.0, 0.0, 0.0)))
    put_vec3(row.doubles, POINT_A, on_a)
    put_vec3(row.doubles, POINT_B, add(on_a, scale(edges.gap, n)))
    return abs(at_a) <= h_a - off and abs(at_b) <= h_b - off


@kernel(inline=True)
def _axis_of(box, k):
    return box.x if k == 0 else box.y if k == 1 else box.z


@kernel(inline=True)
def _axis_towards(A, B, axis, t):
    """The axis of a `FaceAxis`, turned along t."""
    v = _axis_of(A, axis) if axis < 3 else _axis_of(B, axis - 3)
    return scale(_sign(dot(v, t)), v)


@kernel(inline=True)
def _sign(value):
    return 1.0 if value >= 0.0 else -1.0


@kernel(inline=True)
def _farthest_corner(box, n):
    """The corner farthest along n, from the centre."""
    x, y, z = scale(_sign(dot(box.x, n)), box.x), scale(_sign(dot(box.y, n)), box.y), scale(_sign(dot(box.z, n)), box.z)
    return add(add(scale(box.half.x, x), scale(box.half.y, y)), scale(box.half.z, z))
