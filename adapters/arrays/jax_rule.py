"""JAX's rules for distances of two bodies and of robots: a custom_vjp around a callback to the processor."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from collide.adapters.arrays.pose_gradients import distances_with_gradients
from collide.adapters.arrays.robot_gradients import robot_gradients
from collide.errors import InvalidArgument, InvalidPose, MissingExtra


def jax_distance(A, B, X_WA, X_WB, *, subgradient: bool = False):
    """Signed distances as an array with a rule for reverse derivatives; may be traced by ``jit`` and ``vmap``.

    A, B : two shapes, or sequences of N.   X_WA, X_WB : (4, 4) or (N, 4, 4) arrays of floats; a single pose goes with
    every pose of the other's batch.   subgradient : as of `torch_distance`.

    Returns (N,) [m], or () of two single poses of two shapes. Gradients as of `torch_distance`; float32 unless
    ``jax_enable_x64`` is set, and poses have to be rotations to 1e-4. Raises InvalidPose for arrays of other types.
    """
    for name, X in (("X_WA", X_WA), ("X_WB", X_WB)):
        kind = getattr(X, "dtype", type(X).__name__)
        if kind not in (np.float32, np.float64) or X.ndim not in (2, 3):
            wanted = "(4, 4) or (N, 4, 4) of float32 or float64, which carry gradients"
            raise InvalidPose(f"{name} must be {wanted}, got {kind}")
    return _with_rule(A, B, subgradient)(X_WA, X_WB)


def jax_robot_distances(checker, Q, *, max_distance: float = math.inf, per: str = "robot", between: str = "all"):
    """Distances of a robot as an array with a rule for reverse derivatives; may be traced by ``jit`` and ``vmap``.

    checker : a `collide.RobotChecker`.   Q : (N, dof) or (dof,) array of floats.   max_distance, between : as of
    `RobotChecker.distances`.   per : "robot" or "link", which have as many rows for every Q.

    Returns (N,) or (N bodies,) [m]; rows and gradients as of `torch_robot_distances`. Raises InvalidArgument for
    arrays of other types, and for ``per="pair"``.
    """
    kind = getattr(Q, "dtype", type(Q).__name__)
    if kind not in (np.float32, np.float64) or Q.ndim not in (1, 2):
        raise InvalidArgument(f"Q must be (N, dof) of float32 or float64, which carry gradients, got {kind}")
    if per not in ("robot", "link"):
        raise InvalidArgument(f'per must be "robot" or "link", whose rows are as many for every Q, got {per!r}')
    jax = _jax()
    question = {"max_distance": max_distance, "per": per, "between": between}
    width = len(checker.bodies) if per == "link" else 1

    def forward(Q):
        n = width * (len(Q) if Q.ndim == 2 else 1)

        def on_the_processor(Q):
            values, gradient, _ = robot_gradients(checker, np.asarray(Q, dtype=np.float64), question)
            return values.astype(Q.dtype), gradient.astype(Q.dtype)

        wanted = jax.ShapeDtypeStruct((n,), Q.dtype), jax.ShapeDtypeStruct((n, Q.shape[-1]), Q.dtype)
        values, gradient = jax.pure_callback(on_the_processor, wanted, Q, vmap_method="sequential")
        return values, (gradient, Q)

    def backward(residuals, by_distance):
        gradient, Q = residuals
        rows = jax.numpy.where(by_distance[:, None] == 0, 0.0, by_distance[:, None] * gradient)
        return (rows.reshape(-1, width, Q.shape[-1]).sum(1).reshape(Q.shape),)

    distances = jax.custom_vjp(lambda Q: forward(Q)[0])
    distances.defvjp(forward, backward)
    return distances(Q)


def _jax() -> Any:
    try:
        import jax
    except ImportError:
        raise MissingExtra("jax", extra="jax", purpose="differentiate distances with JAX") from None
    return jax


def _with_rule(A: Any, B: Any, subgradient: bool) -> Any:
    """The distance of two shapes as a function of poses with a rule of its own."""
    jax = _jax()
    lengths = [len(S) for S in (A, B) if isinstance(S, (list, tuple))]

    def forward(X, Y):
        sizes = [1, *lengths, *(len(pose) for pose in (X, Y) if pose.ndim == 3)]
        n = max(sizes) if min(sizes) else 0
        kind = jax.numpy.result_type(X, Y)

        def on_the_processor(X, Y):
            poses = np.asarray(X, dtype=np.float64), np.asarray(Y, dtype=np.float64)
            return tuple(part.astype(kind) for part in distances_with_gradients(A, B, *poses, subgradient))

        wanted = [jax.ShapeDtypeStruct((n, *inner), kind) for inner in ((), (4, 4), (4, 4))]
        values, of_x, of_y = jax.pure_callback(on_the_processor, tuple(wanted), X, Y, vmap_method="sequential")
        single = X.ndim == Y.ndim == 2 and not lengths
        return (values[0] if single else values), (of_x, of_y, X, Y)

    def backward(residuals, by_distance):
        of_x, of_y, X, Y = residuals
        grown = by_distance.reshape(-1, 1, 1)

        def by(entries, pose):
            product = grown * entries
            product = product if pose.ndim == 3 and len(pose) == len(product) else product.sum(0)
            return product.reshape(pose.shape).astype(pose.dtype)

        return by(of_x, X), by(of_y, Y)

    distance = jax.custom_vjp(lambda X, Y: forward(X, Y)[0])
    distance.defvjp(forward, backward)
    return distance
