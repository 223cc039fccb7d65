"""Programs of three engines written down as scenes while they run, and each engine's own answer judged exactly."""

import sys
from pathlib import Path
from tempfile import mkdtemp

import coal
import fcl
import numpy as np
import pybullet

from collide.adapters.fuzzing.recorders import record_coal, record_fcl, record_pybullet
from collide.adapters.fuzzing.scene_findings import save_findings
from collide.adapters.peers.compare import compare

folder = Path(sys.argv[1] if len(sys.argv) > 1 else mkdtemp())
folder.mkdir(parents=True, exist_ok=True)

# A crate rests flush on a pallet, barely turned.
c, s = 0.9999996566944359, 0.0008286199432226119
shapes = fcl.Box(1.1, 1.0, 0.25), fcl.Box(1.0, 1.0, 1.0)
poses = fcl.Transform(), fcl.Transform(np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), np.array([-0.2, 0, 0.625]))
objects = [(fcl.CollisionObject(shape, X), shape) for shape, X in zip(shapes, poses)]
scenes = {"fcl": record_fcl(objects, folder / "fcl.json", names=["pallet", "crate"])}

# A short drum beside a tall one, which reaches 32 µm into it.
poses = coal.Transform3s.Identity(), coal.Transform3s(np.eye(3), np.array([-0.557, -1.39271494, -0.8]))
objects = [coal.CollisionObject(drum, X) for drum, X in zip((coal.Cylinder(1, 1), coal.Cylinder(0.5, 20)), poses)]
scenes["coal"] = record_coal(objects, folder / "coal.json", names=["drum", "mast"])

# Two cubes dropped at one place.
client = pybullet.connect(pybullet.DIRECT)
for _ in range(2):
    pybullet.createMultiBody(1.0, pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[0.5, 0.5, 0.5]))
scenes["pybullet"] = record_pybullet(folder / "pybullet.json", client)
pybullet.disconnect(client)

for engine, scene in scenes.items():
    print(f"{engine}: {compare(scene, engines=[engine]).pairs} pair recorded")
    for finding in save_findings(scene, [engine], folder / f"{engine}-findings"):
        print(f"  {finding.stem}: {', '.join(f.suffix for f in sorted(finding.parent.glob(f'{finding.stem}.*')))}")
print(f"all files: {folder}")
