"""The polar of a hull about an inner point, in doubles proven to lie inside the true polar.

A facet with normal n through a has the polar point n / (n·(a − o)), a quotient of polynomials of degree 2 and 3. Its
rounding to doubles could lie outside the polar Q of R − o, and the hull of such points would be the
polar of a body smaller than R. Here each point is drawn towards 0 by the bound of its rounding, about 2⁻⁵¹ of its
length (the bound is at `_polar_points`). So Q' ⊆ Q exactly, and R' = o + ρ0(Q') ⊇ R exactly (Lemma 3.6). Nearly
coplanar facets share a polar point (`merged_facets`), and corners of flat sides are drawn a little more
(`polar_domes`): of a round body, R' is larger by a part of 2⁻⁴³ at most.

Barba and Langerman work with real numbers, without rounding. A plane between P and R'
separates P from R. A point of P and R' has yet to be tested against R, in `walk_proof`.
"""

from __future__ import annotations

from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull, convex_hull
from collide.kernels import address_of, entry, kernel, view_f64, view_i32
from collide.numerics import double_double as dd
from collide.numerics.error_free import DD, two_sum
from collide.numerics.exact_vectors import cross, inner, minus
from collide.papers.hierarchies.hierarchy import DEGREE_BOUND, Hierarchy, build_hierarchy
from collide.papers.hierarchies.merged_facets import merged_facets
from collide.papers.hierarchies.polar_domes import dome_drops
from collide.papers.hierarchies.symbolic_perturbation import exact_side
from collide.papers.hierarchies.true_facets import Cloud, cloud_at, named_in, true_facets

#: How far a polar point may be drawn inside, as a part of it. A hull 10¹¹ times as wide as thick may need more.
_MAX_DRAWN = 2.0**-10
#: Sizes of a body (largest distance from the origin along an axis) whose polar has ordinary doubles.
SMALLEST, LARGEST = 1e-60, 1e60


class PolarBody(NamedTuple):
    """Q' = conv(points) inside Q = ρ0(R − origin).

    origin : (3,) float64, strictly inside R; exact.
    points : (m, 3) float64, 1/length; (v − origin)·q < 1 for every v of R, exactly. A point for every true facet of R,
        or for several facets coplanar in doubles: see `merged_facets`.
    spans : (m, 3) int32, three vertices of R, counter-clockwise from outside, in the plane of the point's facet.
    hierarchy : of Q'; its vertices below m are rows of ``points``.
    groups : (facets,) int64, for each true facet of R its row of ``points``.
    """

    origin: np.ndarray
    points: np.ndarray
    spans: np.ndarray
    hierarchy: Hierarchy
    groups: np.ndarray


def polar_of_hull(
    points: np.ndarray, hull: Hull, degree_bound: int = DEGREE_BOUND, origin: np.ndarray | None = None
) -> PolarBody:
    """The polar of the hull of points (n, 3) about ``origin``, or about a point well inside, with its hierarchy.

    Near-linear where `build_hierarchy` is. Raises ValueError for a hull without interior, for a needle or a pancake
    with no double inside, or too thin for the rounding; for an origin not strictly inside, and for sizes outside 1e-60
    to 1e60.
    """
    if hull.dimension != 3:
        raise ValueError(f"the polar of a hull of dimension {hull.dimension} is not bounded; it has no interior")
    cloud = Cloud(points)
    spans = true_facets(cloud, hull).spans
    centre = interior_point(cloud, spans) if origin is None else np.asarray(origin, dtype=np.float64)
    if origin is not None and not strictly_inside(cloud, spans, centre):
        raise ValueError(f"the origin {centre.tolist()} does not lie strictly inside the hull")
    extent = np.nextafter(np.abs(cloud.originals[hull.vertices] - centre).max(axis=0), np.inf)
    if not SMALLEST <= extent.max() <= LARGEST:
        raise ValueError(f"a body of size {extent.max():g} has no polar in ordinary doubles; scale it to about 1")
    polar = _polar_points(cloud, spans, centre, extent)
    weight = np.abs(polar) @ extent
    facets = np.ascontiguousarray(hull.facets, dtype=np.int32)
    keep, groups, patch = merged_facets(cloud, facets, centre, polar, weight)
    polar, spans, weight = polar[keep], np.ascontiguousarray(spans[keep]), weight[keep]
    drops = dome_drops(cloud.originals[: cloud.count], facets, groups[patch], centre, polar, weight)
    # Two more roundings, which a step of a dome exceeds.
    polar = np.ascontiguousarray(polar * (1.0 - drops)[:, None])
    return PolarBody(centre, polar, spans, build_hierarchy(polar, convex_hull(polar), degree_bound), groups)


