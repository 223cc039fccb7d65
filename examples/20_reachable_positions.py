"""Which share of a grid of tool positions the panda reaches free of collision, by a sweep over random postures."""

import tempfile
import time
from importlib.util import find_spec

import numpy as np

import collide
from collide.scenes import load

scene = load("panda_workbench", meshes="hull")
checker = collide.RobotChecker.from_scene(scene)
robot, n = checker.robot, 200_000
Q = collide.DrawnConfigurations(n, seed=1).of(robot)

begin = time.perf_counter()
if find_spec("pyarrow"):  # in processes, to files; the same call goes on where it was stopped: docs/sweeps.md
    with tempfile.TemporaryDirectory() as folder:
        hit = collide.sweep(checker, collide.DrawnConfigurations(n, seed=1), folder, workers=2).collides()
else:
    hit = checker.collides(Q)
print(f"{n} postures, {hit.mean():.0%} collide, {n / (time.perf_counter() - begin):,.0f} a second")

# Where the tool is: between the finger tips, 10 cm out along the hand's z axis, and whether it points down.
X_WH = np.concatenate([checker.link_poses(part)[:, robot.links.index("panda_hand")] for part in np.array_split(Q, 50)])
p_WT, points_down = X_WH[:, :3, 3] + 0.1034 * X_WH[:, :3, 2], X_WH[:, 2, 2] < -0.9

# A grid above the bench, cells of 10 cm: which of them hold a tool position?
low, high, side = np.array([0.0, -0.7, 0.75]), np.array([1.0, 0.7, 1.65]), 0.1
shape = np.rint((high - low) / side).astype(int)
cell = np.floor((p_WT - low) / side).astype(int)
inside = ((cell >= 0) & (cell < shape)).all(axis=1)
number = np.ravel_multi_index(cell[inside].T, shape)


def share(rows):
    """Of the cells, the share that these of the postures reach."""
    return len(np.unique(number[rows[inside]])) / shape.prod()


print(f"{shape.prod()} cells: {share(np.ones(n, bool)):.0%} within reach, {share(~hit):.0%} free of collision")
print(f"with the tool pointing down: {share(~hit & points_down):.0%}; free of collision, layer by layer:")
layers = np.zeros(shape, dtype=bool)
layers.reshape(-1)[np.unique(number[(~hit)[inside]])] = True
for k in range(shape[2]):
    print(f"  {low[2] + k * side:.2f} m above the floor: {layers[:, :, k].mean():.0%}")
