"""Casts against the facets of a mesh: of a convex set, or of another mesh's facets, along two box-trees.

A moved box meets another box where a ray meets the box of their summed extents (`broadphase/boxes_ahead.py`), here in
the frame and the units of B's tree. Pairs of boxes are opened nearest first; a pair of facets, or a facet and the
convex set, is a cast of convex sets (`portal.py`). A proven contact bounds how far later boxes are opened (van den
Bergen 2004). A facet across the axes is far smaller than its box: extents are compared along the facet's normal and
across its edges, too. A convex set is far smaller than its box as well: along the normals of the casts so far, boxes
and facets are compared with the set's own extent.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.broadphase.boxes_ahead import slab_entry
from collide.casts.cast_pairs import CAST_ROW, LOWER, NORMAL, QUESTION, SIZE, STATUS, TOUCHING, UPPER, VALUE
from collide.casts.portal import BEHIND, HIT, MISS, OPEN, cast_line
from collide.casts.silhouette import CAST_DOUBLES, CAST_INTEGERS, open_cast
from collide.curved.shape_kinds import POINTS
from collide.kernels import entry, kernel, view_f64, view_i64
from collide.lowering.shape_table import INTS, NUMBERS, POSE, POSE_SLOP, RADIUS, REACH
from collide.mesh.bvh import CENTRE, EXPONENT, NODE, WIDTH, Box, box_at, link_of, open_tree
from collide.mesh.bvh import REACH as TREE_REACH
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.gjk.minkowski_difference import POINT_OF_A, difference_point
from collide.narrowphase.posed_pair import PosedBody, PosedPair, posed_body, stretch_of_pose
from collide.numerics.matrix3 import Matrix3, apply
from collide.numerics.vec3 import (
    Vec3,
    absolute,
    add,
    cross,
    dot,
    max_abs,
    neg,
    norm,
    norm1,
    put_vec3,
    rotate,
    rotate_back,
    scale,
    sub,
    vec3_at,
)

#: Boxes or pairs of them that may wait.
STACK = 4096
#: Doubles of workspace: of a cast, two poses, the corners of two facets, and keys of what waits; integers: of a cast,
#: and what waits.
#: Along so many vectors it is kept how far the convex set reaches, FRONT doubles each, behind their number: the
#: direction, and normals of casts.
FRONTS = 12
FRONT = 5
TREE_CAST_DOUBLES = CAST_DOUBLES + 2 * POSE + 48 + STACK + FRONT * FRONTS + 1
TREE_CAST_INTEGERS = CAST_INTEGERS + STACK
#: Doubles of a candidate: a row of `cast_pairs.py`, the facets of A (−1 of a convex set) and of B, and the question.
CANDIDATE = CAST_ROW + 3
FACET_A, FACET_B, OF_QUESTION = CAST_ROW, CAST_ROW + 1, CAST_ROW + 2

# Integers of a header: addresses of the addresses of A's trees, one a question (0 for convex sets), of B's tree, of the
# shape table, poses of A and of B and from one question to the next, questions, candidates, how many of them there is
# room for, the row of the table that is A in each question, the cast that each is a question of, and the largest t of
# interest in each cast, in and out.
(
    TREES_A, TREE_B, INTS_AT, NUMBERS_AT, POSES_A, POSES_B, STEP_A, STEP_B, QUESTIONS_AT, CANDIDATES_AT, CAPACITY,
    SHAPE_OF_AT, CAST_OF_AT, BEST_AT,
) = range(14)
HEADER = 14
_LOW = 0xFFFFFFFF
#: In the count of candidates.
CASTS = 1
#: A normal is kept where the step along it is at least so much of what it could be: rounding then moves t by less than
#: 2⁻³⁸ of it.
_STEEP = 2.0**-10
#: Of products that a vector across a facet is used in: far above what underflows.
_LEAST = 1e-200


class _Sweep(NamedTuple):
    """A question, as the walk along the trees reads the numbers.

    pair : both sides; a side of facets has the corners of the facet asked.   d : the direction.
    error, size : of a cast.
    In B's frame, in units of its tree and from its centre: middle, half : the box of A, where A is a convex set.
    step, inverse : the direction, and the inverses of its components.
    rotation : from A's tree to B's, or from W's axes.
    shift : where the centre of A's tree is, or the origin of the convex set.   pad : widening of boxes.
    """

    pair: Any
    d: Vec3
    error: float
    size: float
    middle: Vec3
    half: Vec3
    step: Vec3
    inverse: Vec3
    rotation: Matrix3
    shift: Vec3
    pad: float


class _Work(NamedTuple):
    """Workspace: corners of two facets, what waits with its keys, fronts of A, addresses of what a cast needs."""

    corners: Any
    stack: Any
    keys: Any
    fronts: Any
    doubles_at: int
    integers_at: int


@kernel(inline=True)
def _inverse_rows(R, at):
    """Rows of R⁻¹."""
    a, b, c = vec3_at(R, at), vec3_at(R, at + 3), vec3_at(R, at + 6)
    p, q, r = cross(b, c), cross(c, a), cross(a, b)
    share = 1.0 / dot(a, p)
    return Matrix3(
        scale(share, Vec3(p.x, q.x, r.x)), scale(share, Vec3(p.y, q.y, r.y)), scale(share, Vec3(p.z, q.z, r.z))
    )


@kernel(inline=True)
def _extent_along(pair, v, radius, points, ids):
    """How far A reaches along v in W's axes, from its own origin."""
    difference_point(pair, points, ids, 0, v)
    return dot(vec3_at(points, POINT_OF_A), v) + radius * norm(v)


