"""Integers of many digits inside kernels, against Python's own: run as plain Python in a child process."""

from __future__ import annotations

import os
import subprocess
import sys

CHILD = r"""
import random
from fractions import Fraction
import numpy as np
from collide.numerics import digits as D

rng = random.Random(7)

def value(X, at, n):
    return sum(int(X[at + k]) << (D.BITS * k) for k in range(n))

def random_double():
    kind = rng.random()
    if kind < 0.1:
        return 0.0
    if kind < 0.3:
        return rng.choice((-1, 1)) * rng.randrange(1, 64) * 2.0 ** rng.randrange(-40, 40)
    return rng.uniform(-1, 1) * 2.0 ** rng.randrange(-60, 40)

signs = {-1: 0, 0: 0, 1: 0}
for case in range(400):
    X = np.zeros(64, dtype=np.int64)
    terms = [random_double() for _ in range(rng.randrange(1, 5))]
    if rng.random() < 0.2:
        terms += [-t for t in terms]
    grid = min([D.grid_of(D.lowest_bit(t)) for t in terms if t] or [0])
    for t in terms:
        D.add_double(X, 0, t, grid)
    sign = D.carry(X, 0, 12)
    exact = sum(map(Fraction, terms), Fraction(0)) / Fraction(2) ** (D.BITS * grid)
    assert value(X, 0, 12) == exact, (terms, value(X, 0, 12), exact)
    assert sign == (exact > 0) - (exact < 0), terms
    assert all(0 <= X[k] < 2 ** D.BITS for k in range(11))
    number, exponent = D.as_double(X, 0, 12)
    assert number == float(exact / Fraction(2) ** exponent), terms  # Fraction → float rounds to nearest
    signs[sign] += 1

    Y = np.zeros(80, dtype=np.int64)
    a, b = (rng.randrange(-(2**100), 2**100) for _ in range(2))
    for at, number in ((0, a), (10, b)):
        rest = abs(number)
        for k in range(10):
            Y[at + k] = (rest & (2**D.BITS - 1)) * (1 if number >= 0 else -1)
            rest >>= D.BITS
        D.carry(Y, at, 10)
    D.add_product(Y, 20, 0, 10, 10, 10, 1)
    D.add_product(Y, 20, 10, 10, 10, 10, -1)
    assert D.carry(Y, 20, 20) == (a * b - b * b > 0) - (a * b - b * b < 0)
    assert value(Y, 20, 20) == a * b - b * b, (a, b)
assert min(signs.values()) > 20, signs
print("sound", signs)
"""


def test_digits_against_python_integers():
    run = subprocess.run(
        [sys.executable, "-c", CHILD], check=False, env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("sound")
