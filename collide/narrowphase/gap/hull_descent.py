"""The lowest vertex of a body along a direction of double-doubles: down the edges of its hull, each step exact.

A hull is convex: a vertex with no lower neighbour is the lowest of all. Rounded heights lack this property. Where edges
nearly are opposite, as on a cap of thousands of vertices, rounding at two neighbours is a thousand times as much across
the cap. So the direction is rounded once, to two doubles a component in the frame of the body, and along the rounded
direction every step is certain: by doubles, by double-doubles, or by the exact sum of all products. The vertex is then
the lowest along a direction off by 2⁻¹⁰⁰, wherever the vertices lie.

Steps on level vertices: the steps of `quickhull`'s hull of a cap, logarithmic in the number of vertices.

Errors, with S, ρ and σ the sizes of `bounds.py`, d the direction in the world, g = Rᵀd, g′ as rounded, u = 2⁻⁵³:

* a component of g′ is a sum of three products of double-doubles, good to 25u²·Σ|R||d|: over an edge no longer than 2ρ
  the height is good to 25u²·√3·2ρσ|d|, as |R| entry by entry stretches by √3·σ at most;
* the height of a vertex v over the first vertex v₀ is (v − v₀)·g′, where v − v₀ is exact: 25u²·2ρσ|d|.

No vertex of a body is lower, relative to its first vertex, than the height found by more than the sum of both errors;
for both bodies together, as ρσ adds up to S at most, 2.2·2⁻¹⁰⁰ S|d|. With the error of the first points' height,
1.25·2⁻⁹⁸ S|d| (`refine_gap.py`), the total is less than `HEIGHT_ERROR`.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import kernel, view_i64
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD, DDVec3
from collide.numerics.exact_dot_sign import exact_sign_of_dot
from collide.numerics.vec3 import column_at, dot, sub, vec3_at
from collide.support.support_tree_query import rings_of
from collide.support.tree_layout import FLAT, HEADER

#: Neighbours that may be visited on the way down; a longer way is for `lowest_of_all`.
MAX_NEIGHBOURS = 768
#: Error of a product of vectors in doubles, in units of Σ|products|: both factors, the product and two sums round once.
_DOUBLE_ERROR = 8.0 * 2.0**-53
#: The same of `dd.inner`; and of either, products below the smallest normal double.
_DD_ERROR, _TINY = 2.0**-101, 2.0**-960


class LowestVertex(NamedTuple):
    """proven : false where it could not be found.   height : over the first vertex, ≤ 0.   n_visited : vertices
    compared."""

    proven: bool
    vertex: int
    height: DD
    n_visited: int


class HeightSign(NamedTuple):
    """certain : whether the sign is proven.   sign : −1, 0 or 1.   height : the same number in doubles, nearly."""

    certain: bool
    sign: int
    height: float


@kernel
def direction_in_body(poses, p, low, low_at, direction, sign):
    """Rᵀ times a stored direction of the world, times ±1.

    p : row of the pose.   low, low_at : where its low parts begin; no doubles where it is as given.
    """
    d = dd.vec3_at(direction, 0)
    x = dd.inner(_column(poses, p, low, low_at), d)
    y = dd.inner(_column(poses, p + 1, low, low_at + 1), d)
    z = dd.inner(_column(poses, p + 2, low, low_at + 2), d)
    return dd.scale_vec3(sign, DDVec3(x, y, z))


@kernel(inline=True)
def _column(poses, p, low, low_at):
    """A column of R."""
    x_low = 0.0
    y_low = 0.0
    z_low = 0.0
    if len(low) > 0:
        x_low = low[low_at]
        y_low = low[low_at + 3]
        z_low = low[low_at + 6]
    return DDVec3(DD(poses[p], x_low), DD(poses[p + 3], y_low), DD(poses[p + 6], z_low))


@kernel
def descend(tree, first, g, terms):
    """A lowest vertex of a hull, exactly, by steps along its edges; `n_visited` is O(log n) of a level cap.

    tree : address of a support tree.   first : the row to start from.   g : `DDVec3`.
    terms : workspace of PRODUCT_TERMS
    doubles.

    Not proven: too many neighbours, or products too small to be exact, or a vertex in the middle of a facet, from which
    edges do not lead to the other side.
    """
    starts, ring, corners = rings_of(tree)
    vertex = first
    n_visited = 0
    while True:
        begin = starts[vertex]
        end = starts[vertex + 1]
        n_visited += end - begin
        if end == begin or n_visited > MAX_NEIGHBOURS:
            return LowestVertex(False, first, DD(0.0, 0.0), n_visited)
        best = vertex
        lowest = 0.0
        plateau = True
        all_certain = True
        for k in range(begin, end):
            certain, sign, height = _compare(vec3_at(corners, 3 * ring[k]), vec3_at(corners, 3 * vertex), g, terms)
            all_certain = all_certain and certain
            plateau = plateau and sign == 0
            if sign < 0 and (best == vertex or height < lowest):
                best = ring[k]
                lowest = height
        if best == vertex:
            break
        vertex = best
    if not all_certain or (plateau and view_i64(tree, HEADER)[FLAT] == 0):
        return LowestVertex(False, first, DD(0.0, 0.0), n_visited)
    height = dd.inner(dd.difference(vec3_at(corners, 3 * vertex), vec3_at(corners, 3 * first)), g)
    if height.high > 0.0:  # rounded: it is not higher
        return LowestVertex(True, vertex, DD(0.0, 0.0), n_visited)
    return LowestVertex(True, vertex, height, n_visited)


@kernel(inline=True)
def _compare(a, b, g, terms):
    """The sign of (a − b)·g."""
    d = sub(a, b)
    h = dd.leading(g)
    height = dot(d, h)
    size = abs(d.x * h.x) + abs(d.y * h.y) + abs(d.z * h.z)
    if height > _DOUBLE_ERROR * size + _TINY:
        return HeightSign(True, 1, height)
    if height < -(_DOUBLE_ERROR * size + _TINY):
        return HeightSign(True, -1, height)
    if (d.x == 0.0 or h.x == 0.0) and (d.y == 0.0 or h.y == 0.0) and (d.z == 0.0 or h.z == 0.0):
        return HeightSign(True, 0, 0.0)
    return _compare_finely(a, b, g, _DD_ERROR * size + _TINY, terms)


@kernel
def _compare_finely(a, b, g, error, terms):
    """`_compare` where doubles leave it open: in double-doubles, then as an exact sum."""
    d = dd.difference(a, b)
    height = dd.inner(d, g)
    if height.high > error:
        return HeightSign(True, 1, height.high)
    if height.high < -error:
        return HeightSign(True, -1, height.high)
    certain, sign = exact_sign_of_dot(d, g, terms)
    return HeightSign(certain, sign, height.high)


@kernel
def lowest_of_all(coords, n, padded, first, g):
    """The lowest of all n vertices by a scan, O(n); `n_visited` counts heights computed in double-doubles, where
    doubles cannot tell a vertex from the lowest so far."""
    start = column_at(coords, padded, first)
    best = first
    lowest = DD(0.0, 0.0)
    n_fine = 0
    for i in range(n):
        vertex = column_at(coords, padded, i)
        x = (vertex.x - start.x) * g.x.high
        y = (vertex.y - start.y) * g.y.high
        z = (vertex.z - start.z) * g.z.high
        # Level is as good: where all heights are exactly 0 none is taken again.
        if x + y + z - _DOUBLE_ERROR * (abs(x) + abs(y) + abs(z)) >= lowest.high:
            continue
        n_fine += 1
        height = dd.inner(dd.difference(vertex, start), g)
        if dd.less(height, lowest):
            best = i
            lowest = height
    return LowestVertex(True, best, lowest, n_fine)
