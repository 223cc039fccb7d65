"""Rays against posed convex sets, one row a question: where the ray's line enters and leaves, with proven bounds.

Boxes, spheres, capsules, cylinders, cones, ellipsoids and half-spaces in closed form (`curved/`); other points, and
these swept by a ball, as casts of a point (`portal.py`), forwards and back.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.casts.portal import HIT, MISS, OPEN, cast_line
from collide.casts.silhouette import CAST_DOUBLES, open_cast
from collide.curved.chords import (
    MET,
    MISSED,
    UNCLEAR,
    Chord,
    Line,
    ball_chord,
    box_chord,
    capsule_chord,
    halfspace_chord,
    nothing,
)
from collide.curved.curved_kinds import curved_chord, curved_normal
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, NUMBERS, POSE, POSE_SLOP, RADIUS, REACH, SLOP
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.posed_pair import PosedBody, PosedPair, Tables, posed_body, stretch_of_pose
from collide.numerics.vec3 import Vec3, add, column_at, cross, dot, neg, norm, put_vec3, rotate, scale, sub, vec3_at

#: Doubles of a ray: origin, direction.
RAY = 6
#: Doubles of a row: state, brackets of both ends, which side of the surface each is on, and both normals.
RAY_ROW = 15
STATE, FIRST_LOWER, FIRST, FIRST_UPPER, LAST_LOWER, LAST, LAST_UPPER = range(7)
FIRST_SIDE, LAST_SIDE, FIRST_NORMAL, LAST_NORMAL = 7, 8, 9, 12
#: Brackets wider than this, in units of t of the far side, are not certified.
MAX_WIDTH = 2.0**-36
#: Doubles of workspace: of a cast, two poses, and a point at a frame's origin.
RAY_DOUBLES = CAST_DOUBLES + 2 * POSE + 24


class _Inverse(NamedTuple):
    """R⁻¹ x = (x.x · p + x.y · q + x.z · r), its columns.   skew : by what errors of it grow, 1 of a rotation."""

    p: Vec3
    q: Vec3
    r: Vec3
    skew: float


@kernel(inline=True)
def _inverse_of(poses, at):
    a, b, c = vec3_at(poses, at), vec3_at(poses, at + 3), vec3_at(poses, at + 6)
    bc = cross(b, c)
    share = 1.0 / dot(a, bc)
    p, q, r = scale(share, bc), scale(share, cross(c, a)), scale(share, cross(a, b))
    skew = (dot(a, a) + dot(b, b) + dot(c, c)) * (dot(p, p) + dot(q, q) + dot(r, r)) / 9.0
    return _Inverse(p, q, r, max(skew, 1.0))


@kernel(inline=True)
def _to_local(inverse, x):
    return add(add(scale(x.x, inverse.p), scale(x.y, inverse.q)), scale(x.z, inverse.r))


@kernel(inline=True)
def _normal_to_world(inverse, n):
    """R⁻ᵀ n, of length 1."""
    v = Vec3(dot(inverse.p, n), dot(inverse.q, n), dot(inverse.r, n))
    return scale(1.0 / norm(v), v)


@kernel(inline=True)
def _put_chord(row, chord):
    row[STATE] = chord.state
    row[FIRST_LOWER] = chord.first_lower
    row[FIRST] = chord.first
    row[FIRST_UPPER] = chord.first_upper
    row[LAST_LOWER] = chord.last_lower
    row[LAST] = chord.last
    row[LAST_UPPER] = chord.last_upper
    row[FIRST_SIDE] = chord.first_side
    row[LAST_SIDE] = chord.last_side


@kernel
def _cut_curved(body, numbers, poses, ray, radius_slop, row):
    """Write the row of a cylinder, cone, ellipsoid or half-space."""
    inverse = _inverse_of(poses, body.pose_at)
    seen = sub(vec3_at(ray, 0), vec3_at(poses, body.pose_at + 9))
    o, d = _to_local(inverse, seen), _to_local(inverse, vec3_at(ray, 3))
    reach = numbers[NUMBERS * body.shape + REACH]
    at = body.params_at
    offset = abs(numbers[at + 3]) if body.kind == HALFSPACE else 0.0
    error = 2.0**-47 * inverse.skew * (norm(o) + reach) + radius_slop
    line = Line(o, d, norm(d), error)
    if body.kind == HALFSPACE:
        n = vec3_at(numbers, at)
        chord = halfspace_chord(line, n, numbers[at + 3], error + 2.0**-50 * offset / norm(n))
        normal = _normal_to_world(inverse, n)
        _put_chord(row, chord)
        put_vec3(row, FIRST_NORMAL, normal)
        put_vec3(row, LAST_NORMAL, normal)
        return
    chord = curved_chord(body.kind, numbers, at, line)
    _put_chord(row, chord)
    if chord.state == MISSED:
        return
    first, last = add(o, scale(chord.first, d)), add(o, scale(chord.last, d))
    n = curved_normal(body.kind, numbers, at, first, chord.first_side)
    put_vec3(row, FIRST_NORMAL, _normal_to_world(inverse, n))
    n = curved_normal(body.kind, numbers, at, last, chord.last_side)
    put_vec3(row, LAST_NORMAL, _normal_to_world(inverse, n))


@kernel
def _cut_rounded(body, poses, ray, radius, size, slop, row):
    """Write the row of one point or two swept by a ball."""
    seen, d = sub(vec3_at(ray, 0), vec3_at(poses, body.pose_at + 9)), vec3_at(ray, 3)
    line = Line(seen, d, norm(d), ERROR * size + slop)
    start = rotate(poses, body.pose_at, column_at(body.coords, body.padded, 0))
    end = start
    if body.n == 1:
        chord = ball_chord(sub(seen, start), d, radius, line.error, 0)
    else:
        end = rotate(poses, body.pose_at, column_at(body.coords, body.padded, 1))
        chord = capsule_chord(line, start, end, radius)
    _put_chord(row, chord)
    if chord.state != MISSED:
        put_vec3(row, FIRST_NORMAL, _away(add(seen, scale(chord.first, d)), start, end))
        put_vec3(row, LAST_NORMAL, _away(add(seen, scale(chord.last, d)), start, end))


@kernel(inline=True)
def _away(p, start, end):
    """The unit vector from a segment to a point."""
    axis = sub(end, start)
    square = dot(axis, axis)
    share = 0.0
    if square > 0.0:
        share = min(max(dot(sub(p, start), axis) / square, 0.0), 1.0)
    v = sub(p, add(start, scale(share, axis)))
    return scale(1.0 / norm(v), v)


@kernel(inline=True)
def _is_box(body):
    """Whether the points are the corners of a box about the frame's origin, along its axes, as `Box` has them."""
    coords, m = body.coords, body.padded
    x, y, z = coords[7], coords[m + 7], coords[2 * m + 7]
    same = x > 0.0 and y > 0.0 and z > 0.0
    for k in range(8):
        same = same and coords[k] == (x if k & 4 else -x)
        same = same and coords[m + k] == (y if k & 2 else -y)
        same = same and coords[2 * m + k] == (z if k & 1 else -z)
    return same


