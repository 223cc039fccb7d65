"""Normals of curved pairs that all but touch: the bodies are as far apart along them as the bracket proves.

The judge: supports in closed form, in long doubles (`contact_oracle.py`). Whatever the direction, two bodies are at
least as far apart as along it.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import soak_contacts
from contact_oracle import ConvexBody
from naive import pose, turn

import collide

CURVED = ("cylinder", "cone", "ellipsoid")
BOUNDED = tuple(kind for kind in soak_contacts.KINDS if kind != "half-space")
#: Rounding of a support, of the reach of a pair [1].
ROUNDING = 2.0**-46


def pair_in_touch(number: int):
    """(exponent, A, B, X_WA, X_WB): a curved body and another, some 10^exponent m apart, or so deep."""
    rng = np.random.default_rng([5, number])
    kinds = soak_contacts._kinds(rng, CURVED, BOUNDED)
    A, B = (soak_contacts._one_of(kind, 1, rng) for kind in kinds)
    X_WA, X_WB = (pose(soak_contacts._rotation(rng), rng.normal(size=3)) for _ in range(2))
    if rng.uniform() < 0.3:
        X_WB[:3, :3] = turn(rng.normal(size=3), 10.0 ** rng.uniform(-16, -1)) @ X_WA[:3, :3]
    exponent = int(rng.integers(-14, -7))
    gap = 10.0**exponent * rng.uniform(0.5, 2)
    for _ in range(2):  # moved along a normal that leans they are nearer than was meant
        r = collide.distance(A, B, X_WA, X_WB)
        X_WB[:3, 3] += (gap - r.distance) * r.normal
    return exponent, A, B, X_WA, X_WB


def apart_along(A, B, X_WA, X_WB, nhat) -> float:
    """How far two bodies are apart along a direction, from A to B [m]."""
    a, b = ConvexBody(A, X_WA), ConvexBody(B, X_WB)
    n = np.asarray(nhat).astype(np.longdouble)
    n /= np.sqrt((n * n).sum())
    return float(-(a.support(n) + b.support(-n)))


@pytest.mark.many(2)
@pytest.mark.parametrize("part", range(4))
def test_bodies_are_as_far_apart_along_the_normal_as_proven(part):
    """The direction of the nearest point of A ⊖ B leaned by its rounding over its length: along it bodies 1e-9 apart
    overlapped by up to 1e-2."""
    gaps: Counter = Counter()
    for number in range(300 * part, 300 * part + 300):
        exponent, *pair = pair_in_touch(number)
        r = collide.distance(*pair)
        size = sum(ConvexBody(S, X).size + float(np.abs(X[:3, 3]).max()) for S, X in zip(pair[:2], pair[2:]))
        along = apart_along(*pair, r.normal)
        where = f"{pair!r}: {r.lower!r} … {r.upper!r}, {along!r} along the normal"
        assert along >= r.lower - ROUNDING * size, where
        assert along <= r.upper + ROUNDING * size, where
        off = np.abs(r.point_b - r.point_a - r.distance * r.normal).max()
        assert off <= ROUNDING * size, (where, off)
        gaps[exponent] += not r.hit
    assert sum(gaps.values()) > 200 and min(gaps.values()) >= 10, gaps


#: Two cylinders whose rims all but touch, and overlap along the normal of an end by 1e-12 m; found by the draws above.
RIMS = (
    collide.Cylinder(0.24538903379391816, 0.2766783695548791), collide.Cylinder(0.2058587920316149, 0.447093454765159),
    np.array([
        [-1.0, 0.0, 0.0, 0.21462985730660974], [0.0, 0.0, 1.0, -0.23608975945607338],
        [0.0, 1.0, 0.0, 0.19735785975451514], [0.0, 0.0, 0.0, 1.0],
    ]),
    np.array([
        [-1.0, 6.481124315118408e-12, -2.2509159530639582e-11, 0.17016082306368296],
        [-2.250915952977072e-11, 1.3406063731994134e-10, 1.0, -0.5979756715891792],
        [6.481124318136e-12, 1.0, -1.3406063731979544e-10, 0.6464091990603709], [0.0, 0.0, 0.0, 1.0],
    ]),
)


def test_a_point_beside_a_rim_is_farther_than_from_either_face():
    """Its distance from the farther face was told as that from the body: a bound that was no bound."""
    A, B, X_WA, X_WB = RIMS
    n = np.array([-0.08282436345371359, -0.5418762144464757, 0.8363660699923589])
    n /= np.linalg.norm(n)
    for away in np.linspace(0.0, 1.8e-12, 10):
        moved = X_WB.copy()
        moved[:3, 3] += away * n
        r = collide.distance(A, B, X_WA, moved)
        along = apart_along(A, B, X_WA, moved, n)
        assert along > 1e-13 and along <= r.upper, (away, along, r.upper)
