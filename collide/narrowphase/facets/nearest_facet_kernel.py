"""The facet nearest to each of many points, eight facets at a time: a walk down the box-tree of a mesh.

Left out is what a box proves farther from the point than the nearest facet so far: boxes are compared in floats, eight
at once, with the rounding of floats added to the limit. Points come along a curve, so that the nearest point of the
point before gives the first limit.

A facet's distance is worked out in doubles, of numbers seen from the point, by the least of three edges and, where the
point stands over the inside, of the height over the plane. Write u = 2⁻⁵³ and L for the distance to the farthest
corner. An edge's nearest place is off by 10u·L (a projection, whatever the edge's length). Corner 0 of a facet is
opposite the longest side, and κ is 1 / sin of the angle there: the height is off by (4 + 2κ)u·L, and where rounding
takes a foot to the wrong side of an edge, by (8 + 4κ)u·L. Needles have κ ≈ 1. Facets with κ > 8, caps, are worked out
in double-doubles; caps with κ > 2⁴⁸ are nowhere farther from their edges than 2⁻⁴⁸ of their longest side, and are their
edges. So every distance is off by less than `ERROR` of L ≤ distance + longest side (measured: 1.6u of it). The limit of
the walk holds this error: the least of all facets' computed distances comes out, of equal ones that of the least
number, whatever the order of the walk.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f32, view_f64, view_i32, view_i64
from collide.kernels.lanes import any_of, select, view_lanes
from collide.mesh.box_overlap import patches_near_place
from collide.mesh.bvh import (
    CENTRE,
    DEPTH,
    EXPONENT,
    HAS_ORIGINS,
    N_FACETS,
    N_NODES,
    NODE,
    NOTHING,
    SLAB,
    SLABS_AT,
    WIDTH,
    box_at,
    link_of,
    open_tree,
    origin_of,
)
from collide.mesh.triangle import triangle_at
from collide.numerics import double_double as dd
from collide.numerics.vec3 import Vec3, add, cross, dot, norm1, put_vec3, scale, sub, vec3_at

#: How far a distance may be off, in units of the distance and the longest side of a facet together: 64u.
ERROR = 2.0**-47
#: Columns of the facets' table: corners, the first opposite the longest side; 1 / square of the sides from corner 0 to
#: 1, 0 to 2, 1 to 2, and of the normal, 0 where there is none; how a facet's inside is looked at.
PER_SQUARE, THICKNESS = 9, 13
COLUMNS = 14
#: Of facets whose inside is: looked at in doubles; not looked at. Of caps the column holds a bound of how far the
#: inside is from the edges.
_REGULAR, _EDGES_ALONE = 0.0, -1.0
#: κ², from which on a facet is a cap, and from which on its edges alone are looked at.
_CAP, _FLAT = 64.0, 2.0**96
#: Sides shorter than this, in units of the mesh, have no normal in doubles. Longest sides count as no shorter.
_SHORT = 2.0**-200
#: Squares below this count as 0: their inverse is out of range.
_LEAST_SQUARE = 2.0**-1000
#: What floats round a gap by, in units, for a place of the size 1, and a gap and its square by besides; places and gaps
#: farther out are compared in doubles, which round by less than `_ROUNDING`.
_FLOAT_ROUNDING, _REACH_ROUNDING, _FAR = 2.0**-21, 1.0 + 2.0**-20, 2.0**10
_ROUNDING = 2.0**-48
#: Balls of other sizes that a point may share, by powers of two.
BALLS = 8
#: Doubles of a walk's work: squares and places of eight facets.
WORK = 4 * WIDTH


class _Facets(NamedTuple):
    """A tree, and the table of its facets, column by column: all lengths in units of 2^exponent.

    slabs : of the tree's boxes (`mesh/bvh_slabs.py`).   table_at : address of (COLUMNS, stride) doubles.
    side : the longest of all sides.
    """

    tree: Any
    slabs: Any
    table_at: int
    stride: int
    side: float


class _Nearest(NamedTuple):
    """square : of the distance, in units.   number : of the facet.   x : from the point to the nearest place.
    place : of the facet in the table."""

    square: float
    number: int
    x: Vec3
    place: int


@entry("float64(int64, int64, int64)")
def lay_out_facets(header_at, table_at, stride):
    """Fill in the table of a tree's facets, in the order of the leaves; returns the longest side, in units.

    table : (COLUMNS, stride) doubles, stride ≥ facets + WIDTH; what is beyond the facets repeats the last.
    """
    tree = open_tree(header_at)
    n, per_unit = tree.header[N_FACETS], math.ldexp(1.0, -int(tree.header[EXPONENT]))
    table, longest = view_f64(table_at, COLUMNS * stride), _SHORT
    for k in range(stride):
        t = triangle_at(tree.triangles, 9 * min(k, n - 1))
        p, q, r = scale(per_unit, t.p), scale(per_unit, t.q), scale(per_unit, t.r)
        a, b, c = sub(r, q), sub(p, r), sub(q, p)
        aa, bb, cc = dot(a, a), dot(b, b), dot(c, c)
        if bb > aa and bb >= cc:
            p, q, r, b, c, aa, bb, cc = q, r, p, c, a, bb, cc, aa
        elif cc > aa:
            p, q, r, b, c, aa, bb, cc = r, p, q, a, b, cc, aa, bb
        side = math.sqrt(aa) * (1.0 + 2.0**-50)
        longest = max(longest, side)
        for corner in range(3):
            v = p if corner == 0 else q if corner == 1 else r
            table[3 * corner * stride + k] = v.x
            table[(3 * corner + 1) * stride + k] = v.y
            table[(3 * corner + 2) * stride + k] = v.z
        across = cross(b, c)
        nn = dot(across, across)
        for column in range(4):
            square = cc if column == 0 else bb if column == 1 else aa if column == 2 else nn
            table[(PER_SQUARE + column) * stride + k] = 1.0 / square if square > _LEAST_SQUARE else 0.0
        table[THICKNESS * stride + k] = _thickness(side, nn, bb * cc)
    return longest


@kernel
def _thickness(side, square, product):
    """Of a facet by its longest side, the square of its normal, the product of the squares of its shorter sides."""
    if side < _SHORT or square * _FLAT < product or not square > _LEAST_SQUARE:
        return _EDGES_ALONE
    if square * _CAP >= product:
        return _REGULAR
    return min(math.sqrt(square) / side * 2.0 + _ROUNDING * side, side)


# --- eight facets -------------------------------------------------------------------------------


@kernel(inline=True)
def _column(facets, column, place):
    return view_lanes(facets.table_at + 8 * (column * facets.stride + place), 1)[0]


@kernel(inline=True)
def _corner(facets, corner, place):
    return Vec3(
        _column(facets, 3 * corner, place), _column(facets, 3 * corner + 1, place),
        _column(facets, 3 * corner + 2, place),
    )


@kernel(inline=True)
def _to_edge(v, e, per_square):
    """From the origin to the nearest places of edges from v to v + e; edges may be points."""
    t = -dot(v, e) * per_square
    t = select(t > 0.0, t, 0.0)
    t = select(t < 1.0, t, 1.0)
    return add(v, scale(t, e))


@kernel(inline=True)
def _nearer(x, square, y):
    """(the shorter of two vectors, its square), the first where equal."""
    other_square = dot(y, y)
    shorter = other_square < square
    return (
        Vec3(select(shorter, y.x, x.x), select(shorter, y.y, x.y), select(shorter, y.z, x.z)),
        select(shorter, other_square, square),
    )


@kernel
def _look_at_eight(facets, place, p, nearest, work_at):
    """The nearest facet so far, or a nearer one of the eight from a place of the table on."""
    a, b, c = _corner(facets, 0, place), _corner(facets, 1, place), _corner(facets, 2, place)
    thickness = _column(facets, THICKNESS, place)
    e, f, g = sub(b, a), sub(c, a), sub(c, b)
    v, w = sub(a, p), sub(b, p)
    x = _to_edge(v, e, _column(facets, PER_SQUARE, place))
    x, square = _nearer(x, dot(x, x), _to_edge(v, f, _column(facets, PER_SQUARE + 1, place)))
    x, square = _nearer(x, square, _to_edge(w, g, _column(facets, PER_SQUARE + 2, place)))
    n = cross(e, f)
    nn, height = dot(n, n), dot(n, v)
    beta, gamma = dot(cross(f, v), n), dot(cross(v, e), n)
    over = (beta >= 0.0) & (gamma >= 0.0) & (beta + gamma <= nn) & (thickness == _REGULAR)
    share = height * _column(facets, PER_SQUARE + 3, place)
    square = select(over, height * share, square)
    # The inside of a cap is nearer than its edges by no more than its thickness, which is 0 of most facets.
    limit = math.sqrt(nearest.square) * (1.0 + _ROUNDING) + thickness
    if not any_of((square <= nearest.square) | ((thickness > 0.0) & (square <= limit * limit))):
        return nearest
    out = view_lanes(work_at, 4)
    out[0] = square
    out[1] = select(over, share * n.x, x.x)
    out[2] = select(over, share * n.y, x.y)
    out[3] = select(over, share * n.z, x.z)
    work = view_f64(work_at, WORK)
    for k in range(WIDTH):
        i = min(place + k, facets.tree.header[N_FACETS] - 1)
        number = np.int64(facets.tree.ids[i])
        at = Vec3(work[WIDTH + k], work[2 * WIDTH + k], work[3 * WIDTH + k])
        nearest = _least(nearest, work[k], number, at, np.int64(i))
    if any_of(thickness > 0.0):
        nearest = _look_at_caps(facets, place, p, nearest)
    return nearest


@kernel(inline=True)
def _least(nearest, square, number, x, place):
    if square < nearest.square or (square == nearest.square and number < nearest.number):
        return _Nearest(square, number, x, place)
    return nearest


@kernel
def _look_at_caps(facets, place, p, nearest):
    """The same of the insides of caps, in double-doubles."""
    table = view_f64(facets.table_at, COLUMNS * facets.stride)
    for k in range(place, min(place + WIDTH, facets.tree.header[N_FACETS])):
        if not table[THICKNESS * facets.stride + k] > 0.0:
            continue
        a, b, c = _corner_of(table, facets.stride, 0, k), _corner_of(table, facets.stride, 1, k), _corner_of(
            table, facets.stride, 2, k
        )
        e, f, v = dd.difference(b, a), dd.difference(c, a), dd.difference(a, p)
        n = dd.cross(e, f)
        nn, height = dd.inner(n, n), dd.inner(n, v)
        beta, gamma = dd.inner(dd.cross(f, v), n), dd.inner(dd.cross(v, e), n)
        if beta.high < 0.0 or gamma.high < 0.0 or dd.less(nn, dd.add(beta, gamma)) or not nn.high > 0.0:
            continue
        share = dd.div(height, nn)
        square = dd.mul(height, share)
        x = Vec3(
            dd.mul(share, n.x).high, dd.mul(share, n.y).high, dd.mul(share, n.z).high
        )
        nearest = _least(nearest, max(square.high, 0.0), np.int64(facets.tree.ids[k]), x, np.int64(k))
    return nearest


@kernel(inline=True)
def _corner_of(table, stride, corner, k):
    at = 3 * corner * stride + k
    return Vec3(table[at], table[at + stride], table[at + 2 * stride])


# --- the walk -----------------------------------------------------------------------------------


@kernel(inline=True)
def _boxes_within(facets, node, x, reach):
    """Bits of a node's boxes that may come within a reach of a place x, in units, from the tree's centre."""
    tree = facets.tree
    if tree.header[HAS_ORIGINS] != 0:
        x = sub(x, origin_of(tree.links, node))
    size = norm1(x)
    limit = (reach + _FLOAT_ROUNDING * (2.0 + size)) * _REACH_ROUNDING
    if size < _FAR and limit < _FAR:
        return patches_near_place(
            tree.boxes, NODE * node, facets.slabs, SLAB * node, np.float32(x.x), np.float32(x.y), np.float32(x.z),
            np.float32(limit * limit), np.float32(limit),
        )
    return _boxes_within_in_doubles(tree, node, x, reach + _ROUNDING * (2.0 + size))


@kernel
def _boxes_within_in_doubles(tree, node, x, reach):
    mask = 0
    origin = origin_of(tree.links, node) if tree.header[HAS_ORIGINS] != 0 else Vec3(0.0, 0.0, 0.0)
    for slot in range(WIDTH):
        box = box_at(tree, WIDTH * node + slot)
        if not box.half.x > NOTHING / 2:
            continue
        c = sub(sub(box.centre, origin), x)
        dx, dy, dz = abs(c.x) - box.half.x, abs(c.y) - box.half.y, abs(c.z) - box.half.z
        dx, dy, dz = max(dx, 0.0), max(dy, 0.0), max(dz, 0.0)
        if math.sqrt(dx * dx + dy * dy + dz * dz) <= reach:
            mask |= 1 << slot
    return mask


@kernel(inline=True)
def _reach(facets, distance):
    """How far the box of a facet may be that has a computed distance of no more than this, in units."""
    return distance + 2.0 * ERROR * (distance + facets.side)


@kernel
def _nearest_facet(facets, p, known, farthest, stack, work_at):
    """The nearest facet of a point, in units.

    known : place of a facet that may be near.   farthest : a bound of the distance.
    """
    tree = facets.tree
    per_unit = math.ldexp(1.0, -int(tree.header[EXPONENT]))
    x = sub(p, scale(per_unit, vec3_at(tree.numbers, CENTRE)))
    nearest = _look_at_eight(facets, known, p, _Nearest(math.inf, np.int64(-1), p, np.int64(0)), work_at)
    reach = _reach(facets, min(farthest, math.sqrt(nearest.square)))
    stack[0] = 0
    top = 1
    while top > 0:
        top -= 1
        node = int(stack[top])
        mask = _boxes_within(facets, node, x, reach)
        seen = -WIDTH  # eight facets from here on have been looked at
        for slot in range(WIDTH):
            if not mask >> slot & 1:
                continue
            link = link_of(tree.links, WIDTH * node + slot)
            if link >= 0:
                stack[top] = link
                top += 1
                continue
            first = ~link >> 3
            if first < seen or first + (~link & 7) > seen + WIDTH:
                before = nearest.square
                nearest = _look_at_eight(facets, first, p, nearest, work_at)
                seen = first
                if nearest.square < before:
                    reach = min(reach, _reach(facets, math.sqrt(nearest.square)))
                    mask &= _boxes_within(facets, node, x, reach)
    return nearest


@entry("void(int64, int64, int64, float64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def nearest_facets(
    header_at, table_at, stride, side, points_at, n, order_at, n_some, distances_at, numbers_at, places_at, stack_at,
    work_at,
):
    """Distances, facets and nearest places of some of n points, in the order given.

    table, stride, side : as of `lay_out_facets`.   points : (n, 3).   order : (n_some,) int32 rows of the points.
    distances, numbers (int64), places (3 each) : a row a point, as points are.   stack : words as of `WIDTH` · (depth +
    2).   work : WORK doubles.
    """
    tree = open_tree(header_at)
    slabs = view_f32(tree.header[SLABS_AT], SLAB * tree.header[N_NODES])
    facets, exponent = _Facets(tree, slabs, table_at, stride, side), int(tree.header[EXPONENT])
    unit, per_unit = math.ldexp(1.0, exponent), math.ldexp(1.0, -exponent)
    points, order = view_f64(points_at, 3 * n), view_i32(order_at, n_some)
    distances, numbers, places = view_f64(distances_at, n), view_i64(numbers_at, n), view_f64(places_at, 3 * n)
    stack = view_i64(stack_at, WIDTH * (tree.header[DEPTH] + 2))
    # A place on the surface, and how far it may be off: its own error, and the rounding of its coordinates.
    seen, off = _corner_of(view_f64(table_at, COLUMNS * stride), stride, 0, 0), 0.0
    place = np.int64(0)
    for i in range(n_some):
        k = int(order[i])
        q = vec3_at(points, 3 * k)
        p = scale(per_unit, q)
        away = sub(p, seen)
        farthest = math.sqrt(dot(away, away)) * (1.0 + _ROUNDING) + off
        nearest = _nearest_facet(facets, p, place, farthest, stack, work_at)
        distance, place = math.sqrt(nearest.square), nearest.place
        seen, off = add(p, nearest.x), 2.0 * ERROR * (distance + side) + 2.0**-51 * (norm1(p) + distance)
        distances[k], numbers[k] = unit * distance, nearest.number
        put_vec3(places, 3 * k, add(q, scale(unit, nearest.x)))


# --- balls that meet no facet -------------------------------------------------------------------


@kernel(inline=True)
def _balls_overlap(points, lower, i, j):
    """Whether the balls around two points that hold no facet have a common point, or a ball holds the other point."""
    away, reach = sub(vec3_at(points, 3 * i), vec3_at(points, 3 * j)), max(lower[i], 0.0) + max(lower[j], 0.0)
    return reach > 0.0 and dot(away, away) * (1.0 + _ROUNDING) < reach * reach


@entry("int64(int64, int64, int64, int64, int64, int64, int64)")
def group_by_balls(points_at, lower_at, n, order_at, n_some, leaders_at, last_at):
    """Leaders (n,) int64 of some of n points, in the order given: a point and its leader are joined by a way off all
    facets, so a closed surface winds around both as often. Returns how many are their own leaders.

    lower : (n,) no facet is nearer than so much.   last : BALLS words of work: looked at is the point before, and the
    last of each size of balls.
    """
    points, lower, order = view_f64(points_at, 3 * n), view_f64(lower_at, n), view_i32(order_at, n_some)
    leaders, n_leaders = view_i64(leaders_at, n), 0
    last = view_i64(last_at, BALLS)
    for size in range(BALLS):
        last[size] = -1
    for i in range(n_some):
        k = int(order[i])
        leaders[k] = k
        before = int(order[i - 1]) if i > 0 else -1
        if before >= 0 and _balls_overlap(points, lower, k, before):
            leaders[k] = leaders[before]
        else:
            for size in range(BALLS):
                if last[size] >= 0 and _balls_overlap(points, lower, k, last[size]):
                    leaders[k] = leaders[last[size]]
                    break
        n_leaders += 1 if leaders[k] == k else 0
        if lower[k] > 0.0:
            last[math.frexp(lower[k])[1] % BALLS] = k
    return n_leaders
