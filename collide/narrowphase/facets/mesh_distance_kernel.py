"""Rows of two bodies of facets at one pair of poses or at many, from matrices to rows inside a kernel.

Work left to Python (depths, directions of bodies all but touching, gaps too small for boxes of floats) is reported as
bits of what a row lacks, for `facet_kernel_calls.py` to complete.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, prepared, view_f64, view_i32, view_i64, view_u8
from collide.mesh.bvh import CENTRE, EXPONENT, INTS, REACH, open_tree
from collide.narrowphase import rows
from collide.narrowphase.facets import surface_distance
from collide.narrowphase.facets.mesh_collide_kernel import (
    APART,
    EXCHANGED,
    FARTHER,
    HEADER,
    HIT,
    OPEN,
    SAME_BODY,
    SINGULAR,
    PosedPair,
    are_poses,
    balls_farther_than,
    cores_state,
    crossing_of,
    gap_state,
    is_rigid,
    measure,
    numbers_of,
    open_pair,
    open_space,
    placed,
    result_of,
)
from collide.narrowphase.facets.posed_surfaces import is_swapped_order, put_in_world, shift_between
from collide.narrowphase.facets.surface_distance import FACET_A, FACET_B, IN_FULL, MARKS, RESULT
from collide.narrowphase.facets.triangle_distance import common_point, nearest_points
from collide.narrowphase.rows import ROW, blank_row, view_row
from collide.numerics.vec3 import Vec3, add, dot, put_vec3, scale, sub, vec3_at
from collide.results import EXACT, FORMULA, UNDECIDED

# What a row still lacks, as bits: the depth and points of bodies whose cores meet, or that only their radii make meet
# (or may); the direction of bodies that all but touch; the gap of bodies too far apart for boxes of floats; the sign of
# bodies without depths that their radii may make meet.
CORES_MEET, RADII_MEET, NEARLY_TOUCH, TOO_FAR, LEFT_OPEN = 1, 2, 4, 8, 16
#: A row that is none: a matrix is no pose, or singular. Above all bits.
ROW_NO_POSE, ROW_SINGULAR = 32, 64

#: Surfaces nearer than this share of the pair's size leave their direction to rounding.
NEARLY_TOUCHING = 2.0**-24
#: `certified` promises gaps in brackets no wider than this, in units of the pair's size.
PROMISE = 2.0**-43
#: The largest gap that boxes of floats can measure, in units of the smaller body's boxes.
FARTHEST = 1e20


@kernel(inline=True)
def _step(row_at, field, up):
    """Replace a positive number of a row by the next double above or below; 0 by the least positive double if ``up``;
    all other numbers by 0."""
    value = view_f64(row_at + 8 * field, 1)
    bits = view_i64(row_at + 8 * field, 1)
    if value[0] > 0.0:
        if value[0] < math.inf:
            bits[0] += 1 if up else -1
    elif up and value[0] == 0.0:
        bits[0] = 1
    else:
        value[0] = 0.0


@kernel(inline=True)
def _unit_or_z(v):
    """A vector of length 1; the z axis where there is no direction."""
    length = math.sqrt(dot(v, v))
    return Vec3(v.x / length, v.y / length, v.z / length) if length > 0.0 else Vec3(0.0, 0.0, 1.0)


@kernel(inline=True)
def _reach(numbers, radius):
    """How far a body reaches from its frame's origin [m]."""
    reach = vec3_at(numbers, REACH)
    return math.sqrt(dot(reach, reach)) + radius


@kernel
def _size(pair):
    """S of docs/conventions.md: reaches of both bodies from their frames' origins, and how far these are apart [m]."""
    XA = view_f64(pair.XA_at, 16)
    XB = view_f64(pair.XB_at, 16)
    across = Vec3(XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11])
    reaches = _reach(numbers_of(pair.A), pair.A.radius) + _reach(numbers_of(pair.B), pair.B.radius)
    return reaches + math.sqrt(dot(across, across))


@kernel(inline=True)
def _set_bracket(row_at, result, radius):
    """Lower and upper bound and distance of bodies, from those of their cores."""
    row = view_f64(row_at, 12)
    row[rows.LOWER] = result[surface_distance.LOWER] - radius
    row[rows.UPPER] = result[surface_distance.UPPER] - radius
    if radius > 0.0:
        _step(row_at, rows.LOWER, False)
        _step(row_at, rows.UPPER, True)
    row[rows.DISTANCE] = min(max(result[surface_distance.DISTANCE] - radius, row[rows.LOWER]), row[rows.UPPER])
    if row[rows.DISTANCE] == 0.0:  # apart, and nearer than the bracket is wide: 0 would say that they touch
        row[rows.DISTANCE] = row[rows.UPPER]


