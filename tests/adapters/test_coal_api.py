"""coal's interface on collide, beside coal itself in a child process, and against closed forms."""

from __future__ import annotations

import importlib.util
import inspect
import itertools
import json
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest
from unit_cube import CORNERS, FACETS

from collide import InvalidArgument, InvalidShape, UnsupportedQuery
from collide.adapters.hosts import coal_api as coal

needs_coal = pytest.mark.skipif(importlib.util.find_spec("coal") is None, reason="coal is not installed")


def surface(vertices=CORNERS, facets=FACETS):
    model = coal.BVHModelOBBRSS()
    steps = model.beginModel(len(facets), len(vertices)), model.addVertices(vertices), model.addTriangles(facets)
    assert (*steps, model.endModel()) == (0, 0, 0, 0)
    return model


def at(x=0.0, y=0.0, z=0.0, R=None):
    return coal.Transform3s(np.eye(3) if R is None else R, np.array([x, y, z], dtype=float))


def turned(angle, axis):
    return coal.AngleAxis(angle, np.array(axis, dtype=float)).matrix()


def collided(g1, T1, g2, T2, **fields):
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    for name, value in fields.items():
        assert hasattr(request, name)
        setattr(request, name, value)
    count = coal.collide(g1, T1, g2, T2, request, result)
    assert count == result.numContacts() == len(result.getContacts())
    assert result.isCollision() == (count > 0)
    return result


def measured(g1, T1, g2, T2, **fields):
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    for name, value in fields.items():
        assert hasattr(request, name)
        setattr(request, name, value)
    assert coal.distance(g1, T1, g2, T2, request, result) == result.min_distance
    return result