@kernel
def _cut_box(body, numbers, poses, ray, slop, row):
    """Write the row of a box."""
    inverse = _inverse_of(poses, body.pose_at)
    seen = sub(vec3_at(ray, 0), vec3_at(poses, body.pose_at + 9))
    o, d = _to_local(inverse, seen), _to_local(inverse, vec3_at(ray, 3))
    reach = numbers[NUMBERS * body.shape + REACH]
    line = Line(o, d, norm(d), 2.0**-47 * inverse.skew * (norm(o) + reach) + slop)
    chord = box_chord(line, column_at(body.coords, body.padded, 7))
    _put_chord(row, chord)
    row[FIRST_SIDE] = -1.0
    row[LAST_SIDE] = -1.0
    if chord.state != MISSED:
        put_vec3(row, FIRST_NORMAL, _normal_to_world(inverse, _normal_of_side(chord.first_side)))
        put_vec3(row, LAST_NORMAL, _normal_to_world(inverse, _normal_of_side(chord.last_side)))


@kernel(inline=True)
def _normal_of_side(side):
    sign = 1.0 if side & 1 == 0 else -1.0
    return Vec3(sign if side <= 2 else 0.0, sign if side == 3 or side == 4 else 0.0, sign if side > 4 else 0.0)


@kernel
def _cut_hull(body, numbers, poses, ray, radius, size, slop, both, row, doubles_at, integers_at):
    """Write the row of points, swept by a ball or not, as casts of the ray's origin to and fro.

    both : write the exit, too, of rays proven to enter ahead.
    """
    local = view_f64(doubles_at + 8 * CAST_DOUBLES, 2 * POSE)
    for k in range(POSE):
        local[k] = 1.0 if k == 0 or k == 4 or k == 8 else 0.0
        local[POSE + k] = poses[body.pose_at + k]
    put_vec3(local, 9, vec3_at(ray, 0))
    point_at = doubles_at + 8 * (CAST_DOUBLES + 2 * POSE)
    point = view_f64(point_at, 24)
    for k in range(24):
        point[k] = 0.0
    A = PosedBody(point, 1, 8, POINTS, body.shape, body.params_at, 0, 0, 0)
    B = PosedBody(
        body.coords, body.n, body.padded, body.kind, body.shape, body.params_at, POSE, body.tree, body.coarse_at
    )
    pair = PosedPair(A, B, numbers, local, sub(vec3_at(poses, body.pose_at + 9), vec3_at(ray, 0)))
    d = vec3_at(ray, 3)
    error = ERROR * size + slop
    there = cast_line(open_cast(pair, d, 0.0, radius, error, size, doubles_at, integers_at), math.inf, True)
    if there.status == MISS:
        _put_chord(row, nothing())
        return
    if there.status == HIT and not both:
        far = math.inf
        _put_chord(row, Chord(MET, there.lower, there.value, there.upper, far, far, far, -1, -1))
        put_vec3(row, FIRST_NORMAL, neg(there.normal))
        return
    back = cast_line(open_cast(pair, neg(d), 0.0, radius, error, size, doubles_at, integers_at), math.inf, True)
    state = UNCLEAR if there.status == OPEN or back.status == OPEN else MET
    chord = Chord(
        state, there.lower, there.value, there.upper, -back.upper, -back.value, -back.lower, -1, -1
    )
    _put_chord(row, chord)
    put_vec3(row, FIRST_NORMAL, neg(there.normal))
    put_vec3(row, LAST_NORMAL, neg(back.normal))


