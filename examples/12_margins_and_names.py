"""Security margins, the deciding argument, contacts of a batch, and poses as other libraries write them."""

import logging

import numpy as np

import collide

logging.basicConfig(level=logging.WARNING)  # INFO tells which kernels and trees are made, and how long that takes

# A margin makes near bodies hit: at most 5 mm apart, proven as every boolean is.
shelf, box = collide.Box(1, 0.4, 0.02), collide.Box(0.1, 0.1, 0.1)
X_WBs = np.array([collide.pose((0, 0, 0.06 + gap)) for gap in (0.0, 0.005 - 1e-12, 0.005 + 1e-12)])
print("within 5 mm:", collide.collide(shelf, box, np.eye(4), X_WBs, security_margin=0.005).tolist())

# How an answer is known: an integer with a name and a meaning.
r = collide.distance(shelf, box, np.eye(4), X_WBs[1])
print(f"{r.distance * 1e3:.3f} mm, known by a {r.how}: {r.how.meaning}")
can = collide.distance(collide.Cylinder(0.05, height=0.1), shelf, collide.pose((0, 0, 0.06)), np.eye(4))
print(f"the can on the shelf is {can.distance:.1e} m from it, by {can.how.meaning}")

# A pair of shapes at every pose, and their contacts pair by pair.
library = collide.ShapeSet([shelf, box, collide.Sphere(0.05)])
X_WAs = np.array([np.eye(4)] * 2)
X_WBs = np.array([collide.pose((0, 0, 0.06)), collide.pose((0.1, 0, 0.06))])
c = collide.contacts(library[[0, 0]], library[[2, 1]], X_WAs, X_WBs, margin=1e-3)
print(f"contacts of pair 0: {len(c[0])}, contacts of pair 1: {len(c[1])}")

# Quaternions in either order and of any length; and whatever has as_matrix(), as scipy's Rotation does.
rotation = collide.pose((1, 2, 3), quat_xyzw=(0, 0, 1, 1))
print(
    "a pose by (R, t) is that of the matrix:",
    collide.collide(shelf, box, (rotation[:3, :3], rotation[:3, 3]), rotation) is True,
)
