"""A scene file, the report made of it, and the JSON for other programs."""

import json
import tempfile
from pathlib import Path

from collide.reports import report, terminal
from collide.scenes import load

# Scene files are YAML or JSON with the same keys (docs/scene-format.md); JSON needs no further package.
SCENE = {
    "collide": 1,
    "name": "press",
    "units": "mm",
    "bodies": [
        {"name": "anvil", "shape": {"box": {"size": [200, 200, 50]}}, "pose": {"xyz": [0, 0, -25]}, "static": True},
        {"name": "blank", "shape": {"cylinder": {"radius": 40, "length": 8}}, "pose": {"xyz": [0, 0, 4]}},
        {"name": "punch", "shape": {"cone": {"radius": 20, "length": 60}},
         "pose": {"xyz": [0, 0, 36], "rpy_deg": [180, 0, 0]}},
        {"name": "ram", "shape": {"box": {"size": [80, 80, 30]}}, "pose": {"xyz": [0, 0, 91]}},
    ],
    "allow": [["blank", "anvil", "lies on it"]],
}

with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "press.json"
    file.write_text(json.dumps(SCENE), encoding="utf-8")
    made = report.make(load(file), clearance=0.02)  # metres here, whatever the file's units

# What `collide report press.json --clearance 2cm --proofs` prints; without proofs it is the first page alone:
terminal.write(terminal.render(made, proofs=True, width=100))

# The same as plain data, at full precision; docs/report-schema.md describes every field.
data = made.to_dict()
print("\nas data:", data["verdict"]["text"])
for pair in data["colliding"] + data["near"]:
    print(f"  {pair['a']} {pair['b']}: {pair['lower']} <= {pair['distance']} <= {pair['upper']} by {pair['how']}")
