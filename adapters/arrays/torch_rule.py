"""PyTorch's rules for distances of two bodies and of robots: autograd functions."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from collide.adapters.arrays.pose_gradients import distances_with_gradients
from collide.adapters.arrays.robot_gradients import robot_gradients
from collide.errors import CollideError, InvalidArgument, InvalidPose, MissingExtra
from collide.shapes.shape import Shape


@cache
def _rules() -> tuple[Any, Any, Any]:
    """(the module torch, the autograd functions of pairs and of robots)."""
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

    class RobotDistances(torch.autograd.Function):
        @staticmethod
        def forward(ctx: Any, checker, Q, question):
            values, gradient, of = robot_gradients(checker, np.asarray(Q.detach(), dtype=np.float64), question)
            ctx.save_for_backward(torch.from_numpy(gradient).to(Q.dtype), torch.from_numpy(of))
            ctx.shape = Q.shape
            return torch.from_numpy(values).to(Q.dtype)

        @staticmethod
        @torch.autograd.function.once_differentiable
        def backward(ctx: Any, by_distance):
            gradient, of = ctx.saved_tensors
            rows = torch.where(by_distance[:, None] == 0, 0.0, by_distance[:, None] * gradient)
            summed = torch.zeros(ctx.shape[-2:] if len(ctx.shape) == 2 else (1, *ctx.shape), dtype=gradient.dtype)
            return None, summed.index_add(0, of, rows).reshape(ctx.shape), None

    return torch, Distance, RobotDistances


def torch_distance(A, B, X_WA, X_WB, *, subgradient: bool = False):
    """Signed distances as a tensor with gradients by the poses.

    A, B : two shapes, or sequences of N.   X_WA, X_WB : (4, 4) or (N, 4, 4) tensors of floats in the processor's
    memory; a single pose goes with every pose of the other's batch.   subgradient : where the distance has no
    derivative, the first of its active gradients; NaN otherwise.

    Returns (N,) [m], or () of two single poses of two shapes. Gradients are of first order; by entries of a rotation R
    tangential, ½ [g]× R (`pose_gradients.py`). Raises InvalidPose for tensors on other devices or of other types.
    """
    torch, distance, _ = _rules()
    for name, X in (("X_WA", X_WA), ("X_WB", X_WB)):
        _check(torch, name, X, InvalidPose)
    return distance.apply(A, B, X_WA, X_WB, subgradient)


def torch_robot_distances(checker, Q, *, max_distance: float = math.inf, per: str = "robot", between: str = "all"):
    """Distances of a robot as a tensor with gradients by q.

    checker : a `collide.RobotChecker`.   Q : (N, dof) or (dof,) tensor of floats in the processor's memory.
    max_distance, per, between : as of `RobotChecker.distances`.

    Returns (M,) [m], the rows of `RobotChecker.distances` in order: N, N bodies, or all pairs, as ``per`` says. A row
    beyond ``max_distance`` is this distance, with a gradient of 0. Where a distance has no derivative its gradient is
    NaN, unless what is handed back for the row is 0: a hinge on the clearance meets no NaN of far pairs. Raises
    InvalidArgument for tensors on other devices or of other types.
    """
    torch, _, distances = _rules()
    _check(torch, "Q", Q, InvalidArgument)
    return distances.apply(checker, Q, {"max_distance": max_distance, "per": per, "between": between})


def _check(torch: Any, name: str, X: Any, error: type[CollideError]) -> None:
    if not isinstance(X, torch.Tensor) or X.dtype not in (torch.float32, torch.float64):
        got = X.dtype if isinstance(X, torch.Tensor) else type(X).__name__
        raise error(f"{name} must be a tensor of float32 or float64, which carry gradients, got {got}")
    if X.device.type != "cpu":
        raise error(f"{name} is on the device {X.device}: hand in {name}.cpu(), through which gradients pass")
