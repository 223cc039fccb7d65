"""The one way to compile a kernel. But for `_simd.py`, `_lanes.py`, `_lean_compile.py` and
`_kernel_cache.py`, nothing else imports numba.

Rules, each measured or forced by a bug met:

* no fastmath and no contraction: products and sums round separately, so error bounds hold and
  the same call gives the same bits everywhere;
* no BLAS inside kernels, no ``parallel=True`` (two Python threads on its work queue abort the
  process): kernels release the GIL and callers chunk;
* no reference counting: kernels take addresses and make views with `view_f64` and its siblings.
  Array arguments cost more than the geometry of a box pair. The caller keeps every buffer alive
  for the length of the call;
* the disk cache (`_kernel_cache.py`) is keyed to a hash of all kernel sources. Numba's own key does not
  see an edit in an imported callee, and a stale kernel answers wrongly.

``NUMBA_DISABLE_JIT=1`` runs the same source as plain Python, for coverage and for debugging.
"""

from __future__ import annotations

import ctypes
import hashlib
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from functools import lru_cache
from pathlib import Path

import numba
import numpy as np
from numba.core import types
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

from collide._kernel_cache import kernel_cache
from collide._lean_compile import SELDOM, compiled_lean
from collide.cache_folder import cache_folder
from collide.journal import log

PLAIN_PYTHON = bool(numba.config.DISABLE_JIT)
_FLAGS = {"nogil": True, "error_model": "numpy", "_nrt": False}

#: Packages whose sources are kernels: an edit in any of them makes all cached kernels stale.
_KERNEL_SOURCES = ("_jit.py", "_lanes.py", "_lean_compile.py", "_simd.py", "results.py", "geometry", "broadphase", "narrowphase")


def kernel(function: Callable | None = None, *, inline: bool = False, seldom: bool = False) -> Callable:
    """A function that other kernels call; compiled into its callers.

    inline : copy its code to where it is called. A call that hands over a pair's tuple of views moves
        some fifty words; functions called once or twice in the innermost loop save that.
    seldom : it is called on few of the ways through its callers, which the compiler then makes fast at its expense.
    """
    if function is None:
        return lambda wrapped: kernel(wrapped, inline=inline, seldom=seldom)
    if seldom:
        SELDOM.add((function.__module__, function.__qualname__))
    dispatcher = numba.njit(function, **_FLAGS, forceinline=inline, no_cpython_wrapper=True, no_cfunc_wrapper=True)
    if not PLAIN_PYTHON:
        _compile_once_for_all_constants(dispatcher)
    return dispatcher


def _compile_once_for_all_constants(dispatcher) -> None:
    """Keep numba from compiling a kernel anew for every integer constant it is called with.

    An argument written as a constant is first tried with a type of its own; the narrowphase was
    compiled three times over that way, 47 s instead of 30 with the exact stage.
    """
    with_constants = dispatcher.get_call_template

    def without_constants(args, kws):
        return with_constants(
            tuple(types.unliteral(a) for a in args), {name: types.unliteral(a) for name, a in kws.items()}
        )

    dispatcher.get_call_template = without_constants


class Entry:
    """A kernel that Python calls: integers and floats in, everything else behind addresses.

    Compiled at its first call for the one signature given, or read from the disk cache.
    """

    def __init__(self, function: Callable, signature: str, nogil: bool = True, hasty: bool = False):
        self.__doc__, self.name = function.__doc__, function.__name__
        self._flags, self._hasty = {**_FLAGS, "nogil": nogil}, hasty
        self._function, self._signature = function, signature
        self._ready: Callable | None = function if PLAIN_PYTHON else None
        self._address = 0

    def __call__(self, *args):
        if self._ready is None:
            self._compile()
        return self._ready(*args)

    @property
    def ready(self) -> Callable:
        """The compiled function itself, without this object's own call in front of it."""
        if self._ready is None:
            self._compile()
        return self._ready  # type: ignore[return-value]

    @property
    def unchecked(self) -> Callable:
        """The compiled function without numba's look at the types of its arguments, which takes as long as
        a pair of boxes. For integers, and arrays that are what the signature says: anything else may crash."""
        if PLAIN_PYTHON:
            return self._function
        (compiled,) = self.ready.overloads.values()  # type: ignore[attr-defined]
        return compiled.entry_point

    @property
    def address(self) -> int:
        """Where the machine code starts, for `native_call`: kernels of another entry call it there.

        A second entry that called the kernels themselves would compile the whole narrowphase again.
        """
        if PLAIN_PYTHON:
            return _plain_address(self._function)
        if self._address == 0:
            (compiled,) = self.ready.overloads.values()  # type: ignore[attr-defined]
            self._address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
        return self._address

    @property
    def c_address(self) -> int:
        """Where the machine code starts that C calls, with the integers of the signature."""
        (compiled,) = self.ready.overloads.values()  # type: ignore[attr-defined]
        return compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)

    def _compiled(self) -> Callable:
        """Compiled for its signature, or read from the disk cache."""
        dispatcher = numba.njit(self._function, **self._flags)
        dispatcher._cache = kernel_cache(self._function, kernel_cache_folder())
        compiled_lean(self._function, self._hasty, lambda: dispatcher.compile(self._signature))
        dispatcher.disable_compile()
        return dispatcher

    def _compile(self) -> None:
        # Numba's own lock and no other: of two, one thread could hold the first and another the second.
        with global_compiler_lock:
            if self._ready is not None:
                return
            started = time.perf_counter()
            with on_compile(self.name):
                dispatcher = self._compiled()
            seconds[self.name] = time.perf_counter() - started
            log.info("kernel %s compiled or loaded: %.3f s", self.name, seconds[self.name])
            self._ready = dispatcher


