"""Pairs of facets that clearly cross, all at once in doubles: which edge of one pierces the other at either end of the
segment they share.

Signs and orders are taken only where bounds of the errors prove them. What such a pair shares ends inside an edge and
inside a facet on both sides, so that the edge and the facet are the point's name: two pairs have an end in common
exactly where these are the same. All other pairs are left to `facet_cuts.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.solids.placed_facets import PlacedFacets
from collide.surface_queries.overlay import plane_crossings, posed_corners, sides_of_planes

_U = 2.0**-53


class CrossingPairs(NamedTuple):
    """The segments that k pairs (a, b) of facets share, from their lower end along n_a × n_b to their higher.

    pairs : (k, 2) rows of facets.   edge : (k, 2) of either end, the edge that pierces.   facet : (k, 2) the facet.
    place : (k, 2, 3) the ends in W [m], off by ``error`` (k,) at most.
    """

    pairs: np.ndarray
    edge: np.ndarray
    facet: np.ndarray
    place: np.ndarray
    error: np.ndarray


def crossing_pairs(facets: PlacedFacets, pairs: np.ndarray) -> tuple[CrossingPairs, np.ndarray]:
    """(the pairs that clearly cross, which of the given they are (k,) bool)."""
    with np.errstate(all="ignore"):
        return _crossing_pairs(facets, pairs)


def _crossing_pairs(facets: PlacedFacets, pairs: np.ndarray) -> tuple[CrossingPairs, np.ndarray]:
    a, b = pairs.T
    A, error_a = posed_corners(facets.local[facets.corners[a]], facets.poses[facets.body[a]])
    B, error_b = posed_corners(facets.local[facets.corners[b]], facets.poses[facets.body[b]])
    error = np.maximum(error_a, error_b)
    largest = np.maximum(np.abs(A).max(axis=(1, 2)), np.abs(B).max(axis=(1, 2)))
    n, sides_b, limit_b = sides_of_planes(A, B, error)
    m, sides_a, limit_a = sides_of_planes(B, A, error)
    proven = (np.abs(sides_b) > limit_b[:, None]).all(axis=1) & (np.abs(sides_a) > limit_a[:, None]).all(axis=1)
    proven &= (np.abs(np.sign(sides_b).sum(axis=1)) == 1) & (np.abs(np.sign(sides_a).sum(axis=1)) == 1)
    on_a, error_on_a = plane_crossings(A, sides_a, limit_a, error)
    on_b, error_on_b = plane_crossings(B, sides_b, limit_b, error)
    off = np.maximum(error_on_a, error_on_b)
    along = np.cross(n, m)
    along /= np.abs(along).max(axis=1, keepdims=True)
    points = np.concatenate([on_a, on_b], axis=1)
    relative = points - points[:, :1]
    heights = (relative * along[:, None]).sum(axis=2)
    # Points of one line are in the order of their heights, as in `surface_queries/overlay.py`.
    lengths = np.abs(relative[:, 1::2] - relative[:, ::2]).max(axis=2)
    rises = np.abs(heights[:, 1::2] - heights[:, ::2])
    proven &= ((rises >= 0.5 * lengths) & (lengths > 64.0 * off[:, None])).any(axis=1)
    slack = 16.0 * off + 64.0 * _U * largest
    apart = np.abs(heights[:, :2, None] - heights[:, None, 2:]).min(axis=(1, 2))
    proven &= apart > slack
    edges = np.concatenate([_piercing(facets, a, sides_a), _piercing(facets, b, sides_b)], axis=1)
    k = np.arange(len(a))
    # Of two segments on one line the common part is from the higher of the lower ends to the lower of the higher.
    low_a, high_a = np.where(heights[:, 0] < heights[:, 1], 0, 1), np.where(heights[:, 0] < heights[:, 1], 1, 0)
    low_b, high_b = np.where(heights[:, 2] < heights[:, 3], 2, 3), np.where(heights[:, 2] < heights[:, 3], 3, 2)
    low = np.where(heights[k, low_a] > heights[k, low_b], low_a, low_b)
    high = np.where(heights[k, high_a] < heights[k, high_b], high_a, high_b)
    proven &= heights[k, high] - heights[k, low] > slack
    ends = np.stack([low, high], axis=1)
    edge = np.take_along_axis(edges, ends, axis=1)
    facet = np.where(ends < 2, b[:, None], a[:, None])
    place = np.take_along_axis(points, ends[:, :, None], axis=1)
    return CrossingPairs(*(x[proven] for x in (pairs, edge, facet, place, off))), proven


def _piercing(facets: PlacedFacets, rows: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """(k, 2) edges of facets from the corner alone on its side to the next and to the one after."""
    signs = np.sign(sides)
    lonely = np.argmax(signs == -np.sign(signs.sum(axis=1))[:, None], axis=1)
    k = np.arange(len(rows))
    edge = facets.edge[rows]
    return np.stack([edge[k, lonely], edge[k, (lonely + 2) % 3]], axis=1)
