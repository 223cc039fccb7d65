"""SignedDistanceGrid: a distance function sampled on a regular grid, answered by proven bounds between its nodes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidShape
from collide.fields.distance_samples import Samples
from collide.shapes.mesh import Mesh
from collide.shapes.shape import positive, rows
from collide.shapes.shape_files import Field, read_arrays, write_arrays
from collide.surface_queries.signed_distances import signed_distances
from collide.transforms import LARGEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

#: Nodes of a grid at most: 4 GiB of floats.
_MAX_NODES = 1 << 30
#: Nodes whose distances are worked out at once.
_BLOCK = 1 << 18
#: Cells no smaller and grids no larger have values that are float32 [m].
_SINGLES = 1e-30, 1e30
#: A cell is at least so much of the largest coordinate of a node.
_LEAST_CELL = 2.0**-40
#: Changes whenever files written before would be read wrongly.
_FILE_FORMAT = 1
_FILE_FIELDS = {
    "values": Field("f", (None, None, None)), "cell": Field("f8", (3,)), "origin": Field("f8", (3,)),
    "error": Field("f8", ()),
}


class GridDistances(NamedTuple):
    """What a grid says of n points; of a single point numbers.

    distance : (n,) between the nodes' values, linear along each axis, within the bounds: an estimate [m].
    lower, upper : (n,) lower ≤ truth ≤ upper, proven [m].
    """

    distance: Any
    lower: Any
    upper: Any


class SignedDistanceGrid:
    """Samples of a signed distance on a regular grid, and brackets of the distance everywhere.

    Made by `from_mesh`, `from_arrays` or `load`. A grid is a bound, never exact: a distance changes by no more than the
    way between two points, so every node bounds the distance around itself, and a bracket is a cell's diagonal wide at
    most.

    Raises
    ------
    InvalidShape
        Always: the class itself makes no grid.

    Notes
    -----
    ``values`` (nx, ny, nz) float32 or float64, read-only [m]: node (i, j, k) stands at ``origin + cell · (i, j, k)``,
    computed in doubles. ``error`` [m]: how far a value may be off. ``cell``, ``origin``: (3,) [m]. ``low``, ``high``:
    (3,) the corners of the box of all nodes. Grids are immutable.
    """

    __slots__ = ("_samples", "cell", "error", "origin", "values")

    _samples: Samples
    values: np.ndarray
    cell: np.ndarray
    origin: np.ndarray
    error: float

    def __init__(self) -> None:
        raise InvalidShape(
            "SignedDistanceGrid: grids are made by SignedDistanceGrid.from_mesh(mesh, cell), from_arrays(values, cell, "
            "origin) and load(path)"
        )

    @classmethod
    def from_mesh(
        cls, mesh: Mesh, cell: ArrayLike, *, margin: float = 0.0, signed: bool = True, threads: int = 1
    ) -> SignedDistanceGrid:
        """The distances of a mesh, sampled at nodes around the mesh by `signed_distances`.

        Parameters
        ----------
        mesh : Mesh
            A solid; with ``signed=False`` a surface as well.
        cell : float or (3,) array_like
            Sides of a cell, > 0 [m].
        margin : float
            How far the grid reaches beyond the mesh's box at least, ≥ 0 [m].
        signed : bool
            False samples distances without sign.
        threads : int
            At most so many.

        Returns
        -------
        SignedDistanceGrid
            Its values are float32, of cells below 1e-30 m and grids beyond 1e30 m float64; their rounding is part of
            ``error``.

        Raises
        ------
        InvalidArgument
            For anything but a `Mesh`.
        InvalidShape
            For a cell or margin that is no such length, more than 2³⁰ nodes, cells lost in rounding.
        UnsupportedQuery
            For a surface, which has no inside, unless ``signed=False``.

        Notes
        -----
        Some microseconds a node, as `signed_distances` takes; 4 bytes a node.
        """
        who = "SignedDistanceGrid.from_mesh"
        checks.instance(f"{who}: mesh", mesh, Mesh, "a Mesh; of other shapes Mesh(*collide.tessellate(shape))")
        sides, margin = _sides(who, cell), positive(who, "margin", margin, zero=True)
        corners = mesh.vertices[mesh.faces].reshape(-1, 3)
        low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
        with np.errstate(over="ignore"):
            counts = np.maximum(np.ceil((high - low) / sides) + 1.0, 2.0)
        if not counts.prod() <= _MAX_NODES:
            raise InvalidShape(
                f"{who}: cell {checks.brief(cell)} and margin {checks.brief(margin)} make {counts.prod():.3g} nodes, "
                "more than 2**30; take larger cells"
            )
        is_single = _SINGLES[0] <= sides.min() and sides.max() * counts.max() <= _SINGLES[1]
        values = np.empty(tuple(int(n) for n in counts), dtype=np.float32 if is_single else np.float64)
        _refuse_rounded_cells(who, cell, sides, low, values.shape)
        samples, error = Samples(values, sides, low, 0.0), 0.0
        layers = max(1, _BLOCK // (values.shape[1] * values.shape[2]))
        for first in range(0, len(values), layers):
            nodes = samples.nodes(first, first + layers)
            near = signed_distances(mesh, nodes, signed=signed, threads=threads)
            rounded = near.distance.astype(values.dtype)
            values[first : first + layers].reshape(-1)[:] = rounded
            off = np.maximum(near.upper - rounded, rounded - near.lower)
            error = max(error, float(off.max()))
        return cls._checked(who, values, sides, low, error * (1.0 + 2.0**-50))

    @classmethod
    def from_arrays(
        cls, values: ArrayLike, cell: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0), *, error: float = 0.0
    ) -> SignedDistanceGrid:
        """A grid of given values.

        Parameters
        ----------
        values : (nx, ny, nz) array_like
            Distances at the nodes, negative inside [m]; at least two along each axis. float32 is kept, all else becomes
            float64.
        cell : float or (3,) array_like
            Sides of a cell, > 0 [m].
        origin : (3,) array_like
            The node (0, 0, 0) [m].
        error : float
            How far a value may be off, ≥ 0 [m].

        Returns
        -------
        SignedDistanceGrid
            With a copy of the values.

        Raises
        ------
        InvalidShape
            For arrays of another shape or not finite, sides of a cell not above 0, and values that are no distances:
            where two neighbours differ by more than the way between their nodes, with these nodes.

        Notes
        -----
        0.05 µs a node. Values scaled or smoothed fail the check, and distances to voxels, too, unless ``error`` covers
        them: brackets from these would not hold.
        """
        who = "SignedDistanceGrid.from_arrays"
        is_single = checks.plain_array(f"{who}: values", values, "(nx, ny, nz)", InvalidShape).dtype == np.float32
        array = rows(who, "values", values, (None, None, None))
        if min(array.shape) < 2:
            raise InvalidShape(f"{who}: values must have two nodes along each axis at least, got shape {array.shape}")
        if is_single:
            array = array.astype(np.float32)
        sides, start = _sides(who, cell), rows(who, "origin", origin, (3,))
        _refuse_rounded_cells(who, cell, sides, start, array.shape)
        return cls._checked(who, array, sides, start, positive(who, "error", error, zero=True))

    @classmethod
    def _checked(cls, who: str, values, cell, origin, error: float) -> SignedDistanceGrid:
        samples = Samples(values, cell, origin, error)
        excess, a, b = samples.steepest_step()
        if excess > 0.0:
            raise InvalidShape(
                f"{who}: values: nodes {a} and {b} have {values[tuple(a)]:g} and {values[tuple(b)]:g}, which differ by "
                f"{excess:g} more than the nodes are apart: no distances. Give distances in the unit of cell, or an "
                "error that covers the difference"
            )
        made = object.__new__(cls)
        for array in (values, cell, origin):
            array.flags.writeable = False
        for name, value in zip(cls.__slots__, (samples, cell, float(error), origin, values)):
            object.__setattr__(made, name, value)
        return made

    def __setattr__(self, name, value):
        raise AttributeError(f"SignedDistanceGrid is immutable: {name} cannot be set")

    def __reduce__(self):
        return _again, (self.values, self.cell, self.origin, self.error)

    def __repr__(self) -> str:
        nx, ny, nz = self.values.shape
        return f"SignedDistanceGrid(<{nx} × {ny} × {nz} nodes>, cell={self.cell.tolist()}, error={self.error:.3g})"

    @property
    def low(self) -> np.ndarray:
        """(3,) the least corner of the box of all nodes [m]."""
        return self.origin

    @property
    def high(self) -> np.ndarray:
        """(3,) the largest corner of the box of all nodes [m]."""
        return self.origin + self.cell * (np.array(self.values.shape) - 1)

    def distances(self, points: ArrayLike) -> GridDistances:
        """Brackets of the distance at points, with an estimate.

        Parameters
        ----------
        points : (3,) or (n, 3) array_like, float64
            In the frame of the grid [m], coordinates within 1e50; outside of the box of all nodes as well.

        Returns
        -------
        GridDistances
            From the eight nodes around a point; outside from the eight nodes of the nearest cell: brackets widen with
            the distance from the box.

        Raises
        ------
        InvalidArgument
            For points not finite or beyond 1e50.

        Notes
        -----
        With nodes x_i, values d_i and their error e: max(d_i − r_i) − e ≤ d(p) ≤ min(d_i + r_i) + e with the
        distances r_i of p from the nodes, rounding added. 0.2 µs a point.
        """
        places, single = checks.vectors("SignedDistanceGrid.distances", "points", points)
        beyond = np.abs(places).max(axis=1) > LARGEST
        checks.refuse_rows("SignedDistanceGrid.distances", "points", places, beyond, f"exceeds {LARGEST:g}")
        out = self._samples.bracket(places)
        return GridDistances(*out[:, 0]) if single else GridDistances(*out)

    def save(self, path) -> None:
        """Write the grid to an ``.npz`` file.

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
        arrays = {name: np.asarray(getattr(self, name)) for name in _FILE_FIELDS}
        write_arrays("SignedDistanceGrid", path, _FILE_FORMAT, arrays)

    @classmethod
    def load(cls, path) -> SignedDistanceGrid:
        """A grid from a file written by `save`.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        SignedDistanceGrid
            Equal to the saved grid.

        Raises
        ------
        InvalidShape
            Where the file is of another kind, or damaged, or describes no distances.
        """
        arrays = read_arrays("SignedDistanceGrid", path, _FILE_FORMAT, _FILE_FIELDS, "grid_")
        error = float(arrays.pop("error"))
        try:
            return cls.from_arrays(**arrays, error=error)
        except InvalidShape as error_of_arrays:
            raise InvalidShape(f"SignedDistanceGrid.load: {path}: {error_of_arrays}") from None


def _again(values, cell, origin, error) -> SignedDistanceGrid:
    return SignedDistanceGrid.from_arrays(values, cell, origin, error=error)


def _sides(who: str, cell) -> np.ndarray:
    """(3,) sides of a cell, > 0."""
    sides = (cell,) * 3 if checks.number(cell) is not None else cell
    read = checks.array(f"{who}: cell", sides, "a length or (3,)", InvalidShape)
    if read.shape != (3,):
        raise InvalidShape(f"{who}: cell must be a length or (3,), got {checks.brief(cell)}")
    return np.array([positive(who, "cell", side) for side in read.tolist()])


def _refuse_rounded_cells(who: str, cell, sides: np.ndarray, origin: np.ndarray, shape: tuple[int, ...]) -> None:
    ends = np.maximum(np.abs(origin), np.abs(origin + sides * (np.array(shape) - 1)))
    if not (ends <= LARGEST).all() or (sides < _LEAST_CELL * ends).any():
        raise InvalidShape(
            f"{who}: cell {checks.brief(cell)}: nodes reach {ends.max():g} m from the frame's origin, where cells are "
            f"lost in rounding, or beyond {LARGEST:g} m; move the grid's origin nearer, or take larger cells"
        )
