"""The broadphase alone: which pairs of boxes meet, for 10² to 10⁵ bodies, beside coal's, FCL's, Bullet's and MuJoCo's.

    python benchmarks/broadphase.py                  # some minutes
    python benchmarks/broadphase.py --sizes 100 1000 --layouts uniform

Bodies are boxes. Layouts: "uniform" in a cube; "clustered" in three heaps; "a few huge", five of them as wide as a
tenth to a third of the cube; "all sizes", from a tenth of a millimetre to a third of a metre; "few move": uniform, and
one body in a hundred moves; "far": uniform, and all move by a body's length or so. In the others all move, by some
centimetres along each axis, between turns: a body is within three centimetres of where it began.

What is timed is what an engine does after it was told new poses, which is not, but for Bullet: boxes, trees, and all
pairs whose boxes meet.

    collide       `World`: tables of poses, boxes, tree, candidate pairs in numpy
    tree before   the tree that collide had first, boxes given (`broadphase_before.py`)
    tree          the graded tree, boxes given; pairs near each other are kept from turn to turn where few leave their
                  leaves' boxes
    coal          `DynamicAABBTreeCollisionManager.update` and `collide` with `CollisionCallBackCollect`, in C++
    python-fcl    `update` and `collide`: its callback is a Python function, called once a pair
    Bullet        `performCollisionDetection`, and what `resetBasePositionAndOrientation` takes for new places more than
                  for the places where bodies are: it brings the tree up to date and looks for pairs
                  (`getOverlappingObjects` finds a body at its new place at once). Every pair is refused by its mask
    Bullet, boxes `performCollisionDetection` alone: boxes of bodies, about which nothing remains to be done
    MuJoCo        the timer mjTIMER_COL_BROAD of `mj_collision`, free bodies, up to 1,000

Engines take turns of two steps, of which the second is timed; of each the median, CPU time of this process. Ratios are
of medians, theirs by ours. Checked first: pairs of collide, the tree before, coal and python-fcl are the same.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time

import numpy as np
from broadphase_before import ImplicitBoxTree
from convex import write
from startup import machine

import collide
from collide.broadphase.box_tree import BoxTree

SIZES = (100, 1000, 10_000, 100_000)
LAYOUTS = ("uniform", "clustered", "a few huge", "all sizes", "few move", "far")
#: Seconds that the turns of one size and layout may take, and how many there are.
SECONDS, TURNS = 20.0, 40


def layout(kind: str, n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """((n, 3) middles, (n, 3) half lengths) [m]."""
    rng = np.random.default_rng(seed)
    side = 0.5 * n ** (1 / 3)
    middles, half_lengths = rng.uniform(0, side, (n, 3)), rng.uniform(0.05, 0.15, (n, 3))
    if kind == "clustered":
        middles = rng.normal(size=(n, 3)) * 0.15 * side + 20 * side * rng.integers(0, 3, (n, 1))
    elif kind == "a few huge":
        half_lengths[:5] = side * rng.uniform(0.05, 0.15, (5, 3))
    elif kind == "all sizes":
        half_lengths = 10.0 ** rng.uniform(-4, -0.5, (n, 1)) * rng.uniform(0.5, 1.0, (n, 3))
    return middles, half_lengths


class Steps:
    """Where bodies are, turn by turn; a body that does not move stays."""

    def __init__(self, kind: str, n: int):
        self.middles, self.half_lengths = layout(kind, n)
        rng = np.random.default_rng(1)
        moving = np.sort(rng.choice(n, max(1, n // 100), replace=False)) if kind == "few move" else np.arange(n)
        reach = 0.1 if kind == "far" else 0.01
        self.moving, self._shift, self.step_number = moving, rng.uniform(-reach, reach, (2, len(moving), 3)), 0

    def places(self) -> np.ndarray:
        """(k, 3) of the bodies that move, now."""
        return self.middles[self.moving] + self._shift[self.step_number % 2] * (1 + self.step_number // 2 % 3)

    def boxes(self, which: np.ndarray, middles: np.ndarray) -> np.ndarray:
        return np.hstack([middles - self.half_lengths[which], middles + self.half_lengths[which]])


class Ours:
    def __init__(self, steps: Steps):
        self.steps, self.world = steps, collide.World()
        for p, half in zip(steps.middles, steps.half_lengths):
            self.world.add(collide.Box(2 * half), collide.pose(p))

    def move(self) -> None:
        X = np.tile(np.eye(4), (len(self.steps.moving), 1, 1))
        X[:, :3, 3] = self.steps.places()
        self.world.set_poses(self.steps.moving, X)

    def pairs(self):
        return self.world._pack().candidates(0.0)


class Tree:
    def __init__(self, steps: Steps):
        self.steps, n = steps, len(steps.middles)
        self.tree = BoxTree(steps.boxes(np.arange(n), steps.middles))

    def move(self) -> None:
        self.moved = self.steps.boxes(self.steps.moving, self.steps.places())

    def pairs(self):
        self.tree.move(self.steps.moving, self.moved)
        return self.tree.pairs(0.0)


class TreeBefore(Tree):
    def __init__(self, steps: Steps):
        self.steps, n = steps, len(steps.middles)
        self.boxes = steps.boxes(np.arange(n), steps.middles)
        self.tree = ImplicitBoxTree(self.boxes)

    def pairs(self):
        self.boxes[self.steps.moving] = self.moved
        self.tree.refit(self.boxes.copy())
        return self.tree.pairs(0.0)


class Coal:
    def __init__(self, steps: Steps):
        import coal

        self.steps, self.coal = steps, coal
        self.manager = coal.DynamicAABBTreeCollisionManager()
        self.objects = [
            coal.CollisionObject(coal.Box(*(2 * half)), coal.Transform3s(np.eye(3), p))
            for p, half in zip(steps.middles, steps.half_lengths)
        ]
        for obj in self.objects:
            self.manager.registerObject(obj)
        self.manager.setup()
        self.callback = coal.CollisionCallBackCollect(64 * len(self.objects) + 1000)

    def move(self) -> None:
        for k, p in zip(self.steps.moving.tolist(), self.steps.places()):
            self.objects[k].setTranslation(p)
            self.objects[k].computeAABB()

    def pairs(self) -> int:
        self.manager.update()
        self.callback.init()
        self.manager.collide(self.callback)
        return self.callback.numCollisionPairs()


class Fcl:
    def __init__(self, steps: Steps):
        import fcl

        self.steps = steps
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.objects = [
            fcl.CollisionObject(fcl.Box(*(2 * half)), fcl.Transform(p))
            for p, half in zip(steps.middles, steps.half_lengths)
        ]
        self.manager.registerObjects(self.objects)
        self.manager.setup()

    def move(self) -> None:
        for k, p in zip(self.steps.moving.tolist(), self.steps.places()):
            self.objects[k].setTranslation(p)

    def pairs(self) -> int:
        count = 0

        def callback(_a, _b, _data) -> bool:
            nonlocal count
            count += 1
            return False

        self.manager.update()
        self.manager.collide(None, callback)
        return count


class Bullet:
    def __init__(self, steps: Steps):
        import pybullet

        if len(steps.middles) > 10_000:
            raise ImportError("pybullet: 10,000 bodies at most")
        self.steps, self.bullet, self.client = steps, pybullet, pybullet.connect(pybullet.DIRECT)
        self.bodies = []
        for p, half in zip(steps.middles.tolist(), steps.half_lengths.tolist()):
            shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=half, physicsClientId=self.client)
            body = pybullet.createMultiBody(1.0, shape, basePosition=p, physicsClientId=self.client)
            pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=self.client)
            self.bodies.append(body)
        self._places = steps.middles[steps.moving].tolist()

    def _reset(self, places: list) -> float:
        """CPU seconds of telling where bodies are."""
        started = time.process_time()
        for k, p in zip(self.steps.moving.tolist(), places):
            self.bullet.resetBasePositionAndOrientation(self.bodies[k], p, (0, 0, 0, 1), physicsClientId=self.client)
        return time.process_time() - started

    def move(self) -> None:
        places = self.steps.places().tolist()
        self._reset(self._places)  # into the caches
        staying = self._reset(self._places)
        self._updating, self._places = max(0.0, self._reset(places) - staying), places

    def pairs(self) -> None:
        self.bullet.performCollisionDetection(physicsClientId=self.client)

    def seconds(self, answering: float) -> float:
        return answering + self._updating


class BulletBoxes(Bullet):
    def seconds(self, answering: float) -> float:
        return answering


class MuJoCo:
    def __init__(self, steps: Steps):
        import mujoco

        if len(steps.middles) > 1000:
            raise ImportError("MuJoCo: 1,000 free bodies at most")
        self.steps, self.mujoco = steps, mujoco
        spec = mujoco.MjSpec()
        for p, half in zip(steps.middles, steps.half_lengths):
            body = spec.worldbody.add_body(pos=p)
            body.add_freejoint()
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, mass=0.0)
            body.mass, body.inertia, body.explicitinertial = 1.0, (1.0, 1.0, 1.0), True
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.set_mjcb_time(time.process_time)
        self.timer = int(mujoco.mjtTimer.mjTIMER_COL_BROAD)
        mujoco.mj_forward(self.model, self.data)

    def move(self) -> None:
        q = self.data.qpos.reshape(-1, 7)
        q[self.steps.moving, :3] = self.steps.places()
        self.mujoco.mj_kinematics(self.model, self.data)
        self.mujoco.mj_comPos(self.model, self.data)

    def pairs(self) -> None:
        self.data.timer[self.timer].duration = 0.0
        self.mujoco.mj_collision(self.model, self.data)

    def seconds(self, _answering: float) -> float:
        return float(self.data.timer[self.timer].duration)


ENGINES = {
    "collide": Ours, "tree": Tree, "tree before": TreeBefore, "coal": Coal, "python-fcl": Fcl, "Bullet": Bullet,
    "Bullet, boxes": BulletBoxes, "MuJoCo": MuJoCo,
}  # fmt: skip
#: Whose pairs are counted and compared.
COUNTED = ("collide", "tree", "tree before", "coal", "python-fcl")


def engines(steps: Steps) -> dict:
    made = {}
    for name, engine in ENGINES.items():
        try:
            made[name] = engine(steps)
        except ImportError as error:
            print(f"{name} is left out: {error}")
    return made


def check(made: dict, what: str) -> int:
    """Engines that tell their pairs find as many. Raises SystemExit."""
    counts = {}
    for name in COUNTED:
        if name in made:
            made[name].move()
            pairs = made[name].pairs()
            counts[name] = pairs if isinstance(pairs, int) else len(pairs)
    # Boxes of a World are rounded outwards by an ulp or so: pairs that touch within that may differ.
    if max(counts.values()) - min(counts.values()) > 1e-5 * max(counts.values()):
        raise SystemExit(f"{what}: {counts}")
    return counts["collide"]


def timed(engine) -> float:
    """CPU seconds of one answer."""
    engine.move()
    started = time.process_time()
    engine.pairs()
    seconds = time.process_time() - started
    return engine.seconds(seconds) if hasattr(engine, "seconds") else seconds


def measure(n: int, kind: str) -> list[dict]:
    steps = Steps(kind, n)
    made = engines(steps)
    n_pairs = check(made, f"{n} bodies, {kind}")
    times: dict[str, list[float]] = {name: [] for name in made}
    started = time.perf_counter()
    for number in range(TURNS):
        for name, engine in made.items():
            steps.step_number = 2 * number
            engine.move()
            engine.pairs()  # brings what the engine works on into the caches
            steps.step_number += 1
            times[name].append(timed(engine) * 1e3)
        if number >= 4 and time.perf_counter() - started > SECONDS:
            break
    ours = statistics.median(times["collide"][2:])
    return [
        {
            "bodies": n, "layout": kind, "pairs": n_pairs, "engine": name,
            "median_ms": round(statistics.median(values[2:]), 4), "min": round(min(values[2:]), 4),
            "max": round(max(values[2:]), 4), "turns": len(values) - 2,
            "ratio": round(statistics.median(values[2:]) / ours, 2),
        }
        for name, values in times.items()
    ]  # fmt: skip


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--layouts", nargs="+", default=LAYOUTS, choices=LAYOUTS)
    parser.add_argument("--no-csv", action="store_true", help="keep the results as they are")
    options = parser.parse_args()
    rows = []
    for kind in options.layouts:
        for n in options.sizes:
            for row in measure(n, kind):
                rows.append(row)
                print(
                    f"{row['bodies']:>7} {kind:<10} {row['pairs']:>7} pairs  {row['engine']:<13} "
                    f"{row['median_ms']:>10.3f} ms   × {row['ratio']}", flush=True,
                )  # fmt: skip
    if not options.no_csv:
        write("broadphase", rows, machine())
    return 0


if __name__ == "__main__":
    sys.exit(main())
