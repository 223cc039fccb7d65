"""VoxelGrid: the occupied cells of a regular grid."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidShape
from collide.shapes.shape import IDENTITY, Shape, positive, rows
from collide.transforms import LARGEST, as_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.fields.cell_tree import CellTree, Grid

cell_tree: Any = lazy_module("collide.fields.cell_tree")
voxel_files: Any = lazy_module("collide.fields.voxel_files")


class VoxelGrid(Shape):
    """The union of the occupied cells of a regular grid: a voxel map, as an obstacle.

    Parameters
    ----------
    occupied : (nx, ny, nz) or (k, 3) array_like
        Whether each cell is occupied (bool, or integers other than 0); or the occupied cells themselves (integers, of
        any sign, in any order), which may be few among many. At least one cell.
    cell : float or (3,) array_like, float64
        Sides of a cell, > 0 [m].
    X : (4, 4) array_like, optional
        Pose of the grid in the frame of the shape. By default the least corner of cell (0, 0, 0) is the origin, and
        cell (i, j, k) reaches from (i, j, k) · cell to (i + 1, j + 1, k + 1) · cell.

    Raises
    ------
    InvalidShape
        For arrays of another shape or type, without an occupied cell; sides not above 0; 2³¹ cells or more, or more
        than 65,536 along an axis, between the least and the largest occupied cell.
    InvalidArgument
        For a matrix that is no pose.

    Notes
    -----
    Queries answer for the union of the cells, each a closed box; cells side by side share a face to the last bit:
    planes between cells stand at i · cell, and with an ``X`` that only shifts at i · cell + shift, each step rounded
    once. ``part`` numbers of results name cells (`cells_of`). Inner faces, between two occupied cells, are no faces
    to contacts, depths and rays.

    A bit a cell under a tree of 64 children a node: O(cells of the array) for arrays, O(k log k) for lists of cells.
    Convex shapes walk down the tree; depths, contacts, half-spaces, meshes and unions take the cells nearby, merged
    to boxes.
    """

    __slots__ = ("X", "X_FG", "cell", "tree")
    _fields: tuple[str, ...] = ("tree", "X")
    convex = False
    is_field = True
    #: (3,) sides of a cell [m].
    cell: np.ndarray
    #: (4, 4) pose of the grid.
    X: np.ndarray
    #: The tree over the occupied cells, and the pose of its frame.
    tree: CellTree
    X_FG: np.ndarray

    def __init__(self, occupied: ArrayLike, cell: float | ArrayLike, X: ArrayLike | None = None):
        name = type(self).__name__
        sides, pose = _checked_sides(name, cell), IDENTITY if X is None else as_pose(X, f"{name}: X")
        checks.no_path(f"{name}: occupied", occupied, f"{name}.from_file", InvalidShape)
        array = checks.plain_array(f"{name}: occupied", occupied, "(nx, ny, nz) or (k, 3)", InvalidShape)
        if not array.size:
            raise InvalidShape(
                f"{name}: no cell is occupied: occupied is empty, of shape {array.shape}; of an empty map make no body"
            )
        if array.dtype.kind not in "biu" or array.ndim not in (2, 3) or (array.ndim == 2 and array.shape[1] != 3):
            raise InvalidShape(
                f"{name}: occupied must be (nx, ny, nz) of bool, or cells (k, 3) of int, got {array.shape} "
                f"{array.dtype}; of probabilities take occupied > 0.5, of places [m] {name}.from_points"
            )
        if array.ndim == 3:
            self._keep(_of_array(name, array, sides, pose), pose)
        else:
            self._keep(tree_of_cells(name, array, np.zeros(len(array), dtype=np.int64), sides, pose), pose)

    def _keep(self, tree: CellTree, X: np.ndarray) -> None:
        X = X.copy()
        for part in (*tree.nodes, tree.least, tree.sides, X):
            part.flags.writeable = False
        self._store(tree=tree, cell=tree.sides, X=X, X_FG=IDENTITY if _only_shifts(X) else X)

    @classmethod
    def _from_fields(cls, tree, X) -> VoxelGrid:
        made = object.__new__(cls)
        made._keep(tree, X)
        return made

    @classmethod
    def from_points(cls, points: ArrayLike, cell: float | ArrayLike) -> VoxelGrid:
        """The cells in which points lie.

        Parameters
        ----------
        points : (n, 3) array_like, float64
            [m], in the frame of the shape.
        cell : float or (3,) array_like, float64
            Sides of a cell, > 0 [m].

        Returns
        -------
        VoxelGrid

        Raises
        ------
        InvalidShape
            For points of another shape, empty, not finite; as the constructor.
        """
        sides = _checked_sides(cls.__name__, cell)
        cells = np.floor(rows(cls.__name__, "points", points, (None, 3)) / sides)
        if not np.abs(cells).max() < 2.0**62:
            name, side = cls.__name__, checks.brief(cell)
            raise InvalidShape(f"{name}: cells of {side} m are too small for these points; take larger cells")
        return cls(cells.astype(np.int64), cell)

    @classmethod
    def from_file(cls, path) -> VoxelGrid:
        """The grid of a binvox file.

        Parameters
        ----------
        path : str or Path
            The file, at most 2 GiB; its scale and its shift are metres.

        Returns
        -------
        VoxelGrid
            Its ``X`` is the file's shift.

        Raises
        ------
        InvalidShape
            For a missing or damaged file, or one without an occupied cell.
        """
        occupied, sides, origin = voxel_files.read_voxel_file(path)
        X = np.eye(4)
        X[:3, 3] = origin
        return cls(occupied, sides, X)

    def save(self, path) -> None:
        """Write the cells to a binvox file, numbered from the least.

        Parameters
        ----------
        path : str or Path
            The file, ending in ``.binvox``; an existing file is replaced as a whole, or kept.

        Raises
        ------
        InvalidShape
            For another suffix, cells other than cubes, a turned grid: the format has a scale and a shift alone.
        """
        name = f"{type(self).__name__}.save"
        if checks.file_path(f"{name}: path", path, InvalidShape).suffix.lower() != ".binvox":
            raise InvalidShape(f"{name}: {checks.brief(path)}: the suffix must be .binvox")
        if self.X_FG is not IDENTITY:
            raise InvalidShape(f"{name}: the grid is turned, which a .binvox file cannot say; give X to the query")
        tree, occupied = self.tree, np.zeros(self.tree.shape, dtype=bool)
        occupied[tuple((self.cells - tree.least).T)] = True
        origin = tree.least * tree.sides + tree.origin
        try:
            voxel_files.write_voxel_file(path, voxel_files.Voxels(occupied, tree.sides, origin))
        except OSError as error:
            raise InvalidShape(f"{name}: {checks.brief(path)}: {error}") from None

    @property
    def count(self) -> int:
        """How many cells are occupied."""
        return self.tree.count

    @property
    def cells(self) -> np.ndarray:
        """(count, 3) int64, the occupied cells, in ascending order."""
        boxes = self.tree.boxes_in(np.zeros(3), np.array(self.tree.shape))
        if not (boxes.size > 1).any():
            return boxes.least + self.tree.least
        inside = [least + np.indices(size).reshape(3, -1).T for least, size in zip(boxes.least, boxes.size)]
        cells = np.concatenate(inside)
        return cells[np.lexsort(cells.T[::-1])] + self.tree.least

    def cells_of(self, parts: ArrayLike) -> np.ndarray:
        """The cells that ``part`` numbers of results name.

        Parameters
        ----------
        parts : int or array_like of int
            Numbers, as results have them.

        Returns
        -------
        np.ndarray
            (…, 3) int64.

        Raises
        ------
        InvalidArgument
            For numbers outside of the grid.
        """
        array = checks.plain_array("VoxelGrid.cells_of: parts", parts, "integers", InvalidArgument)
        n = math.prod(self.tree.shape)
        if array.dtype.kind not in "iu" or (array.size and not (array.min() >= 0 and array.max() < n)):
            raise InvalidArgument(
                f"VoxelGrid.cells_of: parts must be integers within 0 … {n - 1}, got {checks.brief(parts)}"
            )
        return np.stack(np.unravel_index(array.astype(np.int64), self.tree.shape), axis=-1) + self.tree.least

    def _scaled(self, s: np.ndarray) -> VoxelGrid:
        cells = self.cells
        return VoxelGrid(np.where(s < 0.0, -1 - cells, cells), self.cell * np.abs(s), scaled_pose(self.X, s))

    def _key(self) -> tuple:
        tree = self.tree
        return tree.shape, tuple(tree.least), tuple(tree.sides), (self.X + 0.0).tobytes(), tree.nodes[0].tobytes()

    def __repr__(self) -> str:
        cell = f"{self.cell[0]:g}" if len(set(self.cell)) == 1 else str(self.cell.tolist())
        return f"{type(self).__name__}(<{self.count} of {'×'.join(map(str, self.tree.shape))} cells>, cell={cell})"


def scaled_pose(X: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The pose of a grid under scale factors (3,). Raises InvalidShape for turned grids and a mirror image."""
    if not _only_shifts(X) and not (s == abs(s[0])).all():
        raise InvalidShape("they must be equal and above 0, since the grid is turned; scale before it is placed")
    scaled = X.copy()
    scaled[:3, 3] *= s
    return scaled


