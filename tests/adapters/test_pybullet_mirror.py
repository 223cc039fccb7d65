"""A mirror of a pybullet client: what it follows, and its tuples.

Distances are judged by closed forms worked out here, where the arguments of bodies say they stand, and by Bullet itself
where its definition is the same; rays by closed forms. Skipped where pybullet is not installed.
"""

from __future__ import annotations

import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import collide
from collide.adapters.hosts import pybullet_mirror
from collide.adapters.hosts.pybullet_mirror import Mirror, attach
from collide.errors import InvalidArgument, InvalidPose, UnknownBody, UnsupportedQuery

p = pytest.importorskip("pybullet", reason="pybullet is not installed: pip install 'collide-robotics[pybullet]'")
pybullet_data = pytest.importorskip("pybullet_data")
DATA = pybullet_data.getDataPath()
CORNERS = [[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]
FACETS = [0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5, 7, 1, 7, 3]


@pytest.fixture
def client():
    number = p.connect(p.DIRECT)
    yield number
    if p.isConnected(number):
        p.disconnect(number)


def body(
    client: int, mass: float = 1.0, position=(0, 0, 0), turned=(0, 0, 0, 1), *, frame=None, inertial=None, **shape
):
    """A body of one shape.   frame, inertial : position and quaternion of its shape and of its centre of mass."""
    if frame:
        shape |= {"collisionFramePosition": list(frame[0]), "collisionFrameOrientation": list(frame[1])}
    number = p.createCollisionShape(physicsClientId=client, **shape)
    more = {}
    if inertial:
        more = {"baseInertialFramePosition": list(inertial[0]), "baseInertialFrameOrientation": list(inertial[1])}
    return p.createMultiBody(
        mass, number, basePosition=list(position), baseOrientation=list(turned), physicsClientId=client, **more
    )


def quaternion(random: np.random.Generator) -> list[float]:
    q = random.normal(size=4)
    return (q / np.linalg.norm(q)).tolist()


def rotation(q) -> np.ndarray:
    return np.array(p.getMatrixFromQuaternion(q)).reshape(3, 3)


def gap_to_box(point: np.ndarray, half: np.ndarray) -> float:
    """Signed distance of a point from a box around the origin."""
    outside = np.abs(point) - half
    return float(np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0))


def gap_to_capsule(point: np.ndarray, radius: float, length: float) -> float:
    return float(np.linalg.norm(point - [0, 0, np.clip(point[2], -length / 2, length / 2)]) - radius)


def gap_to_cylinder(point: np.ndarray, radius: float, length: float) -> float:
    outside = np.array([np.hypot(point[0], point[1]) - radius, abs(point[2]) - length / 2])
    return float(np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0))


def sphere_of(client: int, radius: float, position) -> int:
    return body(client, position=position, shapeType=p.GEOM_SPHERE, radius=radius)


# --- where shapes stand -------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["box", "capsule", "cylinder", "hull", "plane"])
def test_shapes_stand_where_frames_of_shape_and_mass_put_them(client, kind):
    random = np.random.default_rng(5)
    half = np.array([0.2, 0.3, 0.4])
    shapes = {
        "box": ({"shapeType": p.GEOM_BOX, "halfExtents": half.tolist()}, lambda q: gap_to_box(q, half)),
        "capsule": ({"shapeType": p.GEOM_CAPSULE, "radius": 0.2, "height": 0.5}, lambda q: gap_to_capsule(q, 0.2, 0.5)),
        "cylinder": (
            {"shapeType": p.GEOM_CYLINDER, "radius": 0.2, "height": 0.5},
            lambda q: gap_to_cylinder(q, 0.2, 0.5),
        ),
        "hull": (
            {"shapeType": p.GEOM_MESH, "vertices": (2 * half * np.array(CORNERS)).tolist()},
            lambda q: gap_to_box(q, half),
        ),
        "plane": ({"shapeType": p.GEOM_PLANE, "planeNormal": [0, 0, 1]}, lambda q: q[2]),
    }
    arguments, gap = shapes[kind]
    apart = 0
    for _ in range(20):
        frame = (random.normal(size=3), quaternion(random)) if kind != "plane" else None
        inertial = (random.normal(size=3), quaternion(random))
        position, q = random.normal(size=3), quaternion(random)
        b = body(client, 0.0 if kind == "plane" else 1.0, position, q, frame=frame, inertial=inertial, **arguments)
        probe = random.normal(size=3)
        s = sphere_of(client, 0.1, probe)
        ((*head, on_a, on_b, normal, distance, force, _, _, _, _),) = Mirror(client).getClosestPoints(b, s, 100.0)
        R, t = rotation(q), position
        if frame:
            R, t = R @ rotation(frame[1]), R @ frame[0] + t
        want = gap(R.T @ (probe - t)) - 0.1
        tolerance = 1e-9 if kind != "hull" else 1e-6  # Bullet's grid
        assert abs(distance - want) < tolerance
        assert head == [0, b, s, -1, -1] and force == 0.0
        assert np.allclose(np.array(on_a) - np.array(on_b), np.array(normal) * distance, atol=1e-9)
        assert np.isclose(np.linalg.norm(np.array(on_b) - probe), 0.1)
        apart += want > 0
        p.removeBody(b, client)
        p.removeBody(s, client)
    assert apart >= 8


