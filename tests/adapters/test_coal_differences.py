"""The rows of docs/hosts.md that say where coal differs: each asked of coal itself and of our stand-in, in children."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from typing import NamedTuple

import pytest

pytestmark = pytest.mark.skipif(importlib.util.find_spec("coal") is None, reason="coal is not installed")

#: What every snippet has.
HEAD = """
import json, sys, warnings
import numpy as np
warnings.simplefilter("ignore")
C = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
F = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
              [0, 6, 4], [1, 5, 7], [1, 7, 3]])
def at(x=0.0, y=0.0, z=0.0):
    return coal.Transform3s(np.eye(3), np.array([x, y, z], dtype=float))
def mesh(kind="OBBRSS"):
    m = getattr(coal, "BVHModel" + kind)()
    m.beginModel(12, 8), m.addVertices(C), m.addTriangles(F), m.endModel()
    return m
def distance(g1, T1, g2, T2):
    result = coal.DistanceResult()
    coal.distance(g1, T1, g2, T2, coal.DistanceRequest(), result)
    return result
def collided(g1, T1, g2, T2, **fields):
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    for name, value in fields.items():
        setattr(request, name, value)
    coal.collide(g1, T1, g2, T2, request, result)
    return result
def said(ask):
    try:
        return ask()
    except Exception as error:
        return [kind.__name__ for kind in (ValueError, TypeError) if isinstance(error, kind)] or "?"
