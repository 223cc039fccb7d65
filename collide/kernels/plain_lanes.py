"""Lanes and masks without compilation: numpy arrays of eight. See `lanes.py`."""

from __future__ import annotations

import ctypes

import numpy as np

#: Doubles to a number.
LANES = 8


class _Eight(np.ndarray):
    """Eight numbers, immutable: ``a += b`` makes a new array, and other names of the old array keep its values."""

    def __iadd__(self, other):  # type: ignore[misc]
        return self + other

    def __isub__(self, other):  # type: ignore[misc]
        return self - other

    def __imul__(self, other):  # type: ignore[misc]
        return self * other

    def __itruediv__(self, other):  # type: ignore[misc]
        return self / other

class _Rows:
    """What `view_lanes` gives without compilation; reading copies, as it does compiled."""

    def __init__(self, rows):
        self._rows = rows

    def __getitem__(self, k):
        return self._rows[k].copy().view(_Eight)

    def __setitem__(self, k, value):
        self._rows[k] = value

def view_lanes(address, n):
    buffer = (ctypes.c_double * (LANES * int(n))).from_address(int(address))
    return _Rows(np.frombuffer(buffer).reshape(n, LANES))

def transpose_eight(addresses_at, target_at):
    addresses = (ctypes.c_int64 * LANES).from_address(int(addresses_at))
    rows = [np.frombuffer((ctypes.c_double * LANES).from_address(at)) for at in addresses]
    target = (ctypes.c_double * (LANES * LANES)).from_address(int(target_at))
    np.frombuffer(target).reshape(LANES, LANES)[:] = np.stack(rows, axis=1)

def select(condition, a, b):
    if isinstance(condition, np.ndarray):
        return np.where(condition, a, b).view(_Eight)
    return a if condition else b

def root_of(a):
    return np.sqrt(a)

def bits_of(condition):
    return sum(1 << k for k in range(LANES) if condition[k])

def any_of(condition):
    return bool(np.any(condition))
