"""Oracles and families are importable by name from any test, for tests are no package; tests whose kernels are their own
are skipped where kernels come from the library."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from collide.kernels import library
from collide.kernels.mode import COMPILED, MODE, WHY

HERE = Path(__file__).resolve().parent
#: Every module below this folder that is no test. They have one name each, for all their folders are on the path.
HELPERS = sorted(file for file in HERE.glob("*/**/*.py") if not file.name.startswith("test_"))
sys.path += sorted({str(file.parent) for file in HELPERS})

OWN_KERNELS = "defines kernels of its own: COLLIDE_JIT=1 python -m pytest -m own_kernels"


def pytest_report_header() -> str:
    return f"kernels: {MODE} ({WHY or library.level})"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The library has the package's kernels and no others: see collide/kernels/mode.py."""
    if MODE == COMPILED:
        for item in items:
            if item.get_closest_marker("own_kernels"):
                item.add_marker(pytest.mark.skip(reason=OWN_KERNELS))
