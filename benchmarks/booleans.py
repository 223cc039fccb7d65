"""What a certified boolean costs: stage by stage, beside the same code without proofs, and beside coal.

    python benchmarks/booleans.py                # about three minutes, most of it compiling

Classes of pairs: random boxes and random hulls of 40 vertices, separated and overlapping; flush boxes,
axis-aligned and tilted (rounding decides); boxes exactly face to face. "uncertified" is a copy of the engine
with the error bound set to zero and the exact stage left out. coal, where it is installed, is asked the
same boolean (contacts off) in a Python loop. All are interleaved in one run; medians of 9 repeats.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
POSES = 4000

#: What turns the engine into its uncertified twin: (file, text, replacement).
UNCERTIFIED = [
    ("narrowphase/bounds.py", "ERROR = 64 * 2.0**-53", "ERROR = 0.0"),
    ("narrowphase/convex_kernel_calls.py", 'if (rows["how"] == UNDECIDED).any():', "if False:"),
]


def classes(collide) -> dict:
    """name -> (A, B, X_WA, X_WBs); each class purely separated, overlapping or touching."""
    rng = np.random.default_rng(0)
    box, hull = collide.Box((1, 1, 1)), collide.ConvexHull(rng.normal(size=(40, 3)))
    eye, tilt = np.eye(4), collide.pose(rpy=(0.3, 0.4, 0.5))
    far = np.array([collide.pose(rng.normal(size=3) * 2.5, rpy=rng.uniform(-3, 3, 3)) for _ in range(6 * POSES)])
    out = {}
    for name, shape in (("boxes", box), ("hulls", hull)):
        hits = collide.collide(shape, shape, eye, far)
        out[f"{name} separated"] = shape, shape, eye, far[~hits][:POSES]
        out[f"{name} overlapping"] = shape, shape, eye, far[hits][:POSES]
    flush = [
        collide.pose((rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), 1.0), rpy=(0, 0, rng.uniform(-3, 3)))
        for _ in range(POSES)
    ]
    out["flush, axis-aligned"] = box, box, eye, np.array(flush)
    out["flush, tilted"] = box, box, tilt, np.array([tilt @ X for X in flush])
    exact = rng.integers(-32, 33, size=(POSES, 2)) / 64
    out["exactly face to face"] = box, box, eye, np.array([collide.pose((x, y, 1.0)) for x, y in exact])
    return out


def time_of(question, poses: int) -> float:
    """µs a pair."""
    started = time.perf_counter()
    question()
    return (time.perf_counter() - started) / poses * 1e6


def child(folder: str) -> None:
    """Answer "class name" lines with a time, from the engine in ``folder``."""
    sys.path.insert(0, folder)
    import collide

    pairs = classes(collide)
    for question in pairs.values():
        collide.collide(*question)
    print("ready", flush=True)
    for line in sys.stdin:
        question = pairs[line.strip()]
        print(time_of(lambda q=question: collide.collide(*q), len(question[3])), flush=True)


def coal_questions(pairs: dict) -> dict:
    """name -> a loop over coal's boolean, or {} without coal."""
    try:
        import coal
    except ImportError:
        return {}
    from scipy.spatial import ConvexHull

    def geometry(shape):
        if type(shape).__name__ == "Box":
            return coal.Box(*shape.size)
        hull, points = ConvexHull(shape.points), coal.StdVec_Vec3s()
        for vertex in hull.vertices:
            points.append(shape.points[vertex])
        return coal.Convex.convexHull(points, True, "")

    def loop(A, B, X_WA, X_WBs):
        a, b, request, result = geometry(A), geometry(B), coal.CollisionRequest(), coal.CollisionResult()
        request.enable_contact = False
        place = [coal.Transform3s(np.array(X[:3, :3]), np.array(X[:3, 3])) for X in (X_WA, *X_WBs)]

        def ask():
            for T in place[1:]:
                result.clear()
                coal.collide(a, place[0], b, T, request, result)

        return ask

    return {name: loop(*question) for name, question in pairs.items()}


def uncertified_copy(folder: Path) -> None:
    shutil.copytree(ROOT / "collide", folder / "collide", ignore=shutil.ignore_patterns("__pycache__"))
    for name, old, new in UNCERTIFIED:
        file = folder / "collide" / name
        text = file.read_text(encoding="utf-8")
        assert old in text, f"{name} no longer contains {old!r}"
        file.write_text(text.replace(old, new), encoding="utf-8")


def main() -> None:
    import collide
    from collide.results import HOW

    with tempfile.TemporaryDirectory() as folder:
        uncertified_copy(Path(folder))
        plain = subprocess.Popen(
            [sys.executable, __file__, "--child", folder], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "COLLIDE_CACHE_DIR": folder},
        )  # fmt: skip
        assert plain.stdin is not None and plain.stdout is not None
        plain.stdout.readline()
        pairs = classes(collide)
        peers = coal_questions(pairs)
        rows = []
        for name, question in pairs.items():
            rows_of = collide.distance(*question).rows
            shares = {HOW[h]: round(float((rows_of["how"] == h).mean()), 3) for h in np.unique(rows_of["how"])}
            times: dict[str, list[float]] = {"certified": [], "uncertified": [], "distance": [], "coal": []}
            for _ in range(9):
                times["certified"].append(time_of(lambda q=question: collide.collide(*q), len(question[3])))
                plain.stdin.write(name + "\n")
                plain.stdin.flush()
                times["uncertified"].append(float(plain.stdout.readline()))
                times["distance"].append(time_of(lambda q=question: collide.distance(*q), len(question[3])))
                if name in peers:
                    times["coal"].append(time_of(peers[name], len(question[3])))
            median = {what: statistics.median(t) if t else float("nan") for what, t in times.items()}
            rows.append(
                [name, *(f"{median[what]:.2f}" for what in times), f"{median['certified'] / median['uncertified']:.2f}",
                 f"{median['coal'] / median['certified']:.2f}", json.dumps(shares)]
            )  # fmt: skip
        plain.stdin.close()
        plain.wait()
    header = ["class", "certified_us", "uncertified_us", "distance_us", "coal_us", "certified/uncertified",
              "coal/certified", "decided_by"]  # fmt: skip
    for row in [header, *rows]:
        print("  ".join(f"{cell:>22}" if k else f"{cell:<22}" for k, cell in enumerate(row)))
    target = ROOT / "benchmarks" / "results" / "booleans.csv"
    target.parent.mkdir(exist_ok=True)
    with target.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([header, *rows])


if __name__ == "__main__":
    child(sys.argv[2]) if sys.argv[1:2] == ["--child"] else main()
