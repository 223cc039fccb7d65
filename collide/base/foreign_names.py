"""Names of other libraries, and what is written here instead: for messages where a name or an argument is unknown.

Box2D, Bullet, coal, Drake, fcl, MuJoCo, open3d, pybullet, scipy and trimesh are what callers come from.
"""

from __future__ import annotations

from collections.abc import Iterable

_MESH = "collide.Mesh(vertices, faces), which also takes an object with both, such as a trimesh.Trimesh"
_WORLD = "collide.World()"
_POSE = "collide.pose(xyz, rpy=..., quat_wxyz=... or R=...), a (4, 4) matrix"
_FILE = "collide.scenes.load(path), for robots, scenes and meshes alike; of a mesh .bodies[0].shape"

#: Names looked for in the package → what to write.
FOREIGN_NAMES = {
    **dict.fromkeys(("load", "load_mesh", "load_robot", "load_scene", "load_urdf", "open", "read"), _FILE),
    **dict.fromkeys(("Scene", "URDF"), _FILE),
    **dict.fromkeys(("BVHModel", "TriangleMesh", "Trimesh", "TriMesh", "BVHModelOBBRSS", "Geom"), _MESH),
    **dict.fromkeys(("Convex", "ConvexMesh", "Polytope", "Hull"), "collide.ConvexHull(points)"),
    **dict.fromkeys(("Cuboid", "OBB", "AABB", "Cube", "Rectangle"), "collide.Box((x, y, z)), of full lengths"),
    **dict.fromkeys(("Ball", "Circle"), "collide.Sphere(radius)"),
    **dict.fromkeys(("HalfSpace", "Ground", "GroundPlane"), "collide.Halfspace((0, 0, 1), 0), solid below its plane"),
    **dict.fromkeys(("Octree", "OctoMap"), "collide.OcTree"),
    **dict.fromkeys(("Terrain", "Hfield", "HField", "HeightMap", "Heightmap"), "collide.HeightField(heights, cell)"),
    **dict.fromkeys(("Union", "Shapes", "Group"), "collide.Compound([(shape, X), ...])"),
    **dict.fromkeys(
        ("Transform", "Transform3", "Transform3f", "Transform3s", "RigidTransform", "Pose", "SE3", "transform"), _POSE
    ),
    **dict.fromkeys(
        ("CollisionManager", "DynamicAABBTreeCollisionManager", "BroadPhaseManager", "Manager", "Space"), _WORLD
    ),
    "CollisionObject": f"{_WORLD}, then world.add(shape, X_WB, name=...), or a shape and a pose without a World",
    **dict.fromkeys(
        ("CollisionRequest", "CollisionResult", "DistanceRequest", "DistanceResult"),
        "collide.collide(A, B, X_WA, X_WB), .distance(...) or .contacts(...), which take no request and return results",
    ),
    **dict.fromkeys(
        ("min_distance", "signed_distance", "Distance", "compute_distance"), "collide.distance(A, B, X_WA, X_WB)"
    ),
    **dict.fromkeys(
        ("collides", "check", "check_collision", "intersect", "intersects"), "collide.collide(A, B, X_WA, X_WB)"
    ),
    **dict.fromkeys(("continuousCollide", "continuous_collide", "ccd", "toi"), "collide.time_of_impact"),
    **dict.fromkeys(("rayTest", "ray_cast", "cast_ray", "ray"), "collide.raycast"),
    **dict.fromkeys(("penetration", "manifold", "get_contacts"), "collide.contacts(A, B, X_WA, X_WB)"),
    **dict.fromkeys(("Checker", "CollisionChecker", "PlanningScene"), "collide.RobotChecker.from_scene(scene)"),
}

