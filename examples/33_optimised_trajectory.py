"""A trajectory that scipy pushes out of obstacles: every near pair of every waypoint counts, with its gradient."""

import time

import numpy as np
from scipy.optimize import minimize

import collide
from collide.scenes import load

CLEARANCE, WAYPOINTS = 0.05, 30  # [m]; waypoints between start and goal
checker = collide.RobotChecker.from_scene(load("panda_workbench", meshes="hull"))
lower, upper, dof = checker.robot.lower, checker.robot.upper, checker.robot.dof


def cost(inner, start, goal):
    """Squares of steps, and of what pairs lack of the clearance; with the derivative by the waypoints in between."""
    Q = np.concatenate([[start], inner.reshape(-1, dof), [goal]])
    near = checker.distances(Q, max_distance=CLEARANCE, per="pair")
    known = ~np.isnan(near.gradient).any(axis=1)  # near.no_gradient says why, for meshes: these are hulls
    lacks = 1.0 - near.distance[known] / CLEARANCE
    steps, slope = np.diff(Q, axis=0), np.zeros_like(Q)
    np.add.at(slope, near.configuration[known], -2.0 / CLEARANCE * lacks[:, None] * near.gradient[known])
    slope[1:] += 0.2 * steps
    slope[:-1] -= 0.2 * steps
    return 0.1 * (steps**2).sum() + (lacks**2).sum(), slope[1:-1].ravel()


def report(name, path):
    near, proven = checker.distances(path), checker.certify_edges(path[:-1], path[1:], resolution=0.01)
    print(f"{name}: {near.hit.sum()} of {len(path)} waypoints collide, least distance {near.distance.min():+.4f} m")
    print(f"  {proven.free.sum()} of {len(proven)} motions proven free")


Q = np.random.default_rng(5).uniform(lower, upper, (3000, dof))
Q = Q[checker.distances(Q).distance > CLEARANCE]
line = np.linspace(Q[8], Q[9], WAYPOINTS + 2)  # straight from one posture to another
report("straight", line)
begin, limits = time.perf_counter(), list(zip(lower, upper)) * WAYPOINTS
result = minimize(cost, line[1:-1].ravel(), (line[0], line[-1]), method="L-BFGS-B", jac=True, bounds=limits)
spent = time.perf_counter() - begin
path = np.concatenate([line[:1], result.x.reshape(-1, dof), line[-1:]])
report("optimised", path)
names, counts = np.unique(checker.distances(path, max_distance=CLEARANCE, per="pair").names, axis=0, return_counts=True)
for (a, b), count in zip(names, counts):
    print(f"  within the clearance in {count} waypoints: {a} and {b}")
print(f"{result.nfev} times {len(path)} waypoints asked in {spent:.2f} s, the optimiser included")
