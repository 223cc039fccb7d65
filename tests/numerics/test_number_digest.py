"""Digests worked out in a kernel are those of hashlib."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from naive import rng_of

from collide.kernels import address_of
from collide.numerics.number_digest import DIGEST_WORDS, digest_numbers

#: (words, doubles, integers): none, about one block, several blocks, halves of words.
LENGTHS = [
    (0, 0, 0), (6, 0, 0), (6, 3, 0), (6, 10, 0), (6, 11, 0), (0, 15, 1), (0, 15, 2), (0, 15, 3), (0, 16, 32),
    (0, 9, 33), (6, 3000, 0), (0, 900, 101),
]


@pytest.mark.parametrize("n_head, n_doubles, n_integers", LENGTHS)
def test_digests_are_those_of_hashlib(n_head, n_doubles, n_integers):
    """Of doubles −0.0 counts as 0.0, of words before them not."""
    rng = rng_of("digest", n_head, n_doubles, n_integers)
    for _ in range(5):
        head, doubles = rng.normal(size=n_head), rng.normal(size=n_doubles)
        head[head < -1.0], doubles[doubles < -1.0] = -0.0, -0.0
        integers = rng.integers(-(2**31), 2**31, n_integers).astype(np.int32)
        found, memory = np.zeros(2, dtype=np.int64), np.empty(DIGEST_WORDS + 1, dtype=np.int64)
        memory[-1] = 77
        with np.errstate(over="ignore"):  # words wrap around where kernels run as Python
            digest_numbers(
                address_of(head), n_head, address_of(doubles), n_doubles, address_of(integers), n_integers,
                address_of(memory), address_of(found),
            )
        true = hashlib.blake2b(head.tobytes() + (doubles + 0.0).tobytes() + integers.tobytes(), digest_size=16)
        assert found.tobytes() == true.digest() and memory[-1] == 77
