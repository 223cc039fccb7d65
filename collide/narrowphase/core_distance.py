"""Two convex cores without the balls that sweep them: a gap or a depth, the feature it comes from, and a bracket.

Points and segments by closed forms, others by GJK, and by EPA where they overlap. What EPA leaves of a depth gets its last
digits from `epa/refine.py`.
"""

from __future__ import annotations

import math

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.bounds import GJK_ROUNDS, PROMISE_DEPTH, ROOMY, TOLERANCE_CURVED
from collide.narrowphase.capsule_capsule import across_segments, nearest_of_segments
from collide.narrowphase.epa.expand_polytope import FLAT, epa, facet_of, height_over
from collide.narrowphase.epa.origin_foot import weigh_nearest, weigh_origin
from collide.narrowphase.epa.polytope_surface import FACET, number, workspace
from collide.narrowphase.epa.refine_depth import refine
from collide.narrowphase.exact.depth_requests import ENTRY
from collide.narrowphase.gap.precise_pair import LOW_PARTS_OF_PAIR
from collide.narrowphase.gap.tied_vertices import MAX_TIES
from collide.narrowphase.gjk.gjk import APART, ENCLOSED, NEAREST, gjk
from collide.narrowphase.gjk.minkowski_difference import POINT, combined
from collide.narrowphase.gjk.simplex import face_weights, nearest_of_all, weigh_enclosed
from collide.numerics.double_double import STRIDE
from collide.numerics.exact_dot_sign import PRODUCT_TERMS

# Workspace ahead of what EPA needs: five difference points and their ids, weights; what the last digits of depths and
# heights need: four points, a direction, low parts of two poses, ties or the terms of a sum.
WEIGHTS = 5 * POINT
FINE_AT = 64
_NEAREST, TIES = 10, 16
TIED = TIES + max(MAX_TIES + 1, PRODUCT_TERMS)
OWN_DOUBLES, OWN_INTEGERS = FINE_AT + 5 * STRIDE + LOW_PARTS_OF_PAIR, TIED + ENTRY
#: A weighted point is the foot on a plane if it misses that by no more, in units of the pair's size.
_NEAR_MISS = 2.0**-48
#: Of a bracket's width, what weighted points of curved cores may miss the foot by.
_OF_WIDTH = 2.0**-10
#: Least weight of a foot well inside its facet.
_WELL_INSIDE = 2.0**-10
#: So many vertices of two cores are worth a better seed for EPA than GJK's.
_MANY = 48
#: EPA begins so often at most, of many vertices.
_STARTS = 4


@kernel
def _segment_differences(pair, points, ids):
    """The four differences of two cores of at most two points, each core's ends in order."""
    A, B, poses, t = pair.A, pair.B, pair.poses, pair.t
    p, q = A.pose_at, B.pose_at
    for k in range(4):
        i = min(k & 1, A.n - 1)
        j = min(k >> 1, B.n - 1)
        for axis in range(3):
            r = p + 3 * axis
            a = poses[r] * A.coords[i] + poses[r + 1] * A.coords[A.padded + i] + poses[r + 2] * A.coords[2 * A.padded + i]
            r = q + 3 * axis
            b = poses[r] * B.coords[j] + poses[r + 1] * B.coords[B.padded + j] + poses[r + 2] * B.coords[2 * B.padded + j]
            shift = t.x if axis == 0 else (t.y if axis == 1 else t.z)
            points[POINT * k + axis] = (a - b) - shift
            points[POINT * k + 3 + axis] = a
            points[POINT * k + 6 + axis] = b
        ids[2 * k] = i
        ids[2 * k + 1] = j


