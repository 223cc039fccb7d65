"""Python's integers into and out of the runs of digits that kernels count in (collide/numerics/digits.py)."""

from __future__ import annotations

from collide.numerics.digits import BITS, carry


def number_at(digits, at: int, n: int) -> int:
    return sum(int(digits[at + k]) << (BITS * k) for k in range(n))


def put_number(digits, at: int, n: int, number: int) -> None:
    for k in range(n):
        digits[at + k] = (abs(number) >> (BITS * k) & (2**BITS - 1)) * (1 if number >= 0 else -1)
    carry(digits, at, n)
