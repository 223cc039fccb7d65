"""TetMesh: a body cut into tetrahedra, checked when made."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from collide.base import argument_checks as checks
from collide.base.log import log, log_duration
from collide.errors import InvalidShape
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import MAX_FACETS, MeshTree
from collide.numerics.exact_points import integers
from collide.papers.tetrahedra import cell_orientation, exact_cells
from collide.papers.tetrahedra.cell_files import read_cells
from collide.shapes.mesh import Mesh
from collide.shapes.shape import rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: Corners of the four faces, counter-clockwise from outside; face k is opposite to corner k.
_FACES = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


class TetMesh:
    """Tetrahedra: cells that fill a body, for `collide.overlapping_cells`.

    Parameters
    ----------
    vertices : (n, 3) array_like, float64
        [m], in the frame of the mesh. Some may be unused.
    cells : (m, 4) array_like of int
        Rows of ``vertices``. Corner 3 sees corners 0, 1, 2 counter-clockwise; a cell the other way round is turned (its
        last two corners change places), and ``turned`` has its number.

    Raises
    ------
    InvalidShape
        For anything but finite vertices within 1e50 and at least one row of four ids in range; for cells without a
        volume, decided exactly; for a cell that is there twice. Rows and values are named.

    Notes
    -----
    ``vertices`` (n, 3) float64, ``cells`` (m, 4) int32 and ``turned`` (k,) int64 are read-only. Ids in results are rows
    of ``cells``. Whether cells overlap each other `collide.self_overlapping_cells` says. The mesh is no shape:
    `boundary` is a `Mesh` for every other query. Immutable, picklable, compared by value. About 0.5 µs a cell.
    """

    __slots__ = ("__weakref__", "_boundary", "_tree", "cells", "turned", "vertices")
    vertices: np.ndarray
    cells: np.ndarray
    turned: np.ndarray
    _boundary: Mesh
    _tree: MeshTree

    def __init__(self, vertices: ArrayLike, cells: ArrayLike):
        points = rows("TetMesh", "vertices", vertices, (None, 3))
        ids = _check_cells(cells, len(points))
        signs = cell_orientation.signs(points, ids)
        if (signs == 0).any():
            bad = np.flatnonzero(signs == 0)
            raise InvalidShape(
                f"TetMesh: cells[{bad[0]}] is {ids[bad[0]].tolist()} and has no volume: {_spoilt(points, ids[bad[0]])} "
                f"({len(bad)} such cell{'s' * (len(bad) != 1)}); leave them out: numpy.delete(cells, rows, axis=0)"
            )
        _refuse_repeated(ids)
        turned = np.flatnonzero(signs < 0)
        ids[turned, 2:] = ids[turned, :1:-1]
        if len(turned):
            log.warning(
                "TetMesh: %d of %d cells ran the other way round and were turned: mesh.turned has their numbers",
                len(turned), len(ids),
            )
        for name, value in (("vertices", points), ("cells", ids), ("turned", turned)):
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    def __setattr__(self, name, value):
        raise AttributeError(f"TetMesh is immutable; make a new one instead of setting {name}")

    def __delattr__(self, name):
        raise AttributeError(f"TetMesh is immutable; {name} cannot be deleted")

    def __reduce__(self):
        return TetMesh, (self.vertices, self.cells)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TetMesh):
            return NotImplemented
        return np.array_equal(self.vertices, other.vertices) and np.array_equal(self.cells, other.cells)

    def __hash__(self) -> int:
        return hash(((self.vertices + 0.0).tobytes(), self.cells.tobytes()))

    def __repr__(self) -> str:
        return f"TetMesh({len(self.vertices)} vertices, {len(self.cells)} cells)"

    @classmethod
    def from_file(cls, path: str | Path) -> TetMesh:
        """The tetrahedra of a file read by meshio: .vtk, .vtu, .msh, .mesh, .inp, .xdmf and others.

        Parameters
        ----------
        path : str or Path
            The file. Cells of other kinds (triangles of a boundary, say) are passed over; higher orders are refused.

        Returns
        -------
        TetMesh
            Coordinates are taken as metres.

        Raises
        ------
        SceneError
            For a missing file, an unreadable file, or a file without tetrahedra.
        MissingExtra
            Without meshio: ``pip install 'collide-robotics[tets]'``.
        InvalidShape
            As of the class.
        """
        return cls(*read_cells(path))

    @property
    def unused(self) -> np.ndarray:
        """(k,) int64 vertices that no cell has."""
        is_used = np.zeros(len(self.vertices), dtype=bool)
        is_used[self.cells] = True
        return np.flatnonzero(~is_used)

    @property
    def volumes(self) -> np.ndarray:
        """(m,) float64 volumes of the cells [m³], rounded in every operation; `exact_volume` rounds nothing."""
        a, b, c, d = self.vertices[self.cells].transpose(1, 0, 2)
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0

    @property
    def volume(self) -> float:
        """The sum of the cells' volumes [m³], exact before it is rounded to the nearest double."""
        return float(self.exact_volume())

    def exact_volume(self, cell: int | None = None) -> Fraction:
        """The volume of a cell, or the sum of all, as a fraction.

        Parameters
        ----------
        cell : int, optional
            A row of ``cells``. ``None`` sums all: some 10 µs a cell.

        Returns
        -------
        fractions.Fraction
            [m³]
        """
        used = self.cells
        if cell is not None:
            row = checks.checked_index("TetMesh.exact_volume: cell", cell, len(self.cells))
            used = self.cells[row : row + 1]
        flat, grid = integers(self.vertices[used])
        points = list(zip(flat[0::3], flat[1::3], flat[2::3]))
        total = sum(exact_cells.determinant(points[k : k + 4]) for k in range(0, len(points), 4))
        return Fraction(total, 6) * Fraction(2) ** (3 * grid)

    @property
    def boundary(self) -> Mesh:
        """The surface: a `Mesh` of the faces of a single cell each, facing outwards; made once, and kept.

        Faces with the same vertex numbers are the same face. Raises InvalidShape for a face of three cells.
        """
        if not hasattr(self, "_boundary"):
            object.__setattr__(self, "_boundary", Mesh(self.vertices, self._outer_faces()))
        return self._boundary

    def _outer_faces(self) -> np.ndarray:
        faces = self.cells[:, _FACES].reshape(-1, 3)
        keys = np.sort(faces, axis=1)
        order = np.lexsort(keys.T[::-1])
        is_new = np.concatenate([[True], (keys[order][1:] != keys[order][:-1]).any(axis=1)])
        counts = np.diff(np.append(np.flatnonzero(is_new), len(order)))
        if (counts > 2).any():
            first = order[np.flatnonzero(is_new)[np.argmax(counts > 2)]]
            raise InvalidShape(
                f"TetMesh: the face of vertices {keys[first].tolist()} belongs to {counts.max()} cells, "
                f"cells[{first // 4}] among them: two of them overlap: collide.self_overlapping_cells(mesh)"
            )
        return faces[np.sort(order[is_new][counts == 1])]

    @property
    def tree(self) -> MeshTree:
        """The box-tree over the cells' boxes, made when first asked for."""
        if not hasattr(self, "_tree"):
            with log_duration("box-tree of %d tetrahedra made", len(self.cells)):
                corners = self.vertices[self.cells]
                ends = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1).reshape(-1, 3)
                first = 2 * np.arange(len(self.cells))
                # A facet from a box's least corner to its largest has that box.
                facets = np.stack([first, first + 1, first + 1], axis=1)
                object.__setattr__(self, "_tree", build_mesh_tree(ends, facets))
        return self._tree


