"""Nearly round bodies with many vertices: spheres of points, prisms of 1,000 sides, bipyramids."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import Body, Case, mean_diagonal, pair
from collide.scenes.families.exact_gaps import measure, set_gap
from collide.scenes.families.ingredients import (
    anywhere,
    bipyramid,
    direction,
    power,
    prism,
    random_hull,
    rotation,
    rotation_about,
    sign,
    sphere,
)


def spheres_big(rng, index) -> Case:
    """200 to 2,000 points on spheres of radius 0.5 to 2, gap ±10^U(-6,-0.5)."""
    bodies = [anywhere(rng, sphere(rng, int(rng.integers(200, 2001)), rng.uniform(0.5, 2))) for _ in range(2)]
    gap, towards = power(rng, -6, -0.5), direction(rng)
    # The nearest points lie in the caps that face each other; the rest need not be looked at.
    caps = pair(_facing(bodies[0], towards), _facing(bodies[1], -towards))
    caps = set_gap(caps, gap, towards)
    if rng.random() < 0.5:
        caps = caps.moved(-2 * gap * measure(caps)[1])
    return caps._replace(P=bodies[0].points, Q=bodies[1].points)


def _facing(body: Body, towards: np.ndarray) -> Body:
    """The points of a sphere within 60° of a direction (3,) in the world."""
    heights = body.points @ body.R.T @ towards
    return body._replace(points=body.points[heights > 0.5 * heights.max()])


def cyl1000(rng, index, sides: int = 1000) -> Case:
    """Prisms with 1,000-gon caps against 1,000-, 64- and 8-gon prisms and hulls: cap on cap, side on
    side, random, small gap, coaxial."""
    (r1, r2), (h1, h2) = np.round(rng.uniform(0.2, 1.0, 2), 2), np.round(rng.uniform(0.2, 2.0, 2), 2)
    A = Body(prism(sides, r1, h1), rotation(rng) if rng.random() < 0.5 else np.eye(3), np.zeros(3))
    B = (prism(sides, r2, h2), prism(64, r2, h2), prism(8, r2, h2), random_hull(rng))[index // 5 % 4]
    situation = index % 5
    if situation == 2:
        between = direction(rng) * rng.uniform(0, 1) * (r1 + r2 + (h1 + h2) / 2)
        return pair(A, Body(B, rotation(rng), between))
    if situation == 3:
        case = pair(A, Body(B, rotation(rng), np.zeros(3)))
        return set_gap(case, sign(rng) * power(rng, -9, -2) * mean_diagonal(case), direction(rng))
    step = {
        0: np.array([*rng.uniform(-0.7, 0.7, 2) * r1, (h1 + h2) / 2]),
        1: np.array([r1 + r2, 0.0, np.round(rng.uniform(-0.4, 0.4) * (h1 + h2), 2)]),
        4: np.array([0.0, 0.0, np.round(rng.uniform(-0.6, 0.6) * (h1 + h2), 2)]),
    }[situation]
    return pair(A, Body(B, A.R @ rotation_about(2, rng.uniform(0, 2 * np.pi)) if situation == 0 else A.R, A.R @ step))


def bipyramids(rng, index, sides: int = 300) -> Case:
    """Bipyramids over regular polygons of `sides` corners, each apex the neighbour of all of them,
    against bipyramids, boxes of 8 corners and hulls: apex to apex, rim to rim, gap ±10^U(-12,-1)·L."""
    A = Body(bipyramid(sides, rng.uniform(0.2, 1), rng.uniform(0.2, 2)), rotation(rng), rng.uniform(-1, 1, 3))
    points = bipyramid(sides, rng.uniform(0.2, 1), rng.uniform(0.2, 2)) if index % 2 == 0 else random_hull(rng)
    B = Body(points, A.R if index % 4 == 0 else rotation(rng), np.zeros(3))
    case = pair(A, B)
    towards = (A.R[:, 2], A.R[:, 0], direction(rng))[index // 4 % 3]
    return set_gap(case, sign(rng) * power(rng, -12, -1) * mean_diagonal(case), towards)


def repeats(rng, index, copies: int = 100) -> Case:
    """Random hulls with every vertex given `copies` times, in any order; gap ±10^U(-12,-1)·L."""
    bodies = []
    for _ in range(2):
        hull = random_hull(rng, 16)
        bodies.append(anywhere(rng, hull[rng.permutation(np.repeat(np.arange(len(hull)), copies))]))
    # The gap belongs to the hulls; finding it does not need the copies.
    case = pair(*(b._replace(points=np.unique(b.points, axis=0)) for b in bodies))
    case_with_gap = set_gap(case, sign(rng) * power(rng, -12, -1) * mean_diagonal(case), direction(rng))
    return case_with_gap._replace(P=bodies[0].points, Q=bodies[1].points)


FAMILIES = (spheres_big, cyl1000)
MORE_FAMILIES = (bipyramids, repeats)
