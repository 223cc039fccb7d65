"""Booleans of small hulls, eight pairs at a time: Minkowski portal refinement.

After Snethen 2008, "XenoCollide". A ray from a point o deep in A ⊖ B to the origin leaves A ⊖ B somewhere; a portal is a
triangle of vertices that it passes through. The vertex farthest across the portal either shows a plane that parts the
bodies, or makes a portal farther out; once the origin lies on this side of one, it lies in A ⊖ B. A round is a
support point and two cross products whatever has been found before, so that eight pairs go through it side by side
(`_lanes.py`). Pairs of 8 vertices take less than half the time GJK takes, whose ways part, and whose branches
nobody foresees.

A round concludes nothing. In the end a plane must part the bodies, or a tetrahedron hold the origin, by more than
`bounds.py` allows for rounding; where neither does, the pair goes to GJK as if nothing had been tried. Points are brought
into the world once, which takes one rounding more a coordinate than item 1 there: 11u·S; o, a mean, is good to 14u·ρ
beyond that; choosing vertices by their products in the world is off by less than item 2 has. All within ERROR.

No lane sees another, so that what is decided here does not depend on which others are asked about; only whether the last
one or two pairs of a list come here at all does. Whether bodies meet is the same either way.
"""

from __future__ import annotations

import math

from collide._jit import kernel, view_f64, view_i64
from collide._lanes import LANES, any_of, root_of, select, transpose_eight, view_lanes
from collide.geometry.packing import POINTS
from collide.geometry.tables import ADDRESS, INTS, KIND, NUMBERS, PADDED, POSE, RADIUS
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.fine import smaller
from collide.narrowphase.posed_pair import size_and_slop, sum_of_reaches
from collide.narrowphase.rows import ITERATIONS, NORMAL, ROW, open_row, write_decision
from collide.results import PLANE, SIMPLEX

#: Most vertices of a small hull, of which a block goes together. Of 64, GJK is as fast.
_MOST, _BLOCK = 32, 8
#: Rounds after which GJK may try. Within 1 % of touching the slowest of eight pairs takes 8.
_ROUNDS = 12
#: With fewer pairs than this GJK is as fast.
_FEWEST = 3
#: Sizes of pairs whose numbers neither overflow nor vanish, multiplied six times; the least square of a direction.
_SMALLEST, _LARGEST, _SHORTEST = 1e-20, 1e20, 1e-200

# Eight numbers each: poses, entries 0 to 7 and 4 to 11; vertices a body has, filled up; the error of the pair; o, the portal
# p, q, r, the direction asked next or last, how far its vertex lies along it, rounds; the clearance found; vertices of
# A, of B, then in the world about A's origin: all x, all y, all z.
_POSE_A, _POSE_B, _COUNT_A, _COUNT_B, _ERROR = 0, 16, 32, 33, 34
_O, _P, _Q, _R, _D = 35, 38, 41, 44, 47
_HEIGHT, _USED, _CLEARANCE, _VERTICES = 50, 51, 52, 53
_ROOM = _VERTICES + 6 * _MOST
# Integers: addresses of vertices and of poses, numbers of rows.
_AT_VERTICES_A, _AT_VERTICES_B, _AT_POSE_A, _AT_POSE_B, _ROWS = (LANES * k for k in range(5))
_NOTES = 5 * LANES