def entry(signature: str, *, nogil: bool = True, hasty: bool = False) -> Callable[[Callable], Entry]:
    """Decorator: a kernel called from Python, with its numba signature.

    nogil : let other Python threads run meanwhile. A kernel of a microsecond that shares one
        workspace among all threads keeps the lock instead.
    hasty : compile it sooner, to run 1 to 2 % slower: for what is seldom called.
    """
    return lambda function: Entry(function, signature, nogil, hasty)


#: Seconds each entry took to become callable in this process, by compiling or by loading.
seconds: dict[str, float] = {}


def _silent(_name: str) -> AbstractContextManager:
    return nullcontext()


#: Called with a kernel's name; the context it returns surrounds compiling or loading it. The
#: command line puts a progress line here.
on_compile: Callable[[str], AbstractContextManager] = _silent


# --- the disk cache -----------------------------------------------------------------------------


@lru_cache(maxsize=1)
def source_hash() -> str:
    """Hash of every kernel source and of numba's version."""
    root = Path(__file__).parent
    digest = hashlib.sha256(f"{numba.__version__} {np.__version__}".encode())
    for name in _KERNEL_SOURCES:
        place = root / name
        for file in [place] if place.is_file() else sorted(place.rglob("*.py")):
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def kernel_cache_folder() -> Path:
    """Where compiled kernels of these very sources are kept."""
    return cache_folder("kernels", source_hash())


# --- views on buffers ---------------------------------------------------------------------------

if PLAIN_PYTHON:

    def _view(ctype, dtype):
        def view(address, n):
            buffer = (ctype * int(n)).from_address(int(address)) if n else b""
            return np.frombuffer(buffer, dtype=dtype)

        return view

else:

    def _view(_ctype, dtype):
        element = numba.from_dtype(np.dtype(dtype))
        array = types.Array(element, 1, "C")

        @intrinsic
        def view(_context, address, n):
            def codegen(cgctx, builder, _signature, args):
                layout = cgctx.get_data_type(element)
                size = cgctx.get_constant(types.intp, cgctx.get_abi_sizeof(layout))
                result = make_array(array)(cgctx, builder)
                populate_array(
                    result,
                    data=builder.inttoptr(args[0], layout.as_pointer()),
                    shape=[args[1]],
                    strides=[size],
                    itemsize=size,
                    meminfo=None,
                )
                return result._getvalue()

            return array(types.int64, types.int64), codegen

        return view

if PLAIN_PYTHON:
    _functions: list[Callable] = []

    def _plain_address(function: Callable) -> int:
        if function not in _functions:
            _functions.append(function)
        return _functions.index(function)

    def native_call(signature: str):
        return lambda address, arguments: _functions[int(address)](*arguments)

else:

    def native_call(signature: str):
        """A kernel ``call(address, arguments)``: runs the `Entry` of this signature that stands there."""
        arguments, result = numba.core.sigutils.normalize_signature(signature)

        def make(_context, address, given):
            def codegen(cgctx, builder, _signature, args):
                convention = cgctx.call_conv
                kind = convention.get_function_type(result, arguments)
                unpacked = [builder.extract_value(args[1], k) for k in range(len(arguments))]
                place = builder.inttoptr(args[0], kind.as_pointer())
                _status, value = convention.call_function(builder, place, result, arguments, unpacked)
                return value

            return result(types.int64, types.Tuple(arguments)), codegen

        return intrinsic(make)


#: ``view_f64(address, n)``: n doubles at an address, as a one-dimensional array; the caller keeps
#: the buffer alive. Siblings for other element types.
view_f64 = _view(ctypes.c_double, np.float64)
view_i64 = _view(ctypes.c_int64, np.int64)
view_i32 = _view(ctypes.c_int32, np.int32)
view_f32 = _view(ctypes.c_float, np.float32)
view_u8 = _view(ctypes.c_uint8, np.uint8)


def address_of(array: np.ndarray) -> int:
    """Address of a C-contiguous array's first element. The caller keeps the array alive."""
    if not array.flags.c_contiguous:
        raise ValueError("kernels read C-contiguous buffers")
    return _data_of(array)


def _data_of(array: np.ndarray) -> int:
    """``array.ctypes.data``, in a fifth of its microsecond: batches of a few poses ask ten times."""
    return ctypes.c_size_t.from_address(id(array) + object.__basicsize__).value


def _is_where_data_stands() -> bool:
    """Whether numpy's arrays begin as its headers say: an object's own words, then the data pointer."""
    probes = [np.zeros(3), np.zeros((2, 4), dtype=np.uint8)[1], np.zeros(0)]
    return all(_data_of(probe) == probe.ctypes.data for probe in probes)


if sys.implementation.name != "cpython" or not _is_where_data_stands():

    def _data_of(array: np.ndarray) -> int:  # type: ignore[no-redef]
        return array.ctypes.data
