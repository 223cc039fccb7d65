"""Pairs of clearly crossing facets: for either end of their common segment, the piercing edge and the pierced facet.

Doubles prove the crossing (`narrowphase/facets/facet_crossings.py`). Both ends of the common segment lie inside an edge
and inside a facet, so edge and facet name the point: two pairs have a common end exactly if edge and facet are
the same. All other pairs are left to `facet_cuts.py`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.narrowphase.facets.facet_crossings import facet_crossings
from collide.solids.placed_facets import PlacedFacets


class CrossingPairs(NamedTuple):
    """The common segments of k pairs (a, b) of facets, from their lower end along n_a × n_b to their higher.

    pairs : (k, 2) rows of facets.   edge : (k, 2) of either end, the piercing edge.   facet : (k, 2) the pierced facet.
    place : (k, 2, 3) the ends in W [m], off by ``error`` (k,) at most.
    """

    pairs: np.ndarray
    edge: np.ndarray
    facet: np.ndarray
    place: np.ndarray
    error: np.ndarray


_NO_PAIRS = np.zeros((0, 2), dtype=np.int64)
#: Without pairs.
NO_CROSSINGS = CrossingPairs(_NO_PAIRS, _NO_PAIRS, _NO_PAIRS, np.zeros((0, 2, 3)), np.zeros(0))


def crossing_pairs(facets: PlacedFacets, pairs: np.ndarray) -> tuple[CrossingPairs, np.ndarray]:
    """(the clearly crossing pairs, (k,) bool: given pairs among them)."""
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
