"""A mobile base planned as a point: the obstacle that it sees is made once, and every step of the path is checked."""

import heapq
from itertools import pairwise

import numpy as np

import collide

# Two walls with a door each, and a pillar; the base is an L, and keeps its heading.
walls = [(-2.5, 0.6, 1.8), (2.1, 0.6, 2.6), (-2.1, 2, 2.6), (2.5, 2, 1.8), (0, 1.3, 0.2)]
poses = [collide.pose((x, y, 0)) for x, y, _ in walls]
walls_as_one = collide.combine([collide.Box((w, 0.2, 1)) for _, _, w in walls], poses, "union").mesh
corners = np.array([(0, 0), (0.6, 0), (0.6, 0.25), (0.25, 0.25), (0.25, 0.6), (0, 0.6)]) - 0.2
ears = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
k = np.arange(6)
sides = [np.stack([k, (k + 1) % 6, (k + 1) % 6 + 6], axis=1), np.stack([k, (k + 1) % 6 + 6, k + 6], axis=1)]
heights = [np.column_stack([corners, np.full(6, z)]) for z in (-0.25, 0.25)]
base = collide.Mesh(np.concatenate(heights), np.concatenate([ears[:, ::-1], ears + 6, *sides]))
obstacle = collide.configuration_obstacle(walls_as_one, base, collide.pose((0, 0, 0), rpy=(0, 0, 0.5))[:3, :3])
print(f"{len(walls_as_one.faces)} and {len(base.faces)} facets: an obstacle of {len(obstacle.mesh.faces)} facets")

# The shortest path of a point on a grid: a step is free where its segment meets no facet and starts outside.
start, goal, step = np.array((-5, -6, 0)), np.array((5, 38, 0)), 0.1


def free(n, m):
    inside = np.abs(m).max() <= 40
    return inside and not collide.raycast(obstacle.mesh, np.eye(4), n * step, (m - n) * step, max_distance=1.0).hit


queue, came, cost = [(0.0, tuple(start))], {}, {tuple(start): 0.0}
while queue and queue[0][1] != tuple(goal):
    n = heapq.heappop(queue)[1]
    for way in [(i, j, 0) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]:
        m = np.add(n, way)
        c = cost[n] + step * np.hypot(*way[:2])
        if c < cost.get(tuple(m), np.inf) and free(np.array(n), m):
            cost[tuple(m)], came[tuple(m)] = c, n
            heapq.heappush(queue, (c + step * np.linalg.norm(m - goal), tuple(m)))
path = [tuple(goal)]
while path[-1] in came:
    path.append(came[path[-1]])
print(f"a path of {cost[tuple(goal)]:.2f} m in {len(path) - 1} steps, {len(cost)} places seen")

# The bodies themselves: not one step hits, by certified motion.
poses = [collide.pose(np.multiply(n, step), rpy=(0, 0, 0.5)) for n in path]
hits = [collide.time_of_impact(walls_as_one, base, np.eye(4), np.eye(4), a, b).hit for a, b in pairwise(poses)]
print(f"steps that hit: {sum(map(bool, hits))} of {len(hits)}")
