/* BLAKE2b without a key (RFC 7693), of digests of 16 bytes: what Python's hashlib.blake2b(digest_size=16) gives. */
#ifndef COLLIDE_CAPI_BLAKE2B_H
#define COLLIDE_CAPI_BLAKE2B_H

#include <stddef.h>
#include <stdint.h>

struct blake2b {
    uint64_t state[8];
    uint64_t counted; /* bytes, those in the block among them; digests of more than 2^64 are not to be had */
    size_t used;      /* bytes of the block */
    unsigned char block[128];
};

void blake2b_begin(struct blake2b *hash);
void blake2b_add(struct blake2b *hash, const void *bytes, size_t n);
void blake2b_end(struct blake2b *hash, unsigned char digest[16]);

#endif
