"""Inputs of `collide bench pareto`: pairs by class, seeded, every one judged exactly.

A class takes its pairs from families of `collide.scenes.families` in turn; "large" and "meshes" have generators here,
since no family has hulls of hundreds of vertices, or meshes of hundreds of facets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument
from collide.scenes.families import Case, MeshCase, generate
from collide.scenes.families.ingredients import direction, rotation
from collide.scenes.families.mesh_cases import Surface


class BenchClass(NamedTuple):
    """about : what its pairs are, in one line.   families : of which they are, in turn; empty: `make` makes them."""

    about: str
    families: tuple[str, ...] = ()
    make: Callable[[np.random.Generator, int], Case | MeshCase] | None = None


#: Vertices of the hulls, and rings of the meshes (2 r (r − 2) + 2 r facets), of the two classes made here.
LARGE, RINGS = 512, 18


def large(random: np.random.Generator, index: int) -> Case:
    """Hulls of 512 points on ellipsoids; apart by up to a length, near, overlapping."""
    hulls = []
    for _ in range(2):
        points = random.normal(size=(LARGE, 3))
        hulls.append(points / np.sqrt(np.square(points).sum(axis=1))[:, None] * random.uniform(0.4, 1.0, 3))
    R1, R2, step = rotation(random), rotation(random), direction(random)
    reach = sum(
        float((points @ (sign * R.T @ step)).max()) for points, R, sign in ((hulls[0], R1, 1), (hulls[1], R2, -1))
    )
    factor = (random.uniform(1.05, 1.5), random.uniform(0.999, 1.001), random.uniform(0.5, 0.9))[index % 3]
    return Case("large", index, hulls[0], R1, np.zeros(3), hulls[1], R2, step * reach * factor)


def meshes(random: np.random.Generator, index: int) -> MeshCase:
    """Bumpy closed meshes of 612 facets: apart by up to a diameter, nearly touching, overlapping."""
    step = direction(random)
    factor = (random.uniform(1.3, 2.0), random.uniform(1.0, 1.1), random.uniform(0.3, 0.7))[index % 3]
    sides = []
    for k in range(2):
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = rotation(random), k * step * factor
        vertices, faces = _bumpy_ball(random, RINGS)
        sides.append(Surface(vertices, faces, True, X))
    return MeshCase("meshes", index, sides[0], sides[1])


#: By name, in the order of the picture.
CLASSES = {
    "random": BenchClass("random hulls, apart and overlapping", ("rand_sep", "rand_pen")),
    "near": BenchClass("random hulls, gaps and depths of 1e-2 to 1e-16 of the size", ("near_sep", "near_pen")),
    "resting": BenchClass("boxes on boxes as simulators leave them, 1e-9 to 1e-2 off", ("boxes_rest",)),
    "flush": BenchClass("boxes flush with each other, exactly or but for rounding", ("boxes_flush", "boxes_exact")),
    "needles": BenchClass("needles and plates, 1e-6 to 1e-9 thin", ("needles", "plates")),
    "large": BenchClass(f"hulls of {LARGE} vertices, apart, near, overlapping", make=large),
    "meshes": BenchClass(f"closed meshes of {2 * RINGS * (RINGS - 1)} facets, apart, near, overlapping", make=meshes),
}


def cases_of(name: str, n: int, seed: int) -> list[Case | MeshCase]:
    """n pairs of a class.

    name : of `CLASSES`.   n, seed : whole numbers, n ≥ 1.

    Raises InvalidArgument for an unknown class, listing the known ones.
    """
    check_classes([name])
    kind = CLASSES[name]
    if kind.make is not None:
        return [kind.make(np.random.default_rng([seed, len(name), k]), k) for k in range(n)]
    each = -(-n // len(kind.families))
    lists = [generate(family, each, seed) for family in kind.families]
    return [case for together in zip(*lists) for case in together][:n]


def check_classes(names: list[str]) -> None:
    """Complain about a name that is not in `CLASSES`."""
    for name in names:
        if name not in CLASSES:
            raise InvalidArgument(f"no class {name!r}; there are {', '.join(CLASSES)}")


def _bumpy_ball(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed ball of n − 1 rings of n vertices around the z axis and two poles, its radius 0.4 to 0.5 [m]."""
    theta, phi = np.pi * np.arange(1, n) / n, 2 * np.pi * np.arange(n) / n
    unit = np.stack([
        np.sin(theta)[:, None] * np.cos(phi), np.sin(theta)[:, None] * np.sin(phi),
        np.cos(theta)[:, None] + 0 * phi,
    ], axis=-1).reshape(-1, 3)
    vertices = np.concatenate([unit * random.uniform(0.4, 0.5, (len(unit), 1)), [(0, 0, 0.45), (0, 0, -0.45)]])
    north, south, j = len(unit), len(unit) + 1, np.arange(n)
    k = (j + 1) % n
    faces = [np.stack([np.full(n, north), j, k], axis=1)]
    for a in range(0, n * (n - 2), n):
        b = a + n
        faces += [np.stack([a + j, b + j, b + k], axis=1), np.stack([a + j, b + k, a + k], axis=1)]
    last = n * (n - 2)
    return vertices, np.concatenate([*faces, np.stack([last + k, last + j, np.full(n, south)], axis=1)])
