"""Links as bodies: which shapes a test of two asks, which columns move them, and the way downhill to a collision."""

from __future__ import annotations

import numpy as np
import pytest
from plain_robots import joint, robot_of

from collide import Box, Compound, Robot, Sphere, pose
from collide.robots.robot import LinkShape
from collide.sweeps import link_bodies as links_module
from collide.sweeps import pair_search
from collide.sweeps.link_bodies import link_bodies, link_poses, moving_columns, pair_hits
from collide.sweeps.pair_search import search_downhill

#: Two plates with a gap of 0.8 m between them: not convex.
FORK = Compound([(Box((0.1, 0.2, 0.2)), pose((s * 0.45, 0, 0))) for s in (-1, 1)])


def slider(moving, standing, **limits):
    """A link on a rail along x, and one at the origin."""
    return robot_of(
        ["base", "slider"], [joint("slide", "prismatic", "base", "slider", **{"lower": -3.0, "upper": 3.0, **limits})],
        {"base": (standing, (0, 0, 0)), "slider": (moving, (0, 0, 0))},
    )


@pytest.mark.parametrize(("moving", "standing"), [
    (Sphere(0.1), Sphere(0.1)), (FORK, Sphere(0.1)), (Sphere(0.1), FORK), (FORK, FORK),
], ids=["convex", "first", "second", "both"])
def test_shapes_are_asked_where_the_hulls_around_them_overlap(monkeypatch, moving, standing):
    robot = slider(moving, standing)
    B, A = link_bodies(robot)
    convex = moving.convex and standing.convex
    assert (A.hull is None, B.hull is None) == (moving.convex, standing.convex)
    Q = np.linspace(-3.0, 3.0, 121)[:, None]
    asked = []
    real = links_module.collide

    def recorded(shape_a, shape_b, X_WA, X_WB):
        asked.append(((shape_a, shape_b), len(X_WA)))
        return real(shape_a, shape_b, X_WA, X_WB)

    monkeypatch.setattr(links_module, "collide", recorded)
    hits = pair_hits(A, B, link_poses(robot, Q))
    truth = real(moving, standing, np.array([pose((q, 0, 0)) for q in Q[:, 0]]), pose())
    assert np.array_equal(hits, truth) and 0 < hits.sum() < len(Q)
    if convex:
        assert asked == [((moving, standing), len(Q))]
    else:
        (first, n_first), (second, n_second) = asked
        assert first == (A.hull or moving, B.hull or standing) and n_first == len(Q)
        assert second == (moving, standing) and hits.sum() < n_second < len(Q)
        asked.clear()
        assert not pair_hits(A, B, link_poses(robot, np.full((4, 1), 3.0))).any() and len(asked) == 1


def test_links_without_geometry_are_no_bodies_and_several_elements_one():
    ball = lambda z: LinkShape(Sphere(0.1), pose((0, 0, z)), None, "test")
    robot = Robot("plain", ["a", "b", "c"], [joint("x", "prismatic", "a", "b"), joint("y", "prismatic", "b", "c")],
                  {"a": [ball(1)], "c": [ball(1), ball(2)]})
    one, several = link_bodies(robot)
    assert (one.link, several.link) == ("a", "c") and np.array_equal(one.X_LB, pose((0, 0, 1)))
    assert isinstance(several.shape, Compound) and len(several.shape.items) == 2 and several.hull is not None


def test_columns_that_move_two_links_against_each_other():
    """One after the other: each joint moves all before it against all behind it; a fixed one and a turn of a ball
    around its centre, which moves a frame, too."""
    robot = robot_of(
        ["a", "b", "c", "d"],
        [joint("slide", "prismatic", "a", "b", lower=-1.0, upper=1.0), joint("weld", "fixed", "b", "c"),
         joint("turn", "revolute", "c", "d", axis=(0, 0, 1), lower=-2.0, upper=2.0)],
        {link: (Sphere(0.1), (0, 0, 0)) for link in "abcd"},
    )
    columns = {pair: found.tolist() for pair, found in moving_columns(robot, link_bodies(robot)).items()}
    assert columns == {(0, 1): [0], (0, 2): [0], (0, 3): [0, 1], (1, 2): [], (1, 3): [1], (2, 3): [1]}
    still = robot_of(["a", "b"], [joint("weld", "fixed", "a", "b")], {link: (Sphere(0.1), (0, 0, 0)) for link in "ab"})
    assert [found.tolist() for found in moving_columns(still, link_bodies(still)).values()] == [[]]


@pytest.mark.parametrize(("start", "gap"), [(-2.9, 0.0), (2.9, 0.0), (0.5, 0.0)])
def test_the_way_downhill_ends_in_a_collision_from_either_end_of_the_limits(start, gap):
    robot = slider(Sphere(0.1), Sphere(0.1))
    B, A = link_bodies(robot)
    found = search_downhill(robot, A, B, np.array([0]), np.array([[start]]), 60, 3)
    assert found.gap == gap and abs(found.q[0]) <= 0.2 + 1e-9


def test_the_least_gap_within_the_limits_is_approached():
    robot = slider(Sphere(0.1), Sphere(0.1), lower=-3.0, upper=-0.5)
    B, A = link_bodies(robot)
    starts = np.array([[-2.9], [-2.0]])
    found = search_downhill(robot, A, B, np.array([0]), starts, 40, 3)
    assert found.q[0] == pytest.approx(-0.5, abs=1e-3) and found.gap == pytest.approx(-found.q[0] - 0.2, abs=1e-12)
    unmoved = search_downhill(robot, A, B, np.array([0]), starts, 0, 3)
    assert unmoved.q[0] == -2.0 and unmoved.gap == pytest.approx(1.8) and starts.tolist() == [[-2.9], [-2.0]]


def test_a_collision_ends_the_search(monkeypatch):
    robot = slider(Sphere(0.1), Sphere(0.1))
    B, A = link_bodies(robot)
    asked = []
    real = pair_search.pair_gaps
    monkeypatch.setattr(pair_search, "pair_gaps", lambda *args: asked.append(args) or real(*args))
    found = search_downhill(robot, A, B, np.array([0]), np.array([[2.0], [0.0]]), 50, 3)
    assert len(asked) == 1 and found.gap == 0.0 and found.q.tolist() == [0.0]


def test_steps_that_come_no_nearer_are_not_taken():
    """A ball turns around its centre."""
    robot = robot_of(["base", "ball"], [joint("turn", "revolute", "base", "ball", axis=(0, 0, 1))],
                     {"base": (Sphere(0.1), (1, 0, 0)), "ball": (Sphere(0.1), (0, 0, 0))})
    B, A = link_bodies(robot)
    found = search_downhill(robot, A, B, np.array([0]), np.array([[0.5], [0.75]]), 5, 3)
    assert found.q.tolist() == [0.5] and found.gap == pytest.approx(0.8)
