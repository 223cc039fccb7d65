"""Look at a World while it moves, or at a scene made of shapes: a page on this machine that follows it."""

import sys
import time

import numpy as np

import collide
import collide.adapters
from collide.scenes import generate

SHAPES = (
    collide.Sphere(0.1), collide.Box((0.2, 0.15, 0.1)), collide.Capsule(0.05, 0.2), collide.Cylinder(0.08, 0.15),
    collide.Ellipsoid((0.15, 0.1, 0.06)), collide.Cone(0.1, 0.2),
)


def dance(t: float) -> collide.World:
    """Twelve bodies over a table, at a time [s]."""
    world = collide.World()
    world.add(collide.Box((2, 1.4, 0.04)), collide.pose((0, 0, -0.02)), name="table", static=True)
    for k in range(12):
        world.add(SHAPES[k % 6], name=f"{type(SHAPES[k % 6]).__name__.lower()} {k}")
    move(world, t)
    return world


def move(world: collide.World, t: float) -> None:
    for k in range(12):
        a = (0.5 * t + 0.7 * k) % (2 * np.pi)
        xyz = 0.7 * np.cos(a), 0.45 * np.sin(1.3 * a), 0.25 + 0.2 * np.sin(2 * a + k)
        world.set_pose(k + 1, collide.pose(xyz, rpy=(a, 0.5 * a, 0)))


if __name__ == "__main__":  # python 21_look_at_a_world.py [clutter, stack, accordions ...] [--stay]
    name = next((word for word in sys.argv[1:] if not word.startswith("-")), None)
    stays = "--stay" in sys.argv
    world = generate(name).world() if name else dance(0.0)
    with collide.adapters.view(world, clearance=0.03, title=name or "dance", browser=stays) as viewer:
        print(f"{len(world)} bodies at {viewer.url}, {'until Ctrl-C' if stays else 'for a moment'}")
        for k in range(10**9 if stays else 30):
            if not name:
                move(world, k / 60)
            viewer.update(f"t = {k / 60:.1f} s")
            time.sleep(1 / 60)
    print("the page is told that it is no longer live")
