"""What the families are made of: hulls, boxes, prisms, spheres of points; rotations and poses."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from collide.scenes.families.case import Body
from collide.transforms import pose

#: Directions in which `random_hull` looks for vertices.
_DIRECTIONS = np.random.default_rng(24).standard_normal((256, 3))

#: The 24 rotations with entries 0 and ±1, (24, 3, 3): exact in doubles.
EXACT_ROTATIONS = np.array(
    [
        R
        for order in permutations(range(3))
        for signs in product((1.0, -1.0), repeat=3)
        for R in [np.diag(signs)[list(order)]]
        if np.linalg.det(R) > 0
    ]
)


def random_hull(rng: np.random.Generator, max_points: int = 64) -> np.ndarray:
    """4 to ``max_points`` Gaussian points, with probability 0.6 put on the unit sphere, each axis scaled by
    0.5 to 1.5, hull vertices kept (n, 3).

    Those are kept that are extreme in one of 256 directions: vertices for certain, and found without
    a hull algorithm.
    """
    points = rng.standard_normal((int(rng.integers(4, max_points + 1)), 3))
    if rng.random() < 0.6:
        points /= np.linalg.norm(points, axis=1)[:, None]
    else:
        extreme = np.unique((points @ _DIRECTIONS.T).argmax(axis=0))
        points = points[extreme] if len(extreme) >= 4 else points
    return points * rng.uniform(0.5, 1.5, 3)


def box(size) -> np.ndarray:
    """The 8 corners of a box with these full lengths (3,), centred."""
    return (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * np.asarray(size, dtype=float)


def sphere(rng: np.random.Generator, n: int, radius: float = 1.0) -> np.ndarray:
    """n uniform points on a sphere (n, 3)."""
    points = rng.standard_normal((n, 3))
    return points * (radius / np.linalg.norm(points, axis=1))[:, None]


def circle(sides: int, radius: float = 1.0) -> np.ndarray:
    """Corners (sides, 3) of a regular polygon in the plane z = 0."""
    angles = 2 * np.pi * np.arange(sides) / sides
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(sides)])


def prism(sides: int, radius: float, height: float) -> np.ndarray:
    """The 2·sides corners of a prism along z, centred."""
    cap, up = circle(sides, radius), np.array([0.0, 0.0, height / 2])
    return np.concatenate([cap - up, cap + up])


def bipyramid(sides: int, radius: float, height: float) -> np.ndarray:
    """A regular polygon with two apices, each the neighbour of all its corners (sides + 2, 3)."""
    apices = np.array([[0.0, 0.0, height / 2], [0.0, 0.0, -height / 2]])
    return np.concatenate([circle(sides, radius), apices])


def direction(rng: np.random.Generator) -> np.ndarray:
    """A uniform unit vector."""
    d = rng.standard_normal(3)
    return d / np.linalg.norm(d)


def rotation(rng: np.random.Generator) -> np.ndarray:
    """A uniform rotation, orthonormal to rounding."""
    return pose(quat_wxyz=rng.standard_normal(4))[:3, :3]


def rotation_about(axis: int, angle: float) -> np.ndarray:
    """Rotation about a coordinate axis by an angle [rad], from cosine and sine as they round."""
    c, s = np.cos(angle), np.sin(angle)
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def anywhere(rng: np.random.Generator, points: np.ndarray, spread: float = 1.0) -> Body:
    """Points in a random pose: uniform rotation, translation within ±spread [m]."""
    return Body(points, rotation(rng), rng.uniform(-spread, spread, 3))


def random_body(rng: np.random.Generator) -> Body:
    """A random hull in a random pose."""
    return anywhere(rng, random_hull(rng))


def sign(rng: np.random.Generator) -> float:
    """1 or -1."""
    return float(rng.choice((-1.0, 1.0)))


def power(rng: np.random.Generator, low: float, high: float) -> float:
    """10^U(low, high)."""
    return float(10.0 ** rng.uniform(low, high))


def decimals(rng: np.random.Generator, low: float, high: float, n: int = 3) -> np.ndarray:
    """n numbers of two decimals, as doubles."""
    return np.round(rng.uniform(low, high, n), 2)
