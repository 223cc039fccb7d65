"""HeightField: heights over a grid and all that is below them, as a closed mesh of triangles, made when asked
for.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidShape, MissingExtra
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, positive, rows, scalar
from collide.shapes.shape_files import Field, read_arrays, write_arrays
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.fields import height_pyramid, terrain_surface
    from collide.mesh import mesh_survey
    from collide.mesh.mesh_survey import Survey

if not TYPE_CHECKING:
    mesh_survey = lazy_module("collide.mesh.mesh_survey")
    height_pyramid = lazy_module("collide.fields.height_pyramid")
    terrain_surface = lazy_module("collide.fields.terrain_surface")

#: Cells of a field at most; of more than so many, triangles are made where they are needed.
_MAX_CELLS, _MAX_MESHED = 1 << 30, 1 << 20


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
        y = (i − (r − 1)/2)·dy, and the field's middle at x = y = 0. NaN makes a hole: cells with a corner there are
        left out, down to the bottom.
    cell : float or (2,) array_like, float64
        Sides of a cell [m], > 0: of a square cell, or (dx, dy).
    bottom : float, optional
        z of the bottom [m], below all heights. By default the bottom lies below the lowest height by as much as heights
        differ and the longer side of the field together: a body no taller than the field is wide, and reaching up to
        the lowest height, has its shorter way out upwards.

    Raises
    ------
    InvalidShape
        For heights that are infinite, out of range, fewer than 2 × 2 or of 2³⁰ cells or more; holes that leave no cell;
        cells not above 0; a bottom not below all heights.

    Notes
    -----
    A height field is a solid `Mesh`, and every query for meshes takes height fields: ``vertices``, ``faces`` and
    ``tree`` describe the surface. Each cell is two triangles, cut from the grid point (i, j) to (i + 1, j + 1); between
    grid points the surface is the triangles themselves, z no rounded interpolation. Facet 2·(i·(c − 1) + j) + t is
    triangle t of cell (i, j); walls and bottom follow (`cells_of` tells them apart). Vertex i·c + j is the grid point
    (i, j).

    No triangle is made before a query needs it, and the surface closes by construction, so nothing is welded and no
    edge is looked for: O(r c), 0.15 µs a facet; the box-tree costs ten times as much. Of more than a million cells
    only those near the other shape, or below a ray, are made into triangles, again and again but for the last few
    places; facets of walls and bottom then have the number −1. Files and pickles hold heights, cell and bottom alone.
    `scaled` copies are meshes; their facets are numbered as in their ``base``.
    """

    __slots__ = ("bottom", "cell", "heights", "pyramid")
    _fields = ("heights", "cell", "bottom")
    heights: np.ndarray
    cell: np.ndarray
    bottom: float

    def __init__(self, heights: ArrayLike, cell: ArrayLike, *, bottom: float | None = None):
        heights = _check_heights(heights)
        cell = _check_cell(cell)
        x, y = _grid_line(heights.shape[1], cell[0], "dx"), _grid_line(heights.shape[0], cell[1], "dy")
        pyramid = height_pyramid.HeightPyramid(heights)
        if not pyramid.n_cells:
            raise InvalidShape(
                f"HeightField: heights: every cell has a corner in a hole (nan), got {checks.brief(heights)}"
            )
        bottom = _check_bottom(bottom, heights, x, y)
        self._store(
            heights=heights, cell=cell, bottom=bottom, solid=True, scale=1.0, _copied=None, pyramid=pyramid,
        )

    def __getattr__(self, name: str) -> Any:
        """Triangles, made when first asked for."""
        if name in ("vertices", "faces"):
            surface = terrain_surface.surface_of(self.heights, *self.grid_lines, self.bottom)
            self._store(vertices=surface.vertices, faces=surface.faces)
        elif name == "_survey" and not self.has_holes:
            volume = _volume(self.heights, self.cell, self.bottom)
            self._store(_survey=_known_survey(self.vertices, self.faces, volume))
        else:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return getattr(self, name)

    @property
    def has_holes(self) -> bool:
        """Whether cells are left out."""
        return self.pyramid.n_cells < (self.heights.shape[0] - 1) * (self.heights.shape[1] - 1)

    @property
    def is_field(self) -> bool:  # type: ignore[override]
        """Whether there are too many cells to make triangles of all."""
        return self.pyramid.n_cells > _MAX_MESHED

    @property
    def meshed(self) -> bool:  # type: ignore[override]
        """Whether triangles of all cells are made when a query needs triangles."""
        return not self.is_field

    @property
    def grid_lines(self) -> tuple[np.ndarray, np.ndarray]:
        """x (c,) and y (r,) of the grid points [m]."""
        r, c = self.heights.shape
        return _grid_line(c, self.cell[0], "dx"), _grid_line(r, self.cell[1], "dy")

    @classmethod
    def from_image(
        cls, image: ArrayLike | str, cell: ArrayLike, *, low: float = 0.0, high: float = 1.0,
        bottom: float | None = None,
    ) -> HeightField:
        """Terrain from grey values, the image's upper edge towards +y.

        Parameters
        ----------
        image : (r, c) array_like of int or float, or a path
            Grey values: of unsigned integers from 0 to the largest of their type, of floats from 0 to 1; NaN makes
            holes. Files need the extra ``clouds`` (Pillow); pictures in colour are refused.
        cell : float or (2,) array_like, float64
            Sides of a cell, as of the constructor [m].
        low, high : float
            Heights of black and white [m]; of an inverted picture ``high`` is the lower.
        bottom : float, optional
            As of the constructor.

        Returns
        -------
        HeightField

        Raises
        ------
        InvalidShape
            For images of another shape or type, files that cannot be read; as the constructor.
        MissingExtra
            For a file where Pillow is not installed.
        """
        low, high = scalar("HeightField.from_image", "low", low), scalar("HeightField.from_image", "high", high)
        grey = _grey_of(image)
        white = float(np.iinfo(grey.dtype).max) if grey.dtype.kind == "u" else 1.0
        return cls(low + (high - low) / white * grey[::-1].astype(np.float64), cell, bottom=bottom)

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
        n_facets = 2 * self.pyramid.n_cells if self.is_field else len(self.faces)
        outside = (numbers < -1) | (numbers >= n_facets)
        if outside.any():
            raise InvalidArgument(
                f"HeightField.cells_of: facets: {int(numbers[outside][0])} is none of 0 … {n_facets - 1}, "
                "nor −1 for none"
            )
        columns = self.heights.shape[1] - 1
        on_top = (numbers >= 0) & (numbers < 2 * self.pyramid.n_cells)
        cell = self.pyramid.cells_of(np.where(on_top, numbers // 2, 0))
        parts = (cell // columns, cell % columns, numbers % 2)
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
    checks.no_path("HeightField: heights", heights, "HeightField.from_image and HeightField.load", InvalidShape)
    array = checks.array("HeightField: heights", heights, "(r, c)", InvalidShape)
    if array.ndim != 2 or min(array.shape) < 2:
        raise InvalidShape(
            f"HeightField: heights must have at least 2 rows and 2 columns of grid points, got shape {array.shape}"
        )
    if array.size >= _MAX_CELLS:
        raise InvalidShape(
            f"HeightField: heights of shape {array.shape} are more than the 2³⁰ that a field holds; cut it into several"
        )
    holes = np.isnan(array)
    if not holes.any():
        return rows("HeightField", "heights", array, (None, None))
    heights = rows("HeightField", "heights", np.where(holes, 0.0, array), (None, None)).copy()
    heights[holes] = np.nan
    heights.flags.writeable = False
    return heights


def _grey_of(image) -> np.ndarray:
    """Grey values of an array or a file, bool and integers as unsigned."""
    name = "HeightField.from_image: image"
    if isinstance(image, (str, os.PathLike)):
        image = _read_image(image)
    grey = checks.plain_array(name, image, "(r, c)", InvalidShape)
    if grey.ndim != 2 or grey.dtype.kind not in "uf":
        raise InvalidShape(
            f"{name} must be (r, c) of unsigned integers or floats, got {grey.dtype} {grey.shape}; turn colours to "
            "grey first"
        )
    if min(grey.shape) < 2 or (grey.dtype.kind == "f" and np.isnan(grey).all()):
        raise InvalidShape(
            f"{name} must have at least 2 rows and 2 columns of grey values, not all NaN, got {checks.brief(grey)}"
        )
    if grey.dtype.kind == "f" and ((grey < 0.0) | (grey > 1.0)).any():
        raise InvalidShape(
            f"{name}: grey values of floats lie within 0 … 1, got {np.nanmin(grey):g} … {np.nanmax(grey):g}; divide by "
            "the value of white, or give unsigned integers"
        )
    return grey


def _read_image(path) -> np.ndarray:
    """A picture's grey values. Raises MissingExtra, InvalidShape."""
    try:
        from PIL import Image
    except ImportError:
        raise MissingExtra("pillow", extra="clouds", purpose="read images") from None
    try:
        with Image.open(path) as picture:
            return np.asarray(picture)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise InvalidShape(f"HeightField.from_image: image {checks.brief(path)}: {error}") from None


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
    i, j = np.unravel_index(np.nanargmin(heights), heights.shape)
    lowest = float(heights[i, j])
    if bottom is not None:
        number = scalar("HeightField", "bottom", bottom)
        if not number < lowest:
            raise InvalidShape(
                f"HeightField: bottom must lie below all heights, got {number!r}, and heights[{i}, {j}] is {lowest!r}"
            )
        return number
    width = 2.0 * float(max(x[-1], y[-1]))
    number = lowest - (float(np.nanmax(heights)) - lowest + width)
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
