"""Rays against the facets of posed meshes and convex polytopes, decided exactly.

Whether a ray meets a facet is decided exactly, on the numbers handed in. The traversal gives distances as proven
brackets; where these overlap, are wide, or reach across the limit, Python integers settle order and value.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.casts.directions import Directions
from collide.casts.ray_ends import NARROW, group_first_facets, put_rays_to_facets, scale_facet_t
from collide.casts.ray_hits import RayEvents
from collide.kernels import address_of
from collide.lowering.facet_bodies import Body
from collide.narrowphase.facets import ray_surface as layout
from collide.narrowphase.facets.facet_geometry import exact_point, facet_normals
from collide.narrowphase.facets.facet_queries import facets_on_rays
from collide.numerics.exact_points import enters, integers, on_one_grid, placed, rounded


def facets_met(
    body: Body, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, every: bool
) -> RayEvents:
    """Facets met by n rays, ray by ray and in order along each; the first only, or all.

    X_WA : (n, 4, 4) or (1, 4, 4).   origins : (n, 3).   limit : of t, in lengths of the directions given.
    """
    rays = _rays(body, X_WA, origins, directions, limit)
    hits, _ = facets_on_rays(body.tree, X_WA if len(X_WA) != 1 else X_WA[0], rays, not every)
    met = _MetFacets(body, X_WA, rays, np.ascontiguousarray(directions.exponents), hits, limit)
    met.settle(every)
    return met.events()


def _rays(body: Body, X_WA, origins, directions: Directions, limit: float) -> np.ndarray:
    """(n, RAY) rays as kernels take them."""
    rays, X_WA = np.empty((len(origins), layout.RAY)), np.ascontiguousarray(X_WA)
    origins, vectors = np.ascontiguousarray(origins), np.ascontiguousarray(directions.vectors)
    limits, centre, step = directions.limits(limit), np.ascontiguousarray(body.centre), 16 if len(X_WA) > 1 else 0
    put_rays_to_facets(
        address_of(X_WA), step, address_of(centre), body.reach, address_of(origins), address_of(vectors),
        address_of(limits), len(rays), address_of(rays),
    )
    return rays


# --- order and values ---------------------------------------------------------------------------


class _MetFacets:
    """Facets met by rays, with brackets of t, and exact t where needed.

    groups : of `group_first_facets`.   corners : (m, 3, 3) of the hit facets.
    t : (m, 3) distance, lower, upper of each, in units of the direction's length.   order : of the rows, ray by ray,
    from `settle`.   keep : (m,) bool, rows that are answers.
    """

    def __init__(self, body: Body, X_WA, rays, exponents, hits: np.ndarray, limit: float):
        self.body, self.X_WA, self.rays, self.exponents, self.limit = body, X_WA, rays, exponents, limit
        self.ray, self.facet = (hits[:, k].astype(np.int64) for k in (layout.RAY_OF, layout.FACET_OF))
        marks, self.t = np.empty(len(hits), dtype=np.uint8), np.empty((len(hits), 3))
        groups, at = np.empty((len(hits), 5), dtype=np.int64), (address_of(hits), len(hits), address_of(rays))
        self.groups = groups[: group_first_facets(*at, address_of(marks), address_of(groups))]
        self.narrow = marks == NARROW
        scale_facet_t(*at, address_of(exponents), address_of(self.t))
        self.keep = np.ones(len(hits), dtype=bool)
        self.corners = body.tree.triangles[hits[:, layout.PLACE].astype(np.int64)].reshape(-1, 3, 3)

    def settle(self, every: bool) -> None:
        """Put the hits of each ray in order, exactly, and drop hits beyond the limit; keep the first only, or all.
        """
        if not every and (self.groups[:, 1:3] == (1, NARROW)).all():  # each ray's first hit ends before others begin
            self.order = self.groups[:, 0]
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
            corners = placed(X, self.corners[row])
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
        normals = facet_normals(X, self.corners[rows])
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
