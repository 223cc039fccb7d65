"""The exact stage: whether two posed hulls, each swept by a ball, share a point. No rounding at all.

GJK with Johnson's subalgorithm (Gilbert, Johnson and Keerthi 1988) in integers: every quantity is a
polynomial of the doubles given (vertices, both poses, radii), which `geometry.digits` holds exactly.
The exact distance of the simplex strictly decreases from round to round and there are finitely many
simplices, so it ends, and it ends in a decision. Doubles only propose: which simplex to begin with,
and which few vertices can be extreme in a direction (all within an error bound of the best one).

Degrees, with one coordinate of a difference point y = R_A a − R_B b − (p_WB − p_WA) as one: a Gram
entry y_i·y_j has two, Johnson's Δ has 0, 2, 4, 6 for 1 to 4 points, the direction Σ Δ_i y_i one more.
"""

from __future__ import annotations

import math

from collide._jit import kernel
from collide.geometry.digits import (
    BITS,
    LONGEST_FACTOR,
    add_double,
    add_number,
    add_product,
    as_double,
    as_double_double,
    carry,
    clear,
    grid_of,
    lowest_bit,
)
from collide.geometry.double_double import add, divide, square_root
from collide.geometry.error_free import two_sum
from collide.geometry.support_tree.query import extreme_vertex, rings_of
from collide.geometry.tables import POSE_TERMS, TERMS
from collide.narrowphase.bounds import EXACT_ROUNDS

#: What the stage says. UNDONE: the magnitudes span more bits than the workspace holds.
TOUCHING, SEPARATE, UNDONE = range(3)

#: Most digits of one coordinate: 2^1664 between the largest and the smallest bit of a pair, which is
#: every double there is as long as the bodies are smaller than 2^500 m. The shorter factor of any
#: product has at most two coordinates' digits.
_LONGEST = 64
assert 2 * _LONGEST <= LONGEST_FACTOR

# --- the workspace, in units of the coordinate length D (digits) --------------------------------
# rotations 18·D and shift 3·D; then points 5·3·D, Gram 25·2D, Δ 16·4·6D, direction 3·6D, scratch.

#: Integers of workspace.
INTEGERS = 21 * _LONGEST + 15 * _LONGEST + 50 * _LONGEST + 384 * _LONGEST + 18 * _LONGEST + 60 * _LONGEST + 64


@kernel
def _shift_at(d):
    return 18 * d


@kernel
def _point_at(d, k, axis):
    return (21 + 3 * k + axis) * d


@kernel
def _gram_at(d, i, j):
    return (36 + 2 * (5 * i + j)) * d


@kernel
def _delta_at(d, mask, i):
    return (86 + 6 * (4 * mask + i)) * d


@kernel
def _direction_at(d, axis):
    return (470 + 6 * axis) * d


@kernel
def _scratch_at(d, k):
    """Scratch k of 4, 15·D each: room for a coordinate and for numbers of up to 14 degrees."""
    return (488 + 15 * k) * d


# --- scaling ------------------------------------------------------------------------------------


@kernel
def lowest_and_largest(numbers, at, n):
    """Exponents of the lowest bit and of the largest magnitude among n doubles."""
    lowest = 2000
    largest = -2000
    for k in range(at, at + n):
        if numbers[k] != 0.0:
            lowest = min(lowest, lowest_bit(numbers[k]))
            largest = max(largest, math.frexp(numbers[k])[1])
    return lowest, largest


@kernel
def exact_pose(poses, p, terms):
    """(numbers, where, k): entry j of the pose is exactly the sum of numbers[where + k·j …], k of them."""
    if poses[p + POSE_TERMS] < 0.0:
        return poses, p, 1
    return terms, 12 * TERMS * int(poses[p + POSE_TERMS]), TERMS


@kernel
def span_of_entries(pose, first, count):
    """(grid, digits) that hold each of ``count`` entries of an exact pose; (0, 1) where all are 0."""
    numbers, at, k = pose
    lowest, largest = lowest_and_largest(numbers, at + k * first, k * count)
    if lowest == 2000:
        return 0, 1
    if k > 1:
        largest += 3  # a sum of up to seven
    return grid_of(lowest), grid_of(largest - 1) - grid_of(lowest) + 1


@kernel
def add_entry(digits, at, pose, j, grid, sign):
    """Add or subtract entry j of an exact pose."""
    numbers, start, k = pose
    for i in range(k):
        add_double(digits, at, sign * numbers[start + k * j + i], grid)


