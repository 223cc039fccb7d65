"""Mesh files in scenes as they are, not as hulls: a pin in a notch is free, an open mesh says where it is open."""

import json
import tempfile
from pathlib import Path

from collide.reports import report, terminal
from collide.scenes import load

# A bracket: an L of 40 mm, 20 mm thick, in millimetres as CAD writes it.
PROFILE = [(0, 0), (40, 0), (40, 10), (10, 10), (10, 40), (0, 40)]
corners = [(x, y, z) for z in (0, 20) for x, y in PROFILE]
caps = [(1, 2, 3), (1, 3, 4), (1, 4, 5), (1, 5, 6)]
facets = [(a, c, b) for a, b, c in caps] + [(a + 6, b + 6, c + 6) for a, b, c in caps]
for a, b in zip(range(1, 7), (2, 3, 4, 5, 6, 1)):
    facets += [(a, b, b + 6), (a, b + 6, a + 6)]


def obj(some) -> str:
    return "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "".join(f"f {a} {b} {c}\n" for a, b, c in some)


SCENE = {
    "collide": 1,
    "name": "bracket",
    "units": "mm",
    "bodies": [
        {"name": "bracket", "shape": {"mesh": {"file": "bracket.obj", "scale": 0.001}}},
        {"name": "pin", "shape": {"capsule": {"radius": 4, "length": 30}}, "pose": {"xyz": [18, 18, 10]}},
        {"name": "chip", "shape": {"box": {"size": [2, 2, 2]}}, "pose": {"xyz": [5, 30, 10]}},
        {"name": "shell", "shape": {"mesh": {"file": "open.obj", "scale": 0.001}}, "pose": {"xyz": [100, 0, 0]}},
    ],
}

with tempfile.TemporaryDirectory() as folder:
    (Path(folder) / "bracket.obj").write_text(obj(facets))
    (Path(folder) / "open.obj").write_text(obj(facets[:-2]))
    file = Path(folder) / "scene.json"
    file.write_text(json.dumps(SCENE), encoding="utf-8")
    as_it_is = report.make(load(file), clearance=0.005)
    by_hulls = report.make(load(file, meshes="hull"), clearance=0.005)

# The pin stands in the notch, 4 mm from its walls. The chip is inside the bracket and touches no facet of it.
terminal.write(terminal.render(as_it_is, width=110))

print("\nas it is:", [(pair.a, pair.b) for pair in as_it_is.colliding])
print("by hulls:", [(pair.a, pair.b) for pair in by_hulls.colliding])
print("the bracket as a hull:", by_hulls.approximations[0]["what"])
