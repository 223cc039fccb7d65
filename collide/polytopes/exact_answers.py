"""A `NearestPair` in the units of the input: rounded points, a proven bracket of the distance, the certificate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Literal

import numpy as np

from collide.least_distance.input_rows import InputRows
from collide.least_distance.nearest_pair import APART, EMPTY, MEETING, NearestPair
from collide.polytopes.meeting import Meeting, MeetingCertificate

_KINDS: dict[str, Literal["common point", "separating plane", "contradiction"]] = {
    MEETING: "common point", APART: "separating plane", EMPTY: "contradiction",
}  # fmt: skip


def make_meeting(
    pair: NearestPair, rows: InputRows, normals: np.ndarray, counters: Mapping[str, int | str]
) -> Meeting:
    """The answer that an exact pair amounts to.

    Parameters
    ----------
    pair : NearestPair
        Of all rows.
    rows : InputRows
        What was asked.
    normals : (m, d) float64
        As they were given.
    counters : mapping
        What was done.
    """
    certificate = _certificate(pair, rows, normals)
    if pair.kind == EMPTY:
        return Meeting(False, None, math.inf, None, None, None, math.inf, math.inf, certificate, counters)
    unit = Fraction(2) ** rows.exponent / pair.denominator
    y, x = _rounded(pair.y, unit), _rounded(pair.x, unit)
    if pair.kind == MEETING:
        return Meeting(True, x, 0.0, y, x, None, 0.0, 0.0, certificate, counters)
    lower, upper = root_bracket(sum(number * number for number in pair.u) * unit * unit)
    return Meeting(False, None, upper, y, x, _direction(pair.u), lower, upper, certificate, counters)


def _certificate(pair: NearestPair, rows: InputRows, normals: np.ndarray) -> MeetingCertificate:
    weights = sorted((row, Fraction(weight, pair.denominator)) for row, weight in zip(pair.points, pair.weights))
    multipliers = []
    if pair.kind != MEETING:
        unit = Fraction(2) ** rows.exponent / pair.denominator
        for row, multiplier in sorted(zip(pair.halfspaces, pair.multipliers)):
            axis = int(np.argmax(np.abs(normals[row])))
            factor = Fraction(rows.halfspaces.integers(row)[axis]) / Fraction(float(normals[row, axis]))
            multipliers.append((row, multiplier * factor * unit))
    return MeetingCertificate(
        _KINDS[pair.kind], tuple(row for row, _ in weights), tuple(weight for _, weight in weights),
        tuple(row for row, _ in multipliers), tuple(multiplier for _, multiplier in multipliers),
    )  # fmt: skip


def _rounded(numerators: list[int], unit: Fraction) -> np.ndarray:
    return np.array([_as_double(number * unit) for number in numerators])


def _as_double(value: Fraction) -> float:
    """The nearest double; a fraction beyond the doubles is given as the largest."""
    try:
        return value.numerator / value.denominator
    except OverflowError:
        return math.copysign(1.7976931348623157e308, value)


def _direction(u: list[int]) -> np.ndarray:
    """−u/|u| to some units in the last place, whatever the size of its integers."""
    bits = max(abs(number) for number in u).bit_length()
    vector = np.array([-number / (1 << bits) for number in u])
    return vector / np.linalg.norm(vector) + 0.0


def root_bracket(square: Fraction) -> tuple[float, float]:
    """Two doubles, equal or next to each other, with the square root of a fraction > 0 between them."""
    shift = 128 - (square.numerator.bit_length() - square.denominator.bit_length())
    shift += shift % 2
    scaled = math.isqrt(int(square * Fraction(2) ** shift))
    middle = _as_double(Fraction(scaled) / Fraction(2) ** (shift // 2))
    lower = upper = middle
    while Fraction(lower) ** 2 > square:
        lower = math.nextafter(lower, 0.0)
    while Fraction(upper) ** 2 < square:
        upper = math.nextafter(upper, math.inf)
    if Fraction(math.nextafter(lower, math.inf)) ** 2 <= square:
        lower = math.nextafter(lower, math.inf)
    return lower, upper