@kernel
def _scale(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, radius_a, radius_b, size):
    """(D, grid of coordinates, grid and digits of R_A, grid and digits of a's coordinates, same of B).

    A grid is the exponent of a number's digit 0 over BITS; all of a pair's coordinates share one.
    """
    # A core at its frame's origin alone is not turned: its rotation takes no digits, and must have no say in D.
    rot_a, digits_rot_a = span_of_entries(pose_a, 0, 9 if lowest_a < 2000 else 0)
    rot_b, digits_rot_b = span_of_entries(pose_b, 0, 9 if lowest_b < 2000 else 0)
    core_a = grid_of(min(lowest_a, 1000))
    core_b = grid_of(min(lowest_b, 1000))
    low_s, high_s = lowest_and_largest(pose_a[0], pose_a[1] + 9 * pose_a[2], 3 * pose_a[2])
    low_t, high_t = lowest_and_largest(pose_b[0], pose_b[1] + 9 * pose_b[2], 3 * pose_b[2])
    grid = grid_of(min(low_s, low_t, lowest_bit(radius_a), lowest_bit(radius_b), 1000))
    if lowest_a < 2000:
        grid = min(grid, rot_a + core_a)
    if lowest_b < 2000:
        grid = min(grid, rot_b + core_b)
    # Digits from the lowest bit to the highest: |x| < 2^e reaches up to bit e − 1.
    digits_a = max(grid_of(math.frexp(reach_a)[1] - 1) - core_a + 1, 1) if lowest_a < 2000 else 0
    digits_b = max(grid_of(math.frexp(reach_b)[1] - 1) - core_b + 1, 1) if lowest_b < 2000 else 0
    # A coordinate is less than 2·size; the highest digit is signed and may be as large as a factor.
    d = grid_of(math.frexp(size)[1]) - grid + 1
    d = max(d, grid_of(max(high_s, high_t, -1000)) - grid + 1)
    if lowest_a < 2000:
        d = max(d, digits_rot_a + digits_a - 1 + rot_a + core_a - grid)
    if lowest_b < 2000:
        d = max(d, digits_rot_b + digits_b - 1 + rot_b + core_b - grid)
    return d, grid, rot_a, digits_rot_a, core_a, digits_a, rot_b, digits_rot_b, core_b, digits_b


@kernel
def _load(digits, scale, pose_a, pose_b):
    """Rotations and the shift p_WB − p_WA into the workspace."""
    d, grid, rot_a, digits_rot_a, _, digits_a, rot_b, digits_rot_b, _, digits_b = scale
    clear(digits, 0, 21 * d)
    for k in range(9):
        if digits_a > 0:
            add_entry(digits, k * d, pose_a, k, rot_a, 1.0)
            carry(digits, k * d, digits_rot_a)
        if digits_b > 0:
            add_entry(digits, (9 + k) * d, pose_b, k, rot_b, 1.0)
            carry(digits, (9 + k) * d, digits_rot_b)
    for k in range(3):
        at = _shift_at(d) + k * d
        add_entry(digits, at, pose_b, 9 + k, grid, 1.0)
        add_entry(digits, at, pose_a, 9 + k, grid, -1.0)
        carry(digits, at, d)


@kernel
def _add_vertex(digits, d, out, rotation, digits_rot, coordinates, m, vertex, core, digits_core, offset, sign):
    """Add sign · R v to three coordinates at out, out + D, out + 2D."""
    at = _scratch_at(d, 3)
    clear(digits, at, 3 * digits_core)
    for j in range(3):
        add_double(digits, at + j * digits_core, coordinates[j * m + vertex], core)
    for axis in range(3):
        for j in range(3):
            add_product(
                digits, out + axis * d + offset, (rotation + 3 * axis + j) * d, digits_rot, at + j * digits_core,
                digits_core, sign,
            )  # fmt: skip


@kernel
def _set_point(digits, scale, pair, k, i, j):
    """Point k of the workspace becomes the difference of vertex i of A and vertex j of B."""
    d, grid, rot_a, digits_rot_a, core_a, digits_a, rot_b, digits_rot_b, core_b, digits_b = scale
    out = _point_at(d, k, 0)
    clear(digits, out, 3 * d)
    if digits_a > 0:
        _add_vertex(
            digits, d, out, 0, digits_rot_a, pair[0], pair[2], i, core_a, digits_a, rot_a + core_a - grid, 1
        )
    if digits_b > 0:
        _add_vertex(
            digits, d, out, 9, digits_rot_b, pair[6], pair[8], j, core_b, digits_b, rot_b + core_b - grid, -1
        )
    for axis in range(3):
        add_number(digits, out + axis * d, _shift_at(d) + axis * d, d, -1)
        carry(digits, out + axis * d, d)