def test_hulls_agree_with_bullet_once_its_margins_are_taken_over(client):
    random = np.random.default_rng(11)
    bodies = []
    for k in range(30):
        turned, place = quaternion(random), random.uniform(-1, 1, 3)
        kind = [
            {"shapeType": p.GEOM_MESH, "vertices": (0.3 * random.normal(size=(20, 3))).tolist()},
            {"shapeType": p.GEOM_SPHERE, "radius": 0.2},
            {"shapeType": p.GEOM_CAPSULE, "radius": 0.1, "height": 0.4},
        ][k % 3]
        frame = (random.normal(size=3) * 0.2, quaternion(random)) if k % 2 else None
        bodies.append(body(client, 1.0, place, turned, frame=frame, **kind))
    for changed in (bodies[0], bodies[6]):
        p.changeDynamics(changed, -1, collisionMargin=0.02, physicsClientId=client)
    mirror = Mirror(client, margins="bullet")
    bare = Mirror(client)
    apart = grown = 0
    for a in bodies:
        for b in bodies[a + 1 :]:
            (theirs,) = p.getClosestPoints(a, b, 10.0, physicsClientId=client)
            (ours,) = mirror.getClosestPoints(a, b, 10.0)
            if theirs[8] > 0.0:
                assert abs(ours[8] - theirs[8]) < 2e-6, (a, b, ours[8], theirs[8])
                apart += 1
                grown += bare.getClosestPoints(a, b, 10.0)[0][8] > ours[8] + 9e-4
    assert apart > 200 and grown > 100


def test_unions_and_triangles_of_files_agree_with_bullet(client):
    duck = p.loadURDF(f"{DATA}/duck_vhacd.urdf", [0, 0, 1], physicsClientId=client)
    whole = body(client, shapeType=p.GEOM_MESH, fileName=f"{DATA}/duck_vhacd.obj", meshScale=[0.05] * 3)
    temple = p.loadURDF(f"{DATA}/samurai.urdf", physicsClientId=client)
    probe = sphere_of(client, 0.02, (0, 0, 0))
    mirror = Mirror(client, margins="bullet")
    shapes = {b.name: b.shape for b in map(mirror.world.body, mirror.world.ids)}
    assert sum(isinstance(shape, collide.Compound) and len(shape.items) == 5 for shape in shapes.values()) == 2
    assert sum(isinstance(shape, collide.Mesh) and not shape.solid for shape in shapes.values()) == 1
    random = np.random.default_rng(2)
    near = 0
    for _ in range(40):
        for target, place in ((duck, random.normal([0, 0, 1], 0.1)), (whole, random.normal(0, 0.1, 3))):
            p.resetBasePositionAndOrientation(probe, place.tolist(), quaternion(random), client)
            mirror.update()
            theirs = min(row[8] for row in p.getClosestPoints(target, probe, 9.0, physicsClientId=client))
            (ours,) = mirror.getClosestPoints(target, probe, 9.0)
            if theirs > 0:
                assert abs(ours[8] - theirs) < 1e-4
                near += 1
    p.resetBasePositionAndOrientation(probe, [1.0, 2.0, 3.0], [0, 0, 0, 1], client)
    mirror.update()
    rows = p.getClosestPoints(temple, probe, 4.0, physicsClientId=client)
    (ours,) = mirror.getClosestPoints(temple, probe, 4.0)
    assert abs(ours[8] - min(row[8] for row in rows)) < 1e-4
    assert near > 40


