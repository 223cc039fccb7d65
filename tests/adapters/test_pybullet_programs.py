"""Programs for pybullet as they are, on collide; and what goes wrong. Skipped without pybullet."""

from __future__ import annotations

import runpy
import subprocess
import sys
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import collide
from collide.adapters.hosts import pybullet_mirror
from collide.adapters.hosts.pybullet_mirror import Mirror, attach
from collide.errors import InvalidArgument, InvalidPose, UnknownBody, UnsupportedQuery
from collide.kernels import library

p = pytest.importorskip("pybullet", reason="pybullet is not installed: pip install 'collide-robotics[pybullet]'")
from bullet_scenes import CORNERS, DATA, FACETS, body, sphere_of

# --- programs as they are -----------------------------------------------------------------------


def test_what_pybullet_does_not_give_back_is_noted_as_it_passes(client):
    random = np.random.default_rng(9)
    stand_in = attach(p, client, margins="bullet")
    heights = random.uniform(0, 0.5, 30)
    field = stand_in.createCollisionShape(
        p.GEOM_HEIGHTFIELD, numHeightfieldRows=6, numHeightfieldColumns=5, heightfieldData=heights.tolist(),
        meshScale=[0.5, 0.4, 2.0],
    )
    ground = stand_in.createMultiBody(0.0, field, basePosition=[1, 2, 0])
    crate = stand_in.createMultiBody(
        0.0,
        stand_in.createCollisionShape(
            p.GEOM_MESH, vertices=CORNERS, indices=FACETS, collisionFramePosition=[0.1, 0, 0]
        ),
        basePosition=[6, 0, 1], baseInertialFramePosition=[0.3, 0.2, 0.1], baseInertialFrameOrientation=[0.5] * 4,
    )
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
    with pytest.warns(RuntimeWarning, match="hold pybullet already: .*test_pybullet_programs"):
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
        assert len(q.getClosestPoints(a, b, 9.0)) == 1  # of client 0, as in pybullet
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
    source = (Path(DATA).parent / "pybullet_examples" / "getClosestPoints.py").read_text()
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
    q = attach(wrapped)
    assert attach(wrapped, number).mirror_of().client == q.mirror_of().client == number
    for x in (0, 3):
        ball = q.createMultiBody(1, q.createCollisionShape(q.GEOM_MESH, vertices=CORNERS), basePosition=[x, 0, 0])
    assert abs(q.getClosestPoints(0, ball, 9.0)[0][8] - 2.0) < 1e-12
    assert q.rayTest([3, 0, 5], [3, 0, -5])[0][0] == ball and p.getNumBodies(client) == 0
    q.resetSimulation()
    assert len(q.mirror_of().world) == 0
    q.disconnect()
    with pytest.raises(InvalidArgument, match=r"must be the module or a BulletClient, got object.*say client="):
        attach(object())


#: Run as it is, and with `install()` before. A third client at least, in which nothing else is made.
BULLET_CLIENTS = """
import pybullet as p
from pybullet_utils.bullet_client import BulletClient
assert p.connect(p.SHARED_MEMORY) == -1
p.connect(p.DIRECT)
p.resetSimulation()
clients = [BulletClient(p.DIRECT), BulletClient(p.DIRECT)]
rows = []
for k, client in enumerate(clients):
    client.resetSimulation()
    ball = client.createCollisionShape(client.GEOM_SPHERE, radius=0.5)
    bodies = [client.createMultiBody(1, ball, basePosition=[(1 + k) * x, 0, 0]) for x in range(2 + k)]
    client.addUserData(bodies[0], "colour", "red")
    client.setCollisionFilterGroupMask(bodies[0], -1, 1, 1)
    client.stepSimulation()
for k, client in enumerate(clients):
    rows.append([round(row[8], 9) for row in client.getClosestPoints(0, 1, 9.0)])
    rows.append(sorted(row[0] for row in client.getOverlappingObjects([-9] * 3, [0.6, 9, 9])))
    rows.append([hit[0] for hit in client.rayTestBatch([[0, 0, 9], [2, 0, 9]], [[0, 0, -9], [2, 0, -9]])])
    rows.append([client.getNumUserData(0), client.getUserDataInfo(0, 0)[1:3], client.getNumBodies()])
rows.append([p.getNumBodies(), p.getOverlappingObjects([-9] * 3, [9] * 3), p.getContactPoints()])
clients[0].disconnect()
rows.append([p.isConnected(0), p.isConnected(1), p.isConnected(2), clients[1].getNumBodies()])
print(rows)
"""
INSTALLED = "from collide.adapters.hosts import pybullet_mirror as m; m.install(); import pybullet as q\n"
OURS = "\nassert p is q and q.mirror_of(2).client == 2 and len(q.mirror_of(2).world) == 3"


@pytest.mark.skipif(library.glue is None, reason="builtins are made by the compiled library")
def test_bullet_clients_of_programs_reach_their_own_client():
    """pybullet_utils gives a client's number to builtins alone. A connection that failed is no client."""
    done = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.splitlines()[-1]
        for code in (BULLET_CLIENTS, INSTALLED + BULLET_CLIENTS + OURS)
    ]
    assert done[0] == done[1] and "b'colour'" in done[0]


