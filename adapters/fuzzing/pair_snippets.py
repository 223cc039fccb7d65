"""Findings in the calls of distance3d, Newton and CGAL."""

from __future__ import annotations

import numpy as np

from collide.adapters.fuzzing.snippet_parts import Asked, hull, numbers
from collide.adapters.peers.distance3d_peer import TOUCHING, cone_pose
from collide.adapters.peers.newton_peer import NewtonPeer, PlacedPair, placed_pair
from collide.adapters.peers.question import corners
from collide.shapes import Box, Capsule, Cone, Cylinder, Ellipsoid, Mesh, Shape, Sphere

# --- distance3d -------------------------------------------------------------------------------------


def distance3d_lines(asked: Asked) -> list[str]:
    """A program for distance3d; KeyError for nearest points of flavours that give none."""
    if asked.points and asked.setting in ("nesterov", "mpr"):
        raise KeyError(asked.setting)
    lines = ["import numpy as np", "from distance3d import colliders, epa, gjk, mpr", ""]
    lines += [
        f"{letter} = colliders.{_collider(body.shape, body.X_WB)}" for letter, body in zip("AB", asked.case.bodies)
    ]
    lines.append(asked.true_line())
    if asked.setting == "mpr":
        return [
            *lines, "hit, depth, direction, position = mpr.mpr_penetration(A, B)",
            "print('distance3d collide:', hit)", "print('distance3d depth:', depth)",
        ]
    if asked.setting == "nesterov":
        return [
            *lines, "hit, gap, *_ = gjk.gjk_nesterov_accelerated(A, B, use_nesterov_acceleration=True)",
            "print('distance3d collide:', bool(hit))", "print('distance3d distance:', gap)",
        ]
    if asked.setting == "original":
        lines.append("gap, on_A, on_B, *_ = gjk.gjk_distance_original(A, B)")
    else:
        lines.append("gap, on_A, on_B, simplex = gjk.gjk_distance_jolt(A, B, max_distance_squared=float('inf'))")
    hit = f"gap < {TOUCHING!r}" if asked.setting else "gjk.gjk_intersection_jolt(A, B)"
    lines += [f"print('distance3d collide:', {hit}, flush=True)"]
    if asked.points:
        return [*lines, "print('distance3d points:', np.array(on_A).tolist(), np.array(on_B).tolist())"]
    if asked.setting == "epa":
        lines += [f"if gap < {TOUCHING!r}:", "    gap = -np.linalg.norm(epa.epa(simplex, A, B)[0])"]
    return [*lines, "print('distance3d distance:', gap)"]


def _collider(shape: Shape, X: np.ndarray) -> str:
    place = f"np.array({numbers(X)})"
    if isinstance(shape, Sphere):
        return f"Sphere(np.array({numbers(X[:3, 3])}), {shape.radius!r})"
    if isinstance(shape, Box):
        return f"Box({place}, np.array({numbers(shape.size)}))"
    if isinstance(shape, Capsule | Cylinder):
        return f"{type(shape).__name__}({place}, {shape.radius!r}, {shape.length!r})"
    if isinstance(shape, Cone):
        return f"Cone(np.array({numbers(cone_pose(shape, X))}), {shape.radius!r}, {shape.length!r})"
    if isinstance(shape, Ellipsoid):
        return f"Ellipsoid({place}, np.array({numbers(shape.radii)}))"
    points = None if isinstance(shape, Mesh) else corners(shape)
    if points is None:
        raise KeyError(type(shape).__name__)
    made = f"ConvexHullVertices(np.array({numbers(points[0] @ X[:3, :3].T + X[:3, 3])}))"
    return f"Margin(colliders.{made}, {points[1]!r})" if points[1] else made


# --- Newton -----------------------------------------------------------------------------------------


