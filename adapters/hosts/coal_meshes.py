"""coal's `Convex`, a solid, and its BVH models, surfaces without an inside."""

from __future__ import annotations

import warnings

import numpy as np

import collide as engine
from collide.adapters.hosts import coal_inertia
from collide.adapters.hosts.coal_containers import StdVec_Vec3s, Triangle, triangle_rows
from collide.adapters.hosts.coal_enums import NODE_TYPE, OBJECT_TYPE, BVHBuildState, BVHModelType
from collide.adapters.hosts.coal_geometry import CollisionGeometry, ShapeBase
from collide.adapters.hosts.host_numbers import row, rows_of_three, shaped
from collide.errors import InvalidArgument
from collide.shapes.shape import Shape

#: What coal's models return where calls come in a wrong order, and where all is well.
_OUT_OF_SEQUENCE, _OK = -2, 0


class ConvexBase(ShapeBase):
    """The convex hull of points, a solid; made by `convexHull` or `Convex`."""

    _node_type = NODE_TYPE.GEOM_CONVEX

    def _hull_of(self, points: np.ndarray, facets: np.ndarray) -> None:
        self._points, self._facets = points, facets
        self._become([points.min(axis=0), points.max(axis=0)], engine.ConvexHull(points))

    @staticmethod
    def convexHull(points, keepTriangles, qhullCommand=None):
        """The hull of points: a `Convex` with the triangles of its surface, else a `ConvexBase`.

        points : `StdVec_Vec3s`, or (n, 3) [m].   qhullCommand has no effect: the hull is exact.
        """
        corners = rows_of("points", points)
        hull = engine.ConvexHull(corners).hull
        facets = np.searchsorted(hull.vertices, hull.facets).astype(np.int64).reshape(-1, 3)
        made = object.__new__(Convex if keepTriangles else ConvexBase)
        made._hull_of(corners[hull.vertices], facets)
        return made

    @property
    def center(self):
        """Mean (3,) of the points."""
        return self._points.mean(axis=0)

    @property
    def num_points(self):
        """How many points there are."""
        return len(self._points)

    def points(self, index=None):
        """All points, a copy (n, 3); one of them (3,) by its index."""
        return self._points.copy() if index is None else self._points[row("index", index, len(self._points))].copy()

    def point(self, index):
        """One of the points, a copy (3,)."""
        return self._points[row("index", index, len(self._points))].copy()

    def neighbors(self, i):
        """Rows of the points that share an edge with point i, a list."""
        i = row("i", i, len(self._points))
        around = self._facets[(self._facets == i).any(axis=1)]
        return sorted(set(around.ravel().tolist()) - {i})

    def normals(self):
        """Unit normals (m, 3) of the triangles."""
        a, b, c = (self._points[self._facets[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        outward = np.einsum("ni,ni->n", normals, a - self.center) < 0.0
        normals[outward] *= -1.0
        return normals / np.linalg.norm(normals, axis=1)[:, None]

    def normal(self, index):
        """That of triangle ``index`` (3,)."""
        return self.normals()[row("index", index, len(self._facets))]

    def offsets(self):
        """Offsets (m,) of the triangles' planes, {x : n·x + offset ≤ 0} [m]."""
        return -np.einsum("ni,ni->n", self.normals(), self._points[self._facets[:, 0]])

    def offset(self, index):
        """That of triangle ``index`` [m]."""
        return float(self.offsets()[row("index", index, len(self._facets))])

    @property
    def num_normals_and_offsets(self):
        """How many triangles there are."""
        return len(self._facets)

    def _mass(self):
        a, b, c = (self._points[self._facets[:, k]] for k in range(3))
        inward = np.einsum("ni,ni->n", np.cross(b - a, c - a), a - self.center) < 0.0
        facets = np.where(inward[:, None], self._facets[:, ::-1], self._facets)
        return coal_inertia.polyhedron(self._points, facets)


class Convex(ConvexBase):
    """The convex hull of points. ``Convex(points, triangles)`` with `StdVec_Vec3s` and `StdVec_Triangle` or arrays.

    The triangles are what `polygons` and `neighbors` return; the set is the hull of the points, whatever they say.
    """

    def __init__(self, *args):
        if len(args) == 1 and isinstance(args[0], ConvexBase):
            args = (args[0]._points, args[0]._facets)
        if len(args) != 2:
            raise TypeError("Convex(points, triangles), or Convex.convexHull(points, True)")
        points, facets = rows_of("points", args[0]), triangle_rows(args[1])
        check_rows("Convex: triangles", facets, len(points))
        self._hull_of(points, facets)

    @property
    def num_polygons(self):
        """How many triangles there are."""
        return len(self._facets)

    def polygons(self, index):
        """`Triangle` of that number."""
        return Triangle(*self._facets[row("index", index, len(self._facets))])


class BVHModelBase(CollisionGeometry):
    """Triangles, a surface: nothing is inside of it. `Convex` is the solid.

    ``beginModel``, then vertices and triangles, then ``endModel``; ``beginReplaceModel`` … ``endReplaceModel`` move
    vertices of a finished model. Each returns 0, and −2 with a warning where it comes in a wrong order.
    """

    _object_type, _has_parts = OBJECT_TYPE.OT_BVH, True

    def __init__(self, model=None):
        if type(self) is BVHModelBase:
            super().__init__()
        self._empty()
        if model is not None:
            self.__dict__.update(model.__copy__().__dict__)

    def _empty(self) -> None:
        self.build_state = BVHBuildState.BVH_BUILD_STATE_EMPTY
        self._vertices, self._triangles = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
        self._parts: list[tuple[Shape, np.ndarray | None]] = []
        self._convex: ConvexBase | None = None
        self._n_replaced = 0
        self._corners, self._shapes = None, ()

    def beginModel(self, num_tris=0, num_vertices=0):
        """Start anew; the numbers are hints."""
        if self.build_state != BVHBuildState.BVH_BUILD_STATE_EMPTY:
            warnings.warn("beginModel: the triangles there were are dropped", stacklevel=2)
        self._empty()
        self.build_state = BVHBuildState.BVH_BUILD_STATE_BEGUN
        return _OK

    def addVertices(self, vertices):
        """vertices : (n, 3) [m]."""
        return self._add("addVertices", rows_of("vertices", vertices), np.zeros((0, 3), dtype=np.int64))

    def addVertex(self, p):
        """p : (3,) [m]."""
        return self._add("addVertex", shaped("p", p, (3,))[None], np.zeros((0, 3), dtype=np.int64))

    def addTriangles(self, triangles):
        """triangles : (m, 3) rows of all vertices, also of those that follow."""
        return self._add("addTriangles", np.zeros((0, 3)), triangle_rows(triangles))

    def addTriangle(self, p1, p2, p3):
        """Corners (3,) of one triangle [m]."""
        corners = np.array([shaped(name, p, (3,)) for name, p in zip(("p1", "p2", "p3"), (p1, p2, p3))])
        return self._add("addTriangle", corners, len(self._vertices) + np.array([[0, 1, 2]]))

    def addSubModel(self, ps, ts=()):
        """ps : points (n, 3) [m].   ts : triangles (m, 3), rows of them."""
        points, facets = rows_of("ps", ps), triangle_rows(ts)
        check_rows("addSubModel: ts", facets, len(points))
        return self._add("addSubModel", points, len(self._vertices) + facets)

    def _add(self, name: str, vertices: np.ndarray, facets: np.ndarray) -> int:
        if self.build_state != BVHBuildState.BVH_BUILD_STATE_BEGUN:
            warnings.warn(f"{name}: there is no beginModel before it; nothing done", stacklevel=3)
            return _OUT_OF_SEQUENCE
        self._vertices = np.concatenate([self._vertices, vertices])
        self._triangles = np.concatenate([self._triangles, facets])
        return _OK

    def endModel(self):
        """All is there. Raises InvalidArgument for triangles of vertices that are not, InvalidShape for no numbers."""
        if self.build_state != BVHBuildState.BVH_BUILD_STATE_BEGUN:
            warnings.warn("endModel: there is no beginModel before it; nothing done", stacklevel=2)
            return _OUT_OF_SEQUENCE
        check_rows("endModel: triangles", self._triangles, len(self._vertices))
        self._finish(BVHBuildState.BVH_BUILD_STATE_PROCESSED)
        return _OK

    def _finish(self, state: BVHBuildState) -> None:
        self._parts = []
        if len(self._triangles):
            surface = engine.Mesh(self._vertices, self._triangles, solid=False)
            self._become([self._vertices.min(axis=0), self._vertices.max(axis=0)], surface)
        elif len(self._vertices):
            self._become([self._vertices.min(axis=0), self._vertices.max(axis=0)])
        self.build_state = state

    def beginReplaceModel(self):
        """Vertices are to be moved, from the first one on."""
        if self.build_state not in (
            BVHBuildState.BVH_BUILD_STATE_PROCESSED, BVHBuildState.BVH_BUILD_STATE_UPDATED,
        ):
            warnings.warn("beginReplaceModel: there is no finished model; nothing done", stacklevel=2)
            return _OUT_OF_SEQUENCE
        self.build_state, self._n_replaced = BVHBuildState.BVH_BUILD_STATE_REPLACE_BEGUN, 0
        return _OK

    def replaceVertex(self, p):
        """The next vertex's place (3,) [m]."""
        return self.replaceSubModel(shaped("p", p, (3,))[None])

    def replaceTriangle(self, p1, p2, p3):
        """Places (3,) of the next three vertices [m]."""
        return self.replaceSubModel([p1, p2, p3])

    def replaceSubModel(self, ps):
        """Places (n, 3) of the next n vertices [m]."""
        points = rows_of("ps", ps)
        if self.build_state != BVHBuildState.BVH_BUILD_STATE_REPLACE_BEGUN:
            warnings.warn("replace: there is no beginReplaceModel before it; nothing done", stacklevel=2)
            return _OUT_OF_SEQUENCE
        end = self._n_replaced + len(points)
        if end > len(self._vertices):
            raise InvalidArgument(f"the model has {len(self._vertices)} vertices; {end} are to be replaced")
        self._vertices = self._vertices.copy()
        self._vertices[self._n_replaced : end], self._n_replaced = points, end
        return _OK

    def endReplaceModel(self, refit=True, bottomup=True):
        """All vertices have their new places; the arguments have no effect. Raises InvalidArgument for too few."""
        if self.build_state != BVHBuildState.BVH_BUILD_STATE_REPLACE_BEGUN:
            warnings.warn("endReplaceModel: there is no beginReplaceModel before it; nothing done", stacklevel=2)
            return _OUT_OF_SEQUENCE
        if self._n_replaced != len(self._vertices):
            raise InvalidArgument(f"{self._n_replaced} of {len(self._vertices)} vertices were replaced")
        self._finish(BVHBuildState.BVH_BUILD_STATE_PROCESSED)
        return _OK

    @property
    def num_vertices(self):
        """How many vertices there are."""
        return len(self._vertices)

    @property
    def num_tris(self):
        """How many triangles there are."""
        return len(self._triangles)

    def vertices(self, index=None):
        """All vertices, a copy (n, 3); one of them (3,) by its index."""
        return self._vertices.copy() if index is None else self._vertices[index].copy()

    def vertex(self, index):
        """One of the vertices, a copy (3,)."""
        return self._vertices[index].copy()

    def tri_indices(self, index):
        """`Triangle` of that number."""
        return Triangle(*self._triangles[index])

    def getModelType(self):
        """A `BVHModelType`."""
        if len(self._triangles):
            return BVHModelType.BVH_MODEL_TRIANGLES
        return BVHModelType.BVH_MODEL_POINTCLOUD if len(self._vertices) else BVHModelType.BVH_MODEL_UNKNOWN

    @property
    def convex(self):
        """What `buildConvexHull` or `buildConvexRepresentation` made, None before."""
        return self._convex

    def buildConvexRepresentation(self, share_memory=False):
        """``convex`` becomes the hull of the vertices, with the triangles that there are."""
        if self._convex is None:
            self._convex = Convex(self._vertices, self._triangles)

    def buildConvexHull(self, keepTriangle, qhullCommand=None):
        """``convex`` becomes the hull of the vertices. Returns True."""
        self._convex = ConvexBase.convexHull(self._vertices, keepTriangle)
        return True

    def getNumBVs(self):
        """How many boxes a binary tree over the triangles has."""
        return max(0, 2 * len(self._triangles) - 1)

    def memUsage(self, msg=False):
        """Bytes of the vertices and triangles."""
        return self._vertices.nbytes + self._triangles.nbytes

    def makeParentRelative(self):
        """Nothing to do."""

    @property
    def _shape(self) -> Shape:
        if not self._shapes:
            raise InvalidArgument(
                f"{type(self).__name__} has no triangles: beginModel, addVertices, addTriangles, endModel"
            )
        return self._shapes[0]

    def _mass(self):
        return coal_inertia.polyhedron(self._vertices, self._triangles)

    def _pieces(self):
        if not self._parts:
            surface = self._shape
            labels = component_labels(self._vertices, self._triangles)
            for label in np.unique(labels):
                rows = np.flatnonzero(labels == label)
                whole = len(rows) == len(labels)
                part = surface if whole else engine.Mesh(self._vertices, self._triangles[rows], solid=False)
                self._parts.append((part, None if whole else rows))
        return self._parts


class BVHModelOBBRSS(BVHModelBase):
    """Triangles; the kind of box has no effect here. ``BVHModelOBBRSS()`` or of another one."""

    _node_type = NODE_TYPE.BV_OBBRSS


class BVHModelOBB(BVHModelBase):
    """Triangles; the kind of box has no effect here. ``BVHModelOBB()`` or of another one."""

    _node_type = NODE_TYPE.BV_OBB


def rows_of(name: str, points) -> np.ndarray:
    """Points (n, 3) of a list or an array, float64. Raises InvalidArgument."""
    return rows_of_three(name, list(points) if isinstance(points, StdVec_Vec3s) else points)


def check_rows(name: str, facets: np.ndarray, n_points: int) -> None:
    """Raises InvalidArgument where facets (m, 3) name points that are not there."""
    if facets.size and not 0 <= facets.min() <= facets.max() < n_points:
        raise InvalidArgument(f"{name} must be rows within 0 … {n_points - 1}, got {facets.min()} … {facets.max()}")


def component_labels(vertices: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(m,) the same number for facets (m, 3) that hang together over corners in the same place."""
    _, places = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    corners = places.reshape(-1)[facets]
    labels = np.arange(int(corners.max()) + 1)
    while True:
        lowest = labels[corners].min(axis=1)
        joined = labels.copy()
        np.minimum.at(joined, corners, lowest[:, None])
        joined = joined[joined]
        if np.array_equal(joined, labels):
            return labels[corners[:, 0]]
        labels = joined
