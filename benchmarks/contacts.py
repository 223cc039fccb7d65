"""Contact manifolds beside coal's, Bullet's and MuJoCo's: pairs, single calls, batches, meshes, a world at rest.

    python benchmarks/contacts.py                   # four minutes; prints tables and writes results/contacts_*.csv
    python benchmarks/contacts.py --table world     # one of pairs, single, batches, meshes, world; no file
    python benchmarks/contacts.py --quick           # a minute; no file

pairs    µs a pair. Bodies rest on a box or a hull, sunk by 0.1 mm ("touching") or 1 mm above with a margin of 2 mm
         ("apart"), turned at random. Ours: one batch. coal: a loop of Python over what was made ready, without and with
         its contact patches. Bullet and MuJoCo: all pairs by one call, declared or far from each other: no Python
single   µs a call from Python of one pair: `contacts`, `coal.collide`, `getClosestPoints`, `mj_collision`
batches  µs a pair of ours in batches of 1 to 10,000 boxes on boxes, beside coal's loop
meshes   µs a pair: a box on a rough ground of 100,352 facets, and two bunnies (from ../shared/data) that overlap by a
         thousandth of their size. coal's contacts there are pairs of facets; MuJoCo has no meshes that are not convex
world    ms a step of 5,000 bodies at rest in ten pits (`contact_worlds.py`): move, then find all contacts

Engines take turns; medians of their turns, CPU time; × is theirs divided by ours. Checked first, and printed: how many
contacts a pair everyone finds; whoever finds none at all of bodies that touch is not quicker but wrong.
"""

from __future__ import annotations

import argparse
import gc
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from importlib import metadata
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from contact_peers import BulletContacts, CoalContacts, MujocoContacts, installed
from contact_worlds import WORLDS, OurWorld, Pits
from convex import aligned, log, say, write
from startup import machine

import collide

TABLES = ("pairs", "single", "batches", "meshes", "world")
#: µs a pair (ms a step in "world") that ours is to stay below.
BARS = {
    ("pairs", "box on box", "touching"): 1.0, ("pairs", "hull 48 on hull 48", "touching"): 1.5,
    ("pairs", "box on box", "apart"): 0.3, ("pairs", "hull 48 on hull 48", "apart"): 0.3,
    ("single", "box on box", "touching"): 3.0, ("meshes", "box on ground", "touching"): 20.0,
    ("meshes", "bunny on bunny", "touching"): 1000.0, ("world", "5000 bodies", "contacts"): 20.0,
}  # fmt: skip
BOX = collide.Box((0.4, 0.3, 0.2))
#: Sunk so far, or above by so much, within the margin [m].
SUNK, ABOVE, MARGIN = 1e-4, 1e-3, 2e-3
Tasks = dict[str, Callable[[], object]]


def hull(seed: int) -> collide.ConvexHull:
    """48 points near a ball, its lowest and highest on faces across z."""
    points = np.random.default_rng(seed).normal(size=(48, 3))
    points *= 0.2 / np.linalg.norm(points, axis=1)[:, None]
    points[:, 2] = np.clip(points[:, 2], -0.15, 0.15)
    return collide.ConvexHull(points)


def cases() -> dict[str, tuple[collide.Shape, collide.Shape, float, bool]]:
    """Name to (A, B, height of B's origin over A's where they touch, whether B lies on its side)."""
    lower, upper = hull(1), hull(2)
    return {
        "box on box": (BOX, collide.Box((0.3, 0.3, 0.2)), 0.2, False),
        "hull 48 on hull 48": (lower, upper, 0.3, False), "hull 48 on box": (BOX, upper, 0.25, False),
        "sphere on box": (BOX, collide.Sphere(0.1), 0.2, False),
        "capsule on box": (BOX, collide.Capsule(0.1, 0.2), 0.2, True),
        "cylinder on box, standing": (BOX, collide.Cylinder(0.1, 0.2), 0.2, False),
        "cylinder on box, lying": (BOX, collide.Cylinder(0.1, 0.2), 0.2, True),
    }  # fmt: skip


def resting(n: int, height: float, lying: bool, seed: int) -> np.ndarray:
    """(n, 4, 4): turned about the vertical, aside by at most a centimetre, one body lying on its side."""
    rng = np.random.default_rng(seed)
    return np.array([
        collide.pose((*rng.uniform(-0.01, 0.01, 2), height), rpy=(0.5 * np.pi * lying, 0, rng.uniform(-np.pi, np.pi)))
        for _ in range(n)
    ])  # fmt: skip


def medians(tasks: Tasks, seconds: float, least: int = 5) -> dict[str, list[float]]:
    """CPU seconds of every task, turn after turn, until the time is up; the first turn does not count."""
    taken: dict[str, list[float]] = {name: [] for name in tasks}
    gc.disable()
    started, round_number = time.perf_counter(), 0
    while round_number <= least or time.perf_counter() - started < seconds:
        for name, task in tasks.items():
            before = time.process_time()
            task()
            if round_number:
                taken[name].append(time.process_time() - before)
        round_number += 1
    gc.enable()
    return taken


