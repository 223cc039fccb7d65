"""Random MuJoCo models as MJCF text, and what MuJoCo itself says of them: poses, tested pairs, contacts.

Everything that can collide has a name, so that geoms are found again by what a robot says of their source.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

TETRAHEDRON = "0 0 0 .25 0 0 0 .2 0 0 0 .3 .2 .2 .2"


def numbers(values) -> str:
    return " ".join(repr(float(value)) for value in values)


class Text(NamedTuple):
    """xml : of a model.   followers : joint → (followed, a0, a1) of its equality constraint."""

    xml: str
    followers: dict[str, tuple[str, float, float]]


def random_mjcf(rng, n_bodies: int = 9) -> Text:
    """A model of several trees: joints of every kind, several a body, anchors off the origin, refs, geoms of every
    kind with bits of their own, exclusions, pairs by name, keyframes."""
    children: dict[int, list[int]] = {0: []}
    depth = {0: 0}
    for body in range(1, n_bodies + 1):
        parent = int(rng.choice([k for k in children if depth[k] < 4]))
        children[parent].append(body)
        children[body], depth[body] = [], depth[parent] + 1
    scalars: list[str] = []
    geoms: list[str] = []
    bodies = "".join(_body(rng, child, children, scalars, geoms, top=True) for child in children[0])
    around = '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -.6"/>' + "".join(
        _geom(rng, f"wall{k}", geoms, spread=1.0) for k in range(3)
    )
    equality, followers = "", {}
    if len(scalars) >= 2 and rng.random() < 0.7:
        a, b = rng.permutation(scalars)[:2].tolist()
        a0, a1 = rng.uniform(-0.3, 0.3), rng.uniform(-2, 2)
        followers[a] = b, a0, a1
        equality = f'<equality><joint joint1="{a}" joint2="{b}" polycoef="{numbers([a0, a1, 0, 0, 0])}"/></equality>'
    excluded = {tuple(sorted(rng.choice(n_bodies, 2, replace=False) + 1)) for _ in range(2)}
    contact = "".join(f'<exclude body1="b{a}" body2="b{b}"/>' for a, b in sorted(excluded))
    first, second = rng.choice(geoms, 2, replace=False).tolist()
    contact += f'<pair geom1="{first}" geom2="{second}"/>'
    flag = '<option><flag filterparent="disable"/></option>' if rng.random() < 0.2 else ""
    xml = (
        f'<mujoco model="random"><compiler angle="radian"/><default><joint armature=".1"/></default>{flag}'
        f'<asset><mesh name="tetra" vertex="{TETRAHEDRON}" '
        f'scale="1 {rng.choice([-1, 1])} 1"/></asset><worldbody>{around}{bodies}</worldbody>{equality}'
        f"<contact>{contact}</contact></mujoco>"
    )
    return Text(xml, followers)


def _pose(rng, spread: float) -> str:
    """Some of them at right angles, which a file has mostly, some almost the frame that they stand in."""
    quat = (rng.normal(size=4), rng.choice([-1.0, 0.5, 1.0], 4), (1, 0, 4e-7, 0))[
        rng.choice(3, p=[0.5, 0.3, 0.2])
    ]
    return f'pos="{numbers(rng.uniform(-spread, spread, 3))}" quat="{numbers(quat)}"'


def _geom(rng, name: str, geoms: list[str], spread: float = 0.2) -> str:
    kind = str(rng.choice(["sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh"]))
    size = numbers(rng.uniform(0.05, 0.15, {"sphere": 1, "capsule": 2, "cylinder": 2, "mesh": 0}.get(kind, 3)))
    what = 'mesh="tetra"' if kind == "mesh" else f'size="{size}"'
    bits = rng.choice(4, 2, p=[0.1, 0.6, 0.2, 0.1])
    geoms.append(name)
    where = _pose(rng, spread)
    return f'<geom name="{name}" type="{kind}" {what} {where} contype="{bits[0]}" conaffinity="{bits[1]}"/>'


def _body(rng, body: int, children: dict[int, list[int]], scalars: list[str], geoms: list[str], top=False) -> str:
    kind = rng.choice(["none", "free", "ball", "chain"], p=[0.15, 0.2, 0.1, 0.55] if top else [0.2, 0.0, 0.2, 0.6])
    joints = ""
    if kind == "free":
        joints = f'<joint name="j{body}" type="free"/>'
    elif kind == "ball":
        joints = f'<joint name="j{body}" type="ball" pos="{numbers(rng.uniform(-0.1, 0.1, 3))}"/>'
    elif kind == "chain":
        for k in range(rng.integers(1, 4)):
            name = f"j{body}_{k}"
            scalars.append(name)
            joints += _scalar_joint(rng, name)
    mocap = ' mocap="true"' if top and kind == "none" and rng.random() < 0.5 else ""
    inside = "".join(_geom(rng, f"g{body}_{k}", geoms) for k in range(rng.integers(1, 4)))
    inside += "".join(_body(rng, child, children, scalars, geoms) for child in children[body])
    # Massless bodies that move are refused: every one carries a ghost that does not collide.
    ghost = f'<geom name="ghost{body}" size=".05" contype="0" conaffinity="0"/>'
    return f'<body name="b{body}" {_pose(rng, 0.4)}{mocap}>{joints}{ghost}{inside}</body>'


def _scalar_joint(rng, name: str) -> str:
    slides = rng.random() < 0.3
    axis = rng.normal(size=3) if rng.random() < 0.5 else np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
    anchor = rng.uniform(-0.1, 0.1, 3) if rng.random() < 0.5 else np.zeros(3)
    ref = rng.uniform(-0.5, 0.5) if rng.random() < 0.4 else 0.0
    limits = f'range="{numbers(np.sort(rng.uniform(-0.4 if slides else -3, 0.4 if slides else 3, 2)))}"'
    return (
        f'<joint name="{name}" type="{"slide" if slides else "hinge"}" axis="{numbers(axis)}" pos="{numbers(anchor)}" '
        f'ref="{ref!r}" {limits if rng.random() < 0.7 else ""}/>'
    )


# --- what MuJoCo says -----------------------------------------------------------------------------


def quaternion_of(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """(w, x, y, z) of turns about the own axes z, y, x in this order, by the product of three quaternions."""
    out = np.array([1.0, 0.0, 0.0, 0.0])
    for coordinate, angle in ((2, yaw), (1, pitch), (0, roll)):
        turn = np.zeros(4)
        turn[0], turn[1 + coordinate] = math.cos(angle / 2), math.sin(angle / 2)
        out = hamilton(out, turn)
    return out


def hamilton(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    w = p[0] * q[0] - p[1:] @ q[1:]
    return np.array([w, *(p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:]))])


def rotated(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    conjugate = q * [1, -1, -1, -1]
    return hamilton(hamilton(q, np.array([0.0, *v])), conjugate)[1:]


def qpos_of(model, values: dict[str, float], followers=None) -> np.ndarray:
    """MuJoCo's ``qpos`` for values by column: hinges and slides as they are, constraints by their polynomial, free
    bodies from where they are at ``qpos0``. Of models whose joints have names."""
    qpos = np.array(model.qpos0)
    for k in range(model.njnt):
        joint = model.joint(k)
        at = int(model.jnt_qposadr[k])
        if joint.type[0] == 0:
            shift = np.array([values[f"{joint.name}/{word}"] for word in ("x", "y", "z")])
            start, turn = qpos[at : at + 3].copy(), qpos[at + 3 : at + 7] / np.linalg.norm(qpos[at + 3 : at + 7])
            qpos[at : at + 3] = start + rotated(turn, shift)
            qpos[at + 3 : at + 7] = hamilton(turn, quaternion_of(*_angles(joint.name, values)))
        elif joint.type[0] == 1:
            qpos[at : at + 4] = quaternion_of(*_angles(joint.name, values))
        elif joint.name in values:
            qpos[at] = values[joint.name]
    for name, (followed, a0, a1) in (followers or {}).items():
        at, of = (int(model.jnt_qposadr[model.joint(joint).id]) for joint in (name, followed))
        qpos[at] = model.qpos0[at] + a0 + a1 * (qpos[of] - model.qpos0[of])
    return qpos


def _angles(name: str, values: dict[str, float]) -> list[float]:
    return [values[f"{name}/{word}"] for word in ("roll", "pitch", "yaw")]


def mujoco_pairs(mujoco, model, rng, tries: int = 12) -> set[frozenset[int]]:
    """Pairs of geoms that MuJoCo tests: those it finds contacts of when all geoms stand in one place, whatever their
    bodies do. Its own functions miss a few of those overlaps, hence several tries."""
    data, found = mujoco.MjData(model), set()
    flags = int(model.opt.disableflags)
    model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)
    for _ in range(tries):
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        data.geom_xpos[:] = rng.uniform(-0.02, 0.02, data.geom_xpos.shape)
        data.geom_xmat[:] = [np.linalg.qr(rng.normal(size=(3, 3)))[0].ravel() for _ in range(model.ngeom)]
        data.geom_xmat[np.linalg.det(data.geom_xmat.reshape(-1, 3, 3)) < 0] *= -1
        mujoco.mj_collision(model, data)
        found |= {frozenset((int(c.geom1), int(c.geom2))) for c in data.contact[: data.ncon]}
    model.opt.disableflags = flags
    return found
