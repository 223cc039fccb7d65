"""Copies of the installed package, to be damaged, and processes that use them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import collide
import collide.adapters
import collide.scenes
from collide.kernels import library

PACKAGE = Path(collide.__file__).parent
#: What the mode of a process depends on.
_MODE = ("COLLIDE_JIT", "COLLIDE_CPU", "NUMBA_DISABLE_JIT")


def copied(to: Path) -> Path:
    """The package as an installation has it, in a folder of its own: what goes on PYTHONPATH."""
    unwanted = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, to / "collide", ignore=unwanted)
    for module in (collide.adapters, collide.scenes):  # elsewhere in a checkout
        shutil.copytree(
            Path(module.__file__).parent,
            to / "collide" / module.__name__.split(".")[1],
            ignore=unwanted,
            dirs_exist_ok=True,
        )
    return to


def environment(site: Path, *before: Path, **more: str) -> dict[str, str]:
    """For a process that takes its mode from the package under ``site`` and from nothing else but ``more``."""
    kept = {name: value for name, value in os.environ.items() if name not in _MODE}
    return {**kept, "PYTHONPATH": os.pathsep.join(map(str, (*before, site))), "PYTHONDONTWRITEBYTECODE": "1", **more}


def child(given: list[str], env: dict[str, str], timeout: float = 300) -> subprocess.CompletedProcess[str]:
    """Python with these arguments, run elsewhere than in the checkout."""
    return subprocess.run(
        [sys.executable, *given], env=env, cwd=env["PYTHONPATH"].split(os.pathsep)[-1], capture_output=True, text=True,
        timeout=timeout, check=False,
    )


def why_no_library() -> str:
    """Why tests of the library have nothing to test here; empty where they have."""
    if not library.exists():
        return "this installation was built without compiled kernels"
    return "" if library.fits_sources() else "kernels were edited since the library was built: build it again"
