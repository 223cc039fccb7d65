"""Where to look for a shorter translation out of a union, from a translation x out of the union.

Beside x every pair of parts has a plane with the pair's A ⊖ B behind the plane and x before the plane. The points
before all planes are a convex set with x in the set, and no point of any A ⊖ B: the set's point nearest to 0 is no
longer than x, and clears the union as well. From the new x planes are taken again, until the length stays: at a face of
an A ⊖ B, at an edge of two, or at a corner of three. So lengths fall to a local minimum (the convex-concave procedure;
Yuille and Rangarajan 2003). Sixteen planes are taken, without their errors: the way is a proposal, whose length
`clearing_length` proves.
"""

from __future__ import annotations

from collide.kernels import kernel, view_f64
from collide.narrowphase.composite.clearing_translation import held_in, is_out_of_reach, plane_beside
from collide.narrowphase.composite.ways_out import DEPTH, ERROR, MAX_PLANES, PLANE, way_out
from collide.numerics.vec3 import Vec3, cross, dot, norm, put_vec3, scale, vec3_at

#: Planes that a proposal is made of, and how often they are taken again, while x is shorter by this part each time.
_OF_X, _STEPS, _SHORTER = 6, 12, 2.0**-10
# Doubles of workspace: the nearest planes, each with how far before the plane x is and the plane's two parts; planes of
# a proposal; their numbers among the nearest ones.
_BEFORE, _OF_A, _OF_B, _NEAR = range(PLANE, PLANE + 4)
_OF_PROPOSAL = MAX_PLANES * _NEAR
_NUMBERS = _OF_PROPOSAL + _OF_X * PLANE
SHORTER = _NUMBERS + _OF_X
#: How far a proposal stands before its planes, as a part of x.
_BEYOND = 2.0**-42


@kernel
def shorter_way(parts, first_a, n_a, first_b, n_b, n, tau, planes_at, work_at):
    """A unit vector: the way out of the union along the vector may be shorter than τ along n. The vector is n where
    planes propose no other.

    planes : SHORTER doubles of workspace.   Others as of `clearing_length`.
    """
    near, of_x = view_f64(planes_at, _OF_PROPOSAL), view_f64(planes_at + 8 * _OF_PROPOSAL, _OF_X * PLANE)
    numbers, count = view_f64(planes_at + 8 * _NUMBERS, _OF_X), 0
    for pa in range(first_a, first_a + n_a):
        held = held_in(parts, pa)
        for pb in range(first_b, first_b + n_b):
            if not is_out_of_reach(parts, pa, pb, tau, held):
                count = _put_near(near, count, plane_beside(parts, pa, pb, n, tau, work_at), n, tau, pa, pb)
    for _ in range(_STEPS):
        x, n_of_x = _shortest_before(near, count, of_x, numbers)
        length = norm(x)
        if not 0.0 < length < tau:
            break
        gained, tau = tau - length, length
        n = scale(1.0 / length, x)
        if not gained > _SHORTER * length:
            break
        for k in range(n_of_x):
            at = _NEAR * int(numbers[k])
            pa, pb = int(near[at + _OF_A]), int(near[at + _OF_B])
            _put_plane(near, at, plane_beside(parts, pa, pb, n, tau, work_at), tau)
    return n


@kernel
def _put_near(near, count, plane, n, tau, pa, pb):
    """Insert a plane among the MAX_PLANES nearest to τ·n, in the same order of swapped bodies: by how far τ·n lies
    before the plane, then by m × n. Returns the number of planes."""
    before = tau * dot(plane.m, n) - plane.height
    place = count
    while place > 0 and _comes_first(before, plane.m, near, _NEAR * (place - 1), n):
        place -= 1
    if place == MAX_PLANES:
        return count
    count = min(count + 1, MAX_PLANES)
    for k in range(_NEAR * count - 1, _NEAR * (place + 1) - 1, -1):
        near[k] = near[k - _NEAR]
    at = _NEAR * place
    _put_plane(near, at, plane, tau)
    near[at + _BEFORE], near[at + _OF_A], near[at + _OF_B] = before, float(pa), float(pb)
    return count


@kernel(inline=True)
def _put_plane(near, at, plane, tau):
    put_vec3(near, at, plane.m)
    near[at + DEPTH] = plane.height
    near[at + ERROR] = _BEYOND * tau


@kernel
def _comes_first(before, m, near, at, n):
    if before != near[at + _BEFORE]:
        return before < near[at + _BEFORE]
    p, q = cross(m, n), cross(vec3_at(near, at), n)
    return p.x < q.x or (p.x == q.x and (p.y < q.y or (p.y == q.y and p.z < q.z)))


@kernel
def _shortest_before(near, count, of_x, numbers):
    """(the shortest x before all planes, the number of planes x is made of): planes with x behind them are taken in
    turn, farthest planes first."""
    x = Vec3(0.0, 0.0, 0.0)
    for n_of_x in range(_OF_X):
        worst, farthest = -1, 0.0
        for k in range(count):
            behind = near[_NEAR * k + DEPTH] + near[_NEAR * k + ERROR] - dot(vec3_at(near, _NEAR * k), x)
            if behind > farthest:
                worst, farthest = k, behind
        if worst < 0:
            return x, n_of_x
        for k in range(PLANE):
            of_x[PLANE * n_of_x + k] = near[_NEAR * worst + k]
        numbers[n_of_x] = float(worst)
        x = way_out(of_x, n_of_x + 1, True).x
        if not norm(x) > 0.0:
            return x, 0
    return x, _OF_X
