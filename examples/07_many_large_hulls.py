"""Many different hulls at once: a library of shapes, a pair of them at every pose, warm starts, saving."""

import tempfile
from pathlib import Path

import numpy as np

import collide

rng = np.random.default_rng(0)


def pebble(n: int) -> collide.ConvexHull:
    """n points on an ellipsoid, 4 to 10 cm long."""
    points = rng.normal(size=(n, 3))
    return collide.ConvexHull(points / np.linalg.norm(points, axis=1)[:, None] * rng.uniform(0.02, 0.05, 3))


library = collide.ShapeSet([pebble(int(n)) for n in rng.integers(20, 4000, 30)])

# 5,000 pairs, each with its own two pebbles.
i, j = rng.integers(0, len(library), size=(2, 5000))
X_WA = np.array([collide.pose(rng.uniform(-0.05, 0.05, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(5000)])
X_WB = np.array([collide.pose(rng.uniform(-0.05, 0.05, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(5000)])
hits = collide.collide(library[i], library[j], X_WA, X_WB, threads=2)
print(f"{hits.sum()} of {len(hits)} pairs of pebbles meet")

# They move a little: the axes that parted them last time are tried first. Answers never depend on them.
axes = np.zeros((5000, 3))
collide.collide(library[i], library[j], X_WA, X_WB, axes=axes)
X_WB[:, :3, 3] += rng.normal(size=(5000, 3)) * 1e-4
hits = collide.collide(library[i], library[j], X_WA, X_WB, axes=axes)
print(f"{hits.sum()} after they moved by a tenth of a millimetre")

# Distances, and the proof of one of them.
r = collide.distance(library[i], library[j], X_WA, X_WB)
nearest = int(np.argmin(np.where(r.hit, np.inf, r.distance)))
A, B = library[i[nearest]], library[j[nearest]]
collide.verify(A, B, X_WA[nearest], X_WB[nearest], r[nearest])
print(f"nearest miss: {r.distance[nearest] * 1e3:.4f} mm, proven")

# A hull in a file, for the next process: its points alone; the support tree proofs rest on is made anew from them.
large = pebble(20000)
collide.collide(large, large, np.eye(4), collide.pose((0.01, 0, 0)))
with tempfile.TemporaryDirectory() as folder:
    large.save(Path(folder) / "pebble.npz")
    again = collide.ConvexHull.load(Path(folder) / "pebble.npz")
print(f"saved and loaded: {again == large}; {len(again.hull.vertices)} vertices, {len(again.hull.facets)} facets")
