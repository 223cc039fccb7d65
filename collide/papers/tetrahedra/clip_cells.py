"""The common part of two tetrahedra: a cell is cut by the planes of the other, in double-doubles with a proven bound.

The pair is given by the heights h_j(i) of corner i of the cell over face j of the other. Over the cell a
height is an affine function given by any four values: their rounding tilts a plane and has no other
effect. So the cell is cut into simplices with their share of its volume, a product of ratios of positive numbers
without cancellation, and the values of the remaining heights at their corners.

**The bound.** Let heights be known to δ_j, their own rounding on the way included. The remaining part differs from
the true part only where |h_j| ≤ δ_j for some j. Over a simplex of volume 1 the values of an affine function, with
least and largest corner values r apart, have a density of at most 3 / r (a quadratic B-spline over
the four values: H. B. Curry and I. J. Schoenberg, "On Pólya frequency functions IV" (1966)). So shares are off by at
most Σ 6 δ_j / r_j, and by the rounding of the products. A face with all corners proven inside cuts nothing
and adds nothing.
"""

from __future__ import annotations

import math

from collide.kernels import kernel
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.error_free import two_sum
from collide.numerics.vec3 import Vec3, absolute, dot, norm1
from collide.papers.tetrahedra.cell_signs import face_corner, lost_by_corners

#: Doubles of a cell here: twelve leading parts, twelve low ones.
WIDE_CELL = 24
#: Affine functions that a simplex carries: four heights, and the shares of corners 1, 2 and 3.
_FUNCTIONS = 7
_CORNER = 2 * _FUNCTIONS
SIMPLEX = 2 + 4 * _CORNER
#: Simplices after three cuts, each into three; twice, from one list into the other; the pieces of the last cut are not
#: kept.
_MAX_LISTED = 27
#: Words of the workspace: the lists, a simplex being cut, and what comes out.
_LAST = 2 * _MAX_LISTED * SIMPLEX
OUT = _LAST + 3 * SIMPLEX
WORK = OUT + 16
#: What comes out: the share (2), its bound, sums of shares times middles (6), the cell's determinant (2), its bound.
SHARE, SHARE_BOUND, MIDDLES, DETERMINANT, DETERMINANT_BOUND = OUT, OUT + 2, OUT + 3, OUT + 9, OUT + 11
#: In double-doubles a sum is good to 3 u², a product to 8 u², a quotient to 16 u²; u² is 2⁻¹⁰⁶. A determinant: 9 u² of
#: its terms from differences, 25 u² from products and sums. Heights on the way through three cuts: ratios to 19 u², so
#: each step 30 u² of the largest. A share: twelve factors of 36 u², eighty sums.
_DETERMINANT_ERROR, _ON_THE_WAY, _SHARE_ERROR = 2.0**-100, 2.0**-99, 2.0**-96
#: More than all that underflow does to low parts.
_TINY = 2.0**-1060


@kernel(inline=True)
def _at(work, k):
    return DD(work[k], work[k + 1])


@kernel(inline=True)
def _put(work, k, value):
    work[k] = value.high
    work[k + 1] = value.low


@kernel(inline=True)
def _between(work, base, tip, k):
    """A component of the difference of two corners, to a relative 3u²."""
    d = two_sum(work[tip + k], -work[base + k])
    low = two_sum(work[tip + 12 + k], -work[base + 12 + k])
    return dd.add(DD(d.high, d.low), DD(low.high, low.low))


@kernel(inline=True)
def _difference(work, base, tip):
    return dd.DDVec3(_between(work, base, tip, 0), _between(work, base, tip, 1), _between(work, base, tip, 2))


@kernel(inline=True)
def _minor(a, b, c, d):
    """ab − cd."""
    return dd.sub(dd.mul(a, b), dd.mul(c, d))


@kernel(inline=True)
def _terms(u, v):
    """Magnitudes of the terms of u × v."""
    return Vec3(abs(u.y * v.z) + abs(u.z * v.y), abs(u.z * v.x) + abs(u.x * v.z), abs(u.x * v.y) + abs(u.y * v.x))


