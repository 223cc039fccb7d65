"""Contacts: a box on a table of many facets, and a bar in a gripper, as few points with one normal a patch."""

import numpy as np

import collide

# A table top of 2 × 6 × 6 facets, 2 m wide, its top at z = 0; only the surface, since nothing lies inside.
line = np.linspace(-1, 1, 7)
vertices = np.array([(x, y, 0.0) for y in line for x in line])
cells = [7 * j + i for j in range(6) for i in range(6)]
table = collide.Mesh(vertices, [(k, k + 1, k + 8) for k in cells] + [(k, k + 8, k + 7) for k in cells])

# A box turned by 0.3 rad and sunk by a micron: four corners, and nothing from the edges within the top.
box = collide.Box((0.8, 0.5, 0.4))
c = collide.contacts(table, box, np.eye(4), collide.pose((0.1, 0.05, 0.2 - 1e-6), rpy=(0, 0, 0.3)))
for row in c:
    print(f"at {np.round(row['point_b'], 3)}: {row['distance'] * 1e6:+.2f} µm along {np.round(row['normal'], 3) + 0.0}")
print(f"lifted by {c.apart[0] * 1e6:.2f} µm it is proven free of the table's facets there")

# Hovering: the margin takes in what is near. Rows of a patch stand together, the deepest first.
c = collide.contacts(table, collide.Sphere(0.1), np.eye(4), collide.pose((0.1, 0.2, 0.101)), margin=0.002)
print(f"a ball {c.distance[0] * 1e3:.2f} mm above it, known to {c.upper[0] - c.lower[0]:.0e} m")

# A gripper of two jaws around a bar that is 2 µm too wide: two patches, with opposite normals.
jaws = collide.Compound([(collide.Box((0.02, 0.04, 0.06)), collide.pose((side * 0.06, 0, 0))) for side in (-1, 1)])
bar = collide.Box((0.100002, 0.3, 0.02))
grip = collide.contacts(jaws, bar, np.eye(4), np.eye(4))
for patch in grip.patches:
    print(
        f"jaw {patch['part_a']} pushes along {np.round(patch['normal'], 3) + 0.0}, "
        f"{int((grip.patch == patch['patch']).sum())} points"
    )

# In a world: every pair that is tested, with the ids of the bodies.
world = collide.World()
world.add(table, name="table", static=True)
world.add(box, collide.pose((0.1, 0.05, 0.2)), name="box")
world.add(collide.Sphere(0.1), collide.pose((0.1, 0.05, 0.5)), name="ball")
for row, (a, b) in zip(rows := world.contacts(margin=1e-3), rows.names):
    print(f"{a} and {b}: {row['distance'] * 1e3:+.3f} mm at {np.round(row['point_a'], 3)}")
