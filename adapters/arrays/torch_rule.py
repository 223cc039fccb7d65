"""PyTorch's rule for the distance of two bodies: an autograd function."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from collide.adapters.arrays.pose_gradients import distances_with_gradients
from collide.errors import InvalidPose, MissingExtra
from collide.shapes.shape import Shape


@cache
def _rule() -> tuple[Any, Any]:
    """(the module torch, the autograd function)."""
    try:
        import torch
    except ImportError:
        raise MissingExtra("torch", extra="torch", purpose="differentiate distances with PyTorch") from None

    class Distance(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, A, B, X_WA, X_WB, subgradient):
            X, Y = (np.asarray(pose.detach(), dtype=np.float64) for pose in (X_WA, X_WB))
            values, *gradients = distances_with_gradients(A, B, X, Y, subgradient)
            ctx.save_for_backward(*(torch.from_numpy(G).to(X.dtype) for G, X in zip(gradients, (X_WA, X_WB))))
            ctx.shapes = X_WA.shape, X_WB.shape
            made = torch.from_numpy(np.array(values)).to(torch.promote_types(X_WA.dtype, X_WB.dtype))
            is_single = X_WA.ndim == X_WB.ndim == 2 and isinstance(A, Shape) and isinstance(B, Shape)
            return made.reshape(()) if is_single else made

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, by_distance):
            grown = by_distance.reshape(-1, 1, 1)
            by_pose = (grown.to(G.dtype) * G for G in ctx.saved_tensors)
            summed = [
                G if len(shape) == 3 and len(G) == shape[0] else G.sum(0).reshape(shape)
                for G, shape in zip(by_pose, ctx.shapes)
            ]
            return None, None, *summed, None

    return torch, Distance


def torch_distance(A, B, X_WA, X_WB, *, subgradient: bool = False):
    """Signed distances as a tensor with gradients by the poses.

    A, B : two shapes, or sequences of N.   X_WA, X_WB : (4, 4) or (N, 4, 4) tensors of floats in the processor's
    memory; a single pose goes with every pose of the other's batch.   subgradient : where the distance has no
    derivative, the first of its active gradients; NaN otherwise.

    Returns (N,) [m], or () of two single poses of two shapes. Gradients are of first order; by entries of a rotation R
    tangential, ½ [g]× R (`pose_gradients.py`). Raises InvalidPose for tensors on other devices or of other types.
    """
    torch, distance = _rule()
    for name, X in (("X_WA", X_WA), ("X_WB", X_WB)):
        if not isinstance(X, torch.Tensor) or X.dtype not in (torch.float32, torch.float64):
            got = X.dtype if isinstance(X, torch.Tensor) else type(X).__name__
            raise InvalidPose(f"{name} must be a tensor of float32 or float64, which carry gradients, got {got}")
        if X.device.type != "cpu":
            raise InvalidPose(f"{name} is on the device {X.device}: hand in {name}.cpu(), through which gradients pass")
    return distance.apply(A, B, X_WA, X_WB, subgradient)
