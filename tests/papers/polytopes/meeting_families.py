"""Points and half-spaces of every nasty kind, seeded: lattices, touching, nested, flat, empty, unbounded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np


class Question(NamedTuple):
    """What `collide.polytopes.meets` is asked."""

    points: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray


def _normals(rng: np.random.Generator, m: int, d: int, largest: int = 2) -> np.ndarray:
    a = rng.integers(-largest, largest + 1, (m, d))
    a[~a.any(axis=1), 0] = 1
    return a.astype(float)


def lattice(rng, d, n, m) -> Question:
    """Small integers: parallel planes, equal points, many ties."""
    points = rng.integers(-2, 3, (n, d)) + rng.integers(-3, 4, d)
    return Question(points.astype(float), _normals(rng, m, d), rng.integers(0, 6, m).astype(float))


def touching(rng, d, n, m) -> Question:
    """A point of the hull on a corner of the region, now and then off it by a unit in the last place."""
    corner = rng.integers(-3, 4, d).astype(float) / 4
    normals = _normals(rng, m, d, 3)
    offsets = normals @ corner + np.where(np.arange(m) < d, 0.0, rng.integers(0, 3, m))
    along = normals[: min(d, m)].sum(axis=0)
    points = corner + rng.integers(0, 3, (n, 1)) * along / 8 + _orthogonal(rng, n, along)
    k = int(rng.integers(0, 3))
    if k == 1:
        points[0] = np.nextafter(points[0], points[0] + np.sign(along) * 9)
    elif k == 2:
        offsets[0] = np.nextafter(offsets[0], -np.inf if rng.random() < 0.5 else np.inf)
    return Question(points, normals, offsets)


def _orthogonal(rng, n: int, along: np.ndarray) -> np.ndarray:
    """Vectors of halves, orthogonal to an integral vector."""
    d = len(along)
    vectors = np.zeros((n, d))
    for row in vectors:
        i, k = rng.integers(0, d, 2)
        if i != k:
            row[i], row[k] = along[k] / 16, -along[i] / 16
    return vectors


def nested(rng, d, n, m) -> Question:
    """The hull deep in the region, the region deep in the hull, or both far apart, in doubles."""
    points, normals = rng.normal(size=(n, d)), rng.normal(size=(m, d))
    scale, shift = rng.choice([0.05, 1.0, 20.0]), rng.normal(size=d) * rng.choice([0.0, 0.5, 2.0])
    return Question(points * scale, normals, rng.uniform(0.2, 1.0, m) + normals @ shift)


def flat(rng, d, n, m) -> Question:
    """Hulls and regions without interior: pairs of opposite half-spaces, points in a plane."""
    question = lattice(rng, d, n, m)
    k = int(rng.integers(1, max(2, min(d, m // 2) + 1)))
    normals, offsets, points = question.normals.copy(), question.offsets.copy(), question.points.copy()
    if m >= 2 * k:
        normals[k : 2 * k], offsets[k : 2 * k] = -normals[:k], -offsets[:k]
    if rng.random() < 0.5:
        points[:, 0] = rng.integers(-1, 2)
    return Question(points, normals, offsets)


def empty(rng, d, n, m) -> Question:
    """Half-spaces that contradict each other, or nearly do."""
    question = lattice(rng, d, n, m)
    normals, offsets = question.normals, question.offsets
    if m >= 2 and rng.random() < 0.7:
        normals[1] = -normals[0] * 3
        offsets[1] = -3 * offsets[0] - rng.choice([0.0, 1e-15, 1.0]) * (rng.random() < 0.5)
    return Question(question.points / rng.choice([1.0, 3.0]), normals, offsets)


def unbounded(rng, d, n, m) -> Question:
    """Regions that hold a cone."""
    axis = np.zeros(d)
    axis[0] = 1.0
    normals = rng.normal(size=(m, d))
    normals[normals @ axis > 0] *= -1.0
    return Question(rng.normal(size=(n, d)) + rng.uniform(-1, 4) * axis, normals, rng.uniform(-1.0, 0.3, m))


FAMILIES: dict[str, Callable[..., Question]] = {
    "lattice": lattice, "touching": touching, "nested": nested, "flat": flat, "empty": empty, "unbounded": unbounded,
}


def questions(seed: int, d: int, count: int, max_rows: int = 30) -> Iterator[tuple[str, Question]]:
    """``count`` questions of all families in turn."""
    rng = np.random.default_rng([seed, d])
    names = list(FAMILIES)
    for k in range(count):
        name = names[k % len(names)]
        n, m = rng.integers(1, max_rows + 1, 2).tolist()
        yield name, FAMILIES[name](rng, d, n, m)
