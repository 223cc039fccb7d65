"""Which shells with a negative volume are cavities, and which are inside out: exact winding numbers.

A shell of negative volume is the wall of a cavity where all else winds around the shell at least
once, and otherwise inside out. Rays are cast from a point of the shell in fixed directions, in doubles
with an error bound, and in integers for facets where the bound leaves a sign open.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.mesh.shell_volumes import permanent, put_volumes, span_of
from collide.numerics.counting_sort import order_by_key
from collide.numerics.digits import BITS, add_determinant, add_double, carry, grid_of, set_zero
from collide.numerics.vec3 import Vec3, absolute, add, cross, dot, scale, sub, vec3_at

#: Of a determinant of differences: eight roundings deep, four times that; and all that underflows.
_ERROR, _UNDERFLOW = 2.0**-48, 2.0**-960
#: The sum of three coordinates below 1, and three times one, round by less than this.
_ROUNDED_MIDDLE = 2.0**-49
#: Directions tried before a point is given up, and points of a shell tried before it is.
_DIRECTIONS, _POINTS = 6, 24
#: What a direction says of a point.
_MET_AN_EDGE, _ON_A_FACET, _DECIDED = range(3)
#: Integers of digits: 17 numbers' worth; three times the difference of two doubles has at most 85.
_DIGITS = 17 * 86


class _Parts(NamedTuple):
    """Facets by shell, facets without a shell last.   shell_of : of each.   order, starts, items : `order_by_key`."""

    shell_of: Any
    order: Any
    starts: Any
    items: Any


class _Nesting(NamedTuple):
    """A closed surface of n points, and what is found out about its shells: views.

    points, scaled : as they are, and times a power of two.   low, high : boxes of shells.
    owner, shared : by point, a shell, and whether the point has several: points on other shells' facets, so rays from
        them decide nothing.   gathered : facets of shells whose boxes meet a point.
    ambiguous : facets left undecided by doubles.   row : the points in whose middle a ray begins.
    ray : `_cast_ray`.   digits : workspace.
    """

    points: Any
    scaled: Any
    corners: Any
    parts: _Parts
    signs: Any
    low: Any
    high: Any
    owner: Any
    shared: Any
    gathered: Any
    ambiguous: Any
    row: Any
    ray: Any
    digits: Any


@kernel
def _nesting(points_at, n, corners_at, n_facets, signs_at, n_shells, at):
    """(where all stands in memory, where it ends)."""
    scaled, low, high, ray, digits = (
        view_f64(at, 3 * n), view_f64(at + 24 * n, 3 * n_shells), view_f64(at + 24 * (n + n_shells), 3 * n_shells),
        view_f64(at + 24 * n + 48 * n_shells, 8), view_i64(at + 24 * n + 48 * n_shells + 64, _DIGITS),
    )
    at += 24 * n + 48 * n_shells + 64 + 8 * _DIGITS
    parts = _Parts(
        view_i64(at, n_facets), view_i64(at + 8 * n_facets, n_facets), view_i64(at + 16 * n_facets, n_shells + 2),
        view_i64(at + 16 * n_facets + 8 * n_shells + 16, n_facets),
    )
    at += 24 * n_facets + 8 * n_shells + 16
    nesting = _Nesting(
        view_f64(points_at, 3 * n), scaled, view_i32(corners_at, 3 * n_facets), parts, view_i32(signs_at, n_shells),
        low, high, view_i32(at, n), view_i32(at + 4 * n, n), view_i32(at + 8 * n, 3 * n_facets),
        view_i32(at + 8 * n + 12 * n_facets, n_facets), view_i32(at + 8 * n + 16 * n_facets, 4), ray, digits,
    )
    return nesting, at + 8 * n + 16 * n_facets + 16


@entry("int64(int64, int64, int64)")
def shells_memory(n, n_facets, n_shells):
    """Bytes that `judge_shells` works in."""
    return _nesting(0, n, 0, n_facets, 0, n_shells, 0)[1]


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def judge_shells(points_at, n, corners_at, n_facets, shells_at, n_shells, volumes_at, signs_at, wrong_at, memory_at):
    """Volumes of the shells of a closed surface of n points, their exact signs, and which shells are inside out.

    shells : (f,) int32 of each facet, −1 without one.   volumes : (n_shells,) doubles out, in the unit of length cubed.
    signs, wrong : (n_shells,) int32 out; wrong is 1 of shells of negative volume but for walls of cavities.
    memory : as many bytes as `shells_memory` says.

    Shells are taken not to cross each other; then a single point of each decides. A shell without a point clear of
    the others' facets counts as inside out.
    """
    nesting, _ = _nesting(points_at, n, corners_at, n_facets, signs_at, n_shells, memory_at)
    volumes, wrong = view_f64(volumes_at, n_shells), view_i32(wrong_at, n_shells)
    points, signs = nesting.points, nesting.signs
    exponent = _scale(points, nesting.scaled)
    _sort_facets(nesting.parts, view_i32(shells_at, n_facets), n_facets, n_shells)
    put_volumes(points, nesting.scaled, nesting.corners, nesting.parts, nesting.digits, volumes, signs)
    n_positive = 0
    n_negative = 0
    for shell in range(n_shells):
        volumes[shell] = math.ldexp(volumes[shell] / 6.0, 3 * exponent) if signs[shell] != 0 else 0.0
        wrong[shell] = 1 if signs[shell] < 0 else 0
        n_positive += 1 if signs[shell] > 0 else 0
        n_negative += wrong[shell]
    if n_positive > 0 and n_negative > 0:
        _put_boxes(nesting, n, n_shells)
        for shell in range(n_shells):
            if signs[shell] < 0 and _is_cavity(nesting, shell):
                wrong[shell] = 0


@kernel
def _scale(points, scaled):
    """Write the points times 2^-e with the largest coordinate in [1/2, 1); returns e."""
    largest = 0.0
    for k in range(len(points)):
        largest = max(largest, abs(points[k]))
    exponent = math.frexp(largest)[1]
    for k in range(len(points)):
        scaled[k] = math.ldexp(points[k], -exponent)
    return exponent


@kernel
def _sort_facets(parts, shells, n_facets, n_shells):
    for f in range(n_facets):
        parts.shell_of[f] = shells[f] if shells[f] >= 0 else n_shells
        parts.items[f] = f
    order_by_key(parts.shell_of, parts.items, n_facets, n_shells + 1, parts.starts, parts.order)


@kernel
def _put_boxes(nesting, n, n_shells):
    """Boxes of the shells, and which vertices are of several."""
    low, high, points, owner, parts = nesting.low, nesting.high, nesting.points, nesting.owner, nesting.parts
    for k in range(n):
        owner[k] = -1
        nesting.shared[k] = 0
    for shell in range(n_shells):
        for axis in range(3):
            low[3 * shell + axis] = math.inf
            high[3 * shell + axis] = -math.inf
        for k in range(3 * parts.starts[shell], 3 * parts.starts[shell + 1]):
            vertex = nesting.corners[3 * parts.order[k // 3] + k % 3]
            if owner[vertex] >= 0 and owner[vertex] != shell:
                nesting.shared[vertex] = 1
            owner[vertex] = shell
            for axis in range(3):
                low[3 * shell + axis] = min(low[3 * shell + axis], points[3 * vertex + axis])
                high[3 * shell + axis] = max(high[3 * shell + axis], points[3 * vertex + axis])


@kernel
def _is_cavity(nesting, shell):
    """Whether everything else winds around a shell: asked at vertices of it alone, then at middles of its facets."""
    row, parts = nesting.row, nesting.parts
    first, end = parts.starts[shell], parts.starts[shell + 1]
    vertex = -1
    for _ in range(_POINTS):
        vertex = _next_unshared(nesting, first, end, vertex)
        if vertex < 0:
            break
        row[0] = vertex
        outcome = _ask_around(nesting, shell, 1)
        if outcome >= 0:
            return outcome == 1
    for k in range(first, min(end, first + _POINTS)):
        for j in range(3):
            row[j] = nesting.corners[3 * parts.order[k] + j]
        outcome = _ask_around(nesting, shell, 3)
        if outcome >= 0:
            return outcome == 1
    return False


@kernel
def _next_unshared(nesting, first, end, above):
    """The least vertex above a number in places first … end − 1 of the order, in no other shell; −1 without."""
    least = -1
    for k in range(3 * first, 3 * end):
        vertex = nesting.corners[3 * nesting.parts.order[k // 3] + k % 3]
        if vertex > above and nesting.shared[vertex] == 0 and (least < 0 or vertex < least):
            least = np.int64(vertex)
    return least


@kernel
def _ask_around(nesting, shell, n_row):
    """Whether other shells wind around the middle of the first vertices of ``row``: 0, 1; −1 where rays do not tell."""
    parts = nesting.parts
    n_shells = len(nesting.signs)
    is_any_positive = False
    n_gathered = 0
    for k in range(n_shells):
        # Shells whose boxes miss the facet, or the vertex, do not wind around a point of it.
        if k == shell or not _meets_row(nesting, k, n_row):
            continue
        is_any_positive = is_any_positive or nesting.signs[k] > 0
        for f in range(parts.starts[k], parts.starts[k + 1]):
            for j in range(3):
                nesting.gathered[3 * n_gathered + j] = nesting.corners[3 * parts.order[f] + j]
            n_gathered += 1
    if not is_any_positive:
        return 0
    outcome, winding = winding_around(nesting, n_gathered, n_row)
    if outcome != _DECIDED:
        return -1
    return 1 if winding >= 1 else 0


@kernel
def _meets_row(nesting, shell, n_row):
    """Whether a shell's box meets that of the first vertices of ``row``."""
    for axis in range(3):
        low = math.inf
        high = -math.inf
        for k in range(n_row):
            low = min(low, nesting.points[3 * nesting.row[k] + axis])
            high = max(high, nesting.points[3 * nesting.row[k] + axis])
        if nesting.low[3 * shell + axis] > high or nesting.high[3 * shell + axis] < low:
            return False
    return True


