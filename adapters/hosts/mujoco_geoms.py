"""Geoms of a MuJoCo model as shapes, and the tables that the hook reads.

Planes are half-spaces, meshes their convex hulls, height fields reach down to their base, as in MuJoCo. MuJoCo keeps
vertices and heights in single precision: those numbers are taken as they are.
"""

from __future__ import annotations

import ctypes
import itertools
from typing import Any, NamedTuple

import numpy as np

from collide import ConvexHull, Shape, Sphere
from collide.adapters.hosts.mujoco_layout import FIELD, KINDS, OURS, PLANE, N, check_model
from collide.adapters.hosts.mujoco_limits import max_contacts
from collide.contact.contact_rows import CONTACT_DTYPE
from collide.contact.convex_manifolds import HEADER
from collide.contact.support_face import ROUND
from collide.errors import CollideError, InvalidShape
from collide.lowering.hull_faces import FACE_INTS, HullFaceTable, face_table_of
from collide.lowering.parts import convex_set_of
from collide.lowering.shape_table import RADIUS, REACH, ShapeTable
from collide.scenes.loaders.mjcf_geoms import shape_of


class GeomShapes(NamedTuple):
    """Shapes of a model's geoms.

    shapes : each once.   rows : (n_geoms,) int64, which one; −1 of geoms that are left to MuJoCo.
    remaining : why these are, geom by geom.
    """

    shapes: list[Shape]
    rows: np.ndarray
    remaining: dict[int, str]


def geom_shapes(model, with_fields: bool = True) -> GeomShapes:
    """Shapes of all geoms. Raises InvalidShape, naming the geom, where its numbers make none.

    with_fields : without, height fields have no shape, and row −1: the hook reads their heights itself.
    """
    shapes: list[Shape] = []
    known: dict = {}
    rows = np.full(model.ngeom, -1, dtype=np.int64)
    remaining = {}
    for geom in range(model.ngeom):
        kind = int(model.geom_type[geom])
        if kind not in OURS:
            remaining[geom] = f"{KINDS[kind] if kind < N else f'geoms of kind {kind}'}: left to MuJoCo"
            continue
        name = KINDS[kind]
        if kind == FIELD and not with_fields:
            continue
        numbers = int(model.geom_dataid[geom]) if name in ("mesh", "hfield") else model.geom_size[geom].tobytes()
        key = (kind, 0 if kind == PLANE else numbers)
        if key not in known:
            known[key] = len(shapes)
            try:
                shapes.append(_shape(model, geom, name))
            except CollideError as error:
                raise InvalidShape(f"geom {geom} ({model.geom(geom).name or 'no name'}), a {name}: {error}") from None
        rows[geom] = known[key]
    return GeomShapes(shapes, rows, remaining)


def _shape(model, geom: int, name: str) -> Shape:
    return ConvexHull(_hull_vertices(model, int(model.geom_dataid[geom]))) if name == "mesh" else shape_of(model, geom)


def _hull_vertices(model, mesh: int) -> np.ndarray:
    """Vertices of the hull that MuJoCo collides, or all where it made none."""
    first, n = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.array(model.mesh_vert[first : first + n], dtype=np.float64)
    graph = int(model.mesh_graphadr[mesh])
    if graph < 0:
        return vertices
    n_hull = int(model.mesh_graph[graph])
    return vertices[model.mesh_graph[graph + 2 + n_hull : graph + 2 + 2 * n_hull]]


#: Directions in which vertices of hulls are looked up: where a search for another direction begins.
_DIRECTIONS = np.array([d for d in itertools.product((-1.0, 0.0, 1.0), repeat=3) if np.count_nonzero(d) in (1, 3)])


def _boxes_and_extremes(table: ShapeTable, faces: HullFaceTable) -> tuple[np.ndarray, np.ndarray]:
    """((n, 6) middles and half sides of boxes around hulls, (n, 14) vertices farthest along `_DIRECTIONS`); else 0."""
    boxes, extremes = np.zeros((len(table.packed), 6)), np.zeros((len(table.packed), 14), dtype=np.int64)
    for k, (packed, of_hull) in enumerate(zip(table.packed, faces.faces)):
        if of_hull is not None:
            low, high = packed.points.min(axis=0), packed.points.max(axis=0)
            boxes[k] = *(0.5 * (low + high)), *(0.5 * (high - low) + packed.radius)
            ids = of_hull.arrays.vertex_ids  # points within faces are no vertices, and have no edges to go on along
            extremes[k] = ids[(packed.points[ids] @ _DIRECTIONS.T).argmax(axis=0)]
    return boxes, extremes


class Model(ctypes.Structure):
    """`collide_mujoco_model` of native/host_mujoco.h."""

    _fields_ = [
        ("model", ctypes.c_void_p), ("signature", ctypes.c_uint64), ("n_geoms", ctypes.c_int64),
        ("is_cull", ctypes.c_int64),
        *((name, ctypes.c_void_p) for name in (
            "rows", "types", "dataids", "sizes", "reaches", "vertices", "vertex_starts", "vertex_counts", "fields",
            "ints", "numbers", "faces", "boxes", "extremes",
        )),
        *((name, ctypes.c_int64) for name in ("largest", "face_ints", "manifold_header", "contact_bytes")),
        ("max_contacts", ctypes.c_int64 * (N * N)),
    ]


class ModelTables:
    """What the hook reads of one model, held as long as this lives.

    made : the `Model` of C.   remaining : geoms that are left to MuJoCo, and why.
    """

    def __init__(self, model, is_cull: bool):
        check_model(model)
        shapes, rows, self.remaining = geom_shapes(model, with_fields=False)
        table = ShapeTable([convex_set_of(shape) for shape in shapes] or [convex_set_of(Sphere(1.0))])
        table.build_trees(np.arange(len(table.ints)))
        faces = face_table_of(table, ROUND)
        reach = np.append(table.numbers[:, REACH] + table.numbers[:, RADIUS], 0.0)
        arrays = {
            "rows": rows,
            "types": np.array(model.geom_type, dtype=np.int32),
            "dataids": np.array(model.geom_dataid, dtype=np.int32),
            "sizes": np.array(model.geom_size, dtype=np.float64),
            "reaches": np.where(np.array(model.geom_type) == PLANE, 0.0, reach[rows]),
            "vertices": np.array(model.mesh_vert, dtype=np.float32),
            "vertex_starts": np.array(model.mesh_vertadr, dtype=np.int32),
            "vertex_counts": np.array(model.mesh_vertnum, dtype=np.int32),
            "fields": np.stack([model.hfield_nrow, model.hfield_ncol, model.hfield_adr], axis=1).astype(np.int64),
            "ints": table.ints,
            "numbers": table.numbers,
            "faces": faces.ints,
        }
        arrays["boxes"], arrays["extremes"] = _boxes_and_extremes(table, faces)
        self._held: tuple[Any, ...] = (model, table, faces, arrays)
        counts = max_contacts((int(model.opt.disableflags), int(model.opt.enableflags)))
        self.made = Model(
            model=model._address, signature=model.signature, n_geoms=model.ngeom, is_cull=is_cull,
            largest=faces.largest, face_ints=FACE_INTS, manifold_header=HEADER, contact_bytes=CONTACT_DTYPE.itemsize,
            **{name: array.ctypes.data for name, array in arrays.items()},
        )
        self.made.max_contacts[:] = counts.ravel().tolist()
