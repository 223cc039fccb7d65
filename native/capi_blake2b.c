#include "capi_blake2b.h"

#include <string.h>

/* Fractional parts of the square roots of the first eight primes. */
static const uint64_t START[8] = {
    0x6a09e667f3bcc908u, 0xbb67ae8584caa73bu, 0x3c6ef372fe94f82bu, 0xa54ff53a5f1d36f1u,
    0x510e527fade682d1u, 0x9b05688c2b3e6c1fu, 0x1f83d9abfb41bd6bu, 0x5be0cd19137e2179u,
};

/* Which words of the block go into each step, round by round; rounds 11 and 12 are as 1 and 2. */
static const unsigned char ORDER[10][16] = {
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}, {14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3},
    {11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4}, {7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8},
    {9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13}, {2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9},
    {12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11}, {13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10},
    {6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5}, {10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0},
};

static uint64_t turned(uint64_t word, int bits) { return word >> bits | word << (64 - bits); }

static void mix(uint64_t *v, int a, int b, int c, int d, uint64_t x, uint64_t y)
{
    v[a] += v[b] + x;
    v[d] = turned(v[d] ^ v[a], 32);
    v[c] += v[d];
    v[b] = turned(v[b] ^ v[c], 24);
    v[a] += v[b] + y;
    v[d] = turned(v[d] ^ v[a], 16);
    v[c] += v[d];
    v[b] = turned(v[b] ^ v[c], 63);
}

static void take_block(struct blake2b *hash, int last)
{
    uint64_t v[16], words[16];
    int k, round;
    for (k = 0; k < 16; k++) {
        int i;
        words[k] = 0;
        for (i = 7; i >= 0; i--) words[k] = words[k] << 8 | hash->block[8 * k + i];
    }
    for (k = 0; k < 8; k++) {
        v[k] = hash->state[k];
        v[8 + k] = START[k];
    }
    v[12] ^= hash->counted;
    if (last) v[14] = ~v[14];
    for (round = 0; round < 12; round++) {
        const unsigned char *s = ORDER[round % 10];
        for (k = 0; k < 4; k++) mix(v, k, 4 + k, 8 + k, 12 + k, words[s[2 * k]], words[s[2 * k + 1]]);
        for (k = 0; k < 4; k++)
            mix(v, k, 4 + (k + 1) % 4, 8 + (k + 2) % 4, 12 + (k + 3) % 4, words[s[8 + 2 * k]], words[s[9 + 2 * k]]);
    }
    for (k = 0; k < 8; k++) hash->state[k] ^= v[k] ^ v[8 + k];
}

void blake2b_begin(struct blake2b *hash)
{
    memset(hash, 0, sizeof *hash);
    memcpy(hash->state, START, sizeof START);
    hash->state[0] ^= 0x01010000u | 16u; /* no key, one lane, 16 bytes of digest */
}

void blake2b_add(struct blake2b *hash, const void *bytes, size_t n)
{
    const unsigned char *from = bytes;
    while (n > 0) {
        size_t some = sizeof hash->block - hash->used;
        if (some == 0) { /* a full block is taken only when more follows: the last one is marked */
            take_block(hash, 0);
            hash->used = 0;
            continue;
        }
        if (some > n) some = n;
        memcpy(hash->block + hash->used, from, some);
        hash->used += some;
        hash->counted += some;
        from += some;
        n -= some;
    }
}

void blake2b_end(struct blake2b *hash, unsigned char digest[16])
{
    int k;
    memset(hash->block + hash->used, 0, sizeof hash->block - hash->used);
    take_block(hash, 1);
    for (k = 0; k < 16; k++) digest[k] = (unsigned char)(hash->state[k / 8] >> 8 * (k % 8));
}