_RADIUS = {"r": "radius=", "R": "radius=", "diameter": "radius=diameter / 2"}
_ROUND = {
    **_RADIUS, "l": "length=", "h": "length=", "lz": "length=", "half_length": "length=2 * half_length",
    "half_height": "length=2 * half_height", "halfLength": "length=2 * halfLength",
}
_LENGTHS = {
    "extents": "size=, full lengths", "dimensions": "size=, full lengths", "sides": "size=, full lengths",
    "lengths": "size=, full lengths", "x": "size=(x, y, z), or Box(x, y, z)",
    **{
        half: f"size=2 * numpy.asarray({half}), for size holds full lengths"
        for half in ("half_extents", "halfExtents", "half_size", "half_sizes", "half_sides", "halfSide", "half_lengths")
    },
}
_NORMALS = {"n": "normal=", "d": "offset=, of all x with normal · x ≤ offset", "origin": "offset=normal · origin"}
_ROTATIONS = {
    **dict.fromkeys(
        ("quat", "quaternion", "q", "orientation"),
        "quat_wxyz= where the scalar comes first, quat_xyzw= where it comes last (ROS, scipy)",
    ),
    **dict.fromkeys(("euler", "angles", "rpy_rad"), "rpy= [rad] or rpy_deg=, about fixed x, y, z axes"),
    **dict.fromkeys(("degrees", "rpy_degrees", "euler_deg"), "rpy_deg="),
}
_TOO_MANY = ""
#: Callable → its unknown arguments → what to write; under "" what to do about more arguments than it takes.
FOREIGN_ARGUMENTS = {
    "Box": _LENGTHS,
    "Sphere": _RADIUS,
    "Capsule": _ROUND,
    "Cone": _ROUND,
    "Cylinder": _ROUND,
    "Ellipsoid": {"radius": "radii=", "semi_axes": "radii=", "axes": "radii=, half lengths", "size": "radii=size / 2"},
    "Halfspace": _NORMALS,
    "Plane": _NORMALS,
    "ConvexHull": {"vertices": "points=", "mesh": "points=mesh.vertices"},
    "Mesh": {"triangles": "faces=", "facets": "faces=", "indices": "faces=", "points": "vertices=", "file": _FILE},
    "pose": {
        **_ROTATIONS, **dict.fromkeys(("rotation", "rot", "matrix"), "R=, (3, 3)"),
        **dict.fromkeys(("position", "translation", "pos", "t", "p"), "xyz=, or the first argument"),
        _TOO_MANY: "pose(xyz, R=rotation), or rpy=, rpy_deg=, quat_wxyz= or quat_xyzw= for R=",
    },
    "poses": {
        **_ROTATIONS, **dict.fromkeys(("rotation", "matrix", "R"), "the pair (R, t), which queries take for poses"),
        **dict.fromkeys(("xyz", "position", "translation", "pos", "t"), "p=, or the first argument"),
    },
    "WorldScene.add": {
        _TOO_MANY: "World.add(shape, X_WB, name='b')",
        **dict.fromkeys(("pose", "X", "transform", "X_WA"), "X_WB="),
    },
}


def advice_on_arguments(function: str, message: str, kwargs: Iterable[str]) -> str:
    """What to write in place of arguments of a call that a function cannot take; empty where nothing is known.

    function : its qualified name.   message : of the TypeError.   kwargs : names of the call's arguments.
    """
    known = FOREIGN_ARGUMENTS.get(function.removesuffix(".__init__"), {})
    if "unexpected keyword" in message:
        return next((known[name] for name in kwargs if name in known and f"'{name}'" in message), "")
    return known.get(_TOO_MANY, "") if "positional argument" in message and "given" in message else ""


#: Methods looked for in a World → what to write.
FOREIGN_METHODS = {
    **dict.fromkeys(("add_body", "add_object", "add_shape", "addObject", "register", "registerObject"), "add"),
    **dict.fromkeys(("collide", "check", "in_collision", "is_colliding"), "collides(), or collisions() for the pairs"),
    **dict.fromkeys(("distance", "min_distance", "closest"), "minimum(), or distances(max_distance=...)"),
    **dict.fromkeys(("remove_body", "delete", "unregisterObject"), "remove"),
    **dict.fromkeys(("set_transform", "set_position", "move", "update", "setTransform"), "set_pose(body, X_WB)"),
    **dict.fromkeys(("bodies", "objects"), "names, of all ids, and body(name)"),
    **dict.fromkeys(("ignore", "disable", "disable_pair", "exclude"), "allow(a, b, reason=...)"),
    **dict.fromkeys(("rayTest", "ray_cast", "cast_ray"), "raycast"),
    **dict.fromkeys(("from_scene", "load"), "collide.scenes.load(path).world()"),
}


def advice_on_name(name: str, known: Iterable[str]) -> str:
    """What to write in place of a name unknown to the package, for a message; empty where nothing is near.

    known : the package's names; the nearest is proposed.
    """
    if name in FOREIGN_NAMES:
        return f": write {FOREIGN_NAMES[name]}"
    near = _nearest(name, known)
    return f": did you mean collide.{near}?" if near else ""


def advice_on_method(name: str, known: Iterable[str]) -> str:
    """As `advice_on_name`, of a World's methods."""
    if name in FOREIGN_METHODS:
        return f": write {FOREIGN_METHODS[name]}"
    near = _nearest(name, known)
    return f": did you mean {near}?" if near else ""


def _nearest(name: str, known: Iterable[str]) -> str:
    """The known name nearest to a name, whatever its case and underscores; empty where nothing is near."""
    import difflib

    lower = {entry.lower().replace("_", ""): entry for entry in known}
    near = difflib.get_close_matches(name.lower().replace("_", ""), list(lower), 1, 0.75)
    return lower[near[0]] if near else ""


def advice_on_shape(value: object) -> str:
    """How the mesh of another library becomes a shape, for a message; empty for anything else."""
    if isinstance(value, str):
        return "; of a file the shape is collide.scenes.load(path).bodies[0].shape"
    if hasattr(value, "vertices") and hasattr(value, "faces"):  # trimesh
        return "; a mesh of another library becomes one by collide.Mesh(mesh)"
    if hasattr(value, "vertices") and hasattr(value, "triangles"):  # open3d
        return "; a mesh of another library becomes one by collide.Mesh(mesh.vertices, mesh.triangles)"
    return ""
