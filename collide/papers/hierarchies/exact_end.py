"""The walk's end in integers: proofs from its last vertices on the poses as given, touching included.

The walk runs in doubles, and near touching the gap is below the rounding of planes and points in doubles. The vertex of
P and the facet of R where its planes were tangent last are then taken up exactly. Their differences are a simplex of
P ⊖ R: if the simplex holds the origin, P and R share a point; if all vertices lie beyond the plane of the simplex's
nearest point, P and R are apart; else the simplex is improved, in integers, up to either outcome. Lost walks have no
last vertices, and are not ended here.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.lowering.packed_convex import PackedConvex
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.convex_kernel_calls import settle_proposals
from collide.papers.hierarchies.walk import OPEN_APART, OPEN_MEETING
from collide.papers.hierarchies.walk_bodies import WalkBody
from collide.results import EXACT, PAIR_DTYPE


class ExactEnds(NamedTuple):
    """A row for each ended walk.

    proven, hit : (n,) bool.   rounds : (n,) int64, simplices evaluated in integers.
    vertices_p, vertices_r : (n, 4) of the deciding simplex, the first ``counts`` (n,) in use.
    """

    proven: np.ndarray
    hit: np.ndarray
    rounds: np.ndarray
    vertices_p: np.ndarray
    vertices_r: np.ndarray
    counts: np.ndarray


def last_corners(body_p: WalkBody, body_r: WalkBody, walk) -> tuple[int, list[int]]:
    """(vertex of P, up to three vertices of R) where the planes of a walk were tangent last.

    walk : a row of `WALK_DTYPE`.   Vertices that a cut or a thickened R added are no vertices of the bodies: the first
    vertex stands for them.
    """
    polar = body_r.polar
    assert polar is not None, "the body that plays R has a polar"
    vertex = int(walk["vertex_p"])
    facet = int(walk["vertex_q"])
    corners: dict[int, None] = {}
    if facet < len(polar.starts) - 1:
        corners = dict.fromkeys(polar.triangles[polar.starts[facet]].tolist())
    return (vertex if vertex < len(body_p.points) else 0), list(corners) or [0]


def end_exactly(
    body_p: WalkBody,
    body_r: WalkBody,
    packed_p: PackedConvex,
    packed_r: PackedConvex,
    X_WP: np.ndarray,
    X_WR: np.ndarray,
    walks: np.ndarray,
) -> ExactEnds:
    """Settle walks that ended without a proof, each at its pose.

    X_WP, X_WR : (n, 4, 4).   walks : (n,) `WALK_DTYPE`, OPEN_APART or OPEN_MEETING; others are not proven here.
    """
    n = len(walks)
    rows = np.zeros(n, dtype=PAIR_DTYPE)
    for k, walk in enumerate(walks):
        vertex, corners = last_corners(body_p, body_r, walk)
        rows["vertices_a"][k, : len(corners)] = vertex
        rows["vertices_b"][k, : len(corners)] = corners
        rows["count"][k] = len(corners)
    poses = pose_table(
        np.concatenate([X_WP, X_WR]), np.tile(np.eye(4), (2 * n, 1, 1)), np.repeat([packed_p.reach, packed_r.reach], n)
    )
    table = ShapeTable([packed_p, packed_r])
    table.build_trees(np.arange(2))
    pairs = np.stack([np.arange(n), np.arange(n, 2 * n)], axis=1)
    settle_proposals(table, poses, np.repeat(np.arange(2), n), pairs, rows, boolean=True)
    is_open = (walks["status"] == OPEN_APART) | (walks["status"] == OPEN_MEETING)
    proven = is_open & (rows["how"] == EXACT) & (rows["exact"] > 0)
    return ExactEnds(
        proven, rows["hit"].copy(), rows["exact"].astype(np.int64), rows["vertices_a"], rows["vertices_b"],
        rows["count"].astype(np.int64),
    )
