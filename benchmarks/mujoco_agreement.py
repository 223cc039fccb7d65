"""MuJoCo's contacts of random pairs of geoms, alone and with collide, beside proven brackets.

    python benchmarks/mujoco_agreement.py [--pairs 10000] [--on-fields 3000]

Pairs of every two kinds, turned at random, are placed at a depth or a gap of 3e-2 to 1e-7 of 0.1 m. Truth is the
bracket of `collide.distance`, whose tests judge it in rational arithmetic. A verdict is wrong where a pair proven
to overlap has no contact of negative distance, or one that is proven to be apart has one. A depth is off by the
difference between the deepest contact's and the bracket.

On height fields of random heights bodies of all kinds are placed alike, up to 3 cm deep in cells of 3 and 9 cm. An
overlap is left where the body, moved out of all its contacts, still meets the field by a tenth of a millimetre.
"""

from __future__ import annotations

import argparse
import contextlib

import mujoco
import numpy as np

import collide
from collide.adapters.hosts.mujoco import install
from collide.adapters.hosts.mujoco_geoms import geom_shapes

KINDS = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
LENGTH = 0.1


def model_of(a: str, b: str, random: np.random.Generator) -> mujoco.MjModel:
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


def matrix(data: mujoco.MjData, geom: int) -> np.ndarray:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
    return X


def verdict(data: mujoco.MjData) -> float:
    """The least distance of its contacts; infinite without."""
    return min((contact.dist for contact in data.contact), default=np.inf)


def field_model(kind: str, n: int, random: np.random.Generator) -> mujoco.MjModel:
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


def left_behind(model: mujoco.MjModel, data: mujoco.MjData, shapes) -> float:
    """By how much the body meets the field after it was moved out of all contacts [m]."""
    rows = np.array([(contact.dist, *contact.frame[:3]) for contact in data.contact]).reshape(-1, 4)
    moved = np.zeros(3)
    for _ in range(200):
        for row in rows:
            moved -= min(0.0, row[0] + moved @ row[1:]) * row[1:]
    X_WB = matrix(data, 1)
    X_WB[:3, 3] += moved
    return max(0.0, -collide.distance(*shapes, matrix(data, 0), X_WB).distance)


def on_fields(n_pairs: int) -> None:
    """Print the table of height fields."""
    random = np.random.default_rng(1)
    print("on height fields: wrong verdicts, MuJoCo, collide | overlaps left, both | contacts of a pair, both")
    for kind in KINDS[1:]:
        counts, n = np.zeros((2, 3)), 0
        while n < n_pairs // 6:
            model = field_model(kind, (23, 67)[n // 20 % 2], random)
            data = mujoco.MjData(model)
            shapes = [geom_shapes(model)[0][row] for row in geom_shapes(model)[1]]
            for _ in range(20):
                data.qpos[:3] = *random.uniform(-0.8, 0.8, 2), random.uniform(0.15, 0.3)
                data.qpos[3:] = random.normal(size=4)
                mujoco.mj_kinematics(model, data)
                start = collide.distance(*shapes, matrix(data, 0), matrix(data, 1))
                wanted = random.choice((-1.0, 1.0)) * LENGTH * 10.0 ** random.uniform(-7.0, -0.5)
                data.qpos[:3] += (wanted - start.distance) * start.normal
                mujoco.mj_forward(model, data)
                truth = collide.distance(*shapes, matrix(data, 0), matrix(data, 1))
                for who in range(2):
                    with install(model) if who else contextlib.nullcontext():
                        mujoco.mj_forward(model, data)
                    least = verdict(data)
                    is_wrong = least < 0.0 if truth.lower > 0.0 else least >= 0.0 and truth.upper < 0.0
                    remains = truth.upper < 0.0 and left_behind(model, data, shapes) > 1e-4
                    counts[who] += is_wrong, remains, data.ncon
                    if who and (is_wrong or remains):
                        print("collide is off:", kind, data.qpos.tolist(), least, truth)
                n += 1
        (wrong, remaining, of_mujoco), (ours_wrong, ours_remaining, of_ours) = counts
        print(
            f"{kind:10} {n:6} pairs {int(wrong):16} {int(ours_wrong):8} | {int(remaining):21} {int(ours_remaining):8} |"
            f" {of_mujoco / n:17.1f} {of_ours / n:8.1f}", flush=True,
        )  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10000)
    parser.add_argument("--on-fields", type=int, default=0, help="so many pairs of bodies and height fields instead")
    n_pairs, n_on_fields = vars(parser.parse_args()).values()
    if n_on_fields:
        on_fields(n_on_fields)
        return
    couples = [(a, b) for i, a in enumerate(KINDS) for b in KINDS[max(1, i) :]]
    counts = {b: np.zeros(5, dtype=int) for b in KINDS}
    random = np.random.default_rng(0)
    done = 0
    while done < n_pairs:
        a, b = couples[done // 20 % len(couples)]
        model = model_of(a, b, random)
        data = mujoco.MjData(model)
        shapes, rows, _ = geom_shapes(model)
        A, B = (shapes[row] for row in rows)
        for _ in range(20):
            q = random.normal(size=(2, 4))
            if a != "plane":
                data.qpos[:3], data.qpos[3:7] = 0.0, q[0]
            data.qpos[-7:-4], data.qpos[-4:] = random.normal(size=3), q[1]
            mujoco.mj_kinematics(model, data)
            start = collide.distance(A, B, matrix(data, 0), matrix(data, 1))
            wanted = random.choice((-1.0, 1.0)) * LENGTH * 10.0 ** random.uniform(-7.0, -1.5)
            data.qpos[-7:-4] += (wanted - start.distance) * start.normal
            mujoco.mj_forward(model, data)
            truth = collide.distance(A, B, matrix(data, 0), matrix(data, 1))
            alone = verdict(data)
            with install(model):
                mujoco.mj_forward(model, data)
            answers = alone, verdict(data)
            is_wrong = [(d < 0.0) if truth.lower > 0.0 else d >= 0.0 and truth.upper < 0.0 for d in answers]
            off = [d < 0.0 and abs(d - truth.distance) > 1e-3 * LENGTH for d in answers]
            row = [1, is_wrong[0], is_wrong[1], off[0], off[1]]
            for kind in {a, b}:
                counts[kind] += np.array(row, dtype=int)
            done += 1
            if any(is_wrong[1:]) or off[1]:
                print("collide is off:", a, b, data.qpos.tolist(), answers, truth)
    print(f"MuJoCo {mujoco.__version__}, {done} pairs; a pair counts under each of its kinds")
    heads = f"wrong verdicts: MuJoCo {'collide':>8} | depth off by > 1e-4 m: MuJoCo {'collide':>8}"
    print(f"{'':10} {'pairs':>6} | {heads}")
    for kind, (n, wrong, ours_wrong, off_by, ours_off) in counts.items():
        print(f"{kind:10} {n:6} | {wrong:22} {ours_wrong:8} | {off_by:29} {ours_off:8}")


if __name__ == "__main__":
    main()
