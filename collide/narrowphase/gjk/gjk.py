"""GJK: the point of A ⊖ B nearest the origin, with a lower bound from every support plane.

Gilbert, Johnson and Keerthi 1988; the duality-gap stop after van den Bergen 1999. It stops on a
repeated vertex, on a gap below rounding, or when the distance no longer decreases: thin shapes
would otherwise spin to the cap.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.narrowphase.gjk.grown_simplex import pick, with_newest
from collide.narrowphase.gjk.minkowski_difference import (
    POINT,
    copy_point,
    difference_point,
    has_trees,
    inlined_difference_point,
    listed_difference_point,
    place_vertices,
    settle_point,
)
from collide.narrowphase.gjk.simplex import across_simplex, faces_in_sight, nearest_of_all
from collide.narrowphase.posed_pair import reach_of_both

#: How a run ends. NEAREST: the nearest point is known and clear of rounding. MEETING: nearer than
#: rounding can tell, or no plane separates and no tetrahedron encloses provably. ENCLOSED: the origin lies in a
#: tetrahedron of A ⊖ B, clear of rounding. APART: proven farther apart than the limit.
NEAREST, MEETING, ENCLOSED, APART = range(4)

#: Bodies whose frames are nearer than this share of their reaches probably overlap.
_LIKELY = 0.9
#: Directions ask the same lists of support trees of n vertices that are within an angle whose sine squared is this / n.
_SAME_LISTS = 64.0
#: Of bodies with more than `_FEW` vertices, n of them, the vertex found first is surrounded by others in directions
#: `_TILT` / √n from it: far enough on a ball to meet its neighbours. It pays where the first direction is a good one: its
#: plane nearly parts the bodies (`_FAIR`), the point is not much farther off than the plane (`_FAR`), and those
#: directions reach as far aside as the origin lies.
_FEW = 32
_TILT = 3.0
_FAIR = 0.5
_FAR = 0.9


@kernel(inline=True)
def gjk(pair, points, ids, weights, given, touch_suffices, radius, limit, error, rounds):
    """Run GJK on the cores of a pair.

    points, ids : workspace for five difference points; the simplex found stands first.
    given : 3 if the last three ids name vertices to begin with, else 0.
    weights : 10 doubles. In, the last three: a direction from A to B to begin with, or zeros. Out: weights of the simplex, its nearest point v, and the unit axis (along v,
        from the simplex's own edges where v is too short to have a direction).
    touch_suffices : stop as soon as an overlap is proven (a boolean is asked).
    radius : sum of the swept radii.   limit : stop once proven farther apart than this.
    error : absolute error of a bound, from `bounds.py`.

    Returns
    -------
    status, number of simplex points, best lower bound of the core distance (before ``error``),
    clearance of the origin in the tetrahedron (ENCLOSED only), rounds used.
    """
    status, n, lower, clearance, used = _approach(
        pair, points, ids, weights, given, touch_suffices, radius, limit, error, rounds
    )
    if status != ENCLOSED and status != APART:
        length = math.sqrt(weights[4] * weights[4] + weights[5] * weights[5] + weights[6] * weights[6])
        if length - lower > 0.5 * error and not (touch_suffices and length + error <= radius):
            dx, dy, dz = across_simplex(points, n, weights[4], weights[5], weights[6])
            along = math.sqrt(dx * dx + dy * dy + dz * dz)
            if along > 0.0:
                difference_point(pair, points, ids, 4, -dx, -dy, -dz)
                if has_trees(pair):
                    settle_point(pair, points, ids, 4, -dx, -dy, -dz)
                refined = _height(points, 4, dx, dy, dz) / along
                if refined > lower:
                    lower = refined
                    weights[7] = dx / along
                    weights[8] = dy / along
                    weights[9] = dz / along
        # Where no plane separates, the run is open whatever made it stop.
        status = NEAREST if lower > error or (touch_suffices and length + error <= radius) else MEETING
    return status, n, lower, clearance, used


@kernel(inline=True)
def _direction(pair, weights):
    """(x, y, z, factor, whether it is the line between the frames' origins): where to look first.

    Times the factor, it is that line.
    """
    tx = weights[7]
    ty = weights[8]
    tz = weights[9]
    if tx == 0.0 and ty == 0.0 and tz == 0.0:
        tx = pair.t.x
        ty = pair.t.y
        tz = pair.t.z
    largest = max(abs(tx), abs(ty), abs(tz))
    between = largest > 0.0 and tx == pair.t.x and ty == pair.t.y and tz == pair.t.z
    if largest == 0.0:
        return 1.0, ty, tz, largest, False
    if 2.0**-400 < largest < 2.0**400:
        return tx, ty, tz, 1.0, between
    return tx / largest, ty / largest, tz / largest, largest, between  # squares would vanish or overflow


@kernel(inline=True)
def _set_parting(weights, tx, ty, tz, span, lower):
    """The nearest point, as far as a plane across the direction t, ``span`` long, tells; and the unit axis."""
    over = -1.0 / span
    weights[7] = tx * over
    weights[8] = ty * over
    weights[9] = tz * over
    weights[4] = weights[7] * lower
    weights[5] = weights[8] * lower
    weights[6] = weights[9] * lower


@kernel(inline=True)
def _approach(pair, points, ids, weights, given, touch_suffices, radius, limit, error, rounds):
    """The rounds of GJK; see `gjk` for arguments and results."""
    tx, ty, tz, largest, between = _direction(pair, weights)
    span = math.sqrt(tx * tx + ty * ty + tz * tz)
    # Coarse hulls that overlap are a proof, at a tenth of the price.
    coarse = pair.A.coarse_at != 0 or pair.B.coarse_at != 0
    look = False
    if between:
        # Balls about the origins of the bodies' frames: no support is asked.
        reach = reach_of_both(pair)
        lower = largest * span - reach
        if touch_suffices and lower - error - radius > limit:
            _set_parting(weights, tx, ty, tz, span, lower)
            return APART, 0, lower, 0.0, 0
        look = coarse and largest * span < _LIKELY * reach
    # Lists of the support trees in which the last vertices were found; −1 for a walk from above.
    listed_a, listed_b = inlined_difference_point(pair, points, ids, 0, tx, ty, tz, look, -1, -1)
    coarse = coarse and (look or touch_suffices)
    if look and _height(points, 0, tx, ty, tz) < 0.0:
        coarse = look = False
        listed_a, listed_b = difference_point(pair, points, ids, 0, tx, ty, tz)
    # The first support plane already parts most pairs that are farther apart than asked about.
    trees = has_trees(pair)
    lower = -_height(points, 0, tx, ty, tz) / span
    if look:
        lower = -math.inf  # a few points tell nothing of what lies beyond them
    elif trees:
        if lower - error - radius > limit:
            settle_point(pair, points, ids, 0, tx, ty, tz)
            lower = -_height(points, 0, tx, ty, tz) / span
        else:
            lower = -math.inf  # not proven
    if lower - error - radius > limit:
        _set_parting(weights, tx, ty, tz, span, lower)
        weights[0] = 1.0
        return APART, 1, lower, 0.0, 0
    n = 1
    weights[0] = 1.0
    for axis in range(3):
        weights[4 + axis] = points[axis]
    if given > 0:
        n = _begin_with_given(pair, points, ids, weights)
    tilt = _tilt(pair)
    if tilt > 0.0 and not look:
        height = -_height(points, 0, tx, ty, tz) / span  # of the plane through point 0 across t
        square = points[0] * points[0] + points[1] * points[1] + points[2] * points[2]
        shift = tilt * reach_of_both(pair)
        if -_FAIR * tilt * shift < height < _FAR * math.sqrt(square) and square - height * height < shift * shift:
            coarse = False
            n = _surround(pair, points, ids, weights, tx / span, ty / span, tz / span, height, tilt, listed_a, listed_b)
    # The simplex: points A, B, C in registers, of which n are there, and where they stand in memory.
    # It is loaded so once more, below: through a kernel for both, gaps at n = 512 took 2 to 4 % longer.
    at_a, at_b, at_c, at_d = 0, 1, 2, 3
    ax, ay, az = points[0], points[1], points[2]
    bx, by, bz = points[POINT], points[POINT + 1], points[POINT + 2]
    cx, cy, cz = points[2 * POINT], points[2 * POINT + 1], points[2 * POINT + 2]
    wa, wb, wc = weights[0], weights[1], weights[2]
    vx, vy, vz = weights[4], weights[5], weights[6]
    square = vx * vx + vy * vy + vz * vz
    status = NEAREST
    clearance = 0.0
    # Against u support trees were last walked from above. Within an angle of it only the lists are asked where that ended.
    ux = -tx
    uy = -ty
    uz = -tz
    squared_cosine = _of_same_lists(pair)
    used = 0
    while used < rounds:
        used += 1
        length = math.sqrt(square)
        if length <= error:
            status = MEETING
            break
        if touch_suffices and length + error <= radius:
            break
        if trees and not coarse:
            along = ux * vx + uy * vy + uz * vz
            if along <= 0.0 or along * along < squared_cosine * square * (ux * ux + uy * uy + uz * uz):
                listed_a = listed_b = -1
                ux, uy, uz = vx, vy, vz
        hasty = coarse or listed_a >= 0 or listed_b >= 0
        listed_a, listed_b = inlined_difference_point(
            pair, points, ids, at_d, -vx, -vy, -vz, coarse, listed_a, listed_b
        )
        bound = _height(points, at_d, vx, vy, vz) / length
        repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
        if hasty and _tells_no_more(coarse, length, bound, repeated, error, radius, limit):
            hasty = coarse = False
            ux, uy, uz = vx, vy, vz
            listed_a, listed_b = difference_point(pair, points, ids, at_d, -vx, -vy, -vz)
            bound = _height(points, at_d, vx, vy, vz) / length
            repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
        if trees and (
            bound - error - radius > limit or length - bound <= 0.125 * error or repeated or used == rounds
        ):
            settle_point(pair, points, ids, at_d, -vx, -vy, -vz)
            bound = _height(points, at_d, vx, vy, vz) / length
            repeated = _repeated(ids, n, at_a, at_b, at_c, at_d)
            lower = max(lower, bound)
        elif not trees and not coarse:
            lower = max(lower, bound)
        if lower - error - radius > limit:
            status = APART
            break
        if length - bound <= 0.125 * error or repeated:
            break
        dx = points[POINT * at_d]
        dy = points[POINT * at_d + 1]
        dz = points[POINT * at_d + 2]
        kept, turn, wd, wf, ws, x, y, z, closer = with_newest(
            n, ax, ay, az, bx, by, bz, cx, cy, cz, dx, dy, dz, error, 0.125 * error * length
        )
        if kept == 4:
            status = ENCLOSED
            clearance = wd
            break
        if kept == 0:
            at_a, at_b, at_c, at_d = _in_order(points, ids, n, at_a, at_b, at_c, at_d)
            faces = 15
            if n == 3:
                faces, clearance = faces_in_sight(points, error)
                if faces == 0:
                    status = ENCLOSED
                    break
            closer = nearest_of_all(points, n + 1, weights, faces)
            if closer < square:
                n = _drop_unused(points, ids, weights, n + 1)
                at_a, at_b, at_c, at_d = 0, 1, 2, 3
                ax, ay, az = points[0], points[1], points[2]
                bx, by, bz = points[POINT], points[POINT + 1], points[POINT + 2]
                cx, cy, cz = points[2 * POINT], points[2 * POINT + 1], points[2 * POINT + 2]
                wa, wb, wc = weights[0], weights[1], weights[2]
                vx, vy, vz = weights[4], weights[5], weights[6]
        elif closer < square:
            n = kept
            fx, fy, fz = pick(turn, ax, bx, cx), pick(turn, ay, by, cy), pick(turn, az, bz, cz)
            cx, cy, cz = pick(turn, bx, cx, ax), pick(turn, by, cy, ay), pick(turn, bz, cz, az)
            bx, by, bz = fx, fy, fz
            ax, ay, az = dx, dy, dz
            first = pick(turn, at_a, at_b, at_c)
            second = pick(turn, at_b, at_c, at_a)
            at_a, at_b, at_c, at_d = at_d, first, second, 6 - at_d - first - second
            wa, wb, wc = wd, wf, ws
            vx, vy, vz = x, y, z
        if not closer < square:
            if hasty and used < rounds:
                coarse = False
                ux = uy = uz = 0.0  # the next is asked of the whole bodies
                continue
            if trees:
                settle_point(pair, points, ids, at_d, -vx, -vy, -vz)
                lower = max(lower, _height(points, at_d, vx, vy, vz) / length)
            break
        square = closer
    if status == ENCLOSED:
        return ENCLOSED, 4, lower, clearance, used
    if not (touch_suffices and status == APART):  # of a miss nothing else is wanted
        _in_order(points, ids, n, at_a, at_b, at_c, at_d)
    weights[0] = wa
    weights[1] = wb if n > 1 else 0.0
    weights[2] = wc if n > 2 else 0.0
    weights[3] = 0.0
    weights[4] = vx
    weights[5] = vy
    weights[6] = vz
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    over = 1.0 / length if length > 0.0 else 0.0
    weights[7] = vx * over
    weights[8] = vy * over
    weights[9] = vz * over
    return status, n, lower, 0.0, used


@kernel(cold=True)
def _begin_with_given(pair, points, ids, weights):
    """Begin with the vertices that the last three ids name; returns how many of the points are kept.

    In `_approach` it comes after the first point, which is not needed then: a way around that made the rounds of all other
    pairs 5 % slower.
    """
    for k in range(3):
        place_vertices(pair, points, ids, k, ids[2 * k + 4], ids[2 * k + 5])
    nearest_of_all(points, 3, weights, 15)
    return _drop_unused(points, ids, weights, 3)


@kernel(inline=True)
def _tilt(pair):
    """How far to tilt a direction so that vertices around the one found are met; 0 for curved cores and few vertices."""
    n = min(pair.A.n, pair.B.n)
    return _TILT / math.sqrt(n) if n > _FEW and pair.A.kind == POINTS and pair.B.kind == POINTS else 0.0


@kernel(cold=True)
def _surround(pair, points, ids, weights, tx, ty, tz, height, tilt, listed_a, listed_b):
    """Add two points on either side of where the origin lies beside point 0; returns how many are kept.

    Between bodies that nearly touch, the direction from a vertex of one to a vertex of the other is hardly more than
    chance, and the next vertices found lie far off; half of all rounds went into coming back. A triangle of vertices
    around the origin's foot has the right direction at once: on balls 5 rounds are left of 11 at n = 512.

    t : the unit direction point 0 was found in.   height : of the plane across it.   listed_a, listed_b : the lists
        of support trees to look in.   weights : the simplex that is kept, and its point nearest the origin.
    """
    ux = points[0] + height * tx
    uy = points[1] + height * ty
    uz = points[2] + height * tz
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    over = tilt / length if length > 0.0 else 0.0
    ux *= over
    uy *= over
    uz *= over
    x = 0.75**0.5 * (ty * uz - tz * uy)
    y = 0.75**0.5 * (tz * ux - tx * uz)
    z = 0.75**0.5 * (tx * uy - ty * ux)
    tx -= 0.5 * ux
    ty -= 0.5 * uy
    tz -= 0.5 * uz
    listed_difference_point(pair, points, ids, 1, tx + x, ty + y, tz + z, listed_a, listed_b)
    n = 1 if _repeated(ids, 1, 0, 0, 0, 1) else 2
    listed_difference_point(pair, points, ids, n, tx - x, ty - y, tz - z, listed_a, listed_b)
    if not _repeated(ids, n, 0, 1, 1, n):
        n += 1
    nearest_of_all(points, n, weights, 15)
    return _drop_unused(points, ids, weights, n)


@kernel(inline=True)
def _of_same_lists(pair):
    """The squared cosine of that angle for a pair's support trees; 2, so that there is none, beside a curved core.

    A curved core never repeats a point. Runs would converge towards what lies in one list, and again in the next: some
    came to the last round.
    """
    if pair.A.kind != POINTS or pair.B.kind != POINTS:
        return 2.0
    n = max(pair.A.n if pair.A.tree != 0 else 64, pair.B.n if pair.B.tree != 0 else 64)
    return 1.0 - _SAME_LISTS / n


@kernel(inline=True)
def _tells_no_more(coarse, length, bound, repeated, error, radius, limit):
    """Whether a point found in haste is no good: the one that lies farthest is to be asked for."""
    if repeated:
        return True
    if coarse:
        return bound > 0.0
    return bound - error - radius > limit or length - bound <= 0.125 * error


@kernel(inline=True)
def _height(points, k, dx, dy, dz):
    """Point k along a direction."""
    return points[POINT * k] * dx + points[POINT * k + 1] * dy + points[POINT * k + 2] * dz


@kernel(inline=True)
def _repeated(ids, n, at_a, at_b, at_c, at_d):
    """Whether point D is one of the n others (curved cores have no ids and never repeat)."""
    i = ids[2 * at_d]
    j = ids[2 * at_d + 1]
    if i < 0 or j < 0:
        return False
    if ids[2 * at_a] == i and ids[2 * at_a + 1] == j:
        return True
    if n > 1 and ids[2 * at_b] == i and ids[2 * at_b + 1] == j:
        return True
    return n > 2 and ids[2 * at_c] == i and ids[2 * at_c + 1] == j


@kernel(cold=True)
def _in_order(points, ids, n, at_a, at_b, at_c, at_d):
    """Bring the n points A, B, C to the front, and D behind them; returns where all of them stand then."""
    if at_a != 0:
        _exchange_points(points, ids, 0, at_a)
        at_b = at_a if at_b == 0 else at_b
        at_c = at_a if at_c == 0 else at_c
        at_d = at_a if at_d == 0 else at_d
    if n > 1 and at_b != 1:
        _exchange_points(points, ids, 1, at_b)
        at_c = at_b if at_c == 1 else at_c
        at_d = at_b if at_d == 1 else at_d
    if n > 2 and at_c != 2:
        _exchange_points(points, ids, 2, at_c)
        at_d = at_c if at_d == 2 else at_d
    if at_d != n:
        _exchange_points(points, ids, n, at_d)
    return 0, 1 if n > 1 else 2, 2 if n > 2 else 3, n


@kernel(inline=True)
def _exchange_points(points, ids, k, j):
    for i in range(POINT):
        points[POINT * k + i], points[POINT * j + i] = points[POINT * j + i], points[POINT * k + i]
    for i in range(2):
        ids[2 * k + i], ids[2 * j + i] = ids[2 * j + i], ids[2 * k + i]


@kernel(inline=True)
def _drop_unused(points, ids, weights, n):
    """Keep the points with a positive weight; returns their number."""
    kept = 0
    for k in range(n):
        if weights[k] > 0.0:
            if kept != k:
                copy_point(points, ids, k, kept)
                weights[kept] = weights[k]
            kept += 1
    for k in range(kept, 4):
        weights[k] = 0.0
    return kept
