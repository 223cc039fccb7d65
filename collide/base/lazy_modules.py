"""Modules of kernels that a light module may need later: named where it imports, loaded when first used.

Shapes can be made and certificates verified without any kernel. What a shape computes on request, its hull or the tree
over its facets, takes kernels, and these are loaded then. Scientific Python's lazy-loader has this for modules and for
the names of a package, but would be a second package that every installation needs, where numpy is the only one.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


class LazyModule:
    """Stands for the module of this name: an attribute is the module's, which is imported for it."""

    def __init__(self, name: str):
        self._name = name

    def __getattr__(self, attribute: str) -> Any:
        return getattr(import_module(self._name), attribute)


def lazy_module(name: str) -> Any:
    """The module, to be imported when an attribute of it is first used. A test counts it as an import."""
    return LazyModule(name)
