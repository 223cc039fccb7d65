"""Distances with gradients for PyTorch and JAX, judged by the libraries' own checkers and by differences."""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.adapters.arrays.pose_gradients import distances_with_gradients
from collide.errors import InvalidPose
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape

ROUND = collide.Ellipsoid((0.3, 0.2, 0.5)), collide.Capsule(0.1, 0.4)
EDGED = collide.ConvexHull(np.random.default_rng(3).normal(size=(14, 3))), collide.Box((0.6, 0.5, 0.4))
PAIRS = {"round": ROUND, "edged": EDGED, "box and ball": (collide.Box((1.0, 0.8, 0.6)), collide.Sphere(0.2))}


def library(name: str):
    return pytest.importorskip(name, reason=f"{name} is not installed: pip install 'collide-robotics[{name}]'")


def parameters(seed: int, n: int) -> np.ndarray:
    """(n, 7) translations, most of them apart, and quaternions of any length, scalar first."""
    rng = np.random.default_rng(seed)
    p = rng.normal(size=(n, 3))
    p *= rng.uniform(1.9, 3.0, (n, 1)) / np.linalg.norm(p, axis=1, keepdims=True)
    return np.hstack([p, rng.normal(size=(n, 4))])


def as_matrices(xp, rows):
    """Poses (n, 4, 4) of rows (n, 7), by the operations of a library."""
    q = rows[:, 3:] / xp.sqrt((rows[:, 3:] ** 2).sum(-1))[:, None]
    w, x, y, z = (q[:, k] for k in range(4))
    zero, one = xp.zeros_like(w), xp.ones_like(w)
    entries = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), rows[:, 0],
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), rows[:, 1],
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), rows[:, 2],
        zero, zero, zero, one,
    ]
    return xp.stack(entries, -1).reshape(-1, 4, 4)


@pytest.mark.parametrize("pair", PAIRS)
def test_gradients_by_entries_are_tangential_and_those_of_differences(pair):
    """Along any curve of rotations and shifts the gradient's product with the velocity is the derivative."""
    A, B = PAIRS[pair]
    X, Y = as_matrices(np, parameters(1, 40)), as_matrices(np, parameters(2, 40))
    X[:, :3, 3] *= 0.1
    values, of_x, of_y = distances_with_gradients(A, B, X, Y)
    assert np.array_equal(values, collide.distance(A, B, X, Y).distance) and (values > 0).mean() > 0.8
    rng, h = np.random.default_rng(5), 1e-6
    for side, gradient in ((0, of_x), (1, of_y)):
        for _ in range(4):
            omega, shift = rng.normal(size=(2, 3))
            ends = []
            for step in (h, -h):
                moved = [X.copy(), Y.copy()]
                turn = collide.pose(R=_exponential(step * omega))[:3, :3]
                moved[side][:, :3, :3] = turn @ moved[side][:, :3, :3]
                moved[side][:, :3, 3] += step * shift
                ends.append(collide.distance(A, B, *moved).distance)
            velocity = np.zeros((len(X), 4, 4))
            velocity[:, :3, :3] = np.cross(omega[None, :, None], (X, Y)[side][:, :3, :3], axis=1)
            velocity[:, :3, 3] = shift
            by_gradient = (gradient * velocity).sum(axis=(1, 2))
            assert np.abs(by_gradient - (ends[0] - ends[1]) / (2 * h)).max() < 1e-6
        symmetric = np.swapaxes((X, Y)[side][:, :3, :3], 1, 2) @ gradient[:, :3, :3]
        assert np.abs(symmetric + np.swapaxes(symmetric, 1, 2)).max() < 1e-12  # in the tangent space
        assert not gradient[:, 3].any()


def _exponential(omega: np.ndarray) -> np.ndarray:
    angle, (x, y, z) = np.linalg.norm(omega), omega
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / angle
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


