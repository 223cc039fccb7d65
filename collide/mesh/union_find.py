"""Disjoint classes of numbered things, joined two at a time; the lowest number speaks for its class."""

from __future__ import annotations

from collide.kernels import kernel


@kernel
def speaker(parent, k):
    """The lowest member of k's class; shortens the way there (path halving)."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def join(parent, i, j):
    """Make one class of those of i and j."""
    i = speaker(parent, i)
    j = speaker(parent, j)
    if i < j:
        parent[j] = i
    else:
        parent[i] = j


@kernel
def speaker_and_turn(parent, turned, k):
    """`speaker`, and whether k is turned over against it; turned[k] is against parent[k]."""
    total = 0
    while parent[k] != k:
        turned[k] ^= turned[parent[k]]
        parent[k] = parent[parent[k]]
        total ^= turned[k]
        k = parent[k]
    return k, total


@kernel
def join_turned(parent, turned, i, j, against):
    """Make one class of those of i and j, which are turned against each other (1) or not (0).

    Returns False where they already are in one class that says otherwise.
    """
    i, turn_i = speaker_and_turn(parent, turned, i)
    j, turn_j = speaker_and_turn(parent, turned, j)
    if i == j:
        return (turn_i ^ turn_j) == against
    if i > j:
        i, j = j, i
    parent[j] = i
    turned[j] = turn_i ^ turn_j ^ against
    return True
