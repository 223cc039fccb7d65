"""Where a ray from inside leaves the hull of points: a linear program of d variables, by the simplex method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

_TOLERANCE = 1e-12
_MAX_PIVOTS = 400


class Exit(NamedTuple):
    """rows : (d,) points that span the facet.   weights : (d,) ≥ 0, ray ≈ Σ weights·(points − centre).

    normal : (d,) with normal·(x − centre) ≤ 1 for every point x, to rounding.
    """

    rows: np.ndarray
    weights: np.ndarray
    normal: np.ndarray


def ray_exit(offsets: np.ndarray, first: np.ndarray, ray: np.ndarray) -> Exit | None:
    """The facet through which {t·ray : t ≥ 0} leaves a hull; ``None`` in doubt.

    Parameters
    ----------
    offsets : (k, d) float64
        Points, seen from a centre inside.
    first : (d + 1,) integers
        Rows whose mean is the centre.
    ray : (d,) float64
        Not zero.
    """
    d = offsets.shape[1]
    corners = offsets[first]
    try:
        shares = np.linalg.solve(np.vstack((corners.T, np.ones(d + 1))), np.append(ray, 0.0))
        basis = np.delete(first, int(np.argmin(shares)))  # the mean of all is 0: one share can be made 0
        for _ in range(_MAX_PIVOTS):
            matrix = offsets[basis]
            normal = np.linalg.solve(matrix, np.ones(d))
            heights = offsets @ normal
            row = int(np.argmax(heights))
            weights, change = np.linalg.solve(matrix.T, np.column_stack((ray, offsets[row]))).T
            if heights[row] <= 1.0 + _TOLERANCE:
                return Exit(basis, np.maximum(weights, 0.0), normal)
            falling = np.flatnonzero(change > _TOLERANCE * np.abs(change).max())
            if not len(falling):
                return None
            basis[falling[np.argmin(weights[falling] / change[falling])]] = row
    except np.linalg.LinAlgError:
        return None
    return None
