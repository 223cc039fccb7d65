"""Ordinary pairs: random hulls apart, overlapping, and ever nearer to touching."""

from __future__ import annotations

from collide.scenes.families.case import Case, mean_diagonal, pair
from collide.scenes.families.exact_gaps import set_gap
from collide.scenes.families.ingredients import direction, power, random_body


def rand_sep(rng, index) -> Case:
    """Random hulls and poses, gap 10^U(-2,1)·L."""
    case = pair(random_body(rng), random_body(rng))
    return set_gap(case, power(rng, -2, 1) * mean_diagonal(case), direction(rng))


def rand_pen(rng, index) -> Case:
    """Random hulls and poses, centres up to 2L/3 apart (hits and misses)."""
    case = pair(random_body(rng), random_body(rng))
    between = direction(rng) * rng.uniform(0, 2 / 3) * mean_diagonal(case)
    return case.moved(case.a.world().mean(axis=0) + between - case.b.world().mean(axis=0))


def near_sep(rng, index) -> Case:
    """Random hulls and poses, gap 10^-k·L for k = 2 … 16 in turn."""
    return _near(rng, 10.0 ** -(2 + index % 15))


def near_pen(rng, index) -> Case:
    """Random hulls and poses, gap -10^-k·L for k = 2 … 16 in turn."""
    return _near(rng, -(10.0 ** -(2 + index % 15)))


def _near(rng, gap: float) -> Case:
    case = pair(random_body(rng), random_body(rng))
    return set_gap(case, gap * mean_diagonal(case), direction(rng))


FAMILIES = (rand_sep, rand_pen, near_sep, near_pen)
