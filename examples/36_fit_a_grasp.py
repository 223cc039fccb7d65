"""Two fingertips close on an ellipsoid where normals face each other: by derivatives of distances and of normals."""

import numpy as np

import collide
from collide.base.poses_at import poses_at

BODY, TIP = collide.Ellipsoid((0.05, 0.03, 0.04)), collide.Sphere(0.008)  # [m]
X_WB = collide.pose((0.4, 0.1, 0.2), rpy=(0.3, -0.5, 0.8))
X_WG, opening = collide.pose((0.42, 0.12, 0.21), rpy=(0.9, 0.2, -0.4)), 0.15  # the gripper, and between its tips [m]


def turned(omega):
    """The rotation about a vector by its length [rad]."""
    angle = np.linalg.norm(omega)
    K = np.cross(np.eye(3), -omega / max(angle, 1e-300)).T
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def asked(X_WG, opening):
    """(what has to be 0, its derivative by the gripper's turn, shift and opening, the answer): distances, and how far
    the body's normals are from the gripper's axis x.

    A tip at o moves with a turn ω and a shift v of the gripper at g as v + ω × (o − g), and with the opening along x.
    """
    x, g, sides = X_WG[:3, 0], X_WG[:3, 3], np.array([0.5, -0.5])[:, None]
    tips = g + sides * opening * x
    r = collide.distance(BODY, TIP, X_WB, poses_at(tips), derivatives=True)
    rows = np.concatenate([r.d_distance_B[:, None] / 0.05, r.d_normal_B], axis=1)  # (tip, distance and normal, 6)
    by_turn = rows[..., :3] + np.cross((tips - g)[:, None], rows[..., 3:])
    by_turn[:, 1:] -= 2.0 * sides[..., None] * np.cross(np.eye(3), x).T  # ω × x
    J = np.concatenate([by_turn, rows[..., 3:], (sides * (rows[..., 3:] @ x))[..., None]], axis=2).reshape(8, 7)
    return np.concatenate([r.distance[:, None] / 0.05, r.normal - 2.0 * sides * x], axis=1).ravel(), J, r


for step in range(8):
    residual, J, r = asked(X_WG, opening)
    print(f"step {step}: distances and normals off by {np.linalg.norm(residual):.1e}")
    change = np.linalg.lstsq(J, -residual)[0]
    X_WG[:3, :3], X_WG[:3, 3] = turned(change[:3]) @ X_WG[:3, :3], X_WG[:3, 3] + change[3:6]
    opening += change[6]
line = np.diff(r.point_a, axis=0)[0]
angles = np.degrees(np.arccos(np.clip(np.abs(r.normal @ line) / np.linalg.norm(line), -1.0, 1.0)))
print(f"tips {opening:.4f} m apart, normals {angles.max():.4f} degrees off the line through both contacts")
