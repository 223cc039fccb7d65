"""The last digits of a depth: the same growth in double-doubles, where the surface is nearest the origin.

Doubles leave a surface correct but for their rounding. Only facets within this rounding of the nearest matter: their
planes are computed again in double-doubles, the nearest facet's support vertex is searched among the vertices level
with the facet, and a vertex beyond is added. All other facets are known to be farther. Depths as small as touching need
no other treatment: down to 2⁻⁹⁶ of the size planes are told apart.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.epa.polytope_surface import (
    FACET,
    MARKS,
    PROVEN,
    SEEN,
    TWIN,
    expand,
    fine_surface_at,
    flip,
    following,
    make_find_patch,
    may_expand,
)
from collide.narrowphase.exact.depth_requests import MAX_TIED_FACETS
from collide.narrowphase.gap.precise_pair import (
    HEIGHT_ERROR,
    LOW_PARTS_OF_PAIR,
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
from collide.narrowphase.gjk.minkowski_difference import place_vertices, point_at
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, STRIDE
from collide.numerics.vec3 import Vec3, absolute, cross, divide, dot, neg, norm1, sub
from collide.support.block_scan import least

#: Vertices added, diagonals flipped and planes taken again before a run hands over the bracket it has.
_STEPS = 512
#: Bounds are handed over in doubles: a quotient, a sum and a product.
_ROUNDED = 4.0 * 2.0**-53
#: A vertex that lies no farther beyond the facet, relatively to the depth, makes it final.
_FINAL = 2.0**-44
#: The plane of a triangle whose corners are off by HEIGHT_ERROR, in units of |corner|·(|e| + |f|): see `_set_distance`.
_PLANE_ERROR = 8.0 * HEIGHT_ERROR


class RefinedDepth(NamedTuple):
    """sound : whether anything was gained.

    lower, depth, upper : a proven bracket of the cores' depth, the distance of the facet's plane; no lower bound
        unless the origin is proven to lie inside.   nhat : the plane's direction.   n_facets : of the surface now.
    """

    sound: bool
    lower: float
    depth: float
    upper: float
    nhat: Vec3
    facet: int
    n_facets: int


class _Fine(NamedTuple):
    """The surface, its double-doubles, and what more double-doubles are computed from.

    low : low parts of both poses.   points, distances, known : of `FineSurface`.   direction : a stored normal.
    nearest : that of the facet at work, reversed.
    error : of a height over the length of its direction.   scale : what coordinates are multiplied with.
    rounding : of a coordinate in doubles [m].
    """

    pair: Any
    surface: Any
    low: Any
    points: Any
    distances: Any
    known: Any
    direction: Any
    nearest: Any
    error: float
    scale: float
    rounding: float


@kernel
def _load(fine, v):
    """Compute the fine point of a vertex, if missing."""
    if fine.known[v] == 0:
        ids = fine.surface.ids
        fine_point(fine.pair, fine.low, fine.points, v, ids[2 * v], ids[2 * v + 1], fine.scale)
        fine.known[v] = 1


@kernel
def _load_plane(fine, f):
    """The fine normal of facet f, as long as twice its area, into ``direction``; returns its corners."""
    facets = fine.surface.facets
    for k in range(3):
        _load(fine, facets[FACET * f + k])
    a, b, c = facets[FACET * f], facets[FACET * f + 1], facets[FACET * f + 2]
    set_plane(fine.points, a, b, c, fine.direction)
    return a, b, c


@kernel(inline=True)
def _leading(fine, v):
    """The fine point of a vertex, rounded to doubles."""
    return dd.leading(dd.vec3_at(fine.points, STRIDE * v))


@kernel(inline=True)
def _set_distance(fine, f):
    """Take the plane of facet f again; its distance becomes known, and its clearance if it faces outwards for certain.

    Returns (|n|, spread): 0 where the facet has no area. What is tied with the corners, and tied with what is tied
    with them, is at most the spread farther than the distance.
    """
    clearances = fine.surface.clearances
    a, b, c = _load_plane(fine, f)
    length = fine_length(fine.direction)
    if length.high == 0.0:
        _put_distance(fine, f, DD(math.inf, 0.0))
        clearances[f] = math.inf
        return 0.0, 0.0
    height = fine_height(fine.points, a, fine.direction)
    distance = dd.div(height, length)
    _put_distance(fine, f, distance)
    # Rounding tilts the plane: its corners' heights are what counts, and along any direction no point of a triangle
    # lies nearer than the nearest corner.
    above_b = dd.sub(fine_height(fine.points, b, fine.direction), height).high
    above_c = dd.sub(fine_height(fine.points, c, fine.direction), height).high
    highest = max(max(0.0, above_b), above_c)
    lowest = min(min(0.0, above_b), above_c)
    # Corners off by E move the normal by E(|e| + |f|) at most, so its height at a corner by |corner| times that.
    corner = _leading(fine, a)
    e, g = absolute(sub(_leading(fine, b), corner)), absolute(sub(_leading(fine, c), corner))
    sides = ((e.x + g.x) + (e.y + g.y)) + (e.z + g.z)
    tilt = (_PLANE_ERROR + fine.error) * norm1(corner) * sides
    if height.high > tilt + fine.error * length.high:
        nearest = distance.high + lowest / length.high
        clearances[f] = nearest - _ROUNDED * abs(nearest) - fine.error
    else:
        clearances[f] = min(distance.high, 0.0) - fine.error
    return length.high, (2.0 * highest - lowest) / length.high


@kernel(inline=True)
def _nearest_facet(fine, n_facets, f, tie):
    """Take the planes of facet f and of all facets maybe as near again; returns the nearest facet, with the numbers of
    `_set_distance`, and writes its normal, reversed, into ``nearest``.

    tie : error of doubles [scaled], by which clearances known in doubles alone are too small.

    No plane waits for the outcome of another plane: their arithmetic overlaps in the processor.
    """
    clearances = fine.surface.clearances
    limit = clearances[f] + tie
    nearest, length, spread = f, 0.0, 0.0
    least_clearance = math.inf
    for g in range(n_facets):
        if g != f and (clearances[g] > limit or fine.distances[2 * g] > -math.inf):
            continue
        length_of_g, spread_of_g = _set_distance(fine, g)
        if clearances[g] < least_clearance or g == nearest:
            nearest, length, spread = g, length_of_g, spread_of_g
            least_clearance = clearances[g]
            for k in range(STRIDE):
                fine.nearest[k] = -fine.direction[k]
    return nearest, length, spread


@kernel(inline=True)
def _put_distance(fine, f, distance):
    fine.distances[2 * f] = distance.high
    fine.distances[2 * f + 1] = distance.low


@kernel
def _find_vertex(ids, n_vertices, i, j):
    """Number of the vertex that is this pair of vertices of the bodies, or −1."""
    for v in range(n_vertices):
        if ids[2 * v] == i and ids[2 * v + 1] == j:
            return v
    return -1


@kernel
def _flip_to(surface, f, v, error):
    """Exchange a diagonal of facet f so that vertex v, across an edge, becomes its corner.

    Returns the neighbour in the exchange, or −1.
    """
    for e in range(3):
        t = surface.facets[FACET * f + TWIN + e]
        if surface.facets[following(t) + 1] == v:
            flip(surface, f, e, error)
            return t // FACET
    return -1


@kernel
def _is_behind(fine, h, apex, margin):
    """Whether a vertex lies beyond the fine plane of facet h, which is not yet marked.

    Doubles first, unless the border is full: coordinates are off by ε = ``rounding`` at most, the edges e and f and the
    way w to the vertex by 2ε, e × f by 4ε·(|e| + |f|) + 24ε² and its height over the plane by at most
    |w|·(4ε·(|e| + |f|) + 24ε²) + 2ε·|e||f| and 8u·|e||f||w|, lengths as sums of coordinates. The margin is far below.
    """
    surface = fine.surface
    if surface.facets[FACET * h + MARKS] & SEEN:
        return False
    if margin == 0.0:
        corner = point_at(surface.points, surface.facets[FACET * h])
        e = sub(point_at(surface.points, surface.facets[FACET * h + 1]), corner)
        f = sub(point_at(surface.points, surface.facets[FACET * h + 2]), corner)
        w = sub(point_at(surface.points, apex), corner)
        over = dot(cross(e, f), w)
        e_length, f_length, w_length = norm1(e), norm1(f), norm1(w)
        eps = fine.rounding
        error = eps * (8.0 * w_length * (e_length + f_length + 8.0 * eps) + 8.0 * e_length * f_length)
        if abs(over) > error:
            return over > 0.0
    a, _, _ = _load_plane(fine, h)
    height = dd.sub(fine_height(fine.points, apex, fine.direction), fine_height(fine.points, a, fine.direction))
    return height.high > 4.0 * fine.error * fine_length(fine.direction).high + margin


_find_patch = make_find_patch(_is_behind)


@kernel(inline=True)
def _invalidate(fine, f, error):
    """Facet f has a new plane, known in doubles only: what they prove, less their error, or nothing.

    What counts here are the true corners, so the origin has to lie behind it wherever they are.
    """
    clearances = fine.surface.clearances
    fine.distances[2 * f] = -math.inf
    if clearances[f] < math.inf:
        proven = fine.surface.facets[FACET * f + MARKS] & PROVEN
        clearances[f] = (clearances[f] - error) * fine.scale if proven else -math.inf


@kernel
def _request_nearest(surface, distance, f, n_facets, request):
    """Enter the corners of facet f and of all others that may be as near the origin, for the exact stage."""
    request[0] = 1
    request[1] = 0
    for step in range(n_facets + 1):
        g = f if step == 0 else step - 1
        if surface.clearances[g] > distance or (step > 0 and g == f):
            continue
        if request[1] == MAX_TIED_FACETS:
            request[0] = 0
            break
        at = 2 + 6 * request[1]
        for k in range(3):
            v = surface.facets[FACET * g + k]
            request[at + 2 * k] = surface.ids[2 * v]
            request[at + 2 * k + 1] = surface.ids[2 * v + 1]
        request[1] += 1


@kernel(inline=True)
def _fine(pair, terms_at, work, surface, size, slop, rounding):
    """The `_Fine` of a surface, none of whose fine points is known."""
    fine = fine_surface_at(work.epa_at, work.epa_integers_at)
    low_at = work.fine_at + 8 * STRIDE
    low = view_f64(low_at, put_low_parts(pair, terms_at, low_at))
    scale = unit_scale(size)
    error = HEIGHT_ERROR + SLOP_ERROR * slop * scale
    return _Fine(
        pair, surface, low, fine.points, fine.distances, fine.known, view_f64(work.fine_at, STRIDE),
        view_f64(low_at + 8 * LOW_PARTS_OF_PAIR, STRIDE), error, scale, rounding,
    )


@kernel(cold=True)
def refine(pair, terms_at, work, surface, n_facets, n_vertices, size, slop, error):
    """Grow the surface that `epa` returned until its nearest facet is final to the last digits; returns a
    `RefinedDepth`.

    work : the `Workspace`, whose ``request`` becomes an entry of `depth_requests.py` where the depth is near rounding.
    size, slop, error : of the pair.
    """
    if not is_refinable(size):
        return RefinedDepth(False, 0.0, 0.0, 0.0, Vec3(0.0, 0.0, 1.0), -1, n_facets)
    fine = _fine(pair, terms_at, work, surface, size, slop, error)
    corners = view_i64(work.nearest_at, 6)
    ids, clearances, direction = surface.ids, surface.clearances, fine.nearest
    over = 1.0 / fine.scale
    for v in range(n_vertices):
        fine.known[v] = 0
    for f in range(n_facets):
        _invalidate(fine, f, error)
    for _ in range(_STEPS):
        f, length, spread = _nearest_facet(fine, n_facets, least(clearances, max(n_facets, 8)), error * fine.scale)
        if least(clearances, max(n_facets, 8)) != f:
            continue
        distance = fine.distances[2 * f]
        for k in range(3):
            v = surface.facets[FACET * f + k]
            corners[2 * k] = ids[2 * v]
            corners[2 * k + 1] = ids[2 * v + 1]
        beyond = 0.0
        final = is_unique_minimiser(pair, corners, 3, direction, error)
        i = j = -1
        if not final:
            excess, i, j = lowest_pair(pair, fine.low, corners, direction, work.ties_at, fine.scale)
            beyond = -excess.high / length
            # Three heights make a tied pair's; what is as good as a corner cannot be added, and widens the bracket.
            final = beyond <= max(_FINAL * distance, 3.0 * fine.error) or beyond <= spread
        if final:
            lower = clearances[f] if clearances[f] > 0.0 else -math.inf
            upper = distance + spread + beyond + 3.0 * fine.error
            upper += _ROUNDED * abs(upper)
            if distance * over < 4.0 * error:
                _request_nearest(surface, distance + spread + 8.0 * fine.error, f, n_facets, work.request)
            nhat = divide(neg(dd.leading(dd.vec3_at(direction, 0))), length)
            return RefinedDepth(True, lower * over, distance * over, upper * over, nhat, f, n_facets)
        v = _find_vertex(ids, n_vertices, i, j)
        if v >= 0:
            h = _flip_to(surface, f, v, error)
            if h < 0:
                break
            _invalidate(fine, f, error)
            _invalidate(fine, h, error)
            continue
        if not may_expand(n_vertices, n_facets):
            break
        n_facets = _add_vertex(fine, f, n_vertices, n_facets, i, j, error)
        n_vertices += 1
    return RefinedDepth(False, 0.0, 0.0, 0.0, Vec3(0.0, 0.0, 1.0), -1, n_facets)


@kernel(inline=True)
def _add_vertex(fine, f, apex, n_facets, i, j, error):
    """Expand the surface by the difference of vertices i of A and j of B, seen from facet f; returns how many facets it
    has."""
    surface = fine.surface
    place_vertices(fine.pair, surface.points, surface.ids, apex, i, j)
    fine.known[apex] = 0
    surface.starts[2 * apex + 1] = -1
    _load(fine, apex)
    seen = _find_patch(fine, surface, f, apex, 0.0)
    cone = expand(surface, f, apex, n_facets, seen, math.inf, error, math.inf)
    for g in range(cone.n_facets):
        if apex == surface.facets[FACET * g + 2]:  # the apex stands last in what was made for it
            _invalidate(fine, g, error)
    return cone.n_facets
