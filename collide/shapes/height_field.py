"""HeightField: heights over a grid and all that is below them, as a closed mesh of triangles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidShape
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, positive, rows, scalar
from collide.shapes.shape_files import Field, read_arrays, write_arrays
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.mesh import bvh, mesh_survey
    from collide.mesh.mesh_survey import Survey

if not TYPE_CHECKING:
    bvh = lazy_module("collide.mesh.bvh")
    mesh_survey = lazy_module("collide.mesh.mesh_survey")


class GridCells(NamedTuple):
    """Cells of a `HeightField` around facets: three arrays of the same shape, or three integers for a single facet.

    row, column : of the cell, whose corners are the grid points ``heights[row : row + 2, column : column + 2]``.
    triangle : 0 on the side of greater x, between the grid points (row, column), (row, column + 1) and
        (row + 1, column + 1); 1 on the side of greater y.
    All three are −1 for facets of walls and bottom, and for −1, the sign of results for no facet.
    """

    row: Any
    column: Any
    triangle: Any


class HeightField(Mesh):
    """Terrain: heights over a grid, centred in x and y, and everything below them down to a bottom.

    Parameters
    ----------
    heights : (r, c) array_like, float64
        [m], z of the grid points in the frame of the shape, r and c at least 2. Columns run along +x and rows along +y,
        as ``numpy.meshgrid(x, y)`` lays them out: ``heights[i, j]`` is at x = (j − (c − 1)/2)·dx,
        y = (i − (r − 1)/2)·dy, and the field's middle at x = y = 0.
    cell : float or (2,) array_like, float64
        Sides of a cell [m], > 0: of a square cell, or (dx, dy).
    bottom : float, optional
        z of the bottom [m], below all heights. By default the bottom lies below the lowest height by as much as heights
        differ and the longer side of the field together: a body no taller than the field is wide, and reaching up to
        the lowest height, has its shorter way out upwards.

    Raises
    ------
    InvalidShape
        For heights not finite, out of range, fewer than 2 × 2 or more than a box-tree holds (2²⁸ facets);
        cells not above 0; a bottom not below all heights.

    Notes
    -----
    A height field is a solid `Mesh`, and every query for meshes takes height fields: ``vertices``, ``faces`` and
    ``tree`` describe the surface. Each cell is two triangles, cut from the grid point (i, j) to (i + 1, j + 1); between
    grid points the surface is the triangles themselves, z no rounded interpolation. Facet 2·(i·(c − 1) + j) + t is
    triangle t of cell (i, j); walls and bottom follow (`cells_of` tells them apart). Vertex i·c + j is the grid point
    (i, j).

    The surface closes by construction, so nothing is welded and no edge is looked for: O(r c), 0.15 µs a facet. Its
    box-tree is built when a query first needs it and costs ten times as much: seconds for a million cells. Files and
    pickles hold heights, cell and bottom alone. `scaled` copies are meshes; their facets are numbered as in their
    ``base``.
    """

    __slots__ = ("bottom", "cell", "heights")
    _fields = ("heights", "cell", "bottom")
    heights: np.ndarray
    cell: np.ndarray
    bottom: float

    def __init__(self, heights: ArrayLike, cell: ArrayLike, *, bottom: float | None = None):
        heights = _check_heights(heights)
        cell = _check_cell(cell)
        x, y = _grid_line(heights.shape[1], cell[0], "dx"), _grid_line(heights.shape[0], cell[1], "dy")
        bottom = _check_bottom(bottom, heights, x, y)
        vertices, faces = _closed_surface(x, y, heights, bottom)
        self._store(
            heights=heights, cell=cell, bottom=bottom, vertices=vertices, faces=faces, solid=True, scale=1.0,
            _copied=None, _survey=_known_survey(vertices, faces, _volume(heights, cell, bottom)),
        )

    @classmethod
    def _from_fields(cls, heights, cell, bottom) -> HeightField:  # type: ignore[override]
        return cls(heights, cell, bottom=float(bottom))

    def __reduce__(self):
        return Shape.__reduce__(self)  # a mesh tells its facets, which follow from the heights here

    def cells_of(self, facets: ArrayLike) -> GridCells:
        """The cells that facets lie in.

        Parameters
        ----------
        facets : int or array_like of int
            Numbers of facets, as results name them; −1 stands for no facet.

        Returns
        -------
        GridCells
            ``row``, ``column`` and ``triangle`` (0 or 1), int64 arrays of the shape of ``facets``, or integers; −1 for
            facets of walls and bottom.

        Raises
        ------
        InvalidArgument
            For what is no integer from −1 to the number of the last facet.
        """
        numbers = checks.plain_array("HeightField.cells_of: facets", facets, "(…,) of int", InvalidArgument)
        if numbers.dtype.kind not in "iu" and numbers.size:
            raise InvalidArgument(f"HeightField.cells_of: facets must be integers, got {checks.brief(facets)}")
        numbers = numbers.astype(np.int64)
        outside = (numbers < -1) | (numbers >= len(self.faces))
        if outside.any():
            raise InvalidArgument(
                f"HeightField.cells_of: facets: {int(numbers[outside][0])} is none of 0 … {len(self.faces) - 1}, "
                "nor −1 for none"
            )
        row_count, columns = self.heights.shape[0] - 1, self.heights.shape[1] - 1
        on_top = (numbers >= 0) & (numbers < 2 * row_count * columns)
        parts = (numbers // (2 * columns), numbers // 2 % columns, numbers % 2)
        cells = [np.where(on_top, part, -1) for part in parts]
        return GridCells(*(cells if numbers.ndim else [int(part) for part in cells]))

    def save(self, path) -> None:
        """Write heights, cell and bottom to an ``.npz`` file.

        Parameters
        ----------
        path : str or Path
            The file, ending in ``.npz`` or without a suffix; an existing file is replaced, by all of the new file or
            not at all.

        Raises
        ------
        InvalidShape
            Where the suffix is another, and where the file cannot be written.
        """
        arrays = {name: np.asarray(getattr(self, name)) for name in self._fields}
        write_arrays("HeightField", path, _FILE_FORMAT, arrays)

    @classmethod
    def load(cls, path) -> HeightField:
        """A height field from a file written by `save`.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        HeightField
            Equal to the saved height field.

        Raises
        ------
        InvalidShape
            Where the file is of another kind, or damaged, or describes no height field.
        """
        arrays = read_arrays("HeightField", path, _FILE_FORMAT, _FILE_FIELDS, "tree_")
        try:
            return cls._from_fields(**arrays)
        except InvalidShape as error:
            raise InvalidShape(f"HeightField.load: {path}: {error}") from None


#: Changes whenever files written before would be read wrongly.
_FILE_FORMAT = 1
_FILE_FIELDS = {"heights": Field("f8", (None, None)), "cell": Field("f8", (2,)), "bottom": Field("f8", ())}


# --- checks -------------------------------------------------------------------------------------


def _check_heights(heights) -> np.ndarray:
    array = checks.array("HeightField: heights", heights, "(r, c)", InvalidShape)
    if array.ndim != 2 or min(array.shape) < 2:
        raise InvalidShape(
            f"HeightField: heights must have at least 2 rows and 2 columns of grid points, got shape {array.shape}"
        )
    row_count, columns = array.shape
    facets = 2 * (row_count - 1) * (columns - 1) + 6 * (row_count + columns - 2)
    if facets > bvh.MAX_FACETS:
        raise InvalidShape(
            f"HeightField: heights of shape {array.shape} make {facets} facets, and a mesh has at most "
            f"{bvh.MAX_FACETS}; cut the field into several"
        )
    return rows("HeightField", "heights", array, (None, None))


def _check_cell(cell) -> np.ndarray:
    square = checks.number(cell) is not None
    sides = checks.array("HeightField: cell", (cell, cell) if square else cell, "c or (dx, dy)", InvalidShape)
    if sides.shape != (2,):
        raise InvalidShape(f"HeightField: cell must be one length or (dx, dy), got shape {sides.shape}")
    names = ("cell", "cell") if square else ("cell.x", "cell.y")
    sides = np.array([positive("HeightField", name, side) for name, side in zip(names, sides.tolist())])
    sides.flags.writeable = False
    return sides


def _grid_line(n: int, side: float, name: str) -> np.ndarray:
    """Coordinates (n,) of grid points along an axis, each rounded once, so the two halves mirror each other."""
    places = 0.5 * (np.arange(1 - n, n, 2) * side)
    if not places[-1] <= LARGEST:
        raise InvalidShape(
            f"HeightField: cell: {n} grid points {name} = {side:g} m apart reach {places[-1]:g} m from the middle, "
            f"beyond {LARGEST:g} m; scale the scene"
        )
    return places


def _check_bottom(bottom, heights: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
    i, j = np.unravel_index(np.argmin(heights), heights.shape)
    lowest = float(heights[i, j])
    if bottom is not None:
        number = scalar("HeightField", "bottom", bottom)
        if not number < lowest:
            raise InvalidShape(
                f"HeightField: bottom must lie below all heights, got {number!r}, and heights[{i}, {j}] is {lowest!r}"
            )
        return number
    width = 2.0 * float(max(x[-1], y[-1]))
    number = lowest - (float(heights.max()) - lowest + width)
    if not number < lowest:
        raise InvalidShape(
            f"HeightField: heights are near {lowest:g} m, where a field {width:g} m wide is lost in rounding; take "
            "heights from nearer by and move the pose, or give bottom"
        )
    if number < -LARGEST:
        raise InvalidShape(
            f"HeightField: heights: the bottom would be at {number:g} m, beyond {LARGEST:g} m; scale the scene, or "
            "give bottom"
        )
    return number


# --- the surface --------------------------------------------------------------------------------


def _closed_surface(x: np.ndarray, y: np.ndarray, heights: np.ndarray, bottom: float) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and faces (m, 3), read-only: grid points and cells, then walls, then the fan of the bottom.

    Every point of the rim has a point below, so walls are two triangles an edge and vertical in doubles; the bottom
    is a fan around the point below the middle, on no edge of the rim.
    """
    row_count, columns = heights.shape
    n = row_count * columns
    at = np.arange(n, dtype=np.int32).reshape(row_count, columns)
    # Counter-clockwise seen from above: along −y, +x, +y and −x.
    rim = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    below = np.arange(n, n + len(rim), dtype=np.int32)
    middle = np.full(len(rim), n + len(rim), dtype=np.int32)
    following, below_following = np.roll(rim, -1), np.roll(below, -1)

    vertices = np.empty((n + len(rim) + 1, 3))
    vertices[:n, 0], vertices[:n, 1], vertices[:n, 2] = np.tile(x, row_count), np.repeat(y, columns), heights.ravel()
    vertices[n:-1, :2] = vertices[rim, :2]
    vertices[-1, :2] = 0.0
    vertices[n:, 2] = bottom

    here, right, across, up = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    cells = np.stack([here, right, across, here, across, up], axis=-1).reshape(-1, 3)
    walls = np.stack([below, below_following, following, below, following, rim], axis=-1).reshape(-1, 3)
    faces = np.concatenate([cells, walls, np.stack([middle, below_following, below], axis=-1)])
    vertices.flags.writeable = faces.flags.writeable = False
    return vertices, faces


