"""A support tree made of a hull, in kernels: nested subsets of its vertices, and candidate lists between them.

Python (`build_support_tree.py`) and C (`native/capi_tree.c`) call the entries in this order: `tree_memory` tells how
much memory `grow_tree` works in, `grow_tree` makes the tree, and `keep_tree` writes the tree into a block.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.hull.quickhull import FACETS_AT, HULL_EACH, HULL_FIXED, N_FACETS, grow_hull
from collide.hull.triangle_neighbours import (
    SIDE_WORDS_FIXED,
    SIDE_WORDS_OF_POINT,
    SIDE_WORDS_OF_TRIANGLE,
    side_workspace,
)
from collide.kernels import entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.vec3 import Vec3, add, put_vec3, sub, vec3_at
from collide.support.candidate_lists import STACK, ListWorkspace, candidate_lists
from collide.support.nested_subsets import nested_order
from collide.support.rings import FlatWorkspace, Rings, put_rings
from collide.support.support_tree_query import Lists
from collide.support.tree_layout import (
    AT_ENTRIES,
    AT_LIST_COORDINATES,
    AT_NODES,
    AT_POINTS,
    AT_RANGE,
    AT_RING,
    AT_RING_STARTS,
    DEPTH,
    ENTRIES,
    FEWEST,
    FLAT,
    HEADER,
    LINKS,
    NODES,
    POINTS,
    write_range,
)

#: Vertices to one of the next coarser subset: at the finest level, where lists decide the memory, and above.
#: Measured on spheres, where lists of 24 have 37 entries: 32 makes gaps 5 to 10 % slower and takes 3 bytes less, 16
#: is as fast and takes 5 more.
FINE_RATIO, RATIO = 24, 16
#: Scanned as a whole: a hull of at most so many vertices, and a subset.
SMALL_HULL, LARGEST_SCAN = 160, 100
#: A vertex with more neighbours stays out of coarse subsets: all its neighbours would be its candidates.
HIGHEST_DEGREE = 48
#: Owners of longer lists are moved out of the coarse subsets, and the tree is built again, a few times.
LONGEST_LIST = 384
_ATTEMPTS = 6
#: Subsets fall by RATIO at least.
_MAX_LEVELS = 16

#: What `grow_tree` returns where it has not made a tree.
NOT_CLOSED, UNUSED_VERTEX, UNSOUND = -1, -2, -3
#: Integers of the header in memory: bytes to be kept, what has been made so far; then the subsets' sizes.
BYTES, N_NODES, N_ENTRIES, N_LEVELS, IS_FLAT, SIZES = range(6)
_HEADER = SIZES + _MAX_LEVELS


class _Growing(NamedTuple):
    """A tree while levels are added to it, coarsest first.

    points : (n + 1, 3), scaled.   header : counts of levels, nodes, entries.   n, n_subset : points, in the largest
    subset.
    vertices, late : (n,) of the hull, and whether each comes last.   normals : (n, 3), where each is extreme.
    places, scratch : (n,) of workspace.   ordered : (n,) vertices, subset k the first so many.   place : of each point.
    nodes, owners, entries, coordinates : as `SupportTree` has them.   rows : of the entries' points.
    max_entries : the most that fit.   subset_at, hull_at : where a subset's hull is made.
    """

    points: Any
    header: Any
    n: int
    n_subset: int
    vertices: Any
    late: Any
    normals: Any
    places: Any
    scratch: Any
    ordered: Any
    place: Any
    rings: Rings
    subset_rings: Rings
    flat_workspace: FlatWorkspace
    list_workspace: ListWorkspace
    nodes: Any
    owners: Any
    entries: Any
    rows: Any
    coordinates: Any
    max_entries: int
    subset_at: int
    hull_at: int


@kernel
def _rings_at(at, n, n_facets):
    """(`Rings` for two facets and a point more, where they end)."""
    m = n_facets + 2
    normals = view_f64(at, 3 * m)
    at += 24 * m
    rings = Rings(
        view_i32(at + 48 * m, n + 2), view_i32(at, 3 * m), view_i32(at + 12 * m, 3 * m), normals,
        view_i32(at + 48 * m + 4 * n + 8, n + 1), view_i32(at + 24 * m, 6 * m),
    )
    return rings, at + 48 * m + 8 * n + 16


@kernel
def _growing(at, n, n_facets, capacity):
    """(a tree without levels, where its memory ends).   capacity : the most pairs of candidates that fit."""
    m, n_subset, max_entries = n_facets + 2, n // FINE_RATIO + 1, 2 * capacity
    header = view_i64(at, _HEADER)
    at += 8 * _HEADER
    points, normals, coordinates = view_f64(at, 3 * n + 3), view_f64(at + 24 * n + 24, 3 * n), at + 48 * n + 24
    at = coordinates + 24 * max_entries
    vertices, late, places, scratch = (
        view_i64(at, n), view_i64(at + 8 * n, n), view_i64(at + 16 * n, n), view_i64(at + 24 * n, n),
    )
    ordered, place = view_i64(at + 32 * n, n), view_i64(at + 40 * n, n)
    at += 48 * n
    rings, at = _rings_at(at, n, n_facets)
    subset_rings, at = _rings_at(at, n, 2 * n_subset)
    sides_at = at + 24 * n
    closed_at = sides_at + 8 * (SIDE_WORDS_OF_TRIANGLE * m + SIDE_WORDS_OF_POINT * n + SIDE_WORDS_FIXED)
    flat_workspace = FlatWorkspace(
        side_workspace(sides_at, n, m), view_i64(at, n), view_i64(at + 8 * n, n), view_i64(at + 16 * n, n),
        view_i32(closed_at, 3 * m),
    )
    at = closed_at + 16 * m
    subset_at, hull_at = at, at + 24 * n_subset
    at = hull_at + HULL_EACH * n_subset + HULL_FIXED
    list_workspace = ListWorkspace(
        view_i32(at + 16 * STACK, 2 * capacity), view_i32(at + 16 * STACK + 8 * capacity, n + 1),
        view_i32(at + 16 * STACK + 8 * capacity + 4 * n + 4, capacity),
        view_i32(at + 16 * STACK + 12 * capacity + 4 * n + 4, n),
        view_i32(at + 16 * STACK + 12 * capacity + 8 * n + 4, n), view_f64(at, 2 * STACK), capacity,
    )
    at += 16 * STACK + 12 * capacity + 12 * n + 8
    tree = _Growing(
        points, header, n, n_subset, vertices, late, normals, places, scratch, ordered, place, rings, subset_rings,
        flat_workspace, list_workspace, view_i32(at, n + 2), view_i32(at + 4 * n + 8, n + 2),
        view_i32(at + 8 * n + 16, max_entries), view_i32(at + 8 * n + 16 + 4 * max_entries, max_entries),
        view_f64(coordinates, 3 * max_entries), max_entries, subset_at, hull_at,
    )
    return tree, at + 8 * n + 16 + 8 * max_entries


@entry("int64(int64, int64, int64)")
def tree_memory(n, n_facets, capacity):
    """Bytes that `grow_tree` works in."""
    return _growing(0, n, n_facets, capacity)[1] + 8


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64)")
def grow_tree(points_at, n, vertices_at, n_vertices, facets_at, n_facets, memory_at, capacity):
    """Make a support tree over the hull of points (n, 3).

    vertices, facets : rows of its n_vertices vertices and n_facets triangles, 32-bit integers, of a flat hull the
        triangles of both sides, as `exact_hull.convex_hull` gives them.
    memory : as many bytes as `tree_memory` says, out: what `keep_tree` copies, its header first.
    capacity : the most pairs of candidates that fit; 8 a vertex and some are mostly enough.

    Returns 0; NOT_CLOSED, UNUSED_VERTEX, UNSOUND of a surface so degenerate that no order of neighbours is certain;
    the capacity to call with again where more is wanted. Expected O(h log h).
    """
    tree, _ = _growing(memory_at, n, n_facets, capacity)
    vertices, facets = view_i32(vertices_at, n_vertices), view_i32(facets_at, 3 * n_facets)
    return _grow(tree, view_f64(points_at, 3 * n), vertices, n_vertices, facets, n_facets)


@kernel
def _grow(tree, points, vertices, n_vertices, facets, n_facets):
    header = tree.header
    for k in range(_HEADER):
        header[k] = 0
    _scale(tree, points, vertices, n_vertices)
    flat = put_rings(tree.points, tree.n, facets, n_facets, tree.rings, tree.flat_workspace)
    if flat < 0:
        return NOT_CLOSED
    header[IS_FLAT] = flat
    n_used = _choose_vertices(tree, vertices, n_vertices)
    if n_used == 0:
        return UNUSED_VERTEX
    _put_normals(tree, n_used)
    n_sizes = _put_sizes(header, n_used)
    for attempt in range(_ATTEMPTS):
        _order_vertices(tree, n_used, n_sizes)
        wanted = _add_levels(tree, n_sizes)
        if wanted != 0:
            return wanted
        if not _is_sound(tree):
            return UNSOUND
        if attempt == _ATTEMPTS - 1 or not _move_owners_of_long_lists(tree, n_used):
            break
    header[BYTES] = _kept_bytes(tree)
    return 0


@kernel
def _scale(tree, points, vertices, n_vertices):
    """Coordinates times powers of two that make the vertices fill a cube.

    Cones keep their order under scaling along axes, and powers of two round nothing: normals of pancakes and needles
    are then as good as a ball's.
    """
    for axis in range(3):
        low = points[3 * vertices[0] + axis]
        high = low
        for k in range(1, n_vertices):
            value = points[3 * vertices[k] + axis]
            low = min(low, value)
            high = max(high, value)
        extent = high - low
        exponent = math.frexp(extent if extent > 0.0 else 1.0)[1]
        for k in range(tree.n):
            tree.points[3 * k + axis] = math.ldexp(points[3 * k + axis], -exponent)


@kernel
def _choose_vertices(tree, vertices, n_vertices):
    """Take the vertices that are corners, all where fewer than 3 are, and mark the vertices to come last; how many, 0
    where a vertex has no facets."""
    starts, corner = tree.rings.starts, tree.rings.corner
    n_corners = 0
    for k in range(n_vertices):
        if starts[vertices[k] + 1] == starts[vertices[k]]:
            return 0
        n_corners += corner[vertices[k]]
    n_used = 0
    for k in range(n_vertices):
        vertex = vertices[k]
        if n_corners < 3 or corner[vertex] != 0:
            tree.late[n_used] = 1 if starts[vertex + 1] - starts[vertex] > HIGHEST_DEGREE else 0
            tree.vertices[n_used] = vertex
            n_used += 1
    return n_used


@kernel
def _put_normals(tree, n_used):
    """A direction in which each vertex is extreme: the sum of its facets' unit normals, as sums over all differ."""
    starts, ring_facets, normals = tree.rings.starts, tree.rings.ring_facets, tree.rings.normals
    for k in range(tree.n):
        tree.place[k] = -1
    for k in range(n_used):
        tree.place[tree.vertices[k]] = k
    total = Vec3(0.0, 0.0, 0.0)
    for vertex in range(tree.n):
        before = total
        for k in range(starts[vertex], starts[vertex + 1]):
            normal = vec3_at(normals, 3 * ring_facets[k])
            total = normal if k == 0 else add(total, normal)
        if tree.place[vertex] >= 0:
            put_vec3(tree.normals, 3 * tree.place[vertex], sub(total, before))


