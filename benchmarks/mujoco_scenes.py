"""Pits, a terrain and robots as MuJoCo's models, for `mujoco_steps.py`, and the states that contestants begin from."""

from __future__ import annotations

import contextlib
import re
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from collide.errors import SceneError
from collide.scenes.loaders.resources import find

MIXED = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
SCENES = {"mixed": MIXED, "boxes and hulls": ("box", "mesh")}
TERRAIN, ON_TERRAIN = "terrain", " on terrain"
FILES = {
    "a1": "a1_description/urdf/a1.urdf",
    "g1": "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "go2": "go2_description/urdf/go2.urdf",
}
ROBOTS = [*FILES, *(name + ON_TERRAIN for name in FILES)]
TIMESTEP = 0.004
_SETTLING, _DAMPED = 400, 0.9
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


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
    file = find(f"package://example-robot-data/robots/{FILES[name.removesuffix(ON_TERRAIN)]}", Path(__file__))
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
    if name in ROBOTS:
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
    state = np.zeros(mujoco.mj_stateSize(model, STATE))
    mujoco.mj_getState(model, data, state, STATE)
    return state
