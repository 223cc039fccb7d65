"""Bodies with hardly any volume, or none: needles, plates, polygons, segments, points."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import Body, Case, mean_diagonal, pair
from collide.scenes.families.exact_gaps import set_gap
from collide.scenes.families.ingredients import anywhere, box, direction, power, random_hull, rotation, sign


def needles(rng, index) -> Case:
    """Hulls squeezed by a = 10^-6 … 10^-9 in two axes, against normal or equally squeezed hulls; gaps
    10^U(-4,-1) and ±a·10^U(-2,-0.5)."""
    a = 10.0 ** -(6 + index % 4)
    squeeze = np.array([1.0, a, a])
    B = random_hull(rng) * (squeeze if rng.random() < 0.5 else 1.0)
    case = pair(anywhere(rng, random_hull(rng) * squeeze), anywhere(rng, B))
    return set_gap(case, _thin_gap(rng, a), direction(rng))


def plates(rng, index) -> Case:
    """Hulls squeezed by a = 10^-6 … 10^-9 in one axis, against normal or equally squeezed hulls; gaps
    as for needles; a quarter of the plates parallel."""
    a = 10.0 ** -(6 + index % 4)
    squeeze = np.array([1.0, 1.0, a])
    A = anywhere(rng, random_hull(rng) * squeeze)
    if index // 4 % 4 == 0:
        B = Body(random_hull(rng) * squeeze, A.R, rng.uniform(-1, 1, 3))
        return set_gap(pair(A, B), _thin_gap(rng, a), A.R[:, 2])
    B = anywhere(rng, random_hull(rng) * (squeeze if rng.random() < 0.5 else 1.0))
    return set_gap(pair(A, B), _thin_gap(rng, a), direction(rng))


def _thin_gap(rng, a: float) -> float:
    if rng.random() < 0.33:
        return power(rng, -4, -1)
    return sign(rng) * a * power(rng, -2, -0.5)


def flat(rng, index) -> Case:
    """Planar polygons of 3 to 11 points (zero volume) against polygons or hulls: apart, crossing,
    exactly coplanar or resting on each other, gap 10^-5 … 10^-13."""
    A = Body(_polygon(rng), rotation(rng), rng.uniform(-1, 1, 3))
    points = _polygon(rng) if rng.random() < 0.5 else random_hull(rng)
    situation = index % 5
    if situation == 0:
        case = pair(A, anywhere(rng, points))
        return set_gap(case, power(rng, -2, 0) * mean_diagonal(case), direction(rng))
    if situation == 1:
        return pair(A, Body(points, rotation(rng), A.t + 0.5 * direction(rng)))
    if situation == 2:  # the same plane, to the last bit: the shift is in the polygon's own coordinates
        shift = rng.uniform(-1.5, 1.5, 3) * [1, 1, 0]
        return pair(A, Body(_polygon(rng) + shift, A.R, A.t))
    if situation == 3:
        return pair(A, Body(_standing(points, rng), A.R, A.t))
    case = pair(A, anywhere(rng, points))
    return set_gap(case, 10.0 ** -rng.uniform(5, 13), direction(rng))


def _polygon(rng) -> np.ndarray:
    """3 to 11 corners on an ellipse in the plane z = 0, (n, 3)."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, int(rng.integers(3, 12))))
    return np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))]) * [*rng.uniform(0.5, 1.5, 2), 1]


def _standing(points: np.ndarray, rng) -> np.ndarray:
    """Points moved to rest on z = 0 exactly, or 10^-5 … 10^-13 above it; a corner or a face down."""
    points = points - [0, 0, points[:, 2].min()]
    if rng.random() < 0.5:
        points[np.argsort(points[:, 2])[:3], 2] = 0.0
    above = float(rng.choice((0.0, 1.0))) * 10.0 ** -rng.uniform(5, 13)
    return points + np.array([0, 0, above])


def degenerate(rng, index) -> Case:
    """Single points, segments, collinear sets, every vertex twice, 4×4×4 grids (interior and coplanar
    points), hulls with interior points; apart, overlapping, gap 10^-6 … 10^-11."""
    bodies = [anywhere(rng, _DEGENERATE[int(rng.integers(len(_DEGENERATE)))](rng)) for _ in range(2)]
    case = pair(*bodies)
    size = mean_diagonal(case) or 1.0
    if index % 3 == 0:
        return set_gap(case, power(rng, -2, 0) * size, direction(rng))
    if index % 3 == 1:
        between = direction(rng) * rng.uniform(0, 0.3) * size
        return case.moved(case.a.world().mean(axis=0) + between - case.b.world().mean(axis=0))
    return set_gap(case, 10.0 ** -rng.uniform(6, 11), direction(rng))


def _collinear(rng) -> np.ndarray:
    """Points p + k d for multiples of 1/8, exactly on a line."""
    d = rng.integers(-8, 9, 3) + np.array([0, 0, 9])
    return rng.integers(-16, 17, (int(rng.integers(3, 9)), 1)) / 8.0 * (d / 16.0)


def _with_interior(rng) -> np.ndarray:
    """A hull and 20 points inside it."""
    hull = random_hull(rng)
    weights = rng.dirichlet(np.ones(len(hull)), 20)
    return np.concatenate([weights @ hull, hull])


_DEGENERATE = (
    lambda rng: rng.uniform(-1, 1, (1, 3)),
    lambda rng: rng.uniform(-1, 1, (2, 3)),
    _collinear,
    lambda rng: np.repeat(random_hull(rng), 2, axis=0),
    lambda rng: np.indices((4, 4, 4)).reshape(3, 64).T * rng.uniform(0.1, 0.5, 3),
    _with_interior,
)


def long_boxes(rng, index) -> Case:
    """Boxes 1 m long and 10^-2 … 10^-6 m thick, flush along their length: side by side, across each
    other, and end to end; sizes of two digits, or exactly dyadic every other time."""
    thickness = 10.0 ** -(2 + index // 2 % 5)
    if index % 2:
        thickness = 2.0 ** round(np.log2(thickness))
        length = rng.integers(8, 17) / 8.0
    else:
        thickness, length = thickness * round(float(rng.uniform(1, 9)), 1), round(float(rng.uniform(0.5, 2)), 2)
    size = np.array([length, thickness, thickness])
    R1 = R2 = rotation(rng) if rng.random() < 0.5 else np.eye(3)
    base = np.round(rng.uniform(-1, 1, 3) * 64) / 64
    way = int(rng.integers(3))
    step = np.zeros(3)
    if way == 0:
        step[:] = (np.round(rng.uniform(-8, 8)) / 16 * length, 0, thickness)
    elif way == 1:
        step[2] = thickness
        R2 = R1 @ np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    else:
        step[0] = length
    return pair(Body(box(size), R1, R1 @ base), Body(box(size), R2, R1 @ (base + step)))


FAMILIES = (needles, plates, flat, degenerate)
MORE_FAMILIES = (long_boxes,)