@kernel
def _write_gap(space, pair, limit, hull_at, exchanged, row_at):
    """Write the row of bodies whose cores are apart, from their distance in the scratch; returns what the row lacks.

    hull : 0, or the row of the bodies' hulls, A and B as they are asked about.   exchanged : the kernel works on A and
    B in the other order. Between facets all but touching rounding leaves many directions, and the pair found may be
    around the corner of two faces in contact: the normal comes from the hulls where they may be as far apart as the
    bodies.
    """
    result, marks = result_of(space)
    row, words, flags = blank_row(row_at)
    radius = pair.A.radius + pair.B.radius
    unseen = marks[FACET_A] < 0
    middle_a = placed(view_f64(pair.XA_at, 16), vec3_at(numbers_of(pair.A), CENTRE))
    middle_b = placed(view_f64(pair.XB_at, 16), vec3_at(numbers_of(pair.B), CENTRE))
    normal = vec3_at(result, surface_distance.NORMAL)
    if unseen or (normal.x == 0.0 and normal.y == 0.0 and normal.z == 0.0):
        normal = _unit_or_z(sub(middle_b, middle_a))
    size = _size(pair)
    _set_bracket(row_at, result, radius)
    near = not unseen and result[surface_distance.DISTANCE] <= NEARLY_TOUCHING * size
    lacks = NEARLY_TOUCH if near and hull_at == 0 else 0
    by_hulls = False
    if near and hull_at != 0:
        hull = view_f64(hull_at, 12)
        by_hulls = hull[rows.UPPER] + pair.A.radius + pair.B.radius >= result[surface_distance.LOWER]
        if by_hulls:
            normal = vec3_at(hull, rows.NORMAL)
            if exchanged:
                normal = sub(Vec3(0.0, 0.0, 0.0), normal)
    beyond = unseen or row[rows.LOWER] > limit
    narrow = row[rows.UPPER] <= row[rows.LOWER] + PROMISE * size
    flags[rows.CERTIFIED] = 1 if (narrow or beyond) and (row[rows.LOWER] > 0.0 or radius == 0.0) else 0
    flags[rows.BEYOND] = 1 if beyond else 0
    put_vec3(row, rows.NORMAL, add(normal, Vec3(0.0, 0.0, 0.0)))  # never −0.0
    if unseen:
        lacks |= _write_unseen(pair, limit, normal, middle_a, middle_b, row_at)
    else:
        _write_points(pair, result, normal, by_hulls, row)
    if beyond:
        row[rows.DISTANCE] = row[rows.LOWER]
        row[rows.UPPER] = math.inf
    words[rows.PART_A] = max(marks[FACET_A], 0)
    words[rows.PART_B] = max(marks[FACET_B], 0)
    flags[rows.EXACT_ROUNDS] = min(marks[surface_distance.EXACT], 255)
    return lacks


@kernel
def _write_points(pair, result, normal, by_hulls, row):
    """Write witness points as far apart as the row's distance; by_hulls: the normal comes from the hulls."""
    point_a = add(vec3_at(result, surface_distance.POINT_A), scale(pair.A.radius, normal))
    point_b = sub(vec3_at(result, surface_distance.POINT_B), scale(pair.B.radius, normal))
    if by_hulls:  # lay the points as far apart along it, about their middle
        missing = scale(0.5, sub(scale(row[rows.DISTANCE], normal), sub(point_b, point_a)))
        point_a = sub(point_a, missing)
        point_b = add(point_b, missing)
    put_vec3(row, rows.POINT_A, point_a)
    put_vec3(row, rows.POINT_B, point_b)


@kernel
def _write_unseen(pair, limit, normal, middle_a, middle_b, row_at):
    """Lower bound and points of bodies beyond the limit, halfway between their middles; returns what the row lacks."""
    row = view_f64(row_at, 12)
    row[rows.LOWER] = limit if limit < math.inf else 0.0
    if limit < math.inf:
        _step(row_at, rows.LOWER, True)
    middle = scale(0.5, add(middle_a, middle_b))
    half = scale(0.5 * row[rows.LOWER], normal)
    put_vec3(row, rows.POINT_A, sub(middle, half))
    put_vec3(row, rows.POINT_B, add(middle, half))
    exponent = min(view_i64(pair.A.tree_at, INTS)[EXPONENT], view_i64(pair.B.tree_at, INTS)[EXPONENT])
    return TOO_FAR if limit > FARTHEST * math.ldexp(1.0, int(exponent)) else 0