@kernel
def segments(pair, points, ids, weights, error):
    """Sphere and capsule cores: (depth, bound, core distance, nx, ny, nz), the first two and the last as `convex_cores` has them."""
    _segment_differences(pair, points, ids)
    core, bound = nearest_of_segments(points, weights)
    if core > error:
        return -core, bound, core, -weights[7], -weights[8], -weights[9]
    nx, ny, nz = across_segments(points)
    depth = -math.inf
    for k in range(4):
        depth = max(depth, nx * points[POINT * k] + ny * points[POINT * k + 1] + nz * points[POINT * k + 2])
    return depth, -depth, core, nx, ny, nz


@kernel
def _load_facet(surface, facet, points, ids, weights, with_ids, x, y, z):
    """The corners of EPA's facet become points 0..2, weighted for the point (x, y, z) of it; returns the least weight."""
    source, _, _, _, source_ids, facets, _, _, _ = surface
    for k in range(3):
        v = facets[FACET * facet + k]
        for j in range(POINT):
            points[POINT * k + j] = source[POINT * v + j]
        if with_ids:
            ids[2 * k] = source_ids[2 * v]
            ids[2 * k + 1] = source_ids[2 * v + 1]
    w0, w1, w2 = face_weights(points, 0, POINT, 2 * POINT, x, y, z)
    inside = min(w0, w1, w2)
    w0 = max(w0, 0.0)
    w1 = max(w1, 0.0)
    w2 = max(w2, 0.0)
    total = w0 + w1 + w2
    if total > 0.0:
        weights[0] = w0 / total
        weights[1] = w1 / total
        weights[2] = w2 / total
    else:
        weights[0] = 1.0
        weights[1] = 0.0
        weights[2] = 0.0
    return inside


@kernel(inline=True)
def _miss(points, weights, x, y, z):
    """How far the weighted point of three lies from (x, y, z)."""
    return abs(combined(points, weights, 3, 0) - x) + abs(combined(points, weights, 3, 1) - y) + abs(combined(points, weights, 3, 2) - z)