def _only_shifts(X: np.ndarray) -> bool:
    return bool((X[:3, :3] == IDENTITY[:3, :3]).all())


def _checked_sides(name: str, cell) -> np.ndarray:
    if checks.number(cell) is not None:
        return np.full(3, positive(name, "cell", cell))
    sides = rows(name, "cell", cell, (3,))
    return np.array([positive(name, f"cell[{k}]", float(side)) for k, side in enumerate(sides)])


def grid_of(name: str, shape: tuple[int, ...], least: np.ndarray, sides: np.ndarray, X: np.ndarray) -> Grid:
    """Raises InvalidShape for grids too large."""
    if math.prod(shape) > cell_tree.MAX_NUMBER or max(shape) > cell_tree.MAX_ALONG:
        raise InvalidShape(
            f"{name}: {' × '.join(map(str, shape))} cells are more than the {cell_tree.MAX_ALONG} along an axis and "
            f"{cell_tree.MAX_NUMBER} in all that a grid holds; take larger cells, or several grids"
        )
    origin = X[:3, 3].copy() if _only_shifts(X) else np.zeros(3)
    corners = np.abs([least * sides + origin, (least + shape) * sides + origin])
    if not corners.max() + np.abs(X[:3, 3]).max() <= LARGEST:
        raise InvalidShape(f"{name}: the grid reaches beyond ±{LARGEST:g} m; scale the scene")
    return cell_tree.Grid(tuple(map(int, shape)), least, origin, sides)


