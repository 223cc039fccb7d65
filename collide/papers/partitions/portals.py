"""Where convex cells of a partition open into one another: portals."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from collide.papers.partitions.convex_cells import CellBlock
from collide.papers.partitions.cut_polygons import Polygons, cut_polygons, edge_rows, joined
from collide.papers.partitions.finished_tree import FinishedTree


class Portals(NamedTuple):
    """Common pieces of faces of two cells, each with an area.

    cells : (m, 2) int64, rows of the `ConvexCells`.   middle : (m, 3) [m], a point of each, to rounding.
    area : (m,) [m²], to rounding.
    """

    cells: np.ndarray
    middle: np.ndarray
    area: np.ndarray


def portals_of_block(tree: FinishedTree, block: CellBlock, whole: np.ndarray) -> tuple[np.ndarray, ...]:
    """(leaf of a cell (m,), leaf beyond (m,), plane (m,), middle (m, 3), area (m,)) of faces of cells, each pair once.

    A face is sent down the tree from the root: split by crossing cuts, and sent by a cut in its own plane to the side
    away from its cell. Leaves are numbered as in `cell_blocks`, with `whole`.
    """
    vertices, edges = block.vertices, block.edges
    n_tree_planes = 4 * tree.planes.n + len(tree.planes.axis.rows)
    faces = block.faces[(block.faces.side > 0) & (block.faces.plane < n_tree_planes)]
    owner = block.leaf[faces.cell]
    # `cell` is the row of the face from now on, and follows its pieces down.
    faces = replace(faces, cell=np.arange(len(owner)))
    place = np.zeros(len(owner), dtype=np.int64)
    planes, done = vertices.planes, []
    while len(place):
        cut = tree.below[place]
        inner = cut >= 0
        first = np.where(inner, tree.first[np.where(inner, cut, 0)], ~cut)
        ended = ~inner | whole[np.where(inner, cut, 0)]
        if ended.any():
            done.append((owner[faces.cell[ended]], first[ended], faces.plane[ended], *_measured(block, faces[ended])))
        faces, cut = faces[~ended], cut[~ended]
        made = cut_polygons(vertices, edges, faces, tree.plane[cut])
        above = made.above.copy()
        flat = np.flatnonzero(~(made.above | made.below))
        above[flat] = planes.run_against(faces.plane[flat], tree.plane[cut[flat]])
        on_one_side = np.flatnonzero(~(made.above & made.below))
        both = cut[made.both]
        place = np.concatenate((2 * cut[on_one_side] + 1 + above[on_one_side], 2 * both + 1, 2 * both + 2))
        faces = joined(faces[on_one_side], made.minus, made.plus)
    if not done:
        return (*(np.zeros(0, dtype=np.int64),) * 3, np.zeros((0, 3)), np.zeros(0))
    return tuple(np.concatenate(columns) for columns in zip(*done))


def _measured(block: CellBlock, polygons: Polygons) -> tuple[np.ndarray, np.ndarray]:
    """(means of the corners (k, 3), areas (k,)) of polygons."""
    rows, owner = edge_rows(polygons)
    xyz = block.vertices.xyz.rows[block.edges.vertex.rows[rows]]
    ends = np.cumsum(polygons.count)
    first = ends - polygons.count
    apex = xyz[first][owner]
    following = np.arange(1, len(rows) + 1)
    following[ends - 1] = first
    turns = np.add.reduceat(np.cross(xyz - apex, xyz[following] - apex), first)
    middle = np.add.reduceat(xyz - apex, first) / polygons.count[:, None] + xyz[first]
    return middle, 0.5 * np.sqrt((turns * turns).sum(axis=1))
