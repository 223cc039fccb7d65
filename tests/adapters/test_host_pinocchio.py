"""Pinocchio's pairs answered by collide, beside Pinocchio itself, on arms of example-robot-data."""

from __future__ import annotations

import itertools
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from unit_cube import CORNERS, FACETS

pin = pytest.importorskip("pinocchio", reason="Pinocchio (pin) is not installed")

from collide import InvalidArgument, InvalidShape, UnsupportedQuery
from collide.adapters.hosts import pinocchio as host
from collide.adapters.hosts.pinocchio_geometry import geometry_of
from collide.scenes.loaders.resources import installed_folders

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "oracles"))
from curved_oracle import bracket

coal = pin.coal
ROBOTS = next(
    (folder / "example-robot-data/robots" for folder in installed_folders()
     if (folder / "example-robot-data/robots").is_dir()), None,
)
ARMS = ("panda_description/urdf/panda.urdf", "z1_description/urdf/z1.urdf", "ur_description/urdf/ur5_robot.urdf")
needs_arms = pytest.mark.skipif(ROBOTS is None, reason="example-robot-data is not installed")


class Arm:
    """A model with all pairs of geometries that no joint joins."""

    def __init__(self, name: str):
        self.model = pin.buildModelFromUrdf(str(ROBOTS / name))
        folders = [str(ROBOTS.parents[1])]
        self.geom_model = pin.buildGeomFromUrdf(
            self.model, str(ROBOTS / name), pin.GeometryType.COLLISION, package_dirs=folders
        )
        self.add_pairs()

    def add_pairs(self):
        joints = [obj.parentJoint for obj in self.geom_model.geometryObjects]
        for i, j in itertools.combinations(range(len(joints)), 2):
            if joints[i] != joints[j] and joints[i] not in (self.model.parents[joints[j]],):
                self.geom_model.addCollisionPair(pin.CollisionPair(i, j))
        self.data, self.geom_data = self.model.createData(), self.geom_model.createData()

    def ask(self, q, **options):
        return host.compute_collisions(self.model, self.data, self.geom_model, self.geom_data, q, **options)

    def configurations(self, n, seed):
        rng = np.random.default_rng(seed)
        low, high = self.model.lowerPositionLimit, self.model.upperPositionLimit
        return rng.uniform(np.maximum(low, -3.0), np.minimum(high, 3.0), (n, self.model.nq))

    def truth(self, k):
        """The oracle's bracket of the signed distance of pair k, where the geometries stand."""
        pair = self.geom_model.collisionPairs[k]
        objects = self.geom_model.geometryObjects
        shapes = [geometry_of(objects[g])._shape for g in (pair.first, pair.second)]
        return bracket(*shapes, *(self.geom_data.oMg[g].homogeneous for g in (pair.first, pair.second)))


def balls(*places):
    """A model of one fixed base with balls of radius 0.5 at these places, each two a pair."""
    model, geom_model = pin.Model(), pin.GeometryModel()
    for k, place in enumerate(places):
        placement = pin.SE3(np.eye(3), np.array(place, dtype=float))
        geom_model.addGeometryObject(pin.GeometryObject(f"ball {k}", 0, placement, coal.Sphere(0.5)))
    geom_model.addAllCollisionPairs()  # none: all are fixed to one joint
    for i, j in itertools.combinations(range(len(places)), 2):
        if not geom_model.existCollisionPair(pin.CollisionPair(i, j)):
            geom_model.addCollisionPair(pin.CollisionPair(i, j))
    return model, model.createData(), geom_model, geom_model.createData()


def verdicts(geom_data):
    return np.array([result.isCollision() for result in geom_data.collisionResults])


# --- beside Pinocchio ---------------------------------------------------------------------------


