"""PointCloud: balls around points, as sensors give them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidShape, SceneError
from collide.shapes import cloud_formats
from collide.shapes.shape import Shape, equal_but_for_signs, kept_with_shape, positive, rows, scalar
from collide.shapes.shape_files import ANY, Field, read_arrays, refused_as_shape, shape_suffix, write_arrays
from collide.transforms import LARGEST, SMALLEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.fields.point_tree import PointTree

point_tree: Any = lazy_module("collide.fields.point_tree")
sensor_messages: Any = lazy_module("collide.fields.sensor_messages")
#: Who reads files of points: scenes stand above the engine.
_LOADER = "collide.scenes.loaders.cloud_file", "read_points"

#: Changes whenever files written before would be read wrongly. A radius each, or a single one for all.
_FILE_FORMAT = 1
_FILE_FIELDS = {"points": Field("f8", (None, 3)), "radius": ANY, "dropped": Field("i", (), needed=False)}

#: Numbers of nearest points in an answer at most.
_MAX_NEAREST = 1 << 26
#: Of more points for a place all points are sorted: a walk sorts by insertion.
_MAX_WALKED = 512


class NearestPoints(NamedTuple):
    """The points of a cloud nearest to places.

    distance : (m,) or (m, k) from the place to the point, balls left out [m], nearest first; infinite without a point.
    row : int64 alike, rows of ``cloud.points``; −1 without a point.
    """

    distance: np.ndarray
    row: np.ndarray


class PointCloud(Shape):
    """The union of balls around points: the view of a depth camera or a lidar, as an obstacle.

    Parameters
    ----------
    points : (n, 3) array_like, float64
        Centres in the frame of the shape [m], n ≥ 1: arrays of any real dtype, tensors in the computer's memory, arrays
        of records with fields x, y and z, of any shape.
    radius : float or (n,) array_like, float64
        Of the balls, ≥ 0 [m]: a number for all, or a number each; 0 makes points.
    drop_invalid : bool
        Leave out points with coordinates not finite, from pixels without an echo; ``dropped`` is their number. By
        default they are refused.

    Raises
    ------
    InvalidShape
        For points of another shape, empty, not finite or out of range; radii below 0, or of another number.

    Notes
    -----
    Queries answer for the union of the balls as given, exactly where they answer for single balls exactly; ``part``
    numbers of results are rows of ``points``. The first query makes a tree over the points: 0.1 µs a point up to 10⁵,
    0.2 µs at 10⁷, and 23 bytes a point besides the points. Convex shapes walk down the tree, with questions about
    single balls where boxes do not tell: O(log n + k) for the k balls nearby. Depths, contacts and pairs with a mesh, a
    `Compound` or another cloud take the balls nearby as a `Compound`.
    """

    __slots__ = ("_tree", "dropped", "points", "radius")
    _fields = ("points", "radius")
    convex = False
    is_field = True
    points: np.ndarray
    radius: Any
    #: How many points were left out where the cloud was made; not compared.
    dropped: int

    def __init__(self, points: ArrayLike, radius: float | ArrayLike = 0.0, *, drop_invalid: bool = False):
        checks.no_path("PointCloud: points", points, "PointCloud.from_file", InvalidShape)
        points, radii, dropped = _of_records(points), _checked_radius(radius), 0
        if checks.true_or_false("PointCloud: drop_invalid", drop_invalid):
            points, radii, dropped = _only_finite(points, radii)
        points = _checked_points(points)
        if np.ndim(radii) and len(radii) != len(points):
            raise InvalidShape(
                f"PointCloud: radius must be a number or one for each of {len(points)} points, got {len(radii)}: "
                f"{checks.brief(radius)}"
            )
        self._store(points=points, radius=radii, dropped=dropped)

    def _scaled(self, s: np.ndarray) -> PointCloud:
        factor = equal_but_for_signs(s, "its balls would be no balls") if np.any(self.radius) else 0.0
        return PointCloud._of(self.points * s, self.radius * factor, self.dropped)

    @classmethod
    def _of(cls, points, radius, dropped: int) -> PointCloud:
        made = cls(points, radius)
        made._store(dropped=dropped)
        return made

    def __reduce__(self):
        return *super().__reduce__(), self.dropped

    def __setstate__(self, dropped: int) -> None:
        self._store(dropped=dropped)

    @classmethod
    def from_depth(
        cls, depth: ArrayLike, *, fx: float, fy: float, cx: float | None = None, cy: float | None = None,
        radius: float = 0.0, scale: float = 1.0, max_depth: float = math.inf,
    ) -> PointCloud:
        """The points of a depth image, in the frame of the camera: x to the right, y down, z ahead.

        Parameters
        ----------
        depth : (h, w) array_like
            Depths along the camera's axis, in rows from above; 0 and numbers not finite are pixels without an echo.
        fx, fy : float
            Focal lengths, > 0 [pixels].
        cx, cy : float, optional
            The pixel on the axis, columns from 0; by default the middle of the image.
        radius : float
            Of the balls [m].
        scale : float
            Metres in a unit of the depths, > 0: 0.001 for images in millimetres.
        max_depth : float
            Pixels farther away are left out [m].

        Returns
        -------
        PointCloud
            Its ``dropped`` says how many pixels gave no point.

        Raises
        ------
        InvalidShape
            For an image of another shape, without an echo, lengths not above 0, depths below 0.
        """
        image = checks.array("PointCloud.from_depth: depth", depth, "(h, w)", InvalidShape)
        if image.ndim != 2 or not image.size:
            raise InvalidShape(f"PointCloud.from_depth: depth must have shape (h, w), got {image.shape}")
        fx, fy = (positive("PointCloud.from_depth", name, value) for name, value in (("fx", fx), ("fy", fy)))
        z = image * positive("PointCloud.from_depth", "scale", scale)
        if (z < 0.0).any():
            raise InvalidShape("PointCloud.from_depth: depth has numbers below 0")
        height, width = image.shape
        cx = 0.5 * (width - 1) if cx is None else scalar("PointCloud.from_depth", "cx", cx)
        cy = 0.5 * (height - 1) if cy is None else scalar("PointCloud.from_depth", "cy", cy)
        keep = (z > 0.0) & (z <= min(checks.limit("PointCloud.from_depth: max_depth", max_depth), LARGEST))
        if not keep.any():
            raise InvalidShape(
                f"PointCloud.from_depth: no pixel of depth {checks.brief(depth)} has a depth up to max_depth "
                f"{checks.brief(max_depth)}"
            )
        row, column = np.nonzero(keep)
        z = z[keep]
        points = np.stack([(column - cx) / fx * z, (row - cy) / fy * z, z], axis=1)
        return cls._of(points, radius, int(image.size - len(z)))

    @classmethod
    def from_file(
        cls, path: str | Path, radius: float | ArrayLike | None = None, *, drop_invalid: bool = False
    ) -> PointCloud:
        """The points of a file, as they stand there.

        Parameters
        ----------
        path : str or Path
            The file, by its suffix, behind which ``.gz`` may stand: ``.pcd`` (ascii, binary, binary_compressed),
            ``.ply``, ``.las`` and ``.laz``, text with a point a line (``.xyz``, ``.txt``, ``.asc``, ``.csv``), or
            ``.npz`` from `save`. Of several fields or columns x, y and z are read; a first line of text may name
            them.
        radius : float or (n,) array_like, optional
            Of the balls, ≥ 0 [m]. By default 0, of ``.npz`` files the saved radii.
        drop_invalid : bool
            As of the class.

        Returns
        -------
        PointCloud
            Coordinates are taken as metres, in the frame of the file: the sensor's pose in a PCD is not applied.

        Raises
        ------
        SceneError
            For a missing file, a damaged or unreadable file, naming the line of a text.
        MissingExtra
            For LAS and LAZ without laspy and lazrs: ``pip install 'collide-robotics[clouds]'``.
        InvalidShape
            As of the class, and for a damaged ``.npz`` file.

        Notes
        -----
        O(n) time and memory; files of at most 2 GiB, unpacked. docs/clouds.md has figures.
        """
        path = checks.file_path("PointCloud.from_file: path", path, SceneError)
        checks.true_or_false("PointCloud.from_file: drop_invalid", drop_invalid)
        radius = None if radius is None else _checked_radius(radius)
        if path.suffix.lower() == ".npz":
            cloud = cls.load(path)
            return cloud if radius is None else cls._of(cloud.points, radius, cloud.dropped)
        points = getattr(import_module(_LOADER[0]), _LOADER[1])(path)
        with _refused_from(f"PointCloud.from_file: {path}"):
            return cls(points, 0.0 if radius is None else radius, drop_invalid=drop_invalid)

    @classmethod
    def from_message(
        cls, message: Any, radius: float | ArrayLike = 0.0, *, drop_invalid: bool = False
    ) -> PointCloud:
        """The points of a ``sensor_msgs/PointCloud2`` of ROS or ROS 2, without ROS.

        Parameters
        ----------
        message : object or Mapping
            With ``height``, ``width``, ``fields`` (of ``name``, ``offset``, ``datatype``, ``count``),
            ``is_bigendian``, ``point_step``, ``row_step`` and ``data``: bytes, an array or list of bytes, or base64
            text, as rosbridge sends.
        radius : float or (height · width,) array_like
            Of the balls, ≥ 0 [m].
        drop_invalid : bool
            As of the class: pixels of organised clouds without an echo are NaN.

        Returns
        -------
        PointCloud
            In the frame of the message, row by row; fields besides x, y and z are left out.

        Raises
        ------
        InvalidShape
            For a message without these fields, whose sizes do not match, and as of the class.

        Notes
        -----
        O(n), a few nanoseconds a point: coordinates are copied once.
        """
        points = sensor_messages.points_of_message("PointCloud.from_message: message", message)
        with _refused_from("PointCloud.from_message"):
            return cls(points, radius, drop_invalid=drop_invalid)

    def save(self, path: str | Path) -> None:
        """Write the cloud to a file: whole as ``.npz``, or its points in a form for other programs.

        Parameters
        ----------
        path : str or Path
            The file. ``.npz``, or no suffix: points, radii and ``dropped``, which `load` and `from_file` read. ``.pcd``
            and ``.ply`` (binary) and ``.xyz`` (text): the points alone, without radii and without ``dropped``, which
            `from_file` reads as the same doubles. An existing file is replaced, by all of the new file or not at all.

        Raises
        ------
        InvalidShape
            Where the suffix is another, and where the file cannot be written. LAS holds multiples of a scale, and
            would round points.
        """
        suffix = shape_suffix("PointCloud", path, *cloud_formats.SUFFIXES)
        if suffix in cloud_formats.SUFFIXES:
            with refused_as_shape("PointCloud.save", path):
                cloud_formats.write_points(path, self.points, suffix)
            return
        arrays = {"points": self.points, "radius": np.asarray(self.radius), "dropped": np.array(self.dropped)}
        write_arrays("PointCloud", path, _FILE_FORMAT, arrays)

    @classmethod
    def load(cls, path: str | Path) -> PointCloud:
        """A cloud from an ``.npz`` file written by `save`.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        PointCloud
            Equal to the saved cloud, with its ``dropped``.

        Raises
        ------
        InvalidShape
            Where the file is of another kind, or damaged, or describes no cloud.
        """
        others = "PCD, PLY, LAS and text are read by PointCloud.from_file"
        arrays = read_arrays("PointCloud", path, _FILE_FORMAT, _FILE_FIELDS, "tree_", others)
        dropped = int(arrays.get("dropped", 0))
        if dropped < 0:
            raise InvalidShape(f"PointCloud.load: {path}: dropped must be ≥ 0, got {dropped}")
        with _refused_from(f"PointCloud.load: {path}"):
            return cls._of(arrays["points"], arrays["radius"], dropped)

    def __len__(self) -> int:
        return len(self.points)

    def __repr__(self) -> str:
        radius = f"{self.radius:g}" if np.ndim(self.radius) == 0 else f"{self.radii.min():g} … {self.radii.max():g}"
        return f"PointCloud(<{len(self.points)} points>, radius={radius})"

    @property
    def radii(self) -> np.ndarray:
        """(n,) radii of the balls [m], read-only."""
        return np.broadcast_to(self.radius, len(self.points))

    @property
    def tree(self) -> PointTree:
        """The tree over the points, made when first asked for."""
        return _tree_of(self)

    def nearest(self, p: ArrayLike, k: int = 1, *, max_distance: float = math.inf) -> NearestPoints:
        """The nearest points to places.

        Parameters
        ----------
        p : (3,) or (m, 3) array_like
            Places in the frame of the cloud [m].
        k : int
            How many points for each place.
        max_distance : float
            Points farther away do not count [m].

        Returns
        -------
        NearestPoints
            Arrays (m,), (m, k) for k > 1; for a single place scalars, or (k,). Of points as far away as each other
            those of least number come first.

        Raises
        ------
        InvalidArgument
            For places that are no finite coordinates, k below 1, a distance below 0.

        Notes
        -----
        O(log n) a place where points are spread evenly: 1.5 µs among 10⁵ points, 4.3 µs among 10⁶.
        """
        places, single = _checked_places("PointCloud.nearest", p)
        k = checks.integer("PointCloud.nearest: k", k, 1)
        if k * len(places) > _MAX_NEAREST:
            raise InvalidArgument(
                f"PointCloud.nearest: k must be at most {_MAX_NEAREST // len(places)} for {len(places)} places, "
                f"got {checks.brief(k)}"
            )
        limit = checks.limit("PointCloud.nearest: max_distance", max_distance)
        asked = self._all_sorted if min(k, len(self)) > _MAX_WALKED else self.tree.nearest
        squares, row = asked(places, min(k, len(self)), limit * limit)
        if k > len(self):
            beyond = (0, 0), (0, k - len(self))
            squares, row = np.pad(squares, beyond, constant_values=math.inf), np.pad(row, beyond, constant_values=-1)
        distance = np.sqrt(squares)
        if k == 1:
            distance, row = distance[:, 0], row[:, 0]
        return NearestPoints(distance[0], row[0]) if single else NearestPoints(distance, row)

    def _all_sorted(self, places: np.ndarray, k: int, largest: float) -> tuple[np.ndarray, np.ndarray]:
        """As `PointTree.nearest`, of a large part of all points: these are sorted."""
        squares, rows_of = np.empty((len(places), k)), np.empty((len(places), k), dtype=np.int64)
        for at, place in enumerate(places):
            away = self.points - place
            square = away[:, 0] * away[:, 0] + away[:, 1] * away[:, 1] + away[:, 2] * away[:, 2]
            order = np.argsort(square, kind="stable")[:k]
            squares[at], rows_of[at] = square[order], order
        beyond = squares > largest
        squares[beyond], rows_of[beyond] = math.inf, -1
        return squares, rows_of

    def within(self, p: ArrayLike, r: float) -> np.ndarray:
        """Rows of the points no farther from a place than a distance, ascending.

        Parameters
        ----------
        p : (3,) array_like
            A place in the frame of the cloud [m].
        r : float
            The distance, ≥ 0; balls are left out [m].

        Returns
        -------
        np.ndarray
            (k,) int64.

        Raises
        ------
        InvalidArgument
            For a place that is no finite coordinates, a distance below 0 or not finite.
        """
        places, single = _checked_places("PointCloud.within", p)
        r = checks.limit("PointCloud.within: r", r)
        if not single or not r < math.inf:
            raise InvalidArgument(
                f"PointCloud.within: p must be a single place (3,), and r finite, got {checks.brief(p)} and {r:g}"
            )
        some = self.tree.in_box(places[0] - r * (1.0 + 1e-15), places[0] + r * (1.0 + 1e-15))
        away = self.points[some] - places[0]
        return some[np.square(away).sum(axis=1) <= r * r]

    def cropped(self, box: ArrayLike) -> PointCloud:
        """The cloud of the points within a box, its faces included.

        Parameters
        ----------
        box : (2, 3) array_like
            The least and the largest corner, in the frame of the cloud [m]; infinite numbers leave a side open.

        Returns
        -------
        PointCloud
            Its ``dropped`` says how many points lie outside.

        Raises
        ------
        InvalidArgument
            For corners of another shape or order.
        InvalidShape
            Where no point lies within.
        """
        corners = checks.array("PointCloud.cropped: box", box, "(2, 3)", InvalidArgument)
        if corners.shape != (2, 3) or not (corners[0] <= corners[1]).all():
            raise InvalidArgument(
                f"PointCloud.cropped: box must be a least and a largest corner (2, 3), got {checks.brief(box)}"
            )
        keep = ((self.points >= corners[0]) & (self.points <= corners[1])).all(axis=1)
        return self._only(keep, f"cropped: box {checks.brief(box)}")

    def filtered(self, spacing: float) -> PointCloud:
        """A thinner cloud: of the points in a cell of a grid the first alone.

        Parameters
        ----------
        spacing : float
            Side of a cell, > 0 [m]: a point left out has a point within √3 · spacing.

        Returns
        -------
        PointCloud
            Its ``dropped`` says how many points were left out. Balls keep their radii: balls larger by √3 · spacing
            hold the whole cloud.

        Raises
        ------
        InvalidArgument
            For a spacing not above 0, or so small that cells cannot be numbered.
        """
        spacing = positive("PointCloud.filtered", "spacing", spacing)
        low = self.points.min(axis=0)
        cells = np.floor((self.points - low) / spacing)
        if not cells.max() < 1 << 20:
            raise InvalidArgument(
                f"PointCloud.filtered: a spacing of {spacing:g} m makes more than 2²⁰ cells along an axis; "
                "take a larger one"
            )
        x, y, z = cells.astype(np.int64).T
        _, first = np.unique((x << 40) | (y << 20) | z, return_index=True)
        keep = np.zeros(len(self.points), dtype=bool)
        keep[first] = True
        return self._only(keep, "filtered")

    def updated(self, *, added: ArrayLike | None = None, removed: ArrayLike | None = None) -> PointCloud:
        """The cloud with points more and points less: remaining points in their order, then new points.

        Parameters
        ----------
        added : (k, 3) array_like, optional
            Points of the cloud's radius; a `PointCloud` of points with radii of their own.
        removed : (k,) array_like of int or bool, optional
            Rows of ``points``, or a mask (n,).

        Returns
        -------
        PointCloud
            This cloud stays as it is, for readers in other threads, too. Where radii differ, balls have a radius each.

        Raises
        ------
        InvalidShape
            For points as in the constructor, and where no point is left.
        InvalidArgument
            For rows out of range.

        Notes
        -----
        O(n) of copying. Where this cloud has its ``tree``, the other gets a copy of the tree, changed: O(log n) a new
        point; for 300 points among 10⁵ a quarter of the time of a cloud made anew, among 10⁶ a fifth. The tree is made
        anew when a tenth of all points came or went since the last was, when more than 1/32 come at once, and for
        points far outside.
        """
        n = len(self.points)
        keep = np.ones(n, dtype=bool)
        if removed is not None:
            keep[_checked_rows(removed, n)] = False
        more, gone = _more_points(self, added), np.flatnonzero(~keep)
        if len(gone) == n and more is None:
            raise InvalidShape(f"PointCloud.updated: no point of {n} is left")
        new = np.empty((0, 3)) if more is None else more.points
        points, numbers = point_tree.remaining_points(self.points, gone, new)
        made = _checked_cloud(points, _radius_after(self, keep, more))
        if hasattr(self, "_tree"):
            made._store(_tree=self.tree.changed(points, gone, numbers))
        return made

    def _only(self, keep: np.ndarray, what: str) -> PointCloud:
        """The cloud of the points of a mask.   what : the method and its arguments, for messages."""
        if not keep.any():
            raise InvalidShape(f"PointCloud.{what}: no point of {len(keep)} is left")
        points, _ = point_tree.remaining_points(self.points, np.flatnonzero(~keep), np.empty((0, 3)))
        return _checked_cloud(points, _radius_after(self, keep), int(np.count_nonzero(~keep)))


def _checked_cloud(points: np.ndarray, radius: Any, dropped: int = 0) -> PointCloud:
    """A cloud of points and radii from clouds, which no constructor need check."""
    made = object.__new__(PointCloud)
    made._store(points=points, radius=radius, dropped=dropped)
    return made


def _radius_after(cloud: PointCloud, keep: np.ndarray, more: PointCloud | None = None) -> Any:
    """The radius, or the radii (n,), of balls kept by a mask and of more balls behind."""
    radius = cloud.radius
    if np.ndim(radius) == 0 and (more is None or (np.ndim(more.radius) == 0 and more.radius == radius)):
        return radius
    radii = np.concatenate([cloud.radii[keep], [] if more is None else more.radii])
    radii.setflags(write=False)
    return radii


@kept_with_shape("_tree")
def _tree_of(cloud: PointCloud) -> PointTree:
    return point_tree.PointTree(cloud.points)


@contextmanager
def _refused_from(source: str) -> Iterator[None]:
    """An error of the class says where its numbers come from."""
    try:
        yield
    except InvalidShape as error:
        raise InvalidShape(f"{source}: {error}") from None


def _of_records(points: Any) -> Any:
    """Points (n, 3) of an array of records with fields x, y and z; anything else as it is."""
    if not {"x", "y", "z"} <= {*(getattr(getattr(points, "dtype", None), "names", None) or ())}:
        return points
    columns = [checks.array(f"PointCloud: points[{axis!r}]", points[axis], "(…,)", InvalidShape) for axis in "xyz"]
    return np.stack([column.ravel() for column in columns], axis=1)


def _checked_radius(radius) -> Any:
    """A radius [m], or an array of them, read-only."""
    if checks.number(radius) is not None:
        return positive("PointCloud", "radius", radius, zero=True)
    values = rows("PointCloud", "radius", radius, (None,))
    wrong = ~((values == 0.0) | (values >= SMALLEST))
    if wrong.any():
        k = int(np.flatnonzero(wrong)[0])
        least = "≥ 0" if values[k] < 0.0 else f"0, or at least {SMALLEST:g} m"
        raise InvalidShape(f"PointCloud: radius[{k}] must be {least}, got {values[k]:g}")
    return values


def _checked_points(points) -> np.ndarray:
    array = checks.array("PointCloud: points", points, "(N, 3)", InvalidShape)
    if not array.size:
        raise InvalidShape(f"PointCloud: points is empty, {array.shape}; of a scan without echoes make no body")
    try:
        return rows("PointCloud", "points", array, (None, 3))
    except InvalidShape as error:
        if np.isfinite(array).all():
            raise
        raise InvalidShape(f"{error}; drop_invalid=True leaves out points that are not finite") from None


def _only_finite(points, radius) -> tuple[Any, Any, int]:
    """(finite points, their radii, how many were left out)."""
    array = checks.array("PointCloud: points", points, "(N, 3)", InvalidShape)
    if array.ndim != 2 or array.shape[1] != 3:
        return points, radius, 0  # refused by its shape
    finite = np.isfinite(array).all(axis=1)
    if finite.all():
        return array, radius, 0
    if not finite.any():
        raise InvalidShape(f"PointCloud: none of {len(array)} points is finite; of a scan without echoes make no body")
    if np.ndim(radius) and len(radius) == len(array):
        radius = rows("PointCloud", "radius", radius[finite], (None,))
    return array[finite], radius, int(np.count_nonzero(~finite))


def _checked_places(name: str, p) -> tuple[np.ndarray, bool]:
    """((m, 3) places, whether a single one was given)."""
    array = checks.array(f"{name}: p", p, "(3,) or (m, 3)", InvalidArgument)
    if array.ndim not in (1, 2) or array.shape[-1] != 3 or not np.abs(array).max(initial=0.0) <= LARGEST:
        raise InvalidArgument(
            f"{name}: p must be (3,) or (m, 3), finite and within ±{LARGEST:g} m, got {checks.brief(p)}"
        )
    return np.ascontiguousarray(array.reshape(-1, 3), dtype=np.float64), array.ndim == 1


def _checked_rows(removed, n: int) -> np.ndarray:
    array = checks.plain_array("PointCloud.updated: removed", removed, "(k,) of int, or a mask", InvalidArgument)
    if array.dtype == bool and array.shape == (n,):
        return array
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iu"):
        raise InvalidArgument(
            f"PointCloud.updated: removed must be rows (k,) of int, or a mask ({n},), got {checks.brief(removed)}"
        )
    array = array.astype(np.int64)
    if ((array < 0) | (array >= n)).any():
        raise InvalidArgument(
            f"PointCloud.updated: removed: rows must lie within 0 … {n - 1}, got {checks.brief(removed)}"
        )
    return array


def _more_points(cloud: PointCloud, added) -> PointCloud | None:
    if added is None or isinstance(added, PointCloud):
        return added
    if np.ndim(cloud.radius):
        raise InvalidArgument(
            f"PointCloud.updated: points have a radius each: added must be a PointCloud, got {checks.brief(added)}"
        )
    return _checked_cloud(rows("PointCloud.updated", "added", added, (None, 3)), cloud.radius)
