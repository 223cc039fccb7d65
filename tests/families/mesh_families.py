"""Families of pairs of small meshes: in general position, on grids, flat, identical, without area, touching, scaled."""

from __future__ import annotations

import numpy as np

import collide

RIGHT_ANGLES = [
    np.array(m, dtype=float)
    for m in ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
]


def soup(rng, n, spread=1.0, size=0.7):
    """n triangles about random places."""
    centres = rng.normal(size=(n, 1, 3)) * spread
    return (centres + rng.normal(size=(n, 3, 3)) * size).reshape(-1, 3), np.arange(3 * n).reshape(n, 3)


def grid(rng, n, cells=3):
    """Facets on the points of a small grid: corners, edges and planes coincide, some facets have no area."""
    vertices = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 3).astype(float)
    return vertices, rng.integers(0, len(vertices), (n, 3))


def random_pose(rng, shift=1.0):
    return collide.pose(rng.normal(size=3) * shift, rpy=rng.uniform(-3, 3, 3))


def right_angle_pose(rng, shifts=(-1.0, -0.5, 0.0, 1.0)):
    return collide.pose(rng.choice(shifts, 3), R=RIGHT_ANGLES[rng.integers(3)])


def random_case(rng):
    return soup(rng, 14), soup(rng, 14), random_pose(rng, 0.5), random_pose(rng, 0.5)


def grid_case(rng):
    return grid(rng, 12), grid(rng, 12), right_angle_pose(rng), right_angle_pose(rng)


def turned_grid_case(rng):
    """On grids again, but turned by any angle: coincidences are off by rounding, or exact where poses agree."""
    X = random_pose(rng)
    Y = X.copy()
    if rng.random() < 0.5:
        Y[:3, 3] += rng.choice([-1.0, 0.5, 1.0]) * X[:3, rng.integers(3)]
    return grid(rng, 12), grid(rng, 12), X, Y


def flat_case(rng):
    """All in the plane z = 0.5, in general position or on a grid."""
    parts = []
    for _ in range(2):
        vertices, faces = soup(rng, 10) if rng.random() < 0.5 else grid(rng, 10, 4)
        vertices[:, 2] = 0.5
        parts.append((vertices, faces))
    X, Y = (collide.pose([*rng.choice([-0.5, 0.0, 0.25], 2), 0.0], R=RIGHT_ANGLES[rng.integers(2)]) for _ in range(2))
    return *parts, X, Y


def identical_case(rng):
    mesh = soup(rng, 12) if rng.random() < 0.5 else grid(rng, 10)
    X = random_pose(rng)
    return mesh, mesh, X, X


def degenerate_case(rng):
    """Facets that are segments or points among proper ones, on points that both meshes use."""
    points = np.round(rng.normal(size=(9, 3)) * 4) / 4
    parts = []
    for _ in range(2):
        vertices = np.concatenate([points, (points[:4] + points[4:8]) / 2])
        faces = rng.integers(0, len(vertices), (12, 3))
        faces[:4, 1] = faces[:4, 0]
        faces[:2, 2] = faces[:2, 0]
        parts.append((vertices, faces))
    X = right_angle_pose(rng, (0.0,)) if rng.random() < 0.5 else random_pose(rng)
    return *parts, X, X


def touching_case(rng):
    """A corner of one facet in the interior of another, an ulp or so off or exactly there."""
    vertices, faces = soup(rng, 8)
    vertices = np.round(vertices * 16) / 16
    weights = rng.choice([[0.5, 0.25, 0.25], [0.5, 0.5, 0.0], [1.0, 0.0, 0.0]], len(faces))
    touched = np.einsum("ij,ijk->ik", weights, vertices[faces])
    touched *= 1.0 + rng.choice([0.0, 0.0, 2.0**-52, -(2.0**-52)], (len(faces), 1))
    others = np.round(soup(rng, len(faces))[0] * 16) / 16
    others[::3] = touched
    X = right_angle_pose(rng, (0.0, 0.5)) if rng.random() < 0.7 else random_pose(rng)
    return (vertices, faces), (others, faces.copy()), X, X


def rounded_case(rng):
    """B is only shifted and has its corners where A's are but for the rounding of the shift: coincidences in
    doubles."""
    vertices, faces = soup(rng, 10)
    X = np.eye(4)
    Y = collide.pose(rng.normal(size=3))
    weights = rng.choice([[1.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.25, 0.25]], len(faces))
    others = soup(rng, len(faces))[0]
    others[::3] = np.einsum("ij,ijk->ik", weights, vertices[faces]) - Y[:3, 3]
    return (vertices, faces), (others, faces.copy()), X, Y


def scaled_case(rng):
    """Tiny and huge, far from the origin, and very unlike in size."""
    a, b, X, Y = random_case(rng)
    scale = 10.0 ** rng.integers(-12, 13)
    unlike = 10.0 ** (rng.integers(-3, 1) if rng.random() < 0.9 else -35)
    offset = rng.normal(size=3) * scale * 10.0 ** rng.integers(-1, 5)
    a = (a[0] * scale + offset, a[1])
    b = (b[0] * scale * unlike + offset, b[1])
    X[:3, 3] *= scale
    Y = X.copy()
    if rng.random() < 0.5:
        Y[:3, 3] += rng.normal(size=3) * scale * 0.3
    return a, b, X, Y


FAMILIES = {
    "random": (random_case, 40),
    "grid": (grid_case, 80),
    "turned grid": (turned_grid_case, 80),
    "flat": (flat_case, 80),
    "identical": (identical_case, 60),
    "degenerate": (degenerate_case, 80),
    "touching": (touching_case, 80),
    "rounded": (rounded_case, 60),
    "scaled": (scaled_case, 60),
}
