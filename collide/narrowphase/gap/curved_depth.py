"""The last digits of the depth of two overlapping convex sets, a cylinder, cone or ellipsoid among them.

The depth of the cores is the least σ(n) = σ_A(n) + σ_B(−n) − n·t over all unit vectors n, with t from A's origin to
B's: σ is the support function of A ⊖ B. `curved_features.py` proposes where the least value is taken. Any value bounds
the depth from above; two arguments bound it from below, by the value at n* but for a rounding.

**A ball within.** A point of B that is d deep within A proves a depth of d (the ball around it is in A ⊖ B). With a
ball of radius ρ that rolls inside an ellipsoid, as in `shallow_ellipsoids.py`, the centre lies in the ellipsoid's core
and a depth of ρ − |c − b| is proven.

**A surface and a bend.** EPA's surface lies in A ⊖ B grown by ``error``, and each ray from the origin meets it. If u is
a direction of value σ(u) < s, the ray along u meets the surface no farther from the origin than s + ``error``, hence in
a facet of which a corner or the plane is as near. All those facets lie within a cone about n*: u is n* + τ w over its
length, with w a unit vector across n* and τ ≤ T. Within this cone features of A and B, sets within A and B, have a
support of the form

    V(n* + τ w) = Σ linear + Σ √(a + 2 b τ + c τ²) + Σ ρ |d·(n* + τ w)|,

the roots from an ellipsoid's surface, a rim or a circle of a side, the last sum from flat directions d along which a
point may move by ρ d both ways. A root is convex in τ with a second derivative (a c − b²) / (a + 2 b τ + c τ²)^{3/2}:
the one at n*, which is the Hessian's, times at least (1 + τ r)⁻³ where r² bounds c / a. And |d·w| ≥ (d·w)² / |d|, so
ρ |d·w| τ ≥ ½ τ² (2 ρ / (T |d|)) (d·w)². Let λ be the least eigenvalue of the sum of these forms across n*, and g the
length of V's gradient across n*, next to 0. If λ ≥ V(n*), then

    σ(u) ≥ (V(n*) − g T + ½ λ τ²) / √(1 + τ²) ≥ V(n*) − g T,

since √(1 + τ²) ≤ 1 + ½ τ². (A line of a cone bends as it moves: its form is taken from the smaller circle.) Where λ is
less, as for a ball in the middle of a cylinder, the least value has no single place, and EPA's bracket stays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.lowering.packed_convex import CONE, CYLINDER, POINTS
from collide.narrowphase.epa.polytope_surface import PLANE, corner, normal_of
from collide.narrowphase.gap.curved_features import (
    END,
    ERROR,
    SIDE,
    VERTEX,
    beyond,
    nearest_features,
    turned,
    turned_back,
)
from collide.narrowphase.gjk.minkowski_difference import point_at
from collide.narrowphase.shallow_ellipsoids import rolling_radius
from collide.numerics import double_double as dd
from collide.numerics.double_double import DD
from collide.numerics.rigid_poses import off_rotation
from collide.numerics.vec3 import Vec3, cross, divide, dot, norm, scale, sub, unit_orthogonal

#: How near to a flat feature, in radians, a direction of EPA is for that feature to be taken.
_FLAT = 0.03
#: What points may be off the normal by, of the depth: bounds lose a product with that, of itself or of a narrow cone.
_ACROSS = 2.0**-44
#: Points farther off the normal than this, in units of the pair's size, are no answer.
_ASIDE = 2.0**-43
#: Least and greatest tangent of the cone about the direction.
_NARROWEST, _WIDEST = 2.0**-20, 0.25
#: What entries of the form may be off by, of the numbers that they are worked out from: some dozen roundings.
_ROUNDED = 2.0**-46
#: Of lengths of directions that are taken for 1.
_SLACK = 1.0 + 2.0**-16


class CurvedDepth(NamedTuple):
    """lower ≤ depth of the cores ≤ upper [m]; n̂ from A to B; deepest points in W's axes, each from its own origin."""

    is_proven: bool
    lower: float
    upper: float
    nhat: Vec3
    a: Vec3
    b: Vec3


