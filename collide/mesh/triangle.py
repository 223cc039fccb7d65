"""Triangles in kernels: nine doubles of a buffer as three corners with names."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, cross, dot, put_vec3, sub, vec3_at


class Triangle(NamedTuple):
    p: Vec3
    q: Vec3
    r: Vec3


@kernel(inline=True)
def triangle_at(values, at):
    """Three corners stored in sequence."""
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


@kernel
def sum_of_normals(triangles, first, last):
    """Of triangles first … last − 1."""
    total = Vec3(0.0, 0.0, 0.0)
    for k in range(first, last):
        total = add(total, normal_of(triangle_at(triangles, 9 * k)))
    return total


@kernel(inline=True)
def range_along(n, triangles, first, last, origin):
    """(least, largest) product of n with corners of triangles first … last − 1, seen from the origin given."""
    low = math.inf
    high = -math.inf
    for k in range(9 * first, 9 * last, 3):
        height = dot(n, sub(vec3_at(triangles, k), origin))
        low = min(low, height)
        high = max(high, height)
    return low, high
