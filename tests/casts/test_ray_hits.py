"""Events along rays put in order and made answers of, against loops over Python lists."""

from __future__ import annotations

import math

import numpy as np
import pytest
from naive import rng_of

from collide.casts.directions import Directions
from collide.casts.ray_hits import RayEvents, as_hits, first_of_each, in_order, joined


def drawn(rng, n_rays: int, k: int, all_proven: bool = False) -> RayEvents:
    """Events with many ties of t, brackets that overlap, and open ones."""
    t = rng.integers(0, 6, k).astype(float)
    wide = rng.choice([0.0, 0.5, 1.5], (k, 2))
    proven = np.ones(k, dtype=bool) if all_proven else rng.random(k) < 0.7
    return RayEvents(
        rng.integers(0, n_rays, k), np.stack([t, np.maximum(t - wide[:, 0], 0.0), t + wide[:, 1]], axis=1),
        rng.normal(size=(k, 3)), rng.integers(0, 4, k), rng.integers(0, 3, k), proven, proven & (rng.random(k) < 0.7),
    )


def as_lists(events: RayEvents) -> list[tuple]:
    return list(zip(*(column.tolist() for column in events)))


def test_order_is_that_of_sorted_lists():
    rng = rng_of("order of events")
    for _ in range(20):
        parts = [drawn(rng, 4, k) for k in (0, 3, 9)]
        events = joined(parts)
        assert as_lists(events) == [row for part in parts for row in as_lists(part)]
        rows = as_lists(events)
        expected = sorted(range(len(rows)), key=lambda i: (rows[i][0], rows[i][1][0], rows[i][4], rows[i][3], i))
        assert as_lists(in_order(events)) == [rows[i] for i in expected]
        some = np.array([2, 0, 5])
        assert as_lists(events.of(some)) == [rows[i] for i in some.tolist()]


def naive_first(rows: list[tuple]) -> tuple:
    """The first of one ray's rows: brackets hold what is proven to come first, whichever row that is."""
    _, t, normal, facet, item, _, _ = rows[0]
    lower = min(row[1][1] for row in rows)
    proven = [row[1][2] for row in rows if row[5]]
    upper = min(proven) if proven else max(row[1][2] for row in rows)
    certified = all(row[6] for row in rows if row[1][1] <= upper)
    return rows[0][0], [t[0], lower, upper], normal, facet, item, bool(proven), certified


def test_first_of_each_ray():
    rng, n_open = rng_of("first events"), 0
    for _ in range(60):
        events = in_order(drawn(rng, 5, int(rng.integers(0, 14))))
        rows = as_lists(events)
        by_ray = [[row for row in rows if row[0] == ray] for ray in range(5)]
        expected = [naive_first(of_ray) if len(rows) > len({row[0] for row in rows}) else of_ray[0]
                    for of_ray in by_ray if of_ray]
        assert as_lists(first_of_each(events)) == expected
        n_open += sum(not row[5] for row in expected)
    assert n_open > 20


@pytest.mark.parametrize("every", [False, True])
def test_answers_of_events(every):
    rng = rng_of("hits", every)
    n = 6
    events = in_order(drawn(rng, n - 1, 12, all_proven=True))  # the last ray meets nothing
    origins = rng.normal(size=(n, 3))
    directions = Directions(rng.uniform(0.5, 0.9, (n, 3)), rng.integers(-3, 4, n))
    hits = as_hits(events, origins, directions, every=every, single=False)
    rows = as_lists(events if every else first_of_each(events))
    met = {row[0] for row in rows}
    assert hits.hit.tolist() == [ray in met for ray in range(n)] and not hits.hit[-1]
    if every:
        assert hits.starts.tolist() == [sum(row[0] < ray for row in rows) for ray in range(n + 1)]
    else:
        assert hits.starts is None
    for k, (ray, t, normal, facet, item, _, certified) in enumerate(rows):
        at = k if every else ray
        assert [hits.distance[at], hits.lower[at], hits.upper[at]] == t and hits.normal[at].tolist() == normal
        assert (hits.facet[at], hits.item[at], hits.certified[at]) == (facet, item, certified)
        step = directions.vectors[ray] * 2.0 ** directions.exponents[ray]
        np.testing.assert_allclose(hits.point[at], origins[ray] + t[0] * step, rtol=0, atol=1e-13)
    if not every:
        assert math.isinf(hits.distance[-1]) and math.isinf(hits.lower[-1]) and math.isinf(hits.upper[-1])
        assert hits.facet[-1] == hits.item[-1] == -1 and hits.certified[-1]
        assert not hits.point[-1].any() and not hits.normal[-1].any()


def test_single_rays_give_scalars():
    rng = rng_of("single hit")
    directions = Directions(np.array([[0.5, 0.0, 0.0]]), np.array([1]))
    one = in_order(drawn(rng, 1, 1))
    for events in (one, one.of(np.zeros(0, dtype=np.int64))):
        hits = as_hits(events, np.zeros((1, 3)), directions, every=False, single=True)
        assert isinstance(bool(hits.hit), bool) and np.ndim(hits.distance) == 0 and hits.point.shape == (3,)
        assert bool(hits.hit) == (len(events.ray) == 1)
