"""A binary heap of pairs of boxes in kernels, the one of the least bound first."""

from __future__ import annotations

from collide.kernels import kernel


@kernel
def push_heap(items, keys, size, item, key):
    """Add an item to a heap whose least key stands first; returns its size."""
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
def pop_heap(items, keys, size):
    """Take off the first, which callers read before; returns the heap's size."""
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