@kernel
def look_through_portals(
    ints_at, numbers_at, poses_at, shape_of_at, pairs_at, n_pairs, limit, rows_at, doubles_at, integers_at
):
    """Decide rows of booleans of two small hulls, as far as that goes, and leave the others as they are.

    Arguments as in `answer_pairs`.   doubles, integers : workspace, LANES·(_ROOM + 1) and _NOTES of it.
    """
    pairs = view_i64(pairs_at, 2 * n_pairs)
    room_at = (doubles_at + 8 * (LANES - 1)) // (8 * LANES) * (8 * LANES)
    found = view_f64(room_at, LANES * _ROOM)
    notes = view_i64(integers_at, _NOTES)
    waiting = corners = 0
    for turn in range(n_pairs):
        pa = pairs[2 * turn]
        pb = pairs[2 * turn + 1]
        shape_of = view_i64(shape_of_at, max(pa, pb) + 1)
        sa = shape_of[pa]
        sb = shape_of[pb]
        ints = view_i64(ints_at, INTS * (max(sa, sb) + 1))
        row_at = rows_at + ROW * turn
        if not (_is_small(ints, sa) and _is_small(ints, sb)) or _has_axis(row_at):
            continue
        numbers = view_f64(numbers_at, NUMBERS * (max(sa, sb) + 1))
        if numbers[NUMBERS * sa + RADIUS] + numbers[NUMBERS * sb + RADIUS] > 0.0:
            continue  # nothing here says that cores are near
        poses = view_f64(poses_at, POSE * (max(pa, pb) + 1))
        size, slop, _ = size_and_slop(numbers, poses, sa, pa, sb, pb)
        if not _SMALLEST < size < _LARGEST:
            continue
        error = ERROR * size + slop
        if _are_far(numbers, poses, sa, pa, sb, pb, error, limit, row_at):
            continue
        corners = max(corners, ints[INTS * sa + PADDED], ints[INTS * sb + PADDED])
        found[LANES * _COUNT_A + waiting] = ints[INTS * sa + PADDED]
        found[LANES * _COUNT_B + waiting] = ints[INTS * sb + PADDED]
        found[LANES * _ERROR + waiting] = error
        notes[_AT_VERTICES_A + waiting] = ints[INTS * sa + ADDRESS]
        notes[_AT_VERTICES_B + waiting] = ints[INTS * sb + ADDRESS]
        notes[_AT_POSE_A + waiting] = poses_at + 8 * POSE * pa
        notes[_AT_POSE_B + waiting] = poses_at + 8 * POSE * pb
        notes[_ROWS + waiting] = turn
        waiting += 1
        if waiting == LANES:
            _decide_eight(room_at, integers_at, LANES, corners, limit, rows_at)
            waiting = corners = 0
    if waiting >= _FEWEST:
        for lane in range(waiting, LANES):  # lanes without a row do what the first does
            for k in range(0, _NOTES, LANES):
                notes[k + lane] = notes[k]
            for k in range(_COUNT_A, _ERROR + 1):
                found[LANES * k + lane] = found[LANES * k]
        _decide_eight(room_at, integers_at, waiting, corners, limit, rows_at)


@kernel(inline=True)
def _is_small(ints, s):
    return ints[INTS * s + PADDED] <= _MOST and ints[INTS * s + KIND] == POINTS


@kernel(inline=True)
def _has_axis(row_at):
    """Whether an axis is to be tried first, which is quicker still."""
    row = view_f64(row_at, NORMAL + 3)
    return row[NORMAL] != 0.0 or row[NORMAL + 1] != 0.0 or row[NORMAL + 2] != 0.0


@kernel(inline=True)
def _are_far(numbers, poses, sa, pa, sb, pb, error, limit, row_at):
    """Whether balls about the frames' origins part the bodies; then the row is written."""
    p = POSE * pa
    q = POSE * pb
    tx = poses[q + 9] - poses[p + 9]
    ty = poses[q + 10] - poses[p + 10]
    tz = poses[q + 11] - poses[p + 11]
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    lower = length - sum_of_reaches(numbers, NUMBERS * sa, NUMBERS * sb, poses, p, q) - error
    if lower > limit:
        _write_miss(row_at, lower, tx / length, ty / length, tz / length, limit, 0)
        return True
    return False


@kernel(inline=True)
def _write_miss(row_at, lower, x, y, z, limit, used):
    row, words, marks = open_row(row_at)
    words[ITERATIONS] = used
    write_decision(row, marks, lower, lower, math.inf, PLANE, limit)
    row[NORMAL] = x
    row[NORMAL + 1] = y
    row[NORMAL + 2] = z


@kernel
def _decide_eight(room_at, notes_at, count, corners, limit, rows_at):
    """Work on the pairs that are noted, and write the rows of those that are decided.

    corners : vertices of the largest of the bodies, filled up.
    """
    notes = view_i64(notes_at, _NOTES)
    found = view_f64(room_at, LANES * _ROOM)
    _gather(room_at, notes_at, _AT_VERTICES_A, _COUNT_A, _VERTICES, corners)
    _gather(room_at, notes_at, _AT_VERTICES_B, _COUNT_B, _VERTICES + 3 * corners, corners)
    for half in range(2):
        transpose_eight(notes_at + 8 * _AT_POSE_A, room_at + 8 * LANES * (_POSE_A + 8 * half))
        transpose_eight(notes_at + 8 * _AT_POSE_B, room_at + 8 * LANES * (_POSE_B + 8 * half))
        for k in range(LANES):
            notes[_AT_POSE_A + k] += 32
            notes[_AT_POSE_B + k] += 32
    _refine(view_lanes(room_at, _ROOM), corners, limit)
    for k in range(count):
        row_at = rows_at + ROW * notes[_ROWS + k]
        error = found[LANES * _ERROR + k]
        used = int(found[LANES * _USED + k])
        lower = -found[LANES * _HEIGHT + k] - error
        clearance = found[LANES * _CLEARANCE + k]
        if lower > limit:
            at = LANES * _D + k
            _write_miss(row_at, lower, found[at], found[at + LANES], found[at + 2 * LANES], limit, used)
        elif clearance > error:
            row, words, marks = open_row(row_at)
            words[ITERATIONS] = used
            write_decision(row, marks, -clearance, -math.inf, error - clearance, SIMPLEX, limit)


