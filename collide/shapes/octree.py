"""OcTree: a map of occupancy in cubes of several sizes, as OctoMap keeps it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidShape
from collide.shapes.shape import IDENTITY, equal_but_for_signs, positive, rows
from collide.shapes.voxel_grid import VoxelGrid, scaled_pose, tree_of_cells
from collide.transforms import as_pose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

cell_tree: Any = lazy_module("collide.fields.cell_tree")
ray_cells: Any = lazy_module("collide.fields.ray_cells")
octree_files: Any = lazy_module("collide.fields.octree_files")

#: Of a cell that a ray ends in, and of one that it goes through: OctoMap's log-odds.
HIT, MISS = math.log(0.7 / 0.3), math.log(0.4 / 0.6)
#: Of leaves of files that only say occupied or free: where OctoMap clamps log-odds.
_OCCUPIED, _FREE = 3.5, -2.0
#: A leaf has no more than 2^16 cells along an axis.
_MAX_EXPONENT = 16
#: Indices of cells in OctoMap's files lie within this.
_FARTHEST = 1 << 15


class OcTreeLeaves(NamedTuple):
    """The leaves of an octree.

    cell : (n, 3) int64, indices of the least cell of each, a multiple of 2^exponent along each axis; cell (i, j, k)
    reaches from (i, j, k) · resolution to (i + 1, j + 1, k + 1) · resolution.
    exponent : (n,) int64, a leaf has 2^exponent cells along each axis.   log_odds : (n,) float64, of being occupied.
    """

    cell: np.ndarray
    exponent: np.ndarray
    log_odds: np.ndarray


class OcTree(VoxelGrid):
    """The union of the occupied leaves of an octree: a map of a robot's world, as an obstacle.

    Parameters
    ----------
    leaves : OcTreeLeaves, or three arrays in its order
        All known leaves, free or occupied, none within another.
    resolution : float
        Side of the smallest cells, > 0 [m].
    threshold : float
        Leaves count as occupied from this probability on, within (0, 1).
    unknown : {"free", "occupied"}
        What cells are that no leaf covers, within the box around all leaves; outside of the box they are free.
    X : (4, 4) array_like, optional
        Pose of the map in the frame of the shape.

    Raises
    ------
    InvalidShape
        For arrays of other shapes or types, least cells that are no multiples of their leaf's size, leaves within
        others, a resolution not above 0, a threshold outside (0, 1); where no leaf counts as occupied; for maps too
        large (see `VoxelGrid`).
    InvalidArgument
        For a matrix that is no pose.

    Notes
    -----
    A `VoxelGrid` with the cells of the occupied leaves, whose ``part`` numbers name the least cells of boxes: of
    leaves, or of an eighth of those of 2, 8, 32, … cells a side. O(n log n) for n leaves.
    """

    __slots__ = ("leaves", "threshold", "unknown")
    _fields = ("leaves", "resolution", "threshold", "unknown", "X")
    leaves: OcTreeLeaves
    threshold: float
    unknown: str

    def __init__(
        self, leaves: OcTreeLeaves | tuple[ArrayLike, ArrayLike, ArrayLike], resolution: float, *,
        threshold: float = 0.5, unknown: str = "free", X: ArrayLike | None = None,
    ):
        leaves, resolution = _checked_leaves(leaves), positive("OcTree", "resolution", resolution)
        threshold = _checked_threshold(threshold)
        if not isinstance(unknown, str) or unknown not in ("free", "occupied"):
            raise InvalidShape(f'OcTree: unknown must be "free" or "occupied", got {checks.brief(unknown)}')
        pose, sides = IDENTITY if X is None else as_pose(X, "OcTree: X"), np.full(3, resolution)
        occupied = leaves.log_odds >= _log_odds_of(threshold)
        cells, exponents = leaves.cell[occupied], leaves.exponent[occupied]
        if unknown == "occupied":
            more, of_more = _unknown_cubes(leaves, sides)
            cells, exponents = np.concatenate([cells, more]), np.concatenate([exponents, of_more])
        if not len(cells):
            n = len(leaves.cell)
            raise InvalidShape(
                f"OcTree: none of {n} leaves is occupied, the threshold being {threshold:g}; take a lower one, or make "
                "no body of an empty map"
            )
        self._keep(tree_of_cells("OcTree", cells, exponents, sides, pose), pose)
        for part in leaves:
            part.flags.writeable = False
        self._store(leaves=leaves, threshold=threshold, unknown=unknown)

    @classmethod
    def _from_fields(cls, leaves, resolution, threshold, unknown, X) -> OcTree:  # type: ignore[override]
        return cls(leaves, resolution, threshold=threshold, unknown=unknown, X=X)

    @property
    def resolution(self) -> float:
        """Side of the smallest cells [m]."""
        return float(self.cell[0])

    @classmethod
    def from_file(  # type: ignore[override]
        cls, path, *, resolution: float | None = None, threshold: float = 0.5, unknown: str = "free",
        X: ArrayLike | None = None,
    ) -> OcTree:
        """The map of an OctoMap file: ``.bt``, occupied or free, or ``.ot``, log-odds; colours are left out.

        Parameters
        ----------
        path : str or Path
            The file, at most 2 GiB, in the form told by its first line.
        resolution : float, optional
            The resolution wanted of the file, to five digits [m].
        threshold, unknown, X
            As of the constructor. Leaves of a ``.bt`` count as occupied with any threshold up to 0.97, as in OctoMap.

        Returns
        -------
        OcTree

        Raises
        ------
        InvalidShape
            For a missing or damaged file, one of another resolution; as the constructor.

        Notes
        -----
        About 0.05 s for a million nodes, and O(n log n) for the tree.
        """
        leaves = octree_files.read_octree_file(path, resolution)
        return cls._of_stream(leaves, threshold=threshold, unknown=unknown, X=X)

    @classmethod
    def from_message(
        cls, message: Any, *, threshold: float = 0.5, unknown: str = "free", X: ArrayLike | None = None
    ) -> OcTree:
        """The map of an ``octomap_msgs/Octomap``, without ROS.

        Parameters
        ----------
        message : object or mapping
            With ``id``, ``resolution``, ``binary`` and ``data``: bytes, or int8 in any form.
        threshold, unknown, X
            As of the constructor. An origin told beside the message is the ``X`` here.

        Returns
        -------
        OcTree

        Raises
        ------
        InvalidShape
            For fields missing or not matching; as the constructor.
        """
        return cls._of_stream(octree_files.leaves_of_message(message), threshold=threshold, unknown=unknown, X=X)

    @classmethod
    def _of_stream(cls, leaves, **options) -> OcTree:
        log_odds = np.where(leaves.occupied, _OCCUPIED, _FREE) if leaves.log_odds is None else leaves.log_odds
        return cls((leaves.corners, leaves.exponents, log_odds), leaves.resolution, **options)

    def _scaled(self, s: np.ndarray) -> OcTree:
        factor = equal_but_for_signs(s, "an octree has a single resolution")
        cell, exponent, log_odds = self.leaves
        mirrored = np.where(s < 0.0, -(cell + (1 << exponent)[:, None]), cell)
        return OcTree(
            (mirrored, exponent, log_odds), self.resolution * factor, threshold=self.threshold, unknown=self.unknown,
            X=scaled_pose(self.X, s),
        )

    def save(self, path) -> None:
        """Write the leaves to a ``.bt`` file, occupied by this map's threshold or free.

        Parameters
        ----------
        path : str or Path
            The file, ending in ``.bt``; an existing file is replaced, by all of the new file or not at all. ``X`` is
            not written.

        Raises
        ------
        InvalidShape
            For another suffix, leaves beyond 32,768 cells from the origin, or a file that cannot be written.
        """
        if checks.file_path("OcTree.save: path", path, InvalidShape).suffix.lower() != ".bt":
            raise InvalidShape(f"OcTree.save: {checks.brief(path)}: the suffix must be .bt")
        cell, exponent, log_odds = self.leaves
        if max(abs(int(cell.min())), abs(int(cell.max()))) > _FARTHEST:
            raise InvalidShape(f"OcTree.save: a .bt file holds cells within ±{_FARTHEST}, got {checks.brief(cell)}")
        occupied = log_odds >= _log_odds_of(self.threshold)
        stream = octree_files.StreamLeaves(self.resolution, cell, exponent, occupied)
        try:
            octree_files.write_octree_file(path, stream)
        except OSError as error:
            raise InvalidShape(f"OcTree.save: {checks.brief(path)}: {error}") from None

    @classmethod
    def from_points(cls, points: ArrayLike, resolution: float) -> OcTree:  # type: ignore[override]
        """The cells in which points lie, occupied; all others are unknown.

        Parameters
        ----------
        points : (n, 3) array_like, float64
            [m], in the frame of the map.
        resolution : float
            Side of a cell, > 0 [m].

        Returns
        -------
        OcTree

        Raises
        ------
        InvalidShape
            For points of another shape, empty, not finite; as the constructor.
        """
        resolution = positive("OcTree.from_points", "resolution", resolution)
        name = "OcTree.from_points"
        cells = _distinct(name, _cells_of_points(name, "points", points, resolution))
        n = len(cells)
        return cls(OcTreeLeaves(cells, np.zeros(n, dtype=np.int64), np.full(n, HIT)), resolution)

    @classmethod
    def from_rays(
        cls, origins: ArrayLike, points: ArrayLike, resolution: float, *, max_range: float = math.inf,
        threshold: float = 0.5, unknown: str = "free",
    ) -> OcTree:
        """A map of a sensor's rays: cells at their ends are occupied, cells on their way are free.

        Parameters
        ----------
        origins : (3,) or (n, 3) array_like, float64
            Of the sensor, for all rays or for each [m].
        points : (n, 3) array_like, float64
            Where rays end [m].
        resolution : float
            Side of a cell, > 0 [m].
        max_range : float
            Longer rays end at this distance, without a hit [m].
        threshold, unknown
            As of the constructor.

        Returns
        -------
        OcTree
            Its cells have OctoMap's log-odds of a single scan: log(0.7 / 0.3) where a ray ends, log(0.4 / 0.6) where
            rays only go through.

        Raises
        ------
        InvalidShape
            For arrays of other shapes, empty, not finite; where no ray ends in a cell; as the constructor.
        """
        name = "OcTree.from_rays"
        resolution = positive(name, "resolution", resolution)
        ends = rows(name, "points", points, (None, 3))
        begins = checks.array(f"{name}: origins", origins, "(3,) or (n, 3)", InvalidShape)
        begins = np.broadcast_to(begins, ends.shape) if begins.shape == (3,) else begins
        begins = rows(name, "origins", begins, (None, 3))
        if len(begins) != len(ends):
            raise InvalidShape(f"{name}: {len(begins)} origins and {len(ends)} points; give as many, or one origin")
        lengths, limit = np.linalg.norm(ends - begins, axis=1), checks.limit(f"{name}: max_range", max_range)
        is_hit = lengths <= limit
        far = ~is_hit
        ends = ends.copy()
        ends[far] = begins[far] + (ends[far] - begins[far]) * (limit / lengths[far])[:, None]
        if not is_hit.any():
            raise InvalidShape(f"{name}: no ray of {len(ends)} ends within max_range {limit:g} m")
        _cells_of_points(name, "origins", begins, resolution)  # refuses origins too far away for numbers of cells
        hits = _distinct(name, _cells_of_points(name, "points", ends, resolution)[is_hit])
        through = ray_cells.cells_through(begins / resolution, ends / resolution)
        cells = _distinct(name, np.concatenate([hits, through]))
        log_odds = np.where(_are_among(cells, hits), HIT, MISS)
        leaves = OcTreeLeaves(cells, np.zeros(len(cells), dtype=np.int64), log_odds)
        return cls(leaves, resolution, threshold=threshold, unknown=unknown)

    def _key(self) -> tuple:
        leaves = (part.tobytes() for part in self.leaves)
        return (self.resolution, (self.X + 0.0).tobytes(), *leaves, self.threshold, self.unknown)


def _cells_of_points(name: str, field: str, points, resolution: float) -> np.ndarray:
    cells = np.floor(rows(name, field, points, (None, 3)) / resolution)
    if not np.abs(cells).max() < 2.0**53:
        raise InvalidShape(f"{name}: a resolution of {resolution:g} m is too fine for these points; take larger cells")
    return cells.astype(np.int64)


def _numbered(cells: np.ndarray, low: np.ndarray) -> np.ndarray:
    """(n,) numbers of cells (n, 3) that span less than 2²⁰ along each axis from ``low`` on, x slowest."""
    x, y, z = (cells - low).T
    return x << 40 | y << 20 | z


def _distinct(name: str, cells: np.ndarray) -> np.ndarray:
    """Cells (n, 3), each once, in ascending order. Raises InvalidShape where they span too much."""
    low = cells.min(axis=0)
    span = int((cells - low).max())
    if not span < 1 << 20:
        raise InvalidShape(f"{name}: cells span {span} along an axis, and 2²⁰ are the most; take larger cells")
    numbers = np.sort(_numbered(cells, low))
    numbers = numbers[np.diff(numbers, prepend=-1) != 0]
    return np.stack([numbers >> 40, numbers >> 20 & 0xFFFFF, numbers & 0xFFFFF], axis=1) + low


def _are_among(cells: np.ndarray, some: np.ndarray) -> np.ndarray:
    """(n,) bool: which distinct cells are among some of them, both ascending."""
    low = cells.min(axis=0)
    is_among = np.zeros(len(cells), dtype=bool)
    is_among[np.searchsorted(_numbered(cells, low), _numbered(some, low))] = True
    return is_among


def _log_odds_of(probability: float) -> float:
    return math.log(probability / (1.0 - probability))


def _checked_threshold(threshold) -> float:
    value = checks.number(threshold)
    if value is None or not 0.0 < value < 1.0:
        raise InvalidShape(f"OcTree: threshold must be a probability within (0, 1), got {checks.brief(threshold)}")
    return float(value)


def _checked_leaves(leaves) -> OcTreeLeaves:
    checks.no_path("OcTree: leaves", leaves, "OcTree.from_file", InvalidShape)
    if not isinstance(leaves, (tuple, list)) or len(leaves) != 3:
        raise InvalidShape(
            f"OcTree: leaves must be (cell, exponent, log_odds), got {checks.brief(leaves)}; points are taken by "
            "OcTree.from_points, cells alone by VoxelGrid"
        )
    cell = checks.plain_array("OcTree: leaves.cell", leaves[0], "(n, 3)", InvalidShape)
    exponent = checks.plain_array("OcTree: leaves.exponent", leaves[1], "(n,)", InvalidShape)
    if not np.size(leaves[2]):
        raise InvalidShape("OcTree: the map has no leaf: it is empty, or nothing was seen yet; leave the body out")
    log_odds = rows("OcTree", "leaves.log_odds", leaves[2], (None,))
    n = len(log_odds)
    if cell.shape != (n, 3) or exponent.shape != (n,) or cell.dtype.kind not in "iu" or exponent.dtype.kind not in "iu":
        raise InvalidShape(
            "OcTree: leaves must be cell (n, 3) and exponent (n,) of int, log_odds (n,), got "
            f"{cell.shape} {cell.dtype}, {exponent.shape} {exponent.dtype}, {log_odds.shape}"
        )
    if not (exponent.min() >= 0 and exponent.max() <= _MAX_EXPONENT):
        raise InvalidShape(
            f"OcTree: leaves.exponent must lie within 0 … {_MAX_EXPONENT}, got {checks.brief(leaves[1])}"
        )
    if not max(abs(int(cell.min())), abs(int(cell.max()))) < 1 << 53:
        raise InvalidShape(f"OcTree: leaves.cell must lie within ±2⁵³, got {checks.brief(leaves[0])}")
    cell, exponent = cell.astype(np.int64), exponent.astype(np.int64)
    off = np.flatnonzero((cell & (1 << exponent)[:, None] - 1).any(axis=1))
    if len(off):
        k = int(off[0])
        raise InvalidShape(
            f"OcTree: leaves.cell[{k}] is {cell[k].tolist()}, no multiple of its leaf's {1 << int(exponent[k])} cells"
        )
    low = cell.min(axis=0) >> _MAX_EXPONENT << _MAX_EXPONENT
    if not (cell - low).max() < 1 << 20:
        raise InvalidShape(f"OcTree: leaves span {int((cell - low).max())} cells along an axis, and 2²⁰ are the most")
    if cell_tree.cube_within(cell - low, exponent):
        raise InvalidShape("OcTree: leaves lie within others, or stand twice")
    return OcTreeLeaves(cell, exponent, log_odds)


def _unknown_cubes(leaves: OcTreeLeaves, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(least cells, exponents) of cubes that no leaf covers, within the box around all leaves."""
    known = tree_of_cells("OcTree", leaves.cell, leaves.exponent, sides, IDENTITY)
    low, high = leaves.cell.min(axis=0), (leaves.cell + (1 << leaves.exponent)[:, None]).max(axis=0)
    cells, exponents = cell_tree.free_cubes(known, low - known.least, high - known.least)
    return cells + known.least, exponents