# --- PyTorch ------------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", PAIRS)
def test_torch_checks_its_gradients(pair):
    torch = library("torch")
    from collide.adapters.arrays import torch_distance

    A, B = PAIRS[pair]
    rows_a, rows_b = (torch.tensor(parameters(seed, 6), requires_grad=True) for seed in (7, 8))
    with torch.no_grad():
        rows_a[:, :3] *= 0.1

    def distance(a, b):
        return torch_distance(A, B, as_matrices(torch, a), as_matrices(torch, b))

    assert torch.autograd.gradcheck(distance, (rows_a, rows_b), eps=1e-6, atol=1e-6)
    one = rows_a[:1].detach().requires_grad_()  # a pose for all of the other body's, and a single pair
    assert torch.autograd.gradcheck(lambda a: distance(a, rows_b.detach()), (one,), eps=1e-6, atol=1e-6)
    assert torch.autograd.gradcheck(
        lambda a: torch_distance(A, B, as_matrices(torch, a)[0], as_matrices(torch, rows_b.detach())[0]), (one,),
        eps=1e-6, atol=1e-6,
    )


def test_torch_keeps_types_and_refuses_by_name():
    torch = library("torch")
    from collide.adapters.arrays import torch_distance

    A, B = PAIRS["round"]
    X = torch.eye(4).requires_grad_()
    Y = as_matrices(torch, torch.tensor(parameters(9, 5)))
    value = torch_distance(A, B, X, Y.float())
    value.sum().backward()
    assert value.dtype == X.grad.dtype == torch.float32 and X.grad.shape == (4, 4) and X.grad.abs().sum() > 0
    assert torch_distance(A, B, X, Y).dtype == torch.float64 and torch_distance(A, B, X, Y[0]).shape == ()
    assert torch_distance(A, B, X, Y[:0]).shape == (0,)
    for bad, words in (
        (torch.eye(4, dtype=torch.int64), "must be a tensor of float32 or float64"), (torch.eye(4).half(), "float16"),
        (np.eye(4), "got ndarray"), (torch.empty(4, 4, device="meta"), r"on the device meta: hand in X_WB\.cpu\(\)"),
    ):
        with pytest.raises(InvalidPose, match=f"X_WB.*{words}"):
            torch_distance(A, B, X, bad)
    first = torch.autograd.grad(torch_distance(A, B, X, Y).sum() ** 2, X, create_graph=True)[0]
    with pytest.raises(RuntimeError, match="once_differentiable"):
        first.sum().backward()


def test_without_a_derivative_nan_or_an_active_gradient():
    """Two boxes face to face: nearest points are not unique, and turning one has no derivative."""
    torch = library("torch")
    from collide.adapters.arrays import torch_distance

    box, X = collide.Box((1, 1, 1)), torch.tensor(collide.pose((0, 0, 2.0)), requires_grad=True)
    eye = torch.eye(4, dtype=torch.float64)
    torch_distance(box, box, eye, X).backward()
    assert torch.isnan(X.grad[:3]).any()
    X.grad = None
    torch_distance(box, box, eye, X, subgradient=True).backward()
    assert X.grad[2, 3] == 1.0 and torch.isfinite(X.grad).all()


# --- JAX ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("pair", PAIRS)
def test_jax_checks_its_gradients(pair):
    jax = library("jax")
    from jax.test_util import check_grads

    from collide.adapters.arrays import jax_distance

    A, B = PAIRS[pair]
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        rows_a, rows_b = (jax.numpy.asarray(parameters(seed, 5)) for seed in (7, 8))
        rows_a = rows_a.at[:, :3].multiply(0.1)

        def distance(a, b):
            return jax_distance(A, B, as_matrices(jax.numpy, a), as_matrices(jax.numpy, b))

        check_grads(distance, (rows_a, rows_b), order=1, modes=["rev"], eps=1e-6, atol=1e-5, rtol=1e-5)
        check_grads(lambda a: distance(a, rows_b), (rows_a[:1],), order=1, modes=["rev"], eps=1e-6, atol=1e-5)
        by_rows = jax.jit(jax.grad(lambda a: distance(a, rows_b).sum()))(rows_a)
        X, Y = as_matrices(jax.numpy, rows_a), as_matrices(jax.numpy, rows_b)
        one = jax.grad(lambda a: jax_distance(A, B, as_matrices(jax.numpy, a[None])[0], Y[0]))(rows_a[0])
        assert np.allclose(by_rows[0], one, atol=1e-12) and np.abs(by_rows).max() > 0.1
        mapped = jax.vmap(lambda X, Y: jax_distance(A, B, X, Y))(X, Y)
        assert np.array_equal(mapped, collide.distance(A, B, X, Y).distance)
    finally:
        jax.config.update("jax_enable_x64", before)


