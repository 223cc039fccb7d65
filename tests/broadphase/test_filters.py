"""How many pairs are never tested, and why: against all pairs one by one."""

from __future__ import annotations

from collections import Counter
from itertools import combinations

import numpy as np
from naive import rng_of

from collide.broadphase.filters import MASKED, STATIC, count_skipped


def one_by_one(static, group, mask, allowed) -> dict[str, int]:
    counted: Counter = Counter()
    for i, j in combinations(range(len(static)), 2):
        if static[i] and static[j]:
            counted[STATIC] += 1
        elif not (group[i] & mask[j]) or not (group[j] & mask[i]):
            counted[MASKED] += 1
        elif (i, j) in allowed:
            counted[allowed[i, j]] += 1
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
        arguments = static, group.astype(np.int64), mask.astype(np.int64), allowed
        found = count_skipped(*arguments)
        assert found == one_by_one(*arguments), arguments
        seen |= set(found)
    assert seen == {STATIC, MASKED, "adjacent", "never in collision"}
