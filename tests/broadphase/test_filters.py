"""How many pairs are never tested, and why: against all pairs one by one."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
from naive import rng_of

from collide.broadphase.filters import ASLEEP, MASKED, STATIC, count_skipped


def one_by_one(static, group, mask, asleep, allowed) -> dict[str, int]:
    counted: Counter = Counter()
    for i, j in combinations(range(len(static)), 2):
        if static[i] and static[j]:
            counted[STATIC] += 1
        elif not (group[i] & mask[j]) or not (group[j] & mask[i]):
            counted[MASKED] += 1
        elif (i, j) in allowed:
            counted[allowed[i, j]] += 1
        elif (static[i] or asleep[i]) and (static[j] or asleep[j]):
            counted[ASLEEP] += 1
    return dict(counted)


def test_every_pair_is_counted_once():
    rng = rng_of("filters")
    seen: set[str] = set()
    for _ in range(60):
        n = int(rng.integers(0, 25))
        static = rng.random(n) < 0.4
        group, mask = (1 << rng.integers(0, 3, n)), rng.integers(0, 8, n)
        pairs = [p for p in combinations(range(n), 2) if rng.random() < 0.2]
        allowed = {p: str(rng.choice(["adjacent", "never in collision"])) for p in pairs}
        asleep = rng.random(n) < 0.3
        columns = static, group.astype(np.int64), mask.astype(np.int64), asleep
        found = count_skipped(*columns, np.array(pairs, dtype=np.int64).reshape(-1, 2), list(allowed.values()))
        assert found == one_by_one(*columns, allowed), (columns, allowed)
        seen |= set(found)
    assert seen == {STATIC, MASKED, ASLEEP, "adjacent", "never in collision"}


def test_many_combinations_are_counted_in_blocks():
    """Every body in a group of its own: as many combinations as bodies."""
    n = 700
    columns = np.zeros(n, dtype=np.int64), np.arange(1, n + 1), np.arange(n, 0, -1), np.arange(n) % 7 == 0
    none = np.empty((0, 2), dtype=np.int64)
    assert count_skipped(*columns, none, []) == one_by_one(*columns, {})
