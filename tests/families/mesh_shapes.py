"""Closed meshes that tests of surfaces and solids share."""

from __future__ import annotations

import numpy as np

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_SIDES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5], [2, 3, 7], [2, 7, 6],
     [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]]
)


def box(low=(-1.0, -1.0, -1.0), high=(1.0, 1.0, 1.0)):
    """Twelve facets."""
    low, high = np.array(low), np.array(high)
    return low + _CORNERS * (high - low), _SIDES


def block_ring():
    """A square ring: the cube of side 3 without the middle column, on a grid of unit cells; walls inside are gone."""
    cells = [(x, y) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    count: dict[tuple, tuple] = {}
    for x, y in cells:
        vertices, faces = box((x, y, 0), (x + 1, y + 1, 1))
        for face in faces:
            key = tuple(sorted(map(tuple, vertices[face].tolist())))
            if key in count:
                del count[key]
            else:
                count[key] = tuple(map(tuple, vertices[face].tolist()))
    corners = np.array(list(count.values())) - [1.5, 1.5, 0.5]
    vertices, faces = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    return vertices, faces.reshape(-1, 3)


def bumpy_sphere(n: int, seed: int = 0):
    """A closed mesh of about n facets on a sphere with bumps: rings of vertices between two poles."""
    rng = np.random.default_rng(seed)
    around = max(4, int(np.sqrt(n)))
    rings = max(2, n // (2 * around))
    theta = np.pi * (np.arange(rings) + 1) / (rings + 1)
    phi = 2 * np.pi * np.arange(around) / around
    radius = 1 + 0.1 * np.sin(3 * theta)[:, None] * np.cos(5 * phi)[None] + 0.01 * rng.normal(size=(rings, around))
    sine, cosine = np.sin(theta)[:, None], np.cos(theta)[:, None]
    ring = np.stack([radius * sine * np.cos(phi), radius * sine * np.sin(phi), radius * cosine], axis=-1)
    vertices = np.concatenate([ring.reshape(-1, 3), [[0, 0, 1.1], [0, 0, -1.1]]])
    north, south = len(vertices) - 2, len(vertices) - 1
    j = np.arange(around)
    k = (j + 1) % around
    faces = [np.stack([np.full(around, north), j, k], axis=1)]
    for i in range(rings - 1):
        a, b = i * around, (i + 1) * around
        faces += [np.stack([a + j, b + j, b + k], axis=1), np.stack([a + j, b + k, a + k], axis=1)]
    last = (rings - 1) * around
    faces.append(np.stack([last + k, last + j, np.full(around, south)], axis=1))
    return vertices, np.concatenate(faces)
