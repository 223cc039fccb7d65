"""Single facets of a mesh against a curved convex set (a cylinder, cone, ellipsoid): rows of the convex engine.

Every facet is a hull of three points, and stands before the convex set, in either order of the pair
(`lowering/facet_table.py`). Poses may be rounded products, whose slop is counted in (`PoseTable`, column POSE_SLOP).
"""

from __future__ import annotations

import numpy as np

from collide.lowering.facet_bodies import PosesWithSlop
from collide.lowering.facet_table import FacetTable
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.shape_table import NO_TERMS, POSE, POSE_SLOP, POSE_STRETCH, POSE_TERMS, PoseTable
from collide.mesh.bvh import MeshTree
from collide.narrowphase.convex_kernel_calls import run_pairs


def facet_rows(
    tree: MeshTree, packed: PackedConvex, A: PosesWithSlop, B: PosesWithSlop, pose: np.ndarray, place: np.ndarray, *,
    boolean: bool, limit: float, depths: bool = True,
) -> np.ndarray:
    """Rows (PAIR_DTYPE) of k facets, each at one of n pairs of poses, against a convex set; the facet is A.

    pose, place : (k,) numbers of poses, and numbers of triangles in the order of the tree.
    boolean, limit, depths : as of `run_pairs`.
    """
    triangles, triangle_of = np.unique(place, return_inverse=True)
    table = FacetTable(tree.triangles[triangles].reshape(-1, 3, 3), packed)
    poses, pose_of = np.unique(pose, return_inverse=True)
    rows = np.empty((len(pose) + len(poses), POSE))
    for part, body, which in ((slice(0, len(pose)), A, pose), (slice(len(pose), None), B, poses)):
        rows[part, :9] = body.X[which, :3, :3].reshape(-1, 9)
        rows[part, 9:12] = body.X[which, :3, 3]
        rows[part, POSE_SLOP] = body.slop[which]
    rows[:, POSE_TERMS] = rows[:, POSE_STRETCH] = -1.0
    shape_of = np.concatenate([triangle_of.ravel(), np.full(len(poses), len(triangles))]).astype(np.int64)
    pairs = np.stack([np.arange(len(pose)), len(pose) + pose_of.ravel()], axis=1)
    pose_table = PoseTable(rows, NO_TERMS)
    return run_pairs(table, pose_table, shape_of, pairs, boolean=boolean, limit=limit, depths=depths)  # type: ignore[arg-type]