def newton_lines(asked: Asked) -> list[str]:
    """A program for Newton's narrow phase of one pair; KeyError for its points, which the peer works out."""
    bodies = asked.case.bodies[:2]
    if asked.points or any(NewtonPeer().supports(body.shape) for body in bodies):
        raise KeyError("points")
    built = [NewtonPeer().build(body.shape) for body in bodies]
    pair = placed_pair(built[0], bodies[0].X_WB, built[1], bodies[1].X_WB)
    lines = ["import newton", "import numpy as np", "import warp as wp", "from newton.geometry import NarrowPhase", ""]
    hulls = ["None", "None"]
    for k, (body, geometry) in enumerate(zip(bodies, built)):
        if geometry[2] is not None:
            points, facets = hull(body.shape)
            hulls[k] = f"newton.Mesh(np.array({numbers(points)}), {numbers(facets.ravel())}, compute_inertia=False)"
    kinds = ", ".join(f"int(newton.GeoType.{geometry[0]})" for geometry in built)
    lines += [
        "def array(values, dtype): return wp.array(values, dtype=dtype, device='cpu')",
        f"hulls = [{hulls[0]},", f"         {hulls[1]}]",
        f"places = {[list(place) for place in pair.places]!r}",
        f"sizes = {[[*map(float, geometry[1]), 0.0] for geometry in built]!r}",
        "normal, at, gaps, n = (wp.zeros(64, dtype=kind, device='cpu') for kind in (wp.vec3, wp.vec3, float, int))",
        "phase = NarrowPhase(max_candidate_pairs=1, max_triangle_pairs=1, reduce_contacts=False, has_meshes=False,",
        "                    device='cpu', verify_buffers=False)",
        "phase.launch(candidate_pair=array([(0, 1)], wp.vec2i), candidate_pair_count=array([1], int), device='cpu',",
        *_launch_lines(kinds, pair),
        asked.true_line(),
        "print('newton distance:', float(gaps.numpy()[: n.numpy()[0]].min(initial=np.inf)))",
    ]
    return lines


def _launch_lines(kinds: str, pair: PlacedPair) -> list[str]:
    """The rest of the arguments of a launch, on two lines."""
    boxes = [[[sign * r] * 3 for r in pair.boxes] for sign in (-1, 1)]
    shapes = [
        f"shape_types=array([{kinds}], int)", "shape_data=array(sizes, wp.vec4)",
        "shape_transform=array(places, wp.transform)",
        "shape_source=array([h.finalize('cpu') if h else 0 for h in hulls], wp.uint64)",
    ]
    rest = [
        f"shape_gap=array([{pair.gap / 2!r}] * 2, float)", f"shape_collision_radius=array({pair.reaches!r}, float)",
        "shape_flags=array([int(newton.ShapeFlags.COLLIDE_SHAPES)] * 2, int)",
        f"shape_collision_aabb_lower=array({boxes[0]!r}, wp.vec3)",
        f"shape_collision_aabb_upper=array({boxes[1]!r}, wp.vec3)",
        "shape_voxel_resolution=array([(4, 4, 4)] * 2, wp.vec3i)",
        "contact_pair=wp.zeros(64, dtype=wp.vec2i, device='cpu')", "contact_position=at", "contact_normal=normal",
        "contact_penetration=gaps", "contact_count=n)",
    ]
    return [f"    {', '.join(shapes)},", f"    {', '.join(rest)}"]


# --- CGAL -------------------------------------------------------------------------------------------


def cgal_lines(asked: Asked) -> list[str]:
    """A program for CGAL and two polytopes; meshes have no form."""
    lines = [
        "from CGAL.CGAL_Convex_hull_3 import convex_hull_3", "from CGAL.CGAL_Kernel import ON_UNBOUNDED_SIDE, Point_3",
        "from CGAL.CGAL_Polygon_mesh_processing import Side_of_triangle_mesh, do_intersect",
        "from CGAL.CGAL_Polyhedron_3 import Polyhedron_3", "",
        "def hull(points):", "    made = Polyhedron_3()",
        "    convex_hull_3([Point_3(*point) for point in points], made)", "    return made",
        "def has_vertex_in(outer, inner):", "    side = Side_of_triangle_mesh(outer)",
        "    return any(side.bounded_side(v.point()) != ON_UNBOUNDED_SIDE for v in inner.vertices())",
    ]
    for letter, body in zip("AB", asked.case.bodies):
        points = None if isinstance(body.shape, Mesh | Sphere | Capsule) else corners(body.shape)
        if points is None or points[1]:
            raise KeyError(type(body.shape).__name__)
        lines.append(f"{letter} = hull({numbers(points[0] @ body.X_WB[:3, :3].T + body.X_WB[:3, 3])})")
    meet = "do_intersect(A, B) or has_vertex_in(A, B) or has_vertex_in(B, A)"
    return [*lines, asked.true_line(), f"print('cgal collide:', {meet})"]
