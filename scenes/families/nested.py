"""One body within another: the same centre, somewhere inside, the very same place."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import Body, Case, pair
from collide.scenes.families.ingredients import anywhere, box, power, random_body, random_hull, rotation, sphere


def concentric(rng, index) -> Case:
    """Hulls, boxes and spheres (32 to 300 points) with the same centre."""
    A = anywhere(rng, _any_solid(rng))
    return pair(A, Body(_any_solid(rng), rotation(rng), A.t))


def inside(rng, index) -> Case:
    """A hull scaled by 10^U(-3,-0.7) at a random point inside another."""
    A = random_body(rng)
    place = rng.dirichlet(np.ones(len(A.points))) @ A.world()
    B = Body(random_hull(rng) * power(rng, -3, -0.7), rotation(rng), np.zeros(3))
    return pair(A, B._replace(t=place - B.world().mean(axis=0)))


def identical(rng, index) -> Case:
    """The same hull, box, sphere or dyadic hull twice in the same pose."""
    points = (
        lambda: random_hull(rng),
        lambda: box(rng.uniform(0.2, 2, 3)),
        lambda: sphere(rng, int(rng.integers(32, 301))),
        lambda: np.round(random_hull(rng) * 16) / 16,
    )[index % 4]()
    A = anywhere(rng, points)
    return pair(A, A)


def _any_solid(rng) -> np.ndarray:
    kind = int(rng.integers(3))
    if kind == 0:
        return random_hull(rng)
    if kind == 1:
        return box(rng.uniform(0.2, 2, 3))
    return sphere(rng, int(rng.integers(32, 301)), rng.uniform(0.5, 2))


FAMILIES = (concentric, inside, identical)
