"""Rays against the facets of posed meshes and convex polytopes: `raycast`.

Whether a ray meets a facet is decided exactly, on the numbers handed in. The traversal gives distances as proven
brackets; where these overlap, are wide, or reach across the limit, Python integers settle order and value.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide import argument_checks as checks
from collide.lowering.facet_bodies import Body, facet_body
from collide.narrowphase.facets import ray_surface as layout
from collide.narrowphase.facets.facet_queries import facets_on_rays
from collide.numerics.exact_points import enters, integers, on_one_grid, placed, rounded
from collide.shapes.shape import Shape
from collide.surface_queries.checked_arguments import matched_count, refuse_rows, vectors
from collide.surface_queries.facet_geometry import FacetCorners, exact_point, facet_normals
from collide.transforms import LARGEST, poses_as_given

#: Brackets wider than this, in units of the length of the ray up to beyond the body, are worked out exactly.
_MAX_WIDTH = 2.0**-40
#: The largest component of a direction stays within these; its others are 0 or at least this part of the largest.
_DIRECTIONS = (1e-100, 1e100)
_MIN_RATIO = 2.0**-500
#: Limits below this, in the same units, may have lost digits: facets within them are worked out exactly.
_MIN_LIMIT = 1e-290


class RayHits(NamedTuple):
    """Where rays first meet a body, or, with ``all_hits``, every facet they meet.

    hit : (N,) bool, decided exactly.
    distance : t of the point origin + t · direction: lengths in units of the direction's, metres for unit directions.
        ``inf`` where nothing is met.
    lower, upper : lower ≤ truth ≤ upper is proven; no wider apart than 2⁻³⁶ of t of the body's far side.
    point : in W [m], origin + distance · direction, rounded; zeros where nothing is met.
    normal : outward unit normal of the facet in W: that from which its corners run counter-clockwise. Zeros for a facet
        without area, and where nothing is met.
    facet : number of the facet; −1 where nothing is met. Of several met at the same point the least.
    starts : (N + 1,) with ``all_hits``, where the facets of each ray begin and end: then the fields above, but for
        ``hit``, have a row for every facet met, by distance, then number. None otherwise.

    Single rays at single poses give scalars and (3,), unless ``all_hits``.
    """

    hit: np.ndarray
    distance: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    facet: np.ndarray
    starts: np.ndarray | None = None


def raycast(
    shape: Shape,
    X_WA,
    origins_W,
    directions_W,
    *,
    max_distance: float = math.inf,
    all_hits: bool = False,
    check_poses: bool = True,
) -> RayHits:
    """Where rays first meet the surface of a mesh or a convex polytope.

    Parameters
    ----------
    shape : a `Mesh`, solid or surface; or a `Box`, `ConvexHull` without a radius or bounded `HPolytope`, by the
        triangles of its hull.
    X_WA : (4, 4) pose of the shape in the world W [m], or (N, 4, 4), one a ray.
    origins_W : (3,) or (N, 3) where rays begin, in W [m], within 1e50.
    directions_W : (3,) or (N, 3) in W; they need not be unit vectors. A single pose, origin or direction goes with
        every one of the others.
    max_distance : [lengths of the direction], ≥ 0: t up to which facets count.
    all_hits : report every facet that a ray meets, not only the first.
    check_poses : refuse matrices that are no rotation.

    Returns
    -------
    RayHits. Facets are closed sets: a ray through a common edge or corner meets all facets there, one that begins on a
    facet meets it at 0, one that runs in a facet's plane meets it where it enters it. From inside a solid a ray meets
    the wall on its way out; `contains` says what is inside. The same bits one by one or in batches.

    Raises
    ------
    InvalidArgument : numbers that are not finite, directions of length 0 or with components that differ by more than
        2^500, lengths of batches that do not match.
    InvalidPose : matrices that are no pose.
    UnsupportedQuery : shapes without facets, by name.

    Notes
    -----
    1.5 to 2.5 µs a ray through meshes of 2,000 to 200,000 facets, in batches; about O(log n) for well-shaped ones. Rays
    that doubles leave open (through edges, along facets) take some 0.1 ms a facet.
    """
    body = facet_body(shape, "raycast")
    limit = checks.limit("raycast: max_distance", max_distance, "")
    X_WA, rays, exponents, single = _checked_rays(body, X_WA, origins_W, directions_W, limit, check_poses)
    n = len(rays)
    hits, _ = facets_on_rays(body.tree, X_WA if len(X_WA) != 1 else X_WA[0], rays, not all_hits)
    met = _MetFacets(body, X_WA, rays, exponents, hits, limit)
    met.settle(all_hits)
    ray, facet, t = met.answers()
    if all_hits:
        starts = np.concatenate([[0], np.cumsum(np.bincount(ray, minlength=n))])
        return _as_hits(met, ray, facet, t, np.diff(starts) > 0, starts)
    rows = _as_hits(met, ray, facet, t, np.ones(len(ray), dtype=bool), None)
    full = _nothing(n)
    for into, values in zip(full[:7], rows[:7]):
        into[ray] = values
    return RayHits._make([*(values[0] for values in full[:7]), None]) if single else full


def _nothing(n: int) -> RayHits:
    """Of rays that meet no facet."""
    hit, (t, lower, upper), facet = np.zeros(n, dtype=bool), np.full((3, n), np.inf), np.full(n, -1, dtype=np.int64)
    return RayHits(hit, t, lower, upper, np.zeros((n, 3)), np.zeros((n, 3)), facet)


# --- the question -------------------------------------------------------------------------------


def _checked_rays(body: Body, X_WA, origins_W, directions_W, limit: float, check: bool):
    """(poses, rays (n, RAY) as kernels take them, exponents of the directions' lengths, whether single)."""
    X_WA, single_pose = poses_as_given(X_WA, "X_WA", check=check)
    origins, single_origin = vectors("raycast", "origins_W", origins_W)
    directions, single_direction = vectors("raycast", "directions_W", directions_W)
    refuse_rows("raycast", "origins_W", origins, np.abs(origins).max(axis=1) > LARGEST, f"exceeds {LARGEST:g}")
    sizes = np.abs(directions).max(axis=1)
    refuse_rows("raycast", "directions_W", directions, sizes == 0.0, "has length 0: a ray needs a direction")
    low, high = _DIRECTIONS
    complaint = f"has no component within [{low:g}, {high:g}]"
    refuse_rows("raycast", "directions_W", directions, (sizes < low) | (sizes > high), complaint)
    n = matched_count("raycast", X_WA=len(X_WA), origins_W=len(origins), directions_W=len(directions))
    exponents = np.frexp(sizes)[1].astype(np.int64)
    directions = np.ldexp(directions, -exponents[:, None])
    thin = (directions != 0.0) & (np.abs(directions) < _MIN_RATIO)
    complaint = "has components that differ by more than 2^500; make them 0"
    refuse_rows("raycast", "directions_W", directions, thin.any(axis=1), complaint)
    rays = np.empty((n, layout.RAY))
    rays[:, :3], rays[:, 3:6] = origins, directions
    # Beyond the ball around the body, wherever the ray begins.
    centre = X_WA[:, :3, 3] + (X_WA[:, :3, :3] * body.centre).sum(axis=2)
    stretch = np.abs(X_WA[:, :3, :3]).sum(axis=(1, 2))
    away = np.abs(rays[:, :3] - centre).sum(axis=1) + stretch * body.reach + 1e-100
    rays[:, 6] = np.ldexp(1.0, np.frexp(away)[1] + 2)
    exponents = np.ascontiguousarray(np.broadcast_to(exponents, (n,)))
    with np.errstate(over="ignore"):
        rays[:, 7] = np.maximum(np.ldexp(limit, exponents) / rays[:, 6], _MIN_LIMIT)
    return X_WA, rays, exponents, single_pose and single_origin and single_direction


# --- order and values ---------------------------------------------------------------------------


class _MetFacets:
    """Facets that rays meet, brackets of where, and exact values where these were needed.

    t : (m, 3) distance, lower, upper of each, in units of the direction's length.   order : of the rows that `settle`
    puts ray by ray.   keep : (m,) bool, rows that are answers.
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
        """Put the hits of each ray in order, exactly, and drop those beyond the limit; keep the first only, or every
        one.
        """
        if not every and self.narrow.all() and (self.ray[1:] > self.ray[:-1]).all():
            self.order = np.arange(len(self.ray))
            return
        order = np.lexsort((self.facet, self.t[:, 1], self.ray))
        ray, lower = self.ray[order], self.t[order, 1]
        open_rays = set(self.ray[~self.narrow].tolist())
        same = ray[1:] == ray[:-1]
        # Brackets of one ray that overlap: what came before may reach as far as the largest end among them.
        ends = _running_ends(ray, self.t[order, 2])
        open_rays.update(ray[1:][same & (lower[1:] <= ends[:-1])].tolist())
        if not every:
            open_rays.update(ray[1:][same].tolist())
        self.order = order
        for k in sorted(open_rays):
            begin, end = np.searchsorted(ray, [k, k + 1])
            order[begin:end] = self._in_order(order[begin:end])
        if not every:
            remaining = order[self.keep[order]]
            is_later = np.diff(self.ray[remaining], prepend=-1) == 0
            self.keep[remaining[is_later]] = False

    def _in_order(self, rows: np.ndarray) -> list[int]:
        """The hits of one ray by their exact t, then by facet; those beyond the limit are dropped."""
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

    def answers(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(ray, facet, t) of the hits that are kept, in order."""
        rows = self.order[self.keep[self.order]]
        return self.ray[rows], self.facet[rows], self.t[rows]


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


def _as_hits(met: _MetFacets, ray, facet, t, hit, starts) -> RayHits:
    points = met.rays[ray, :3] + t[:, :1] * np.ldexp(met.rays[ray, 3:6], met.exponents[ray, None])
    X = met.X_WA[ray] if len(met.X_WA) > 1 else met.X_WA
    normals = facet_normals(X, met.corners[facet])
    return RayHits(hit, t[:, 0], t[:, 1], t[:, 2], points, normals, facet, starts)