"""


class Row(NamedTuple):
    """A snippet that sets ``answer``, and what it is with coal and here."""

    snippet: str
    coal: object
    ours: object


FIELD = "coal.HeightFieldAABB(1.0, 1.0, np.zeros((3, 3)), -1.0)"
ROWS = {
    "can in a box": Row(
        "answer = collided(coal.Box(1, 1, 0.5), at(), coal.Cylinder(0.25, 0.5), at(z=-0.25), enable_contact=False)"
        ".numContacts()", 0, 1,
    ),
    "the same with contacts": Row(
        "answer = round(collided(coal.Box(1, 1, 0.5), at(), coal.Cylinder(0.25, 0.5), at(z=-0.25))"
        ".getContact(0).penetration_depth, 6)", -0.25, -0.25,
    ),
    "nearest of all": Row(
        "m = coal.DynamicAABBTreeCollisionManager()\nball = coal.Sphere(0.5)\n"
        "objects = [coal.CollisionObject(ball, at(2.0 * k * k)) for k in range(5)]\n"
        "for o in objects: m.registerObject(o)\nm.setup()\ncb = coal.DistanceCallBackDefault()\n"
        "m.distance(cb)\nanswer = cb.data.result.min_distance", 9.0, 1.0,
    ),
    "managers and margins": Row(
        "m = coal.NaiveCollisionManager()\nball = coal.Sphere(0.5)\n"
        "objects = [coal.CollisionObject(ball, at(k)) for k in (0, 1.1)]\n"
        "for o in objects: m.registerObject(o)\nm.setup()\ncb = coal.CollisionCallBackDefault()\n"
        "cb.data.request.security_margin = 0.2\nm.collide(cb)\nanswer = cb.data.result.numContacts()", 0, 1,
    ),
    "facets of a mesh that comes second": Row(
        "r = distance(coal.Sphere(0.5), at(2.0, 0.1, 0.2), mesh(), at())\nanswer = [r.b1, r.b2]", [3, -1], [-1, 3],
    ),
    "normal of two meshes": Row(
        "n = distance(mesh(), at(), mesh(), at(1.8, 0.1, 0.2)).normal\n"
        "answer = bool(abs(np.linalg.norm(n) - 1.0) < 1e-9)", False, True,
    ),
    "depths of facets": Row(
        "cs = collided(mesh(), at(), mesh(), at(0.8, 0.1, 0.1), num_max_contacts=100).getContacts()\n"
        "answer = round(max(-c.penetration_depth for c in cs), 6)", 0.9, 0.1,
    ),
    "patch of a can on a box": Row(
        "g = coal.Cylinder(0.2, 1), at(0.2, 0.1, 0.99), coal.Box(1, 1, 1), at()\nq = coal.ContactPatchRequest()\n"
        "r = coal.ContactPatchResult(q)\ncoal.computeContactPatch(*g, collided(*g), q, r)\n"
        "answer = r.getContactPatch(0).size() >= 6", False, True,
    ),
    "triangle": Row("answer = said(lambda: distance(coal.TriangleP(*C[[1, 3, 5]]), at(), coal.Sphere(0.5), at(-0.2, "
                    "-0.2, 2)).min_distance)", ["ValueError"], 1.0),
    "distance of a field": Row(
        f"answer = said(lambda: distance({FIELD}, at(), coal.Sphere(0.5), at(z=2)).min_distance)", ["ValueError"], 1.5,
    ),
    "boxes of two kinds": Row("answer = said(lambda: collided(mesh(), at(), mesh('OBB'), at(0.5)).isCollision())",
                              ["ValueError"], True),
    "field and mesh": Row(f"answer = said(lambda: collided({FIELD}, at(), mesh(), at()).isCollision())",
                          ["ValueError"], True),
    "two fields": Row(f"answer = said(lambda: collided({FIELD}, at(), {FIELD}, at(z=0.5)).isCollision())",
                      ["ValueError"], True),
    "lists of objects": Row("answer = said(lambda: coal.NaiveCollisionManager().registerObjects([]))",
                            ["TypeError"], None),
    "objects of a manager": Row("answer = said(lambda: coal.NaiveCollisionManager().getObjects())", ["TypeError"], []),
    "pairs that were collected": Row("answer = said(lambda: coal.CollisionCallBackCollect(1).getCollisionPairs())",
                                     ["TypeError"], []),
    "bodies of a distance": Row("r = distance(coal.Sphere(1), at(), coal.Sphere(1), at(3))\n"
                                "answer = said(lambda: type(r.o1).__name__)", ["TypeError"], "Sphere"),
    "callbacks of one's own": Row("class Mine(coal.CollisionCallBackBase):\n    pass\n"
                                  "answer = said(lambda: type(Mine()).__name__)", "?", "Mine"),
    "lists": Row("answer = said(lambda: coal.Box([1, 2, 3]).computeVolume())", ["TypeError"], 6.0),
    "long quaternions": Row("R = coal.Quaternion(2.0, 0.0, 0.0, 2.0).matrix()\n"
                            "answer = bool(np.abs(R @ R.T - np.eye(3)).max() < 1e-12)", False, True),
}


def run(code: str) -> subprocess.CompletedProcess:
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)


def answers(module: str, row_names: list[str]) -> list:
    """What the module says to these rows, in a process of its own."""
    code = [f"import {module} as coal", HEAD, "answers = []"]
    code += [f"{ROWS[name].snippet}\nanswers.append(answer)" for name in row_names]
    code += ["print('FOUND', json.dumps(answers))"]
    done = run("\n".join(code))
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.split("FOUND")[1])


def test_rows_of_the_table():
    names = list(ROWS)
    theirs, ours = (answers(module, names) for module in ("coal", "collide.adapters.hosts.coal_api"))
    assert dict(zip(names, theirs)) == {name: row.coal for name, row in ROWS.items()}
    assert dict(zip(names, ours)) == {name: row.ours for name, row in ROWS.items()}


@pytest.mark.parametrize("module, ends", [("coal", True), ("collide.adapters.hosts.coal_api", False)])
def test_vertices_before_a_model(module, ends):
    code = f"import {module} as coal\n{HEAD}\nm = coal.BVHModelOBBRSS()\n"
    code += "m.addVertex(np.zeros(3)); m.addTriangle(np.zeros(3), np.ones(3), np.eye(3)[0]); print(m.endModel())"
    done = run(code)
    assert (done.returncode < 0) == ends
    assert ends or done.stdout == "-2\n"
