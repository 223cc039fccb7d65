"""Polygons with holes, and whether two of them meet, in fractions: judges configuration obstacles in the plane."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.solids.planar_obstacle import border_rings, exact_planar_obstacle

HALF_TURN = -np.eye(2)


def turned_by(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def square(x=0.0, y=0.0, size=1.0) -> np.ndarray:
    return np.array([(x, y), (x + size, y), (x + size, y + size), (x, y + size)])


def frame() -> list[np.ndarray]:
    """A square of 3 with a hole of 1."""
    return [square(size=3.0), square(1.0, 1.0)[::-1]]


def letter_u() -> list[np.ndarray]:
    return [np.array([(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)]


def star(rng, n: int, grid: int | None = None) -> list[np.ndarray]:
    """A star-shaped polygon of at most n corners; of corners on a grid, where its size is given."""
    while True:
        if grid is None:
            angle, radius = rng.uniform(0, 2 * np.pi, n), rng.uniform(0.3, 1.0, n)
            ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
        else:
            ring = rng.integers(-grid, grid + 1, (n, 2)).astype(float)
            ring = ring[ring.any(axis=1)]
        angle, first = np.unique(np.round(np.arctan2(ring[:, 1], ring[:, 0]), 9), return_index=True)
        if len(angle) > 2 and (np.diff(np.append(angle, angle[0] + 2 * np.pi)) < 3.0).all():
            return [ring[first]]


def comb(n: int, spacing: float, tooth: float, at: float) -> list[np.ndarray]:
    """Figure 10: a bar, n thin spikes in two halves, and between them a stem with a zigzag of n teeth near its top.

    spacing : of the spikes.   tooth : of the teeth.   at : how far the zigzag reaches to the right of the middle.
    """
    thin, height = 1.0 / (64 * n**3), 8.0 * n
    middle = 0.5 * (n - 1) * 8.0
    ring = [(-2.0, -1.0), ((n - 1) * spacing + 2.0, -1.0), ((n - 1) * spacing + 2.0, 0.0)]
    for k in range(n - 1, -1, -1):
        if k == n // 2 - 1:
            teeth = [(middle + at, 0.0), (middle + at, height - n * tooth)]
            for j in range(n):
                start = height - n * tooth + j * tooth
                teeth += [(middle + at + 0.5 * tooth, start + 0.5 * tooth), (middle + at, start + tooth)]
            ring += [*teeth, (middle - 1.5, height), (middle - 1.5, 0.0)]
        x = k * spacing
        ring += [(x + thin, 0.0), (x + thin, height + 4.0), (x, height + 4.0), (x, 0.0)]
    return [np.array([*ring, (-2.0, 0.0)])]


def combs(n: int):
    """A, B, R with A − R B as in figure 10 of the paper, for even n: n spikes of the middle bundle, each of which n²
    teeth cut through."""
    second = 1.0 + 1.0 / n
    at = 0.5 * (1.0 / (32 * n) + 1.0 / (4 * n) - 0.5 * (1.0 + second))
    return comb(n, 8.0, 1.0, at), comb(n, 8.0 + 1.0 / (16 * n**2), second, at), HALF_TURN


def cases(seed: int = 0) -> dict:
    rng = np.random.default_rng(seed)
    return {
        "squares": ([square()], [square(size=2.0)], None),
        "a frame and a square": (frame(), [square(size=0.5)], None),
        "a frame and a square as large as its hole": (frame(), [square()], None),
        "a frame and a larger square": (frame(), [square(size=1.5)], turned_by(0.3)),
        "frames": (frame(), frame(), turned_by(1.0)),
        "letters": (letter_u(), letter_u(), turned_by(np.pi)),
        "letters turned over": (letter_u(), letter_u(), HALF_TURN),
        "stars": (star(rng, 9), star(rng, 7), turned_by(2.0)),
        "stars on a grid": (star(rng, 8, 4), star(rng, 7, 3), None),
        "more stars on a grid": (star(rng, 6, 3), star(rng, 6, 3), HALF_TURN),
    }


class PlanarVerdict(NamedTuple):
    """wrong : positions judged otherwise.   n_points, n_in, n_on : positions, of which the polygons meet; of which on
    an edge of the obstacle."""

    wrong: list[str]
    n_points: int
    n_in: int
    n_on: int


def judge_planar(A, B, R, n_points: int, n_on: int, seed: int) -> PlanarVerdict:
    """Positions around, as many within 1e-9 of an edge or an ulp off one; and n_on on an edge, in fractions."""
    rng = np.random.default_rng(seed)
    exact = exact_planar_obstacle(A, B, R)
    unit = Fraction(2) ** exact.grid
    place = [tuple(Fraction(c, p[2]) * unit for c in p[:2]) for p in exact.arrangement.points]
    rings = [[place[k] for k in ring] for ring in border_rings(exact.arrangement, exact.keep)]
    edges = [(p, q) for ring in rings for p, q in zip(ring, [*ring[1:], ring[0]])]
    near = np.array([[[float(c) for c in p] for p in edge] for edge in edges])
    low, high = near.min(axis=(0, 1)), near.max(axis=(0, 1))
    rows = rng.integers(len(edges), size=n_points // 2)
    share = rng.random((len(rows), 1))
    beside = near[rows, 0] * share + near[rows, 1] * (1 - share)
    beside += (
        rng.normal(size=beside.shape)
        * 10.0 ** rng.uniform(-12, -9, (len(beside), 1))
        * (rng.random((len(beside), 1)) < 0.5)
    )
    beside += np.spacing(np.abs(beside)) * rng.integers(-1, 2, beside.shape)
    points = [
        [Fraction(c) for c in p]
        for p in np.concatenate([rng.uniform(low - 0.1, high + 0.1, (len(rows), 2)), beside]).tolist()
    ]
    for row in rng.integers(len(edges), size=n_on).tolist():
        i, j = rng.integers(0, 5, 2).tolist()
        points.append([(i * a + (j + 1) * b) / (i + j + 1) for a, b in zip(*edges[row])])
    wrong, n_in = [], 0
    body_a, body_b = in_fractions(A, np.eye(2)), in_fractions(B, np.eye(2) if R is None else R)
    for k, x in enumerate(points):
        meet = polygons_meet(body_a, [[(p[0] + x[0], p[1] + x[1]) for p in ring] for ring in body_b])
        number = winding(rings, x)
        n_in += meet
        if number not in (None, 0, 1) or meet != (number != 0) or (k >= 2 * len(rows) and not meet):
            wrong.append(
                f"at {[float(c) for c in x]} they {'meet' if meet else 'are apart'}, the border winds {number} times"
            )
    return PlanarVerdict(wrong, len(points), n_in, n_on)


def in_fractions(rings, R) -> list:
    R = [[Fraction(c) for c in row] for row in np.asarray(R, dtype=float).tolist()]
    out = []
    for ring in rings:
        corners = [[Fraction(c) for c in p] for p in np.asarray(ring, dtype=float).tolist()]
        out.append([(R[0][0] * x + R[0][1] * y, R[1][0] * x + R[1][1] * y) for x, y in corners])
    return out


def polygons_meet(P, Q) -> bool:
    """Whether two closed polygons have a point in common."""
    for ring in P:
        for a, b in zip(ring, [*ring[1:], ring[0]]):
            for other in Q:
                for c, d in zip(other, [*other[1:], other[0]]):
                    if _touch(a, b, c, d):
                        return True
    return any(winding(Q, ring[0]) for ring in P) or any(winding(P, ring[0]) for ring in Q)


def _turn(a, b, c):
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _touch(a, b, c, d) -> bool:
    for k in (0, 1):
        if max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]):
            return False
    first, second, third, fourth = _turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b)
    return not ((first > 0 and second > 0) or (first < 0 and second < 0) or (third > 0 and fourth > 0)
                or (third < 0 and fourth < 0))


def winding(rings, x) -> int | None:
    """How often rings wind around a point; None on one."""
    total = 0
    for ring in rings:
        for a, b in zip(ring, [*ring[1:], ring[0]]):
            turn = _turn(a, b, x)
            inside = all(min(a[k], b[k]) <= x[k] <= max(a[k], b[k]) for k in (0, 1))
            if turn == 0 and inside:
                return None
            if a[1] <= x[1] < b[1] and turn > 0:
                total += 1
            elif b[1] <= x[1] < a[1] and turn < 0:
                total -= 1
    return total


def snippet_planar(name: str, n_points: int, n_on: int, seed: int) -> str:
    asked = f"*cases({seed})[{name!r}], {n_points}, {n_on}, {seed}"
    return f"from planar_obstacle_judge import *; print(judge_planar({asked}))"
