"""Minkowski portal refinement of eight pairs of small hulls, side by side.

After Snethen 2008, "XenoCollide". A ray from a point o deep in A ⊖ B to the origin leaves A ⊖ B somewhere; a portal is
a triangle of vertices crossed by the ray. The vertex farthest across the portal either shows a separating plane, or
makes a portal farther out; once the origin lies on this side of a portal, the origin lies in A ⊖ B. An iteration is a
support point and two cross products whatever has been found before, so eight pairs go through it side by side
(`kernels/lanes.py`), where the paths of GJK diverge and its branches are unpredictable.

An iteration concludes nothing. In the end a plane must separate the bodies, or a tetrahedron hold the origin, by more
than `bounds.py` allows for rounding. Points are brought into the world once, a rounding more a coordinate than in its
item 1: 11u·S; o, a mean, is good to 14u·ρ besides; choosing vertices by their products in the world is off by less than
in its item 2. All within ERROR. No lane sees another.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.kernels.lanes import any_of, root_of, select
from collide.narrowphase.gap.precise_pair import smaller
from collide.numerics.vec3 import Vec3, add, cross, divide, dot, neg, norm1, put_vec3, scale, sub, vec3_at

#: Most vertices of a small hull, of which a run of eight goes together. For booleans of 64, GJK is as fast.
MAX_VERTICES, RUN = 32, 8
#: Iterations after which GJK may try. Within 1 % of touching the slowest of eight pairs takes 8.
MAX_ITERATIONS = 12
#: Least square of a direction.
_SHORTEST = 1e-200

# A block, eight numbers each: poses, entries 0 to 7 and 4 to 11; how many vertices the bodies have, with padding; the
# error of the pair; corners: o, and the three of the portal, with the name of their vertices, i + MAX_VERTICES·j, and
# with their weights at the origin where it lies among them; the direction asked next or last, how far its vertex lies
# along it, iterations; the clearance found; the mean of A's vertices; vertices of A, of B, then in the world about A's
# origin: all x, all y, all z.
POSE_A, POSE_B, COUNT_A, COUNT_B, ERROR_OF = 0, 16, 32, 33, 34
NAME, WEIGHT, CORNER = 3, 4, 5
DEEP, PORTAL = 35, 35 + CORNER
_CORNER_P, _CORNER_Q, _CORNER_R = (PORTAL + CORNER * k for k in range(3))
ACROSS = _CORNER_R + CORNER
HEIGHT, ITERATIONS, CLEARANCE, MEAN_A, VERTICES = (ACROSS + k for k in (3, 4, 5, 6, 9))
BLOCK = VERTICES + 6 * MAX_VERTICES


class _Support(NamedTuple):
    """A vertex of A ⊖ B and its name."""

    w: Vec3
    name: Any


class _Status(NamedTuple):
    """By lane.   is_open : nothing is known yet.   apart : a plane separates the bodies.   hit : the origin lies before
    the
    portal.   has_portal : the third corner is a vertex of one."""

    is_open: Any
    apart: Any
    hit: Any
    has_portal: Any


@kernel
def refine(block, n_padded, limit):
    """From poses, vertices and errors of eight pairs: unit directions of separating planes, with their heights (0 if
    missing), or clearances (−1 if missing); and the last portals.

    n_padded : vertices of the largest body, with padding.
    limit : least distance of a separating plane from the origin; infinite if portals are to go on to the last.
    """
    margin = block[ERROR_OF] + limit
    status = _begin(block, n_padded, margin)
    iterations = 2
    while iterations < MAX_ITERATIONS and any_of(status.is_open):
        iterations += 1
        status = _advance(block, n_padded, margin, status)
    d = vec3_at(block, ACROSS)
    square = dot(d, d)
    apart = status.apart & (square > _SHORTEST)
    length = root_of(select(apart, square, 1.0))
    block[HEIGHT] = select(apart, block[HEIGHT] / length, 0.0)
    put_vec3(block, ACROSS, divide(d, length))
    block[CLEARANCE] = 0.0 * length - 1.0
    if any_of(status.hit):
        block[CLEARANCE] = select(status.hit, _clearance(block), -1.0)


@kernel(inline=True)
def _begin(block, n_padded, margin):
    """The first two vertices: against the way from the origin to o, and across the plane of this way and the first
    vertex."""
    zero = 0.0 * block[ERROR_OF]
    t = sub(vec3_at(block, POSE_B + 13), vec3_at(block, POSE_A + 13))
    a = _place(block, VERTICES, n_padded, COUNT_A, POSE_A, Vec3(zero, zero, zero))
    b = _place(block, VERTICES + 3 * n_padded, n_padded, COUNT_B, POSE_B, t)
    o = sub(a, b)
    put_vec3(block, DEEP, o)
    put_vec3(block, MEAN_A, a)
    put_vec3(block, ACROSS, neg(o))
    p = _support(block, n_padded)
    height = -dot(p.w, o)
    block[HEIGHT] = height
    block[ITERATIONS] = zero + 2.0
    apart = _separates(height, dot(o, o), margin)
    n = cross(p.w, o)
    _put_where(block, ACROSS, ~apart, n)
    q = _support(block, n_padded)
    height = dot(q.w, n)
    block[HEIGHT] = select(apart, block[HEIGHT], height)
    apart = apart | _separates(height, dot(n, n), margin)
    n = cross(sub(p.w, o), sub(q.w, o))
    back = dot(n, o) > 0.0
    _put_where(block, ACROSS, ~apart, scale(select(back, -1.0 + zero, 1.0), n))
    put_vec3(block, _CORNER_P, _select_vec3(back, q.w, p.w))
    put_vec3(block, _CORNER_Q, _select_vec3(back, p.w, q.w))
    put_vec3(block, _CORNER_R, p.w)
    block[_CORNER_P + NAME] = select(back, q.name, p.name)
    block[_CORNER_Q + NAME] = select(back, p.name, q.name)
    block[_CORNER_R + NAME] = p.name
    nowhere = block[ERROR_OF] < 0.0
    return _Status(~apart, apart, nowhere, nowhere)


@kernel(inline=True)
def _advance(block, n_padded, margin, status):
    """The next vertex: of a portal, once the ray passes between the planes through o, p, r and o, q, r; then across the
    portal."""
    is_open, apart, has_portal = status.is_open, status.apart, status.has_portal
    o, d = vec3_at(block, DEEP), vec3_at(block, ACROSS)
    p, q, r = vec3_at(block, _CORNER_P), vec3_at(block, _CORNER_Q), vec3_at(block, _CORNER_R)
    new = _support(block, n_padded)
    along = dot(new.w, d)
    block[HEIGHT] = select(is_open, along, block[HEIGHT])
    block[ITERATIONS] = block[ITERATIONS] + select(is_open, 1.0 + 0.0 * along, 0.0)
    square = dot(d, d)
    separated = is_open & _separates(along, square, margin)
    apart = apart | separated
    gain = along - dot(p, d)
    error = block[ERROR_OF]
    stuck = has_portal & ((gain <= 0.0) | (gain * gain <= error * error * square))
    is_open = is_open & ~separated & ~stuck
    # On which side of the planes through o, the new vertex and a vertex of the portal the ray passes.
    side = cross(new.w, o)
    of_p, of_q, of_r = dot(p, side), dot(q, side), dot(r, side)
    for_p = (has_portal & _either(of_p > 0.0, of_q > 0.0, ~(of_r > 0.0))) | (~has_portal & ~(of_p < 0.0) & (of_q > 0.0))
    for_q = _either(has_portal, ~(of_p > 0.0) & (of_r > 0.0), of_p < 0.0)
    for_r = is_open & ~for_p & ~for_q
    has_portal = has_portal | for_r
    p = _replace_corner(block, _CORNER_P, is_open & for_p, new)
    q = _replace_corner(block, _CORNER_Q, is_open & for_q, new)
    r = _replace_corner(block, _CORNER_R, for_r, new)
    # Next across the portal (p, q, r), or across (o, p, q), where the ray passes beyond.
    first = _select_vec3(has_portal, p, o)
    n = cross(sub(_select_vec3(has_portal, q, p), first), sub(_select_vec3(has_portal, r, q), first))
    _put_where(block, ACROSS, is_open, n)
    beyond = is_open & has_portal & (dot(p, n) >= 0.0)
    return _Status(is_open & ~beyond, apart, status.hit | beyond, has_portal)


@kernel(inline=True)
def _select_vec3(condition, a, b):
    """`select` of vectors."""
    return Vec3(select(condition, a.x, b.x), select(condition, a.y, b.y), select(condition, a.z, b.z))


@kernel(inline=True)
def _put_where(block, at, condition, a):
    """Write a vector where the condition holds; returns the vector then stored."""
    a = _select_vec3(condition, a, vec3_at(block, at))
    put_vec3(block, at, a)
    return a


@kernel(inline=True)
def _replace_corner(block, at, condition, new):
    """The same for a corner of the portal, with the name of its vertices."""
    block[at + NAME] = select(condition, new.name, block[at + NAME])
    return _put_where(block, at, condition, new.w)


@kernel(inline=True)
def _either(condition, a, b):
    """`select` of conditions."""
    return (condition & a) | (~condition & b)


@kernel(inline=True)
def _separates(height, square, margin):
    """Whether a plane across a direction, of this squared length, leaves the origin out by about the margin."""
    return (height < 0.0) & (height * height > margin * margin * square)


@kernel(inline=True)
def _place(block, body, n_padded, count, pose, t):
    """Bring the vertices of bodies into the world, shifted by t; returns their mean."""
    total = Vec3(0.0 * t.x, 0.0 * t.x, 0.0 * t.x)
    for first in range(0, n_padded, RUN):
        of_run = Vec3(0.0 * t.x, 0.0 * t.x, 0.0 * t.x)
        for at in range(body + first, body + first + RUN):
            p = Vec3(block[at], block[at + n_padded], block[at + 2 * n_padded])
            q = add(Vec3(
                block[pose] * p.x + block[pose + 1] * p.y + block[pose + 2] * p.z,
                block[pose + 3] * p.x + block[pose + 4] * p.y + block[pose + 5] * p.z,
                block[pose + 6] * p.x + block[pose + 7] * p.y + block[pose + 12] * p.z,
            ), t)
            block[at] = q.x
            block[at + n_padded] = q.y
            block[at + 2 * n_padded] = q.z
            of_run = add(of_run, q)
        is_there = block[count] > float(first)
        total = add(total, _select_vec3(is_there, of_run, Vec3(0.0, 0.0, 0.0)))
    return divide(total, block[count])


@kernel
def _support(block, n_padded):
    """The `_Support` of A ⊖ B in the direction that stands in the block."""
    d = vec3_at(block, ACROSS)
    a, i = _farthest(block, VERTICES, n_padded, d)
    b, j = _farthest(block, VERTICES + 3 * n_padded, n_padded, neg(d))
    return _Support(sub(a, b), i + float(MAX_VERTICES) * j)


@kernel(inline=True)
def _farthest(block, body, n_padded, d):
    """(the vertex of a body farthest along d, its number)."""
    best = Vec3(d.x, d.x, d.x)
    at = d.x
    greatest = 0.0 * d.x - math.inf
    for first in range(body, body + n_padded, RUN):
        for k in range(first, first + RUN):
            p = Vec3(block[k], block[k + n_padded], block[k + 2 * n_padded])
            along = dot(p, d)
            farther = along > greatest
            greatest = select(farther, along, greatest)
            best = _select_vec3(farther, p, best)
            at = select(farther, float(k - body), at)
    return best, at


@kernel(inline=True)
def _clearance(block):
    """Lower bound of the origin's depth in the tetrahedron of o and the portal; −1 unless the origin provably lies
    inside.

    Writes the corners' weights at the origin, ratios of volumes.
    """
    error = block[ERROR_OF]
    o, p = vec3_at(block, DEEP), vec3_at(block, _CORNER_P)
    q, r = vec3_at(block, _CORNER_Q), vec3_at(block, _CORNER_R)
    a, b, c = sub(p, o), sub(q, o), sub(r, o)
    outwards = select(dot(cross(a, b), c) < 0.0, 1.0 + 0.0 * error, -1.0)
    least, of_r = _behind(error, outwards, o, a, b)
    square, of_p = _behind(error, outwards, o, b, c)
    least = smaller(least, square)
    square, of_q = _behind(error, outwards, o, c, a)
    least = smaller(least, square)
    square, of_o = _behind(error, outwards, p, sub(r, p), sub(q, p))
    least = smaller(least, square)
    inside = least > 0.0
    volume = select(inside, of_o + of_p + of_q + of_r, 1.0)
    block[DEEP + WEIGHT] = of_o / volume
    block[_CORNER_P + WEIGHT] = of_p / volume
    block[_CORNER_Q + WEIGHT] = of_q / volume
    block[_CORNER_R + WEIGHT] = of_r / volume
    return select(inside, root_of(select(inside, least, 1.0)), -1.0)


@kernel
def _behind(error, outwards, p, e, f):
    """The square of how far the origin lies behind the triangle p, p + e, p + f, −1 unless it provably does; and six
    times the volume between them.

    `simplex.height_behind` has the proof.
    """
    n = cross(e, f)
    n = Vec3(n.x * outwards, n.y * outwards, n.z * outwards)
    volume = dot(p, n)
    e_length, f_length, p_length = norm1(e), norm1(f), norm1(p)
    proven = volume > 2.0 * error * (e_length * f_length + 2.0 * p_length * (e_length + f_length))
    height = smaller(volume, dot(add(p, e), n))
    height = smaller(height, dot(add(p, f), n))
    square = dot(n, n)
    proven = proven & (height > 0.0) & (square > _SHORTEST)
    return select(proven, height * height / select(proven, square, 1.0), -1.0), volume
