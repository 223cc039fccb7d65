"""GJK in integers: whether two swept hulls share a point."""

from __future__ import annotations

from collide.kernels import kernel
from collide.narrowphase.bounds import EXACT_ROUNDS
from collide.narrowphase.exact.exact_directions import is_ahead, set_normal
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import (
    LONGEST,
    exact_pose,
    load_poses,
    point_at,
    scale_of,
    scratch_at,
    set_point,
)
from collide.narrowphase.exact.johnson import compact, nearest_subset, set_delta, set_direction, set_gram, within_radius
from collide.numerics.digits import add_number, add_product, carry, clear

#: What the stage says. UNDONE: the magnitudes span more bits than the workspace holds.
TOUCHING, SEPARATE, UNDONE = range(3)


@kernel
def touch_exactly(
    pair, terms, digits, boolean, ids, n, lowest_a, lowest_b, reach_a, reach_b, radius_a, radius_b, size, error
):
    """Decide whether two swept hulls share a point.

    pair : as in `difference_point`, both cores hulls of points.
    terms : exact terms of poses that are products (`PoseTable.terms`).
    digits : int64 workspace of `INTEGERS`.
    boolean : stop at the first plane that separates, which need not be the nearest point's.
    ids : vertex pairs of a first simplex of n ≥ 1 points in, of the deciding one out.
    lowest_a, lowest_b, reach_a, reach_b : of the shapes (`PackedConvex`).   size : S of `bounds.py`.
    error : of a support value in doubles.

    Returns
    -------
    verdict : TOUCHING, SEPARATE or UNDONE.
    points of the deciding simplex: its nearest point to the origin is the separating direction, or
    lies within the sum of the radii.
    cores apart : whether the cores themselves are apart; the next two are set only then.
    excess, low part : distance of the cores minus the radii, without cancellation, to EXACT_ERROR.
    vx, vy, vz : unit vector from B to A, exact but for its own rounding.
    rounds used.
    """
    pose_a = exact_pose(pair.poses, pair.A.pose_at, terms)
    pose_b = exact_pose(pair.poses, pair.B.pose_at, terms)
    scale = scale_of(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, radius_a, radius_b, size)
    d = scale[0]
    if d > LONGEST:
        return UNDONE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    load_poses(digits, scale, pose_a, pose_b)
    for k in range(n):
        set_point(digits, scale, pair, k, ids[2 * k], ids[2 * k + 1])
    if boolean and n == 3 and radius_a == 0.0 and radius_b == 0.0:
        verdict, shown = _try_face(digits, scale, pair, ids, error)
        if verdict != UNDONE:
            return verdict, shown, False, 0.0, 0.0, 0.0, 0.0, 0.0, 1
    for k in range(n):
        set_gram(digits, d, k)
    mask = nearest_subset(digits, d, n, -1)
    for used in range(1, EXACT_ROUNDS + 1):
        n = compact(digits, d, ids, mask, n)
        mask = (1 << n) - 1
        if n == 4:
            return TOUCHING, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
        length, zero = set_direction(digits, d, mask)
        if zero:
            return TOUCHING, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
        i, j, vx, vy, vz = support_pair(digits, scale, pair, length, error)
        known = False
        for k in range(n):
            known = known or (ids[2 * k] == i and ids[2 * k + 1] == j)
        if not known:
            ids[2 * n] = i
            ids[2 * n + 1] = j
            set_point(digits, scale, pair, n, i, j)
            if boolean and radius_a == 0.0 and radius_b == 0.0 and is_ahead(digits, d, length, n):
                return SEPARATE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
            set_gram(digits, d, n)
        if known or set_delta(digits, d, mask, n) <= 0:
            touching, excess, excess_low = within_radius(digits, d, mask, scale[1], radius_a, radius_b)
            return TOUCHING if touching else SEPARATE, n, True, excess, excess_low, vx, vy, vz, used
        if n == 3:
            outside = _faces_that_part(digits, d)
            if outside == 0:
                return TOUCHING, 4, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
            if outside & (outside - 1) == 0:
                # Beyond one face alone: the nearest point is on it, and the vertex across goes.
                n = compact(digits, d, ids, 15 & ~outside, 4) - 1
        mask = nearest_subset(digits, d, n + 1, n)
        n += 1
    return UNDONE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, EXACT_ROUNDS


@kernel
def _try_face(digits, scale, pair, ids, error):
    """(verdict, points) from the plane of points 0, 1, 2 alone: most flush faces need no more.

    The plane separates, or its support point makes a tetrahedron around the origin; else UNDONE.
    """
    d = scale[0]
    length, side = set_normal(digits, d)
    if side == 0:
        return UNDONE, 3
    i, j, _, _, _ = support_pair(digits, scale, pair, length, error)
    for k in range(3):
        if ids[2 * k] == i and ids[2 * k + 1] == j:
            return SEPARATE, 3  # nothing lies farther back than the plane itself
    set_point(digits, scale, pair, 3, i, j)
    if is_ahead(digits, d, length, 3):
        return SEPARATE, 3
    if _faces_that_part(digits, d) != 0:
        return UNDONE, 3
    ids[6] = i
    ids[7] = j
    return TOUCHING, 4


@kernel
def _faces_that_part(digits, d):
    """Which faces of points 0 … 3 through point 3 have the origin beyond them: bit k for the face across k.

    The origin is known to lie on the inner side of the face across point 3. All three inside proves
    that the tetrahedron holds the origin; it takes a quarter of the work of Johnson's determinants.
    7, saying nothing, where the four points are coplanar or the origin is on a face's plane.
    """
    beyond = 0
    edges = scratch_at(d, 0)
    for k in range(3):
        for axis in range(3):
            at = edges + (3 * k + axis) * d
            clear(digits, at, d)
            add_number(digits, at, point_at(d, k, axis), d, 1)
            add_number(digits, at, point_at(d, 3, axis), d, -1)
            carry(digits, at, d)
    normal = scratch_at(d, 1)
    height = scratch_at(d, 2)
    for k in range(3):
        e = edges + 3 * d * ((k + 1) % 3)
        f = edges + 3 * d * ((k + 2) % 3)
        clear(digits, height, 6 * d)
        for axis in range(3):
            i = (axis + 1) % 3
            j = (axis + 2) % 3
            clear(digits, normal, 2 * d)
            add_product(digits, normal, e + i * d, d, f + j * d, d, 1)
            add_product(digits, normal, e + j * d, d, f + i * d, d, -1)
            carry(digits, normal, 2 * d)
            add_product(digits, height, normal, 2 * d, point_at(d, 3, axis), d, -1)  # the origin, seen from 3
            add_product(digits, height + 3 * d, normal, 2 * d, edges + (3 * k + axis) * d, d, 1)
        origin = carry(digits, height, 3 * d)
        across = carry(digits, height + 3 * d, 3 * d)
        if origin == 0 or across == 0:
            return 7
        if origin != across:
            beyond |= 1 << k
    return beyond