@kernel
def _gather(room_at, notes_at, vertices, count, target, corners):
    """Have the vertices of eight bodies side by side; of those that have fewer, their last ones again."""
    addresses = view_i64(notes_at + 8 * vertices, LANES)
    counts = view_f64(room_at + 8 * LANES * count, LANES)
    for axis in range(3):
        for first in range(0, corners, _BLOCK):
            transpose_eight(notes_at + 8 * vertices, room_at + 8 * LANES * (target + corners * axis + first))
            last = first + _BLOCK == corners
            for k in range(LANES):
                addresses[k] += 8 * _BLOCK if last or first + _BLOCK < counts[k] else 0


@kernel
def _refine(room, corners, limit):
    """Poses, vertices and errors of eight pairs are there; become known: unit directions of planes that part
    bodies, with their heights (0 where there is none), or clearances (−1 where there is none)."""
    margin = room[_ERROR] + limit
    open_, apart = _begin(room, corners, margin)
    hit = portal = room[_ERROR] < 0.0
    rounds = 2
    while rounds < _ROUNDS and any_of(open_):
        rounds += 1
        open_, apart, hit, portal = _advance(room, corners, margin, open_, apart, hit, portal)
    dx, dy, dz = _vector(room, _D)
    square = dx * dx + dy * dy + dz * dz
    apart = apart & (square > _SHORTEST)
    length = root_of(select(apart, square, 1.0))
    room[_HEIGHT] = select(apart, room[_HEIGHT] / length, 0.0)
    _set(room, _D, dx / length, dy / length, dz / length)
    room[_CLEARANCE] = 0.0 * length - 1.0
    if any_of(hit):
        room[_CLEARANCE] = select(hit, _clearance(room), -1.0)


@kernel(inline=True)
def _begin(room, corners, margin):
    """The first two vertices: against the way from the origin to o, and across the plane of that way and the first one.

    Returns where nothing is known yet, and where planes may part bodies.
    """
    nothing = 0.0 * margin
    tx = room[_POSE_B + 13] - room[_POSE_A + 13]
    ty = room[_POSE_B + 14] - room[_POSE_A + 14]
    tz = room[_POSE_B + 15] - room[_POSE_A + 15]
    ax, ay, az = _place(room, _VERTICES, corners, _COUNT_A, _POSE_A, nothing, nothing, nothing)
    bx, by, bz = _place(room, _VERTICES + 3 * corners, corners, _COUNT_B, _POSE_B, tx, ty, tz)
    ox = ax - bx
    oy = ay - by
    oz = az - bz
    _set(room, _O, ox, oy, oz)
    _set(room, _D, -ox, -oy, -oz)
    px, py, pz = _support(room, corners)
    height = -(px * ox + py * oy + pz * oz)
    room[_HEIGHT] = height
    room[_USED] = nothing + 2.0
    apart = _parts(height, ox * ox + oy * oy + oz * oz, margin)
    nx, ny, nz = _cross(px, py, pz, ox, oy, oz)
    _exchange(room, _D, ~apart, nx, ny, nz)
    qx, qy, qz = _support(room, corners)
    height = qx * nx + qy * ny + qz * nz
    room[_HEIGHT] = select(apart, room[_HEIGHT], height)
    apart = apart | _parts(height, nx * nx + ny * ny + nz * nz, margin)
    nx, ny, nz = _cross(px - ox, py - oy, pz - oz, qx - ox, qy - oy, qz - oz)
    back = nx * ox + ny * oy + nz * oz > 0.0
    turned = select(back, -1.0 + nothing, 1.0)
    _exchange(room, _D, ~apart, turned * nx, turned * ny, turned * nz)
    _set(room, _P, select(back, qx, px), select(back, qy, py), select(back, qz, pz))
    _set(room, _Q, select(back, px, qx), select(back, py, qy), select(back, pz, qz))
    _set(room, _R, px, py, pz)
    return ~apart, apart


