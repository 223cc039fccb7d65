"""A finding in the peer's own calls: 20 lines at most, needing the peer and numpy alone, for its issue tracker.

Each prints what the peer answers beside what is true, and asks exactly what the protocol's peer asks.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from collide.adapters.fuzzing.disagreements import Flaw
from collide.adapters.fuzzing.fuzz_case import Case
from collide.adapters.fuzzing.proofs import expected_text
from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.fcl_peer import FclPeer
from collide.adapters.peers.hull_facets import triangulate
from collide.adapters.peers.pybullet_peer import quaternion_xyzw
from collide.adapters.peers.question import corners
from collide.errors import CollideError
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Halfspace, Mesh, Shape, Sphere

MAX_LINES = 20
#: Points and facets above which a snippet would not be read.
MAX_ROWS = 120


def snippet(flaw: Flaw, case: Case, known: dict[str, Any]) -> str | None:
    """Python for one finding; None for engines without a form here, Worlds, and shapes of too many numbers.

    known : as `proofs.proof` gives it.
    """
    name, _, setting = flaw.engine.partition(":")
    if name not in _ENGINES or case.world or any(_n_rows(body.shape) > MAX_ROWS for body in case.bodies[:2]):
        return None
    try:
        lines = _ENGINES[name](case, setting, expected_text(known))
    except (CollideError, KeyError):
        return None  # a shape that the peer cannot be given
    assert len(lines) <= MAX_LINES, lines
    return "\n".join(lines) + "\n"


def _n_rows(shape: Shape) -> int:
    if isinstance(shape, Mesh):
        return len(shape.vertices) + len(shape.faces)
    points = None if isinstance(shape, Halfspace) else corners(shape)
    return 0 if points is None else len(points[0])


def _numbers(array) -> str:
    return repr(np.asarray(array).tolist())


def _poses(case: Case) -> list[str]:
    """Lines that define R and t of both bodies."""
    return [
        line
        for letter, body in zip("AB", case.bodies)
        for line in (f"R_{letter}, t_{letter} = {_rotation(body.X_WB)}, np.array({_numbers(body.X_WB[:3, 3])})",)
    ]


def _rotation(X: np.ndarray) -> str:
    return "np.eye(3)" if np.array_equal(X[:3, :3], np.eye(3)) else f"np.array({_numbers(X[:3, :3])})"


def _unit(shape: Halfspace) -> tuple[str, float]:
    length = float(np.linalg.norm(shape.normal))
    return f"np.array({_numbers(shape.normal / length)})", float(shape.offset / length)


def _primitive(module: str, shape: Shape) -> str | None:
    """The call that makes a shape which fcl and coal both have under the same name."""
    if isinstance(shape, Sphere):
        return f"{module}.Sphere({shape.radius!r})"
    if isinstance(shape, Box):
        return f"{module}.Box({', '.join(map(repr, shape.size.tolist()))})"
    for kind in (Capsule, Cylinder, Cone):
        if isinstance(shape, kind):
            return f"{module}.{kind.__name__}({shape.radius!r}, {shape.length!r})"
    if isinstance(shape, Ellipsoid):
        return f"{module}.Ellipsoid({', '.join(map(repr, shape.radii.tolist()))})"
    if isinstance(shape, Halfspace):
        normal, offset = _unit(shape)
        return f"{module}.Halfspace({normal}, {offset!r})"
    return None


# --- fcl --------------------------------------------------------------------------------------------


def _fcl(case: Case, setting: str, expected: str) -> list[str]:
    lines = ["import fcl", "import numpy as np", ""]
    for letter, body in zip("AB", case.bodies):
        lines += _fcl_shape(letter, body.shape)
    flat = any(isinstance(body.shape, Halfspace) for body in case.bodies[:2])
    lines += _poses(case)
    lines += [
        "a = fcl.CollisionObject(A, fcl.Transform(R_A, t_A))",
        "b = fcl.CollisionObject(B, fcl.Transform(R_B, t_B))",
        f"print({f'true: {expected}'!r}, flush=True)",
    ]
    if setting:
        solver = FclPeer.settings[setting].values["solver"]
        return [
            *lines,
            f"request = fcl.CollisionRequest(8, True, gjk_solver_type=fcl.GJKSolverType.{solver})",
            "result = fcl.CollisionResult()",
            "print('fcl collide:', fcl.collide(a, b, request, result) > 0)",
            "print('fcl depths:', [contact.penetration_depth for contact in result.contacts])",
        ]
    lines.append(
        "print('fcl collide:', fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0, flush=True)"
    )
    if not flat:
        lines += [
            "request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)",
            "print('fcl distance:', fcl.distance(a, b, request, fcl.DistanceResult()))",
        ]
    return lines


def _fcl_shape(letter: str, shape: Shape) -> list[str]:
    made = _primitive("fcl", shape)
    if made is not None:
        return [f"{letter} = {made}"]
    if isinstance(shape, Mesh):
        return [
            f"{letter} = fcl.BVHModel()",
            f"{letter}.beginModel({len(shape.vertices)}, {len(shape.faces)})",
            f"{letter}.addSubModel(np.array({_numbers(shape.vertices)}), np.array({_numbers(shape.faces)}))",
            f"{letter}.endModel()",
        ]
    vertices, triangles = _hull(shape)
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return [f"{letter} = fcl.Convex(np.array({_numbers(vertices)}), {len(triangles)}, np.array({_numbers(faces)}))"]


def _hull(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    points = corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return triangulate(points[0])


# --- coal -------------------------------------------------------------------------------------------


def _coal(case: Case, setting: str, expected: str) -> list[str]:
    lines = ["import coal", "import numpy as np", ""]
    meshed = any(isinstance(body.shape, Mesh) for body in case.bodies[:2])
    hulls = any(_primitive("coal", body.shape) is None and not isinstance(body.shape, Mesh) for body in case.bodies[:2])
    if hulls:
        lines += [
            "def hull(points, faces):",
            "    corners, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()",
            "    corners.extend(np.array(points))",
            "    triangles.extend([coal.Triangle(*face) for face in faces])",
            "    return coal.Convex(corners, triangles)",
        ]
    for letter, body in zip("AB", case.bodies):
        lines += _coal_shape(letter, body.shape)
    lines += _poses(case)
    lines += [
        "X_A, X_B = coal.Transform3s(R_A, t_A), coal.Transform3s(R_B, t_B)",
        "boolean, number = coal.CollisionRequest(), coal.DistanceRequest()",
        "boolean.enable_contact = False" + ("; boolean.break_distance = 0.0" if meshed else ""),
        *_coal_setting(setting),
        f"print({f'true: {expected}'!r}, flush=True)",
        "print('coal collide:', coal.collide(A, X_A, B, X_B, boolean, coal.CollisionResult()) > 0, flush=True)",
        "print('coal distance:', coal.distance(A, X_A, B, X_B, number, coal.DistanceResult()))",
    ]
    return lines


def _coal_setting(setting: str) -> list[str]:
    """Lines that set up both requests as the peer does."""
    if not setting:
        return []
    values = [
        f"request.{name} = " + (f"coal.GJKVariant.{value}" if name == "gjk_variant" else repr(value))
        for name, value in CoalPeer.settings[setting].values.items()
    ]
    return [f"for request in (boolean, number): {'; '.join(values)}"]


def _coal_shape(letter: str, shape: Shape) -> list[str]:
    made = _primitive("coal", shape)
    if made is not None:
        return [f"{letter} = {made}"]
    if isinstance(shape, Mesh):
        return [
            f"{letter} = coal.BVHModelOBBRSS(); {letter}.beginModel({len(shape.faces)}, {len(shape.vertices)})",
            (f"{letter}.addVertices(np.array({_numbers(shape.vertices)})); "
            f"{letter}.addTriangles(np.array({_numbers(shape.faces)})); {letter}.endModel()"),
        ]
    vertices, triangles = _hull(shape)
    return [f"{letter} = hull({_numbers(vertices)}, {_numbers(triangles)})"]


# --- pybullet ---------------------------------------------------------------------------------------


def _pybullet(case: Case, setting: str, expected: str) -> list[str]:
    lines = ["import pybullet as p", "", "p.connect(p.DIRECT)", "def body(**shape):"]
    lines += ["    made = p.createMultiBody(0, p.createCollisionShape(**shape))"]
    lines += [] if setting == "margins" else ["    p.changeDynamics(made, -1, collisionMargin=0.0)"]
    lines += ["    return made"]
    for letter, body in zip("AB", case.bodies):
        shape, X = body.shape, body.X_WB.copy()
        if isinstance(shape, Halfspace):
            length = float(np.linalg.norm(shape.normal))
            X[:3, 3] = X[:3, :3] @ (shape.normal / length * shape.offset / length) + X[:3, 3]
        lines.append(f"{letter} = body({_bullet_shape(shape)})")
        pose = f"{_numbers(X[:3, 3])}, {_numbers(np.array(quaternion_xyzw(X[:3, :3])))}"
        lines.append(f"p.resetBasePositionAndOrientation({letter}, {pose})")
    lines += [
        "contacts = p.getClosestPoints(A, B, 1000.0)",
        f"print({f'true: {expected}'!r})",
        "print('pybullet distance:', min(contact[8] for contact in contacts) if contacts else 'no contact at all')",
    ]
    return lines


def _bullet_shape(shape: Shape) -> str:
    if isinstance(shape, Sphere):
        return f"shapeType=p.GEOM_SPHERE, radius={shape.radius!r}"
    if isinstance(shape, Box):
        return f"shapeType=p.GEOM_BOX, halfExtents={_numbers(shape.size / 2)}"
    if isinstance(shape, Capsule | Cylinder):
        kind = "CAPSULE" if isinstance(shape, Capsule) else "CYLINDER"
        return f"shapeType=p.GEOM_{kind}, radius={shape.radius!r}, height={shape.length!r}"
    if isinstance(shape, Halfspace):
        return f"shapeType=p.GEOM_PLANE, planeNormal={_numbers(shape.normal / np.linalg.norm(shape.normal))}"
    if isinstance(shape, Mesh):
        return (
            f"shapeType=p.GEOM_MESH, vertices={_numbers(shape.vertices)}, "
            f"indices={_numbers(shape.faces.ravel())}, flags=p.GEOM_FORCE_CONCAVE_TRIMESH"
        )
    points = corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return f"shapeType=p.GEOM_MESH, vertices={_numbers(points[0])}"


# --- MuJoCo -----------------------------------------------------------------------------------------


def _mujoco(case: Case, setting: str, expected: str) -> list[str]:
    solver = " | mujoco.mjtDisableBit.mjDSBL_NATIVECCD" if "libccd" in setting else ""
    lines = ["import mujoco", "import numpy as np", "", "spec = mujoco.MjSpec()"]
    lines += [f"spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_MULTICCD{solver}"]
    for letter, body in zip("AB", case.bodies):
        geom, points = _mujoco_geom(letter, body.shape)
        if points is not None:
            lines.append(
                f"mesh = spec.add_mesh(name='{letter}', inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX); "
                f"mesh.uservert = {_numbers(points.ravel())}"
            )
        x, y, z, w = quaternion_xyzw(body.X_WB[:3, :3])
        place = f"pos={_numbers(body.X_WB[:3, 3])}, quat={[w, x, y, z]!r}"
        lines += [f"{letter} = spec.worldbody.add_body(name='{letter}', {place})"]
        lines += [f"{letter}.add_geom(name='{letter}', {geom})"]
    lines += [
        "spec.add_pair(geomname1='A', geomname2='B', margin=0.0, gap=0.0)",
        "model = spec.compile()",
        "data = mujoco.MjData(model)",
        "mujoco.mj_kinematics(model, data)",
        f"print({f'true: {expected}'!r}, flush=True)",
    ]
    if "distance" in setting:
        far = _far(case)
        return [*lines, f"print('mujoco distance:', mujoco.mj_geomDistance(model, data, 0, 1, {far!r}, np.zeros(6)))"]
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
        return f"type=mujoco.mjtGeom.mjGEOM_BOX, size={_numbers(shape.size / 2)}", None
    if isinstance(shape, Capsule | Cylinder):
        kind = "CAPSULE" if isinstance(shape, Capsule) else "CYLINDER"
        return f"type=mujoco.mjtGeom.mjGEOM_{kind}, size=[{shape.radius!r}, {shape.length / 2!r}, 0]", None
    if isinstance(shape, Ellipsoid):
        return f"type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size={_numbers(shape.radii)}", None
    points = None if isinstance(shape, Mesh | Halfspace) else corners(shape)
    if points is None or points[1]:
        raise KeyError(type(shape).__name__)
    return f"type=mujoco.mjtGeom.mjGEOM_MESH, meshname='{letter}'", np.unique(points[0], axis=0)


def _far(case: Case) -> float:
    """A length that the pair is surely not apart by [m], small as the peer's: libccd loses digits where it is large."""
    reach = 0.0
    for body in case.bodies[:2]:
        shape = body.shape
        if isinstance(shape, Box | Ellipsoid):
            reach += float(np.sum(shape.size / 2 if isinstance(shape, Box) else shape.radii))
        elif isinstance(shape, Sphere | Capsule | Cylinder):
            reach += shape.radius + (0.0 if isinstance(shape, Sphere) else shape.length / 2)
        else:
            points = corners(shape)
            reach += float(np.linalg.norm(points[0], axis=1).max()) if points is not None else 0.0
    return 1.01 * (float(np.linalg.norm(case.bodies[0].X_WB[:3, 3] - case.bodies[1].X_WB[:3, 3])) + reach)


_ENGINES: dict[str, Callable[[Case, str, str], list[str]]] = {
    "fcl": _fcl, "coal": _coal, "pybullet": _pybullet, "mujoco": _mujoco,
}  # fmt: skip
