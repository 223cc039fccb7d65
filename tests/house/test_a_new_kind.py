"""A curved kind is a file and a line in a few others: a double cone is added to a copy of the package, and asked.

The copy runs as plain Python: its kernels are what the sources say, and nothing has to be compiled.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from installed_copy import PACKAGE, child, copied, environment

#: The most files of the package that a new curved kind may touch, its own among them.
MOST = 8

OWN = "curved/bicone.py"
BICONE = '''"""Two cones, base to base at z = 0: params = (radius, half length)."""

import math

import numpy as np

from collide.curved.chords import Line, together
from collide.curved.cone import cone_chord
from collide.curved.cylinder import rim_extents, rim_point
from collide.curved.unit_polytopes import MARGIN, ring, rings_around
from collide.kernels import kernel
from collide.numerics.vec3 import Vec3


@kernel(inline=True)
def bicone_support(params, at, g):
    x, y, across = rim_point(params[at], g)
    if params[at + 1] * abs(g.z) > across:
        return Vec3(0.0, 0.0, math.copysign(params[at + 1], g.z))
    return Vec3(x, y, 0.0)


@kernel(inline=True)
def bicone_normal(params, at, p):
    across = math.sqrt(p.x * p.x + p.y * p.y)
    return Vec3(p.x, p.y, math.copysign(across * params[at] / params[at + 1], p.z))


@kernel
def bicone_chord(line, radius, half):
    o, d, h = line.origin, line.direction, 0.5 * half
    upper = cone_chord(Line(Vec3(o.x, o.y, o.z - h), d, line.length, line.error), radius, h)
    lower = cone_chord(Line(Vec3(o.x, o.y, -o.z - h), Vec3(d.x, d.y, -d.z), line.length, line.error), radius, h)
    return together(upper, lower)._replace(first_side=0, last_side=0)


def bicone_extents(params, g):
    return np.maximum(rim_extents(params[0], g), params[1] * np.abs(g[..., 2]))


def within_bicone(params, points, error):
    x, y, z = points
    aside = np.sqrt(x * x + y * y) + 2.0 * error
    return aside <= params[0] * (params[1] - np.abs(z) - error) / params[1]


def bicone_polytopes(params):
    tips = np.array([[0.0, 0.0, -params[1]], [0.0, 0.0, params[1]]])
    outer, inner = rings_around(params[0])
    return (np.vstack([ring(outer, 0.0), tips * (1 + MARGIN)]), np.vstack([ring(inner, 0.0), tips * (1 - MARGIN)]))
'''
TRIANGLES = """def _bicone(shape, tolerance):
    ring, deviation = _ring(shape.radius, tolerance)
    n, half = len(ring), 0.5 * shape.length
    vertices = np.vstack([np.column_stack([ring, np.zeros(n)]), [[0.0, 0.0, half], [0.0, 0.0, -half]]])
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    upper, lower = np.full(n, n), np.full(n, n + 1)
    faces = [np.column_stack([k, after, upper]), np.column_stack([after, k, lower])]
    return Tessellation(vertices, np.concatenate(faces), deviation)


"""
#: What is inserted before each of these texts.
EDITS = {
    "curved/shape_kinds.py": [
        ("#: The numbers by name", "BICONE = 5\n"), ('"HALFSPACE": HALFSPACE}', '"BICONE": BICONE, '),
    ],
    "curved/curved_kinds.py": [
        (
            "from collide.curved.cone import",
            "from collide.curved.bicone import bicone_chord, bicone_extents, bicone_normal\n"
            + "from collide.curved.bicone import bicone_polytopes, bicone_support, within_bicone\n",
        ),
        ("CONE, CYLINDER, ELLIPSOID\n", "BICONE, "),
        (
            "    CYLINDER: CurvedKind(",
            "    BICONE: CurvedKind(bicone_extents, within_bicone, bicone_polytopes),\n",
        ),
        (
            "    if kind == CONE:\n        return cone_support",
            "    if kind == BICONE:\n        return bicone_support(params, at, g)\n",
        ),
        (
            "    if kind == CONE:\n        return cone_normal",
            "    if kind == BICONE:\n        return bicone_normal(params, at, p)\n",
        ),
        (
            "    if kind == CONE:\n        return cone_chord",
            "    if kind == BICONE:\n        return bicone_chord(line, params[at], params[at + 1])\n",
        ),
    ],
    "shapes/primitives.py": [
        (
            "class Ellipsoid(Shape):",
            'class Bicone(Cylinder):\n    """Two cones along z, base to base."""\n\n    __slots__ = ()\n\n\n',
        )
    ],
    "lowering/convex_sets.py": [
        ("def _ellipsoid(", "def _bicone(shape) -> PrimitiveNumbers:\n    return (5, *_cylinder(shape)[1:])\n\n\n"),
        ("    Sphere: _sphere, Box: _box,", "    primitives.Bicone: _bicone,\n"),
        ("from collide.shapes.shape import", "from collide.shapes import primitives\n"),
    ],
    "lowering/kinds.py": [("\n\n#: Kinds whose surface", "    BICONE = 12\n")],
    "shapes/tessellation.py": [
        (
            "def _ring(",
            TRIANGLES,
        ),
        ("    Cylinder: _cylinder,", "    primitives.Bicone: _bicone,\n"),
        ("from collide.shapes.shape import", "from collide.shapes import primitives\n"),
    ],
    "__init__.py": [
        ('    "collide.shapes.tessellation": (', '    "collide.shapes.primitives": ("Bicone",),\n'),
        ('    "BooleanResult", "Box",', '    "Bicone",\n'),
    ],
}
#: Closed forms: a double cone of radius 0.5 and half length 1, unturned.
ASKED = """
import math
import numpy as np
import collide

