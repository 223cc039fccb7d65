"""Findings in the calls of the collision libraries: python-fcl, coal, and trimesh, which has FCL inside."""

from __future__ import annotations

import numpy as np

from collide.adapters.fuzzing.snippet_parts import Asked, hull, numbers, poses, primitive
from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.fcl_peer import FclPeer
from collide.adapters.peers.question import corners
from collide.shapes import Capsule, Halfspace, Mesh, Shape, Sphere

# --- fcl --------------------------------------------------------------------------------------------


def fcl_lines(asked: Asked) -> list[str]:
    """A program for python-fcl."""
    case, setting = asked.case, asked.setting
    lines = ["import fcl", "import numpy as np", ""]
    for letter, body in zip("AB", case.bodies):
        lines += _fcl_shape(letter, body.shape)
    flat = any(isinstance(body.shape, Halfspace) for body in case.bodies[:2])
    lines += poses(case)
    lines += [
        "a = fcl.CollisionObject(A, fcl.Transform(R_A, t_A))",
        "b = fcl.CollisionObject(B, fcl.Transform(R_B, t_B))",
        asked.true_line(),
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
    wanted = "request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)"
    if asked.points:
        return [
            *lines, wanted, "result = fcl.DistanceResult()",
            "print('fcl distance:', fcl.distance(a, b, request, result))",
            "print('fcl points:', [point.tolist() for point in result.nearest_points])",
        ]
    lines.append(
        "print('fcl collide:', fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0, flush=True)"
    )
    if not flat:
        lines += [wanted, "print('fcl distance:', fcl.distance(a, b, request, fcl.DistanceResult()))"]
    return lines


def _fcl_shape(letter: str, shape: Shape) -> list[str]:
    made = primitive("fcl", shape)
    if made is not None:
        return [f"{letter} = {made}"]
    if isinstance(shape, Mesh):
        return [
            f"{letter} = fcl.BVHModel()",
            f"{letter}.beginModel({len(shape.vertices)}, {len(shape.faces)})",
            f"{letter}.addSubModel(np.array({numbers(shape.vertices)}), np.array({numbers(shape.faces)}))",
            f"{letter}.endModel()",
        ]
    vertices, triangles = hull(shape)
    faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
    return [f"{letter} = fcl.Convex(np.array({numbers(vertices)}), {len(triangles)}, np.array({numbers(faces)}))"]


# --- coal -------------------------------------------------------------------------------------------


def coal_lines(asked: Asked) -> list[str]:
    """A program for coal."""
    case = asked.case
    lines = ["import coal", "import numpy as np", ""]
    meshed = any(isinstance(body.shape, Mesh) for body in case.bodies[:2])
    hulls = any(primitive("coal", body.shape) is None and not isinstance(body.shape, Mesh) for body in case.bodies[:2])
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
    lines += poses(case)
    points = [
        "result = coal.DistanceResult()",
        "print('coal distance:', coal.distance(A, X_A, B, X_B, number, result))",
        "print('coal points:', result.getNearestPoint1().tolist(), result.getNearestPoint2().tolist())",
    ]
    answers = [
        "print('coal collide:', coal.collide(A, X_A, B, X_B, boolean, coal.CollisionResult()) > 0, flush=True)",
        "print('coal distance:', coal.distance(A, X_A, B, X_B, number, coal.DistanceResult()))",
    ]
    lines += [
        "X_A, X_B = coal.Transform3s(R_A, t_A), coal.Transform3s(R_B, t_B)",
        "boolean, number = coal.CollisionRequest(), coal.DistanceRequest()",
        "boolean.enable_contact = False" + ("; boolean.break_distance = 0.0" if meshed else ""),
        *_coal_setting(asked.setting), asked.true_line(), *(points if asked.points else answers),
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
    made = primitive("coal", shape)
    if made is not None:
        return [f"{letter} = {made}"]
    if isinstance(shape, Mesh):
        return [
            f"{letter} = coal.BVHModelOBBRSS(); {letter}.beginModel({len(shape.faces)}, {len(shape.vertices)})",
            (f"{letter}.addVertices(np.array({numbers(shape.vertices)})); "
            f"{letter}.addTriangles(np.array({numbers(shape.faces)})); {letter}.endModel()"),
        ]
    vertices, triangles = hull(shape)
    return [f"{letter} = hull({numbers(vertices)}, {numbers(triangles)})"]


# --- trimesh ------------------------------------------------------------------------------------------


def trimesh_lines(asked: Asked) -> list[str]:
    """A program for trimesh's collision managers."""
    lines = [
        "import numpy as np", "import trimesh", "from trimesh.collision import CollisionManager", "",
        "def manager(name, vertices, faces, R, t):",
        "    X, made = np.eye(4), CollisionManager()",
        "    X[:3, :3], X[:3, 3] = R, t",
        "    made.add_object(name, trimesh.Trimesh(vertices, faces, process=False), transform=X)",
        "    return made",
    ]
    lines += poses(asked.case)
    for letter, body in zip("AB", asked.case.bodies):
        vertices, faces = _triangles(body.shape)
        call = f"manager('{letter.lower()}', {numbers(vertices)}, {numbers(faces)}, R_{letter}, t_{letter})"
        lines.append(f"{letter.lower()} = {call}")
    lines.append(asked.true_line())
    if asked.points:
        return [
            *lines, "distance, data = a.min_distance_other(b, return_data=True)",
            "print('trimesh distance:', distance)",
            "print('trimesh points:', data.point('a').tolist(), data.point('b').tolist())",
        ]
    return [
        *lines, "print('trimesh collide:', a.in_collision_other(b), flush=True)",
        "print('trimesh distance:', a.min_distance_other(b))",
    ]


def _triangles(shape: Shape) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(shape, Mesh):
        return shape.vertices, shape.faces
    if isinstance(shape, Sphere | Capsule | Halfspace) or corners(shape) is None:
        raise KeyError(type(shape).__name__)
    return hull(shape)
