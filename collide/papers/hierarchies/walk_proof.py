"""Proofs of the walk's answers, against the bodies and poses as given.

The walk works with rounded numbers: the relative pose, the vertices of Q, the small linear programs. No proof
relies on them. A plane is proven by the extreme vertices of both bodies along it (`minkowski_difference.settle_point`).
A common point is proven by a ball: R holds the ball of radius ρ about its centre c, and a triangle of its surface with
a point f of the triangle, hence the ball of radius (1 − s) ρ about (1 − s) c + s f; P holds x; x lies in the ball.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import kernel, view_f64, view_i32, view_i64
from collide.narrowphase.gjk.minkowski_difference import difference_point, has_trees, settle_point
from collide.numerics.vec3 import Vec3, add, column_at, cross, divide, dot, rotate, scale, sub, vec3_at
from collide.papers.hierarchies.packed_hierarchy import row_at

# Integers that describe R's ball and facets: addresses of centre and radius (4 doubles), of where each facet's
# triangles start, and of the triangles (three vertices of R each).
_CENTRE_AT, _STARTS_AT, _FACETS, _TRIANGLES_AT, _TRIANGLES = range(5)
_BALL = 5

#: A facet of more triangles than this is not searched: the walk's answer is then not proven here.
_MAX_TRIANGLES = 256
#: The most facets stepped over in search of the facet pierced by a ray.
_MAX_STEPS = 64


class Ball(NamedTuple):
    """A ball that R holds, and R's facets.

    numbers : centre in R's frame, radius [m].   starts, triangles : as `walk_bodies.PolarSide` has them.
    """

    numbers: Any
    starts: Any
    triangles: Any


class Proof(NamedTuple):
    """Input and output of proofs: the `PosedPair` of P and R, R's `Ball`, a difference point, the ids of its vertices.

    ids : also three vertices of R, the triangle of a proof of a common point.
    """

    pair: Any
    ball: Any
    points: Any
    ids: Any


class TriangleWeights(NamedTuple):
    """Vertices of a triangle, and weights ≥ 0 of sum 1 of a point in the triangle."""

    a: int
    b: int
    c: int
    weights: Vec3


@kernel
def ball_at(address):
    """The `Ball` that a `PolarSide` describes."""
    ball = view_i64(address, _BALL)
    return Ball(
        view_f64(ball[_CENTRE_AT], 4), view_i64(ball[_STARTS_AT], ball[_FACETS] + 1),
        view_i32(ball[_TRIANGLES_AT], 3 * ball[_TRIANGLES]),
    )


@kernel
def planes_apart(proof, d, error):
    """Whether the plane across d, from P towards R, has all of P on one side and all of R on the other, by more than
    the error [m]. d in the world, of any length.
    """
    span = math.sqrt(dot(d, d))
    if not span > 0.0:
        return False
    n = divide(d, span)
    difference_point(proof.pair, proof.points, proof.ids, 0, n)
    if has_trees(proof.pair):
        if dot(vec3_at(proof.points, 0), n) >= 0.0:
            return False  # an existing point, farthest or not
        settle_point(proof.pair, proof.points, proof.ids, 0, n)
    return -dot(vec3_at(proof.points, 0), n) > 1.000001 * error


@kernel
def _least_stretch(R, q):
    """A lower bound of the factor by which the matrix at q changes a vector's length; 0 without a bound."""
    off = 0.0
    for i in range(3):
        row = 0.0
        for j in range(3):
            product = R[q + i] * R[q + j] + R[q + 3 + i] * R[q + 3 + j] + R[q + 6 + i] * R[q + 6 + j]
            row += abs(product - (1.0 if i == j else 0.0))
        off = max(off, row)
    return math.sqrt(1.0 - off) * (1.0 - 1e-12) if off < 0.5 else 0.0


@kernel
def _distance_in_world(pair, x, r):
    """From a point r of R to a point x of P, each in its body's frame [m]."""
    d = sub(sub(rotate(pair.poses, pair.A.pose_at, x), rotate(pair.poses, pair.B.pose_at, r)), pair.t)
    return math.sqrt(dot(d, d))


