"""Contacts, filters, rays and boxes of a mirror, beside Bullet's and closed forms. Skipped without pybullet."""

from __future__ import annotations

import numpy as np
import pytest

from collide import InvalidPose
from collide.adapters.hosts.pybullet_mirror import Mirror, attach

p = pytest.importorskip("pybullet", reason="pybullet is not installed: pip install 'collide-robotics[pybullet]'")
from bullet_scenes import CORNERS, DATA, body, pairs_of, quaternion, sphere_of

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
        )
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


def test_contacts_of_two_bodies_are_those_among_all(client):
    """Pairs are asked alone where not all contacts are known: with the rows, and the filters, that the World has."""
    random = np.random.default_rng(11)
    stand_in = attach(p, client)
    kinds = [
        {"shapeType": p.GEOM_SPHERE, "radius": 0.5}, {"shapeType": p.GEOM_BOX, "halfExtents": [0.4, 0.5, 0.6]},
        {"shapeType": p.GEOM_CAPSULE, "radius": 0.3, "height": 0.8},
        {"shapeType": p.GEOM_MESH, "vertices": CORNERS, "meshScale": [0.8, 0.9, 1.0]},
    ]
    bodies = [body(client, 0.0, shapeType=p.GEOM_PLANE, planeNormal=[0, 0, 1])]
    for k in range(24):
        place = [*random.uniform(-1.2, 1.2, 2), random.uniform(0.2, 1.0)]
        bodies.append(body(client, float(k % 5 > 0), place, quaternion(random), **kinds[k % 4]))
    stand_in.loadURDF(f"{DATA}/cube.urdf", [0.1, 0.2, 0.5], physicsClientId=client)
    bodies.append(stand_in.loadURDF(
        f"{DATA}/kuka_iiwa/model.urdf", [0.3, 0.3, 0.2], flags=p.URDF_USE_SELF_COLLISION, physicsClientId=client
    ))
    n_pairs = n_asked = n_contacts = 0
    for step in range(3):
        for _ in range(20 * (step > 0)):
            a, b = random.choice(bodies, 2, replace=False).tolist()
            stand_in.setCollisionFilterPair(a, b, -1, -1, int(random.integers(2)), physicsClientId=client)
        for number in random.choice(bodies, 4, replace=False).tolist() if step == 2 else ():
            bits = random.integers(1, 4, 2).tolist()
            stand_in.setCollisionFilterGroupMask(number, -1, *bits, physicsClientId=client)
        mirror = stand_in.mirror_of(client)
        for a, b in random.choice(bodies, (100, 2)).tolist():
            mirror._contacts = None
            alone = mirror.getContactPoints(a, b)
            n_asked += mirror._contacts is None
            mirror.getContactPoints()
            assert alone == mirror.getContactPoints(a, b), (step, a, b)
            n_pairs, n_contacts = n_pairs + 1, n_contacts + bool(alone)
    assert n_asked > 0.8 * n_pairs and n_contacts > 0.05 * n_pairs


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
    ]
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
    ]
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


def test_a_body_that_returns_is_followed(client):
    """Bodies that are asked about alone are compared with where they were seen last, whoever saw them."""
    stand_in = attach(p, client)
    A, B = (body(client, 1.0, (2.0 * k, 0, 0), shapeType=p.GEOM_SPHERE, radius=0.5) for k in range(2))
    mirror = stand_in.mirror_of(client)
    for whole in (False, True, False, True, True, False):
        for x in (2.0, 3.0, 2.0, 5.0, 2.0):
            p.resetBasePositionAndOrientation(B, [x, 0, 0], [0, 0, 0, 1], client)
            if whole and x != 2.0:
                mirror.update()
                continue
            ((*_, gap, _, _, _, _, _),) = stand_in.getClosestPoints(A, B, 9.0, physicsClientId=client)
            assert abs(gap - (x - 1.0)) < 1e-12, (whole, x)
    p.resetBasePositionAndOrientation(B, [np.nan, 0, 0], [0, 0, 0, 1], client)
    for _ in range(2):
        with pytest.raises(InvalidPose, match="diverged"):
            stand_in.getClosestPoints(A, B, 9.0, physicsClientId=client)
