"""Check the certificate of a `Meeting` by substitution in integers and fractions; nothing of the engine is used."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

from collide.certificates.certificate import CertificateRefused
from collide.papers.polytopes.meeting import Meeting, MeetingCertificate
from collide.papers.polytopes.verified_arguments import as_answer, as_halfspaces, as_points

#: Rows turned into integers at a time.
_BLOCK = 65_536


def verify(points: ArrayLike, normals: ArrayLike, offsets: ArrayLike, answer: Meeting) -> None:
    """Check an answer of `meets` against the input, row by row, in integers.

    Parameters
    ----------
    points : (n, d) array_like, float64
        As they were handed to `meets` [any unit of length].
    normals : (m, d) array_like, float64
        As they were handed to `meets`.
    offsets : (m,) array_like, float64
        As they were handed to `meets` [units of normals·points].
    answer : Meeting
        Whose ``hit``, ``lower``, ``upper`` and ``certificate`` are checked.

    Raises
    ------
    CertificateRefused
        With the reason, where the certificate does not prove the answer.

    Notes
    -----
    A common point: its weights are positive and of sum 1, and Σ weights·points satisfies every half-space. A miss: the
    combination u·x ≤ c of half-spaces is exceeded by every point; |u·p − c|/|u| of the nearest one bounds ``lower``,
    the distance of Σ weights·points from its projection on the plane, which every half-space holds, bounds ``upper``.
    O((n + m) d) operations on integers, some microseconds a row.
    """
    p = as_points("verify", points)
    a, b = as_halfspaces("verify", normals, offsets, p.shape[1])
    certificate = as_answer("verify", "answer", answer, Meeting).certificate
    _check_form(certificate, len(p), len(a), p.shape[1])
    if certificate.kind == "common point":
        _check(answer.hit and answer.lower == answer.upper == answer.distance == 0.0, "a common point is a hit at 0")
        _check_inside(_combination(certificate.points, certificate.weights, p), a, b)
        return
    _check(not answer.hit, "a hit is proven by a common point")
    u = _combination(certificate.halfspaces, certificate.multipliers, a)
    c = _combination(certificate.halfspaces, certificate.multipliers, b[:, None])[0]
    if certificate.kind == "contradiction":
        _check(not any(u) and c < 0, "the combination of half-spaces is no contradiction")
        _check(answer.lower == answer.upper == answer.distance == math.inf, "no distance from an empty set")
        return
    _check(any(u), "the plane has no normal")
    _check_bracket(answer, p, a, b, u, c)


def _check(condition: bool, reason: str) -> None:
    if not condition:
        raise CertificateRefused(f"meets: {reason}")


def _check_form(certificate: MeetingCertificate, n: int, m: int, d: int) -> None:
    """Rows exist and are different, weights positive and of sum 1, no more of them than Carathéodory needs."""
    kinds = {"common point": (d + 1, 0), "separating plane": (d, d), "contradiction": (0, d + 1)}
    _check(certificate.kind in kinds, f"no certificate is a {certificate.kind!r}")
    max_points, max_halfspaces = kinds[certificate.kind]
    for name, rows, numbers, count, max_rows in (
        ("points", certificate.points, certificate.weights, n, max_points),
        ("half-spaces", certificate.halfspaces, certificate.multipliers, m, max_halfspaces),
    ):
        _check(len(rows) == len(numbers) == len(set(rows)), f"{name} and their numbers do not match")
        _check(len(rows) <= max_rows, f"{len(rows)} {name} where {max_rows} are enough")
        _check(all(type(row) is int and 0 <= row < count for row in rows), f"no such {name}: {rows}")
        _check(all(isinstance(number, (int, Fraction)) and number > 0 for number in numbers), "a number is not > 0")
    if max_points:
        _check(sum(certificate.weights) == 1, "weights do not sum to 1")


def _combination(rows, numbers, values: np.ndarray) -> list[Fraction]:
    """Σ numbers·rows, exactly."""
    sums = [Fraction(0)] * values.shape[1]
    for row, number in zip(rows, numbers):
        sums = [total + number * Fraction(value) for total, value in zip(sums, values[row].tolist())]
    return sums


def _check_inside(x: list[Fraction], a: np.ndarray, b: np.ndarray) -> None:
    highest, row = largest_value(np.column_stack((a, b)), [*x, Fraction(-1)])
    _check(highest <= 0, f"half-space {row} does not hold the point")


def _check_bracket(answer: Meeting, p: np.ndarray, a: np.ndarray, b: np.ndarray, u: list[Fraction], c: Fraction):
    negated, row = largest_value(p, [-number for number in u])
    gap, square = -negated - c, sum(number * number for number in u)
    _check(gap > 0, f"the plane does not separate point {row} from the half-spaces")
    _check(0.0 <= answer.lower <= answer.distance <= answer.upper < math.inf, "lower ≤ distance ≤ upper fails")
    _check(Fraction(answer.lower) ** 2 * square <= gap * gap, "the distance may be less than lower")
    y = _combination(answer.certificate.points, answer.certificate.weights, p)
    share = (sum(number * value for number, value in zip(u, y)) - c) / square
    x = [value - share * number for value, number in zip(y, u)]
    _check_inside(x, a, b)
    _check(share * share * square <= Fraction(answer.upper) ** 2, "the two points are farther apart than upper")


def largest_value(values: np.ndarray, function: list[Fraction]) -> tuple[Fraction, int]:
    """The largest value of a linear function over rows of doubles, exactly, and the first row with the largest
    value.
    """
    common = math.lcm(*(number.denominator for number in function))
    factors = [number.numerator * (common // number.denominator) for number in function]
    best, best_row = Fraction(0), -1
    for start in range(0, len(values), _BLOCK):
        block = values[start : start + _BLOCK]
        mantissas, exponents = np.frexp(block)
        whole = np.ldexp(mantissas, 53).astype(np.int64)
        lowest = int(exponents[whole != 0].min()) if whole.any() else 0
        shifts = np.where(whole != 0, exponents - lowest, 0).astype(object)
        total = sum((whole[:, k].astype(object) << shifts[:, k]) * factors[k] for k in range(block.shape[1]))
        row = int(np.argmax(total))
        value = Fraction(total[row]) * Fraction(2) ** (lowest - 53) / common
        if best_row < 0 or value > best:
            best, best_row = value, start + row
    return best, best_row
