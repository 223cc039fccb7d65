"""The broadphase alone: which pairs of boxes meet, for 10² to 10⁵ bodies, beside coal's, FCL's, Bullet's and MuJoCo's.

    python benchmarks/broadphase.py                  # some minutes
    python benchmarks/broadphase.py --only bodies=100,1000 --only layout=uniform

Bodies are boxes. Layouts: "uniform" in a cube; "clustered" in three heaps; "a few huge", five of them as wide as a
tenth to a third of the cube; "all sizes", from a tenth of a millimetre to a third of a metre; "few move": uniform, and
one body in a hundred moves; "far": uniform, and all move by a body's length or so. In the others all move, by some
centimetres along each axis, between turns: a body is within three centimetres of where it began.

What is timed is what an engine does after it was told new poses, which is not, but for Bullet: boxes, trees, and all
pairs whose boxes meet; ms of the processor.

    collide       `World`: tables of poses, boxes, tree, candidate pairs in numpy
    tree          the graded tree, boxes given; pairs near each other are kept from turn to turn where few leave their
                  leaves' boxes
    coal          `DynamicAABBTreeCollisionManager.update` and `collide` with `CollisionCallBackCollect`, in C++
    fcl           `update` and `collide`: its callback is a Python function, called once a pair
    Bullet        `performCollisionDetection`, and what `resetBasePositionAndOrientation` takes for new places more than
                  for the places where bodies are: it brings the tree up to date and looks for pairs
                  (`getOverlappingObjects` finds a body at its new place at once). Every pair is refused by its mask
    Bullet boxes  `performCollisionDetection` alone: boxes of bodies, about which nothing remains to be done
    MuJoCo        the timer mjTIMER_COL_BROAD of `mj_collision`, free bodies, up to 1,000

Checked first: collide, its tree, coal and python-fcl find as many pairs.
"""

from __future__ import annotations

import numpy as np
from broadphase_peers import PEERS, Engine

import collide
from collide.adapters.bench.claims import Claim, Options, Race, check, grid, installed, main
from collide.broadphase.box_tree import BoxTree

LAYOUTS = ("uniform", "clustered", "a few huge", "all sizes", "few move", "far")


class Ours(Engine):
    def make(self) -> None:
        self.world = collide.World()
        for p, half in zip(self.middles, self.half_lengths):
            self.world.add(collide.Box(2 * half), collide.pose(p))

    def moved(self, places: np.ndarray) -> None:
        X = np.tile(np.eye(4), (len(places), 1, 1))
        X[:, :3, 3] = places
        self.world.set_poses(self.moving, X)

    def pairs(self) -> int:
        return len(self.world._pack().candidates(0.0))


class Tree(Engine):
    def make(self) -> None:
        self.tree = BoxTree(np.hstack([self.middles - self.half_lengths, self.middles + self.half_lengths]))

    def moved(self, places: np.ndarray) -> None:
        half = self.half_lengths[self.moving]
        self.boxes = np.hstack([places - half, places + half])

    def pairs(self) -> int:
        self.tree.move(self.moving, self.boxes)
        return len(self.tree.pairs(0.0))


def measure(options: Options, layout: str, bodies: int) -> Race:
    present = installed(**{name: package for name, (_, package, _) in PEERS.items()})
    engines: dict[str, type[Engine]] = {"collide": Ours, "tree": Tree}
    engines |= {name: PEERS[name][0] for name in present if bodies <= PEERS[name][2]}
    made = {name: engine(layout, bodies) for name, engine in engines.items()}
    counts = {}
    for name in [name for name in ("collide", "tree", "coal", "fcl") if name in made]:
        made[name].moved(made[name].places())
        counts[name] = made[name].pairs()
    # Boxes of a World are rounded outwards by an ulp or so: pairs that touch within that may differ.
    check(max(counts.values()) - min(counts.values()) <= 1e-5 * max(counts.values()), f"{bodies} {layout}: {counts}")
    tasks = {name: engine.answer for name, engine in made.items()}

    def close() -> None:
        for engine in made.values():
            engine.close()

    return Race(tasks, columns={"pairs": counts["collide"]}, close=close)


def cases(options: Options):
    return grid(layout=LAYOUTS, bodies=(100, 1000) if options.quick else (100, 1000, 10_000, 100_000))


CLAIMS = [Claim("broadphase", "pairs of boxes that meet, after steps: ms", cases, measure, unit="ms", turns=40)]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
