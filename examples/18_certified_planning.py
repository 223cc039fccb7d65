"""RRT-Connect for the panda on the shipped workbench: every motion of both trees is proven free, not sampled."""

import time

import numpy as np

import collide
from collide.scenes import load

checker = collide.RobotChecker.from_scene(load("panda_workbench", meshes="hull"))
lower, upper, random, spent = checker.robot.lower, checker.robot.upper, np.random.default_rng(4), []


def is_free(q0, q1):
    """Whether the straight motion from q0 to q1 is proven free, all of the way."""
    begin = time.perf_counter()
    proven = checker.certify_edges(q0, q1, resolution=0.01).free[0]
    spent.append(time.perf_counter() - begin)
    return proven


def extend(tree, target, step=1.0):
    """A node at most a step from the tree, towards a target; None where something is in between."""
    nearest = min(tree, key=lambda node: np.linalg.norm(node[-1] - target))  # a node is the path to it
    way = target - nearest[-1]
    q = target if np.linalg.norm(way) <= step else nearest[-1] + step * way / np.linalg.norm(way)
    if is_free(nearest[-1], q):
        tree.append([*nearest, q])
        return q


Q = sorted((q for q in random.uniform(lower, upper, (5000, 8)) if not checker.collides(q)), key=lambda q: q[0])
here, there = [[Q[0]]], [[Q[-1]]]  # from one side of the bench to the other
started, reached, q = time.perf_counter(), None, None
while q is None or reached is not q:
    here, there = there, here
    q = reached = extend(here, random.uniform(lower, upper))
    while q is not None and (reached := extend(there, q)) is not None and reached is not q:
        pass
path = here[-1] + there[-1][-2::-1]
length = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
for i, j in np.sort(random.integers(0, len(path), (200, 2))):  # shortcuts between two nodes of the path
    if j < len(path) and j - i > 1 and is_free(path[i], path[j]):
        path[i + 1 : j] = []
total, proven = time.perf_counter() - started, checker.certify_edges(path[:-1], path[1:])
shorter = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
print(f"{len(here) + len(there)} nodes; a path {length:.1f} rad long, after shortcuts {shorter:.1f} rad")
print(f"{proven.free.sum()} of its {len(proven)} motions are proven free")
print(f"{len(spent)} motions asked in {total:.2f} s, {100 * sum(spent) / total:.0f} % of it in collision checks")
