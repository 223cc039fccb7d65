"""MuJoCo on collide: bodies in a pit, and two tetrahedra in one place, which MuJoCo alone does not always see."""

import mujoco
import numpy as np

from collide.adapters.hosts.mujoco import install, world

geoms = ('type="box" size=".07 .06 .05"', 'type="mesh" mesh="t"', 'type="capsule" size=".05 .06"')
bodies = "".join(
    f'<body pos="{0.2 * (k % 3)} {0.2 * (k // 3 % 3)} {0.2 + 0.2 * (k // 9)}"><freejoint/><geom {geoms[k % 3]}/></body>'
    for k in range(36)
)
walls = "".join(
    f'<geom type="plane" size="3 3 1" pos="{0.2 + 0.4 * x} {0.2 + 0.4 * y} 0" zaxis="{-x} {-y} 0"/>'
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1))
)
mesh = '<mujoco><asset><mesh name="t" vertex="0 0 0 .15 0 0 0 .15 0 0 0 .15"/></asset><worldbody>'
model = mujoco.MjModel.from_xml_string(
    f'{mesh}<geom name="floor" type="plane" size="3 3 1"/>{walls}{bodies}</worldbody></mujoco>'
)
ended = {}
for mode in ("alone", "contacts", "cull"):
    data = mujoco.MjData(model)
    installed = install(model, mode) if mode != "alone" else None
    for _ in range(750):
        mujoco.mj_step(model, data)
    if installed:  # or `with install(model):`
        installed.uninstall()
    ended[mode] = data
    print(f"{mode:9} {data.ncon} contacts, the deepest {-1e3 * min(c.dist for c in data.contact):.2f} mm")
print(f"culled steps have MuJoCo's bits: {np.array_equal(ended['alone'].qpos, ended['cull'].qpos)}")
print(f"a World of {len(world(model, ended['contacts']))} bodies")

# Two equal tetrahedra in one place, turned alike: as deep in each other as bodies can be.
pair = '<body><freejoint/><geom type="mesh" mesh="t"/></body>'
model = mujoco.MjModel.from_xml_string(f"{mesh}{pair * 2}</worldbody></mujoco>")
data, random, missed, seen = mujoco.MjData(model), np.random.default_rng(0), 0, 0
for _ in range(100):
    data.qpos[3:7] = data.qpos[10:14] = random.normal(size=4)
    mujoco.mj_forward(model, data)
    missed += data.ncon == 0
    with install(model):
        mujoco.mj_forward(model, data)
        seen += data.ncon > 0
print(f"of 100 pairs of tetrahedra in one place MuJoCo alone misses {missed}; with collide all are seen: {seen == 100}")
