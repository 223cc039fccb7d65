"""Facets cut by paths of clear crossings, split all at once: around every part, then into triangles.

A path enters a facet through its border, turns where edges of others pierce the facet, and leaves through the border.
Paths of different bodies may cross. No angle has to be compared: at a point of the border the way around a part turns
inwards, where an edge pierces the facet the way goes on along the path, and where two paths cross the way turns left.
Facets with a step unproven in doubles, or with a ring of cuts, are left to the exact sweep.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.solids.cut_segments import CutSegments
from collide.solids.placed_facets import PlacedFacets
from collide.solids.polygon_ears import WORKSPACE, clip_parts


class _Chains(NamedTuple):
    """The borders of facets, from corner to corner over their cut points.

    facet, point : (m,) ids of points in order, facet by facet, each counter-clockwise.
    following : (m,) the next point of the facet.   is_corner : (m,).
    """

    facet: np.ndarray
    point: np.ndarray
    following: np.ndarray
    is_corner: np.ndarray


def split_facets(
    facets: PlacedFacets, cuts: CutSegments, rows: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(triangles (t, 3) of point ids with the fronts of facets, facet (t,), facets that are left (k,)).

    rows : facets cut by these segments alone.
    """
    if not len(rows):
        return np.zeros((0, 3), dtype=np.int64), rows, rows
    n_points = len(facets.local) + len(cuts.place)
    wanted = np.zeros(len(facets.corners), dtype=bool)
    wanted[rows] = True
    # Every segment lies on two facets and is walked along both ways: four half-edges, of each facet and way.
    facet = np.tile(cuts.pairs.T.ravel(), 2)
    mine = wanted[facet]
    number = np.cumsum(mine) - 1
    turns = cuts.turns[wanted[cuts.turns[:, 0]]]
    turned = [number[half_edges] for half_edges in _turns(cuts, turns)]
    facet = facet[mine]
    both = np.concatenate([cuts.ids] * 2 + [cuts.ids[:, ::-1]] * 2)[mine]
    edge = np.concatenate([cuts.edge[:, 0]] * 2 + [cuts.edge[:, 1]] * 2)[mine]
    pierced = np.concatenate([cuts.pierced] * 2 + [cuts.pierced[:, ::-1]] * 2)[mine]
    at_border = ((pierced >= 0) & (pierced != facet[:, None])).T
    start, end = both.T
    chains, bad = _borders(facets, rows, facet, start, edge, at_border[0], cuts.place, cuts.error)
    following, unpaired = _ways_around(chains, facet, start, end, at_border, turned, n_points)
    bad = np.union1d(bad, unpaired)
    steps = np.concatenate([chains.facet, facet]), np.concatenate([chains.point, start])
    is_bad = np.zeros(len(facets.corners), dtype=bool)
    is_bad[bad] = True
    triangles, owners = _clipped(facets, following, len(chains.facet), *steps, cuts.place, cuts.error, is_bad)
    remaining = ~is_bad[owners]
    return triangles[remaining], owners[remaining], rows[is_bad[rows]]


