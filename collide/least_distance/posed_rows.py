"""Exact points and half-spaces (`posed_sets.py`) as rows for a least-distance program."""

from __future__ import annotations

from fractions import Fraction
from math import frexp

import numpy as np

from collide.least_distance.homogeneous_rows import HomogeneousRows, as_integers
from collide.least_distance.posed_sets import ExactRow

_UNIT = 2.0**-53


def rows_of_points(points: list[ExactRow]) -> HomogeneousRows:
    """Points, as a program reads them."""
    values = np.array([[float(v) for v in point] for point in points])

    def integers(row: int) -> list[int]:
        denominator = _common_denominator(points[row])
        return [*(int(v * denominator) for v in points[row]), denominator]

    return HomogeneousRows(values, 1.0, integers, _UNIT)


def rows_of_planes(
    planes: list[ExactRow], normals: np.ndarray | None = None, offsets: np.ndarray | None = None
) -> HomogeneousRows:
    """Half-spaces, as a program reads them; behind those given as doubles (m, 3), (m,), if any are."""
    scaled = [_scaled(plane) for plane in planes]
    rows = np.array([[float(v) for v in plane] for plane in scaled]).reshape(-1, 4)
    n_first = 0
    if normals is not None and offsets is not None:
        n_first = len(normals)
        exponents = np.frexp(np.abs(normals).max(axis=1))[1]
        values = np.ldexp(np.column_stack((normals, offsets)), -exponents[:, None])
        rows = np.vstack((values, rows))

    def integers(row: int) -> list[int]:
        if row < n_first:
            return as_integers(rows[row].tolist())[0]
        denominator = _common_denominator(scaled[row - n_first])
        return [int(v * denominator) for v in scaled[row - n_first]]

    return HomogeneousRows(rows[:, :3], rows[:, 3], integers, _UNIT if planes else 0.0)


def _scaled(plane: ExactRow) -> ExactRow:
    """The same half-space, its normal of about unit length."""
    factor = Fraction(2) ** -frexp(float(max(map(abs, plane[:3]))))[1]
    return [v * factor for v in plane]


def _common_denominator(row: ExactRow) -> int:
    """Of numbers that are all integers over powers of two."""
    return max(v.denominator for v in row)
