"""Hulls swept by balls: exactly touching, one ulp off, padded on one side, near, and deep."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import Body, Case, mean_diagonal, pair
from collide.scenes.families.exact_gaps import set_gap
from collide.scenes.families.ingredients import (
    anywhere,
    direction,
    power,
    random_body,
    random_hull,
    rotation,
    rotation_about,
    sign,
)
from collide.scenes.families.thin import flat
from collide.scenes.families.touching import UNIT, Contact, contact, placed

#: Lattice normals of whole length: cores apart along them are a dyadic distance apart.
_WHOLE = ((0, 0, 1), (1, 2, 2), (2, 3, 6), (4, 4, 7), (0, 3, 4), (1, 4, 8))


def _apart_by_dyadic(rng, index) -> tuple[Case, float]:
    """Cores exactly `reach` apart, reach [m] dyadic: a lattice contact opened along its normal."""
    n = np.array(_WHOLE[int(rng.integers(len(_WHOLE)))])[rng.permutation(3)] * rng.choice((-1, 1), 3)
    touching = contact(rng, ("vf", "ee", "ff", "vv", "ve")[index % 5], n)
    # The contact may have exchanged the bodies, and its normal with them.
    opened = Contact(touching.A, touching.B + int(rng.integers(1, 9)) * touching.normal, touching.normal)
    step = opened.B[0] - touching.B[0]
    reach = round(float(np.sqrt((step * step).sum()))) * UNIT  # a whole number: the root is exact
    return placed(rng, opened)[0], reach


def swept_touch(rng, index) -> Case:
    """Lattice cores a dyadic distance apart, radii that add up to it exactly: the swept pair touches."""
    case, reach = _apart_by_dyadic(rng, index)
    radius_a = np.round(rng.uniform(0.1, 0.9) * reach * 256) / 256
    return case._replace(radius_a=float(radius_a), radius_b=float(reach - radius_a))


def swept_1ulp(rng, index) -> Case:
    """The same, then the larger radius one ulp larger or smaller, in turn: hit or miss."""
    case = swept_touch(rng, index // 2)
    towards = 0.0 if index % 2 else np.inf
    if case.radius_a >= case.radius_b:
        return case._replace(radius_a=float(np.nextafter(case.radius_a, towards)))
    return case._replace(radius_b=float(np.nextafter(case.radius_b, towards)))


def padded_touch(rng, index) -> Case:
    """Padding on one side only, the other body bare: exactly touching, one ulp more, one ulp less in
    turn."""
    case, reach = _apart_by_dyadic(rng, index // 3)
    reach = float((reach, np.nextafter(reach, np.inf), np.nextafter(reach, 0.0))[index % 3])
    return case._replace(radius_a=reach) if index // 3 % 2 else case._replace(radius_b=reach)


def swept_near(rng, index) -> Case:
    """Random hulls swept by random radii, one of them often 0, signed distance ±10^-k·L for k = 2 … 16
    in turn; every fourth core is a point or a segment (spheres and capsules)."""
    bodies = [random_body(rng), random_body(rng)]
    if index % 4 == 3:
        bodies[0] = anywhere(rng, rng.uniform(-1, 1, (int(rng.integers(1, 3)), 3)))
    case = pair(*bodies)
    size = mean_diagonal(case)
    radii = power(rng, -3, -0.5) * size * rng.dirichlet((1.0, 1.0)) * (1.0, float(rng.random() < 0.7))
    gap = sign(rng) * 10.0 ** -(2 + index % 15) * size
    case = set_gap(case, max(float(radii.sum()) + gap, 0.0), direction(rng))
    return case._replace(radius_a=float(radii[0]), radius_b=float(radii[1]))


def swept_deep(rng, index) -> Case:
    """Cores that overlap, touch or are flat, swept by balls of 10^U(-6,0)·L: cores at ±10^U(-9,-1)·L,
    or polygons crossing."""
    if index % 4 == 3:
        case = flat(rng, 5 * int(rng.integers(10)) + 1 + index // 4 % 3)
    else:
        case = pair(random_body(rng), Body(random_hull(rng), random_body(rng).R, np.zeros(3)))
        case = set_gap(case, sign(rng) * power(rng, -9, -1) * mean_diagonal(case), direction(rng))
    radii = [power(rng, -6, 0) * mean_diagonal(case) for _ in range(2)]
    return case._replace(radius_a=radii[0], radius_b=radii[1])


def turned_balls(rng, index) -> Case:
    """A ball, turned anyhow and half the time by right angles as they round, on a face of an unturned box:
    exactly touching, one ulp larger, one ulp smaller in turn. What is a point does not turn."""
    half, radius = (np.round(rng.uniform(0.25, 2.0, n) * 256) / 256 for n in (3, 1))
    where = np.round(rng.uniform(-1, 1, 3) * half * 64) / 64
    axis = int(rng.integers(3))
    where[axis] = sign(rng) * (half[axis] + radius[0])
    turned = rotation_about(int(rng.integers(3)), np.pi / 2 * int(rng.integers(1, 4))) if index % 2 else rotation(rng)
    ball = Body(np.zeros((1, 3)), turned, where)
    box = Body(np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half, np.eye(3), np.zeros(3))
    reach = float((radius[0], np.nextafter(radius[0], np.inf), np.nextafter(radius[0], 0.0))[index % 3])
    if index // 3 % 2:
        return pair(box, ball)._replace(radius_b=reach)
    return pair(ball, box)._replace(radius_a=reach)


MORE_FAMILIES = (turned_balls, swept_touch, swept_1ulp, padded_touch, swept_near, swept_deep)
