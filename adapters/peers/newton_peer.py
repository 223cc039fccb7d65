"""Newton's narrow phase in Warp, on the CPU, in single precision: `newton.geometry.NarrowPhase` of one pair.

Its kernels are compiled at the first launch, a minute or so once a machine; then they come from Warp's cache.
"""

from __future__ import annotations

import importlib
import math
from typing import Any, NamedTuple

import numpy as np

from collide.adapters.peers.answers import Reply
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.mujoco_peer import plane_pose
from collide.adapters.peers.protocol import PairwisePeer, has_radius
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.adapters.peers.question import corners
from collide.adapters.peers.rapier_peer import rapier_reach, unit
from collide.errors import UnsupportedQuery
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

#: Contacts of a pair that there is room for.
_MAX_CONTACTS = 64


class NewtonPeer(PairwisePeer):
    """The contacts of a pair; the least separation is its distance, and a hit is one of 0 or less."""

    name, package, module = "newton", "newton", "newton"
    isolated, extra, start_timeout = True, "all-peers", 600.0
    about = "NarrowPhase.launch on the CPU; the least separation of its contacts, a hit is one of 0 or less"
    receives = (
        "all in single precision: sizes, corners, poses with unit quaternions", "hulls with faces of our own",
        "a gap larger than the distance, margin 0, none of its support tables", "no broad phase",
    )
    cannot = ("a boolean of its own", "hulls with a radius, flat hulls, two planes", "meshes: they are not asked of it")

    def prepare(self) -> None:
        quiet_warp()
        sphere, apart = self.build(Sphere(1.0)), np.eye(4)
        apart[0, 3] = 3.0
        self.ask(sphere, np.eye(4), sphere, apart)  # what it compiles is no part of a pair's time

    def refuses(self, part: Shape) -> str | None:
        if isinstance(part, Mesh):
            return "meshes are not asked of Newton"
        return "Newton has no hull with a radius" if has_radius(part) else None

    def build(self, part: Shape) -> tuple[str, tuple, Any, np.ndarray, float]:
        """Kind, three lengths, the mesh of a hull, the pose (4, 4) of the geometry in the part, how far it reaches."""
        mesh, X_PG = None, np.eye(4)
        if isinstance(part, Sphere):
            kind, scale = "SPHERE", (part.radius, 0.0, 0.0)
        elif isinstance(part, Box):
            kind, scale = "BOX", tuple(part.size / 2)
        elif isinstance(part, Ellipsoid):
            kind, scale = "ELLIPSOID", tuple(part.radii)
        elif isinstance(part, Capsule | Cylinder | Cone):
            kind, scale = type(part).__name__.upper(), (part.radius, part.length / 2, 0.0)
        elif isinstance(part, Halfspace):
            kind, scale, X_PG = "PLANE", (0.0, 0.0, 0.0), plane_pose(part)
        else:
            points = corners(part)
            if points is None:
                raise UnsupportedQuery(f"Newton has no {type(part).__name__}")
            kind, scale, mesh = "CONVEX_MESH", (1.0, 1.0, 1.0), _mesh(*triangulate(points[0]))
        reach = max(part.radii) if isinstance(part, Ellipsoid) else rapier_reach(part)
        return kind, scale, mesh, X_PG, float(reach)

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        if A[0] == B[0] == "PLANE":
            raise UnsupportedQuery("Newton has no contact of two planes")
        launch, contacts = self.launch_of(A, X_WA, B, X_WB)
        launch()
        return nearest_contact(contacts)

    def launch_of(self, A, X_WA: np.ndarray, B, X_WB: np.ndarray):
        """A launch for two geometries, whose gap is larger than their distance, and the arrays that it fills."""
        return launched(placed_pair(A, X_WA, B, X_WB))


class PlacedPair(NamedTuple):
    """Two geometries in the world, as the narrow phase takes them.

    places : positions and quaternions (x, y, z, w).   gap : larger than their distance [m].
    reaches, boxes : radii of balls and half sizes of boxes around them [m].
    """

    geometries: tuple
    places: list[tuple]
    gap: float
    reaches: list[float]
    boxes: list[float]


