"""Contacts of two convex sets from their row of `distance`.

The normal is the row's. Where both bodies have a face, or an edge, across it (`support_face.py`), the corners of
their overlap are the contacts (`manifold_points.py`); the nearest points of the row are a contact where no corner is as
near. Half-spaces have no corners of their own: the support of the other body stands on the plane.

Every length here comes from the poses as given, seen from A's origin; `error` bounds the rounding of a coordinate, and
every gap measured is within a few of them (`_bound`).
"""

from __future__ import annotations

import math
from functools import partial

from collide.contact.clip_polygons import Clipped
from collide.contact.contact_rows import CONTACT_DTYPE, GAP, OVERLAP
from collide.contact.manifold_points import (
    GAP as POINT_GAP,
)
from collide.contact.manifold_points import (
    HEIGHT,
    NEAR,
    NEAR_END,
    POINT,
    ManifoldPoints,
    V,
    copy_point,
    deepest_point,
    drop_repeated,
    height_at,
    keep_near,
    least_gap,
    overlap_points,
)
from collide.contact.reduce_points import select_points
from collide.contact.support_face import SupportFace, axes_across, seen_along, support_face, swept_face
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import NUMBERS, POSE, POSE_SLOP, SLOP
from collide.narrowphase.pose_batches import set_pose
from collide.narrowphase.posed_pair import ordered_pair, radius_of, reach_of
from collide.narrowphase.rows import BEYOND, DISTANCE, HIT, LOWER, NORMAL, POINT_A, POINT_B, UPPER, view_row
from collide.numerics.vec3 import Vec3, add, norm1, put_vec3, scale, sub, vec3_at
from collide.results import field_at

#: Lengths up to so many errors of a coordinate, or up to this part of the manifold's size, are rounding.
_ERRORS, _SHARE = 64.0, 2.0**-30
_U = 2.0**-53

# Header: addresses of a `ShapeTable`'s integers and numbers, of the rows of a `HullFaceTable`, of two rows of poses and
# two shape numbers, of the workspace; most corners of a face. Then what a call of a batch has done, pairs and rows; the
# bits of the margin, and max_contacts.
(
    INTS_AT, NUMBERS_AT, FACES_AT, POSES_AT, SHAPE_OF_AT, DOUBLES_AT, INTEGERS_AT, LARGEST, PAIRS_DONE, ROWS_DONE,
    MARGIN, MAX_CONTACTS,
) = range(12)
HEADER = 12


_CONTACT = CONTACT_DTYPE.itemsize
_at = partial(field_at, CONTACT_DTYPE)
_DISTANCE, _LOWER, _UPPER, _APART = (_at(name, 8) for name in ("distance", "lower", "upper", "apart"))
_NORMAL, _POINT_A, _POINT_B = (_at(name, 8) for name in ("normal", "point_a", "point_b"))
_A, _B, _FACET_A, _FACET_B = (_at(name, 4) for name in ("a", "b", "facet_a", "facet_b"))
_FEATURE_A, _FEATURE_B, _PATCH, _KIND = (_at(name, 4) for name in ("feature_a", "feature_b", "patch", "kind"))


def workspace_doubles(largest: int) -> int:
    """How many doubles the kernel works in, for faces of so many corners."""
    return 2 * 3 * largest + 2 * 2 * max_corners(largest) + POINT * max_corners(largest)


def workspace_integers(largest: int) -> int:
    return 2 * 2 * largest + 2 * max_corners(largest) + 2 * max_corners(largest) + max_corners(largest)


def max_corners(largest: int) -> int:
    """Largest number of corners of an overlap, and one point more."""
    return 2 * largest + 8


@kernel(inline=True)
def max_corners_of(largest):
    """`max_corners` for kernels: Python calls none of them but entries."""
    return 2 * largest + 8


@entry("int64(int64, int64, int64, int64, float64, int64, int64)")
def manifold_of_row(header_at, XA_at, XB_at, row_at, margin, max_contacts, out_at):
    """`contacts_of_row` for C, where that row takes the long way."""
    X_WA, X_WB = view_f64(XA_at, 16), view_f64(XB_at, 16)
    return contacts_of_row(header_at, X_WA, X_WB, view_row(row_at), margin, max_contacts, out_at)


@kernel(inline=True)
def contacts_of_row(header_at, X_WA, X_WB, row, margin, max_contacts, out_at):
    """Write the contacts of a pair at two matrices, if its row of `distance` is within the margin; how many.

    header : its two poses become the matrices.   out : `CONTACT_DTYPE`, for as many rows as a manifold may have.
    """
    if row.flags[BEYOND] != 0 or not row.doubles[LOWER] <= margin:
        return 0
    poses = view_f64(view_i64(header_at, HEADER)[POSES_AT], 2 * POSE)
    set_pose(poses, 0, X_WA, False)
    set_pose(poses, POSE, X_WB, False)
    return put_manifold(header_at, 0, 1, row, margin, max_contacts, out_at)


