"""Sines and cosines in decimals, by Taylor's series."""

from __future__ import annotations

from decimal import Decimal, localcontext

PI = Decimal("3.14159265358979323846264338327950288419716939937510582097494459230781640628620899")


def decimal_sine_cosine(x: float) -> tuple[Decimal, Decimal]:
    with localcontext() as context:
        context.prec = 70
        angle = Decimal(x)
        angle -= (angle / (2 * PI)).to_integral_value() * 2 * PI
        sine = cosine = Decimal(0)
        term = Decimal(1)
        for k in range(60):
            if k % 2 == 0:
                cosine += term if k % 4 == 0 else -term
            else:
                sine += term if k % 4 == 1 else -term
            term = term * angle / (k + 1)
        return sine, cosine