class _Form(NamedTuple):
    """A symmetric form across n: entries along two unit vectors, and what they may be off by."""

    xx: float
    yy: float
    xy: float
    off: float


@kernel
def refine_curved_depth(ordered, work, n_points, named, nhat, surface, n_facets, error):
    """The `CurvedDepth` of cores near n points of the workspace, weighted, and the direction n̂ from A to B.

    named : as of `nearest_features`.   surface : EPA's, of n_facets proven to face outwards, or of 0.
    error : of the surface's corners [m].
    """
    s = nearest_features(ordered, work, n_points, named, nhat, _FLAT, _ACROSS, work.fine_at)
    pair = ordered.pair
    length = dd.sqrt(dd.inner(s.n, s.n))
    v = dd.sub_vec3(s.p.point, dd.add_vec3(s.q.point, s.t))
    value = dd.div(dd.inner(s.n, v), length)
    lower = _ball_within(pair, s, v, length)
    is_direction = s.is_found and value.high > 0.0 and abs(length.high - 1.0) < 2.0**-20
    if is_direction and n_facets > 0 and lower.high < value.high * (1.0 - 2.0**-48):
        n = divide(dd.leading(s.n), length.high)
        tangent = _cone_of_near_facets(surface, n_facets, n, value.high / s.unit + error)
        if tangent <= _WIDEST and _least_eigenvalue(pair, s, n, tangent) >= value.high * _SLACK:
            across = dd.sub_vec3(v, dd.times_vec3(dd.div(value, length), s.n))
            lost = tangent * norm(dd.leading(across)) + _lost_by_leaning(pair, s)
            lower = _greater(lower, dd.sub(value, DD(_SLACK * lost, 0.0)))
    return _bracket(pair, s, v, length, lower, work)


@kernel
def _ball_within(pair, s, v, length):
    """What balls within the bodies prove of the depth: rolling ones of ellipsoids, one about a point of a body."""
    b, a = dd.add_vec3(s.q.point, s.t), dd.sub_vec3(s.p.point, s.t)
    lower = _greater(_depth_of_point(pair, pair.A, b, s.unit), _depth_of_point(pair, pair.B, a, s.unit))
    radius = s.unit * (rolling_radius(pair, pair.A) + rolling_radius(pair, pair.B))
    if radius > 0.0:
        centres = dd.sub_vec3(dd.times_vec3(dd.div(DD(radius, 0.0), length), s.n), v)
        lower = _greater(lower, dd.sub(DD(radius, 0.0), dd.sqrt(dd.inner(centres, centres))))
    return lower


@kernel(inline=True)
def _greater(a, b):
    return b if dd.less(a, b) else a


@kernel
def _bracket(pair, s, v, length, lower, work):
    """The `CurvedDepth` with the value along the direction for its upper bound."""
    excess = dd.add(
        beyond(pair, pair.A, s.p, s.n, s.unit, work), beyond(pair, pair.B, s.q, dd.neg_vec3(s.n), s.unit, work)
    )
    upper = dd.div(dd.add(dd.inner(s.n, v), excess), length)
    error, over = ERROR * s.size, 1.0 / s.unit
    least, greatest = dd.bracket(lower, error), dd.bracket(upper, error)
    off = norm(dd.leading(dd.sub_vec3(v, dd.times_vec3(dd.div(dd.inner(s.n, v), dd.inner(s.n, s.n)), s.n))))
    # Features whose points are no supports, as a base where the tip is meant, bound a depth at points elsewhere.
    is_support = excess.high <= _ASIDE * s.size
    is_good = s.is_found and is_support and 0.5 < length.high < 2.0 and off <= _ASIDE * s.size
    is_proven = is_good and 0.0 < least.lower < math.inf and greatest.upper < math.inf
    return CurvedDepth(
        is_proven, over * least.lower, over * greatest.upper, divide(dd.leading(s.n), length.high),
        scale(over, dd.leading(s.p.point)), scale(over, dd.leading(s.q.point))
    )


