"""Oracles and families are importable by name from any test, for tests are no package; tests that need kernels of
another kind than this process has are skipped."""

from __future__ import annotations

import gc
import os
import sys
from pathlib import Path

# Tests run in processes, one a core: threads of BLAS would only wait for each other, and cost a core while they do.
os.environ["OPENBLAS_NUM_THREADS"] = "1"

import pytest

from collide.kernels import library
from collide.kernels.mode import COMPILED, JUST_IN_TIME, MODE, PLAIN_PYTHON, WHY

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE))
pytest_plugins = ["tiers", "time_budget"]
#: Every module below this folder that is no test. They have one name each, for all their folders are on the path.
HELPERS = sorted(file for file in HERE.glob("*/**/*.py") if not file.name.startswith("test_"))
sys.path += sorted({str(file.parent) for file in HELPERS})

#: Marks of tests, the mode of kernels in which each is skipped, and how to run it then.
SKIPPED = {
    "own_kernels": (COMPILED, "defines kernels of its own: COLLIDE_JIT=1 python -m pytest -m own_kernels"),
    "plain_kernels": (
        JUST_IN_TIME,
        "calls kernels as plain Python: NUMBA_DISABLE_JIT=1 python -m pytest -m plain_kernels",
    ),
}


def pytest_configure(config: pytest.Config) -> None:
    """Machine code divides by zero and overflows without a word; as Python, with numpy's numbers, kernels are
    warned. Files are handed to processes in order of their names: in order of their numbers of tests, which is the
    default, a long file of few tests would be the last, and all but one process would wait for it."""
    if hasattr(config.option, "loadscopereorder"):
        config.option.loadscopereorder = False
    if PLAIN_PYTHON:
        config.addinivalue_line("filterwarnings", "ignore::RuntimeWarning")


@pytest.hookimpl(optionalhook=True)  # xdist is not everywhere
def pytest_xdist_make_scheduler(config: pytest.Config, log):
    """A process a file, and for all files that read the sources of the house the same process: each source is parsed
    once."""
    if config.getoption("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class OfFiles(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = nodeid.split("::")[0]
            return "tests/house" if file.startswith("tests/house/") else file

    return OfFiles(config, log)


@pytest.hookimpl(wrapper=True)
def pytest_collection(session: pytest.Session):
    """What is made while tests are collected stays: looking through it for garbage again and again would take a third
    of the time, and a twelfth of the tests' time after it. Frozen, a test that collects does not look at it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(100_000, 20, 20)
        gc.enable()


def pytest_report_header() -> str:
    return f"kernels: {MODE} ({WHY or library.level})"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The library has the package's entries and no others, and what only kernels call stays Python beside it: see
    collide/kernels/mode.py. Compiled just in time, it cannot be called."""
    for name, (mode, reason) in SKIPPED.items():
        if mode == MODE:
            for item in items:
                if item.get_closest_marker(name):
                    item.add_marker(pytest.mark.skip(reason=reason))
