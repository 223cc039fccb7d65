"""Makes the references and families of bodies beside it importable by name: tests are no package and not on the path."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path


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
_register("c_library")
