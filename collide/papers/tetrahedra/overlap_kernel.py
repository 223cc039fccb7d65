"""Cells of a mesh against the box-tree of another mesh: pairs whose interiors meet, and their common volumes.

A cell's box is taken down the tree of the other mesh, eight boxes a step. Each pair of cells whose boxes meet is
settled by the first decisive test of: boxes, faces, an edge into the other cell, pairs of edges, each in
doubles with error bounds; faces exactly; the common volume, in double-doubles; pairs of edges exactly. Corners in
doubles make the last test decisive; other open pairs are `OPEN`, and settled in Python integers.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import entry, kernel, view_f32, view_f64, view_i32, view_i64, view_u8
from collide.mesh.bvh import NODE, WIDTH
from collide.numerics import double_double as dd
from collide.numerics import orientation
from collide.numerics.double_double import DD
from collide.numerics.vec3 import vec3_at
from collide.papers.tetrahedra import clip_cells as clip
from collide.papers.tetrahedra.cell_signs import (
    CELL,
    HEIGHTS,
    edge_enters,
    edges_part,
    face_parts,
    face_parts_exactly,
    write_heights,
)
from collide.papers.tetrahedra.clip_cells import clip_cell, write_determinant

#: What is known of a pair: its interiors meet, and its volume, if asked for, is rounded once; nothing; its interiors
#: meet, and of its volume a bound.
MEET, OPEN, VOLUME_OPEN = 1, 2, 3
#: What is asked: volumes; centroids; of one mesh with itself. What corners are: doubles; exact with their low parts.
VOLUMES, CENTROIDS, WITH_ITSELF, PLAIN, EXACT = 1, 2, 4, 8, 16
#: Integers of a job, then its numbers.
(
    NODES_AT, N_NODES, IDS_AT, CELLS_A, N_CELLS_A, CELLS_B, N_CELLS_B, CORNERS_A, N_CORNERS_A, CORNERS_B, N_CORNERS_B,
    ORDER_AT, QUERIES_AT, FLAGS, NUMBERS_AT,
) = range(15)
JOB = 15
#: Errors of leading parts and of both parts together; how far a query may be off, in the tree's units; the determinant
#: of the map to the world, its low part and its bound.
ERROR, WIDE_ERROR, MARGIN, SCALE, SCALE_LOW, SCALE_BOUND = range(6)
NUMBERS = 6
#: Doubles of an answer: volume, bound of its error, centroid.
ANSWER = 5
#: Doubles of a thread's workspace: both cells as doubles, heights of both with bounds, both cells in two parts, rows of
#: determinants, what `clip_cells` works with.
_HEIGHTS_A, _HEIGHTS_B = 2 * CELL, 2 * CELL + 2 * HEIGHTS
_WIDE = _HEIGHTS_B + 2 * HEIGHTS
_DIGITS = _WIDE + 2 * clip.WIDE_CELL
_CLIP = _DIGITS + orientation.WORK
WORK = _CLIP + clip.WORK
_A, _B, _WIDE_A, _WIDE_B = 0, CELL, 0, clip.WIDE_CELL
#: Of a share, its bound at most where centroids are good to the last places in double-doubles.
_GOOD_SHARE = 2.0**-56
#: More than all that underflow does to a volume's low part.
_TINY = 2.0**-1060


class _Job(NamedTuple):
    """What a call works on, and with.

    boxes, links, ids : B's tree and its cells in the order of the leaves.   queries : A's corners in the tree's units.
    cells_a, cells_b : four corners each.   corners_a, corners_b : six doubles a corner, leading parts and low ones.
    numbers, flags : as the constants say.   answers : volumes and centroids.   stack : nodes to look at.
    work, wide, digits, clip : the workspace and its parts.   counts : as the entry says.
    """

    boxes: Any
    links: Any
    ids: Any
    queries: Any
    cells_a: Any
    cells_b: Any
    corners_a: Any
    corners_b: Any
    numbers: Any
    flags: int
    answers: Any
    stack: Any
    work: Any
    wide: Any
    digits: Any
    clip: Any
    counts: Any


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def overlap_cells(
    job_at, begin, end, pairs_at, status_at, answers_at, capacity, stack_at, stack_size, work_at, counts_at
):
    """Pairs of cells order[begin] … order[end − 1] of A; returns the first cell not done for lack of space for pairs.

    A cell's pairs are all written or all left out. counts : pairs; then, added to the counts before, nodes compared
    with the box of a cell, and pairs of cells whose boxes meet.
    """
    header = view_i64(job_at, JOB)
    order = view_i32(header[ORDER_AT], header[N_CELLS_A])
    pairs = view_i32(pairs_at, 2 * capacity)
    status = view_u8(status_at, capacity)
    job = _Job(
        view_f32(header[NODES_AT], NODE * header[N_NODES]), view_i32(header[NODES_AT], NODE * header[N_NODES]),
        view_i32(header[IDS_AT], header[N_CELLS_B]), view_f64(header[QUERIES_AT], 3 * header[N_CORNERS_A]),
        view_i32(header[CELLS_A], 4 * header[N_CELLS_A]), view_i32(header[CELLS_B], 4 * header[N_CELLS_B]),
        view_f64(header[CORNERS_A], 6 * header[N_CORNERS_A]), view_f64(header[CORNERS_B], 6 * header[N_CORNERS_B]),
        view_f64(header[NUMBERS_AT], NUMBERS), header[FLAGS], view_f64(answers_at, ANSWER * capacity),
        view_i32(stack_at, stack_size), view_f64(work_at, WORK),
        view_f64(work_at + 8 * _WIDE, 2 * clip.WIDE_CELL), view_f64(work_at + 8 * _DIGITS, orientation.WORK),
        view_f64(work_at + 8 * _CLIP, clip.WORK), view_i64(counts_at, 3),
    )
    n = 0
    for k in range(begin, end):
        after = _cell_pairs(job, int(order[k]), pairs, status, n, capacity)
        if after < 0:
            job.counts[0] = n
            return k
        n = after
    job.counts[0] = n
    return end


@kernel
def _cell_pairs(job, a, pairs, status, n, capacity):
    """Put the pairs of cell a behind n others; how many there are then, −1 without space for them."""
    _load_cell(job.cells_a, job.corners_a, a, job.work, _A, job.wide, _WIDE_A)
    query = _query_box(job.cells_a, job.queries, a, job.numbers[MARGIN])
    job.stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = int(job.stack[top])
        job.counts[1] += 1
        mask = _boxes_meeting(job.boxes, NODE * node, query)
        for slot in range(WIDTH):
            if (mask >> slot) & 1 == 0:
                continue
            link = int(job.links[NODE * node + 6 * WIDTH + slot])
            if link >= 0:
                job.stack[top] = link
                top += 1
                continue
            for at in range(~link >> 3, (~link >> 3) + (~link & 7)):
                b = int(job.ids[at])
                if job.flags & WITH_ITSELF and b <= a:
                    continue
                if n == capacity:
                    return -1
                job.counts[2] += 1
                state = _settle(job, b, ANSWER * n)
                if state != 0:
                    pairs[2 * n] = a
                    pairs[2 * n + 1] = b
                    status[n] = state
                    n += 1
    return n


class _Query(NamedTuple):
    """A box in the tree's units: middle and half lengths."""

    x: float
    y: float
    z: float
    half_x: float
    half_y: float
    half_z: float


