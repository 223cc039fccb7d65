"""Convex pieces as hulls for hosts that take convex shapes, and by how much the hulls miss what the pieces cover."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collide.mesh import solid_measures
from collide.papers.partitions.convex_cells import CellBlock, cell_blocks
from collide.papers.partitions.cut_polygons import edge_rows
from collide.papers.partitions.finished_tree import FinishedTree
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.tessellation import tessellate


class ConvexParts(NamedTuple):
    """Convex pieces of a partition as shapes, and how well they cover.

    hulls : of the rounded corners of pieces, in the frame of the mesh.   piece : (m,) int64, the row of each.
    n_flat : pieces left out, because rounding put their corners in a plane.
    volume : of the solid, or of the free space, that the pieces cover [m³], rounded once.
    excess : volumes of all hulls less the volume to cover [m³], exact and rounded once: 0.0 only where they are equal.
    """

    hulls: list[ConvexHull]
    piece: np.ndarray
    n_flat: int
    volume: float
    excess: float


def parts_of(corners: list[np.ndarray], volume: Fraction) -> ConvexParts:
    """Parts of the corners (n, 3) of each piece, which cover a volume [m³]."""
    hulls, rows, total = [], [], Fraction(0)
    for k, points in enumerate(corners):
        hull = ConvexHull(points)
        held = solid_measures.exact_volume(*tessellate(hull))
        if held > 0:
            hulls.append(hull)
            rows.append(k)
        total += held
    return ConvexParts(
        hulls, np.array(rows, dtype=np.int64), len(corners) - len(hulls), solid_measures.rounded(volume),
        solid_measures.rounded(total - volume),
    )


def solid_volume(tree: FinishedTree, winding: np.ndarray) -> Fraction:
    """The exact volume of all leaves of winding number 1 or more [m³].

    Facets enclose each leaf as often as they wind around the leaf: of their volume the leaves with other numbers than 0
    and 1 take away what is counted too often.
    """
    planes = tree.planes
    volume = solid_measures.exact_volume(planes.vertices, planes.faces)
    low, high = planes.vertices.min(axis=0), planes.vertices.max(axis=0)
    leaves = np.flatnonzero((winding < 0) | (winding > 1))
    wrong = []
    for block in cell_blocks(tree, leaves, low, high):
        often = (winding[block.leaf] - (winding[block.leaf] > 0)).tolist()
        wrong += [n * v for n, v in zip(often, _volumes(block))]
    return volume - _sum(wrong) / (1 << 3 * planes.grid)


def _volumes(block: CellBlock) -> list[Fraction]:
    """Exact volumes of cells, in units of the grid: cones from a corner over triangles of faces."""
    rows, _ = edge_rows(block.faces)
    used, corner = np.unique(block.edges.vertex.rows[rows], return_inverse=True)
    exact = [[Fraction(x, w) for x in p] for *p, w in block.vertices.exact(used).tolist()]
    begin = np.append(0, np.cumsum(block.faces.count)).tolist()
    loops = [np.ravel(corner)[a:b].tolist() for a, b in pairwise(begin)]
    volumes = [Fraction(0)] * len(block.leaf)
    apex: dict[int, list[Fraction]] = {}
    for cell, loop in zip(block.faces.cell.tolist(), loops):
        start = apex.setdefault(cell, exact[loop[0]])
        a, *rest = ([x - s for x, s in zip(exact[v], start)] for v in loop)
        volumes[cell] += sum(_determinant(a, b, c) for b, c in pairwise(rest)) / 6
    return volumes


def _determinant(a, b, c) -> Fraction:
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def _sum(values: list[Fraction]) -> Fraction:
    """By halves: denominators grow with the number of values."""
    if len(values) < 2:
        return values[0] if values else Fraction(0)
    half = len(values) // 2
    return _sum(values[:half]) + _sum(values[half:])
