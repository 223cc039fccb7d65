"""Counting sort beside numpy's stable one."""

from __future__ import annotations

import numpy as np
import pytest

from collide.numerics.counting_sort import only_class, order_by_key, order_by_merging, sort_by_class


@pytest.mark.plain_kernels
@pytest.mark.parametrize("n_classes", [1, 2, 9])
def test_a_range_is_ordered_by_class_as_it_stood(n_classes):
    rng, n_only = np.random.default_rng(n_classes), 0
    for _ in range(60):
        n = int(rng.integers(1, 40))
        first, last = sorted(rng.integers(0, n + 1, 2).tolist())
        items = rng.permutation(n)
        classes = rng.integers(0, n_classes, n) if rng.random() < 0.7 else np.full(n, rng.integers(n_classes))
        wanted = items.copy()
        wanted[first:last] = items[first:last][np.argsort(classes[first:last], kind="stable")]
        found = np.unique(classes[first:last])
        scratch, counts = np.concatenate([classes, np.zeros(n, dtype=np.int64)]), np.zeros(2 * n_classes, np.int64)
        sort_by_class(items, first, last, n_classes, scratch, counts)
        only = only_class(counts, n_classes, last - first)
        assert np.array_equal(items, wanted), f"n={n}; first={first}; last={last}; classes={classes.tolist()}"
        assert np.array_equal(counts[:n_classes], np.bincount(classes[first:last], minlength=n_classes))
        if first < last:
            assert only == (found[0] if len(found) == 1 else -1)
            n_only += len(found) == 1
    assert n_only > 5


@pytest.mark.plain_kernels
@pytest.mark.parametrize("n, n_keys", [(0, 1), (1, 1), (7, 3), (50, 4), (50, 1000), (333, 10)])
def test_orders_are_stable(n, n_keys):
    rng = np.random.default_rng(n + n_keys)
    keys, items = rng.integers(0, n_keys, n), rng.permutation(n)
    starts, ordered, order, scratch = np.zeros(n_keys + 1, int), *np.zeros((3, n), int)
    order_by_key(keys, items, n, n_keys, starts, ordered)
    assert np.array_equal(ordered, items[np.argsort(keys[items], kind="stable")])
    assert np.array_equal(starts, np.searchsorted(np.sort(keys), np.arange(n_keys + 1)))
    order_by_merging(keys, n, order, scratch)
    assert np.array_equal(order, np.argsort(keys, kind="stable"))
