"""Findings in the calls of simulators: pybullet, MuJoCo, Drake, Rapier."""

from __future__ import annotations

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.snippet_parts import Asked, numbers, rotation
from collide.adapters.peers.mujoco_peer import plane_pose
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.adapters.peers.question import corners
from collide.adapters.peers.rapier_peer import X_ALONG_Y, rapier_reach
from collide.shapes import Box, Capsule, Cone, ConvexHull, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

# --- pybullet ---------------------------------------------------------------------------------------


def pybullet_lines(asked: Asked) -> list[str]:
    """A program for pybullet."""
    lines = ["import pybullet as p", "", "p.connect(p.DIRECT)", "def body(**shape):"]
    lines += ["    made = p.createMultiBody(0, p.createCollisionShape(**shape))"]
    lines += [] if asked.setting == "margins" else ["    p.changeDynamics(made, -1, collisionMargin=0.0)"]
    lines += ["    return made"]
    for letter, body in zip("AB", asked.case.bodies):
        shape, X = body.shape, body.X_WB.copy()
        if isinstance(shape, Halfspace):
            length = float(np.linalg.norm(shape.normal))
            X[:3, 3] = X[:3, :3] @ (shape.normal / length * shape.offset / length) + X[:3, 3]
        lines.append(f"{letter} = body({_bullet_shape(shape)})")
        pose = f"{numbers(X[:3, 3])}, {numbers(np.array(quaternion_xyzw(X[:3, :3])))}"
        lines.append(f"p.resetBasePositionAndOrientation({letter}, {pose})")
    lines += [
        "contacts = p.getClosestPoints(A, B, 1000.0)",
        asked.true_line(),
        "print('pybullet distance:', min(contact[8] for contact in contacts) if contacts else 'no contact at all')",
    ]
    if asked.points:
        lines.append("print('pybullet points:', min(contacts, key=lambda contact: contact[8])[5:7])")
    return lines


def _bullet_shape(shape: Shape) -> str:
    if isinstance(shape, Sphere):
        return f"shapeType=p.GEOM_SPHERE, radius={shape.radius!r}"
    if isinstance(shape, Box):
        return f"shapeType=p.GEOM_BOX, halfExtents={numbers(shape.size / 2)}"
    if isinstance(shape, Capsule | Cylinder):
        kind = "CAPSULE" if isinstance(shape, Capsule) else "CYLINDER"
        return f"shapeType=p.GEOM_{kind}, radius={shape.radius!r}, height={shape.length!r}"
    if isinstance(shape, Halfspace):
        return f"shapeType=p.GEOM_PLANE, planeNormal={numbers(shape.normal / np.linalg.norm(shape.normal))}"
    if isinstance(shape, Mesh):
        return (
            f"shapeType=p.GEOM_MESH, vertices={numbers(shape.vertices)}, "
            f"indices={numbers(shape.faces.ravel())}, flags=p.GEOM_FORCE_CONCAVE_TRIMESH"
        )
    points = corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return f"shapeType=p.GEOM_MESH, vertices={numbers(points[0])}"


# --- MuJoCo -----------------------------------------------------------------------------------------


def mujoco_lines(asked: Asked) -> list[str]:
    """A program for MuJoCo."""
    case, setting = asked.case, asked.setting
    solver = " | mujoco.mjtDisableBit.mjDSBL_NATIVECCD" if "libccd" in setting else ""
    lines = ["import mujoco", "import numpy as np", "", "spec = mujoco.MjSpec()"]
    lines += [f"spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD{solver}"]
    for letter, body in zip("AB", case.bodies):
        geom, points = _mujoco_geom(letter, body.shape)
        if points is not None:
            lines.append(
                f"mesh = spec.add_mesh(name='{letter}', inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX); "
                f"mesh.uservert = {numbers(points.ravel())}"
            )
        X_WG = body.X_WB @ plane_pose(body.shape) if isinstance(body.shape, Halfspace) else body.X_WB
        x, y, z, w = quaternion_xyzw(X_WG[:3, :3])
        place = f"pos={numbers(X_WG[:3, 3])}, quat={[w, x, y, z]!r}"
        lines += [f"{letter} = spec.worldbody.add_body(name='{letter}', {place})"]
        lines += [f"{letter}.add_geom(name='{letter}', {geom})"]
    lines += [
        "spec.add_pair(geomname1='A', geomname2='B', margin=0.0, gap=0.0)",
        "model = spec.compile()",
        "data = mujoco.MjData(model)",
        "mujoco.mj_kinematics(model, data)",
        asked.true_line(),
    ]
    if "distance" in setting:
        lines.append("fromto = np.zeros(6)")
        lines.append(f"print('mujoco distance:', mujoco.mj_geomDistance(model, data, 0, 1, {_far(case)!r}, fromto))")
        return [*lines, "print('mujoco points:', fromto[:3].tolist(), fromto[3:].tolist())"] if asked.points else lines
    return [
        *lines,
        "mujoco.mj_collision(model, data)",
        "print('mujoco collide:', data.ncon > 0)",
        "print('mujoco contacts:', data.contact.dist.tolist())",
    ]


