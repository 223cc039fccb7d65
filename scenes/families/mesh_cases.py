"""Triangle meshes that collision libraries get wrong: coplanar grids, equal poses, insides, facets without area.

A case is plain numbers, as those of hulls are (`case.py`), with facets. Where a family promises contact, it is exact:
coordinates and poses are multiples of powers of two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.scenes.families.ingredients import EXACT_ROTATIONS, rotation
from collide.shapes import Mesh


class Surface(NamedTuple):
    """A mesh: vertices (n, 3) [m], facets (m, 3), whether it is meant as a solid, and its pose (4, 4)."""

    vertices: np.ndarray
    faces: np.ndarray
    solid: bool
    X: np.ndarray

    def diagonal(self) -> float:
        """Diagonal of the box around the vertices, in the mesh's frame [m]."""
        return float(np.sqrt(np.square(np.ptp(self.vertices, axis=0)).sum()))


class MeshCase(NamedTuple):
    """A pair of meshes; every double is meant as the real number it is.   seed, size : as in `Case`."""

    family: str
    index: int  # type: ignore[assignment]  # hides the method of tuples, which nobody asks of a case
    a: Surface
    b: Surface
    seed: int = 0
    size: tuple = ()

    def shapes(self) -> tuple:
        """(A, B, X_WA, X_WB) as `collide.distance` takes them."""
        A, B = (Mesh(s.vertices, s.faces, solid=s.solid) for s in (self.a, self.b))
        return A, B, self.a.X, self.b.X

    def to_dict(self) -> dict:
        """Plain data for JSON; floats survive the way there and back."""
        sides = {
            name: {"vertices": s.vertices.tolist(), "faces": s.faces.tolist(), "solid": s.solid, "X": s.X.tolist()}
            for name, s in (("a", self.a), ("b", self.b))
        }
        return {"family": self.family, "index": self.index, "seed": self.seed, "size": dict(self.size), **sides}

    def snippet(self) -> str:
        """Python that asks collide this question again: the generator's call."""
        call = ", ".join(
            [repr(self.family), str(self.index + 1), str(self.seed), *(f"{k}={v!r}" for k, v in self.size)]
        )
        return (
            "import collide\nfrom collide.scenes.families import generate\n\n"
            f"A, B, X_WA, X_WB = generate({call})[-1].shapes()\n"
            "print(collide.collide(A, B, X_WA, X_WB), collide.distance(A, B, X_WA, X_WB))\n"
        )


def mesh_grids(rng, index: int) -> MeshCase:
    """Two bumpless grids of facets in one plane: flush, side by side, apart by 2⁻³⁰ or crossing by it."""
    n = int(rng.integers(2, 5))
    A, B = (_grid(n, 2.0 ** -int(rng.integers(0, 3))) for _ in range(2))
    height = float(rng.choice([0.0, 0.0, 2.0**-30]))
    shift = np.array([*rng.integers(-n, n + 1, 2) * 0.25, height])
    return _turned(rng, (*A, False), (*B, False), shift)


def mesh_identical(rng, index: int) -> MeshCase:
    """The same solid or surface in the same pose, or moved by one unit in the last place of its size."""
    vertices, faces = _blob(rng, 6)
    solid = bool(rng.random() < 0.5)
    shift = np.array([float(rng.choice([0.0, 0.0, 2.0**-52])), 0.0, 0.0])
    return _turned(rng, (vertices, faces, solid), (vertices, faces, solid), shift, exact=index % 2 == 0)


def mesh_nested(rng, index: int) -> MeshCase:
    """A small body in a larger one: within its wall, in its cavity, in the hole of a ring, or in a mere surface."""
    kind = int(rng.integers(4))
    inner = _box(0.125 * rng.uniform(0.1, 0.9, 3))
    if kind == 0:
        outer, at = (*_box(np.ones(3)), True), rng.uniform(-0.4, 0.4, 3)
    elif kind == 1:  # a cavity runs the other way round
        (v, f), (w, g) = _box(np.ones(3)), _box(np.full(3, 0.5))
        outer, at = (np.concatenate([v, w]), np.concatenate([f, g[:, ::-1] + len(v)]), True), rng.uniform(-0.4, 0.4, 3)
    elif kind == 2:
        outer, at = (*_ring(), True), np.array([rng.choice([0.0, 0.375]), rng.uniform(-0.3, 0.3), 0.0])
    else:
        outer, at = (*_box(np.ones(3)), False), rng.uniform(-0.4, 0.4, 3)
    return _turned(rng, outer, (*inner, True), at, exact=index % 2 == 0)


def mesh_gaps(rng, index: int) -> MeshCase:
    """Two solids whose nearest facets are 1e-9 of their size apart, or overlap by it."""
    (v, f), (w, g) = _blob(rng, 6), _blob(rng, 6)
    step = float(rng.choice([1.0, -1.0])) * 1e-9
    return _turned(
        rng, (v, f, True), (w, g, True), np.array([0.0, 0.0, v[:, 2].max() - w[:, 2].min() + step]), exact=True
    )


