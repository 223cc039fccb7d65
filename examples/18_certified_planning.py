"""Plans for the panda on the shipped workbench, every motion proven free: `collide.plan`, and a loop in Python."""

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


Q = [q for q in random.uniform(lower, upper, (5000, 8)) if checker.within_limits(q) and not checker.collides(q)]
start, goal = min(Q, key=lambda q: q[0]), max(Q, key=lambda q: q[0])  # from one side of the bench to the other
plan = collide.plan(checker, start, goal, seed=4)
print(f"collide.plan: {plan.n_nodes} nodes, {len(plan.path) - 1} motions, {len(plan.simplified) - 1} after shortcuts,")
print(f"  {plan.length:.1f} rad, all of it proven free in {plan.seconds * 1e3:.1f} ms")

here, there, started, reached, q = [[start]], [[goal]], time.perf_counter(), None, None
while q is None or reached is not q:
    here, there = there, here
    q = reached = extend(here, random.uniform(lower, upper))
    while q is not None and (reached := extend(there, q)) is not None and reached is not q:
        pass
path, total = here[-1] + there[-1][-2::-1], time.perf_counter() - started
proven = checker.certify_edges(path[:-1], path[1:])
print(f"in Python: {len(here) + len(there)} nodes; a path of {len(path) - 1} motions")
print(f"  {proven.free.sum()} of its {len(proven)} motions are proven free")
print(f"  {len(spent)} motions in {total * 1e3:.0f} ms, {100 * sum(spent) / total:.0f} % of it in collision checks")