@kernel(inline=True)
def _facet_body(corners):
    """A `PosedBody` over the corners of a facet: eight columns, five of them copies."""
    return PosedBody(corners, 3, 8, POINTS, 0, 0, 0, 0, 0)


@kernel(inline=True)
def _put_corners(corners, at, triangles, facet):
    for axis in range(3):
        for k in range(8):
            corners[at + 8 * axis + k] = triangles[9 * facet + 3 * (k if k < 3 else 0) + axis]


@kernel
def _posed_pair(header, k, poses, corners_at):
    """Both sides at the poses of question k, copied to ``poses``."""
    of_a = view_f64(header[POSES_A] + 8 * header[STEP_A] * k, POSE)
    of_b = view_f64(header[POSES_B] + 8 * header[STEP_B] * k, POSE)
    for i in range(POSE):
        poses[i] = of_a[i]
        poses[POSE + i] = of_b[i]
    shape = view_i64(header[SHAPE_OF_AT], k + 1)[k]
    ints, numbers = view_i64(header[INTS_AT], INTS * (shape + 1)), view_f64(header[NUMBERS_AT], NUMBERS * (shape + 1))
    A = posed_body(ints, shape, 0)
    if header[TREES_A] != 0:
        A = _facet_body(view_f64(corners_at, 24))
    B = _facet_body(view_f64(corners_at + 8 * 24, 24))
    B = PosedBody(B.coords, 3, 8, POINTS, 0, 0, POSE, 0, 0)
    t = sub(vec3_at(poses, POSE + 9), vec3_at(poses, 9))
    return PosedPair(A, B, numbers, poses, t)


