"""Tetrahedral meshes for tests: soups, lattices of cubes cut in six, slivers; pairs of them that touch everywhere."""

from __future__ import annotations

import logging
from itertools import permutations

import numpy as np
from mesh_families import random_pose

from collide import TetMesh, pose


def quiet(vertices, cells) -> TetMesh:
    """A TetMesh whose turned cells are not remarked upon."""
    log = logging.getLogger("collide")
    level = log.level
    log.setLevel(logging.ERROR)
    try:
        return TetMesh(vertices, cells)
    finally:
        log.setLevel(level)  # not `log.level = `: loggers remember what they would say


def soup(corners) -> TetMesh:
    """Cells (m, 4, 3) that share no vertices."""
    corners = np.asarray(corners, dtype=float)
    return quiet(corners.reshape(-1, 3), np.arange(4 * len(corners)).reshape(-1, 4))


def random_cells(rng, m: int, scale: float = 1.0) -> TetMesh:
    return soup(scale * (0.5 * rng.normal(size=(m, 1, 3)) + rng.normal(size=(m, 4, 3))))


def lattice_cells(rng, m: int, reach: int = 2, unit: float = 1.0) -> TetMesh:
    """Corners in few whole numbers: planes, edges and corners in common."""
    cells: list[np.ndarray] = []
    while len(cells) < m:
        cell = rng.integers(-reach, reach + 1, size=(4, 3))
        if round(np.linalg.det(cell[1:] - cell[0])):
            cells.append(cell * unit)
    return soup(cells)


def slivers(rng, m: int) -> TetMesh:
    """Cells a billionth as thick as they are long, across each other."""
    cells = 0.2 * rng.normal(size=(m, 1, 3)) + rng.normal(size=(m, 4, 3))
    n = rng.normal(size=(m, 1, 3))
    cells -= n * ((cells * n).sum(axis=2, keepdims=True) / (n * n).sum(axis=2, keepdims=True)) * (1 - 1e-9)
    return soup(cells)


def edges_near_faces(rng, m: int) -> tuple[np.ndarray, np.ndarray]:
    """Cells (m, 4, 3) and (m, 4, 3), an edge of each of the first within rounding of a face of the second's."""
    B = rng.normal(size=(m, 4, 3))
    A = np.empty_like(B)
    for k, (a, b, c, d) in enumerate(B):
        n = np.cross(b - a, c - a)
        n *= -np.sign(n @ (d - a)) / np.linalg.norm(n)
        p, q = rng.dirichlet([1.0, 1.0, 1.0], size=2) @ [a, b, c]
        out = rng.normal(size=(2, 3))
        A[k] = p, q, *(0.5 * (p + q) + out + np.outer(rng.uniform(0.2, 1.0, 2) - out @ n, n))
    return A, B


def edges_near_edges(rng, m: int) -> tuple[np.ndarray, np.ndarray]:
    """The same of edges that cross within rounding, the cells on both sides of them."""
    B = rng.normal(size=(m, 4, 3))
    A = np.empty_like(B)
    for k, (a, b, c, d) in enumerate(B):
        x = a + rng.uniform(0.2, 0.8) * (b - a)
        away = x - 0.5 * (c + d)
        e = np.cross(b - a, away) + 0.3 * rng.normal() * (b - a)
        side = 0.3 * (b - a)
        A[k] = x + 0.7 * e, x - rng.uniform(0.3, 0.8) * e, x + away + side, x + away - side + 0.1 * e
    return A, B


def carried_into(X, cells: np.ndarray) -> np.ndarray:
    """Points in the frame of a pose, rounded."""
    return (cells - X[:3, 3]) @ np.linalg.inv(X[:3, :3]).T


def kuhn_cubes(n: int, size: float = 1.0, shift=(0.0, 0.0, 0.0)) -> TetMesh:
    """A cube of n³ cubes, each cut into six tetrahedra around a diagonal (H. W. Kuhn, 1960)."""
    ticks = [np.arange(n + 1) * (size / n) + s for s in shift]
    vertices = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, 3)
    corners = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    cells = []
    for axes in permutations(range(3)):
        steps = np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(axes)]], axis=0)
        cells.append(np.stack([(corners + s) @ [(n + 1) ** 2, n + 1, 1] for s in steps], axis=1))
    return quiet(vertices, np.concatenate(cells))


