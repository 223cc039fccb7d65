"""Every row of docs/hosts.md on where python-fcl is wrong: asked of it in a child process, and of ours; both judged.

Truth is a closed form, or fractions (`collide.adapters.peers.exact`), or the oracle's bracket in 80 digits.
"""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from collide import InvalidPose
from collide.adapters.hosts import fcl_api
from collide.adapters.peers import exact

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracles"))
from curved_oracle import bracket
from exact_verdict import verdict

pytestmark = pytest.mark.skipif(importlib.util.find_spec("fcl") is None, reason="python-fcl is not installed")

PRELUDE = """
import json, math, sys
import numpy as np
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACETS = np.array([
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
])
def at(geometry, *translation, q=(1.0, 0.0, 0.0, 0.0)):
    return fcl.CollisionObject(geometry, fcl.Transform(np.array(q), np.array(translation, dtype=float)))
def hull(size):
    return fcl.Convex(CORNERS * size, 12, np.concatenate([[3, *facet] for facet in FACETS]))
signed = fcl.DistanceRequest(True, True)
wanted = fcl.CollisionRequest(10, True)
"""


def theirs(code: str, limit: float = 60.0):
    """(what python-fcl prints last as JSON, how its process ended: 0, −signal, or None where it had to be ended)."""
    command = [sys.executable, "-c", "import fcl\n" + PRELUDE + code]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        return None, None
    lines = done.stdout.strip().splitlines()
    return (json.loads(lines[-1]) if done.returncode == 0 else None), done.returncode


def ours(code: str, names: dict | None = None):
    """The same program with ours as fcl: what it prints last.   names : takes its variables."""
    printed: list[str] = []
    names = {} if names is None else names
    names.update({"fcl": fcl_api, "print": lambda text, **_: printed.append(text)})
    exec(PRELUDE + code, names)  # noqa: S102 - the program stands in this file
    return json.loads(printed[-1])


@pytest.mark.slow
def test_signed_distance_of_concentric_balls():
    code = "print(json.dumps(fcl.distance(at(fcl.Sphere(0.5), 0, 0, 0), at(fcl.Sphere(0.25), 0, 0, 0), signed)))"
    assert theirs(code, 2.5) == (None, None)
    assert ours(code) == -0.75


#: Found among 4,000 grids of boxes, capsules, ellipsoids and cylinders; of each what python-fcl does.
SIGNED = {
    "boxes that overlap by less than 1e-12": (
        "fcl.Box(1, 0.25, 0.25)", "fcl.Box(0.25, 0.25, 0.75)", (0.25, -0.25, 0.49999999999991007),
        (1.0, 3.899744776227749e-16, -7.673374071165575e-16, 6.4765831444805e-16), "ends",
    ),
    "other boxes": (
        "fcl.Box(0.25, 0.5, 0.25)", "fcl.Box(0.5, 0.75, 0.25)", (0.0, -0.25, 0.24999999999970765),
        (1.0, 2.4902342486284458e-11, 3.6971449139352745e-11, -1.3260750184682326e-11), "ends",
    ),
    "a cylinder and a box": (
        "fcl.Cylinder(0.5, 1)", "fcl.Box(0.5, 0.5, 1)", (-0.75, 0.25, -0.75), (1.0, 0.0, 0.0, 0.0), "ends",
    ),
    "a box and a capsule": (
        "fcl.Box(1, 1, 0.25)", "fcl.Capsule(0.25, 0.75)", (-0.5, 0.5, -0.5), (1.0, 0.0, 0.0, 0.0), "hangs",
    ),
}


@pytest.mark.many(2)
@pytest.mark.parametrize("name", SIGNED)
def test_signed_distance_of_what_all_but_touches(name):
    A, B, t, q, end = SIGNED[name]
    code = f"a, b = at({A}, 0, 0, 0), at({B}, *{t}, q={q})\nprint(json.dumps(fcl.distance(a, b, signed)))"
    answer, status = theirs(code, 2.5)
    assert answer is None and status == (None if end == "hangs" else -6)
    names: dict = {}
    value = ours(code, names)
    a, b = names["a"], names["b"]
    truth = bracket(a._geometry._shape, b._geometry._shape, a._X, b._X)
    assert float(truth.upper - truth.lower) < 1e-9, truth
    assert float(truth.lower) - 1e-13 <= value <= float(truth.upper) + 1e-13, truth


