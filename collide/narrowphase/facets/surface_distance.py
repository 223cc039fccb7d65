"""The distance of two posed surfaces, with nearest points and a proven bracket.

A walk over pairs of boxes, nearest first, that leaves out what is proven farther than the nearest points so far.
The direction between these is an axis for all boxes to come: that, and starting near, is what saves most.

Leaves are measured in the world's axes with A's origin as theirs: x = R_A v, y = R_B w + (t_B − t_A). Both are off by
at most E a coordinate (`_world_error`), so a distance or the width of a slab is off by 4E. Whatever the boxes leave
out is farther than the bound at that time; every pair of triangles met adds its slab. Their least is the lower bound.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, NEAR_PROBE, boxes_nearest
from collide.mesh.bvh import (
    CENTRE,
    EXPONENT,
    N_NODES,
    NODE,
    REACH,
    SLAB,
    SLABS_AT,
    WIDTH,
    open_tree,
)
from collide.narrowphase.facets.exact_corners import CORNERS, STATE, forget_poses
from collide.narrowphase.facets.posed_surfaces import (
    ERROR,
    INVERSE_A,
    INVERSE_B,
    MOST_UNLIKE,
    PLACING,
    UNITS,
    later,
    place,
    to_world,
    transform,
)
from collide.narrowphase.facets.surface_collision import box_size, certainly_meeting, link_of, set_probe
from collide.narrowphase.facets.triangle_distance import beyond, common_point, nearest_points, slab, widest_slab

# A row of results, doubles: distance, proven bounds, points on A and on B and the direction between them in the world.
DISTANCE, LOWER, UPPER, POINT_A, POINT_B, NORMAL = 0, 1, 2, 3, 6, 9
RESULT = 12
# And integers: facet of A, facet of B, whether the surfaces meet; boxes, triangles and exact decisions.
FACET_A, FACET_B, MEETS, BOXES, TRIANGLES, EXACT = range(6)
MARKS = 6

# What a walk keeps, doubles: direction (3) and, in units of A's boxes, its products with A's boxes (3), B's (3) and
# the shift (1), less rounding; worths of the axes of A (3), B (3), of lines in A's frame and in B's; the best so far,
# the least slab; error of a world coordinate; scale of the units.
_DIRECTION, _ALONG_A, _ALONG_B, _OFFSET, _WORTH_A, _WORTH_B, _LINE_A, _LINE_B = 0, 3, 6, 9, 10, 13, 16, 17
_BEST, _LEAST, _WORLD_ERROR, _SCALE = 18, 19, 20, 21
# Points so far (6), then triangles in world axes: one of B after up to seven of A; then points of a pair.
_POINTS, _PAIR, _NEW, _OF_A = 22, 28, 46, 52
NEAR = _OF_A + 9 * 7

_U = 2.0**-53
_FLOAT_ERROR = 2.0**-19
#: B's unit over A's beyond which floats might overflow.
_UNLIKE = 2.0**MOST_UNLIKE
#: Depth first until so many pairs of leaves were met, to have a bound and a direction; then the nearest boxes first,
#: and again depth first, which costs no heap, while the bound has not got better for so many pairs of leaves.
_DIVES, _PATIENCE = 4, 16

#: Points nearer than so many times the error of a coordinate tell no direction: it may be off by one over that.
_TURNED = 2.0**26

DOUBLES = PLACING + CORNERS + NEAR
FLOATS = 2 * FRAME + NEAR_PROBE + 2 * WIDTH


@kernel
def _prepare(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, near):
    """What does not change while a pair of poses is walked."""
    _worths(placing, INVERSE_A, near, _WORTH_A, _LINE_A, 1.0)
    _worths(placing, INVERSE_B, near, _WORTH_B, _LINE_B, 1.0 / placing[UNITS])
    near[_SCALE] = math.ldexp(1.0, int(header_a[EXPONENT]))
    size = 0.0
    for i in range(3):
        terms = abs(XB[4 * i + 3] - XA[4 * i + 3])
        for j in range(3):
            terms += abs(XA[4 * i + j]) * numbers_a[REACH + j] + abs(XB[4 * i + j]) * numbers_b[REACH + j]
        size = max(size, terms)
    near[_WORLD_ERROR] = 8.0 * _U * size
    direction = (
        _middle(XB, numbers_b, 0) - _middle(XA, numbers_a, 0),
        _middle(XB, numbers_b, 1) - _middle(XA, numbers_a, 1),
        _middle(XB, numbers_b, 2) - _middle(XA, numbers_a, 2),
    )
    _set_direction(direction[0], direction[1], direction[2], header_a, numbers_a, XA, header_b, numbers_b, XB, near)


@kernel
def _middle(X, numbers, i):
    return (
        X[4 * i] * numbers[CENTRE] + X[4 * i + 1] * numbers[CENTRE + 1] + X[4 * i + 2] * numbers[CENTRE + 2] + X[4 * i + 3]
    )


@kernel
def _worths(placing, inverse, near, at, line, unit):
    """A gap of 1 along an axis of a frame is worth at least this in the world: 1 over the row of the inverse.

    The inverse is off by at most 2⁻¹⁰ of its size where it is accepted, and by 2⁻⁵⁰ for rotations: the residual,
    measured again, is added.
    """
    largest = 0.0
    for i in range(3):
        row = 0.0
        across = 0.0
        for j in range(3):
            row += placing[inverse + 3 * i + j] ** 2
            product = 0.0
            for k in range(3):
                product += placing[inverse + 3 * k + i] * placing[inverse + 3 * k + j]
            across += abs(product)
        near[at + i] = row
        largest = max(largest, across)
    root = math.sqrt(largest)
    if unit > _UNLIKE:
        unit = 0.0
    slack = placing[inverse + 9] * 4.0 * root
    for i in range(3):
        near[at + i] = unit * (1.0 - 2.0**-18) / (math.sqrt(near[at + i]) + slack)
    near[line] = unit * (1.0 - 2.0**-18) / (root + slack)


@kernel
def _set_direction(x, y, z, header_a, numbers_a, XA, header_b, numbers_b, XB, near):
    """Make the direction, from A to B and of any length, the axis of the boxes to come."""
    size = max(abs(x), abs(y), abs(z))
    if not size > 0.0:
        x = 1.0
        y = 0.0
        z = 0.0
        size = 1.0
    x /= size
    y /= size
    z /= size
    length = math.sqrt(x * x + y * y + z * z) * (1.0 + 2.0**-40)
    near[_DIRECTION] = x / length
    near[_DIRECTION + 1] = y / length
    near[_DIRECTION + 2] = z / length
    unit = math.ldexp(1.0, int(header_b[EXPONENT] - header_a[EXPONENT]))
    scale = math.ldexp(1.0, int(-header_a[EXPONENT]))
    offset = 0.0
    terms = 0.0
    spread = 0.0
    for i in range(3):
        d = near[_DIRECTION + i]
        shift = XB[4 * i + 3] - XA[4 * i + 3]
        offset += d * shift
        terms += abs(shift)
    for j in range(3):
        along_a = 0.0
        along_b = 0.0
        for i in range(3):
            d = near[_DIRECTION + i]
            along_a += d * XA[4 * i + j]
            along_b += d * XB[4 * i + j]
            terms += abs(XA[4 * i + j] * numbers_a[CENTRE + j]) + abs(XB[4 * i + j] * numbers_b[CENTRE + j])
        offset += along_b * numbers_b[CENTRE + j] - along_a * numbers_a[CENTRE + j]
        near[_ALONG_A + j] = along_a
        near[_ALONG_B + j] = along_b * unit
        spread += abs(along_a) + abs(along_b * unit)
    offset *= scale
    if unit > _UNLIKE:
        for j in range(3):
            near[_ALONG_B + j] = 0.0
        near[_OFFSET] = -math.inf
        return
    near[_OFFSET] = offset - (_FLOAT_ERROR * (abs(offset) + 1.001 * spread) + 2.0**-110 + 32.0 * _U * scale * terms)


@kernel(inline=True)
def _set_near_probe(placing, near, which, nodes, ref, gap, probe):
    """`set_probe`, and what distances need besides; gap: `_own_gap` of the box."""
    set_probe(placing, which, nodes, ref, probe)
    own = _WORTH_A if which == 0 else _WORTH_B
    other = _WORTH_B if which == 0 else _WORTH_A
    for i in range(3):
        probe[12 + i] = np.float32(near[other + i])
        probe[15 + i] = np.float32(near[own + i])
    probe[18] = np.float32(near[_LINE_A if which == 0 else _LINE_B])
    probe[22] = np.float32(near[_OFFSET] + gap)
    other = _ALONG_B if which == 0 else _ALONG_A
    sign = 1.0 if which == 0 else -1.0
    for i in range(3):
        probe[19 + i] = np.float32(sign * near[other + i])


@kernel(inline=True)
def _own_gap(near, which, nodes, slabs, triangles, numbers, scale, link, ref):
    """Least product of a box with the direction (of B's) or with its opposite (of A's); of a leaf that of its corners."""
    mine = _ALONG_A if which == 0 else _ALONG_B
    sign = -1.0 if which == 0 else 1.0
    gx = sign * near[mine]
    gy = sign * near[mine + 1]
    gz = sign * near[mine + 2]
    if link < 0:
        first = 9 * (~link >> 3)
        low = math.inf
        for k in range(first, first + 9 * (~link & 7), 3):
            x = triangles[k] - numbers[CENTRE]
            y = triangles[k + 1] - numbers[CENTRE + 1]
            z = triangles[k + 2] - numbers[CENTRE + 2]
            low = min(low, gx * x + gy * y + gz * z)
        return low * scale
    at = NODE * (ref >> 3) + (ref & 7)
    x = float(nodes[at])
    y = float(nodes[at + WIDTH])
    z = float(nodes[at + 2 * WIDTH])
    hx = float(nodes[at + 3 * WIDTH])
    hy = float(nodes[at + 4 * WIDTH])
    hz = float(nodes[at + 5 * WIDTH])
    plain = (gx * x + gy * y + gz * z) - (abs(gx) * hx + abs(gy) * hy + abs(gz) * hz)
    at = SLAB * (ref >> 3) + (ref & 7)
    nx = float(slabs[at])
    ny = float(slabs[at + WIDTH])
    nz = float(slabs[at + 2 * WIDTH])
    share = gx * nx + gy * ny + gz * nz
    thin = share * float(slabs[at + 3 * WIDTH]) - abs(share) * float(slabs[at + 4 * WIDTH])
    gx -= share * nx
    gy -= share * ny
    gz -= share * nz
    thin += (gx * x + gy * y + gz * z) - (abs(gx) * hx + abs(gy) * hy + abs(gz) * hz)
    return max(plain, thin)


@kernel
def _near_leaves(P, W, run_a, run_b, XA, XB, placing, near, T, new, of_a, corners, context, marks):
    """Triangles of two leaves against the best so far; 2 where two of them meet, 1 where the best got better."""
    first_a = run_a >> 3
    better = 0
    error = 4.0 * near[_WORLD_ERROR]
    for j in range(run_a & 7):
        to_world(XA, 0.0, 0.0, 0.0, P, 9 * (first_a + j), of_a, 9 * j)
    for i in range(run_b & 7):
        b = (run_b >> 3) + i
        to_world(XB, XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11], W, 9 * b, T, 9)
        for j in range(run_a & 7):
            for k in range(9):
                T[k] = of_a[9 * j + k]
            marks[TRIANGLES] += 1
            width = slab(T, near[_DIRECTION], near[_DIRECTION + 1], near[_DIRECTION + 2]) - error
            if width >= near[_BEST] or beyond(T, near[_BEST] + 2.0 * error):
                continue
            apart = width > 0.0
            if not apart:
                transform(placing, W, 9 * b, corners, 9)
                apart = not certainly_meeting(P, W, 9 * (first_a + j), 9 * b, corners, context, marks, EXACT)
            length, width_between = nearest_points(T, new)
            if not apart:
                common_point(T, length, new)
                for k in range(6):
                    near[_POINTS + k] = new[k]
                marks[FACET_A] = first_a + j
                marks[FACET_B] = b
                return 2
            width = max(width, width_between - error)
            least = min(length, near[_BEST])
            if width < least * (1.0 - 2.0**-44) - error:
                width = max(width, widest_slab(T)[0] - 2.0 * error)
            near[_LEAST] = min(near[_LEAST], width)
            if length < near[_BEST]:
                near[_BEST] = length
                for k in range(6):
                    near[_POINTS + k] = new[k]
                marks[FACET_A] = first_a + j
                marks[FACET_B] = b
                better = 1
    return better


@kernel
def _direction_between(P, W, XA, XB, near, marks, T):
    """The unit vector from A to B along which the nearest triangles are apart; zeros where none can be told.

    The line between the nearest points, unless rounding has turned it. Points nearer than `_TURNED` errors are compared with
    the normals and edges of both triangles, and the widest slab tells; within rounding, one of these. The points are then
    laid along that, through their middle: how far this moves them is how far they were from being the nearest.
    """
    x = near[_POINTS + 3] - near[_POINTS]
    y = near[_POINTS + 4] - near[_POINTS + 1]
    z = near[_POINTS + 5] - near[_POINTS + 2]
    size = max(abs(x), abs(y), abs(z))
    width = -math.inf
    if size > 0.0:
        x /= size
        y /= size
        z /= size
        length = math.sqrt(x * x + y * y + z * z)
        x /= length
        y /= length
        z /= length
        if size > _TURNED * near[_WORLD_ERROR]:
            return x, y, z
    to_world(XA, 0.0, 0.0, 0.0, P, 9 * marks[FACET_A], T, 0)
    to_world(XB, XB[3] - XA[3], XB[7] - XA[7], XB[11] - XA[11], W, 9 * marks[FACET_B], T, 9)
    if size > 0.0:
        width = slab(T, x, y, z)
    widest, nx, ny, nz = widest_slab(T)
    if widest <= width - 4.0 * near[_WORLD_ERROR]:
        return x, y, z
    for axis in range(3):
        half = 0.5 * near[_BEST] * (nx if axis == 0 else (ny if axis == 1 else nz))
        middle = 0.5 * near[_POINTS + axis] + 0.5 * near[_POINTS + 3 + axis]
        near[_POINTS + axis] = middle - half
        near[_POINTS + 3 + axis] = middle + half
    return nx, ny, nz


@kernel
def _finish(near, marks, ids_a, ids_b, P, W, XA, XB, T, meets, flip, limit, out):
    """The row of results."""
    marks[MEETS] = 1 if meets else 0
    found = marks[FACET_A] >= 0
    if found and not meets:
        out[NORMAL], out[NORMAL + 1], out[NORMAL + 2] = _direction_between(P, W, XA, XB, near, marks, T)
    else:
        out[NORMAL] = out[NORMAL + 1] = out[NORMAL + 2] = 0.0
    if found:
        marks[FACET_A] = ids_a[marks[FACET_A]]
        marks[FACET_B] = ids_b[marks[FACET_B]]
    length = near[_BEST]
    error = 4.0 * near[_WORLD_ERROR]
    for k in range(NORMAL):
        out[k] = 0.0
    if not meets:
        out[DISTANCE] = length
        out[LOWER] = max(0.0, min(near[_LEAST], length - error if found else limit))
        out[UPPER] = length + error if found else math.inf
    for k in range(3):
        shift = XA[4 * k + 3]
        x = near[_POINTS + k]
        y = near[_POINTS + 3 + k]
        if meets:
            x = 0.5 * x + 0.5 * y
            y = x
        out[POINT_A + k] = (y if flip else x) + shift
        out[POINT_B + k] = (x if flip else y) + shift
        if flip:
            out[NORMAL + k] = -out[NORMAL + k]
    if flip:
        one = marks[FACET_A]
        marks[FACET_A] = marks[FACET_B]
        marks[FACET_B] = one


@kernel(inline=True)
def _push_nearest(out, bound, node, order, stack, bounds, top, fixed, in_b):
    """Children nearer than the bound onto the stack, those whose centres are nearest on top."""
    count = 0
    for slot in range(WIDTH):
        if float(out[slot]) < bound:
            key = float(out[WIDTH + slot])
            k = count
            while k > 0 and float(out[WIDTH + order[k - 1]]) < key:
                order[k] = order[k - 1]
                k -= 1
            order[k] = slot
            count += 1
    for k in range(count):
        child = node * WIDTH + order[k]
        stack[top] = ((fixed << 32) | child) if in_b else ((child << 32) | fixed)
        bounds[top] = float(out[order[k]])
        top += 1
    return top


@kernel
def _push_heap(items, keys, size, item, key):
    """Add to a heap whose least key stands first; returns its size."""
    at = size
    while at > 0:
        parent = (at - 1) >> 1
        if keys[parent] <= key:
            break
        keys[at] = keys[parent]
        items[at] = items[parent]
        at = parent
    keys[at] = key
    items[at] = item
    return size + 1


@kernel
def _pop_heap(items, keys, size):
    """Take the first off; returns the size that is left. Whoever wants it reads it before."""
    size -= 1
    key = keys[size]
    item = items[size]
    at = 0
    while True:
        child = 2 * at + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[at] = keys[child]
        items[at] = items[child]
        at = child
    keys[at] = key
    items[at] = item
    return size


#: Of `near_surfaces`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64)"
)


@entry(SIGNATURE)
def near_surfaces(
    header_a_at, header_b_at, XA_at, step_a, XB_at, step_b, n, alike, limit, results_at, marks_at, stack_at, n_stack,
    heap_at, n_heap, doubles_at, integers_at, decide,
):  # fmt: skip
    """Distances of two surfaces at n pairs of poses; returns how many were done (fewer: that matrix is singular).

    limit : nothing farther than this is looked for; where nothing is found, facets are −1 and LOWER is it.
    results, marks : RESULT doubles and MARKS integers a pose.   stack : 2·n_stack words and 8 more.
    """
    header_a, numbers_a, boxes_a, links_a, P, ids_a = open_tree(header_a_at)
    header_b, numbers_b, boxes_b, links_b, W, ids_b = open_tree(header_b_at)
    slabs_a = view_f32(header_a[SLABS_AT], SLAB * header_a[N_NODES])
    slabs_b = view_f32(header_b[SLABS_AT], SLAB * header_b[N_NODES])
    stack = view_i64(stack_at, n_stack)
    bounds = view_f64(stack_at + 8 * n_stack, n_stack)
    order = view_i64(stack_at + 16 * n_stack, WIDTH)
    heap = view_i64(heap_at, n_heap)
    keys = view_f64(heap_at + 8 * n_heap, n_heap)
    placing = view_f64(doubles_at, PLACING)
    corners = view_f64(doubles_at + 8 * PLACING, CORNERS)
    near_at = doubles_at + 8 * (PLACING + CORNERS)
    near = view_f64(near_at, NEAR)
    T = view_f64(near_at + 8 * _PAIR, 18)
    new = view_f64(near_at + 8 * _NEW, 6)
    of_a = view_f64(near_at + 8 * _OF_A, 63)
    floats_at = doubles_at + 8 * DOUBLES
    frames = view_f32(floats_at, 2 * FRAME)
    frame_a = view_f32(floats_at, FRAME)
    frame_b = view_f32(floats_at + 4 * FRAME, FRAME)
    probe = view_f32(floats_at + 8 * FRAME, NEAR_PROBE)
    out = view_f32(floats_at + 8 * FRAME + 4 * NEAR_PROBE, 2 * WIDTH)
    state = view_i64(integers_at, STATE)
    for k in range(n):
        pose_a = XA_at + 8 * step_a * k
        pose_b = XB_at + 8 * step_b * k
        flip = alike and later(view_f64(pose_a, 12), view_f64(pose_b, 12))
        if flip:
            pose_a, pose_b = pose_b, pose_a
        XA = view_f64(pose_a, 16)
        XB = view_f64(pose_b, 16)
        marks = view_i64(marks_at + 8 * MARKS * k, MARKS)
        if not place(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, frames):
            return k
        forget_poses(state)
        context = (
            decide, doubles_at + 8 * PLACING, doubles_at, integers_at, pose_a, pose_b, placing[ERROR],
        )  # fmt: skip
        _prepare(header_a, numbers_a, XA, header_b, numbers_b, XB, placing, near)
        near[_BEST] = limit
        near[_LEAST] = math.inf
        marks[FACET_A] = -1
        marks[FACET_B] = -1
        units = placing[UNITS]
        scale = 1.0 / near[_SCALE]
        scale_a = math.ldexp(1.0, int(-header_a[EXPONENT]))
        scale_b = math.ldexp(1.0, int(-header_b[EXPONENT]))
        meets = False
        stack[0] = 0
        bounds[0] = 0.0
        top = 1
        size = 0
        leaves = 0
        calm = 0
        bound = near[_BEST] * scale
        while top > 0 or size > 0:
            if top > 0 and (leaves < _DIVES or calm > _PATIENCE or size + top > n_heap):
                top -= 1
                if bounds[top] >= bound:
                    continue
                item = stack[top]
            else:
                while top > 0:
                    top -= 1
                    size = _push_heap(heap, keys, size, stack[top], bounds[top])
                if keys[0] >= bound:
                    break
                item = heap[0]
                size = _pop_heap(heap, keys, size)
            a = item >> 32
            b = item & 0xFFFFFFFF
            link_a = int(link_of(links_a, a))
            link_b = int(link_of(links_b, b))
            # What was pushed before the direction turned is looked at again.
            gap_a = _own_gap(near, 0, boxes_a, slabs_a, P, numbers_a, scale_a, link_a, a)
            gap_b = _own_gap(near, 1, boxes_b, slabs_b, W, numbers_b, scale_b, link_b, b)
            if near[_OFFSET] + gap_a + gap_b >= bound:
                continue
            if link_a < 0 and link_b < 0:
                leaves += 1
                calm += 1
                said = _near_leaves(
                    P, W, ~link_a, ~link_b, XA, XB, placing, near, T, new, of_a, corners, context,
                    marks,
                )
                if said == 2:
                    meets = True
                    break
                if said == 1:
                    calm = 0
                    bound = near[_BEST] * scale
                    _set_direction(
                        near[_POINTS + 3] - near[_POINTS], near[_POINTS + 4] - near[_POINTS + 1],
                        near[_POINTS + 5] - near[_POINTS + 2], header_a, numbers_a, XA, header_b, numbers_b, XB, near,
                    )  # fmt: skip
                continue
            marks[BOXES] += 1
            if link_a < 0 or (link_b >= 0 and box_size(boxes_b, b) > units * box_size(boxes_a, a)):
                _set_near_probe(placing, near, 0, boxes_a, a, gap_a, probe)
                boxes_nearest(boxes_b, NODE * link_b, slabs_b, SLAB * link_b, frame_a, probe, out)
                top = _push_nearest(out, bound, link_b, order, stack, bounds, top, a, True)
            else:
                _set_near_probe(placing, near, 1, boxes_b, b, gap_b, probe)
                boxes_nearest(boxes_a, NODE * link_a, slabs_a, SLAB * link_a, frame_b, probe, out)
                top = _push_nearest(out, bound, link_a, order, stack, bounds, top, b, False)
        _finish(near, marks, ids_a, ids_b, P, W, XA, XB, T, meets, flip, limit, view_f64(results_at + 8 * RESULT * k, RESULT))
    return n
