"""MuJoCo's contacts of random pairs of geoms, alone and with collide, beside proven brackets.

    python benchmarks/mujoco_agreement.py [--pairs 10000]

Pairs of every two kinds, turned at random, are placed at a depth or a gap of 3e-2 to 1e-7 of 0.1 m. Truth is the
bracket of `collide.distance`, whose tests judge it in rational arithmetic. A verdict is wrong where a pair proven
to overlap has no contact of negative distance, or one that is proven to be apart has one. A depth is off by the
difference between the deepest contact's and the bracket.
"""

from __future__ import annotations

import argparse

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=10000)
    n_pairs = parser.parse_args().pairs
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