@kernel
def _write_row(space, pair, limit, reach, depths, hull_at, exchanged, row_at):
    """Write the row of two bodies, A and B as worked on; returns what the row lacks.

    reach : how far cores are looked for, above the limit and the radii [m].   depths : whether depths of overlaps are
    wanted.   hull, exchanged : as of `_write_gap`.
    """
    radius = pair.A.radius + pair.B.radius
    if balls_farther_than(pair, reach):
        _set_unseen(space, reach)
    else:
        row, _, _ = blank_row(row_at)
        row[rows.POINT_A] = math.nan
        state = cores_state(space, pair, row_at + 8 * rows.POINT_A)
        if state == SINGULAR or (state == APART and not measure(space, pair, reach, IN_FULL)):
            return ROW_SINGULAR
        if state == HIT:
            return _write_core_hit(space, pair, depths, row_at)
    lacks = _write_gap(space, pair, limit, hull_at, exchanged, row_at)
    state = gap_state(space, radius)
    if state == OPEN:  # a search no farther than the radii may have a bracket that is narrow enough
        measure(space, pair, radius * FARTHER, IN_FULL)
        state = APART if gap_state(space, radius) == APART else OPEN
    _, _, flags = view_row(row_at)
    flags[rows.HOW] = UNDECIDED if state == OPEN else FORMULA
    if state == APART:
        return lacks
    flags[rows.HIT] = 1
    if depths or lacks != 0:
        return lacks | RADII_MEET
    _forget_gap(row_at, state == HIT)
    return 0 if state == HIT else LEFT_OPEN


@kernel
def _set_unseen(space, reach):
    """Make the scratch the traversal's result for surfaces farther apart than ``reach`` [m]."""
    result, marks = result_of(space)
    for i in range(RESULT):
        result[i] = 0.0
    for i in range(MARKS):
        marks[i] = 0
    marks[FACET_A] = marks[FACET_B] = -1
    result[surface_distance.DISTANCE] = result[surface_distance.LOWER] = reach
    result[surface_distance.UPPER] = math.inf


@kernel
def _write_core_hit(space, pair, depths, row_at):
    """Write the row of bodies whose cores meet, at a common point; returns what the row lacks.

    The row's point A is in both bodies where a part of either lies inside the other, NaN where surfaces meet.
    """
    row, words, flags = view_row(row_at)
    flags[rows.HIT] = 1
    flags[rows.HOW] = EXACT
    if math.isnan(row[rows.POINT_A]):
        words[rows.PART_A], words[rows.PART_B] = _put_crossing(space, pair, row)
    put_vec3(row, rows.POINT_B, vec3_at(row, rows.POINT_A))
    flags[rows.CERTIFIED] = 1
    return CORES_MEET if depths else 0


@kernel
def _put_crossing(space, pair, row):
    """Write a common point of the two crossing facets found by `cores_state`; returns the numbers of the facets.

    Triangles are placed as by `surface_distance.py`: in the world's axes, with A's origin as theirs.
    """
    a, b = crossing_of(space)
    A, B = open_tree(pair.A.tree_at), open_tree(pair.B.tree_at)
    XA, XB = view_f64(pair.XA_at, 16), view_f64(pair.XB_at, 16)
    T, points = view_f64(space.doubles_at, 18), view_f64(space.doubles_at + 8 * 18, 6)
    put_in_world(XA, Vec3(0.0, 0.0, 0.0), A.triangles, 9 * a, T, 0)
    put_in_world(XB, shift_between(XA, XB), B.triangles, 9 * b, T, 9)
    length, _ = nearest_points(T, points)
    common_point(T, length, points)
    middle = add(scale(0.5, vec3_at(points, 0)), scale(0.5, vec3_at(points, 3)))
    put_vec3(row, rows.POINT_A, add(middle, Vec3(XA[3], XA[7], XA[11])))
    return int(A.ids[a]), int(B.ids[b])


