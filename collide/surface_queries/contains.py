"""Whether points belong to a shape: `contains`, decided without rounding.

Points are single-point hulls: what the engine proves about a shape and such a hull holds for the point. What it leaves
open, next to curved surfaces and in nested unions, is decided in fractions by the shape's definition (`inside_by_definition.py`).
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from collide import argument_checks as checks
from collide.batches import answer_batch
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering.facet_bodies import body_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import MeshTree
from collide.mesh.shell_volumes import without_area
from collide.narrowphase.convex_bodies import Question
from collide.narrowphase.facets.facet_queries import points_in_solid, surfaces_meet
from collide.narrowphase.facets.winding_numbers import INSIDE, OUTSIDE, UNDECIDED
from collide.numerics.exact_points import cross, inner, integers, minus, on_one_grid, placed
from collide.results import UNDECIDED as LEFT_OPEN
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape
from collide.surface_queries.inside_by_definition import holds
from collide.surface_queries.raycast import as_it_is, matched_count, raycast, vectors
from collide.transforms import LARGEST, poses_as_given

#: The facets without area of meshes that have been asked.
_thin: WeakKeyDictionary[MeshTree, MeshTree | None] = WeakKeyDictionary()
#: Directions tried where every segment of the kernel passes an edge.
_DIRECTIONS = np.array([[89.0, 233, 610], [-1597, 377, 987], [144, -2584, 55], [-34, 21, -4181], [6765, -8, 13], [-3, -5, 10946]])


def contains(shape: Shape, X_WA, points_W, *, check_poses: bool = True):
    """Whether points belong to a shape, decided exactly; points on its surface do.

    Parameters
    ----------
    shape : a `Mesh` (a solid holds its facets and what they wind around; a surface its facets alone), or any other shape.
    X_WA : (4, 4) pose of the shape, or (N, 4, 4), one a point.
    points_W : (3,) or (N, 3) [m], within 1e50.

    Returns
    -------
    bool for a single point at a single pose, bool[N] otherwise; the same one by one or in batches. About 1 µs a point for
    solids, O(log n) for well-shaped ones.

    Raises InvalidPose; InvalidArgument for points that are not finite or beyond 1e50, or counts that do not match.
    """
    if not isinstance(shape, Shape):
        raise InvalidArgument(f"contains: shape must be a shape, for example collide.Box((1, 1, 1)), got {checks.describe(shape)}")
    points, one = vectors("contains", "points_W", points_W)
    beyond = np.abs(points).max(axis=1) > LARGEST
    if beyond.any():
        k = int(np.argmax(beyond))
        raise InvalidArgument(f"contains: points_W[{k}] exceeds {LARGEST:g}, got {points[k].tolist()}")
    X_WA, single_pose = poses_as_given(X_WA, "X_WA", check=check_poses)
    n = matched_count("contains", X_WA=len(X_WA), points_W=len(points))
    points = np.ascontiguousarray(np.broadcast_to(points, (n, 3)))
    if n == 0:
        return np.zeros(0, dtype=bool)
    answer = _in_mesh(shape, X_WA, points) if isinstance(shape, Mesh) else _in_convex(shape, X_WA, points)
    return bool(answer[0]) if one and single_pose else answer


def _at(points: np.ndarray) -> np.ndarray:
    """(n, 4, 4) poses whose origins are the points."""
    X = np.tile(np.eye(4), (len(points), 1, 1))
    X[:, :3, 3] = points
    return X


def _pose(X: np.ndarray, k: int) -> np.ndarray:
    return X[k if len(X) > 1 else 0]


def _some(X: np.ndarray, rows) -> np.ndarray:
    """Those poses of a batch, or the single one."""
    return X[0] if len(X) == 1 else np.ascontiguousarray(X[rows])


# --- meshes -------------------------------------------------------------------------------------


def _in_mesh(mesh: Mesh, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    body = body_of(mesh)
    if not mesh.solid:
        return surfaces_meet(body.tree, _point_tree(), _some(X_WA, slice(None)), _at(points))
    poses = np.ascontiguousarray(np.broadcast_to(X_WA, (len(points), 4, 4)))
    where = points_in_solid(body.tree, poses, points, np.eye(4))
    for k in np.flatnonzero(where == UNDECIDED).tolist():
        where[k] = INSIDE if winds_around(mesh, _pose(X_WA, k), points[k]) else OUTSIDE
    answer = where != OUTSIDE
    thin = thin_facets(mesh, body.tree)
    if thin is not None:  # points on facets without area count, too
        left = np.flatnonzero(~answer)
        answer[left] = surfaces_meet(thin, _point_tree(), _some(X_WA, left), _at(points[left])) if len(left) else False
    return answer


def _point_tree() -> MeshTree:
    return body_of(_POINT).tree


def thin_facets(mesh: Mesh, tree: MeshTree) -> MeshTree | None:
    """A tree of the facets without area, None where there are none; kept as long as the mesh's own."""
    if tree not in _thin:
        thin = without_area(mesh.vertices, mesh.faces)
        thin = np.flatnonzero(thin) if thin.dtype == bool else thin
        _thin[tree] = build_mesh_tree(mesh.vertices, mesh.faces[thin]) if len(thin) else None
    return _thin[tree]


def winds_around(mesh: Mesh, X_WA: np.ndarray, point: np.ndarray) -> bool:
    """Whether a solid's facets wind around a point that is on none of them, along rays that pass no edge."""
    tree = body_of(mesh).tree
    place = np.empty(len(tree.ids), dtype=np.int64)
    place[tree.ids] = np.arange(len(place))
    for ray in _DIRECTIONS:
        direction = tuple(integers(ray)[0])
        met = raycast(mesh, X_WA, point[None], ray[None], all_hits=True, check_poses=False)
        passed, clear = 0, True
        for facet in met.facet.tolist():
            ((origin,), corners), _ = on_one_grid(as_it_is(point), placed(X_WA, tree.triangles[place[facet]].reshape(3, 3)))
            a, b, c = (minus(corner, origin) for corner in corners)
            sides = [inner(direction, cross(p, q)) for p, q in ((a, b), (b, c), (c, a))]
            clear = clear and 0 not in sides
            passed += 1 if sides[0] > 0 else -1
        if clear:
            return passed > 0
    raise UnsupportedQuery(f"contains: every ray tried from {point.tolist()} passes an edge of the mesh; please report it")


# --- convex shapes, and unions ------------------------------------------------------------------

_POINT = ConvexHull(np.zeros((1, 3)))


def _in_convex(shape: Shape, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    rows = answer_batch(shape, _POINT, X_WA, _at(points), Question(False, 0.0, depths=False))
    answer = rows["hit"].copy()
    for k in np.flatnonzero(answer & (rows["how"] == LEFT_OPEN)).tolist():
        answer[k] = holds(shape, [_pose(X_WA, k)], points[k])
    return answer