@pytest.mark.many(2)
@needs_arms
@pytest.mark.parametrize("name", ARMS)
def test_collisions_are_pinocchios(name):
    """Every pair's verdict, and what differs judged in decimals."""
    arm = Arm(name)
    theirs = arm.geom_model.createData()
    n_hits = n_asked = 0
    Q = arm.configurations(60, 22)
    any_hit = []
    for q in Q:
        answer = arm.ask(q)
        pin.computeCollisions(arm.model, arm.data, arm.geom_model, theirs, q, False)
        ours, other = verdicts(arm.geom_data), verdicts(theirs)
        assert answer == ours.any()
        any_hit.append(answer)
        n_hits, n_asked = n_hits + int(ours.sum()), n_asked + len(ours)
        for k in np.flatnonzero(ours != other).tolist():
            truth = arm.truth(k)
            assert truth.upper <= 0 if ours[k] else truth.lower > 0, (name, q.tolist(), k, truth)
    assert 0 < n_hits < n_asked
    found = host.collides(arm.model, arm.data, arm.geom_model, arm.geom_data, Q)
    assert found.tolist() == any_hit and (0 < sum(any_hit))


@pytest.mark.many(2)
@needs_arms
@pytest.mark.parametrize("name", ARMS)
def test_distances_are_pinocchios(name):
    """Gaps agree to a micrometre or the oracle says that ours is right; results are written where they can be."""
    arm = Arm(name)
    theirs = arm.geom_model.createData()
    n_gaps = 0
    for q in arm.configurations(4, 7):
        nearest = host.compute_distances(arm.model, arm.data, arm.geom_model, arm.geom_data, q)
        pin.computeDistances(arm.model, arm.data, arm.geom_model, theirs, q)
        answer = host.distances(arm.model, arm.data, arm.geom_model, arm.geom_data, None)
        least = min(result.min_distance for result in arm.geom_data.distanceResults)
        assert arm.geom_data.distanceResults[nearest].min_distance == least
        for k, (result, other) in enumerate(zip(arm.geom_data.distanceResults, theirs.distanceResults)):
            assert result.min_distance == answer.distance[k] >= answer.lower[k]
            if answer.distance[k] <= 0.0:
                continue
            n_gaps += 1
            assert np.array_equal(result.normal, answer.normal[k])
            along = (answer.point_2[k] - answer.point_1[k]) @ answer.normal[k]
            assert abs(along - answer.distance[k]) < 1e-9
            if abs(result.min_distance - other.min_distance) > 1e-6:
                truth = arm.truth(k)
                assert float(truth.lower) - 1e-9 <= result.min_distance <= float(truth.upper) + 1e-9, (q.tolist(), k)
    assert n_gaps > 20


@needs_arms
def test_margins_and_contacts_are_written():
    arm = Arm(ARMS[0])
    q = arm.configurations(1, 5)[0]
    for request in arm.geom_data.collisionRequests:
        request.security_margin, request.enable_contact = 0.05, True
    arm.ask(q)
    gaps = host.distances(arm.model, arm.data, arm.geom_model, arm.geom_data, q)
    hit = verdicts(arm.geom_data)
    assert np.array_equal(hit, gaps.distance <= 0.05) and 0 < hit.sum() < len(hit)
    for k in range(len(hit)):
        result = arm.geom_data.collisionResults[k]
        if not hit[k]:
            assert result.numContacts() == 0 and result.distance_lower_bound <= gaps.distance[k] - 0.05 + 1e-12
        elif gaps.distance[k] > 0.0:
            contact = result.getContact(0)
            assert math.isclose(contact.penetration_depth, gaps.distance[k], abs_tol=1e-12)
            assert np.allclose(contact.pos, 0.5 * (gaps.point_1[k] + gaps.point_2[k]))
            assert np.allclose(contact.getNearestPoint1(), gaps.point_1[k])


# --- what counts --------------------------------------------------------------------------------


