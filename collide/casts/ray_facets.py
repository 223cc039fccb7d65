"""Rays against the facets of posed meshes and convex polytopes, decided exactly.

Whether a ray meets a facet is decided exactly, on the numbers handed in. The traversal gives distances as proven
brackets; where these overlap, are wide, or reach across the limit, Python integers settle order and value.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.casts.directions import Directions
from collide.casts.ray_hits import RayEvents
from collide.lowering.facet_bodies import Body
from collide.narrowphase.facets import ray_surface as layout
from collide.narrowphase.facets.facet_geometry import FacetCorners, exact_point, facet_normals
from collide.narrowphase.facets.facet_queries import facets_on_rays
from collide.numerics.exact_points import enters, integers, on_one_grid, placed, rounded

#: Brackets wider than this, in units of the length of the ray up to beyond the body, are worked out exactly.
_MAX_WIDTH = 2.0**-40
#: Limits below this, in the same units, may have lost digits: facets within them are worked out exactly.
_MIN_LIMIT = 1e-290


def facets_met(
    body: Body, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Facets met by n rays, ray by ray and in order along each; the first only, or all.

    X_WA : (n, 4, 4) or (1, 4, 4).   origins : (n, 3).   limit : of t, in lengths of the directions given.
    """
    rays = _rays(body, X_WA, origins, directions, limit)
    hits, _ = facets_on_rays(body.tree, X_WA if len(X_WA) != 1 else X_WA[0], rays, not every)
    met = _MetFacets(body, X_WA, rays, directions.exponents, hits, limit)
    met.settle(every)
    return met.events()


def _rays(body: Body, X_WA, origins, directions: Directions, limit: float) -> np.ndarray:
    """(n, RAY) rays as kernels take them."""
    rays = np.empty((len(origins), layout.RAY))
    rays[:, :3], rays[:, 3:6] = origins, directions.vectors
    # Beyond the ball around the body, wherever the ray begins.
    centre = X_WA[:, :3, 3] + (X_WA[:, :3, :3] * body.centre).sum(axis=2)
    stretch = np.abs(X_WA[:, :3, :3]).sum(axis=(1, 2))
    away = np.abs(rays[:, :3] - centre).sum(axis=1) + stretch * body.reach + 1e-100
    rays[:, 6] = np.ldexp(1.0, np.frexp(away)[1] + 2)
    rays[:, 7] = np.maximum(directions.limits(limit) / rays[:, 6], _MIN_LIMIT)
    return rays


# --- order and values ---------------------------------------------------------------------------


class _MetFacets:
    """Facets met by rays, with brackets of t, and exact t where needed.

    t : (m, 3) distance, lower, upper of each, in units of the direction's length.   order : of the rows, ray by ray,
    from `settle`.   keep : (m,) bool, rows that are answers.
    """

    def __init__(self, body: Body, X_WA, rays, exponents, hits: np.ndarray, limit: float):
        self.body, self.X_WA, self.rays, self.exponents, self.limit = body, X_WA, rays, exponents, limit
        self.ray, self.facet = (hits[:, k].astype(np.int64) for k in (layout.RAY_OF, layout.FACET_OF))
        self.narrow = (hits[:, layout.OPEN] == 0.0) & (hits[:, layout.UPPER] - hits[:, layout.LOWER] <= _MAX_WIDTH)
        self.narrow &= (hits[:, layout.UPPER] <= rays[self.ray, 7]) & (rays[self.ray, 7] > _MIN_LIMIT)
        unit = rays[self.ray, 6:7]
        self.t = np.ldexp(hits[:, [layout.VALUE, layout.LOWER, layout.UPPER]] * unit, -exponents[self.ray, None])
        self.keep = np.ones(len(hits), dtype=bool)
        self.corners = FacetCorners(body.tree)

    def settle(self, every: bool) -> None:
        """Put the hits of each ray in order, exactly, and drop hits beyond the limit; keep the first only, or all.
        """
        if not every and self.narrow.all() and (self.ray[1:] > self.ray[:-1]).all():
            self.order = np.arange(len(self.ray))
            return
        order = np.lexsort((self.facet, self.t[:, 1], self.ray))
        ray, lower = self.ray[order], self.t[order, 1]
        # Brackets of one ray that overlap: what came before may reach as far as the largest end among them. Exact are
        # those, and wide ones, alone: the first hit has the same digits whether or not the others are looked for.
        ends = _running_ends(ray, self.t[order, 2])
        begins = np.append(True, (ray[1:] != ray[:-1]) | (lower[1:] > ends[:-1]))[: len(ray)]
        starts = np.append(np.flatnonzero(begins), len(ray))
        is_open = (np.diff(starts) > 1) | np.logical_or.reduceat(np.append(~self.narrow[order], False), starts)[:-1]
        self.order = order
        for k in np.flatnonzero(is_open).tolist():
            begin, end = starts[k : k + 2].tolist()
            order[begin:end] = self._in_order(order[begin:end])
        if not every:
            remaining = order[self.keep[order]]
            is_later = np.diff(self.ray[remaining], prepend=-1) == 0
            self.keep[remaining[is_later]] = False

    def _in_order(self, rows: np.ndarray) -> list[int]:
        """Hits of a ray by their exact t, then by facet; hits beyond the limit are dropped."""
        k = int(self.ray[rows[0]])
        X = self.X_WA[k if len(self.X_WA) > 1 else 0]
        direction, direction_at = integers(self.rays[k, 3:6])
        exponent = int(self.exponents[k])
        values = {}
        for row in rows.tolist():
            corners = placed(X, self.corners[self.facet[row]])
            ((origin,), triangle), grid = on_one_grid(exact_point(self.rays[k, :3]), corners)
            t = enters(triangle, origin, (direction[0], direction[1], direction[2]))
            values[row] = t * Fraction(2) ** (grid - direction_at - exponent)
            self.t[row] = rounded(values[row])
            self.keep[row] = values[row] <= self.limit
        return sorted(rows.tolist(), key=lambda row: (values[row], int(self.facet[row])))

    def events(self) -> RayEvents:
        """The hits that are kept, in order."""
        rows = self.order[self.keep[self.order]]
        ray, facet = self.ray[rows], self.facet[rows]
        X = self.X_WA[ray] if len(self.X_WA) > 1 else self.X_WA
        proven = np.ones(len(rows), dtype=bool)
        normals = facet_normals(X, self.corners[facet])
        return RayEvents(ray, self.t[rows], normals, facet, np.zeros(len(rows), dtype=np.int64), proven, proven.copy())


def _running_ends(ray: np.ndarray, upper: np.ndarray) -> np.ndarray:
    """The largest end so far among the hits of the same ray."""
    ends = upper.copy()
    step = 1
    while step < len(ends):  # doubling: every entry sees twice as many before it
        same = ray[step:] == ray[:-step]
        if not same.any():
            break
        ends[step:] = np.where(same, np.maximum(ends[step:], ends[:-step].copy()), ends[step:])
        step *= 2
    return ends
