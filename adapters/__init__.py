"""Bridges between collide and other libraries; nothing third-party is imported before it is asked for.

`collide.adapters.peers` asks other engines the same questions and compares the answers;
`collide.adapters.hosts` lets programs written for another engine run on collide;
`collide.adapters.arrays` has distances with gradients for PyTorch and JAX;
`collide.adapters.planning` gives planners of others our checks and proofs;
`collide.adapters.view(world)` shows a World in a browser, and follows it;
`collide.adapters.to_viser`, `to_rerun` and `to_foxglove` show Worlds, reports and trajectories in those viewers.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collide.adapters.live.world_viewer import WorldViewer, view
    from collide.adapters.viewers.foxglove_log import to_foxglove
    from collide.adapters.viewers.rerun_log import to_rerun
    from collide.adapters.viewers.viser_view import to_viser

__all__ = ["WorldViewer", "to_foxglove", "to_rerun", "to_viser", "view"]

_HOME = {
    "WorldViewer": "live.world_viewer", "view": "live.world_viewer", "to_viser": "viewers.viser_view",
    "to_rerun": "viewers.rerun_log", "to_foxglove": "viewers.foxglove_log",
}


#: Modules that are reached by name alone: ``collide.adapters.hosts.mujoco``.
_MODULES = ("arrays", "fuzzing", "hosts", "live", "peers", "planning", "viewers")


def __getattr__(name: str):
    if name in _MODULES:
        return import_module(f"collide.adapters.{name}")
    if name not in _HOME:
        raise AttributeError(f"module 'collide.adapters' has no attribute {name!r}")
    value = getattr(import_module(f"collide.adapters.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