@kernel
def winding_around(nesting, n_gathered, n_row):
    """(outcome, how often the facets gathered wind around the middle of the first vertices of ``row``).

    The outcome is _DECIDED, or else _ON_A_FACET, or _MET_AN_EDGE in all directions.
    """
    scaled, row, ray = nesting.scaled, nesting.row, nesting.ray
    for direction in range(_DIRECTIONS):
        for axis in range(3):
            total = scaled[3 * row[0] + axis]
            for k in range(1, n_row):
                total += scaled[3 * row[k] + axis]
            ray[axis] = total
            ray[3 + axis] = float(_direction(direction, axis))
        ray[6] = float(n_row)
        ray[7] = 0.0 if n_row == 1 else _ROUNDED_MIDDLE
        n_ambiguous, winding = _cast_ray(scaled, nesting.gathered, n_gathered, ray, nesting.ambiguous)
        outcome = _DECIDED
        for u in range(n_ambiguous):
            f = 3 * nesting.ambiguous[u]
            s0, s1, s2, height = _exact_signs(nesting, f, n_row)
            if max(s0, s1, s2) > 0 and min(s0, s1, s2) < 0:
                continue
            if s0 == 0 or s1 == 0 or s2 == 0:
                outcome = _MET_AN_EDGE
                break
            if height == 0:
                outcome = _ON_A_FACET
            if height == s0:
                winding += s0
        if outcome != _MET_AN_EDGE:
            return outcome, winding
    return _MET_AN_EDGE, 0