@entry("void(int64, int64, int64, int64, int64, int64, int64, boolean, int64, int64, int64)")
def cut_parts(
    ints_at, numbers_at, poses_at, shape_of_at, questions_at, rays_at, n, both, rows_at, doubles_at, integers_at
):
    """Chords of n rays with posed convex parts.

    ints, numbers : a `ShapeTable`, its trees built.   poses : POSE doubles a part.   shape_of : a shape row a part.
    questions : two integers each, a ray and a part.   rays : RAY doubles.   rows : out, RAY_ROW doubles a question.
    both : where they leave as well; else infinity may be said of hulls that are entered ahead.
    doubles, integers : workspace (RAY_DOUBLES, `silhouette.CAST_INTEGERS`).
    """
    questions = view_i64(questions_at, 2 * n)
    tables = Tables(ints_at, numbers_at, poses_at, shape_of_at)
    for k in range(n):
        ray = view_f64(rays_at + 8 * RAY * questions[2 * k], RAY)
        row = view_f64(rows_at + 8 * RAY_ROW * k, RAY_ROW)
        cut_part(tables, questions[2 * k + 1], ray, both, row, doubles_at, integers_at)


@kernel
def cut_part(tables, part, ray, both, row, doubles_at, integers_at):
    """Write the row of a ray and a part of a table.   ray, row : views of RAY and RAY_ROW doubles.   both : ends."""
    shape = view_i64(tables.shape_of_at, part + 1)[part]
    ints = view_i64(tables.ints_at, INTS * (shape + 1))
    numbers = view_f64(tables.numbers_at, NUMBERS * (shape + 1))
    poses = view_f64(tables.poses_at, POSE * (part + 1))
    body = posed_body(ints, shape, part)
    radius = numbers[NUMBERS * shape + RADIUS]
    slop = numbers[NUMBERS * shape + SLOP] + poses[body.pose_at + POSE_SLOP]
    if body.kind != POINTS:
        _cut_curved(body, numbers, poses, ray, slop, row)
        return
    away = norm(sub(vec3_at(ray, 0), vec3_at(poses, body.pose_at + 9)))
    size = numbers[NUMBERS * shape + REACH] * stretch_of_pose(poses, body.pose_at) + radius + away
    if body.n == 8 and radius == 0.0 and _is_box(body):
        _cut_box(body, numbers, poses, ray, slop, row)
    elif radius > 0.0 and body.n <= 2:
        _cut_rounded(body, poses, ray, radius, size, slop, row)
    else:
        _cut_hull(body, numbers, poses, ray, radius, size, slop, both, row, doubles_at, integers_at)
