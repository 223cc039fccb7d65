"""Rows of bits, or lists, beside a set of pairs; their memory."""

from __future__ import annotations

import numpy as np
import pytest

from collide.broadphase.allowed_rows import allowed_rows
from collide.broadphase.box_tree import BoxTree

EVERYWHERE = np.array([0.0, 0, 0, 1, 1, 1])


@pytest.mark.parametrize("kind", ["neighbours", "anything", "one with all", "all", "none"])
def test_pairs_that_are_found_are_those_that_are_not_allowed(kind):
    rng, n = np.random.default_rng(1), 150
    i, j = np.triu_indices(n, 1)
    keep = {
        "neighbours": j - i <= 2, "anything": rng.random(len(i)) < 0.05, "one with all": (i == 70) | (j == 70),
        "all": i >= 0, "none": i < 0,
    }[kind]
    allowed = np.stack([i[keep], j[keep]], axis=1)
    tree = BoxTree(np.tile(EVERYWHERE, (n, 1)))
    tree.set_allowed(rng.permutation(allowed))
    assert np.array_equal(tree.pairs(0.0), np.stack([i[~keep], j[~keep]], axis=1))


def test_memory_is_that_of_the_pairs():
    """A hundred thousand bodies: robots of ten links side by side, and pairs of bodies from anywhere."""
    n, rng = 100_000, np.random.default_rng(2)
    links = np.arange(n - 1)[np.arange(n - 1) % 10 != 9]
    neighbours = np.stack([links, links + 1], axis=1)
    anywhere = np.unique(np.sort(rng.integers(0, n, (20_000, 2)), axis=1), axis=0)
    anywhere = anywhere[anywhere[:, 0] < anywhere[:, 1]]
    for pairs, limit in ((neighbours, 64), (anywhere, 96)):
        row_at, rows = allowed_rows(pairs, n)
        assert (row_at >= 0).sum() == len(np.unique(pairs))
        assert rows.nbytes <= limit * len(pairs), rows.nbytes / len(pairs)
    full = np.stack(np.triu_indices(2000, 1), axis=1)
    assert allowed_rows(full, n)[1].nbytes <= 2000 * 2000 / 8 + 2000 * 64