@kernel
def put_manifold(header_at, a, b, row, margin, max_contacts, out_at):
    """Write the contacts of one pair, by the numbers of its poses; how many."""
    header = view_i64(header_at, HEADER)
    ordered = ordered_pair(header[INTS_AT], header[NUMBERS_AT], header[POSES_AT], header[SHAPE_OF_AT], a, b)
    pair, flip = ordered.pair, ordered.flip
    sign = -1.0 if flip else 1.0
    axes = axes_across(scale(sign, vec3_at(row.doubles, NORMAL)))
    error = _error(pair, row)
    largest = header[LARGEST]
    doubles, integers = header[DOUBLES_AT], header[INTEGERS_AT]
    n_max = max_corners_of(largest)
    of_b = support_face(
        pair, pair.B, header[FACES_AT], axes, -1.0, pair.t, largest, doubles + 24 * largest, integers + 16 * largest
    )
    of_b = swept_face(of_b, -1.0, radius_of(pair, pair.B), error)
    nearest = seen_along(axes, sub(_point(row, not flip), vec3_at(pair.poses, pair.A.pose_at + 9)))
    if pair.A.kind == HALFSPACE:
        of_a = _plane_face(of_b, nearest)
    else:
        of_a = support_face(
            pair, pair.A, header[FACES_AT], axes, 1.0, Vec3(0.0, 0.0, 0.0), largest, doubles, integers
        )
        of_a = swept_face(of_a, 1.0, radius_of(pair, pair.A), error)
    polygons, flags = doubles + 48 * largest, integers + 32 * largest
    first = Clipped(view_f64(polygons, 2 * n_max), view_i64(flags, n_max))
    second = Clipped(view_f64(polygons + 16 * n_max, 2 * n_max), view_i64(flags + 8 * n_max, n_max))
    manifold = ManifoldPoints(view_f64(polygons + 32 * n_max, POINT * n_max), view_i64(flags + 16 * n_max, 2 * n_max))
    order = view_i64(flags + 32 * n_max, n_max)
    bound = _bound(error, of_a, of_b)
    if pair.A.kind == HALFSPACE:
        n = _points_on_plane(of_a, of_b, manifold)
    else:
        n, off = overlap_points(of_a, of_b, 16.0 * error, margin, first, second, manifold)
        bound += off
    n = keep_near(manifold, n, margin + bound)
    distance = row.doubles[DISTANCE]
    bracket = max(row.doubles[UPPER] - distance, distance - row.doubles[LOWER])
    if least_gap(manifold, n) - bound > distance + bracket + _ERRORS * error:
        is_line = of_a.n == 2 or of_b.n == 2
        k = _corner_near(manifold, n, nearest, NEAR_END if is_line else NEAR)
        if k < 0:  # put in front: the nearest points, where corners are farther apart
            for j in range(n):
                copy_point(manifold, n - 1 - j, n - j)
            k = 0
            n += 1
            manifold.features[0] = of_a.feature
            manifold.features[1] = of_b.feature
        manifold.points[POINT * k] = nearest.x
        manifold.points[POINT * k + V] = nearest.y
        manifold.points[POINT * k + POINT_GAP] = distance
        manifold.points[POINT * k + HEIGHT] = nearest.z + 0.5 * distance
        bound = max(bound, bracket)
    tolerance = max(_ERRORS * error, _SHARE * _extent(manifold, n))
    n = drop_repeated(manifold, n, bound, tolerance)
    first_point = deepest_point(manifold, n, bound)
    n = select_points(manifold, n, first_point, max_contacts, order)
    bound += 8.0 * error + pair.numbers[NUMBERS * pair.A.shape + SLOP] + pair.numbers[NUMBERS * pair.B.shape + SLOP]
    bound += pair.poses[pair.A.pose_at + POSE_SLOP] + pair.poses[pair.B.pose_at + POSE_SLOP]
    for k in range(n):
        contact = out_at + _CONTACT * k
        _write_contact(contact, manifold, order[k], k == 0, axes, pair, row, flip, bound)
        words = view_i32(contact, _CONTACT // 4)
        words[_FACET_B if flip else _FACET_A] = of_a.triangle
        words[_FACET_A if flip else _FACET_B] = of_b.triangle
    return n


@kernel(inline=True)
def _point(row, of_a):
    return vec3_at(row.doubles, POINT_A if of_a else POINT_B)


@kernel(inline=True)
def _error(pair, row):
    """Bound of the rounding of a coordinate (u, v, h) seen from A's origin.

    With S = ρ_A + ρ_B + |t|, ρ the reach of a body and a little for its stretch: a turned corner is good to 4u·ρ, the
    sum with t and t itself to 2u·S, a product with an axis, itself good to 4u, to 8u·S; 14u·S in all.
    """
    reach = 1.01 * (reach_of(pair, pair.A) + reach_of(pair, pair.B)) + norm1(pair.t)
    reach += radius_of(pair, pair.A) + radius_of(pair, pair.B)
    if pair.A.kind == HALFSPACE:  # its nearest point, and that seen from its origin
        reach += norm1(vec3_at(row.doubles, POINT_A)) + norm1(vec3_at(row.doubles, POINT_B))
        reach += norm1(vec3_at(pair.poses, pair.A.pose_at + 9))
    return 16.0 * _U * reach


@kernel(inline=True)
def _bound(error, of_a, of_b):
    """How far a gap measured may be off.

    Two heights, and for each face twice the error of a place times its slope, at most 1.02; a slope is good to 32u,
    and extends over 2S at most: 6 errors and 8. A face's corners are off its plane by its flatness, measured along its
    normal, of which the gap is the slant, at most 1.5 times as long.
    """
    return 16.0 * error + 2.0 * (of_a.flatness + of_b.flatness)


@kernel(inline=True)
def _plane_face(of_b, nearest):
    """The face of a half-space: its plane, without corners."""
    return SupportFace(
        0, -1, nearest.x, nearest.y, nearest.z, 0.0, 0.0, 0.0, 0.0, 0.0, of_b.corners, of_b.features, of_b.edges, -1
    )


@kernel(inline=True)
def _points_on_plane(plane, face, manifold):
    """Corners of B's support on the plane of A, counter-clockwise; how many."""
    for k in range(face.n):
        corner = face.n - 1 - k
        at = 3 * corner
        u, v, h = face.corners[at], face.corners[at + 1], face.corners[at + 2]
        manifold.points[POINT * k] = u
        manifold.points[POINT * k + V] = v
        manifold.points[POINT * k + POINT_GAP] = h - height_at(plane, u, v)
        manifold.points[POINT * k + HEIGHT] = 0.5 * (h + height_at(plane, u, v))
        manifold.features[2 * k] = -1
        manifold.features[2 * k + 1] = face.features[corner]
    return face.n


@kernel(inline=True)
def _corner_near(manifold, n, nearest, share):
    """Number of the point within ``share`` of the manifold's size of the nearest points, which take its place and its
    features; −1 without."""
    closest, square = -1, math.inf
    for k in range(n):
        du, dv = manifold.points[POINT * k] - nearest.x, manifold.points[POINT * k + V] - nearest.y
        if du * du + dv * dv < square:
            closest, square = k, du * du + dv * dv
    if closest < 0 or square > (share * _extent(manifold, n)) ** 2:
        return -1
    return closest


@kernel(inline=True)
def _extent(manifold, n):
    """The larger side of the box around n points."""
    low_u, high_u = manifold.points[0], manifold.points[0]
    low_v, high_v = manifold.points[V], manifold.points[V]
    for k in range(1, n):
        u, v = manifold.points[POINT * k], manifold.points[POINT * k + V]
        low_u, high_u = min(low_u, u), max(high_u, u)
        low_v, high_v = min(low_v, v), max(high_v, v)
    return max(high_u - low_u, high_v - low_v)


@kernel
def _write_contact(contact_at, manifold, k, is_first, axes, pair, row, flip, bound):
    """Write a row, with A and B in the order of the question."""
    doubles, words = view_f64(contact_at, _CONTACT // 8), view_i32(contact_at, _CONTACT // 4)
    distance = manifold.points[POINT * k + POINT_GAP]
    lower, upper = distance - bound, distance + bound
    # A height field's facet is asked for its own points by a row that holds no distance: its bracket is empty.
    is_known = row.doubles[DISTANCE] <= row.doubles[UPPER]
    if is_first and is_known:
        distance = row.doubles[DISTANCE]  # the deepest point of the manifold is that of the pair
        lower = min(lower, row.doubles[LOWER])
        upper = max(upper, row.doubles[UPPER])
    elif is_known:  # none is deeper, but for what either is known by
        distance = max(distance, row.doubles[DISTANCE])
        upper = max(upper, distance)
    height = manifold.points[POINT * k + HEIGHT]
    middle = add(
        add(scale(manifold.points[POINT * k], axes.e), scale(manifold.points[POINT * k + V], axes.f)),
        scale(height, axes.nhat),
    )
    middle = add(middle, vec3_at(pair.poses, pair.A.pose_at + 9))
    half = scale(0.5 * distance, axes.nhat)
    sign = -1.0 if flip else 1.0
    doubles[_DISTANCE] = distance + 0.0
    doubles[_LOWER] = lower
    doubles[_UPPER] = upper
    doubles[_APART] = max(0.0, -row.doubles[LOWER]) if row.flags[HIT] == 1 else 0.0
    put_vec3(doubles, _NORMAL, add(scale(sign, axes.nhat), Vec3(0.0, 0.0, 0.0)))
    put_vec3(doubles, _POINT_B if flip else _POINT_A, sub(middle, half))
    put_vec3(doubles, _POINT_A if flip else _POINT_B, add(middle, half))
    for at in range(_A, _CONTACT // 4):  # what is not set below
        words[at] = 0
    words[_B] = 1
    words[_FEATURE_B if flip else _FEATURE_A] = manifold.features[2 * k]
    words[_FEATURE_A if flip else _FEATURE_B] = manifold.features[2 * k + 1]
    words[_KIND] = OVERLAP if row.flags[HIT] == 1 else GAP
