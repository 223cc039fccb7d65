"""The allowed-collision matrix as rows of bits: only bodies with allowed pairs have a row, over the range of their
partners alone.

A row of partners far apart in number would be mostly zeros and is a sorted list instead. Memory is a small multiple of
the number of allowed pairs in both forms.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import kernel

# A row: the first partner (down to a multiple of 64), how many words follow, and whether these are bits or a list.
_FIRST, _WORDS, _IS_LIST = 0, 1, 2
_HEAD = 3
#: A row of bits has at most this many words more than its number of partners.
_SPARE_WORDS = 4


@kernel(inline=True)
def is_allowed(rows, at, body):
    """Whether a body's row, which begins at ``at``, holds another body."""
    first, n = rows[at + _FIRST], rows[at + _WORDS]
    if rows[at + _IS_LIST] == 0:
        bit = body - first
        return 0 <= bit < 64 * n and ((rows[at + _HEAD + (bit >> 6)] >> (bit & 63)) & 1) != 0
    low, high = 0, n
    while low < high:
        middle = (low + high) >> 1
        if rows[at + _HEAD + middle] < body:
            low = middle + 1
        else:
            high = middle
    return low < n and rows[at + _HEAD + low] == body


def allowed_rows(pairs: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """((n,) where each body's row begins, −1 for bodies without allowed pairs; the rows in sequence), int64.

    pairs : (k, 2) bodies never tested with each other, each pair once.
    """
    row_at = np.full(n, -1, dtype=np.int64)
    if not len(pairs):
        return row_at, np.zeros(1, dtype=np.int64)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    owner, partner = both[np.lexsort((both[:, 1], both[:, 0]))].T
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    counts = np.diff(starts, append=len(owner))
    first = partner[starts] & ~63
    n_words = ((partner[starts + counts - 1] - first) >> 6) + 1
    is_list = n_words > counts + _SPARE_WORDS
    n_words = np.where(is_list, counts, n_words)
    at = np.cumsum(_HEAD + n_words) - (_HEAD + n_words)
    rows = np.zeros(int((_HEAD + n_words).sum()), dtype=np.int64)
    rows[at + _FIRST], rows[at + _WORDS], rows[at + _IS_LIST] = first, n_words, is_list
    row_at[owner[starts]] = at
    which = np.repeat(np.arange(len(starts)), counts)
    rank = np.arange(len(owner)) - starts[which]
    listed = is_list[which]
    rows[at[which[listed]] + _HEAD + rank[listed]] = partner[listed]
    bit = (partner - first[which])[~listed]
    words = rows.view(np.uint64)
    np.bitwise_or.at(words, (at[which] + _HEAD)[~listed] + (bit >> 6), np.uint64(1) << (bit & 63).astype(np.uint64))
    return row_at, rows