@kernel
def _put_sizes(header, n):
    """Sizes of the nested subsets, finest first, into the header; how many. The last is scanned as a whole."""
    header[SIZES] = n
    n_sizes = 1
    while n_sizes < _MAX_LEVELS and header[SIZES + n_sizes - 1] > (SMALL_HULL if n_sizes == 1 else LARGEST_SCAN):
        ratio = FINE_RATIO if n_sizes == 1 else RATIO
        header[SIZES + n_sizes] = (header[SIZES + n_sizes - 1] + ratio - 1) // ratio
        n_sizes += 1
    return n_sizes


@kernel
def _order_vertices(tree, n_used, n_sizes):
    sizes = tree.header
    nested_order(
        tree.vertices, tree.normals, tree.late, n_used, sizes, SIZES, n_sizes, tree.places, tree.scratch, tree.ordered
    )
    for k in range(tree.n):
        tree.place[k] = -1
    for k in range(n_used):
        tree.place[tree.ordered[k]] = k


# --- levels --------------------------------------------------------------------------------------


@kernel
def _add_levels(tree, n_sizes):
    """All levels, coarsest first. 0; NOT_CLOSED; the capacity to call with again."""
    header, space = tree.header, tree.list_workspace
    header[N_NODES] = 0
    header[N_ENTRIES] = 0
    header[N_LEVELS] = 0
    tree.nodes[0] = 0
    n_top = header[SIZES + n_sizes - 1]
    for k in range(n_top):
        space.pairs[k] = tree.ordered[k]
    space.list_starts[0] = 0
    space.list_starts[1] = n_top
    _add_level(tree, 1, 1 if n_sizes > 1 else -1)
    first_node = 1
    for level in range(n_sizes - 2, -1, -1):
        n_fine, n_coarse = header[SIZES + level], header[SIZES + level + 1]
        if level > 0 and not _put_subset_rings(tree, n_fine):
            return NOT_CLOSED
        lists = Lists(tree.nodes, tree.entries, tree.coordinates, header[N_LEVELS])
        rings = tree.subset_rings if level > 0 else tree.rings
        n_pairs = candidate_lists(
            tree.points, tree.n, tree.ordered, n_fine, rings, lists, tree.ordered, n_coarse, first_node, space
        )
        if n_pairs > space.capacity:
            return n_pairs
        if not _add_level(tree, n_coarse, first_node + n_coarse if level > 0 else -1):
            return 2 * space.capacity
        first_node += n_coarse
    return 0