@kernel(inline=True)
def _advance(room, corners, margin, open_, apart, hit, portal):
    """One more vertex: of a portal, once the ray passes between the planes through o, p, r and o, q, r; then across it.

    open : nothing is known yet.   apart : a plane parts the bodies.   hit : the origin lies before the portal.
    portal : r is one of its vertices.
    """
    ox, oy, oz = _vector(room, _O)
    px, py, pz = _vector(room, _P)
    qx, qy, qz = _vector(room, _Q)
    rx, ry, rz = _vector(room, _R)
    dx, dy, dz = _vector(room, _D)
    wx, wy, wz = _support(room, corners)
    along = wx * dx + wy * dy + wz * dz
    room[_HEIGHT] = select(open_, along, room[_HEIGHT])
    room[_USED] = room[_USED] + select(open_, 1.0 + 0.0 * along, 0.0)
    square = dx * dx + dy * dy + dz * dz
    found = open_ & _parts(along, square, margin)
    apart = apart | found
    gain = along - (px * dx + py * dy + pz * dz)
    error = room[_ERROR]
    stuck = portal & ((gain <= 0.0) | (gain * gain <= error * error * square))
    open_ = open_ & ~found & ~stuck
    # On which side of the planes through o, w and a vertex of the portal the ray passes.
    sx, sy, sz = _cross(wx, wy, wz, ox, oy, oz)
    of_p = px * sx + py * sy + pz * sz
    of_q = qx * sx + qy * sy + qz * sz
    of_r = rx * sx + ry * sy + rz * sz
    for_p = (portal & _one_of(of_p > 0.0, of_q > 0.0, ~(of_r > 0.0))) | (~portal & ~(of_p < 0.0) & (of_q > 0.0))
    for_q = _one_of(portal, ~(of_p > 0.0) & (of_r > 0.0), of_p < 0.0)
    for_r = open_ & ~for_p & ~for_q
    portal = portal | for_r
    px, py, pz = _exchange(room, _P, open_ & for_p, wx, wy, wz)
    qx, qy, qz = _exchange(room, _Q, open_ & for_q, wx, wy, wz)
    rx, ry, rz = _exchange(room, _R, for_r, wx, wy, wz)
    # Next across the portal (p, q, r), or across (o, p, q), where the ray passes beyond.
    ex = select(portal, px, ox)
    ey = select(portal, py, oy)
    ez = select(portal, pz, oz)
    nx, ny, nz = _cross(
        select(portal, qx, px) - ex, select(portal, qy, py) - ey, select(portal, qz, pz) - ez,
        select(portal, rx, qx) - ex, select(portal, ry, qy) - ey, select(portal, rz, qz) - ez,
    )  # fmt: skip
    _exchange(room, _D, open_, nx, ny, nz)
    beyond = open_ & portal & (px * nx + py * ny + pz * nz >= 0.0)
    return open_ & ~beyond, apart, hit | beyond, portal


@kernel(inline=True)
def _vector(room, at):
    return room[at], room[at + 1], room[at + 2]


@kernel(inline=True)
def _set(room, at, x, y, z):
    room[at] = x
    room[at + 1] = y
    room[at + 2] = z


@kernel(inline=True)
def _exchange(room, at, condition, x, y, z):
    """A vector becomes another one where the condition holds; returns what it is then."""
    x = select(condition, x, room[at])
    y = select(condition, y, room[at + 1])
    z = select(condition, z, room[at + 2])
    _set(room, at, x, y, z)
    return x, y, z


@kernel(inline=True)
def _cross(ax, ay, az, bx, by, bz):
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel(inline=True)
def _one_of(condition, a, b):
    """`select` of conditions."""
    return (condition & a) | (~condition & b)


@kernel(inline=True)
def _parts(height, square, margin):
    """Whether a plane across a direction, of this squared length, leaves the origin out by about that much."""
    return (height < 0.0) & (height * height > margin * margin * square)


