"""Distances with gradients for PyTorch and JAX, each loaded when first used: of pairs by `torch_distance` and
`jax_distance`, of a robot by `torch_robot_distances` and `jax_robot_distances`."""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "torch_distance": "torch_rule", "torch_robot_distances": "torch_rule", "jax_distance": "jax_rule",
    "jax_robot_distances": "jax_rule",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
