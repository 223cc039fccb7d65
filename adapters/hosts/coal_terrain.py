"""coal's height fields, octrees and mesh files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import collide as engine
from collide.adapters.hosts.coal_containers import AABB, StdVec_Vec6
from collide.adapters.hosts.coal_enums import NODE_TYPE, OBJECT_TYPE
from collide.adapters.hosts.coal_geometry import CollisionGeometry
from collide.adapters.hosts.coal_meshes import BVHModelOBB, BVHModelOBBRSS, rows_of
from collide.adapters.hosts.host_numbers import real
from collide.adapters.hosts.octomap_boxes import occupied_boxes
from collide.base import argument_checks as checks
from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.scenes.loaders.mesh_file import read_mesh

#: How far below the lowest height a bottom lies that is not below it, in parts of the field's size.
_THIN = 2.0**-40
#: Levels of an octomap.
OCTREE_DEPTH = 16


class _HeightField(CollisionGeometry):
    """Terrain: heights over a grid, and everything below them down to ``min_height``, a solid.

    ``(x_dim, y_dim, heights, min_height=0)``: lengths of the field [m], centred; heights (r, c) [m], columns from −x to
    +x, rows from +y to −y, as coal has them; or another field. Heights below ``min_height`` are raised to it. Where the
    lowest height is ``min_height`` the bottom lies 2⁻⁴⁰ of the field's size deeper.
    """

    _object_type, _has_parts = OBJECT_TYPE.OT_HFIELD, True

    def __init__(self, *args):
        if len(args) == 1 and isinstance(args[0], _HeightField):
            args = (args[0]._dims[0], args[0]._dims[1], args[0]._heights, args[0]._min_height)
        if len(args) not in (3, 4):
            raise TypeError(f"{type(self).__name__}(x_dim, y_dim, heights, min_height=0)")
        self._dims = np.array([real("x_dim", args[0]), real("y_dim", args[1])])
        self._min_height = real("min_height", args[3]) if len(args) == 4 else 0.0
        self.updateHeights(args[2])

    def updateHeights(self, new_heights):
        """New heights, as many as before [m]."""
        heights = np.array(checks.array("heights", new_heights, "(r, c)", InvalidArgument))
        if heights.ndim != 2 or min(heights.shape) < 2:
            raise InvalidArgument(f"heights must be (r, c) with r and c at least 2, got shape {heights.shape}")
        if "_heights" in vars(self) and self._heights.shape != heights.shape:
            raise InvalidArgument(f"updateHeights: {self._heights.shape} heights are there, got {heights.shape}")
        self._heights = np.maximum(heights, self._min_height)
        rows, columns = heights.shape
        cell = self._dims / [columns - 1, rows - 1]
        extent = max(*self._dims.tolist(), float(np.abs(self._heights).max()), abs(self._min_height))
        lowest = float(self._heights.min())
        bottom = self._min_height if lowest > self._min_height else lowest - _THIN * extent
        half = 0.5 * self._dims
        corners = [[*-half, bottom], [*half, self._heights.max()]]
        self._become(corners, engine.HeightField(self._heights[::-1], cell, bottom=bottom))

    def getXDim(self):
        """Length along x [m]."""
        return float(self._dims[0])

    def getYDim(self):
        """Length along y [m]."""
        return float(self._dims[1])

    def getXGrid(self):
        """x of the columns (c,) [m]."""
        return np.linspace(-0.5 * self._dims[0], 0.5 * self._dims[0], self._heights.shape[1])

    def getYGrid(self):
        """y of the rows (r,), from the greatest down [m]."""
        return np.linspace(0.5 * self._dims[1], -0.5 * self._dims[1], self._heights.shape[0])

    def getHeights(self):
        """A copy (r, c) [m]."""
        return self._heights.copy()

    def getMinHeight(self):
        """z of the bottom [m]."""
        return self._min_height

    def getMaxHeight(self):
        """The greatest height [m]."""
        return float(self._heights.max())


class HeightFieldAABB(_HeightField):
    __doc__ = _HeightField.__doc__
    _node_type = NODE_TYPE.HF_AABB


class HeightFieldOBBRSS(_HeightField):
    __doc__ = _HeightField.__doc__
    _node_type = NODE_TYPE.HF_OBBRSS


class OcTree(CollisionGeometry):
    """The occupied boxes of an octomap, a solid; free and unknown space is empty. Made by `makeOctree` or
    ``MeshLoader().loadOctree``; ``OcTree(resolution)`` is empty, which no query takes.
    """

    _node_type, _object_type, _has_parts = NODE_TYPE.GEOM_OCTREE, OBJECT_TYPE.OT_OCTREE, True

    def __init__(self, resolution, boxes=()):
        self._resolution = real("OcTree: resolution", resolution)
        if not 0.0 < self._resolution < np.inf:
            raise InvalidArgument(f"OcTree: resolution must be > 0 and finite [m], got {self._resolution}")
        self._free, self._occupied = 0.12, 0.7
        self._boxes = list(boxes)
        if self._boxes:
            middles = np.array([middle for middle, _ in self._boxes])
            half_edges = np.array([[0.5 * edge] for _, edge in self._boxes])
            union = engine.Compound([(engine.Box(edge, edge, edge), engine.pose(p)) for p, edge in self._boxes])
            self._become([(middles - half_edges).min(axis=0), (middles + half_edges).max(axis=0)], union)

    def toBoxes(self):
        """`StdVec_Vec6` of the occupied boxes: middle, edge [m], occupancy 1, and the threshold of it."""
        return StdVec_Vec6(np.array([*middle, edge, 1.0, self._occupied]) for middle, edge in self._boxes)

    def getResolution(self):
        """Edge of the smallest box [m]."""
        return self._resolution

    def getTreeDepth(self):
        """16."""
        return OCTREE_DEPTH

    def getRootBV(self):
        """The `AABB` of all that a tree of this resolution can hold."""
        half = self._resolution * 2.0 ** (OCTREE_DEPTH - 1)
        return AABB(np.full(3, -half), np.full(3, half))

    def getDefaultOccupancy(self):
        """The occupancy threshold: boxes are occupied or not there."""
        return self._occupied

    def getOccupancyThres(self):
        """Kept, and without effect."""
        return self._occupied

    def getFreeThres(self):
        """Kept, and without effect."""
        return self._free

    def setOccupancyThres(self, threshold):
        """Without effect on queries."""
        self._occupied = real("threshold", threshold)

    def setFreeThres(self, threshold):
        """Without effect on queries."""
        self._free = real("threshold", threshold)

    @property
    def _shape(self):
        if not self._shapes:
            raise UnsupportedQuery("OcTree has no occupied box; leave the object out")
        return self._shapes[0]

    def _pieces(self):
        union = self._shape
        return [(engine.Compound([part]), np.array([k])) for k, part in enumerate(union.items)]


def makeOctree(point_cloud, resolution):
    """The `OcTree` of the boxes in which points lie.

    point_cloud : (n, 3) [m].   resolution : edge of a box [m].
    """
    points, edge = rows_of("point_cloud", point_cloud), real("resolution", resolution)
    OcTree(edge)  # says what is wrong with the edge
    numbers = np.unique(np.floor(points / edge), axis=0)
    if np.abs(numbers).max() > 2.0 ** (OCTREE_DEPTH - 1) - 1.0:
        raise InvalidArgument(f"makeOctree: points lie outside of what 16 levels of boxes of {edge:g} m reach")
    return OcTree(edge, [((number + 0.5) * edge, edge) for number in numbers])


class MeshLoader:
    """Mesh files as models: STL, OBJ, PLY, OFF, DAE, glTF, GLB.

    node_type : ``BV_OBBRSS`` or ``BV_OBB``, the kind of model.
    """

    def __init__(self, node_type=NODE_TYPE.BV_OBBRSS):
        models = {NODE_TYPE.BV_OBBRSS: BVHModelOBBRSS, NODE_TYPE.BV_OBB: BVHModelOBB}
        if node_type not in models:
            raise UnsupportedQuery(f"MeshLoader: models are BV_OBBRSS or BV_OBB, not {node_type}")
        self._model = models[node_type]

    def load(self, filename, scale=(1.0, 1.0, 1.0)):
        """The triangles of all meshes in a file, one surface. Raises SceneError, MissingExtra."""
        factors = _factors(scale)
        model = self._model()
        model.beginModel()
        for part in read_mesh(checks.file_path("filename", filename)).parts:
            model.addSubModel(part.points * factors, part.facets)
        model.endModel()
        return model

    def loadOctree(self, filename):
        """The `OcTree` of a file of octomap (.bt, .ot). Raises InvalidArgument."""
        try:
            return OcTree(*occupied_boxes(read_bytes(Path(filename), LARGEST_MESH, "octree")))
        except InvalidArgument as error:
            raise InvalidArgument(f"{filename}: {error}") from None


class CachedMeshLoader(MeshLoader):
    """The same; a file that did not change is read once."""

    def __init__(self, node_type=NODE_TYPE.BV_OBBRSS):
        super().__init__(node_type)
        self._known: dict[tuple, CollisionGeometry] = {}

    def load(self, filename, scale=(1.0, 1.0, 1.0)):
        """The triangles of all meshes in a file, one surface; the same object for the same file and scale."""
        path = checks.file_path("filename", filename)
        if not path.is_file():
            return super().load(filename, scale)  # says what is wrong
        changed = path.stat().st_mtime_ns
        key = (path.resolve(), changed, tuple(_factors(scale).tolist()))
        if key not in self._known:
            self._known[key] = super().load(filename, scale)
        return self._known[key]


def _factors(scale) -> np.ndarray:
    """(3,) factors along x, y, z of one or three. Raises InvalidArgument."""
    factors = checks.array("scale", scale, "() or (3,)", InvalidArgument)
    if factors.shape not in ((), (3,)):
        raise InvalidArgument(f"scale must be one number or three, got shape {factors.shape}")
    return np.broadcast_to(factors, (3,))