@kernel
def _put_subset_rings(tree, n_fine):
    """Rings of the hull of the first so many vertices, by rows of all points; whether they could be put in order."""
    subset = view_f64(tree.subset_at, 3 * n_fine)
    for k in range(n_fine):
        put_vec3(subset, 3 * k, vec3_at(tree.points, 3 * tree.ordered[k]))
    grow_hull(tree.subset_at, n_fine, tree.hull_at)
    hull = view_i64(tree.hull_at, 4)
    n_facets = hull[N_FACETS]
    facets = view_i32(hull[FACETS_AT], 3 * n_facets)
    for k in range(3 * n_facets):
        facets[k] = tree.ordered[facets[k]]
    if n_facets < 2 or n_fine < 3:
        return False
    return put_rings(tree.points, tree.n, facets, n_facets, tree.subset_rings, tree.flat_workspace) >= 0


@kernel
def _add_level(tree, n_lists, first):
    """Add the lists of the list workspace; False where the tree has not enough space for them.

    An entry's number is ``first`` and its place in the order, or the row itself where first < 0. Short lists are filled
    up with their first entry. Owners are the first vertices, but of the coarsest list.
    """
    header, starts, listed = tree.header, tree.list_workspace.list_starts, tree.list_workspace.pairs
    at, node = header[N_ENTRIES], header[N_NODES]
    for i in range(n_lists):
        length = starts[i + 1] - starts[i]
        filled = max(length, FEWEST)
        if at + filled > tree.max_entries:
            return False
        for k in range(filled):
            row = listed[starts[i] + (k if k < length else 0)]
            tree.rows[at + k] = row
            tree.entries[at + k] = row if first < 0 else first + tree.place[row]
            _put_column(tree.coordinates, 3 * at + k, filled, vec3_at(tree.points, 3 * row))
        at += filled
        tree.owners[node] = tree.ordered[i] if node > 0 else -1
        node += 1
        tree.nodes[node] = at
    header[N_ENTRIES] = at
    header[N_NODES] = node
    header[N_LEVELS] += 1
    return True