def test_links_stand_where_their_colliders_do_also_in_motion(client):
    """getLinkStates alone tells where links stood a step ago."""
    arm = p.loadURDF(f"{DATA}/kuka_iiwa/model.urdf", useFixedBase=True, physicsClientId=client)
    probe = sphere_of(client, 0.05, (0.4, 0.3, 0.6))
    p.changeDynamics(probe, -1, mass=0.0, physicsClientId=client)
    mirror = Mirror(client, margins="bullet")
    for step in range(30):
        for joint in range(7):
            if step == 15:
                p.resetJointState(arm, joint, 0.3 * joint, physicsClientId=client)
            p.setJointMotorControl2(arm, joint, p.VELOCITY_CONTROL, targetVelocity=joint + 1, physicsClientId=client)
        p.stepSimulation(client)
        mirror.update()
        theirs = p.getClosestPoints(arm, probe, 9.0, physicsClientId=client)
        ours = mirror.getClosestPoints(arm, probe, 9.0)
        assert [row[:5] for row in ours] == [row[:5] for row in theirs] and len(ours) == 8
        assert max(abs(a[8] - b[8]) for a, b in zip(ours, theirs)) < 1e-9


def test_two_bodies_alone_are_followed_as_all_are(client):
    """Also a body whose base has no shape, and links that have none."""
    random = np.random.default_rng(12)
    stand_in = attach(p, client)
    car = p.loadURDF(f"{DATA}/racecar/racecar.urdf", physicsClientId=client)
    arm = p.loadURDF(f"{DATA}/kuka_iiwa/model.urdf", [1, 0, 0], physicsClientId=client)
    ball = sphere_of(client, 0.1, (0, 0, 0))
    bodies = (car, arm, ball)
    for _ in range(12):
        for moved in bodies:
            p.resetBasePositionAndOrientation(moved, random.normal(size=3).tolist(), quaternion(random), client)
            for joint in range(p.getNumJoints(moved, client)):
                p.resetJointState(moved, joint, random.uniform(-1, 1), physicsClientId=client)
        a, b = (bodies[k] for k in random.choice(3, 2, replace=False))
        ours = stand_in.getClosestPoints(a, b, 9.0)
        assert len(ours) > 2 and ours == Mirror(client).getClosestPoints(a, b, 9.0)


def test_steps_have_the_same_bits_with_a_mirror():
    def run(mirrored: bool) -> list:
        number = p.connect(p.DIRECT)
        p.setGravity(0, 0, -10, physicsClientId=number)
        p.loadURDF(f"{DATA}/plane.urdf", physicsClientId=number)
        arm = p.loadURDF(f"{DATA}/kuka_iiwa/model.urdf", [0, 0, 1], physicsClientId=number)
        balls = [sphere_of(number, 0.1, (0.1 * k, 0.05 * k, 1.5 + 0.3 * k)) for k in range(5)]
        mirror = Mirror(number) if mirrored else None
        for _ in range(120):
            p.stepSimulation(number)
            if mirror is not None:
                mirror.update()
                mirror.getContactPoints()
        states = [p.getBasePositionAndOrientation(ball, number) for ball in balls]
        states += p.getJointStates(arm, range(7), number)
        p.disconnect(number)
        return states

    assert run(True) == run(False)


# --- following ----------------------------------------------------------------------------------


def places(mirror: Mirror) -> dict:
    world = mirror.world
    return {world.body(k).name: (type(world.body(k).shape), world.body(k).X_WB.tobytes()) for k in world.ids}


def test_bodies_that_come_go_move_and_take_over_numbers_are_followed(client):
    random = np.random.default_rng(8)
    mirror = Mirror(client)
    assert (
        len(mirror.world) == 0 and mirror.getContactPoints() == () and mirror.rayTest([0, 0, 1], [0, 0, -1])[0][0] == -1
    )
    kinds = [
        {"shapeType": p.GEOM_SPHERE, "radius": 0.2},
        {"shapeType": p.GEOM_BOX, "halfExtents": [0.1, 0.2, 0.3]},
        {"shapeType": p.GEOM_CAPSULE, "radius": 0.1, "height": 0.2},
    ]
    bodies: list[int] = []
    reused = resets = 0
    numbers: set[int] = set()
    for step in range(150):
        action = random.integers(5) if bodies else 0
        if action == 0 or len(bodies) < 3:
            kind = kinds[random.integers(3)]
            bodies.append(body(client, 1.0, random.normal(size=3), quaternion(random), **kind))
            reused += bodies[-1] in numbers
            numbers.add(bodies[-1])
        elif action == 1:  # the last one goes and comes back as something else under its number
            gone = bodies.pop(int(random.integers(len(bodies))))
            p.removeBody(gone, client)
        elif action == 2:
            moved = bodies[int(random.integers(len(bodies)))]
            p.resetBasePositionAndOrientation(moved, random.normal(size=3).tolist(), quaternion(random), client)
        elif action == 3:
            p.stepSimulation(client)
        elif random.random() < 0.1:
            p.resetSimulation(client)
            bodies, resets = [], resets + 1
        if random.random() < 0.6:
            mirror.update()
            assert places(mirror) == places(Mirror(client)), step
    assert reused > 10 and resets > 0


