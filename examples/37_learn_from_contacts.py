"""Where a box stands, learned from touches: a ball was pushed down to contact forty times, to a tenth of a millimetre.

    python examples/37_learn_from_contacts.py [learned.png]    # needs PyTorch; a picture where matplotlib is installed
"""

import sys

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
aims = X_true[:3, 3] + rng.uniform(-1, 1, (40, 3)) * [0.1, 0.06, 0.03]
inwards = (aims - outside) / np.linalg.norm(aims - outside, axis=1, keepdims=True)
casts = collide.shape_cast(PROBE, poses_at(outside), inwards, BOX, X_true)
centers = outside + casts.distance[:, None] * inwards + NOISE * rng.normal(size=(40, 3))
touches = torch.from_numpy(poses_at(centers))

position = torch.tensor([0.45, 0.0, 0.0], dtype=torch.float64, requires_grad=True)
quaternion = torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64, requires_grad=True)


def pose():
    w, x, y, z = quaternion / quaternion.norm()
    rows = [
        1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), position[0],
        2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), position[1],
        2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y), position[2],
        *torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64),
    ]
    return torch.stack(rows).reshape(4, 4)


def off():
    """How far the learned box is from the true one [m], at its farthest corner."""
    corners = np.array([*np.ndindex(2, 2, 2)]) * [0.3, 0.2, 0.1] - [0.15, 0.1, 0.05]
    learned = pose().detach().numpy()
    difference = corners @ (learned[:3, :3] - X_true[:3, :3]).T + learned[:3, 3] - X_true[:3, 3]
    return float(np.linalg.norm(difference, axis=1).max())


optimiser = torch.optim.LBFGS([position, quaternion], max_iter=20, line_search_fn="strong_wolfe")
errors = [off()]


def loss():
    """Touching bodies are at distance 0; where a ball's nearest points jump, any of the active gradients serves."""
    optimiser.zero_grad()
    value = (1e3 * torch_distance(BOX, PROBE, pose(), touches, subgradient=True)).square().mean()
    value.backward()
    return value


for _ in range(12):
    last = optimiser.step(loss).item()
    errors.append(off())
print(f"{len(touches)} touches; the box was {1e3 * errors[0]:.1f} mm off, and is {1e3 * errors[-1]:.3f} mm off")
print(f"balls are {last**0.5:.3f} mm from the learned box, in the mean square")
if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    axes.semilogy(1e3 * np.array(errors))
    axes.set(xlabel="20 evaluations of L-BFGS", ylabel="farthest corner off by [mm]")
    figure.savefig(sys.argv[1], dpi=110)