def _turns(cuts: CutSegments, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(half-edges up to the crossing of two paths, of each the next half-edge, on the left)."""
    m = len(cuts.pairs)
    facet, first, second, sign = turns.T

    def half_edge(piece: np.ndarray, backward: bool) -> np.ndarray:
        return piece + m * (cuts.pairs[piece, 1] == facet) + 2 * m * backward

    # Ahead and behind along both segments, arriving and leaving; the second crosses the first from right to left.
    to_left = np.where(sign > 0, half_edge(second + 1, False), half_edge(second, True))
    to_right = np.where(sign > 0, half_edge(second, True), half_edge(second + 1, False))
    from_right = np.where(sign > 0, half_edge(second, False), half_edge(second + 1, True))
    from_left = np.where(sign > 0, half_edge(second + 1, True), half_edge(second, False))
    ahead, back = half_edge(first + 1, False), half_edge(first, True)
    arriving = [half_edge(first, False), half_edge(first + 1, True), from_right, from_left]
    return np.concatenate(arriving), np.concatenate([to_left, to_right, back, ahead])


def _clipped(
    facets: PlacedFacets, following: np.ndarray, n_border: int, rows: np.ndarray, points: np.ndarray,
    place: np.ndarray, error: np.ndarray, is_bad: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """(triangles (t, 3), their facets (t,)) as of `polygon_ears.clip_parts`, which marks further facets as bad."""
    n = len(following)
    triangles, owners = np.empty((n, 3), dtype=np.int64), np.empty(n, dtype=np.int64)
    seen, workspace = np.zeros(n, dtype=np.uint8), np.empty(WORKSPACE)
    count = clip_parts(
        address_of(facets.poses), len(facets.poses), address_of(facets.local), len(facets.local),
        address_of(facets.corners), address_of(facets.body), len(facets.corners), address_of(place), address_of(error),
        len(place), address_of(following), address_of(points), address_of(rows), n, n_border, address_of(seen),
        address_of(is_bad.view(np.uint8)), address_of(triangles), address_of(owners), address_of(workspace),
    )
    return triangles[:count], owners[:count]


def _borders(facets: PlacedFacets, rows, facet, start, edge, at_border, place, error) -> tuple[_Chains, np.ndarray]:
    """(the borders of facets, facets with an unproven order of points)."""
    f, p = facet[at_border], start[at_border]
    slot = np.argmax(facets.edge[f] == edge[at_border][:, None], axis=1)
    corners, corner_error = _posed_corners(facets.local[facets.corners[f]], facets.poses[facets.body[f]])
    k = np.arange(len(f))
    a, b = corners[k, slot], corners[k, (slot + 1) % 3]
    rows_of = p - len(facets.local)
    along = ((place[rows_of] - a) * (b - a)).sum(axis=1)
    slack = 16.0 * (error[rows_of] + corner_error) * np.abs(b - a).sum(axis=1)
    at = np.concatenate([np.repeat(rows, 3), f])
    slots = np.concatenate([np.tile(np.arange(3), len(rows)), slot])
    height = np.concatenate([np.full(3 * len(rows), -np.inf), along])
    points = np.concatenate([facets.corners[rows].ravel(), p])
    order = np.lexsort((height, slots, at))
    at, slots, height, points = at[order], slots[order], height[order], points[order]
    slack = np.concatenate([np.zeros(3 * len(rows)), slack])[order]
    same = (at[1:] == at[:-1]) & (slots[1:] == slots[:-1]) & np.isfinite(height[:-1])
    with np.errstate(invalid="ignore"):
        tight = same & ~(height[1:] - height[:-1] > slack[1:] + slack[:-1])
    following = np.arange(1, len(at) + 1)
    last = np.flatnonzero(np.append(at[1:] != at[:-1], True))
    following[last] = np.append(0, last[:-1] + 1)
    return _Chains(at, points, following, ~np.isfinite(height)), np.unique(at[1:][tight])


def _posed_corners(T: np.ndarray, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((k, 3, 3) corners in W, (k,) bound of the error of a coordinate)."""
    terms = X[:, None, :3, :3] * T[:, :, None, :]
    shift = X[:, None, :3, 3]
    size = np.abs(terms).sum(axis=3) + np.abs(shift)
    return terms.sum(axis=3) + shift, 6.0 * 2.0**-53 * size.max(axis=(1, 2))


def _ways_around(chains: _Chains, facet, start, end, at_border, turned, n_points) -> tuple[np.ndarray, np.ndarray]:
    """(after each step of the borders, then of the segments, the next around the same part; facets where none fits)."""
    m, n = len(chains.facet), len(facet)
    keys = facet * n_points + start
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]

    def leaving(f: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(a segment of each facet that starts at a point, how many do)."""
        wanted = f * n_points + p
        first = np.searchsorted(ordered, wanted)
        count = np.searchsorted(ordered, wanted, side="right") - first
        return first, count

    following = np.empty(m + n, dtype=np.int64)
    then = chains.following
    first, count = leaving(chains.facet, chains.point[then])
    on_border = ~chains.is_corner[then]
    following[:m] = np.where(on_border, m + order[np.minimum(first, n - 1)], then)
    bad = [chains.facet[on_border & (count != 1)]]
    # Segments ending on the border continue along the border, where paths cross they turn, and others continue along
    # the path, never back.
    border_keys = chains.facet * n_points + chains.point
    border_order = np.argsort(border_keys, kind="stable")
    at = np.searchsorted(border_keys[border_order], facet * n_points + end)
    onward = border_order[np.minimum(at, m - 1)]
    first, count = leaving(facet, end)
    onto, or_onto = order[np.minimum(first, n - 1)], order[np.minimum(first + 1, n - 1)]
    back = (np.arange(n) + n // 2) % n
    following[m:] = np.where(at_border[1], onward, m + np.where(onto == back, or_onto, onto))
    following[m + turned[0]] = m + turned[1]
    turns = np.zeros(n, dtype=bool)
    turns[turned[0]] = True
    bad.append(facet[~at_border[1] & ~turns & (count != 2)])
    return following, np.unique(np.concatenate(bad))
