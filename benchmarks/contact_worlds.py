"""Five thousand bodies at rest, and engines that find all their contacts, for `contacts.py`.

Half boxes, half hulls of 12 points, a tenth to a fifth of a metre, fall into a pit of 500 and are settled there by
Bullet (the same every time); ten such pits, turned and shifted, are the world. Engines are asked step after step, all
bodies having moved by 10 µm between two steps.
"""

from __future__ import annotations

import math

import numpy as np
from contact_peers import Assets, bullet_shape, numbers, qpos_of

import collide
from collide.adapters.peers.coal_peer import CoalPeer
from collide.adapters.peers.pybullet_peer import quaternion_xyzw

#: Bodies of a pit, its inner side [m], and between the middles of two pits [m].
PER_PIT, SIDE, BETWEEN = 500, 1.6, 4.0
#: Steps of 1/240 s that Bullet takes until the bodies rest, and between two steps the bodies move so far [m].
SETTLING, MOVED = 700, 1e-5
#: Contacts are asked for up to here [m].
MARGIN = 2e-3


def shapes_of_pit() -> list[collide.Shape]:
    rng = np.random.default_rng(5)
    some: list[collide.Shape] = [collide.Box(rng.uniform(0.1, 0.2, 3)) for _ in range(20)]
    for _ in range(20):
        points = rng.normal(size=(12, 3))
        points *= 0.09 / np.linalg.norm(points, axis=1)[:, None]
        some.append(collide.ConvexHull(points - points.mean(axis=0)))
    return some


def walls() -> list[tuple[collide.Box, np.ndarray]]:
    """The floor and four walls of a pit."""
    half = SIDE / 2 + 0.1
    bodies = [(collide.Box((SIDE + 0.4, SIDE + 0.4, 0.2)), collide.pose((0, 0, -0.1)))]
    for k in range(4):
        angle = 0.5 * math.pi * k
        place = (half * math.cos(angle), half * math.sin(angle), 1.5)
        bodies.append((collide.Box((0.2, SIDE + 0.4, 3.0)), collide.pose(place, rpy=(0, 0, angle))))
    return bodies