@kernel
def _sweep_of(header, k, a, b, pair, doubles_at, integers_at):
    """The `_Sweep` of question k.   a, b : both trees; b twice where A is none."""
    numbers, poses = pair.numbers, pair.poses
    is_convex = header[TREES_A] == 0
    at = NUMBERS * view_i64(header[SHAPE_OF_AT], k + 1)[k]
    reach_a = numbers[at + REACH] if is_convex else norm(vec3_at(a.numbers, TREE_REACH))
    radius = numbers[at + RADIUS] if is_convex else 0.0
    reach_a = reach_a * stretch_of_pose(poses, 0) + radius
    reach_b = norm(vec3_at(b.numbers, TREE_REACH)) * stretch_of_pose(poses, POSE)
    size = reach_a + reach_b + norm(pair.t)
    error = ERROR * size + poses[POSE_SLOP] + poses[POSE + POSE_SLOP]
    unit = math.ldexp(1.0, int(-b.header[EXPONENT]))
    inverse = _inverse_rows(poses, POSE)
    rows = Matrix3(scale(unit, inverse.x), scale(unit, inverse.y), scale(unit, inverse.z))
    centre = scale(unit, vec3_at(b.numbers, CENTRE))
    origin = sub(apply(rows, neg(pair.t)), centre)
    d = vec3_at(view_f64(header[QUESTIONS_AT] + 8 * QUESTION * k, QUESTION), 0)
    middle, half, shift, rotation = origin, Vec3(0.0, 0.0, 0.0), origin, rows
    if is_convex:
        points, ids = view_f64(doubles_at, 9), view_i64(integers_at, 2)
        high = Vec3(
            _extent_along(pair, rows.x, radius, points, ids), _extent_along(pair, rows.y, radius, points, ids),
            _extent_along(pair, rows.z, radius, points, ids),
        )
        low = Vec3(
            -_extent_along(pair, neg(rows.x), radius, points, ids),
            -_extent_along(pair, neg(rows.y), radius, points, ids),
            -_extent_along(pair, neg(rows.z), radius, points, ids),
        )
        middle = add(origin, scale(0.5, add(low, high)))
        half = scale(0.5, sub(high, low))
    else:
        # x ↦ rows R_A (centre + 2^e x): coordinates of A's tree in those of B's.
        columns = Matrix3(
            Vec3(poses[0], poses[3], poses[6]), Vec3(poses[1], poses[4], poses[7]), Vec3(poses[2], poses[5], poses[8])
        )
        x, y, z = apply(rows, columns.x), apply(rows, columns.y), apply(rows, columns.z)
        of_a = math.ldexp(1.0, int(a.header[EXPONENT]))
        rotation = Matrix3(
            scale(of_a, Vec3(x.x, y.x, z.x)), scale(of_a, Vec3(x.y, y.y, z.y)), scale(of_a, Vec3(x.z, y.z, z.z))
        )
        shift = add(origin, apply(rows, rotate(poses, 0, vec3_at(a.numbers, CENTRE))))
    widest = max(norm(rows.x), norm(rows.y), norm(rows.z))
    pad = 4.0 * widest * (error + 2.0**-44 * size) + 2.0**-44 * (norm(origin) + norm(centre) + 1.0)
    step = apply(rows, d)
    inverse = Vec3(_inverted(step.x, step), _inverted(step.y, step), _inverted(step.z, step))
    return _Sweep(pair, d, error, size, middle, half, step, inverse, rotation, shift, pad)


@kernel(inline=True)
def _inverted(x, step):
    """1 / x; infinite where the component of a step is 0 but for rounding: ``pad`` holds what it moves."""
    return 1.0 / x if abs(x) > 2.0**-48 * max_abs(step) else math.inf


@kernel(inline=True)
def _box_of_a(sweep, a, ref_a, has_tree_a):
    """The box of A behind a reference, or of the convex set, in B's frame."""
    middle, half = sweep.middle, sweep.half
    if has_tree_a:
        of_a = box_at(a, ref_a)
        rotation = sweep.rotation
        middle = add(sweep.shift, apply(rotation, of_a.centre))
        half = Vec3(
            dot(absolute(rotation.x), of_a.half), dot(absolute(rotation.y), of_a.half),
            dot(absolute(rotation.z), of_a.half),
        )
    return Box(middle, half)


