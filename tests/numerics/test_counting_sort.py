"""Counting sort beside numpy's stable one."""

from __future__ import annotations

import numpy as np
import pytest

from collide.numerics.counting_sort import only_class, sort_by_class


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