@pytest.mark.parametrize("flat, gap", [
    ("fcl.Halfspace(np.array([0.0, 0, 1]), 0.5)", 1.0), ("fcl.Plane(np.array([0.0, 0, 1]), 0.5)", 1.0),
])
@pytest.mark.parametrize("body", ["fcl.Sphere(0.5)", "fcl.Cylinder(0.2, 1)"])
def test_distance_to_a_half_space_or_a_plane(flat, gap, body):
    code = f"print(json.dumps(fcl.distance(at({body}, 0, 0, 2), at({flat}, 0, 0, 0))))"
    answer, status = theirs(code)
    assert answer is None and status in (-11, -6, -7)
    assert math.isclose(ours(code), gap, rel_tol=1e-12)


def test_flat_things_among_themselves():
    """Equal ones, and ones that cross, share points; a triangle through a box, too."""
    code = """
plane, tilted = fcl.Plane(np.array([0.0, 0, 1]), 0.0), fcl.Plane(np.array([1.0, 0, 0]), 0.0)
half = fcl.Halfspace(np.array([0.0, 0, 1]), 0.0)
triangle = fcl.TriangleP(np.array([0.0, 0, -1]), np.array([1.0, 0, 1]), np.array([0.0, 1, 1]))
pairs = [(plane, plane), (plane, tilted), (half, half), (half, plane), (half, tilted), (triangle, fcl.Box(1, 1, 1)),
         (triangle, plane), (triangle, triangle)]
counts, depths = [], []
for a, b in pairs:
    result = fcl.CollisionResult()
    fcl.collide(at(a, 0, 0, 0), at(b, 0, 0, 0), fcl.CollisionRequest(1, True), result)
    counts.append(len(result.contacts))
    depths.append([str(c.penetration_depth) for c in result.contacts])
print(json.dumps([counts, depths]))
"""
    (counts, _), status = theirs(code)
    assert status == 0 and counts == [0] * 8
    triangle = np.array([[0.0, 0, -1], [1.0, 0, 1], [0.0, 1, 1]])
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    assert exact.hit(triangle, np.eye(3), np.zeros(3), corners, np.eye(3), np.zeros(3))
    counts, depths = ours(code)
    assert counts == [1] * 8
    assert depths[:5] == [["inf"]] * 5  # no translation takes them apart


def test_boxes_that_fly_onto_each_other():
    """They are 1 m apart, and come nearer by 4 m: a quarter of the way, exactly."""
    code = """
a, b = at(fcl.Box(1, 1, 1), 0, 0, 0), at(fcl.Box(1, 1, 1), 2, 0, 0)
print(json.dumps(fcl.continuousCollide(a, fcl.Transform(), b, fcl.Transform(np.array([-2.0, 0, 0])))))
"""
    assert theirs(code) == (1.0, 0)
    assert math.isclose(ours(code), 0.25, abs_tol=1e-9)


#: (shapes, where B stands, depth in closed form): along the axes, the least way out of an overlap of intervals.
CONTAINED = {
    "hull in hull": (
        "hull(np.array([0.9422607658090565, 0.6583292210870066, 0.5107319381385957]))",
        "hull(np.array([0.3391781713699078, 0.07164642738075047, 0.08254719743177993]))",
        (0.18527268669589397, 0.10134616725134338, -0.06485831888829799),
        (0.5107319381385957 + 0.08254719743177993) / 2 - 0.06485831888829799,
    ),
    "ball in ellipsoid, concentric": (
        "fcl.Ellipsoid(0.4932984427114358, 0.2546034033036858, 0.3421234696621914)",
        "fcl.Ellipsoid(0.05, 0.05, 0.05)", (0.0, 0.0, 0.0), 0.2546034033036858 + 0.05,
    ),
    "cylinder in cylinder": (
        "fcl.Cylinder(0.49374056011165525, 0.5025686493151211)", "fcl.Cylinder(0.18388187187497, 0.15507014641673783)",
        (-0.046305762765796926, 0.08218387940754945, 0.03412381259252997),
        (0.5025686493151211 + 0.15507014641673783) / 2 - 0.03412381259252997,
    ),
}


@pytest.mark.parametrize("name", CONTAINED)
def test_depths_of_contained_bodies(name):
    A, B, t, truth = CONTAINED[name]
    code = f"""
result = fcl.CollisionResult()
fcl.collide(at({A}, 0, 0, 0), at({B}, *{t}), fcl.CollisionRequest(1, True), result)
print(json.dumps(result.contacts[0].penetration_depth))
"""
    depth, status = theirs(code)
    assert status == 0 and depth > 1.2 * truth, (depth, truth)
    assert math.isclose(ours(code), truth, rel_tol=1e-8)