# --- a ball within ------------------------------------------------------------------------------


@kernel
def _depth_of_point(pair, body, x, unit):
    """How deep a point, in W's axes from the body's origin, is at least within a cylinder, cone or box; else −∞.

    Measured in the body's frame, at p with R p next to x: what R p misses x by is taken off, and what R shrinks lengths
    by. One step more than Rᵀ x makes the miss of a rotation's roundings a square of them.
    """
    numbers, at, poses, pose_at = pair.numbers, body.params_at, pair.poses, body.pose_at
    is_box = body.kind == POINTS and body.n > 2 and numbers[at] > 0.0
    if not (is_box or body.kind == CYLINDER or body.kind == CONE):
        return DD(-math.inf, 0.0)
    p = turned_back(poses, pose_at, x)
    p = dd.add_vec3(p, turned_back(poses, pose_at, dd.sub_vec3(x, turned(poses, pose_at, p))))
    miss = norm(dd.leading(dd.sub_vec3(x, turned(poses, pose_at, p))))
    if is_box:
        inner = _less(_inset(unit * numbers[at], p.x), _inset(unit * numbers[at + 1], p.y))
        inner = _less(inner, _inset(unit * numbers[at + 2], p.z))
    else:
        aside = dd.sqrt(dd.add(dd.mul(p.x, p.x), dd.mul(p.y, p.y)))
        radius, half = unit * numbers[at], unit * numbers[at + 1]
        if body.kind == CYLINDER:
            inner = _less(_inset(radius, aside), _inset(half, p.z))
        else:
            inner = _less(_inset_of_side(radius, half, aside, p.z), dd.add(DD(half, 0.0), p.z))
    off = 3.0 * off_rotation(poses, pose_at)
    return dd.sub(inner, DD(_SLACK * (off * abs(inner.high) + miss), 0.0))


@kernel(inline=True)
def _inset(half, x):
    """half − |x|."""
    return dd.sub(DD(half, 0.0), x if x.high > 0.0 else dd.neg(x))


@kernel(inline=True)
def _inset_of_side(radius, half, aside, z):
    """How far the side of a cone is from a point within, beside its axis and above its middle."""
    slope, rise = DD(radius, 0.0), DD(2.0 * half, 0.0)
    slant = dd.sqrt(dd.add(dd.mul(slope, slope), dd.mul(rise, rise)))
    return dd.div(dd.sub(dd.mul(slope, dd.sub(DD(half, 0.0), z)), dd.mul(rise, aside)), slant)


@kernel(inline=True)
def _less(a, b):
    return a if dd.less(a, b) else b


# --- a surface and a bend -----------------------------------------------------------------------


@kernel
def _cone_of_near_facets(surface, n_facets, n, reach):
    """Tangent of the cone about n with all directions along which a facet may be no farther than ``reach``, or ∞.

    By a facet's corners, as directions of a cone are convex, or by the cap of a ball beyond its plane, by the smaller:
    corners of slivers are far, planes of small facets have no direction.
    """
    widest = _NARROWEST
    square = reach * reach
    for f in range(n_facets):
        if surface.clearances[f] < reach:
            by_corners = 0.0
            for k in range(3):
                x = point_at(surface.points, corner(surface, f, k))
                by_corners = max(by_corners, _tangent(dot(x, n), norm(sub(x, scale(dot(x, n), n)))))
            normal, height = normal_of(surface, f), surface.planes[PLANE * f + 3]
            by_plane = math.inf
            if 0.0 < height < math.inf:
                aside = math.sqrt(max(square - height * height, 0.0) + 2.0**-48 * square)
                along = dot(normal, n)
                across = norm(sub(normal, scale(along, n)))
                by_plane = _tangent(height * along - aside, height * across + aside)
            widest = max(widest, min(by_corners, by_plane))
    return widest * _SLACK


@kernel(inline=True)
def _tangent(along, across):
    return across / along if along > 0.0 else math.inf