def rows_of(table: str, case: str, state: str, taken: dict[str, list[float]], per: float, contacts: dict) -> list[dict]:
    """Rows of one comparison. per : what a second is divided by."""
    ours = statistics.median(taken["collide"])
    return [
        {
            "table": table, "case": case, "state": state, "engine": engine, "turns": len(times),
            "median": statistics.median(times) * per, "min": min(times) * per, "max": max(times) * per,
            "ratio": round(statistics.median(times) / ours, 2), "contacts": contacts.get(engine, ""),
            "bar": BARS.get((table, case, state), "") if engine == "collide" else "",
        }
        for engine, times in taken.items()
    ]  # fmt: skip


def per_pair(manifolds) -> float:
    """Contacts a pair."""
    return round(sum(len(m.distance) for m in manifolds) / len(manifolds), 2)


def peers_of(As, Bs, Xs, Ys, margin: float, patches: bool) -> list:
    made: list = []
    for engine in installed([CoalContacts, BulletContacts, MujocoContacts]):
        made.append(engine(As, Bs, Xs, Ys, margin))
        if engine is CoalContacts and patches:
            made.append(CoalContacts(As, Bs, Xs, Ys, margin, patches=True))
    return made


def states() -> dict[str, tuple[float, float]]:
    """Name to (how far apart, margin) [m]."""
    return {"touching": (-SUNK, 0.0), "apart": (ABOVE, MARGIN)}


def pairs_table(n: int, seconds: float) -> list[dict]:
    rows = []
    for name, (A, B, height, lying) in cases().items():
        for state, (gap, margin) in states().items():
            Ys = resting(n, height + gap, lying, seed=n)
            ours = partial(collide.contacts, A, B, np.eye(4), Ys, margin=margin)
            tasks: Tasks = {"collide": ours}
            contacts = {"collide": round(len(ours()) / n, 2)}
            for peer in peers_of([A] * n, [B] * n, np.tile(np.eye(4), (n, 1, 1)), Ys, margin, patches=True):
                contacts[peer.name] = per_pair(peer.manifolds())
                tasks[peer.name] = peer.detect
            rows += rows_of("pairs", name, state, medians(tasks, seconds), 1e6 / n, contacts)
    return rows


def single_table(calls: int, seconds: float) -> list[dict]:
    def repeated(task: Callable[[], object]) -> Callable[[], None]:
        def run() -> None:
            for _ in range(calls):
                task()

        return run

    rows = []
    for name, (A, B, height, lying) in cases().items():
        for state, (gap, margin) in states().items():
            X, Y = np.eye(4), resting(1, height + gap, lying, seed=3)[0]
            tasks: Tasks = {"collide": repeated(partial(collide.contacts, A, B, X, Y, margin=margin))}
            for peer in peers_of([A], [B], [X], [Y], margin, patches=False):
                tasks[peer.name] = repeated(peer.closest_points if isinstance(peer, BulletContacts) else peer.detect)
            rows += rows_of("single", name, state, medians(tasks, seconds), 1e6 / calls, {})
    return rows


def batches_table(sizes: tuple[int, ...], seconds: float) -> list[dict]:
    A, B, height, lying = cases()["box on box"]
    rows = []
    for n in sizes:
        Ys = resting(n, height - SUNK, lying, seed=n)
        tasks: Tasks = {"collide": partial(collide.contacts, A, B, np.eye(4), Ys)}
        if installed([CoalContacts]):
            tasks["coal"] = CoalContacts([A] * n, [B] * n, np.tile(np.eye(4), (n, 1, 1)), Ys, 0.0).detect
        rows += rows_of("batches", "box on box", f"{n} poses", medians(tasks, seconds), 1e6 / n, {})
    return rows


def ground(cells: int = 224, size: float = 4.0) -> collide.Mesh:
    """A rough surface of 2 · cells² facets, in cells of about two centimetres, some millimetres high."""
    xs = np.linspace(-size / 2, size / 2, cells + 1)
    x, y = np.meshgrid(xs, xs)
    z = 0.02 * np.sin(3 * x) * np.cos(2 * y) + np.random.default_rng(0).uniform(-1e-3, 1e-3, x.shape)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up, both = corner + 1, corner + cells + 1, corner + cells + 2
    faces = np.concatenate([np.stack([corner, right, both], axis=1), np.stack([corner, both, up], axis=1)])
    return collide.Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, solid=False)


