"""The lowest set bit of doubles: what says on which grid of powers of two numbers are integers."""

from __future__ import annotations

import numpy as np

#: Stands for the exponent of the lowest set bit where no bit is set.
NO_BITS = 2000


def lowest_exponents(values: np.ndarray) -> np.ndarray:
    """Along the last axis, the exponent of the lowest set bit among doubles; NO_BITS where all are 0."""
    fraction, exponent = np.frexp(values)
    mantissa = (fraction * 2.0**53).astype(np.int64)
    lowest = exponent - 53 + np.frexp((mantissa & -mantissa).astype(float))[1] - 1
    return np.where(values != 0.0, lowest, NO_BITS).min(axis=-1)