@kernel
def _keep_front(sweep, work, n, radius, at):
    """Keep how far a convex set A reaches along n, in W's axes, in front number ``at``; later ones replace the oldest
    but for the first.

    In coordinates of B's tree n is m = 2⁻ᵉ R_Bᵀ n up to its length; any vector serves. A is within m · y ≤ h, where it
    stands, and within m · y ≤ h + t (m · step), moved: what is beyond has no contact before
    t = (m · y − h) / (m · step).
    """
    poses, rows = sweep.pair.poses, sweep.rotation
    m = rotate_back(poses, POSE, n)
    along = dot(m, sweep.step)
    if not along > _STEEP * norm1(m) * max_abs(sweep.step):
        return at
    v = add(add(scale(m.x, rows.x), scale(m.y, rows.y)), scale(m.z, rows.z))
    points, ids = view_f64(work.doubles_at, 9), view_i64(work.integers_at, 2)
    h = _extent_along(sweep.pair, v, radius, points, ids) + dot(m, sweep.shift)
    slot = at if at < FRONTS else 1 + (at - 1) % (FRONTS - 1)
    put_vec3(work.fronts, FRONT * slot + 1, m)
    work.fronts[FRONT * slot + 4] = h
    work.fronts[FRONT * slot + 5] = 1.0 / along
    work.fronts[0] = float(min(at + 1, FRONTS))
    return at + 1


@kernel(inline=True)
def _front_entry(sweep, fronts, centre, u, v, half):
    """t before which A has no contact with the sums of a triangle centre, centre + u, centre + v and a box, by fronts.

    Rounding moves y by the pad, as of `_entry_of`, and h by 2⁻⁴⁴ of itself; t by 2⁻³⁸ (`_STEEP`).
    """
    first = 0.0
    pad = sweep.pad + 2.0**-40 * (norm1(centre) + norm1(u) + norm1(v) + norm1(half))
    for k in range(int(fronts[0])):
        m, h = vec3_at(fronts, FRONT * k + 1), fronts[FRONT * k + 4]
        low = dot(m, centre) + min(0.0, min(dot(m, u), dot(m, v))) - dot(absolute(m), half)
        t = (low - h - norm1(m) * pad - 2.0**-44 * abs(h)) * fronts[FRONT * k + 5]
        first = max(first, t * (1.0 - 2.0**-38))
    return first


@kernel(inline=True)
def _box_entry(sweep, work, box):
    """`_front_entry` of a box."""
    zero = Vec3(0.0, 0.0, 0.0)
    return _front_entry(sweep, work.fronts, box.centre, zero, zero, box.half)


@kernel(inline=True)
def _entry_of(sweep, a, b, ref_a, ref_b, has_tree_a, best):
    """Lower bound of the t at which the box of A behind a reference meets the box of B; infinite beyond ``best``."""
    box = box_at(b, ref_b)
    of_a = _box_of_a(sweep, a, ref_a, has_tree_a)
    gap = sub(box.centre, of_a.centre)
    wide = add(box.half, of_a.half)
    pad = sweep.pad + 2.0**-40 * (abs(gap.x) + abs(gap.y) + abs(gap.z))
    first, last = slab_entry(gap.x - wide.x - pad, gap.x + wide.x + pad, sweep.inverse.x, 0.0, best)
    first, last = slab_entry(gap.y - wide.y - pad, gap.y + wide.y + pad, sweep.inverse.y, first, last)
    first, last = slab_entry(gap.z - wide.z - pad, gap.z + wide.z + pad, sweep.inverse.z, first, last)
    return first if first <= last else math.inf


@kernel(inline=True)
def _unit_of(tree):
    return math.ldexp(1.0, int(-tree.header[EXPONENT]))


@kernel(inline=True)
def _corner_in(sweep, tree, facet, k, is_of_a, unit):
    """A corner of a facet of A's tree, or of B's, in B's frame.   unit : 2⁻ᵉ of its tree."""
    corner = scale(unit, sub(vec3_at(tree.triangles, 9 * facet + 3 * k), vec3_at(tree.numbers, CENTRE)))
    return add(sweep.shift, apply(sweep.rotation, corner)) if is_of_a else corner