def _volume(heights: np.ndarray, cell: np.ndarray, bottom: float) -> float:
    """Of all prisms below triangles [m³]; the two ends of a cell's diagonal have a share in both."""
    ends = heights[:-1, :-1] + heights[1:, 1:]
    mean = (2.0 * ends + heights[:-1, 1:] + heights[1:, :-1]) / 6.0
    return float((mean - bottom).sum()) * float(cell[0]) * float(cell[1])


def _known_survey(vertices: np.ndarray, faces: np.ndarray, volume: float) -> Survey:
    """What a survey of the surface would find: one closed shell without a defect.

    Grid lines are distinct doubles and walls are higher than 0, so no two vertices are equal and no facet is without
    area; seen from above cells tile the rectangle, and every edge of cells, walls and bottom has its two facets.
    """
    flags, shells = np.zeros(len(faces), dtype=np.int32), np.zeros(len(faces), dtype=np.int32)
    volumes, signs = np.array([volume]), np.ones(1, dtype=np.int8)
    for array in (flags, shells, volumes, signs):
        array.flags.writeable = False
    return mesh_survey.Survey(
        faces, flags, shells, volumes, signs, n_shells=1, edges=3 * len(faces) // 2, open_edges=0, pinches=0,
        used=len(vertices), welded=0,
    )