@kernel
def _set_gram(digits, d, k):
    """Products of point k with points 0 … k."""
    for i in range(k + 1):
        at = _gram_at(d, k, i)
        clear(digits, at, 2 * d)
        for axis in range(3):
            add_product(digits, at, _point_at(d, k, axis), d, _point_at(d, i, axis), d, 1)
        carry(digits, at, 2 * d)
        if i != k:
            clear(digits, _gram_at(d, i, k), 2 * d)
            add_number(digits, _gram_at(d, i, k), at, 2 * d, 1)


# --- Johnson's subalgorithm ---------------------------------------------------------------------


@kernel
def _length(d, mask):
    """Digits of Δ for a set of points: one more factor of degree two for each point but the first."""
    count = (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1) + ((mask >> 3) & 1)
    return 1 if count == 1 else 2 * d * (count - 1)


@kernel
def _lowest_member(mask):
    k = 0
    while not (mask >> k) & 1:
        k += 1
    return k


@kernel
def _set_delta(digits, d, mask, j):
    """Δ_j(X ∪ {j}) = Σ_{i ∈ X} Δ_i(X)·(y_i·y_k − y_i·y_j), k in X; returns its sign.

    Negative or zero for j outside X: no point of the simplex gets nearer by going towards y_j.
    """
    k = _lowest_member(mask)
    larger = mask | (1 << j)
    out = _delta_at(d, larger, j)
    n = _length(d, larger)
    clear(digits, out, n)
    if mask & (mask - 1) == 0:
        add_number(digits, out, _gram_at(d, k, k), 2 * d, 1)
        add_number(digits, out, _gram_at(d, k, j), 2 * d, -1)
        return carry(digits, out, n)
    difference = _scratch_at(d, 0)
    for i in range(4):
        if (mask >> i) & 1:
            clear(digits, difference, 2 * d)
            add_number(digits, difference, _gram_at(d, i, k), 2 * d, 1)
            add_number(digits, difference, _gram_at(d, i, j), 2 * d, -1)
            carry(digits, difference, 2 * d)
            add_product(digits, out, _delta_at(d, mask, i), _length(d, mask), difference, 2 * d, 1)
    return carry(digits, out, n)


@kernel
def _nearest_subset(digits, d, n, newest):
    """The subset of n ≤ 4 points that holds the nearest point of their hull in its relative interior.

    Subsets with the newest point only, where newest ≥ 0: without it there is nothing nearer than
    before. Sets are visited smaller ones first, so that every Δ needed stands. Affinely dependent
    points are no special case: the nearest point also lies in an independent subset.
    """
    everything = (1 << n) - 1
    signs = 0  # two bits a (subset, member): 1 where Δ > 0
    for i in range(n):
        digits[_delta_at(d, 1 << i, i)] = 1
        signs |= 1 << i
    for count in range(1, n + 1):
        for mask in range(1, everything + 1):
            size = (mask & 1) + ((mask >> 1) & 1) + ((mask >> 2) & 1) + ((mask >> 3) & 1)
            if size != count:
                continue
            positive = True
            for i in range(n):
                if (mask >> i) & 1 and count > 1 and _delta_sign(digits, d, mask, i) <= 0:
                    positive = False
            nearest = positive
            for j in range(n):
                if not (mask >> j) & 1 and _set_delta(digits, d, mask, j) > 0:
                    nearest = False
            if nearest and (newest < 0 or (mask >> newest) & 1):
                return mask
    return 0


@kernel
def _delta_sign(digits, d, mask, i):
    """Sign of a carried Δ_i(mask)."""
    at = _delta_at(d, mask, i)
    n = _length(d, mask)
    if digits[at + n - 1] < 0:
        return -1
    for k in range(n):
        if digits[at + k] != 0:
            return 1
    return 0


