"""Whether the least depth of two points, segments or boxes has a single direction, by trying all directions.

A ⊖ B of these cores is a zonotope, a sum of segments; each facet is spanned by two segments. So the directions are the
cross products of pairs of segments, both ways: the separating axes of two boxes.
"""

from __future__ import annotations

from collide.derivatives.features import LEVEL, reach_of, vertex_of
from collide.kernels import kernel
from collide.lowering.packed_convex import POINTS
from collide.lowering.set_rows import PARAMS
from collide.numerics.vec3 import Vec3, add, cross, dot, neg, norm, norm1, put_vec3, rotate, scale, sub, vec3_at

#: Half segments of two boxes, and the doubles that hold them.
MAX_SEGMENTS = 6
ZONOTOPE_DOUBLES = 3 * MAX_SEGMENTS
#: A direction is another one, and as short, where its depth is longer by less than this part of the depth, times one
#: minus the cosine between both.
TIED = 2.0**-16
#: Directions at a smaller angle are the same, pairs of segments at a smaller one parallel (sines, squared).
_SAME, _PARALLEL = 2.0**-40, 2.0**-60


@kernel(inline=True)
def is_zonotope(body):
    """Whether a core is a point, a segment or a box."""
    return body.kind == POINTS and (body.count <= 2 or (body.count == 8 and body.numbers[PARAMS] > 0.0))


@kernel
def has_single_direction(A, B, doubles, pose_a, pose_b, at, n, d):
    """1 where n, of cores at the signed distance d ≤ 0 [m], is the only direction, 0 where another is as short, −1
    where facets do not tell: points and segments in line.

    doubles : workspace: poses of both at ``pose_a`` and ``pose_b``, and from ``at`` on ZONOTOPE_DOUBLES.
    """
    count = _put_segments(A, doubles, pose_a, at, 0)
    count = _put_segments(B, doubles, pose_b, at, count)
    centre = sub(_centre(B, doubles, pose_b), _centre(A, doubles, pose_a))
    size = norm1(centre) + reach_of(A) + reach_of(B)
    least = max(TIED * -d, LEVEL * size)
    has_facets = False
    for i in range(count):
        for j in range(i + 1, count):
            u, v = vec3_at(doubles, at + 3 * i), vec3_at(doubles, at + 3 * j)
            m = cross(u, v)
            length = norm(m)
            if length * length <= _PARALLEL * dot(u, u) * dot(v, v):
                continue
            has_facets = True
            m = scale(1.0 / length, m)
            width = 0.0
            for k in range(count):
                width += abs(dot(m, vec3_at(doubles, at + 3 * k)))
            height = dot(m, centre)
            if _is_tied(n, m, height - width, d, least) or _is_tied(n, neg(m), -height - width, d, least):
                return 0
    return 1 if has_facets else -1


@kernel(inline=True)
def _is_tied(n, m, separation, d, least):
    """Whether another direction than n parts the cores by as short a way."""
    apart = sub(m, n)
    half = 0.5 * dot(apart, apart)  # 1 − m·n
    return half > _SAME and separation > d - least * half


@kernel
def _put_segments(body, doubles, pose, at, count):
    """Write half segments of a core behind ``count`` others; how many there are."""
    if body.count == 2:
        half = scale(0.5, sub(vertex_of(body, 1), vertex_of(body, 0)))
        put_vec3(doubles, at + 3 * count, rotate(doubles, pose, half))
        return count + 1
    if body.count == 8:
        for axis in range(3):
            half = body.numbers[PARAMS + axis]
            x = half if axis == 0 else 0.0
            y = half if axis == 1 else 0.0
            z = half if axis == 2 else 0.0
            put_vec3(doubles, at + 3 * count, rotate(doubles, pose, Vec3(x, y, z)))
            count += 1
    return count


@kernel(inline=True)
def _centre(body, doubles, pose):
    """The middle of a core, in the world."""
    middle = Vec3(0.0, 0.0, 0.0)
    if body.count <= 2:
        middle = scale(0.5, add(vertex_of(body, 0), vertex_of(body, body.count - 1)))
    return add(rotate(doubles, pose, middle), vec3_at(doubles, pose + 9))
