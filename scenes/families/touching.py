"""Exactly touching by construction, in integers: nothing is rounded on the way to the doubles.

Body A has lattice points on and below a lattice plane through the origin, body B on and above it;
what the two have in the plane decides the kind of contact. All is scaled by 2^-4, turned by one of
the 24 exact rotations and moved by dyadic offsets, and each body's own frame is another such frame.
"""

from __future__ import annotations

from math import gcd
from typing import NamedTuple

import numpy as np

from collide.scenes.families.case import Body, Case, pair
from collide.scenes.families.ingredients import EXACT_ROTATIONS

#: The lattice's unit [m].
UNIT = 2.0**-4


class Contact(NamedTuple):
    """Integer world points of A and B, (n, 3) and (m, 3), with the origin in both; the plane n·x = 0
    has A on the side n·x ≤ 0 and B on the other."""

    A: np.ndarray
    B: np.ndarray
    normal: np.ndarray


def contact(rng, kind: str, normal=None) -> Contact:
    """Two integer bodies that touch, and do no more than touch.

    kind : two letters, v for a vertex, e for an edge, f for a face polygon: what A and B have in the
        plane, or the other way round. Edges cross, and polygons overlap in an area, around the origin.
    normal : (3,) integers; random by default.
    """
    n = _lattice_normal(rng) if normal is None else np.array(normal)
    u, v = _plane_basis(n)
    first, second = _flats(rng, kind)
    A = np.concatenate([first @ [u, v], _beside(rng, n, -1)])
    B = np.concatenate([second @ [u, v], _beside(rng, n, 1)])
    return Contact(A, B, n) if rng.random() < 0.5 else Contact(B, A, -n)


def _lattice_normal(rng) -> np.ndarray:
    while True:
        n = rng.integers(-3, 4, 3)
        if n.any():
            return n // gcd(*map(int, n))


