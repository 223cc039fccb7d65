"""What a mirror of a pybullet client follows: where shapes stand, and which bodies there are.

Distances are judged by closed forms worked out here, where the arguments of bodies say they stand, and by Bullet itself
where its definition is the same. Skipped where pybullet is not installed.
"""

from __future__ import annotations

import numpy as np
import pytest

import collide
from collide.adapters.hosts.pybullet_mirror import Mirror, attach

p = pytest.importorskip("pybullet", reason="pybullet is not installed: pip install 'collide-robotics[pybullet]'")
from bullet_scenes import CORNERS, DATA, body, quaternion, rotation, sphere_of


def gap_to_box(point: np.ndarray, half: np.ndarray) -> float:
    """Signed distance of a point from a box around the origin."""
    outside = np.abs(point) - half
    return float(np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0))


def gap_to_capsule(point: np.ndarray, radius: float, length: float) -> float:
    return float(np.linalg.norm(point - [0, 0, np.clip(point[2], -length / 2, length / 2)]) - radius)


def gap_to_cylinder(point: np.ndarray, radius: float, length: float) -> float:
    outside = np.array([np.hypot(point[0], point[1]) - radius, abs(point[2]) - length / 2])
    return float(np.linalg.norm(np.maximum(outside, 0.0)) + min(outside.max(), 0.0))


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
