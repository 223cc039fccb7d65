"""Levels of a hierarchy by vertex, against dictionaries: births, rows, neighbours, and what left each neighbourhood."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from naive import rng_of

from collide.papers.hierarchies.level_rows import by_vertex


def random_levels(rng, points: int):
    """Shrinking sets of vertices with random neighbours; some vertices come late, in the place of a parent."""
    here = np.flatnonzero(rng.random(points) < 0.7)
    new = np.setdiff1d(np.arange(points), here)[:3]
    parent, levels = np.full(points, -1, dtype=np.int32), []
    while len(here) > 2:
        lists = [rng.choice(here, int(rng.integers(1, 6))).tolist() for _ in here]
        levels.append((here.astype(np.int32), lists))
        gone = rng.choice(here, max(1, len(here) // 3), replace=False)
        here = np.setdiff1d(here, gone)
        if len(levels) == 1:
            parent[new] = gone[0]
            here = np.sort(np.concatenate([here, new]))
    return levels, parent


def test_rows_of_every_vertex():
    rng = rng_of("level rows")
    checked = late = 0
    for _ in range(30):
        levels, parent = random_levels(rng, 30)
        packed = [
            (v, np.cumsum([0, *map(len, lists)]).astype(np.int64), np.concatenate(lists).astype(np.int32))
            for v, lists in levels
        ]
        birth, last, row, start, neighbours, removed_start, removed, level_start, level_vertices = by_vertex(
            packed, 30, parent
        )
        levels_of = {p: [k for k, (v, _) in enumerate(levels) if p in v] for p in range(30)}
        for p, known in levels_of.items():
            if not known:
                assert (birth[p], last[p], row[p]) == (-1, -1, -1)
                continue
            assert (birth[p], last[p]) == (known[0], known[-1]) and known == list(range(known[0], known[-1] + 1))
            for level in known:
                this = row[p] + level - birth[p]
                vertices, lists = levels[level]
                ring = lists[vertices.tolist().index(p)]
                assert neighbours[start[this] : start[this + 1]].tolist() == ring
                gone = removed[removed_start[this] : removed_start[this + 1]].tolist()
                if level == 0:
                    assert gone == []
                elif level == birth[p]:
                    assert gone == [parent[p]]
                    late += 1
                else:
                    finer, finer_lists = levels[level - 1]
                    before = finer_lists[finer.tolist().index(p)]
                    assert gone == [q for q in before if q not in vertices]
                checked += 1
        assert [level_vertices[a:b].tolist() for a, b in pairwise(level_start)] == [
            v.tolist() for v, _ in levels
        ]
        assert len(start) == len(removed_start) == sum(map(len, levels_of.values())) + 1
    assert checked > 600 and late > 50
