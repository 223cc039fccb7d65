"""Mesh: triangles as they are, a solid where they close and a surface where they do not."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_arguments, foreign_names
from collide.base.lazy_modules import lazy_module
from collide.base.log import log_duration
from collide.errors import InvalidShape
from collide.shapes import mesh_formats
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh_report import MeshReport, make_report
from collide.shapes.shape import Shape, facet_ids, mirrors, positive, rows
from collide.shapes.shape_files import Field, read_arrays, refused_as_shape, shape_suffix, write_arrays
from collide.transforms import SMALLEST

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from collide import RepairedMesh
    from collide.hull import exact_hull
    from collide.mesh import build_bvh, fine_boxes, mesh_survey, scaled_bvh, solid_measures
    from collide.mesh import locality as local_stretch
    from collide.mesh.bvh import MeshTree
    from collide.mesh.locality import Locality
    from collide.mesh.mesh_survey import Survey
    from collide.shapes import localised_facets

    class HasFacets(Protocol):
        """What carries a mesh: trimesh.Trimesh, among others."""

        @property
        def vertices(self) -> Any: ...
        @property
        def faces(self) -> Any: ...

if not TYPE_CHECKING:
    exact_hull = lazy_module("collide.hull.exact_hull")
    build_bvh = lazy_module("collide.mesh.build_bvh")
    fine_boxes = lazy_module("collide.mesh.fine_boxes")
    local_stretch = lazy_module("collide.mesh.locality")
    localised_facets = lazy_module("collide.shapes.localised_facets")
    mesh_survey = lazy_module("collide.mesh.mesh_survey")
    scaled_bvh = lazy_module("collide.mesh.scaled_bvh")
    solid_measures = lazy_module("collide.mesh.solid_measures")


class Mesh(Shape):
    """Triangles: a solid, or a surface.

    Parameters
    ----------
    vertices : (n, 3) array_like, float64, or an object with ``vertices`` and ``faces``
        [m], in the frame of the shape. Equal vertices are welded, so the loose triangles of an STL close; some may be
        unused. With no ``faces``, an object such as a trimesh.Trimesh.
    faces : (m, 3) array_like of int
        Rows of ``vertices``, counter-clockwise seen from outside.
    solid : bool, optional
        ``None`` takes a mesh that closes as a solid and any other as a surface: ``mesh.solid`` says which,
        ``mesh.report`` why. True insists: a mesh without an inside is refused, with its defects and facet numbers.
        False takes the surface alone.

    Raises
    ------
    InvalidShape
        For anything but finite vertices and at least one row of ids in range; with ``solid=True`` also where the mesh
        has no inside.

    Notes
    -----
    A **solid** is its facets and all points around which they wind once or more: parts may overlap, and a part of
    opposite orientation within another is a cavity. A **surface** is its facets. Facets of a solid need not be
    manifold: every edge must be run along as often forwards as backwards. Whether the facets of a solid cross each
    other is not checked here (`collide.self_collisions`).

    Ids in results are rows of ``faces``, as given. Surveying a mesh takes about 0.3 µs a facet; its box-tree (`tree`)
    is built when a query first needs it (about 0.6 µs a facet) and kept. Files and pickles hold vertices, faces and the
    choice of ``solid``; what proofs rest on is computed anew from them.
    """

    __slots__ = ("_copied", "_hull", "_survey", "_tree", "faces", "scale", "solid", "vertices")
    _fields = ("vertices", "faces", "solid")
    convex = False
    meshed = True
    vertices: np.ndarray
    faces: np.ndarray
    solid: bool
    #: What this is a scaled copy of, None where it is none, and the factor.
    _copied: Mesh | None
    scale: float
    _survey: Survey
    _tree: MeshTree
    _hull: ConvexHull

    @foreign_arguments
    def __init__(self, vertices: ArrayLike | HasFacets, faces: ArrayLike | None = None, *, solid: bool | None = None):
        if faces is None:
            vertices, faces = _vertices_and_faces(vertices)
        vertices = _check_vertices(vertices)
        faces = _check_faces(faces, len(vertices))
        if solid is not None and not isinstance(solid, (bool, np.bool_)):
            raise InvalidShape(f"Mesh: solid must be True, False or None, got {checks.brief(solid)}")
        self._store(vertices=vertices, faces=faces, scale=1.0, solid=False, _copied=None)
        if solid is not None and not solid:
            return
        spoilt = _what_spoils(len(vertices), self.survey)
        if solid and spoilt:
            raise InvalidShape(spoilt)
        self._store(solid=not spoilt)

    @classmethod
    def _from_fields(cls, vertices, faces, solid, scale) -> Mesh:
        """The mesh of a pickle or a file: a mesh stored as a solid must be a solid."""
        return cls(vertices, faces, solid=bool(solid)).scaled(scale)

    @classmethod
    def _known(cls, vertices, faces, solid: bool) -> Mesh:
        """A mesh whose ``solid`` a cache knows: surveyed again when a query first needs the survey."""
        made = cls(vertices, faces, solid=False)
        made._store(solid=bool(solid))
        return made

    def __reduce__(self):
        rebuild, _ = super().__reduce__()
        return rebuild, (type(self), (self.base.vertices, self.base.faces, self.solid, self.scale))

    @property
    def tree(self) -> MeshTree:
        """The box-tree that queries walk: made when first asked for. A scaled copy's is its base's, boxes scaled."""
        if not hasattr(self, "_tree"):
            with log_duration("box-tree of a mesh of %d facets made", len(self.faces)):
                if self._copied is None:
                    tree = build_bvh.build_mesh_tree(self.vertices, self.faces)
                    self._store(_tree=fine_boxes.with_origins_if_needed(tree))
                else:
                    self._store(_tree=scaled_bvh.scaled_tree(self._copied.tree, self.vertices, self.faces, self.scale))
        return self._tree

    @property
    def convex_hull(self) -> ConvexHull:
        """The convex hull of the facets: made when first asked for, and kept. Of large meshes only its corners."""
        if not hasattr(self, "_hull"):
            used = corners_of_facets(self)
            with log_duration("convex hull around a mesh of %d facets made", len(self.faces)):
                if len(used) > _MAX_HULL_POINTS:
                    used = used[exact_hull.convex_hull(used).vertices]
                self._store(_hull=ConvexHull(used))
        return self._hull

    @property
    def base(self) -> Mesh:
        """The original of a scaled copy, whose search tree the copy shares; the mesh itself where not a copy."""
        return self if self._copied is None else self._copied

    @property
    def survey(self) -> Survey:
        """Which facets meet where, welded corners, shells and their volumes: of `base`, for all its scaled copies."""
        if self._copied is not None:
            return self._copied.survey
        if not hasattr(self, "_survey"):
            with log_duration("surface of a mesh of %d facets looked at", len(self.faces)):
                survey = mesh_survey.survey_surface(self.vertices, self.faces)
            spoilt = self.solid and _what_spoils(len(self.vertices), survey)
            if spoilt:
                raise InvalidShape(spoilt)
            for array in (survey.corners, survey.flags, survey.shells, survey.volumes, survey.signs):
                array.flags.writeable = False
            self._store(_survey=survey)
        return self._survey

    @property
    def report(self) -> MeshReport:
        """Solid or surface, why, and every defect with its facets; ``print(mesh.report)``."""
        report = make_report(len(self.vertices), self.solid, self.survey)
        return report._replace(volume=report.volume * self.scale**3)

    @property
    def volume(self) -> float:
        """What a solid's facets enclose [m³], exact and rounded once; points wound around twice count twice.

        `combine([mesh], [pose], "union")` makes a solid without parts that overlap.

        Raises
        ------
        InvalidShape
            Of a surface, with its defects.
        """
        return solid_measures.volume(self.vertices, self._closed("volume"))

    @property
    def area(self) -> float:
        """The sum of the areas of all facets [m²], exact and rounded once."""
        return solid_measures.area(self.vertices, self.faces)

    @property
    def centroid(self) -> np.ndarray:
        """(3,) the mean of the points a solid encloses, in its frame [m], each coordinate exact and rounded once.

        Raises
        ------
        InvalidShape
            Of a surface, with its defects.
        """
        return solid_measures.centroid(solid_measures.moments(self.vertices, self._closed("centroid")))

    def inertia(self, density: float) -> np.ndarray:
        """(3, 3) inertia of a solid of even density about its centroid, along the axes of its frame [kg m²].

        Parameters
        ----------
        density : float
            [kg/m³], > 0.

        Returns
        -------
        (3, 3) float64
            Every entry exact and rounded once. O(n), some 10 µs a facet.

        Raises
        ------
        InvalidShape
            Of a surface, with its defects; for a density other than a positive number.
        """
        density = positive("Mesh.inertia", "density", density)
        return solid_measures.inertia(solid_measures.moments(self.vertices, self._closed("inertia")), density)

    def _closed(self, name: str) -> np.ndarray:
        """(f, 3) corners of a solid."""
        if not self.solid:
            why = "; ".join(str(defect) for defect in self.report.defects if defect.spoils)
            raise InvalidShape(f"Mesh.{name}: a surface encloses nothing: {why or 'it was made with solid=False'}")
        return self.faces

    def scaled(self, factors: float | ArrayLike) -> Mesh:
        """The mesh with every coordinate times a factor, rounded once; equal factors > 0 share the search tree.

        The ``base`` of a copy by equal factors > 0 is the mesh copied, and ``scale`` the factor; factors of copies of
        copies are multiplied first. Facets keep their numbers, and are turned over where factors mirror: a solid stays
        a solid.

        Parameters
        ----------
        factors : float or (3,) array_like
            Along x, y, z, or a single number for all axes, not 0, without a unit. Negative factors mirror.

        Returns
        -------
        Mesh
            The scaled copy; ``base`` itself where the product of equal factors is 1.

        Raises
        ------
        InvalidShape
            Where a factor is 0 or not finite, or coordinates leave the supported range.
        """
        return super().scaled(factors)

    def _scaled(self, s: np.ndarray) -> Mesh:
        x, y, z = s.tolist()
        if not x == y == z or x < 0.0:
            faces = self.faces[:, ::-1] if mirrors(s) else self.faces
            return Mesh(self.vertices * s, faces, solid=self.solid)
        factor = positive("Mesh", "factor", x) * self.scale
        if factor == 1.0:
            return self.base
        vertices = _check_vertices(self.base.vertices * factor)
        made = Mesh.__new__(Mesh)
        made._store(vertices=vertices, faces=self.faces, solid=self.solid, scale=factor, _copied=self.base)
        return made

    def locality(self, *, repeated: bool = False, progress=None) -> Locality:
        """How local the mesh is: Erickson's global stretch Σ and local stretches σ_1 … σ_10, with their distributions.

        Parameters
        ----------
        repeated : bool
            Count vertices with equal coordinates one by one, as Table 1 of the paper does.
        progress : callable, optional
            Called with a label, gives a context manager; for long work.

        Returns
        -------
        Locality
            See `collide.mesh.locality`. Scaling changes nothing but rounding.

        Notes
        -----
        O(n log n), a second for 437,645 vertices. J. Erickson, "Local polyhedra and geometric graphs", Computational
        Geometry 31 (2005), sections 2.1 and 8.
        """
        options = {} if progress is None else {"progress": progress}
        repeated = checks.true_or_false("Mesh.locality: repeated", repeated)
        return local_stretch.locality(self.vertices, self.faces, repeated=repeated, **options)

    def localised(
        self, stretch: float = 10.0, order: int = 1, *, max_facets: int = 200_000, progress=None
    ) -> LocalisedMesh:
        """The same solid or surface with facets cut until the mesh is local: no σ_order exceeds ``stretch``.

        Parameters
        ----------
        stretch : float
            ≥ 3.2, what the local stretch of the order may be at most.
        order : int
            1 … 10: which σ_k is bounded. From 2 on some vertices may nearly coincide, and fewer cuts are needed.
        max_facets : int
            More are not made. The number needed is estimated before the first cut.
        progress : callable, optional
            Called with a label, gives a context manager; for long work.

        Returns
        -------
        LocalisedMesh
            The mesh, for every facet the old facet around it, how far rounding moved the farthest new vertex, and
            the locality before and after. An edge is cut for all its facets: what closes still closes, and
            what is solid is solid. Facets with two equal corners are left out.

        Raises
        ------
        InvalidArgument
            For arguments out of range; where more than ``max_facets`` would be needed, with the number; where edges
            crowd and vertices come ever nearer to each other, with facet and vertex.
        InvalidShape
            Where no facet has three distinct corners.

        Notes
        -----
        O(log n) facets for a box n × n × 1, n² for a cylinder of n sides. Each round takes O(k log k) for k facets.
        J. Erickson, "Local polyhedra and geometric graphs", Computational Geometry 31 (2005), section 8 and figure 12.
        docs/locality.md says where it pays.
        """
        stretch, order, max_facets = localised_facets.checked(stretch, order, max_facets)
        progress = progress or local_stretch.quiet
        plain = self if type(self) is Mesh else Mesh(self.vertices, self.faces, solid=self.solid)
        before = plain.locality(progress=progress)
        points, faces, source, moved = localised_facets.localised_facets(
            plain.vertices, plain.survey, before, stretch, order, max_facets, progress
        )
        made = Mesh(points, faces, solid=plain.solid)
        return LocalisedMesh(made, source, moved, before, made.locality(progress=progress))

    def repaired(
        self, *, weld: float | None = None, widest_hole: float | None = None, crossings: bool = True, progress=None,
        time_limit: float | None = None, memory: int | None = None,
    ) -> RepairedMesh:
        """The mesh as a solid without crossing facets, as far as that is safe, and a report: `collide.repaired`.

        Parameters
        ----------
        weld : float, optional
            Vertices at open edges are joined within this distance [m]; by default 1e-6 of the box's diagonal.
        widest_hole : float, optional
            The widest hole to close [m], the diagonal of a square hole; by default a tenth of the box's diagonal.
        crossings : bool
            Resolve facets that cross, by winding numbers.
        progress, time_limit, memory
            As of `collide.boolean`.

        Returns
        -------
        RepairedMesh
            The new mesh, its source facets, and every step: ``print(mesh.repaired().report)``.

        Raises
        ------
        InvalidArgument
            For arguments out of range.
        UnsupportedQuery
            Where a limit was reached.
        """
        from collide import repaired  # its arrangement is of a room that needs shapes

        return repaired(
            self, weld=weld, widest_hole=widest_hole, crossings=crossings, progress=progress, time_limit=time_limit,
            memory=memory,
        )

    def save(self, path) -> None:
        """Write the mesh to a file: whole as ``.npz``, or its triangles in a form for other programs.

        Parameters
        ----------
        path : str or Path
            The file. ``.npz``, or no suffix: vertices, faces, ``solid`` and ``scale``, which `load` reads. ``.stl``,
            ``.ply``, ``.obj``, ``.off``, ``.3mf`` and ``.glb``: the triangles, for ``collide.scenes.load`` too, in
            metres. All but GLB hold the same doubles; STL is binary where its numbers of 32 bits are the coordinates,
            else text. GLB rounds to 32 bits, relative to the box's middle, and a warning of the logger "collide" says
            how far. An existing file is replaced, by all of the new file or not at all.

        Raises
        ------
        InvalidShape
            Where the suffix is another, and where the file cannot be written.
        """
        if not save_triangles("Mesh", path, self.vertices, self.faces):
            arrays = {name: np.asarray(getattr(self.base, name)) for name in ("vertices", "faces")}
            arrays.update(solid=np.array(self.solid), scale=np.array(self.scale))
            write_arrays("Mesh", path, _FILE_FORMAT, arrays)

    @classmethod
    def load(cls, path) -> Mesh:
        """A mesh from a file written by `save`.

        Parameters
        ----------
        path : str or Path
            The file.

        Returns
        -------
        Mesh
            Equal to the saved mesh.

        Raises
        ------
        InvalidShape
            Where the file is of another kind, or damaged, or says solid of a mesh without an inside.
        """
        arrays = read_arrays("Mesh", path, _FILE_FORMAT, _FILE_FIELDS, "mesh_")
        try:
            return cls._from_fields(arrays["vertices"], arrays["faces"], arrays["solid"], float(arrays["scale"]))
        except InvalidShape as error:
            raise InvalidShape(f"Mesh.load: {path}: {error}") from None


#: Hulls of so many vertices are asked as they are: leaving out those inside takes a kernel of its own.
_MAX_HULL_POINTS = 512

#: Changes whenever files written before would be read wrongly.
_FILE_FORMAT = 1
_FILE_FIELDS = {
    "vertices": Field("f8", (None, 3)), "faces": Field("i4", (None, 3)), "solid": Field("b1", ()),
    "scale": Field("f8", ()),
}


def save_triangles(who: str, path, vertices: np.ndarray, faces: np.ndarray, body: np.ndarray | None = None) -> bool:
    """Write triangles as the suffix says; False, and nothing written, for the suffix of arrays.

    who : the calling class, for messages.   body : (m,) of every facet, for colours, or ``None``.
    """
    suffix = shape_suffix(who, path, *mesh_formats.SUFFIXES)
    if suffix not in mesh_formats.SUFFIXES:
        return False
    with refused_as_shape(f"{who}.save", path):
        mesh_formats.write_triangles(path, vertices, faces, suffix, body)
    return True


def corners_of_facets(mesh: Mesh) -> np.ndarray:
    """(k, 3) the vertices of a mesh that facets have, in their order. O(vertices + facets)."""
    is_used = np.zeros(len(mesh.vertices), dtype=bool)
    is_used[mesh.faces] = True
    return mesh.vertices[is_used]


def _what_spoils(vertices: int, survey: Survey) -> str:
    """Why a mesh of so many vertices is no solid, in words; empty for a solid."""
    report = make_report(vertices, True, survey)
    spoilt = [str(defect) for defect in report.defects if defect.spoils] or (
        [] if survey.edges else ["no facet has three distinct corners"]
    )
    if not spoilt:
        return ""
    remedy = "Repair the mesh, or leave out solid=True and it is taken as a surface"
    return f"Mesh: no inside can be told: {'; '.join(spoilt)}. {remedy}"


def _vertices_and_faces(mesh) -> tuple[ArrayLike, ArrayLike]:
    """Vertices and faces of an object, for example of a trimesh.Trimesh."""
    try:
        return mesh.vertices, mesh.faces
    except AttributeError:
        raise InvalidShape(
            f"Mesh: give vertices (n, 3) and faces (m, 3), or an object that has both, got {checks.brief(mesh)} and "
            f"faces None{foreign_names.advice_on_shape(mesh)}"
        ) from None


def _check_vertices(vertices) -> np.ndarray:
    vertices = rows("Mesh", "vertices", vertices, (None, 3))
    largest = float(np.abs(vertices).max())
    if 0.0 < largest < SMALLEST:
        raise InvalidShape(
            f"Mesh: vertices: the largest coordinate is {largest!r}; it must be 0 or at least {SMALLEST:g}: scale the "
            "scene"
        )
    return vertices


def _check_faces(faces, n: int) -> np.ndarray:
    """(m, 3) int32 ids, read-only, m ≥ 1."""
    array = checks.plain_array("Mesh: faces", faces, "(m, 3)", InvalidShape)
    if array.size == 0:
        raise InvalidShape(f"Mesh: no facets: faces has shape {array.shape}; at least one row of three ids is needed")
    return facet_ids("Mesh", array, n, np.int32, "vertices 0 … {last}")


class LocalisedMesh(NamedTuple):
    """What `Mesh.localised` returns.

    mesh : the same solid or surface, a `Mesh`. Its first vertices are the vertices of the old mesh, row by row.
    source_facets : (k,) int64, for every facet of ``mesh`` the row of the old facet around it.
    moved : upper bound of the distances of new vertices from their exact points in old facets (on an old edge: in the
        edge), by rounding to doubles [the unit of the mesh]; 0 where all of them are exact.
    before, after : `Locality` of both.
    """

    mesh: Mesh
    source_facets: np.ndarray
    moved: float
    before: Locality
    after: Locality
