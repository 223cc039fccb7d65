"""A lidar cluster against the regions of a safe corridor: which it reaches into, how far the others are, with proof."""

import numpy as np

from collide import polytopes

rng = np.random.default_rng(0)

# Four regions along a corridor, as planners keep free space: boxes with their edges cut off, here 66 half-spaces each.
directions = rng.normal(size=(60, 3))
directions /= np.linalg.norm(directions, axis=1)[:, None]
normals = np.vstack((np.eye(3), -np.eye(3), directions))
half_size = np.array([1.5, 1.0, 1.0])
offsets = np.concatenate((half_size, half_size, np.abs(directions) @ half_size - 0.12))
centres = [np.array([2.0 * k, 0.2 * k, 1.0]) for k in range(4)]

# What a lidar saw of a pillar beside the corridor: 20,000 points of its front, with noise. No hull of them is made.
angle, height = rng.uniform(np.pi, 2 * np.pi, 20_000), rng.uniform(0.0, 2.2, 20_000)
radius = 0.2 + rng.normal(0.0, 0.003, 20_000)
pillar = np.column_stack((4.0 + radius * np.cos(angle), 1.45 + radius * np.sin(angle), height))

for k, centre in enumerate(centres):
    b = offsets + normals @ centre
    r = polytopes.meets(pillar, normals, b)
    polytopes.verify(pillar, normals, b, r)  # substitutes in integers, and raises where the answer is not proven
    if r.hit:
        print(f"region {k}: the pillar reaches into it, for example at {np.round(r.point, 3)}")
        continue
    n = -r.normal  # from the region towards the points
    print(f"region {k}: {r.lower:.4f} m away; all points are beyond the plane {np.round(n, 3)}·x = {n @ r.point_p:.3f}")

# A robot of 0.4 m needs more room than region 3 leaves it: the same plane, moved towards the region, cuts least off it.
b = offsets + normals @ centres[3]
r = polytopes.meets(pillar, normals, b)
n = -r.normal
smaller = np.vstack((normals, n)), np.append(b, n @ r.point_p - 0.4)
print(f"region 3 with that plane: {polytopes.meets(pillar, *smaller).distance:.4f} m away")
