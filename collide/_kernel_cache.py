"""Compiled kernels on disk: what numba's own cache does, with files that are looked at before they are believed.

A kept kernel is a pickle of machine code: reading one runs it. So the folder must be one that nobody else may write in
(`cache_folder.why_distrusted`), and a file begins with a digest of the rest: one that is cut, or has a bit flipped, is
noticed before it is unpickled, and compiled anew. The digest is no signature: whoever may write in the folder may write
that as well.

The cache is a convenience. Nothing that goes wrong with it is an error of the question that was asked: it is said in a
line, and the kernel is compiled.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import stat
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import CodeType

import llvmlite
from numba.core.caching import NullCache, _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from collide.cache_folder import TRUST, make_private, why_distrusted

log = logging.getLogger("collide")

#: Raised with every change of what a file holds.
_VERSION = 1
_DIGEST = hashlib.sha256().digest_size
_REMEDY = "they are compiled again in every process. Set COLLIDE_CACHE_DIR to a folder"


def kernel_cache(function: Callable, folder: Path) -> _Cache:
    """The cache of this kernel in a folder, made where it is missing; numba's null cache where it is not to be used."""
    try:
        why = why_distrusted(folder)
        if why is None:
            make_private(folder)
            why = why_distrusted(folder)  # somebody else may have made it meanwhile
    except (OSError, RuntimeError, ValueError) as error:
        say_once(f"compiled kernels cannot be kept in {folder} ({error}); {_REMEDY} that can be written.")
        return NullCache()
    if why is not None:
        say_once(f"compiled kernels are neither kept in {folder} nor read from there, for they are code: {why}; {_REMEDY} of your own.")
        return NullCache()
    return _KernelCache(function, folder)


class _KernelCache(_Cache):
    """The part of numba's interface that a dispatcher uses. One file a kernel, signature and processor."""

    def __init__(self, function: Callable, folder: Path):
        self._folder = folder
        code = function.__code__
        constants = [constant for constant in code.co_consts if not isinstance(constant, CodeType)]
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        # The folder's name stands for the package's sources; this for a function defined elsewhere.
        self._function = repr((code.co_code.hex(), code.co_names, constants, cells))
        self._name = f"{function.__module__}.{function.__qualname__}-{code.co_firstlineno}".replace("<", "").replace(">", "")

    @property
    def cache_path(self) -> str:
        return str(self._folder)

    def enable(self) -> None:
        """For numba's interface: always on."""

    def disable(self) -> None:
        """For numba's interface."""

    def flush(self) -> None:
        """For numba's interface."""

    def load_overload(self, sig, target_context):
        """What was kept for this signature, made callable; None where nothing was, or nothing that can be used."""
        target_context.refresh()
        file, key = self._place(sig, target_context.codegen())
        try:
            kept = _read(file)
            if kept is None:
                return None
            if kept[:_DIGEST] != _digest(key, kept[_DIGEST:]):
                raise ValueError("its digest is another")
            return CompileResult._rebuild(target_context, *pickle.loads(kept[_DIGEST:]))
        except Exception as error:  # noqa: BLE001 - whatever the file holds, the kernel can be compiled
            log.warning(
                "a compiled kernel in %s is damaged (%s: %s); it is compiled anew", self._folder, type(error).__name__, error
            )
            with suppress(OSError):
                file.unlink(missing_ok=True)
            return None

    def save_overload(self, sig, data) -> None:
        """Keep a kernel just compiled."""
        if data.library.has_dynamic_globals:  # addresses of this process
            return
        try:
            file, key = self._place(sig, data.codegen)
            body = dumps(data._reduce())
            _write(file, _digest(key, body) + body)
        except Exception as error:  # noqa: BLE001 - it is compiled, and that is what was asked for
            say_once(f"compiled kernels cannot be kept in {self._folder} ({error}); {_REMEDY} that can be written.")

    def _place(self, sig, codegen) -> tuple[Path, bytes]:
        """(file, all that the machine code depends on besides the folder's sources)."""
        made_by = _VERSION, sys.implementation.cache_tag, getattr(sys, "abiflags", ""), llvmlite.__version__
        key = repr((self._name, self._function, str(sig), codegen.magic_tuple(), made_by)).encode()
        return self._folder / f"{self._name}.{hashlib.sha256(key).hexdigest()[:16]}.kernel", key


def _digest(key: bytes, body: bytes) -> bytes:
    return hashlib.sha256(key + body).digest()


def _read(file: Path) -> bytes | None:
    """What a file holds, None where there is none. Raises PermissionError where somebody else may have written it."""
    try:
        with open(file, "rb") as opened:
            found = os.fstat(opened.fileno())
            if TRUST and (found.st_uid != os.geteuid() or stat.S_IMODE(found.st_mode) & 0o022):
                raise PermissionError("others may have written it")
            return opened.read()
    except FileNotFoundError:
        return None


def _write(file: Path, content: bytes) -> None:
    """Write a file so that readers see all of it or nothing."""
    handle, temporary = tempfile.mkstemp(dir=file.parent, prefix=".", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as opened:
            opened.write(content)
        os.replace(temporary, file)
    except BaseException:
        with suppress(OSError):
            os.unlink(temporary)
        raise


@cache
def say_once(message: str) -> None:
    log.warning(message)
