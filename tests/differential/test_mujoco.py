"""MuJoCo's contacts of random pairs of geoms, alone and with collide, beside proven brackets.

Pairs are placed at a depth or a gap of 3e-2 to 1e-7 of 0.1 m. Truth is the bracket of `collide.distance`, which other
tests judge in rational arithmetic. A verdict is wrong where a pair proven to overlap has no contact of negative
distance, or one that is proven to be apart has one. On height fields an overlap is left where the body, moved out of
all its contacts, still meets the field by a tenth of a millimetre.
"""

from __future__ import annotations

import contextlib
from collections import Counter

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
from samples import sizes, told

import collide
from collide.adapters.hosts.mujoco import install
from collide.adapters.hosts.mujoco_geoms import geom_shapes

KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
LENGTH = 0.1


def model_of(a: str, b: str, random: np.random.Generator) -> object:
    points = random.normal(size=(10, 3))
    points *= 0.8 * LENGTH / np.linalg.norm(points, axis=1)[:, None]

    def geom(kind: str) -> str:
        size = " ".join(f"{length:.5f}" for length in LENGTH * random.uniform(0.4, 1.0, 3))
        return '<geom type="mesh" mesh="hull"/>' if kind == "mesh" else f'<geom type="{kind}" size="{size}"/>'

    first = geom(a) if a == "plane" else f"<body><freejoint/>{geom(a)}</body>"
    vertices = " ".join(f"{v:.6f}" for v in points.ravel())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="hull" vertex="{vertices}"/></asset>'
        f"<worldbody>{first}<body><freejoint/>{geom(b)}</body></worldbody></mujoco>"
    )


def matrix(data, geom: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    return X


def verdict(data) -> float:
    """The least distance of its contacts; infinite without."""
    return min((contact.dist for contact in data.contact), default=np.inf)


def field_model(kind: str, n: int, random: np.random.Generator) -> object:
    """A body of a kind and a height field of n x n points on two metres, 10 cm from its lowest to its highest."""
    points = random.normal(size=(10, 3))
    points *= 0.8 * LENGTH / np.linalg.norm(points, axis=1)[:, None]
    vertices = " ".join(f"{v:.6f}" for v in points.ravel())
    size = " ".join(f"{length:.5f}" for length in LENGTH * random.uniform(0.4, 1.0, 3))
    geom = '<geom type="mesh" mesh="hull"/>' if kind == "mesh" else f'<geom type="{kind}" size="{size}"/>'
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><asset><mesh name="hull" vertex="{vertices}"/>'
        f'<hfield name="h" nrow="{n}" ncol="{n}" size="1 1 .1 .2"/></asset>'
        f'<worldbody><geom type="hfield" hfield="h"/><body><freejoint/>{geom}</body></worldbody></mujoco>'
    )
    model.hfield_data[:] = random.random(n * n)
    return model


def left_behind(model, data, shapes) -> float:
    """By how much the body meets the field after it was moved out of all contacts [m]."""
    rows = np.array([(contact.dist, *contact.frame[:3]) for contact in data.contact]).reshape(-1, 4)
    moved = np.zeros(3)
    for _ in range(200):
        for row in rows:
            moved -= min(0.0, row[0] + moved @ row[1:]) * row[1:]
    X_WB = matrix(data, 1)
    X_WB[:3, 3] += moved
    return max(0.0, -collide.distance(*shapes, matrix(data, 0), X_WB).distance)


def near(model, data, A, B, first: int, random, low: float) -> collide.PairResult:
    """B's body moved along the normal to a random gap or depth; the bracket there."""
    mujoco.mj_kinematics(model, data)
    start = collide.distance(A, B, matrix(data, 0), matrix(data, 1))
    wanted = random.choice((-1.0, 1.0)) * LENGTH * 10.0 ** random.uniform(-7.0, low)
    data.qpos[first : first + 3] += (wanted - start.distance) * start.normal
    mujoco.mj_forward(model, data)
    return collide.distance(A, B, matrix(data, 0), matrix(data, 1))


def is_wrong(least: float, truth) -> bool:
    return least < 0.0 if truth.lower > 0.0 else least >= 0.0 and truth.upper < 0.0


@sizes(270, 10_800)
def test_verdicts_and_depths_with_collide_are_right(n):
    couples = [(a, b) for i, a in enumerate(KINDS) for b in KINDS[max(1, i) :]]
    counts, random = Counter(), np.random.default_rng(0)
    each = max(1, min(20, n // len(couples)))
    for k in range(n // each):
        a, b = couples[k % len(couples)]
        model = model_of(a, b, random)
        data, (shapes, rows, _) = mujoco.MjData(model), geom_shapes(model)
        A, B = (shapes[row] for row in rows)
        for _ in range(each):
            q = random.normal(size=(2, 4))
            if a != "plane":
                data.qpos[:3], data.qpos[3:7] = 0.0, q[0]
            data.qpos[-7:-4], data.qpos[-4:] = random.normal(size=3), q[1]
            truth = near(model, data, A, B, len(data.qpos) - 7, random, -1.5)
            answers = {"MuJoCo": verdict(data)}
            with install(model):
                mujoco.mj_forward(model, data)
            answers["collide"] = verdict(data)
            counts["asked", "hits" if truth.upper < 0.0 else "apart"] += 1
            for who, least in answers.items():
                wrong, off = is_wrong(least, truth), least < 0.0 and abs(least - truth.distance) > 1e-3 * LENGTH
                for kind in {a, b}:
                    counts[kind, who, "wrong verdicts"] += wrong
                    counts[kind, who, "depths off by 0.1 mm"] += off
                assert who == "MuJoCo" or not (wrong or off), f"{a}, {b}, qpos {data.qpos.tolist()}: {least}, {truth}"
    told(f"MuJoCo {mujoco.__version__}, {n} pairs; a pair counts under each of its kinds", +counts)
    assert min(counts["asked", "hits"], counts["asked", "apart"]) > 0.3 * n


@sizes(60, 6000)
def test_contacts_on_height_fields_leave_no_overlap(n):
    counts, random, each = Counter(), np.random.default_rng(1), max(1, min(20, n // 12))
    for k in range(n // each):
        kind = KINDS[1 + k % 6]
        model = field_model(kind, (23, 67)[k // 6 % 2], random)
        data, (shapes, rows, _) = mujoco.MjData(model), geom_shapes(model)
        A, B = (shapes[row] for row in rows)
        for _ in range(each):
            data.qpos[:3] = *random.uniform(-0.8, 0.8, 2), random.uniform(0.15, 0.3)
            data.qpos[3:] = random.normal(size=4)
            truth = near(model, data, A, B, 0, random, -0.5)
            for who in ("MuJoCo", "collide"):
                with install(model) if who == "collide" else contextlib.nullcontext():
                    mujoco.mj_forward(model, data)
                wrong = is_wrong(verdict(data), truth)
                remains = truth.upper < 0.0 and left_behind(model, data, (A, B)) > 1e-4
                counts[kind, who, "wrong verdicts"] += wrong
                counts[kind, who, "overlaps left"] += remains
                counts[kind, who, "contacts"] += data.ncon
                assert who == "MuJoCo" or not (wrong or remains), f"{kind}, qpos {data.qpos.tolist()}: {truth}"
    told(f"{n} pairs on height fields", +counts)
    assert sum(count for (_, who, what), count in counts.items() if (who, what) == ("collide", "contacts")) > 0.2 * n