@kernel
def _facet_entry(sweep, tree, facet, is_of_a, unit, box, best):
    """t at which a facet and the other body's box come to each other along the facet's normal, and across the step and
    each edge, where they pass each other if ever; from below, infinite for later than ``best``."""
    p = _corner_in(sweep, tree, facet, 0, is_of_a, unit)
    u = sub(_corner_in(sweep, tree, facet, 1, is_of_a, unit), p)
    v = sub(_corner_in(sweep, tree, facet, 2, is_of_a, unit), p)
    step = sweep.step if is_of_a else neg(sweep.step)  # of the facet, the box standing still
    gap = sub(box.centre, p)
    pad = sweep.pad + 2.0**-40 * (norm1(gap) + norm1(u) + norm1(v) + norm1(box.half))
    first, last = _entry_along(cross(u, v), u, v, gap, box.half, step, pad, 0.0, best)
    first, last = _entry_along(cross(step, u), u, v, gap, box.half, step, pad, first, last)
    first, last = _entry_along(cross(step, v), u, v, gap, box.half, step, pad, first, last)
    first, last = _entry_along(cross(step, sub(v, u)), u, v, gap, box.half, step, pad, first, last)
    return first if first <= last else math.inf


@kernel(inline=True)
def _entry_along(n, u, v, gap, half, step, pad, first, last):
    """(first, last): the part of [first, last] in which the extents along n of a moved facet 0, u, v and of a box at
    ``gap`` overlap.

    Bodies are apart while their extents along any vector are: rounding of n itself takes nothing from the bound.
    Rounding moves points by the pad: by at most n's 1-norm times the pad along n. A step along n of 0 but for rounding
    moves less than this until the boxes have passed each other. Vectors whose products leave the range of doubles say
    nothing.
    """
    length = norm1(n)
    widening, weight = length * pad, length * max_abs(step)
    if not (length > _LEAST and weight > _LEAST and widening < 1.0 / _LEAST):
        return first, last
    along_u, along_v, across = dot(n, u), dot(n, v), dot(n, gap)
    low, high = min(0.0, min(along_u, along_v)), max(0.0, max(along_u, along_v))
    wide = dot(absolute(n), half) + widening
    along = dot(n, step)
    inverse = 1.0 / along if abs(along) > 2.0**-46 * weight else math.inf
    return slab_entry(across - high - wide, across - low + wide, inverse, first, last)


@kernel
def _leaf_entry(sweep, tree, run, is_of_a, unit, box, best):
    """The least `_facet_entry` of a leaf's facets."""
    least = math.inf
    for i in range(run & 7):
        least = min(least, _facet_entry(sweep, tree, (run >> 3) + i, is_of_a, unit, box, best))
    return least


@kernel
def _cast_facets(sweep, work, radius, limit, best, row):
    """Write the row of what the pair holds now; the largest t that is still of interest afterwards, at first ``best``.

    The bodies are known to be apart at the start.
    """
    cast = open_cast(
        sweep.pair, sweep.d, radius, 0.0, sweep.error, sweep.size, work.doubles_at, work.integers_at
    )
    met = cast_line(cast, limit, False)
    status = met.status
    if met.lower > best:
        status = MISS
    elif status == BEHIND:
        status = MISS if met.upper <= 0.0 else OPEN
    row[STATUS] = status
    row[LOWER] = max(met.lower, 0.0)
    row[VALUE] = max(met.value, 0.0)
    row[UPPER] = met.upper
    row[SIZE] = sweep.size / cast.length
    put_vec3(row, NORMAL, met.normal)
    put_vec3(row, TOUCHING, add(met.point, vec3_at(sweep.pair.poses, POSE + 9)))
    return min(best, met.upper) if status == HIT else best