def test_jax_refuses_by_name():
    jax = library("jax")
    from collide.adapters.arrays import jax_distance

    xp = jax.numpy
    for bad, words in ((xp.eye(4, dtype=int), "got int"), (xp.eye(4)[0], r"\(N, 4, 4\)"), ([1.0], "got list")):
        with pytest.raises(InvalidPose, match=f"X_WA must be.*{words}"):
            jax_distance(*ROUND, bad, jax.numpy.eye(4))


# --- robots ----------------------------------------------------------------------------------------


def arm_of_two() -> collide.RobotChecker:
    """Two links that turn beside a ball and a box; every pair is a gap of round or edged bodies."""
    joints = [
        Joint("shoulder", "revolute", "base", "upper", axis=np.array([0, 0, 1.0]), lower=-3.0, upper=3.0),
        Joint("elbow", "revolute", "upper", "lower", collide.pose((0.5, 0, 0)), np.array([0, 1.0, 0]), -2.0, 2.0),
    ]
    along = collide.pose((0.25, 0, 0), rpy=(0, np.pi / 2, 0))
    upper, lower = (LinkShape(S, along, None, "") for S in (collide.Capsule(0.05, 0.3), collide.Cylinder(0.04, 0.3)))
    shapes = {"upper": [upper], "lower": [lower]}
    world = collide.World()
    world.add(collide.Sphere(0.1), collide.pose((0.4, 0.6, 0.3)), name="ball")
    world.add(collide.Box((0.2, 0.2, 0.2)), collide.pose((0.7, -0.5, 0.4), rpy=(0.3, 0.2, 0.1)), name="box")
    return collide.RobotChecker(collide.Robot("arm", ["base", "upper", "lower"], joints, shapes), world)


QS = np.random.default_rng(7).uniform(-0.8, 0.8, (5, 2))


def test_torch_of_robots():
    torch = library("torch")
    from collide.adapters.arrays import torch_robot_distances

    checker = arm_of_two()
    Q = torch.tensor(QS, requires_grad=True)
    for per, n in (("robot", 5), ("link", 10), ("pair", 20)):
        told = torch_robot_distances(checker, Q, per=per, between="world")
        measured = checker.distances(QS, per=per, between="world")
        assert told.shape == (n,) and np.array_equal(told.detach(), measured.distance)
        assert torch.autograd.gradcheck(
            lambda Q, per=per: torch_robot_distances(checker, Q, per=per, between="world"), (Q,), atol=1e-5
        )
    limit = float(np.median(checker.distances(QS, per="link", between="world").distance))
    near = torch_robot_distances(checker, Q, per="link", between="world", max_distance=limit)
    assert (near == limit).sum() == 5
    (slope,) = torch.autograd.grad(torch.relu(0.9 * limit - near).sum(), Q)
    assert torch.isfinite(slope).all() and slope.any()
    (single,) = torch.autograd.grad(torch_robot_distances(checker, Q[0]).sum(), Q)
    assert single[0].any() and not single[1:].any()


def test_jax_of_robots():
    jax = library("jax")
    from jax.test_util import check_grads

    from collide.adapters.arrays import jax_robot_distances

    checker = arm_of_two()
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    try:
        Q = jax.numpy.asarray(QS)
        told = jax.jit(lambda Q: jax_robot_distances(checker, Q, per="link", between="world"))(Q)
        assert np.array_equal(np.asarray(told), checker.distances(QS, per="link", between="world").distance)
        for per in ("robot", "link"):
            check_grads(lambda Q, per=per: jax_robot_distances(checker, Q, per=per, between="world"), (Q,), 1, ["rev"])
        with pytest.raises(collide.InvalidArgument, match="per must be"):
            jax_robot_distances(checker, Q, per="pair")
    finally:
        jax.config.update("jax_enable_x64", before)


def test_tensors_of_robots_that_carry_no_gradient_are_refused():
    torch = library("torch")
    from collide.adapters.arrays import torch_robot_distances

    with pytest.raises(collide.InvalidArgument, match="Q must be a tensor of float32 or float64"):
        torch_robot_distances(arm_of_two(), torch.zeros(2, dtype=torch.int64))
