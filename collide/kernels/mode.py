"""How kernels run in this process, decided once, before the first kernel is defined.

COMPILED : in the library made when the package was built. Neither Numba nor LLVM is in the process.
JUST_IN_TIME : compiled by Numba and LLVM at their first call, and kept on disk. For kernels edited since the
    library was made, all others coming from the library; for installations without a library; and for all kernels with
    ``COLLIDE_JIT=1``.
PYTHON : as plain Python: ``NUMBA_DISABLE_JIT=1``, for coverage and debugging.
"""

from __future__ import annotations

import os

from collide.base.log import log
from collide.errors import MissingExtra
from collide.kernels import library

COMPILED, JUST_IN_TIME, PYTHON = "compiled", "just in time", "python"


def _asked(name: str) -> bool:
    return os.environ.get(name, "0") not in ("", "0")


def _choose_mode() -> tuple[str, str]:
    """(mode, why). Raises MissingExtra where neither a usable library nor a compiler is installed."""
    if _asked("NUMBA_DISABLE_JIT"):
        return PYTHON, "NUMBA_DISABLE_JIT is set"
    forced = _asked("COLLIDE_JIT")
    why = "COLLIDE_JIT is set" if forced else library.load()
    if not why:
        return COMPILED, ""
    try:
        import numba  # noqa: F401
    except ImportError as error:
        raise MissingExtra("numba", extra="jit", purpose=f"compile kernels at their first call ({why})") from error
    if not forced and library.exists():
        log.warning("kernels of the library are not%s used: %s", " all" if library.glue else "", why)
    return JUST_IN_TIME, why


#: How kernels run, and why they are not `COMPILED`.
MODE, WHY = _choose_mode()
#: Whether kernels are what Numba makes of them: their own types and intrinsics are there.
WITH_NUMBA = MODE == JUST_IN_TIME
PLAIN_PYTHON = MODE == PYTHON


def describe_mode() -> str:
    """The mode in words: ``library, v4``."""
    return f"library, {library.level}" if MODE == COMPILED else MODE