def test_contacts_that_nobody_asked_for():
    code = """
values = []
for k in range(300):
    fill = [np.full(n, 0.1 * k + n) for n in range(1, 30)]
    del fill
    result = fcl.CollisionResult()
    fcl.collide(at(fcl.Box(1, 1, 1), 0, 0, 0), at(fcl.Sphere(0.5), 0.6, 0, 0), fcl.CollisionRequest(), result)
    c = result.contacts[0]
    values += [*c.normal, *c.pos, c.penetration_depth]
print(json.dumps(bool(np.any(np.array(values) != 0.0))))
"""
    assert theirs(code) == (True, 0)
    assert ours(code) is False


#: Calls of tests/differential/host_pairs.py: (A, B, where they stand), of which python-fcl says that they are apart.
TOUCHING = {
    "a cone on a cube's wall": (
        "hull(np.array([1.0, 1.0, 0.75]))", (-0.5, -0.5, -0.5), "fcl.Cone(0.5, 0.5)", (0.5, -0.25, -0.25),
        (0.0, -0.25, -0.5),
    ),
    "a ball and an ellipsoid": (
        "fcl.Sphere(0.375)", (0.25, 0.0, 0.0), "fcl.Ellipsoid(0.375, 0.5, 0.25)", (-0.5, 0.0, 0.0), (-0.125, 0.0, 0.0),
    ),
    "a cylinder and a capsule": (
        "fcl.Cylinder(0.25, 0.75)", (0.5, -0.25, 0.0), "fcl.Capsule(0.25, 0.75)", (0.0, -0.25, -0.25),
        (0.25, -0.25, -0.125),
    ),
}


@pytest.mark.parametrize("name", TOUCHING)
def test_bodies_that_touch(name):
    """They share the point named, in fractions; closed sets that share a point meet."""
    A, p, B, t, point = TOUCHING[name]
    code = f"a, b = at({A}, *{p}), at({B}, *{t})\nprint(json.dumps(fcl.collide(a, b)))"
    names: dict = {}
    assert theirs(code) == (0, 0) and ours(code, names) == 1
    a, b = names["a"], names["b"]
    assert verdict(a._geometry._shape, b._geometry._shape, a._X, b._X, [point]) == "touch"


#: Two cubes 2 m apart, face to face; and of the same calls those whose gaps differ most.
GAPS = {
    "two cubes given as hulls": ("hull(np.ones(3))", (0.0, 0.0, 0.0), "hull(np.ones(3))", (0.0, -3.0, 0.0), 0.2),
    "two cones": ("fcl.Cone(0.25, 0.5)", (0.0, -0.25, 0.25), "fcl.Cone(0.375, 0.25)", (-0.5, -0.25, -0.5), 0.17),
    "two cylinders": (
        "fcl.Cylinder(0.5, 0.75)", (-0.5, 0.0, -0.25), "fcl.Cylinder(0.375, 0.75)", (0.5, 0.25, 0.5), 8e-4,
    ),
}


@pytest.mark.parametrize("name", GAPS)
def test_gaps(name):
    A, p, B, t, error = GAPS[name]
    code = f"a, b = at({A}, *{p}), at({B}, *{t})\nprint(json.dumps(fcl.distance(a, b)))"
    names: dict = {}
    value = ours(code, names)
    a, b = names["a"], names["b"]
    truth = bracket(a._geometry._shape, b._geometry._shape, a._X, b._X)
    gap, status = theirs(code)
    assert status == 0 and gap > float(truth.upper) + error, (gap, truth)
    assert float(truth.lower) - 1e-12 <= value <= float(truth.upper) + 1e-12, (value, truth)


def test_distance_of_a_mesh_and_a_ball_that_meet():
    """The ball's middle is 0.4 m from a facet, its radius 0.5 m."""
    code = """
mesh = fcl.BVHModel()
mesh.beginModel(12, 8)
mesh.addSubModel(CORNERS, FACETS)
mesh.endModel()
print(json.dumps(fcl.distance(at(mesh, 0, 0, 0), at(fcl.Sphere(0.5), 0.9, 0.2, 0.1), signed)))
"""
    distance, status = theirs(code)
    assert status == 0 and distance > 0.0
    assert ours(code) == -1.0


def test_callbacks_that_raise():
    code = """
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([at(fcl.Sphere(1), 0, 0, 0), at(fcl.Sphere(1), 1, 0, 0)])
manager.setup()
try:
    manager.collide(None, lambda a, b, cdata: 1 / 0)
    print(json.dumps("went on"))
except ZeroDivisionError:
    print(json.dumps("raised"))
"""
    assert theirs(code) == ("went on", 0) and ours(code) == "raised"


