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


def test_a_point_beside_a_rim_or_an_edge_is_farther_than_from_either_face():
    """Its distance from the farther face was told as that from the body: a bound that was no bound."""
    rng = np.random.default_rng(3)
    small = 0
    for _ in range(300):
        B = collide.Box((0.3, 0.3, 0.3)) if rng.uniform() < 0.5 else collide.Cylinder(0.2, 0.3)
        corner = np.array([0.15, 0.15, 0.15]) if isinstance(B, collide.Box) else np.array([0.2, 0.0, 0.15])
        A = collide.Cylinder(0.25, 0.4)
        # The rim of A at x = 0.25, z = 0.2, and a corner of B that looks at it along the diagonal between its faces.
        n = np.array([np.cos(angle := rng.uniform(0.3, 1.2)), 0.0, np.sin(angle)])
        X_WB = np.eye(4)
        axis = np.cross(corner / np.linalg.norm(corner), -n)
        X_WB[:3, :3] = turn(axis, np.arcsin(min(np.linalg.norm(axis), 1.0)))
        if np.dot(X_WB[:3, :3] @ corner, n) > 0:
            X_WB[:3, :3] = turn(axis, np.pi - np.arcsin(min(np.linalg.norm(axis), 1.0)))
        X_WB[:3, 3] = (0.25, 0, 0.2) + 10.0 ** rng.uniform(-14, -11) * n - X_WB[:3, :3] @ corner
        X = pose(soak_contacts._rotation(rng), np.zeros(3))
        pair = A, B, X, X @ X_WB
        r = collide.distance(*pair)
        along = apart_along(*pair, X[:3, :3] @ n)
        assert along <= r.upper + 2.0**-48, (pair, r.upper, along)
        small += not r.hit
    assert small > 100, small
