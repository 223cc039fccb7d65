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
DIGEST_WORDS = 24


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
    put_digest(head_at, n_head, doubles_at, n_doubles, integers_at, n_integers, memory_at, digest_at)


@kernel
def put_digest(head_at, n_head, doubles_at, n_doubles, integers_at, n_integers, memory_at, digest_at):
    """`digest_numbers` for kernels."""
    message = _Message(view_i64(head_at, n_head), view_i64(doubles_at, n_doubles), view_i32(integers_at, n_integers))
    state, words = view_i64(memory_at, 8), view_i64(memory_at + 64, _WORDS)
    digest = view_i64(digest_at, 2)
    n_bytes = 8 * (n_head + n_doubles) + 4 * n_integers
    for k in range(8):
        state[k] = _START[k]
    state[0] ^= 0x01010010  # no key, one lane, 16 bytes of digest
    n_blocks = max((n_bytes + _BLOCK - 1) // _BLOCK, 1)
    for block in range(n_blocks):
        for k in range(_WORDS):
            words[k] = _word(message, _WORDS * block + k)
        _take_block(state, words, min(_BLOCK * (block + 1), n_bytes), block == n_blocks - 1)
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
def _take_block(state, words, n_bytes, is_last):
    v0, v1, v2, v3, v4, v5, v6, v7 = state[0], state[1], state[2], state[3], state[4], state[5], state[6], state[7]
    v8, v9, va, vb, vc, vd, ve, vf = (
        _START[0], _START[1], _START[2], _START[3], _START[4] ^ n_bytes, _START[5], _START[6], _START[7],
    )
    if is_last:
        ve = ~ve
    for k in range(12):  # rounds; the sixteen words stay in registers
        at = 16 * (k % 10)
        v0, v4, v8, vc = _mixed(v0, v4, v8, vc, words[_ORDER[at]], words[_ORDER[at + 1]])
        v1, v5, v9, vd = _mixed(v1, v5, v9, vd, words[_ORDER[at + 2]], words[_ORDER[at + 3]])
        v2, v6, va, ve = _mixed(v2, v6, va, ve, words[_ORDER[at + 4]], words[_ORDER[at + 5]])
        v3, v7, vb, vf = _mixed(v3, v7, vb, vf, words[_ORDER[at + 6]], words[_ORDER[at + 7]])
        v0, v5, va, vf = _mixed(v0, v5, va, vf, words[_ORDER[at + 8]], words[_ORDER[at + 9]])
        v1, v6, vb, vc = _mixed(v1, v6, vb, vc, words[_ORDER[at + 10]], words[_ORDER[at + 11]])
        v2, v7, v8, vd = _mixed(v2, v7, v8, vd, words[_ORDER[at + 12]], words[_ORDER[at + 13]])
        v3, v4, v9, ve = _mixed(v3, v4, v9, ve, words[_ORDER[at + 14]], words[_ORDER[at + 15]])
    state[0] ^= v0 ^ v8
    state[1] ^= v1 ^ v9
    state[2] ^= v2 ^ va
    state[3] ^= v3 ^ vb
    state[4] ^= v4 ^ vc
    state[5] ^= v5 ^ vd
    state[6] ^= v6 ^ ve
    state[7] ^= v7 ^ vf


@kernel(inline=True)
def _mixed(a, b, c, d, x, y):
    a += b + x
    d = _turned(d ^ a, 32)
    c += d
    b = _turned(b ^ c, 24)
    a += b + y
    d = _turned(d ^ a, 16)
    c += d
    b = _turned(b ^ c, 63)
    return a, b, c, d


@kernel(inline=True)
def _turned(word, bits):
    """A word turned right."""
    return ((word >> bits) & ((1 << (64 - bits)) - 1)) | (word << (64 - bits))