def mesh_soups(rng, index: int) -> MeshCase:
    """Loose facets on a coarse grid, many of them doubled, coplanar or without area."""
    sides = []
    for _ in range(2):
        n = int(rng.integers(4, 12))
        vertices = rng.integers(-3, 4, (n, 3)) * 0.25
        faces = rng.integers(0, n, (n, 3))
        sides.append(
            (vertices, np.concatenate([faces, faces[: n // 3, ::-1], np.repeat(faces[:2, :1], 3, axis=1)]), False)
        )
    return _turned(rng, sides[0], sides[1], rng.integers(-4, 5, 3) * 0.25, exact=index % 3 > 0)


def mesh_scales(rng, index: int) -> MeshCase:
    """A solid of a metre, and crumbs of 1e-12 m on, beside or inside it."""
    vertices, faces = _blob(rng, 5)
    crumb, facets = _box(1e-12 * rng.uniform(0.5, 1.5, 3))
    facet = vertices[faces[rng.integers(len(faces))]]
    at = facet[0] if rng.random() < 0.4 else facet.mean(axis=0) if rng.random() < 0.5 else rng.uniform(-0.3, 0.3, 3)
    return _turned(rng, (vertices, faces, True), (crumb, facets, True), at, exact=index % 2 == 0)


FAMILIES = (mesh_grids, mesh_identical, mesh_nested, mesh_gaps, mesh_soups, mesh_scales)


# --- parts ------------------------------------------------------------------------------------------


def _turned(rng, A, B, shift, *, exact: bool = True) -> MeshCase:
    """The pair with B moved by a shift, both then turned and moved alike: by an exact rotation, or any."""
    R = EXACT_ROTATIONS[rng.integers(len(EXACT_ROTATIONS))] if exact else rotation(rng)
    t = rng.integers(-64, 65, 3) / 16
    sides = []
    for (vertices, faces, solid), step in ((A, np.zeros(3)), (B, np.asarray(shift, dtype=float))):
        X = np.eye(4)
        X[:3, :3], X[:3, 3] = R, (R * step).sum(axis=1) + t
        sides.append(Surface(np.asarray(vertices, dtype=float), np.asarray(faces), solid, X))
    return MeshCase("", 0, sides[0], sides[1])


def _grid(n: int, side: float) -> tuple[np.ndarray, np.ndarray]:
    """2 n² facets in the plane z = 0."""
    vertices = np.array([(x * side / n, y * side / n, 0.0) for x in range(n + 1) for y in range(n + 1)])
    vertices = np.round(vertices * 2**20) / 2**20
    faces = []
    for x in range(n):
        for y in range(n):
            a, b = x * (n + 1) + y, (x + 1) * (n + 1) + y
            faces += [(a, b, b + 1), (a, b + 1, a + 1)]
    return vertices, np.array(faces)


def _box(half) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    faces = [
        (0, 1, 3), (0, 3, 2), (4, 7, 5), (4, 6, 7), (0, 5, 1), (0, 4, 5),
        (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
    ]
    return corners, np.array(faces)


def _ring() -> tuple[np.ndarray, np.ndarray]:
    """A square ring around the z axis: a tube of four sides."""
    vertices = np.array(
        [
            (r * x, r * y, z)
            for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1))
            for r, z in ((0.25, -0.125), (0.5, -0.125), (0.5, 0.125), (0.25, 0.125))
        ]
    )
    faces = []
    for i in range(4):
        for k in range(4):
            a, b = 4 * i + k, 4 * i + (k + 1) % 4
            c, d = 4 * ((i + 1) % 4) + k, 4 * ((i + 1) % 4) + (k + 1) % 4
            faces += [(a, c, b), (b, c, d)]
    return vertices, np.array(faces)


def _blob(rng, n: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed, bumpy ball of rings around the z axis, its coordinates multiples of 2⁻²⁰."""
    theta, phi = np.pi * (np.arange(n - 1) + 1) / n, 2 * np.pi * np.arange(n) / n
    radius = 0.5 * rng.uniform(0.6, 1.0, (n - 1, n))
    ring = np.stack(
        [
            radius * np.sin(theta)[:, None] * np.cos(phi),
            radius * np.sin(theta)[:, None] * np.sin(phi),
            radius * np.cos(theta)[:, None] + 0 * phi,
        ],
        axis=-1,
    )
    vertices = np.concatenate([ring.reshape(-1, 3), [(0, 0, 0.55), (0, 0, -0.55)]])
    north, south, j = len(vertices) - 2, len(vertices) - 1, np.arange(n)
    k = (j + 1) % n
    faces = [np.stack([np.full(n, north), j, k], axis=1)]
    for i in range(n - 2):
        a, b = i * n, (i + 1) * n
        faces += [np.stack([a + j, b + j, b + k], axis=1), np.stack([a + j, b + k, a + k], axis=1)]
    last = (n - 2) * n
    faces.append(np.stack([last + k, last + j, np.full(n, south)], axis=1))
    return np.round(vertices * 2**20) / 2**20, np.concatenate(faces)
