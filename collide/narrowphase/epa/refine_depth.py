"""The last digits of a depth: the same growth in double-doubles, where the surface is nearest the origin.

Doubles leave a surface that is right but for their rounding. What matters of it are the facets within that rounding
of the nearest: their planes are taken again in double-doubles, the nearest one's support vertex is looked for among
the vertices that are level with it, and what lies beyond is added. All others are known to be farther. Depths as
small as touching need no other treatment: down to 2⁻⁹⁶ of the size planes are told apart.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.epa.polytope_surface import (
    FACET,
    MARKS,
    SEEN,
    SURE,
    TWIN,
    WIDEST_BORDER,
    expand,
    fine_workspace,
    flip,
    following,
    has_room,
    workspace,
)
from collide.narrowphase.exact.depth_requests import MAX_TIED_FACETS
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    SLOP_ERROR,
    fine_height,
    fine_length,
    fine_point,
    is_refinable,
    put_low_parts,
    set_plane,
    unit_scale,
)
from collide.narrowphase.gap.tied_vertices import is_unique_minimiser, lowest_pair
from collide.narrowphase.gjk.minkowski_difference import place_vertices
from collide.numerics import double_double as dd
from collide.numerics.double_double import STRIDE
from collide.support.block_scan import least

#: Vertices added, diagonals flipped and planes taken again before a run hands over the bracket it has.
_STEPS = 512
#: Bounds are handed over in doubles: a quotient, a sum and a product.
_ROUNDED = 4.0 * 2.0**-53
#: What is still level, relative to the depth.
_LEVEL = 2.0**-44
#: The plane of a triangle whose corners are off by HEIGHT_ERROR, in units of |corner|·(|e| + |f|): see `_set_distance`.
_PLANE_ERROR = 8.0 * HEIGHT_ERROR


@kernel(inline=True)
def _load(pair, low, fine, known, ids, v, scale):
    """Have the fine point of a vertex."""
    if known[v] == 0:
        fine_point(pair, low, fine, v, ids[2 * v], ids[2 * v + 1], scale)
        known[v] = 1


@kernel(inline=True)
def _set_distance(pair, low, surface, fine, distances, known, direction, f, unsure, scale):
    """Take the plane of facet f again; its distance becomes known, and its clearance if it faces outwards for certain.

    Returns (|n|, spread): 0 where the facet has no area. What is level with the corners, and level with what is level
    with them, is at most the spread farther than the distance.
    """
    _, _, _, clearances, ids, facets, _, _, _ = surface
    a = facets[FACET * f]
    b = facets[FACET * f + 1]
    c = facets[FACET * f + 2]
    _load(pair, low, fine, known, ids, a, scale)
    _load(pair, low, fine, known, ids, b, scale)
    _load(pair, low, fine, known, ids, c, scale)
    set_plane(fine, a, b, c, direction)
    length = fine_length(direction)
    if length.high == 0.0:
        distances[2 * f] = math.inf
        distances[2 * f + 1] = 0.0
        clearances[f] = math.inf
        return 0.0, 0.0
    height = fine_height(fine, a, direction)
    distance, distance_low = dd.div(height, length)
    distances[2 * f] = distance
    distances[2 * f + 1] = distance_low
    # Rounding tilts the plane: its corners' heights are what counts, and along any direction no point of a triangle lies
    # nearer than the nearest corner.
    most = 0.0
    least_height = 0.0
    for corner in range(1, 3):
        other = dd.sub(fine_height(fine, facets[FACET * f + corner], direction), height)
        most = max(most, other.high)
        least_height = min(least_height, other.high)
    # Corners off by E move the normal by E(|e| + |f|) at most, so its height at a corner by |corner| times that.
    corner = 0.0
    sides = 0.0
    for axis in range(3):
        x = fine[STRIDE * a + 2 * axis]
        corner += abs(x)
        sides += abs(fine[STRIDE * b + 2 * axis] - x) + abs(fine[STRIDE * c + 2 * axis] - x)
    tilt = (_PLANE_ERROR + unsure) * corner * sides
    if height.high > tilt + unsure * length.high:
        nearest = distance + least_height / length.high
        clearances[f] = nearest - _ROUNDED * abs(nearest) - unsure
    else:
        clearances[f] = min(distance, 0.0) - unsure
    return length.high, (2.0 * most - least_height) / length.high


@kernel
def _find_vertex(ids, vertices, i, j):
    """Number of the vertex that is this pair of vertices of the bodies, or −1."""
    for v in range(vertices):
        if ids[2 * v] == i and ids[2 * v + 1] == j:
            return v
    return -1


@kernel
def _flip_to(surface, f, v, error):
    """Exchange a diagonal of facet f so that vertex v, across one of its edges, becomes a corner; whether it could."""
    _, _, _, _, _, facets, _, _, _ = surface
    for e in range(3):
        t = facets[FACET * f + TWIN + e]
        if facets[following(t) + 1] == v:
            flip(surface, f, e, error)
            return t // FACET
    return -1


@kernel
def _find_patch(pair, low, surface, fine, known, direction, f, apex, unsure, scale):
    """`surface.find_patch` by the fine planes."""
    _, _, _, _, ids, facets, _, border, patch = surface
    _load(pair, low, fine, known, ids, apex, scale)
    facets[FACET * f + MARKS] |= SEEN
    patch[0] = f
    found = 1
    visited = 0
    edges = 0
    while visited < found:
        g = patch[visited]
        visited += 1
        for e in range(3):
            t = facets[FACET * g + TWIN + e]
            h = t // FACET
            if facets[FACET * h + MARKS] & SEEN:
                continue
            if found < WIDEST_BORDER - 2 and _is_seen(pair, low, surface, fine, known, direction, h, apex, unsure, scale):
                facets[FACET * h + MARKS] |= SEEN
                patch[found] = h
                found += 1
            else:
                border[edges] = t
                edges += 1
    return found, edges


@kernel
def _is_seen(pair, low, surface, fine, known, direction, h, apex, unsure, scale):
    """Whether a vertex lies beyond the fine plane of facet h."""
    _, _, _, _, ids, facets, _, _, _ = surface
    for corner in range(3):
        _load(pair, low, fine, known, ids, facets[FACET * h + corner], scale)
    a = facets[FACET * h]
    set_plane(fine, a, facets[FACET * h + 1], facets[FACET * h + 2], direction)
    height = dd.sub(fine_height(fine, apex, direction), fine_height(fine, a, direction))
    return height.high > 4.0 * unsure * fine_length(direction).high


@kernel(inline=True)
def _forget(surface, distances, f, error, scale):
    """Facet f has a new plane, known in doubles only: what they prove, less their error, or nothing.

    What counts here are the true corners, so the origin has to lie behind it wherever they are.
    """
    _, _, _, clearances, _, facets, _, _, _ = surface
    distances[2 * f] = -math.inf
    if clearances[f] < math.inf:
        clearances[f] = (clearances[f] - error) * scale if facets[FACET * f + MARKS] & SURE else -math.inf


@kernel
def _name_tied(surface, distance, f, count, tied):
    """Enter the corners of facet f and of all others that may be as near the origin, for the exact stage."""
    _, _, _, clearances, ids, facets, _, _, _ = surface
    tied[0] = 1
    tied[1] = 0
    for turn in range(count + 1):
        g = f if turn == 0 else turn - 1
        if clearances[g] > distance or (turn > 0 and g == f):
            continue
        if tied[1] == MAX_TIED_FACETS:
            tied[0] = 0
            break
        at = 2 + 6 * tied[1]
        for k in range(3):
            v = facets[FACET * g + k]
            tied[at + 2 * k] = ids[2 * v]
            tied[at + 2 * k + 1] = ids[2 * v + 1]
        tied[1] += 1


@kernel
def refine(
    pair, terms_at, doubles_at, integers_at, direction_at, corners_at, exact_at, tied, count, vertices, size, slop, error
):  # fmt: skip
    """Grow the surface that `epa` left until its nearest facet is final to the last digits.

    direction_at, corners_at, exact_at : further workspace: STRIDE + 24 doubles, 6 integers and `lowest_pair`'s.
    tied : an entry of `depth_requests.py` out, where the depth is near rounding.
    count, vertices : as left.   size, slop, error : of the pair.

    Returns (sound, lower, depth, upper, nx, ny, nz, facet, count): a proven bracket of the cores' depth, which is
    the distance of the facet's plane, and its direction; no lower one unless the origin is proven to lie inside.
    Not sound: nothing was gained.
    """
    if not is_refinable(size):
        return False, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1, count
    surface = workspace(doubles_at, integers_at)
    points, _, _, clearances, ids, facets, starts, _, _ = surface
    fine, distances, known = fine_workspace(doubles_at, integers_at)
    direction = view_f64(direction_at, STRIDE)
    corners = view_i64(corners_at, 6)
    low = view_f64(direction_at + 8 * STRIDE, put_low_parts(pair, terms_at, direction_at + 8 * STRIDE))
    scale = unit_scale(size)
    over = 1.0 / scale
    unsure = HEIGHT_ERROR + SLOP_ERROR * slop * scale
    for v in range(vertices):
        known[v] = 0
    for f in range(count):
        _forget(surface, distances, f, error, scale)
    for _ in range(_STEPS):
        f = least(clearances, max(count, 8))
        taken = distances[2 * f] > -math.inf
        length, spread = _set_distance(pair, low, surface, fine, distances, known, direction, f, unsure, scale)
        if not taken and least(clearances, max(count, 8)) != f:
            continue
        distance = distances[2 * f]
        for k in range(STRIDE):
            direction[k] = -direction[k]
        for k in range(3):
            corners[2 * k] = ids[2 * facets[FACET * f + k]]
            corners[2 * k + 1] = ids[2 * facets[FACET * f + k] + 1]
        beyond = 0.0
        final = is_unique_minimiser(pair, corners, 3, direction, error)
        i = j = -1
        if not final:
            excess, i, j = lowest_pair(pair, low, corners, direction, exact_at, scale)
            beyond = -excess.high / length
            # Three heights make a level pair's; what is as good as a corner cannot be added, and widens the bracket.
            final = beyond <= max(_LEVEL * distance, 3.0 * unsure) or beyond <= spread
        if final:
            inner = clearances[f] if clearances[f] > 0.0 else -math.inf
            outer = distance + spread + beyond + 3.0 * unsure
            outer += _ROUNDED * abs(outer)
            if distance * over < 4.0 * error:
                _name_tied(surface, distance + spread + 8.0 * unsure, f, count, tied)
            return (
                True, inner * over, distance * over, outer * over,
                -direction[0] / length, -direction[2] / length, -direction[4] / length, f, count,
            )  # fmt: skip
        v = _find_vertex(ids, vertices, i, j)
        if v >= 0:
            h = _flip_to(surface, f, v, error)
            if h < 0:
                break
            _forget(surface, distances, f, error, scale)
            _forget(surface, distances, h, error, scale)
            continue
        if not has_room(vertices, count):
            break
        place_vertices(pair, points, ids, vertices, i, j)
        known[vertices] = 0
        starts[2 * vertices + 1] = -1
        found, edges = _find_patch(pair, low, surface, fine, known, direction, f, vertices, unsure, scale)
        count, _, _ = expand(surface, f, vertices, count, found, edges, math.inf, error, math.inf)
        for g in range(count):
            if vertices == facets[FACET * g + 2]:  # the apex stands last in what was made for it
                _forget(surface, distances, g, error, scale)
        vertices += 1
    return False, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1, count
