"""Classes of numbered things, and which way up each is, against a search through all joins."""

from __future__ import annotations

from collections import Counter

import pytest
from naive import rng_of
from reproduction import reproducing

from collide.mesh import union_find as U

pytestmark = pytest.mark.plain_kernels

SOURCE = "n, joins = {n}, {joins}  # tests/mesh/test_union_find.py"


def searched(n: int, joins) -> tuple[list[int], list[int], bool]:
    """(lowest member of everything's class, which way up it is against that one, whether the joins agree), step by
    step."""
    across: list[list[tuple[int, int]]] = [[] for _ in range(n)]
    for i, j, against in joins:
        across[i].append((j, against))
        across[j].append((i, against))
    lowest, turned, agree = [-1] * n, [0] * n, True
    for start in range(n):
        if lowest[start] >= 0:
            continue
        lowest[start], waiting = start, [start]
        for i in waiting:
            for j, against in across[i]:
                if lowest[j] < 0:
                    lowest[j], turned[j] = start, turned[i] ^ against
                    waiting.append(j)
                agree &= turned[j] == turned[i] ^ against
    return lowest, turned, agree


def random_joins(rng) -> tuple[int, list[tuple[int, int, int]]]:
    n = int(rng.integers(1, 30))
    pairs = rng.integers(0, n, size=(int(rng.integers(0, 2 * n)), 2)).tolist()
    up = rng.integers(0, 2, n).tolist()  # agreeing joins in most cases
    wrong = rng.random() < 0.3
    return n, [(i, j, int(rng.integers(0, 2)) if wrong else up[i] ^ up[j]) for i, j in pairs]


def test_classes():
    rng = rng_of("union find")
    sizes: Counter = Counter()
    for _ in range(300):
        n, joins = random_joins(rng)
        parent = list(range(n))
        with reproducing(SOURCE, n=n, joins=joins):
            for i, j, _ in joins:
                U.union(parent, i, j)
            lowest, _, _ = searched(n, joins)
            assert [U.find(parent, k) for k in range(n)] == lowest
        sizes[min(len(set(lowest)), 5)] += 1
    assert min(sizes[1], sizes[2], sizes[5]) > 10, sizes


def test_classes_with_parity():
    rng = rng_of("parity")
    contradicted = 0
    for _ in range(300):
        n, joins = random_joins(rng)
        parent, turned = list(range(n)), [0] * n
        with reproducing(SOURCE, n=n, joins=joins):
            agreed = True
            for k, (i, j, against) in enumerate(joins):
                agreed &= U.union_with_parity(parent, turned, i, j, against)
                assert agreed == searched(n, joins[: k + 1])[2]
                if not agreed:
                    break
            if agreed:
                lowest, up, _ = searched(n, joins)
                assert [U.find_with_parity(parent, turned, k) for k in range(n)] == list(zip(lowest, up))
        contradicted += not agreed
    assert 20 < contradicted < 280, contradicted