def _mujoco_geom(letter: str, shape: Shape) -> tuple[str, np.ndarray | None]:
    """Arguments of add_geom, and the corners of its mesh."""
    if isinstance(shape, Sphere):
        return f"type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[{shape.radius!r}, 0, 0]", None
    if isinstance(shape, Box):
        return f"type=mujoco.mjtGeom.mjGEOM_BOX, size={numbers(shape.size / 2)}", None
    if isinstance(shape, Capsule | Cylinder):
        kind = "CAPSULE" if isinstance(shape, Capsule) else "CYLINDER"
        return f"type=mujoco.mjtGeom.mjGEOM_{kind}, size=[{shape.radius!r}, {shape.length / 2!r}, 0]", None
    if isinstance(shape, Ellipsoid):
        return f"type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size={numbers(shape.radii)}", None
    if isinstance(shape, Halfspace):
        return "type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1]", None
    points = None if isinstance(shape, Mesh) else corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return f"type=mujoco.mjtGeom.mjGEOM_MESH, meshname='{letter}'", np.unique(points[0], axis=0)


def _far(case: Case) -> float:
    """A length that the pair is surely not apart by [m], small as the peer's: libccd loses digits where it is large."""
    reach = 0.0
    for body in case.bodies[:2]:
        shape = body.shape
        if isinstance(shape, Halfspace):
            reach += 3.0 + abs(float(shape.offset)) / float(np.linalg.norm(shape.normal))
        elif isinstance(shape, Box | Ellipsoid):
            reach += float(np.sum(shape.size / 2 if isinstance(shape, Box) else shape.radii))
        elif isinstance(shape, Sphere | Capsule | Cylinder):
            reach += shape.radius + (0.0 if isinstance(shape, Sphere) else shape.length / 2)
        else:
            points = corners(shape)
            reach += float(np.linalg.norm(points[0], axis=1).max()) if points is not None else 0.0
    return 1.01 * (float(np.linalg.norm(case.bodies[0].X_WB[:3, 3] - case.bodies[1].X_WB[:3, 3])) + reach)


# --- Drake --------------------------------------------------------------------------------------------


def drake_lines(asked: Asked) -> list[str]:
    """A program for Drake's SceneGraph."""
    lines = [
        "import numpy as np", "import pydrake.geometry as g",
        "from pydrake.math import RigidTransform, RotationMatrix", "",
        'scene = g.SceneGraph(); source = scene.RegisterSource("pair")', "poses, ids = g.FramePoseVector(), []",
        "def body(shape, R, t):",
        "    frame = scene.RegisterFrame(source, g.GeometryFrame(str(len(ids))))",
        "    made = g.GeometryInstance(RigidTransform(), shape, str(len(ids)))",
        "    made.set_proximity_properties(g.ProximityProperties())",
        "    ids.append(scene.RegisterGeometry(source, frame, made)); poses.set_value(frame, RigidTransform(R, t))",
    ]
    for body in asked.case.bodies[:2]:
        X_WG = body.X_WB @ plane_pose(body.shape) if isinstance(body.shape, Halfspace) else body.X_WB
        lines.append(f"body({_drake_shape(body.shape)}, {_drake_rotation(X_WG)}, {numbers(X_WG[:3, 3])})")
    lines += [
        "context = scene.CreateDefaultContext()",
        "scene.get_source_pose_port(source).FixValue(context, poses)",
        "query = scene.get_query_output_port().Eval(context)",
        asked.true_line(),
    ]
    if asked.setting == "penetration":
        return [*lines, "print('drake depths:', [pair.depth for pair in query.ComputePointPairPenetration()])"]
    if asked.points:
        return [
            *lines, "pair = query.ComputeSignedDistancePairClosestPoints(*ids)",
            "A, B = (query.GetPoseInWorld(i).multiply(p).tolist() for i, p in zip(ids, (pair.p_ACa, pair.p_BCb)))",
            "print('drake points:', A, B)",
        ]
    return [
        *lines, "print('drake collide:', query.HasCollisions(), flush=True)",
        "print('drake distance:', query.ComputeSignedDistancePairClosestPoints(*ids).distance)",
    ]


