"""Scenes invented from a seed: pairs and Worlds of every shape, near touching, resting, degenerate, and robots.

What depends on the engine under test is where near pairs are put; whether they are there is for the judge to say.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np

from collide.adapters.fuzzing.fuzz_case import Case, cases_of, pair_case, pair_of
from collide.adapters.fuzzing.simpler_cases import at_distance
from collide.adapters.peers.question import Body, Question
from collide.errors import CollideError
from collide.scenes import families, load
from collide.scenes.families.ingredients import EXACT_ROTATIONS, rotation
from collide.scenes.generators import generate
from collide.shapes import (
    Box,
    Capsule,
    Compound,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    Halfspace,
    HeightField,
    HPolytope,
    Mesh,
    Shape,
    Sphere,
)
from collide.transforms import pose

#: Pairs of a World that are asked of other engines.
MAX_WORLD_PAIRS = 12
#: Families whose cases take exact arithmetic long.
_LARGE = ("spheres_big", "cyl1000", "bipyramids", "repeats")
Random = np.random.Generator


def invent(seed: int, round_number: int, n: int = 60) -> list[Case]:
    """The cases of one round: the same ones for the same numbers.

    seed, round_number : whole numbers ≥ 0.   n : about how many pairs.
    """
    cases: list[Case] = []
    kinds = list(_SOURCES)
    k = 0
    while len(cases) < n:
        rng = np.random.default_rng([seed, round_number, k])
        source = kinds[int(rng.choice(len(kinds), p=[share for share in _SOURCES.values()]))]
        try:
            cases += source(rng)
        except CollideError:
            pass  # sizes that no shape has
        k += 1
    return cases


# --- sizes, shapes, poses -------------------------------------------------------------------------


def _length(rng: Random) -> float:
    """A length as people write it, or any [m]."""
    kind = rng.random()
    if kind < 0.4:
        return float(rng.choice([0.1, 0.2, 0.25, 0.3, 0.5, 1.0, 1.5, 2.0, 3.0]))
    if kind < 0.8:
        return float(round(rng.uniform(0.01, 2.0), 2)) or 0.5
    return float(10.0 ** rng.uniform(-3, 1.5))


def _box_mesh(size: np.ndarray) -> Mesh:
    corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * size
    faces = [(0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5), (2, 3, 7), (2, 7, 6), (0, 2, 6),
             (0, 6, 4), (1, 5, 7), (1, 7, 3)]  # fmt: skip
    return Mesh(corners, faces)


def _hull(rng: Random) -> Shape:
    points = rng.standard_normal((int(rng.integers(4, 20)), 3)) * _length(rng)
    if rng.random() < 0.5:
        points = np.round(points, 2)
    return ConvexHull(points, radius=_length(rng) if rng.random() < 0.1 else 0.0)


def _hpolytope(rng: Random) -> Shape:
    normals = np.concatenate([np.eye(3), -np.eye(3), np.round(rng.uniform(-1, 1, (3, 3)), 1)])
    normals = normals[np.abs(normals).sum(axis=1) > 0]
    return HPolytope(normals, np.full(len(normals), _length(rng)))


def _mesh(rng: Random) -> Shape:
    if rng.random() < 0.5:
        return _box_mesh(np.array([_length(rng) for _ in range(3)]))
    case = families.generate(str(rng.choice(families.mesh_names())), 1, int(rng.integers(1 << 30)))[0]
    return case.shapes()[int(rng.integers(2))]


def _height_field(rng: Random) -> Shape:
    heights = rng.uniform(0, 1, rng.integers(2, 5, 2)) * _length(rng)
    return HeightField(np.round(heights, 2) if rng.random() < 0.5 else heights, _length(rng))


def _compound(rng: Random) -> Shape:
    parts = [(_ROUND_AND_FLAT[int(rng.integers(len(_ROUND_AND_FLAT)))](rng), _pose(rng)) for _ in range(3)]
    return Compound(parts)


_ROUND_AND_FLAT: list[Callable[[Random], Shape]] = [
    lambda rng: Sphere(_length(rng)),
    lambda rng: Box([_length(rng) for _ in range(3)]),
    lambda rng: Capsule(_length(rng), _length(rng)),
    lambda rng: Cylinder(_length(rng), _length(rng)),
    lambda rng: Cone(_length(rng), _length(rng)),
    lambda rng: Ellipsoid([_length(rng) for _ in range(3)]),
    _hull,
]
_SHAPES = [*_ROUND_AND_FLAT, *_ROUND_AND_FLAT, _hpolytope, _mesh, _mesh, _height_field, _compound]


def _shape(rng: Random) -> Shape:
    return _SHAPES[int(rng.integers(len(_SHAPES)))](rng)


def _rotation(rng: Random) -> np.ndarray:
    kind = rng.random()
    if kind < 0.35:
        return np.eye(3)
    if kind < 0.55:
        return EXACT_ROTATIONS[int(rng.integers(len(EXACT_ROTATIONS)))]
    if kind < 0.7:  # barely tilted
        return pose(rpy=rng.standard_normal(3) * 10.0 ** rng.uniform(-9, -2))[:3, :3]
    if kind < 0.8:
        return pose(rpy=np.radians(15.0) * rng.integers(0, 24, 3))[:3, :3]
    return rotation(rng)


def _pose(rng: Random, spread: float = 1.0) -> np.ndarray:
    t = rng.uniform(-spread, spread, 3)
    return pose(np.round(t, 2) if rng.random() < 0.5 else t, R=_rotation(rng))


def _reach(shape: Shape) -> float:
    from_origin = [1.0]
    for name in ("radius", "length"):
        from_origin += [float(getattr(shape, name))] if hasattr(shape, name) else []
    for name in ("size", "radii", "points", "vertices"):
        from_origin += [float(np.abs(getattr(shape, name)).max())] if hasattr(shape, name) else []
    return max(from_origin[1:] or from_origin)


# --- sources of cases -----------------------------------------------------------------------------


def _random_pairs(rng: Random) -> list[Case]:
    """Anywhere near each other."""
    A, B = _shape(rng), _shape(rng)
    return [pair_case(A, B, _pose(rng), _pose(rng, _reach(A) + _reach(B)))]


def _near_pairs(rng: Random) -> list[Case]:
    """Moved along their normal to a gap or a depth of 1e-1 … 1e-12 of a length."""
    case = _random_pairs(rng)[0]
    gap = _reach(case.bodies[0].shape) * 10.0 ** -int(rng.integers(1, 13)) * float(rng.choice([1, 1, -1]))
    moved = at_distance(case, gap)
    return [] if moved is None else [moved]


def _resting_pairs(rng: Random) -> list[Case]:
    """One on top of the other, axis-aligned, with decimal numbers: touching within rounding, or a plain gap."""
    A, B = _shape(rng), _shape(rng)
    top, bottom = _extent(A), _extent(B)
    if top is None or bottom is None:
        return []
    gap = float(rng.choice([0.0, 0.0, 1e-9, -1e-9, 1e-6, -1e-6, 1e-3, -1e-3]))
    x, y = (round(float(v), 2) for v in rng.uniform(-0.5, 0.5, 2) * (rng.random() < 0.7))
    at = pose((x, y, top[1] - bottom[0] + gap))
    if rng.random() < 0.3:  # a half-space below
        return [pair_case(Halfspace((0, 0, 1), 0.0), B, pose(), pose((x, y, gap - bottom[0])))]
    return [pair_case(A, B, pose(), at)]


def _extent(shape: Shape) -> tuple[float, float] | None:
    """The least and the greatest z of a shape in its own frame [m]; None where that is not plain."""
    if isinstance(shape, Sphere):
        return -shape.radius, shape.radius
    if isinstance(shape, Box):
        return -shape.size[2] / 2, shape.size[2] / 2
    if isinstance(shape, Capsule):
        return -shape.length / 2 - shape.radius, shape.length / 2 + shape.radius
    if isinstance(shape, Cylinder | Cone):
        return -shape.length / 2, shape.length / 2
    if isinstance(shape, Ellipsoid):
        return -shape.radii[2], shape.radii[2]
    points = getattr(shape, "points", None) if isinstance(shape, ConvexHull) else getattr(shape, "vertices", None)
    return None if points is None else (float(points[:, 2].min()), float(points[:, 2].max()))


def _degenerate_pairs(rng: Random) -> list[Case]:
    """Needles, plates, flat and doubled hulls, tiny against huge, far from the origin, concentric, identical."""
    kind = int(rng.integers(6))
    A, B = _shape(rng), _shape(rng)
    if kind == 0:
        thin = [1.0, 1.0, 1.0]
        thin[int(rng.integers(3))] = 10.0 ** -int(rng.integers(2, 9))
        A = Box(np.array(thin) * _length(rng)) if rng.random() < 0.5 else ConvexHull(
            np.round(rng.standard_normal((8, 3)), 2) * thin)  # fmt: skip
    elif kind == 1:
        points = np.round(rng.uniform(-1, 1, (int(rng.integers(1, 6)), 3)), 1)
        points[:, 2] = 0.0
        A = ConvexHull(np.concatenate([points, points[:1]]))
    elif kind == 2:
        A, B = Sphere(10.0 ** rng.uniform(-6, -3)), Box(np.full(3, 10.0 ** rng.uniform(1, 4)))
    elif kind == 3:
        far = rng.standard_normal(3) * 10.0 ** rng.uniform(2, 5)
        X_WA, X_WB = _pose(rng), _pose(rng)
        X_WA[:3, 3] += far
        X_WB[:3, 3] += far
        return [pair_case(A, B, X_WA, X_WB)]
    elif kind == 4:
        X = _pose(rng)
        return [pair_case(A, B, X, pose(X[:3, 3], R=_rotation(rng)))]
    else:
        X = _pose(rng)
        return [pair_case(A, A, X, X)]
    case = pair_case(A, B, _pose(rng), _pose(rng))
    moved = at_distance(case, _reach(B) * 10.0 ** -int(rng.integers(1, 12)) * float(rng.choice([1, -1])))
    return [case if moved is None else moved]


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


#: Where cases come from, and their shares.
_SOURCES: dict[Callable[[Random], list[Case]], float] = {
    _random_pairs: 0.22, _near_pairs: 0.26, _resting_pairs: 0.16, _degenerate_pairs: 0.16, _family_cases: 0.14,
    _worlds: 0.04, _robots: 0.02,
}  # fmt: skip
assert math.isclose(sum(_SOURCES.values()), 1.0)
