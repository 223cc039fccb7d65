"""Convex cells as arrays: `ConvexCells`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.papers.partitions.convex_cells import CellBlock
from collide.papers.partitions.cut_polygons import edge_rows
from collide.papers.partitions.finished_tree import FinishedTree
from collide.shapes.convex_hull import ConvexHull


class CellPlanes(NamedTuple):
    """The planes of a cell, exact, (f,) each; and rounded, {x : normals @ x ≤ offsets}.

    facet : the facet in the plane, −1 for a plane parallel to two axes.
    axis, value : of an axis-parallel plane, x[axis] = value; −1 and NaN for a facet's plane.
    side : 1 where the cell lies on the side of the facet's normal, or of larger coordinates; else −1.
    normals, offsets : (f, 3) unit outward normals, (f,) [m], to rounding.
    """

    facet: np.ndarray
    axis: np.ndarray
    value: np.ndarray
    side: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray


class CellSource(NamedTuple):
    """What cells were made from: the arguments of `cell_blocks`."""

    tree: FinishedTree
    leaves: np.ndarray
    low: np.ndarray
    high: np.ndarray
    whole: np.ndarray


class ConvexCells:
    """Convex polytopes that share no inner points.

    Parameters
    ----------
    inside : (leaves,) bool, of all leaves.
    facets : (n,) int64, numbers in the mesh of the facets with an area.
    parts : blocks of cells, in order.
    source : what the cells were made from.

    Attributes
    ----------
    cell : (k,) int64, the leaf of the partition each is, or the first of several that it is made of.
    members, member_rows : (m,) int64, the first leaves of all cells before merging, ascending, and their rows.
    inside : (k,) bool, of the solid.
    vertices : (v, 3) float64 [m], the exact corners rounded; cells may name corners at one place twice.
    error : float [m], no coordinate of a vertex is off by more.
    face_starts : (k + 1,), the faces of cell i are face_starts[i] … face_starts[i + 1] − 1.
    loop_starts, loops : the corners of face j are vertices[loops[loop_starts[j] : loop_starts[j + 1]]],
        counter-clockwise seen from outside.
    facet, axis, value, side : (f,), the plane of each face, exactly, as in `CellPlanes`.
    volumes : (k,) float64 [m³], from the rounded corners.
    source : what the cells were made from.
    """

    def __init__(self, inside: np.ndarray, facets: np.ndarray, parts: list[_Part], source: CellSource):
        self.source = source
        self.cell = np.concatenate([part.cell for part in parts])
        self.members = np.concatenate([part.members for part in parts])
        rows_before = np.cumsum([0] + [len(part.cell) for part in parts])
        self.member_rows = np.concatenate([part.member_rows + n for n, part in zip(rows_before, parts)])
        self.inside = inside[self.cell]
        self.vertices = np.concatenate([part.vertices for part in parts])
        self.error = max((part.error for part in parts), default=0.0)
        self.face_starts = _chained([part.face_starts for part in parts])
        self.loop_starts = _chained([part.loop_starts for part in parts])
        before = np.cumsum([0] + [len(part.vertices) for part in parts])
        self.loops = np.concatenate([part.loops + n for n, part in zip(before, parts)])
        of_facet = np.concatenate([part.facet for part in parts])
        self._of_facet, self.facet = of_facet, np.where(of_facet >= 0, facets[of_facet], -1)
        self.axis, self.value, self.side = (
            np.concatenate([getattr(part, name) for part in parts]) for name in ("axis", "value", "side")
        )
        self.volumes = self._volumes()

    def __len__(self) -> int:
        return len(self.cell)

    def _volumes(self) -> np.ndarray:
        """Cones over the triangles of all faces from a corner of each cell."""
        n_corners = np.diff(self.loop_starts)
        face = np.repeat(np.arange(len(n_corners)), n_corners)
        cell = np.repeat(np.arange(len(self)), np.diff(self.face_starts))[face]
        at = self.vertices[self.loops]
        apex = at[self.loop_starts[self.face_starts[:-1]]][cell] if len(self) else at
        following = np.arange(1, len(face) + 1)
        following[self.loop_starts[1:] - 1] = self.loop_starts[:-1]
        a, b, c = at[self.loop_starts[:-1]][face] - apex, at - apex, at[following] - apex
        return np.bincount(cell, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0, minlength=len(self))

    def rows_of(self, leaves) -> np.ndarray:
        """The rows of the cells that hold leaves of the partition.

        Parameters
        ----------
        leaves : (k,) int, as `locate` names them.

        Returns
        -------
        (k,) int64; −1 for leaves in no cell.
        """
        leaves = checks.whole_numbers("ConvexCells.rows_of: leaves", leaves)
        if not len(self):
            return np.full(len(leaves), -1)
        tree, last = self.source.tree, self.members.copy()
        first = tree.first[self.source.whole]
        row = np.minimum(np.searchsorted(self.members, first), len(last) - 1)
        mine = self.members[row] == first
        np.maximum.at(last, row[mine], tree.last[self.source.whole][mine])
        row = np.maximum(np.searchsorted(self.members, leaves, "right") - 1, 0)
        return np.where((self.members[row] <= leaves) & (leaves <= last[row]), self.member_rows[row], -1)

    def corners(self, i: int) -> np.ndarray:
        """The corners of a cell, rounded.

        Parameters
        ----------
        i : number of the cell.

        Returns
        -------
        (n, 3) float64 [m].

        Raises
        ------
        InvalidArgument : no such cell.
        """
        i = self._row(i)
        loops = self.loops[self.loop_starts[self.face_starts[i]] : self.loop_starts[self.face_starts[i + 1]]]
        return self.vertices[np.unique(loops)]

    def hull(self, i: int) -> ConvexHull:
        """A cell as a shape: the hull of its rounded corners.

        Parameters
        ----------
        i : number of the cell.

        Returns
        -------
        ConvexHull.

        Raises
        ------
        InvalidArgument : no such cell.
        """
        return ConvexHull(self.corners(i))

    def planes(self, i: int) -> CellPlanes:
        """The planes of a cell, exact and rounded.

        Parameters
        ----------
        i : number of the cell.

        Returns
        -------
        CellPlanes.

        Raises
        ------
        InvalidArgument : no such cell.
        """
        i = self._row(i)
        rows = np.arange(self.face_starts[i], self.face_starts[i + 1])
        normals, offsets = np.zeros((len(rows), 3)), np.zeros(len(rows))
        for k, row in enumerate(rows.tolist()):
            at = self.vertices[self.loops[self.loop_starts[row] : self.loop_starts[row + 1]]]
            if self.facet[row] < 0:
                normals[k, self.axis[row]] = -self.side[row]
            else:  # of the facet: corners of a face thinner than rounding tell nothing
                *n, _ = self.source.tree.planes.coefficients(self._of_facet[row : row + 1])[0]
                largest = -int(self.side[row]) * max(map(abs, n))
                normals[k] = [v / largest for v in n]
                normals[k] /= np.linalg.norm(normals[k])
            offsets[k] = (at @ normals[k]).max()
        return CellPlanes(self.facet[rows], self.axis[rows], self.value[rows], self.side[rows], normals, offsets)

    def _row(self, i: int) -> int:
        return checks.checked_index("ConvexCells: i", i, len(self))


class _Part(NamedTuple):
    """`ConvexCells` of one block, facets numbered as the partition's planes are."""

    cell: np.ndarray
    vertices: np.ndarray
    error: float
    face_starts: np.ndarray
    loop_starts: np.ndarray
    loops: np.ndarray
    facet: np.ndarray
    axis: np.ndarray
    value: np.ndarray
    side: np.ndarray
    members: np.ndarray
    member_rows: np.ndarray


