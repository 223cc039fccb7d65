"""Sums and products of doubles with the error they make, which is a double too.

D. E. Knuth's sum and T. J. Dekker's product ("A floating-point technique for extending the available
precision", 1971): what exact signs and double-doubles are built from. Compiled, the error of a product is one
fused instruction instead of Dekker's sixteen.
"""

from __future__ import annotations

from collide.kernels import WITH_NUMBA, kernel


@kernel(inline=True)
def two_sum(a, b):
    """(s, e): s = a + b rounded, s + e = a + b exactly (Knuth)."""
    total = a + b
    other = total - a
    return total, (a - (total - other)) + (b - other)


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
    return product, a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)


if not WITH_NUMBA:
    two_product = dekker_product
else:
    from collide.kernels.compiled_lanes import product_error

    @kernel(inline=True)
    def two_product(a, b):
        """(p, e): p = a·b rounded, p + e = a·b exactly unless it underflows."""
        product = a * b
        return product, product_error(a, b, product)