def child(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


# --- the interface ------------------------------------------------------------------------------

#: What coal has and this has not, by kind: files of Boost's archives, addresses, types of C++, parts of its own search.
ARCHIVES = {
    f"{verb}{kind}" for verb in ("saveTo", "loadFrom") for kind in ("Binary", "Buffer", "String", "Text", "XML")
}
NOT_THERE = {
    "coal_pywrap", "viewer", "boost_type_index", "std_type_index", "computeMemoryFootprint", "windows_dll_manager",
}
REFUSED = {"GJK", "MinkowskiDiff"}
MEMBERS_NOT_THERE = {
    "OcTree": {"size", "tobytes", "setCellDefaultOccupancy"}, "HeightFieldAABB": {"getBV"},
    "HeightFieldOBBRSS": {"getBV"}, "Exception": {"message"},
}


def described(module):
    """Public names, and of classes their public members and what new ones hold."""
    found = {}
    for name in [name for name in dir(module) if not name.startswith("_")]:
        value = getattr(module, name)
        found[name] = sorted(n for n in dir(value) if not n.startswith("_")) if isinstance(value, type) else None
        plain = name.endswith(("Request", "Result", "Data")) and not name.startswith(("StdVec", "Query"))
        if plain or name == "Contact":
            made, fields = value(), {}
            for field in [f for f in dir(made) if not f.startswith("_") and f not in ("o1", "o2", "nearest_points")]:
                held = getattr(made, field)
                if isinstance(held, (bool, int, float)) or type(held).__module__ == "numpy":
                    fields[field] = repr([float(x) for x in held]) if hasattr(held, "shape") else repr(float(held))
            found[name + " fields"] = fields
        if isinstance(value, type) and hasattr(value, "names"):
            found[name + " numbers"] = {key: int(member) for key, member in value.names.items()}
    return found


@needs_coal
def test_every_name_and_default_is_there():
    code = "import coal, json, warnings\nwarnings.simplefilter('ignore')\n"
    theirs = json.loads(child(f"{code}{inspect.getsource(described)}\nprint(json.dumps(described(coal)))"))
    ours = described(coal)
    assert len(theirs) > 150
    names = {name for name in theirs if " " not in name}
    assert names - set(ours) == NOT_THERE & names
    for name, value in theirs.items():
        if name.endswith((" fields", " numbers")):
            assert ours[name] == value, name
        elif isinstance(value, list) and not (name in NOT_THERE | REFUSED or name + " numbers" in theirs):
            here = set(dir(getattr(coal, name)))
            if name.endswith(("Request", "Result", "Data")) and not name.startswith(("StdVec", "Query")):
                here |= set(dir(getattr(coal, name)()))
            here |= {n for n in ("data", "angle", "min_", "max_", "build_state", *_fields_of(name))}
            missing = set(value) - here - ARCHIVES - {"id"} - MEMBERS_NOT_THERE.get(name, set())
            assert not missing, (name, missing)


def _fields_of(name):
    """Attributes that only instances have."""
    made = {
        "Contact": coal.Contact, "ContactPatch": coal.ContactPatch, "CPUTimes": coal.CPUTimes,
        "QueryRequest": coal.CollisionRequest, "QueryResult": coal.CollisionResult,
    }
    return set(dir(made[name]())) if name in made else set()


def test_install_and_uninstall():
    code = """
import sys
assert "coal" not in sys.modules
from collide.adapters.hosts import coal_api
with coal_api.install() as ours:
    import coal, hppfcl
    assert coal is hppfcl is ours is coal_api and coal_api.installed()
    assert coal.Transform3f is coal.Transform3s
    from coal import Box
    coal_api.install()
assert not coal_api.installed() and "coal" not in sys.modules and "hppfcl" not in sys.modules
try:
    with coal_api.install():
        raise KeyError
except KeyError:
    pass
assert not coal_api.installed()
coal_api.uninstall()
print(coal_api.check())
"""
    assert "uninstalled cleanly" in child(code)


@needs_coal
def test_install_says_who_holds_coal():
    code = """
import sys, types, warnings
import coal
holder = types.ModuleType("holder"); holder.coal = coal; sys.modules["holder"] = holder
from collide.adapters.hosts import coal_api
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    with coal_api.install():
        import coal as other
        assert other is coal_api
import coal as again
assert again is holder.coal and sys.modules["coal"] is holder.coal
print(said[0].category.__name__, said[0].message)
"""
    said = child(code)
    assert "RuntimeWarning" in said and "holder" in said


def test_quaternions_turn_as_matrices_do():
    rng = np.random.default_rng(22)
    for _ in range(200):
        p, q = (coal.Quaternion(*v) for v in rng.normal(size=(2, 4)))
        p.normalize(), q.normalize()
        v = rng.normal(size=3)
        pure = coal.Quaternion(0.0, *v)
        assert np.allclose(p.matrix() @ v, (p * pure * p.conjugate()).vec()), (p, v.tolist())
        assert np.allclose((p * q).matrix(), p.matrix() @ q.matrix()) and np.allclose(p * v, p.matrix() @ v)
        back = coal.Quaternion(p.matrix())
        assert min(np.abs(back.coeffs() - p.coeffs()).max(), np.abs(back.coeffs() + p.coeffs()).max()) < 1e-12
        aa = coal.AngleAxis(p)
        assert np.allclose(aa.matrix(), p.matrix()) and np.allclose(coal.Quaternion(aa).matrix(), p.matrix())
        u, w = rng.normal(size=(2, 3))
        assert np.allclose(coal.Quaternion(u, w) * (u / np.linalg.norm(u)), w / np.linalg.norm(w))
        assert np.allclose((p * p.inverse()).coeffs(), [0, 0, 0, 1])
        assert math.isclose(p.angularDistance(q), coal.AngleAxis(p.conjugate() * q).angle, abs_tol=1e-7)
        half = p.slerp(0.5, q)
        assert math.isclose(half.angularDistance(p), half.angularDistance(q), abs_tol=1e-9)
    assert coal.Quaternion(1, 2, 3, 4).coeffs().tolist() == [2, 3, 4, 1]
    assert coal.Quaternion(np.array([1.0, 2, 3, 4])).coeffs().tolist() == [1, 2, 3, 4]
    assert np.allclose(coal.Quaternion([1, 0, 0], [-1, 0, 0]) * [1, 0, 0], [-1, 0, 0])


def test_transforms_are_poses():
    rng = np.random.default_rng(3)
    for _ in range(50):
        R, S = (turned(rng.uniform(0, 3), v / np.linalg.norm(v)) for v in rng.normal(size=(2, 3)))
        a, b = coal.Transform3s(R, rng.normal(size=3)), coal.Transform3s(S, rng.normal(size=3))
        A, B = (np.vstack([np.column_stack([T.getRotation(), T.getTranslation()]), [0, 0, 0, 1]]) for T in (a, b))
        for made, X in ((a * b, A @ B), (a.inverse(), np.linalg.inv(A)), (a.inverseTimes(b), np.linalg.inv(A) @ B)):
            assert np.allclose(made.getRotation(), X[:3, :3]) and np.allclose(made.getTranslation(), X[:3, 3])
        assert np.allclose(a.transform(np.ones(3)), (A @ np.ones(4))[:3])
        again = coal.Transform3s(a.getQuatRotation(), a.getTranslation())
        assert (again.inverse() * a).isIdentity(1e-12) and pickle.loads(pickle.dumps(a)) == a
    for wrong in ((np.eye(2),), (1, 2, 3), (np.eye(3), [1, 2]), ("x",)):
        with pytest.raises((TypeError, ValueError)):
            coal.Transform3s(*wrong)


# --- answers ------------------------------------------------------------------------------------


def test_contacts_have_coals_signs():
    box, ball = coal.Box(1, 1, 1), coal.Sphere(0.5)
    (contact,) = collided(box, at(), ball, at(0.8)).getContacts()
    assert contact.o1 is box and contact.o2 is ball and (contact.b1, contact.b2) == (-1, -1)
    assert np.allclose(contact.normal, [1, 0, 0]) and np.allclose(contact.pos, [0.4, 0, 0])
    assert math.isclose(contact.penetration_depth, -0.2)
    assert np.allclose(contact.getNearestPoint1(), [0.5, 0, 0])
    assert np.allclose(contact.getNearestPoint2(), [0.3, 0, 0])
    (contact,) = collided(ball, at(0.8), box, at()).getContacts()
    assert np.allclose(contact.normal, [-1, 0, 0])
    result = measured(box, at(), ball, at(1.3))
    assert math.isclose(result.min_distance, 0.3) and np.allclose(result.normal, [1, 0, 0])
    assert np.allclose(result.getNearestPoint2(), [0.8, 0, 0]) and result.o1 is box
    assert measured(box, at(), ball, at(0.8), enable_signed_distance=False).min_distance == 0.0


def test_margins_grow_and_shrink():
    box, ball = coal.Box(1, 1, 1), coal.Sphere(0.5)
    for gap, margin in itertools.product((-0.3, -0.1, 0.25, 0.5), (-0.2, 0.0, 0.125, 0.375)):
        result = collided(box, at(), ball, at(1.0 + gap), security_margin=margin)
        assert result.isCollision() == (gap <= margin), (gap, margin)
        assert result.distance_lower_bound <= gap - margin + 1e-12
        assert math.isclose(result.distance_lower_bound, gap - margin, abs_tol=1e-12)
        if gap <= margin:
            assert math.isclose(result.getContact(0).penetration_depth, gap)
    far = collided(surface(), at(), surface(), at(5.0), distance_upper_bound=0.5)
    assert not far.isCollision() and 0.5 <= far.distance_lower_bound <= 4.0
    result = coal.CollisionResult()
    request = coal.CollisionRequest(coal.CONTACT, 3)
    counts = [coal.collide(box, at(), ball, at(0.8 + 0.01 * k), request, result) for k in range(5)]
    assert counts == [1, 2, 3, 3, 3]


def test_swept_radii_are_taken_off():
    """Closed forms; a margin and a radius add up."""
    box, ball = coal.Box(1, 1, 1), coal.Sphere(0.5)
    box.setSweptSphereRadius(0.125)
    ball.setSweptSphereRadius(0.0625)
    assert box.getSweptSphereRadius() == 0.125 and np.allclose(box.aabb_local.max_, 0.625)
    result = measured(box, at(), ball, at(1.5))
    assert result.min_distance == 0.3125
    assert np.allclose(result.getNearestPoint1(), [0.625, 0, 0]) and np.allclose(
        result.getNearestPoint2(), [0.9375, 0, 0]
    )
    deep = collided(box, at(), ball, at(1.0)).getContact(0)
    assert deep.penetration_depth == -0.1875 and np.allclose(deep.getNearestPoint1(), [0.625, 0, 0])
    assert collided(box, at(), ball, at(1.1875)).isCollision()
    assert not collided(box, at(), ball, at(np.nextafter(1.1875, 2))).isCollision()
    cone, half = coal.Cone(0.5, 1.0), coal.Halfspace(np.array([0.0, 0, 1]), 0.0)
    cone.setSweptSphereRadius(0.25)
    assert measured(cone, at(z=1.0), half, at()).min_distance == 0.25
    model = surface()
    assert math.isclose(measured(model, at(), box, at(2.0)).min_distance, 0.875)
    assert box != coal.Box(1, 1, 1) and box.clone() == box


def test_meshes_are_surfaces():
    mesh, ball = surface(), coal.Sphere(0.1)
    assert not collided(mesh, at(), ball, at()).isCollision()
    assert math.isclose(measured(mesh, at(), ball, at()).min_distance, 0.4)
    result = measured(ball, at(z=2.0), mesh, at())
    assert math.isclose(result.min_distance, 1.4) and result.b1 == -1 and result.b2 in (10, 11)
    assert np.allclose(result.normal, [0, 0, -1]) and np.allclose(result.getNearestPoint2(), [0, 0, 0.5])
    assert measured(mesh, at(), mesh, at(0.9, 0.2, 0.1)).min_distance == 0.0
    contacts = collided(mesh, at(), coal.Box(0.5, 0.5, 0.5), at(z=0.74), num_max_contacts=8).getContacts()
    assert len(contacts) == 4
    for contact in contacts:
        assert math.isclose(contact.penetration_depth, -0.01) and np.allclose(contact.normal, [0, 0, 1])
        assert np.allclose(np.abs(contact.pos), [0.25, 0.25, 0.495])


def test_contacts_of_meshes_are_pairs_of_facets():
    """Moving the second triangle by the depth takes it off the first, and the position is in both."""
    rng = np.random.default_rng(5)
    mesh, n_contacts = surface(), 0
    for _ in range(20):
        poses = [at(*rng.uniform(-0.4, 0.4, 3), R=coal.Quaternion(*rng.normal(size=4)).matrix()) for _ in range(2)]
        for contact in collided(mesh, poses[0], mesh, poses[1], num_max_contacts=1000).getContacts():
            n_contacts += 1
            first, second = (X.transform(CORNERS[FACETS[b]]) for X, b in zip(poses, (contact.b1, contact.b2)))
            overlap = (first @ contact.normal).max() - (second @ contact.normal).min()
            assert abs(overlap + contact.penetration_depth) < 1e-12
            for triangle in (first, second):
                weights = np.linalg.lstsq(np.vstack([triangle.T, np.ones(3)]), [*contact.pos, 1.0], rcond=None)[0]
                assert weights.min() > -1e-7 and np.abs(weights @ triangle - contact.pos).max() < 1e-7
    assert n_contacts > 100


def test_planes_and_half_spaces():
    plane, half = coal.Plane(np.array([0, 0, 2.0]), 1.0), coal.Halfspace(0.0, 0.0, 2.0, 1.0)
    box = coal.Box(1, 1, 1)
    for z, gap in ((1.25, 0.25), (-0.25, 0.25), (0.625, -0.375), (0.25, -0.25)):
        assert measured(plane, at(), box, at(z=z)).min_distance == gap
        assert collided(plane, at(), box, at(z=z)).isCollision() == (gap <= 0)
    assert measured(half, at(), box, at(z=2.0)).min_distance == 1.0
    lowest = -sys.float_info.max
    for other, T, gap in (
        (half, at(z=2), lowest), (coal.Halfspace([0, 0, -1], -3.0), at(), 2.5), (coal.Plane([0, 0, 1], 2.0), at(), 1.5),
        (coal.Halfspace([0, 0, -1], 1.0), at(), -1.5), (coal.Plane([1, 0, 0], 2.0), at(), lowest),
    ):
        result = measured(half, at(), other, T)
        assert result.min_distance == gap, (other, gap)
        assert collided(half, at(), other, T).isCollision() == (gap <= 0)
    assert measured(plane, at(), coal.Plane([0, 0, -1], 1.0), at()).min_distance == 1.5


def test_planes_between_pieces_of_a_mesh():
    """A mesh of two cubes, one on each side of a plane that meets neither."""
    two = surface(np.concatenate([CORNERS, CORNERS + np.array([0, 0, 3])]), np.concatenate([FACETS, FACETS + 8]))
    plane = coal.Plane([0, 0, 1], 0.0)
    result = measured(plane, at(z=1.25), two, at())
    assert result.min_distance == 0.75 and result.b1 == -1 and np.allclose(result.normal, [0, 0, -1])
    result = measured(two, at(), plane, at(z=2.0))
    assert result.min_distance == 0.5 and result.b1 >= 12 and np.allclose(result.normal, [0, 0, -1])
    assert not collided(two, at(), plane, at(z=2.0)).isCollision()
    assert collided(two, at(), plane, at(z=2.5)).isCollision()
    contact = collided(plane, at(z=2.75), two, at()).getContact(0)
    assert contact.penetration_depth == -0.25 and contact.b2 >= 12
    tree = coal.makeOctree(np.array([[0.05, 0.05, 0.05], [0.05, 0.05, 1.05]]), 0.1)
    assert not collided(plane, at(z=0.5), tree, at()).isCollision()
    assert collided(plane, at(z=1.05), tree, at()).isCollision()


def test_height_fields():
    """A slope: the distance of a ball is that to its plane; a bottom at the lowest height; rows run from +y down."""
    x = np.linspace(-1.0, 1.0, 5)
    slope = coal.HeightFieldOBBRSS(2.0, 2.0, np.tile(0.5 * x, (3, 1)), -2.0)
    normal = np.array([-0.5, 0, 1]) / math.hypot(0.5, 1)
    ball = coal.Sphere(0.1)
    for z in (0.7, 0.3, 0.15):
        gap = z * normal[2] - 0.1
        result = measured(slope, at(), ball, at(z=z))
        assert math.isclose(result.min_distance, gap, abs_tol=1e-12) and np.allclose(result.normal, normal)
    assert collided(slope, at(), ball, at(z=0.1)).isCollision() and collided(slope, at(), ball, at(z=-1)).isCollision()
    heights = np.zeros((3, 4))
    heights[0, 3] = 1.0  # at the greatest y, and the greatest x
    peak = coal.HeightFieldAABB(3.0, 2.0, heights)
    assert peak.getYGrid().tolist() == [1, 0, -1] and peak.getXGrid().tolist() == [-1.5, -0.5, 0.5, 1.5]
    assert peak.getNodeType() == coal.HF_AABB and peak.getMaxHeight() == 1.0 and peak.getMinHeight() == 0.0
    assert collided(peak, at(), ball, at(1.5, 1.0, 1.05)).isCollision()
    assert not collided(peak, at(), ball, at(1.5, -1.0, 0.5)).isCollision()
    assert math.isclose(measured(peak, at(), ball, at(-1.0, -0.5, 0.5)).min_distance, 0.4)
    peak.updateHeights(0 * heights)
    assert math.isclose(measured(peak, at(), ball, at(1.5, 1.0, 1.1)).min_distance, 1.0, abs_tol=1e-9)
    with pytest.raises(InvalidArgument, match="updateHeights"):
        peak.updateHeights(np.zeros((2, 2)))


def test_octrees_are_their_boxes(tmp_path):
    tree = coal.makeOctree(np.array([[0.01, 0.01, 0.01], [0.02, 0.03, 0.04], [-0.01, 0.5, 0.5]]), 0.1)
    assert len(tree._shape.items) == 2 and tree.getResolution() == 0.1
    assert math.isclose(measured(tree, at(), coal.Sphere(0.5), at(5, 0.05, 0.05)).min_distance, 4.4)
    contact = collided(coal.Sphere(0.5), at(-0.55, 0.55, 0.55), tree, at()).getContact(0)
    assert contact.b1 == -1 and contact.b2 == 0 and math.isclose(contact.penetration_depth, -0.05)
    with pytest.raises(UnsupportedQuery, match="no occupied box"):
        measured(coal.OcTree(0.1), at(), coal.Sphere(1), at())
    file = tmp_path / "map.bt"
    file.write_bytes(b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.1\ndata\n" + bytes([2, 0]))
    assert coal.MeshLoader().loadOctree(str(file)).aabb_local.min_.tolist() == [-3276.8] * 3
    file.write_bytes(b"solid\n")
    with pytest.raises(InvalidArgument, match="must begin with"):
        coal.MeshLoader().loadOctree(str(file))


def test_mesh_files(tmp_path):
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS) + "".join(f"f {a} {b} {c}\n" for a, b, c in FACETS + 1)
    file = tmp_path / "cube.obj"
    file.write_text(text)
    loader = coal.CachedMeshLoader(coal.BV_OBB)
    model = loader.load(str(file), np.array([2.0, 1.0, 1.0]))
    assert isinstance(model, coal.BVHModelOBB) and model.num_tris == 12 and loader.load(str(file), [2, 1, 1]) is model
    assert math.isclose(measured(model, at(), coal.Sphere(0.5), at(3.0)).min_distance, 1.5)
    assert math.isclose(model.computeVolume(), 2.0)
    with pytest.raises(UnsupportedQuery, match="BV_OBBRSS"):
        coal.MeshLoader(coal.BV_AABB)


# --- contact patches ----------------------------------------------------------------------------


def patches(g1, T1, g2, T2, request=None, margin=0.0):
    collision = collided(g1, T1, g2, T2, security_margin=margin)
    result = coal.ContactPatchResult()
    coal.computeContactPatch(g1, T1, g2, T2, collision, request or coal.ContactPatchRequest(), result)
    again = coal.ContactPatchResult()
    coal.ComputeContactPatch(g1, g2)(T1, T2, collision, request or coal.ContactPatchRequest(), again)
    assert again.numContactPatches() == result.numContactPatches()
    return [result.getContactPatch(k) for k in range(result.numContactPatches())]


def test_patches_are_what_faces_share():
    rng = np.random.default_rng(8)
    for _ in range(40):
        a, b = rng.uniform(0.2, 1.0, (2, 3))
        shift, gap = rng.uniform(-0.1, 0.1, 2), rng.choice([-0.01, 0.01])
        z = 0.5 * (a[2] + b[2]) + gap
        low, high = np.maximum(-0.5 * a[:2], shift - 0.5 * b[:2]), np.minimum(0.5 * a[:2], shift + 0.5 * b[:2])
        (patch,) = patches(coal.Box(a), at(), coal.Box(b), at(*shift, z), margin=0.02)
        where = (a.tolist(), b.tolist(), shift.tolist(), gap)
        assert patch.size() == 4 and math.isclose(patch.penetration_depth, gap, abs_tol=1e-12), where
        assert np.allclose(patch.getNormal(), [0, 0, 1])
        corners = {tuple(np.round(patch.getPoint(k), 9) + 0.0) for k in range(4)}
        middle = 0.5 * a[2] + 0.5 * gap
        wanted = {
            tuple(np.round([x, y, middle], 9) + 0.0) for x in (low[0], high[0]) for y in (low[1], high[1])
        }
        assert corners == wanted, where
        assert math.isclose(patch.getPointShape1(0)[2], 0.5 * a[2]) and math.isclose(
            patch.getPointShape2(0)[2], z - 0.5 * b[2]
        )


def test_patches_keep_what_is_within_the_tolerance():
    top = at(0.2, 0.1, 0.99, turned(0.02, [0, 1, 0]))
    box = coal.Box(1, 1, 1)
    assert patches(box, at(), box, top)[0].size() == 2
    assert patches(box, at(), box, top, coal.ContactPatchRequest(1, 6, 0.1))[0].size() == 4
    assert patches(box, at(), coal.Sphere(0.5), at(z=0.99))[0].size() == 1
    assert patches(box, at(), box, at(5.0)) == []
    assert patches(box, at(), box, top, coal.ContactPatchRequest(0)) == []
    bench = surface(np.concatenate([CORNERS, CORNERS + np.array([3, 0, 0])]), np.concatenate([FACETS, FACETS + 8]))
    plank = coal.Box(4, 0.2, 0.2)
    both = patches(bench, at(), plank, at(1.5, 0, 0.59), coal.ContactPatchRequest(4))
    assert len(both) == 2 and all(patch.size() == 4 for patch in both)
    half = coal.Halfspace([0, 0, 1], 0.0)
    (patch,) = patches(half, at(), half, at(z=1))
    assert patch.size() == 1


# --- shapes -------------------------------------------------------------------------------------


def test_convex_shapes():
    points = coal.StdVec_Vec3s()
    for point in [*CORNERS, np.zeros(3)]:
        points.append(point)
    cube = coal.Convex.convexHull(points, True, "Qt")
    assert isinstance(cube, coal.Convex) and cube.num_points == 8 and cube.num_polygons == 12
    assert type(coal.ConvexBase.convexHull(points, False, None)) is coal.ConvexBase
    assert {tuple(np.abs(n).round(12)) for n in cube.normals()} == {(1, 0, 0), (0, 1, 0), (0, 0, 1)}
    assert np.allclose(cube.offsets(), -0.5) and math.isclose(cube.computeVolume(), 1.0)
    for k in range(8):
        apart = np.linalg.norm(cube.points() - cube.point(k), axis=1)
        assert set(np.flatnonzero(np.isclose(apart, 1.0)).tolist()) <= set(cube.neighbors(k))
    model = surface()
    model.buildConvexRepresentation(False)
    assert model.convex.num_polygons == 12 and model.buildConvexHull(True, "Qt") is True
    assert collided(model.convex, at(), coal.Sphere(0.1), at()).isCollision()
    copied = pickle.loads(pickle.dumps(cube))
    assert copied == cube and measured(copied, at(), cube, at(2)).min_distance == 1.0


def test_models_may_be_replaced():
    model = surface()
    with pytest.warns(UserWarning, match="beginModel"):
        assert model.addVertex(np.zeros(3)) == -2
    manager, ball = coal.NaiveCollisionManager(), coal.CollisionObject(coal.Sphere(0.25), at(10.0))
    manager.registerObjects([coal.CollisionObject(model), ball])
    callback = coal.CollisionCallBackDefault()
    manager.collide(callback)
    assert not callback.data.result.isCollision()
    assert model.beginReplaceModel() == 0 and model.replaceSubModel(CORNERS[:4] + np.array([10, 0, 0])) == 0
    for corner in CORNERS[4:]:
        assert model.replaceVertex(corner + np.array([10, 0, 0])) == 0
    assert model.endReplaceModel(True, True) == 0
    manager.collide(callback)
    assert not callback.data.result.isCollision()  # a ball within a surface
    assert math.isclose(measured(model, at(), ball.collisionGeometry(), at()).min_distance, 9.25)
    ball.setCollisionGeometry(coal.Sphere(0.75), True)
    manager.collide(callback)
    assert callback.data.result.isCollision()
    with pytest.warns(UserWarning, match="dropped"):
        model.beginModel(1, 3)
    assert model.build_state == coal.BVH_BUILD_STATE_BEGUN and model.num_tris == 0


def masses(module):
    """Volume, centre and second moments of one shape of each kind."""
    shapes = [
        module.Sphere(1.5), module.Ellipsoid(1, 2, 3), module.Box(1, 2, 3), module.Capsule(1, 2), module.Cone(1, 2),
        module.Cylinder(1, 3),
    ]
    return [[s.computeVolume(), s.computeCOM().tolist(), s.computeMomentofInertia().tolist()] for s in shapes]


@needs_coal
def test_volumes_and_inertias_are_coals():
    theirs = json.loads(child(f"import coal, json\n{inspect.getsource(masses)}\nprint(json.dumps(masses(coal)))"))
    for ours, reply in zip(masses(coal), theirs):
        for mine, other in zip(ours, reply):
            assert np.allclose(mine, other)
    cube, model = coal.Convex(CORNERS, FACETS), surface()
    for shape in (cube, model):
        assert np.allclose(shape.computeMomentofInertia(), np.eye(3) / 6)
    cone = coal.Cone(1, 2)
    moved = cone.computeMomentofInertiaRelatedToCOM()
    assert np.allclose(moved, np.diag([0.3, 0.3, 0.3]) * cone.computeVolume())


# --- managers -----------------------------------------------------------------------------------


def scattered(n: int, seed: int):
    rng = np.random.default_rng(seed)
    shapes = [coal.Box(0.5, 0.4, 0.3), coal.Sphere(0.3), coal.Capsule(0.1, 0.5), surface(0.4 * CORNERS)]
    return [
        coal.CollisionObject(shapes[k % 4], coal.Quaternion(*rng.normal(size=4)).matrix(), rng.uniform(-1.5, 1.5, 3))
        for k in range(n)
    ]


def asked(a, b):
    return coal.collide(a, b, coal.CollisionRequest(), coal.CollisionResult()) > 0


class Finder(coal.CollisionCallBackBase):
    """A callback of a user's own: all pairs that collide."""

    def init(self):
        self.pairs = set()

    def collide(self, o1, o2):
        if asked(o1, o2):
            self.pairs.add(frozenset((id(o1), id(o2))))
        return False


class Near(coal.CollisionCallBackDefault):
    """All pairs that come within a margin: the default callback, told never to end."""

    def __init__(self, margin):
        super().__init__()
        self.data.request.security_margin = margin
        self.pairs = set()

    def collide(self, o1, o2):
        self.data.clear()
        if super().collide(o1, o2):
            self.pairs.add(frozenset((id(o1), id(o2))))
        return False


@pytest.mark.many(2)
@pytest.mark.parametrize("kind", ["DynamicAABBTreeCollisionManager", "SSaPCollisionManager", "NaiveCollisionManager"])
def test_managers_find_all_pairs(kind):
    objects, guests = scattered(60, 1), scattered(25, 2)
    manager, guest_manager = getattr(coal, kind)(), coal.SpatialHashingCollisionManager(1.0, [-2] * 3, [2] * 3)
    manager.registerObjects(objects)
    guest_manager.registerObjects(guests)
    manager.setup()
    finder = Finder()

    def truth(pairs):
        return {frozenset((id(a), id(b))) for a, b in pairs if asked(a, b)}

    for n_moved in (0, 5, 40):
        for k in range(n_moved):
            objects[k].setTranslation(np.random.default_rng(k).uniform(-1.5, 1.5, 3))
        manager.collide(finder)
        expected = truth(itertools.combinations(objects, 2))
        assert len(expected) > 20 and finder.pairs == expected
        manager.collide(guest_manager, finder)
        assert finder.pairs == truth(itertools.product(objects, guests))
        manager.collide(guests[0], finder)
        assert finder.pairs == truth((a, guests[0]) for a in objects)
    callback = coal.CollisionCallBackDefault()
    callback.data.request.num_max_contacts = 10_000
    manager.collide(callback)
    found = {frozenset((id(c.o1), id(c.o2))) for c in callback.data.result.getContacts()}
    geometries = {frozenset((id(a._geometry), id(b._geometry))) for a, b in itertools.combinations(objects, 2)}
    assert callback.data.result.numContacts() >= len(expected) and found <= geometries
    for margin in (0.0, 0.25):
        callback.data.request.security_margin, callback.data.request.num_max_contacts = margin, 1
        lists = [(manager.collide, itertools.combinations(objects, 2)),
                 (lambda cb: manager.collide(guests[1], cb), ((a, guests[1]) for a in objects)),
                 (lambda cb: manager.collide(guest_manager, cb), itertools.product(objects, guests))]
        for ask, pairs in lists:
            near = Near(margin)
            ask(near)
            wanted = {
                frozenset((id(a), id(b))) for a, b in pairs
                if measured(a._geometry, a.getTransform(), b._geometry, b.getTransform()).min_distance <= margin
            }
            assert near.pairs == wanted
    collected = coal.CollisionCallBackCollect(10)
    manager.collide(collected)
    pairs = collected.getCollisionPairs()
    assert collected.numCollisionPairs() == len(pairs) >= len(expected) and collected.exist(pairs[0])
    assert {frozenset((id(a), id(b))) for a, b in pairs} >= expected
    far = [coal.CollisionObject(coal.Sphere(0.1), at(10.0 * k * k)) for k in range(1, 8)]
    nearest = coal.DistanceCallBackDefault()
    far_manager = getattr(coal, kind)()
    far_manager.registerObjects(far)
    far_manager.distance(nearest)
    assert math.isclose(nearest.data.result.min_distance, 29.8)
    far_manager.distance(coal.CollisionObject(coal.Sphere(0.1), at(165.0)), nearest)
    assert math.isclose(nearest.data.result.min_distance, 4.8)
    manager.unregisterObject(objects[0])
    assert manager.size() == 59 and objects[0] not in manager.getObjects()
    manager.clear()
    assert manager.empty()


def test_callbacks_end_and_raise():
    manager = coal.DynamicAABBTreeCollisionManager()
    manager.registerObjects([coal.CollisionObject(coal.Sphere(1), at(0.5 * k)) for k in range(4)])
    callback = coal.CollisionCallBackDefault()
    manager.collide(callback)
    assert callback.data.done and callback.data.result.numContacts() == 1

    class Failing(coal.CollisionCallBackBase):
        def collide(self, o1, o2):
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        manager.collide(Failing())
    with pytest.raises(NotImplementedError, match="collide"):
        manager.collide(coal.CollisionCallBackBase())
    for wrong in ((), (3,), (callback, manager), (coal.DistanceCallBackDefault(),)):
        with pytest.raises(TypeError, match="callback"):
            manager.collide(*wrong)


def test_bad_input_is_named():
    box, ball = coal.Box(1, 1, 1), coal.Sphere(1)
    for match, wrong in (
        ("radius", lambda: coal.Sphere(-1)), ("radius", lambda: box.setSweptSphereRadius(-1)),
        ("no triangles", lambda: collided(coal.BVHModelOBB(), at(), ball, at())),
        ("num_max_contacts", lambda: collided(box, at(), ball, at(), num_max_contacts=0)),
        ("security_margin", lambda: collided(box, at(), ball, at(), security_margin=math.nan)),
        ("triangles", lambda: coal.Convex(CORNERS, [[0, 1, 9]])), ("n must", lambda: coal.Plane([0, 0, 0], 1.0)),
        ("contacts is zero", lambda: coal.CollisionResult().getContact(0)),
        ("heights", lambda: coal.HeightFieldAABB(1.0, 1.0, [1.0])),
    ):
        with pytest.raises((InvalidArgument, InvalidShape), match=match):
            wrong()
    for wrong in (
        lambda: coal.collide(box, box, coal.CollisionRequest(), coal.CollisionResult()),
        lambda: coal.collide(box, np.eye(4), box, at(), coal.CollisionRequest(), coal.CollisionResult()),
        lambda: coal.CollisionObject("box"), lambda: coal.ComputeCollision(box, 3), lambda: coal.Transform3s(1, 2, 3),
    ):
        with pytest.raises(TypeError):
            wrong()
    with pytest.raises(UnsupportedQuery, match="ComputeDistance"):
        coal.GJK(10, 1e-6)
    for base in (coal.CollisionGeometry, coal.ShapeBase, coal.BVHModelBase, coal.BroadPhaseCollisionManager):
        with pytest.raises(RuntimeError, match="cannot be instantiated"):
            base()
