"""Triangles in kernels: nine doubles of a buffer as three corners with names."""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, cross, put_vec3, sub, vec3_at


class Triangle(NamedTuple):
    p: Vec3
    q: Vec3
    r: Vec3


@kernel(inline=True)
def triangle_at(values, at):
    """Three corners that stand one after another."""
    return Triangle(vec3_at(values, at), vec3_at(values, at + 3), vec3_at(values, at + 6))


@kernel(inline=True)
def put_triangle(values, at, triangle):
    put_vec3(values, at, triangle.p)
    put_vec3(values, at + 3, triangle.q)
    put_vec3(values, at + 6, triangle.r)


@kernel(inline=True)
def normal_of(triangle):
    """(q − p) × (r − p): across the plane, twice the area long."""
    return cross(sub(triangle.q, triangle.p), sub(triangle.r, triangle.p))
