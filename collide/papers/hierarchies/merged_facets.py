"""Facets that may be left out of a body's polar: facets merged into a neighbouring facet.

A flat side, turned and rounded, is thousands of facets in doubles. Their polar points crowd within an ulp or so
of each other: the highest of them along a direction is a matter of rounding, and edges from far away fan out to
any of them. So a facet F is merged into a facet G beside F if all corners of F lie within a part τ of G's plane,
⟨v − o, q_G⟩ ≥ 1 − τ. Without the planes of merged facets the body grows by the part τ at most: let x be outside the
body, and y in facet F where the segment from o to x leaves the body. Then ⟨y − o, q_G⟩ ≥ 1 − τ, since y is in the hull
of F's corners, and if x is below G's plane, |x − o| ≤ |y − o| / (1 − τ).
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64
from collide.numerics.vec3 import dot, sub, vec3_at
from collide.papers.hierarchies.true_facets import Cloud, label_patches, twins_of

#: τ of a round body; of thin ones this times what rounding leaves of ⟨v − o, q⟩.
_LEAST_PART, _PER_ROUNDING = 2.0**-45, 2.0**-49


def facet_of_triangles(cloud: Cloud, triangles: np.ndarray, twins: np.ndarray) -> np.ndarray:
    """(f,) int32, the number of each triangle's true facet, as `true_facets` counts them."""
    patch, stack = np.empty(len(triangles), dtype=np.int32), np.empty(len(triangles), dtype=np.int32)
    label_patches(
        *cloud.addresses, address_of(triangles), address_of(twins), len(triangles), address_of(patch), address_of(stack)
    )
    return patch


def merged_facets(
    cloud: Cloud, triangles: np.ndarray, origin: np.ndarray, polar: np.ndarray, weight: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(kept facets, ascending; for each facet the index among the kept of the facet merged into; facet of each
    triangle).

    triangles : (f, 3) int32, a closed surface.   origin : (3,), inside.
    polar : (m, 3), the polar point of each true facet.   weight : (m,), Σ V_k |q_k| with |v_k − o_k| ≤ V_k.

    Facets are visited by falling size, and each absorbs all neighbours within reach. O(m log m) for facets with few
    corners.
    """
    twins = twins_of(triangles)
    patch = facet_of_triangles(cloud, triangles, twins)
    a, b, c = (cloud.scaled[triangles[:, k]] for k in range(3))
    area = np.square(np.cross(b - a, c - a)).sum(axis=1)
    widest = np.zeros(len(polar))
    np.maximum.at(widest, patch, area)
    order = np.argsort(-widest, kind="stable")
    listed = np.argsort(patch, kind="stable").astype(np.int32)
    start = np.searchsorted(patch[listed], np.arange(len(polar) + 1)).astype(np.int64)
    floor = np.ascontiguousarray(1.0 - np.maximum(_LEAST_PART, _PER_ROUNDING * weight))
    taken_by, stack = np.full(len(polar), -1, dtype=np.int64), np.empty(len(polar), dtype=np.int64)
    centre, points = np.ascontiguousarray(origin), np.ascontiguousarray(polar)
    merge_facets(
        address_of(cloud.originals), len(cloud.originals), address_of(triangles), address_of(twins), len(triangles),
        address_of(patch), address_of(listed), address_of(start), len(polar), address_of(order), address_of(centre),
        address_of(points), address_of(floor), address_of(taken_by), address_of(stack),
    )
    keep = np.flatnonzero(taken_by == np.arange(len(polar)))
    return keep, np.searchsorted(keep, taken_by), patch


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def merge_facets(
    points_at, rows, corners_at, twins_at, count, patch_at, listed_at, start_at, facets, order_at, origin_at, polar_at,
    floor_at, taken_by_at, stack_at,
):
    """Merge facets: write for each facet the number of the absorbing facet, the facet's own number if kept.

    listed, start : the triangles of each facet.   order : facets in the order of visits.
    floor : (facets,) the least height ⟨v − o, q⟩ of the corners of absorbed facets, q the absorbing facet's polar
        point.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    points = view_f64(points_at, 3 * rows)
    corners = view_i32(corners_at, 3 * count)
    twins = view_i32(twins_at, 3 * count)
    patch = view_i32(patch_at, count)
    listed = view_i32(listed_at, count)
    start = view_i64(start_at, facets + 1)
    order = view_i64(order_at, facets)
    origin = vec3_at(view_f64(origin_at, 3), 0)
    polar = view_f64(polar_at, 3 * facets)
    floor = view_f64(floor_at, facets)
    taken_by = view_i64(taken_by_at, facets)
    stack = view_i64(stack_at, facets)
    for k in range(facets):
        facet = order[k]
        if taken_by[facet] >= 0:
            continue
        taken_by[facet] = facet
        q = vec3_at(polar, 3 * facet)
        stack[0] = facet
        depth = 1
        while depth > 0:
            depth -= 1
            at = stack[depth]
            for place in range(start[at], start[at + 1]):
                t = np.int64(listed[place])
                for h in range(3 * t, 3 * t + 3):
                    beside = np.int64(patch[twins[h] // 3])
                    if taken_by[beside] < 0 and in_reach(
                        points, corners, listed, start[beside], start[beside + 1], origin, q, floor[facet]
                    ):
                        taken_by[beside] = facet
                        stack[depth] = beside
                        depth += 1


@kernel
def in_reach(points, corners, listed, begin, end, origin, q, floor):
    """Whether all corners of these triangles are at least as high along q as the floor."""
    for place in range(begin, end):
        t = np.int64(listed[place])
        for h in range(3 * t, 3 * t + 3):
            if not dot(sub(vec3_at(points, 3 * np.int64(corners[h])), origin), q) >= floor:
                return False
    return True