def test_pairs_can_be_switched_off():
    model, data, geom_model, geom_data = balls((0, 0, 0), (0.9, 0, 0), (1.8, 0, 0), (9, 0, 0))
    q = np.zeros(0)
    assert host.compute_collisions(model, data, geom_model, geom_data, q) is True
    pairs = [(pair.first, pair.second) for pair in geom_model.collisionPairs]
    assert {pairs[k] for k in np.flatnonzero(verdicts(geom_data))} == {(0, 1), (1, 2)}
    for result in geom_data.collisionResults:
        result.clear()
    assert host.compute_collisions(model, data, geom_model, geom_data, q, stop_at_first=True)
    assert verdicts(geom_data).sum() == 1
    geom_data.deactivateCollisionPair(pairs.index((0, 1)))
    geom_model.geometryObjects[2].disableCollision = True
    for result in geom_data.collisionResults:
        result.clear()
    assert host.compute_collisions(model, data, geom_model, geom_data, q) is False
    geom_data.activateCollisionPair(pairs.index((0, 1)))
    assert host.compute_collisions(model, data, geom_model, geom_data, q) is True
    geom_data.deactivateAllCollisionPairs()
    assert host.compute_collisions(model, data, geom_model, geom_data, q) is False
    assert host.compute_distances(model, data, geom_model, geom_data, q) == len(pairs)


def test_changes_are_noticed():
    model, data, geom_model, geom_data = balls((0, 0, 0), (2, 0, 0))
    q = np.zeros(0)
    assert not host.compute_collisions(model, data, geom_model, geom_data, q)
    geom_model.geometryObjects[0].geometry.radius = 1.75
    assert host.compute_collisions(model, data, geom_model, geom_data, q)
    geom_model.geometryObjects[0].geometry = coal.Box(1.0, 1.0, 1.0)
    assert not host.compute_collisions(model, data, geom_model, geom_data, q)
    assert host.compute_distances(model, data, geom_model, geom_data, q) == 0
    assert geom_data.distanceResults[0].min_distance == 1.0
    geom_model.geometryObjects[0].geometry.setSweptSphereRadius(0.75)
    assert host.distances(model, data, geom_model, geom_data, q).distance[0] == 0.25
    geom_data.oMg[1] = pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.0]))
    assert host.compute_collisions(model, data, geom_model, geom_data, None)
    geom_model.removeCollisionPair(pin.CollisionPair(0, 1))
    geom_data = geom_model.createData()
    assert not host.compute_collisions(model, data, geom_model, geom_data, q)


def test_every_geometry_is_read():
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for corner in CORNERS:
        points.append(corner)
    for facet in FACETS.tolist():
        triangles.append(coal.Triangle(*facet))
    model = coal.BVHModelOBBRSS()
    model.beginModel(12, 8)
    model.addVertices(CORNERS)
    model.addTriangles(FACETS)
    model.endModel()
    gaps = [
        (coal.Box(1, 1, 1), 2.5), (coal.Sphere(0.5), 2.5), (coal.Ellipsoid(0.1, 0.2, 0.25), 2.75),
        (coal.Capsule(0.5, 1.0), 2.0), (coal.Cone(0.5, 1.0), 2.5), (coal.Cylinder(0.5, 1.0), 2.5),
        (coal.Convex(points, triangles), 2.5), (coal.Convex.convexHull(points, False, "Qt"), 2.5), (model, 2.5),
        (coal.Halfspace(np.array([0.0, 0, 1]), 0.5), 2.5), (coal.Plane(np.array([0.0, 0, 1]), 0.5), 2.5),
        (coal.HeightFieldAABB(1.0, 1.0, np.zeros((3, 3)), -1.0), 3.0),
        (coal.makeOctree(np.array([[0.05, 0.05, 0.45]]), 0.1), 2.5),
    ]
    pin_model, geom_model = pin.Model(), pin.GeometryModel()
    place = pin.SE3(np.eye(3), np.array([0.05, 0.05, 3.5]))
    geom_model.addGeometryObject(pin.GeometryObject("ball", 0, place, coal.Sphere(0.5)))
    for k, (geometry, _) in enumerate(gaps):
        geom_model.addGeometryObject(pin.GeometryObject(f"geometry {k}", 0, pin.SE3.Identity(), geometry))
        geom_model.addCollisionPair(pin.CollisionPair(0, k + 1))
    geom_data = geom_model.createData()
    answer = host.distances(pin_model, pin_model.createData(), geom_model, geom_data, np.zeros(0))
    rounded = (coal.Sphere, coal.Capsule, coal.Ellipsoid, coal.Cone)  # not level below the ball
    slack = [0.03 if isinstance(geometry, rounded) else 1e-9 for geometry, _ in gaps]
    for (geometry, gap), measured, allowed in zip(gaps, answer.distance, slack):
        assert gap - 1e-9 <= measured <= gap + allowed, (geometry, measured)
    assert not verdicts(geom_data).any()
    for lift in (0.0, 2.55, 2.8, 3.1):
        geom_data.oMg[0] = pin.SE3(np.eye(3), np.array([0.05, 0.05, 3.5 - lift]))
        host.compute_collisions(pin_model, pin_model.createData(), geom_model, geom_data, None)
        for (geometry, gap), hit, allowed in zip(gaps, verdicts(geom_data).tolist(), slack):
            if not gap <= lift < gap + allowed:  # the ball has not yet sunk through a surface
                assert hit == (gap <= lift), (geometry, lift)


