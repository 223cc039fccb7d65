"""The graded box-tree of J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.2, over bodies' boxes.

A root's control cube is the smallest cube around the boxes; control cubes are the cells of an octree in the root's. A
node's bounding cube has its control cube's middle and twice its width; a body goes down to the child whose control cube
has the body's middle, as long as the child's bounding cube holds the body's box. Bodies left at a node are its
outliers. Paths without branches are single edges, and queries compare tight boxes, not the cubes.

Over bodies nothing bounds how many outliers a node has (rods as long as the world are outliers of its root), so two or
more make a child: a tree of their own, split by the octants of the cube around their middles.

Nodes stand in preorder, each with the number of the node after its subtree: a walk needs no stack, and trees may stand
in sequence in the same arrays.
"""

from __future__ import annotations

import math

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.numerics.counting_sort import only_class, sort_by_class

#: Integers of a node: the node after its subtree, the body of a leaf (−1 of others), the node above it (−1 of roots).
SKIP, BODY, PARENT = range(3)
LINK = 3
#: Integers of a range of bodies that waits to become a node.
_FIRST, _LAST, _LEVEL, _CELL, _PARENT, _OF_OUTLIERS = 0, 1, 2, 3, 6, 7
_RANGE = 8
#: Control cubes go down so far, and trees of outliers are split by octants so often; then by halves.
DEEPEST, _MAX_SPLITS = 60, 40
#: So few outliers, or bodies in one place, are leaves side by side.
_SIDE_BY_SIDE = 8
#: The most children of a node: eight, and the outliers.
MAX_CHILDREN = 9
#: The most edges from a root to a leaf: of control cubes, of splits, and of halves of up to 2^30 bodies.
MAX_DEPTH = DEEPEST + _MAX_SPLITS + 30
#: Ranges that wait: at most so many a level.
STACK = MAX_CHILDREN * MAX_DEPTH * _RANGE


@kernel(inline=True)
def _middle(boxes, body, axis):
    return 0.5 * boxes[6 * body + axis] + 0.5 * boxes[6 * body + 3 + axis]


@kernel(inline=True)
def _child_of(boxes, body, cube, stack, at):
    """The child whose control cube has a body's middle, if its bounding cube holds its box; else 8."""
    cell = cube[3] / float(1 << stack[at + _LEVEL])
    child = 0
    is_held = True
    for axis in range(3):
        corner = cube[axis] + float(stack[at + _CELL + axis]) * cell
        middle = corner + 0.5 * cell
        if _middle(boxes, body, axis) >= middle:
            child |= 1 << axis
            corner = middle
        # The child's cube is half a cell wide, its bounding cube a whole one, of the same middle.
        low = corner - 0.25 * cell
        is_held = is_held and boxes[6 * body + axis] >= low and boxes[6 * body + 3 + axis] <= low + cell
    return child if is_held else 8


@kernel(inline=True)
def _octant_of(boxes, body, cube):
    """The octant of a cube that has a body's middle."""
    octant = 0
    for axis in range(3):
        if _middle(boxes, body, axis) >= cube[axis] + 0.5 * cube[3]:
            octant |= 1 << axis
    return octant


@kernel
def _sort_range(boxes, bodies, cube, stack, at, of_outliers, scratch, counts):
    """Order the bodies of a range by child, outliers last; counts become how many there are of each."""
    first, last = stack[at + _FIRST], stack[at + _LAST]
    for k in range(first, last):
        if of_outliers:
            scratch[k] = _octant_of(boxes, bodies[k], cube)
        else:
            scratch[k] = _child_of(boxes, bodies[k], cube, stack, at) if stack[at + _LEVEL] < DEEPEST else 8
    sort_by_class(bodies, first, last, 9, scratch, counts)


@kernel
def _cube_around(boxes, bodies, first, last, of_middles, cube):
    """Make ``cube`` (low corner, width) the smallest one around boxes, or around their middles."""
    width = 0.0
    for axis in range(3):
        low = math.inf
        high = -math.inf
        for k in range(first, last):
            at = 6 * bodies[k] + axis
            if of_middles:
                low = min(low, 0.5 * boxes[at] + 0.5 * boxes[at + 3])
                high = max(high, 0.5 * boxes[at] + 0.5 * boxes[at + 3])
            else:
                low = min(low, boxes[at])
                high = max(high, boxes[at + 3])
        cube[axis] = low
        width = max(width, high - low)
    cube[3] = width


