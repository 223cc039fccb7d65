"""The true facets of an exact hull, and their triangulation by the perturbation.

`convex_hull` gives flat facets as some triangles, and may keep points on a facet or an edge. Here
coplanar triangles are merged again. A vertex where three true facets or more meet is strictly
extreme; the others are dropped. The rest of a facet's border is a strictly convex polygon,
triangulated as of `symbolic_perturbation.py`: vertices are cut off in the order of their moves inwards.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.hull.exact_hull import Hull
from collide.kernels import address_of, entry, kernel, view_f64, view_i32, view_i64, view_u8
from collide.numerics.orientation import DIGITS, WORK, CloudView, one_of_four, survey
from collide.papers.hierarchies.half_edges import following, preceding
from collide.papers.hierarchies.symbolic_perturbation import exact_side, rank_of, side

#: Coordinates that are smaller than the largest by this power of two must not be left to expansions (`orientation`).
SMALL = -280
#: Flips for each triangle before flipping is given up.
_FLIPS = 400


class Cloud:
    """Points for exact tests: as they are and scaled, workspace for the sums; the centres of the perturbation.

    originals, scaled : (rows, 3). Rows: the points, four centres, vertices added later.
    """

    def __init__(self, points: np.ndarray):
        points = np.asarray(points, dtype=np.float64)
        self.count = len(points)
        self.originals = np.concatenate([points, _centres(points)])
        self.scaled = np.empty_like(self.originals)
        self.work = np.zeros(WORK)
        self.digits = np.zeros(DIGITS, dtype=np.int64)
        self.exponent = int(
            scale_cloud(address_of(self.originals), address_of(self.scaled), len(self.scaled), address_of(self.work))
        )
        self.used = len(self.scaled)

    def reserve(self, rows: int) -> None:
        """Have at least this many rows."""
        if rows > len(self.scaled):
            more = np.zeros((rows - len(self.scaled), 3))
            self.originals = np.concatenate([self.originals, more])
            self.scaled = np.concatenate([self.scaled, more])

    def add(self, point: np.ndarray) -> int:
        """Row of an additional point, for a test; the next point overwrites the row."""
        self.reserve(self.used + 1)
        self.originals[self.used] = point
        self.scaled[self.used] = np.ldexp(point, -self.exponent)
        # It lies on no lattice, and may have small coordinates.
        self.work[0] = max(float(np.ldexp(1.0, self.exponent + SMALL)), 5e-324)
        self.work[1] = 0.0
        return self.used

    @property
    def addresses(self) -> tuple[int, int, int, int, int]:
        """Scaled, originals, rows, sums, digits: the first arguments of the kernels."""
        return (
            address_of(self.scaled), address_of(self.originals), len(self.scaled), address_of(self.work),
            address_of(self.digits),
        )


def _centres(points: np.ndarray) -> np.ndarray:
    """The mean, and three points beside. Points of a lattice have their centres on a lattice not much finer."""
    largest = np.abs(points).max()
    unit = 2.0 ** float(np.frexp(largest)[1] - 1) if largest > 0 else 1.0
    mean = (points / len(points)).sum(axis=0)
    for bits in (8, 16, 24):
        step = unit * 2.0**-bits
        if step > 0.0 and (np.rint(points / step) * step == points).all():
            fine = step / 64
            mean = np.rint(mean / fine) * fine if fine > 0.0 else mean
            break
    aside = np.diag([0.25 * unit] * 3)
    aside[mean[None] + aside == mean[None]] = unit
    return np.concatenate([mean[None], mean[None] + aside])


class Facets(NamedTuple):
    """The boundary by true facets.

    triangles : (f, 3) int32, the perturbed hull: closed, weakly convex, all corners strictly extreme.
    twins : (3 f,) int32, the opposite half-edge of each, see `surface`.
    spans : (m, 3) int32, for every true facet three points spanning its plane, counter-clockwise.
    """

    triangles: np.ndarray
    twins: np.ndarray
    spans: np.ndarray


def true_facets(cloud: Cloud, hull: Hull) -> Facets:
    """Facets of a solid hull. O(f log f), and O(k log k) for a flat facet with k corners."""
    triangles = np.ascontiguousarray(hull.facets, dtype=np.int32)
    twins = twins_of(triangles)
    patch = np.empty(len(triangles), dtype=np.int32)
    stack = np.empty(len(triangles), dtype=np.int32)
    n_facets = label_patches(
        *cloud.addresses, address_of(triangles), address_of(twins), len(triangles), address_of(patch), address_of(stack)
    )
    if n_facets == len(triangles):
        return Facets(triangles, twins, triangles)
    spans = _widest(cloud, triangles, patch, n_facets)
    ranks = np.empty(cloud.count, dtype=np.int64)
    write_ranks(cloud.count, address_of(ranks))
    extreme = _where_three_meet(triangles, twins, patch, cloud.count)
    made = _triangulated(triangles, twins, patch, n_facets, extreme, ranks)
    return Facets(made, settled_twins(cloud, made), spans)


def twins_of(triangles: np.ndarray) -> np.ndarray:
    """(3 f,) int32: the opposite half-edge of every half-edge of a closed surface."""
    start = triangles.ravel().astype(np.int64)
    end = triangles[:, [1, 2, 0]].ravel().astype(np.int64)
    order = np.argsort(np.minimum(start, end) << 32 | np.maximum(start, end), kind="stable")
    twins = np.empty(len(start), dtype=np.int32)
    twins[order[0::2]] = order[1::2]
    twins[order[1::2]] = order[0::2]
    return twins


def _where_three_meet(triangles, twins, patch, count) -> np.ndarray:
    """(count,) bool: vertices that belong to three true facets or more. As many borders leave a vertex."""
    border = np.repeat(patch, 3) != patch[twins // 3]
    return np.bincount(triangles.ravel()[border], minlength=count) >= 3


def _widest(cloud: Cloud, triangles, patch, n_facets) -> np.ndarray:
    """Of each patch the triangle of the largest area, in doubles."""
    a, b, c = (cloud.scaled[triangles[:, k]] for k in range(3))
    area = np.abs(np.cross(b - a, c - a)).sum(axis=1)
    order = np.lexsort((np.arange(len(area)), -area, patch))
    first = np.searchsorted(patch[order], np.arange(n_facets))
    return np.ascontiguousarray(triangles[order[first]])


def _triangulated(triangles, twins, patch, n_facets, extreme, ranks) -> np.ndarray:
    """Triangles of all facets, from their borders."""
    border = np.empty(3 * len(triangles), dtype=np.int32)
    start = np.zeros(n_facets + 1, dtype=np.int64)
    strict = np.ascontiguousarray(extreme, dtype=np.uint8)
    seen = np.zeros(n_facets, dtype=np.uint8)
    trace_borders(
        address_of(triangles), address_of(twins), len(triangles), address_of(patch), n_facets, address_of(strict),
        len(strict), address_of(border), address_of(start), address_of(seen),
    )
    border = border[: start[-1]]
    size = np.diff(start)
    owner = np.repeat(np.arange(n_facets), size)
    order = np.ascontiguousarray(np.lexsort((-ranks[border], owner)))
    made = np.empty((int((size - 2).sum()), 3), dtype=np.int32)
    before, after = np.empty(len(border), dtype=np.int64), np.empty(len(border), dtype=np.int64)
    cut_ears(
        address_of(border), address_of(start), n_facets, address_of(order), address_of(before),
        address_of(after), address_of(made), len(border),
    )
    return made


def settled_twins(cloud: Cloud, triangles: np.ndarray) -> np.ndarray:
    """Flip the triangles, in place, until the perturbed surface is convex; returns their twins.

    Convex without flips if centre 0 lies strictly inside the hull. In a hull thinner than rounding centre 0 may lie
    outside.
    """
    twins = twins_of(triangles)
    stack = np.empty(2 * len(twins), dtype=np.int64)
    flips = flip_until_convex(
        *cloud.addresses, cloud.count, address_of(triangles), address_of(twins), len(triangles), address_of(stack)
    )
    if flips < 0:
        raise AssertionError("a flat facet could not be brought to the triangulation of its perturbation")
    return twins


def named_in(ids: np.ndarray, count: int) -> np.ndarray:
    """The ids below count that occur, ascending."""
    occurs = np.zeros(count, dtype=bool)
    occurs[ids.ravel()] = True
    return np.flatnonzero(occurs)


# --- kernels ------------------------------------------------------------------------------------


@entry("int64(int64, int64, int64, int64)")
def scale_cloud(originals_at, scaled_at, count, work_at):
    return survey(view_f64(originals_at, 3 * count), view_f64(scaled_at, 3 * count), count, view_f64(work_at, WORK))


@entry("void(int64, int64)")
def write_ranks(count, ranks_at):
    ranks = view_i64(ranks_at, count)
    for i in range(count):
        ranks[i] = rank_of(i)


@kernel
def cloud_at(scaled_at, originals_at, rows, work_at, digits_at, centres, exponent):
    """A `CloudView` of `Cloud.addresses`; centres and exponent 0 for exact tests alone."""
    return CloudView(
        view_f64(scaled_at, 3 * rows), view_f64(originals_at, 3 * rows), view_f64(work_at, WORK),
        view_i64(digits_at, DIGITS), centres, exponent,
    )


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def label_patches(scaled_at, originals_at, rows, work_at, digits_at, corners_at, twins_at, count, patch_at, stack_at):
    """Number the triangles by the plane they lie in, neighbours in one plane alike; returns how many planes."""
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, 0, 0)
    corners = view_i32(corners_at, 3 * count)
    twins = view_i32(twins_at, 3 * count)
    patch = view_i32(patch_at, count)
    stack = view_i32(stack_at, count)
    for t in range(count):
        patch[t] = -1
    n_planes = 0
    for first in range(count):
        if patch[first] >= 0:
            continue
        patch[first] = n_planes
        stack[0] = first
        depth = 1
        while depth > 0:
            depth -= 1
            t = np.int64(stack[depth])
            for h in range(3 * t, 3 * t + 3):
                g = np.int64(twins[h])
                if patch[g // 3] < 0 and in_plane(cloud, corners, t, g):
                    patch[g // 3] = n_planes
                    stack[depth] = g // 3
                    depth += 1
        n_planes += 1
    return n_planes


@kernel
def in_plane(cloud, corners, t, g):
    """Whether the corner opposite half-edge g lies in the plane of triangle t."""
    d = np.int64(corners[preceding(g)])
    a, b, c = np.int64(corners[3 * t]), np.int64(corners[3 * t + 1]), np.int64(corners[3 * t + 2])
    return exact_side(cloud, a, b, c, d) == 0


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def trace_borders(corners_at, twins_at, count, patch_at, n_facets, strict_at, points, border_at, start_at, seen_at):
    """The strictly extreme vertices along the border of every patch, counter-clockwise, patch after patch."""
    corners = view_i32(corners_at, 3 * count)
    twins = view_i32(twins_at, 3 * count)
    patch = view_i32(patch_at, count)
    strict = view_u8(strict_at, points)
    border = view_i32(border_at, 3 * count)
    start = view_i64(start_at, n_facets + 1)
    seen = view_u8(seen_at, n_facets)
    total = 0
    traced = 0
    for first in range(3 * count):
        facet = patch[first // 3]
        if seen[facet] != 0 or patch[twins[first] // 3] == facet:
            continue
        seen[facet] = 1
        start[traced] = total
        traced += 1
        h = first
        while True:
            if strict[corners[h]] != 0:
                border[total] = corners[h]
                total += 1
            h = following(h)
            while patch[twins[h] // 3] == facet:
                h = following(np.int64(twins[h]))
            if h == first:
                break
    start[n_facets] = total


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def cut_ears(border_at, start_at, n_polygons, order_at, before_at, after_at, made_at, total):
    """Triangulate polygons by cutting their vertices off in a given order."""
    border = view_i32(border_at, total)
    start = view_i64(start_at, n_polygons + 1)
    order = view_i64(order_at, total)
    before = view_i64(before_at, total)
    after = view_i64(after_at, total)
    made = view_i32(made_at, 3 * (total - 2 * n_polygons))
    at = 0
    for polygon in range(n_polygons):
        low = start[polygon]
        high = start[polygon + 1]
        for k in range(low, high):
            before[k] = k - 1 if k > low else high - 1
            after[k] = k + 1 if k < high - 1 else low
        for k in range(low, high - 2):
            ear = order[k]
            made[at] = border[before[ear]]
            made[at + 1] = border[ear]
            made[at + 2] = border[after[ear]]
            at += 3
            after[before[ear]] = after[ear]
            before[after[ear]] = before[ear]


@entry("int64(int64, int64, int64, int64, int64, int64, int64, int64, int64, int64)")
def flip_until_convex(
    scaled_at, originals_at, rows, work_at, digits_at, centres, corners_at, twins_at, count, stack_at
):
    """Flip edges until the perturbed surface is convex at every edge; returns the number of flips, −1 without an end.

    Only edges inside a strictly convex flat facet are ever concave; any two triangles there make a convex
    quadrilateral, and each flip lifts the perturbed surface, so the flips end.
    """
    cloud = cloud_at(scaled_at, originals_at, rows, work_at, digits_at, centres, 0)
    corners = view_i32(corners_at, 3 * count)
    twins = view_i32(twins_at, 3 * count)
    stack = view_i64(stack_at, 6 * count)
    flips = 0
    for first in range(3 * count):
        if twins[first] < first:
            continue
        stack[0] = first
        depth = 1
        while depth > 0:
            depth -= 1
            h = stack[depth]
            if not concave(cloud, corners, twins, h):
                continue
            flips += 1
            if flips > _FLIPS * count:
                return -1
            flip(corners, twins, h)
            g = np.int64(twins[h])
            for edge in range(4):
                k = one_of_four(edge, following(h), preceding(h), following(g), preceding(g))
                if depth < 6 * count:
                    stack[depth] = k
                    depth += 1
    return flips


@kernel
def concave(cloud, corners, twins, h):
    """Whether the corner beyond half-edge h lies above its triangle."""
    a = np.int64(corners[h])
    b = np.int64(corners[following(h)])
    c = np.int64(corners[preceding(h)])
    d = np.int64(corners[preceding(np.int64(twins[h]))])
    return side(cloud, a, b, c, d) > 0


@kernel
def flip(corners, twins, h):
    """Replace the edge of half-edge h by the other diagonal; h and its twin run along it afterwards.

    Triangles a → b → c at h and b → a → d at its twin g become d → c → a at h and c → d → b at g.
    """
    g = np.int64(twins[h])
    a, b = corners[h], corners[g]
    c, d = corners[preceding(h)], corners[preceding(g)]
    bc, ca = twins[following(h)], twins[preceding(h)]
    ad, db = twins[following(g)], twins[preceding(g)]
    corners[h], corners[following(h)], corners[preceding(h)] = d, c, a
    corners[g], corners[following(g)], corners[preceding(g)] = c, d, b
    link(twins, following(h), ca)
    link(twins, preceding(h), ad)
    link(twins, following(g), db)
    link(twins, preceding(g), bc)


@kernel
def link(twins, g, h):
    twins[g] = h
    twins[h] = g
