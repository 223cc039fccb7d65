"""Free space as convex cells for a planner: a room of overlapping parts, its cells, their portals, and a path."""

import heapq
from itertools import pairwise

import numpy as np

import collide

# A room of 6 × 4 × 2.5 m: a wall with a door, a wall with a window, a table and a beam that leans into the floor.
parts = [
    (collide.Box((0.2, 2.9, 2.5)), collide.pose((2.0, -0.55, 1.25))),
    (collide.Box((0.2, 4.0, 1.0)), collide.pose((4.0, 0.0, 0.5))),
    (collide.Box((0.2, 4.0, 0.6)), collide.pose((4.0, 0.0, 2.2))),
    (collide.Box((1.2, 0.8, 0.75)), collide.pose((1.0, 0.4, 0.375))),
    (collide.Box((0.15, 0.15, 3.0)), collide.pose((3.0, 0.8, 1.0), rpy=(0.5, 0.2, 0.3))),
]
made = [(collide.tessellate(shape), X_WA) for shape, X_WA in parts]
vertices = np.concatenate([tessellated.vertices @ X_WA[:3, :3].T + X_WA[:3, 3] for tessellated, X_WA in made])
starts = np.cumsum([0] + [len(tessellated.vertices) for tessellated, _ in made])
faces = np.concatenate([tessellated.faces + start for (tessellated, _), start in zip(made, starts)])

partition = collide.SpacePartition(collide.Mesh(vertices, faces), kappa=512)
free = partition.convex_pieces(inside=False, box=((0.0, -2.0, 0.0), (6.0, 2.0, 2.5)))
portals = partition.portals(free)
print(f"{partition.size.facets} facets; {len(free)} convex cells, {free.volumes.sum():.3f} m³ of 60 m³ are free")

# The graph of a planner: from portal to portal through cells, where portals are large enough to pass.
start, goal = np.array([0.3, -1.5, 0.3]), np.array([5.7, 1.5, 0.3])
first, last = free.rows_of(partition.locate([start, goal]).cell)
beside = [np.flatnonzero((portals.cells == row).any(axis=1) & (portals.area > 0.02)) for row in range(len(free))]
done, queue = set(), [(0.0, 0, int(first), [start])]
while queue:
    length, _, cell, path = heapq.heappop(queue)
    if cell == last:
        break
    if cell not in done:
        done.add(cell)
        for k in beside[cell]:
            through = portals.middle[k]
            further = length + float(np.linalg.norm(through - path[-1]))
            heapq.heappush(queue, (further, len(queue), int(portals.cells[k].sum()) - cell, [*path, through]))
path.append(goal)
print(f"a path through {len(path) - 2} portals, {np.linalg.norm(np.diff(path, axis=0), axis=1).sum():.2f} m long")
points = np.concatenate([np.linspace(a, b, 100) for a, b in pairwise(path)])
print(f"{partition.locate(points).inside.sum()} of {len(points)} points of it are in a body")