@kernel(inline=True)
def convex_cores(pair, terms_at, doubles_at, integers_at, boolean, depths, radius, limit, size, slop, error, curved, exactly, given):
    """Two convex cores by GJK, and by EPA where they overlap; arguments as `gjk` has them.

    Returns
    -------
    depth : of the cores; minus their distance where they are apart.
    bound : lower bound of the core distance before ``error``, negative for overlap.
    above : upper bound of the signed core distance before ``error``.
    shallowest, deepest : proven bracket of the depth by `refine`, or (−∞, ∞).
    nx, ny, nz : from A towards B.
    n, vertices : points of the deciding feature in the workspace, and how many of its ids to show.
    rounds : of GJK, plus 65536 times those of EPA.
    """
    points = view_f64(doubles_at, 5 * POINT)
    weights = view_f64(doubles_at + 8 * WEIGHTS, 10)
    ids = view_i64(integers_at, 10)
    status, n, bound, clearance, rounds = gjk(pair, points, ids, weights, given, boolean, radius, limit, error, GJK_ROUNDS)
    core = math.sqrt(weights[4] * weights[4] + weights[5] * weights[5] + weights[6] * weights[6])
    if status == NEAREST or status == APART:
        return -core, bound, core, -math.inf, math.inf, -weights[7], -weights[8], -weights[9], n, n, rounds
    above = -clearance if status == ENCLOSED else core
    # What the exact stage can settle needs no EPA to find out whether it is open.
    if not depths and (above + error < radius or exactly):
        if status == ENCLOSED and not boolean:
            miss, extent = weigh_enclosed(points, weights)
            if not miss <= _NEAR_MISS * extent:
                nearest_of_all(points, 4, weights, 15)
        return -above, -math.inf, above, -math.inf, math.inf, 0.0, 0.0, 1.0, n, n, rounds
    tolerance = TOLERANCE_CURVED * size if curved else 0.25 * error
    roomy = status == ENCLOSED and clearance > ROOMY * size
    many = depths and not curved and pair.A.n + pair.B.n > _MANY
    epa_at = doubles_at + 8 * OWN_DOUBLES
    ids_at = integers_at + 8 * OWN_INTEGERS
    shallowest = -math.inf
    deepest = math.inf
    for again in range(_STARTS):  # where rounding has spoilt a surface, one that begins elsewhere is often sound
        outcome, depth, surface, nx, ny, nz, facet, vertices, count = epa(
            pair, points, ids, status == ENCLOSED and again == 0, roomy, many, again, epa_at, ids_at, not depths, size, error,
            tolerance,
        )
        rounds += 65536 * max(vertices - 4, 0)
        if outcome == FLAT:
            shown = n
            if vertices == 3 and not curved:  # what spans it: for the exact stage, which may prove it flat
                _, _, _, _, spanning, _, _, _, _ = workspace(epa_at, ids_at)
                name_plane(spanning, view_i64(integers_at + 8 * TIED, ENTRY))
            return depth, -depth, above, shallowest, deepest, nx, ny, nz, n, shown, rounds
        if not depths and not boolean and surface > error and weigh_origin(workspace(epa_at, ids_at), count, points, ids, weights):
            # A common point is wanted, and EPA stopped before it knew any way out.
            return surface, -math.inf, -surface, shallowest, deepest, 0.0, 0.0, 1.0, 4, 4, rounds
        bound = -depth  # the depth of a last facet is no bound: what it is level with may lie beyond it
        width = (depth - surface + 2.0 * error) * (1.0 + 2.0**-40)
        # The foot misses the surface by as much as doubles leave between that and the plane.
        settled = surface > error and width <= PROMISE_DEPTH * (depth + radius) and depth - surface <= _NEAR_MISS * size
        if not exactly or not depths or settled:
            break
        sound, low, level, high, ux, uy, uz, nearest, count = refine(
            pair, terms_at, epa_at, ids_at, doubles_at + 8 * FINE_AT, integers_at + 8 * _NEAREST, integers_at + 8 * TIES,
            view_i64(integers_at + 8 * TIED, ENTRY), count, vertices, size, slop, error,
        )  # fmt: skip
        if sound:
            shallowest = low
            deepest = high
            # A facet as thin as a rounding has no direction of its own; EPA's plane is then the better one.
            if high <= depth + 2.0 * error:
                depth, nx, ny, nz, facet = level, ux, uy, uz, nearest
        if sound or not many:  # of few vertices all planes are looked at instead (`exact_depth.py`)
            break
    polytope = workspace(epa_at, ids_at)
    facet = number(facet)
    x = depth * nx
    y = depth * ny
    z = depth * nz
    slack = tolerance + 2.0 * error
    named = status != ENCLOSED
    inside = _load_facet(polytope, facet, points, ids, weights, named, x, y, z)
    # What is well inside one facet is in no other.
    if not (inside > _WELL_INSIDE and abs(height_over(polytope, facet, x, y, z)) <= slack):
        facet = facet_of(polytope, count, facet, x, y, z, slack)
        _load_facet(polytope, facet, points, ids, weights, named, x, y, z)
    # The surface of curved cores keeps a width. Where many facets are as near, slivers mostly, none need hold the foot.
    # Some facet passes it within the width of the bracket; a thousandth of that is as good as the width allows.
    enough = _NEAR_MISS * size
    if curved:
        enough = max(slack, _OF_WIDTH * (depth - surface)) if surface > error else slack
    if depths and _miss(points, weights, x, y, z) > enough:
        weigh_nearest(polytope, count, facet, points, ids, weights, named, x, y, z, enough)
    if surface > error:
        above = min(above, -surface)
    return depth, bound, above, shallowest, deepest, nx, ny, nz, 3, 4 if status == ENCLOSED else 3, rounds


@kernel
def name_plane(ids, tied):
    """An entry of `depth_requests.py`: the plane of three points, which may be all there is."""
    tied[0] = 0
    tied[1] = 1
    for k in range(6):
        tied[2 + k] = ids[k]