@kernel
def _direction(k, axis):
    """A fixed component within ±2¹⁹; few planes of a mesh will hold such a direction."""
    h = (3 * k + axis + 1) * 0x9E3779B1 & 0xFFFFFFFF
    h = (h ^ (h >> 15)) * 0x85EBCA6B & 0xFFFFFFFF
    return ((h ^ (h >> 13)) & 0xFFFFF) - 0x80000


@kernel
def _exact_signs(nesting, at, n_row):
    """Seen from the middle of the first vertices of ``row``, in integers: the side of each edge of a facet where the
    ray passes, and the side of the facet where the point lies.   at : place of its corners in ``gathered``."""
    points, facet, row, digits = nesting.points, nesting.gathered, nesting.row, nesting.digits
    lowest = 2000
    highest = -2000
    for k in range(3):
        lowest, highest = span_of(points, facet[at + k], lowest, highest)
    for k in range(n_row):
        lowest, highest = span_of(points, row[k], lowest, highest)
    if lowest == 2000:
        return 0, 0, 0, 0
    grid = grid_of(lowest)
    n = (highest - BITS * grid) // BITS + 3  # three times a difference
    for cell in range(9):
        set_zero(digits, cell * n, n)
        for k in range(n_row):
            add_double(digits, cell * n, points[3 * facet[at + cell // 3] + cell % 3], grid)
            add_double(digits, cell * n, -points[3 * row[k] + cell % 3], grid)
        carry(digits, cell * n, n)
    for axis in range(3):
        set_zero(digits, (9 + axis) * n, n)
        digits[(9 + axis) * n] = int(nesting.ray[3 + axis])
        carry(digits, (9 + axis) * n, n)
    return (
        _sign_of_determinant(digits, 9 * n, 0, 3 * n, n), _sign_of_determinant(digits, 9 * n, 3 * n, 6 * n, n),
        _sign_of_determinant(digits, 9 * n, 6 * n, 0, n), _sign_of_determinant(digits, 0, 3 * n, 6 * n, n),
    )


@kernel
def _sign_of_determinant(digits, u, v, w, n):
    set_zero(digits, 14 * n, 3 * n)
    add_determinant(digits, u, v, w, n, 12 * n, 14 * n)
    return carry(digits, 14 * n, 3 * n)


@kernel
def _proven_sign(u, v, w, slack_u, slack):
    """Sign of the determinant of u, v, w, whose entries are off by the slacks at most; 0 where these leave doubt."""
    value = dot(u, cross(v, w))
    size = permanent(u, v, w)
    margin = _ERROR * size + _UNDERFLOW
    if slack > 0.0:
        wide = permanent(_widened(u, slack_u), _widened(v, slack), _widened(w, slack))
        margin = _ERROR * wide + 1.01 * (wide - size) + _UNDERFLOW
    if value > margin:
        return 1
    return -1 if value < -margin else 0


@kernel(inline=True)
def _widened(a, slack):
    return add(absolute(a), Vec3(slack, slack, slack))


@kernel
def _cast_ray(points, corners, n_facets, ray, ambiguous):
    """(how many facets are undecided, the sum over facets the ray certainly passes of +1 outwards and −1 inwards).

    ray : eight doubles: the sum of some points, the direction, how many points, and how far their sum may be off.
    ambiguous : (n_facets,) out, the undecided facets.
    """
    start = vec3_at(ray, 0)
    d = vec3_at(ray, 3)
    n_points = ray[6]
    slack = ray[7]
    count = 0
    winding = 0
    for f in range(n_facets):
        a = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f])), start)
        b = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f + 1])), start)
        c = sub(scale(n_points, vec3_at(points, 3 * corners[3 * f + 2])), start)
        ab = _proven_sign(d, a, b, 0.0, slack)
        bc = _proven_sign(d, b, c, 0.0, slack)
        if ab * bc < 0:
            continue
        ca = _proven_sign(d, c, a, 0.0, slack)
        if ab * ca < 0 or bc * ca < 0:
            continue
        side = _proven_sign(a, b, c, slack, slack)
        if ab * bc * ca == 0 or side == 0:
            ambiguous[count] = f
            count += 1
        elif side == ab:
            winding += ab
    return count, winding