def test_objects_in_callbacks():
    code = """
a, b, seen = at(fcl.Sphere(1), 0, 0, 0), at(fcl.Sphere(1), 1, 0, 0), []
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([a, b])
manager.setup()
def callback(one, two, cdata):
    seen.extend([one is a or one is b, two is a or two is b])
manager.collide(None, callback)
print(json.dumps(seen))
"""
    assert theirs(code) == ([False, False], 0) and ours(code) == [True, True]


def test_objects_that_moved_without_update():
    """From far away into the other one: one pair meets."""
    code = """
a, b, seen = at(fcl.Sphere(1), 0, 0, 0), at(fcl.Sphere(1), 9, 0, 0), []
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([a, b])
manager.setup()
b.setTranslation(np.array([1.0, 0, 0]))
manager.collide(None, lambda one, two, cdata: seen.append(fcl.collide(one, two)))
print(json.dumps(seen))
"""
    assert theirs(code) == ([], 0) and ours(code) == [1]


def test_what_is_left_after_clear():
    code = """
manager = fcl.DynamicAABBTreeCollisionManager()
manager.registerObjects([at(fcl.Sphere(1), 0, 0, 0)])
manager.clear()
print(json.dumps([len(manager.getObjects()), manager.size()]))
"""
    assert theirs(code) == ([1, 0], 0) and ours(code) == [0, 0]


def test_vertices_and_lists():
    code = """
errors = []
def attempt(function):
    try:
        function()
        errors.append(None)
    except Exception as error:
        errors.append(type(error).__name__)
model = fcl.BVHModel()
model.beginModel(1, 3)
attempt(lambda: model.addVertex(0.0, 0.0, 0.0))
ball = at(fcl.Sphere(1), 0, 0, 0)
attempt(lambda: ball.setTranslation([1.0, 2.0, 3.0]))
attempt(lambda: ball.setRotation([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]]))
attempt(lambda: fcl.Plane([0.0, 0.0, 1.0], 0.0))
attempt(lambda: fcl.Convex([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], 1, [3, 0, 1, 2]))
print(json.dumps(errors))
"""
    errors, status = theirs(code)
    assert status == 0 and None not in errors
    assert ours(code) == [None] * 5


def test_matrices_that_are_no_rotation():
    """A box scaled by two reaches a ball at 0.9 m, taken as a linear map; python-fcl answers as for neither."""
    code = """
box = fcl.CollisionObject(fcl.Box(1, 1, 1), fcl.Transform(2.0 * np.eye(3)))
print(json.dumps([box.getRotation().tolist(), fcl.collide(box, at(fcl.Sphere(0.1), 0.9, 0, 0))]))
"""
    (matrix, hit), status = theirs(code)
    assert status == 0 and matrix == (2.0 * np.eye(3)).tolist() and hit == 0
    with pytest.raises(InvalidPose):
        ours(code)


def test_quaternions_of_another_length():
    code = "print(json.dumps(fcl.Transform(np.array([2.0, 0, 0, 2.0])).getRotation().tolist()))"
    matrix, status = theirs(code)
    assert status == 0 and not np.allclose(np.array(matrix) @ np.array(matrix).T, np.eye(3))
    assert np.allclose(ours(code), [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15)


def test_a_hull_in_the_place_of_its_like_has_python_fcls_contact_where_that_is_right():
    """One contact along −x for a cube, whose ways out along x, y and z are as short; where that is not the shortest, as
    of a slab or a cube that is turned, the shortest."""
    code = """
def contacts(size, turned=(1.0, 0.0, 0.0, 0.0)):
    result = fcl.CollisionResult()
    fcl.collide(at(hull(size), 5, 0, 0, q=turned), at(hull(size), 5, 0, 0, q=turned), wanted, result)
    return [[*map(float, c.pos), *map(float, c.normal), float(c.penetration_depth)] for c in result.contacts]
turned = (math.cos(0.15), 0.0, 0.0, math.sin(0.15))
print(json.dumps([contacts((1, 1, 1)), contacts((1, 2, 2)), contacts((1, 0.5, 2)), contacts((1, 1, 1), turned)]))
"""
    (cube, plate, slab, tilted), _ = theirs(code)
    of_cube, of_plate, of_slab, of_tilted = ours(code)
    np.testing.assert_allclose([of_cube, of_plate], [cube, plate], atol=1e-12)
    assert len(cube) == 1 and cube[0][3:] == [-1, 0, 0, 1]
    assert slab[0][6] == 1.0 and all(abs(row[6] - 0.5) < 1e-12 for row in of_slab)
    assert tilted[0][6] > 1.4 and all(abs(row[6] - 1.0) < 1e-12 for row in of_tilted)
