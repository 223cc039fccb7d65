"""libcollide through ctypes, for tests: its functions with their types, and Python's shapes made by them.

No Python of collide is between: what a program in C calls is called here.
"""

from __future__ import annotations

import ctypes
import math
import os
from ctypes import POINTER, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import cache

import numpy as np

import collide
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.kernels.library import library_path
from collide.results import PAIR_DTYPE

OK, NO_MEMORY, INVALID_ARGUMENT, INVALID_SHAPE, INVALID_POSE, OUT_OF_RANGE, ENDLESS_DEPTH, UNSUPPORTED, NO_KERNELS = (
    range(9)
)
TOO_MANY, INVALID_FILE = 9, 10
TRUST_POSES, UNSIGNED, START_NORMALS = 1, 2, 4


class Poses(ctypes.Structure):
    _fields_ = [("matrices", c_void_p), ("count", c_size_t)]


class Vectors(ctypes.Structure):
    _fields_ = [("xyz", c_void_p), ("count", c_size_t)]


class Motions(ctypes.Structure):
    _fields_ = [
        ("X_WA0", Poses), ("X_WA1", Poses), ("X_WB0", Poses), ("X_WB1", Poses), ("omega_WA", Vectors),
        ("omega_WB", Vectors),
    ]


#: Rows of `collide_ray_hit`.
RAY_HIT = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point", "f8", 3),
        ("facet", "i4"), ("item", "i4"), ("hit", "?"), ("certified", "?"), ("reserved", "u1", 6),
    ]
)
#: Rows of `collide_time_of_impact`.
TIME_OF_IMPACT = np.dtype(
    [
        ("time", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point_a", "f8", 3),
        ("point_b", "f8", 3), ("part_a", "i4"), ("part_b", "i4"), ("queries", "i4"), ("hit", "?"), ("certified", "?"),
        ("reserved", "u1", 2),
    ]
)
#: Rows of `collide_first_contact`.
FIRST_CONTACT = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("normal", "f8", 3), ("point", "f8", 3),
        ("item_a", "i4"), ("item_b", "i4"), ("hit", "?"), ("certified", "?"), ("at_start", "?"), ("reserved", "u1", 5),
    ]
)

