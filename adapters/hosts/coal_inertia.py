"""Volumes, centres and second moments of coal's geometries, of density 1, in their own frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np


class MassProperties(NamedTuple):
    """volume [m³].   center : (3,) of mass [m].   inertia : (3, 3) about the frame's origin, of density 1 [m⁵]."""

    volume: float
    center: np.ndarray
    inertia: np.ndarray


def flat() -> MassProperties:
    """Of what has no volume, or no end."""
    return MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))


def ellipsoid(radii) -> MassProperties:
    """Of semi-axes (3,)."""
    squares = np.asarray(radii) ** 2
    volume = 4.0 / 3.0 * math.pi * float(np.prod(radii))
    return MassProperties(volume, np.zeros(3), np.diag(0.2 * volume * (squares.sum() - squares)))


def box(side) -> MassProperties:
    """Of edge lengths (3,)."""
    squares = np.asarray(side) ** 2
    volume = float(np.prod(side))
    return MassProperties(volume, np.zeros(3), np.diag(volume / 12.0 * (squares.sum() - squares)))


def cylinder(radius: float, lz: float) -> MassProperties:
    """Along z, centred."""
    volume = math.pi * radius**2 * lz
    across = volume * (radius**2 / 4.0 + lz**2 / 12.0)
    return MassProperties(volume, np.zeros(3), np.diag([across, across, 0.5 * volume * radius**2]))


def capsule(radius: float, lz: float) -> MassProperties:
    """Along z, centred; lz without the caps."""
    middle = cylinder(radius, lz)
    caps = 4.0 / 3.0 * math.pi * radius**3
    across = caps * (0.4 * radius**2 + lz**2 / 4.0 + 0.375 * radius * lz)
    inertia = middle.inertia + np.diag([across, across, 0.4 * caps * radius**2])
    return MassProperties(middle.volume + caps, np.zeros(3), inertia)


def cone(radius: float, lz: float) -> MassProperties:
    """Along z, the apex at +lz/2."""
    volume = math.pi * radius**2 * lz / 3.0
    across = volume * (0.1 * lz**2 + 0.15 * radius**2)
    center = np.array([0.0, 0.0, -0.25 * lz])
    return MassProperties(volume, center, np.diag([across, across, 0.3 * volume * radius**2]))


def polyhedron(vertices: np.ndarray, faces: np.ndarray) -> MassProperties:
    """Of what closed facets wind around, summed over tetrahedra from the origin."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volumes = np.einsum("ni,ni->n", a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if volume == 0.0:
        return flat()
    sums = a + b + c
    center = volumes @ sums / 4.0 / volume
    second = sum(np.einsum("n,ni,nj->ij", volumes, p, p) for p in (a, b, c, sums)) / 20.0
    return MassProperties(volume, center, np.trace(second) * np.eye(3) - second)
