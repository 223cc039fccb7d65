"""Results of `RobotChecker.distances`: names, the reasons why there is no gradient, what is printed."""

from __future__ import annotations

import numpy as np
import pytest

from collide.robots.robot_distances import NEAREST_DTYPE, NO_GRADIENT, RobotDistances


def made(*rows: dict, gradient=None) -> RobotDistances:
    out = np.zeros(len(rows), dtype=NEAREST_DTYPE)
    for row, values in zip(out, rows):
        for name, value in values.items():
            row[name] = value
    return RobotDistances(out, np.zeros((len(rows), 2)) if gradient is None else gradient, ["a", "b"], ["wall", "pin"])


def test_names_of_bodies_and_of_what_is_around():
    measured = made({"a": 0, "b": 1}, {"a": 1, "b": 0}, {"a": 1, "b": -1}, {"a": 0, "b": -2}, {"a": -1, "b": 0})
    assert measured.names == [("a", "b"), ("b", "a"), ("b", "wall"), ("a", "pin"), None]
    assert made().names == [] and len(made()) == 0


@pytest.mark.parametrize(("values", "reason"), [
    ({"beyond": True, "certified": True}, "beyond"),
    ({"beyond": True}, "beyond"),
    ({"certified": True, "distance": 0.0}, "touching"),
    ({"certified": True, "distance": 5e-324}, None),
    ({"certified": True, "distance": -0.5, "hit": True}, None),
    ({"distance": -0.5, "upper": -0.25, "hit": True}, "depth"),
    ({"distance": -0.5, "upper": 0.0, "hit": True}, "depth"),
    ({"distance": -0.5, "upper": 5e-324, "hit": True}, "bracket"),
    ({"distance": -0.5, "upper": -0.25, "hit": False}, "bracket"),
    ({"distance": 0.5, "upper": 1.0}, "bracket"),
])
def test_why_there_is_no_gradient(values, reason):
    assert made(values).no_gradient == [NO_GRADIENT[reason] if reason else None]
    without = made(values, gradient=np.array([[0.0, np.nan]]))
    assert without.no_gradient == [NO_GRADIENT[reason or "normal"]]


def test_fields_are_attributes_and_others_are_told():
    measured = made({"distance": 1.0, "point_a": (1, 2, 3)}, {"distance": 2.0})
    assert measured.distance.tolist() == [1.0, 2.0] and measured.point_a[0].tolist() == [1, 2, 3]
    assert measured.gradient.shape == (2, 2)
    with pytest.raises(AttributeError, match=r"no 'depth'; it has distance, lower, upper, normal, .*, beyond$"):
        measured.depth  # noqa: B018


def test_the_least_distance_is_of_what_is_within_the_limit():
    far = {"distance": -9.0, "beyond": True}
    assert repr(made({"distance": 0.25}, {"distance": -0.5, "hit": True}, far)) == (
        "RobotDistances(3 configurations, 1 in collision, least -0.5 m)"
    )
    assert repr(made(far)) == "RobotDistances(1 configurations, 0 in collision)"
    assert repr(made()) == "RobotDistances(0 configurations, 0 in collision)"


def test_rows_of_configurations_begin_and_end_at_starts():
    rows = np.zeros(4, dtype=NEAREST_DTYPE)
    rows["distance"], rows["hit"] = [0.5, -0.25, 1.0, 2.0], [False, True, False, False]
    measured = RobotDistances(rows, np.zeros((4, 2)), ["a", "b"], ["wall"], np.array([0, 0, 3, 3, 4]))
    assert measured.configuration.tolist() == [1, 1, 1, 3] and len(measured) == 4
    assert repr(measured) == "RobotDistances(4 rows of 4 configurations, 1 hits, least -0.25 m)"
    one_each = made({"distance": 1.0}, {"distance": 2.0})
    assert one_each.configuration.tolist() == [0, 1] and one_each.starts.tolist() == [0, 1, 2]
    assert made().configuration.tolist() == [] and made().starts.tolist() == [0]
