"""Descents of a support tree: scan the coarsest subset, then the candidate list of the winner, and so on.

Every list holds the vertices of the next subset whose normal cones meet the normal cone of the list's
owner, so the descent ends at the extreme vertex, up to the rounding of the products compared. The number
of lists is logarithmic in the number of vertices, the length of a list does not depend on it.
Nested subsets of a hull's vertices are Dobkin and Kirkpatrick's ("Fast detection of polyhedral
intersection", 1983); lists of all that a coarse answer leaves possible are Clarkson's ("A randomized
algorithm for closest-point queries", 1988).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.vec3 import Vec3, vec3_at
from collide.support.block_scan import farthest_listed
from collide.support.extreme_vertex import SCANNED, climb
from collide.support.support_tree import SupportTree
from collide.support.tree_layout import (
    AT_ENTRIES,
    AT_LIST_COORDINATES,
    AT_NODES,
    AT_POINTS,
    AT_RING,
    AT_RING_STARTS,
    DEPTH,
    ENTRIES,
    HEADER,
    LINKS,
    NODES,
    POINTS,
)

#: Operations counted: see `extreme_vertices`.
COUNTERS = 4


class SupportPoint(NamedTuple):
    """The farthest point of a set in a direction.   id : of the vertex; −1 on curved sets.

    list_id : the list of the support tree that the vertex stands in, for `extreme_vertex_listed`.
    """

    id: int
    point: Vec3
    list_id: int


class Lists(NamedTuple):
    """Candidate lists of a support tree, as `SupportTree` names them.   depth : how many are scanned one after
    another."""

    nodes: Any
    entries: Any
    coordinates: Any
    depth: int


@kernel(inline=True)
def _scan(lists, node, g):
    """(entry, where its x stands, length) of the best of node's list."""
    begin = lists.nodes[node]
    count = lists.nodes[node + 1] - begin
    k, _ = farthest_listed(lists.coordinates, 3 * begin, count, count, g.x, g.y, g.z)
    return lists.entries[begin + k], 3 * begin + k, count


@kernel
def descend_lists(lists, list_id, g, counters):
    """The `SupportPoint` that ``lists.depth`` ≥ 1 scans lead to, from a list on; its id is an entry of the last list.

    Counts entries scanned where counters is not empty.
    """
    node = list_id
    at = 0
    count = 0
    for _ in range(lists.depth):
        list_id = node
        node, at, count = _scan(lists, node, g)
        if len(counters) > 0:
            counters[SCANNED] += count
    return SupportPoint(np.int64(node), _listed_point(lists, at, count), np.int64(list_id))


@kernel(inline=True)
def _listed_point(lists, at, count):
    coordinates = lists.coordinates
    return Vec3(coordinates[at], coordinates[at + count], coordinates[at + 2 * count])


@kernel(inline=True)
def _lists_of(tree_at, list_id):
    """The lists of a tree, with how many scans lead from a list (−1: the first) to a vertex."""
    header = view_i64(tree_at, HEADER)
    return Lists(
        view_i32(header[AT_NODES], header[NODES] + 1), view_i32(header[AT_ENTRIES], header[ENTRIES]),
        view_f64(header[AT_LIST_COORDINATES], 3 * header[ENTRIES]), header[DEPTH] if list_id < 0 else np.int64(1),
    )


@kernel
def extreme_vertex_listed(tree_at, list_id, g, counters):
    """`extreme_vertex`, with the last list scanned; or the best of a single last list.

    list_id : a list of the last level, or −1 for the whole descent. While directions change little the list stays the
        same, so that a single scan often finds the vertex of the descent; the caller has to prove the vertex in the
        end.
    counters : (COUNTERS,) int64 to add to, or empty.
    """
    return descend_lists(_lists_of(tree_at, list_id), max(list_id, 0), g, counters)


@kernel(inline=True)
def two_extreme_vertices(tree_a, list_a, g_a, tree_b, list_b, g_b):
    """`extreme_vertex_listed` of two trees, their scans in turns; nothing is counted.

    A scan spends more time waiting for the previous scan of its tree than working: in turns, both descents take hardly
    longer than a single descent.
    """
    lists_a = _lists_of(tree_a, list_a)
    lists_b = _lists_of(tree_b, list_b)
    node_a = max(list_a, 0)
    node_b = max(list_b, 0)
    at_a = at_b = count_a = count_b = 0
    for level in range(max(lists_a.depth, lists_b.depth)):
        if level < lists_a.depth:
            list_a = node_a
            node_a, at_a, count_a = _scan(lists_a, node_a, g_a)
        if level < lists_b.depth:
            list_b = node_b
            node_b, at_b, count_b = _scan(lists_b, node_b, g_b)
    return (
        SupportPoint(np.int64(node_a), _listed_point(lists_a, at_a, count_a), np.int64(list_a)),
        SupportPoint(np.int64(node_b), _listed_point(lists_b, at_b, count_b), np.int64(list_b)),
    )


@kernel
def extreme_vertex(tree_at, g):
    """The `SupportPoint` of a vertex farthest in direction g, up to rounding. O(log n).

    tree_at : `SupportTree.address`. id : row of the tree's points. Not proven: see `settle_vertex`.
    """
    return extreme_vertex_listed(tree_at, -1, g, view_i64(0, 0))


@kernel
def rings_of(tree_at):
    """(starts, ring, corners): the hull neighbours of row i are ring[starts[i]] … ring[starts[i + 1] − 1].

    The coordinates of row i stand at corners[3·i], next to each other, which saves two of three cache misses.
    """
    header = view_i64(tree_at, HEADER)
    return (
        view_i32(header[AT_RING_STARTS], header[POINTS] + 1), view_i32(header[AT_RING], header[LINKS]),
        view_f64(header[AT_POINTS], 3 * header[POINTS]),
    )


@entry("void(int64, int64, int64, boolean, int64, int64)")
def write_extreme_vertices(tree_at, directions_at, n, settled, ids_at, counters_at):
    """Ids for n directions; ``counters_at`` is 0 where nothing is to be counted."""
    directions = view_f64(directions_at, 3 * n)
    ids = view_i64(ids_at, n)
    counters = view_i64(counters_at, COUNTERS if counters_at != 0 else 0)
    for i in range(n):
        g = vec3_at(directions, 3 * i)
        vertex = extreme_vertex_listed(tree_at, -1, g, counters).id
        if settled:
            vertex = climb(tree_at, vertex, g, counters)
        ids[i] = vertex


def extreme_vertices(
    tree: SupportTree, directions: np.ndarray, settled: bool = True, counters: np.ndarray | None = None
) -> np.ndarray:
    """(n,) ids of vertices farthest in ``directions`` (n, 3).

    settled : proven exactly; an id below 0 is then ``-1 - id`` of a vertex not proven, since the direction's components
        differ by too many powers of two (see `extreme_vertex.py`).
    counters : (COUNTERS,) int64: entries scanned, climbing steps, neighbours looked at and exact signs are added.
    """
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    if directions.ndim != 2 or directions.shape[1] != 3 or not np.isfinite(directions).all():
        raise ValueError("directions must be (n, 3) and finite")
    if counters is not None and (counters.dtype != np.int64 or counters.shape != (COUNTERS,)):
        raise ValueError(f"counters must be ({COUNTERS},) of int64")
    ids = np.empty(len(directions), dtype=np.int64)
    write_extreme_vertices(
        tree.address, address_of(directions), len(directions), settled, address_of(ids),
        0 if counters is None else address_of(counters),
    )
    return ids