@kernel(inline=True)
def _bound(terms, u1, v1, w, error):
    """Of a determinant in double-doubles, as `cell_signs.bound_of`."""
    size = dot(terms, absolute(w))
    bound = _DETERMINANT_ERROR * size + _TINY if size > 0.0 else 0.0
    if error > 0.0:
        bound += lost_by_corners(u1, v1, norm1(w), error)
    return bound


@kernel
def _write_height(wide, planes, face, corners, work, error):
    """Values of one height at the four corners of the whole cell; (least, largest, largest bound)."""
    a = planes + 3 * face_corner(face, 0)
    u = _difference(wide, a, planes + 3 * face_corner(face, 1))
    v = _difference(wide, a, planes + 3 * face_corner(face, 2))
    n = dd.DDVec3(_minor(u.y, v.z, u.z, v.y), _minor(u.z, v.x, u.x, v.z), _minor(u.x, v.y, u.y, v.x))
    u0 = dd.leading(u)
    v0 = dd.leading(v)
    terms = _terms(u0, v0)
    u1 = norm1(u0)
    v1 = norm1(v0)
    least = math.inf
    largest = -math.inf
    bound = 0.0
    for k in range(4):
        w = _difference(wide, a, corners + 3 * k)
        height = dd.add(dd.add(dd.mul(n.x, w.x), dd.mul(n.y, w.y)), dd.mul(n.z, w.z))
        _put(work, 2 + k * _CORNER + 2 * face, height)
        least = min(least, height.high)
        largest = max(largest, height.high)
        bound = max(bound, _bound(terms, u1, v1, dd.leading(w), error))
    # Products of what follows must not underflow.
    unit = math.ldexp(1.0, -math.frexp(max(abs(least), abs(largest)))[1])
    for k in range(4):
        at = 2 + k * _CORNER + 2 * face
        _put(work, at, dd.scale(unit, _at(work, at)))
    return least * unit, largest * unit, bound * unit


@kernel
def write_determinant(wide, cell, work, error):
    """Six times the volume of a cell, and the bound of its error."""
    u = _difference(wide, cell, cell + 3)
    v = _difference(wide, cell, cell + 6)
    w = _difference(wide, cell, cell + 9)
    x = dd.mul(_minor(u.y, v.z, u.z, v.y), w.x)
    y = dd.mul(_minor(u.z, v.x, u.x, v.z), w.y)
    z = dd.mul(_minor(u.x, v.y, u.y, v.x), w.z)
    u0 = dd.leading(u)
    v0 = dd.leading(v)
    _put(work, DETERMINANT, dd.add(dd.add(x, y), z))
    work[DETERMINANT_BOUND] = _bound(_terms(u0, v0), norm1(u0), norm1(v0), dd.leading(w), error)


