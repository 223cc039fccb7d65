"""The checking mode of the walk: every invariant of every round, against every vertex of the levels reached.

O(n) a round and in doubles with a tolerance, since the walk's own points are rounded. Run by tests; the same walk in
rational numbers, with the same checks and none, stands in tests/papers/hierarchies/reference_walk.py.
"""

from __future__ import annotations

import numpy as np

from collide.papers.hierarchies.run_walk import TracedRound
from collide.papers.hierarchies.walk_bodies import WalkBody

#: How far an inequality between numbers of the order of one may fail.
_SLACK = 1e-9


def validate_rounds(body_p: WalkBody, body_r: WalkBody, X_WP, X_WR, rounds: tuple[TracedRound, ...]) -> None:
    """Assert the invariants of a traced walk; AssertionError names the round and what does not hold.

    X_WP, X_WR : (4, 4) poses of the bodies that play P and R.
    """
    polar = body_r.polar
    assert polar is not None, "the body that plays R has a polar"
    R, offset = _relative_pose(X_WP, X_WR, polar.origin)
    P, Q = body_p.hierarchy.hierarchy, polar.hierarchy.hierarchy
    top_p, top_q = body_p.hierarchy.depth, polar.hierarchy.depth
    assert rounds and rounds[0].space == "base" and (rounds[0].level_p, rounds[0].level_q) == (top_p, top_q)
    for number, round_ in enumerate(rounds):
        if round_.invariant == "none":
            assert number == len(rounds) - 1, f"round {number}: the walk went on without an invariant"
            return
        ids_p, ids_q = _vertices(P, round_.level_p), _vertices(Q, round_.level_q)
        points_p = _moved(P.points[ids_p], R, offset)
        points_q = Q.points[ids_q]
        # Heights are products of points of P, before and after the motion, with points of Q.
        reach = max(np.abs(P.points[ids_p]).max(), np.abs(offset).max())
        rounding = _SLACK + 1e-14 * float(reach * np.abs(points_q).max())
        where = f"round {number} at levels {round_.level_p}, {round_.level_q}"
        if round_.invariant == "separation":
            heights = points_p @ round_.z
            slack = rounding + _SLACK * np.abs(heights).max()
            assert heights.min() > 1 - slack, f"{where}: P_i is not beyond the plane of z: {heights.min()!r}"
            tangent = heights[np.flatnonzero(ids_p == round_.vertex_p)]
            assert len(tangent) == 1 and tangent[0] <= heights.min() + slack, (
                f"{where}: the plane is not tangent at its vertex"
            )
            _assert_inside(Q, round_.level_q, round_.z, f"{where}: z is not in Q_j")
        else:
            x = _moved(round_.x[None], R, offset)[0]
            heights = points_q @ x
            slack = rounding + _SLACK * np.abs(heights).max()
            assert heights.max() < 1 + slack, f"{where}: Q_j is not inside the plane of x: {heights.max()!r}"
            tangent = heights[np.flatnonzero(ids_q == round_.vertex_q)]
            assert len(tangent) == 1 and tangent[0] >= heights.max() - slack, (
                f"{where}: the plane is not tangent at its vertex"
            )
            _assert_inside(P, round_.level_p, round_.x, f"{where}: x is not in P_i")
        if round_.level_p < top_p:
            others = points_p[ids_p != round_.p_star] @ round_.z_star
            assert len(others) == len(ids_p) - 1 and (others > 1 - rounding - _SLACK * np.abs(others).max()).all(), (
                f"{where}: the star invariant fails in the primal space"
            )
        if round_.level_q < top_q:
            x = _moved(round_.x_star[None], R, offset)[0]
            others = points_q[ids_q != round_.q_star] @ x
            assert len(others) == len(ids_q) - 1 and (others < 1 + rounding + _SLACK * np.abs(others).max()).all(), (
                f"{where}: the star invariant fails in the polar space"
            )
        if number:
            before = rounds[number - 1]
            primal = before.invariant == "separation"
            assert round_.space == ("primal" if primal else "polar"), f"{where}: the walk went the wrong way"
            steps = before.level_p - round_.level_p, before.level_q - round_.level_q
            assert steps == ((1, 0) if primal else (0, 1)), f"{where}: not one level down"


def _relative_pose(X_WP, X_WR, origin) -> tuple[np.ndarray, np.ndarray]:
    inverse = np.linalg.inv(X_WR[:3, :3])
    return inverse @ X_WP[:3, :3], inverse @ (X_WP[:3, 3] - X_WR[:3, 3]) - origin


def _moved(points: np.ndarray, R: np.ndarray, offset: np.ndarray) -> np.ndarray:
    return points @ R.T + offset


def _vertices(hierarchy, level: int) -> np.ndarray:
    return hierarchy.level_vertices[hierarchy.level_start[level - 1] : hierarchy.level_start[level]]


def _assert_inside(hierarchy, level: int, x: np.ndarray, message: str) -> None:
    """Check that x is in a level of a hierarchy; for a flat level, without triangles, in its plane's box alone."""
    points = hierarchy.points[_vertices(hierarchy, level)]
    slack = _SLACK * max(1.0, float(np.abs(points).max()))
    assert (x >= points.min(axis=0) - slack).all() and (x <= points.max(axis=0) + slack).all(), message
    if hasattr(hierarchy, "triangles"):
        triangles = hierarchy.triangles(level - 1)
        a, b, c = (hierarchy.points[triangles[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        lengths = np.sqrt(np.square(normals).sum(axis=1))
        thick = lengths > 1e-12 * np.square(points).max()
        above = ((x - a) * normals).sum(axis=1)[thick] / lengths[thick]
        assert (above <= 1e3 * slack).all(), f"{message}: {above.max()!r} beyond a facet"
