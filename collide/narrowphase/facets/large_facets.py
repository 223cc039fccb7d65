"""How far a box is from a larger facet: by the facet's plane and by the half-spaces along its edges.

Boxes and slabs around a leaf of large facets hold all of a small body in a valley between the facets; no facet does.
Coordinates are in the world's axes, from A's origin, in doubles.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.mesh.bvh import CENTRE, EXPONENT, box_at
from collide.mesh.triangle import Triangle, normal_of, triangle_at
from collide.narrowphase.facets.posed_surfaces import rotate_by_pose
from collide.numerics.vec3 import Vec3, add, cross, dot, norm, scale, sub, vec3_at

#: Shorter vectors give no direction: their squares may underflow.
_SHORT = 1e-150


class WorldBox(NamedTuple):
    """A box in the world's axes, seen from A's origin: its middle, and its half edges."""

    centre: Vec3
    x: Vec3
    y: Vec3
    z: Vec3


@kernel
def world_box(X, shift, tree, ref):
    """The box behind a reference, rotated by a pose X and shifted."""
    unit = math.ldexp(1.0, int(tree.header[EXPONENT]))
    box = box_at(tree, ref)
    centre = add(vec3_at(tree.numbers, CENTRE), scale(unit, box.centre))
    x, y, z = unit * box.half.x, unit * box.half.y, unit * box.half.z
    return WorldBox(
        add(rotate_by_pose(X, centre), shift), Vec3(x * X[0], x * X[4], x * X[8]), Vec3(y * X[1], y * X[5], y * X[9]),
        Vec3(z * X[2], z * X[6], z * X[10]),
    )


@kernel
def gap_to_facet(box, X, shift, triangles, facet):
    """What the distance of a box from a facet, rotated by a pose X and shifted, is at least, but for rounding.

    Along a unit vector two sets are no nearer than their extents. Of unit vectors m, n with gaps g, h > 0 and
    |m·n| = c, the vector g m + h n, at most √((g² + h²)(1 + c)) long, says √((g² + h²) / (1 + c)).
    """
    at = triangle_at(triangles, 9 * facet)
    p, q, r = rotate_by_pose(X, at.p), rotate_by_pose(X, at.q), rotate_by_pose(X, at.r)
    T = Triangle(add(p, shift), add(q, shift), add(r, shift))
    n = normal_of(T)
    length = norm(n)
    if not length > _SHORT:
        return -math.inf
    n = scale(1.0 / length, n)
    above = _gap_along(n, box, T)
    below = _gap_along(scale(-1.0, n), box, T)
    height = max(above, below)
    gap = height
    for k in range(3):
        edge = sub(T.q, T.p) if k == 0 else sub(T.r, T.q) if k == 1 else sub(T.p, T.r)
        out = cross(edge, n)
        length = norm(out)
        if not length > _SHORT:
            continue
        out = scale(1.0 / length, out)
        beside = _gap_along(out, box, T)
        if beside > 0.0 and height > 0.0:
            gap = max(gap, math.sqrt((height * height + beside * beside) / (1.0 + abs(dot(n, out)))))
        gap = max(gap, beside)
    return gap


@kernel(inline=True)
def _gap_along(n, box, T):
    """How far the box is beyond the facet along n."""
    half = abs(dot(n, box.x)) + abs(dot(n, box.y)) + abs(dot(n, box.z))
    return dot(n, box.centre) - half - max(dot(n, T.p), dot(n, T.q), dot(n, T.r))
