"""Rows of a patch: its points, thinned out and reduced, in the world."""

from __future__ import annotations

import math
from functools import partial
from typing import Any, NamedTuple

from collide.contact.contact_pairs import facing_a, facing_b
from collide.contact.contact_points import LEAST_COSINE, PatchPoints, copy_of_points
from collide.contact.contact_rows import CONTACT_DTYPE, GAP, OVERLAP
from collide.contact.manifold_points import GAP as POINT_GAP
from collide.contact.manifold_points import HEIGHT, POINT, V
from collide.contact.reduce_patch import HullSpace, reduce_patch
from collide.kernels import kernel, view_f64, view_i32
from collide.narrowphase.facets.facets_within import FACET_A, FACET_B, INTS_OF_PAIR
from collide.numerics.vec3 import Vec3, add, put_vec3, scale, sub, vec3_at
from collide.results import field_at

#: Points nearer than so many errors of a coordinate, or this part of the patch's size, are one point.
_ERRORS, _SHARE = 64.0, 2.0**-30

CONTACT = CONTACT_DTYPE.itemsize
_at = partial(field_at, CONTACT_DTYPE)
_DISTANCE, _LOWER, _UPPER, _APART = (_at(name, 8) for name in ("distance", "lower", "upper", "apart"))
_NORMAL, _POINT_A, _POINT_B = (_at(name, 8) for name in ("normal", "point_a", "point_b"))
_A, _B, _FACET_A, _FACET_B = (_at(name, 4) for name in ("a", "b", "facet_a", "facet_b"))
_PART_A, _PART_B = (_at(name, 4) for name in ("part_a", "part_b"))
_FEATURE_A, _FEATURE_B, _PATCH, _KIND = (_at(name, 4) for name in ("feature_a", "feature_b", "patch", "kind"))


class PatchSpace(NamedTuple):
    """Where rows go, and what they are made of.

    target : points as they are chosen.   hull : numbers of points.   origin : of A in the world.
    out : address of rows, ``capacity`` of them.   max_contacts : of a patch.   margin : [m].
    """

    target: PatchPoints
    hull: HullSpace
    origin: Vec3
    out: int
    capacity: int
    max_contacts: int
    margin: float


@kernel
def _keep_near(points, n, limit):
    """Keep the points whose gap is at most so much, but for its error, and the nearest; how many."""
    p = points.manifold.points
    least = math.inf
    for i in range(n):
        least = min(least, p[POINT * i + POINT_GAP])
    n_kept = 0
    for i in range(n):
        gap = p[POINT * i + POINT_GAP]
        if gap <= limit + points.errors[i] or gap == least:
            if n_kept != i:
                copy_of_points(points, i, points, n_kept)
            n_kept += 1
    return n_kept


@kernel
def _extent(points, n):
    """The larger side of the box around n points."""
    p = points.manifold.points
    low_u = low_v = math.inf
    high_u = high_v = -math.inf
    for i in range(n):
        u, v = p[POINT * i], p[POINT * i + V]
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    return max(high_u - low_u, high_v - low_v)


class RowsOf(NamedTuple):
    """What all rows of a patch share.

    axes : `ContactAxes`.   origin : of A in the world.   radius_a, radius_b : of the balls swept over both [m].
    error : beyond those of the gaps [m].   meets : whether something of the patch meets.   apart : as in the rows [m].
    number : of the patch.
    """

    axes: Any
    origin: Vec3
    radius_a: float
    radius_b: float
    error: float
    meets: bool
    apart: float
    number: int


@kernel
def put_patch(frame, patch, apart, number, space, n_rows):
    """Append the rows of a patch; returns the new number of rows, −1 where they do not fit.

    apart : as in the rows [m].   number : of the patch.
    """
    target = space.target
    radius_a, radius_b = frame.A.radius, frame.B.radius
    n = choose_points(frame.points, patch.n, frame.error, space.margin + radius_a + radius_b, space)
    if n_rows + n > space.capacity:
        return -1
    error = 8.0 * frame.error if radius_a + radius_b > 0.0 else 0.0
    rows = RowsOf(patch.axes, space.origin, radius_a, radius_b, error, patch.meets, apart, number)
    tolerance = _ERRORS * frame.error
    for i in range(n):
        k = space.hull.order[i]
        _name_faces(frame, patch, target, k, tolerance)
        pair = INTS_OF_PAIR * target.pairs[k]
        facet_a, facet_b = frame.pairs.facets[pair + FACET_A], frame.pairs.facets[pair + FACET_B]
        put_row(space.out + CONTACT * (n_rows + i), target, k, facet_a, facet_b, rows)
    return n_rows + n


@kernel(inline=True)
def _faces_both(frame, pair, nhat):
    """Whether both facets of a pair face along the normal, and none is a wall."""
    pairs = frame.pairs
    return min(facing_a(pairs, pair, nhat, frame.A), facing_b(pairs, pair, nhat, frame.B)) > LEAST_COSINE


@kernel
def _name_faces(frame, patch, target, k, tolerance):
    """Name a contact at the rim of a steep facet by a pair of facets facing along the normal at the same point.

    tolerance : nearer points are the same [m].
    """
    points, nhat = frame.points, patch.axes.nhat
    if _faces_both(frame, target.pairs[k], nhat):
        return
    p, q = points.manifold.points, target.manifold.points
    for i in range(patch.n):
        du, dv = abs(p[POINT * i] - q[POINT * k]), abs(p[POINT * i + V] - q[POINT * k + V])
        rise = abs(p[POINT * i + POINT_GAP] - q[POINT * k + POINT_GAP])
        is_same = max(du, dv) <= tolerance and rise <= points.errors[i] + target.errors[k]
        if is_same and _faces_both(frame, points.pairs[i], nhat):
            copy_of_points(points, i, target, k)
            return