def test_a_body_that_takes_over_the_last_number_is_noticed(client):
    first = sphere_of(client, 0.1, (0, 0, 0))
    last = sphere_of(client, 0.1, (1, 0, 0))
    mirror, second = Mirror(client), Mirror(client)
    p.removeBody(last, client)
    again = body(client, position=(1, 0, 0), shapeType=p.GEOM_BOX, halfExtents=[0.3] * 3)
    assert again == last  # the case under test
    for following in (mirror, second):
        following.update_bodies(first, again)
        assert abs(following.getClosestPoints(first, again, 5.0)[0][8] - 0.6) < 1e-12
    p.resetSimulation(client)
    assert sphere_of(client, 0.5, (0, 0, 0)) == first
    mirror.update()
    assert len(mirror.world) == 1 and mirror.world.body(0).shape == collide.Sphere(0.5)


def test_bodies_that_rest_are_not_moved(client, monkeypatch):
    bodies = [sphere_of(client, 0.1, (k, 0, 0)) for k in range(4)]
    mirror = Mirror(client)
    moved, set_poses = [], mirror.world.set_poses
    monkeypatch.setattr(mirror.world, "set_poses", lambda ids, X: (moved.append(list(ids)), set_poses(ids, X)))
    mirror.update()
    p.resetBasePositionAndOrientation(bodies[3], [3, 1, 0], [0, 0, 0, 1], client)
    mirror.update()
    mirror.update()
    assert moved == [[3]] and mirror.world.body(3).X_WB[1, 3] == 1.0


# --- contacts and filters -----------------------------------------------------------------------


def test_contacts_of_a_box_on_a_plane_have_pybullets_conventions(client):
    plane = body(client, 0.0, shapeType=p.GEOM_PLANE, planeNormal=[0, 0, 1])
    box = body(client, 1.0, (0, 0, 0.299), shapeType=p.GEOM_BOX, halfExtents=[0.1, 0.2, 0.3])
    mirror = Mirror(client)
    p.performCollisionDetection(client)
    for arguments in ((box, plane), (plane, box), (box,), (-1, plane)):
        ours = mirror.getContactPoints(*arguments)
        theirs = p.getContactPoints(*arguments, physicsClientId=client)
        assert len(ours) == 4
        assert len({row[1:5] for row in ours}) == 1
        first, second, *_ = (*arguments, -1)
        assert first in (-1, ours[0][1]) and second in (-1, ours[0][2])
        down = 1.0 if ours[0][1] == box else -1.0
        for row in ours:
            assert abs(row[8] + 0.001) < 1e-12 and row[9:] == (0.0, 0.0, (0, 0, 0), 0.0, (0, 0, 0))
            assert np.allclose(row[7], [0, 0, down])
            assert np.allclose(np.array(row[5]) - row[6], np.array(row[7]) * row[8], atol=1e-12)
        if theirs:  # of (-1, plane) Bullet has none or all, as it happened to store the pair
            matching = [row for row in theirs if row[1] == ours[0][1]]
            assert matching and np.allclose([row[7] for row in matching], [0, 0, down], atol=1e-6)
    assert mirror.getContactPoints(box, plane, linkIndexA=3) == ()
    assert Mirror(client, contact_margin=0.0).getContactPoints(box, plane)
    p.resetBasePositionAndOrientation(box, [0, 0, 0.302], [0, 0, 0, 1], client)
    mirror.update()
    assert len(mirror.getContactPoints(box, plane)) == 4 and mirror.getContactPoints()[0][8] > 0.0019
    assert Mirror(client, contact_margin=0.001).getContactPoints() == ()


def pairs_of(rows) -> set:
    return {frozenset([(row[1], row[3]), (row[2], row[4])]) for row in rows}


@pytest.mark.parametrize("mode", [None, 0, 1])
def test_pairs_that_filters_leave_out_are_those_of_bullet(client, mode):
    random = np.random.default_rng(4)
    stand_in = attach(p, client, contact_margin=0.0)
    if mode is not None:
        stand_in.setPhysicsEngineParameter(collisionFilterMode=mode)
    bodies = []
    for k in range(24):
        stand_in.createMultiBody(
            float(k % 4 > 0), stand_in.createCollisionShape(p.GEOM_BOX, halfExtents=[0.3, 0.3, 0.3]),
            basePosition=random.uniform(-0.5, 0.5, 3).tolist(), baseOrientation=quaternion(random),
        )  # fmt: skip
        bodies.append(k)
    seen = 0
    for k in range(25):
        a, b = (int(n) for n in random.choice(24, 2, replace=False))
        if k % 2:
            group, mask = (int(n) for n in random.integers(0, 4, 2))
            stand_in.setCollisionFilterGroupMask(a, -1, group, mask)
        else:
            stand_in.setCollisionFilterPair(a, b, -1, -1, int(random.integers(2)))
        p.performCollisionDetection(client)
        theirs = pairs_of(row for row in p.getContactPoints(physicsClientId=client) if row[8] < -1e-6)
        ours = stand_in.getContactPoints()
        assert theirs <= pairs_of(ours)
        assert pairs_of(row for row in ours if row[8] < -1e-6) <= theirs
        seen += len(theirs)
    assert seen > 500