@kernel(inline=True)
def _is_before(sweep, work, b, facet, unit, best):
    """Whether A may meet a facet of B before ``best``, by its fronts."""
    p = _corner_in(sweep, b, facet, 0, False, unit)
    u, v = sub(_corner_in(sweep, b, facet, 1, False, unit), p), sub(_corner_in(sweep, b, facet, 2, False, unit), p)
    return _front_entry(sweep, work.fronts, p, u, v, Vec3(0.0, 0.0, 0.0)) <= best


@kernel(inline=True)
def _push(work, top, base, word, key):
    """Put a word onto the stack, which from ``base`` on stays in order, the nearest on top."""
    at = top
    while at > base and work.keys[at - 1] < key:
        work.keys[at] = work.keys[at - 1]
        work.stack[at] = work.stack[at - 1]
        at -= 1
    work.keys[at] = key
    work.stack[at] = word


@kernel
def _open_pair(sweep, work, a, b, ref_a, ref_b, has_tree_a, best, top):
    """Push the children of the larger box of a pair; the stack's new height."""
    link_a = link_of(a.links, ref_a) if has_tree_a else -1
    link_b = link_of(b.links, ref_b)
    opens_a = link_a >= 0
    if opens_a and link_b >= 0:
        of_a, of_b = box_at(a, ref_a).half, box_at(b, ref_b).half
        rotation = sweep.rotation
        size_a = dot(absolute(rotation.x), of_a) + dot(absolute(rotation.y), of_a) + dot(absolute(rotation.z), of_a)
        opens_a = size_a > of_b.x + of_b.y + of_b.z
    base, unit_a, unit_b = top, _unit_of(a), _unit_of(b)
    for slot in range(WIDTH):
        child_a = WIDTH * link_a + slot if opens_a else ref_a
        child_b = ref_b if opens_a else WIDTH * link_b + slot
        boxes = a.boxes if opens_a else b.boxes
        node = link_a if opens_a else link_b
        if not boxes[NODE * node + 3 * WIDTH + slot] >= 0.0:
            continue
        key = _entry_of(sweep, a, b, child_a, child_b, has_tree_a, best)
        if key < math.inf and not has_tree_a:
            key = max(key, _box_entry(sweep, work, box_at(b, child_b)))
            key = key if key <= best else math.inf
        link = link_of(a.links, child_a) if has_tree_a else 0
        if key < math.inf and link < 0:
            key = max(key, _leaf_entry(sweep, a, ~link, True, unit_a, box_at(b, child_b), best))
        link = link_of(b.links, child_b)
        if key < math.inf and link < 0:
            of_a = _box_of_a(sweep, a, child_a, has_tree_a)
            key = max(key, _leaf_entry(sweep, b, ~link, False, unit_b, of_a, best))
        if key < math.inf:
            _push(work, top, base, (child_a << 32) | child_b, key)
            top += 1
    return top


@entry("int64(int64, int64, int64, int64, int64, int64)")
def cast_into_tree(header_at, first, n, count_at, doubles_at, integers_at):
    """Candidates for the first contacts of questions ``first`` … n − 1, of bodies apart at the start.

    Each question is searched no farther than to the contacts proven by earlier questions of its cast.
    header : HEADER integers.   count : numbers of candidates and of casts made, in and out.
    doubles, integers : workspace (TREE_CAST_DOUBLES, TREE_CAST_INTEGERS).
    Returns how many questions are answered; fewer than n where no more candidates fit.
    """
    header = view_i64(header_at, HEADER)
    count = view_i64(count_at, 2)
    has_tree_a = header[TREES_A] != 0
    b = open_tree(header[TREE_B])
    poses_at = doubles_at + 8 * CAST_DOUBLES
    corners_at = poses_at + 8 * 2 * POSE
    work = _Work(
        view_f64(corners_at, 48), view_i64(integers_at + 8 * CAST_INTEGERS, STACK),
        view_f64(corners_at + 8 * 48, STACK), view_f64(corners_at + 8 * (48 + STACK), FRONT * FRONTS + 1), doubles_at,
        integers_at,
    )
    for k in range(first, n):
        begin = count[0]
        a = open_tree(view_i64(header[TREES_A] + 8 * k, 1)[0]) if has_tree_a else b
        question = view_f64(header[QUESTIONS_AT] + 8 * QUESTION * k, QUESTION)
        pair = _posed_pair(header, k, view_f64(poses_at, 2 * POSE), corners_at)
        sweep = _sweep_of(header, k, a, b, pair, doubles_at, integers_at)
        cast = view_i64(header[CAST_OF_AT], k + 1)[k]
        best = view_f64(header[BEST_AT] + 8 * cast, 1)
        until = _walk_pairs(header, sweep, work, a, b, has_tree_a, k, question[3], best[0], count)
        if until < 0.0:
            count[0] = begin
            return k
        best[0] = until
    return n


