"""Steps of MuJoCo with its own contacts, with collide's, and culled by collide: pits, a terrain, and robots.

    python benchmarks/mujoco_steps.py [--quick] [--bodies 100 1000 5000] [--scenes NAME …] [--no-csv]

Pits hold spheres, capsules, ellipsoids, cylinders, boxes and hulls in equal numbers, or boxes and hulls alone, which
fall from a grid. The terrain is a rough height field of 9 cm cells, over which bodies of all kinds fall, 22 cm apart.
"Falling" are the steps after the first tenth of a second, "resting" those after four hundred steps that are damped,
until next to nothing moves. Robots are URDF models of example-robot-data, dropped on a floor, or on such a terrain.

All contestants step from the same saved state, in turns; a row holds the median, the least and the largest of their
rounds. "step" is processor time, "collision" what MuJoCo's own timer says of the collision within these steps. Pits are
solved by conjugate gradients: Newton, the default, takes a second a step where a thousand bodies lie on each other,
and collisions are no part of that. Checked: culled steps have the bits of MuJoCo's own.

Then what becomes of bodies at rest in a second: how much energy is gained or lost, the greatest speed, and the deepest
contact.
"""

from __future__ import annotations

import argparse
import contextlib
import re
import statistics
import time
from functools import cache
from pathlib import Path

import mujoco
import numpy as np
from convex import write
from startup import machine

from collide.adapters.hosts.mujoco import install
from collide.errors import SceneError
from collide.scenes.loaders.resources import find

MIXED = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
SCENES = {"mixed": MIXED, "boxes and hulls": ("box", "mesh")}
TERRAIN, ON_TERRAIN = "terrain", " on terrain"
CONTESTANTS = (None, "contacts", "cull")
ROBOTS = {
    "a1": "a1_description/urdf/a1.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "go2": "go2_description/urdf/go2.urdf",
}
TIMESTEP = 0.004
#: Rounds, and steps of each, by the number of bodies.
ROUNDS = {1: (9, 200), 100: (9, 20), 1000: (7, 8), 5000: (5, 4)}
_SETTLING, _DAMPED = 400, 0.9
_TIMER = int(mujoco.mjtTimer.mjTIMER_POS_COLLISION)
_STATE = mujoco.mjtState.mjSTATE_INTEGRATION


def form_of(kind: str, random: np.random.Generator) -> str:
    """A geom of 5 to 7 cm."""
    size = " ".join(f"{length:.4f}" for length in random.uniform(0.05, 0.07, 3))
    if kind in ("capsule", "cylinder"):
        size = "0.05 0.04"
    return 'type="mesh" mesh="hull"' if kind == "mesh" else f'type="{kind}" size="{size}"'


def hull_asset(random: np.random.Generator) -> str:
    points = random.normal(size=(12, 3))
    points *= 0.08 / np.linalg.norm(points, axis=1)[:, None]
    vertices = " ".join(f"{v:.6f}" for v in points.ravel())
    return f'<mesh name="hull" vertex="{vertices}"/>'


def elevation(n: int, random: np.random.Generator) -> np.ndarray:
    """(n, n) heights of hills of a metre and a half, and a hundredth of noise, from 0 to 1."""
    x = np.linspace(0.0, 0.09 * (n - 1), n)
    hills = np.sin(4.2 * x)[:, None] * np.cos(3.9 * x)[None, :]
    heights = 0.1 * hills + 0.02 * random.random((n, n))
    return (heights - heights.min()) / np.ptp(heights)


def field_asset(n: int, random: np.random.Generator) -> str:
    """A height field of n x n points, 9 cm apart, and 0.2 m from its lowest to its highest."""
    numbers = " ".join(f"{v:.5f}" for v in elevation(n, random).ravel())
    half = 0.045 * (n - 1)
    return f'<hfield name="hills" nrow="{n}" ncol="{n}" size="{half} {half} 0.2 0.1" elevation="{numbers}"/>'