def test_bad_input_is_named():
    model, data, geom_model, geom_data = balls((0, 0, 0), (2, 0, 0))
    q = np.zeros(0)
    other = balls((0, 0, 0), (1, 0, 0), (2, 0, 0))
    for match, arguments in (
        ("q must have shape", (model, data, geom_model, geom_data, np.zeros(3))),
        ("placements", (model, data, geom_model, other[3], q)),
        ("placements", (model, data, other[2], geom_data, q)),
    ):
        for ask in (host.compute_collisions, host.compute_distances, host.distances):
            with pytest.raises(InvalidArgument, match=match):
                ask(*arguments)
    with pytest.raises(InvalidArgument, match="Q must have shape"):
        host.collides(model, data, geom_model, geom_data, np.zeros(3))
    geom_model.addGeometryObject(pin.GeometryObject("far joint", 5, pin.SE3.Identity(), coal.Sphere(1.0)))
    geom_model.addCollisionPair(pin.CollisionPair(0, 2))
    with pytest.raises(InvalidArgument, match="'far joint' is fixed to joint 5"):
        host.compute_collisions(model, data, geom_model, geom_model.createData(), q)
    with pytest.raises(InvalidArgument, match="createData"):
        host.compute_collisions(model, data, geom_model, geom_data, q)
    model, data, geom_model, geom_data = balls((0, 0, 0), (2, 0, 0))
    geom_model.geometryObjects[1].geometry = coal.BVHModelOBBRSS()
    with pytest.raises(InvalidShape, match="'ball 1', a BVHModelOBBRSS: it has no triangles"):
        host.compute_collisions(model, data, geom_model, geom_data, q)
    geom_model.geometryObjects[1].geometry = coal.Sphere(-1.0)
    with pytest.raises(InvalidShape, match=r"'ball 1', a Sphere.*radius"):
        host.compute_collisions(model, data, geom_model, geom_data, q)
    geom_model.geometryObjects[1].geometry = coal.OcTree(0.1)
    with pytest.raises((UnsupportedQuery, InvalidShape), match=r"ball 1|no occupied box"):
        host.compute_collisions(model, data, geom_model, geom_data, q)