@kernel
def clip_cell(wide, planes, corners, work, error, middles):
    """The share of a cell, its corners at ``corners``, that lies in the cell at ``planes``: SHARE and SHARE_BOUND.

    middles : also the sums of shares times barycentric coordinates 1, 2 and 3 of their middles.
    The bound is infinite where a plane cannot be told from the cell's own extent.
    """
    for k in range(OUT, OUT + 9):
        work[k] = 0.0
    bound = 0.0
    cuts = 0
    last = -1
    for face in range(4):
        least, largest, height_bound = _write_height(wide, planes, face, corners, work, error)
        if largest <= -height_bound:  # nothing inside
            return
        if least < height_bound or least < 0.0:
            cuts |= 1 << face
            last = face
            size = largest - least - 2.0 * height_bound
            if size <= 0.0:
                work[SHARE_BOUND] = math.inf
                return
            bound += 6.0 * (height_bound + _ON_THE_WAY * max(abs(least), abs(largest))) / size
    end = _FUNCTIONS if middles else 4
    source = 0
    n = 1
    _put(work, 0, DD(1.0, 0.0))
    for k in range(12):
        _put(work, 2 + (k % 4) * _CORNER + 8 + 2 * (k // 4), DD(1.0 if k % 4 == k // 4 + 1 else 0.0, 0.0))
    for face in range(last):
        if cuts & (1 << face):
            target = _MAX_LISTED * SIMPLEX - source
            n_new = 0
            for k in range(n):
                n_new += _cut(work, source + k * SIMPLEX, target + n_new * SIMPLEX, face, end)
            source = target
            n = n_new
    for k in range(n):
        if last < 0:
            _add(work, source, middles)
        else:
            pieces = _cut(work, source + k * SIMPLEX, _LAST, last, end)
            for piece in range(pieces):
                _add(work, _LAST + piece * SIMPLEX, middles)
    work[SHARE_BOUND] = 1.0625 * bound + _SHARE_ERROR * work[SHARE]


@kernel
def _add(work, at, middles):
    """Add a simplex to what comes out."""
    weight = _at(work, at)
    _put(work, SHARE, dd.add(_at(work, SHARE), weight))
    if middles:
        for j in range(3):
            total = DD(0.0, 0.0)
            for k in range(4):
                total = dd.add(total, _at(work, at + 2 + k * _CORNER + 8 + 2 * j))
            total = dd.mul(dd.scale(0.25, total), weight)
            _put(work, MIDDLES + 2 * j, dd.add(_at(work, MIDDLES + 2 * j), total))


@kernel
def _copy_corner(work, source, corner, target, slot, face, end):
    for k in range(2 * face + 2, 2 * end):
        work[target + 2 + slot * _CORNER + k] = work[source + 2 + corner * _CORNER + k]


@kernel
def _ratio(work, source, inner, outer, face):
    """How far along the edge from a corner inside to one outside the plane is met, as a share of the edge."""
    s = _at(work, source + 2 + inner * _CORNER + 2 * face)
    t = _at(work, source + 2 + outer * _CORNER + 2 * face)
    return dd.div(s, dd.sub(s, t))


@kernel
def _rest(work, source, inner, outer, face):
    """The other fraction, 1 − ratio, without cancellation."""
    s = _at(work, source + 2 + inner * _CORNER + 2 * face)
    t = dd.neg(_at(work, source + 2 + outer * _CORNER + 2 * face))
    return dd.div(t, dd.add(s, t))


@kernel
def _put_cut(work, source, inner, outer, u, v, target, slot, face, end):
    """Write the point of an edge in the plane, with the values of the remaining functions at the point."""
    for k in range(face + 1, end):
        a = _at(work, source + 2 + inner * _CORNER + 2 * k)
        b = _at(work, source + 2 + outer * _CORNER + 2 * k)
        _put(work, target + 2 + slot * _CORNER + 2 * k, dd.add(dd.mul(u, a), dd.mul(v, b)))


@kernel
def _cut(work, source, target, face, end):
    """The part of a simplex where a height is positive, as up to three simplices at ``target``; how many.

    Functions from face + 1 to ``end`` are carried on.
    """
    inside = 0
    n = 0
    below = 0
    for k in range(4):
        height = work[source + 2 + k * _CORNER + 2 * face]
        if height > 0.0:
            inside |= 1 << k
            n += 1
        elif height < 0.0:
            below += 1
    if n == 0 or work[source] == 0.0:
        return 0
    if below == 0:
        for k in range(SIMPLEX):
            work[target + k] = work[source + k]
        return 1
    # Corners inside, then those outside.
    a = b = c = d = 0
    place = 0
    for wanted in range(1, -1, -1):
        for k in range(4):
            if (inside >> k) & 1 == wanted:
                if place == 0:
                    a = k
                elif place == 1:
                    b = k
                elif place == 2:
                    c = k
                else:
                    d = k
                place += 1
    if n == 1:
        return _cut_tip(work, source, target, face, end, a, b, c, d)
    if n == 2:
        return _cut_wedge(work, source, target, face, end, a, b, c, d)
    return _cut_stump(work, source, target, face, end, a, b, c, d)


@kernel
def _cut_tip(work, source, target, face, end, a, b, c, d):
    """Corner a is inside."""
    v_b = _ratio(work, source, a, b, face)
    v_c = _ratio(work, source, a, c, face)
    v_d = _ratio(work, source, a, d, face)
    _put(work, target, dd.mul(_at(work, source), dd.mul(v_b, dd.mul(v_c, v_d))))
    _copy_corner(work, source, a, target, 0, face, end)
    _put_cut(work, source, a, b, _rest(work, source, a, b, face), v_b, target, 1, face, end)
    _put_cut(work, source, a, c, _rest(work, source, a, c, face), v_c, target, 2, face, end)
    _put_cut(work, source, a, d, _rest(work, source, a, d, face), v_d, target, 3, face, end)
    return 1


@kernel
def _cut_wedge(work, source, target, face, end, a, b, c, d):
    """Corners a and b are inside: a prism from a, ac, ad to b, bc, bd."""
    weight = _at(work, source)
    v_ac = _ratio(work, source, a, c, face)
    v_ad = _ratio(work, source, a, d, face)
    v_bc = _ratio(work, source, b, c, face)
    v_bd = _ratio(work, source, b, d, face)
    u_ac = _rest(work, source, a, c, face)
    u_ad = _rest(work, source, a, d, face)
    second = target + SIMPLEX
    third = second + SIMPLEX
    _put(work, target, dd.mul(weight, dd.mul(v_ac, v_ad)))
    _put(work, second, dd.mul(weight, dd.mul(v_bc, dd.mul(u_ac, v_ad))))
    _put(work, third, dd.mul(weight, dd.mul(u_ad, dd.mul(v_bc, v_bd))))
    _copy_corner(work, source, a, target, 0, face, end)
    _put_cut(work, source, a, c, u_ac, v_ac, target, 1, face, end)
    _put_cut(work, source, a, d, u_ad, v_ad, target, 2, face, end)
    _copy_corner(work, source, b, target, 3, face, end)
    _put_cut(work, source, b, c, _rest(work, source, b, c, face), v_bc, second, 3, face, end)
    _put_cut(work, source, b, d, _rest(work, source, b, d, face), v_bd, third, 3, face, end)
    _finish_prism(work, target, second, third, face, end)
    return 3


@kernel
def _cut_stump(work, source, target, face, end, a, b, c, d):
    """Corners a, b and c are inside: a prism from these to ad, bd, cd."""
    weight = _at(work, source)
    v_a = _ratio(work, source, a, d, face)
    v_b = _ratio(work, source, b, d, face)
    v_c = _ratio(work, source, c, d, face)
    u_a = _rest(work, source, a, d, face)
    u_b = _rest(work, source, b, d, face)
    second = target + SIMPLEX
    third = second + SIMPLEX
    _put(work, target, dd.mul(weight, v_a))
    _put(work, second, dd.mul(weight, dd.mul(u_a, v_b)))
    _put(work, third, dd.mul(weight, dd.mul(u_a, dd.mul(u_b, v_c))))
    _copy_corner(work, source, a, target, 0, face, end)
    _copy_corner(work, source, b, target, 1, face, end)
    _copy_corner(work, source, c, target, 2, face, end)
    _put_cut(work, source, a, d, u_a, v_a, target, 3, face, end)
    _put_cut(work, source, b, d, u_b, v_b, second, 3, face, end)
    _put_cut(work, source, c, d, _rest(work, source, c, d, face), v_c, third, 3, face, end)
    _finish_prism(work, target, second, third, face, end)
    return 3


@kernel
def _finish_prism(work, target, second, third, face, end):
    """Write the other two simplices of a prism: each drops the first corner of the simplex before and adds a new
    corner.
    """
    for k in range(3):
        _copy_corner(work, target, k + 1, second, k, face, end)
    for k in range(3):
        _copy_corner(work, second, k + 1, third, k, face, end)
