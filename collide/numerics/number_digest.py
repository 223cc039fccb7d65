"""BLAKE2b of numbers (RFC 7693), digests of 16 bytes: equal to `hashlib.blake2b`'s, for C, where hashlib is missing.

Digests order the two bodies of a pair, so C and Python give the same bits.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_i32, view_i64

#: Fractional parts of the square roots of the first eight primes.
_START = np.array([
    0x6a09e667f3bcc908, 0xbb67ae8584caa73b, 0x3c6ef372fe94f82b, 0xa54ff53a5f1d36f1,
    0x510e527fade682d1, 0x9b05688c2b3e6c1f, 0x1f83d9abfb41bd6b, 0x5be0cd19137e2179,
], dtype=np.uint64).view(np.int64)
#: Which words of a block go into each step, round by round; rounds 11 and 12 are as 1 and 2.
_ORDER = np.array([int(word, 16) for word in (
    "0123456789abcdef" "ea489fd61c02b753" "b8c052fdae367194" "7931dcbe265a40f8" "905724afe1bc683d"
    "2c6a0b834d75fe19" "c51fed4a0763928b" "db7ec13950f4862a" "6fe9b308c2d714a5" "a2847615fb9e3cd0"
)])
#: Bytes of a block, and its words.
_BLOCK, _WORDS = 128, 16
_NEGATIVE_ZERO = -(2**63)
#: Integers of workspace.
DIGEST_WORDS = 40


class _Message(NamedTuple):
    """Views of what is taken one behind the other: words, doubles as words, integers."""

    head: Any
    doubles: Any
    integers: Any


@entry("void(int64, int64, int64, int64, int64, int64, int64, int64)")
def digest_numbers(head_at, n_head, doubles_at, n_doubles, integers_at, n_integers, memory_at, digest_at):
    """Write the digest, 16 bytes, of 64-bit words, of doubles, −0.0 taken as 0.0, and of 32-bit integers behind them.

    memory : DIGEST_WORDS integers. O(n), a nanosecond or two a byte.
    """
    message = _Message(view_i64(head_at, n_head), view_i64(doubles_at, n_doubles), view_i32(integers_at, n_integers))
    state, v, words = view_i64(memory_at, 8), view_i64(memory_at + 64, 16), view_i64(memory_at + 192, 16)
    digest = view_i64(digest_at, 2)
    n_bytes = 8 * (n_head + n_doubles) + 4 * n_integers
    for k in range(8):
        state[k] = _START[k]
    state[0] ^= 0x01010010  # no key, one lane, 16 bytes of digest
    n_blocks = max((n_bytes + _BLOCK - 1) // _BLOCK, 1)
    for block in range(n_blocks):
        for k in range(_WORDS):
            words[k] = _word(message, _WORDS * block + k)
        _take_block(state, v, words, min(_BLOCK * (block + 1), n_bytes), block == n_blocks - 1)
    digest[0] = state[0]
    digest[1] = state[1]


@kernel
def _word(message, k):
    """Word k of the message, 0 behind its end."""
    if k < len(message.head):
        return message.head[k]
    k -= len(message.head)
    if k < len(message.doubles):
        return 0 if message.doubles[k] == _NEGATIVE_ZERO else message.doubles[k]
    k = 2 * (k - len(message.doubles))
    low = message.integers[k] if k < len(message.integers) else 0
    high = message.integers[k + 1] if k + 1 < len(message.integers) else 0
    return (int(high) << 32) | (int(low) & 0xffffffff)


@kernel
def _take_block(state, v, words, n_bytes, is_last):
    for k in range(8):
        v[k] = state[k]
        v[8 + k] = _START[k]
    v[12] ^= n_bytes
    if is_last:
        v[14] = ~v[14]
    for step in range(96):  # twelve rounds of eight
        i, row = step % 4, step % 8 // 4
        at = (16 * (step // 8) + 2 * (step % 8)) % 160
        _mix(v, i, 4 + (i + row) % 4, 8 + (i + 2 * row) % 4, 12 + (i + 3 * row) % 4, words[_ORDER[at]],
             words[_ORDER[at + 1]])
    for k in range(8):
        state[k] ^= v[k] ^ v[8 + k]


@kernel(inline=True)
def _mix(v, a, b, c, d, x, y):
    v[a] += v[b] + x
    v[d] = _turned(v[d] ^ v[a], 32)
    v[c] += v[d]
    v[b] = _turned(v[b] ^ v[c], 24)
    v[a] += v[b] + y
    v[d] = _turned(v[d] ^ v[a], 16)
    v[c] += v[d]
    v[b] = _turned(v[b] ^ v[c], 63)


@kernel(inline=True)
def _turned(word, bits):
    """A word turned right."""
    return ((word >> bits) & ((1 << (64 - bits)) - 1)) | (word << (64 - bits))
