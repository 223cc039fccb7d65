"""Reduction of a patch: of its points the deepest, the corners of their hull, and points inside that may carry."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.carrying_points import MAX_CLASSED, ON_WALL, PLAIN, STEEP, choose_carrying, mark_carrying
from collide.contact.contact_points import copy_of_points
from collide.contact.manifold_points import GAP, POINT, V
from collide.contact.reduce_points import select_points
from collide.kernels import kernel

#: Points are on a wall where they lie so many times as far above another as aside of it.
_STEEP = 2.0
#: What a corner is while others are compared that has been compared with all: on no wall.
_NO_WALL = -1
#: Directions in which extreme points are looked for before others are compared with them.
_EXTREME = 8


class HullSpace(NamedTuple):
    """Views of numbers of points: the points compared, a hull's corners, the class of each point (on a wall or not),
    and the lowest of each of CELLS cells."""

    order: Any
    corners: Any
    remaining: Any
    cells: Any


@kernel
def hull_of_patch(points, n, tolerance, space):
    """Put the corners of the convex hull of the points on no wall, out of n, into ``space.corners``, counter-clockwise;
    how many.

    Points rising steeply from a lower point are on a wall.   tolerance : smaller lengths are rounding [m].
    """
    p = points.manifold.points
    for i in range(n):
        space.remaining[i] = PLAIN
    n_order = _outer_points(p, n, tolerance, space)
    n_corners = _hull(p, n_order, tolerance, space)
    while _drop_walls(p, n, n_corners, tolerance, space):
        n_order = _standing_points(p, n, tolerance, space)
        n_corners = _hull(p, n_order, tolerance, space)
    for i in range(n):
        if space.remaining[i] == _NO_WALL:
            space.remaining[i] = PLAIN
    return n_corners


@kernel
def _standing_points(p, n, tolerance, space):
    """Put what may be corners of the hull of the points on no wall into ``space.order``; how many."""
    if n > MAX_CLASSED:
        return _outer_points(p, n, tolerance, space)
    n_order = 0
    for i in range(n):
        if space.remaining[i] != ON_WALL:
            space.order[n_order] = i
            n_order += 1
    return n_order


@kernel
def _drop_walls(p, n, n_corners, tolerance, space):
    """Mark corners rising steeply from other points as ON_WALL; whether any corner was.

    Each point is compared with the others once: corners on no wall are marked until the hull is known.
    """
    lowest = math.inf
    for i in range(n):
        lowest = min(lowest, p[POINT * i + GAP])
    dropped = False
    for j in range(n_corners):
        k = POINT * space.corners[j]
        if p[k + GAP] - lowest <= tolerance or space.remaining[space.corners[j]] == _NO_WALL:
            continue
        space.remaining[space.corners[j]] = _NO_WALL
        for i in range(n):
            rise = p[k + GAP] - p[POINT * i + GAP] - tolerance
            if rise <= 0.0:
                continue
            du, dv = p[k] - p[POINT * i], p[k + V] - p[POINT * i + V]
            if rise * rise > _STEEP * _STEEP * (du * du + dv * dv):
                space.remaining[space.corners[j]] = ON_WALL
                dropped = True
                break
    return dropped


@kernel
def _extreme_points(p, n, remaining, extreme):
    """Put the numbers of the points on no wall farthest in eight directions, counter-clockwise, without repeats in a
    row; how many."""
    first = 0
    while first < n - 1 and remaining[first] == ON_WALL:
        first += 1
    for d in range(_EXTREME):
        extreme[d] = first
    for i in range(first + 1, n):
        if remaining[i] == ON_WALL:
            continue
        u, v = p[POINT * i], p[POINT * i + V]
        _farther(p, extreme, 0, 4, i, u, p[POINT * extreme[0]], p[POINT * extreme[4]])
        a, b = POINT * extreme[2], POINT * extreme[6]
        _farther(p, extreme, 2, 6, i, v, p[a + V], p[b + V])
        a, b = POINT * extreme[1], POINT * extreme[5]
        _farther(p, extreme, 1, 5, i, u + v, p[a] + p[a + V], p[b] + p[b + V])
        a, b = POINT * extreme[3], POINT * extreme[7]
        _farther(p, extreme, 3, 7, i, v - u, p[a + V] - p[a], p[b + V] - p[b])
    n_extreme = 1
    for d in range(1, _EXTREME):
        if extreme[d] != extreme[n_extreme - 1]:
            extreme[n_extreme] = extreme[d]
            n_extreme += 1
    return n_extreme - 1 if n_extreme > 1 and extreme[n_extreme - 1] == extreme[0] else n_extreme


@kernel(inline=True)
def _farther(p, extreme, d, opposite, i, value, largest, least):
    """Make point i extreme in a direction, or the opposite direction, where farthest; of equal points the deeper
    counts."""
    if value > largest or (value == largest and p[POINT * i + GAP] < p[POINT * extreme[d] + GAP]):
        extreme[d] = i
    if value < least or (value == least and p[POINT * i + GAP] < p[POINT * extreme[opposite] + GAP]):
        extreme[opposite] = i


@kernel
def _outer_points(p, n, tolerance, space):
    """Put possible corners of the hull of the points on no wall into ``space.order``; how many.

    Points within the polygon of eight extreme points, or on its sides, are no corners (S. G. Akl, G. T. Toussaint, "A
    fast convex hull algorithm", 1978); of points in the place of an extreme point the deepest counts.
    """
    extreme = space.corners
    n_extreme = _extreme_points(p, n, space.remaining, extreme)
    n_order = 0
    for i in range(n):
        if space.remaining[i] != ON_WALL and _is_outer(p, i, extreme, n_extreme, tolerance):
            space.order[n_order] = i
            n_order += 1
    return n_order


@kernel(inline=True)
def _is_outer(p, i, extreme, n_extreme, tolerance):
    u, v = p[POINT * i], p[POINT * i + V]
    beyond = False
    for d in range(n_extreme):
        at = POINT * extreme[d]
        du, dv = u - p[at], v - p[at + V]
        if abs(du) <= tolerance and abs(dv) <= tolerance:
            return extreme[d] == i or p[POINT * i + GAP] < p[at + GAP]
        to = POINT * extreme[d + 1 if d + 1 < n_extreme else 0]
        eu, ev = p[to] - p[at], p[to + V] - p[at + V]
        wide = eu * dv - ev * du
        if wide < 0.0 and wide * wide > tolerance * tolerance * (eu * eu + ev * ev):
            beyond = True
    return beyond


@kernel
def _hull(p, n, tolerance, space):
    """Corners of the hull of the n points of ``space.order``, each farther than the tolerance from the line through its
    neighbours; how many.

    A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979). Of points in the same place
    the deepest is taken.
    """
    step = max(tolerance, 1e-300)
    _sort(p, space.order, n, step)
    n_distinct = 0
    for i in range(n):
        k = space.order[i]
        last = space.order[n_distinct - 1] if n_distinct > 0 else -1
        if last < 0 or max(abs(p[POINT * k] - p[POINT * last]), abs(p[POINT * k + V] - p[POINT * last + V])) > step:
            space.order[n_distinct] = k
            n_distinct += 1
        elif p[POINT * k + GAP] < p[POINT * last + GAP]:
            space.order[n_distinct - 1] = k
    if n_distinct < 3:
        for i in range(n_distinct):
            space.corners[i] = space.order[i]
        return n_distinct
    n_corners = 0
    for i in range(n_distinct):
        n_corners = _push(p, space, n_corners, 0, space.order[i], step)
    n_lower = n_corners
    for i in range(n_distinct - 2, -1, -1):
        n_corners = _push(p, space, n_corners, n_lower - 1, space.order[i], step)
    n_corners -= 1  # the first once more
    if n_corners > 2:
        return n_corners
    space.corners[0], space.corners[1] = space.order[0], space.order[n_distinct - 1]
    return 2


@kernel(inline=True)
def _push(p, space, n, base, k, step):
    """Put point k behind the chain of corners from ``base`` on, having dropped corners no longer convex; how many."""
    corners = space.corners
    while n >= base + 2:
        i, j = POINT * corners[n - 2], POINT * corners[n - 1]
        eu, ev = p[POINT * k] - p[i], p[POINT * k + V] - p[i + V]
        wide = ev * (p[j] - p[i]) - eu * (p[j + V] - p[i + V])
        if wide > 0.0 and wide > step * math.sqrt(eu * eu + ev * ev):
            break
        n -= 1
    corners[n] = k
    return n + 1


@kernel(inline=True)
def _cell(x, step):
    """A coordinate in steps, so far as these can be counted."""
    return float(math.floor(x / step + 0.5)) if abs(x) < 2.0**50 * step else x


@kernel(inline=True)
def _precedes(p, i, j, step):
    """Whether point i comes before j: by place, in steps, then by gap."""
    a, b = POINT * i, POINT * j
    cell_a, cell_b = _cell(p[a], step), _cell(p[b], step)
    if cell_a != cell_b:
        return cell_a < cell_b
    cell_a, cell_b = _cell(p[a + V], step), _cell(p[b + V], step)
    if cell_a != cell_b:
        return cell_a < cell_b
    if p[a + GAP] != p[b + GAP]:
        return p[a + GAP] < p[b + GAP]
    return i < j


@kernel
def _sort(p, order, n, step):
    """Sort numbers of points by place (heapsort: J. W. J. Williams, 1964)."""
    for root in range(n // 2 - 1, -1, -1):
        _sift(p, order, root, n, step)
    for end in range(n - 1, 0, -1):
        order[0], order[end] = order[end], order[0]
        _sift(p, order, 0, end, step)


@kernel
def _sift(p, order, root, end, step):
    k = order[root]
    while 2 * root + 1 < end:
        child = 2 * root + 1
        if child + 1 < end and _precedes(p, order[child], order[child + 1], step):
            child += 1
        if not _precedes(p, k, order[child], step):
            break
        order[root] = order[child]
        root = child
    order[root] = k


@kernel
def reduce_patch(points, n, tolerance, max_contacts, target, space):
    """Put the contacts of a patch of n points into ``target``, in the order of ``space.order``; how many.

    Corners of the convex hull, the point of least gap where no corner is as deep, and inner points that may carry. The
    deepest comes first, then the points around the patch, then the inner points. Of more than ``max_contacts`` points:
    without inner points the points spanning the greatest area, else first the points able to carry after the slightest
    tilt.
    """
    n_corners = hull_of_patch(points, n, tolerance, space)
    n_ring = _put_ring(points, n, n_corners, tolerance, target, space)
    mark_carrying(points.manifold.points, n, n_corners, tolerance, space)
    n_target = _put_inner(points, n, n_ring, tolerance, target, space)
    if n_target == n_ring or n_target <= max_contacts:
        return select_points(target.manifold, n_target, 0, max_contacts, space.order)
    for k in range(n_target):
        space.corners[k] = space.remaining[space.order[k]]
    return choose_carrying(target.manifold.points, n_target, max_contacts, space.corners, space.order)


@kernel
def _put_ring(points, n, n_corners, tolerance, target, space):
    """Put the corners of the hull into ``target``, from the deepest point on, first even if no corner; how many.

    space.order : becomes the points' numbers.
    """
    p, errors = points.manifold.points, points.errors
    deepest = 0
    for i in range(1, n):
        if _is_deeper(p, i, deepest):
            deepest = i
    known = p[POINT * deepest + GAP] + errors[deepest] + tolerance
    step = max(tolerance, 1e-300)
    first = -1
    for j in range(n_corners):
        k = space.corners[j]
        if p[POINT * k + GAP] - errors[k] > known:
            continue
        if first < 0:
            first = j
            continue
        gap = _cell(p[POINT * k + GAP], step)
        least = _cell(p[POINT * space.corners[first] + GAP], step)
        if gap < least or (gap == least and _is_lower(p, k, space.corners[first])):
            first = j
    n_target = 0
    if first < 0:
        space.order[0] = deepest
        n_target = 1
        first = 0
    for j in range(n_corners):
        space.order[n_target] = space.corners[first + j if first + j < n_corners else first + j - n_corners]
        n_target += 1
    for k in range(n_target):
        copy_of_points(points, space.order[k], target, k)
    return n_target


@kernel
def _put_inner(points, n, n_ring, tolerance, target, space):
    """Append points that may carry to ``target``, away from all points around the patch; returns the new number."""
    p = points.manifold.points
    n_target = n_ring
    for i in range(n):
        if space.remaining[i] < STEEP:
            continue
        is_new = True
        for k in range(n_ring):
            at = POINT * space.order[k]
            is_new = is_new and max(abs(p[POINT * i] - p[at]), abs(p[POINT * i + V] - p[at + V])) > 2.0 * tolerance
        if is_new:
            space.order[n_target] = i
            copy_of_points(points, i, target, n_target)
            n_target += 1
    return n_target


@kernel(inline=True)
def _is_lower(p, i, j):
    """By place: u, then v."""
    a, b = POINT * i, POINT * j
    return p[a] < p[b] or (p[a] == p[b] and p[a + V] < p[b + V])


@kernel(inline=True)
def _is_deeper(p, i, j):
    gap_i, gap_j = p[POINT * i + GAP], p[POINT * j + GAP]
    return gap_i < gap_j or (gap_i == gap_j and _is_lower(p, i, j))
