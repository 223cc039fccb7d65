"""The same pairs small, large, unequal, far from the origin, and with rotations that are none."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.box_cases import boxes_flush, boxes_rest
from collide.scenes.families.case import Body, Case, mean_diagonal, pair
from collide.scenes.families.exact_gaps import set_gap
from collide.scenes.families.ingredients import anywhere, direction, power, random_body, random_hull, sign


def scale(rng, index) -> Case:
    """A random pair scaled by 10^e, e = -6 … 6 in turn, gaps ±10^U(-4,0)·L."""
    factor = 10.0 ** (index % 13 - 6)
    bodies = [Body(b.points * factor, b.R, b.t * factor) for b in (random_body(rng), random_body(rng))]
    case = pair(*bodies)
    return set_gap(case, sign(rng) * power(rng, -4, 0) * mean_diagonal(case), direction(rng))


def tiny_vs_huge(rng, index) -> Case:
    """One hull ×1e-4 against one ×1e4, gap ±1e-4·10^U(-3,0.5)."""
    case = pair(anywhere(rng, 1e-4 * random_hull(rng)), anywhere(rng, 1e4 * random_hull(rng)))
    case = set_gap(case, sign(rng) * 1e-4 * power(rng, -3, 0.5), direction(rng))
    return case if index % 2 else case.swapped()


def far_origin(rng, index) -> Case:
    """Both bodies moved by 10^3 … 10^8 in turn, gaps ±10^U(-4,-0.5)·L."""
    far = direction(rng) * 10.0 ** (3 + index % 6)
    bodies = [b._replace(t=b.t + far) for b in (random_body(rng), random_body(rng))]
    case = pair(*bodies)
    return set_gap(case, sign(rng) * power(rng, -4, -0.5) * mean_diagonal(case), direction(rng))


def badrot(rng, index) -> Case:
    """Random pairs with Gaussian noise of 1e-7 on every entry of both rotation matrices; gaps
    ±10^U(-4,-0.5)·L, as the matrices stand."""
    bodies = [b._replace(R=b.R + 1e-7 * rng.standard_normal((3, 3))) for b in (random_body(rng), random_body(rng))]
    case = pair(*bodies)
    return set_gap(case, sign(rng) * power(rng, -4, -0.5) * mean_diagonal(case), direction(rng))


def tiny_motions(rng, index, steps: int = 1000) -> Case:
    """Flush boxes carried along by a chain of tiny motions: both poses are multiplied `steps` times by
    the same rotation of 10^U(-6,-2) rad and a small step, and drift from orthonormal as they go."""
    start = (boxes_flush if index % 2 else boxes_rest)(rng, index // 2)
    X1, X2 = (_matrix(b) for b in (start.a, start.b))
    motion = np.eye(4)
    motion[:3, :3] = _small_rotation(direction(rng) * power(rng, -6, -2))
    motion[:3, 3] = 1e-3 * direction(rng)
    for _ in range(steps):
        X1, X2 = motion @ X1, motion @ X2
    return start._replace(R1=X1[:3, :3].copy(), t1=X1[:3, 3].copy(), R2=X2[:3, :3].copy(), t2=X2[:3, 3].copy())


def _small_rotation(v: np.ndarray) -> np.ndarray:
    """Rodrigues' formula for a rotation vector (3,) that is not 0 [rad]."""
    angle = np.linalg.norm(v)
    x, y, z = v / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


def _matrix(body: Body) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = body.R, body.t
    return X


FAMILIES = (scale, tiny_vs_huge, far_origin, badrot)
MORE_FAMILIES = (tiny_motions,)
