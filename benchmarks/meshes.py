"""Triangle meshes against coal and FCL: building, booleans, all pairs of facets, distances.

    python benchmarks/meshes.py
    # ten minutes; --meshes teapot bunny, --runs N, --poses N, --no-csv

Meshes are scaled to a box diagonal of 1 and stand in random poses of six classes: far (0.5 apart), gaps of 1e-2 and
1e-4, shallow (1e-3 into each other), deep (0.1), and inside (the second mesh a tenth as large, in the first one).
Engines take turns run by run; a run counts its fastest turn, times are medians of the runs, ratios are of medians,
above 1 where collide is faster.
collide answers all poses in one call of the functions on trees, of booleans each ten times over, since a batch has more
than a dozen; "single" is one call of `collide.collide` a pose, of surfaces, as the peers are asked.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import io
import os
import platform
import re
import sys
import time
from importlib.metadata import version
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from mesh_peers import QUESTIONS, Coal, Fcl, warm

from collide import Mesh, collide
from collide.hull.exact_hull import convex_hull
from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import all_hits, first_hits, surface_distances

DATA = Path(__file__).resolve().parents[2] / "shared" / "data" / "meshes"
RESULTS = Path(__file__).parent / "results"
FILES = {
    "teapot": "teapot_1177.ply", "bunny": "bunny_35947.ply", "env": "env.obj", "rob": "rob.obj",
    "dragon 11k": "dragon_vrip_res4.ply.gz", "dragon 48k": "dragon_vrip_res3.ply.gz",
    "dragon 203k": "dragon_vrip_res2.ply.gz", "dragon 871k": "dragon_vrip.ply.gz",
}  # fmt: skip
PAIRS = {name: (name, name) for name in FILES if name not in ("env", "rob")} | {"env/rob": ("env", "rob")}
#: A mesh against a convex hull given as a mesh: few large flat facets against many small ones.
PAIRS |= {f"{name}/hull": (name, f"hull of {name}") for name in ("bunny", "dragon 203k")}
PACKAGES = {"collide": "collide-robotics", "numpy": "numpy", "numba": "numba", "coal": "coal", "fcl": "python-fcl"}
#: How far along the way from touching, in diagonals.
CLASSES = {"far": 0.5, "gap 1e-2": 1e-2, "gap 1e-4": 1e-4, "shallow": -1e-3, "deep": -0.1, "inside": None}


def mesh(name: str) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, faces), its box's diagonal 1 and its middle at the origin."""
    import trimesh

    if name.startswith("hull of "):
        vertices, _ = mesh(name.removeprefix("hull of "))
        corners, faces = np.unique(convex_hull(vertices).facets, return_inverse=True)
        return vertices[corners], faces.reshape(-1, 3)
    file = DATA / FILES[name]
    content = file.read_bytes()
    suffix = file.suffix
    if suffix == ".gz":
        content, suffix = gzip.decompress(content), Path(file.stem).suffix
    loaded = trimesh.load(io.BytesIO(content), file_type=suffix[1:], process=False, maintain_order=True, force="mesh")
    faces = np.array(loaded.faces, dtype=np.int64)
    vertices = np.array(loaded.vertices, dtype=np.float64)
    low, high = vertices[faces].reshape(-1, 3).min(axis=0), vertices[faces].reshape(-1, 3).max(axis=0)
    return (vertices - (low + high) / 2) / np.linalg.norm(high - low), faces


def rotation(rng) -> np.ndarray:
    q = rng.normal(size=4)
    w, x, y, z = q / np.linalg.norm(q)
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip


def touching(A, B, rng) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """(X_WA, X_WB, direction, way): B comes from far along a direction and touches A after that way."""
    X, Y = np.eye(4), np.eye(4)
    X[:3, :3], Y[:3, :3] = rotation(rng), rotation(rng)
    X[:3, 3] = rng.normal(size=3) * 0.1
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    way = 2.0
    for _ in range(300):
        Y[:3, 3] = X[:3, 3] + way * direction
        gap = float(surface_distances(A, B, X, Y).distance[0])
        if gap < 1e-9 or way < -1.0:
            break
        way -= gap
    return X, Y, direction, way


