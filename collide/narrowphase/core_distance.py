"""Two convex cores without the balls around them: a gap or a depth, its feature, and a bracket.

GJK, and EPA where the cores overlap; `refine_depth.py` finds the last digits of a depth. Points and segments:
`sphere_sphere.py`, `sphere_capsule.py`, `capsule_capsule.py`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import COARSE_CURVED, GJK_ROUNDS, PROMISE_DEPTH, TOLERANCE_CURVED, WELL_CONDITIONED
from collide.narrowphase.epa.expand_polytope import FLAT, EpaResult, Goal, Seed, epa, facet_of, height_over
from collide.narrowphase.epa.origin_foot import load_facet, weigh_nearest, weigh_origin
from collide.narrowphase.epa.polytope_surface import number, surface_at
from collide.narrowphase.epa.refine_depth import refine
from collide.narrowphase.gap.curved_depth import refine_curved_depth
from collide.narrowphase.gjk.gjk import APART, ENCLOSED, NEAREST, gjk
from collide.narrowphase.gjk.minkowski_difference import (
    AXIS,
    NEAREST_POINT,
    POINT,
    POINT_OF_A,
    POINT_OF_B,
    weighted_sum,
)
from collide.narrowphase.gjk.simplex import nearest_of_all, weigh_enclosed
from collide.narrowphase.shallow_cylinders import is_cylinder_pair, shallow_cylinders
from collide.narrowphase.shallow_ellipsoids import NOTHING, is_ellipsoid_pair, shallow_ellipsoids
from collide.numerics.vec3 import Vec3, add, neg, norm, norm1, put_vec3, scale, sub, vec3_at

#: A weighted point is the foot on a plane if it misses that by no more, in units of the pair's size.
_NEAR_MISS = 2.0**-48
#: Of a bracket's width, what weighted points of curved cores may miss the foot by.
_MISS_OF_WIDTH = 2.0**-10
#: Nearest points of curved cores move by half of so much, in units of the pair's size, and of twice the width of their
#: bracket, to be across the plane between them.
_CARRIED = 2.0**-35
#: Least weight of a foot well inside its facet.
_WELL_INSIDE = 2.0**-10
#: With more vertices than this in two cores, a better seed for EPA than GJK's tetrahedron is worth its support points.
_MAX_VERTICES_FOR_GJK_SEED = 48
#: How often EPA begins at most, where there are so many vertices.
_MAX_STARTS = 4


class CoreDistance(NamedTuple):
    """What is known of the distance of two cores, before ``error``.

    depth : of the overlap; minus their distance where they are apart.
    lower, upper : bounds of the signed distance.
    shallowest, deepest : proven bracket of the depth by `refine`, or (−∞, ∞).
    nhat : unit vector from A towards B.
    n_points : of the deciding feature in the workspace.   n_vertices : how many of its vertex pairs the row names.
    iterations : of GJK, plus 65536 times those of EPA.
    """

    depth: float
    lower: float
    upper: float
    shallowest: float
    deepest: float
    nhat: Vec3
    n_points: int
    n_vertices: int
    iterations: int


@kernel(inline=True)
def convex_cores(ordered, query, work, radius, error, curved, n_start):
    """The `CoreDistance` of two convex cores by GJK, and by EPA where they overlap.

    radius : sum of the radii.   error : of a bound.   curved : a core is no polytope.   n_start : as of `gjk`.
    """
    pair = ordered.pair
    points, weights, ids = work.points, work.weights, work.ids
    exact_numbers = ordered.exact_numbers and not curved
    if query.depths and curved:
        shallow = _shallow_depth(pair, work, ordered.size)
        if shallow.is_proven:
            depth, proven, nhat = shallow.depth, shallow.proven, shallow.nhat
            core = CoreDistance(depth, -depth, -proven, -math.inf, math.inf, nhat, 1, 1, shallow.iterations)
            if query.resumes or not ordered.exact_numbers:
                return core
            surface = surface_at(work.epa_at, work.epa_integers_at)
            return _refined(core, refine_curved_depth(ordered, work, 1, False, nhat, surface, 0, error), work, error)
    # Of polytopes at rest the last digits tell the normal (`gap/refine_gap.py`); a motion tries axes between this one
    # and the last where it is a poor one.
    axis_from = 0.125 if query.resumes else 0.0 if curved else math.inf
    axis_from = math.inf if query.boolean else axis_from
    run = gjk(pair, points, ids, weights, n_start, query.boolean, axis_from, radius, query.limit, error, GJK_ROUNDS)
    n = run.n_points
    distance = norm(vec3_at(weights, NEAREST_POINT))
    if run.status == NEAREST or run.status == APART:
        nhat = neg(vec3_at(weights, AXIS))
        if curved and not (query.boolean or query.resumes):
            tolerance = _CARRIED * ordered.size + 2.0 * max(distance - run.lower, 0.0)
            nhat = _normal_of_gap(vec3_at(weights, NEAREST_POINT), distance, nhat, tolerance)
        return CoreDistance(-distance, run.lower, distance, -math.inf, math.inf, nhat, n, n, run.iterations)
    enclosed = run.status == ENCLOSED
    upper = -run.clearance if enclosed else distance
    # What the exact stage can settle needs no EPA to find out whether it is open.
    if not query.depths and (upper + error < radius or exact_numbers):
        if enclosed and not query.boolean:
            _weigh_enclosed(work)
        return _common_point(upper, n, run.iterations)
    return _by_epa(ordered, query, work, run, upper, radius, error, curved)


@kernel(inline=True)
def _by_epa(ordered, query, work, run, upper, radius, error, curved):
    """The `CoreDistance` of cores that GJK could not separate.   run : its result.   upper : of the signed distance.

    Depths of curved cores begin with a coarse surface, mostly enough to prove the last digits.
    """
    size = ordered.size
    is_refined = curved and query.depths and ordered.exact_numbers and not query.resumes
    tolerance = (COARSE_CURVED if is_refined else TOLERANCE_CURVED) * size if curved else 0.25 * error
    while True:
        core = _by_surface(ordered, query, work, run, upper, radius, error, curved, is_refined, tolerance)
        is_narrow = core.deepest - core.shallowest <= PROMISE_DEPTH * (core.depth + radius)
        if not is_refined or is_narrow or tolerance < COARSE_CURVED * size:
            return core
        tolerance = TOLERANCE_CURVED * size
        _take_simplex(work)


@kernel(inline=True)
def _normal_of_gap(v, distance, nhat, tolerance):
    """The direction along which curved cores are proven apart, if their nearest points can be moved onto its line.

    The nearest point v of A ⊖ B stops at rounding: across its direction, v is off by √(distance · rounding), and the
    direction by this error over the distance, so corners of A ⊖ B far from v may come nearer along v than v. No corner
    does along the normal of the plane of the lower bound.   tolerance : largest miss of the points [m].
    """
    if not distance > 0.0 or norm(add(v, scale(distance, nhat))) <= tolerance:
        return nhat
    return scale(-1.0 / distance, v)


@kernel(inline=True)
def _refined(core, fine, work, error):
    """The `CoreDistance` with the last digits of a `CurvedDepth`, if that proves more; its points become point 0."""
    if not (fine.is_proven and fine.upper - fine.lower < core.upper - core.lower + 2.0 * error):
        return core
    put_vec3(work.points, POINT_OF_A, fine.a)
    put_vec3(work.points, POINT_OF_B, fine.b)
    work.weights[0] = 1.0
    depth = 0.5 * (fine.lower + fine.upper)
    return CoreDistance(
        depth, core.lower, core.upper, fine.lower, fine.upper, fine.nhat, 1, core.n_vertices, core.iterations
    )


@kernel
def _shallow_depth(pair, work, size):
    """The `ShallowDepth` of two cores, one of them curved."""
    if is_ellipsoid_pair(pair):
        return shallow_ellipsoids(pair, work.points, work.ids, work.weights, size, TOLERANCE_CURVED * size)
    if is_cylinder_pair(pair):
        return shallow_cylinders(pair, work.points, work.ids, work.weights, size, TOLERANCE_CURVED * size)
    return NOTHING


@kernel(inline=True)
def _by_surface(ordered, query, work, run, upper, radius, error, curved, is_refined, tolerance):
    """`_by_epa` with a surface grown until the bracket is as narrow as ``tolerance``."""
    pair, size = ordered.pair, ordered.size
    points, weights, ids = work.points, work.weights, work.ids
    exact_numbers = ordered.exact_numbers and not curved
    enclosed = run.status == ENCLOSED
    n = run.n_points
    polytope = surface_at(work.epa_at, work.epa_integers_at)
    use_capped_tetrahedron = query.depths and not curved and pair.A.n + pair.B.n > _MAX_VERTICES_FOR_GJK_SEED
    well_conditioned = enclosed and run.clearance > WELL_CONDITIONED * size
    iterations = run.iterations
    shallowest, deepest = -math.inf, math.inf
    # A gap next to nothing has its nearest points where the whole surface is known, as a depth has; a gap of polytopes
    # of exact numbers gets its points with its last digits.
    has_points = query.depths or not (query.boolean or exact_numbers)
    if has_points:
        _keep_simplex(work)
    start = 0
    while True:  # where rounding has spoilt a surface, one that begins elsewhere is often sound
        seed = Seed(points, ids, enclosed and start == 0, well_conditioned, use_capped_tetrahedron, start)
        result = epa(pair, polytope, seed, Goal(not has_points, size, error, tolerance))
        iterations += 65536 * max(result.n_vertices - 4, 0)
        if result.status == FLAT:
            if result.n_vertices == 3 and not curved:  # what spans it: for the exact stage, which may prove it flat
                request_plane(polytope.ids, work.request)
            return CoreDistance(result.depth, -result.depth, upper, shallowest, deepest, result.nhat, n, n, iterations)
        wants_common_point = not query.depths and not query.boolean and result.clearance > error
        if wants_common_point and weigh_origin(polytope, result.n_facets, points, ids, weights):
            # EPA stopped before it knew any separating translation.
            return _common_point(-result.clearance, 4, iterations)
        lower = -result.depth  # the depth of a last facet is no bound: what it is level with may lie beyond it
        if not exact_numbers or not query.depths or _is_final(result, size, error, radius):
            break
        refined = refine(
            pair, query.terms_at, work, polytope, result.n_facets, result.n_vertices, size, ordered.slop, error
        )
        if refined.sound:
            shallowest, deepest = refined.lower, refined.upper
        result = _refined_result(result, refined, error)
        start += 1
        # few vertices: `exact_depth.py` tries all planes instead
        if refined.sound or not use_capped_tetrahedron or start == _MAX_STARTS:
            break
    with_ids = is_refined or not enclosed
    miss = _weigh_foot(work, polytope, result, has_points, with_ids, curved, tolerance, size, error)
    of_gjk = abs(result.depth) + (0.0 if enclosed else upper)  # what GJK's last simplex may miss the foot by
    if result.clearance > error:
        upper = min(upper, -result.clearance)
    n_vertices = 4 if enclosed else 3
    if miss > of_gjk:  # the surface is unfinished
        _take_simplex(work)
        if enclosed:
            _weigh_enclosed(work)
        return CoreDistance(result.depth, lower, upper, shallowest, deepest, result.nhat, n, n, iterations)
    core = CoreDistance(result.depth, lower, upper, shallowest, deepest, result.nhat, 3, n_vertices, iterations)
    if is_refined:
        n_facets = result.n_facets if result.clearance > error else 0
        fine = refine_curved_depth(ordered, work, 3, True, result.nhat, polytope, n_facets, error)
        if enclosed:
            _take_vertices(work)
        core = _refined(core, fine, work, error)
    return core


@kernel(inline=True)
def _keep_simplex(work):
    """Copy points 0 … 3, their weights and their vertices to where `_take_simplex` finds them."""
    for k in range(4 * POINT):
        work.simplex[k] = work.points[k]
    for k in range(4):
        work.simplex[4 * POINT + k] = work.weights[k]
    for k in range(8):
        work.simplex[4 * POINT + 4 + k] = work.ids[k]


@kernel
def _take_simplex(work):
    """Take points, weights and vertices back."""
    for k in range(4 * POINT):
        work.points[k] = work.simplex[k]
    for k in range(4):
        work.weights[k] = work.simplex[4 * POINT + k]
    _take_vertices(work)


@kernel(inline=True)
def _take_vertices(work):
    for k in range(8):
        work.ids[k] = int(work.simplex[4 * POINT + 4 + k])


@kernel(inline=True)
def _weigh_enclosed(work):
    """Weigh a tetrahedron for the origin within, or for its point nearest the origin where rounding spoils that."""
    miss, extent = weigh_enclosed(work.points, work.weights)
    if not miss <= _NEAR_MISS * extent:
        nearest_of_all(work.points, 4, work.weights, 15)


@kernel(inline=True)
def _common_point(upper, n, iterations):
    """Cores that meet in the weighted sum of n points, with a bound of their signed distance and no direction."""
    nhat = Vec3(0.0, 0.0, 1.0)
    return CoreDistance(-upper, -math.inf, upper, -math.inf, math.inf, nhat, n, n, iterations)


@kernel(inline=True)
def _is_final(result, size, error, radius):
    """Whether the depth keeps its promise, and the foot misses the surface by no more than the points may."""
    width = (result.depth - result.clearance + 2.0 * error) * (1.0 + 2.0**-40)
    if not (result.clearance > error and width <= PROMISE_DEPTH * (result.depth + radius)):
        return False
    return result.depth - result.clearance <= _NEAR_MISS * size


@kernel(inline=True)
def _refined_result(result, refined, error):
    """EPA's result with the last digits of `refine`, on the surface left by `refine`.

    A facet as thin as a rounding has no direction of its own; EPA's plane is then the better plane.
    """
    if refined.sound and refined.upper <= result.depth + 2.0 * error:
        return EpaResult(
            result.status, refined.depth, result.clearance, refined.nhat, refined.facet, result.n_vertices,
            refined.n_facets
        )
    return EpaResult(
        result.status, result.depth, result.clearance, result.nhat, result.facet, result.n_vertices, refined.n_facets
    )


@kernel(inline=True)
def _weigh_foot(work, polytope, result, has_points, with_ids, curved, tolerance, size, error):
    """Points 0 … 2 become the facet holding the origin's foot on the plane of the depth, weighted for the foot; by how
    much they miss the foot where that is more than may be, else 0 [m].

    with_ids : name the facet's vertices, too; else the simplex enclosing the origin stays named.
    """
    foot = scale(result.depth, result.nhat)
    slack = tolerance + 2.0 * error
    facet = number(result.facet)
    inside = load_facet(polytope, facet, work.points, work.ids, work.weights, with_ids, foot)
    # What is well inside one facet is in no other.
    if not (inside > _WELL_INSIDE and abs(height_over(polytope, facet, foot)) <= slack):
        facet = facet_of(polytope, result.n_facets, facet, foot, slack)
        load_facet(polytope, facet, work.points, work.ids, work.weights, with_ids, foot)
    # The surface of curved cores keeps a width. Where many facets are as near, slivers mostly, none need hold the
    # foot. Some facet passes it within the width of the bracket; a thousandth of that is as good as the width allows.
    tolerated = _NEAR_MISS * size
    if curved:
        width = result.depth - result.clearance
        tolerated = max(slack, _MISS_OF_WIDTH * width) if result.clearance > error else slack
    if not has_points or norm1(sub(weighted_sum(work.points, work.weights, 3, 0), foot)) <= tolerated:
        return 0.0
    miss = weigh_nearest(
        polytope, result.n_facets, facet, work.points, work.ids, work.weights, with_ids, foot, tolerated
    )
    return miss if miss > tolerated else 0.0


@kernel
def request_plane(ids, request):
    """An entry of `depth_requests.py`: the plane of three points, perhaps all of a flat A ⊖ B."""
    request[0] = 0
    request[1] = 1
    for k in range(6):
        request[2 + k] = ids[k]
