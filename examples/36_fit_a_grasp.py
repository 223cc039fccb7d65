"""Two fingertips close on an ellipsoid where normals face each other: by derivatives of distances and of normals.

    python examples/36_fit_a_grasp.py [grasp.png]    # a picture where matplotlib is installed
"""

import sys

import numpy as np

import collide
from collide.base.poses_at import poses_at

BODY, TIP = collide.Ellipsoid((0.05, 0.03, 0.04)), collide.Sphere(0.008)  # [m]
X_WB = collide.pose((0.4, 0.1, 0.2), rpy=(0.3, -0.5, 0.8))
X_WG, opening = collide.pose((0.42, 0.12, 0.21), rpy=(0.9, 0.2, -0.4)), 0.15  # the gripper, and between its tips [m]


def turned(omega):
    """The rotation about a vector by its length [rad]."""
    angle = np.linalg.norm(omega)
    axis = omega / angle if angle else np.eye(3)[0]
    K = np.cross(np.eye(3), -axis).T
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def asked(X_WG, opening):
    """(what has to be 0, its derivative by the gripper's turn, shift and opening): distances, and how far the body's
    normals are from the gripper's axis x.

    A tip at o moves with a turn ω and a shift v of the gripper at g as v + ω × (o − g), and with the opening along x.
    """
    x, g = X_WG[:3, 0], X_WG[:3, 3]
    tips = g + np.array([0.5, -0.5])[:, None] * opening * x
    r = collide.distance(BODY, TIP, X_WB, poses_at(tips), derivatives=True)
    assert r.unique.all()
    residual = np.concatenate([r.distance / 0.05, r.normal[0] - x, r.normal[1] + x])
    rows = np.concatenate([r.d_distance_B[:, None] / 0.05, r.d_normal_B], axis=1)  # (tip, distance and normal, 6)
    by_turn = rows[..., :3] + np.cross((tips - g)[:, None], rows[..., 3:])
    by_opening = np.array([0.5, -0.5])[:, None] * (rows[..., 3:] @ x)
    J = np.concatenate([by_turn, rows[..., 3:], by_opening[..., None]], axis=2)
    J[0, 1:, :3] -= np.cross(np.eye(3), x).T  # ω × x
    J[1, 1:, :3] += np.cross(np.eye(3), x).T
    return residual, np.concatenate([J[:, 0], J[0, 1:], J[1, 1:]]), r


history, damping = [], 1e-3
residual, J, r = asked(X_WG, opening)
while len(history) < 60:
    history.append(float(np.linalg.norm(residual)))
    change = -np.linalg.solve(J.T @ J + damping * np.eye(7), J.T @ residual)
    X_next = X_WG.copy()
    X_next[:3, :3], X_next[:3, 3] = turned(change[:3]) @ X_WG[:3, :3], X_WG[:3, 3] + change[3:6]
    tried = asked(X_next, opening + change[6])
    if np.linalg.norm(tried[0]) < history[-1]:
        X_WG, opening, (residual, J, r), damping = X_next, opening + change[6], tried, 0.3 * damping
    else:
        damping *= 10.0
    if history[-1] < 1e-10:
        break
line = np.diff(r.point_a, axis=0)[0]
angles = np.degrees(np.arccos(np.clip(np.abs(r.normal @ line) / np.linalg.norm(line), -1.0, 1.0)))
least, most = r.distance.min(), r.distance.max()
print(f"after {len(history)} steps: tips {least:+.1e} m and {most:+.1e} m from the body, {opening:.4f} m apart")
print(f"normals {angles.max():.4f} degrees off the line through both contacts")
if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 3.2), layout="constrained")
    axes.semilogy(history)
    axes.set(xlabel="step", ylabel="distances [50 mm] and normals")
    figure.savefig(sys.argv[1], dpi=110)
