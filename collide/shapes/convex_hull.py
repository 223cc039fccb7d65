"""ConvexHull: the hull of any points, swept by a ball."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from collide.base.foreign_arguments import foreign_arguments
from collide.base.lazy_modules import lazy_module
from collide.base.log import log_duration
from collide.errors import InvalidShape, brief
from collide.shapes.shape import Shape, equal_but_for_signs, facet_ids, mirrors, positive, rows
from collide.shapes.shape_files import Field, read_arrays, write_arrays
from collide.transforms import SMALLEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide.hull import exact_hull, validate_hull
    from collide.hull.exact_hull import Hull

if not TYPE_CHECKING:
    exact_hull = lazy_module("collide.hull.exact_hull")
    validate_hull = lazy_module("collide.hull.validate_hull")


class ConvexHull(Shape):
    """Exactly the convex hull of the points given, swept by a ball.

    Parameters
    ----------
    points : (n, 3) array_like, float64
        In any order, in the frame of the shape [m]: a solid, a flat or a straight set, a single point. Points that are
        doubled, collinear, coplanar or inside change nothing.
    faces : (m, 3) array_like of int, optional
        Rows of ``points``. The set does not depend on them: they are checked for shape and range here, and by
        `validate` for being the surface of the hull.
    radius : float
        Of the ball swept over the hull [m], ≥ 0.

    Raises
    ------
    InvalidShape
        Where points are missing, not finite or out of range, faces name rows beyond ``points``, or the radius is
        negative.

    Notes
    -----
    Ids in results are rows of ``points`` as given. From 224 points on, a support tree finds the extreme vertex in
    O(log n). The tree is built when a query first needs it (4 to 6 µs a point) and kept with the
    shape. Files and pickles hold the points alone: proofs rest on the tree, so a tree is built from the points and
    never believed.
    """

    __slots__ = ("_hull", "faces", "points", "radius")
    _fields = ("points", "faces", "radius")
    points: np.ndarray
    faces: np.ndarray | None
    radius: float
    _hull: Hull

    @foreign_arguments
    def __init__(self, points: ArrayLike, *, faces: ArrayLike | None = None, radius: float = 0.0):
        if hasattr(points, "vertices"):
            advice = "the hull of a mesh is ConvexHull(mesh.vertices)"
            raise InvalidShape(f"ConvexHull: points must be (N, 3), got {brief(points)}; {advice}")
        points = rows("ConvexHull", "points", points, (None, 3))
        largest = float(np.abs(points).max())
        if 0.0 < largest < SMALLEST:
            raise InvalidShape(
                f"ConvexHull: points: the largest coordinate is {largest!r}; it must be 0 or at least {SMALLEST:g}: "
                "scale the scene"
            )
        self._store(
            points=points,
            faces=None if faces is None else facet_ids("ConvexHull", faces, len(points), np.int64, "{n} points"),
            radius=positive("ConvexHull", "radius", radius, zero=True),
        )

    @classmethod
    def _from_fields(cls, points, faces, radius) -> ConvexHull:
        return cls(points, faces=faces, radius=radius)

    @property
    def hull(self) -> Hull:
        """The surface, exactly, computed when first needed in O(n log n).

        ``dimension`` (3 solid, 2 flat, 1 straight, 0 a point), ``vertices`` and ``facets`` by rows of ``points``,
        facets counter-clockwise seen from outside.
        """
        if not hasattr(self, "_hull"):
            with log_duration("convex hull of %d points made", len(self.points)):
                hull = exact_hull.convex_hull(self.points)
            for array in (hull.vertices, hull.facets):
                array.flags.writeable = False
            object.__setattr__(self, "_hull", hull)
        return self._hull

    def validate(self) -> None:
        """Check exactly that `hull`, and the faces given, are the surface of the hull of all points.

        For tests, and for data of doubtful origin.

        Raises
        ------
        InvalidShape
            With the defect and its place.
        """
        given_surface = self.hull._replace(facets=self.faces) if self.faces is not None else None
        for what, surface in (("hull", self.hull), ("faces", given_surface)):
            if surface is None:
                continue
            if what == "faces":
                facets = surface.facets.astype(np.int32)
                surface = surface._replace(facets=facets, vertices=np.unique(facets))
            try:
                validate_hull.validate_hull(self.points, surface)
            except AssertionError as error:
                raise InvalidShape(f"ConvexHull: {what}: {error}") from None

    def save(self, path) -> None:
        """Write points, faces and radius to an ``.npz`` file.

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
        arrays = {"points": self.points, "radius": np.array(self.radius)}
        if self.faces is not None:
            arrays["faces"] = self.faces
        write_arrays("ConvexHull", path, _FILE_FORMAT, arrays)

    @classmethod
    def load(cls, path) -> ConvexHull:
        """A hull from a file written by `save`.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        ConvexHull
            Equal to the saved hull.

        Raises
        ------
        InvalidShape
            Where the file is of another kind, or damaged.
        """
        arrays = read_arrays("ConvexHull", path, _FILE_FORMAT, _FILE_FIELDS, "tree_")
        try:
            return cls(arrays["points"], faces=arrays.get("faces"), radius=float(arrays["radius"]))
        except InvalidShape as error:
            raise InvalidShape(f"ConvexHull.load: {path}: {error}") from None

    def _scaled(self, s: np.ndarray) -> ConvexHull:
        factor = equal_but_for_signs(s, "the ball swept over it would be no ball") if self.radius else 0.0
        faces = self.faces if self.faces is None or not mirrors(s) else self.faces[:, ::-1]
        return ConvexHull(self.points * s, faces=faces, radius=self.radius * factor)

    def without_repeats(self) -> ConvexHull:
        """The same set with every point once, in the order of first appearance.

        Files repeat vertices (an STL names each about six times), and a support query of a small hull is a scan.

        Returns
        -------
        ConvexHull
            Without faces, which would name the old ids; this hull itself where no point repeats.
        """
        distinct, first = np.unique(self.points + 0.0, axis=0, return_index=True)
        if len(distinct) == len(self.points):
            return self
        return ConvexHull(self.points[np.sort(first)], radius=self.radius)


#: Changes whenever files written before would be read wrongly.
_FILE_FORMAT = 1
_FILE_FIELDS = {
    "points": Field("f8", (None, 3)),
    "faces": Field("i8", (None, 3), needed=False),
    "radius": Field("f8", ()),
}