@kernel
def _query_box(cells, queries, a, margin):
    first = vec3_at(queries, 3 * int(cells[4 * a]))
    low_x = high_x = first.x
    low_y = high_y = first.y
    low_z = high_z = first.z
    for k in range(1, 4):
        p = vec3_at(queries, 3 * int(cells[4 * a + k]))
        low_x = min(low_x, p.x)
        high_x = max(high_x, p.x)
        low_y = min(low_y, p.y)
        high_y = max(high_y, p.y)
        low_z = min(low_z, p.z)
        high_z = max(high_z, p.z)
    return _Query(
        0.5 * (low_x + high_x), 0.5 * (low_y + high_y), 0.5 * (low_z + high_z), 0.5 * (high_x - low_x) + margin,
        0.5 * (high_y - low_y) + margin, 0.5 * (high_z - low_z) + margin,
    )


@kernel
def _boxes_meeting(boxes, at, query):
    """Which of a node's eight boxes meet the query's, as bits."""
    mask = 0
    for slot in range(WIDTH):
        k = at + slot
        x = abs(float(boxes[k]) - query.x) - float(boxes[k + 3 * WIDTH])
        y = abs(float(boxes[k + WIDTH]) - query.y) - float(boxes[k + 4 * WIDTH])
        z = abs(float(boxes[k + 2 * WIDTH]) - query.z) - float(boxes[k + 5 * WIDTH])
        if (x <= query.half_x) & (y <= query.half_y) & (z <= query.half_z):
            mask |= 1 << slot
    return mask


