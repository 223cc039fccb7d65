"""A `NearestPair` in the units of the input: rounded points, a proven bracket of the distance, the certificate."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Literal

import numpy as np

from collide.least_distance.input_rows import InputRows
from collide.least_distance.nearest_pair import APART, EMPTY, MEETING, NearestPair
from collide.papers.polytopes.meeting import Meeting, MeetingCertificate

_KINDS: dict[str, Literal["common point", "separating plane", "contradiction"]] = {
    MEETING: "common point", APART: "separating plane", EMPTY: "contradiction",
}


def make_meeting(pair: NearestPair, rows: InputRows, counters: Mapping[str, int | str]) -> Meeting:
    """The answer that an exact pair amounts to.

    Parameters
    ----------
    pair : NearestPair
        Of all rows.
    rows : InputRows
        What was asked.
    counters : mapping
        What was done.
    """
    up, down = 1 << max(rows.exponent, 0), pair.denominator << max(-rows.exponent, 0)
    certificate = _certificate(pair, rows, up, down)
    if pair.kind == EMPTY:
        return Meeting(False, None, math.inf, None, None, None, math.inf, math.inf, certificate, counters)
    x = np.array([_as_double(number * up, down) for number in pair.x])
    y = np.array([_as_double(number * up, down) for number in pair.y])
    if pair.kind == MEETING:
        return Meeting(True, x, 0.0, y, x, None, 0.0, 0.0, certificate, counters)
    lower, upper = root_bracket(sum(number * number for number in pair.u) * up * up, down * down)
    return Meeting(False, None, upper, y, x, _direction(pair.u), lower, upper, certificate, counters)


def _certificate(pair: NearestPair, rows: InputRows, up: int, down: int) -> MeetingCertificate:
    weights = sorted(zip(pair.points, pair.weights))
    multipliers = sorted(zip(pair.halfspaces, pair.multipliers)) if pair.kind != MEETING else []
    return MeetingCertificate(
        _KINDS[pair.kind], tuple(row for row, _ in weights),
        tuple(Fraction(weight, pair.denominator) for _, weight in weights), tuple(row for row, _ in multipliers),
        tuple(Fraction(number * _factor(rows, row) * up, down) for row, number in multipliers),
    )


def _factor(rows: InputRows, row: int) -> int:
    """By what a half-space was multiplied to become integers."""
    numbers = rows.normals[row].tolist()
    axis = next(k for k, number in enumerate(numbers) if number)
    numerator, denominator = numbers[axis].as_integer_ratio()
    return rows.halfspaces.integers(row)[axis] * denominator // numerator


def _as_double(numerator: int, denominator: int) -> float:
    """The nearest double; a fraction beyond the doubles is given as the largest."""
    try:
        return numerator / denominator
    except OverflowError:
        return math.copysign(1.7976931348623157e308, numerator)


def _direction(u: list[int]) -> np.ndarray:
    """−u/|u| to some units in the last place, whatever the size of its integers."""
    bits = max(abs(number) for number in u).bit_length()
    vector = np.array([-number / (1 << bits) for number in u])
    return vector / math.sqrt(vector @ vector) + 0.0


def root_bracket(numerator: int, denominator: int) -> tuple[float, float]:
    """Two doubles, equal or next to each other, with the square root of a fraction > 0 between them."""
    shift = 128 - (numerator.bit_length() - denominator.bit_length())
    shift += shift % 2
    scaled = math.isqrt((numerator << max(shift, 0)) // (denominator << max(-shift, 0)))
    half = shift // 2
    middle = _as_double(scaled << max(-half, 0), 1 << max(half, 0))

    def compared(x: float) -> int:
        above, below = x.as_integer_ratio()
        return above * above * denominator - numerator * below * below

    lower = upper = middle
    while compared(lower) > 0:
        lower = math.nextafter(lower, 0.0)
    while compared(upper) < 0:
        upper = math.nextafter(upper, math.inf)
    if compared(math.nextafter(lower, math.inf)) <= 0:
        lower = math.nextafter(lower, math.inf)
    return lower, upper
