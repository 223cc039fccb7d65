"""How often rays along an axis leave a body: facets passed from behind, less facets entered from the front.

Boxes of the body's tree lead to the facets beside a ray. Doubles with a bound of their error count clearly
passed facets; the others are listed, and left to integers.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64
from collide.mesh.bvh import CENTRE, EXPONENT, NODE, WIDTH, MeshTree, box_at, open_tree
from collide.numerics.vec3 import add, component, cross, divide, max_abs, put_vec3, scale, sub, vec3_at

#: Answers of a facet: number of passages, or open in doubles.
_OPEN = 2
#: Integers of a ray that starts within a facet, as of `aim_rays`.
AIM = 5
#: More than what underflows in a normal.
_TINY = 1e-290


def count_passages(
    tree: MeshTree, X: np.ndarray, points: np.ndarray, axes: np.ndarray, skipped: np.ndarray, slack: float
) -> tuple[np.ndarray, np.ndarray]:
    """((k,) int64 proven passages, (m, 2) rays and facets left open).

    X : (4, 4), the body's pose.   points : (k, 3) in W, origins of the rays.
    axes : (k,) int64, 0, 1 or 2: the rays' axis, upwards.   skipped : (k,) int64, a facet left out for each ray, or −1.
    slack : bound of the errors of coordinates in W, of points and of vertices worked out in doubles, and of their
    differences. O(log n) a ray for well-shaped bodies.
    """
    X, points = np.ascontiguousarray(X), np.ascontiguousarray(points)
    axes, skipped = (np.ascontiguousarray(x, dtype=np.int64) for x in (axes, skipped))
    totals = np.empty(len(axes), dtype=np.int64)
    stack = np.empty(WIDTH * (tree.depth + 2), dtype=np.int64)
    remaining = np.empty((64 + 4 * len(axes), 2), dtype=np.int64)
    while True:
        count = pass_facets(
            tree.address, address_of(X), address_of(points), address_of(axes), address_of(skipped), len(axes),
            float(slack),
            address_of(totals), address_of(remaining), len(remaining), address_of(stack), len(stack),
        )
        if count <= len(remaining):
            return totals, remaining[:count]
        remaining = np.empty((count, 2), dtype=np.int64)


# --- kernels ------------------------------------------------------------------------------------


@kernel
def _placed(X, i, x, y, z):
    """Coordinate i in W of a point of the body's frame."""
    return X[4 * i] * x + X[4 * i + 1] * y + X[4 * i + 2] * z + X[4 * i + 3]


@kernel
def _box_is_beside(tree, ref, unit, X, points, k, axis, slack):
    """Whether the box behind a reference may meet ray k, from its point upwards along an axis."""
    box = box_at(tree, ref)
    centre, half = box.centre, box.half
    if half.x < 0.0:
        return False
    x = tree.numbers[CENTRE] + unit * centre.x
    y = tree.numbers[CENTRE + 1] + unit * centre.y
    z = tree.numbers[CENTRE + 2] + unit * centre.z
    for i in range(3):
        reach = unit * (abs(X[4 * i]) * half.x + abs(X[4 * i + 1]) * half.y + abs(X[4 * i + 2]) * half.z) + slack
        off = _placed(X, i, x, y, z) - points[3 * k + i]
        if off + reach < 0.0 or (i != axis and off - reach > 0.0):
            return False
    return True


