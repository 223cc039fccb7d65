"""Sums and products of arrays of doubles with their rounding errors: `error_free.py` for numpy (Knuth; Dekker 1971)."""

from __future__ import annotations

import numpy as np


def array_sum(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a + b exactly, as rounded sums and their errors."""
    total = a + b
    back = total - a
    return total, (a - (total - back)) + (b - back)


def array_product(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a·b exactly unless it leaves the range of doubles, as rounded products and their errors."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _split(a), _split(b)
    return product, ((a_high * b_high - product) + a_high * b_low + a_low * b_high) + a_low * b_low


def _split(a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    wide = 134217729.0 * a  # 2²⁷ + 1
    high = wide - (wide - a)
    return high, a - high
