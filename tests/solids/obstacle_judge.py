"""Configuration obstacles, before rounding, against whether the moved bodies meet: by `collide` and in fractions."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import triangles_meet, winding, world_points
from solid_judge import exact_corners
from solid_membership import as_doubles, windings

import collide
from collide.solids.configuration_obstacle import exact_obstacle

TETRAHEDRON = (np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float),
               np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
TURNED = collide.pose((0, 0, 0), rpy=(0.3, -0.4, 0.7))[:3, :3]
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def cells_of_a_grid(cells):
    """Unit cells as one closed surface, walls between them gone."""
    found: dict[tuple, tuple] = {}
    for cell in cells:
        vertices, faces = box(cell, np.array(cell) + 1)
        for face in faces:
            corners = vertices[face].tolist()
            key = tuple(sorted(map(tuple, corners)))
            if found.pop(key, None) is None:
                found[key] = tuple(map(tuple, corners))
    vertices, faces = np.unique(np.array(list(found.values())).reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, faces.reshape(-1, 3)


def random_cells(rng, n: int):
    """n cells that hang together, no two of which touch in an edge or a corner alone."""
    while True:
        cells = [(0, 0, 0)]
        while len(cells) < n:
            cell = np.array(cells[rng.integers(len(cells))])
            k = rng.integers(3)
            cell[k] += rng.choice([-1, 1])
            if tuple(cell.tolist()) not in cells:
                cells.append(tuple(cell.tolist()))
        mesh = cells_of_a_grid(cells)
        edges = np.sort(np.stack([mesh[1], np.roll(mesh[1], -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        if (np.unique(edges, axis=0, return_counts=True)[1] == 2).all():
            return mesh


def horseshoe():
    """A ring with one side open: two of these meet in a ring."""
    return cells_of_a_grid([(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0), (2, 1, 0)])


def cases(seed: int = 0) -> dict:
    """(A, B, R) by name."""
    rng = np.random.default_rng(seed)
    small_ring = (block_ring()[0] * 0.25, block_ring()[1])
    some = {
        "tetrahedra": (TETRAHEDRON, TETRAHEDRON, TURNED),
        "boxes": (box(), box((0, 0, 0), (1, 2, 1)), None),
        "turned boxes": (box(), box(), TURNED),
        "a ring and a box": (block_ring(), box((0, 0, 0), (0.5, 0.5, 0.5)), None),
        "a ring and a box larger than its hole": (block_ring(), box((0, 0, 0), (1.5, 1.5, 0.25)), TURNED),
        "a ring and a box as large as its hole": (block_ring(), box((0, 0, 0), (1, 1, 0.5)), None),
        "rings": (block_ring(), small_ring, None),
        "horseshoes": (horseshoe(), horseshoe(), QUARTER),
        "turned horseshoes": (horseshoe(), horseshoe(), TURNED),
        "bumpy": (bumpy_sphere(60), bumpy_sphere(40, 1), TURNED),
    }
    for k in range(2):
        R = [None, QUARTER, TURNED][rng.integers(3)]
        some[f"cells {k}"] = (random_cells(rng, 3), random_cells(rng, 3), R)
    return {name: (collide.Mesh(*A), collide.Mesh(*B), R) for name, (A, B, R) in some.items()}


class ObstacleVerdict(NamedTuple):
    """wrong : descriptions of positions judged otherwise.   n_points, n_in : positions, of which the bodies meet.
    n_ulp, n_on : of which an ulp or so off a facet, and on one."""

    wrong: list[str]
    n_points: int
    n_in: int
    n_ulp: int
    n_on: int


def pose_of(R, x=(0.0, 0.0, 0.0)) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3] = np.eye(3) if R is None else R
    X[:3, 3] = x
    return X


def judge_obstacle(A, B, R, n_points: int, n_exact: int, seed: int) -> ObstacleVerdict:
    """n_points positions that are doubles: half around, half within 1e-9 of a facet; n_exact of each: an ulp or so off
    a facet, and on one, in fractions."""
    rng = np.random.default_rng(seed)
    exact = exact_obstacle(A, B, pose_of(R))
    arrangement = exact.arrangement
    border = exact_corners(arrangement, arrangement.boundary(exact.keep)[0], [Fraction(0)] * 3)
    triangles = as_doubles(border)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    far = rng.uniform(low - 0.1, high + 0.1, (n_points - n_points // 2, 3))
    rows = rng.integers(len(border), size=n_points // 2 + n_exact)
    near = (triangles[rows] * rng.dirichlet(np.ones(3), len(rows))[:, :, None]).sum(axis=1)
    offset = rng.normal(size=near.shape) * 10.0 ** rng.uniform(-12, -9, (len(near), 1))
    offset[:n_exact] = rng.integers(-1, 2, (n_exact, 3)) * np.spacing(np.abs(near[:n_exact]))
    points = np.concatenate([far, near + offset])
    X = np.array([pose_of(R, x) for x in points])
    meets = collide.collide(A, B, np.eye(4), X)
    wrong, n_in = [], int(meets.sum())
    numbers: list[int | None] = []
    for start in range(0, len(points), 1000):
        numbers += windings(border, points[start : start + 1000])
    for x, hit, number in zip(points.tolist(), meets.tolist(), numbers):
        if number not in (0, 1, None) or hit != (number != 0):
            wrong.append(f"at {x} the bodies {'meet' if hit else 'are apart'}, the obstacle winds {number} times")
    for row in rng.integers(len(border), size=n_exact).tolist():
        p, q, r = border[row]
        i, j, k = rng.integers(1, 5, 3).tolist()
        x = [(i * a + j * b + k * c) / Fraction(i + j + k) for a, b, c in zip(p, q, r)]
        if not meet_in_fractions(A, B, R, x):
            wrong.append(f"on a facet, at {[float(v) for v in x]}, the bodies are apart")
        if overlap_nearby(A, B, R, x, border[row], 1):
            wrong.append(f"just outside, at {[float(v) for v in x]}, the bodies meet")
    return ObstacleVerdict(wrong, len(points), n_in, n_exact, n_exact)


def overlap_nearby(A, B, R, x, triangle, way: int) -> bool:
    """Whether the bodies meet an infinitely small step (10⁻⁶⁰) outside a facet of the obstacle."""
    u, v = ([b - a for a, b in zip(triangle[0], p)] for p in triangle[1:])
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    size = max(abs(float(c)) for c in n)
    step = Fraction(way, 10**60) / Fraction(size)
    return meet_in_fractions(A, B, R, [a + c * step for a, c in zip(x, n)])


def meet_in_fractions(A, B, R, x) -> bool:
    """Whether A and R B + x have a point in common: facets by pairs, and one vertex of each in the other."""
    in_a = world_points(A.vertices, np.eye(4))
    in_b = [[c + s for c, s in zip(p, x)] for p in world_points(B.vertices, pose_of(R))]
    whole = math.lcm(*(c.denominator for p in [*in_a, *in_b] for c in p))
    points_a, points_b = ([[int(c * whole) for c in p] for p in some] for some in (in_a, in_b))
    facets_a = [[points_a[v] for v in face] for face in A.faces.tolist()]
    facets_b = [[points_b[v] for v in face] for face in B.faces.tolist()]
    if any(triangles_meet(P, Q) for P in facets_a for Q in facets_b):
        return True
    return bool(winding(facets_a, points_b[0]) or winding(facets_b, points_a[0]))


def snippet_obstacle(name: str, n_points: int, n_exact: int, seed: int) -> str:
    return f"from obstacle_judge import *; print(judge_obstacle(*cases()[{name!r}], {n_points}, {n_exact}, {seed}))"
