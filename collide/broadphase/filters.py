"""Which pairs are never tested, and how many of each kind there were."""

from __future__ import annotations

import numpy as np

STATIC, MASKED, CULLED = "static–static", "filtered by group and mask", "broadphase"


def count_skipped(static: np.ndarray, group: np.ndarray, mask: np.ndarray, allowed: dict) -> dict[str, int]:
    """Pairs of n bodies that no query tests, by reason; each pair is counted once.

    static, group, mask : (n,).   allowed : {(i, j): reason} with i < j, positions of bodies.

    Precedence: static–static, then group and mask, then the reason a pair was allowed for. Counted
    over the distinct combinations of static, group and mask, not over all pairs.
    """
    skipped: dict[str, int] = {}
    classes, inverse, sizes = np.unique(
        np.stack([static.astype(np.int64), group, mask], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    inverse = inverse.reshape(-1)
    verdict = {}
    for a in range(len(classes)):
        for b in range(a, len(classes)):
            verdict[a, b] = why = _excluded(classes[a], classes[b])
            if why:
                n_pairs = sizes[a] * (sizes[a] - 1) // 2 if a == b else sizes[a] * sizes[b]
                if n_pairs:
                    skipped[why] = skipped.get(why, 0) + int(n_pairs)
    for (i, j), reason in allowed.items():
        a, b = sorted((int(inverse[i]), int(inverse[j])))
        if not verdict[a, b]:
            skipped[reason] = skipped.get(reason, 0) + 1
    return skipped


def _excluded(a: np.ndarray, b: np.ndarray) -> str | None:
    if a[0] and b[0]:
        return STATIC
    if not (a[1] & b[2]) or not (b[1] & a[2]):
        return MASKED
    return None
