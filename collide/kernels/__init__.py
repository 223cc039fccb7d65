"""The one way to write a kernel, and to call a kernel. Nothing outside this room knows how kernels become machine code.

Rules, each measured or forced by a bug met:

* no fastmath and no contraction: products and sums round separately, so error bounds hold and the same call gives the
  same bits everywhere;
* no BLAS inside kernels, no ``parallel=True`` (two Python threads on its work queue abort the process): kernels release
  the GIL and callers chunk;
* kernels hold no Python objects and raise nothing: they take integers, doubles and booleans, and everything else behind
  addresses, seen through views (`view_f64` and its siblings). The caller keeps every buffer alive for the
  length of the call. The build refuses a kernel able to raise;
* everything a kernel is compiled from stands in the sources named by `sources.py`: a stale kernel answers wrongly.

`mode.py` says how kernels run: from the library made when the package was built, compiled just in time, or as plain
Python.

    kernel(inline=, cold=)    a function called by other kernels. inline : copy its code to each call.
        cold : few paths through its callers reach it; the compiler favours the other paths.
    entry(signature, nogil=)    a kernel called by Python, with its Numba signature of int64, float64 and boolean.
        nogil : let other Python threads run meanwhile. A kernel of a microsecond with a workspace shared by all
        threads keeps the lock instead.
    code_of(entry)              address of its machine code, for `native_call`
    native_call(signature)
    a kernel ``call(address, arguments)``: runs the entry of this signature at the address.
        A second entry calling the kernels themselves would compile the whole narrowphase again.
    view_f64(address, n)        n doubles at an address; siblings for other kinds of elements
    address_of(array)           of a C-contiguous array's first element
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from collide.kernels import library
from collide.kernels.mode import COMPILED, MODE, PLAIN_PYTHON, WITH_NUMBA

if TYPE_CHECKING or PLAIN_PYTHON:
    from collide.kernels.plain import code_of, entry, kernel, native_call
    from collide.kernels.plain import view_maker as _view
elif WITH_NUMBA:
    from numba import from_dtype

    from collide.kernels.jit import code_of, entry, kernel, native_call
    from collide.kernels.views import view_maker as _view_of_kind

    def _view(_ctype, dtype) -> Callable:
        return _view_of_kind(from_dtype(np.dtype(dtype)))
else:
    from collide.kernels.library import code_of, entry
    from collide.kernels.plain import kernel, native_call
    from collide.kernels.plain import view_maker as _view

__all__ = [
    "MODE", "PLAIN_PYTHON", "WITH_NUMBA", "address_of", "code_of", "entry", "kernel", "native_call", "view_f32",
    "view_f64",
    "view_i32", "view_i64", "view_u8",
]

view_f64 = _view(ctypes.c_double, np.float64)
view_i64 = _view(ctypes.c_int64, np.int64)
view_i32 = _view(ctypes.c_int32, np.int32)
view_f32 = _view(ctypes.c_float, np.float32)
view_u8 = _view(ctypes.c_uint8, np.uint8)


if MODE == COMPILED:
    address_of = library.glue.address_of
else:

    def address_of(array: np.ndarray) -> int:
        """Address of a C-contiguous array's first element. The caller keeps the array alive."""
        if not array.flags.c_contiguous:
            raise ValueError("kernels read C-contiguous buffers")
        return array.ctypes.data
