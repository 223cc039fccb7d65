"""Where a box stands, learned from touches in PyTorch: a ball was pushed down to contact forty times."""

import numpy as np
import torch

import collide
from collide.adapters.arrays import torch_distance
from collide.base.poses_at import poses_at

BOX, PROBE, NOISE = collide.Box((0.3, 0.2, 0.1)), collide.Sphere(0.01), 1e-4  # [m]
X_true = collide.pose((0.52, -0.08, 0.06), rpy=(0.1, -0.15, 0.6))

# Touches: the ball comes from outside towards the box, and stops where a cast says that the two meet.
rng = np.random.default_rng(0)
outside = rng.normal(size=(40, 3))
outside = X_true[:3, 3] + 0.5 * outside / np.linalg.norm(outside, axis=1, keepdims=True)
inwards = X_true[:3, 3] + rng.uniform(-1, 1, (40, 3)) * [0.1, 0.06, 0.03] - outside
casts = collide.shape_cast(PROBE, poses_at(outside), inwards, BOX, X_true)
touches = torch.from_numpy(poses_at(outside + casts.distance[:, None] * inwards + NOISE * rng.normal(size=(40, 3))))

position = torch.tensor([0.45, 0.0, 0.0], dtype=torch.float64, requires_grad=True)
quaternion = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64, requires_grad=True)


def pose():
    w, x, y, z = quaternion / quaternion.norm()
    R = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
         2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
         2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return torch.cat([torch.cat([torch.stack(R).reshape(3, 3), position[:, None]], 1), torch.eye(4)[3:]])


def loss():
    """Touching bodies are at distance 0; where a ball's nearest points jump, any of the active gradients serves."""
    optimiser.zero_grad()
    value = (1e3 * torch_distance(BOX, PROBE, pose(), touches, subgradient=True)).square().mean()
    value.backward()
    return value


optimiser = torch.optim.LBFGS([position, quaternion], max_iter=20, line_search_fn="strong_wolfe")
corners = np.array([[*corner, 2.0] for corner in np.ndindex(2, 2, 2)]) * 0.5 * [0.6, 0.4, 0.2, 1] - [0.15, 0.1, 0.05, 0]
for _ in range(5):
    off = np.linalg.norm((corners @ (pose().detach().numpy() - X_true).T)[:, :3], axis=1).max()
    print(f"the box is {1e3 * off:.3f} mm off, balls are {optimiser.step(loss).item()**0.5:.3f} mm from it")
