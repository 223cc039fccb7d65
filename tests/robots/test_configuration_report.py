"""One configuration explained: which pairs are listed, in which order, how many, and what the text says of them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from naive import pose
from random_robots import slider

import collide
from collide.robots.configuration_report import ConfigurationReport, ExplainedPair
from collide.robots.robot import LinkShape


def pair(name: str, distance: float) -> ExplainedPair:
    zero = np.zeros(3)
    return ExplainedPair("cart", name, distance, distance, distance, zero, np.array([1.0, -0.25, 1 / 3]), zero)


def report(collisions=(), nearest=(), notes=(), skipped=None) -> ConfigurationReport:
    return ConfigurationReport(np.zeros(1), list(collisions), list(nearest), list(notes), 12, skipped or {}, "arm")


def test_the_text_of_a_free_configuration():
    assert str(report()) == "arm: free (12 pairs tested)\n  nothing within 0.1 m"
    text = str(report(nearest=[pair("wall", 0.0125)], notes=["a note"], skipped={"b reason": 1, "a reason": 20}))
    assert text.split("\n") == [
        "arm: free (12 pairs tested)", "  near: cart and wall, 12.5 mm apart, at (1, -0.25, 0.3333) m", "  a note",
        "  never tested: 20 pairs, a reason", "  never tested: 1 pairs, b reason",
    ]


def test_the_text_of_a_collision():
    made = report([pair("wall", -0.0125), pair("pin", 0.0)])
    assert made.collides and not report(nearest=[pair("wall", 1.0)]).collides
    assert str(made).split("\n") == [
        "arm: in collision (12 pairs tested)", "  collides: cart and wall, 12.5 mm deep, at (1, -0.25, 0.3333) m",
        "  collides: cart and pin, -0 mm deep, at (1, -0.25, 0.3333) m",
    ]


@pytest.mark.parametrize(("n", "more"), [(1, 0), (8, 0), (9, 1), (11, 3)])
@pytest.mark.parametrize("title", ["collides", "near"])
def test_of_many_pairs_eight_are_listed_and_the_others_counted(n, more, title):
    pairs = [pair(f"body{k}", -0.5) for k in range(n)]
    lines = str(report(pairs) if title == "collides" else report((), pairs)).split("\n")[1:]
    assert len(lines) == n - more + (more > 0) and all(line.startswith(f"  {title}: ") for line in lines)
    assert (lines[-1] == f"  {title}: {more} more pairs") == (more > 0)


def test_pairs_of_a_checker_deepest_first_then_nearest_first():
    world = collide.World()
    for name, x in (("far", 0.301), ("near", 0.25), ("deep", 0.125), ("hit", 0.1875), ("edge", 0.299)):
        world.add(collide.Sphere(0.1), pose(t=(x, 0, 0)), name=name)
    base = [LinkShape(collide.Sphere(0.1), pose(t=(0, 0, 0.3)), None, "test")]
    robot = slider(base=base)
    robot.semantic_pairs = ()  # base and cart are tested
    checker = collide.RobotChecker(robot, world, allowed=[("base", name) for name in world.names.values()])
    made = checker.explain([0.0])
    assert [each[:2] for each in made.collisions] == [("cart", "deep"), ("cart", "hit")]
    assert [each[:2] for each in made.nearest] == [("cart", "near"), ("cart", "edge"), ("cart", "base")]
    assert made.n_pairs == 6 and made.skipped == {"allowed": 5} and made.robot == "slider"
    deep = made.collisions[0]
    assert abs(deep.distance + 0.075) <= 1e-15 and deep.lower <= deep.distance <= deep.upper
    assert np.allclose(deep.normal, (1, 0, 0)) and np.allclose(deep.point_a, (0.1, 0, 0))
    assert np.allclose(deep.point_b, (0.025, 0, 0))


def test_a_base_that_stands_elsewhere_and_limits():
    world = collide.World()
    world.add(collide.Sphere(0.1), pose(t=(4.0, 0, 0)), name="ball")
    made = collide.RobotChecker(slider(), world, X_WR=pose(t=(2.75, 0, 0))).explain([1.0625])
    assert made.collides and made.notes == ["robot slider: joint slide at 1.0625 m is outside its limits [-1, 1]"]
    assert re.search(r"cart and ball, 12\.5 mm deep, at \(3\.9\d*, 0, 0\) m", str(made))
    assert not collide.RobotChecker(slider(), world).explain([1.0]).collides
