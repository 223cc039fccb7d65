"""Ranges of numbers ordered by the few classes they fall into, in place."""

from __future__ import annotations

from collide.kernels import kernel


@kernel
def sort_by_class(items, first, last, n_classes, scratch, counts):
    """Order items[first:last] by class, those of one class as they stood.

    scratch : the class of item k at k; behind as many places as there are items, as many of workspace.
    counts : out, how many there are of each class; behind them as many of workspace.   O(last − first + n_classes).
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