@kernel
def choose_points(points, n, error, limit, space):
    """Put the contacts of a patch of n points into ``space.target``, in the order of ``space.hull.order``; how many.

    error : of a coordinate [m].   limit : gaps are no larger, but for their errors [m].
    """
    n = _keep_near(points, n, limit)
    tolerance = max(_ERRORS * error, _SHARE * _extent(points, n))
    return reduce_patch(points, n, tolerance, space.max_contacts, space.target, space.hull)


@kernel
def put_row(contact_at, points, k, facet_a, facet_b, rows):
    """Write one contact: point k."""
    doubles, words = view_f64(contact_at, CONTACT // 8), view_i32(contact_at, CONTACT // 4)
    axes = rows.axes
    p, at = points.manifold.points, POINT * k
    distance = p[at + POINT_GAP] - (rows.radius_a + rows.radius_b)
    error = points.errors[k] + rows.error
    if rows.meets and 0.0 < distance <= error:  # what touches is no gap, though it may come out as one
        distance = 0.0
    height = p[at + HEIGHT] + 0.5 * (rows.radius_a - rows.radius_b)
    middle = add(add(scale(p[at], axes.e), scale(p[at + V], axes.f)), scale(height, axes.nhat))
    middle = add(middle, rows.origin)
    half = scale(0.5 * distance, axes.nhat)
    doubles[_DISTANCE] = distance + 0.0
    doubles[_LOWER] = distance - error
    doubles[_UPPER] = distance + error
    doubles[_APART] = rows.apart
    put_vec3(doubles, _NORMAL, add(axes.nhat, Vec3(0.0, 0.0, 0.0)))
    put_vec3(doubles, _POINT_A, sub(middle, half))
    put_vec3(doubles, _POINT_B, add(middle, half))
    words[_B] = 1
    words[_FACET_A] = facet_a
    words[_FACET_B] = facet_b
    words[_FEATURE_A] = points.manifold.features[2 * k]
    words[_FEATURE_B] = points.manifold.features[2 * k + 1]
    words[_KIND] = OVERLAP if rows.meets else GAP
    words[_PATCH] = rows.number


@kernel(inline=True)
def facet_of_row(contact_at):
    """The facet of A that a row names."""
    return view_i32(contact_at, CONTACT // 4)[_FACET_A]


@kernel(inline=True)
def patch_of_row(contact_at):
    """The patch that a row is of."""
    return view_i32(contact_at, CONTACT // 4)[_PATCH]


@kernel(inline=True)
def is_cleared_by(contact_at, factor):
    """Whether a row's ``apart``, where its facets meet, is at most so many times its depth."""
    doubles = view_f64(contact_at, CONTACT // 8)
    meets = view_i32(contact_at, CONTACT // 4)[_KIND] == OVERLAP
    return not meets or doubles[_APART] <= factor * max(-doubles[_LOWER], 0.0)


@kernel
def clear_words(out_at, n_rows):
    """Zero what a pair's rows leave to callers: the first body's id, and parts of unions."""
    for k in range(n_rows):
        words = view_i32(out_at + CONTACT * k, CONTACT // 4)
        words[_A] = words[_PART_A] = words[_PART_B] = 0


@kernel
def widen_row(contact_at, distance, lower, upper):
    """Give a row the distance of its patch's nearest point where the brackets of both overlap, unless the nearest
    point's bracket holds the row's; the row's bracket becomes the union of both."""
    doubles = view_f64(contact_at, CONTACT // 8)
    if lower <= doubles[_LOWER] and doubles[_UPPER] <= upper:
        return
    if doubles[_LOWER] <= upper and lower <= doubles[_UPPER]:
        doubles[_DISTANCE] = distance + 0.0
        doubles[_LOWER] = min(doubles[_LOWER], lower)
        doubles[_UPPER] = max(doubles[_UPPER], upper)
        middle = scale(0.5, add(vec3_at(doubles, _POINT_A), vec3_at(doubles, _POINT_B)))
        half = scale(0.5 * distance, vec3_at(doubles, _NORMAL))
        put_vec3(doubles, _POINT_A, sub(middle, half))
        put_vec3(doubles, _POINT_B, add(middle, half))


@kernel
def flip_row(contact_at):
    """Exchange A and B in a row, in place."""
    doubles, words = view_f64(contact_at, CONTACT // 8), view_i32(contact_at, CONTACT // 4)
    point = vec3_at(doubles, _POINT_A)
    put_vec3(doubles, _POINT_A, vec3_at(doubles, _POINT_B))
    put_vec3(doubles, _POINT_B, point)
    put_vec3(doubles, _NORMAL, sub(Vec3(0.0, 0.0, 0.0), vec3_at(doubles, _NORMAL)))
    facet, feature = words[_FACET_A], words[_FEATURE_A]
    words[_FACET_A] = words[_FACET_B]
    words[_FACET_B] = facet
    words[_FEATURE_A] = words[_FEATURE_B]
    words[_FEATURE_B] = feature
