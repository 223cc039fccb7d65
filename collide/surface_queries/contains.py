"""Whether points belong to a shape: `contains`, decided without rounding.

Points are single-point hulls: what the engine proves about a shape and such a hull holds for the point. What the engine
leaves open, next to curved surfaces and in nested unions, the shape's definition decides in fractions
(`inside_by_definition.py`).
"""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from collide.base import argument_checks as checks
from collide.base.poses_at import poses_at
from collide.casts.raycast import raycast
from collide.errors import UnsupportedQuery
from collide.lowering.facet_bodies import body_of
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import MeshTree
from collide.mesh.shell_volumes import without_area
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.facets.facet_geometry import RAY_DIRECTIONS, FacetCorners, exact_point, ray_crossing
from collide.narrowphase.facets.facet_queries import points_in_solid, surfaces_meet
from collide.narrowphase.facets.winding_numbers import INSIDE, ON_SURFACE, OUTSIDE, UNDECIDED
from collide.numerics.exact_points import on_one_grid, placed
from collide.numerics.exact_vectors import minus
from collide.pairs.batches import answer_batch
from collide.results import UNDECIDED as SIGN_OPEN
from collide.shapes.convex_hull import ConvexHull
from collide.shapes.mesh import Mesh
from collide.shapes.shape import Shape, checked_shape
from collide.surface_queries.inside_by_definition import holds
from collide.transforms import LARGEST, poses_as_given

#: The facets without area of meshes that have been asked.
_thin: WeakKeyDictionary[MeshTree, MeshTree | None] = WeakKeyDictionary()


def contains(shape: Shape, X_WA, points_W, *, check_poses: bool = True):
    """Whether points belong to a shape, decided exactly; points on its surface do.

    Parameters
    ----------
    shape : a `Mesh` (a solid holds its facets and the points they wind around; a surface its facets alone), or any
        other shape.
    X_WA : (4, 4) pose of the shape in the world W [m], or (N, 4, 4), a pose a point.
    points_W : (3,) or (N, 3) in W [m], coordinates within 1e50.
    check_poses : refuse matrices other than rotations.

    Returns
    -------
    bool for a single point at a single pose, bool[N] otherwise; a batch gives the answers of N single calls.

    Raises
    ------
    InvalidArgument : points not finite or beyond 1e50, batches of different lengths.
    InvalidPose : matrices other than poses.
    UnsupportedQuery : next to the surface of a shape without a definition in fractions.

    Notes
    -----
    About 1 µs a point for solids, O(log n) for well-shaped ones: hierarchical winding numbers along segments. What
    rounding leaves open is decided in integers.
    """
    checked_shape("contains: shape", shape)
    points, single_point = checks.vectors("contains", "points_W", points_W)
    checks.refuse_rows("contains", "points_W", points, np.abs(points).max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")
    X_WA, single_pose = poses_as_given(X_WA, "X_WA", check=check_poses)
    n = checks.matched_count("contains", X_WA=len(X_WA), points_W=len(points))
    points = np.ascontiguousarray(np.broadcast_to(points, (n, 3)))
    if n == 0:
        return np.zeros(0, dtype=bool)
    if isinstance(shape, Mesh) and shape.meshed:
        answer = _in_mesh(shape, X_WA, points)
    else:
        answer = _in_convex(shape, X_WA, points)
    return bool(answer[0]) if single_point and single_pose else answer


def _pose(X: np.ndarray, k: int) -> np.ndarray:
    return X[k if len(X) > 1 else 0]


def _some(X: np.ndarray, rows) -> np.ndarray:
    """Rows of a batch (N, 4, 4) of poses; of a batch of length 1 its pose (4, 4), whatever the rows."""
    return X[0] if len(X) == 1 else np.ascontiguousarray(X[rows])


# --- meshes -------------------------------------------------------------------------------------


def _in_mesh(mesh: Mesh, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    if not mesh.solid:
        return on_facets(body_of(mesh).tree, X_WA, points)
    return where_in_solid(mesh, X_WA, points) != OUTSIDE


def on_facets(tree: MeshTree, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) bool: whether points (n, 3) of the world lie on facets, exactly; poses (n or 1, 4, 4)."""
    return surfaces_meet(tree, _point_tree(), _some(X_WA, slice(None)), poses_at(points))


def where_in_solid(mesh: Mesh, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) int64: OUTSIDE, ON_SURFACE or INSIDE of points (n, 3) of the world, exactly; poses (n or 1, 4, 4)."""
    tree = body_of(mesh).tree
    poses = np.ascontiguousarray(np.broadcast_to(X_WA, (len(points), 4, 4)))
    where = points_in_solid(tree, poses, points, np.eye(4))
    for k in np.flatnonzero(where == UNDECIDED).tolist():
        where[k] = INSIDE if winds_around(mesh, _pose(X_WA, k), points[k]) else OUTSIDE
    thin = thin_facets(mesh, tree)
    if thin is not None:  # points on facets without area count, too
        rest = np.flatnonzero(where != ON_SURFACE)
        where[rest[on_facets(thin, poses[rest], points[rest])]] = ON_SURFACE
    return where


def _point_tree() -> MeshTree:
    return body_of(_POINT).tree


def thin_facets(mesh: Mesh, tree: MeshTree) -> MeshTree | None:
    """A tree of the mesh's facets of zero area, None for a mesh without them; kept as long as the mesh's own tree."""
    if tree not in _thin:
        thin = without_area(mesh.vertices, mesh.faces)
        thin = np.flatnonzero(thin) if thin.dtype == bool else thin
        _thin[tree] = build_mesh_tree(mesh.vertices, mesh.faces[thin]) if len(thin) else None
    return _thin[tree]


def winds_around(mesh: Mesh, X_WA: np.ndarray, point: np.ndarray) -> bool:
    """Whether a solid's facets wind around a point off all facets, by rays from the point past every edge."""
    corners = FacetCorners(body_of(mesh).tree)
    for direction in RAY_DIRECTIONS:
        met = raycast(mesh, X_WA, point[None], np.array([direction], dtype=float), all_hits=True, check_poses=False)
        crossings = []
        for facet in met.facet.tolist():
            ((origin,), triangle), _ = on_one_grid(exact_point(point), placed(X_WA, corners[facet]))
            crossings.append(ray_crossing(direction, *(minus(corner, origin) for corner in triangle)))
        certain = [crossing for crossing in crossings if crossing is not None]
        if len(certain) == len(crossings):
            return sum(certain) > 0
    raise UnsupportedQuery(
        f"contains: every ray tried from {point.tolist()} passes an edge of the mesh; please report it"
    )


# --- convex shapes, and unions ------------------------------------------------------------------

_POINT = ConvexHull(np.zeros((1, 3)))


def _in_convex(shape: Shape, X_WA: np.ndarray, points: np.ndarray) -> np.ndarray:
    rows = answer_batch(shape, _POINT, X_WA, poses_at(points), Question(False, 0.0, depths=False))
    answer = rows["hit"].copy()
    for k in np.flatnonzero(answer & (rows["how"] == SIGN_OPEN)).tolist():
        answer[k] = holds(shape, [_pose(X_WA, k)], points[k])
    return answer
