"""What a certified boolean costs: stage by stage, beside the same code without proofs, and beside coal.

    python benchmarks/booleans.py                # about three minutes, most of it compiling

Classes of pairs: random boxes and random hulls of 40 vertices, separated and overlapping; flush boxes, axis-aligned and
tilted (rounding decides); boxes exactly face to face. "uncertified" is a copy of the engine with the error bound set to
zero and the exact stage left out. coal, where it is installed, is asked the same boolean (contacts off) in a Python
loop. µs of the processor a pair; "decided by" are the shares of the stages that settle distances.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numpy as np
from inputs import ROOT
from pair_loops import CoalLoop

from collide.adapters.bench.claims import Claim, Options, Race, check, installed, main
from collide.adapters.bench.turns import Seconds

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


class Uncertified:
    """A process with the copy, which compiles its kernels when it is first asked."""

    def __init__(self) -> None:
        self.folder = tempfile.TemporaryDirectory()
        place = Path(self.folder.name)
        shutil.copytree(ROOT / "collide", place / "collide", ignore=shutil.ignore_patterns("__pycache__"))
        for name, old, new in UNCERTIFIED:
            file = place / "collide" / name
            text = file.read_text(encoding="utf-8")
            check(old in text, f"{name} no longer contains {old!r}")
            file.write_text(text.replace(old, new), encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, __file__, "--child", str(place)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            env={**os.environ, "COLLIDE_CACHE_DIR": str(place)},
        )
        assert self.process.stdout is not None
        check(self.process.stdout.readline() == "ready\n", "the copy without proofs did not start")

    def seconds(self, name: str) -> Seconds:
        assert self.process.stdin is not None and self.process.stdout is not None
        self.process.stdin.write(name + "\n")
        self.process.stdin.flush()
        return Seconds(self.process.stdout.readline())


def child(folder: str) -> None:
    """Answer names of classes with seconds, from the engine in ``folder``."""
    sys.path.insert(0, folder)
    import collide

    pairs = classes(collide)
    for question in pairs.values():
        collide.collide(*question)
    print("ready", flush=True)
    for line in sys.stdin:
        started = time.process_time()
        collide.collide(*pairs[line.strip()])
        print(time.process_time() - started, flush=True)


@cache
def ready() -> tuple[dict, Uncertified | None]:
    import collide

    return classes(collide), Uncertified()


def measure(options: Options, pairs: str) -> Race:
    import collide
    from collide.results import HOW

    made, plain = ready()
    A, B, X_WA, X_WBs = question = made[pairs]
    how = collide.distance(*question).rows["how"]
    tasks = {"certified": lambda: collide.collide(*question), "uncertified": lambda: plain.seconds(pairs),
             "distance": lambda: collide.distance(*question)}
    n = len(X_WBs)
    if installed(coal="coal"):
        tasks["coal"] = CoalLoop([A] * n, [B] * n, np.tile(X_WA, (n, 1, 1)), X_WBs).loop("boolean")
    shares = {HOW[h]: round(float((how == h).mean()), 3) for h in np.unique(how)}
    return Race(tasks, n, beside={"certified": {"decided_by": json.dumps(shares)}})


def cases(options: Options):
    return [{"pairs": name} for name in list(ready()[0])[: 2 if options.quick else None]]


CLAIMS = [Claim("booleans", "µs a certified boolean", cases, measure, everywhere=True)]


if __name__ == "__main__":
    child(sys.argv[2]) if sys.argv[1:2] == ["--child"] else main(__doc__, CLAIMS)
