"""Signs of sums with square roots of integers: nothing is rounded."""

from __future__ import annotations

from math import isqrt


def sign(a: int) -> int:
    return (a > 0) - (a < 0)


def sign_with_root(a: int, b: int) -> int:
    """The sign of a + √b, b ≥ 0: for a < 0 that of b − a²."""
    return sign(a + b) if a >= 0 else sign(b - a * a)


def sign_with_roots(a: int, b: int, c: int) -> int:
    """The sign of a + √b + √c, b and c ≥ 0.

    For a < 0 both sides of √b + √c against −a are squared: 2 √(b c) against d = a² − b − c, and once more.
    """
    if a >= 0 or b == 0 or c == 0:
        return sign_with_root(a, b + c) if a < 0 else sign(a + b + c)
    d = a * a - b - c
    return 1 if d < 0 else sign(4 * b * c - d * d)


def exact_root(b: int) -> int | None:
    """√b where it is whole."""
    root = isqrt(b)
    return root if root * root == b else None
