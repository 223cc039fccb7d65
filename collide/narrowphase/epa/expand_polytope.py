"""The growth of EPA's polytope, in doubles."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import EPA_VERTICES
from collide.narrowphase.epa.initial_polytope import Extremes, capped_tetrahedron, extremal_tetrahedron
from collide.narrowphase.epa.polytope_surface import (
    FACET,
    PLANE,
    TWIN,
    ample,
    corner,
    expand,
    find_patch,
    may_expand,
    normal_of,
    number,
    set_tetrahedron,
)
from collide.narrowphase.epa.prove_facets import prove_facets
from collide.narrowphase.gjk.minkowski_difference import (
    copy_coordinates,
    difference_point,
    has_trees,
    height,
    inlined_difference_point,
    point_at,
    settle_point,
)
from collide.narrowphase.gjk.simplex import face_weights
from collide.numerics.vec3 import Vec3, dot, neg
from collide.support.block_scan import least

#: How a run ends. EXPANDED: the facet nearest the origin is final, or the cap was met. FLAT: A ⊖ B
#: has no interior as far as rounding can tell.
EXPANDED, FLAT = range(2)

#: From this vertex on a repeated one is looked for among all of them: where faces are nearly parallel, runs went on
#: adding the same ones up to the cap.
_SEARCH_ALL_FROM = 64


class EpaResult(NamedTuple):
    """status : EXPANDED or FLAT.

    depth : least support value met: moving by this depth (plus ``error``) along nhat separates the cores;
        negative where the support plane already does.
    clearance : proven least distance of the surface from the origin (before ``error``), or −1.
    nhat : unit normal of the support plane.
    facet : the facet nearest the origin, −1 where FLAT.   n_vertices, n_facets : of the surface. Where FLAT, the first
        n_vertices points span A ⊖ B.
    """

    status: int
    depth: float
    clearance: float
    nhat: Vec3
    facet: int
    n_vertices: int
    n_facets: int


class Seed(NamedTuple):
    """Four points of A ⊖ B to begin with, from GJK.

    points, ids : POINT doubles and two vertices a point.   enclosed : the origin is proven to lie among them.
    well_conditioned : the origin lies among them clear of rounding by far.
    use_capped_tetrahedron : with so many vertices, iterations cost more than the supports of a better seed.
    start : how often EPA has begun elsewhere.
    """

    points: Any
    ids: Any
    enclosed: bool
    well_conditioned: bool
    use_capped_tetrahedron: bool
    start: int


class Goal(NamedTuple):
    """When EPA stops.

    overlap_suffices : once the origin is proven inside (a boolean is asked).
    size, error : of the pair, as in `bounds.py`.
    tolerance : once the bracket is this narrow.
    """

    overlap_suffices: bool
    size: float
    error: float
    tolerance: float


@kernel(inline=True)
def _is_corner(ids, facets, f, k):
    """Whether point k is a vertex of facet f or of a neighbour, or one of many vertices, by its support vertices."""
    if ids[2 * k] < 0 or ids[2 * k + 1] < 0:
        return False
    for side in range(4):
        g = f if side == 3 else facets[FACET * f + TWIN + side] // FACET
        for i in range(3):
            v = facets[FACET * g + i]
            if ids[2 * v] == ids[2 * k] and ids[2 * v + 1] == ids[2 * k + 1]:
                return True
    if k >= _SEARCH_ALL_FROM:
        for v in range(k):
            if ids[2 * v] == ids[2 * k] and ids[2 * v + 1] == ids[2 * k + 1]:
                return True
    return False


@kernel(inline=True)
def _vertex_fingerprint(ids, k):
    """A bit of 64, from point k's support vertices: a point whose bit is not among the bits met is new."""
    return 1 << ((8 * ids[2 * k] + ids[2 * k + 1]) & 63)


@kernel(inline=True)
def _surface_clearance(clearances, n_facets, error):
    """Least distance of a facet from the origin, or −1 unless every facet provably faces outwards."""
    nearest = clearances[least(clearances, max(n_facets, 8))]
    return nearest if nearest > error else -1.0


@kernel(inline=True)
def _put_seed(pair, points, ids, seed, goal):
    """Points 0 … 3 to begin with; returns `Extremes` of rank 3, or less where A ⊖ B is flat."""
    for k in range(4 if seed.enclosed else 0):
        copy_coordinates(seed.points, k, points, k)
        ids[2 * k] = seed.ids[2 * k]
        ids[2 * k + 1] = seed.ids[2 * k + 1]
    # GJK's own tetrahedron saves a dozen supports, if it is nothing like as thin as those of touching bodies.
    if seed.enclosed and (
        (seed.use_capped_tetrahedron and capped_tetrahedron(pair, points, ids, goal.size)) or seed.well_conditioned
    ):
        return Extremes(3, Vec3(0.0, 0.0, 0.0))
    return extremal_tetrahedron(pair, points, ids, goal.error, seed.start)


