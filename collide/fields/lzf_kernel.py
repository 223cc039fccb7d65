"""LZF, the compression of PCD files, unpacked: runs of bytes, and copies of bytes unpacked before (M. Lehmann, liblzf).
"""

from __future__ import annotations

import numpy as np

from collide.kernels import address_of, entry, view_u8

#: Bytes that a packed byte stands for at most: three make a copy of 264.
MAX_RATIO = 88


def unpack_lzf(packed: np.ndarray, size: int) -> np.ndarray | None:
    """(size,) uint8 of packed (n,) uint8; ``None`` where these are damaged, or unpack to another number. O(size)."""
    if size > MAX_RATIO * len(packed):
        return None
    packed, unpacked = np.ascontiguousarray(packed), np.empty(size, dtype=np.uint8)
    n_written = _unpack(address_of(packed), len(packed), address_of(unpacked), size)
    return unpacked if n_written == size else None


@entry("int64(int64, int64, int64, int64)")
def _unpack(packed_at, n_packed, unpacked_at, size):
    """Write what packed bytes stand for; returns how many bytes, −1 for damaged ones and for more than ``size``."""
    packed, unpacked = view_u8(packed_at, n_packed), view_u8(unpacked_at, size)
    i = n = 0
    while i < n_packed:
        control = int(packed[i])
        i += 1
        if control < 32:
            count, back = control + 1, 0
            if i + count > n_packed:
                return -1
        else:
            count, back = (control >> 5) + 2, (control & 31) << 8
            if count == 9:
                if i >= n_packed:
                    return -1
                count += int(packed[i])
                i += 1
            if i >= n_packed:
                return -1
            back += int(packed[i]) + 1
            i += 1
            if back > n:
                return -1
        if n + count > size:
            return -1
        if back == 0:
            for k in range(count):
                unpacked[n + k] = packed[i + k]
            i += count
        else:
            for k in range(count):
                unpacked[n + k] = unpacked[n + k - back]
        n += count
    return n
