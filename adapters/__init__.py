"""Bridges between collide and other libraries; nothing third-party is imported before it is asked for.

`collide.adapters.peers` asks other engines the same questions and compares the answers;
`collide.adapters.hosts` lets programs written for another engine run on collide;
`collide.adapters.arrays` has distances with gradients for PyTorch and JAX;
`collide.adapters.planning` gives planners of others our checks and proofs;
`collide.adapters.view(world)` shows a World in a browser, and follows it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collide.adapters.live.world_viewer import WorldViewer, view

__all__ = ["WorldViewer", "view"]

_HOME = dict.fromkeys(__all__, "collide.adapters.live.world_viewer")


#: Modules that are reached by name alone: ``collide.adapters.hosts.mujoco``.
_MODULES = ("arrays", "fuzzing", "hosts", "live", "peers", "planning")


def __getattr__(name: str):
    if name in _MODULES:
        return import_module(f"collide.adapters.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'collide.adapters' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
