"""A box of configurations grown in free space around a panda's posture: all of it proven free, not sampled.

What regions of convex planners (IRIS and its kin) hold with a probability, this box holds without exception: each side
is moved outwards as long as the new slab is proven free; a slab that collides or stays open is halved.
"""

import time

import numpy as np

import collide
from collide.scenes import load

checker = collide.RobotChecker.from_scene(load("panda_workbench", meshes="hull"))
lower, upper, random = checker.robot.lower, checker.robot.upper, np.random.default_rng(7)
begin, asked = time.perf_counter(), 0


def grow(q, step=0.5, smallest=0.04):
    """A box around q, as (lo, hi): sides in turn, each by its own step, until all steps are small."""
    global asked
    box, limits, steps = np.array([q, q]), (lower, upper), np.full((2, len(q)), step)
    while (steps >= smallest).any():
        for side, j in np.argwhere(steps >= smallest):
            slab = box.copy()
            slab[1 - side, j] = box[side, j]
            slab[side, j] += (2 * side - 1) * min(steps[side, j], abs(limits[side][j] - box[side, j]))
            result = checker.certify_boxes(*slab, resolution=0.02, max_cells=2000)
            asked += result.n_checked
            if result.free[0] and slab[0, j] < slab[1, j]:
                box[side, j] = slab[side, j]
            else:
                steps[side, j] /= 2
    return box


free = [q for q in random.uniform(lower, upper, (2000, len(lower))) if not checker.collides(q)]
d = checker.distances(np.array(free[:200]))
lo, hi = grow(free[int(np.argmax(d.distance))])
for name, a, b in zip(checker.robot.joint_names, lo, hi):
    print(f"{name:22} {a:7.3f} … {b:7.3f}")
print(f"box grown in {time.perf_counter() - begin:.2f} s, {asked} configurations asked")
samples = random.uniform(lo, hi, (100_000, len(lo)))
print(f"{checker.collides(samples).sum()} of {len(samples)} samples of the box collide")
path = checker.certify_path(random.uniform(lo, hi, (50, len(lo))))
print(f"a path of {len(path)} segments at random within the box: {path.free.sum()} proven free")