@kernel
def _set_direction(digits, d, mask):
    """A positive multiple of the nearest point of points 0 … n − 1, into the direction.

    For one or two points it is the nearest point times ΣΔ. Across three it is their normal, of degree
    two instead of five. Returns (digits it takes, whether it is zero: the origin is in the hull).
    """
    if mask == 7:
        return _set_normal(digits, d)
    n = _length(d, mask)
    total = d if n == 1 else n + d
    zero = True
    for axis in range(3):
        at = _direction_at(d, axis)
        clear(digits, at, 6 * d)
        for i in range(4):
            if (mask >> i) & 1:
                add_product(digits, at, _delta_at(d, mask, i), n, _point_at(d, i, axis), d, 1)
        if carry(digits, at, total) != 0:
            zero = False
    return total, zero


@kernel
def _set_normal(digits, d):
    """The normal of points 0, 1, 2, on the side that points 0, 1, 2 lie on, seen from the origin."""
    for edge in range(2):
        for axis in range(3):
            at = _scratch_at(d, 0) + (3 * edge + axis) * d
            clear(digits, at, d)
            add_number(digits, at, _point_at(d, edge + 1, axis), d, 1)
            add_number(digits, at, _point_at(d, 0, axis), d, -1)
            carry(digits, at, d)
    height = _scratch_at(d, 1)
    clear(digits, height, 3 * d)
    for axis in range(3):
        out = _direction_at(d, axis)
        e = _scratch_at(d, 0)
        f = e + 3 * d
        i = (axis + 1) % 3
        j = (axis + 2) % 3
        clear(digits, out, 2 * d)
        add_product(digits, out, e + i * d, d, f + j * d, d, 1)
        add_product(digits, out, e + j * d, d, f + i * d, d, -1)
        carry(digits, out, 2 * d)
        add_product(digits, height, out, 2 * d, _point_at(d, 0, axis), d, 1)
    side = carry(digits, height, 3 * d)
    if side < 0:
        for axis in range(3):
            out = _direction_at(d, axis)
            for k in range(2 * d):
                digits[out + k] = -digits[out + k]
            carry(digits, out, 2 * d)
    return 2 * d, side == 0


@kernel
def _direction_double(digits, d, n):
    """The direction as doubles, to a relative 2⁻⁵⁰ of its length, and up to a power of two."""
    x, ex = as_double(digits, _direction_at(d, 0), n)
    y, ey = as_double(digits, _direction_at(d, 1), n)
    z, ez = as_double(digits, _direction_at(d, 2), n)
    e = -(10**6)
    if x != 0.0:
        e = ex + math.frexp(x)[1]
    if y != 0.0:
        e = max(e, ey + math.frexp(y)[1])
    if z != 0.0:
        e = max(e, ez + math.frexp(z)[1])
    return _ldexp(x, ex - e), _ldexp(y, ey - e), _ldexp(z, ez - e)


@kernel
def _ldexp(x, e):
    """x·2^e, with exponents far out of range brought to where they still give 0 or infinity."""
    return math.ldexp(x, int(min(max(e, -5000), 5000)))


# --- supports -----------------------------------------------------------------------------------


@kernel
def _extreme_vertex(
    digits, d, n, coordinates, count, m, tree, poses, p, rotation, digits_rot, core, digits_core, vx, vy, vz, slack, sign
):
    """The vertex with the least sign · (v·R a), v the exact direction; the first of equals.

    Doubles rule out all that are farther than twice the slack from the best; what is left, usually
    one vertex, is compared exactly. Where there is a support tree, only what it proposes and its
    neighbours are looked at (which of equals is then up to the tree).
    """
    gx = sign * (poses[p] * vx + poses[p + 3] * vy + poses[p + 6] * vz)
    gy = sign * (poses[p + 1] * vx + poses[p + 4] * vy + poses[p + 7] * vz)
    gz = sign * (poses[p + 2] * vx + poses[p + 5] * vy + poses[p + 8] * vz)
    if tree != 0:
        _turn_direction(digits, d, n, rotation, digits_rot)
        found = _climb(digits, d, n + digits_rot, coordinates, m, tree, core, digits_core, gx, gy, gz, slack, sign)
        if found >= 0:
            return found
    least = math.inf
    for i in range(count):
        least = min(least, coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz)
    best = -1
    turned = False
    for i in range(count):
        value = coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz
        if value > least + slack:
            continue
        if best < 0:
            best = i
            continue
        if not turned:
            _turn_direction(digits, d, n, rotation, digits_rot)
            turned = True
        if _compare(digits, d, n + digits_rot, coordinates, m, core, digits_core, i, best) * sign < 0:
            best = i
    return max(best, 0)