body, box, eye = collide.Bicone(0.5, length=2.0), collide.Box((1, 1, 1)), np.eye(4)
at = lambda *p: collide.pose(p)
slant = math.atan2(0.5, 1.0)  # of the side against the axis


def near(row, value, off=1e-12):
    assert row.lower <= value + off and value - off <= row.upper, (row, value)


near(collide.distance(body, box, eye, at(0, 0, 1.75)), 0.25)  # the tip below a face
near(collide.distance(body, box, eye, at(1.25, 0, 0)), 0.25)  # the rim beside a face
beside = at(0.5 + 0.3 * math.cos(slant), 0, 0.3 * math.sin(slant))
near(collide.distance(body, collide.Sphere(0.1), eye, beside), 0.2, 1e-9)
near(collide.distance(body, collide.Bicone(0.5, length=2.0), eye, at(0, 0, 2.5)), 0.5)
near(collide.distance(body, collide.Halfspace((0, 0, 1), -1.5), eye, eye), 0.5)
near(collide.distance(body, box, eye, at(0, 0, 1.375)), -0.125, 1e-6)  # the tip within
assert collide.collide(body, box, eye, at(0, 0, 1.5)) and not collide.collide(body, box, eye, at(0, 0, 1.5000001))
corners = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
facets = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4),
          (1, 5, 7), (1, 7, 3)]
mesh = collide.Mesh(corners, facets)
near(collide.distance(body, mesh, eye, at(0, 0, 1.75)), 0.25, 1e-9)
assert collide.collide(body, mesh, eye, at(0, 0, 1.25)) and not collide.collide(body, mesh, eye, at(1.01, 0, 0))
rows = collide.contacts(body, box, eye, at(0, 0, 1.4375))
assert len(rows.distance) == 1 and abs(rows.distance[0] + 0.0625) < 1e-6, rows
hits = collide.raycast(body, eye, [(0.25, 0, 5), (0, 5, 0), (0.6, 0, 5)], [(0, 0, -1), (0, -1, 0), (0, 0, -1)])
assert np.allclose(hits.distance[:2], (4.5, 4.5)) and hits.hit.tolist() == [True, True, False], hits
assert np.allclose(hits.normal[0], (math.cos(slant), 0, math.sin(slant))), hits
world = collide.World()
ids = [world.add(shape, X) for shape, X in ((body, eye), (box, at(0, 0, 1.4)), (box, at(3, 0, 0)))]
assert [tuple(row) for row in world.collisions().rows[["a", "b"]].tolist()] == [tuple(ids[:2])], world.collisions()
triangles = collide.tessellate(body, tolerance=1e-3)
volume = np.einsum("ij,ij->i", np.cross(*triangles[0][triangles[1]][:, :2].transpose(1, 0, 2)),
                   triangles[0][triangles[1]][:, 2]).sum() / 6
assert abs(volume - math.pi / 6) < 5e-3, volume
print("asked")
"""


def _with_edits(package: Path) -> list[str]:
    """Add the kind to a package; the files touched."""
    (package / OWN).write_text(BICONE)
    for name, edits in EDITS.items():
        text = (package / name).read_text()
        for before, inserted in edits:
            assert text.count(before) == 1, (name, before, text.count(before))
            text = text.replace(before, inserted + before)
        (package / name).write_text(text)
    return [OWN, *EDITS]


@pytest.mark.slow  # kernels as plain Python
def test_a_double_cone_is_added_in_eight_places(tmp_path):
    site = copied(tmp_path / "site")
    touched = _with_edits(site / "collide")
    assert len(touched) <= MOST, touched
    done = child(["-c", ASKED], environment(site, NUMBA_DISABLE_JIT="1"))
    assert done.returncode == 0 and done.stdout == "asked\n", done.stderr


#: Kernels of a kind that is not listed answer NaN, or leave the question open.
UNLISTED = """
import numpy as np
from collide.curved.chords import UNCLEAR, Line
from collide.curved.curved_kinds import CURVED, curved_chord, curved_normal, curved_support
from collide.curved.shape_kinds import NUMBERS
from collide.numerics.vec3 import Vec3

unlisted, params, g = max(NUMBERS.values()) + 1, np.ones(4), Vec3(0.0, 0.6, 0.8)
assert set(CURVED) == {NUMBERS[name] for name in ("CYLINDER", "CONE", "ELLIPSOID")}
for kind in CURVED:
    assert np.isfinite(curved_support(kind, params, 0, g)).all(), kind
    assert np.isfinite(curved_normal(kind, params, 0, g, 0)).all(), kind
assert np.isnan(curved_support(unlisted, params, 0, g)).all()
assert np.isnan(curved_normal(unlisted, params, 0, g, 0)).all()
assert curved_chord(unlisted, params, 0, Line(g, g, 1.0, 0.0)).state == UNCLEAR
print("refused")
"""


def test_what_is_not_listed_is_refused():
    """Neither kernels nor numpy code takes a kind that is not listed for another."""
    done = child(["-c", UNLISTED], environment(PACKAGE.parent, NUMBA_DISABLE_JIT="1"))
    assert done.returncode == 0 and done.stdout == "refused\n", done.stderr
