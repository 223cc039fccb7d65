"""A program written for pybullet, on collide: one line, and what it changes. Two arms and a table."""

import time

import numpy as np
import pybullet
import pybullet_data

from collide.adapters.hosts import pybullet_mirror

p = pybullet_mirror.attach(pybullet)  # in place of: import pybullet as p

client = p.connect(p.DIRECT)
p.setAdditionalSearchPath(pybullet_data.getDataPath())
table = p.loadURDF("table/table.urdf", [0.5, 0.0, -0.63])
kuka = p.loadURDF("kuka_iiwa/model.urdf", useFixedBase=True)
panda = p.loadURDF("franka_panda/panda.urdf", [0.7, 0.0, 0.0], useFixedBase=True)

# Random postures: which touch? Bullet's hulls are a millimetre larger than what they stand for.
random, gaps, spent = np.random.default_rng(3), [], []
for _ in range(300):
    for arm in (kuka, panda):
        for joint in range(7):
            p.resetJointState(arm, joint, random.uniform(-2.0, 2.0))
    for engine in (p, pybullet):
        begin = time.perf_counter()
        gaps.append(min(row[8] for row in engine.getClosestPoints(kuka, panda, 3.0)))
        spent.append(time.perf_counter() - begin)
ours, theirs = np.reshape(gaps, (-1, 2)).T
wrong = ((ours <= 0) != (theirs <= 0)).sum()
print(f"300 postures, {(ours <= 0).sum()} in which the arms touch; Bullet says otherwise in {wrong}")
print(f"gaps between the arms differ by {1e3 * np.median(ours - theirs):.3f} mm (median)")
spent = 1e6 * np.mean(np.reshape(spent, (-1, 2)), axis=0)
print(f"nearest points of two arms: {spent[0]:.0f} µs, Bullet {spent[1]:.0f} µs")

# A finger 0.8 mm above the table: Bullet says that they overlap.
finger, height = 9, 0.2
for joint, angle in enumerate((0.0, 0.9, 0.0, -1.6, 0.0, 2.5, 0.8)):
    p.resetJointState(panda, joint, angle)
for _ in range(4):
    p.resetBasePositionAndOrientation(panda, [0.2, 0.0, height], [0.0, 0.0, 0.0, 1.0])
    gaps = [min(row[8] for row in q.getClosestPoints(panda, table, 3.0, linkIndexA=finger)) for q in (p, pybullet)]
    height += 0.0008 - gaps[0]
print("finger over the table: {:+.3f} mm, Bullet {:+.3f} mm".format(*1e3 * np.array(gaps)))

mirror = p.mirror_of(client)
rows = mirror.world.distances(0.05)  # whatever else a World answers, proven
print(f"a World of {len(mirror.world)} links, {len(rows)} pairs within 5 cm, proven: {rows['certified'].all()}")
