"""Triangle meshes as they are: holes are holes, solids have an inside, and a ring is not its hull."""

import tempfile
from pathlib import Path

import numpy as np

import collide

# A ring around the z axis, its section a square of 4 cm at 10 cm from the axis.
n = 48
angles = 2 * np.pi * np.arange(n) / n
section = np.array([(0.08, -0.02), (0.12, -0.02), (0.12, 0.02), (0.08, 0.02)])
vertices = np.array([(r * np.cos(a), r * np.sin(a), z) for a in angles for r, z in section])
faces = []
for i in range(n):
    for k in range(4):
        a, b = 4 * i + k, 4 * i + (k + 1) % 4
        c, d = 4 * ((i + 1) % n) + k, 4 * ((i + 1) % n) + (k + 1) % 4
        faces += [(a, c, b), (b, c, d)]
ring = collide.Mesh(vertices, faces)
print(f"solid: {ring.solid}\n{ring.report}")

# A finger through the hole, and a bead inside the wall that touches no facet.
finger, bead = collide.Capsule(0.01, 0.2), collide.Sphere(0.005)
print("inside the ring's hole:", collide.collide(ring, finger, np.eye(4), np.eye(4)))
print("its hull would hit:", collide.collide(collide.ConvexHull(vertices), finger, np.eye(4), np.eye(4)))
print("inside its wall:", collide.collide(ring, bead, np.eye(4), collide.pose((0.1, 0, 0))))

# Gaps are proven brackets; overlaps come with a translation that is proven to part the bodies.
gap = collide.distance(ring, finger, np.eye(4), np.eye(4))
print(f"gap {gap.distance * 1e3:.3f} mm, known to {gap.upper - gap.lower:.0e} m")
pushed = collide.distance(ring, finger, np.eye(4), collide.pose((0.075, 0, 0)))
print(f"moved by {-pushed.distance * 1e3:.3f} mm along {np.round(pushed.normal, 2)} the finger comes free")

# Copies of another size share the box-tree; a file holds the facets, and the same tree is made from them.
half = ring.scaled(0.5)
print("half as large:", collide.collide(half, finger, np.eye(4), collide.pose((0.03, 0, 0))))
with tempfile.TemporaryDirectory() as folder:
    ring.save(Path(folder) / "ring.npz")
    again = collide.Mesh.load(Path(folder) / "ring.npz")
print("the same tree:", again == ring and np.array_equal(again.tree.nodes, ring.tree.nodes))

# Round pegs, and bodies made of several parts with meshes among them: here a ring on a stem, put over a peg.
hook = collide.Compound([(ring, np.eye(4)), (collide.Box((0.02, 0.02, 0.3)), collide.pose((0.1, 0, 0.17)))])
peg = collide.Cylinder(0.06, 0.4)
free = collide.distance(hook, peg, np.eye(4), collide.pose((0.0, 0, -0.1)))
print(f"the peg clears part {free.part_a} of the hook by {free.distance * 1e3:.3f} mm")
print("turned by 30°, it hits:", collide.collide(hook, peg, np.eye(4), collide.pose((0, 0, 0), rpy=(np.pi / 6, 0, 0))))
