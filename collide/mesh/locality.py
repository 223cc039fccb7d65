"""How local a mesh is: the stretches of Erickson, "Local polyhedra and geometric graphs" (2003), sections 2.1 and 8.

The vertices are points, the facets' sides are edges. The local stretch σ(v) is the longest edge at v over
the distance to the nearest other vertex, joined to v by an edge or not; σ_k(v) has the k-th
nearest in its place; σ_k is the largest σ_k(v); the global stretch Σ is the longest edge over the shortest.
Cheap collision detection is proven for meshes whose σ_k are small.

All vertices count, also vertices without a facet. Vertices are distinct points: rows with the same
coordinates are one vertex with the edges of all, and edges of no length do not count. Table 1 of the
paper counts otherwise (its dragon has 2,100 repeated rows): ``repeated=True`` counts as the table does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass

import numpy as np

from collide.errors import InvalidShape
from collide.mesh.nearest_neighbours import PointTree
from collide.mesh.weld import weld

#: Orders of the local stretch that are measured.
ORDERS = 10


@dataclass(frozen=True)
class Locality:
    """What `locality` found of a mesh.

    vertices, distinct, in_use : rows given, distinct points among them, and distinct points with an edge.
    facets : given.
    shortest, longest : edges [the unit of the mesh]; edges of no length do not count.
    global_stretch : Σ, their ratio.
    stretches : (in_use, 10) σ_k of every vertex with an edge, k = 1 … 10; 0 with fewer than k others.
    ids : (in_use,) their rows.
    """

    vertices: int
    distinct: int
    in_use: int
    facets: int
    shortest: float
    longest: float
    stretches: np.ndarray
    ids: np.ndarray

    @property
    def global_stretch(self) -> float:
        """Σ: the longest edge over the shortest."""
        return self.longest / self.shortest

    @property
    def local_stretches(self) -> np.ndarray:
        """(10,) σ_k, the largest stretch of each order; the first is σ."""
        return self.stretches.max(axis=0)

    @property
    def worst(self) -> np.ndarray:
        """(10,) the vertex, by its row, that has the largest stretch of each order."""
        return self.ids[self.stretches.argmax(axis=0)]

    @property
    def means(self) -> np.ndarray:
        """(10,) the mean stretch of each order."""
        return self.stretches.mean(axis=0)

    def quantiles(self, shares) -> np.ndarray:
        """(len(shares), 10) stretches σ_k, each not exceeded by the given share of the vertices."""
        return np.quantile(self.stretches, shares, axis=0)

    def histogram(self, bins_an_octave: int = 4) -> tuple[np.ndarray, np.ndarray]:
        """((b + 1,) limits, (b, 10) counts) of vertices by stretch, in bins of equal ratios around 1.

        Stretches of 0 (fewer than k other vertices) are in no bin.
        """
        known = self.stretches[self.stretches > 0.0]
        low = math.floor(math.log2(known.min()) * bins_an_octave)
        high = math.floor(math.log2(known.max()) * bins_an_octave) + 1
        limits = 2.0 ** (np.arange(low, high + 1) / bins_an_octave)
        limits[0], limits[-1] = min(limits[0], known.min()), max(limits[-1], np.nextafter(known.max(), np.inf))
        return limits, np.stack([np.histogram(column, limits)[0] for column in self.stretches.T], axis=1)

    @property
    def depth_bound(self) -> int:
        """⌈log2(n Σ)⌉, the depth that section 3.2 proves for a graded box-tree of a connected mesh."""
        return math.ceil(math.log2(self.distinct) + math.log2(self.global_stretch))


def quiet(_label: str) -> AbstractContextManager:
    """Progress that nobody watches."""
    return nullcontext()


def locality(
    vertices: np.ndarray, faces: np.ndarray, *, repeated: bool = False,
    progress: Callable[[str], AbstractContextManager] = quiet,
) -> Locality:
    """Stretches of a triangle mesh.

    vertices : (n, 3) finite.   faces : (m, 3) rows of vertices, within range.
    repeated : every row is a vertex of its own, with its own edges. Rows at distance 0 then take a place
        among the nearest, and a stretch over a distance of 0 does not count.
    progress : called with a label, gives a context manager around long work.

    O(n log n): a second for 437,645 vertices. Ratios are good to 4 units in the last place.
    Raises InvalidShape where no facet has an edge of any length.
    """
    first = weld(vertices) if not repeated else np.arange(len(vertices))
    distinct, number = np.unique(first, return_inverse=True)
    # Around 2^500 differences square without underflow down to 1e-304 of the largest coordinate.
    exponent = 500 - int(np.frexp(np.abs(vertices).max())[1])
    points = np.ldexp(vertices[distinct], exponent)
    with progress("measuring edges"):
        longest, shortest = _edge_squares(points, number[faces])
    used = np.flatnonzero(longest > 0.0)
    if not len(used):
        raise InvalidShape("locality: the mesh has no edge of any length")
    stretches = _stretches(points, longest, progress)[used]
    lengths = np.ldexp(np.sqrt([shortest, longest.max()]), -exponent)
    return Locality(
        len(vertices), len(distinct), len(used), len(faces), float(lengths[0]), float(lengths[1]),
        stretches, distinct[used],
    )


def _edge_squares(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, float]:
    """Squared length of the longest edge at each point (n,), 0 without an edge, and of the shortest of all."""
    longest, shortest = np.zeros(len(points)), math.inf
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        squares = np.square(points[a] - points[b]).sum(axis=1)
        np.maximum.at(longest, a, squares)
        np.maximum.at(longest, b, squares)
        shortest = min(shortest, float(squares.min(where=squares > 0.0, initial=math.inf)))
    return longest, shortest


def _stretches(points: np.ndarray, longest: np.ndarray, progress) -> np.ndarray:
    """(n, ORDERS) σ_k of every point, 0 without an edge or with fewer than k others."""
    result = np.zeros((len(points), ORDERS))
    with progress("sorting vertices"):
        tree = PointTree(points)
    done = 0
    chunks = tree.nearest(ORDERS)
    while done < len(points):
        with progress(f"finding the {ORDERS} nearest of each vertex, {100 * done // len(points)} %"):
            rows, squares = next(chunks)
        edges = np.broadcast_to(np.sqrt(longest[rows, None]), squares.shape)
        result[rows] = np.divide(edges, np.sqrt(squares), out=np.zeros_like(squares), where=squares > 0.0)
        done += len(rows)
    return result