def poses(A, B, count: int, seed: int) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Class to (X_WAs, X_WBs)."""
    rng = np.random.default_rng(seed)
    by_class: dict[str, list] = {name: [] for name in CLASSES}
    for _ in range(count):
        X, Y, direction, way = touching(A, B, rng)
        for name, further in CLASSES.items():
            Z = Y.copy()
            Z[:3, 3] = X[:3, 3] + ((way + further) * direction if further is not None else rng.normal(size=3) * 0.02)
            by_class[name].append((X, Z))
    return {name: tuple(np.array(X) for X in zip(*pairs)) for name, pairs in by_class.items()}  # type: ignore[misc]


#: How often a batch of booleans holds every pose.
OVER = 10


def ours(trees, meshes, X_WAs, X_WBs) -> dict:
    """(question, how asked) -> a task."""
    A, B = trees
    X_WAs_repeated, X_WBs_repeated = (np.tile(X, (OVER, 1, 1)) for X in (X_WAs, X_WBs))
    surfaces = [Mesh(*m, solid=False) for m in meshes]
    each = list(zip(X_WAs, X_WBs))
    collide(*surfaces, *each[0])  # trees are built when first asked for
    return {
        ("build", "batch"): lambda: [build_mesh_tree(*m) for m in meshes],
        ("boolean", "batch"): lambda: first_hits(A, B, X_WAs_repeated, X_WBs_repeated),
        ("boolean", "single"): lambda: [collide(*surfaces, X, Y) for X, Y in each],
        ("all pairs", "batch"): lambda: all_hits(A, B, X_WAs, X_WBs),
        ("distance", "batch"): lambda: surface_distances(A, B, X_WAs, X_WBs),
    }


def seconds_of(task) -> float:
    """Of the fastest turn of a run, as `mesh_peers.warm` says."""

    def once() -> float:
        started = time.perf_counter()
        task()
        return time.perf_counter() - started

    return warm(once)


def measured(pair: str, name: str, meshes, trees, X_WAs, X_WBs, runs: int, with_build: bool) -> list[dict]:
    """Rows of one pair of meshes and one class of poses."""
    tasks = ours(trees, meshes, X_WAs, X_WBs)
    peers = [Coal("OBBRSS", meshes, X_WAs, X_WBs), Coal("OBB", meshes, X_WAs, X_WBs), Fcl(meshes, X_WAs, X_WBs)]
    hits = np.diff(first_hits(*trees, X_WAs, X_WBs).starts) > 0
    wrong = {p.name: "" if (reply := p.answers()) is None else int((reply != hits).sum()) for p in peers}
    rows = []
    for question in QUESTIONS:
        if question == "build" and not with_build:
            continue
        asked = [how for q, how in tasks if q == question]
        times: dict[str, list[float]] = {f"collide {how}": [] for how in asked} | {p.name: [] for p in peers}
        for _ in range(2 if question == "build" and len(meshes[0][1]) > 200_000 else runs):
            for how in asked:
                asked_over = OVER if (question, how) == ("boolean", "batch") else 1
                times[f"collide {how}"].append(seconds_of(tasks[question, how]) / asked_over)
            for peer in peers:
                times[peer.name].append(peer.seconds(question))
        ours_seconds = np.median(times["collide batch"])
        count = 1 if question == "build" else len(X_WAs)
        for engine, taken in times.items():
            rows.append({
                "meshes": pair, "facets": "/".join(str(len(m[1])) for m in meshes),
                "poses": "" if question == "build" else name,
                "question": question, "engine": engine, "runs": len(taken),
                "median_us": f"{np.median(taken) / count * 1e6:.2f}",
                "least_us": f"{min(taken) / count * 1e6:.2f}", "ratio": f"{np.median(taken) / ours_seconds:.2f}",
                "disagreements": wrong.get(engine, "") if question == "boolean" else "",
            })  # fmt: skip
    rows += counted(pair, name, meshes, trees, X_WAs, X_WBs)
    for peer in peers:
        peer.close()
    return rows


def counted(pair: str, name: str, meshes, trees, X_WAs, X_WBs) -> list[dict]:
    """What the walks looked at, a row a question."""
    rows = []
    for question, ask in (("boolean", first_hits), ("all pairs", all_hits), ("distance", surface_distances)):
        nodes, triangles, exact = ask(*trees, X_WAs, X_WBs).counters.mean(axis=0)
        rows.append({
            "meshes": pair, "facets": "/".join(str(len(m[1])) for m in meshes), "poses": name, "question": question,
            "engine": "collide counters", "nodes": f"{nodes:.1f}", "triangles": f"{triangles:.1f}",
            "exact": f"{exact:.2f}",
        })  # fmt: skip
    return rows


def as_text(rows: list[dict]) -> str:
    """Ratios to each peer, a line a pair of meshes, question and class."""
    lines = [
        f"{'meshes':12} {'question':10} {'poses':9} {'us':>9} {'single':>8} {'OBBRSS':>7} {'OBB':>7} {'fcl':>7}  wrong"
    ]
    keys = dict.fromkeys((r["meshes"], r["question"], r["poses"]) for r in rows if "ratio" in r)
    for key in keys:
        of = {r["engine"]: r for r in rows if (r["meshes"], r["question"], r["poses"]) == key and "ratio" in r}
        wrong = "/".join(str(of[e]["disagreements"]) for e in ("coal OBBRSS", "coal OBB", "fcl"))
        single = of["collide single"]["median_us"] if "collide single" in of else ""
        ratios = " ".join(f"{of[e]['ratio']:>7}" for e in ("coal OBBRSS", "coal OBB", "fcl"))
        lines.append(
            f"{key[0]:12} {key[1]:10} {key[2]:9} {of['collide batch']['median_us']:>9} {single:>8} {ratios}  {wrong}"
        )
    return "\n".join(lines)


def write(rows: list[dict]) -> Path:
    """The CSV, with the processor and the versions the times belong to."""
    about = {
        "cpu": processor(), "cores": str(os.cpu_count()), "system": platform.system(),
        "python": platform.python_version(),
        **{name: version(package) for name, package in PACKAGES.items()},
    }  # fmt: skip
    slug = re.sub(r"[^a-z0-9]+", "-", about["cpu"].lower()).strip("-")
    place = RESULTS / f"meshes_{slug}_{about['cores']}-cores.csv"
    with open(place, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)) + list(about))
        writer.writeheader()
        writer.writerows(row | about for row in rows)
    return place


def processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else ():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--meshes", nargs="*", default=list(PAIRS), choices=list(PAIRS))
    parser.add_argument("--classes", nargs="*", default=list(CLASSES), choices=list(CLASSES))
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--poses", type=int, default=12)
    parser.add_argument("--no-csv", action="store_true")
    options = parser.parse_args()
    if not DATA.is_dir():
        print(f"skipped: {DATA.name} of shared/data is not beside this checkout")
        return 0
    rows: list[dict] = []
    for pair in options.meshes:
        meshes = [mesh(name) for name in PAIRS[pair]]
        trees = [build_mesh_tree(*m) for m in meshes]
        poses_by_class = poses(*trees, options.poses, seed=1)
        for k, name in enumerate(options.classes):
            both, our_trees = meshes, trees
            if name == "inside":
                both = [meshes[0], (meshes[1][0] * 0.1, meshes[1][1])]
                our_trees = [trees[0], build_mesh_tree(*both[1])]
            row = measured(pair, name, both, our_trees, *poses_by_class[name], options.runs, k == 0)
            print(as_text(row) if not rows else as_text(row).split("\n", 1)[1], flush=True)
            rows += row
    if not options.no_csv:
        print(write(rows))
    return 0


if __name__ == "__main__":
    sys.exit(main())
