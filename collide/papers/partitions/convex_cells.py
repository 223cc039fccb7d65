"""Cells of a partition as convex polytopes, their vertices named by planes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from collide.papers.partitions.cut_polygons import Edges, Polygons, cut_polygons, edge_rows, joined
from collide.papers.partitions.finished_tree import FinishedTree
from collide.papers.partitions.vertices import Vertices

#: Leaves made at once.
_AT_ONCE = 8192


class CellBlock(NamedTuple):
    """Some leaves of a partition, clipped by a box.

    leaf : (c,) their numbers; for a cut taken as a cell, the first leaf below the cut.
    faces : their faces, sorted by `cell`, which counts rows of `leaf`.
    vertices, edges : of the faces; counter-clockwise seen from outside.
    """

    leaf: np.ndarray
    faces: Polygons
    vertices: Vertices
    edges: Edges


def cell_blocks(
    tree: FinishedTree, leaves: np.ndarray, low: np.ndarray, high: np.ndarray, whole: np.ndarray | None = None
) -> Iterator[CellBlock]:
    """Leaves (sorted numbers) within the box low … high, in blocks; leaves outside are left out.

    whole : (cuts,) bool, cuts whose subtree is a single cell: `leaves` has the first leaf of its subtree.
    """
    if whole is None:
        whole = np.zeros(len(tree.plane), dtype=bool)
    for begin in range(0, len(leaves), _AT_ONCE):
        wanted = np.zeros(tree.n_leaves + 1, dtype=np.int64)
        wanted[leaves[begin : begin + _AT_ONCE] + 1] = 1
        yield _block(tree, whole, np.cumsum(wanted), low, high)


def _block(tree: FinishedTree, whole: np.ndarray, wanted: np.ndarray, low, high) -> CellBlock:
    vertices, edges = Vertices(tree.planes.with_own_axis_planes()), Edges()
    faces, place = _box(vertices, edges, low, high), np.zeros(1, dtype=np.int64)
    done: list[tuple[np.ndarray, Polygons]] = []
    while len(place):
        cut = tree.below[place]
        inner = cut >= 0
        at = np.where(inner, cut, 0)
        first, last = np.where(inner, tree.first[at], ~cut), np.where(inner, tree.last[at], ~cut)
        some = wanted[last + 1] > wanted[first]
        inner &= ~whole[at]
        ended = some & ~inner
        if ended.any():
            done.append((first[ended], _of_cells(faces, ended)))
        selected = some & inner
        place, faces = _cut_cells(vertices, edges, _of_cells(faces, selected), cut[selected], tree.plane[cut[selected]])
    if not done:
        nothing = np.zeros(0, dtype=np.int64)
        return CellBlock(nothing, Polygons(*(nothing,) * 5), vertices, edges)
    begins = np.cumsum([0] + [len(leaf) for leaf, _ in done])
    faces = joined(*(replace(part, cell=part.cell + begin) for begin, (_, part) in zip(begins, done)))
    leaf = np.concatenate([leaf for leaf, _ in done])
    order = np.argsort(leaf)
    rank = np.empty(len(leaf), dtype=np.int64)
    rank[order] = np.arange(len(leaf))
    faces = replace(faces, cell=rank[faces.cell])
    return CellBlock(leaf[order], faces[np.argsort(faces.cell, kind="stable")], vertices, edges)


def cells_within(vertices: Vertices, edges: Edges, low, high, first, count, planes, sides) -> Polygons:
    """The faces of cells: the box low … high within the half-spaces of planes first[i] … first[i] + count[i] − 1.

    first, count : (c,).   planes, sides : numbers of planes, and where cells lie of them: 1 above, −1 below.
    """
    n = len(first)
    box = _box(vertices, edges, low, high)
    rows, _ = edge_rows(box)
    vertex, carrier = edges.vertex.rows[rows], edges.carrier.rows[rows]
    begin = edges.add(np.tile(vertex, n), np.tile(carrier, n))[::4]  # a cut renames edges: every cell has its own
    cell = np.repeat(np.arange(n), 6)
    faces = Polygons(np.tile(box.plane, n), cell, begin, np.full(6 * n, 4), np.tile(box.side, n))
    for k in range(int(count.max(initial=0))):
        cut = count > k
        selected = np.flatnonzero(cut)
        at = first[selected] + k
        place, halfspaces = _cut_cells(vertices, edges, _of_cells(faces, cut), np.arange(len(at)), planes[at])
        of, is_below = (place - 1) // 2, place % 2 == 1
        wanted = is_below == (sides[at[of]] < 0)
        if not np.array_equal(np.sort(of[wanted]), np.arange(len(at))):
            raise AssertionError("half-spaces of a cell have no common volume: please report it")
        halfspaces = _of_cells(halfspaces, wanted)
        rest = faces[~cut[faces.cell]]
        faces = joined(rest, replace(halfspaces, cell=selected[of[wanted][halfspaces.cell]]))
        faces = faces[np.argsort(faces.cell, kind="stable")]
    return faces


def _of_cells(faces: Polygons, selected: np.ndarray) -> Polygons:
    """The faces of some of the cells, which are numbered anew."""
    number = np.cumsum(selected) - 1
    faces = faces[selected[faces.cell]]
    return replace(faces, cell=number[faces.cell])


def _box(vertices: Vertices, edges: Edges, low: np.ndarray, high: np.ndarray) -> Polygons:
    """The six faces of a box."""
    planes = vertices.planes.add_axis_planes(np.tile(np.arange(3), 2), np.concatenate((low, high)))
    which = (np.arange(8)[:, None] >> np.arange(3)) & 1
    corners = vertices.add(
        np.where(which, high, low), np.zeros(8), planes[np.arange(3) + 3 * which]
    )  # corner k is high along the axes whose bits it has
    loops, carriers = [], []
    for side in (0, 1):
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            loop = [(0, 0), (1, 0), (1, 1), (0, 1)]
            rims = [(v, 0), (u, 1), (v, 1), (u, 0)]
            if not side:
                loop, rims = [loop[k] for k in (0, 3, 2, 1)], [rims[k] for k in (3, 2, 1, 0)]
            loops += [corners[(side << axis) + (a << u) + (b << v)] for a, b in loop]
            carriers += [planes[k + 3 * s] for k, s in rims]
    begin = edges.add(np.array(loops), np.array(carriers))[::4]
    return Polygons(planes, np.zeros(6, dtype=np.int64), begin, np.full(6, 4), np.repeat([1, -1], 3))


def _cut_cells(vertices, edges, faces: Polygons, cuts: np.ndarray, planes: np.ndarray) -> tuple[np.ndarray, Polygons]:
    """Cut cells by a plane each; returns (the places of what has a volume, its faces)."""
    n = len(cuts)
    if n == 0:
        return cuts, faces
    cut = cut_polygons(vertices, edges, faces, planes[faces.cell], shared=True)
    has = np.zeros((2, n), dtype=bool)
    has[0, faces.cell[cut.below]] = True
    has[1, faces.cell[cut.above]] = True
    through = np.all(has, axis=0)
    rows, owner = edge_rows(faces)
    groups = []
    for side, mine, opposite, pieces in ((0, cut.below, cut.above, cut.minus), (1, cut.above, cut.below, cut.plus)):
        # Faces in the plane itself belong to the cell that stays whole; faces cut in two leave pieces.
        whole = np.flatnonzero(~opposite & (mine | has[side, faces.cell]) & (mine | ~through[faces.cell]))
        _rename_edges_in_planes(edges, faces, rows, owner, cut.sign, mine & ~opposite & through[faces.cell], planes)
        group = joined(faces[whole], pieces)
        caps = _caps(edges, group[through[group.cell]], planes, 2 * side - 1)
        group = joined(group, caps)
        groups.append(replace(group, cell=side * n + group.cell))
    places = np.concatenate((2 * cuts + 1, 2 * cuts + 2))
    return places[has.ravel()], _of_cells(joined(*groups), has.ravel())


def _rename_edges_in_planes(edges, faces, rows, owner, sign, mine, planes) -> None:
    """Set the cutting plane as the carrier of uncut faces' edges in the plane."""
    following = np.arange(1, len(rows) + 1)
    ends = np.cumsum(faces.count)
    following[ends - 1] = ends - faces.count
    flat = mine[owner] & (sign == 0) & (sign[following] == 0)
    edges.carrier.rows[rows[flat]] = planes[faces.cell[owner[flat]]]


