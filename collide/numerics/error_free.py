"""Error-free transformations: sums and products of doubles with their rounding errors, themselves doubles.

D. E. Knuth's sum and T. J. Dekker's product ("A floating-point technique for extending the available precision", 1971),
from which exact signs and double-doubles are built. Compiled, the error of a product is a single fused instruction
instead of Dekker's sixteen.
"""

from __future__ import annotations

from typing import NamedTuple

from collide.kernels import WITH_NUMBA, kernel


class DD(NamedTuple):
    """A double-double: the unevaluated sum of two doubles, or of two `Lanes`, |low| at most half an ulp of high."""

    high: float
    low: float


@kernel(inline=True)
def two_sum(a, b):
    """a + b exactly, as the rounded sum and its error (Knuth)."""
    total = a + b
    b_rounded = total - a
    return DD(total, (a - (total - b_rounded)) + (b - b_rounded))


@kernel
def dekker_product(a, b):
    """`two_product` by sums and products alone (Dekker, Veltkamp)."""
    product = a * b
    wide = 134217729.0 * a  # 2²⁷ + 1
    a_high = wide - (wide - a)
    a_low = a - a_high
    wide = 134217729.0 * b
    b_high = wide - (wide - b)
    b_low = b - b_high
    return DD(product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low))


if not WITH_NUMBA:
    two_product = dekker_product
else:
    from collide.kernels.compiled_lanes import product_error

    @kernel(inline=True)
    def two_product(a, b):
        """a·b exactly unless it underflows, as the rounded product and its error."""
        product = a * b
        return DD(product, product_error(a, b, product))
