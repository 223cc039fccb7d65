"""Steps of MuJoCo with its own contacts, with collide's, and culled by collide: pits, a terrain, and robots.

    python benchmarks/mujoco_steps.py --quick
    python benchmarks/mujoco_steps.py --only bodies=100 --only scene=mixed

Pits hold spheres, capsules, ellipsoids, cylinders, boxes and hulls in equal numbers, or boxes and hulls alone, which
fall from a grid. The terrain is a rough height field of 9 cm cells, over which bodies of all kinds fall, 22 cm apart.
"Falling" are the steps after the first tenth of a second, "resting" those after four hundred steps that are damped,
until next to nothing moves. Robots are URDF models of example-robot-data, dropped on a floor, or on such a terrain.

All contestants step from the same saved state; ms. "step" is processor time, "collision" what MuJoCo's own timer says
of the collision within these steps. Pits are solved by conjugate gradients: Newton, the default, takes a second a step
where a thousand bodies lie on each other, and collisions are no part of that. Checked: culled steps have the bits of
MuJoCo's own. Then what becomes of bodies at rest in a second: how much energy is gained or lost [J/kg], the greatest
speed [m/s, rad/s], and the deepest contact [mm].
"""

from __future__ import annotations

import time
from contextlib import nullcontext

import mujoco
import numpy as np
from mujoco_scenes import ROBOTS, SCENES, STATE, TERRAIN, saved_state, scene

from collide.adapters.bench.claims import Claim, Options, Race, check, grid, main
from collide.adapters.bench.turns import Seconds
from collide.adapters.hosts.mujoco import install

CONTESTANTS = {"MuJoCo alone": None, "contacts": "contacts", "cull": "cull"}
_TIMER = int(mujoco.mjtTimer.mjTIMER_POS_COLLISION)


def stepped(model, data, state: np.ndarray, mode: str | None, n_steps: int, what: str) -> Seconds:
    """Of all steps, or of their collisions."""
    with install(model, mode) if mode else nullcontext():
        mujoco.mj_step(model, data)  # memory, and directions that parted bodies
        mujoco.mj_setState(model, data, state, STATE)
        before, start = data.timer[_TIMER].duration, time.thread_time()
        for _ in range(n_steps):
            mujoco.mj_step(model, data)
        spent = time.thread_time() - start
    return Seconds(spent if what == "step" else data.timer[_TIMER].duration - before)


def measure(options: Options, scene_name: str, bodies: int, when: str, what: str) -> Race:
    model, state = scene(scene_name, bodies), saved_state(scene_name, bodies, when)
    n_steps = (5 if bodies > 1 else 200) if options.quick else {1: 200, 1000: 8, 5000: 4}.get(bodies, 20)
    data, ends, beside = mujoco.MjData(model), {}, {}
    for name, mode in CONTESTANTS.items():
        stepped(model, data, state, mode, n_steps, what)
        ends[name], beside[name] = data.qpos.copy(), {"contacts": int(data.ncon)}
    check(np.array_equal(ends["MuJoCo alone"], ends["cull"]), f"culled steps of {scene_name} are not MuJoCo's")
    return Race({
        name: lambda mode=mode: stepped(model, data, state, mode, n_steps, what) for name, mode in CONTESTANTS.items()
    }, n_steps, beside=beside)


def rest(options: Options, scene_name: str, bodies: int, mode: str) -> list[dict]:
    """A second at rest."""
    model, state = scene(scene_name, bodies), saved_state(scene_name, bodies, "resting")
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, STATE)
    flags, model.opt.enableflags, deepest = model.opt.enableflags, mujoco.mjtEnableBit.mjENBL_ENERGY, 0.0
    with install(model, CONTESTANTS[mode]) if CONTESTANTS[mode] else nullcontext():
        mujoco.mj_forward(model, data)
        before = data.energy.sum()
        for _ in range(round(1.0 / model.opt.timestep)):
            mujoco.mj_step(model, data)
            deepest = max(deepest, -min(data.contact.dist, default=0.0))
        mujoco.mj_forward(model, data)
    model.opt.enableflags = flags
    gained = float((data.energy.sum() - before) / model.body_mass.sum())
    return [{"energy_gained": gained, "greatest_speed": float(np.abs(data.qvel).max()), "deepest_mm": 1e3 * deepest}]


def scenes(options: Options, largest: int = 5000):
    sizes = [n for n in ((100,) if options.quick else (100, 1000, 5000)) if n <= largest]
    yield from grid(scene_name=(*SCENES, TERRAIN), bodies=sizes)
    yield from grid(scene_name=ROBOTS[: 1 if options.quick else None], bodies=[1])


def cases(options: Options):
    for case in scenes(options):
        yield from grid(**{key: [value] for key, value in case.items()}, when=("falling", "resting"),
                        what=("step", "collision"))


def rest_cases(options: Options):
    return (case | {"mode": mode} for case in scenes(options, 100) for mode in ("MuJoCo alone", "contacts"))


CLAIMS = [
    Claim("steps", "ms a step", cases, measure, unit="ms", file="mujoco-steps"),
    Claim("rest", "a second at rest", rest_cases, rest, file="mujoco-rest", everywhere=True),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
