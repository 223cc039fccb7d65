"""What the walk says, proven against the bodies and poses as given.

The walk works with rounded numbers: the relative pose, the vertices of Q, the small linear programs. None of it is
relied on here. A plane is proven by the extreme vertices of both bodies along it (`minkowski.settle_point`). A
common point is proven by a ball: R holds the ball of radius ρ about its centre c, and a triangle of its surface with
a point f in it, so it holds the ball of radius (1 − s) ρ about (1 − s) c + s f; P holds x; x lies in that ball.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import kernel, view_f64, view_i32, view_i64
from collide.narrowphase.gjk.minkowski_difference import difference_point, has_trees, height, settle_point
from collide.numerics.vec3 import Vec3, divide

# Integers of what is kept of R: addresses of centre and radius (4 doubles), of where each facet's triangles start,
# and of the triangles (three vertices of R each).
CENTRE_AT, STARTS_AT, FACETS, TRIANGLES_AT, TRIANGLES = range(5)
BALL = 5

#: A facet of more triangles than this is not searched: the walk's answer is then not proven here.
_MOST_TRIANGLES = 256
#: Facets stepped over in search of the one that a ray leaves by.
_MOST_STEPS = 64


@kernel
def planes_apart(pair, points, ids, dx, dy, dz, error):
    """Whether the plane across d, from P towards R, has all of P on one side and all of R on the other, clear of
    rounding. d in the world, of any length."""
    span = math.sqrt(dx * dx + dy * dy + dz * dz)
    if not span > 0.0:
        return False
    d = divide(Vec3(dx, dy, dz), span)
    difference_point(pair, points, ids, 0, d)
    if has_trees(pair):
        if height(points, 0, d) >= 0.0:
            return False  # a point that is there, farthest or not
        settle_point(pair, points, ids, 0, d)
    return -height(points, 0, d) > 1.000001 * error


@kernel
def _shrinks_to(R, q):
    """A factor by which the matrix at q shortens no vector more; 0 where it may be anything."""
    off = 0.0
    for i in range(3):
        row = 0.0
        for j in range(3):
            product = R[q + i] * R[q + j] + R[q + 3 + i] * R[q + 3 + j] + R[q + 6 + i] * R[q + 6 + j]
            row += abs(product - (1.0 if i == j else 0.0))
        off = max(off, row)
    return math.sqrt(1.0 - off) * (1.0 - 1e-12) if off < 0.5 else 0.0


@kernel
def in_ball(pair, ball_at, x, y, z, error):
    """Whether the point (x, y, z) of P, in P's frame, lies in the ball that R holds about its centre."""
    poses, q, t = pair.poses, pair.B.pose_at, pair.t
    centre = view_f64(view_i64(ball_at, BALL)[CENTRE_AT], 4)
    dx, dy, dz = _apart_by(poses, pair.A.pose_at, x, y, z, q, centre[0], centre[1], centre[2], t.x, t.y, t.z)
    return math.sqrt(dx * dx + dy * dy + dz * dz) + error < (1.0 - 1e-12) * centre[3] * _shrinks_to(poses, q)


@kernel
def _apart_by(poses, p, x, y, z, q, rx, ry, rz, tx, ty, tz):
    """From a point of R to a point of P, each in its body's frame, in the world."""
    return (
        (poses[p] * x + poses[p + 1] * y + poses[p + 2] * z)
        - (poses[q] * rx + poses[q + 1] * ry + poses[q + 2] * rz) - tx,
        (poses[p + 3] * x + poses[p + 4] * y + poses[p + 5] * z)
        - (poses[q + 3] * rx + poses[q + 4] * ry + poses[q + 5] * rz) - ty,
        (poses[p + 6] * x + poses[p + 7] * y + poses[p + 8] * z)
        - (poses[q + 6] * rx + poses[q + 7] * ry + poses[q + 8] * rz) - tz,
    )  # fmt: skip


