"""Union–find in kernels: disjoint classes of numbered elements; the lowest number is the root of its class.

R. E. Tarjan, "Efficiency of a good but not linear set union algorithm" (1975); paths are halved as they are followed.
"""

from __future__ import annotations

from collide.kernels import kernel


@kernel
def find(parent, k):
    """The root of k's class."""
    while parent[k] != k:
        parent[k] = parent[parent[k]]
        k = parent[k]
    return k


@kernel
def union(parent, i, j):
    """Merge the classes of i and j."""
    i = find(parent, i)
    j = find(parent, j)
    if i < j:
        parent[j] = i
    else:
        parent[i] = j


@kernel
def find_with_parity(parent, parity, k):
    """(root of k's class, k's parity against it); parity[k], 0 or 1, is against parent[k]."""
    total = 0
    while parent[k] != k:
        parity[k] ^= parity[parent[k]]
        parent[k] = parent[parent[k]]
        total ^= parity[k]
        k = parent[k]
    return k, total


@kernel
def union_with_parity(parent, parity, i, j, against):
    """Merge the classes of i and j, whose parities differ (against = 1) or not (0).

    Returns False where i and j already share a class with parities in contradiction to ``against``.
    """
    i, parity_i = find_with_parity(parent, parity, i)
    j, parity_j = find_with_parity(parent, parity, j)
    if i == j:
        return (parity_i ^ parity_j) == against
    if i > j:
        i, j = j, i
    parent[j] = i
    parity[j] = parity_i ^ parity_j ^ against
    return True
