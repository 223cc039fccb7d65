"""Regions of half-spaces of several families, and the same closed by a far box by hand."""

from __future__ import annotations

import numpy as np

import collide

#: Half the edge of the box that tests close regions by [m].
FAR = 64.0
FAMILIES = ("half-space", "slab", "corridor", "frustum", "cone", "pyramid", "cell", "many", "flat")


def region_rows(rng, family: str) -> tuple[np.ndarray, np.ndarray]:
    """(normals (m, 3), offsets (m,)) of a region that comes within about a metre of the origin."""
    n = unit(rng.normal(size=3))
    u = unit(np.cross(n, rng.normal(size=3)))
    v = np.cross(n, u)
    shift = rng.uniform(-0.6, 0.6, 3)
    angle = np.linspace(0.0, 2.0 * np.pi, int(rng.integers(5, 9)), endpoint=False)[:, None]
    around = np.cos(angle) * u + np.sin(angle) * v
    if family == "half-space":
        normals, offsets = n[None], np.zeros(1)
    elif family == "slab":
        normals, offsets = np.array([n, -n]), np.full(2, rng.uniform(0.05, 0.4))
    elif family == "flat":
        normals, offsets = np.array([(1.0, 0, 0), (-1.0, 0, 0), n]), np.array([0.25, -0.25, 0.3])
        return normals, offsets + np.array([0.0, 0.0, n @ shift])
    elif family == "corridor":
        normals, offsets = around, rng.uniform(0.1, 0.4, len(around))
    elif family == "cone":
        normals, offsets = around - rng.uniform(0.2, 1.5) * n, np.zeros(len(around))
    elif family == "frustum":
        normals = np.vstack((around - rng.uniform(0.4, 1.5) * n, -n, n))
        offsets = np.append(np.zeros(len(around)), (-rng.uniform(0.1, 0.2), rng.uniform(1.0, 3.0)))
    elif family == "pyramid":
        normals, offsets = np.vstack((around + 0.7 * n, -n)), np.append(np.full(len(around), 0.5), 0.1)
    elif family == "cell":
        normals, offsets = rng.normal(size=(6, 3)), rng.uniform(0.05, 0.6, 6)
    else:
        normals = unit(rng.normal(size=(120, 3)) + np.array([0.0, 0.0, 1.5]))
        offsets = np.full(120, 0.5)
    scale = 2.0 ** rng.integers(-3, 4, len(normals))
    return normals * scale[:, None], (offsets + normals @ shift) * scale


def unit(v: np.ndarray) -> np.ndarray:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def by_far_box(normals: np.ndarray, offsets: np.ndarray) -> collide.HPolytope:
    """The region within a far box, by shapes that know nothing of regions."""
    sides = np.vstack((np.eye(3), -np.eye(3)))
    return collide.HPolytope(np.vstack((normals, sides)), np.append(offsets, np.full(6, FAR)))