def _of_array(name: str, array: np.ndarray, sides: np.ndarray, X: np.ndarray) -> CellTree:
    if not array.size or not array.any():
        raise InvalidShape(
            f"{name}: none of {' × '.join(map(str, array.shape))} cells is occupied; of an empty map make no body"
        )
    grid = grid_of(name, array.shape, np.zeros(3, dtype=np.int64), sides, X)
    return cell_tree.tree_of_array(np.ascontiguousarray(array, dtype=bool).view(np.uint8), grid)


def tree_of_cells(
    name: str, cells: np.ndarray, exponents: np.ndarray, sides: np.ndarray, X: np.ndarray
) -> CellTree:
    """The tree of cubes of 2^exponent cells along each axis, none of them within another. Raises InvalidShape."""
    if not len(cells):
        raise InvalidShape(f"{name}: no cell is occupied")
    if cells.dtype == bool:
        raise InvalidShape(f"{name}: occupied must be (nx, ny, nz) of bool, or cells (k, 3) of int, got bool (k, 3)")
    low, high = cells.min(axis=0), cells.max(axis=0)
    if not max(abs(int(low.min())), abs(int(high.max()))) < 1 << 62:
        raise InvalidShape(f"{name}: cells must lie within ±2⁶², got {int(low.min())} … {int(high.max())}")
    # the tree's least cell is a multiple of the largest cube's size, so that cubes stay aligned
    step = 1 << int(exponents.max())
    cells = cells.astype(np.int64)
    least = cells.min(axis=0) // step * step
    shape = tuple(((cells + (1 << exponents)[:, None]).max(axis=0) - least).tolist())
    return cell_tree.tree_of_cubes(cells - least, exponents, grid_of(name, shape, least, sides, X))
