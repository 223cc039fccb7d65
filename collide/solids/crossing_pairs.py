"""Pairs of facets that clearly cross: which edge of one pierces the other at either end of the segment they share.

Doubles prove it (`narrowphase/facets/facet_crossings.py`). What such a pair shares ends inside an edge and
inside a facet on both sides, so that the edge and the facet are the point's name: two pairs have an end in common
exactly where these are the same. All other pairs are left to `facet_cuts.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.narrowphase.facets.facet_crossings import facet_crossings
from collide.solids.placed_facets import PlacedFacets


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
    a, b = pairs.T
    corners = facets.local[facets.corners[a]], facets.local[facets.corners[b]]
    crossings = facet_crossings(*corners, facets.poses[facets.body[a]], facets.poses[facets.body[b]])
    is_clear = crossings.is_clear
    pairs, slots = pairs[is_clear], crossings.slots[is_clear]
    is_of_b = (slots >= 3).astype(np.int64)
    piercing = np.take_along_axis(pairs, is_of_b, axis=1)
    facet = np.take_along_axis(pairs, 1 - is_of_b, axis=1)
    return CrossingPairs(
        pairs, facets.edge[piercing, slots % 3], facet, crossings.place[is_clear], crossings.error[is_clear]
    ), is_clear