@kernel(inline=True)
def _place(room, body, corners, count, pose, tx, ty, tz):
    """Bring the vertices of bodies into the world, shifted by t; returns their mean."""
    x = y = z = 0.0 * tx
    for first in range(0, corners, _BLOCK):
        sx = sy = sz = 0.0 * tx
        for at in range(body + first, body + first + _BLOCK):
            px = room[at]
            py = room[at + corners]
            pz = room[at + 2 * corners]
            qx = (room[pose] * px + room[pose + 1] * py + room[pose + 2] * pz) + tx
            qy = (room[pose + 3] * px + room[pose + 4] * py + room[pose + 5] * pz) + ty
            qz = (room[pose + 6] * px + room[pose + 7] * py + room[pose + 12] * pz) + tz
            room[at] = qx
            room[at + corners] = qy
            room[at + 2 * corners] = qz
            sx += qx
            sy += qy
            sz += qz
        own = room[count] > float(first)
        x += select(own, sx, 0.0)
        y += select(own, sy, 0.0)
        z += select(own, sz, 0.0)
    return x / room[count], y / room[count], z / room[count]


@kernel
def _support(room, corners):
    """The vertex of A ⊖ B that lies farthest along the direction that stands in the room."""
    dx, dy, dz = _vector(room, _D)
    ax, ay, az = _farthest(room, _VERTICES, corners, dx, dy, dz)
    bx, by, bz = _farthest(room, _VERTICES + 3 * corners, corners, -dx, -dy, -dz)
    return ax - bx, ay - by, az - bz


@kernel(inline=True)
def _farthest(room, body, corners, dx, dy, dz):
    """The vertex of a body that lies farthest along d."""
    x = y = z = dx
    most = 0.0 * dx - math.inf
    for first in range(body, body + corners, _BLOCK):
        for k in range(first, first + _BLOCK):
            px = room[k]
            py = room[k + corners]
            pz = room[k + 2 * corners]
            along = px * dx + py * dy + pz * dz
            more = along > most
            most = select(more, along, most)
            x = select(more, px, x)
            y = select(more, py, y)
            z = select(more, pz, z)
    return x, y, z


@kernel(inline=True)
def _clearance(room):
    """How deep the origin lies in the tetrahedron o, p, q, r at least; −1 where it is not proven to lie in it."""
    error = room[_ERROR]
    ox, oy, oz = _vector(room, _O)
    px, py, pz = _vector(room, _P)
    ax, ay, az = px - ox, py - oy, pz - oz
    bx, by, bz = room[_Q] - ox, room[_Q + 1] - oy, room[_Q + 2] - oz
    cx, cy, cz = room[_R] - ox, room[_R + 1] - oy, room[_R + 2] - oz
    nx, ny, nz = _cross(ax, ay, az, bx, by, bz)
    turned = select(nx * cx + ny * cy + nz * cz < 0.0, 1.0 + 0.0 * error, -1.0)  # so that normals lead outwards
    least = _behind(error, turned, ox, oy, oz, ax, ay, az, bx, by, bz)
    least = smaller(least, _behind(error, turned, ox, oy, oz, bx, by, bz, cx, cy, cz))
    least = smaller(least, _behind(error, turned, ox, oy, oz, cx, cy, cz, ax, ay, az))
    least = smaller(
        least,
        _behind(
            error, turned, px, py, pz, room[_R] - px, room[_R + 1] - py, room[_R + 2] - pz,
            room[_Q] - px, room[_Q + 1] - py, room[_Q + 2] - pz,
        ),
    )  # fmt: skip
    return select(least > 0.0, root_of(select(least > 0.0, least, 1.0)), -1.0)


@kernel
def _behind(error, turned, px, py, pz, ex, ey, ez, fx, fy, fz):
    """The square of how far the origin lies behind the triangle p, p + e, p + f; −1 unless it provably does.

    `simplex.height_behind` has the proof.
    """
    nx, ny, nz = _cross(ex, ey, ez, fx, fy, fz)
    nx *= turned
    ny *= turned
    nz *= turned
    height = px * nx + py * ny + pz * nz
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    p = abs(px) + abs(py) + abs(pz)
    proven = height > 2.0 * error * (e * f + 2.0 * p * (e + f))
    height = smaller(height, (px + ex) * nx + (py + ey) * ny + (pz + ez) * nz)
    height = smaller(height, (px + fx) * nx + (py + fy) * ny + (pz + fz) * nz)
    square = nx * nx + ny * ny + nz * nz
    proven = proven & (height > 0.0) & (square > _SHORTEST)
    return select(proven, height * height / select(proven, square, 1.0), -1.0)
