"""Walks down a support tree: scan the coarsest subset, then the candidate list of the winner, and so on.

Every list holds the vertices of the next subset whose normal cones meet the normal cone of the list's
owner, so the walk ends at the extreme vertex, up to the rounding of the products compared. The number
of lists is logarithmic in the number of vertices, the length of a list does not depend on it.
Nested subsets of a hull's vertices are Dobkin and Kirkpatrick's ("Fast detection of polyhedral
intersection", 1983); lists of all that a coarse answer leaves possible are Clarkson's ("A randomized
algorithm for closest-point queries", 1988).
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.support.block_scan import farthest_listed
from collide.support.extreme_vertex import SCANNED, climb
from collide.support.support_tree import (
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
    SupportTree,
)  # fmt: skip

#: Operations counted: see `extreme_vertices`.
COUNTERS = 4


@kernel(inline=True)
def _scan(nodes, entries, coordinates, node, gx, gy, gz):
    """(entry, where its x stands, length) of the best of node's list."""
    begin = nodes[node]
    count = nodes[node + 1] - begin
    k, _ = farthest_listed(coordinates, 3 * begin, count, count, gx, gy, gz)
    return entries[begin + k], 3 * begin + k, count


@kernel
def walk(nodes, entries, coordinates, listed, depth, gx, gy, gz, counters):
    """(entry, x, y, z, the list it stands in) that ``depth`` ≥ 1 scans from a list on lead to.

    Counts entries scanned where counters has room.
    """
    node = listed
    at = 0
    count = 0
    for _ in range(depth):
        listed = node
        node, at, count = _scan(nodes, entries, coordinates, node, gx, gy, gz)
        if len(counters) > 0:
            counters[SCANNED] += count
    return node, coordinates[at], coordinates[at + count], coordinates[at + 2 * count], listed


@kernel(inline=True)
def _lists_of(tree_at, listed):
    """(nodes, entries, coordinates, how many scans)."""
    header = view_i64(tree_at, HEADER)
    nodes = view_i32(header[AT_NODES], header[NODES] + 1)
    entries = view_i32(header[AT_ENTRIES], header[ENTRIES])
    coordinates = view_f64(header[AT_LIST_COORDINATES], 3 * header[ENTRIES])
    return nodes, entries, coordinates, header[DEPTH] if listed < 0 else 1


@kernel
def extreme_vertex_listed(tree_at, listed, gx, gy, gz, counters):
    """(id, x, y, z, list): `extreme_vertex` and the last list; or the best of one of its last lists alone.

    listed : such a list, or −1 for the whole walk. While directions change little the list stays the same, so that
        one scan often finds what the walk would; whether it has is for the caller to ask in the end.
    counters : (COUNTERS,) int64 that is added to, or empty.
    """
    nodes, entries, coordinates, depth = _lists_of(tree_at, listed)
    return walk(nodes, entries, coordinates, max(listed, 0), depth, gx, gy, gz, counters)


@kernel(inline=True)
def two_extreme_vertices(tree_a, listed_a, ax, ay, az, tree_b, listed_b, bx, by, bz):
    """`extreme_vertex_listed` of two trees, a scan of one and a scan of the other in turns; nothing is counted.

    A scan waits for the one before it more than it works: in turns, both walks take hardly longer than one.
    """
    nodes_a, entries_a, coordinates_a, depth_a = _lists_of(tree_a, listed_a)
    nodes_b, entries_b, coordinates_b, depth_b = _lists_of(tree_b, listed_b)
    node_a = max(listed_a, 0)
    node_b = max(listed_b, 0)
    at_a = at_b = count_a = count_b = 0
    for level in range(max(depth_a, depth_b)):
        if level < depth_a:
            listed_a = node_a
            node_a, at_a, count_a = _scan(nodes_a, entries_a, coordinates_a, node_a, ax, ay, az)
        if level < depth_b:
            listed_b = node_b
            node_b, at_b, count_b = _scan(nodes_b, entries_b, coordinates_b, node_b, bx, by, bz)
    return (
        node_a, coordinates_a[at_a], coordinates_a[at_a + count_a], coordinates_a[at_a + 2 * count_a], listed_a,
        node_b, coordinates_b[at_b], coordinates_b[at_b + count_b], coordinates_b[at_b + 2 * count_b], listed_b,
    )  # fmt: skip


@kernel
def extreme_vertex(tree_at, gx, gy, gz):
    """(id, x, y, z): a vertex farthest in direction g, up to rounding, and its coordinates. O(log n).

    tree_at : `SupportTree.address`. id : row of the tree's points. Not proven: see `settle_vertex`.
    """
    vertex, x, y, z, _ = extreme_vertex_listed(tree_at, -1, gx, gy, gz, view_i64(0, 0))
    return vertex, x, y, z


@kernel
def rings_of(tree_at):
    """(starts, ring, corners): the hull neighbours of row i are ring[starts[i]] … ring[starts[i + 1] − 1].

    The coordinates of row i stand at corners[3·i], next to each other, which saves two of three cache misses.
    """
    header = view_i64(tree_at, HEADER)
    return (
        view_i32(header[AT_RING_STARTS], header[POINTS] + 1), view_i32(header[AT_RING], header[LINKS]),
        view_f64(header[AT_POINTS], 3 * header[POINTS]),
    )  # fmt: skip


@entry("void(int64, int64, int64, boolean, int64, int64)")
def many_extreme_vertices(tree_at, directions_at, n, settled, ids_at, counters_at):
    """Ids for n directions; ``counters_at`` is 0 where nothing is to be counted."""
    directions = view_f64(directions_at, 3 * n)
    ids = view_i64(ids_at, n)
    counters = view_i64(counters_at, COUNTERS if counters_at != 0 else 0)
    for i in range(n):
        gx = directions[3 * i]
        gy = directions[3 * i + 1]
        gz = directions[3 * i + 2]
        vertex, _, _, _, _ = extreme_vertex_listed(tree_at, -1, gx, gy, gz, counters)
        if settled:
            vertex = climb(tree_at, vertex, gx, gy, gz, counters)
        ids[i] = vertex


def extreme_vertices(
    tree: SupportTree, directions: np.ndarray, settled: bool = True, counters: np.ndarray | None = None
) -> np.ndarray:
    """(n,) ids of vertices farthest in ``directions`` (n, 3).

    settled : proven exactly; an id below 0 is then ``-1 - id`` of a vertex that could not be proven, since
        the direction's components differ by too many powers of two (see `extreme_vertex.py`).
    counters : (COUNTERS,) int64 that entries scanned, climbing steps, neighbours looked at and exact
        signs are added to.
    """
    directions = np.ascontiguousarray(directions, dtype=np.float64)
    if directions.ndim != 2 or directions.shape[1] != 3 or not np.isfinite(directions).all():
        raise ValueError("directions must be (n, 3) and finite")
    if counters is not None and (counters.dtype != np.int64 or counters.shape != (COUNTERS,)):
        raise ValueError(f"counters must be ({COUNTERS},) of int64")
    ids = np.empty(len(directions), dtype=np.int64)
    many_extreme_vertices(
        tree.address, address_of(directions), len(directions), settled, address_of(ids), 0 if counters is None else address_of(counters),
    )  # fmt: skip
    return ids