@kernel
def _forget_gap(row_at, proven):
    """Bodies that meet because of their radii, or may meet: the row becomes an overlap of unknown depth, at distance 0.

    Both points become the middle between the cores.   proven : they do meet.
    """
    row, _, flags = view_row(row_at)
    middle = scale(0.5, add(vec3_at(row, rows.POINT_A), vec3_at(row, rows.POINT_B)))
    put_vec3(row, rows.POINT_A, middle)
    put_vec3(row, rows.POINT_B, middle)
    put_vec3(row, rows.NORMAL, Vec3(0.0, 0.0, 0.0))
    row[rows.DISTANCE] = 0.0
    row[rows.LOWER] = 0.0
    row[rows.UPPER] = 0.0 if proven else max(row[rows.UPPER], 0.0)
    flags[rows.BEYOND] = 0
    flags[rows.CERTIFIED] = 1 if proven else 0


@kernel
def _exchange(row_at):
    """Make a row that of the same bodies in the other order (`results.flipped`)."""
    row, words, _ = view_row(row_at)
    normal = vec3_at(row, rows.NORMAL)
    point = vec3_at(row, rows.POINT_A)
    part = words[rows.PART_A]
    put_vec3(row, rows.NORMAL, sub(Vec3(0.0, 0.0, 0.0), normal))
    put_vec3(row, rows.POINT_A, vec3_at(row, rows.POINT_B))
    put_vec3(row, rows.POINT_B, point)
    words[rows.PART_A] = words[rows.PART_B]
    words[rows.PART_B] = part


@kernel
def _row_at_poses(header_at, space, XA_at, XB_at, limit, reach, depths, hull_at, row_at):
    """Write a row of the bodies as they are asked about; returns what the row lacks.

    Bodies are worked on in the order of their contents, equal bodies in the order of their poses, so swapped questions
    give the same numbers.
    """
    words = view_i64(header_at, HEADER)
    exchanged = words[EXCHANGED] != 0
    pair = open_pair(header_at, XA_at, XB_at, exchanged)
    if words[SAME_BODY] != 0 and is_swapped_order(view_f64(pair.XA_at, 12), view_f64(pair.XB_at, 12)):
        pair = PosedPair(pair.B, pair.A, pair.XB_at, pair.XA_at, pair.same_tree)
        exchanged = not exchanged
    lacks = _write_row(space, pair, limit, reach, depths, hull_at, exchanged, row_at)
    if exchanged and lacks != ROW_SINGULAR:
        _exchange(row_at)
    return lacks


@entry(prepared.ROW, nogil=False)
def gap_single(header_at, XA_at, XB_at, row_at, depths, _unlimited):
    """1 with the row of PAIR_DTYPE, zeroed before, of bodies that are apart or without depths; −1: the long way is
    taken."""
    if not (is_rigid(XA_at, True) and is_rigid(XB_at, True)):
        return -1
    view_i32(row_at, ROW // 4)[rows.BODY_B] = 1
    lacks = _row_at_poses(header_at, open_space(header_at), XA_at, XB_at, math.inf, math.inf, depths, 0, row_at)
    _, _, flags = view_row(row_at)
    return -1 if lacks != 0 or flags[rows.HOW] == UNDECIDED else 1


@entry("int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, float64, boolean, int64, int64, "
"int64)")
def gap_poses(
    header_at, XA_at, step_a, XB_at, step_b, first, n, check, limit, reach, depths, hulls_at, rows_at, lacks_at
):
    """Rows of bodies at poses ``first`` … n − 1; returns n, or the first pose without a row, told by ``lacks``.

    XA, XB, check : as of `meet_poses`.   limit : beyond the limit only a lower bound is wanted [m].   reach : how far
    cores are looked for: next above the limit and the radii [m].   depths : whether depths of overlaps are wanted.
    hulls : 0, or rows of the bodies' hulls, for directions.   rows : of PAIR_DTYPE, zeroed.
    lacks : n + 1 bytes, zeroed: bits of what a row lacks, or ROW_NO_POSE, ROW_SINGULAR; last what any row lacks.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    space = open_space(header_at)
    lacks = view_u8(lacks_at, n + 1)
    for k in range(first, n):
        if not are_poses(XA_at, step_a, XB_at, step_b, k, first, check):
            lacks[k] = ROW_NO_POSE
            return k
        hull_at = hulls_at + ROW * k if hulls_at != 0 else 0
        lacks[k] = _row_at_poses(
            header_at, space, XA_at + 8 * step_a * k, XB_at + 8 * step_b * k, limit, reach, depths, hull_at,
            rows_at + ROW * k,
        )
        if lacks[k] == ROW_SINGULAR:
            return k
        lacks[n] |= lacks[k]
    return n