@pytest.mark.parametrize("flags", [0, 8, 8 | 16, 8 | 32, 8 | 8192])
def test_self_collision_is_that_of_the_flags(client, flags):
    stand_in = attach(p, client, margins="bullet")
    arm = stand_in.loadURDF(f"{DATA}/kuka_iiwa/model.urdf", useFixedBase=True, flags=flags)
    random = np.random.default_rng(1)
    n = 0
    for _ in range(12):
        for joint in range(7):
            p.resetJointState(arm, joint, random.uniform(-2.5, 2.5), physicsClientId=client)
        p.performCollisionDetection(client)
        theirs, ours = p.getContactPoints(physicsClientId=client), stand_in.getContactPoints()
        assert pairs_of(row for row in theirs if row[8] < -1e-5) == pairs_of(row for row in ours if row[8] < -1e-5)
        n += len(pairs_of(theirs))
    assert (n > 0) == (flags not in (0, 8 | 32))  # each link hangs on all links before it


# --- rays and boxes -----------------------------------------------------------------------------


def test_rays_meet_spheres_and_boxes_where_closed_forms_say(client):
    random = np.random.default_rng(3)
    ball = sphere_of(client, 0.4, (0.1, 0.2, 0.3))
    box = body(client, position=(2, 0, 0), shapeType=p.GEOM_BOX, halfExtents=[0.3, 0.2, 0.5])
    mirror = Mirror(client)
    origins, ends = random.uniform(-3, 3, (2, 1500, 3))
    rows = mirror.rayTestBatch(origins, ends)
    hits = {ball: 0, box: 0, -1: 0}
    for origin, end, (who, link, fraction, place, normal) in zip(origins, ends, rows):
        d = end - origin
        best = (1.0, -1)
        m = origin - [0.1, 0.2, 0.3]
        a, b, c = d @ d, m @ d, m @ m - 0.16
        if c > 0 and b * b - a * c > 0 and 0 <= (t := (-b - np.sqrt(b * b - a * c)) / a) <= 1:
            best = min(best, (t, ball))
        enter, leave = np.sort(
            np.array([-1, 1])[:, None] * [0.3, 0.2, 0.5] / d + (np.array([2, 0, 0]) - origin) / d, axis=0
        )
        if 0 <= enter.max() <= min(leave.min(), 1):
            best = min(best, (enter.max(), box))
        assert (who, link) == (best[1], -1) and abs(fraction - best[0]) < 1e-12
        hits[who] += 1
        if who == -1:
            assert (fraction, place, normal) == (1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        else:
            assert np.allclose(place, origin + fraction * d, atol=1e-12) and np.array(normal) @ d < 0
    assert min(hits.values()) > 25
    assert rows[0] == mirror.rayTest(origins[0].tolist(), ends[0].tolist())[0]


def test_rays_begin_inside_come_from_behind_and_pass_filters_as_in_bullet(client):
    made = {
        "box": body(client, shapeType=p.GEOM_BOX, halfExtents=[0.5] * 3),
        "ball": sphere_of(client, 0.5, (2, 0, 0)),
        "triangles": p.loadURDF(f"{DATA}/samurai.urdf", [0, 0, -40], physicsClientId=client),
        "plane": body(client, 0.0, (8, 0, 0), shapeType=p.GEOM_PLANE, planeNormal=[-1, 0, 0]),
    }
    mirror = Mirror(client)
    assert len(made) == len(mirror.world)
    rays = [
        ((0.1, 0.1, 0.1), (5, 0.1, 0.1)), ((0.1, 0.1, 0.1), (1.2, 0.1, 0.1)), ((2.1, 0.1, 0.1), (6, 0.1, 0.1)),
        ((10, 0, 0), (4, 0, 0)), ((4, 0.3, 0), (12, 0, 0)), ((-3, 0.2, 0.1), (9, 0.1, 0.1)), ((0, 0, 5), (0, 0, 5)),
    ]  # fmt: skip
    p.performCollisionDetection(client)
    for origin, end in rays:
        (theirs,), (ours,) = p.rayTest(origin, end, physicsClientId=client), mirror.rayTest(origin, end)
        assert ours[:2] == theirs[:2] and abs(ours[2] - theirs[2]) < 1e-3, (origin, end, ours, theirs)
        assert np.allclose(ours[4], theirs[4], atol=5e-3)
    mirror.setCollisionFilterGroupMask(made["box"], -1, 4, 1)
    through = (-3, 0.2, 0.1), (9, 0.1, 0.1)
    assert mirror.rayTest(*through)[0][0] == made["box"]
    assert mirror.rayTest(*through, collisionFilterMask=4)[0][0] == made["box"]
    assert mirror.rayTest(*through, collisionFilterMask=3)[0][0] == made["ball"]
    assert [mirror.rayTest(*through, reportHitNumber=k)[0][0] for k in range(4)] == [
        made["box"], made["ball"], made["plane"], -1
    ]  # fmt: skip
    ((_, _, fraction, _, _),) = mirror.rayTestBatch([[0, 0, 3]], [[0, 0, -3]], parentObjectUniqueId=made["ball"])
    assert abs(fraction - 2.5 / 6) < 1e-12
    assert mirror.rayTestBatch([], []) == ()


def test_boxes_that_overlap_are_those_of_the_bodies(client):
    random = np.random.default_rng(6)
    centers = random.uniform(-2, 2, (40, 3))
    bodies = [sphere_of(client, 0.3, center) for center in centers]
    mirror = Mirror(client)
    n = empty = 0
    for _ in range(60):
        low = random.uniform(-2.5, 2.5, 3)
        high = low + random.uniform(0, 1.5, 3)
        want = [(b, -1) for b, c in zip(bodies, centers) if (low <= c + 0.3).all() and (c - 0.3 <= high).all()]
        ours = mirror.getOverlappingObjects(low.tolist(), high.tolist())
        assert (list(ours) if ours is not None else []) == want
        theirs = p.getOverlappingObjects(low.tolist(), high.tolist(), physicsClientId=client) or ()
        assert set(want) <= set(theirs)
        n, empty = n + len(want), empty + (ours is None)
    assert n > 25 and empty > 3


# --- programs as they are -----------------------------------------------------------------------


def test_what_pybullet_does_not_give_back_is_noted_as_it_passes(client):
    random = np.random.default_rng(9)
    stand_in = attach(p, client, margins="bullet")
    heights = random.uniform(0, 0.5, 30)
    field = stand_in.createCollisionShape(
        p.GEOM_HEIGHTFIELD, numHeightfieldRows=6, numHeightfieldColumns=5, heightfieldData=heights.tolist(),
        meshScale=[0.5, 0.4, 2.0],
    )  # fmt: skip
    ground = stand_in.createMultiBody(0.0, field, basePosition=[1, 2, 0])
    crate = stand_in.createMultiBody(
        0.0,
        stand_in.createCollisionShape(
            p.GEOM_MESH, vertices=CORNERS, indices=FACETS, collisionFramePosition=[0.1, 0, 0]
        ),
        basePosition=[6, 0, 1], baseInertialFramePosition=[0.3, 0.2, 0.1], baseInertialFrameOrientation=[0.5] * 4,
    )  # fmt: skip
    ball = stand_in.createMultiBody(
        1.0, stand_in.createCollisionShape(p.GEOM_SPHERE, radius=0.2), useMaximalCoordinates=1
    )
    assert stand_in.mirror_of(client).remaining == {}
    p.performCollisionDetection(client)
    n = 0
    for target, middle, size in ((ground, [1, 2, 0], [1.2, 0.7, 0.4]), (crate, [6.1, 0, 1], [0.6, 0.6, 0.6])):
        for _ in range(40):
            end = np.array(middle) + np.array(size) * random.uniform(-0.7, 0.7, 3)
            origin = end + random.normal(size=3) * 5
            (theirs,) = p.rayTest(origin.tolist(), (2 * end - origin).tolist(), physicsClientId=client)
            (ours,) = stand_in.rayTest(origin.tolist(), (2 * end - origin).tolist())
            if ours[0] == theirs[0] == target:
                assert abs(ours[2] - theirs[2]) < 1e-5
                n += 1
            p.resetBasePositionAndOrientation(ball, np.add(end, [0, 0, 2.0]).tolist(), [0, 0, 0, 1], client)
            least = min(row[8] for row in p.getClosestPoints(target, ball, 9.0, physicsClientId=client))
            assert abs(stand_in.getClosestPoints(target, ball, 9.0)[0][8] - least) < 1e-6
    assert n > 50
    rows = stand_in.getClosestPoints(
        -1,
        ball,
        99.0,
        collisionShapeA=field,
        collisionShapePositionA=[1, 2, 0],
        collisionShapeOrientationA=[0, 0, 0, 1],
    )
    assert rows[0][1:5] == (-1, ball, -2, -1)
    assert abs(rows[0][8] - stand_in.getClosestPoints(ground, ball, 99.0)[0][8]) < 1e-12


def test_import_finds_ours_between_install_and_uninstall():
    held = sys.modules["pybullet"]
    with pytest.warns(RuntimeWarning, match="hold pybullet already: .*test_pybullet_mirror"):
        context = pybullet_mirror.install(questions=("getClosestPoints",))
    with context as module:
        import pybullet as q

        assert q is module and q is not held and pybullet_mirror.installed()
        number = q.connect(q.DIRECT)
        a = q.createMultiBody(1, q.createCollisionShape(q.GEOM_MESH, vertices=CORNERS))
        b = q.createMultiBody(1, q.createCollisionShape(q.GEOM_MESH, vertices=CORNERS), basePosition=[3, 0, 0])
        assert abs(q.getClosestPoints(a, b, 9.0)[0][8] - 2.0) < 1e-12  # 1.998 in Bullet
        assert abs(held.getClosestPoints(a, b, 9.0, physicsClientId=number)[0][8] - 1.998) < 1e-9
        assert q.rayTest is held.rayTest and q.getQuaternionFromEuler([0, 0, 0]) == (0, 0, 0, 1)
        other = q.connect(q.DIRECT)
        with pytest.raises(InvalidArgument, match="say physicsClientId"):
            q.getClosestPoints(a, b, 9.0)
        assert len(q.getClosestPoints(a, b, 9.0, physicsClientId=number)) == 1
        with pytest.raises(UnknownBody):
            q.getClosestPoints(a, b, 9.0, physicsClientId=other)
        q.disconnect(other)
        q.disconnect(number)
    assert sys.modules["pybullet"] is held and not pybullet_mirror.installed()
    pybullet_mirror.uninstall()
    with pytest.raises(InvalidArgument, match="questions are among"):
        attach(held, questions=("stepSimulation",))


def test_marks_are_not_among_the_user_data_of_a_program(client):
    stand_in = attach(p, client)
    ball = sphere_of(client, 0.1, (0, 0, 0))
    first = stand_in.addUserData(ball, "colour", "red")
    stand_in.mirror_of()
    second = stand_in.addUserData(ball, "weight", "5")
    assert p.getNumUserData(ball, client) == 3 and stand_in.getNumUserData(ball) == 2
    infos = [stand_in.getUserDataInfo(ball, k) for k in range(2)]
    assert sorted(infos) == [(first, b"colour", ball, -1, -1), (second, b"weight", ball, -1, -1)]
    with pytest.raises(p.error):
        stand_in.getUserDataInfo(ball, 2)


def test_an_example_of_pybullets_own_runs_as_it_is(tmp_path):
    """Without its window, and not for ever."""
    source = (Path(pybullet_data.getDataPath()).parent / "pybullet_examples" / "getClosestPoints.py").read_text()
    changes = {"p.connect(p.GUI)": "p.connect(p.DIRECT)", "while (p.isConnected()):": "for step in range(30):"}
    for before, after in changes.items():
        assert source.count(before) == 1
        source = source.replace(before, after)
    source = source.replace("    distance = pts[0][8]\n", "    distance = pts[0][8]\n    rows.append(pts)\n")
    script = tmp_path / "example.py"
    script.write_text(f"rows = []\n{source}\np.disconnect()\n")
    answers = [runpy.run_path(str(script))["rows"]]
    with pytest.warns(RuntimeWarning, match="hold pybullet already"):
        context = pybullet_mirror.install()
    with context:
        answers.append(runpy.run_path(str(script))["rows"])
    assert len(answers[0]) == len(answers[1]) == 30
    for (theirs,), (row,) in zip(*answers):
        assert row[:5] == theirs[:5] and abs(row[8] - theirs[8]) < 1e-3 and np.allclose(row[7], theirs[7], atol=1e-2)


def test_a_bullet_client_is_attached_by_its_number(client):
    from pybullet_utils.bullet_client import BulletClient

    wrapped = BulletClient(p.DIRECT)  # closes itself, and its number is not told otherwise
    number = wrapped._client
    assert number != client  # calls that said nothing would be about the other one
    q = attach(wrapped, number)
    for x in (0, 3):
        ball = q.createMultiBody(1, q.createCollisionShape(q.GEOM_MESH, vertices=CORNERS), basePosition=[x, 0, 0])
    assert abs(q.getClosestPoints(0, ball, 9.0)[0][8] - 2.0) < 1e-12
    assert q.rayTest([3, 0, 5], [3, 0, -5])[0][0] == ball and p.getNumBodies(client) == 0
    q.resetSimulation()
    assert len(q.mirror_of().world) == 0
    q.disconnect()


# --- what goes wrong ----------------------------------------------------------------------------


def test_links_that_cannot_be_read_are_told_and_never_taken_for_free(client):
    ball = sphere_of(client, 0.1, (0, 0, 0))
    crate = body(client, 0.0, (1, 0, 0), shapeType=p.GEOM_MESH, vertices=CORNERS, indices=FACETS)
    with pytest.warns(RuntimeWarning, match="is left out: a mesh of triangles made from arrays"):
        mirror = Mirror(client)
    assert list(mirror.remaining) == [(crate, -1)]
    with pytest.raises(UnsupportedQuery, match="set_shape"):
        mirror.getClosestPoints(ball, crate, 1.0)
    with pytest.raises(UnsupportedQuery, match="triangles"):
        mirror.getContactPoints(crate)
    mirror.set_shape(crate, -1, collide.Box((1, 1, 1)))
    assert mirror.remaining == {} and abs(mirror.getClosestPoints(ball, crate, 1.0)[0][8] - 0.4) < 1e-12
    given = Mirror(client, shapes={(crate, -1): collide.Box((1, 1, 1))})
    assert abs(given.getClosestPoints(ball, crate, 1.0)[0][8] - 0.4) < 1e-12


def test_soft_bodies_and_those_of_maximal_coordinates_are_told_apart(client):
    p.resetSimulation(p.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    cloth = p.loadSoftBody(f"{DATA}/cloth_z_up.obj", useMassSpring=1, useBendingSprings=1, physicsClientId=client)
    number = p.createCollisionShape(p.GEOM_SPHERE, radius=0.1, physicsClientId=client)
    maximal = p.createMultiBody(1.0, number, useMaximalCoordinates=1, physicsClientId=client)
    with pytest.warns(RuntimeWarning, match="is left out"):
        mirror = Mirror(client)
    assert "of a soft body" in mirror.remaining[cloth, -1]
    assert "useMaximalCoordinates" in mirror.remaining[maximal, -1]
    mirror.update()
    assert len(mirror.world) == 0


def test_bad_arguments_are_named(client):
    ball = sphere_of(client, 0.1, (0, 0, 0))
    mirror = Mirror(client)
    for make, error, text in (
        (lambda: Mirror(77), InvalidArgument, "client must be what pybullet.connect returned.*77"),
        (
            lambda: Mirror(client, margins="thick"),
            InvalidArgument,
            "margins must be one of 'none', 'bullet', got 'thick'",
        ),
        (lambda: Mirror(client, shapes={(0, -1): 3}), InvalidArgument, "must be a shape, got int"),
        (lambda: mirror.getClosestPoints(ball, 9, 1.0), UnknownBody, "no body 9"),
        (lambda: mirror.getContactPoints(9), UnknownBody, "no body 9"),
        (lambda: mirror.getClosestPoints(ball, -1, 1.0, collisionShapeB=5), InvalidArgument, "shape 5 is not known"),
        (lambda: mirror.rayTest([0, 0], [1, 0, 0]), InvalidArgument, "rayFromPositions must be finite positions"),
        (lambda: mirror.rayTestBatch([[0, 0, 0]], [[1, 0, 0]] * 2), InvalidArgument, "1 origins and 2 ends"),
        (lambda: mirror.getOverlappingObjects([0, 0, np.nan], [1, 1, 1]), InvalidArgument, "aabbMin"),
    ):
        with pytest.raises(error, match=text):
            make()
    p.resetBasePositionAndOrientation(ball, [np.nan, 0, 0], [0, 0, 0, 1], client)
    with pytest.raises(InvalidPose, match=f"{ball}: its pose in pybullet is not finite"):
        mirror.update()
    p.disconnect(client)
    with pytest.raises(InvalidArgument, match=f"client {client} does not answer"):
        mirror.update()


def test_the_extra_is_named_where_pybullet_is_missing():
    code = (
        "import sys; sys.modules['pybullet'] = None\n"
        "from collide.adapters.hosts.pybullet_mirror import Mirror\n"
        "from collide.errors import MissingExtra\n"
        "try:\n  Mirror(0)\nexcept MissingExtra as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "pip install 'collide-robotics[pybullet]'" in done.stdout