@kernel
def _walk_pairs(header, sweep, work, a, b, has_tree_a, k, limit, best, count):
    """Write all candidates of a question; returns the new ``best``, below 0 where they do not fit."""
    unit_a, unit_b = _unit_of(a), _unit_of(b)
    radius = 0.0 if has_tree_a else sweep.pair.numbers[NUMBERS * view_i64(header[SHAPE_OF_AT], k + 1)[k] + RADIUS]
    work.fronts[0] = 0.0
    n_fronts = 0 if has_tree_a else _keep_front(sweep, work, sweep.d, radius, 0)
    top = 0
    if _entry_of(sweep, a, b, 0, 0, has_tree_a, best) < math.inf:
        work.stack[0] = 0
        work.keys[0] = 0.0
        top = 1
    while top > 0:
        top -= 1
        if work.keys[top] > best:
            continue
        ref_a, ref_b = work.stack[top] >> 32, work.stack[top] & _LOW
        link_a = link_of(a.links, ref_a) if has_tree_a else -1
        link_b = link_of(b.links, ref_b)
        if link_a >= 0 or link_b >= 0:
            if top + WIDTH > STACK:
                return -1.0
            top = _open_pair(sweep, work, a, b, ref_a, ref_b, has_tree_a, best, top)
            continue
        run_a, run_b = ~link_a, ~link_b
        of_a, of_b = _box_of_a(sweep, a, ref_a, has_tree_a), box_at(b, ref_b)
        n_a = run_a & 7 if has_tree_a else 1
        if count[0] + n_a * (run_b & 7) > header[CAPACITY]:
            return -1.0
        for i in range(n_a):
            if has_tree_a:
                if _facet_entry(sweep, a, (run_a >> 3) + i, True, unit_a, of_b, best) == math.inf:
                    continue
                _put_corners(work.corners, 0, a.triangles, (run_a >> 3) + i)
            for j in range(run_b & 7):
                if _facet_entry(sweep, b, (run_b >> 3) + j, False, unit_b, of_a, best) == math.inf:
                    continue
                if not (has_tree_a or _is_before(sweep, work, b, (run_b >> 3) + j, unit_b, best)):
                    continue
                count[CASTS] += 1
                _put_corners(work.corners, 24, b.triangles, (run_b >> 3) + j)
                row = view_f64(header[CANDIDATES_AT] + 8 * CANDIDATE * count[0], CANDIDATE)
                best = _cast_facets(sweep, work, radius, limit, best, row)
                if not has_tree_a:
                    n_fronts = _keep_front(sweep, work, vec3_at(row, NORMAL), radius, n_fronts)
                if row[STATUS] != MISS:
                    row[FACET_A] = a.ids[(run_a >> 3) + i] if has_tree_a else -1
                    row[FACET_B] = b.ids[(run_b >> 3) + j]
                    row[OF_QUESTION] = k
                    count[0] += 1
    return best
