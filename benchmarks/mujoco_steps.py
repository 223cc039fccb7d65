"""Steps of MuJoCo with its own contacts, with collide's, and culled by collide: pits of bodies that fall, and at rest.

    python benchmarks/mujoco_steps.py [--quick] [--bodies 100 1000 5000] [--no-csv]

Spheres, capsules, ellipsoids, cylinders, boxes and hulls in equal numbers, or boxes and hulls alone. "falling" are the
steps after the first tenth of a second, "resting" those after three seconds of MuJoCo's own. All contestants step from
the same state, in turns; a row holds the median, the least and the largest of their rounds. "collision" is
`mj_collision` alone, with everything before it done. Checked first: culled steps have the bits of MuJoCo's own.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import statistics
import time
from pathlib import Path

import mujoco
import numpy as np

from collide.adapters.hosts.mujoco import install

MIXED = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
SCENES = {"mixed": MIXED, "boxes and hulls": ("box", "mesh")}
CONTESTANTS = (None, "contacts", "cull")
TIMESTEP = 0.004
ROUNDS, STEPS = 9, 10


def pit(n: int, kinds: tuple[str, ...], seed: int = 0) -> mujoco.MjModel:
    """Bodies of 5 to 10 cm above a floor within four walls, eight layers or fewer."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(12, 3))
    points *= 0.08 / np.linalg.norm(points, axis=1)[:, None]
    side = max(3, int(np.ceil(np.sqrt(n / 8))))
    wall = 0.1 * side + 0.05
    parts = ['<geom type="plane" size="9 9 1"/>']
    for x, y in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        parts.append(f'<geom type="plane" size="9 9 1" pos="{wall * x} {wall * y} 0" zaxis="{-x} {-y} 0"/>')
    for k in range(n):
        place = 0.2 * (np.array([k % side, k // side % side, k // side**2]) - [(side - 1) / 2, (side - 1) / 2, -0.6])
        kind = kinds[k % len(kinds)]
        size = " ".join(f"{length:.4f}" for length in random.uniform(0.05, 0.07, 3))
        form = 'type="mesh" mesh="hull"' if kind == "mesh" else f'type="{kind}" size="{size}"'
        q = " ".join(f"{v:.4f}" for v in random.normal(size=4))
        p = " ".join(f"{v:.4f}" for v in place + random.uniform(-0.01, 0.01, 3))
        parts.append(f'<body pos="{p}" quat="{q}"><freejoint/><geom {form}/></body>')
    vertices = " ".join(f"{v:.6f}" for v in points.ravel())
    return mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{TIMESTEP}"/><size memory="1G"/>'
        f'<asset><mesh name="hull" vertex="{vertices}"/></asset>'
        f"<worldbody>{''.join(parts)}</worldbody></mujoco>"
    )


def state_after(model: mujoco.MjModel, seconds: float) -> mujoco.MjData:
    data = mujoco.MjData(model)
    for _ in range(round(seconds / TIMESTEP)):
        mujoco.mj_step(model, data)
    return data


def timed(model: mujoco.MjModel, state: mujoco.MjData, mode: str | None, n_steps: int) -> dict:
    """Seconds of a step and of a collision, and what came of the steps."""
    data = mujoco.MjData(model)
    mujoco.mj_copyData(data, model, state)
    installed = install(model, mode) if mode else None
    try:
        start = time.perf_counter()
        for _ in range(n_steps):
            mujoco.mj_step(model, data)
        step = (time.perf_counter() - start) / n_steps
        mujoco.mj_fwdPosition(model, data)
        start = time.perf_counter()
        for _ in range(n_steps):
            mujoco.mj_collision(model, data)
        collision = (time.perf_counter() - start) / n_steps
    finally:
        if installed:
            installed.uninstall()
    return {"step": step, "collision": collision, "contacts": data.ncon, "qpos": data.qpos.copy()}


def measured(scene: str, n: int, when: str, rounds: int) -> list[dict]:
    model = pit(n, SCENES[scene])
    state = state_after(model, 0.1 if when == "falling" else 3.0)
    runs: dict = {mode: [] for mode in CONTESTANTS}
    for _ in range(rounds):
        for mode in CONTESTANTS:
            runs[mode].append(timed(model, state, mode, STEPS))
    assert np.array_equal(runs[None][0]["qpos"], runs["cull"][0]["qpos"]), "culled steps are not MuJoCo's"
    rows = []
    for what in ("step", "collision"):
        of_mujoco = statistics.median(run[what] for run in runs[None])
        for mode in CONTESTANTS:
            times = sorted(run[what] for run in runs[mode])
            rows.append({
                "scene": scene, "bodies": n, "when": when, "what": what, "mode": mode or "MuJoCo alone",
                "contacts": runs[mode][0]["contacts"], "median_ms": 1e3 * statistics.median(times),
                "least_ms": 1e3 * times[0], "largest_ms": 1e3 * times[-1],
                "ratio": statistics.median(times) / of_mujoco,
            })  # fmt: skip
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bodies", type=int, nargs="+", default=[100, 1000, 5000])
    parser.add_argument("--quick", action="store_true", help="100 bodies and few rounds; writes nothing")
    parser.add_argument("--no-csv", action="store_true")
    arguments = parser.parse_args()
    sizes, rounds = ([100], 3) if arguments.quick else (arguments.bodies, ROUNDS)
    rows = []
    print(f"MuJoCo {mujoco.__version__}")
    print(f"{'scene':16}{'bodies':>7} {'when':8}{'what':10}{'mode':>13}{'contacts':>9}{'ms':>9}{'ratio':>7}")
    for scene in SCENES:
        for n in sizes:
            for when in ("falling", "resting"):
                for row in measured(scene, n, when, rounds):
                    rows.append(row)
                    print(
                        f"{row['scene']:16}{row['bodies']:7} {row['when']:8}{row['what']:10}{row['mode']:>13}"
                        f"{row['contacts']:9}{row['median_ms']:9.3f}{row['ratio']:7.2f}", flush=True,
                    )  # fmt: skip
    if not arguments.quick and not arguments.no_csv:
        name = f"mujoco_steps_{platform.machine()}_{len(os.sched_getaffinity(0))}.csv"
        with (Path(__file__).parent / "results" / name).open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)


if __name__ == "__main__":
    main()
