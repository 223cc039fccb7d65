"""Kernels as Python: views are on the memory that they are made of, and entries are called by their address."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from collide.kernels import plain


@pytest.mark.parametrize(
    ("ctype", "dtype"),
    [(ctypes.c_double, np.float64), (ctypes.c_int64, np.int64), (ctypes.c_int32, np.int32), (ctypes.c_uint8, np.uint8)],
)
def test_views_read_and_write_what_is_there(ctype, dtype):
    view, array = plain.view_maker(ctype, dtype), np.arange(10).astype(dtype)
    step = array.itemsize
    seen = view(array.ctypes.data + 2 * step, 5)
    assert seen.dtype == dtype and seen.tolist() == [2, 3, 4, 5, 6] and len(view(np.int64(array.ctypes.data), 10)) == 10
    seen[1] = 99
    assert array[3] == 99
    array[4] = 77
    assert seen[2] == 77
    assert len(view(0, 0)) == 0, "an address of nothing is never read"


def test_kernels_and_entries_are_the_functions_themselves():
    def add(a, b):
        return a + b

    assert plain.kernel(add) is add and plain.kernel(inline=True, cold=True)(add) is add
    assert plain.entry("int64(int64, int64)", nogil=False)(add) is add
    call = plain.native_call("int64(int64, int64)")
    address = plain.code_of(add)
    assert plain.code_of(add) == address != plain.code_of(lambda a, b: a * b)
    assert call(address, (2, 3)) == 5 and call(np.int64(address), (2.5, 3)) == 5.5
