"""What kernels of single calls read of Python's objects, and the objects they answer with.

A call of one pair is a call of one built-in function: it gets its poses as objects and gives back True, False or None.
Numba's own reading of two arrays takes as long as GJK takes for two boxes, and so do its handing over of integers and
`id`. The layouts relied on are part of CPython's and numpy's binary interfaces, and are looked at once before anything
relies on them: `layouts_are_known`.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

import numpy as np

from collide._jit import Entry, kernel, view_i64

# First words of a header: types of the arrays served, the objects to answer with, whether references to those are counted.
ARRAY_TYPE, ARRAY_DTYPE, APART_OBJECT, HIT_OBJECT, OPEN_OBJECT, COUNTED = range(6)
OBJECT_WORDS = 6

# Words of an array object.
_TYPE, _DATA, _DIMENSIONS, _SHAPE, _STRIDES, _, _DTYPE = range(1, 8)
_FIELDS = 8
_F8 = np.dtype(np.float64)


def object_words() -> tuple[int, ...]:
    """The first words of a header."""
    # From Python 3.12 on True, False and None live for ever, and nobody counts.
    return id(np.ndarray), id(_F8), id(False), id(True), id(None), int(sys.version_info < (3, 12))


@kernel(inline=True)
def matrix_at(object_at, header):
    """Address of the 16 doubles of a C-contiguous (4, 4) numpy array of float64, given where the object is; else 0."""
    fields = view_i64(object_at, _FIELDS)
    if fields[_TYPE] != header[ARRAY_TYPE] or fields[_DTYPE] != header[ARRAY_DTYPE]:
        return 0
    if fields[_DIMENSIONS] & 0xFFFFFFFF != 2 or fields[_DATA] & 7 != 0:
        return 0
    shape = view_i64(fields[_SHAPE], 2)
    strides = view_i64(fields[_STRIDES], 2)
    if shape[0] != 4 or shape[1] != 4 or strides[0] != 32 or strides[1] != 8:
        return 0
    return fields[_DATA]


@kernel(inline=True)
def data_at(object_at):
    """Address of the first element of a numpy array, given where the object is."""
    return view_i64(object_at, _FIELDS)[_DATA]


@kernel(inline=True)
def answered(header, said):
    """Address of the object for an answer: 0 False, 1 True, less None; with one reference more."""
    answer_at = header[OPEN_OBJECT] if said < 0 else header[APART_OBJECT + said]
    if header[COUNTED] != 0:
        view_i64(answer_at, 1)[0] += 1
    return answer_at


class _Method(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("address", ctypes.c_void_p), ("flags", ctypes.c_int), ("doc", ctypes.c_char_p))


#: METH_FASTCALL: the kernel gets the header's array, the address of the arguments and their number.
_FAST_CALL = 0x80
_methods: dict[str, _Method] = {}


def built_in(kernel_entry: Entry, header: np.ndarray) -> Callable:
    """A built-in function of positional arguments that runs a kernel of ("int64(int64, int64, int64)", nogil=False).

    The kernel gets the address of the object ``header``, the address of its arguments' addresses, and their number; it
    returns the address of an object (`answered`).
    """
    method = _methods.get(kernel_entry.name)
    if method is None:
        name = kernel_entry.name.encode()
        method = _methods[kernel_entry.name] = _Method(name, kernel_entry.c_address, _FAST_CALL, None)
        # Functions read it as long as they live, and some outlive this module when Python ends: it is never freed.
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(method))
    make = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.POINTER(_Method), ctypes.py_object, ctypes.c_void_p)
    return make(("PyCFunction_NewEx", ctypes.pythonapi))(method, header, None)


def layouts_are_known() -> bool:
    """Whether objects lie in memory as kernels read them: CPython with its lock, 64 bits."""
    if sys.implementation.name != "cpython" or sys.maxsize < 2**60 or not getattr(sys, "_is_gil_enabled", lambda: True)():
        return False
    probe = np.zeros((4, 4))
    fields = (ctypes.c_int64 * _FIELDS).from_address(id(probe))
    words = (ctypes.c_int64 * 2).from_address
    return (
        (fields[_TYPE], fields[_DTYPE], fields[_DATA]) == (id(np.ndarray), id(_F8), probe.ctypes.data)
        and fields[_DIMENSIONS] & 0xFFFFFFFF == 2
        and tuple(words(fields[_SHAPE])) == (4, 4)
        and tuple(words(fields[_STRIDES])) == (32, 8)
    )
