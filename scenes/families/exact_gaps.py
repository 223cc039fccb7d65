"""Setting a pair to a given gap: B is moved along the exact normal until it is there.

The normal and the distance come from the exact oracle, `collide.adapters.peers.exact`, which imports
nothing of the engine. It is loaded when first used: the scenes package needs no adapter to load.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.scenes.families.case import Case

#: Numbers of cases are made with its help; families can be listed and described without it.
exact = lazy_module("collide.adapters.peers.exact")

#: A gap this much off, relative to itself, is set again; the translation's rounding is the limit.
NEAR_ENOUGH = 1e-3


def measure(case: Case) -> tuple[float, np.ndarray]:
    """Signed distance of the two hulls [m], radii left out, and the unit vector nhat_AB_W (3,).

    Where the hulls touch, or one is flat, the normal is that of a plane between them.
    """
    arguments = case[2:8]
    apart = exact.distance(*arguments)
    if not apart.hit:
        step = [q - p for p, q in zip(apart.point_a, apart.point_b)]
        return float(apart.distance), _unit(step)
    together = exact.depth(*arguments)
    return -float(together.depth), _unit(together.normal)


def set_gap(case: Case, gap: float, towards: np.ndarray | None = None) -> Case:
    """B moved until the signed distance of the hulls is about `gap` [m]; below 0 they overlap by -gap.

    towards : direction (3,) from A in which B comes nearer; from centre to centre by default.
    A depth larger than the bodies allow ends as deep as the search gets; flat pairs have none.
    """
    case = _moved_apart(case, towards)
    distance, normal = measure(case)
    if gap >= 0:
        case = case.moved((gap - distance) * normal)
    else:
        case = _overlapping(case, distance, normal, -gap)
    for _ in range(2):  # the first step was long, and its rounding may exceed the gap
        distance, normal = measure(case)
        if abs(distance - gap) <= NEAR_ENOUGH * abs(gap):
            break
        case = case.moved((gap - distance) * normal)
    return case


def _overlapping(case: Case, distance: float, normal: np.ndarray, depth: float) -> Case:
    """Bodies that are `distance` apart along `normal`, moved to overlap by `depth`.

    At corners and edges a step of `depth` leaves less than that depth, so go farther and come back
    along the normal of the depth: every facet was at least that deep, and stays so.
    """
    for factor in (1.0, 2.0, 4.0, 8.0, 16.0):
        pushed = case.moved(-(distance + factor * depth) * normal)
        reached, outwards = measure(pushed)
        if -reached >= (1 - NEAR_ENOUGH) * depth:
            break
    return pushed.moved((-reached - depth) * outwards) if -reached > depth else pushed


def _moved_apart(case: Case, towards: np.ndarray | None) -> Case:
    """The pair with B moved out of the ball around A."""
    A, B = case.a.world(), case.b.world()
    centre_a, centre_b = A.mean(axis=0), B.mean(axis=0)
    reach = sum(np.linalg.norm(W - c, axis=1).max() for W, c in ((A, centre_a), (B, centre_b)))
    away = centre_b - centre_a if towards is None else np.asarray(towards, dtype=float)
    length = np.linalg.norm(away)
    away = away / length if length > 0 else np.array([0.0, 0.0, 1.0])
    # Two points have no size: any distance but 0 keeps them apart.
    return case.moved(centre_a + 1.05 * (reach or 1.0) * away - centre_b)


def _unit(vector) -> np.ndarray:
    """A unit vector of doubles from exact numbers, whose integers may exceed the range of doubles."""
    largest = max(abs(Fraction(x)) for x in vector)
    v = np.array([float(Fraction(x) / largest) for x in vector])
    return v / np.linalg.norm(v)
