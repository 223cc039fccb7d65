"""python-fcl's interface on collide, beside python-fcl itself in a child process, and under trimesh."""

from __future__ import annotations

import importlib.util
import inspect
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from unit_cube import CORNERS, FACETS

from collide import InvalidArgument, InvalidShape, UnsupportedQuery
from collide.adapters.hosts import fcl_api as fcl
from collide.adapters.peers import exact

needs_fcl = pytest.mark.skipif(importlib.util.find_spec("fcl") is None, reason="python-fcl is not installed")
needs_trimesh = pytest.mark.skipif(importlib.util.find_spec("trimesh") is None, reason="trimesh is not installed")


def cube_mesh():
    model = fcl.BVHModel()
    model.beginModel(num_tris_=12, num_vertices_=8)
    model.addSubModel(CORNERS, FACETS)
    assert model.endModel() == 0 and model.num_tries_() == 12 and model.buildState() == 2
    return model


def at(geometry, *translation):
    return fcl.CollisionObject(geometry, fcl.Transform(np.array(translation, dtype=float)))


def child(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


# --- the interface ------------------------------------------------------------------------------

def described(module):
    """Public names, methods and attributes of classes, and what constructors of plain data set."""
    found = {}
    for name in module.__all__:
        value = getattr(module, name)
        found[name] = sorted(n for n in dir(value) if not n.startswith("_")) if isinstance(value, type) else None
        if name.endswith(("Request", "Result", "Data")) or name in ("Contact", "CostSource"):
            found[name] = {key: repr(v) for key, v in vars(value()).items() if isinstance(v, (int, float, list, bool))}
            found[name + " fields"] = sorted(vars(value()))
        elif name.isupper() or name.startswith(("CCD", "GJK")):
            found[name] = {key: v for key, v in vars(value).items() if not key.startswith("_")}
    return found


@needs_fcl
def test_every_name_is_there():
    code = f"import fcl, json\n{inspect.getsource(described)}\nprint(json.dumps(described(fcl)))"
    theirs = json.loads(child(code))
    ours = json.loads(json.dumps(described(fcl)))
    assert len(theirs) > 40
    assert set(ours) == set(theirs)
    for name, value in theirs.items():
        if name.endswith(" fields"):
            assert ours[name] == value, name
        elif isinstance(value, list):
            made = fcl.DynamicAABBTreeCollisionManager() if name.startswith("Dynamic") else getattr(fcl, name)
            missing = set(value) - set(dir(made))
            assert not missing, (name, missing)
        elif isinstance(value, dict):
            assert ours[name] == value, name


def test_transforms_take_every_form():
    q, R = [0.5, 0.5, 0.5, 0.5], np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    for tf in (fcl.Transform(q), fcl.Transform(R), fcl.Transform(q, [0, 0, 0]), fcl.Transform(fcl.Transform(R))):
        assert np.allclose(tf.getRotation(), R) and np.allclose(tf.getQuatRotation(), q)
    assert fcl.Transform(R, [[1, 2, 3]]).getTranslation().tolist() == [1, 2, 3]
    for wrong in ((np.eye(4),), ([1, 2],), (R, [1, 2]), (1, 2, 3), (np.eye(2), [1, 2, 3]), ([0, 0, 0, 0],)):
        with pytest.raises(ValueError):
            fcl.Transform(*wrong)
    rng = np.random.default_rng(22)
    for q in rng.normal(size=(200, 4)):
        q /= np.linalg.norm(q)
        back = fcl.Transform(q).getQuatRotation()
        assert min(np.abs(back - q).max(), np.abs(back + q).max()) < 1e-12, q.tolist()


def test_geometries_change():
    box = fcl.Box(1, 1, 1)
    a, b = at(box, 0, 0, 0), at(fcl.Sphere(0.5), 2, 0, 0)
    manager = fcl.DynamicAABBTreeCollisionManager()
    manager.registerObjects([a, b])
    found = []
    manager.collide(None, lambda *pair: found.append(pair))
    assert not found and fcl.distance(a, b) == 1.0
    box.side = [3.2, 1, 1]
    assert fcl.distance(a, b) == -1.0 and fcl.collide(a, b) == 1
    manager.collide(None, lambda *pair: found.append(pair))
    assert found == [(a, b, None)]


# --- answers ------------------------------------------------------------------------------------


def test_contacts_have_fcls_signs():
    request, result = fcl.CollisionRequest(10, True), fcl.CollisionResult()
    box, sphere = fcl.Box(1, 1, 1), fcl.Sphere(0.5)
    assert fcl.collide(at(box, 0, 0, 0), at(sphere, 0.8, 0, 0), request, result) == 1
    assert fcl.collide(at(sphere, 5, 0, 0), at(box, 5.9, 0, 0), request, result) == 1
    first, second = result.contacts
    assert first.o1 is box and first.o2 is sphere and second.o1 is sphere and (first.b1, first.b2) == (-1, -1)
    assert np.allclose(first.normal, [1, 0, 0]) and np.allclose(first.pos, [0.4, 0, 0])
    assert math.isclose(first.penetration_depth, 0.2) and math.isclose(second.penetration_depth, 0.1)
    assert fcl.collide(at(box, 0, 0, 0), at(box, 0.9, 0.2, 0.1), request) == 4
    assert fcl.collide(at(box, 0, 0, 0), at(box, 0.9, 0.2, 0.1), fcl.CollisionRequest(0, True)) == 0


def test_meshes_are_surfaces_and_come_first():
    mesh, ball = cube_mesh(), fcl.Sphere(0.1)
    assert fcl.collide(at(mesh, 0, 0, 0), at(ball, 0, 0, 0)) == 0
    result = fcl.DistanceResult()
    assert math.isclose(fcl.distance(at(ball, 0, 0, 2), at(mesh, 0, 0, 0), fcl.DistanceRequest(), result), 1.4)
    assert result.o1 is mesh and result.o2 is ball and result.b1 in (10, 11) and result.b2 == -1
    assert np.allclose(result.nearest_points[0], [0, 0, 0.5])
    assert fcl.distance(at(mesh, 0, 0, 0), at(mesh, 0.9, 0.2, 0.1)) == 0.0


def test_contacts_of_meshes_are_pairs_of_facets():
    """Each position lies in both triangles, and moving along the normal by the depth takes them apart."""
    rng = np.random.default_rng(7)
    n_contacts = 0
    for _ in range(40):
        X = [fcl.Transform(rng.normal(size=4), rng.uniform(-0.5, 0.5, 3)) for _ in range(2)]
        mesh = cube_mesh()
        a, b = (fcl.CollisionObject(mesh, tf) for tf in X)
        result = fcl.CollisionResult()
        n = fcl.collide(a, b, fcl.CollisionRequest(1000, True), result)
        assert n == len(result.contacts)
        for contact in result.contacts:
            n_contacts += 1
            facets = zip((contact.b1, contact.b2), X)
            first, second = (CORNERS[FACETS[k]] @ tf.getRotation().T + tf.getTranslation() for k, tf in facets)
            for triangle in (first, second):
                weights = np.linalg.lstsq(np.vstack([triangle.T, np.ones(3)]), [*contact.pos, 1.0], rcond=None)[0]
                assert weights.min() > -1e-7 and np.abs(weights @ triangle - contact.pos).max() < 1e-7, X
            overlap = (first @ contact.normal).max() - (second @ contact.normal).min()
            assert abs(overlap - contact.penetration_depth) < 1e-12
            assert abs(np.linalg.norm(contact.normal) - 1.0) < 1e-12
    assert n_contacts > 200


def test_planes_and_half_spaces():
    plane, half = fcl.Plane(np.array([0, 0, 2.0]), 1.0), fcl.Halfspace(np.array([0, 0, 2.0]), 1.0)
    assert plane.n.tolist() == [0, 0, 1] and plane.d == 0.5
    box = fcl.Box(1, 1, 1)
    for z, gap in ((1.25, 0.25), (-0.25, 0.25), (0.6, -0.4), (0.2, -0.2)):
        value = fcl.distance(at(plane, 0, 0, 0), at(box, 0, 0, z), fcl.DistanceRequest(True, True))
        assert math.isclose(value, gap), z
        assert fcl.collide(at(plane, 0, 0, 0), at(box, 0, 0, z)) == (gap <= 0)
    assert math.isclose(fcl.distance(at(half, 0, 0, 0), at(box, 0, 0, 2.0)), 1.0)
    assert fcl.collide(at(half, 0, 0, 0), at(half, 0, 0, 9.0)) == 1
    assert fcl.collide(at(plane, 0, 0, 0), at(plane, 0, 0, 9.0)) == 0
    assert fcl.collide(at(plane, 0, 0, 0), at(plane, 5, 0, 0)) == 1


def test_octrees_are_their_occupied_boxes():
    tree = fcl.OcTree(0.1, bytes([2, 0]))  # the first eighth of the root: −3276.8 … 0 along each axis
    assert fcl.collide(at(tree, 0, 0, 0), at(fcl.Sphere(0.5), -10, -10, -10)) == 1
    assert math.isclose(fcl.distance(at(fcl.Sphere(0.5), 10, 10, 10), at(tree, 0, 0, 0)), 10 * math.sqrt(3) - 0.5)
    nested = fcl.OcTree(0.1, bytes([3, 0, 0, 0x80]))  # the last eighth of the first
    assert math.isclose(fcl.distance(at(nested, 0, 0, 0), at(fcl.Sphere(0.5), 1.5, -1, -1)), 1.0)
    assert fcl.collide(at(nested, 0, 0, 0), at(fcl.Sphere(0.5), -1640, -1, -1)) == 0
    for wrong in (bytes([3, 0]), bytes([3])):
        with pytest.raises(InvalidArgument, match=r"no octomap: .*ends before its last node|no whole number of nodes"):
            fcl.OcTree(0.1, wrong)
    with pytest.raises(UnsupportedQuery, match="no occupied box"):
        fcl.OcTree(0.1, b"")


def octomap_bytes(occupied, free, edge: float) -> tuple[bytes, bytes]:
    """(nodes, a whole file) of octomap's binary form, of smallest boxes by three numbers from the middle each."""
    cells = {tuple(key): state for keys, state in ((occupied, 2), (free, 1)) for key in np.asarray(keys).tolist()}
    nodes, n_nodes = bytearray(), 1

    def write(keys: list, level: int) -> None:
        nonlocal n_nodes
        of_child: dict[int, list] = {}
        for key in keys:
            child = sum(((key[axis] + 32768) >> level & 1) << axis for axis in range(3))
            of_child.setdefault(child, []).append(key)
        word = sum((cells[inside[0]] if level == 0 else 3) << 2 * child for child, inside in of_child.items())
        nodes.extend((word & 255, word >> 8))
        n_nodes += len(of_child)
        for child in sorted(of_child) if level else ():
            write(of_child[child], level - 1)

    write(list(cells), 15)
    comment = "(feel free to add / change comments, but leave the first line as it is!)"
    head = f"# Octomap OcTree binary file\n# {comment}\n#\nid OcTree\nsize {n_nodes}\nres {edge}\ndata\n"
    return bytes(nodes), head.encode() + bytes(nodes)


def test_octomap_files_are_read():
    """A whole file is its nodes: balls among occupied and free boxes as brute force has them, and as python-fcl has the
    nodes, in a child process.
    """
    random, edge = np.random.default_rng(8), 0.1
    cells = np.unique(random.integers(-5, 5, (300, 3)), axis=0)
    random.shuffle(cells)
    occupied, free = cells[:80], cells[80:]
    nodes, file = octomap_bytes(occupied, free, edge)
    trees = [fcl.OcTree(edge, data) for data in (nodes, file, bytearray(file), np.frombuffer(nodes, np.int8))]
    centres, radius = random.uniform(-0.5, 0.5, (200, 3)), 0.05
    low = occupied * edge
    gaps = np.linalg.norm(np.maximum(0.0, np.maximum(low - centres[:, None], centres[:, None] - low - edge)), axis=2)
    wanted = gaps.min(axis=1) < radius
    for tree in trees:
        assert len(tree._boxes) == len(occupied)
        hits = [fcl.collide(at(tree, 0, 0, 0), at(fcl.Sphere(radius), *c)) for c in centres]
        assert [bool(hit) for hit in hits] == wanted.tolist()
    assert 20 < wanted.sum() < 180
    if importlib.util.find_spec("fcl") is None:
        return
    code = (
        "import sys, numpy as np, fcl; nodes = [b - 256 * (b > 127) for b in bytes.fromhex(sys.argv[1])]\n"
        f"tree = fcl.CollisionObject(fcl.OcTree({edge}, nodes))\n"
        f"ball = fcl.CollisionObject(fcl.Sphere({radius}))\n"
        f"for c in {centres.tolist()}:\n  ball.setTranslation(np.array(c)); print(int(fcl.collide(tree, ball) > 0))\n"
    )
    code = code.replace("sys.argv[1]", repr(nodes.hex()))
    assert [int(line) for line in child(code).split()] == wanted.astype(int).tolist()


@pytest.mark.parametrize(
    "change, match",
    [
        (lambda file: file + b"\n", "no whole number of nodes of 2 bytes"),
        (lambda file: file[:-2], "ends before its last node"),
        (lambda file: file.replace(b"res 0.1", b"res 0.2"), r"its resolution is 0\.2 m, not 0\.1"),
        (lambda file: file.replace(b"res 0.1", b"res x"), "res must be 1 finite number"),
        (lambda file: file.replace(b"id OcTree", b"id Forest"), "id must be one of OcTree, ColorOcTree"),
        (lambda file: file.replace(b"size ", b"size 9"), "size must be its number of nodes"),
        (lambda file: file.replace(b"OcTree binary file", b"OcTree file", 1), "no whole number of nodes of 5 bytes"),
        (lambda file: file.replace(b"\ndata\n", b"\n"), "no line 'data'"),
    ],
)
def test_octomap_files_that_lie_are_refused(change, match):
    _, file = octomap_bytes([[0, 0, 0], [5, 5, 5]], [[1, 0, 0]], 0.1)
    fcl.OcTree(0.1, file)
    with pytest.raises(InvalidArgument, match=match):
        fcl.OcTree(0.1, change(file))


def test_motions():
    a, b = at(fcl.Box(1, 1, 1), 0, 0, 0), at(fcl.Box(1, 1, 1), 2, 0, 0)
    result = fcl.ContinuousCollisionResult()
    time = fcl.continuousCollide(a, fcl.Transform(), b, fcl.Transform([-2.0, 0, 0]), None, result)
    assert math.isclose(time, 0.25, abs_tol=1e-8) and result.is_collide and result.time_of_contact == time
    assert fcl.continuousCollide(a, fcl.Transform(), b, fcl.Transform([3.0, 0, 0])) == 1.0
    rod, ball = at(fcl.Box(4, 0.1, 0.1), 0, 0, 0), at(fcl.Sphere(0.1), 0.0, 1.5, 0)
    quarter = fcl.Transform([1.0, 0, 0, 1.0])
    still = fcl.Transform([0.0, 1.5, 0])
    turning = fcl.ContinuousCollisionRequest(ccd_motion_type=fcl.CCDMotionType.CCDM_LINEAR)
    assert fcl.continuousCollide(rod, quarter, ball, still) == 1.0  # CCDM_TRANS leaves rotations as they are
    assert 0.8 < fcl.continuousCollide(rod, quarter, ball, still, turning) < 1.0
    plane = at(fcl.Plane(np.array([1.0, 0, 0]), 0.0), 0, 0, 0)
    assert math.isclose(fcl.continuousCollide(plane, fcl.Transform(), b, still), 0.75, abs_tol=1e-8)
    with pytest.raises(UnsupportedQuery, match="screws"):
        screw = fcl.ContinuousCollisionRequest(ccd_motion_type=fcl.CCDMotionType.CCDM_SCREW)
        fcl.continuousCollide(rod, quarter, ball, still, screw)


def test_bad_input_is_named():
    with pytest.raises(InvalidShape, match="radius"):
        fcl.Sphere(-1)
    with pytest.raises(ValueError, match="geometry"):
        fcl.CollisionObject()
    with pytest.raises(InvalidArgument, match="endModel"):
        fcl.collide(at(fcl.BVHModel(), 0, 0, 0), at(fcl.Sphere(1), 0, 0, 0))
    with pytest.raises(UnsupportedQuery, match="cost"):
        fcl.collide(at(fcl.Sphere(1), 0, 0, 0), at(fcl.Sphere(1), 0, 0, 0), fcl.CollisionRequest(enable_cost=True))
    with pytest.raises(InvalidArgument, match="face 0"):
        fcl.Convex(CORNERS, 1, [9, 0, 1])
    with pytest.raises(TypeError, match="CollisionObjects"):
        fcl.collide(fcl.Sphere(1), fcl.Sphere(1))


# --- beside python-fcl --------------------------------------------------------------------------


def test_polytopes_are_judged_in_rationals():
    """Boxes that touch or miss by one unit in the last place, as rationals have it."""
    rng = np.random.default_rng(3)
    n_hits = 0
    for _ in range(150):
        side = rng.integers(1, 9, 3) / 8
        x = 0.5 + side[0] / 2
        x = rng.choice([x, np.nextafter(x, 9), np.nextafter(x, 0)])
        a, b = at(fcl.Box(1, 1, 1), 0, 0, 0), at(fcl.Box(*side), x, 0.25, 0.125)
        truth = exact.hit(CORNERS, np.eye(3), np.zeros(3), CORNERS * side, np.eye(3), b.getTranslation())
        n_hits += truth
        assert bool(fcl.collide(a, b)) == truth, f"fcl.Box(*{side.tolist()}) at x = {float(x)!r}"
    assert 40 < n_hits < 140


# --- programs that import fcl -------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:these modules hold")  # in a process where trimesh has been imported
def test_install_and_uninstall():
    former = sys.modules.get("fcl")
    with fcl.install() as module:
        import fcl as found

        assert found is module is fcl and fcl.installed()
        assert fcl.install() is not None  # twice is once
    assert sys.modules.get("fcl") is former and not fcl.installed()


@needs_trimesh
def test_trimesh_runs_on_it():
    """In a process of its own, for trimesh keeps the fcl that it found first, and hides an import that fails."""
    out = child("""
from collide.adapters.hosts import fcl_api
fcl_api.install()
import numpy as np, trimesh
from trimesh.collision import CollisionManager, fcl
assert fcl is fcl_api, fcl
cube = trimesh.creation.box((1, 1, 1))
def X(*t):
    M = np.eye(4); M[:3, 3] = t; return M
ring = trimesh.creation.annulus(1.0, 2.0, 1.0)
manager = CollisionManager()
for name, mesh, t in (("a", cube, (0, 0, 0)), ("b", cube, (0.9, 0.25, 0)), ("c", cube, (5, 0, 0))):
    manager.add_object(name, mesh, X(*t))
manager.add_object("d", ring, X(0, 9, 0))
hit, names, data = manager.in_collision_internal(return_names=True, return_data=True)
assert hit and names == {("a", "b")}, names
assert all(abs(c.depth - 0.1) < 1e-6 and abs(abs(c.normal[0]) - 1) < 1e-6 and c.names == {"a", "b"} for c in data)
assert manager.in_collision_single(cube, X(5.5, 0, 0), return_names=True) == (True, {"c"})
assert not manager.in_collision_single(cube, X(20, 0, 0))
ball = trimesh.creation.icosphere(radius=0.5)
assert not manager.in_collision_single(ball, X(0, 9, 0))
distance, name, near = manager.min_distance_single(ball, X(0, 9, 0), return_name=True, return_data=True)
assert name == "d" and 0.48 < distance < 0.51, (name, distance)
assert near.point("d").shape == (3,) and isinstance(near.index("d"), int)
manager.set_transform("b", X(0, 3, 0)); manager.remove_object("c")
distance, names = manager.min_distance_internal(return_names=True)
assert names == ("a", "b") and abs(distance - 2.0) < 1e-6, (distance, names)
others = CollisionManager(); others.add_object("e", cube, X(0.5, 0.5, 0))
assert manager.in_collision_other(others, return_names=True) == (True, {("a", "e")})
assert abs(manager.min_distance_other(others)) >= 0
print("done")
""")
    assert out.strip() == "done"
