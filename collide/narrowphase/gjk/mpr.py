"""Minkowski portal refinement of eight pairs of small hulls, side by side.

After Snethen 2008, "XenoCollide". A ray from a point o deep in A ⊖ B to the origin leaves A ⊖ B somewhere; a portal is a
triangle of vertices that it passes through. The vertex farthest across the portal either shows a plane that parts the
bodies, or makes a portal farther out; once the origin lies on this side of one, it lies in A ⊖ B. A round is a
support point and two cross products whatever has been found before, so that eight pairs go through it side by side
(`_lanes.py`), where the ways of GJK part and nobody foresees its branches.

A round concludes nothing. In the end a plane must part the bodies, or a tetrahedron hold the origin, by more than
`bounds.py` allows for rounding. Points are brought into the world once, which takes one rounding more a coordinate than
item 1 there: 11u·S; o, a mean, is good to 14u·ρ beyond that; choosing vertices by their products in the world is off by
less than item 2 has. All within ERROR. No lane sees another.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.kernels.lanes import any_of, root_of, select
from collide.narrowphase.gap.precise_pair import smaller

#: Most vertices of a small hull, of which a block goes together. For booleans of 64, GJK is as fast.
MOST, BLOCK = 32, 8
#: Rounds after which GJK may try. Within 1 % of touching the slowest of eight pairs takes 8.
ROUNDS = 12
#: Least square of a direction.
_SHORTEST = 1e-200

# A room, eight numbers each: poses, entries 0 to 7 and 4 to 11; vertices a body has, filled up; the error of the pair;
# corners: o, and p, q, r of the portal, with the name of their vertices, i + MOST·j, and with their weights at the origin
# where it lies among them; the direction asked next or last, how far its vertex lies along it, rounds; the clearance found;
# the mean of A's vertices; vertices of A, of B, then in the world about A's origin: all x, all y, all z.
POSE_A, POSE_B, COUNT_A, COUNT_B, ERROR_OF = 0, 16, 32, 33, 34
NAME, WEIGHT, CORNER = 3, 4, 5
DEEP, PORTAL = 35, 35 + CORNER
_P, _Q, _R = (PORTAL + CORNER * k for k in range(3))
ACROSS = _R + CORNER
HEIGHT, USED, CLEARANCE, MEAN_A, VERTICES = (ACROSS + k for k in (3, 4, 5, 6, 9))
ROOM = VERTICES + 6 * MOST


@kernel
def refine(room, corners, limit):
    """Poses, vertices and errors of eight pairs are there; become known: unit directions of planes that part
    bodies, with their heights (0 where there is none), or clearances (−1 where there is none); and the last portals.

    limit : planes must leave out the origin by more; infinite if portals are to go on to the last.
    """
    margin = room[ERROR_OF] + limit
    open_, apart = _begin(room, corners, margin)
    hit = portal = room[ERROR_OF] < 0.0
    rounds = 2
    while rounds < ROUNDS and any_of(open_):
        rounds += 1
        open_, apart, hit, portal = _advance(room, corners, margin, open_, apart, hit, portal)
    dx, dy, dz = _vector(room, ACROSS)
    square = dx * dx + dy * dy + dz * dz
    apart = apart & (square > _SHORTEST)
    length = root_of(select(apart, square, 1.0))
    room[HEIGHT] = select(apart, room[HEIGHT] / length, 0.0)
    _set(room, ACROSS, dx / length, dy / length, dz / length)
    room[CLEARANCE] = 0.0 * length - 1.0
    if any_of(hit):
        room[CLEARANCE] = select(hit, _clearance(room), -1.0)


@kernel(inline=True)
def _begin(room, corners, margin):
    """The first two vertices: against the way from the origin to o, and across the plane of that way and the first one.

    Returns where nothing is known yet, and where planes may part bodies.
    """
    nothing = 0.0 * room[ERROR_OF]
    tx = room[POSE_B + 13] - room[POSE_A + 13]
    ty = room[POSE_B + 14] - room[POSE_A + 14]
    tz = room[POSE_B + 15] - room[POSE_A + 15]
    ax, ay, az = _place(room, VERTICES, corners, COUNT_A, POSE_A, nothing, nothing, nothing)
    bx, by, bz = _place(room, VERTICES + 3 * corners, corners, COUNT_B, POSE_B, tx, ty, tz)
    ox = ax - bx
    oy = ay - by
    oz = az - bz
    _set(room, DEEP, ox, oy, oz)
    _set(room, MEAN_A, ax, ay, az)
    _set(room, ACROSS, -ox, -oy, -oz)
    px, py, pz, p_name = _support(room, corners)
    height = -(px * ox + py * oy + pz * oz)
    room[HEIGHT] = height
    room[USED] = nothing + 2.0
    apart = _parts(height, ox * ox + oy * oy + oz * oz, margin)
    nx, ny, nz = _cross(px, py, pz, ox, oy, oz)
    _exchange(room, ACROSS, ~apart, nx, ny, nz)
    qx, qy, qz, q_name = _support(room, corners)
    height = qx * nx + qy * ny + qz * nz
    room[HEIGHT] = select(apart, room[HEIGHT], height)
    apart = apart | _parts(height, nx * nx + ny * ny + nz * nz, margin)
    nx, ny, nz = _cross(px - ox, py - oy, pz - oz, qx - ox, qy - oy, qz - oz)
    back = nx * ox + ny * oy + nz * oz > 0.0
    turned = select(back, -1.0 + nothing, 1.0)
    _exchange(room, ACROSS, ~apart, turned * nx, turned * ny, turned * nz)
    _set(room, _P, select(back, qx, px), select(back, qy, py), select(back, qz, pz))
    _set(room, _Q, select(back, px, qx), select(back, py, qy), select(back, pz, qz))
    _set(room, _R, px, py, pz)
    room[_P + NAME] = select(back, q_name, p_name)
    room[_Q + NAME] = select(back, p_name, q_name)
    room[_R + NAME] = p_name
    return ~apart, apart


@kernel(inline=True)
def _advance(room, corners, margin, open_, apart, hit, portal):
    """One more vertex: of a portal, once the ray passes between the planes through o, p, r and o, q, r; then across it.

    open : nothing is known yet.   apart : a plane parts the bodies.   hit : the origin lies before the portal.
    portal : r is one of its vertices.
    """
    ox, oy, oz = _vector(room, DEEP)
    px, py, pz = _vector(room, _P)
    qx, qy, qz = _vector(room, _Q)
    rx, ry, rz = _vector(room, _R)
    dx, dy, dz = _vector(room, ACROSS)
    wx, wy, wz, name = _support(room, corners)
    along = wx * dx + wy * dy + wz * dz
    room[HEIGHT] = select(open_, along, room[HEIGHT])
    room[USED] = room[USED] + select(open_, 1.0 + 0.0 * along, 0.0)
    square = dx * dx + dy * dy + dz * dz
    found = open_ & _parts(along, square, margin)
    apart = apart | found
    gain = along - (px * dx + py * dy + pz * dz)
    error = room[ERROR_OF]
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
    px, py, pz = _exchange_corner(room, _P, open_ & for_p, wx, wy, wz, name)
    qx, qy, qz = _exchange_corner(room, _Q, open_ & for_q, wx, wy, wz, name)
    rx, ry, rz = _exchange_corner(room, _R, for_r, wx, wy, wz, name)
    # Next across the portal (p, q, r), or across (o, p, q), where the ray passes beyond.
    ex = select(portal, px, ox)
    ey = select(portal, py, oy)
    ez = select(portal, pz, oz)
    nx, ny, nz = _cross(
        select(portal, qx, px) - ex, select(portal, qy, py) - ey, select(portal, qz, pz) - ez,
        select(portal, rx, qx) - ex, select(portal, ry, qy) - ey, select(portal, rz, qz) - ez,
    )  # fmt: skip
    _exchange(room, ACROSS, open_, nx, ny, nz)
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
def _exchange_corner(room, at, condition, x, y, z, name):
    """The same for a corner of the portal, with the name of its vertices."""
    room[at + NAME] = select(condition, name, room[at + NAME])
    return _exchange(room, at, condition, x, y, z)


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
    for first in range(0, corners, BLOCK):
        sx = sy = sz = 0.0 * tx
        for at in range(body + first, body + first + BLOCK):
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
    """The vertex of A ⊖ B that lies farthest along the direction that stands in the room, and its name."""
    dx, dy, dz = _vector(room, ACROSS)
    ax, ay, az, i = _farthest(room, VERTICES, corners, dx, dy, dz)
    bx, by, bz, j = _farthest(room, VERTICES + 3 * corners, corners, -dx, -dy, -dz)
    return ax - bx, ay - by, az - bz, i + float(MOST) * j


@kernel(inline=True)
def _farthest(room, body, corners, dx, dy, dz):
    """The vertex of a body that lies farthest along d, and which one it is."""
    x = y = z = at = dx
    most = 0.0 * dx - math.inf
    for first in range(body, body + corners, BLOCK):
        for k in range(first, first + BLOCK):
            px = room[k]
            py = room[k + corners]
            pz = room[k + 2 * corners]
            along = px * dx + py * dy + pz * dz
            more = along > most
            most = select(more, along, most)
            x = select(more, px, x)
            y = select(more, py, y)
            z = select(more, pz, z)
            at = select(more, float(k - body), at)
    return x, y, z, at


@kernel(inline=True)
def _clearance(room):
    """How deep the origin lies in the tetrahedron o, p, q, r at least; −1 where it is not proven to lie in it.

    Becomes known: the corners' weights there, ratios of volumes.
    """
    error = room[ERROR_OF]
    ox, oy, oz = _vector(room, DEEP)
    px, py, pz = _vector(room, _P)
    ax, ay, az = px - ox, py - oy, pz - oz
    bx, by, bz = room[_Q] - ox, room[_Q + 1] - oy, room[_Q + 2] - oz
    cx, cy, cz = room[_R] - ox, room[_R + 1] - oy, room[_R + 2] - oz
    nx, ny, nz = _cross(ax, ay, az, bx, by, bz)
    turned = select(nx * cx + ny * cy + nz * cz < 0.0, 1.0 + 0.0 * error, -1.0)  # so that normals lead outwards
    least, of_r = _behind(error, turned, ox, oy, oz, ax, ay, az, bx, by, bz)
    square, of_p = _behind(error, turned, ox, oy, oz, bx, by, bz, cx, cy, cz)
    least = smaller(least, square)
    square, of_q = _behind(error, turned, ox, oy, oz, cx, cy, cz, ax, ay, az)
    least = smaller(least, square)
    square, of_o = _behind(
        error, turned, px, py, pz, room[_R] - px, room[_R + 1] - py, room[_R + 2] - pz,
        room[_Q] - px, room[_Q + 1] - py, room[_Q + 2] - pz,
    )  # fmt: skip
    least = smaller(least, square)
    inside = least > 0.0
    whole = select(inside, of_o + of_p + of_q + of_r, 1.0)
    room[DEEP + WEIGHT] = of_o / whole
    room[_P + WEIGHT] = of_p / whole
    room[_Q + WEIGHT] = of_q / whole
    room[_R + WEIGHT] = of_r / whole
    return select(inside, root_of(select(inside, least, 1.0)), -1.0)


@kernel
def _behind(error, turned, px, py, pz, ex, ey, ez, fx, fy, fz):
    """The square of how far the origin lies behind the triangle p, p + e, p + f, −1 unless it provably does; and six times
    the volume between them.

    `simplex.height_behind` has the proof.
    """
    nx, ny, nz = _cross(ex, ey, ez, fx, fy, fz)
    nx *= turned
    ny *= turned
    nz *= turned
    volume = px * nx + py * ny + pz * nz
    e = abs(ex) + abs(ey) + abs(ez)
    f = abs(fx) + abs(fy) + abs(fz)
    p = abs(px) + abs(py) + abs(pz)
    proven = volume > 2.0 * error * (e * f + 2.0 * p * (e + f))
    height = smaller(volume, (px + ex) * nx + (py + ey) * ny + (pz + ez) * nz)
    height = smaller(height, (px + fx) * nx + (py + fy) * ny + (pz + fz) * nz)
    square = nx * nx + ny * ny + nz * nz
    proven = proven & (height > 0.0) & (square > _SHORTEST)
    return select(proven, height * height / select(proven, square, 1.0), -1.0), volume
