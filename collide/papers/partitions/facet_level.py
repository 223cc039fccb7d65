"""The second level of a space partition: each cell of the first cut along planes of the facets in it.

M. S. Paterson, F. F. Yao, "Efficient binary space partitions for hidden-surface removal and solid modeling" (1990).
Facets are taken in random order, and a facet from wall to wall of its cell is taken at once: its plane cuts only
facets that cross the facet (a free cut). k facets make O(k²) cells in expectation. At the end no facet
passes through a cell. Each pivot is the witness of its cut (`leaf_labels.py`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from collide.papers.partitions.cut_polygons import Edges, Polygons, cut_polygons, edge_rows, joined
from collide.papers.partitions.leaf_labels import Witnesses, links_of
from collide.papers.partitions.partition_tree import PartitionTree
from collide.papers.partitions.vertices import Vertices

#: Polygons worked on at once: their vertices are forgotten afterwards.
_AT_ONCE = 200_000


def cut_along_facets(
    tree: PartitionTree, vertices: Vertices, edges: Edges, polygons: Polygons, rng: np.random.Generator, progress
) -> None:
    """Cut every cell with polygons along the polygons' planes, until no polygon lies inside a cell."""
    polygons = polygons[np.argsort(polygons.cell, kind="stable")]
    ends = np.flatnonzero(np.append(np.diff(polygons.cell) != 0, True)) + 1
    bytes_before = tree.other_bytes
    begin, n_vertices, n_edges = 0, vertices.xyz.n, edges.vertex.n
    while begin < len(polygons.cell):
        end = int(ends[np.searchsorted(ends, min(begin + _AT_ONCE, len(polygons.cell)))])
        with progress(f"cutting space along facets, {100 * begin // len(polygons.cell)} %: {tree.plane.n + 1:,} cells"):
            active, n_held = polygons[begin:end], len(tree.held)
            pivots: list[Polygons] = []
            while len(active.cell):
                active = _round(tree, vertices, edges, active, rng, pivots)
                tree.other_bytes = bytes_before + (vertices.xyz.n - n_vertices) * 56 + (edges.vertex.n - n_edges) * 16
                tree.other_bytes += vertices.exact_bytes
            tree.links.append(links_of(tree, vertices, _witnesses(edges, joined(*pivots)), tree.held[n_held:]))
        vertices.cut_back(n_vertices)
        edges.cut_back(n_edges)
        tree.other_bytes = bytes_before
        begin = end


def _round(tree, vertices, edges, polygons: Polygons, rng, pivots: list[Polygons]) -> Polygons:
    """Cut each cell once; returns what is left of the polygons. `pivots` get the polygons that cut, `cell` the cut."""
    first, cell = _groups(polygons.cell)
    pivot = _pivots(vertices, edges, polygons, rng, first, cell)
    planes = polygons.plane[pivot]
    cuts = tree.cut(polygons.cell[pivot], planes)
    pivots.append(replace(polygons[pivot], cell=cuts))
    others = np.ones(len(cell), dtype=bool)
    others[pivot] = False
    tree.hold(cuts, planes)
    rest, cell = polygons[others], cell[others]
    cut = cut_polygons(vertices, edges, rest, planes[cell])
    flat = ~(cut.below | cut.above)
    tree.hold(cuts[cell[flat]], rest.plane[flat])
    on_one_side = np.flatnonzero(cut.below ^ cut.above)
    side = cuts[cell[on_one_side]]
    split_cuts = cuts[cell[cut.both]]
    remaining = joined(
        replace(rest[on_one_side], cell=2 * side + 1 + cut.above[on_one_side]),
        replace(cut.minus, cell=2 * split_cuts + 1),
        replace(cut.plus, cell=2 * split_cuts + 2),
    )
    return remaining[np.argsort(remaining.cell, kind="stable")]


def _groups(cell: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(the first row of each run of equal cells, the number of the run of each row)."""
    begins = np.append(True, np.diff(cell) != 0)
    return np.flatnonzero(begins), np.cumsum(begins) - 1


def _pivots(vertices, edges, polygons, rng, first, cell) -> np.ndarray:
    """The polygon of each cell whose plane cuts the cell: a polygon from wall to wall, or else a random polygon."""
    n = vertices.planes.n
    rows, owner = edge_rows(polygons)
    carrier = edges.carrier.rows[rows]
    of_edge = (carrier >= n) & (carrier < 4 * n)
    bounded = np.zeros(len(cell), dtype=bool)
    bounded[owner[of_edge]] = True
    return np.lexsort((rng.random(len(cell)) + bounded, cell))[first]


def _witnesses(edges: Edges, pivots: Polygons) -> Witnesses:
    """Pieces of facets as witnesses of the cuts in their planes."""
    rows, _ = edge_rows(pivots)
    return Witnesses(pivots.cell, np.cumsum(pivots.count) - pivots.count, pivots.count, edges.vertex.rows[rows])