@kernel
def _climb(digits, d, n, coordinates, m, tree, core, digits_core, gx, gy, gz, slack, sign):
    """The least vertex by steps along hull edges from what the tree proposes, compared exactly.

    −1 where all neighbours are level: a vertex within a face, which may be a face on the far side.
    """
    best, _, _, _ = extreme_vertex(tree, -gx, -gy, -gz)
    starts, ring = rings_of(tree)
    while True:
        better = best
        level = True
        for k in range(starts[best], starts[best + 1]):
            i = ring[k]
            value = (
                (coordinates[i] - coordinates[best]) * gx
                + (coordinates[m + i] - coordinates[m + best]) * gy
                + (coordinates[2 * m + i] - coordinates[2 * m + best]) * gz
            )
            if value > slack:
                level = False
                continue
            side = _compare(digits, d, n, coordinates, m, core, digits_core, i, better) * sign
            if side < 0:
                better = i
            level = level and side == 0
        if better == best:
            return -1 if level else best
        best = better


@kernel
def _turn_direction(digits, d, n, rotation, digits_rot):
    """Rᵀv into scratch 1: comparing vertices then takes three products each instead of twenty-one."""
    for j in range(3):
        at = _scratch_at(d, 1) + 5 * d * j
        clear(digits, at, n + digits_rot)
        for axis in range(3):
            add_product(digits, at, _direction_at(d, axis), n, (rotation + 3 * axis + j) * d, digits_rot, 1)
        carry(digits, at, n + digits_rot)


@kernel
def _compare(digits, d, n, coordinates, m, core, digits_core, i, j):
    """Sign of (Rᵀv)·(a_i − a_j), Rᵀv of n digits standing in scratch 1."""
    out = _scratch_at(d, 2)
    at = _scratch_at(d, 3)
    clear(digits, out, n + digits_core)
    for axis in range(3):
        if coordinates[axis * m + i] != coordinates[axis * m + j]:
            clear(digits, at, digits_core)
            add_double(digits, at, coordinates[axis * m + i], core)
            add_double(digits, at, -coordinates[axis * m + j], core)
            carry(digits, at, digits_core)
            add_product(digits, out, _scratch_at(d, 1) + 5 * d * axis, n, at, digits_core, 1)
    return carry(digits, out, n + digits_core)


# --- the search ---------------------------------------------------------------------------------


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
    pose_a = exact_pose(pair[13], pair[5], terms)
    pose_b = exact_pose(pair[13], pair[11], terms)
    scale = _scale(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, radius_a, radius_b, size)
    d = scale[0]
    if d > _LONGEST:
        return UNDONE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, 0
    _load(digits, scale, pose_a, pose_b)
    for k in range(n):
        _set_point(digits, scale, pair, k, ids[2 * k], ids[2 * k + 1])
    if boolean and n == 3 and radius_a == 0.0 and radius_b == 0.0:
        verdict, shown = _try_face(digits, scale, pair, ids, error)
        if verdict != UNDONE:
            return verdict, shown, False, 0.0, 0.0, 0.0, 0.0, 0.0, 1
    for k in range(n):
        _set_gram(digits, d, k)
    mask = _nearest_subset(digits, d, n, -1)
    for used in range(1, EXACT_ROUNDS + 1):
        n = _compact(digits, d, ids, mask, n)
        mask = (1 << n) - 1
        if n == 4:
            return TOUCHING, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
        length, zero = _set_direction(digits, d, mask)
        if zero:
            return TOUCHING, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
        i, j, vx, vy, vz = _support_pair(digits, scale, pair, length, error)
        known = False
        for k in range(n):
            known = known or (ids[2 * k] == i and ids[2 * k + 1] == j)
        if not known:
            ids[2 * n] = i
            ids[2 * n + 1] = j
            _set_point(digits, scale, pair, n, i, j)
            if boolean and radius_a == 0.0 and radius_b == 0.0 and _is_ahead(digits, d, length, n):
                return SEPARATE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
            _set_gram(digits, d, n)
        if known or _set_delta(digits, d, mask, n) <= 0:
            touching, excess, excess_low = _within_radius(digits, d, mask, scale[1], radius_a, radius_b)
            return TOUCHING if touching else SEPARATE, n, True, excess, excess_low, vx, vy, vz, used
        if n == 3:
            outside = _faces_that_part(digits, d)
            if outside == 0:
                return TOUCHING, 4, False, 0.0, 0.0, 0.0, 0.0, 0.0, used
            if outside & (outside - 1) == 0:
                # Beyond one face alone: the nearest point is on it, and the vertex across goes.
                n = _compact(digits, d, ids, 15 & ~outside, 4) - 1
        mask = _nearest_subset(digits, d, n + 1, n)
        n += 1
    return UNDONE, n, False, 0.0, 0.0, 0.0, 0.0, 0.0, EXACT_ROUNDS


