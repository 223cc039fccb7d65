"""Modules of kernels for a light module's later use: named at the import, loaded at the first use.

Shapes can be made and certificates verified without any kernel. A shape's hull or the tree
over its facets, computed on request, takes kernels, loaded at the request. Scientific Python's lazy-loader does the
same for modules and for the names of a package, but would be a second required package beside numpy.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class LazyModule:
    """Stands for the module of this name: the first access of an attribute imports the module."""

    def __init__(self, name: str):
        self._name = name
        self._module: Any = None

    def __getattr__(self, attribute: str) -> Any:
        if self._module is None:  # another thread may be importing it: the import waits until the module is whole
            self._module = import_module(self._name)
        return getattr(self._module, attribute)


def lazy_module(name: str) -> Any:
    """The module, imported at the first access of an attribute. A test counts the call as an import."""
    return LazyModule(name)
