"""Two trees at their poses: what the rounds need, and all rows as the exact search reads them."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.input_rows import InputRows
from collide.numerics.exact_vectors import dot
from collide.papers.polytopes.hierarchical_tree import HierarchicalTree
from collide.papers.polytopes.relative_pose import Rows, as_doubles, homogeneous_integers
from collide.papers.polytopes.tree_walk import Relative

_UNIT = 2.0**-53


def relative_of(A: HierarchicalTree, B: HierarchicalTree, X_BA: Rows, X_AB: Rows) -> Relative:
    """The relative pose on grids, with what rounding may do."""
    d, grid, polar = A.dimension, A.grid, B.grid
    assert B.interior is not None
    inside = [Fraction(x) for x in B.interior.tolist()]
    centre = [Fraction(x) for x in grid.centre.tolist()]
    M = as_doubles(X_BA)[:d, :d]
    a = np.array([
        float(sum((x * y for x, y in zip(row, centre)), row[d]) - c) for row, c in zip(X_BA[:d], inside)
    ])
    unit = Fraction(grid.unit)
    o = np.array([
        float((sum((x * y for x, y in zip(row, inside)), row[d]) - c) / unit) for row, c in zip(X_AB[:d], centre)
    ])
    map_of_unit = M * grid.unit
    size = float((np.abs(map_of_unit).sum(axis=1) * A.tree.reach + np.abs(a)).max())
    shift = float(np.abs(map_of_unit).sum(axis=1).max())  # what a point is off by
    largest = float(np.abs(polar.points).max())
    eta = 4.0 * d * (size * (polar.unit + 16.0 * _UNIT * largest) + largest * (shift + 32.0 * d * _UNIT * size))
    zeta = 64.0 * d * _UNIT * (float(np.abs(o).max()) + A.tree.reach) + 4.0 * d
    return Relative(map_of_unit, a, o, eta, zeta)


def posed_rows(A: HierarchicalTree, B: HierarchicalTree, X_BA: Rows) -> InputRows:
    """All points in the frame of B and all half-spaces, with exact integers behind them."""
    points, normals, offsets = A.points, B.normals, B.offsets
    assert points is not None and normals is not None and offsets is not None
    d, whole, doubles = A.dimension, homogeneous_integers(X_BA), as_doubles(X_BA)
    values = points @ doubles[:d, :d].T + doubles[:d, d]
    size = float((np.abs(points).max(axis=0) @ np.abs(doubles[:d, :d]).T + np.abs(doubles[:d, d])).max())
    magnitude = float(np.abs(values).max()) or 1.0

    def point(row: int) -> list[int]:
        numerators, denominator = as_integers(points[row].tolist())
        vector = [*numerators, denominator]
        return [dot(line, vector) for line in whole]

    def halfspace(row: int) -> list[int]:
        return as_integers([*normals[row].tolist(), float(offsets[row])])[0]

    error = (2 * d + 6) * _UNIT * max(size / magnitude, 1.0)
    return InputRows(
        HomogeneousRows(values, 1.0, point, error), HomogeneousRows(normals, offsets, halfspace), 0, normals
    )
