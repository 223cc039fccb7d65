"""A mobile base planned as a point: the obstacle that it sees is made once, and every step of the path is checked."""

import heapq
from itertools import pairwise

import numpy as np

import collide

# Two walls with a door each, and a pillar; the base is an L, and keeps its heading.
walls = [(-2.5, 0.6, 0, 1.8, 0.2), (2.1, 0.6, 0, 2.6, 0.2), (-2.1, 2, 0, 2.6, 0.2), (2.5, 2, 0, 1.8, 0.2), (0, 1.3, 0, 0.2, 0.2)]
boxes = [collide.Box((w, d, 1)) for _, _, _, w, d in walls]
room = collide.combine(boxes, [collide.pose(w[:3]) for w in walls], "union").mesh
corners = np.array([(0, 0), (0.6, 0), (0.6, 0.25), (0.25, 0.25), (0.25, 0.6), (0, 0.6)]) - 0.2
ears = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
k = np.arange(6)
sides = [np.stack([k, (k + 1) % 6, (k + 1) % 6 + 6], axis=1), np.stack([k, (k + 1) % 6 + 6, k + 6], axis=1)]
heights = [np.column_stack([corners, np.full(6, z)]) for z in (-0.25, 0.25)]
base = collide.Mesh(np.concatenate(heights), np.concatenate([ears[:, ::-1], ears + 6, *sides]))
X = collide.pose((0, 0, 0), rpy=(0, 0, 0.5))
obstacle = collide.configuration_obstacle(room, base, X[:3, :3])
print(f"{len(room.faces)} facets of walls, {len(base.faces)} of the base: an obstacle of {len(obstacle.mesh.faces)} facets")

# The shortest path of a point on a grid: a step is free where its segment meets no facet and starts outside.
start, goal, step = (-5, -6), (5, 38), 0.1


def at(n):
    return (n[0] * step, n[1] * step, 0.0)


def free(n, m):
    a, d = np.array(at(n)), np.subtract(at(m), at(n))
    return max(map(abs, m)) <= 40 and not collide.raycast(obstacle.mesh, np.eye(4), a, d, max_distance=1.0).hit


queue, came, cost = [(0.0, start)], {start: start}, {start: 0.0}
while queue and queue[0][1] != goal:
    n = heapq.heappop(queue)[1]
    for m in [(n[0] + i, n[1] + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]:
        c = cost[n] + step * float(np.hypot(m[0] - n[0], m[1] - n[1]))
        if c < cost.get(m, np.inf) and free(n, m):
            cost[m], came[m] = c, n
            heapq.heappush(queue, (c + step * float(np.hypot(m[0] - goal[0], m[1] - goal[1])), m))
path = [goal]
while path[-1] != start:
    path.append(came[path[-1]])
print(f"a path of {cost[goal]:.2f} m in {len(path) - 1} steps, {len(cost)} places seen")

# The bodies themselves: not one step hits, by certified motion.
hits = [collide.time_of_impact(room, base, np.eye(4), np.eye(4), *(collide.pose(at(n), rpy=(0, 0, 0.5)) for n in s)).hit
        for s in pairwise(path)]  # fmt: skip
print(f"steps that hit: {sum(map(bool, hits))} of {len(hits)}")
