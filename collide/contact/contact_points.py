"""Points at which two sets of facets come nearest along a direction: corners over facets, and edges that cross.

Seen along the unit vector n, the gap between two facets is linear over the polygon in which they overlap, so its
least and largest values stand at the corners of that polygon: corners of one over the other, and crossings of edges.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.contact.contact_facets import Pairs, facing

#: A facet is looked at along n where its normal's cosine with it is above this.
LEAST_COSINE = 2.0**-10
#: Barycentric coordinates and edge parameters may be as far outside as rounding moves them, in so many errors of a
#: coordinate: no corner may be lost. Never farther than this share.
_ERRORS_OUTSIDE, _FARTHEST_OUTSIDE = 16.0, 2.0**-10
#: Edges whose sine, seen along n, is below this are parallel: their ends tell. Edges and heights of facets that are
#: shorter, seen so, than so many errors of a coordinate are none.
_PARALLEL, _MIN_ERRORS = 2.0**-30, 256.0


class Points(NamedTuple):
    """k points: the pair each is of, the points of A's facet and of B's, gap along n and a bound of its error."""

    pair: np.ndarray
    a: np.ndarray
    b: np.ndarray
    gap: np.ndarray
    error: np.ndarray

    def take(self, which) -> Points:
        return Points(*(array[which] for array in self))


def across(n: np.ndarray) -> np.ndarray:
    """(2, 3) unit vectors that make a right-handed frame with the unit vector n."""
    x, y, z = n.tolist()
    least = min(abs(x), abs(y), abs(z))
    u = (0.0, z, -y) if abs(x) == least else (-z, 0.0, x) if abs(y) == least else (y, -x, 0.0)
    length = math.sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
    p, q, r = u[0] / length, u[1] / length, u[2] / length
    return np.array([(p, q, r), (y * r - z * q, z * p - x * r, x * q - y * p)])


def points_along(pairs: Pairs, n: np.ndarray, solid_a: bool, solid_b: bool, error: float) -> Points:
    """All corners of the overlaps of k pairs of facets seen along n; facets that look the other way have none."""
    frame = np.concatenate([across(n), n[None]])
    a, b = ((frame[None, None] * side.corners[:, :, None]).sum(axis=3) for side in (pairs.a, pairs.b))
    toward_b, toward_a = facing(pairs.a.normals, n, solid_a), facing(pairs.b.normals, -n, solid_b)
    may = (toward_b >= -LEAST_COSINE) & (toward_a >= -LEAST_COSINE)
    parts = [
        _corners_over(pairs, a, b, np.flatnonzero(may & (toward_b > LEAST_COSINE)), n, error, False),
        _corners_over(pairs, b, a, np.flatnonzero(may & (toward_a > LEAST_COSINE)), n, error, True),
        _crossings(pairs, a, b, np.flatnonzero(may & ((toward_b > LEAST_COSINE) | (toward_a > LEAST_COSINE))), error),
    ]
    return Points(*(np.concatenate(columns) for columns in zip(*parts)))


def _corners_over(pairs: Pairs, face, opposite, which, n, error: float, exchanged: bool) -> Points:
    """Corners of one side over the facets of the other, in coordinates seen along n."""
    T, corners = face[which], opposite[which]
    edges = T[:, [1, 2, 0], :2] - T[:, :, :2]
    area = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    lengths = np.hypot(edges[..., 0], edges[..., 1])
    longest = lengths.max(axis=1, initial=0.0)
    well_conditioned = np.abs(area) > _MIN_ERRORS * error * longest
    safe = np.where(well_conditioned, area, 1.0)
    # Weight of corner k: what the edge opposite to it spans with the point, over the whole.
    away = corners[:, :, None, :2] - T[:, None, :, :2]  # (pair, point, corner)
    spans = edges[:, None, :, 0] * away[..., 1] - edges[:, None, :, 1] * away[..., 0]
    weights = spans[:, :, [1, 2, 0]] / safe[:, None, None]
    # Off an edge by an error, whatever the shape of the facet: no more of a needle's length than of its width.
    outside = np.minimum(_ERRORS_OUTSIDE * error * lengths[:, [1, 2, 0]] / np.abs(safe)[:, None], _FARTHEST_OUTSIDE)
    inside = (weights >= -outside[:, None]).all(axis=2) & well_conditioned[:, None]
    height = (weights * T[:, None, :, 2]).sum(axis=2)
    gap = (height - corners[:, :, 2]) if exchanged else (corners[:, :, 2] - height)
    spread = T[:, :, 2].max(axis=1, initial=-np.inf) - T[:, :, 2].min(axis=1, initial=np.inf)
    bound = 32.0 * error + 64.0 * error * longest * spread / np.abs(safe)
    row, corner = np.nonzero(inside)
    gap = gap[row, corner]
    at_corner = (pairs.a if exchanged else pairs.b).corners[which][row, corner]
    if exchanged:
        return Points(which[row], at_corner, at_corner + gap[:, None] * n, gap, bound[row])
    return Points(which[row], at_corner - gap[:, None] * n, at_corner, gap, bound[row])


def _crossings(pairs: Pairs, a, b, which, error: float) -> Points:
    """Where edges of A's facets cross edges of B's, seen along n."""
    start_p, start_q = a[which][:, :, None], b[which][:, None, :]
    e = a[which][:, [1, 2, 0], None] - start_p
    f = b[which][:, None, [1, 2, 0]] - start_q
    w = start_q - start_p
    span = e[..., 0] * f[..., 1] - e[..., 1] * f[..., 0]
    long_e, long_f = np.hypot(e[..., 0], e[..., 1]), np.hypot(f[..., 0], f[..., 1])
    well_conditioned = np.abs(span) > _PARALLEL * long_e * long_f + _MIN_ERRORS * error * (long_e + long_f)
    safe = np.where(well_conditioned, span, 1.0)
    s = (w[..., 0] * f[..., 1] - w[..., 1] * f[..., 0]) / safe
    t = (w[..., 0] * e[..., 1] - w[..., 1] * e[..., 0]) / safe
    # Beyond the end of either edge by an error, across the other: no more of a long edge than of a short one.
    outside_e, outside_f = (
        np.minimum(_ERRORS_OUTSIDE * error * length / np.abs(safe), _FARTHEST_OUTSIDE) for length in (long_f, long_e)
    )
    hit = well_conditioned & (s >= -outside_e) & (s <= 1 + outside_e) & (t >= -outside_f) & (t <= 1 + outside_f)
    row, i, j = np.nonzero(hit)
    s, t = s[hit], t[hit]
    gap = w[..., 2][hit] + t * f[row, 0, j, 2] - s * e[row, i, 0, 2]
    slack = 64.0 * error * (long_e[row, i, 0] + long_f[row, 0, j]) / np.abs(span[hit])
    bound = 32.0 * error + slack * (np.abs(e[row, i, 0, 2]) + np.abs(f[row, 0, j, 2]))
    start_a, start_b = pairs.a.corners[which][row, i], pairs.b.corners[which][row, j]
    end_a, end_b = pairs.a.corners[which][row, (i + 1) % 3], pairs.b.corners[which][row, (j + 1) % 3]
    at_a = start_a + s[:, None] * (end_a - start_a)
    at_b = start_b + t[:, None] * (end_b - start_b)
    return Points(which[row], at_a, at_b, gap, bound)
