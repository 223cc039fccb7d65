"""Matrices of three rows, in kernels."""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, dot


class Matrix3(NamedTuple):
    """A (3, 3) matrix by its rows."""

    x: Vec3
    y: Vec3
    z: Vec3


@kernel(inline=True)
def apply(M, a):
    """M a."""
    return Vec3(dot(M.x, a), dot(M.y, a), dot(M.z, a))
