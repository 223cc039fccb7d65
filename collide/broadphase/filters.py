"""Filters of pairs never tested, and the number of pairs of each reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

STATIC, MASKED, ASLEEP, CULLED = "static–static", "filtered by group and mask", "sleeping", "broadphase"
#: Combinations of static, group, mask and sleeping that are compared with each other at once.
_BLOCK = 256


def count_skipped(
    static: np.ndarray, group: np.ndarray, mask: np.ndarray, asleep: np.ndarray, allowed: np.ndarray,
    reasons: Sequence[str],
) -> dict[str, int]:
    """The number of untested pairs of n bodies, by reason; each pair is counted once.

    static, group, mask, asleep : (n,).   allowed : (k, 2) bodies, each pair once.   reasons : (k,) of the allowed
        pairs.

    Precedence: static–static, then group and mask, then the reason a pair was allowed for, then that both are asleep
    or static. Counted over the distinct combinations of the four, not over all pairs.
    """
    traits = np.stack([static.astype(np.int64), group, mask, (asleep | (static != 0)).astype(np.int64)], axis=1)
    classes, inverse, sizes = np.unique(traits, axis=0, return_inverse=True, return_counts=True)
    inverse = inverse.reshape(-1)
    skipped: Counter[str] = Counter()
    for start in range(0, len(classes), _BLOCK):
        block = np.arange(start, min(start + _BLOCK, len(classes)))
        pairs = sizes[block, None] * sizes[None]
        pairs[block - start, block] = sizes[block] * (sizes[block] - 1) // 2
        pairs[np.arange(len(classes))[None] < block[:, None]] = 0  # each two classes once
        for reason, applies in _exclusions(classes[block][:, None], classes[None]).items():
            skipped[reason] += int(pairs[applies].sum())
    by_class = _exclusions(classes[inverse[allowed[:, 0]]], classes[inverse[allowed[:, 1]]])
    remains = ~(by_class[STATIC] | by_class[MASKED])
    skipped.update(reasons[k] for k in np.flatnonzero(remains).tolist())
    skipped[ASLEEP] -= int(by_class[ASLEEP].sum())  # counted as allowed
    return {reason: count for reason, count in skipped.items() if count}


def _exclusions(a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
    """{reason: bool array}, from traits (…, 4) of both bodies of each pair; at most the first reason of a pair is
    True.
    """
    both_static = (a[..., 0] != 0) & (b[..., 0] != 0)
    masked = ((a[..., 1] & b[..., 2]) == 0) | ((b[..., 1] & a[..., 2]) == 0)
    still = (a[..., 3] != 0) & (b[..., 3] != 0)
    return {STATIC: both_static, MASKED: masked & ~both_static, ASLEEP: still & ~masked & ~both_static}