@kernel(inline=True)
def epa(pair, surface, seed, goal):
    """Expand until the nearest facet of A ⊖ B is known; returns an `EpaResult`.   surface : a `Surface` to grow in."""
    points, ids, facets, clearances = surface.points, surface.ids, surface.facets, surface.clearances
    overlap_suffices, error = goal.overlap_suffices, goal.error
    extremes = _put_seed(pair, points, ids, seed, goal)
    if extremes.rank < 3:
        return _flat_result(pair, points, ids, extremes)
    nhat = extremes.nhat
    enough = ample(goal.size, error)
    set_tetrahedron(surface, error, enough)
    met = 0
    for k in range(4):
        met |= _vertex_fingerprint(ids, k)
    n_facets = 4
    n_vertices = 4
    depth = math.inf
    facet = 0
    f = least(surface.reaches, 8)
    distance = surface.reaches[f]
    while True:
        f = number(f)
        if distance == math.inf:  # every facet is farther off than a known separating translation
            break
        if overlap_suffices and distance > 2.0 * error and _surface_clearance(clearances, n_facets, error) > error:
            break
        normal = normal_of(surface, f)
        inlined_difference_point(pair, points, ids, n_vertices, normal, False, -1, -1)
        value = height(points, n_vertices, normal)
        if overlap_suffices and value < -error and has_trees(pair):
            settle_point(pair, points, ids, n_vertices, normal)
            value = height(points, n_vertices, normal)
        facet = f  # its slot stays with the surface nearest the origin, also when it is exchanged
        if value < depth:
            depth = value
            nhat = normal
        if overlap_suffices and value < -error:
            return EpaResult(EXPANDED, depth, -1.0, nhat, facet, n_vertices, n_facets)
        if depth - distance <= goal.tolerance or not may_expand(n_vertices, n_facets):
            break
        if met & _vertex_fingerprint(ids, n_vertices) != 0 and _is_corner(ids, facets, f, n_vertices):
            break
        surface.starts[2 * n_vertices + 1] = -1
        seen = find_patch(surface, surface, f, point_at(points, number(n_vertices)), 0.0625 * error)
        # The nearest of what stays, while the cone's planes are worked out: neither has to wait for the other.
        nearest = least(surface.reaches, max(n_facets, 8))
        reach = surface.reaches[nearest]
        cone = expand(surface, f, n_vertices, n_facets, seen, depth, error, enough)
        n_facets = cone.n_facets
        stays = reach < cone.reach
        f = nearest if stays else cone.nearest
        distance = reach if stays else cone.reach
        met |= _vertex_fingerprint(ids, n_vertices)
        n_vertices += 1
    clearance = _surface_clearance(clearances, n_facets, error)
    if clearance < 0.0:
        prove_facets(surface, n_facets)
        clearance = _surface_clearance(clearances, n_facets, error)
    if has_trees(pair):
        depth = _extent(pair, points, ids, nhat)
    return EpaResult(EXPANDED, depth, clearance, nhat, facet, n_vertices, n_facets)


@kernel(inline=True)
def _flat_result(pair, points, ids, extremes):
    """The `EpaResult` of a flat A ⊖ B: across it, to the nearer side."""
    up = _extent(pair, points, ids, extremes.nhat)
    down = _extent(pair, points, ids, neg(extremes.nhat))
    nhat = neg(extremes.nhat) if down < up else extremes.nhat
    return EpaResult(FLAT, min(up, down), -1.0, nhat, -1, extremes.rank + 1, 0)


@kernel
def facet_of(surface, n_facets, best, p, slack):
    """The facet holding p, the origin's foot on the final plane: for the witness points.

    This facet need not be ``best``, whose plane settled the depth. A face of A ⊖ B with more than three corners is
    covered by several facets; and where the bodies just touch, the foot may be a corner or lie on an edge of facets in
    other planes.
    """
    greatest = -math.inf
    for g in range(n_facets):
        if abs(height_over(surface, g, p)) <= slack:
            a = point_at(surface.points, corner(surface, g, 0))
            b = point_at(surface.points, corner(surface, g, 1))
            c = point_at(surface.points, corner(surface, g, 2))
            w0, w1, w2 = face_weights(a, b, c, p)
            inside = min(w0, w1, w2)
            if inside > greatest:
                greatest = inside
                best = g
    return best


@kernel(inline=True)
def height_over(surface, g, p):
    """Height of a point over the plane of a facet."""
    return dot(normal_of(surface, g), p) - surface.planes[PLANE * g + 3]


@kernel
def _extent(pair, points, ids, nhat):
    """Support value of A ⊖ B in a unit direction, for certain."""
    k = EPA_VERTICES + 2
    difference_point(pair, points, ids, k, nhat)
    if has_trees(pair):
        settle_point(pair, points, ids, k, nhat)
    return height(points, k, nhat)