@kernel
def _put_column(coordinates, at, n, p):
    coordinates[at] = p.x
    coordinates[at + n] = p.y
    coordinates[at + 2 * n] = p.z


@kernel
def _is_sound(tree):
    """Whether kernels stay inside the arrays and come to an end: entries of a level lead to the nodes of the next, all
    of them, of the last to vertices, and neighbours have neighbours."""
    starts, ring, header = tree.rings.starts, tree.rings.ring, tree.header
    for k in range(starts[tree.n]):
        if starts[ring[k] + 1] == starts[ring[k]]:
            return False
    first = 0
    end = 1
    for _ in range(header[N_LEVELS] - 1):
        if end >= header[N_NODES] + 1:
            return False
        least = tree.entries[tree.nodes[first]]
        largest = least
        for k in range(tree.nodes[first], tree.nodes[end]):
            least = min(least, tree.entries[k])
            largest = max(largest, tree.entries[k])
        if least != end or largest >= header[N_NODES]:
            return False
        first = end
        end = largest + 1
    for k in range(header[N_ENTRIES]):
        if starts[tree.rows[k] + 1] == starts[tree.rows[k]]:
            return False
    return end == header[N_NODES]


@kernel
def _move_owners_of_long_lists(tree, n_used):
    """Mark the owners of long lists as late; whether there are any."""
    is_long = tree.place
    for k in range(tree.n):
        is_long[k] = 0
    is_any = False
    for node in range(1, tree.header[N_NODES]):
        if tree.nodes[node + 1] - tree.nodes[node] > LONGEST_LIST:
            is_long[tree.owners[node]] = 1
            is_any = True
    for k in range(n_used):
        if is_long[tree.vertices[k]] != 0:
            tree.late[k] = 1
    return is_any


