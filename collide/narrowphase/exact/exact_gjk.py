"""GJK in integers: whether two swept hulls share a point."""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.bounds import EXACT_ROUNDS
from collide.narrowphase.exact.exact_directions import (
    direction_double,
    direction_length,
    edge_at,
    height_along,
    set_cross,
    set_edge,
    set_normal,
    side_of,
)
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import exact_pair, fits, load_poses, point_at, scratch_at, set_point
from collide.narrowphase.exact.johnson import (
    has_pair,
    nearest_subset,
    reduce_simplex,
    set_delta,
    set_direction,
    set_gram,
    within_radius,
)
from collide.numerics.digits import add_product, carry, set_zero
from collide.numerics.double_double import DD
from collide.numerics.vec3 import Vec3, divide, norm

#: Verdicts of the exact stage. UNDONE: the magnitudes span more bits than the workspace holds.
TOUCHING, SEPARATE, UNDONE = range(3)


class ExactAnswer(NamedTuple):
    """Whether two swept hulls share a point.

    verdict : TOUCHING, SEPARATE or UNDONE.
    n : points of the deciding simplex: its nearest point to the origin is the separating direction, or
        lies within the sum of the radii.
    cores_apart : whether the cores themselves are known to be apart; the next two are set only then.
    excess : distance of the cores minus the radii [m], without cancellation, to EXACT_ERROR.
    v : unit vector from B to A, exact but for its own rounding.
    rounds : of GJK.
    """

    verdict: int
    n: int
    cores_apart: bool
    excess: DD
    v: Vec3
    rounds: int


@kernel(inline=True)
def sign_only(verdict, n, rounds):
    return ExactAnswer(verdict, n, False, DD(0.0, 0.0), Vec3(0.0, 0.0, 0.0), rounds)


@kernel
def touch_exactly(ordered, terms, digits, boolean, ids, n, radius_a, radius_b):
    """The `ExactAnswer` of an `OrderedPair` whose cores are hulls of points.

    terms : exact terms of poses that are products (`PoseTable.terms`).
    digits : workspace of `exact_workspace.INTEGERS`.
    boolean : stop at the first separating plane, not always the nearest point's.
    ids : in, vertex pairs of a first simplex of n ≥ 1 points; out, of the deciding simplex.
    """
    exact = exact_pair(ordered, terms, digits, radius_a, radius_b)
    if not fits(exact):
        return sign_only(UNDONE, n, 0)
    load_poses(exact)
    for k in range(n):
        set_point(exact, k, ids[2 * k], ids[2 * k + 1])
    sign_of_cores = boolean and radius_a == 0.0 and radius_b == 0.0
    if sign_of_cores and n == 3:
        verdict, n_deciding = _try_face(exact, ids)
        if verdict != UNDONE:
            return sign_only(verdict, n_deciding, 1)
    for k in range(n):
        set_gram(exact, k)
    mask = nearest_subset(exact, n, -1)
    for rounds in range(1, EXACT_ROUNDS + 1):
        n = reduce_simplex(exact, ids, mask, n)
        mask = (1 << n) - 1
        if n == 4:
            return sign_only(TOUCHING, n, rounds)
        length, zero = set_direction(exact, mask)
        if zero:
            return sign_only(TOUCHING, n, rounds)
        i, j, v = support_pair(exact, length)
        is_in_simplex = has_pair(ids, n, i, j)
        if not is_in_simplex:
            ids[2 * n] = i
            ids[2 * n + 1] = j
            set_point(exact, n, i, j)
            # The last point against the direction still lies along it: then all do.
            if sign_of_cores and side_of(exact, length, n) > 0:
                return sign_only(SEPARATE, n, rounds)
            set_gram(exact, n)
        if is_in_simplex or set_delta(exact, mask, n) <= 0:
            within, excess = within_radius(exact, mask, radius_a, radius_b)
            return ExactAnswer(TOUCHING if within else SEPARATE, n, True, excess, v, rounds)
        if n == 3:
            separating = _separating_faces(exact)
            if separating == 0:
                return sign_only(TOUCHING, 4, rounds)
            if separating & (separating - 1) == 0:
                # Beyond one face alone: the nearest point is on it, and the vertex across goes.
                n = reduce_simplex(exact, ids, 15 & ~separating, 4) - 1
        mask = nearest_subset(exact, n + 1, n)
        n += 1
    return sign_only(UNDONE, n, EXACT_ROUNDS)


@kernel
def gap_of_face(ordered, terms, digits, ids, rounds):
    """The `ExactAnswer` of cores without radii known to be apart, whose nearest point lies within the face ``ids``.

    The distance is the height of the face over its plane's foot, of degree three over two, where Johnson's takes eight
    over six.   rounds : that have found the face.   Other arguments as of `touch_exactly`.
    """
    exact = exact_pair(ordered, terms, digits, 0.0, 0.0)
    if not fits(exact):
        return sign_only(UNDONE, 3, 0)
    load_poses(exact)
    for k in range(3):
        set_point(exact, k, ids[2 * k], ids[2 * k + 1])
    n, _ = set_normal(exact)
    direction = direction_double(exact, n)
    excess = height_along(exact, n, direction_length(exact, n), 0)
    return ExactAnswer(SEPARATE, 3, True, excess, divide(direction, norm(direction)), rounds)


@kernel
def _try_face(exact, ids):
    """(verdict, points) from the plane of points 0, 1, 2 alone: most flush faces need no more.

    The plane separates, or its support point makes a tetrahedron around the origin; else UNDONE.
    """
    n, side = set_normal(exact)
    if side == 0:
        return UNDONE, 3
    i, j, _ = support_pair(exact, n)
    if has_pair(ids, 3, i, j):
        return SEPARATE, 3  # nothing lies farther back than the plane itself
    set_point(exact, 3, i, j)
    if side_of(exact, n, 3) > 0:
        return SEPARATE, 3
    if _separating_faces(exact) != 0:
        return UNDONE, 3
    ids[6] = i
    ids[7] = j
    return TOUCHING, 4


@kernel
def _separating_faces(exact):
    """Faces of points 0 … 3 through point 3 with the origin beyond: bit k for the face across k.

    The origin is known to lie on the inner side of the face across point 3. All three inside proves that the
    tetrahedron holds the origin, in a quarter of the work of Johnson's determinants. 7, saying nothing, where the four
    points are coplanar or the origin is on a face's plane.
    """
    digits, d = exact.digits, exact.d
    beyond = 0
    for k in range(3):
        set_edge(exact, k, k, 3)
    normal = scratch_at(d, 1)
    height = scratch_at(d, 2)
    for k in range(3):
        set_zero(digits, height, 6 * d)
        for axis in range(3):
            set_cross(exact, normal, (k + 1) % 3, (k + 2) % 3, axis)
            add_product(digits, height, normal, 2 * d, point_at(d, 3, axis), d, -1)  # the origin, seen from 3
            add_product(digits, height + 3 * d, normal, 2 * d, edge_at(d, k, axis), d, 1)
        origin = carry(digits, height, 3 * d)
        across = carry(digits, height + 3 * d, 3 * d)
        if origin == 0 or across == 0:
            return 7
        if origin != across:
            beyond |= 1 << k
    return beyond