def part_of_block(block: CellBlock, members: np.ndarray, member_rows: np.ndarray) -> _Part:
    """The cells of a block as arrays of their own, with the leaves (m,) merged to cells, and the rows of these."""
    faces, planes = block.faces, block.vertices.planes
    rows, _ = edge_rows(faces)
    used, loops = np.unique(block.edges.vertex.rows[rows], return_inverse=True)
    vertices, error = block.vertices.rounded(used)
    on_axis = faces.plane >= 4 * planes.n
    k = np.where(on_axis, faces.plane - 4 * planes.n, 0)
    return _Part(
        block.leaf, vertices, error,
        np.searchsorted(faces.cell, np.arange(len(block.leaf) + 1)), np.append(0, np.cumsum(faces.count)),
        np.ravel(loops), np.where(on_axis, -1, faces.plane), np.where(on_axis, planes.axis.rows[k], -1),
        np.where(on_axis, planes.value.rows[k], np.nan), faces.side, members, member_rows,
    )


def _chained(starts: list[np.ndarray]) -> np.ndarray:
    """Starts of the rows of consecutive parts, from the starts in each part."""
    ends = np.cumsum([0] + [int(s[-1]) for s in starts])
    return np.concatenate([s[:-1] + end for s, end in zip(starts, ends)] + [ends[-1:]])