# --- what is kept --------------------------------------------------------------------------------


@kernel
def _padded(n):
    """Bytes of so many 32-bit integers, a multiple of 8."""
    return (4 * n + 7) // 8 * 8


@kernel
def _kept_bytes(tree):
    n_nodes, n_entries, n_links = tree.header[N_NODES], tree.header[N_ENTRIES], tree.rings.starts[tree.n]
    integers = 2 * _padded(n_nodes + 1) + _padded(n_entries) + _padded(tree.n + 1) + _padded(n_links)
    return 8 * HEADER + 24 + 24 * n_entries + integers


@entry("void(int64, int64, int64, int64, int64, int64)")
def keep_tree(points_at, n, n_facets, memory_at, capacity, block_at):
    """Write the tree left in memory by `grow_tree` into a block of as many bytes as its header says.

    The block begins with the header of `support_tree.py`, followed by range, coordinates, nodes, owners, entries,
    rings.
    """
    tree, _ = _growing(memory_at, n, n_facets, capacity)
    points, header = view_f64(points_at, 3 * n), view_i64(block_at, HEADER)
    n_nodes, n_entries, n_links = tree.header[N_NODES], tree.header[N_ENTRIES], tree.rings.starts[n]
    header[POINTS] = n
    header[DEPTH] = tree.header[N_LEVELS]
    header[NODES] = n_nodes
    header[ENTRIES] = n_entries
    header[LINKS] = n_links
    header[FLAT] = tree.header[IS_FLAT]
    header[AT_POINTS] = points_at
    header[AT_RANGE] = block_at + 8 * HEADER
    header[AT_LIST_COORDINATES] = header[AT_RANGE] + 24
    header[AT_NODES] = header[AT_LIST_COORDINATES] + 24 * n_entries
    header[AT_ENTRIES] = header[AT_NODES] + 2 * _padded(n_nodes + 1)
    header[AT_RING_STARTS] = header[AT_ENTRIES] + _padded(n_entries)
    header[AT_RING] = header[AT_RING_STARTS] + _padded(n + 1)
    write_range(points, n, view_f64(header[AT_RANGE], 3))
    coordinates = view_f64(header[AT_LIST_COORDINATES], 3 * n_entries)
    for node in range(n_nodes):
        first, end = tree.nodes[node], tree.nodes[node + 1]
        for k in range(first, end):
            _put_column(coordinates, 2 * first + k, end - first, vec3_at(points, 3 * tree.rows[k]))
    _copy(tree.nodes, n_nodes + 1, header[AT_NODES])
    _copy(tree.owners, n_nodes, header[AT_NODES] + _padded(n_nodes + 1))
    _copy(tree.entries, n_entries, header[AT_ENTRIES])
    _copy(tree.rings.starts, n + 1, header[AT_RING_STARTS])
    _copy(tree.rings.ring, n_links, header[AT_RING])


@kernel
def _copy(integers, n, at):
    out = view_i32(at, n)
    for k in range(n):
        out[k] = integers[k]
