"""A UR5 keeps 5 cm from all that is around: a plan that scipy bends by gradients, then proven at all times."""

import numpy as np
from scipy.optimize import minimize

import collide

CLEARANCE, WAYPOINTS, SAMPLES = 0.05, 20, 8  # [m]; waypoints between start and goal; samples of each motion
START, GOAL = np.array([-0.9, -1.0, 1.3, -1.5, -1.57, 0.0]), np.array([1.0, -1.0, 1.2, -1.5, -1.57, 0.0])
world = collide.World()
world.add(collide.Box((1.6, 1.4, 0.1)), collide.pose((0.3, 0, -0.15)), name="table")
world.add(collide.Cylinder(0.04, 0.9), collide.pose((0.45, 0, 0.35)), name="post")
world.add(collide.Box((0.3, 0.3, 0.2)), collide.pose((0.45, 0.4, 0)), name="bin")
robot = collide.Robot.load("package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf", meshes="hull")
checker = collide.RobotChecker(robot, world)
# Samples of the motions are means of two waypoints: gradients at waypoints alone let a motion jump over the post.
times = np.arange(SAMPLES * (WAYPOINTS + 1) + 1) / SAMPLES
sampled = np.maximum(0.0, 1.0 - np.abs(times[:, None] - np.arange(WAYPOINTS + 2)))  # (samples, waypoints)


def cost(inner, margin):
    """Squares of steps, and of what bodies around lack of a margin; with the derivative by the waypoints in between."""
    Q = np.vstack([START, inner.reshape(-1, 6), GOAL])
    near = checker.distances(sampled @ Q, max_distance=margin, per="pair", between="world")
    lacks, steps, slope = 1.0 - near.distance / margin, np.diff(Q, axis=0), np.zeros((len(times), len(START)))
    np.add.at(slope, near.configuration, -2.0 / margin * lacks[:, None] * np.nan_to_num(near.gradient))
    by_waypoint = sampled.T @ slope
    by_waypoint[1:] += 2.0 * steps
    by_waypoint[:-1] -= 2.0 * steps
    return (steps**2).sum() + (lacks**2).sum(), by_waypoint[1:-1].ravel()


def report(name, Q):
    print(f"{name}: least distance {checker.distances(sampled @ Q, between='world').distance.min():+.4f} m")


# From a straight line gradients push waypoints before the post back and those behind it on, which leads nowhere.
plan = collide.plan(checker, START, GOAL, seed=1).path
along = np.append(0.0, np.cumsum(np.abs(np.diff(plan, axis=0)).max(axis=1)))
path = np.stack([np.interp(np.linspace(0, along[-1], WAYPOINTS + 2), along, column) for column in plan.T], axis=1)
report("planned", path)
inner = minimize(cost, path[1:-1].ravel(), (1.4 * CLEARANCE,), method="L-BFGS-B", jac=True).x
path = np.vstack([START, inner.reshape(-1, 6), GOAL])
report("bent", path)
for body in world.ids:
    world.set_margin(body, CLEARANCE)  # from now on what comes nearer is a collision
proof = checker.certify_edges(path[:-1], path[1:])
print(f"{proof.free.sum()} of {len(proof)} motions proven to keep {CLEARANCE} m")
