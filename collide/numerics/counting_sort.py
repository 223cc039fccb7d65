"""Numbers ordered by what they are counted under, and by merging: always stable."""

from __future__ import annotations

from collide.kernels import kernel


@kernel
def sort_by_class(items, first, last, n_classes, scratch, counts):
    """Order items[first:last] by class, items of a class as they stood.

    scratch : the class of item k at k, then as many places of workspace as items has.
    counts : out, the number of items of each class; then n_classes places of workspace.   O(last − first + n_classes).
    """
    behind = len(items)
    for c in range(n_classes):
        counts[c] = 0
    for k in range(first, last):
        scratch[behind + k] = items[k]
        counts[scratch[k]] += 1
    counts[n_classes] = first
    for c in range(n_classes - 1):
        counts[n_classes + 1 + c] = counts[n_classes + c] + counts[c]
    for k in range(first, last):
        c = n_classes + scratch[k]
        items[counts[c]] = scratch[behind + k]
        counts[c] += 1


@kernel
def only_class(counts, n_classes, n):
    """The class that has all n items; −1 where they are of several."""
    for c in range(n_classes):
        if counts[c] == n:
            return c
    return -1


@kernel
def order_by_key(keys, items, n, n_keys, starts, ordered):
    """Put n items in the order of their keys, items of equal keys as they stood.   keys : of item k at k, below n_keys.

    starts : (n_keys + 1,), out: where the items of a key begin.   ordered : (n,), out.   O(n + n_keys).
    """
    for key in range(n_keys + 1):
        starts[key] = 0
    for k in range(n):
        starts[keys[items[k]] + 1] += 1
    for key in range(n_keys):
        starts[key + 1] += starts[key]
    for k in range(n):
        key = keys[items[k]]
        ordered[starts[key]] = items[k]
        starts[key] += 1
    for key in range(n_keys, 0, -1):
        starts[key] = starts[key - 1]
    starts[0] = 0


@kernel
def order_by_merging(keys, n, order, scratch):
    """Numbers 0 … n − 1 in the order of their keys, equal ones as they stood, into ``order``.

    Runs of one are merged, then of two, of four. scratch : (n,).   O(n log n).
    """
    for k in range(n):
        order[k] = k
    width = 1
    while width < n:
        for start in range(0, n, 2 * width):
            middle, end = min(start + width, n), min(start + 2 * width, n)
            i, j = start, middle
            for at in range(start, end):
                if j == end or (i < middle and keys[order[i]] <= keys[order[j]]):
                    scratch[at] = order[i]
                    i += 1
                else:
                    scratch[at] = order[j]
                    j += 1
        for k in range(n):
            order[k] = scratch[k]
        width *= 2
