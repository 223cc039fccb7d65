"""The growing polytope of EPA: a closed, oriented surface of triangles over points of A ⊖ B.

A facet is a slot: three vertices and the three half-edges across its own. Expanding takes a patch of facets out and
puts a cone over the patch's border in, into the same slots and two new ones, so all slots up to the number of
facets are in use.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.bounds import EPA_FACETS, EPA_VERTICES
from collide.narrowphase.gjk.minkowski_difference import POINT, copy_point, point_at
from collide.narrowphase.gjk.simplex import signed_volume
from collide.numerics.vec3 import Vec3, cross, dot, norm1, put_vec3, scale, sub, vec3_at

#: Doubles a facet's plane: unit normal, and the least of its corners along it.
PLANE = 4
#: Integers a facet: vertices 0 … 2 and vertex 0 again, half-edges across 0→1, 1→2, 2→0, marks. The half-edge that
#: begins at corner e of facet f is the number FACET·f + e: its origin stands there, its end next to it, and the
#: half-edge across TWIN places on.
FACET, TWIN, MARKS = 8, 4, 7
#: Marks: the facet is seen from the apex; the origin lies behind it wherever its corners truly are.
SEEN, PROVEN = 1, 2
#: Vertices stand in this many points; the last ones are for trying.
POINTS = EPA_VERTICES + 8
#: Rounding of the determinant of three corners, in units of |a|·|b − a|·|c − a| as sums of coordinates: eight roundings
#: in a row, doubled.
DETERMINANT_ERROR = 16 * 2.0**-53
#: Most edges of a border.
WIDEST_BORDER = 512
#: Above every number of a vertex, facet or half-edge.
_NUMBERS = (1 << 16) - 1

#: Doubles and integers of workspace one run needs (see `surface_at`).
DOUBLES = (POINT + 6) * POINTS + (PLANE + 4) * EPA_FACETS
INTEGERS = 3 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER


@kernel(inline=True)
def number(stored):
    """A vertex, facet or half-edge as stored. The mask tells the compiler of an index ≥ 0, and changes nothing else: an
    index of unknown sign is compared and replaced at every access."""
    return stored & _NUMBERS


class Surface(NamedTuple):
    """Views of a polytope in its workspace.

    points, ids : of its vertices, POINT doubles and a vertex of A and of B each.
    planes : PLANE doubles a facet.   facets : FACET integers a facet.
    reaches : distance of each facet's plane from the origin, ∞ if farther than a known separating translation.
    clearances : proven distance of each facet from the origin, seen from its inner side, or −1.
    starts : by vertex, the new facet whose base begins there, and its apex.
    border, patch : half-edges around a replaced patch, and its facets.
    """

    points: Any
    planes: Any
    reaches: Any
    clearances: Any
    ids: Any
    facets: Any
    starts: Any
    border: Any
    patch: Any


class FineSurface(NamedTuple):
    """Further views for `refine_depth.py`.

    points : FINE doubles a vertex.   distances : a double-double a facet.
    known : whether a vertex's fine point is there.
    """

    points: Any
    distances: Any
    known: Any


@kernel(inline=True)
def surface_at(doubles_at, integers_at):
    """The `Surface` in DOUBLES doubles and INTEGERS int64."""
    planes_at = doubles_at + 8 * POINT * POINTS
    reaches_at = planes_at + 8 * PLANE * EPA_FACETS
    facets_at = integers_at + 8 * 2 * POINTS
    starts_at = facets_at + 8 * FACET * EPA_FACETS
    border_at = starts_at + 8 * 2 * EPA_VERTICES
    return Surface(
        view_f64(doubles_at, POINT * POINTS), view_f64(planes_at, PLANE * EPA_FACETS), view_f64(reaches_at, EPA_FACETS),
        view_f64(reaches_at + 8 * EPA_FACETS, EPA_FACETS), view_i64(integers_at, 2 * POINTS),
        view_i64(facets_at, FACET * EPA_FACETS), view_i64(starts_at, 2 * EPA_VERTICES),
        view_i64(border_at, 2 * WIDEST_BORDER), view_i64(border_at + 8 * 2 * WIDEST_BORDER, EPA_FACETS),
    )


@kernel(inline=True)
def fine_surface_at(doubles_at, integers_at):
    """The `FineSurface` in the same workspace, behind the `Surface`."""
    fine_at = doubles_at + 8 * (POINT * POINTS + (PLANE + 2) * EPA_FACETS)
    known_at = integers_at + 8 * (2 * POINTS + (FACET + 1) * EPA_FACETS + 2 * EPA_VERTICES + 2 * WIDEST_BORDER)
    return FineSurface(
        view_f64(fine_at, 6 * POINTS), view_f64(fine_at + 8 * 6 * POINTS, 2 * EPA_FACETS), view_i64(known_at, POINTS)
    )


@kernel(inline=True)
def corner(surface, f, k):
    """Vertex k of facet f."""
    return number(surface.facets[FACET * f + k])


@kernel(inline=True)
def normal_of(surface, f):
    """The unit normal of facet f."""
    return vec3_at(surface.planes, PLANE * f)


@kernel(inline=True)
def ample(size, error):
    """A determinant of three points of A ⊖ B above this value is clear of rounding, and of ``error``, for every
    triangle.

    Coordinates of a point add up to √3·size at most, coordinates of an edge to twice as much: the bounds of `_sides` at
    these sizes.
    """
    return 128.0 * error * size * size


@kernel(inline=True)
def _sides(determinant, a, e, f, error):
    """(behind, proven) of `plane_of`, from the lengths of this very triangle."""
    e, f, a = norm1(e), norm1(f), norm1(a)
    return determinant > DETERMINANT_ERROR * a * e * f, determinant > 2.0 * error * (e * f + 2.0 * a * (e + f))


class FacetPlane(NamedTuple):
    """The plane of a triangle, counter-clockwise from outside.

    normal : unit, 0 where the triangle has no area.
    distance : the least of the corners' along the normal: for any unit normal, however badly a thin triangle
        defines it, no point of the triangle lies nearer the origin.
    clearance : the same where the origin provably lies behind the triangle of the corners as they stand, else −1.
    proven : whether it would with corners anywhere within ``error`` of these (see `simplex.height_behind`).
    """

    normal: Vec3
    distance: float
    clearance: float
    proven: bool


@kernel(inline=True)
def plane_of(a, b, c, error, enough):
    """The `FacetPlane` of a triangle.   enough : `ample`, which nearly all triangles are beyond, or ∞."""
    e, f = sub(b, a), sub(c, a)
    n = cross(e, f)
    square = dot(n, n)
    determinant = dot(n, a)
    behind = True
    proven = True
    if not determinant > enough:
        if square == 0.0:
            return FacetPlane(Vec3(0.0, 0.0, 0.0), math.inf, -1.0, False)
        behind, proven = _sides(determinant, a, e, f, error)
    n = scale(1.0 / math.sqrt(square), n)
    distance = min(min(dot(n, a), dot(n, b)), dot(n, c))
    return FacetPlane(n, distance, distance if behind else -1.0, proven)


@kernel(inline=True)
def set_facet(surface, f, i, j, k, error, enough, depth):
    """Slot f becomes the facet on vertices i, j, k, counter-clockwise from outside; returns its reach.

    Eight facets at a time in vectors took longer than eight in turn: corners have to be gathered, and numbers stored
    singly are slow to load together.
    """
    points, facets = surface.points, surface.facets
    f = number(f)
    plane = plane_of(
        point_at(points, number(i)), point_at(points, number(j)), point_at(points, number(k)), error, enough
    )
    at = FACET * f
    facets[at] = i
    facets[at + 1] = j
    facets[at + 2] = k
    facets[at + 3] = i
    facets[at + MARKS] = PROVEN if plane.proven else 0
    put_vec3(surface.planes, PLANE * f, plane.normal)
    surface.planes[PLANE * f + 3] = plane.distance
    # A facet farther off than a known separating translation will never be the nearest.
    reach = plane.distance if plane.distance <= depth else math.inf
    surface.reaches[f] = reach
    surface.clearances[f] = plane.clearance
    return reach


@kernel
def set_tetrahedron(surface, error, enough):
    """The first four facets, outwards, over points 0 … 3, with their neighbours."""
    points, ids, facets = surface.points, surface.ids, surface.facets
    if signed_volume(points, 0) > 0.0:
        # Vertex 3 must lie behind facet 0, 1, 2.
        copy_point(points, ids, 1, EPA_VERTICES)
        copy_point(points, ids, 2, 1)
        copy_point(points, ids, EPA_VERTICES, 2)
    for f in range(4):  # (0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)
        i = 0 if f < 2 else f - 1
        j = 1 if f == 0 else 3
        k = 2 if f == 0 or f == 2 else (1 if f == 1 else 0)
        set_facet(surface, f, i, j, k, error, enough, math.inf)
        surface.starts[2 * f + 1] = -1
        surface.reaches[f + 4] = math.inf
        surface.clearances[f + 4] = math.inf
    join(facets, 0, FACET + 2)
    join(facets, 1, 2 * FACET + 2)
    join(facets, 2, 3 * FACET + 2)
    join(facets, FACET, 3 * FACET + 1)
    join(facets, FACET + 1, 2 * FACET)
    join(facets, 2 * FACET + 1, 3 * FACET)


@kernel(inline=True)
def join(facets, s, t):
    """Two half-edges lie across from one another."""
    facets[s + TWIN] = t
    facets[t + TWIN] = s


@kernel(inline=True)
def following(t):
    """The next half-edge of the same facet."""
    return t - 2 if t % FACET == 2 else t + 1


class Patch(NamedTuple):
    """What an apex sees of a surface: numbers of its facets, in ``patch``, and of the half-edges around them, in
    ``border``."""

    n_facets: int
    n_edges: int


def make_find_patch(is_behind: Callable) -> Callable:
    """A kernel ``find_patch(planes, surface, f, apex, slack)``: the `Patch` seen by the apex, spreading from facet f
    over shared edges; marks its facets as seen.

    is_behind(planes, h, apex, margin) : whether facet h has the apex beyond its plane by more than the margin: the
        slack, or ∞ where the border is full. planes, apex : as given by the caller.

    ``border`` gets the half-edges of facets that stay, ``patch`` the facets, whose reach becomes ∞. No branch depends
    on an outcome of is_behind: a mispredicted branch costs more than an edge.
    """

    @kernel(inline=True)
    def find_patch(planes, surface, f, apex, slack):
        facets, border, patch = surface.facets, surface.border, surface.patch
        facets[FACET * f + MARKS] |= SEEN
        patch[0] = f
        n_facets = 1
        visited = 0
        n_edges = 0
        while visited < n_facets:
            g = number(patch[visited])
            surface.reaches[g] = math.inf
            first = FACET * g + TWIN
            visited += 1
            margin = slack if n_facets < WIDEST_BORDER - 4 else math.inf
            for e in range(3):
                t = number(facets[first + e])
                h = t // FACET
                marks = facets[FACET * h + MARKS]
                fresh = 1 - (marks & SEEN)
                seen = fresh if is_behind(planes, h, apex, margin) else 0
                facets[FACET * h + MARKS] = marks | seen
                patch[number(n_facets)] = h
                n_facets += seen
                border[number(n_edges)] = t
                n_edges += fresh - seen
        return Patch(n_facets, n_edges)

    return find_patch


@kernel(inline=True)
def _is_behind(surface, h, apex, margin):
    """In doubles; apex : the point."""
    return dot(normal_of(surface, h), apex) > surface.planes[PLANE * h + 3] + margin


find_patch = make_find_patch(_is_behind)


class Cone(NamedTuple):
    """After an expansion: number of facets of the surface; the nearest of the new ones and its reach."""

    n_facets: int
    nearest: int
    reach: float


@kernel(inline=True)
def expand(surface, f, apex, count, seen, depth, error, enough):
    """Replace the `Patch` ``seen`` by a cone from its border to the apex, in a surface of ``count`` facets; returns a
    `Cone`.

    Where the patch is no disc, as rounding may make the patch, facet f alone is replaced.
    """
    facets, starts, border, patch = surface.facets, surface.starts, surface.border, surface.patch
    n_facets, n_edges = seen.n_facets, seen.n_edges
    nearest = EPA_FACETS
    least_reach = math.inf
    for k in range(n_edges):
        start = number(facets[number(border[k]) + 1])
        if starts[2 * start + 1] == apex:
            n_edges = 0  # pinched: the border passes a vertex twice
            break
        starts[2 * start] = patch[k] if k < n_facets else count + k - n_facets
        starts[2 * start + 1] = apex
    if n_edges == 0:
        for k in range(1, n_facets):
            h = number(patch[k])
            facets[FACET * h + MARKS] &= PROVEN
            distance = surface.planes[PLANE * h + 3]
            surface.reaches[h] = distance if distance <= depth else math.inf
            if surface.reaches[h] < least_reach:
                least_reach = surface.reaches[h]
                nearest = h
        n_facets = 1
        n_edges = 3
        for e in range(3):
            t = number(facets[FACET * f + TWIN + e])
            border[e] = t
            starts[2 * number(facets[t + 1])] = f if e == 0 else count + e - 1
    for k in range(n_edges):
        t = number(border[k])
        end = number(facets[t])
        start = number(facets[t + 1])
        new = number(starts[2 * start])
        patch[k] = new
        reach = set_facet(surface, new, start, end, apex, error, enough, depth)
        nearer = reach < least_reach
        least_reach = reach if nearer else least_reach
        nearest = new if nearer else nearest
        join(facets, FACET * new, t)
        join(facets, FACET * new + 1, FACET * number(starts[2 * end]) + 2)
    for k in range(n_edges, n_facets):  # slots of a patch around several vertices: given up
        h = number(patch[k])
        surface.reaches[h] = math.inf
        surface.clearances[h] = math.inf
        surface.planes[PLANE * h + 3] = math.inf
    return Cone(count + max(n_edges - n_facets, 0), nearest, least_reach)


@kernel
def flip(surface, f, e, error):
    """Exchange the diagonal of facet f and its neighbour across edge e: two facets with the same border."""
    facets = surface.facets
    s = FACET * f + e
    t = facets[s + TWIN]
    h = t // FACET
    across_qr = facets[following(s) + TWIN]
    across_rp = facets[following(following(s)) + TWIN]
    across_pv = facets[following(t) + TWIN]
    across_vq = facets[following(following(t)) + TWIN]
    p = facets[s]
    q = facets[s + 1]
    r = facets[following(s) + 1]
    v = facets[following(t) + 1]
    set_facet(surface, f, p, v, r, error, math.inf, math.inf)
    set_facet(surface, h, v, q, r, error, math.inf, math.inf)
    join(facets, FACET * f, across_pv)
    join(facets, FACET * f + 1, FACET * h + 2)
    join(facets, FACET * f + 2, across_rp)
    join(facets, FACET * h, across_vq)
    join(facets, FACET * h + 1, across_qr)


@kernel(inline=True)
def may_expand(n_vertices, n_facets):
    """Whether one more expansion fits."""
    return n_vertices + 1 < EPA_VERTICES and n_facets + 2 < EPA_FACETS