@kernel
def _support_pair(digits, scale, pair, length, error):
    """(vertex of A, vertex of B) whose difference is the last one against the direction; unit v in doubles."""
    d, _, _, digits_rot_a, core_a, digits_a, _, digits_rot_b, core_b, digits_b = scale
    (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, _, _, _, tree_a, tree_b, _, _) = pair
    vx, vy, vz = _direction_double(digits, d, length)
    along = math.sqrt(vx * vx + vy * vy + vz * vz)
    slack = 2.0 * error * along
    i = _extreme_vertex(
        digits, d, length, coords_a, n_a, m_a, tree_a, poses, p, 0, digits_rot_a, core_a, digits_a, vx, vy, vz, slack, 1.0
    )
    j = _extreme_vertex(
        digits, d, length, coords_b, n_b, m_b, tree_b, poses, q, 9, digits_rot_b, core_b, digits_b, vx, vy, vz, slack, -1.0
    )
    return i, j, vx / along, vy / along, vz / along


@kernel
def _try_face(digits, scale, pair, ids, error):
    """(verdict, points) from the plane of points 0, 1, 2 alone: most flush faces need no more.

    The plane separates, or its support point makes a tetrahedron around the origin; else UNDONE.
    """
    d = scale[0]
    length, zero = _set_normal(digits, d)
    if zero:
        return UNDONE, 3
    i, j, _, _, _ = _support_pair(digits, scale, pair, length, error)
    for k in range(3):
        if ids[2 * k] == i and ids[2 * k + 1] == j:
            return SEPARATE, 3  # nothing lies farther back than the plane itself
    _set_point(digits, scale, pair, 3, i, j)
    if _is_ahead(digits, d, length, 3):
        return SEPARATE, 3
    if _faces_that_part(digits, d) != 0:
        return UNDONE, 3
    ids[6] = i
    ids[7] = j
    return TOUCHING, 4


#: A vertex this near a plane, in units of the size, is level with it or the plane says nothing (`depth_of_plane`).
_AS_GOOD_AS_LEVEL = 2.0**-80


@kernel
def depth_of_plane(pair, terms, digits, ids, alone, lowest_a, lowest_b, reach_a, reach_b, size, error):
    """(proven, depth, low part) of cores that share a point, from three difference points on the nearest plane.

    ids : their vertex pairs.   alone : as `epa.refine` says.   Other arguments as in `touch_exactly`.

    No vertex lies beyond the plane. That is all where it passes through the origin: nothing is less than 0. Else all
    other planes must be farther, but for those that `epa.refine` could not tell from this one; of these it is shown
    that they are the same, since vertices as good as level with it are exactly level. The depth is then exact to
    EXACT_ERROR, however small it is.
    """
    if pair[1] * pair[7] <= 3:
        return True, 0.0, 0.0  # so few points span no volume
    pose_a = exact_pose(pair[13], pair[5], terms)
    pose_b = exact_pose(pair[13], pair[11], terms)
    scale = _scale(pose_a, pose_b, lowest_a, lowest_b, reach_a, reach_b, 0.0, 0.0, size)
    d, grid, rot_a, digits_rot_a, core_a, digits_a, rot_b, digits_rot_b, core_b, digits_b = scale
    if d > _LONGEST:
        return False, 0.0, 0.0
    _load(digits, scale, pose_a, pose_b)
    for k in range(3):
        _set_point(digits, scale, pair, k, ids[2 * k], ids[2 * k + 1])
    n, zero = _set_normal(digits, d)
    if not (zero or alone):
        return False, 0.0, 0.0
    square = _scratch_at(d, 0)
    clear(digits, square, 2 * n)
    for axis in range(3):
        add_product(digits, square, _direction_at(d, axis), n, _direction_at(d, axis), n, 1)
    if carry(digits, square, 2 * n) == 0:
        return False, 0.0, 0.0  # the three points are in line
    value, value_low, exponent = as_double_double(digits, square, 2 * n)
    odd = exponent & 1
    length, length_low = square_root(_ldexp(value, odd), _ldexp(value_low, odd))
    half = (exponent - odd) // 2
    height = _scratch_at(d, 0)
    _side_of(digits, d, n, 0)
    value, value_low, exponent = as_double_double(digits, height, n + d)
    depth, depth_low = divide(value, value_low, length, length_low)
    shift = exponent - half + BITS * grid
    for _ in range(2 if zero else 1):
        for axis in range(3):
            for k in range(n):
                digits[_direction_at(d, axis) + k] = -digits[_direction_at(d, axis) + k]
            carry(digits, _direction_at(d, axis), n)
        # Level within the body: |dip| · 2^(BITS·(rot + core)) of what `_compare` leaves, over the length.
        level = _ldexp(_AS_GOOD_AS_LEVEL * size * length, half)
        i, j, vx, vy, vz = _support_pair(digits, scale, pair, n, error)
        _set_point(digits, scale, pair, 3, i, j)
        for axis in range(3):
            add_number(digits, _point_at(d, 3, axis), _point_at(d, 0, axis), d, -1)
            carry(digits, _point_at(d, 3, axis), d)
        side = _side_of(digits, d, n, 3)
        if side == 0 and zero:
            return True, 0.0, 0.0
        if side == 0:
            slack = 2.0 * error
            (coords_a, n_a, m_a, _, _, p, coords_b, n_b, m_b, _, _, q, _, poses, _, _, _, _, _, _, _) = pair
            if _level_or_far(
                digits, d, n, coords_a, n_a, m_a, poses, p, 0, digits_rot_a, core_a, digits_a, vx, vy, vz, slack, 1.0, i,
                level, BITS * (rot_a + core_a),
            ) and _level_or_far(
                digits, d, n, coords_b, n_b, m_b, poses, q, 9, digits_rot_b, core_b, digits_b, vx, vy, vz, slack, -1.0, j,
                level, BITS * (rot_b + core_b),
            ):  # fmt: skip
                return True, _ldexp(depth, shift), _ldexp(depth_low, shift)
    return False, 0.0, 0.0