@kernel
def _best_triangle(ball, coords, m, facet, fx, fy, fz):
    """(how well, vertices and weights of the triangle of a facet that holds f best); f from the centre.

    How well: the least weight, negative where the triangle does not hold f.
    """
    centre = view_f64(ball[CENTRE_AT], 4)
    starts = view_i64(ball[STARTS_AT], ball[FACETS] + 1)
    triangles = view_i32(ball[TRIANGLES_AT], 3 * ball[TRIANGLES])
    best = -1e300
    found = (0, 0, 0, 0.0, 0.0, 0.0)
    start = starts[facet]
    for k in range(start, min(starts[facet + 1], start + _MOST_TRIANGLES)):
        a = triangles[3 * k]
        b = triangles[3 * k + 1]
        c = triangles[3 * k + 2]
        ax = coords[a] - centre[0]
        ay = coords[m + a] - centre[1]
        az = coords[2 * m + a] - centre[2]
        bx = coords[b] - centre[0]
        by = coords[m + b] - centre[1]
        bz = coords[2 * m + b] - centre[2]
        cx = coords[c] - centre[0]
        cy = coords[m + c] - centre[1]
        cz = coords[2 * m + c] - centre[2]
        wa = fx * (by * cz - bz * cy) + fy * (bz * cx - bx * cz) + fz * (bx * cy - by * cx)
        wb = fx * (cy * az - cz * ay) + fy * (cz * ax - cx * az) + fz * (cx * ay - cy * ax)
        wc = fx * (ay * bz - az * by) + fy * (az * bx - ax * bz) + fz * (ax * by - ay * bx)
        total = abs(wa) + abs(wb) + abs(wc)
        if not total > 0.0:
            continue
        least = min(wa, wb, wc) / total
        if least > best:
            best = least
            wa = max(wa, 0.0)
            wb = max(wb, 0.0)
            wc = max(wc, 0.0)
            total = wa + wb + wc
            if total > 0.0:
                found = (a, b, c, wa / total, wb / total, wc / total)
                if least >= 0.0:
                    break
    return best, found


@kernel
def _triangle_near(Q, ball, coords, m, facet, fx, fy, fz):
    """As `_best_triangle`, from facet to neighbouring facet while that gets better.

    Rounding may have split a flat side into facets whose planes it cannot tell apart: the ray then leaves by another.
    """
    rows, starts, neighbours = Q[3], Q[4], Q[5]
    best, found = _best_triangle(ball, coords, m, facet, fx, fy, fz)
    for _ in range(_MOST_STEPS):
        if best >= 0.0:
            break
        at = facet
        for k in range(starts[rows[at]], starts[rows[at] + 1]):
            other, there = _best_triangle(ball, coords, m, np.int64(neighbours[k]), fx, fy, fz)
            if other > best:
                best = other
                found = there
                facet = np.int64(neighbours[k])
        if facet == at:
            break
    return found


@kernel
def shares_point(Q, pair, ball_at, ids, facet, qx, qy, qz, x, y, z, yx, yy, yz, error):
    """Whether the point (x, y, z) of P, in P's frame, lies in R, clear of rounding.

    Q : the ladder of R's polar, whose edges join neighbouring facets of R.
    facet, q : the facet of R that the ray from the centre through the point leaves by, and its polar point.
    yx, yy, yz : the point in R's frame, from the centre, as the walk had it.
    ids : room for three pairs; the vertices of R named by the proof.
    error : how far the point may be from P, and what follows from being computed, altogether.
    """
    poses, q, t = pair.poses, pair.B.pose_at, pair.t
    coords, m = pair.B.coords, pair.B.padded
    ball = view_i64(ball_at, BALL)
    centre = view_f64(ball[CENTRE_AT], 4)
    s = yx * qx + yy * qy + yz * qz
    a, b, c, wa, wb, wc = _triangle_near(Q, ball, coords, m, facet, yx, yy, yz)
    ids[0] = a
    ids[1] = b
    ids[2] = c
    s = min(max(s, 0.0), 1.0)
    if not wa + wb + wc > 0.5:
        s = 0.0
    # The point of R's segment from the centre to the facet, in R's frame.
    fx = wa * coords[a] + wb * coords[b] + wc * coords[c]
    fy = wa * coords[m + a] + wb * coords[m + b] + wc * coords[m + c]
    fz = wa * coords[2 * m + a] + wb * coords[2 * m + b] + wc * coords[2 * m + c]
    rx = (1.0 - s) * centre[0] + s * fx
    ry = (1.0 - s) * centre[1] + s * fy
    rz = (1.0 - s) * centre[2] + s * fz
    dx, dy, dz = _apart_by(poses, pair.A.pose_at, x, y, z, q, rx, ry, rz, t.x, t.y, t.z)
    room = (1.0 - s) * (1.0 - 1e-12) * centre[3] * _shrinks_to(poses, q)
    return math.sqrt(dx * dx + dy * dy + dz * dz) + error < room