def _plane_basis(n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two orthogonal integer vectors in the plane n·x = 0."""
    axis = np.zeros(3, dtype=int)
    axis[np.abs(n).argmin()] = 1
    u = np.cross(n, axis)
    u //= gcd(*map(int, u))
    v = np.cross(n, u)
    return u, v // gcd(*map(int, v))


def _flats(rng, kind: str) -> tuple[np.ndarray, np.ndarray]:
    """What the two bodies have in the plane, as integer coordinates (k, 2) there."""
    if kind == "ee":
        d1, d2 = _coordinates(rng, 2)
        while d1[0] * d2[1] == d1[1] * d2[0]:
            d1, d2 = _coordinates(rng, 2)
        return _edge(rng, d1), _edge(rng, d2)
    make = {
        "v": lambda: np.zeros((1, 2), dtype=int),
        "e": lambda: _edge(rng, _coordinates(rng, 1)[0]),
        "f": lambda: _polygon(rng),
    }
    return make[kind[0]](), make[kind[1]]()


def _coordinates(rng, n: int) -> np.ndarray:
    """n integer vectors (n, 2), none of them 0."""
    while True:
        points = rng.integers(-6, 7, (n, 2))
        if points.any(axis=1).all():
            return points


def _edge(rng, d: np.ndarray) -> np.ndarray:
    """The ends of an edge along d with the origin strictly inside."""
    return np.array([-int(rng.integers(1, 4)) * d, int(rng.integers(1, 4)) * d])


def _polygon(rng) -> np.ndarray:
    """3 to 6 points around the origin, which is strictly inside their hull."""
    while True:
        p = _coordinates(rng, int(rng.integers(3, 7)))
        p = p[np.argsort(np.arctan2(p[:, 1], p[:, 0]))]
        q = np.roll(p, -1, axis=0)
        if (p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] > 0).all():
            return p


def _beside(rng, n: np.ndarray, side: int) -> np.ndarray:
    """3 to 12 integer points strictly on one side of the plane."""
    points = rng.integers(-30, 31, (int(rng.integers(3, 13)), 3))
    off = points @ n
    points[off == 0] += n
    points[(off != 0) & (np.sign(off) != side)] *= -1
    points[off == 0] *= side
    return points


def placed(rng, touching: Contact) -> tuple[Case, np.ndarray]:
    """A contact as doubles, and its normal in the world (3,); 15 % have a doubled vertex.

    No translation of B has a 0 in it, so that one ulp of it is a length like its others'.
    """
    G = EXACT_ROTATIONS[rng.integers(24)]
    shift = rng.integers(-64, 65, 3)
    bodies = []
    for points in (touching.A, touching.B):
        R = EXACT_ROTATIONS[rng.integers(24)]
        t = rng.integers(1, 65, 3) * rng.choice((-1, 1), 3)
        # Rows, so that R.T @ (world - t) is (world - t) @ R; integers, so that nothing rounds.
        local = (points @ G.T + shift - t) @ R
        if rng.random() < 0.15:
            local = np.concatenate([local, local[[rng.integers(len(local))]]])
        bodies.append(Body(local * UNIT, R, t * UNIT))
    return pair(*bodies), G @ touching.normal


def touch_vf(rng, index) -> Case:
    """Exactly touching: a vertex inside a face polygon."""
    return placed(rng, contact(rng, "vf"))[0]


def touch_ee(rng, index) -> Case:
    """Exactly touching: two crossing edges."""
    return placed(rng, contact(rng, "ee"))[0]


def touch_ff(rng, index) -> Case:
    """Exactly touching: two overlapping face polygons."""
    return placed(rng, contact(rng, "ff"))[0]


def touch_vv(rng, index) -> Case:
    """Exactly touching: two vertices."""
    return placed(rng, contact(rng, "vv"))[0]


def touch_ve(rng, index) -> Case:
    """Exactly touching: a vertex inside an edge."""
    return placed(rng, contact(rng, "ve"))[0]


def touch_1ulp(rng, index) -> Case:
    """Exactly touching, then B moved by one ulp along the largest normal component, towards or away.

    Contacts with an area of directions (a vertex or an edge on a face, crossing edges, faces), so
    that towards is an overlap for certain; the two ways alternate.
    """
    case, normal = placed(rng, contact(rng, ("vf", "ee", "ff")[index // 2 % 3]))
    axis = int(np.abs(normal).argmax())
    away = 1 if index % 2 else -1
    t2 = case.t2.copy()
    t2[axis] = np.nextafter(t2[axis], away * np.sign(normal[axis]) * np.inf)
    return case._replace(t2=t2)


def touch_scaled(rng, index) -> Case:
    """Exactly touching, one ulp towards, one ulp away in turn, and all lengths scaled by 2^e with e from
    -150 to 150."""
    case = (touch_1ulp(rng, 2 * index), touch_1ulp(rng, 2 * index + 1), touch_ee(rng, index))[index % 3]
    factor = 2.0 ** int(rng.integers(-150, 151))
    return case._replace(P=case.P * factor, t1=case.t1 * factor, Q=case.Q * factor, t2=case.t2 * factor)


def touch_tiny_step(rng, index) -> Case:
    """Exactly touching with a translation of B that is 0 along the largest normal component, then moved
    there by ±2^-k, k from 55 to 1074: far less than an ulp of any other number, towards and away in turn."""
    touching = contact(rng, ("vf", "ee", "ff")[index // 2 % 3])
    case, normal = placed(rng, touching)
    axis = int(np.abs(normal).argmax())
    # The pair as a whole moves along that axis, so that B's translation becomes 0 there, exactly.
    t1, t2 = case.t1.copy(), case.t2.copy()
    t1[axis] -= t2[axis]
    away = 1.0 if index % 2 else -1.0
    t2[axis] = away * np.sign(normal[axis]) * 2.0 ** -int(rng.integers(55, 1075))
    return case._replace(t1=t1, t2=t2)


FAMILIES = (touch_vf, touch_ee, touch_ff, touch_vv, touch_ve, touch_1ulp)
MORE_FAMILIES = (touch_scaled, touch_tiny_step)
