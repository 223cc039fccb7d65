"""OctoMap's streams of nodes, walked in their order: each node before its children, children by number.

Child k of a node is its upper half along x where bit 0 of k is set, along y for bit 1 and z for bit 2. A walk has the
nodes still to come as words of a stack, and writes the corner and the exponent of every leaf. O(1) a node.
"""

from __future__ import annotations

from collide.kernels import entry, kernel, view_i32, view_i64, view_u8

#: Levels below the root: the root covers 2¹⁶ finest cells a side.
LEVELS = 16
#: Words of a walk's stack: eight children a level.
STACK = 8 * LEVELS + 1
#: What is wrong with a stream: it ends early, a node of one finest cell has children, a node has none.
CUT_SHORT, TOO_DEEP, CHILDLESS = -1, -2, -3
#: A bit for each half of the root, then the exponent.
_AXIS, _MASK = 16, (1 << 16) - 1


@kernel(inline=True)
def _packed(x, y, z, exponent):
    return ((exponent << _AXIS | x) << _AXIS | y) << _AXIS | z


@kernel(inline=True)
def _child(node, k):
    """The k-th child of a packed node."""
    exponent = (node >> 3 * _AXIS) - 1
    x, y, z = node >> 2 * _AXIS & _MASK, node >> _AXIS & _MASK, node & _MASK
    return _packed(
        x | (k & 1) << exponent, y | (k >> 1 & 1) << exponent, z | (k >> 2 & 1) << exponent, exponent
    )


@kernel(inline=True)
def _write(node, corners, exponents, leaf):
    half = 1 << LEVELS - 1
    corners[3 * leaf] = (node >> 2 * _AXIS & _MASK) - half
    corners[3 * leaf + 1] = (node >> _AXIS & _MASK) - half
    corners[3 * leaf + 2] = (node & _MASK) - half
    exponents[leaf] = node >> 3 * _AXIS


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def walk_binary_stream(stream_at, n_nodes, corners_at, exponents_at, occupied_at, n_leaves, stack_at):
    """The leaves of a .bt stream: two bits a child, none, free, occupied or a node of the stream.

    stream : two bytes a node.   corners, exponents : int32, of leaves.   occupied : bytes, 0 or 1, of leaves.
    n_leaves : how often the stream says free or occupied.   stack : `STACK` words.
    Returns how many nodes were read, or what is wrong.
    """
    stream, occupied = view_u8(stream_at, 2 * n_nodes), view_u8(occupied_at, n_leaves)
    corners, exponents = view_i32(corners_at, 3 * n_leaves), view_i32(exponents_at, n_leaves)
    stack = view_i64(stack_at, STACK)
    stack[0] = _packed(0, 0, 0, LEVELS)
    top, n, leaf = 1, 0, 0
    while top > 0:
        if n == n_nodes:
            return CUT_SHORT
        top -= 1
        node = stack[top]
        states = int(stream[2 * n]) | int(stream[2 * n + 1]) << 8
        n += 1
        if states == 0:
            return CHILDLESS
        if node >> 3 * _AXIS == 1 and states & states >> 1 & 0x5555:
            return TOO_DEEP
        for k in range(8):
            state = states >> 2 * k & 3
            if state == 1 or state == 2:
                _write(_child(node, k), corners, exponents, leaf)
                occupied[leaf] = state - 1
                leaf += 1
        for k in range(7, -1, -1):
            if states >> 2 * k & 3 == 3:
                stack[top] = _child(node, k)
                top += 1
    return n


@entry("int64(int64, int64, int64, int64, int64, int64)")
def walk_full_stream(children_at, n_nodes, corners_at, exponents_at, n_leaves, stack_at):
    """The leaves of a .ot stream, a byte a node, a bit a child.

    corners, exponents : int32, of leaves.   n_leaves : how many bytes are 0.   stack : `STACK` words.
    Returns how many nodes were read, or what is wrong.
    """
    children, stack = view_u8(children_at, n_nodes), view_i64(stack_at, STACK)
    corners, exponents = view_i32(corners_at, 3 * n_leaves), view_i32(exponents_at, n_leaves)
    stack[0] = _packed(0, 0, 0, LEVELS)
    top, n, leaf = 1, 0, 0
    while top > 0:
        if n == n_nodes:
            return CUT_SHORT
        top -= 1
        node, bits = stack[top], int(children[n])
        n += 1
        if bits == 0:
            _write(node, corners, exponents, leaf)
            leaf += 1
            continue
        if node >> 3 * _AXIS == 0:
            return TOO_DEEP
        for k in range(7, -1, -1):
            if bits >> k & 1:
                stack[top] = _child(node, k)
                top += 1
    return n