def shaken(rng, n: int) -> TetMesh:
    """`kuhn_cubes` with inner vertices moved by up to a fifth of a cube."""
    mesh = kuhn_cubes(n)
    is_inner = (mesh.vertices > 1e-9) & (mesh.vertices < 1 - 1e-9)
    return quiet(mesh.vertices + is_inner * rng.uniform(-0.2, 0.2, mesh.vertices.shape) / n, mesh.cells)


def pairs_of_meshes(seed: int):
    """name → (A, B, X_WA, X_WB)."""
    rng = np.random.default_rng(seed)
    eye = np.eye(4)
    mirror = np.diag([-1.0, 1.0, 1.0, 1.0])
    mirror[0, 3] = 0.75
    turned = np.array([[0, -1.0, 0, 0.5], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
    X, Y, Z = (random_pose(rng) for _ in range(3))
    X[:3, 3] *= 0.1
    Y[:3, 3] *= 0.1
    far, near = random_pose(rng, 1e4), random_pose(rng, 1e4)
    faces, edges = edges_near_faces(rng, 5), edges_near_edges(rng, 5)
    apart = tuple(np.concatenate(cells) for cells in zip(edges_near_faces(rng, 4), edges_near_edges(rng, 4)))
    cubes, tenths = kuhn_cubes(1), kuhn_cubes(1, 0.3)
    large = lattice_cells(rng, 3)
    cells = np.concatenate([large.cells, large.cells + 12])
    tiny = quiet(np.concatenate([large.vertices, large.vertices * 1e-70]), cells)
    return {
        "random": (random_cells(rng, 7), random_cells(rng, 7), eye, eye),
        "random, posed": (random_cells(rng, 7), random_cells(rng, 7), X, Y),
        "random, 1e9 m": (random_cells(rng, 6, 1e9), random_cells(rng, 6, 1e9), eye, pose((1e8, 0, 0))),
        "random, 1e-9 m": (random_cells(rng, 6, 1e-9), random_cells(rng, 6, 1e-9), X, X),
        "whole numbers": (lattice_cells(rng, 12), lattice_cells(rng, 12), eye, eye),
        "tenths": (lattice_cells(rng, 9, 2, 0.1), lattice_cells(rng, 9, 2, 0.1), eye, eye),
        "tenths, moved": (lattice_cells(rng, 9, 2, 0.1), lattice_cells(rng, 9, 2, 0.1), eye, pose((0.1, 0.1, 0))),
        "a quarter turn": (lattice_cells(rng, 9), lattice_cells(rng, 9), turned, eye),
        "one frame, turned": (lattice_cells(rng, 9), lattice_cells(rng, 9), Z, Z),
        "slivers": (slivers(rng, 6), slivers(rng, 6), eye, eye),
        "slivers, posed": (slivers(rng, 5), slivers(rng, 5), X, Y),
        "edges near faces": (soup(faces[0]), soup(faces[1]), eye, eye),
        "edges near edges": (soup(edges[0]), soup(edges[1]), eye, eye),
        "edges near faces and edges, far away": (
            soup(carried_into(far, apart[0])), soup(carried_into(near, apart[1])), far, near,
        ),
        "tiny within large": (tiny, tiny, eye, eye),
        "cubes on themselves": (cubes, cubes, eye, eye),
        "cubes by halves": (kuhn_cubes(2), cubes, eye, pose((0.25, 0.5, 0))),
        "cubes by halves in one frame": (kuhn_cubes(2), kuhn_cubes(1, 1.0, (0.5, 0.25, 0)), Z, Z),
        "cubes by tenths": (tenths, tenths, eye, pose((0.1, 0.1, 0))),
        "cubes, mirrored": (cubes, cubes, eye, mirror),
    }