def _drake_rotation(X: np.ndarray) -> str:
    """As the peer gives it: projected where Drake would find it no rotation."""
    R = X[:3, :3]
    is_rotation = np.abs(R @ R.T - np.eye(3)).max() <= 128 * np.finfo(float).eps
    return f"RotationMatrix({rotation(X)})" if is_rotation else (
        f"RotationMatrix.ProjectToRotationMatrix({rotation(X)})")


def _drake_shape(shape: Shape) -> str:
    if isinstance(shape, Sphere):
        return f"g.Sphere({shape.radius!r})"
    if isinstance(shape, Box):
        return f"g.Box({', '.join(map(repr, shape.size.tolist()))})"
    if isinstance(shape, Capsule | Cylinder):
        return f"g.{type(shape).__name__}({shape.radius!r}, {shape.length!r})"
    if isinstance(shape, Ellipsoid):
        return f"g.Ellipsoid({', '.join(map(repr, shape.radii.tolist()))})"
    if isinstance(shape, Halfspace):
        return "g.HalfSpace()"
    points = None if isinstance(shape, Mesh) else corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return f"g.Convex(points=np.array({numbers(points[0])}).T, label='hull')"


# --- Rapier -------------------------------------------------------------------------------------------


def rapier_lines(asked: Asked) -> list[str]:
    """A program for Rapier's manifolds; KeyError for its casts and its nearest points, which have none."""
    if asked.setting or asked.points:
        raise KeyError(asked.setting)
    bodies = asked.case.bodies[:2]
    lines = [
        "import rapier3d as r", "",
        "def world(*placed):",
        "    made, kinds = r.PhysicsWorld(), r.ActiveCollisionTypes.all()",
        "    of = [r.Collider.new(shape).position(X).active_collision_types(kinds) for shape, X in placed]",
        "    return made, [made.add_collider(collider) for collider in of]",
    ]
    for letter, body in zip("AB", bodies):
        shape, X_BS = _rapier_shape(body.shape)
        x, y, z, w = quaternion_xyzw((body.X_WB @ X_BS)[:3, :3])
        t = ", ".join(map(repr, (body.X_WB @ X_BS)[:3, 3].tolist()))
        lines.append(f"{letter} = r.SharedShape.{shape}, r.Isometry3(r.Vec3({t}), r.Rotation3({w}, {x}, {y}, {z}))")
    lines += [
        asked.true_line(), "only_A, _ = world(A); hits = []",
        "only_A.detect_collisions(); only_A.update_query_pipeline()",
        "only_A.query_pipeline.intersect_shape(B[1], B[0], lambda handle: hits.append(handle) or True)",
        "print('rapier collide:', bool(hits), flush=True)",
    ]
    if any(isinstance(body.shape, Mesh) for body in bodies):
        return lines
    X_WA, X_WB = (body.X_WB @ _rapier_shape(body.shape)[1] for body in bodies)
    farthest = 1.01 * (float(np.linalg.norm(X_WA[:3, 3] - X_WB[:3, 3])) + sum(rapier_reach(b.shape) for b in bodies))
    return [
        *lines, "both, (a, b) = world(A, B)",
        f"both.collision_pipeline.step({farthest!r}, both.islands, both.broad_phase, both.narrow_phase,",
        "                             both.rigid_bodies, both.colliders)",
        "pair = both.narrow_phase.contact_pair(a, b)",
        "distances = [point.dist for manifold in (pair.manifolds if pair else ()) for point in manifold.points]",
        "print('rapier distance:', min(distances, default=float('inf')))",
    ]


def _rapier_shape(shape: Shape) -> tuple[str, np.ndarray]:
    """The call that makes a shape, and the pose (4, 4) of Rapier's in it."""
    if isinstance(shape, Sphere):
        return f"ball({shape.radius!r})", np.eye(4)
    if isinstance(shape, Box):
        return f"cuboid({', '.join(map(repr, (shape.size / 2).tolist()))})", np.eye(4)
    if isinstance(shape, Capsule):
        return f"capsule_z({shape.length / 2!r}, {shape.radius!r})", np.eye(4)
    if isinstance(shape, Cylinder | Cone):
        return f"{type(shape).__name__.lower()}({shape.length / 2!r}, {shape.radius!r})", X_ALONG_Y
    if isinstance(shape, Halfspace):
        return "halfspace((0.0, 0.0, 1.0))", plane_pose(shape)
    if isinstance(shape, Mesh):
        return f"trimesh({numbers(shape.vertices)}, {numbers(shape.faces)})", np.eye(4)
    points = corners(shape)
    if points is None:
        raise KeyError(type(shape).__name__)
    if isinstance(shape, ConvexHull) and shape.radius:
        return f"round_convex_hull({numbers(points[0])}, {shape.radius!r})", np.eye(4)
    return f"convex_hull({numbers(points[0])})", np.eye(4)