def terrain(n: int, seed: int = 0) -> mujoco.MjModel:
    """Bodies of all kinds a hand above hills, a hand apart."""
    random = np.random.default_rng(seed)
    side = int(np.ceil(np.sqrt(n)))
    parts = ['<geom type="hfield" hfield="hills"/>']
    for k in range(n):
        x, y = 0.22 * (np.array([k % side, k // side]) - (side - 1) / 2) + random.uniform(-0.02, 0.02, 2)
        q = " ".join(f"{v:.4f}" for v in random.normal(size=4))
        form = form_of(MIXED[k % len(MIXED)], random)
        parts.append(f'<body pos="{x:.4f} {y:.4f} 0.3" quat="{q}"><freejoint/><geom {form}/></body>')
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{TIMESTEP}" solver="CG"/><size memory="1G"/>'
        f"<asset>{hull_asset(random)}{field_asset(round(0.22 * side / 0.09) + 12, random)}</asset>"
        f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
    )


def pit(n: int, kinds: tuple[str, ...], seed: int = 0) -> mujoco.MjModel:
    """Bodies of 5 to 7 cm in eight layers of a grid above a floor within four walls."""
    random = np.random.default_rng(seed)
    asset = hull_asset(random)
    side = max(3, int(np.ceil(np.sqrt(n / 8))))
    wall = 0.07 * side + 0.05
    parts = ['<geom type="plane" size="9 9 1"/>']
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        parts.append(f'<geom type="plane" size="9 9 1" pos="{wall * x} {wall * y} 0" zaxis="{-x} {-y} 0"/>')
    for k in range(n):
        place = 0.14 * (np.array([k % side, k // side % side, k // side**2]) - [(side - 1) / 2, (side - 1) / 2, -0.6])
        form = form_of(kinds[k % len(kinds)], random)
        q = " ".join(f"{v:.4f}" for v in random.normal(size=4))
        p = " ".join(f"{v:.4f}" for v in place + random.uniform(-0.005, 0.005, 3))
        parts.append(f'<body pos="{p}" quat="{q}"><freejoint/><geom {form}/></body>')
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{TIMESTEP}" solver="CG"/><size memory="1G"/>'
        f"<asset>{asset}</asset><worldbody>{''.join(parts)}</worldbody></mujoco>"
    )


def robot(name: str) -> mujoco.MjModel:
    """A robot on a floor, or on hills, free to fall. Raises SceneError where example-robot-data is not installed."""
    file = find(f"package://example-robot-data/robots/{ROBOTS[name.removesuffix(ON_TERRAIN)]}", Path(__file__))
    text = file.read_text(encoding="utf-8")
    assets = {}
    for mesh in set(re.findall(r'filename="([^"]+)"', text)):
        with contextlib.suppress(SceneError):  # of what is only drawn some are missing
            place = find(mesh, file)
            assets[place.name] = place.read_bytes()
    end = text.index(">", text.index("<robot")) + 1
    compiler = '<compiler strippath="true" balanceinertia="true" discardvisual="true" fusestatic="false"/>'
    spec = mujoco.MjSpec.from_string(f"{text[:end]}<mujoco>{compiler}</mujoco>{text[end:]}", assets=assets)
    spec.worldbody.first_body().add_freejoint()
    if name.endswith(ON_TERRAIN):
        heights = elevation(33, np.random.default_rng(0))
        spec.add_hfield(name="hills", nrow=33, ncol=33, size=[1.44, 1.44, 0.2, 0.1], userdata=heights.ravel())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hills")
    else:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[9, 9, 1])
    spec.option.timestep = TIMESTEP / 2
    return spec.compile()


def lowest(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """How low the robot's geoms reach, at most [m]."""
    moving = model.geom_bodyid > 0
    return float((data.geom_xpos[moving, 2] - model.geom_rbound[moving]).min())


@cache
def scene(name: str, n: int) -> mujoco.MjModel:
    if name == TERRAIN:
        return terrain(n)
    return pit(n, SCENES[name]) if name in SCENES else robot(name)


@cache
def saved_state(name: str, n: int, when: str) -> np.ndarray:
    """Where all contestants begin."""
    model = scene(name, n)
    data = mujoco.MjData(model)
    if name.removesuffix(ON_TERRAIN) in ROBOTS:
        mujoco.mj_kinematics(model, data)
        data.qpos[2] += 0.05 - lowest(model, data) + (0.2 if model.nhfield else 0.0)
    solver, iterations = model.opt.solver, model.opt.iterations
    if when == "falling":
        for _ in range(round(0.1 / model.opt.timestep)):
            mujoco.mj_step(model, data)
    else:
        model.opt.solver, model.opt.iterations = mujoco.mjtSolver.mjSOL_CG, 6
        for _ in range(_SETTLING):
            mujoco.mj_step(model, data)
            data.qvel *= _DAMPED
        model.opt.solver, model.opt.iterations = solver, iterations
        for _ in range(10 if n < 1000 else 2):
            mujoco.mj_step(model, data)
    state = np.zeros(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    return state


def timed(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray, mode: str | None, n_steps: int) -> dict:
    """Seconds of a step and of its collision, and what came of the steps."""
    with install(model, mode) if mode else contextlib.nullcontext():
        mujoco.mj_step(model, data)  # memory, and directions that parted bodies
        mujoco.mj_setState(model, data, state, _STATE)
        before = data.timer[_TIMER].duration
        start = time.thread_time()
        for _ in range(n_steps):
            mujoco.mj_step(model, data)
        step = (time.thread_time() - start) / n_steps
        collision = (data.timer[_TIMER].duration - before) / n_steps
    return {"step": step, "collision": collision, "contacts": data.ncon, "qpos": data.qpos.copy()}


def measured(name: str, n: int, when: str, is_quick: bool) -> list[dict]:
    model, state = scene(name, n), saved_state(name, n, when)
    data = mujoco.MjData(model)
    rounds, n_steps = (3, 5 if n > 1 else 200) if is_quick else ROUNDS.get(n, (9, 20))
    runs: dict = {mode: [] for mode in CONTESTANTS}
    for _ in range(rounds):
        for mode in CONTESTANTS:
            runs[mode].append(timed(model, data, state, mode, n_steps))
    assert np.array_equal(runs[None][0]["qpos"], runs["cull"][0]["qpos"]), "culled steps are not MuJoCo's"
    rows = []
    for what in ("step", "collision"):
        of_mujoco = statistics.median(run[what] for run in runs[None])
        for mode in CONTESTANTS:
            times = sorted(run[what] for run in runs[mode])
            rows.append({
                "scene": name, "bodies": n, "when": when, "what": what, "mode": mode or "MuJoCo alone",
                "contacts": runs[mode][0]["contacts"], "median_ms": 1e3 * statistics.median(times),
                "least_ms": 1e3 * times[0], "largest_ms": 1e3 * times[-1],
                "ratio": statistics.median(times) / of_mujoco,
            })  # fmt: skip
    return rows


def rest(name: str, n: int, mode: str | None, seconds: float = 1.0) -> tuple[float, float, float]:
    """(energy gained per kg [J/kg], greatest speed at the end [m/s, rad/s], depth of the deepest contact [mm])."""
    model, state = scene(name, n), saved_state(name, n, "resting")
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, _STATE)
    flags, model.opt.enableflags = model.opt.enableflags, mujoco.mjtEnableBit.mjENBL_ENERGY
    deepest = 0.0
    with install(model, mode) if mode else contextlib.nullcontext():
        mujoco.mj_forward(model, data)
        before = data.energy.sum()
        for _ in range(round(seconds / model.opt.timestep)):
            mujoco.mj_step(model, data)
            deepest = max(deepest, -min(data.contact.dist, default=0.0))
        mujoco.mj_forward(model, data)
    model.opt.enableflags = flags
    return (data.energy.sum() - before) / model.body_mass.sum(), np.abs(data.qvel).max(), 1e3 * deepest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bodies", type=int, nargs="+", default=[100, 1000, 5000])
    parser.add_argument("--scenes", nargs="+", help="these alone; robots are named, too")
    parser.add_argument("--quick", action="store_true", help="100 bodies, one robot and few rounds; writes nothing")
    parser.add_argument("--no-csv", action="store_true")
    arguments = parser.parse_args()
    asked = [(name, n) for name in SCENES for n in ([100] if arguments.quick else arguments.bodies)]
    asked += [(TERRAIN, n) for n in ([100] if arguments.quick else arguments.bodies)]
    robots = [*ROBOTS, *(name + ON_TERRAIN for name in ROBOTS)]
    asked += [(name, 1) for name in (robots[:1] if arguments.quick and not arguments.scenes else robots)]
    asked = [(name, n) for name, n in asked if not arguments.scenes or name in arguments.scenes]
    rows = []
    print(f"MuJoCo {mujoco.__version__}")
    print(f"{'scene':16}{'bodies':>7} {'when':8}{'what':10}{'mode':>13}{'contacts':>9}{'ms':>9}{'ratio':>7}")
    for name, n in asked:
        for when in ("falling", "resting"):
            for row in measured(name, n, when, arguments.quick):
                rows.append(row)
                print(
                    f"{row['scene']:16}{row['bodies']:7} {row['when']:8}{row['what']:10}{row['mode']:>13}"
                    f"{row['contacts']:9}{row['median_ms']:9.3f}{row['ratio']:7.2f}", flush=True,
                )  # fmt: skip
    print("a second at rest:  energy gained [J/kg], greatest speed [m/s, rad/s], deepest contact [mm]")
    for name, n in asked:
        for mode in (None, "contacts") if n <= 100 else ():
            energy, speed, depth = rest(name, n, mode)
            print(f"{name:16}{n:7} {mode or 'MuJoCo alone':>13}{energy:12.2e}{speed:12.2e}{depth:9.3f}", flush=True)
    if not arguments.quick and not arguments.no_csv:
        print(f"written: {write('mujoco-steps', rows, machine() | {'mujoco': mujoco.__version__}).name}")


if __name__ == "__main__":
    main()
