"""What is nearest: over a slice of the shipped workbench, and over two joints of its panda. A picture, or a table."""

import sys
from importlib.util import find_spec

import numpy as np

import collide
from collide.scenes import load

scene = load("panda_workbench", meshes="hull")
checker = collide.RobotChecker.from_scene(scene)

# A slice of space 12 cm above the bench, 2 cm apart: how far is it to the nearest thing that is no part of the robot?
x, y = np.arange(-0.2, 1.2, 0.02), np.arange(-0.8, 0.8, 0.02)
points = np.array([(a, b, 0.87) for b in y for a in x])
space = checker.world.nearest(points)
clearance = space["distance"].reshape(len(y), len(x))

# The robot as it stands, its first and fourth joint turned: the least distance to anything, itself too.
joints = (0, 3)
turned = [np.linspace(checker.robot.lower[k], checker.robot.upper[k], 60) for k in joints]
Q = np.repeat(scene.placements["panda"].q[None], 3600, axis=0)
Q[:, joints] = np.stack(np.meshgrid(*turned), axis=-1).reshape(-1, 2)
robot = checker.distances(Q)
least = robot.distance.reshape(60, 60)

names, counts = np.unique([f"{a} – {b}" for a, b in robot.names], return_counts=True)
print(f"{len(points)} points: {(clearance <= 0).mean():.0%} in something, gaps up to {clearance.max():.2f} m")
print(f"{len(Q)} postures: {robot.hit.mean():.0%} collide, depths up to {-least.min():.2f} m, gaps {least.max():.2f} m")
for k in counts.argsort()[:-4:-1]:
    print(f"  nearest in {counts[k]:4} of them: {names[k]}")

if len(sys.argv) > 1 and find_spec("matplotlib"):  # python 19_nearest_obstacles.py map.png
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
    for axis, across, up, field in ((axes[0], x, y, clearance), (axes[1], *turned, least)):
        picture = axis.pcolormesh(across, up, field, cmap="RdYlBu", vmin=-0.2, vmax=0.2)
        axis.contour(across, up, field, [0.0], colors="black")
        figure.colorbar(picture, ax=axis, label="distance to the nearest obstacle [m]")
    axes[0].set(xlabel="x [m]", ylabel="y [m]", title="0.12 m above the bench", aspect="equal")
    axes[1].set(xlabel="joint 1 [rad]", ylabel="joint 4 [rad]", title="the panda, two joints turned")
    figure.savefig(sys.argv[1], dpi=110)
elif len(sys.argv) > 1:  # without matplotlib: a table to be drawn elsewhere
    np.savetxt(sys.argv[1] + ".csv", np.column_stack([points, space["distance"]]), header="x y z distance")