@kernel
def _load_cell(cells, corners, cell, work, at, wide, wide_at):
    for k in range(4):
        corner = 6 * int(cells[4 * cell + k])
        for axis in range(3):
            work[at + 3 * k + axis] = corners[corner + axis]
            wide[wide_at + 3 * k + axis] = corners[corner + axis]
            wide[wide_at + 12 + 3 * k + axis] = corners[corner + 3 + axis]


@kernel
def _boxes_part(work, error):
    """Whether the cells' boxes are proven to share no inner point."""
    for axis in range(3):
        low_a = min(min(work[axis], work[axis + 3]), min(work[axis + 6], work[axis + 9]))
        high_a = max(max(work[axis], work[axis + 3]), max(work[axis + 6], work[axis + 9]))
        k = CELL + axis
        low_b = min(min(work[k], work[k + 3]), min(work[k + 6], work[k + 9]))
        high_b = max(max(work[k], work[k + 3]), max(work[k + 6], work[k + 9]))
        if high_a - low_b <= -2.5 * error or high_b - low_a <= -2.5 * error:
            return True
    return False


@kernel
def _wide_boxes_part(wide):
    """The same by corners in two parts, which are exact."""
    for axis in range(3):
        if _all_below(wide, _WIDE_A + axis, _WIDE_B + axis) or _all_below(wide, _WIDE_B + axis, _WIDE_A + axis):
            return True
    return False


@kernel
def _all_below(wide, below, above):
    """Whether the four coordinates at ``below``, ``below + 3``, … are all at most the four at ``above``, ``above + 3``,
    ….
    """
    for i in range(below, below + 12, 3):
        for j in range(above, above + 12, 3):
            if dd.less(DD(wide[j], wide[j + 12]), DD(wide[i], wide[i + 12])):
                return False
    return True


@kernel
def _settle(job, b, at):
    """What is known of the loaded cell of A and cell b: 0 where they share no inner point."""
    work, error = job.work, job.numbers[ERROR]
    _load_cell(job.cells_b, job.corners_b, b, work, _B, job.wide, _WIDE_B)
    if _boxes_part(work, error):
        return 0
    write_heights(work, _B, _A, _HEIGHTS_A, error)
    if face_parts(work, _HEIGHTS_A):
        return 0
    write_heights(work, _A, _B, _HEIGHTS_B, error)
    if face_parts(work, _HEIGHTS_B):
        return 0
    is_measured = False
    state = OPEN
    if edge_enters(work, _HEIGHTS_A) or edge_enters(work, _HEIGHTS_B):
        state = MEET
    elif edges_part(work, job.digits, _A, _B, error, False):
        return 0
    else:
        plain = job.flags & PLAIN != 0
        if plain and (
            face_parts_exactly(work, job.digits, _B, _A, _HEIGHTS_A)
            or face_parts_exactly(work, job.digits, _A, _B, _HEIGHTS_B)
        ):
            return 0
        if job.flags & EXACT and _wide_boxes_part(job.wide):
            return 0
        _measure(job, at)
        is_measured = True
        share, bound = job.clip[clip.SHARE], job.clip[clip.SHARE_BOUND]
        if share > bound:
            state = MEET
        elif share == 0.0 and bound == 0.0:
            return 0
        elif plain:
            if edges_part(work, job.digits, _A, _B, error, True):
                return 0
            state = MEET
    if state == MEET and job.flags & VOLUMES:
        if not is_measured:
            _measure(job, at)
        if job.clip[clip.SHARE] <= 0.0:
            return OPEN
        if not _volume(job, at):
            return VOLUME_OPEN
    return state