def _check_cells(cells, n: int) -> np.ndarray:
    """(m, 4) int32 ids, m ≥ 1, a copy."""
    array = checks.plain_array("TetMesh: cells", cells, "(m, 4)", InvalidShape)
    if array.ndim != 2 or array.shape[1] != 4:
        raise InvalidShape(f"TetMesh: cells must have shape (m, 4), four corners a cell, got {array.shape}")
    if not len(array):
        raise InvalidShape("TetMesh: cells is empty; at least one row of four ids is needed")
    if len(array) > MAX_FACETS:
        raise InvalidShape(f"TetMesh: {len(array)} cells; at most {MAX_FACETS} are supported: cut the body into parts")
    if array.dtype.kind not in "iu":
        raise InvalidShape(f"TetMesh: cells must be integers, got {array.dtype} (whole ones: cells.astype(int))")
    outside = ((array < 0) | (array >= n)).any(axis=1)
    if outside.any():
        row, n_outside = int(np.argmax(outside)), int(outside.sum())
        raise InvalidShape(
            f"TetMesh: cells[{row}] is {array[row].tolist()}, but there are vertices 0 … {n - 1} "
            f"({n_outside} such cell{'s' * (n_outside != 1)})"
        )
    return np.array(array, dtype=np.int32, order="C")


def _spoilt(vertices: np.ndarray, cell: np.ndarray) -> str:
    if len(set(cell.tolist())) < 4:
        return "it has a corner twice"
    if len(np.unique(vertices[cell] + 0.0, axis=0)) < 4:
        return "two of its corners are in one place"
    return "its corners lie in one plane"


def _refuse_repeated(cells: np.ndarray) -> None:
    keys = np.sort(cells, axis=1)
    order = np.lexsort(keys.T[::-1])
    same = np.flatnonzero((keys[order][1:] == keys[order][:-1]).all(axis=1))
    if len(same):
        first, second = order[same[0]], order[same[0] + 1]
        raise InvalidShape(
            f"TetMesh: cells[{second}] has the corners of cells[{first}], {cells[second].tolist()} "
            f"({len(same)} such cell{'s' * (len(same) != 1)}); leave one of them out"
        )