_TYPES = {
    "collide_status_text": [c_int],
    "collide_version": [],
    "collide_level": [POINTER(c_char_p)],
    "collide_sphere": [c_double, c_void_p],
    "collide_box": [c_void_p, c_void_p],
    "collide_capsule": [c_double, c_double, c_void_p],
    "collide_cylinder": [c_double, c_double, c_void_p],
    "collide_cone": [c_double, c_double, c_void_p],
    "collide_ellipsoid": [c_void_p, c_void_p],
    "collide_halfspace": [c_void_p, c_double, c_void_p],
    "collide_hull": [c_void_p, c_size_t, c_double, c_void_p],
    "collide_hpolytope": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_shape_free": [c_void_p],
    "collide_shape_set_create": [c_void_p, c_size_t, c_void_p],
    "collide_shape_set_free": [c_void_p],
    "collide_workspace_create": [c_void_p],
    "collide_workspace_free": [c_void_p],
    "collide_collide": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, POINTER(c_int)],
    "collide_distance": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p],
    "collide_collide_batch": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_distance_batch": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, c_double, c_uint, c_void_p, POINTER(c_size_t),
    ],
    "collide_collide_each": [
        c_void_p, c_void_p, c_void_p, c_size_t, Poses, Poses, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_distance_each": [
        c_void_p, c_void_p, c_void_p, c_size_t, Poses, Poses, c_double, c_uint, c_void_p, POINTER(c_size_t),
    ],
    "collide_contacts": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_size_t, c_uint, c_void_p, POINTER(c_size_t),
    ],
    "collide_contacts_batch": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, c_double, c_size_t, c_uint, c_void_p, c_size_t, c_void_p,
        POINTER(c_size_t),
    ],
    "collide_contacts_each": [
        c_void_p, c_void_p, c_void_p, c_size_t, Poses, Poses, c_double, c_size_t, c_uint, c_void_p, c_size_t, c_void_p,
        POINTER(c_size_t),
    ],
    "collide_within": [c_void_p, c_void_p, c_void_p, Poses, Poses, c_double, c_uint, c_void_p, POINTER(c_size_t)],
    "collide_cast": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p,
    ],
    "collide_compound_cast": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p,
    ],
    "collide_cast_batch": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, Vectors, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_impact": [c_void_p] * 9 + [c_double, c_uint, c_void_p],
    "collide_impact_batch": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_raycast": [
        c_void_p, c_void_p, Poses, Vectors, Vectors, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_compound_raycast": [
        c_void_p, c_void_p, Poses, Vectors, Vectors, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_mesh_raycast": [
        c_void_p, c_void_p, Poses, Vectors, Vectors, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_compound_create": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_compound_free": [c_void_p],
    "collide_compound_collide": [c_void_p, c_void_p, c_void_p, Poses, Poses, c_uint, c_void_p, POINTER(c_size_t)],
    "collide_compound_distance": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, c_double, c_uint, c_void_p, POINTER(c_size_t),
    ],
    "collide_compound_contacts": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_size_t, c_uint, c_void_p, c_size_t,
        POINTER(c_size_t),
    ],
    "collide_mesh_shape_collide": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, POINTER(c_int)],
    "collide_mesh_shape_distance": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, c_void_p],
    "collide_mesh_shape_contacts": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_size_t, c_uint, c_void_p, c_size_t,
        POINTER(c_size_t),
    ],
    "collide_mesh_contacts": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_size_t, c_uint, c_void_p, c_size_t,
        POINTER(c_size_t),
    ],
    "collide_mesh_create": [c_void_p, c_size_t, c_void_p, c_size_t, c_int, c_void_p],
    "collide_mesh_of_shape": [c_void_p, c_void_p],
    "collide_height_field_create": [c_void_p, c_size_t, c_size_t, c_void_p, c_void_p, c_void_p],
    "collide_mesh_free": [c_void_p],
    "collide_mesh_collide": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, POINTER(c_int)],
    "collide_mesh_distance": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, c_void_p],
    "collide_point_cloud_create": [c_void_p, c_size_t, c_void_p, c_size_t, c_void_p],
    "collide_voxel_grid_create": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p],
    "collide_field_free": [c_void_p],
    "collide_field_collide": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_uint, POINTER(c_int)],
    "collide_field_distance": [c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p],
    "collide_field_collide_batch": [c_void_p, c_void_p, c_void_p, Poses, Poses, c_uint, c_void_p, POINTER(c_size_t)],
    "collide_field_distance_batch": [
        c_void_p, c_void_p, c_void_p, Poses, Poses, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_field_contacts": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_size_t, c_uint, c_void_p, c_size_t,
        POINTER(c_size_t),
    ],
    "collide_field_raycast": [
        c_void_p, c_void_p, Poses, Vectors, Vectors, c_double, c_uint, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_field_cast": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_uint, c_void_p,
    ],
    "collide_point_cloud_nearest": [c_void_p, c_void_p, c_size_t, c_size_t, c_double, c_void_p, c_void_p],
    "collide_point_cloud_within": [c_void_p, c_void_p, c_double, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_create": [c_void_p],
    "collide_world_free": [c_void_p],
    "collide_world_message": [c_void_p],
    "collide_workspace_message": [c_void_p],
    "collide_world_add": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_world_remove": [c_void_p, c_int],
    "collide_world_move": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_world_replace": [c_void_p, c_int, c_void_p],
    "collide_world_replace_mesh": [c_void_p, c_int, c_void_p],
    "collide_world_replace_field": [c_void_p, c_int, c_void_p],
    "collide_world_sleep": [c_void_p, c_void_p, c_size_t, c_int],
    "collide_world_allow": [c_void_p, c_void_p, c_size_t],
    "collide_world_set_margins": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_world_set_pair_margins": [c_void_p, c_void_p, c_size_t, c_void_p],
    "collide_world_size": [c_void_p],
    "collide_world_pose": [c_void_p, c_int, c_void_p],
    "collide_world_collides": [c_void_p, c_void_p, POINTER(c_int)],
    "collide_world_within": [c_void_p, c_void_p, c_double, POINTER(c_int)],
    "collide_world_hits": [c_void_p, c_void_p, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_collisions": [c_void_p, c_void_p, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_distances": [c_void_p, c_void_p, c_double, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_minimum": [c_void_p, c_void_p, c_double, c_void_p, POINTER(c_size_t)],
    "collide_world_contacts": [c_void_p, c_void_p, c_double, c_size_t, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_query": [c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_void_p, c_size_t, POINTER(c_size_t)],
    "collide_world_boxes_near": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_double, c_void_p, c_size_t, POINTER(c_size_t),
    ],
    "collide_world_raycast": [
        c_void_p, c_void_p, c_void_p, c_void_p, c_size_t, c_double, c_void_p, c_void_p, c_void_p, c_void_p,
    ],
    "collide_world_cast": [
        c_void_p, c_void_p, c_void_p, Poses, Vectors, c_double, c_uint, c_void_p, c_void_p, c_void_p, c_void_p,
    ],
    "collide_world_nearest": [
        c_void_p, c_void_p, c_void_p, c_size_t, c_double, c_void_p, c_void_p, c_void_p,
    ],
    "collide_robot_load": [c_char_p, c_void_p],
    "collide_robot_read": [c_char_p, c_size_t, c_void_p],
    "collide_robot_free": [c_void_p],
    "collide_robot_columns": [c_void_p],
    "collide_robot_bodies": [c_void_p],
    "collide_robot_around": [c_void_p],
    "collide_robot_column_name": [c_void_p, c_size_t],
    "collide_robot_body_name": [c_void_p, c_int],
    "collide_robot_workspace_create": [c_void_p, c_void_p],
    "collide_robot_workspace_free": [c_void_p],
    "collide_robot_move_around": [c_void_p, c_void_p, c_size_t, c_void_p, POINTER(c_size_t)],
    "collide_robot_pose_around": [c_void_p, c_int, c_void_p],
    "collide_robot_attach": [
        c_void_p, c_int, c_void_p, c_void_p, c_double, c_void_p, c_size_t, POINTER(c_int),
    ],
    "collide_robot_detach": [c_void_p, c_int],
    "collide_robot_allow": [c_void_p, c_void_p, c_size_t],
    "collide_robot_collide": [c_void_p, c_void_p, c_size_t, c_void_p, c_void_p, POINTER(c_size_t)],
    "collide_robot_distance": [
        c_void_p, c_void_p, c_size_t, c_double, c_uint, c_void_p, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_robot_near": [
        c_void_p, c_void_p, c_size_t, c_double, c_uint, c_void_p, c_void_p, c_size_t, c_void_p, c_void_p,
        POINTER(c_size_t),
    ],
    "collide_robot_certify": [
        c_void_p, c_void_p, c_void_p, c_size_t, c_double, c_void_p, c_void_p, c_void_p, POINTER(c_size_t),
    ],
    "collide_robot_sample": [
        c_void_p, c_void_p, c_void_p, c_size_t, c_double, c_void_p, c_void_p, c_void_p, POINTER(c_size_t),
    ],
}
_TEXTS = {
    "collide_status_text", "collide_version", "collide_world_message", "collide_workspace_message",
    "collide_robot_column_name", "collide_robot_body_name",
}
_SIZES = {"collide_world_size", "collide_robot_columns", "collide_robot_bodies", "collide_robot_around"}
#: What is no status.
_OTHERS = {**dict.fromkeys(_TEXTS, c_char_p), **dict.fromkeys(_SIZES, c_size_t)}


@cache
def library() -> ctypes.CDLL:
    """The library of this installation. Raises FileNotFoundError where there is none."""
    found = ctypes.CDLL(os.environ.get("COLLIDE_TEST_LIBRARY") or library_path())
    for name, types in _TYPES.items():
        function = getattr(found, name)
        function.argtypes = types
        function.restype = _OTHERS.get(name, None if name.endswith("_free") else c_int)
    return found


def _doubles(values) -> np.ndarray:
    return np.ascontiguousarray(values, dtype=np.float64)


def raw_shape(function: str, *arguments) -> tuple[int, int | None]:
    """(status, handle) of a function that makes a shape; arrays are handed over as addresses."""
    out = c_void_p()
    given = [a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments]
    return getattr(library(), function)(*given, ctypes.byref(out)), out.value


class CShape:
    """A shape of Python made once more in C."""

    def __init__(self, shape: collide.Shape):
        status, self.handle = raw_shape(*_made_by(shape))
        self._free = library().collide_shape_free  # at the end of a process modules go before shapes do
        assert status == OK, (shape, library().collide_status_text(status))

    def __del__(self):
        self._free(self.handle)


def _made_by(shape) -> tuple:
    kind = type(shape).__name__
    if kind == "Sphere":
        return "collide_sphere", shape.radius
    if kind == "Box":
        return "collide_box", _doubles(shape.size)
    if kind in ("Capsule", "Cylinder", "Cone"):
        return f"collide_{kind.lower()}", shape.radius, shape.length
    if kind == "Ellipsoid":
        return "collide_ellipsoid", _doubles(shape.radii)
    if kind == "Halfspace":
        return "collide_halfspace", _doubles(shape.normal), shape.offset
    if kind == "HPolytope":
        return "collide_hpolytope", _doubles(shape.normals), _doubles(shape.offsets), len(shape.offsets)
    assert kind == "ConvexHull", kind
    return "collide_hull", _doubles(shape.points), len(shape.points), shape.radius


#: How a mesh is taken.
SURFACE, SOLID, SOLID_IF_CLOSED = range(3)


def raw_mesh(vertices, faces, solid: int) -> tuple[int, int | None]:
    """(status, handle) of a mesh."""
    vertices, faces, out = _doubles(vertices), np.ascontiguousarray(faces, dtype=np.int32), c_void_p()
    status = library().collide_mesh_create(
        vertices.ctypes.data, len(vertices), faces.ctypes.data, len(faces), solid, ctypes.byref(out)
    )
    return status, out.value


def raw_height_field(heights, cell, bottom: float | None) -> tuple[int, int | None]:
    """(status, handle) of a mesh of terrain."""
    heights, cell = _doubles(heights), _doubles(np.broadcast_to(cell, 2))
    below = None if bottom is None else _doubles([bottom])
    return raw_shape("collide_height_field_create", heights, *heights.shape, cell, below)


class CMesh:
    """A mesh, or a convex shape, of Python made once more in C, to be asked about as facets."""

    def __init__(self, shape: collide.Shape):
        if isinstance(shape, collide.HeightField):
            status, self.handle = raw_height_field(shape.heights, shape.cell, shape.bottom)
        elif isinstance(shape, collide.Mesh):
            status, self.handle = raw_mesh(shape.vertices, shape.faces, SOLID if shape.solid else SURFACE)
        else:
            convex = CShape(shape)  # held until the mesh is made
            status, self.handle = raw_shape("collide_mesh_of_shape", convex.handle)
        assert status == OK, (shape, library().collide_status_text(status))

    def __del__(self):
        if getattr(self, "handle", None):
            library().collide_mesh_free(self.handle)


def raw_compound(shapes: list[CShape | None], poses) -> tuple[int, int | None]:
    """(status, handle) of a union."""
    handles = (c_void_p * max(len(shapes), 1))(*(None if shape is None else shape.handle for shape in shapes))
    poses, out = _doubles(poses), c_void_p()
    status = library().collide_compound_create(handles, poses.ctypes.data, len(shapes), ctypes.byref(out))
    return status, out.value


class CCompound:
    """A Compound of Python, no item of which is another or a mesh, made once more in C; or of a convex shape."""

    def __init__(self, shape: collide.Shape):
        items = shape.items if isinstance(shape, collide.Compound) else ((shape, np.eye(4)),)
        self._parts, self._free = [CShape(item) for item, _ in items], library().collide_compound_free
        status, self.handle = raw_compound(self._parts, np.array([X for _, X in items]))
        assert status == OK, (shape, library().collide_status_text(status))

    def __del__(self):
        self._free(self.handle)


def raw_cloud(points, radii) -> tuple[int, int | None]:
    """(status, handle) of a cloud with a radius for all, or one each."""
    points, radii = _doubles(points).reshape(-1, 3), np.atleast_1d(_doubles(radii))
    return raw_shape("collide_point_cloud_create", points, len(points), radii, len(radii))


def raw_grid(occupied, cell, origin=None) -> tuple[int, int | None]:
    """(status, handle) of a grid."""
    occupied = np.ascontiguousarray(occupied, dtype=np.uint8)
    cells, cell = np.array(occupied.shape, dtype=np.uintp), np.broadcast_to(_doubles(cell), 3).copy()
    return raw_shape("collide_voxel_grid_create", occupied, cells, cell, None if origin is None else _doubles(origin))


class CField:
    """A cloud of Python made once more in C; or a grid, by the array whose grid is given."""

    def __init__(self, field: collide.PointCloud | collide.VoxelGrid, occupied: np.ndarray | None = None):
        self._free = library().collide_field_free
        if isinstance(field, collide.PointCloud):
            status, self.handle = raw_cloud(field.points, field.radius)
        else:
            status, self.handle = raw_grid(occupied, field.cell, field.X[:3, 3])
        assert status == OK, (field, library().collide_status_text(status))

    def __del__(self):
        self._free(self.handle)

    def nearest(self, places, k: int, limit: float = math.inf) -> tuple[int, np.ndarray, np.ndarray]:
        """(status, distances (m, k), numbers (m, k))."""
        places = _doubles(places).reshape(-1, 3)
        distances, rows = np.full((len(places), k), 7.0), np.full((len(places), k), 7, dtype=np.int64)
        status = library().collide_point_cloud_nearest(
            self.handle, places.ctypes.data, len(places), k, limit, distances.ctypes.data, rows.ctypes.data
        )
        return status, distances, rows

    def within(self, place, r: float, capacity: int) -> tuple[int, np.ndarray, int]:
        """(status, numbers that there is room for, how many there are)."""
        place, rows, count = _doubles(place), np.full(max(capacity, 1), 7, dtype=np.int64), c_size_t()
        status = library().collide_point_cloud_within(
            self.handle, place.ctypes.data, r, rows.ctypes.data, capacity, count
        )
        return status, rows[: min(count.value, capacity)], count.value


class CSet:
    """A set of shapes."""

    def __init__(self, shapes: list[CShape]):
        self._shapes = shapes
        handles, out = (c_void_p * len(shapes))(*(shape.handle for shape in shapes)), c_void_p()
        status = library().collide_shape_set_create(handles, len(shapes), ctypes.byref(out))
        assert status == OK, status
        self.handle = out.value

    def __del__(self):
        library().collide_shape_set_free(self.handle)


class Asker:
    """A workspace and questions to it; each answers (status, answer)."""

    def __init__(self):
        out = c_void_p()
        assert library().collide_workspace_create(ctypes.byref(out)) == OK
        self.handle = out.value

    def __del__(self):
        library().collide_workspace_free(self.handle)

    def collide(self, A: CShape, B: CShape, X_WA, X_WB, flags: int = 0) -> tuple[int, bool]:
        hit, X_WA, X_WB = c_int(), _doubles(X_WA), _doubles(X_WB)
        status = library().collide_collide(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, flags, hit
        )
        return status, bool(hit.value)

    def distance(
        self, A: CShape, B: CShape, X_WA, X_WB, flags: int = 0, limit: float = math.inf
    ) -> tuple[int, np.ndarray]:
        rows, X_WA, X_WB = np.zeros(1, dtype=PAIR_DTYPE), _doubles(X_WA), _doubles(X_WB)
        status = library().collide_distance(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, limit, flags, rows.ctypes.data
        )
        return status, rows

    def contacts(self, A: CShape, B: CShape, X_WA, X_WB, margin: float, max_contacts: int, flags: int = 0):
        """(status, rows)."""
        rows, count = np.full(max(max_contacts, 1), 7, dtype=CONTACT_DTYPE), c_size_t()
        X_WA, X_WB = _doubles(X_WA), _doubles(X_WB)
        status = library().collide_contacts(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, margin, max_contacts, flags,
            rows.ctypes.data, count,
        )
        return status, rows[: count.value]

    def contact_batch(self, asked, X_WA, X_WB, margin: float, max_contacts: int, *, capacity: int, flags: int = 0):
        """(status, rows, starts, number of the pair to blame). asked : (A, B), or (set, (n, 2) numbers)."""
        X_WA, X_WB, failed = _doubles(X_WA).reshape(-1, 4, 4), _doubles(X_WB).reshape(-1, 4, 4), c_size_t(0)
        one, other = asked
        if isinstance(one, CSet):
            which = np.ascontiguousarray(other, dtype=np.int64)
            n, first, name = len(which), [one.handle, which.ctypes.data, len(which)], "each"
        else:
            n, first, name = max(len(X_WA), len(X_WB)), [one.handle, other.handle], "batch"
            n = n if len(X_WA) and len(X_WB) else 0
        rows, starts = np.full(capacity, 7, dtype=CONTACT_DTYPE), np.zeros(n + 1, dtype=np.uint64)
        status = getattr(library(), f"collide_contacts_{name}")(
            self.handle, *first, Poses(X_WA.ctypes.data, len(X_WA)), Poses(X_WB.ctypes.data, len(X_WB)), margin,
            max_contacts, flags, rows.ctypes.data, capacity, starts.ctypes.data, failed,
        )
        return status, rows, starts.astype(np.int64), failed.value

    def within(self, A: CShape, B: CShape, X_WA, X_WB, margin: float, flags: int = 0):
        """(status, booleans, number of the pair to blame)."""
        X_WA, X_WB, failed = _doubles(X_WA).reshape(-1, 4, 4), _doubles(X_WB).reshape(-1, 4, 4), c_size_t(0)
        out = np.full(max(len(X_WA), len(X_WB)), 7, dtype=np.uint8)
        poses = Poses(X_WA.ctypes.data, len(X_WA)), Poses(X_WB.ctypes.data, len(X_WB))
        status = library().collide_within(
            self.handle, A.handle, B.handle, *poses, margin, flags, out.ctypes.data, failed
        )
        return status, out, failed.value

    def cast(self, A, B, X_WA, X_WB, direction, limit: float = math.inf, flags: int = 0):
        """(status, row) of two `CShape` or `CCompound`; or of a `CShape` onto a `CField`."""
        rows, X_WA, X_WB, direction = np.full(1, 7, dtype=FIRST_CONTACT), *map(_doubles, (X_WA, X_WB, direction))
        name = "collide_cast" if isinstance(A, CShape) else "collide_compound_cast"
        name = "collide_field_cast" if isinstance(B, CField) else name
        status = getattr(library(), name)(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, direction.ctypes.data, limit, flags,
            rows.ctypes.data,
        )
        return status, rows[0]

    def cast_batch(self, A: CShape, B: CShape, X_WA, X_WB, directions, limit: float = math.inf, flags: int = 0):
        """(status, rows, their statuses, number of the cast to blame)."""
        X_WA, X_WB = (_doubles(X).reshape(-1, 4, 4) for X in (X_WA, X_WB))
        directions, failed = _doubles(directions).reshape(-1, 3), c_size_t(0)
        n = max(len(X_WA), len(X_WB), len(directions))
        rows, statuses = np.full(n, 7, dtype=FIRST_CONTACT), np.full(n, -1, dtype=np.int32)
        status = library().collide_cast_batch(
            self.handle, A.handle, B.handle, Poses(X_WA.ctypes.data, len(X_WA)), Poses(X_WB.ctypes.data, len(X_WB)),
            Vectors(directions.ctypes.data, len(directions)), limit, flags, rows.ctypes.data, statuses.ctypes.data,
            failed,
        )
        return status, rows, statuses, failed.value

    def impact(self, A: CShape, B: CShape, ends, omegas=(None, None), tolerance: float = 1e-9, flags: int = 0):
        """(status, row).   ends : poses of A at times 0 and 1, then of B.   omegas : of A and of B."""
        rows, ends = np.full(1, 7, dtype=TIME_OF_IMPACT), [_doubles(X) for X in ends]
        omegas = [None if omega is None else _doubles(omega) for omega in omegas]
        at = [None if values is None else values.ctypes.data for values in (*ends, *omegas)]
        status = library().collide_impact(self.handle, A.handle, B.handle, *at, tolerance, flags, rows.ctypes.data)
        return status, rows[0]

    def impact_batch(self, A: CShape, B: CShape, ends, omegas=(None, None), tolerance: float = 1e-9, flags: int = 0):
        """(status, rows, their statuses, number of the motion to blame)."""
        ends, failed = [_doubles(X).reshape(-1, 4, 4) for X in ends], c_size_t(0)
        omegas = [np.zeros((0, 3)) if omega is None else _doubles(omega).reshape(-1, 3) for omega in omegas]
        n = max(map(len, (*ends, *omegas)))
        rows, statuses = np.full(n, 7, dtype=TIME_OF_IMPACT), np.full(n, -1, dtype=np.int32)
        motions = Motions(
            *(Poses(X.ctypes.data, len(X)) for X in ends),
            *(Vectors(omega.ctypes.data if len(omega) else None, len(omega)) for omega in omegas),
        )
        status = library().collide_impact_batch(
            self.handle, A.handle, B.handle, ctypes.byref(motions), tolerance, flags, rows.ctypes.data,
            statuses.ctypes.data, failed,
        )
        return status, rows, statuses, failed.value

    def rays(self, shape, X_WA, origins, directions, limit: float = math.inf, flags: int = 0):
        """(status, rows, their statuses, number of the ray to blame).

        shape : a `CShape`, `CMesh`, `CCompound` or `CField`.
        """
        X_WA, failed = _doubles(X_WA).reshape(-1, 4, 4), c_size_t(0)
        origins, directions = (_doubles(values).reshape(-1, 3) for values in (origins, directions))
        n = max(len(X_WA), len(origins), len(directions))
        rows, statuses = np.full(n, 7, dtype=RAY_HIT), np.full(n, -1, dtype=np.int32)
        name = {CMesh: "mesh_", CCompound: "compound_", CField: "field_"}.get(type(shape), "")
        status = getattr(library(), f"collide_{name}raycast")(
            self.handle, shape.handle, Poses(X_WA.ctypes.data, len(X_WA)), Vectors(origins.ctypes.data, len(origins)),
            Vectors(directions.ctypes.data, len(directions)), limit, flags, rows.ctypes.data, statuses.ctypes.data,
            failed,
        )
        return status, rows, statuses, failed.value

    def compounds(self, A: CCompound, B: CCompound, X_WA, X_WB, *, boolean: bool, flags: int = 0, limit=math.inf):
        """(status, answers, number of the pair to blame)."""
        X_WA, X_WB, failed = _doubles(X_WA).reshape(-1, 4, 4), _doubles(X_WB).reshape(-1, 4, 4), c_size_t(0)
        n = max(len(X_WA), len(X_WB)) if len(X_WA) and len(X_WB) else 0
        out = np.full(n, 7, dtype=np.uint8) if boolean else np.zeros(n, dtype=PAIR_DTYPE)
        poses = Poses(X_WA.ctypes.data, len(X_WA)), Poses(X_WB.ctypes.data, len(X_WB))
        rest = [flags] if boolean else [limit, flags]
        function = getattr(library(), f"collide_compound_{'collide' if boolean else 'distance'}")
        status = function(self.handle, A.handle, B.handle, *poses, *rest, out.ctypes.data, failed)
        return status, out.astype(bool) if boolean else out, failed.value

    def many_contacts(self, A, B, X_WA, X_WB, margin: float, max_contacts: int, *, capacity=1024, flags: int = 0):
        """(status, rows that there is room for, how many there are): meshes, unions, a mesh and a shape."""
        rows, count = np.full(max(capacity, 1), 7, dtype=CONTACT_DTYPE), c_size_t()
        X_WA, X_WB = _doubles(X_WA), _doubles(X_WB)
        name = "collide_mesh_contacts" if isinstance(B, CMesh) else "collide_compound_contacts"
        name = "collide_mesh_shape_contacts" if isinstance(B, CShape) else name
        name = "collide_field_contacts" if isinstance(A, CField) else name
        status = getattr(library(), name)(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, margin, max_contacts, flags,
            rows.ctypes.data, capacity, count,
        )
        return status, rows[: min(count.value, capacity)], count.value

    def mesh_shape(self, A: CMesh, B: CShape, X_WA, X_WB, flags: int = 0):
        """(status, whether they meet, status, row)."""
        hit, rows, X_WA, X_WB = c_int(7), np.full(1, 7, dtype=PAIR_DTYPE), _doubles(X_WA), _doubles(X_WB)
        asked = self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, flags
        status = library().collide_mesh_shape_collide(*asked, hit)
        return status, bool(hit.value), library().collide_mesh_shape_distance(*asked, rows.ctypes.data), rows

    def meshes_meet(self, A: CMesh, B: CMesh, X_WA, X_WB, flags: int = 0) -> tuple[int, bool]:
        hit, X_WA, X_WB = c_int(), _doubles(X_WA), _doubles(X_WB)
        status = library().collide_mesh_collide(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, flags, hit
        )
        return status, bool(hit.value)

    def mesh_gap(self, A: CMesh, B: CMesh, X_WA, X_WB, flags: int = 0) -> tuple[int, np.ndarray]:
        rows, X_WA, X_WB = np.zeros(1, dtype=PAIR_DTYPE), _doubles(X_WA), _doubles(X_WB)
        status = library().collide_mesh_distance(
            self.handle, A.handle, B.handle, X_WA.ctypes.data, X_WB.ctypes.data, flags, rows.ctypes.data
        )
        return status, rows

    def field_meets(self, F: CField, S: CShape, X_WF, X_WS, flags: int = 0) -> tuple[int, bool]:
        hit, X_WF, X_WS = c_int(), _doubles(X_WF), _doubles(X_WS)
        status = library().collide_field_collide(
            self.handle, F.handle, S.handle, X_WF.ctypes.data, X_WS.ctypes.data, flags, hit
        )
        return status, bool(hit.value)

    def field_gap(self, F: CField, S: CShape, X_WF, X_WS, flags: int = 0, limit: float = math.inf):
        """(status, row)."""
        rows, X_WF, X_WS = np.zeros(1, dtype=PAIR_DTYPE), _doubles(X_WF), _doubles(X_WS)
        status = library().collide_field_distance(
            self.handle, F.handle, S.handle, X_WF.ctypes.data, X_WS.ctypes.data, limit, flags, rows.ctypes.data
        )
        return status, rows

    def field_batch(self, F: CField, S: CShape, X_WF, X_WS, *, boolean: bool, flags: int = 0, limit: float = math.inf):
        """(status, answers, statuses of rows, number of the pair to blame)."""
        X_WF, X_WS, failed = _doubles(X_WF).reshape(-1, 4, 4), _doubles(X_WS).reshape(-1, 4, 4), c_size_t(0)
        n = max(len(X_WF), len(X_WS)) if len(X_WF) and len(X_WS) else 0
        out, statuses = np.zeros(n, dtype=np.uint8 if boolean else PAIR_DTYPE), np.full(n, -1, dtype=np.int32)
        poses = Poses(X_WF.ctypes.data, len(X_WF)), Poses(X_WS.ctypes.data, len(X_WS))
        if boolean:
            status = library().collide_field_collide_batch(
                self.handle, F.handle, S.handle, *poses, flags, out.ctypes.data, failed
            )
            return status, out.astype(bool), statuses, failed.value
        status = library().collide_field_distance_batch(
            self.handle, F.handle, S.handle, *poses, limit, flags, out.ctypes.data, statuses.ctypes.data, failed
        )
        return status, out, statuses, failed.value

    def batch(self, asked, X_WA, X_WB, *, boolean: bool, flags: int = 0, limit: float = math.inf, axes=None):
        """(status, answers, number of the pair to blame). asked : (A, B), or (set, (n, 2) numbers)."""
        X_WA, X_WB, failed = _doubles(X_WA).reshape(-1, 4, 4), _doubles(X_WB).reshape(-1, 4, 4), c_size_t(0)
        one, other = asked
        if isinstance(one, CSet):
            which = np.ascontiguousarray(other, dtype=np.int64)
            n, first, name = len(which), [one.handle, which.ctypes.data, len(which)], "each"
        else:
            n, first, name = max(len(X_WA), len(X_WB)), [one.handle, other.handle], "batch"
        out = np.zeros(n, dtype=np.uint8 if boolean else PAIR_DTYPE)
        rest = [flags, None if axes is None else axes.ctypes.data] if boolean else [limit, flags]
        function = getattr(library(), f"collide_{'collide' if boolean else 'distance'}_{name}")
        poses = Poses(X_WA.ctypes.data, len(X_WA)), Poses(X_WB.ctypes.data, len(X_WB))
        status = function(self.handle, *first, *poses, *rest, out.ctypes.data, failed)
        return status, out.astype(bool) if boolean else out, failed.value


class CRobot:
    """A robot from the bytes of a file, with a workspace; questions answer (statuses, answers …)."""

    def __init__(self, content: bytes):
        status, self.handle = raw_robot(content)
        assert status == OK, library().collide_status_text(status)
        self.workspace = raw_handle("collide_robot_workspace_create", self.handle)
        self.columns = library().collide_robot_columns(self.handle)
        self._free = library().collide_robot_workspace_free, library().collide_robot_free

    def __del__(self):
        if getattr(self, "workspace", None):
            self._free[0](self.workspace)
            self._free[1](self.handle)

    def _asked(self, name: str, n: int, *arguments) -> np.ndarray:
        """Statuses of n answers; whether function and statuses agree is looked at."""
        statuses, failed = np.full(n, -1, dtype=np.int32), c_size_t(77)
        given = [a.ctypes.data if isinstance(a, np.ndarray) else a for a in arguments]
        status = getattr(library(), f"collide_robot_{name}")(self.workspace, *given, statuses.ctypes.data, failed)
        wrong = np.flatnonzero(statuses)
        assert status == (statuses[wrong[0]] if len(wrong) else OK), (name, status)
        assert failed.value == (wrong[0] if len(wrong) else 0)
        return statuses

    def move(self, bodies: list[int], X_WBs: np.ndarray) -> tuple[int, int]:
        """(status, number of the first to blame) of bodies around given other poses (n, 4, 4)."""
        failed, numbers = c_size_t(77), np.array(bodies, dtype=np.int32)
        given = numbers.ctypes.data, len(bodies), _doubles(np.asarray(X_WBs)).ctypes.data
        return library().collide_robot_move_around(self.workspace, *given, failed), failed.value

    def attach(
        self, body: int, compound: CCompound, X_LS: np.ndarray, padding: float = 0.0, touch: tuple[int, ...] = ()
    ) -> tuple[int, int]:
        """(status, number of the object)."""
        number, names = c_int(77), np.array(touch, dtype=np.int32)
        given = compound.handle, _doubles(X_LS).ctypes.data, padding, names.ctypes.data, len(names)
        return library().collide_robot_attach(self.workspace, body, *given, number), number.value

    def detach(self, number: int) -> int:
        return library().collide_robot_detach(self.workspace, number)

    def allow(self, *pairs: tuple[int, int]) -> int:
        numbers = np.array(pairs, dtype=np.int32)
        return library().collide_robot_allow(self.workspace, numbers.ctypes.data, len(pairs))

    def pose(self, body: int) -> np.ndarray:
        X_WB = np.full((4, 4), 7.0)
        assert library().collide_robot_pose_around(self.workspace, body, X_WB.ctypes.data) == OK
        return X_WB

    def collides(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        hits = np.full(len(q), 7, dtype=np.uint8)
        return self._asked("collide", len(q), _doubles(q), len(q), hits), hits

    def distances(self, q: np.ndarray, limit: float = math.inf, between: int = 3) -> tuple:
        rows, gradients = np.zeros(len(q), dtype=PAIR_DTYPE), np.full((len(q), self.columns), 7.0)
        return self._asked("distance", len(q), _doubles(q), len(q), limit, between, rows, gradients), rows, gradients

    def near(self, q: np.ndarray, limit: float, between: int = 3, capacity: int = 20_000) -> tuple:
        rows, gradients = np.zeros(capacity, dtype=PAIR_DTYPE), np.full((capacity, self.columns), 7.0)
        starts = np.full(len(q) + 1, 7, dtype=np.uint64)
        statuses = self._asked(
            "near", len(q), _doubles(q), len(q), limit, between, rows, gradients, capacity, starts
        )
        starts = starts.astype(np.int64)
        return statuses, rows[: starts[-1]], gradients[: starts[-1]], starts

    def certify(self, q0: np.ndarray, q1: np.ndarray, resolution: float) -> tuple:
        verdicts, times = np.full(len(q0), 7, dtype=np.uint8), np.full(len(q0), 7.0)
        asked = _doubles(q0), _doubles(q1), len(q0), resolution, verdicts, times
        return self._asked("certify", len(q0), *asked), verdicts, times

    def sample(self, q0: np.ndarray, q1: np.ndarray, resolution: float) -> tuple:
        hits, times = np.full(len(q0), 7, dtype=np.uint8), np.full(len(q0), 7.0)
        return self._asked("sample", len(q0), _doubles(q0), _doubles(q1), len(q0), resolution, hits, times), hits, times


def raw_handle(function: str, handle: int) -> int:
    """What a function makes of a handle."""
    status, made = raw_shape(function, handle)
    assert status == OK and made is not None, library().collide_status_text(status)
    return made


def raw_robot(content: bytes) -> tuple[int, int | None]:
    """(status, handle) of a robot from the bytes of a file."""
    out = c_void_p()
    return library().collide_robot_read(content, len(content), ctypes.byref(out)), out.value


# --- poses ----------------------------------------------------------------------------------------------------------


def identity_at(*xyz: float) -> np.ndarray:
    """A pose that is a shift [m]."""
    X = np.eye(4)
    X[:3, 3] = xyz
    return X


def odd_poses() -> list[np.ndarray]:
    """Matrices that are no poses, or only with ``check_poses=False``."""
    poses = [np.eye(4) for _ in range(9)]
    poses[0][0, 0] = math.nan
    poses[1][2, 3] = math.inf
    poses[2][3, 3] = 2.0
    poses[3][3, 0] = 1e-300
    poses[4][0, 0] = -1.0  # mirrors
    poses[5][0, 1] = 1.01e-4
    poses[6][1, 3] = 1.1e50
    poses[7][:3, :3] *= 2.0
    poses[8][:3, :3] = 0.0
    return poses
