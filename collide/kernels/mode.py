"""How kernels run in this process, decided once, before the first of them is defined.

COMPILED : in the library that was made when the package was built. Neither Numba nor LLVM is in the process.
JUST_IN_TIME : compiled by Numba and LLVM at their first call, and kept on disk. For checkouts whose sources differ from
    those of the library, for installations without one, and where ``COLLIDE_JIT=1`` asks for it.
PYTHON : as the Python that they are written in: ``NUMBA_DISABLE_JIT=1``, for coverage and debugging.
"""

from __future__ import annotations

import os

from collide.kernels import library

COMPILED, JUST_IN_TIME, PYTHON = "compiled", "just in time", "python"


def _chosen() -> tuple[str, str]:
    """(mode, why)."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        return PYTHON, "NUMBA_DISABLE_JIT is set"
    if os.environ.get("COLLIDE_JIT", "0") not in ("", "0"):
        return JUST_IN_TIME, "COLLIDE_JIT is set"
    why_not = library.load()
    return (JUST_IN_TIME, why_not) if why_not else (COMPILED, "")


#: How kernels run, and why they are not `COMPILED`.
MODE, WHY = _chosen()
#: Whether kernels are what Numba makes of them: their own types and intrinsics are there.
WITH_NUMBA = MODE == JUST_IN_TIME
PLAIN_PYTHON = MODE == PYTHON
