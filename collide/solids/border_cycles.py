"""Cycles of unbalanced edges of a surface.

A surface read as a chain of oriented triangles has a border: at every edge, runs in a direction less runs in the
opposite direction. The border of a chain is balanced at every vertex and falls into cycles. Triangles with the opposite
border close the chain, whatever facets they meet.
"""

from __future__ import annotations

from collections import defaultdict

import numpy as np


def border_edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k, 2) directed edges run along more often than back, by the difference, (k,) a triangle running along each).

    corners : (f, 3) ids.   O(f log f).
    """
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    keys = np.stack([np.minimum(starts, ends), np.maximum(starts, ends)], axis=1)
    edges, which = np.unique(keys, axis=0, return_inverse=True)
    which = which.ravel()
    upward = starts < ends
    surplus = np.bincount(which, weights=np.where(upward, 1, -1), minlength=len(edges)).astype(np.int64)
    along = np.full((2, len(edges)), -1)
    for k, half_edges in enumerate((np.flatnonzero(~upward), np.flatnonzero(upward))):
        along[k, which[half_edges]] = half_edges // 3
    unbalanced = np.flatnonzero(surplus)
    unbalanced = np.repeat(unbalanced, np.abs(surplus[unbalanced]))
    forward = surplus[unbalanced] > 0
    directed = np.where(forward[:, None], edges[unbalanced], edges[unbalanced][:, ::-1])
    return directed, np.where(forward, along[1, unbalanced], along[0, unbalanced])


def cycles_of(edges: np.ndarray) -> list[np.ndarray]:
    """Simple cycles, each the numbers of consecutive edges, of directed edges (k, 2) balanced at every vertex; O(k)."""
    leaving: dict[int, list[int]] = defaultdict(list)
    for row in range(len(edges) - 1, -1, -1):
        leaving[int(edges[row, 0])].append(row)
    cycles = []
    for first in range(len(edges)):
        start = int(edges[first, 0])
        if not leaving[start] or leaving[start][-1] != first:
            continue
        path: list[int] = []
        place = {start: 0}
        here = start
        while leaving[here]:
            row = leaving[here].pop()
            path.append(row)
            here = int(edges[row, 1])
            if here in place:  # a cycle is complete, the path before remains
                at = place[here]
                cycles.append(np.array(path[at:]))
                for passed in path[at:]:
                    place.pop(int(edges[passed, 0]))
                del path[at:]
            place[here] = len(path)
    return cycles
