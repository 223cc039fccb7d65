"""Engines' broadphases, for `broadphase.py`: told where boxes are, then asked which of them meet."""

from __future__ import annotations

import time

import numpy as np

from collide.adapters.bench.turns import Seconds


class Engine:
    """Boxes that move to and fro: `moved` gives new places to an engine, `pairs` is what is timed."""

    def __init__(self, layout: str, n: int):
        rng = np.random.default_rng(0)
        side = 0.5 * n ** (1 / 3)
        middles, half_lengths = rng.uniform(0, side, (n, 3)), rng.uniform(0.05, 0.15, (n, 3))
        if layout == "clustered":
            middles = rng.normal(size=(n, 3)) * 0.15 * side + 20 * side * rng.integers(0, 3, (n, 1))
        elif layout == "a few huge":
            half_lengths[:5] = side * rng.uniform(0.05, 0.15, (5, 3))
        elif layout == "all sizes":
            half_lengths = 10.0 ** rng.uniform(-4, -0.5, (n, 1)) * rng.uniform(0.5, 1.0, (n, 3))
        self.middles, self.half_lengths, self.step, rng = middles, half_lengths, 0, np.random.default_rng(1)
        self.moving = np.sort(rng.choice(n, max(1, n // 100), replace=False)) if layout == "few move" else np.arange(n)
        reach = 0.1 if layout == "far" else 0.01
        self._shift = rng.uniform(-reach, reach, (2, len(self.moving), 3))
        self.make()

    def places(self) -> np.ndarray:
        """(k, 3) of the bodies that move, one step on."""
        self.step += 1
        return self.middles[self.moving] + self._shift[self.step % 2] * (1 + self.step // 2 % 3)

    def answer(self) -> Seconds:
        """Seconds of the second of two steps; the first brings what the engine works on into the caches."""
        self.moved(self.places())
        self.pairs()
        self.moved(self.places())
        started = time.process_time()
        self.pairs()
        return Seconds(self.seconds(time.process_time() - started))

    def seconds(self, answering: float) -> float:
        return answering

    def close(self) -> None:
        """Nothing to end."""


class Coal(Engine):
    def make(self) -> None:
        import coal

        self.manager = coal.DynamicAABBTreeCollisionManager()
        self.objects = [
            coal.CollisionObject(coal.Box(*(2 * half)), coal.Transform3s(np.eye(3), p))
            for p, half in zip(self.middles, self.half_lengths)
        ]
        for obj in self.objects:
            self.manager.registerObject(obj)
        self.manager.setup()
        self.callback = coal.CollisionCallBackCollect(64 * len(self.objects) + 1000)

    def moved(self, places: np.ndarray) -> None:
        for k, p in zip(self.moving.tolist(), places):
            self.objects[k].setTranslation(p)
            self.objects[k].computeAABB()

    def pairs(self) -> int:
        self.manager.update()
        self.callback.init()
        self.manager.collide(self.callback)
        return self.callback.numCollisionPairs()


class Fcl(Engine):
    def make(self) -> None:
        import fcl

        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.objects = [
            fcl.CollisionObject(fcl.Box(*(2 * half)), fcl.Transform(p))
            for p, half in zip(self.middles, self.half_lengths)
        ]
        self.manager.registerObjects(self.objects)
        self.manager.setup()

    def moved(self, places: np.ndarray) -> None:
        for k, p in zip(self.moving.tolist(), places):
            self.objects[k].setTranslation(p)

    def pairs(self) -> int:
        pairs: list = []
        self.manager.update()
        self.manager.collide(None, lambda a, b, data: bool(pairs.append(None)))
        return len(pairs)


class Bullet(Engine):
    """Told through `resetBasePositionAndOrientation`, which does a part of the work."""

    def make(self) -> None:
        import pybullet

        self.bullet, self.client, self.bodies = pybullet, pybullet.connect(pybullet.DIRECT), []
        for p, half in zip(self.middles.tolist(), self.half_lengths.tolist()):
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client)
            body = pybullet.createMultiBody(1.0, shape, basePosition=p, physicsClientId=self.client)
            pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=self.client)
            self.bodies.append(body)
        self._places = self.middles[self.moving].tolist()

    def _reset(self, places: list) -> float:
        """CPU seconds of telling where bodies are."""
        started = time.process_time()
        for k, p in zip(self.moving.tolist(), places):
            self.bullet.resetBasePositionAndOrientation(self.bodies[k], p, (0, 0, 0, 1), physicsClientId=self.client)
        return time.process_time() - started

    def moved(self, places: np.ndarray) -> None:
        self._reset(self._places)  # into the caches
        staying = self._reset(self._places)
        self._places = places.tolist()
        self.updating = max(0.0, self._reset(self._places) - staying)

    def pairs(self) -> None:
        self.bullet.performCollisionDetection(physicsClientId=self.client)

    def seconds(self, answering: float) -> float:
        return answering + self.updating

    def close(self) -> None:
        self.bullet.disconnect(self.client)


class BulletBoxes(Bullet):
    def seconds(self, answering: float) -> float:
        return answering


class MuJoCo(Engine):
    """Free bodies without masses of their own; MuJoCo's timer of its broadphase."""

    def make(self) -> None:
        import mujoco

        self.mujoco, spec = mujoco, mujoco.MjSpec()
        for p, half in zip(self.middles, self.half_lengths):
            body = spec.worldbody.add_body(pos=p)
            body.add_freejoint()
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, mass=0.0)
            body.mass, body.inertia, body.explicitinertial = 1.0, (1.0, 1.0, 1.0), True
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.set_mjcb_time(time.process_time)
        self.timer = int(mujoco.mjtTimer.mjTIMER_COL_BROAD)
        mujoco.mj_forward(self.model, self.data)

    def moved(self, places: np.ndarray) -> None:
        self.data.qpos.reshape(-1, 7)[self.moving, :3] = places
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_comPos(self.model, self.data)

    def pairs(self) -> None:
        self.data.timer[self.timer].duration = 0.0
        self.mujoco.mj_collision(self.model, self.data)

    def seconds(self, answering: float) -> float:
        return float(self.data.timer[self.timer].duration)


#: Name → (engine, package, most bodies).
PEERS: dict[str, tuple[type[Engine], str, int]] = {
    "coal": (Coal, "coal", 10**6), "fcl": (Fcl, "fcl", 10**6), "Bullet": (Bullet, "pybullet", 10_000),
    "Bullet boxes": (BulletBoxes, "pybullet", 10_000), "MuJoCo": (MuJoCo, "mujoco", 1000),
}
