"""The depth of two small hulls from all planes there are, where no surface around the origin could be closed.

A facet of A ⊖ B is a facet of A, one of B, or spanned by an edge of each. So its depth is the least extent of A ⊖ B from
the origin along the normals of any three vertices of one body and of any two pairs of vertices: no direction gives less,
so normals of what is no facet do no harm. Nothing is said about how facets hang together, which is what needles
a billion times as long as wide, pressed flat on each other, leave open in doubles and in double-doubles.

Doubles leave out nearly all, double-doubles nearly all of the rest; integers measure the others. O((n + m)·n²·m²).
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64
from collide.narrowphase.epa.origin_foot import nearest_of_triangle
from collide.narrowphase.exact.exact_directions import scaled_by, set_normal, side_of
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import (
    LONGEST,
    direction_at,
    exact_pose,
    load_poses,
    scale_of,
    scratch_at,
    set_point,
)
from collide.narrowphase.gap.precise_pair import (
    FINE,
    HEIGHT_ERROR,
    LARGEST_FINE,
    SMALLEST_FINE,
    fine_edge,
    fine_height,
    fine_length,
    fine_point,
    write_low_parts,
)
from collide.narrowphase.gap.precise_pair import scale_of as power_of_two
from collide.numerics.digits import BITS, add_product, as_double_double, carry, clear
from collide.numerics.double_double import add, cross, divide, square_root

#: Most vertices of both bodies, and most planes: some ten milliseconds.
MOST_VERTICES, MOST_PLANES = 64, 60_000
#: Most planes that double-doubles may leave.
_KEPT = 256
#: Of a plane kept: its three points (6 vertex ids), a bound of the extent.
_PLANE = 7
#: Most points of a facet that are looked at for the nearest one.
_CORNERS = 64
# Doubles of workspace: points of A and of B, a direction, low parts of poses, planes.
_DIRECTION = FINE * (MOST_VERTICES + 1)
_LOW = _DIRECTION + FINE
_PLANES = _LOW + 24
ROOM = _PLANES + _PLANE * _KEPT
#: What rounding does to a normal, in doubles and in double-doubles, in units of |e||f| and of |e| + |f|.
_IN_DOUBLES, _FINELY = 2.0**-49, 2.0**-96
#: Extents are told apart to this, relatively, four roundings of doubles doubled; integers do the rest.
_ROUNDED = 2.0**-50


@kernel
def planes_of(n_a, n_b):
    """How many planes there are to look at."""
    pairs = (n_a * (n_a - 1) // 2) * (n_b * (n_b - 1) // 2)
    return pairs + n_a * (n_a - 1) * (n_a - 2) // 6 + n_b * (n_b - 1) * (n_b - 2) // 6


@kernel
def depth_by_all_planes(
    pair, terms, terms_at, digits, room_at, ids, lowest_a, lowest_b, reach_a, reach_b, size, error
):  # fmt: skip
    """The depth of cores that share a point, however small, and the direction of it.

    room_at : ROOM doubles of workspace.   ids : out, the vertex pairs of three points around the nearest one.
    Other arguments as in `touch_exactly`.

    Returns (proven, depth, low part, nx, ny, nz): the last three the unit vector outwards of A ⊖ B.
    """
    n_a = pair.A.n
    n_b = pair.B.n
    if n_a + n_b > MOST_VERTICES or planes_of(n_a, n_b) > MOST_PLANES or not (SMALLEST_FINE < size < LARGEST_FINE):
        return False, 0.0, 0.0, 0.0, 0.0, 1.0
    pose_a = exact_pose(pair.poses, pair.A.pose_at, terms)
    pose_b = exact_pose(pair.poses, pair.B.pose_at, terms)
    scale = scale_of(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, 0.0, 0.0, size)
    if scale[0] > LONGEST:
        return False, 0.0, 0.0, 0.0, 0.0, 1.0
    kept = _nearest_planes(pair, terms_at, room_at, n_a, n_b, size)
    if kept == 0:
        return False, 0.0, 0.0, 0.0, 0.0, 1.0
    load_poses(digits, scale, pose_a, pose_b)
    planes = view_f64(room_at + 8 * _PLANES, _PLANE * _KEPT)
    depth = math.inf
    depth_low = 0.0
    nx = 0.0
    ny = 0.0
    nz = 1.0
    for k in range(kept):
        at = _PLANE * k
        for point in range(3):
            set_point(digits, scale, pair, point, int(planes[at + 2 * point]), int(planes[at + 2 * point + 1]))
        extent, extent_low, x, y, z = _extent(digits, scale, pair, error)
        if extent < depth or (extent == depth and extent_low < depth_low):
            depth = extent
            depth_low = extent_low
            nx = x
            ny = y
            nz = z
    if depth == math.inf:
        return False, 0.0, 0.0, 0.0, 0.0, 1.0
    _find_corners(pair, room_at, ids, nx, ny, nz, depth, error)
    return True, depth, depth_low, nx, ny, nz


@kernel
def _extent(digits, scale, pair, error):
    """(extent, low, nx, ny, nz): the least of both extents of A ⊖ B across points 0 … 2, and its direction; infinite
    where these lie in line."""
    d = scale[0]
    n, _ = set_normal(digits, d)
    square = scratch_at(d, 0)
    clear(digits, square, 2 * n)
    for axis in range(3):
        add_product(digits, square, direction_at(d, axis), n, direction_at(d, axis), n, 1)
    if carry(digits, square, 2 * n) == 0:
        return math.inf, 0.0, 0.0, 0.0, 0.0
    value, value_low, exponent = as_double_double(digits, square, 2 * n)
    odd = exponent & 1
    length, length_low = square_root(scaled_by(value, odd), scaled_by(value_low, odd))
    half = (exponent - odd) // 2
    best = math.inf
    best_low = 0.0
    bx = 0.0
    by = 0.0
    bz = 0.0
    for _ in range(2):
        for axis in range(3):
            at = direction_at(d, axis)
            for k in range(n):
                digits[at + k] = -digits[at + k]
            carry(digits, at, n)
        # The last vertex against the direction is the first one along its opposite.
        i, j, vx, vy, vz = support_pair(digits, scale, pair, n, error)
        set_point(digits, scale, pair, 3, i, j)
        side_of(digits, d, n, 3)
        value, value_low, exponent = as_double_double(digits, scratch_at(d, 0), n + d)
        extent, low = divide(-value, -value_low, length, length_low)
        shift = exponent - half + BITS * scale[1]
        extent = scaled_by(extent, shift)
        low = scaled_by(low, shift)
        if extent < best or (extent == best and low < best_low):
            best = extent
            best_low = low
            bx = -vx
            by = -vy
            bz = -vz
    return best, best_low, bx, by, bz


@kernel
def _nearest_planes(pair, terms_at, room_at, n_a, n_b, size):
    """Number of the planes that may decide, written into the room; 0 where there are too many of them."""
    fine = view_f64(room_at, FINE * (MOST_VERTICES + 1))
    planes = view_f64(room_at + 8 * _PLANES, _PLANE * _KEPT)
    low_at = room_at + 8 * _LOW
    low = view_f64(low_at, write_low_parts(pair, terms_at, low_at))
    scale = power_of_two(size)
    for i in range(n_a):
        fine_point(pair, low, fine, i, i, 0, scale)
    for j in range(n_b):
        fine_point(pair, low, fine, n_a + j, 0, j, scale)
    best = math.inf
    kept = 0
    for body in range(3):
        # Three vertices of A, three of B, or two of each; ``first`` and ``last`` bound the numbers of their points.
        first = n_a if body == 1 else 0
        last = n_a if body == 0 else n_a + n_b
        for p in range(first, last if body < 2 else n_a):
            for q in range(p + 1, last if body < 2 else n_a):
                for r in range(q + 1 if body < 2 else n_a, last):
                    if body < 2:
                        kept, best = _weigh(fine, room_at, planes, n_a, n_b, p, q, p, r, kept, best)
                    else:
                        for s in range(r + 1, last):
                            kept, best = _weigh(fine, room_at, planes, n_a, n_b, p, q, r, s, kept, best)
                            if kept < 0:
                                return 0
                    if kept < 0:
                        return 0
    return _pruned(planes, kept, best)


@kernel
def _weigh(fine, room_at, planes, n_a, n_b, p, q, r, s, kept, best):
    """Keep the plane along the edges from p to q and from r to s if it may decide; (kept, least extent so far).

    Kept becomes −1 where there is no room.
    """
    ex = fine[FINE * q] - fine[FINE * p]
    ey = fine[FINE * q + 2] - fine[FINE * p + 2]
    ez = fine[FINE * q + 4] - fine[FINE * p + 4]
    fx = fine[FINE * s] - fine[FINE * r]
    fy = fine[FINE * s + 2] - fine[FINE * r + 2]
    fz = fine[FINE * s + 4] - fine[FINE * r + 4]
    nx = ey * fz - ez * fy
    ny = ez * fx - ex * fz
    nz = ex * fy - ey * fx
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    high_a = -math.inf
    low_a = math.inf
    for i in range(n_a):
        height = nx * fine[FINE * i] + ny * fine[FINE * i + 2] + nz * fine[FINE * i + 4]
        high_a = max(high_a, height)
        low_a = min(low_a, height)
    high_b = -math.inf
    low_b = math.inf
    for j in range(n_a, n_a + n_b):
        height = nx * fine[FINE * j] + ny * fine[FINE * j + 2] + nz * fine[FINE * j + 4]
        high_b = max(high_b, height)
        low_b = min(low_b, height)
    base = nx * fine[0] + ny * fine[2] + nz * fine[4]
    # Points are at most 1 in size, so are heights in units of the normal; edges are off by roundings of points.
    unsure = 8.0 * _IN_DOUBLES * (e * f + e + f)
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if min(high_a + high_b - base, base - low_a - low_b) - unsure > best * length:
        return kept, best
    return _weigh_finely(fine, room_at, planes, n_a, n_b, p, q, r, s, kept, best)


@kernel
def _weigh_finely(fine, room_at, planes, n_a, n_b, p, q, r, s, kept, best):
    """`_weigh` in double-doubles."""
    direction = view_f64(room_at + 8 * _DIRECTION, FINE)
    ex, ex_low, ey, ey_low, ez, ez_low = fine_edge(fine, q, p)
    fx, fx_low, fy, fy_low, fz, fz_low = fine_edge(fine, s, r)
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    (
        direction[0], direction[1], direction[2], direction[3], direction[4], direction[5],
    ) = cross(ex, ex_low, ey, ey_low, ez, ez_low, fx, fx_low, fy, fy_low, fz, fz_low)  # fmt: skip
    length, _ = fine_length(direction)
    unsure = 8.0 * (_FINELY * e * f + 4.0 * HEIGHT_ERROR * (e + f))
    extent = 0.0
    if length > 0.0:
        extent = max(min(_extent_above(fine, n_a, n_b, direction, 1.0), _extent_above(fine, n_a, n_b, direction, -1.0)), 0.0)
        extent /= length
        best = min(best, extent * (1.0 + _ROUNDED) + 8.0 * HEIGHT_ERROR)
        extent = extent * (1.0 - _ROUNDED) - unsure / length - 8.0 * HEIGHT_ERROR
    if extent > best:
        return kept, best
    if kept == _KEPT:
        kept = _pruned(planes, kept, best)
        if kept == _KEPT:
            return -1, best
    at = _PLANE * kept
    # Points of A ⊖ B: the corner of both edges, and where either leads from it.
    if r >= n_a and p < n_a:
        _set_ids(planes, at, p, r - n_a, q, r - n_a, p, s - n_a)
    elif p < n_a:
        _set_ids(planes, at, p, 0, q, 0, s, 0)
    else:
        _set_ids(planes, at, 0, p - n_a, 0, q - n_a, 0, s - n_a)
    planes[at + 6] = extent
    return kept + 1, best


@kernel
def _extent_above(fine, n_a, n_b, direction, sign):
    """The greatest height of A ⊖ B along a direction (sign 1) or its opposite (−1), rounded once."""
    # Point 0 stands among those of A and those of B, and once too often.
    total, total_low = fine_height(fine, 0, direction)
    total = -sign * total
    total_low = -sign * total_low
    for body in range(2):
        high = -math.inf
        high_low = 0.0
        for k in range(n_a if body == 1 else 0, n_a + n_b if body == 1 else n_a):
            height, height_low = fine_height(fine, k, direction)
            if sign * height > high or (sign * height == high and sign * height_low > high_low):
                high = sign * height
                high_low = sign * height_low
        total, total_low = add(total, total_low, high, high_low)
    return total


@kernel
def _set_ids(planes, at, i, j, i_first, j_first, i_second, j_second):
    planes[at] = i
    planes[at + 1] = j
    planes[at + 2] = i_first
    planes[at + 3] = j_first
    planes[at + 4] = i_second
    planes[at + 5] = j_second


@kernel
def _pruned(planes, kept, best):
    """Drop planes that cannot decide any more; how many are left."""
    left = 0
    for k in range(kept):
        if planes[_PLANE * k + 6] <= best:
            for j in range(_PLANE):
                planes[_PLANE * left + j] = planes[_PLANE * k + j]
            left += 1
    return left


@kernel
def _find_corners(pair, room_at, ids, nx, ny, nz, depth, error):
    """The vertex pairs of three points of the facet across n, around the foot of the origin.

    Any three of its corners may not do; the triangle that comes nearest does, or an edge, or a corner.
    """
    corners = view_f64(room_at, 5 * _CORNERS)
    count = _facet(pair, corners, nx, ny, nz, depth, error)
    best = math.inf
    for i in range(count):
        for j in range(i + 1):
            for k in range(j + 1):
                away, _, _, _ = nearest_of_triangle(corners, 5 * i, 5 * j, 5 * k, 0.0, 0.0, 0.0)
                if away < best:
                    best = away
                    for corner in range(3):
                        at = 5 * (i if corner == 0 else j if corner == 1 else k)
                        ids[2 * corner] = int(corners[at + 3])
                        ids[2 * corner + 1] = int(corners[at + 4])


@kernel
def _facet(pair, corners, nx, ny, nz, depth, error):
    """Points of A ⊖ B that are level with the farthest along n, less the foot, with their vertices; their number."""
    A, B, poses, t = pair.A, pair.B, pair.poses, pair.t
    p, q = A.pose_at, B.pose_at
    ax = poses[p] * nx + poses[p + 3] * ny + poses[p + 6] * nz
    ay = poses[p + 1] * nx + poses[p + 4] * ny + poses[p + 7] * nz
    az = poses[p + 2] * nx + poses[p + 5] * ny + poses[p + 8] * nz
    bx = poses[q] * nx + poses[q + 3] * ny + poses[q + 6] * nz
    by = poses[q + 1] * nx + poses[q + 4] * ny + poses[q + 7] * nz
    bz = poses[q + 2] * nx + poses[q + 5] * ny + poses[q + 8] * nz
    high = -math.inf
    for i in range(A.n):
        high = max(high, ax * A.coords[i] + ay * A.coords[A.padded + i] + az * A.coords[2 * A.padded + i])
    low = math.inf
    for j in range(B.n):
        low = min(low, bx * B.coords[j] + by * B.coords[B.padded + j] + bz * B.coords[2 * B.padded + j])
    count = 0
    for i in range(A.n):
        if ax * A.coords[i] + ay * A.coords[A.padded + i] + az * A.coords[2 * A.padded + i] < high - error:
            continue
        for j in range(B.n):
            if bx * B.coords[j] + by * B.coords[B.padded + j] + bz * B.coords[2 * B.padded + j] > low + error or count == _CORNERS:
                continue
            for axis in range(3):
                r = p + 3 * axis
                s = q + 3 * axis
                a = poses[r] * A.coords[i] + poses[r + 1] * A.coords[A.padded + i] + poses[r + 2] * A.coords[2 * A.padded + i]
                b = poses[s] * B.coords[j] + poses[s + 1] * B.coords[B.padded + j] + poses[s + 2] * B.coords[2 * B.padded + j]
                shift = t.x if axis == 0 else (t.y if axis == 1 else t.z)
                n = nx if axis == 0 else (ny if axis == 1 else nz)
                corners[5 * count + axis] = (a - b) - shift - depth * n
            corners[5 * count + 3] = i
            corners[5 * count + 4] = j
            count += 1
    return count
