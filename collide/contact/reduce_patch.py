"""Reduction of a patch: of its points the deepest, the corners of their hull, and points inside that may carry."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.carrying_points import MAX_CLASSED, ON_WALL, PLAIN, STEEP, choose_carrying, mark_carrying
from collide.contact.contact_points import copy_of_points
from collide.contact.eight_places import BLOCK, blocks_of, fill_last_block, place_in_columns, put_in_columns
from collide.contact.manifold_points import GAP, POINT, V
from collide.contact.reduce_points import select_points
from collide.kernels import kernel, view_f64
from collide.kernels.lanes import LANES, any_of, select, view_lanes

#: Points are on a wall where they lie so many times as far above another as aside of it.
_STEEP = 2.0
#: What a corner is while others are compared that has been compared with all: on no wall.
_NO_WALL = -1
#: Walls fall layer by layer, each layer a look at all points: so many points are looked at, at most, and a wall higher
#: than these layers stays: rough surfaces of 10⁵ facets deep in each other.
_MAX_DROPPED = 1 << 18
#: Directions in which extreme points are looked for before others are compared with them.
_EXTREME = 8
#: Points within the polygon of extreme points, beyond a side, and in the place of a corner.
_INNER, _BEYOND, _THERE = 0.0, 1.0, 2.0
#: Numbers that are sorted by insertion.
_RUN = 8


class HullSpace(NamedTuple):
    """Views of numbers of points: the points compared, a hull's corners, the class of each point (on a wall or not),
    all points by place, and the lowest of each of CELLS cells.

    columns : address of `column_words` doubles: points in columns, then a mark of each, then cells of places.
    """

    order: Any
    corners: Any
    remaining: Any
    by_place: Any
    cells: Any
    columns: int


def column_words(n: int) -> int:
    """Doubles of columns for patches of n points."""
    return 6 * n + 5 * LANES


@kernel
def hull_of_patch(points, n, tolerance, space):
    """Put the corners of the convex hull of the points on no wall, out of n, into ``space.corners``, counter-clockwise;
    how many.

    Points rising steeply from a lower point are on a wall.   tolerance : smaller lengths are rounding [m].
    """
    p = points.manifold.points
    step = max(tolerance, 1e-300)
    lowest = math.inf
    columns = view_f64(space.columns, BLOCK * blocks_of(n))
    for i in range(n):
        space.remaining[i] = PLAIN
        lowest = min(lowest, p[POINT * i + GAP])
        put_in_columns(columns, i, p[POINT * i], p[POINT * i + V], p[POINT * i + GAP])
    fill_last_block(space.columns, n)
    n_order = _outer_points(p, n, tolerance, False, space)
    _sort(p, n, space.order, n_order, step, space)
    n_corners = _hull(p, n_order, step, space)
    if _drop_walls(p, n, n_corners, tolerance, lowest, False, space):
        _sort_all(p, n, step, space)
        n_corners = _hull(p, _standing_points(p, n, tolerance, space), step, space)
        n_left = _MAX_DROPPED
        while n_left > 0 and _drop_walls(p, n, n_corners, tolerance, lowest, True, space):
            n_corners = _hull(p, _standing_points(p, n, tolerance, space), step, space)
            n_left -= n
    for i in range(n):
        if space.remaining[i] == _NO_WALL:
            space.remaining[i] = PLAIN
    return n_corners


@kernel
def _sort_all(p, n, step, space):
    """Sort all points by place, in columns as well: walls fall layer by layer, and each layer's points are sorted."""
    columns = view_f64(space.columns, BLOCK * blocks_of(n))
    for i in range(n):
        space.by_place[i] = i
    _sort(p, n, space.by_place, n, step, space)
    for k in range(n):
        at = POINT * space.by_place[k]
        put_in_columns(columns, k, p[at], p[at + V], p[at + GAP])


@kernel
def _standing_points(p, n, tolerance, space):
    """Put what may be corners of the hull of the points on no wall into ``space.order``, by place; how many."""
    if n > MAX_CLASSED:
        return _outer_points(p, n, tolerance, True, space)
    n_order = 0
    for k in range(n):
        i = space.by_place[k]
        if space.remaining[i] != ON_WALL:
            space.order[n_order] = i
            n_order += 1
    return n_order