@kernel
def _measure(job, at):
    """The share of the smaller cell inside the larger cell, and the smaller cell's determinant."""
    write_determinant(job.wide, _WIDE_B, job.clip, job.numbers[WIDE_ERROR])
    size = job.clip[clip.DETERMINANT]
    write_determinant(job.wide, _WIDE_A, job.clip, job.numbers[WIDE_ERROR])
    is_a = job.clip[clip.DETERMINANT] <= size
    if not is_a:
        write_determinant(job.wide, _WIDE_B, job.clip, job.numbers[WIDE_ERROR])
    corners = _WIDE_A if is_a else _WIDE_B
    middles = job.flags & CENTROIDS != 0
    clip_cell(job.wide, _WIDE_B if is_a else _WIDE_A, corners, job.clip, job.numbers[WIDE_ERROR], middles)
    if middles and job.clip[clip.SHARE] > 0.0:
        _put_centroid(job, corners, at)


@kernel
def _put_centroid(job, corners, at):
    share = DD(job.clip[clip.SHARE], job.clip[clip.SHARE + 1])
    for axis in range(3):
        base = DD(job.wide[corners + axis], job.wide[corners + 12 + axis])
        total = base
        for k in range(1, 4):
            corner = corners + 3 * k + axis
            way = dd.sub(DD(job.wide[corner], job.wide[corner + 12]), base)
            middle = clip.MIDDLES + 2 * (k - 1)
            total = dd.add(total, dd.mul(dd.div(DD(job.clip[middle], job.clip[middle + 1]), share), way))
        job.answers[at + 2 + axis] = total.high


@kernel
def _volume(job, at):
    """Put the volume shared and the bound of its error; whether it is rounded once, and the centroid is good."""
    out, numbers = job.clip, job.numbers
    share = DD(out[clip.SHARE], out[clip.SHARE + 1])
    determinant = DD(out[clip.DETERMINANT], out[clip.DETERMINANT + 1])
    scale = DD(numbers[SCALE], numbers[SCALE_LOW])
    volume = dd.mul(dd.div(dd.mul(determinant, share), DD(6.0, 0.0)), scale)
    # Relative errors of the three factors, each below ½ or of no use, and of three operations.
    relative = (
        out[clip.SHARE_BOUND] / share.high + out[clip.DETERMINANT_BOUND] / determinant.high
        + numbers[SCALE_BOUND] / scale.high
    )
    job.answers[at] = volume.high
    if not relative < 0.5:
        largest = min(share.high + out[clip.SHARE_BOUND], 1.0) * (determinant.high + out[clip.DETERMINANT_BOUND])
        job.answers[at + 1] = largest * (scale.high + numbers[SCALE_BOUND])
        return False
    error = abs(volume.low) + volume.high * (2.0 * relative + 2.0**-96) + _TINY
    error += error * 2.0**-50
    job.answers[at + 1] = error
    is_rounded = volume.high + error == volume.high and volume.high - error == volume.high
    return is_rounded and (job.flags & CENTROIDS == 0 or out[clip.SHARE_BOUND] < _GOOD_SHARE * share.high)
