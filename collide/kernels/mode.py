"""How kernels run in this process, decided once, before the first of them is defined.

COMPILED : in the library that was made when the package was built. Neither Numba nor LLVM is in the process.
JUST_IN_TIME : compiled by Numba and LLVM at their first call, and kept on disk. For kernels that were edited since the
    library was made, the others being its; for installations without one; and for all where ``COLLIDE_JIT=1`` asks for
    it.
PYTHON : as the Python that they are written in: ``NUMBA_DISABLE_JIT=1``, for coverage and debugging.
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
    """(mode, why). Raises MissingExtra where there is neither a library that can be used nor a compiler."""
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