@kernel
def _least_eigenvalue(pair, s, n, tangent):
    """Least eigenvalue λ across n of the forms of both features in a cone, less what rounding may add."""
    e = unit_orthogonal(n)
    g = cross(n, e)
    largest = 16.0 * norm(dd.leading(dd.sub_vec3(s.p.point, dd.add_vec3(s.q.point, s.t))))
    a = _form(pair, pair.A, s.f, s.p, e, g, tangent, s.unit, largest)
    b = _form(pair, pair.B, s.h, s.q, e, g, tangent, s.unit, largest)
    xx, yy, xy = a.xx + b.xx, a.yy + b.yy, a.xy + b.xy
    root = math.sqrt(0.25 * (xx - yy) * (xx - yy) + xy * xy)
    return 0.5 * (xx + yy) - root - (a.off + b.off) - _ROUNDED * (xx + yy)


@kernel
def _form(pair, body, f, placed, e, g, tangent, unit, largest):
    """The `_Form` of a feature.   largest : flat directions need add no more than that."""
    slide = _slide(pair, body, f, unit)
    share = 1.001 * tangent * placed.ratio
    factor = 1.0 / ((1.0 + share) * (1.0 + share) * (1.0 + share))
    if body.kind == CONE and f.kind == SIDE:
        factor *= (1.0 - f.s.high - slide) / (1.0 - f.s.high)
    he = _product(placed, e)
    hg = _product(placed, g)
    bent = _Form(factor * dot(e, he), factor * dot(g, hg), factor * dot(e, hg), _ROUNDED * placed.bend)
    if f.flat > 0:
        bent = _with_flat(bent, dd.leading(placed.d), slide, e, g, tangent, largest)
    if f.flat > 1:
        bent = _with_flat(bent, dd.leading(placed.e), slide, e, g, tangent, largest)
    return bent


@kernel(inline=True)
def _product(h, x):
    """The Hessian times x."""
    return Vec3(
        h.xx * x.x + h.xy * x.y + h.zx * x.z, h.xy * x.x + h.yy * x.y + h.yz * x.z, h.zx * x.x + h.yz * x.y + h.zz * x.z
    )


@kernel(inline=True)
def _with_flat(form, d, slide, e, g, tangent, largest):
    """The form with a flat direction d, along which a point may move by ``slide`` times d both ways."""
    length = norm(d)
    if not length > 0.0:
        return form
    weight = min(2.0 * slide / (_SLACK * tangent * length), largest / (length * length))
    x, y = dot(d, e), dot(d, g)
    off = form.off + _ROUNDED * weight * length * length
    return _Form(form.xx + weight * x * x, form.yy + weight * y * y, form.xy + weight * x * y, off)


@kernel
def _slide(pair, body, f, unit):
    """By how much flat coordinates of a feature may change both ways, at once where there are two."""
    numbers, params = pair.numbers, body.params_at
    s, t = f.s.high, f.t.high
    slide = 0.0
    if f.kind == VERTEX and f.flat > 0:
        slide = min(s, 1.0 - s) if f.flat == 1 else 0.5 * min(min(s, t), 1.0 - s - t)
    elif f.kind == SIDE:
        slide = unit * numbers[params + 1] - abs(s) if body.kind == CYLINDER else 0.125 * min(s, 1.0 - s)
    elif f.kind == END:
        slide = 0.5 * (unit * numbers[params] - math.sqrt(s * s + t * t))
    return max(slide * (1.0 - 2.0**-40), 0.0)


@kernel(inline=True)
def _lost_by_leaning(pair, s):
    """What flat directions that are not across n take off the bound at most."""
    lost = 0.0
    if s.f.flat > 0:
        lost += _slide(pair, pair.A, s.f, s.unit) * (abs(dd.inner(s.n, s.p.d).high) + abs(dd.inner(s.n, s.p.e).high))
    if s.h.flat > 0:
        lost += _slide(pair, pair.B, s.h, s.unit) * (abs(dd.inner(s.n, s.q.d).high) + abs(dd.inner(s.n, s.q.e).high))
    return lost