@kernel
def _drop_walls(p, n, n_corners, tolerance, lowest, is_sorted, space):
    """Mark corners rising steeply from other points as ON_WALL; whether any corner was.

    Each point is compared with the others once: corners on no wall are marked until the hull is known.
    lowest : gap [m].   is_sorted : whether columns are, by place.

    A point at most r lower is a wall's foot only where it is less than r / _STEEP aside: of columns that are sorted
    the others are not looked at.
    """
    dropped = False
    for j in range(n_corners):
        i = space.corners[j]
        k = POINT * i
        if p[k + GAP] - lowest <= tolerance or space.remaining[i] == _NO_WALL:
            continue
        first, last = 0, n
        if is_sorted:
            aside = (1.0 / _STEEP + 2.0**-20) * (p[k + GAP] - lowest) + 4.0 * max(tolerance, 1e-300)
            first, last = _first_from(p[k] - aside, n, space), _first_from(p[k] + aside, n, space)
        if _is_steep(p[k], p[k + V], p[k + GAP], tolerance, first, last, n, space):
            space.remaining[i] = ON_WALL
            dropped = True
        else:
            space.remaining[i] = _NO_WALL
    return dropped


@kernel
def _first_from(u, n, space):
    """A number k: sorted points before k have places of at most u plus twice the sorting step, points from k on of at
    least u less twice the step."""
    columns = view_f64(space.columns, BLOCK * blocks_of(n))
    low, high = 0, n
    while low < high:
        middle = (low + high) // 2
        if columns[place_in_columns(middle)] < u:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def _is_steep(u, v, gap, tolerance, first, last, n, space):
    """Whether a point rises steeply from a point of columns in the blocks that hold numbers ``first`` to ``last``."""
    rows = view_lanes(space.columns, 3 * blocks_of(n))
    for b in range(first // LANES, blocks_of(last)):
        du, dv = u - rows[3 * b], v - rows[3 * b + 1]
        rise = gap - rows[3 * b + 2] - tolerance
        if any_of((rise > 0.0) & (rise * rise > _STEEP * _STEEP * (du * du + dv * dv))):
            return True
    return False


@kernel
def _extreme_points(p, n, remaining, extreme):
    """Put the numbers of the points on no wall farthest in eight directions, counter-clockwise, without repeats in a
    row; how many. Of equally far points the deeper counts, then the first."""
    first = 0
    while first < n - 1 and remaining[first] == ON_WALL:
        first += 1
    for d in range(_EXTREME):
        extreme[d] = first
    u, v = p[POINT * first], p[POINT * first + V]
    low_u, high_u, low_v, high_v = u, u, v, v
    low_sum, high_sum, low_rest, high_rest = u + v, u + v, v - u, v - u
    for i in range(first + 1, n):
        if remaining[i] == ON_WALL:
            continue
        u, v = p[POINT * i], p[POINT * i + V]
        high_u = _farther(p, extreme, 0, i, u, high_u)
        low_u = -_farther(p, extreme, 4, i, -u, -low_u)
        high_v = _farther(p, extreme, 2, i, v, high_v)
        low_v = -_farther(p, extreme, 6, i, -v, -low_v)
        high_sum = _farther(p, extreme, 1, i, u + v, high_sum)
        low_sum = -_farther(p, extreme, 5, i, -(u + v), -low_sum)
        high_rest = _farther(p, extreme, 3, i, v - u, high_rest)
        low_rest = -_farther(p, extreme, 7, i, -(v - u), -low_rest)
    n_extreme = 1
    for d in range(1, _EXTREME):
        if extreme[d] != extreme[n_extreme - 1]:
            extreme[n_extreme] = extreme[d]
            n_extreme += 1
    return n_extreme - 1 if n_extreme > 1 and extreme[n_extreme - 1] == extreme[0] else n_extreme


@kernel(inline=True)
def _farther(p, extreme, d, i, value, largest):
    """Make point i extreme in a direction where farther than ``largest``, or as far and deeper; the new largest."""
    if value < largest:
        return largest
    if value > largest or p[POINT * i + GAP] < p[POINT * extreme[d] + GAP]:
        extreme[d] = i
    return value


@kernel
def _outer_points(p, n, tolerance, is_sorted, space):
    """Put possible corners of the hull of the points on no wall into ``space.order``, in the order of columns; how
    many.

    Points within the polygon of eight extreme points, or on its sides, are no corners (S. G. Akl, G. T. Toussaint, "A
    fast convex hull algorithm", 1978); of points in the place of an extreme point the deepest counts.
    is_sorted : whether columns are, by place.
    """
    extreme = space.corners
    n_extreme = _extreme_points(p, n, space.remaining, extreme)
    marks = view_f64(space.columns, (BLOCK + LANES) * blocks_of(n))
    _mark_outer(p, n, extreme, n_extreme, tolerance, space)
    n_order = 0
    for k in range(n):
        mark = marks[BLOCK * blocks_of(n) + k]
        if mark == _INNER:
            continue
        i = space.by_place[k] if is_sorted else k
        if space.remaining[i] == ON_WALL:
            continue
        if mark == _BEYOND or _is_deepest_there(p, i, extreme, n_extreme, tolerance):
            space.order[n_order] = i
            n_order += 1
    return n_order


@kernel
def _mark_outer(p, n, extreme, n_extreme, tolerance, space):
    """Set the mark of each point in columns."""
    blocks = blocks_of(n)
    rows = view_lanes(space.columns, 4 * blocks)
    for d in range(n_extreme):
        at, to = POINT * extreme[d], POINT * extreme[d + 1 if d + 1 < n_extreme else 0]
        u, v = p[at], p[at + V]
        eu, ev = p[to] - u, p[to + V] - v
        limit = tolerance * tolerance * (eu * eu + ev * ev)
        for b in range(blocks):
            du, dv = rows[3 * b] - u, rows[3 * b + 1] - v
            wide = eu * dv - ev * du
            is_there = (du <= tolerance) & (du >= -tolerance) & (dv <= tolerance) & (dv >= -tolerance)
            mark = select((wide < 0.0) & (wide * wide > limit), _BEYOND, _INNER)
            if d > 0:
                before = rows[3 * blocks + b]
                mark = select(before == _INNER, mark, before)
            rows[3 * blocks + b] = select(is_there, _THERE, mark)


@kernel
def _is_deepest_there(p, i, extreme, n_extreme, tolerance):
    """Whether a point in the place of an extreme point is that point, or deeper."""
    for d in range(n_extreme):
        at = POINT * extreme[d]
        if abs(p[POINT * i] - p[at]) <= tolerance and abs(p[POINT * i + V] - p[at + V]) <= tolerance:
            return extreme[d] == i or p[POINT * i + GAP] < p[at + GAP]
    return False


@kernel
def _hull(p, n, step, space):
    """Corners of the hull of the n points of ``space.order``, by place, each farther than ``step`` from the line
    through its neighbours; how many.

    A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979). Of points in the same place
    the deepest is taken.
    """
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
def _precedes(p, cells, i, j):
    """Whether point i comes before j: by place, in steps, then by gap."""
    if cells[2 * i] != cells[2 * j]:
        return cells[2 * i] < cells[2 * j]
    if cells[2 * i + 1] != cells[2 * j + 1]:
        return cells[2 * i + 1] < cells[2 * j + 1]
    if p[POINT * i + GAP] != p[POINT * j + GAP]:
        return p[POINT * i + GAP] < p[POINT * j + GAP]
    return i < j


@kernel
def _sort(p, n_points, order, n, step, space):
    """Sort numbers of points, n of n_points, by place: runs by insertion, then merged, ``space.corners`` between."""
    at = (BLOCK + LANES) * blocks_of(n_points)
    cells = view_f64(space.columns + 8 * at, 2 * n_points)
    for k in range(n):
        i = order[k]
        cells[2 * i], cells[2 * i + 1] = _cell(p[POINT * i], step), _cell(p[POINT * i + V], step)
    for k in range(n):
        i, place = order[k], k
        while place % _RUN != 0 and _precedes(p, cells, i, order[place - 1]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = i
    width = _RUN
    while width < n:
        for first in range(0, n - width, 2 * width):
            _merge(p, cells, order, first, first + width, min(first + 2 * width, n), space.corners)
        width *= 2


@kernel
def _merge(p, cells, order, first, middle, end, between):
    """Merge two runs that follow each other."""
    for k in range(first, middle):
        between[k] = order[k]
    lower, upper = first, middle
    for k in range(first, end):
        if lower == middle:
            return
        if upper == end or _precedes(p, cells, between[lower], order[upper]):
            order[k] = between[lower]
            lower += 1
        else:
            order[k] = order[upper]
            upper += 1


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
    if max_contacts == 1:
        space.order[0] = 0
        return 1
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