def test_joints_that_are_not_numbers():
    arm = pin.buildSampleModelManipulator()
    geom_model = pin.GeometryModel()
    for k, joint in enumerate((1, 3)):
        geom_model.addGeometryObject(pin.GeometryObject(str(k), joint, pin.SE3.Identity(), coal.Sphere(0.1)))
    geom_model.addCollisionPair(pin.CollisionPair(0, 1))
    q = np.full(arm.nq, np.nan)
    with pytest.raises(InvalidArgument, match="finite"):
        host.compute_collisions(arm, arm.createData(), geom_model, geom_model.createData(), q)


@pytest.mark.many(2)
@pytest.mark.parametrize("first", ["", "import coal as former", "import pinocchio as former"])
def test_pinocchio_has_coals_own_whatever_is_installed_first(first):
    """While coal_api stands in for coal, Pinocchio finds coal itself, and programs find ours, then and afterwards."""
    code = f"""
import sys, warnings
warnings.simplefilter("ignore", RuntimeWarning)
from collide.adapters.hosts import coal_api, pinocchio as host
{first}
finders = list(sys.meta_path)
with coal_api.install():
    import pinocchio
    import coal, hppfcl
    assert coal is hppfcl is coal_api and pinocchio.coal is not coal_api
    import pinocchio.utils
    assert "pinocchio" in type(pinocchio.__loader__).__module__ + str(pinocchio.__spec__.origin)
    print(host.check())
assert sys.meta_path == finders and not coal_api.installed()
import coal
assert coal is pinocchio.coal
print(host.check())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.splitlines() == ["a pair was read, answered and written back"] * 2, done.stderr


def test_nearest_points_are_written():
    """What coal says of its own result: the very points of `distances`, of pairs near and far, touching and deep."""
    random = np.random.default_rng(6)
    n_meet = 0
    for scale in (1.0, 1e-3, 1e4):
        model, data, geom_model, geom_data = balls(*(scale * random.normal(size=(6, 3))), (0, 0, 0), (1, 0, 0))
        for request in geom_data.distanceRequests:
            request.enable_signed_distance = True
        q = np.zeros(0)
        host.compute_distances(model, data, geom_model, geom_data, q)
        answer = host.distances(model, data, geom_model, geom_data, q)
        for k, result in enumerate(geom_data.distanceResults):
            first, second = result.getNearestPoint1(), result.getNearestPoint2()
            assert np.array_equal(first, answer.point_1[k]) and np.array_equal(second, answer.point_2[k])
            assert result.min_distance == answer.distance[k] and np.array_equal(result.normal, answer.normal[k])
            pair = geom_model.collisionPairs[k]
            for point, g in ((first, pair.first), (second, pair.second)):
                middle = geom_data.oMg[g].translation
                assert np.linalg.norm(point - middle) == pytest.approx(0.5, abs=1e-9 * max(scale, 1.0))
            n_meet += result.min_distance <= 0.0
    assert n_meet > 10, n_meet


@pytest.mark.many(2)
@needs_arms
@pytest.mark.parametrize("name", ARMS)
def test_nearest_points_stand_as_pinocchios(name):
    """On an arm: as far apart as the distance says, and within a millimetre of Pinocchio's where these are unique."""
    arm = Arm(name)
    theirs = arm.geom_model.createData()
    n_near = n_gaps = 0
    for q in arm.configurations(3, 17):
        host.compute_distances(arm.model, arm.data, arm.geom_model, arm.geom_data, q)
        pin.computeDistances(arm.model, arm.data, arm.geom_model, theirs, q)
        for result, other in zip(arm.geom_data.distanceResults, theirs.distanceResults):
            first, second = result.getNearestPoint1(), result.getNearestPoint2()
            assert np.isfinite(first).all() and np.isfinite(second).all()
            if result.min_distance > 1e-3:
                n_gaps += 1
                assert np.linalg.norm(second - first) == pytest.approx(result.min_distance, abs=1e-7)
                n_near += np.linalg.norm(first - other.getNearestPoint1()) < 1e-3
    assert n_gaps > 20 and n_near > n_gaps // 2, (n_near, n_gaps)
