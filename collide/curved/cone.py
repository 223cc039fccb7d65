"""A cone by its numbers: params = (radius of the base, half length). The base is at z = −half, the tip at half."""

from __future__ import annotations

import math

import numpy as np

from collide.curved.chords import (
    MET,
    MISSED,
    ROUNDING,
    UNCLEAR,
    Chord,
    common,
    everything,
    nothing,
    slab_chord,
)
from collide.curved.cylinder import rim_extents, rim_point
from collide.curved.unit_polytopes import ring, rings_around
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3, add, dot, scale


@kernel(inline=True)
def cone_support(params, at, g):
    """The point of a cone farthest along g: the tip, or a point of the base's rim."""
    x, y, across = rim_point(params[at], g)
    half = params[at + 1]
    if half * g.z >= across - half * g.z:
        return Vec3(0.0, 0.0, half)
    return Vec3(x, y, -half)


@kernel(inline=True)
def cone_normal(params, at, p):
    """An outward normal of the side at a point p of the side."""
    across = math.sqrt(p.x * p.x + p.y * p.y)
    return Vec3(p.x, p.y, 0.5 * across * params[at] / params[at + 1])


@kernel
def cone_chord(line, radius, half):
    """Of a cone with its base at z = −half and its tip at half."""
    d = line.direction
    slab = slab_chord(line.origin.z, d.z, -half, half, line, 1, -1)
    if slab.state == MISSED:
        return slab
    slope = 0.5 * radius / half
    if slab.state == MET and slab.first > -math.inf:
        off = (slab.first_upper - slab.first_lower + slab.last_upper - slab.last_lower) * line.length
        deepest = max(_outside_cone(line, slab.first, slope, half), _outside_cone(line, slab.last, slope, half))
        if deepest + (1.0 + slope) * (off + 2.0 * line.error) < 0.0:
            return slab
    return common(_nappe_chord(line, slope, half), slab)


@kernel(inline=True)
def _outside_cone(line, t, slope, half):
    """How far a point of the line is outside the cone, measured across z."""
    p = add(line.origin, scale(t, line.direction))
    return math.sqrt(p.x * p.x + p.y * p.y) - slope * (half - p.z)


@kernel
def _nappe_chord(line, slope, half):
    """Of the endless cone |(x, y)| ≤ slope (half − z): where a quadratic a t² + 2 b t + c is at most 0, on one side."""
    d = line.direction
    middle = -dot(line.origin, d) / (line.length * line.length)
    q = add(line.origin, scale(middle, d))
    s = slope * (half - q.z)
    ds = -slope * d.z
    a = d.x * d.x + d.y * d.y - ds * ds
    b = q.x * d.x + q.y * d.y - s * ds
    c = q.x * q.x + q.y * q.y - s * s
    # Errors of the three, from that of points and of the direction.
    wide = 1.0 + slope
    reach = math.sqrt(q.x * q.x + q.y * q.y) + abs(s)
    off_a = 2.0**-47 * wide * wide * line.length * line.length
    off_b = wide * line.length * (wide * line.error + 2.0**-47 * reach)
    off_c = 2.0 * reach * wide * line.error + (wide * line.error) ** 2 + ROUNDING * reach * reach
    root = b * b - a * c
    off_root = 2.0 * abs(b) * off_b + off_b * off_b + abs(a) * off_c + abs(c) * off_a + off_a * off_c
    if root < -off_root and a > off_a:
        return nothing()
    if not root > 4.0 * off_root:
        return everything(UNCLEAR)
    root = math.sqrt(root)
    sum_ = -(b + math.copysign(root, b))
    near = c / sum_
    near_off = _off_root(near, off_a, off_b, off_c, root)
    if abs(a) <= 2.0 * off_a:  # along a generator: the other end is far away
        far_sign = -math.copysign(1.0, b)  # where the quadratic goes to −∞
        if s + ds * (near + far_sign * abs(near) + far_sign * reach / line.length) < 0.0:
            return nothing()
        return _half_line(near + middle, near_off + ROUNDING * abs(middle), far_sign)
    far = sum_ / a
    far_off = _off_root(far, off_a, off_b, off_c, root)
    if near > far:
        near, far, near_off, far_off = far, near, far_off, near_off
    if a > 0.0:
        if s - ds * b / a < 0.0:
            return nothing()
        near, far = near + middle, far + middle
        near_off += ROUNDING * (abs(middle) + abs(near))
        far_off += ROUNDING * (abs(middle) + abs(far))
        return Chord(MET, near - near_off, near, near + near_off, far - far_off, far, far + far_off, 0, 0)
    if ds > 0.0:
        return _half_line(far + middle, far_off + ROUNDING * abs(middle), 1.0)
    return _half_line(near + middle, near_off + ROUNDING * abs(middle), -1.0)


@kernel(inline=True)
def _off_root(t, off_a, off_b, off_c, root):
    """How far a root of the quadratic may be off: the error of its value over half its slope."""
    return (off_a * t * t + 2.0 * off_b * abs(t) + off_c) / root + ROUNDING * abs(t)


@kernel(inline=True)
def _half_line(t, off, sign):
    if sign > 0.0:
        return Chord(MET, t - off, t, t + off, math.inf, math.inf, math.inf, 0, -1)
    return Chord(MET, -math.inf, -math.inf, -math.inf, t - off, t, t + off, -1, 0)


def cone_extents(params: np.ndarray, g: np.ndarray) -> np.ndarray:
    """(…,) how far a cone reaches along g (…, 3)."""
    return np.maximum(params[1] * g[..., 2], rim_extents(params[0], g) - params[1] * g[..., 2])


def within_cone(params: np.ndarray, points: np.ndarray, error: np.ndarray | float) -> np.ndarray:
    """(m,) bool: whether points (3, m), each coordinate off by ``error`` at most, are within."""
    x, y, z = points
    radius, half = params[:2].tolist()
    aside = np.sqrt(x * x + y * y) + 2.0 * error
    return (aside <= radius * (half - z - error) / (2.0 * half)) & (z - error >= -half)


def cone_polytopes(params: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (n, 3) of a polytope around a cone, and of a polytope within."""
    half = float(params[1])
    outer, inner = (np.vstack([ring(r, -half), [[0.0, 0.0, half]]]) for r in rings_around(params[0]))
    return outer, inner
