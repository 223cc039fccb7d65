"""Where the text of Barba and Langerman's section 2 does not hold as written: each place met, and answered rightly."""

from __future__ import annotations

import numpy as np
import pytest
from planar_families import near_and_far, nested, pose_at
from planar_oracle import edges_of, polygons_meet_exactly

from collide import ConvexPolygon
from collide.papers.polytopes.planar_layout import DOUBLES, INTEGERS, OF_P, P_SLOTS, Q_SLOTS
from collide.papers.polytopes.planar_predicates import PolygonPair, read_vertex, set_planar_poses, side_of
from collide.papers.polytopes.planar_triangles import CROSSING, VERTEX, chord_beyond, compare_triangles, line_of_q
from collide.polytopes import polygons_meet


def meets_an_edge(A, B, X_WA, X_WB) -> bool:
    """Whether A has a point on an edge of B."""
    corners = B.vertices
    return any(polygons_meet_exactly(A.vertices, corners[[i, j]], X_WA, X_WB) for i, j in edges_of(corners))


def test_no_edge_is_met_where_p_lies_inside_q():
    """The invariant "P and Q intersect iff CH(V*) intersects an edge of E*" is false from the start."""
    rng = np.random.default_rng(3)
    inside = 0
    for _ in range(60):
        points_a, points_b, X_WA, X_WB = nested(rng)
        A, B = ConvexPolygon(points_a), ConvexPolygon(points_b)
        if not meets_an_edge(A, B, X_WA, X_WB):
            inside += polygons_meet(A, B, X_WA, X_WB).hit
    assert inside >= 10


def first_triangles(A, B, X_WA, X_WB) -> PolygonPair:
    """The pair with the first T_P and T_Q of the search in its workspace."""
    doubles, integers = [0.0] * DOUBLES, [0] * INTEGERS
    set_planar_poses(doubles, X_WA.ravel().tolist(), X_WB.ravel().tolist())
    n, m = len(A.vertices), len(B.vertices)
    pair = PolygonPair(A.vertices.ravel().tolist(), n, B.vertices.ravel().tolist(), m, doubles, integers)
    for k in range(3):
        read_vertex(pair, P_SLOTS + k, 0, k * n // 3)
        read_vertex(pair, Q_SLOTS + 2 * k, 1, k * m // 3)
        read_vertex(pair, Q_SLOTS + 2 * k + 1, 1, (k * m // 3 + 1) % m)
    return pair


def is_unbounded(B) -> bool:
    """Whether the half-planes of three edges, a third of the corners apart, have no bounded intersection."""
    m = len(B.vertices)
    edges = np.array([B.vertices[(k * m // 3 + 1) % m] - B.vertices[k * m // 3] for k in range(3)])
    angles = np.sort(np.arctan2(edges[:, 1], edges[:, 0]))
    return bool(np.diff(np.r_[angles, angles[0] + 2 * np.pi]).max() > np.pi)


@pytest.mark.plain_kernels
def test_x_inside_t_q_and_unbounded_edge_hulls():
    """x is a vertex of P strictly inside T_Q, not "on the boundary of T_Q", and T_Q may have no end."""
    rng = np.random.default_rng(9)
    interior = unbounded = 0
    for _ in range(150):
        points_a, points_b, X_WA, X_WB = near_and_far(rng)
        if rng.random() < 0.5:  # corners crowded together on one side
            points_b = np.array([[np.cos(t), np.sin(t)] for t in rng.uniform(0, 2.5, 12)])
        A, B = ConvexPolygon(points_a), ConvexPolygon(points_b)
        if min(len(A.vertices), len(B.vertices)) < 4:
            continue
        assert polygons_meet(A, B, X_WA, X_WB).hit == polygons_meet_exactly(A.vertices, B.vertices, X_WA, X_WB)
        pair = first_triangles(A, B, X_WA, X_WB)
        relation = compare_triangles(pair, 3)
        met = relation.what in (VERTEX, CROSSING) and chord_beyond(pair, relation) >= 0
        unbounded += met and is_unbounded(B)
        if met and relation.what == VERTEX:
            interior += all(side_of(pair, line_of_q(pair, k), P_SLOTS + relation.i) > 0 for k in range(3))
    assert interior >= 5
    assert unbounded >= 5


def test_segment_xy_is_in_p_and_not_in_q():
    """Hits whose point x, kept from an earlier round, lies outside of Q: "the edge xy is contained in Q" means P."""
    rng = np.random.default_rng(5)
    outside = 0
    for _ in range(150):
        angles = np.sort(rng.uniform(0, 2 * np.pi, (2, 24)))
        A, B = (ConvexPolygon(np.c_[np.cos(t), np.sin(t)]) for t in angles)
        around = rng.uniform(0, 7)
        X_WB = pose_at(rng.uniform(1.5, 1.98) * np.array([np.cos(around), np.sin(around)]), rng.uniform(0, 7))
        r = polygons_meet(A, B, np.eye(3), X_WB)
        x = r._rows[0, OF_P + 2 : OF_P + 4].tolist()
        if r.hit and x[0] == x[1] >= 0:  # a vertex of A
            outside += not polygons_meet_exactly(A.vertices[x[:1]], B.vertices, np.eye(3), X_WB)
    assert outside >= 3
