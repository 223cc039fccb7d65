"""Footprints in the plane: where a base may drive, how near it comes, and whether a legged robot stands."""

import numpy as np

from collide import ConvexPolygon
from collide.polytopes import planar_pose, polygon_distance, polygons_meet, verify_polygons

rng = np.random.default_rng(7)

# A base of 0.9 m × 0.6 m with a nose, and a shelf seen from above: points in any order, their hull is exact.
base = ConvexPolygon([(-0.45, -0.3), (0.35, -0.3), (0.45, 0.0), (0.35, 0.3), (-0.45, 0.3)])
shelf = ConvexPolygon(rng.normal(size=(60, 2)) * (0.5, 0.2))
X_WS = planar_pose((2.0, 1.0), 0.4)

# 100,000 poses of the base at once.
x, y, angle = rng.uniform((0, -1, -np.pi), (4, 3, np.pi), size=(100_000, 3)).T
c, s = np.cos(angle), np.sin(angle)
X_WBs = np.zeros((len(x), 3, 3))
X_WBs[:, 0] = np.c_[c, -s, x]
X_WBs[:, 1] = np.c_[s, c, y]
X_WBs[:, 2, 2] = 1.0
hits = polygons_meet(base, shelf, X_WBs, X_WS)
print(f"{hits.hit.mean():.1%} of {len(hits)} poses hit; rounds at most {hits.rounds.max()}")

# Any answer can be proven: a common point with its weights, or a line between.
for k in (int(np.argmax(hits.hit)), int(np.argmin(hits.hit))):
    certificate = hits.certificate(k)
    verify_polygons(base, shelf, X_WBs[k], X_WS, certificate)
    print(f"pose {k}:", "a common point" if certificate.hit else "a line between", "checked in fractions")

# Driving past: the gap, and where.
path = np.array([planar_pose((d, -0.2), 0.0) for d in np.linspace(0, 4, 41)])
r = polygon_distance(base, shelf, path, X_WS)
nearest = int(np.argmin(r.distance))
print(f"nearest at x = {path[nearest, 0, 2]:.1f} m: {r.distance[nearest]:.3f} m, "
      f"from {r.point_a[nearest].round(3)} to {r.point_b[nearest].round(3)}")

# Three feet on the ground: does the centre of mass stand above their hull, and how far from the edge?
feet = ConvexPolygon([(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2)])
for com in ((0.1, 0.05), (-0.1, -0.1)):
    r = polygon_distance(feet, ConvexPolygon([com]), planar_pose(), planar_pose())
    print(f"centre of mass at {com}: {abs(r.distance):.3f} m", "inside" if r.hit else "outside, it falls")
# On the edge itself, and a hair beside it: (0, 0) lies on the line from foot to foot.
com = ConvexPolygon([(0.0, 0.0)])
for shift in (0.0, -1e-200):
    stands = polygons_meet(feet, com, planar_pose(), planar_pose((shift, 0.0))).hit
    print(f"moved by {shift:g} m:", "stands" if stands else "falls")
