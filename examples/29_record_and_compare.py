"""Programs of four engines written down as scenes while they run, and each engine's own answers judged exactly."""

import sys
from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from collide.adapters.fuzzing.recorders import record_coal, record_fcl, record_mujoco, record_pybullet
from collide.adapters.fuzzing.scene_findings import save_findings
from collide.adapters.peers.compare import compare

COS, SIN = 0.9999996566944359, 0.0008286199432226119
R = np.array([[COS, SIN, 0.0], [-SIN, COS, 0.0], [0.0, 0.0, 1.0]])
OCTAHEDRON = "1 0 0  -1 0 0  0 1 0  0 -1 0  0 0 1  0 0 -1"


def fcl_program(place):
    """A crate rests flush on a pallet, barely turned."""
    import fcl

    pallet, crate = fcl.Box(1.1, 1.0, 0.25), fcl.Box(1.0, 1.0, 1.0)
    at = fcl.Transform(np.eye(3), np.zeros(3)), fcl.Transform(R, np.array([-0.2, 0.0, 0.625]))
    objects = [(fcl.CollisionObject(shape, X), shape) for shape, X in zip((pallet, crate), at)]
    return record_fcl(objects, place, names=["pallet", "crate"])


def coal_program(place):
    """A short drum beside a tall one, which reaches 32 µm into it."""
    import coal

    at = coal.Transform3s.Identity(), coal.Transform3s(np.eye(3), np.array([-0.557, -1.39271494, -0.8]))
    objects = [coal.CollisionObject(drum, X) for drum, X in zip((coal.Cylinder(1, 1), coal.Cylinder(0.5, 20)), at)]
    return record_coal(objects, place, names=["drum", "mast"])


def pybullet_program(place):
    """Two cubes dropped at one place."""
    import pybullet as p

    client = p.connect(p.DIRECT)
    for _ in range(2):
        p.createMultiBody(1.0, p.createCollisionShape(p.GEOM_BOX, halfExtents=[0.5, 0.5, 0.5]))
    try:
        return record_pybullet(place, client)
    finally:
        p.disconnect(client)


def mujoco_program(place):
    """Two octahedra, at one place before the first step."""
    import mujoco

    body = "<body><freejoint/><geom name='{}' type='mesh' mesh='gem'/></body>"
    model = mujoco.MjModel.from_xml_string(
        f"<mujoco><asset><mesh name='gem' vertex='{OCTAHEDRON}' inertia='convex'/></asset>"
        f"<worldbody>{body.format('ruby')}{body.format('topaz')}</worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    print(f"  MuJoCo itself: {data.ncon} contacts")
    return record_mujoco(model, data, place)


folder = Path(sys.argv[1] if len(sys.argv) > 1 else mkdtemp())
programs = {"fcl": fcl_program, "coal": coal_program, "pybullet": pybullet_program, "mujoco": mujoco_program}
for engine, program in programs.items():
    print(f"{engine}: {program.__doc__}")
    try:
        scene = program(folder / f"{engine}.json")
    except ImportError as missing:
        print(f"  {missing}")
        continue
    judged = compare(scene, engines=[engine])
    print(f"  {judged.pairs} pair recorded; collide wrong: {judged.ours_wrong}")
    for finding in save_findings(scene, [engine], folder / f"{engine}-findings"):
        print(f"  {finding.stem}: {', '.join(f.suffix for f in sorted(finding.parent.glob(f'{finding.stem}.*')))}")
print(f"all files: {folder}")
