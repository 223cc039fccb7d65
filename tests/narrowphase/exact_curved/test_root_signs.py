from __future__ import annotations

from decimal import Context, Decimal, localcontext

import numpy as np

from collide.narrowphase.exact_curved.root_signs import exact_root, sign_with_root, sign_with_roots


def test_signs_are_those_of_many_digits():
    rng = np.random.default_rng(5)
    zeros = 0
    with localcontext(Context(prec=60)):
        for _ in range(3000):
            b, c = (int(x) ** 2 if rng.random() < 0.5 else int(x) for x in rng.integers(0, 40, 2))
            a = -int(Decimal(b).sqrt() + Decimal(c).sqrt()) + int(rng.integers(-1, 2))
            value = a + Decimal(b).sqrt() + Decimal(c).sqrt()
            told = (value > Decimal("1e-40")) - (value < Decimal("-1e-40"))
            assert sign_with_roots(a, b, c) == told, (a, b, c)
            value = a + Decimal(b).sqrt()
            assert sign_with_root(a, b) == (value > Decimal("1e-40")) - (value < Decimal("-1e-40")), (a, b)
            zeros += told == 0
    assert zeros > 100


def test_roots_of_squares_alone_are_whole():
    big = 3**200
    assert exact_root(big * big) == big and exact_root(big * big + 1) is None and exact_root(0) == 0
