"""A depth image, a robot, a proven plan: what a camera sees is the obstacle, and every motion past it is certified."""

import json
import tempfile
from pathlib import Path

import numpy as np

import collide
from collide.cli.main import main
from collide.scenes import load

# A camera looks at the bench, its robot taken away: a ray a pixel, which goes a metre ahead in each of its lengths.
bench = load("panda_workbench", meshes="hull")
world, f, (v, u) = bench.world(), 75.0, np.mgrid[:75, :120]
for name in bench.placements["panda"].carried:
    world.remove(name)
X_WC = collide.pose((2.0, 0, 2.0), R=np.column_stack([(0, 1, 0), (0.6, 0, -0.8), (-0.8, 0, -0.6)]))
rays_C = np.stack([(u - 59.5) / f, (v - 37) / f, np.ones(u.shape)], axis=-1).reshape(-1, 3)
depth = world.raycast(X_WC[:3, 3], rays_C @ X_WC[:3, :3].T)["distance"].reshape(u.shape)
seen = collide.PointCloud.from_depth(depth, fx=f, fy=f, radius=0.015, max_depth=2.5)
# What the robot knows: itself, and the points.
scene, plan, page = map(Path(tempfile.mkdtemp()).joinpath, ("seen.json", "plan.csv", "plan.html"))
seen.save(scene.with_name("seen.npz"))
panda = {"urdf": "package://example-robot-data/robots/panda_description/urdf/panda.urdf", "meshes": "hull"}
cloud = {"name": "seen", "shape": {"cloud": {"file": "seen.npz"}}, "pose": {"matrix": X_WC.tolist()}, "static": True}
scene.write_text(json.dumps({"collide": 1, "robots": [panda | {"pose": {"xyz": [0, 0, 0.72]}}], "bodies": [cloud]}))
checker = collide.RobotChecker.from_scene(load(scene))
# From one side of the parcel to the other by RRT-Connect: a node of a tree is the path to it, proven free.
random, met = np.random.default_rng(0), False
here, there = ([[np.array([joint_1, *bench.placements["panda"].q[1:]])]] for joint_1 in (-0.8, 0.38))
while not met:
    tree, target = here, random.uniform(checker.robot.lower, checker.robot.upper)
    while target is not None and not met:
        nearest = min(tree, key=lambda node: np.linalg.norm(node[-1] - target))
        q = nearest[-1] + (target - nearest[-1]) / max(np.linalg.norm(target - nearest[-1]), 1.0)  # a radian at most
        if not checker.certify_edges(nearest[-1], q).free[0]:
            break
        tree.append([*nearest, q])
        met, tree, target = tree is there and np.array_equal(q, target), there, q if tree is here else target
    here, there = there, here
first, last = sorted((here[-1], there[-1]), key=lambda path: path[0][0])
path = np.array(first + last[-2::-1])
proven, straight = checker.certify_edges(path[:-1], path[1:]), checker.certify_edges(path[0], path[-1]).time[0]
print(f"{len(seen)} points seen; the straight motion collides at {straight:.2f} of its length")
print(f"a path of {len(proven)} motions, {proven.free.sum()} of them proven free")
np.savetxt(plan, path, header=",".join(checker.robot.joint_names), delimiter=",", comments="")
main(["report", str(scene), "--trajectory", str(plan), "--html", str(page), "--quiet"])
print(f"robot, path and points: {page}, {page.stat().st_size / 1e6:.1f} MB")