@kernel
def _sort_control_cube(boxes, bodies, cube, stack, at, scratch, counts):
    """Sort a range by the children of its control cube, or of the largest cube below with bodies in several classes.

    Returns False where no cube has: all bodies are outliers.
    """
    n = stack[at + _LAST] - stack[at + _FIRST]
    _sort_range(boxes, bodies, cube, stack, at, False, scratch, counts)
    child = only_class(counts, 9, n)
    while 0 <= child < 8:  # nothing branches: the node is that child
        stack[at + _LEVEL] += 1
        for axis in range(3):
            stack[at + _CELL + axis] = 2 * stack[at + _CELL + axis] + ((child >> axis) & 1)
        _sort_range(boxes, bodies, cube, stack, at, False, scratch, counts)
        child = only_class(counts, 9, n)
    return child < 0


@kernel
def _sort_outliers(boxes, bodies, stack, at, scratch, counts, cube):
    """Sort a range of outliers by octants; by halves where these do not part them."""
    first, last = stack[at + _FIRST], stack[at + _LAST]
    _cube_around(boxes, bodies, first, last, True, cube)
    if cube[3] > 0.0 and stack[at + _LEVEL] < _MAX_SPLITS:
        _sort_range(boxes, bodies, cube, stack, at, True, scratch, counts)
        if only_class(counts, 9, last - first) < 0:
            return
    for child in range(9):
        counts[child] = 0
    counts[0] = (last - first) // 2
    counts[1] = last - first - counts[0]


@kernel
def _push_children(stack, top, at, node, of_outliers, counts, side_by_side, row):
    """Put a node's children on the stack, the first on top; the new height. ``row`` holds the node's own range."""
    for k in range(_RANGE):
        row[k] = stack[at + k]
    last = row[_LAST]
    if side_by_side:
        for k in range(last - 1, row[_FIRST] - 1, -1):
            to = _RANGE * top
            stack[to + _FIRST], stack[to + _LAST], stack[to + _PARENT] = k, k + 1, node
            top += 1
        return top
    for child in range(8, -1, -1):
        if counts[child] == 0:
            continue
        to = _RANGE * top
        stack[to + _FIRST], stack[to + _LAST] = last - counts[child], last
        last -= counts[child]
        stack[to + _PARENT] = node
        stack[to + _OF_OUTLIERS] = 1 if of_outliers or child == 8 else 0
        stack[to + _LEVEL] = 0 if child == 8 else row[_LEVEL] + 1
        for axis in range(3):
            stack[to + _CELL + axis] = 2 * row[_CELL + axis] + ((child >> axis) & 1)
        top += 1
    return top


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64)")
def grow_graded(bodies_at, m, boxes_at, n_boxes, begin, links_at, capacity, scratch_at):
    """Links of a tree over m > 0 bodies, from node ``begin`` on; returns the node after it, at most begin + 2·m.

    bodies : m integers, brought into the order of the leaves.   boxes : 6 doubles a body.   links : LINK integers a
    node.   scratch : 2·m + 18 + STACK + 16 integers.
    """
    bodies = view_i64(bodies_at, m)
    boxes = view_f64(boxes_at, 6 * n_boxes)
    links = view_i64(links_at, LINK * capacity)
    scratch = view_i64(scratch_at, 2 * m)
    counts = view_i64(scratch_at + 16 * m, 18)
    row = view_i64(scratch_at + 16 * m + 144, _RANGE)
    root = view_f64(scratch_at + 16 * m + 208, 4)
    cube = view_f64(scratch_at + 16 * m + 240, 4)
    stack = view_i64(scratch_at + 16 * m + 272, STACK)
    _cube_around(boxes, bodies, 0, m, False, root)
    root[3] *= 1.0 + 2.0**-50
    for k in range(_RANGE):
        stack[k] = 0
    stack[_LAST], stack[_PARENT] = m, -1
    top = 1
    node = begin
    while top > 0:
        top -= 1
        at = _RANGE * top
        first, last = stack[at + _FIRST], stack[at + _LAST]
        link = LINK * node
        links[link + PARENT] = stack[at + _PARENT]
        links[link + BODY] = bodies[first] if last - first == 1 else -1
        links[link + SKIP] = node + 1
        if last - first > 1:
            of_outliers = stack[at + _OF_OUTLIERS] != 0
            if not of_outliers and not _sort_control_cube(boxes, bodies, root, stack, at, scratch, counts):
                of_outliers = True
                stack[at + _LEVEL] = 0
            side_by_side = of_outliers and last - first <= _SIDE_BY_SIDE
            if of_outliers and not side_by_side:
                _sort_outliers(boxes, bodies, stack, at, scratch, counts, cube)
            top = _push_children(stack, top, at, node, of_outliers, counts, side_by_side, row)
        node += 1
    for k in range(node - 1, begin - 1, -1):
        parent = links[LINK * k + PARENT]
        if parent >= 0:
            links[LINK * parent + SKIP] = max(links[LINK * parent + SKIP], links[LINK * k + SKIP])
    return node
