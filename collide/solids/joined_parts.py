"""The parts into which facets fall along edges, and other components of graphs: union–find."""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_i32, view_u8
from collide.mesh.union_find import find, union


def uncut_parts(links: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """(n,) int32: for each whole facet the least facet of its part, whole facets joined along edges of two; −1 for
    others.

    links : (2, m) int32, the facets on both sides of each edge of two.   whole : (n,) bool. O(n), nearly.
    """
    return _joined(whole, *links)


def components(n: int, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) int32: the least number of each component of a graph with edges a[k] – b[k]; O(n + k), nearly."""
    return _joined(np.ones(n, dtype=bool), a, b)


def _joined(wanted: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(n,) the least number of each component of the wanted ones; −1 for others."""
    a, b = (np.ascontiguousarray(x, dtype=np.int32) for x in (a, b))
    root = np.empty(len(wanted), dtype=np.int32)
    join_pairs(address_of(wanted.view(np.uint8)), address_of(root), len(wanted), address_of(a), address_of(b), len(a))
    return root


@entry("void(int64, int64, int64, int64, int64, int64)")
def join_pairs(wanted_at, root_at, n, a_at, b_at, k):
    """root : out, for each of n wanted numbers the least number joined by pairs a – b; −1 for unwanted numbers."""
    wanted = view_u8(wanted_at, n)
    root = view_i32(root_at, n)
    a = view_i32(a_at, k)
    b = view_i32(b_at, k)
    for i in range(n):
        root[i] = i
    for i in range(k):
        if wanted[a[i]] != 0 and wanted[b[i]] != 0:
            union(root, a[i], b[i])
    for i in range(n):
        root[i] = find(root, i) if wanted[i] != 0 else -1
