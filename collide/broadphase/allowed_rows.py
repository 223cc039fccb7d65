"""The allowed-collision matrix as rows of bits: only bodies with allowed pairs have a row, over the range of their
partners alone.

A row of partners far apart in number would be mostly zeros and is a sorted list instead. Memory is a small multiple of
the number of allowed pairs in both forms.
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, kernel, view_i64

# A row: the first partner (down to a multiple of 64), how many words follow, and whether these are bits or a list.
_FIRST, _WORDS, _IS_LIST = 0, 1, 2
_HEAD = 3
#: A row of bits has at most this many words more than its number of partners.
_SPARE_WORDS = 4
#: Integers of a row, divided by its number of partners, are at most so many.
ROW_OF_A_KEY = _HEAD + 1 + _SPARE_WORDS


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


@kernel(inline=True)
def _write_row(rows, at, keys, begin, end):
    """Write the row of the partners in keys begin … end − 1 at ``at``; the place behind the row."""
    first = (keys[begin] & 0xFFFFFFFF) & ~63
    n_words = (((keys[end - 1] & 0xFFFFFFFF) - first) >> 6) + 1
    is_list = n_words > end - begin + _SPARE_WORDS
    if is_list:
        n_words = end - begin
    rows[at + _FIRST], rows[at + _WORDS], rows[at + _IS_LIST] = first, n_words, 1 if is_list else 0
    for k in range(n_words):
        rows[at + _HEAD + k] = 0
    for k in range(begin, end):
        partner = keys[k] & 0xFFFFFFFF
        if is_list:
            rows[at + _HEAD + k - begin] = partner
        else:
            rows[at + _HEAD + ((partner - first) >> 6)] |= 1 << ((partner - first) & 63)
    return at + _HEAD + n_words


@entry("int64(int64, int64, int64, int64, int64)")
def write_allowed_rows(keys_at, n_keys, row_at_at, n, rows_at):
    """Write the rows of n bodies; returns the number of integers written.

    keys : i·2^32 + j of every body i and partner j, both ways round, ascending, each once.
    row_at : n integers, out: where each body's row begins, −1 for bodies without allowed pairs.
    rows : ROW_OF_A_KEY integers a key, out: no row takes more.
    """
    keys, row_at = view_i64(keys_at, n_keys), view_i64(row_at_at, n)
    rows = view_i64(rows_at, ROW_OF_A_KEY * n_keys)
    for body in range(n):
        row_at[body] = -1
    begin = at = 0
    while begin < n_keys:
        end = begin + 1
        while end < n_keys and keys[end] >> 32 == keys[begin] >> 32:
            end += 1
        row_at[keys[begin] >> 32] = at
        at = _write_row(rows, at, keys, begin, end)
        begin = end
    return at


def allowed_rows(pairs: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """((n,) where each body's row begins, −1 for bodies without allowed pairs; the rows in sequence), int64.

    pairs : (k, 2) bodies never tested with each other, each pair once.
    """
    keys = np.sort(np.concatenate([(pairs[:, 0] << 32) + pairs[:, 1], (pairs[:, 1] << 32) + pairs[:, 0]]))
    row_at, rows = np.empty(n, dtype=np.int64), np.zeros(ROW_OF_A_KEY * len(keys) + 1, dtype=np.int64)
    count = write_allowed_rows(address_of(keys), len(keys), address_of(row_at), n, address_of(rows))
    return row_at, rows[: max(count, 1)].copy()
