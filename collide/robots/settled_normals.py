"""Normals of overlapping or nearly touching parts, a curved part among them: to the last digits of gradients.

A depth is least along its direction, so that a bracket of a relative width ε tells the direction to √ε alone: to 1e-6
where depths are known to 1e-12. Between curved parts at a gap g normals are as exact as points are, divided by g. At
wider gaps normals are exact to 1e-7.

So B is moved out along the normal n by a length s, up to a wide gap; this gap's normal n' is nearer the true normal.
Where ρ > 0 is the excess of the radii of curvature of A ⊖ B about the normal over the depth, or their sum with the gap,
tangents of n' are s / (ρ + s) of the tangents of n. Moved out along n', and so on, the normal settles: at flat faces
and edges at once.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.kernels import kernel, view_i64
from collide.lowering.packed_convex import HALFSPACE, POINTS
from collide.lowering.shape_table import INTS, KIND, POSE
from collide.narrowphase.rows import (
    BODY_B,
    DISTANCE,
    NORMAL,
    PART_A,
    PART_B,
    POINT_A,
    POINT_B,
    is_undecided_or_refused,
)
from collide.numerics.vec3 import Vec3, add, norm1, put_vec3, scale, sub, vec3_at
from collide.robots.check_scene import (
    BODY_INTS,
    BOX,
    COUNT,
    FIRST,
    HALF,
    INTS_AT,
    N_LINK_PARTS,
    N_PARTS,
    SHAPE_OF_AT,
    body_of_part,
    place,
)
from collide.robots.nearest_pairs import BODY_A, NONE
from collide.robots.part_pairs import ask, is_bounded

#: Gaps below this share of the smaller part's extent are small. Parts are moved out up to a gap of this share, and of a
#: share of their depth besides: normals of wider gaps settle later. Items of fields are not moved: nearer than the
#: least share of a body's extent their normals are not known.
_SMALL_GAP, _WIDE_GAP, _BEYOND_DEPTH, _LEAST_GAP = 2.0**-6, 0.25, 0.5, 2.0**-10
#: A normal has settled where a change is as small as normals of wide gaps are exact, and all further changes, in
#: proportion to the last two, add up to no more than the second; or where a change is as small as the third.
_SETTLED, _REMAINING, _EXACT = 2.0**-25, 2.0**-23, 2.0**-32
_ROUNDS = 64


class Normal(NamedTuple):
    """nhat : from A towards B, NaN where not known.   p_a, p_b : points of both parts in W [m]."""

    nhat: Any
    p_a: Any
    p_b: Any


@kernel(inline=True)
def normal_of_row(scene, row):
    """The `Normal` of a row of `nearest_pairs.py`, of the configuration that is placed."""
    part_a, part_b = row.words[PART_A], row.words[PART_B]
    distance = row.doubles[DISTANCE]
    if part_a == NONE or part_b == NONE:
        is_curved = _has_curved_part(scene, row.words[BODY_A]) or _has_curved_part(scene, row.words[BODY_B])
        if is_curved and distance < _LEAST_GAP * _extent(scene.body_boxes, row.words[BODY_A]):
            return unknown_normal()
    elif (_is_curved(scene, part_a) or _is_curved(scene, part_b)) and (
        is_bounded(scene, part_a) and is_bounded(scene, part_b)  # half-spaces have closed forms
    ):
        size = min(_extent(scene.part_boxes, part_a), _extent(scene.part_boxes, part_b))
        if distance < _SMALL_GAP * size:
            return _settled_normal(scene, row, size)
    return Normal(vec3_at(row.doubles, NORMAL), vec3_at(row.doubles, POINT_A), vec3_at(row.doubles, POINT_B))


@kernel(inline=True)
def unknown_normal():
    nothing = Vec3(math.nan, math.nan, math.nan)
    return Normal(nothing, nothing, nothing)


@kernel(inline=True)
def _is_curved(scene, part):
    """Whether a part is a cylinder, a cone, an ellipsoid, or such a set swollen."""
    words = scene.words
    at = INTS * view_i64(words[SHAPE_OF_AT], part + 1)[part]
    kind = view_i64(words[INTS_AT], at + INTS)[at + KIND]
    return kind != POINTS and kind != HALFSPACE


@kernel(cold=True)
def _has_curved_part(scene, body):
    """Whether any part of a body is curved.   body : a body, or −1 − the number of a body around."""
    words = scene.words
    if body >= 0:
        first = scene.bodies[BODY_INTS * body + FIRST]
        for part in range(first, first + scene.bodies[BODY_INTS * body + COUNT]):
            if _is_curved(scene, part):
                return True
        return False
    first = words[N_LINK_PARTS]
    for part in range(first, words[N_PARTS]):
        if body_of_part(scene, part - first) == -1 - body and _is_curved(scene, part):
            return True
    return False


@kernel(inline=True)
def _extent(boxes, k):
    """The largest half side of box k [m]."""
    at = BOX * k + HALF
    return max(boxes[at], boxes[at + 1], boxes[at + 2])


@kernel(cold=True)
def _settled_normal(scene, row, size):
    """The `Normal` of a row that names its parts.   size : the smaller part's extent [m]."""
    part_a, part_b, b = row.words[PART_A], row.words[PART_B], row.words[BODY_B]
    place(scene, part_a, row.words[BODY_A])
    if b >= 0:
        place(scene, part_b, b)
    nhat, p_a, p_b = vec3_at(row.doubles, NORMAL), vec3_at(row.doubles, POINT_A), vec3_at(row.doubles, POINT_B)
    distance = row.doubles[DISTANCE]
    by = _WIDE_GAP * size + _BEYOND_DEPTH * max(-distance, 0.0) - distance
    poses, at = scene.poses, POSE * part_b + 9
    p_WB = vec3_at(poses, at)
    before, is_known = math.inf, False
    for _ in range(_ROUNDS):
        shift = scale(by, nhat)
        put_vec3(poses, at, add(p_WB, shift))
        gap = ask(scene, part_a, part_b, nhat, False, math.inf)
        if is_undecided_or_refused(gap) or gap.doubles[DISTANCE] <= 0.0:
            break
        change = norm1(sub(vec3_at(gap.doubles, NORMAL), nhat))
        nhat, p_a = vec3_at(gap.doubles, NORMAL), vec3_at(gap.doubles, POINT_A)
        p_b = sub(vec3_at(gap.doubles, POINT_B), shift)
        is_known = change <= _EXACT or (
            change <= _SETTLED and before < math.inf and change * change <= _REMAINING * (before - change)
        )
        if is_known:
            break
        before = change
    put_vec3(poses, at, p_WB)
    return Normal(nhat, p_a, p_b) if is_known else unknown_normal()