def placed_pair(A, X_WA: np.ndarray, B, X_WB: np.ndarray) -> PlacedPair:
    """Two built geometries at the poses (4, 4) of their parts."""
    Xs = X_WA @ A[3], X_WB @ B[3]
    between = float(np.linalg.norm(Xs[0][:3, 3] - Xs[1][:3, 3]))
    places = [(*X[:3, 3].tolist(), *map(float, quaternion_xyzw(X[:3, :3]))) for X in Xs]
    reaches = [1e6 if geometry[0] == "PLANE" else geometry[4] for geometry in (A, B)]
    return PlacedPair((A, B), places, 1.01 * (between + A[4] + B[4]), reaches, [A[4], B[4]])


def quiet_warp() -> None:
    """Warp tells of every module that it loads."""
    importlib.import_module("warp").config.quiet = True


def _mesh(points: np.ndarray, facets: np.ndarray) -> Any:
    import newton

    mesh = newton.Mesh(points.astype(np.float32), facets.ravel(), compute_inertia=False)
    mesh.finalize("cpu")
    return mesh


def launched(pair: PlacedPair):
    """A launch of the narrow phase for a pair, and the arrays that it fills."""
    import newton
    import warp as wp

    def array(values, dtype):
        return wp.array(values, dtype=dtype, device="cpu")

    kinds = [int(newton.GeoType[geometry[0]]) for geometry in pair.geometries]
    meshes = [geometry[2] for geometry in pair.geometries]
    boxes = np.repeat(pair.boxes, 3).reshape(2, 3)
    contacts = {
        "contact_pair": wp.zeros(_MAX_CONTACTS, dtype=wp.vec2i, device="cpu"),
        "contact_position": wp.zeros(_MAX_CONTACTS, dtype=wp.vec3, device="cpu"),
        "contact_normal": wp.zeros(_MAX_CONTACTS, dtype=wp.vec3, device="cpu"),
        "contact_penetration": wp.zeros(_MAX_CONTACTS, dtype=float, device="cpu"),
        "contact_count": wp.zeros(1, dtype=int, device="cpu"),
    }
    arguments = {
        "candidate_pair": array([(0, 1)], wp.vec2i), "candidate_pair_count": array([1], wp.int32),
        "shape_types": array(kinds, wp.int32),
        "shape_data": array([(*geometry[1], 0.0) for geometry in pair.geometries], wp.vec4),
        "shape_transform": array(pair.places, wp.transform),
        "shape_source": array([mesh.finalize("cpu") if mesh else 0 for mesh in meshes], wp.uint64),
        "shape_gap": array([pair.gap / 2] * 2, wp.float32), "shape_collision_radius": array(pair.reaches, wp.float32),
        "shape_flags": array([int(newton.ShapeFlags.COLLIDE_SHAPES)] * 2, wp.int32),
        "shape_collision_aabb_lower": array(-boxes, wp.vec3),
        "shape_collision_aabb_upper": array(boxes, wp.vec3),
        "shape_voxel_resolution": array([(4, 4, 4)] * 2, wp.vec3i), "device": "cpu",
    }
    narrow_phase, count = _narrow_phase(), contacts["contact_count"].numpy()

    def launch(_alive=meshes) -> None:  # the arrays hold numbers of the hulls' meshes, which must not end before
        count[0] = 0
        narrow_phase.launch(**arguments, **contacts)

    return launch, contacts


_MADE: list = []


def _narrow_phase():
    """Made once: every new one loads its kernels anew."""
    from newton.geometry import NarrowPhase

    if not _MADE:
        _MADE.append(
            NarrowPhase(
                max_candidate_pairs=1, max_triangle_pairs=1, reduce_contacts=False, device="cpu", has_meshes=False,
                verify_buffers=False,
            )
        )
    return _MADE[0]


def nearest_contact(contacts: dict) -> Reply:
    """The contact of least separation; no contact within any gap is an infinite distance."""
    n = int(contacts["contact_count"].numpy()[0])
    if not n:
        return Reply(False, math.inf)
    separations = contacts["contact_penetration"].numpy()[:n].astype(float)
    nearest = int(np.argmin(separations))
    distance = float(separations[nearest])
    normal = np.array(unit(contacts["contact_normal"].numpy()[nearest].astype(float)))
    middle = contacts["contact_position"].numpy()[nearest].astype(float)
    if tuple(contacts["contact_pair"].numpy()[nearest]) == (1, 0):
        normal = -normal
    point_a, point_b = middle - 0.5 * distance * normal, middle + 0.5 * distance * normal
    return Reply(distance <= 0.0, distance, tuple(normal), tuple(point_a), tuple(point_b))