@kernel
def in_ball(proof, x, error):
    """Whether the point x of P, in P's frame, lies in the ball that R holds about its centre."""
    pair, ball = proof.pair, proof.ball.numbers
    distance = _distance_in_world(pair, x, vec3_at(ball, 0))
    return distance + error < (1.0 - 1e-12) * ball[3] * _least_stretch(pair.poses, pair.B.pose_at)


@kernel
def _best_triangle(proof, facet, f):
    """(fit, weights): the triangle of a facet that holds f best, a point in R's frame from the centre.

    fit : the least weight, negative where the triangle does not hold f; −1e300 where no triangle has an area.
    """
    ball, coords, m = proof.ball, proof.pair.B.coords, proof.pair.B.padded
    centre = vec3_at(ball.numbers, 0)
    best = -1e300
    best_weights = TriangleWeights(np.int64(0), np.int64(0), np.int64(0), Vec3(0.0, 0.0, 0.0))
    start = ball.starts[facet]
    for k in range(start, min(ball.starts[facet + 1], start + _MAX_TRIANGLES)):
        ia, ib, ic = (
            np.int64(ball.triangles[3 * k]),
            np.int64(ball.triangles[3 * k + 1]),
            np.int64(ball.triangles[3 * k + 2]),
        )
        a = sub(column_at(coords, m, ia), centre)
        b = sub(column_at(coords, m, ib), centre)
        c = sub(column_at(coords, m, ic), centre)
        wa = dot(f, cross(b, c))
        wb = dot(f, cross(c, a))
        wc = dot(f, cross(a, b))
        total = abs(wa) + abs(wb) + abs(wc)
        if not total > 0.0:
            continue
        least = min(wa, wb, wc) / total
        if least > best:
            best = least
            w = Vec3(max(wa, 0.0), max(wb, 0.0), max(wc, 0.0))
            total = w.x + w.y + w.z
            if total > 0.0:
                best_weights = TriangleWeights(ia, ib, ic, divide(w, total))
                if least >= 0.0:
                    break
    return best, best_weights


@kernel
def _triangle_near(Q, proof, facet, f):
    """As `_best_triangle`, from facet to neighbouring facet while the result improves.

    Rounding may have split a flat side into facets with indistinguishable planes: the ray may leave by a neighbour.
    """
    best, best_weights = _best_triangle(proof, facet, f)
    for _ in range(_MAX_STEPS):
        if best >= 0.0:
            break
        at = facet
        row = row_at(Q, at, 0)
        for k in range(Q.neighbour_start[row], Q.neighbour_start[row + 1]):
            fit, weights = _best_triangle(proof, np.int64(Q.neighbours[k]), f)
            if fit > best:
                best = fit
                best_weights = weights
                facet = np.int64(Q.neighbours[k])
        if facet == at:
            break
    return best_weights


@kernel
def shares_point(Q, proof, facet, x, y, error):
    """Whether the point x of P, in P's frame, lies in R, by more than the error.

    Q : `Levels` of R's polar, whose edges join neighbouring facets of R.
    facet : vertex of Q: the facet of R that the ray from the centre through the point leaves by.
    y : the point in R's frame, from the centre, as the walk had it.
    error : how far the point may be from P, and the rounding of what is computed, altogether [m].
    """
    pair, ball = proof.pair, proof.ball.numbers
    coords, m = pair.B.coords, pair.B.padded
    s = dot(y, vec3_at(Q.points, 3 * facet))
    triangle = _triangle_near(Q, proof, facet, y)
    w = triangle.weights
    proof.ids[0] = triangle.a
    proof.ids[1] = triangle.b
    proof.ids[2] = triangle.c
    s = min(max(s, 0.0), 1.0)
    if not w.x + w.y + w.z > 0.5:
        s = 0.0
    # The point of R's segment from the centre to the facet, in R's frame.
    f = add(
        add(scale(w.x, column_at(coords, m, triangle.a)), scale(w.y, column_at(coords, m, triangle.b))),
        scale(w.z, column_at(coords, m, triangle.c)),
    )
    r = add(scale(1.0 - s, vec3_at(ball, 0)), scale(s, f))
    radius = (1.0 - s) * (1.0 - 1e-12) * ball[3] * _least_stretch(pair.poses, pair.B.pose_at)
    return _distance_in_world(pair, x, r) + error < radius