@kernel
def _passage(T, at, X, points, k, axis, slack):
    """1 where the ray leaves through a triangle, −1 where the ray enters, 0 where the ray misses; _OPEN where unclear.

    Relative coordinates below D across the axis, off by ε each, make determinants s off by 4Dε + 2ε² and by
    their rounding, less than Dε / 4; heights z below Z make Σ s z off by 3 (2D²ε + (Z + ε) limit), and
    by less for rounding.
    """
    u = (axis + 1) % 3
    v = (axis + 2) % 3
    ax = _placed(X, u, T[at], T[at + 1], T[at + 2]) - points[3 * k + u]
    ay = _placed(X, v, T[at], T[at + 1], T[at + 2]) - points[3 * k + v]
    bx = _placed(X, u, T[at + 3], T[at + 4], T[at + 5]) - points[3 * k + u]
    by = _placed(X, v, T[at + 3], T[at + 4], T[at + 5]) - points[3 * k + v]
    cx = _placed(X, u, T[at + 6], T[at + 7], T[at + 8]) - points[3 * k + u]
    cy = _placed(X, v, T[at + 6], T[at + 7], T[at + 8]) - points[3 * k + v]
    D = max(abs(ax), abs(ay), abs(bx), abs(by), abs(cx), abs(cy))
    limit = 8.0 * D * slack + 4.0 * slack * slack
    of_c = ax * by - ay * bx
    of_a = bx * cy - by * cx
    of_b = cx * ay - cy * ax
    lowest = min(of_a, of_b, of_c)
    highest = max(of_a, of_b, of_c)
    if lowest < -limit and highest > limit:
        return 0
    if not (lowest > limit or highest < -limit):
        return _OPEN
    az = _placed(X, axis, T[at], T[at + 1], T[at + 2]) - points[3 * k + axis]
    bz = _placed(X, axis, T[at + 3], T[at + 4], T[at + 5]) - points[3 * k + axis]
    cz = _placed(X, axis, T[at + 6], T[at + 7], T[at + 8]) - points[3 * k + axis]
    sense = 1 if lowest > 0.0 else -1
    height = (of_a * az + of_b * bz + of_c * cz) * sense
    Z = max(abs(az), abs(bz), abs(cz)) + slack
    of_height = 16.0 * (D * D * slack + Z * limit)
    if height > of_height:
        return sense
    return 0 if height < -of_height else _OPEN


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def aim_rays(
    places_at, n_places, corners_at, n_facets, rows_at, triangles_at, n, attempt, points_at, aims_at
):
    """Points within triangles of facets to start rays at, and axes that the facets look along.

    places : (n_places, 3) vertices, rounded.   corners : (F, 3).   rows : (n,) facets.   triangles : (n, 9), rounded.
    points : out, (n, 3).   aims : out, (n, AIM), the axis, 1 or −1 as the front looks up or down, 0 where that is open,
    and weights of the corners, other ones at another attempt.

    Corners are off by a unit u M of their size M, edges below L by 4u M, normals by 2 (2L 4u M) and rounding, less than
    32u M L. Points are off by as much as corners, and by a product, two sums and a quotient of positive shares: by less
    than six units, as vertices worked out in doubles, whose slack is 32 units of no less than M.
    """
    places, corners = view_f64(places_at, 3 * n_places), view_i64(corners_at, 3 * n_facets)
    rows, triangles = view_i64(rows_at, n), view_f64(triangles_at, 9 * n)
    points, aims = view_f64(points_at, 3 * n), view_i64(aims_at, AIM * n)
    for k in range(n):
        f = 3 * rows[k]
        p, q = vec3_at(places, 3 * corners[f]), vec3_at(places, 3 * corners[f + 1])
        r = vec3_at(places, 3 * corners[f + 2])
        u, v = sub(q, p), sub(r, p)
        normal = cross(u, v)
        axis = 0
        for i in range(1, 3):
            axis = i if abs(component(normal, i)) > abs(component(normal, axis)) else axis
        limit = 2.0**-48 * max(max_abs(p), max_abs(q), max_abs(r)) * max(max_abs(u), max_abs(v)) + _TINY
        height = component(normal, axis)
        aims[AIM * k] = axis
        aims[AIM * k + 1] = 0 if not abs(height) > limit else (1 if height > 0.0 else -1)
        first, second = 1 + (389 * (k + 1) + 211 * attempt) % 1021, 1 + (613 * (k + 1) + 503 * attempt) % 1021
        third = 1 + (797 * (k + 1) + 97 * attempt) % 1021
        aims[AIM * k + 2], aims[AIM * k + 3], aims[AIM * k + 4] = first, second, third
        a, b, c = vec3_at(triangles, 9 * k), vec3_at(triangles, 9 * k + 3), vec3_at(triangles, 9 * k + 6)
        total = add(add(scale(float(first), a), scale(float(second), b)), scale(float(third), c))
        put_vec3(points, 3 * k, divide(total, float(first + second + third)))


@entry("int64(int64, int64, int64, int64, int64, int64, float64, int64, int64, int64, int64, int64)")
def pass_facets(
    header_at, X_at, points_at, axes_at, skipped_at, n, slack, totals_at, left_at, capacity, stack_at, n_stack
):
    """Returns the number of open pairs of rays and facets; ray and facet are written of the pairs within the capacity.
    totals : out, per ray.
    """
    tree = open_tree(header_at)
    X = view_f64(X_at, 16)
    points = view_f64(points_at, 3 * n)
    axes, skipped = view_i64(axes_at, n), view_i64(skipped_at, n)
    totals = view_i64(totals_at, n)
    remaining = view_i64(left_at, 2 * capacity)
    stack = view_i64(stack_at, n_stack)
    unit = math.ldexp(1.0, int(tree.header[EXPONENT]))
    count = 0
    for k in range(n):
        axis = axes[k]
        totals[k] = 0
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            link = stack[top]
            if link >= 0:
                for slot in range(WIDTH):
                    if _box_is_beside(tree, 8 * link + slot, unit, X, points, k, axis, slack):
                        stack[top] = tree.links[NODE * link + 6 * WIDTH + slot]
                        top += 1
                continue
            run = ~link
            for a in range(run >> 3, (run >> 3) + (run & 7)):
                if tree.ids[a] == skipped[k]:
                    continue
                passage = _passage(tree.triangles, 9 * a, X, points, k, axis, slack)
                if passage != _OPEN:
                    totals[k] += passage
                    continue
                if count < capacity:
                    remaining[2 * count] = k
                    remaining[2 * count + 1] = tree.ids[a]
                count += 1
    return count