def _caps(edges: Edges, faces: Polygons, planes: np.ndarray, side: int) -> Polygons:
    """The face made in each cell by a cut: a loop of the edges in the plane of the cell's other faces."""
    rows, owner = edge_rows(faces)
    following = rows + 1
    ends = np.cumsum(faces.count)
    following[ends - 1] = faces.begin
    cap_edges = np.flatnonzero(edges.carrier.rows[rows] == planes[faces.cell[owner]])
    cell = faces.cell[owner[cap_edges]]
    # The face runs along them the other way round.
    tail, head = edges.vertex.rows[following[cap_edges]], edges.vertex.rows[rows[cap_edges]]
    order = np.lexsort((tail, cell))
    cell, tail, head, carrier = cell[order], tail[order], head[order], faces.plane[owner[cap_edges]][order]
    next_ = np.searchsorted((cell << 32) + tail, (cell << 32) + head)
    first = np.flatnonzero(np.append(True, np.diff(cell) != 0)) if len(cell) else np.zeros(0, dtype=np.int64)
    count = np.diff(np.append(first, len(cell)))
    loop = np.empty(len(cell), dtype=np.int64)
    at = first.copy()
    for k in range(int(count.max(initial=0))):
        longer = count > k
        loop[first[longer] + k] = at[longer]
        at[longer] = next_[at[longer]]
    if not np.array_equal(at, first):
        raise AssertionError("the faces of a cell do not close: please report it")
    begin = edges.add(tail[loop], carrier[loop])[first] if len(loop) else first
    whose = cell[first]
    return Polygons(planes[whose], whose, begin, count, np.full(len(whose), side))