def settled_pit() -> np.ndarray:
    """(PER_PIT, 4, 4) poses at rest, body k of shape k modulo 40. Raises ImportError without pybullet."""
    import pybullet

    client = pybullet.connect(pybullet.DIRECT)
    rng = np.random.default_rng(6)
    numbers_of = [bullet_shape(pybullet, shape, client) for shape in shapes_of_pit()]
    for shape, X in walls():
        wall = pybullet.createMultiBody(0, bullet_shape(pybullet, shape, client), physicsClientId=client)
        place_in(pybullet, client, wall, X)
    bodies = []
    for k in range(PER_PIT):
        layer, at = divmod(k, 36)
        place = 0.25 * np.array([at % 6 - 2.5, at // 6 - 2.5, layer + 0.6]) + rng.uniform(-0.02, 0.02, 3)
        body = pybullet.createMultiBody(1.0, numbers_of[k % len(numbers_of)], physicsClientId=client)
        pybullet.changeDynamics(body, -1, collisionMargin=1e-3, rollingFriction=1e-3, physicsClientId=client)
        place_in(pybullet, client, body, collide.pose(place, quat_wxyz=rng.normal(size=4)))
        bodies.append(body)
    pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
    for _ in range(SETTLING):
        pybullet.stepSimulation(physicsClientId=client)
    poses = []
    for body in bodies:
        place, (x, y, z, w) = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        poses.append(collide.pose(place, quat_wxyz=(w, x, y, z)))
    pybullet.disconnect(client)
    return np.array(poses)


def place_in(pybullet, client: int, body: int, X: np.ndarray) -> None:
    pybullet.resetBasePositionAndOrientation(
        body, X[:3, 3].tolist(), quaternion_xyzw(X[:3, :3]), physicsClientId=client
    )


class Pits:
    """shapes : of all bodies, those that stay behind.   X : (2, n, 4, 4), to and fro.   n_moving : the first."""

    def __init__(self, bodies: int):
        pit, some = settled_pit(), shapes_of_pit()
        n_pits = max(1, bodies // PER_PIT)
        places = [(BETWEEN * (k % 4), BETWEEN * (k // 4), 0) for k in range(n_pits)]
        frames = [collide.pose(place, rpy=(0, 0, 0.5 * math.pi * k)) for k, place in enumerate(places)]
        moving = [frame @ X for frame in frames for X in pit]
        still = [(shape, frame @ X) for frame in frames for shape, X in walls()]
        self.n_moving = len(moving)
        self.shapes = [some[k % PER_PIT % len(some)] for k in range(self.n_moving)] + [shape for shape, _ in still]
        X = np.array(moving + [X for _, X in still])
        Y = X.copy()
        Y[: self.n_moving, :3, 3] += np.random.default_rng(7).uniform(-MOVED, MOVED, (self.n_moving, 3))
        self.X = np.stack([X, Y])


class OurWorld:
    name = "collide"

    def __init__(self, pits: Pits):
        self.pits, self.at, self.ids = pits, 0, np.arange(pits.n_moving)
        self.world = collide.World()
        for k, (shape, X) in enumerate(zip(pits.shapes, pits.X[0])):
            self.world.add(shape, X, static=k >= pits.n_moving)

    def move(self) -> None:
        self.at = 1 - self.at
        self.world.set_poses(self.ids, self.pits.X[self.at, : self.pits.n_moving])

    def detect(self) -> None:
        self.rows = self.world.contacts(MARGIN).rows

    def counts(self) -> tuple[int, int]:
        """(pairs, contacts)."""
        return len(np.unique(np.stack([self.rows["a"], self.rows["b"]], axis=1), axis=0)), len(self.rows)


class CoalWorld:
    """`DynamicAABBTreeCollisionManager`: one contact a pair, its callback in C++."""

    name = "coal"

    def __init__(self, pits: Pits):
        import coal

        self.coal, self.pits, self.at = coal, pits, 0
        peer = CoalPeer()
        built = {id(shape): peer.build(shape) for shape in pits.shapes}
        self.transforms = [[coal.Transform3s(np.array(x[:3, :3]), np.array(x[:3, 3])) for x in X] for X in pits.X]
        self.objects = [coal.CollisionObject(built[id(s)], T) for s, T in zip(pits.shapes, self.transforms[0])]
        # Objects that stay are in a manager of their own, or their pairs would be asked for, too.
        self.managers = coal.DynamicAABBTreeCollisionManager(), coal.DynamicAABBTreeCollisionManager()
        for k, obj in enumerate(self.objects):
            self.managers[k >= pits.n_moving].registerObject(obj)
        for manager in self.managers:
            manager.setup()

    def move(self) -> None:
        self.at = 1 - self.at
        for obj, transform in zip(self.objects[: self.pits.n_moving], self.transforms[self.at]):
            obj.setTransform(transform)
            obj.computeAABB()

    def detect(self) -> None:
        self.callbacks = [self.coal.CollisionCallBackDefault() for _ in range(2)]
        for callback in self.callbacks:
            request = callback.data.request
            request.num_max_contacts, request.enable_contact, request.security_margin = 1 << 30, True, MARGIN
        self.managers[0].update()
        self.managers[0].collide(self.callbacks[0])
        self.managers[0].collide(self.managers[1], self.callbacks[1])

    def counts(self) -> tuple[int, int]:
        contacts = sum(callback.data.result.numContacts() for callback in self.callbacks)
        return contacts, contacts


class BulletWorld:
    """`performCollisionDetection`, which keeps contacts from step to step and refreshes them."""

    name = "bullet"

    def __init__(self, pits: Pits):
        import pybullet

        self.pybullet, self.pits, self.at = pybullet, pits, 0
        self.client = pybullet.connect(pybullet.DIRECT)
        made = {id(shape): bullet_shape(pybullet, shape, self.client) for shape in pits.shapes}
        self.bodies = []
        for k, (shape, X) in enumerate(zip(pits.shapes, pits.X[0])):
            body = pybullet.createMultiBody(float(k < pits.n_moving), made[id(shape)], physicsClientId=self.client)
            pybullet.changeDynamics(body, -1, collisionMargin=1e-3, physicsClientId=self.client)
            place_in(pybullet, self.client, body, X)
            self.bodies.append(body)
        self.places = [[(X[:3, 3].tolist(), quaternion_xyzw(X[:3, :3])) for X in some] for some in pits.X]

    def move(self) -> None:
        self.at = 1 - self.at
        put, client = self.pybullet.resetBasePositionAndOrientation, self.client
        for body, place in zip(self.bodies[: self.pits.n_moving], self.places[self.at]):
            put(body, *place, physicsClientId=client)

    def detect(self) -> None:
        self.pybullet.performCollisionDetection(physicsClientId=self.client)

    def counts(self) -> tuple[int, int]:
        pairs, contacts = set(), 0
        for body in self.bodies[: self.pits.n_moving]:
            for c in self.pybullet.getContactPoints(body, physicsClientId=self.client):
                if c[8] <= MARGIN:
                    pairs.add((min(c[1], c[2]), max(c[1], c[2])))
                    contacts += 1 if c[2] >= self.pits.n_moving or c[1] >= self.pits.n_moving else 0.5
        return len(pairs), int(contacts)


class MujocoWorld:
    """`mj_kinematics` is its move, `mj_collision` all the rest."""

    name = "mujoco"

    def __init__(self, pits: Pits):
        import mujoco

        self.mujoco, self.pits, self.at = mujoco, pits, 0
        assets, bodies = Assets(), []
        for k, (shape, X) in enumerate(zip(pits.shapes, pits.X[0])):
            geom = f'<geom {assets.attributes(shape)} mass="1" margin="{0.5 * MARGIN!r}"/>'  # those of two geoms add up
            place = qpos_of(X)
            bodies.append(
                f"<body><freejoint/>{geom}</body>" if k < pits.n_moving
                else f'<body pos="{numbers(place[:3])}" quat="{numbers(place[3:])}">{geom}</body>'
            )
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><size memory="1G"/><option><flag multiccd="enable"/></option><asset>{assets.xml()}</asset>'
            f'<worldbody>{"".join(bodies)}</worldbody></mujoco>'
        )
        self.data = mujoco.MjData(self.model)
        self.qpos = [np.concatenate([qpos_of(x) for x in X[: pits.n_moving]]) for X in pits.X]
        self.move()

    def move(self) -> None:
        self.at = 1 - self.at
        self.data.qpos[:] = self.qpos[self.at]
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_comPos(self.model, self.data)

    def detect(self) -> None:
        self.mujoco.mj_collision(self.model, self.data)

    def counts(self) -> tuple[int, int]:
        return len(np.unique(np.array(self.data.contact.geom).reshape(-1, 2), axis=0)), int(self.data.ncon)


WORLDS = {"coal": CoalWorld, "pybullet": BulletWorld, "mujoco": MujocoWorld}
