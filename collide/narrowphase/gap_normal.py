"""The normal of a gap that is small beside curved cores: turned until no support plane shows them farther apart.

Where a gap g is much smaller than the radius R of curvature, points that are off by δ along the surfaces change the gap
by δ²/2R, which GJK does not see, and turn the line between them by δ/g. Moved apart along a normal by D, the cores have
a gap of g + D, and its normal is off by D/(R + D) of what the first one was off: moving B out and asking again leads to
the normal of the gap. Each one is judged by the gap that the support planes across it prove.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.bounds import GJK_ROUNDS
from collide.narrowphase.core_distance import CoreDistance
from collide.narrowphase.gjk.gjk import NEAREST, gjk
from collide.narrowphase.gjk.minkowski_difference import (
    AXIS,
    POINT,
    POINT_OF_A,
    POINT_OF_B,
    copy_coordinates,
    difference_point,
    has_trees,
    height,
    settle_point,
    weighted_sum,
)
from collide.narrowphase.posed_pair import PosedPair
from collide.numerics.vec3 import Vec3, add, neg, norm, put_vec3, scale, sub, vec3_at

#: In units of the pair's size: by so much a gap may be larger than the support planes prove, for its normal to stay.
_LEVEL = 2.0**-42
#: In units of the pair's size, how far B is moved out; and how often at most.
_OUT, _TURNS = 2.0**-2, 6


class _Found(NamedTuple):
    """What is known of a gap: its nearest pair of points and a normal.

    distance : of the nearest points met [m].   proven : how far the cores are apart at least [m].
    along : how far they are along nhat [m].
    n_points : of the feature in the workspace, whose points miss the normal least.   iterations : of GJK.
    is_better : the last run found a better normal.
    """

    distance: float
    proven: float
    along: float
    nhat: Vec3
    n_points: int
    iterations: int
    is_better: bool


@kernel(cold=True)
def with_gap_normal(pair, work, core, size, error):
    """The `CoreDistance` of cores that are apart, with a normal across which planes prove that gap, as far as doubles
    tell.

    Bounds stay proven: the lower one is that of a support plane, the upper one that of two points. The workspace holds
    the points that miss the normal least. EPA's workspace is used.
    """
    points, ids = view_f64(work.epa_at, 5 * POINT), view_i64(work.epa_integers_at, 10)
    proven = _apart_along(pair, points, ids, core.nhat)
    if -core.depth - proven <= _LEVEL * size:
        return core
    found = _Found(-core.depth, proven, proven, core.nhat, core.n_points, core.iterations, True)
    for _ in range(_TURNS):
        found = _ask_again(pair, _OUT * size, work, found, 0.0, error)
        if not found.is_better or found.distance - found.proven <= _LEVEL * size:
            break
    # From the normal found, GJK keeps to points across it, and to the normal that is theirs where it is as good.
    found = _ask_again(pair, 0.0, work, found, _LEVEL * size, error)
    n_vertices = core.n_vertices if found.n_points == core.n_points else found.n_points
    return CoreDistance(
        -found.distance, max(core.lower, found.proven), min(core.upper, found.distance), core.shallowest, core.deepest,
        found.nhat, found.n_points, n_vertices, found.iterations,
    )  # fmt: skip


@kernel
def _ask_again(pair, out, work, found, slack, error):
    """``found``, and what GJK finds of the pair with B moved out along the normal by ``out``.

    slack : by how much another normal may be worse, of points that miss it less [m].
    """
    points, weights = view_f64(work.epa_at, 5 * POINT), view_f64(work.epa_at + 40 * POINT, 10)
    ids = view_i64(work.epa_integers_at, 10)
    moved = PosedPair(pair.A, pair.B, pair.numbers, pair.poses, add(pair.t, scale(out, found.nhat)))
    put_vec3(weights, AXIS, found.nhat)
    run = gjk(moved, points, ids, weights, 0, False, 0.0, math.inf, error, GJK_ROUNDS)
    iterations = found.iterations + run.iterations
    if run.status != NEAREST:
        return _Found(found.distance, found.proven, found.along, found.nhat, found.n_points, iterations, False)
    along, nhat, n_points = found.along, found.nhat, found.n_points
    turned = neg(vec3_at(weights, AXIS))
    of_turned = _apart_along(pair, points, ids, turned)
    is_better = of_turned > along - slack
    if is_better:
        along, nhat = of_turned, turned
    between = _between(pair, points, weights, run.n_points)
    foot = scale(-along, nhat)
    if norm(sub(between, foot)) < norm(sub(_between(pair, work.points, work.weights, n_points), foot)):
        n_points = run.n_points
        for k in range(n_points):
            copy_coordinates(points, k, work.points, k)
            work.weights[k] = weights[k]
            work.ids[2 * k], work.ids[2 * k + 1] = ids[2 * k], ids[2 * k + 1]
    distance, proven = min(found.distance, norm(between)), max(found.proven, along)
    return _Found(distance, proven, along, nhat, n_points, iterations, is_better)


@kernel(inline=True)
def _between(pair, points, weights, n):
    """The point of A ⊖ B that n weighted points make."""
    a, b = weighted_sum(points, weights, n, POINT_OF_A), weighted_sum(points, weights, n, POINT_OF_B)
    return sub(sub(a, b), pair.t)


@kernel(inline=True)
def _apart_along(pair, points, ids, nhat):
    """How far the cores are apart along a direction from A to B [m], a lower bound of their gap. Point 4 is lost."""
    difference_point(pair, points, ids, 4, nhat)
    if has_trees(pair):
        settle_point(pair, points, ids, 4, nhat)
    return -height(points, 4, nhat) / norm(nhat)
