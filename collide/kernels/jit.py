"""Kernels compiled at their first call, and kept on disk: for people who change kernels.

The front end and back end of the library (`front_end.py`, `back_end.py`), for this very processor. An entry's machine
code is an object file, kept under a hash of all code its result depends on (`sources.py`). An edit makes dependent
entries stale; all other entries come from the library, if installed.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from functools import cache
from typing import Any

import llvmlite.binding as llvm
from numba.core import sigutils

from collide.base.log import log
from collide.kernels import library, object_cache, sources
from collide.kernels.back_end import Target, host, machine_code
from collide.kernels.front_end import Lowered, dispatcher, native_call

__all__ = ["Entry", "code_of", "entry", "kernel", "native_call"]

_C_TYPES: dict[str, Any] = {
    "int64": ctypes.c_int64,
    "float64": ctypes.c_double,
    "boolean": ctypes.c_bool,
    "bool": ctypes.c_bool,
    "none": None,
}
#: One at a time: two threads' first calls compile an entry once.
_compiling = threading.RLock()


def kernel(function: Callable | None = None, *, inline: bool = False, cold: bool = False) -> Callable:
    if function is None:
        return lambda wrapped: kernel(wrapped, inline=inline, cold=cold)
    return dispatcher(function, inline=inline, cold=cold)


class Entry:
    """A kernel that Python calls; compiled, or read from the disk, at its first call."""

    def __init__(self, function: Callable, signature: str, nogil: bool):
        self.__doc__, self.__name__ = function.__doc__, function.__name__
        self.function, self.signature, self.nogil = function, signature, nogil
        self._ready: Callable | None = None
        self._address = 0

    def __call__(self, *args):
        return (self._ready or self._made())(*args)

    @property
    def address(self) -> int:
        if self._ready is None:
            self._made()
        return self._address

    def _made(self) -> Callable:
        if threading.current_thread() is threading.main_thread():
            return _out_of_reach_of_signals(self._make)
        return self._make()

    def _make(self) -> Callable:
        with _compiling:
            if self._ready is None:
                start = time.perf_counter()
                self._address = _placed(self.__name__, self._object())
                self._ready = self._c_function()
                log.info("kernel %s compiled or loaded: %.3f s", self.__name__, time.perf_counter() - start)
            return self._ready

    def _object(self) -> bytes:
        """The entry's machine code."""

        def compiled() -> bytes:
            _say_once()
            log.info("compiling kernel %s", self.__name__)
            code = Lowered()
            code.add(self.__name__, self.function, self.signature)
            return machine_code(code.names, code.modules, _here())

        return object_cache.kept_or_made(
            f"{self.function.__module__}.{self.__name__}", _key(self.function, self.signature), compiled
        )

    def _c_function(self) -> Callable:
        arguments, result = sigutils.normalize_signature(self.signature)
        make = ctypes.CFUNCTYPE if self.nogil else ctypes.PYFUNCTYPE
        return make(_C_TYPES[str(result)], *(_C_TYPES[str(kind)] for kind in arguments))(self._address)


def _out_of_reach_of_signals(work: Callable) -> Any:
    """What ``work`` gives, done in another thread.

    Handlers of signals run in the main thread, at any moment. What they raise within LLVM's and Numba's code, as Ctrl-C
    does, leaves locks of theirs held for ever; and what they compile would be compiled for our target.
    """
    done: Future = Future()

    def run() -> None:
        try:
            done.set_result(work())
        except BaseException as error:  # noqa: BLE001 - whatever it is, it is the asker's
            done.set_exception(error)

    threading.Thread(target=run, name="collide: compiling").start()
    return done.result()


@cache
def _say_once() -> None:
    from collide.kernels.mode import WHY

    log.warning(
        "kernels are compiled at their first call (%s): half a minute once, then kept in %s",
        WHY,
        object_cache.kernel_folder(),
    )


def entry(signature: str, *, nogil: bool = True) -> Callable[[Callable], Callable]:
    def made(function: Callable) -> Callable:
        if (ready := library.function_of(function)) is not None:
            return ready
        entries.append(Entry(function, signature, nogil))
        return entries[-1]

    return made


#: All that are compiled just in time, for the build.
entries: list[Entry] = []


def code_of(entry) -> int:
    return entry.address if isinstance(entry, Entry) else library.code_of(entry)


@cache
def _here() -> Target:
    """This very processor, and memory that the loader chooses."""
    return host(position_independent=False)


def _key(function: Callable, signature: str) -> str:
    return repr(
        (signature, sources.of_function(function), _here(), llvm.get_process_triple(), sources.compiler_versions())
    )


_engines: list = []  # machine code lives as long as what holds it


def _placed(name: str, code: bytes) -> int:
    """Where the function of this name starts, of an object file brought into this process."""
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), _here().machine())
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    _engines.append(engine)
    return engine.get_function_address(name)