@kernel
def _level_or_far(
    digits, d, n, coordinates, count, m, poses, p, rotation, digits_rot, core, digits_core, vx, vy, vz, slack, sign,
    best, level, exponent,
):  # fmt: skip
    """Whether every vertex is exactly as far along the direction as the farthest one, or nearer by more than a level."""
    gx = sign * (poses[p] * vx + poses[p + 3] * vy + poses[p + 6] * vz)
    gy = sign * (poses[p + 1] * vx + poses[p + 4] * vy + poses[p + 7] * vz)
    gz = sign * (poses[p + 2] * vx + poses[p + 5] * vy + poses[p + 8] * vz)
    least = coordinates[best] * gx + coordinates[m + best] * gy + coordinates[2 * m + best] * gz
    _turn_direction(digits, d, n, rotation, digits_rot)
    for i in range(count):
        if i == best or coordinates[i] * gx + coordinates[m + i] * gy + coordinates[2 * m + i] * gz > least + slack:
            continue
        if _compare(digits, d, n + digits_rot, coordinates, m, core, digits_core, i, best) != 0:
            value, e = as_double(digits, _scratch_at(d, 2), n + digits_rot + digits_core)
            if abs(_ldexp(value, e + exponent)) < level:
                return False
    return True


@kernel
def _side_of(digits, d, length, k):
    """Sign of point k along the direction."""
    out = _scratch_at(d, 0)
    clear(digits, out, length + d)
    for axis in range(3):
        add_product(digits, out, _direction_at(d, axis), length, _point_at(d, k, axis), d, 1)
    return carry(digits, out, length + d)


@kernel
def _is_ahead(digits, d, length, k):
    """Whether point k, the last one against the direction, still lies along it: then all do."""
    return _side_of(digits, d, length, k) > 0


@kernel
def _faces_that_part(digits, d):
    """Which faces of points 0 … 3 through point 3 have the origin beyond them: bit k for the face across k.

    The origin is known to lie on the inner side of the face across point 3. All three inside proves
    that the tetrahedron holds the origin; it takes a quarter of the work of Johnson's determinants.
    7, saying nothing, where the four points are coplanar or the origin is on a face's plane.
    """
    beyond = 0
    edges = _scratch_at(d, 0)
    for k in range(3):
        for axis in range(3):
            at = edges + (3 * k + axis) * d
            clear(digits, at, d)
            add_number(digits, at, _point_at(d, k, axis), d, 1)
            add_number(digits, at, _point_at(d, 3, axis), d, -1)
            carry(digits, at, d)
    normal = _scratch_at(d, 1)
    height = _scratch_at(d, 2)
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
            add_product(digits, height, normal, 2 * d, _point_at(d, 3, axis), d, -1)  # the origin, seen from 3
            add_product(digits, height + 3 * d, normal, 2 * d, edges + (3 * k + axis) * d, d, 1)
        origin = carry(digits, height, 3 * d)
        across = carry(digits, height + 3 * d, 3 * d)
        if origin == 0 or across == 0:
            return 7
        if origin != across:
            beyond |= 1 << k
    return beyond