def test_a_module_attached_to_a_client_is_about_that_client(client):
    """Calls without physicsClientId, those that collide does not answer, too."""
    number = p.connect(p.DIRECT)
    q = attach(p, number)
    assert number > client >= 0
    ball = q.createMultiBody(1.0, q.createCollisionShape(q.GEOM_SPHERE, radius=0.2))
    q.setGravity(0, 0, -10)
    q.stepSimulation()
    assert (q.getNumBodies(), p.getNumBodies(client)) == (1, 0)
    assert q.getBasePositionAndOrientation(ball)[0][2] < 0.0 and q.rayTest([0, 0, 5], [0, 0, -5])[0][0] == ball
    assert q.getNumBodies(physicsClientId=client) == 0 and q.connect(p.SHARED_MEMORY) == -1
    q.disconnect()
    assert not p.isConnected(number) and p.isConnected(client)
    again = q.connect(p.DIRECT)
    assert again == number and q.getNumBodies() == 0 and len(q.mirror_of().world) == 0
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
        (lambda: Mirror(client, shapes={(0, -1): 3}), InvalidArgument, "must be a shape, got 3"),
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


def test_an_exclusive_module_looks_at_bodies_after_what_may_have_moved_some(monkeypatch):
    """Beside a module that looks before each question, in a program of steps, resets, bodies that come and go."""
    looks, look = [], Mirror.update
    alone, client = attach(p, exclusive=True), None
    try:
        client = alone.connect(p.DIRECT)
        careful = attach(p, client)
        alone.createMultiBody(0.0, alone.createCollisionShape(p.GEOM_PLANE))
        box = alone.createCollisionShape(p.GEOM_BOX, halfExtents=[0.2, 0.3, 0.1])
        arm = alone.loadURDF(f"{DATA}/kuka_iiwa/model.urdf", [1, 0, 0.5])
        random = np.random.default_rng(4)
        bodies = [alone.createMultiBody(1.0, box, basePosition=[*random.uniform(-1, 1, 2), 0.3]) for _ in range(6)]
        changes = {
            "step": alone.stepSimulation,
            "base": lambda: alone.resetBasePositionAndOrientation(bodies[0], random.normal(size=3), [0, 0, 0, 1]),
            "come": lambda: bodies.append(alone.createMultiBody(1.0, box, basePosition=random.normal(size=3).tolist())),
            "gone": lambda: alone.removeBody(bodies.pop()) if len(bodies) > 3 else None,
            "look": lambda: (alone.getBasePositionAndOrientation(bodies[0]), alone.getNumBodies()),
            "joint": lambda: alone.resetJointState(arm, 2, float(random.uniform(-1, 1))),
        }
        questions = {
            "rayTest": lambda m: m.rayTest([0.1, 0.2, 3], [0.1, 0.2, -1]),
            "getContactPoints": lambda m: m.getContactPoints(),
            "contacts of two": lambda m: m.getContactPoints(bodies[0], bodies[1]),
            "getClosestPoints": lambda m: m.getClosestPoints(bodies[0], bodies[1], 5.0),
            "getOverlappingObjects": lambda m: m.getOverlappingObjects([-1, -1, -1], [1, 1, 1]),
        }
        n_looks = Counter()
        for k in range(120):
            change = str(random.choice(list(changes)))
            changes[change]()
            for name in random.permutation(list(questions))[:2].tolist():
                monkeypatch.setattr(Mirror, "update", lambda self: (looks.append(1), look(self))[1])
                ours = questions[name](alone)
                monkeypatch.setattr(Mirror, "update", look)
                n_looks[change] += len(looks)
                looks.clear()
                assert ours == questions[name](careful), f"{k}: {name} after {change}"
        assert n_looks["step"] > 5 and n_looks["look"] < 0.7 * n_looks["step"], n_looks
    finally:
        if client is not None:
            alone.disconnect(client)


def test_clients_that_others_may_reach_are_looked_at_each_time(client):
    """Made by pybullet itself, or module and pybullet both in use: a reset that does not pass is seen."""
    stand_in = attach(p, client, exclusive=True)
    ball = stand_in.createMultiBody(1.0, stand_in.createCollisionShape(p.GEOM_SPHERE, radius=0.5))
    for z in (0.0, 2.0, 4.0):
        p.resetBasePositionAndOrientation(ball, [0, 0, z], [0, 0, 0, 1], client)
        ((body, _, _, position, _),) = stand_in.rayTest([0, 0, 9], [0, 0, -9])
        assert body == ball and position[2] == pytest.approx(z + 0.5)
    with pytest.raises(InvalidArgument, match="exclusive"):
        attach(p, client, exclusive="yes")


def test_threads_that_ask_never_see_bodies_where_they_were():
    alone, stop = attach(p, exclusive=True), threading.Event()

    def ask() -> None:
        while not stop.is_set():
            alone.getOverlappingObjects([-1, -1, -1], [1, 1, 1])

    interval, client = sys.getswitchinterval(), alone.connect(p.DIRECT)
    threads = ThreadPoolExecutor(1)
    try:
        ball = alone.createCollisionShape(p.GEOM_SPHERE, radius=0.1)
        first, second = (alone.createMultiBody(1.0, ball, basePosition=[x, 0, 0]) for x in (0.0, 1.0))
        for k in range(20):
            alone.createMultiBody(1.0, ball, basePosition=[0, k + 5, 0])
        sys.setswitchinterval(1e-5)
        asking = threads.submit(ask)
        for k in range(100):
            x = 1.0 + 0.5 * (k % 7)
            alone.resetBasePositionAndOrientation(second, [x, 0, 0], [0, 0, 0, 1])
            ((*_, gap, _, _, _, _, _),) = alone.getClosestPoints(first, second, 100.0)
            assert gap == pytest.approx(x - 0.2, abs=1e-9), k
        stop.set()
        asking.result()
    finally:
        stop.set()
        sys.setswitchinterval(interval)
        threads.shutdown()
        alone.disconnect(client)


def test_a_client_is_named_by_its_place_or_its_name(client):
    own = attach(p, client, exclusive=True)
    own.stepSimulation(client)
    own.stepSimulation(physicsClientId=client)
    assert own.getNumBodies(client) == own.getNumBodies() == 0
    with pytest.raises(TypeError):
        own.stepSimulation(client, "more")
