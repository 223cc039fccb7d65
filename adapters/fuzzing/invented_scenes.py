"""Scenes invented from a seed: pairs and Worlds of every shape, near touching, resting, degenerate, and robots.

Where near pairs are put depends on collide's own distance; whether they are there is for the judge to say. Every case
tells its source.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case, cases_of, pair_case, pair_of
from collide.adapters.fuzzing.invented_shapes import (
    Random,
    any_pose,
    any_rotation,
    any_shape,
    extent,
    length,
    reach,
)
from collide.adapters.fuzzing.simpler_cases import at_distance
from collide.adapters.peers.question import Body, Question
from collide.errors import CollideError
from collide.scenes import families, load
from collide.scenes.generators import generate
from collide.shapes import Box, ConvexHull, Halfspace, Sphere
from collide.transforms import pose

#: Pairs of a World that are asked of other engines.
MAX_WORLD_PAIRS = 12
#: Families whose cases take exact arithmetic long.
_LARGE = ("spheres_big", "cyl1000", "bipyramids", "repeats")


def invent(seed: int, round_number: int, n: int = 60) -> list[Case]:
    """The cases of one round: the same ones for the same numbers.

    seed, round_number : whole numbers ≥ 0.   n : about how many pairs.
    """
    cases: list[Case] = []
    names, shares = list(SOURCES), [share for share, _ in SOURCES.values()]
    k = 0
    while len(cases) < n:
        rng = np.random.default_rng([seed, round_number, k])
        name = names[int(rng.choice(len(names), p=shares))]
        try:
            cases += [case._replace(source=name) for case in SOURCES[name][1](rng)]
        except CollideError:
            pass  # sizes that no shape has
        k += 1
    return cases


def _random_pairs(rng: Random) -> list[Case]:
    """Anywhere near each other."""
    A, B = any_shape(rng), any_shape(rng)
    return [pair_case(A, B, any_pose(rng), any_pose(rng, reach(A) + reach(B)))]


def _near_pairs(rng: Random) -> list[Case]:
    """Moved along their normal to a gap or a depth of 1e-1 … 1e-12 of a length."""
    case = _random_pairs(rng)[0]
    gap = reach(case.bodies[0].shape) * 10.0 ** -int(rng.integers(1, 13)) * float(rng.choice([1, 1, -1]))
    moved = at_distance(case, gap)
    return [] if moved is None else [moved]


def _resting_pairs(rng: Random) -> list[Case]:
    """One on top of the other, axis-aligned, with decimal numbers: touching within rounding, or a plain gap."""
    A, B = any_shape(rng), any_shape(rng)
    top, bottom = extent(A), extent(B)
    if top is None or bottom is None:
        return []
    gap = float(rng.choice([0.0, 0.0, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3, -1e-3]))
    x, y = (round(float(v), 2) for v in rng.uniform(-0.5, 0.5, 2) * (rng.random() < 0.7))
    at = pose((x, y, top[1] - bottom[0] + gap))
    if rng.random() < 0.3:  # a half-space below
        return [pair_case(Halfspace((0, 0, 1), 0.0), B, pose(), pose((x, y, gap - bottom[0])))]
    return [pair_case(A, B, pose(), at)]


# --- degenerate pairs -----------------------------------------------------------------------------


def _thin(rng: Random) -> list[Case]:
    """Needles and plates, a hundredth to a hundred-millionth as thick as long."""
    sizes = np.ones(3)
    for axis in rng.choice(3, int(rng.integers(1, 3)), replace=False):
        sizes[axis] = 10.0 ** -int(rng.integers(2, 9))
    hull = np.round(rng.standard_normal((8, 3)), 2) * sizes
    return _brought_near(rng, Box(sizes * length(rng)) if rng.random() < 0.5 else ConvexHull(hull), any_shape(rng))


def _flat_hulls(rng: Random) -> list[Case]:
    """Hulls of a few points in one plane, one of them twice: points, segments, polygons."""
    points = np.round(rng.uniform(-1, 1, (int(rng.integers(1, 6)), 3)), 1)
    points[:, 2] = 0.0
    return _brought_near(rng, ConvexHull(np.concatenate([points, points[:1]])), any_shape(rng))


def _tiny_and_huge(rng: Random) -> list[Case]:
    A = ConvexHull(np.round(rng.standard_normal((6, 3)), 2) * 10.0 ** rng.uniform(-6, -3))
    tiny = Sphere(10.0 ** rng.uniform(-6, -3)) if rng.random() < 0.5 else A
    return _brought_near(rng, tiny, Box(np.full(3, 10.0 ** rng.uniform(1, 4))))


def _far_away(rng: Random) -> list[Case]:
    """Both bodies 100 m to 100 km from the origin."""
    far = rng.standard_normal(3) * 10.0 ** rng.uniform(2, 5)
    X_WA, X_WB = any_pose(rng), any_pose(rng)
    X_WA[:3, 3] += far
    X_WB[:3, 3] += far
    return [pair_case(any_shape(rng), any_shape(rng), X_WA, X_WB)]


def _concentric(rng: Random) -> list[Case]:
    X = any_pose(rng)
    return [pair_case(any_shape(rng), any_shape(rng), X, pose(X[:3, 3], R=any_rotation(rng)))]


def _identical(rng: Random) -> list[Case]:
    A, X = any_shape(rng), any_pose(rng)
    return [pair_case(A, A, X, X)]


def _brought_near(rng: Random, A, B) -> list[Case]:
    """The pair at a gap or a depth of 1e-1 … 1e-11 of a length, where that can be told."""
    case = pair_case(A, B, any_pose(rng), any_pose(rng))
    moved = at_distance(case, reach(B) * 10.0 ** -int(rng.integers(1, 12)) * float(rng.choice([1, -1])))
    return [case if moved is None else moved]


# --- families, Worlds, robots ---------------------------------------------------------------------


def _family_cases(rng: Random) -> list[Case]:
    """Pairs of the hard families."""
    names = [name for name in (*families.names(), *families.mesh_names()) if name not in _LARGE]
    made = families.generate(str(rng.choice(names)), 2, int(rng.integers(1 << 30)))
    return [pair_case(*case.shapes()) for case in made]


def _worlds(rng: Random) -> list[Case]:
    """Clutter and stacks: some of their pairs, and the World they are in."""
    if rng.random() < 0.5:
        density = float(rng.uniform(0.2, 2))
        scene = generate("clutter", int(rng.integers(1 << 30)), n=int(rng.integers(4, 14)), density=density)
    else:
        scene = generate("stack", int(rng.integers(1 << 30)), layers=2, wide=2, jitter=float(rng.choice([0.0, 0.01])))
    return _of_question(rng, Question.from_scene(scene))


@cache
def _robot_scene():
    return load("workcell")


def _robots(rng: Random) -> list[Case]:
    """The arm over its bench, in any configuration: pairs near each other."""
    scene = _robot_scene()
    joints = {}
    for placement in scene.placements.values():
        robot = placement.robot
        for name, low, high in zip(robot.joint_names, robot.lower, robot.upper):
            joints[name] = float(rng.uniform(max(low, -math.pi), min(high, math.pi)))
    return _of_question(rng, Question.from_scene(scene.with_state(joints)))


def _of_question(rng: Random, question: Question) -> list[Case]:
    cases = cases_of(question)
    if len(cases) > MAX_WORLD_PAIRS:
        cases = [cases[k] for k in rng.choice(len(cases), MAX_WORLD_PAIRS, replace=False)]
    worlds = []
    for k in rng.choice(len(question.pairs), min(3, len(question.pairs)), replace=False):
        i, j = question.pairs[k]
        others = [b for m, b in enumerate(question.bodies) if m not in (i, j)]
        bodies = [*pair_of(question, i, j).bodies, *(Body(f"C{m}", b.shape, b.X_WB) for m, b in enumerate(others))]
        worlds.append(Case(tuple(bodies), world=True))
    return cases + worlds


#: Where cases come from: name → share, and what makes them.
SOURCES: dict[str, tuple[float, Callable[[Random], list[Case]]]] = {
    "random": (0.22, _random_pairs), "near touching": (0.26, _near_pairs), "resting": (0.14, _resting_pairs),
    "thin": (0.03, _thin), "flat": (0.03, _flat_hulls), "tiny and huge": (0.03, _tiny_and_huge),
    "far away": (0.03, _far_away), "concentric": (0.03, _concentric), "identical": (0.03, _identical),
    "hard family": (0.14, _family_cases), "world": (0.04, _worlds), "robot": (0.02, _robots),
}
assert math.isclose(sum(share for share, _ in SOURCES.values()), 1.0)
