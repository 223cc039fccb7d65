"""How many facets a localised mesh would have, told before any is cut: an estimate by how edges crowd.

Where M edges, each at least w long, pass through a cube of width w, about w·K/M is as long as their pieces can be, K
edges in a cube being what a stretch allows: M²/K pieces. J. Erickson, "Local polyhedra and geometric graphs" (2005),
section 8: n edges around a cylinder must be cut into n²/log n pieces so.
"""

from __future__ import annotations

import numpy as np

#: Edges in a cube that need no cut, for a stretch of 1: fitted to cylinders of 64 to 256 sides at stretches 10 and 20.
_EDGES_A_STRETCH = 1.15
#: Pieces of edges, over facets.
_EDGES_A_FACET = 1.5
#: Cubes are halved no further where all edges pass through more of them than this.
_MAX_CUBES = 1 << 18
#: Levels of cubes at most.
_MAX_LEVELS = 18


def predicted_facets(points: np.ndarray, ends: np.ndarray, n_facets: int, stretch: float, order: int) -> int:
    """An estimate of the facets of a mesh of n_facets once it is localised; never less than n_facets.

    ends : (e, 2) rows of points (n, 3), the mesh's edges. O(e) a level of cubes, to 262,144 cubes a level.
    """
    a, b = points[ends[:, 0]], points[ends[:, 1]]
    low = np.minimum(a, b).min(axis=0)
    a, b = a - low, b - low
    lengths = np.sqrt(np.square(b - a).sum(axis=1))
    max_uncut = _EDGES_A_STRETCH * stretch * np.sqrt(order)
    pieces, width = 0.0, float(lengths.max())
    for level in range(_MAX_LEVELS):
        long = np.flatnonzero(lengths >= width)
        steps = np.ceil(2.0 * lengths[long] / width)
        if level > 2 and steps.sum() > _MAX_CUBES:
            break
        counts = _edges_in_cubes(a[long] / width, b[long] / width, steps.astype(np.int64))
        pieces = max(pieces, float(np.square(counts[counts > max_uncut].astype(np.float64)).sum() / max_uncut))
        if len(long) == len(lengths) and counts.max() <= max_uncut:
            break
        width /= 2.0
    return max(n_facets, int(pieces / _EDGES_A_FACET))


def _edges_in_cubes(a: np.ndarray, b: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """How many edges pass through every cube of width 1 that any does, edges looked at in points half a width apart."""
    edge = np.repeat(np.arange(len(a)), steps)
    at = np.arange(len(edge)) - np.repeat(np.cumsum(steps) - steps, steps)
    share = (at + 0.5) / steps[edge]
    cubes = np.floor(a[edge] + share[:, None] * (b - a)[edge]).astype(np.int64)
    size = int(cubes.max()) + 1
    _, cube = np.unique((cubes[:, 0] * size + cubes[:, 1]) * size + cubes[:, 2], return_inverse=True)
    key = np.unique(cube.ravel() * len(a) + edge)
    return np.bincount(key // len(a))
