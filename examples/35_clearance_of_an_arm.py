"""A UR5 on a table keeps 5 cm from all that is around: a plan that scipy bends by gradients, then proven at all times.

    python examples/35_clearance_of_an_arm.py [clearance.png]    # a picture where matplotlib is installed
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import collide
from collide.scenes import load

CLEARANCE, WAYPOINTS, SAMPLES = 0.05, 20, 8  # [m]; waypoints between start and goal; samples of each motion
PLINTH = 0.1  # [m], below the robot
ROBOT = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
SCENE = {
    "collide": 1,
    "robots": [{"urdf": ROBOT, "meshes": "hull", "pose": {"xyz": [0, 0, PLINTH]}}],
    "bodies": [
        {"name": "table", "shape": {"box": {"size": [1.6, 1.4, 0.1]}}, "pose": {"xyz": [0.3, 0, -0.05]}},
        {"name": "post", "shape": {"cylinder": {"radius": 0.04, "length": 0.9}}, "pose": {"xyz": [0.45, 0, 0.45]}},
        {"name": "bin", "shape": {"box": {"size": [0.3, 0.3, 0.2]}}, "pose": {"xyz": [0.45, 0.4, 0.1]}},
    ],
    "allow": [["base_link", "table"], ["shoulder_link", "table"], ["table", "post"], ["table", "bin"], ["post", "bin"]],
}
START, GOAL = np.array([-0.9, -1.0, 1.3, -1.5, -1.57, 0.0]), np.array([1.0, -1.0, 1.2, -1.5, -1.57, 0.0])

with tempfile.TemporaryDirectory() as folder:
    Path(folder, "cell.json").write_text(json.dumps(SCENE))
    scene = load(Path(folder, "cell.json"))
checker = collide.RobotChecker.from_scene(scene)
dof, least_so_far = checker.robot.dof, []


# Samples of the motions are means of two waypoints: distances at waypoints alone would let a motion jump over a post.
times = np.arange(SAMPLES * (WAYPOINTS + 1) + 1) / SAMPLES
sampled = np.maximum(0.0, 1.0 - np.abs(times[:, None] - np.arange(WAYPOINTS + 2)))  # (samples, waypoints)


def waypoints(inner):
    return np.concatenate([[START], inner.reshape(-1, dof), [GOAL]])


def cost(inner, margin):
    """Squares of steps, and of what bodies around lack of a margin; with the derivative by the waypoints in between."""
    Q = waypoints(inner)
    near = checker.distances(sampled @ Q, max_distance=margin, per="pair", between="world")
    lacks, steps, by_sample = 1.0 - near.distance / margin, np.diff(Q, axis=0), np.zeros((len(times), dof))
    np.add.at(by_sample, near.configuration, -2.0 / margin * lacks[:, None] * np.nan_to_num(near.gradient))
    slope = sampled.T @ by_sample
    slope[1:] += 2.0 * steps
    slope[:-1] -= 2.0 * steps
    return (steps**2).sum() + (lacks**2).sum(), slope[1:-1].ravel()


def clearances(Q):
    return checker.distances(sampled @ Q, between="world").distance


def note(inner):
    least_so_far.append(clearances(waypoints(inner)).min())


# From a straight line gradients push waypoints before the post back and those behind it on, which leads nowhere.
planned = collide.plan(checker, START, GOAL, seed=1)
along = np.append(0.0, np.cumsum(np.abs(np.diff(planned.path, axis=0)).max(axis=1)))
even = np.linspace(0.0, along[-1], WAYPOINTS + 2)
begun = np.stack([np.interp(even, along, column) for column in planned.path.T], axis=1)
inner = begun[1:-1].ravel()
note(inner)
result = minimize(cost, inner, (1.4 * CLEARANCE,), method="L-BFGS-B", jac=True, callback=note)
path = waypoints(result.x)

# The clearance as a margin of all that is around: a motion is proven to keep it at all times, not at samples.
wide = collide.World()
for body in scene.bodies:
    if body.name in ("table", "post", "bin"):
        wide.add(body.shape, body.X_WB, name=body.name, margin=CLEARANCE)
robot = scene.placements[next(iter(scene.placements))].robot
proof = collide.RobotChecker(
    robot, wide, X_WR=collide.pose((0, 0, PLINTH)), allowed=[("base_link", "table"), ("shoulder_link", "table")]
).certify_edges(path[:-1], path[1:])
print(f"planned: least distance {least_so_far[0]:+.4f} m")
print(f"bent, {result.nfev} evaluations: least distance {least_so_far[-1]:+.4f} m")
print(f"{proof.free.sum()} of {len(proof)} motions proven to keep {CLEARANCE} m")
if len(sys.argv) > 1:
    import matplotlib.pyplot as plt

    figure, (over_path, over_steps) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    for name, Q in (("planned", begun), ("bent", path)):
        over_path.plot(times, clearances(Q), label=name)
    over_path.axhline(CLEARANCE, color="gray", linewidth=0.8)
    over_path.set(xlabel="waypoint", ylabel="distance from what is around [m]")
    over_path.legend()
    over_steps.plot(least_so_far)
    over_steps.axhline(CLEARANCE, color="gray", linewidth=0.8)
    over_steps.set(xlabel="step of the optimiser", ylabel="least distance of all samples [m]")
    figure.savefig(sys.argv[1], dpi=110)
