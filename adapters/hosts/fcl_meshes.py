"""python-fcl's `BVHModel` and `OcTree`: triangles as a surface without an inside, and boxes of a binary octomap."""

from __future__ import annotations

import itertools
import warnings
from typing import Any

import numpy as np

import collide as engine
from collide.adapters.hosts.fcl_geometry import CollisionGeometry
from collide.adapters.hosts.fcl_requests import NODE_TYPE, OBJECT_TYPE
from collide.adapters.hosts.host_numbers import real, shaped
from collide.adapters.hosts.octomap_boxes import occupied_boxes
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, UnsupportedQuery

#: What python-fcl's model returns where calls come in a wrong order, and of none.
_OUT_OF_SEQUENCE, _OK = -2, 0
_EMPTY, _STARTED, _PROCESSED = range(3)


class BVHModel(CollisionGeometry):
    """Triangles, a surface: nothing is inside of it, as in FCL. `Convex` is the solid.

    ``beginModel``, then ``addSubModel``, ``addTriangle`` or ``addVertex``, then ``endModel``.
    """

    _node_type, _object_type = NODE_TYPE.BV_OBBRSS, OBJECT_TYPE.OT_BVH

    def __init__(self):
        self._state, self._n_vertices = _EMPTY, 0
        self._vertices, self._triangles = [], []
        self._become(np.zeros((2, 3)))

    def num_tries_(self):
        """How many triangles there are."""
        return sum(len(triangles) for triangles in self._triangles)

    def buildState(self):
        """0 empty, 1 begun, 2 finished."""
        return self._state

    def beginModel(self, num_tris_=0, num_vertices_=0):
        """Start anew; the numbers are hints. Returns 0."""
        if self._state != _EMPTY:
            warnings.warn("beginModel: the triangles there were are dropped", stacklevel=2)
        self.__init__()
        self._state = _STARTED
        return _OK

    def endModel(self):
        """Triangles are complete. Returns 0, −2 before `beginModel`. Raises InvalidShape, InvalidArgument."""
        if self._state != _STARTED:
            warnings.warn("endModel: there is no beginModel before it; nothing done", stacklevel=2)
            return _OUT_OF_SEQUENCE
        if not self._triangles:
            raise InvalidArgument("endModel: there are no triangles; addSubModel(verts, triangles) adds them")
        vertices = np.concatenate(self._vertices)
        surface = engine.Mesh(vertices, np.concatenate(self._triangles), solid=False)
        self._become([vertices.min(axis=0), vertices.max(axis=0)], surface)
        self._state = _PROCESSED
        return _OK

    def addVertex(self, x, y, z):
        """Coordinates [m] of a vertex. Returns True."""
        vertex = [real(name, value) for name, value in zip("xyz", (x, y, z))]
        self._add(np.array([vertex]), np.zeros((0, 3), dtype=np.int64))
        return True

    def addTriangle(self, v1, v2, v3):
        """Corners (3,) [m]. Returns True."""
        corners = np.array([shaped(name, v, (3,)) for name, v in zip(("v1", "v2", "v3"), (v1, v2, v3))])
        self._add(corners, np.array([[0, 1, 2]]))
        return True

    def addSubModel(self, verts, triangles):
        """verts : (n, 3) [m].   triangles : (m, 3) rows of verts.   Returns True."""
        vertices = np.array(checks.array("verts", verts, "(n, 3)", InvalidArgument))
        facets = checks.plain_array("triangles", triangles, "(m, 3)", InvalidArgument)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or facets.ndim != 2 or facets.shape[1] != 3:
            raise InvalidArgument(f"verts must be (n, 3) and triangles (m, 3), got {vertices.shape} and {facets.shape}")
        if facets.dtype.kind not in "iu" or (facets.size and not 0 <= facets.min() <= facets.max() < len(vertices)):
            raise InvalidArgument(f"triangles must be integers within 0 … {len(vertices) - 1}")
        self._add(vertices, facets.astype(np.int64))
        return True

    def _cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the facets (n, 3, 3), and what is to be added to them: nothing."""
        surface: Any = self._shape
        corners = surface.vertices[surface.faces]
        return corners, np.zeros_like(corners)

    def _of_cells(self, cells: np.ndarray) -> engine.Mesh:
        """The surface of these facets alone."""
        surface: Any = self._shape
        return engine.Mesh(surface.vertices, surface.faces[cells], solid=False)

    def _add(self, vertices: np.ndarray, facets: np.ndarray) -> None:
        if self._state != _STARTED:
            raise ValueError("BVH construction does not follow correct sequence: call beginModel() first")
        self._vertices.append(vertices)
        if len(facets):
            self._triangles.append(facets + self._n_vertices)
        self._n_vertices += len(vertices)


class OcTree(CollisionGeometry):
    """The occupied boxes of an octomap, a solid; free and unknown space is empty.

    r : edge of the smallest box [m].   data : bytes, or numbers of them: the tree in octomap's binary form, for every
    node two bytes, two bits a child (nothing, free, occupied, or a node of its own), the first child lowest; or a whole
    file (.bt, .ot) of it, whose resolution r must be.
    """

    _node_type, _object_type = NODE_TYPE.GEOM_OCTREE, OBJECT_TYPE.OT_OCTREE

    def __init__(self, r, data):
        is_bytes = isinstance(data, bytes | bytearray | memoryview)
        values = data if is_bytes else (checks.whole_numbers("OcTree: data", data) & 255).tolist()
        boxes = occupied_boxes(bytes(values), real("OcTree: r", r)).boxes
        if not boxes:
            raise UnsupportedQuery("OcTree: data holds no occupied box; leave the object out")
        middles = np.array([middle for middle, _ in boxes])
        half_edges = np.array([[0.5 * edge] for _, edge in boxes])
        shapes = [(engine.Box(edge, edge, edge), engine.pose(middle)) for middle, edge in boxes]
        self._middles, self._half_edges, self._boxes = middles, half_edges, shapes
        self._become([(middles - half_edges).min(axis=0), (middles + half_edges).max(axis=0)], engine.Compound(shapes))

    def _cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Middles of the boxes (n, 8, 3), and what is to be added to them for the corners, exactly."""
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        offsets = self._half_edges[:, :, None] * signs[None]
        return np.broadcast_to(self._middles[:, None], offsets.shape), offsets

    def _of_cells(self, cells: np.ndarray) -> engine.Compound:
        """The union of these boxes alone."""
        return engine.Compound([self._boxes[k] for k in cells.tolist()])