def sunk_poses(A, B, n: int, depth: float, seed: int, spread: float) -> np.ndarray:
    """(n, 4, 4): B over A, let down until they touch, and by so much more [m]."""
    rng = np.random.default_rng(seed)
    placed = []
    for _ in range(n):
        place, tilt = rng.uniform(-spread, spread, 2), rng.uniform(-0.02, 0.02, 2)
        Y = collide.pose((*place, 2.0), rpy=(*tilt, rng.uniform(-3, 3)))
        for _ in range(200):
            gap = collide.distance(A, B, np.eye(4), Y, signed=False).distance
            Y[2, 3] -= gap
            if gap < 1e-7:
                break
        Y[2, 3] -= depth
        placed.append(Y)
    return np.array(placed)


def meshes_table(n: int, seconds: float) -> list[dict]:
    asked = {"box on ground": (ground(), collide.Box((0.1, 0.08, 0.06)), 2e-4, 1.5)}
    try:
        from meshes import mesh

        bunny = collide.Mesh(*mesh("bunny"), solid=False)
        asked["bunny on bunny"] = bunny, bunny, 1e-3, 0.1
    except (ImportError, OSError) as error:
        say(f"left out: bunnies ({error})")
    rows = []
    for name, (A, B, depth, spread) in asked.items():
        Ys = sunk_poses(A, B, n, depth, 1, spread)
        Xs = np.tile(np.eye(4), (n, 1, 1))
        ours = partial(collide.contacts, A, B, np.eye(4), Ys)
        tasks: Tasks = {"collide": ours}
        contacts = {"collide": round(len(ours()) / n, 2)}
        for engine in installed([CoalContacts] if isinstance(B, collide.Mesh) else [CoalContacts, BulletContacts]):
            limits = {"max_contacts": 1 << 20} if engine is CoalContacts else {}
            peer = engine([A] * n, [B] * n, Xs, Ys, 0.0, **limits)
            contacts[peer.name] = per_pair(peer.manifolds())
            tasks[peer.name] = peer.detect
        rows += rows_of("meshes", name, "touching", medians(tasks, seconds, least=3), 1e6 / n, contacts)
    return rows


def world_table(bodies: int, seconds: float) -> list[dict]:
    try:
        pits = Pits(bodies)
    except ImportError:
        say("left out: the world at rest (pybullet, which settles it, is not installed)")
        return []
    worlds: list = [OurWorld(pits)]
    for package, engine in WORLDS.items():
        try:
            worlds.append(engine(pits))
        except ImportError:
            print(f"{package} is not installed: left out")
    tasks: Tasks = {f"{w.name} {task}": getattr(w, task) for w in worlds for task in ("move", "detect")}
    taken = medians(tasks, seconds, least=5)
    contacts = {}
    for w in worlds:
        n_pairs, n_contacts = w.counts()
        contacts[w.name] = n_contacts
        say(f"{w.name}: {n_pairs} pairs within {1e3 * 2e-3:g} mm, {n_contacts} contacts")
    rows = []
    for state, task in (("move", "move"), ("contacts", "detect")):
        of_task = {w.name: taken[f"{w.name} {task}"] for w in worlds}
        rows += rows_of("world", f"{bodies} bodies", state, of_task, 1e3, contacts if state == "contacts" else {})
    return rows


def show(rows: list[dict]) -> None:
    columns = ("case", "state", "engine", "median", "min", "max", "ratio", "contacts", "bar")
    for table in dict.fromkeys(row["table"] for row in rows):
        lines = [list(columns)]
        for row in rows:
            if row["table"] == table:
                cells = [(row[c], c) for c in columns]
                lines.append([f"{v:.3f}" if isinstance(v, float) and c != "ratio" else str(v) for v, c in cells])
        aligned(f"{table}: {'ms a step' if table == 'world' else 'µs a pair'}", lines)


def versions() -> dict[str, str]:
    """Of the peers."""
    numbers = {}
    for name in ("coal", "pybullet", "mujoco"):
        try:
            numbers[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            numbers[name] = "absent"
    return numbers


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--table", choices=[*TABLES, "all"], default="all", help="which table (default: all)")
    parser.add_argument("--quick", action="store_true", help="fewer turns, 1,000 bodies, no CSV")
    parser.add_argument("--no-csv", action="store_true", help="print the tables alone")
    options = parser.parse_args()
    n, seconds = (100, 0.2) if options.quick else (400, 2.0)
    measures: dict[str, Callable[[], list[dict]]] = {
        "pairs": partial(pairs_table, n, seconds), "single": partial(single_table, 1000, 0.5 * seconds),
        "batches": partial(batches_table, (1, 10, 100, 1000, 10_000), seconds),
        "meshes": partial(meshes_table, 10 if options.quick else 40, 4 * seconds),
        "world": partial(world_table, 1000 if options.quick else 5000, 15 * seconds),
    }  # fmt: skip
    rows: list[dict] = []
    for table in TABLES if options.table == "all" else (options.table,):
        say(table)
        measured = measures[table]()
        show(measured)
        rows += measured
    if options.table == "all" and not (options.quick or options.no_csv):
        log(f"written: {write('contacts', rows, machine() | versions()).name}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