@kernel
def _compact(digits, d, ids, mask, n):
    """Keep the points of the subset, with their Gram entries, and set their Δ; returns their number."""
    kept = 0
    for k in range(n):
        if not (mask >> k) & 1:
            continue
        if kept != k:
            ids[2 * kept] = ids[2 * k]
            ids[2 * kept + 1] = ids[2 * k + 1]
            for c in range(3 * d):
                digits[_point_at(d, kept, 0) + c] = digits[_point_at(d, k, 0) + c]
        column = 0
        for j in range(n):
            if (mask >> j) & 1:
                for c in range(2 * d):
                    digits[_gram_at(d, kept, column) + c] = digits[_gram_at(d, k, j) + c]
                column += 1
        kept += 1
    if kept < n:
        for subset in range(1, 1 << kept):
            if subset & (subset - 1) == 0:
                digits[_delta_at(d, subset, _lowest_member(subset))] = 1
            for j in range(kept):
                if not (subset >> j) & 1:
                    _set_delta(digits, d, subset, j)
    return kept


@kernel
def _within_radius(digits, d, mask, grid, radius_a, radius_b):
    """(|v| ≤ r, |v| − r, low part) for the nearest point v of the subset and the sum r of the radii.

    |v|² = Σ Δ_i (y_i·y_k) / ΣΔ for any k of the subset, so the test is Σ Δ_i (y_i·y_k) ≤ r² ΣΔ.
    """
    k = _lowest_member(mask)
    n = _length(d, mask)
    total = _scratch_at(d, 0)
    square = _scratch_at(d, 1)
    clear(digits, total, n)
    clear(digits, square, n + 2 * d)
    for i in range(4):
        if (mask >> i) & 1:
            add_number(digits, total, _delta_at(d, mask, i), n, 1)
            add_product(digits, square, _delta_at(d, mask, i), n, _gram_at(d, i, k), 2 * d, 1)
    carry(digits, total, n)
    sign = carry(digits, square, n + 2 * d)
    over, over_low, over_exponent = as_double_double(digits, total, n)
    value, value_low, exponent = as_double_double(digits, square, n + 2 * d)
    scale = 2 * BITS * grid - over_exponent
    # The root before the power of two: the square of a tiny distance would vanish.
    half = (exponent + scale) // 2
    ratio, ratio_low = divide(value, value_low, over, over_low)
    rest = exponent + scale - 2 * half
    distance, distance_low = square_root(_ldexp(ratio, rest), _ldexp(ratio_low, rest))
    distance = _ldexp(distance, half)
    distance_low = _ldexp(distance_low, half)
    if radius_a == 0.0 and radius_b == 0.0:
        return sign == 0, distance, distance_low
    radius = _scratch_at(d, 2)
    clear(digits, radius, d)
    add_double(digits, radius, radius_a, grid)
    add_double(digits, radius, radius_b, grid)
    carry(digits, radius, d)
    power = _scratch_at(d, 3)
    clear(digits, power, 2 * d)
    add_product(digits, power, radius, d, radius, d, 1)
    carry(digits, power, 2 * d)
    add_product(digits, square, power, 2 * d, total, n, -1)
    sign = carry(digits, square, n + 2 * d)
    # |v| − r without cancellation, as (|v|² − r²) / (|v| + r).
    value, value_low, exponent = as_double_double(digits, square, n + 2 * d)
    swept, swept_low = two_sum(radius_a, radius_b)
    both, both_low = add(distance, distance_low, swept, swept_low)
    ratio, ratio_low = divide(value, value_low, over, over_low)
    shift = math.frexp(both)[1]
    ratio, ratio_low = divide(ratio, ratio_low, _ldexp(both, -shift), _ldexp(both_low, -shift))
    excess = _ldexp(ratio, exponent + scale - shift)
    if excess == 0.0 and sign != 0:  # vanished, but not 0
        excess = 5e-324 * sign
    return sign <= 0, excess, _ldexp(ratio_low, exponent + scale - shift)
