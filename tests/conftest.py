"""References and families of bodies beside it are importable by name, for tests are no package and not on the path; tests
whose kernels are their own are skipped where kernels come from the library."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

from collide.kernels import library
from collide.kernels.mode import COMPILED, MODE, WHY


def _register(name: str) -> None:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)


_register("naive")
_register("hull_families")
_register("reference_walk")
_register("hierarchy_families")
_register("naive_triangles")
_register("mesh_families")
_register("mesh_shapes")
_register("mesh_corruptions")
_register("surfaces")
_register("contact_oracle")
_register("contact_scenes")
_register("witness_cases")
_register("curved_cells")
_register("curved_search")
_register("curved_oracle")
_register("soak_pairs")
_register("soak_judges")
_register("soak")
_register("slider_scene")
_register("installed_copy")

OWN_KERNELS = "defines kernels of its own: COLLIDE_JIT=1 python -m pytest -m own_kernels"


def pytest_report_header() -> str:
    return f"kernels: {MODE} ({WHY or library.level})"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The library has the package's kernels and no others: see collide/kernels/mode.py."""
    if MODE == COMPILED:
        for item in items:
            if item.get_closest_marker("own_kernels"):
                item.add_marker(pytest.mark.skip(reason=OWN_KERNELS))
_register("c_library")
