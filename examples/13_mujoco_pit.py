"""MuJoCo on collide: bodies in a pit, and two tetrahedra in one place, which MuJoCo alone does not see."""

import time

import mujoco
import numpy as np

from collide.adapters.hosts.mujoco import install, world

random = np.random.default_rng(0)
points = random.normal(size=(12, 3))
points *= 0.1 / np.linalg.norm(points, axis=1)[:, None]
geoms = ('type="box" size=".07 .06 .05"', 'type="mesh" mesh="hull"', 'type="capsule" size=".05 .06"')
bodies = "".join(
    f'<body pos="{0.2 * (k % 3)} {0.2 * (k // 3 % 3)} {0.2 + 0.2 * (k // 9)}"><freejoint/><geom {geoms[k % 3]}/></body>'
    for k in range(36)
)
walls = "".join(
    f'<geom type="plane" size="3 3 1" pos="{0.2 + 0.4 * x} {0.2 + 0.4 * y} 0" zaxis="{-x} {-y} 0"/>'
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
)
vertices = " ".join(f"{v:.5f}" for v in points.ravel())
model = mujoco.MjModel.from_xml_string(
    f'<mujoco><option timestep="0.004"/><asset><mesh name="hull" vertex="{vertices}"/></asset>'
    f'<worldbody><geom name="floor" type="plane" size="3 3 1"/>{walls}{bodies}</worldbody></mujoco>'
)


def fall(seconds: float = 3.0) -> tuple[mujoco.MjData, float]:
    data, start = mujoco.MjData(model), time.perf_counter()
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return data, time.perf_counter() - start


alone, t_alone = fall()
with install(model):
    ours, t_ours = fall()
with install(model, "cull"):
    culled, t_culled = fall()
print(f"culled steps have MuJoCo's bits: {np.array_equal(alone.qpos, culled.qpos)}")
for name, data, seconds in (("MuJoCo alone", alone, t_alone), ("collide", ours, t_ours), ("culled", culled, t_culled)):
    deepest = min(contact.dist for contact in data.contact)
    print(f"{name:13} {1e3 * seconds / 750:.2f} ms a step, {data.ncon} contacts, deepest {-1e3 * deepest:.2f} mm")

# The same bodies in a World, for every other question.
scene = world(model, ours)
nearest = scene.distances(max_distance=0.001)
print(f"a World of {len(scene)} bodies, {len(nearest)} pairs within 1 mm")

# Two equal tetrahedra in one place, turned alike: as deep in each other as bodies can be.
pair = '<body><freejoint/><geom type="mesh" mesh="t"/></body>'
model = mujoco.MjModel.from_xml_string(
    '<mujoco><asset><mesh name="t" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3"/></asset>'
    f"<worldbody>{pair * 2}</worldbody></mujoco>"
)
data, missed, seen = mujoco.MjData(model), 0, 0
for _ in range(100):
    data.qpos[3:7] = data.qpos[10:14] = random.normal(size=4)
    mujoco.mj_forward(model, data)
    missed += data.ncon == 0
    with install(model):
        mujoco.mj_forward(model, data)
        seen += data.ncon > 0
print(f"of 100 pairs of tetrahedra in one place MuJoCo alone misses {missed}; with collide all are seen: {seen == 100}")