def interior_point(cloud: Cloud, spans: np.ndarray) -> np.ndarray:
    """The candidate middle of the hull farthest from its facets, in doubles; strictly inside, exactly.

    Raises ValueError if no candidate is strictly inside.
    """
    used = cloud.originals[named_in(spans, cloud.count)]
    corners = cloud.originals[spans]
    middles = [
        0.5 * used.min(axis=0) + 0.5 * used.max(axis=0), (used / len(used)).sum(axis=0),
        (corners.sum(axis=1) / 3.0 / len(corners)).sum(axis=0), *_mid_simplices(used),
    ]
    order = np.argsort([-_clearance(corners, middle) for middle in middles], kind="stable")
    for k in order.tolist():
        if strictly_inside(cloud, spans, middles[k]):
            return middles[k] + 0.0
    raise ValueError("no double was found strictly inside the hull: it is thinner than the rounding of its points")


def _mid_simplices(used: np.ndarray) -> list[np.ndarray]:
    """The middle of a few of the extreme points, for hulls most of whose points are crowded together."""
    extremes = np.concatenate([used[used.argmin(axis=0)], used[used.argmax(axis=0)]])
    return [extremes.mean(axis=0), used[:: max(1, len(used) // 7)].mean(axis=0)]


def _clearance(corners: np.ndarray, middle: np.ndarray) -> float:
    """Distance from the nearest plane of three corners, relative to the size of the hull; in doubles."""
    size = np.abs(corners - middle).max()
    a, b, c = (corners - middle).transpose(1, 0, 2) / size
    normal = np.cross(b - a, c - a)
    length = np.sqrt(np.square(normal).sum(axis=1))
    return float(((a * normal).sum(axis=1) / np.maximum(length, 1e-300)).min())


def strictly_inside(cloud: Cloud, spans: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point lies strictly below all facets; exact."""
    row = cloud.add(point)
    return not touches_or_sees(*cloud.addresses, address_of(spans), len(spans), row)


def _polar_points(cloud: Cloud, spans: np.ndarray, origin: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """(m, 3) polar points, drawn inside.

    Let q* be the true point, |v_k − o_k| ≤ V_k for all vertices, and W = Σ V_k |q_k| ≥ 1. What is stored is
    q_k = q*_k (1 − d) up to 2.5·2⁻⁵³ |q_k| for three roundings, and up to 2⁻⁵⁶ max|q| for the pairs of doubles
    (else it is taken from fractions). So (v − o)·q ≤ 1 − d + 1.25·2⁻⁵² W + 2⁻⁵⁶ max|q| ΣV, below 1 for
    d = 2⁻⁵¹ W + 2⁻⁵⁵ max|q| ΣV or more. With W at most 2⁴¹, d is small enough for this to hold to first order.
    """
    triples = np.ascontiguousarray(spans, dtype=np.int32)
    polar = np.empty((len(triples), 3))
    proven = np.empty(len(triples), dtype=np.int32)
    centre, reach = np.ascontiguousarray(origin), np.ascontiguousarray(extent)
    write_polar(
        address_of(cloud.originals), len(cloud.originals), address_of(triples), len(triples), address_of(centre),
        address_of(reach), address_of(polar), address_of(proven),
    )
    for k in np.flatnonzero(proven == 0).tolist():
        polar[k] = _from_fractions(cloud.originals[triples[k]], centre, reach)
    if not np.isfinite(polar).all():
        raise ValueError("the hull is so thin, and so oblique, that its polar cannot be rounded into itself")
    return polar


def _from_fractions(corners: np.ndarray, origin: np.ndarray, extent: np.ndarray) -> np.ndarray:
    """One polar point, exactly, then drawn inside."""
    a, b, c = ([Fraction(x) - Fraction(o) for x, o in zip(row, origin.tolist())] for row in corners.tolist())
    n = cross(minus(b, a), minus(c, a))
    d = inner(n, a)
    q = [x / d for x in n]
    drawn = Fraction(2) ** -50 * sum(Fraction(s) * abs(x) for s, x in zip(extent.tolist(), q))
    if drawn > _MAX_DRAWN or max(map(abs, q)) > 2**1000:
        return np.full(3, np.nan)
    return np.array([float(x * (1 - drawn)) for x in q])


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64)")
def touches_or_sees(scaled_at, originals_at, rows, work_at, digits_at, spans_at, count, row):
    """1 where a point is on the plane of some facet or above it."""
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, 0, 0)
    spans = view_i32(spans_at, 3 * count)
    for k in range(count):
        a, b, c = np.int64(spans[3 * k]), np.int64(spans[3 * k + 1]), np.int64(spans[3 * k + 2])
        if exact_side(cloud, a, b, c, row) >= 0:
            return 1
    return 0


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def write_polar(points_at, rows, spans_at, count, origin_at, extent_at, polar_at, proven_at):
    """Polar points in pairs of doubles, drawn inside; ``proven`` is 0 where pairs do not suffice."""
    points = view_f64(points_at, 3 * rows)
    spans = view_i32(spans_at, 3 * count)
    origin = view_f64(origin_at, 3)
    extent = view_f64(extent_at, 3)
    polar = view_f64(polar_at, 3 * count)
    proven = view_i32(proven_at, count)
    for k in range(count):
        a, b, c = 3 * np.int64(spans[3 * k]), 3 * np.int64(spans[3 * k + 1]), 3 * np.int64(spans[3 * k + 2])
        x, x_low, x_size = normal_part(points, a, b, c, 1, 2)
        y, y_low, y_size = normal_part(points, a, b, c, 2, 0)
        z, z_low, z_size = normal_part(points, a, b, c, 0, 1)
        d, d_low, d_size = 0.0, 0.0, 0.0
        for axis in range(3):
            n, n_low, n_size = (
                (x, x_low, x_size) if axis == 0 else ((y, y_low, y_size) if axis == 1 else (z, z_low, z_size))
            )
            w, w_low = two_sum(points[a + axis], -origin[axis])
            d, d_low = dd.sloppy_add(DD(d, d_low), dd.unnormalized_mul(DD(n, n_low), DD(w, w_low)))
            d_size += n_size * abs(w)
        largest = max(abs(x), abs(y), abs(z))
        # Pairs: an error of 2⁻⁹⁶ times the terms' magnitudes is far more than theirs (see `orientation`).
        sizes = x_size + y_size + z_size
        reach = extent[0] + extent[1] + extent[2]
        proven[k] = 0
        if d > 0.0 and d_size * 2.0**-36 < d and sizes * 2.0**-36 < largest and d > 1e-250:
            qx, qy, qz = quotient(x, x_low, d, d_low), quotient(y, y_low, d, d_low), quotient(z, z_low, d, d_low)
            within = extent[0] * abs(qx) + extent[1] * abs(qy) + extent[2] * abs(qz)
            drawn = 2.0**-51 * within + 2.0**-55 * (largest / d) * reach
            polar[3 * k] = qx * (1.0 - drawn)
            polar[3 * k + 1] = qy * (1.0 - drawn)
            polar[3 * k + 2] = qz * (1.0 - drawn)
            proven[k] = 1 if drawn <= _MAX_DRAWN else 0


@kernel
def normal_part(points, a, b, c, i, j):
    """One component of (b − a) × (c − a) as a pair of doubles, and its terms' magnitude."""
    ui, ui_low = two_sum(points[b + i], -points[a + i])
    uj, uj_low = two_sum(points[b + j], -points[a + j])
    vi, vi_low = two_sum(points[c + i], -points[a + i])
    vj, vj_low = two_sum(points[c + j], -points[a + j])
    p = dd.unnormalized_mul(DD(ui, ui_low), DD(vj, vj_low))
    q = dd.unnormalized_mul(DD(uj, uj_low), DD(vi, vi_low))
    high, low = dd.sloppy_add(p, dd.neg(q))
    return high, low, abs(p.high) + abs(q.high)


@kernel
def quotient(n, n_low, d, d_low):
    """n / d for pairs of doubles, rounded, to 2⁻⁵³ and a little."""
    q = n / d
    product = dd.unnormalized_mul(DD(q, 0.0), DD(d, d_low))
    remainder = dd.sloppy_add(DD(n, n_low), dd.neg(product))
    return q + remainder.high / d
