"""A binary space partition as it grows: cuts, the places below them, and what each cut holds of the facets."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.errors import UnsupportedQuery
from collide.numerics.growing_rows import GrowingRows

#: What stands at a place that no cut and no leaf has taken.
EMPTY = np.iinfo(np.int64).min
#: Bytes of a cut with its two places, and of a facet in a cut.
_CUT_BYTES, _HELD_BYTES = 88, 16


class Links(NamedTuple):
    """Leaves that touch across cuts, (k,) each.

    cut : numbers of the cuts.   below, above : places of a leaf on each side, with a common piece of a face.
    step : how often facets wind around the leaf below, less how often around the leaf above.
    """

    cut: np.ndarray
    below: np.ndarray
    above: np.ndarray
    step: np.ndarray


class PartitionTree:
    """Places are numbered: 0 is all of space, 2 c + 1 is the side below cut c, 2 c + 2 the side above.

    plane : (cuts,), the plane of each cut.   below : (places,), the cut at a place, or EMPTY for a leaf.
    held : [(cuts (k,), facets (k,))], facets that lie in the plane of a cut and in its cell.
    links : a leaf on each side of every cut, block by block.
    """

    def __init__(self, memory: int):
        self.memory, self.other_bytes, self.prediction = memory, 0, ""
        self.plane, self.below = GrowingRows.empty(np.int64), GrowingRows.empty(np.int64)
        self.held: list[tuple[np.ndarray, np.ndarray]] = []
        self.links: list[Links] = []
        self.below.add(np.array([EMPTY]))

    def cut(self, places: np.ndarray, planes: np.ndarray) -> np.ndarray:
        """Cut the cells at places by a plane each; returns the numbers of the cuts."""
        made = self.plane.add(planes)
        self.below.rows[places] = made
        self.below.add(np.full(2 * len(planes), EMPTY))
        self.check_memory()
        return made

    def hold(self, cuts: np.ndarray, facets: np.ndarray) -> None:
        """Facets that lie in the planes of cuts."""
        if len(cuts):
            self.held.append((cuts, facets))

    @property
    def n_bytes(self) -> int:
        """Bytes of the tree and of what is worked on."""
        return _CUT_BYTES * self.plane.n + _HELD_BYTES * sum(len(c) for c, _ in self.held) + self.other_bytes

    def check_memory(self) -> None:
        """Refuse to grow beyond the limit, and say how far it came."""
        if self.n_bytes > self.memory:
            raise UnsupportedQuery(
                f"SpacePartition: {self.plane.n + 1:,} cells so far take {self.n_bytes:,} bytes, more than "
                f"memory={self.memory:,}; {self.prediction}raise memory, or cut the mesh into fewer facets"
            )
