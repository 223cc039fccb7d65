"""How long a user waits, and how much memory it takes: start-up, first answers, reports.

    python benchmarks/startup.py                 # everything; a few minutes
    python benchmarks/startup.py --repeats 1 --no-csv
    python benchmarks/startup.py --against ../older/.venv/bin/python      # another installation, in turns with this one

Each case runs in processes of its own. Cold means an empty cache folder: meshes are read, and kernels compiled where
they come in no library. Warm means a folder that one run has filled. Wall time is taken from outside, the interpreter's
own start included; peak memory is the process's largest resident set.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from collide.adapters.bench.claims import Claim, Options, Race, grid, main, say
from collide.adapters.bench.turns import Seconds
from collide.errors import CollideError


class Case(NamedTuple):
    """name : in the table.   arguments : of the interpreter.   cached : whether the cache matters.
    needs : a distribution without which it cannot run.
    """

    name: str
    arguments: tuple[str, ...]
    cached: bool = False
    needs: str | None = None


_BOXES = "import collide; box = collide.Box((1, 1, 1)); X_WA, X_WB = collide.pose(), collide.pose((1.5, 0, 0)); "
_HULL = (
    "import collide, numpy; hull = collide.ConvexHull(numpy.random.default_rng(1).normal(size=(500, 3))); "
    "collide.distance(hull, hull, collide.pose(), collide.pose((9, 0, 0)))"
)
CASES = (
    Case("python alone", ("-c", "pass")),
    Case("import numpy", ("-c", "import numpy")),
    Case("import collide", ("-c", "import collide")),
    Case("first boolean", ("-c", f"{_BOXES}collide.collide(box, box, X_WA, X_WB)"), cached=True),
    Case("first distance, hulls of 500 points", ("-c", _HULL), cached=True),
    Case("collide --help", ("-m", "collide", "--help")),
    Case("collide report workcell", ("-m", "collide", "report", "workcell"), cached=True),
    Case("collide report panda_workbench", ("-m", "collide", "report", "panda_workbench"), True, "example-robot-data"),
)


#: A process that is small itself, or its own memory would be its child's largest: wall seconds and peak of a command.
LAUNCHER = """
import os, subprocess, sys, time
started = time.perf_counter()
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
print(time.perf_counter() - started, usage.ru_maxrss)
sys.exit(os.waitstatus_to_exitcode(status))
"""


class Runs:
    """Processes of one interpreter, from start to end; their output is thrown away."""

    def __init__(self, case: Case, python: str, is_cold: bool):
        self.case, self.python, self.is_cold, self.peak = case, python, is_cold, 0.0
        self.folder, self.count = tempfile.TemporaryDirectory(), 0
        self()

    def __call__(self) -> Seconds:
        """Seconds of one; where the cache is to be cold, in a folder of its own."""
        self.count += self.is_cold
        cache = Path(self.folder.name, str(self.count))
        cache.mkdir(mode=0o700, exist_ok=True)
        environment = {**os.environ, "COLLIDE_CACHE_DIR": str(cache)}
        # Away from the checkout, so that the installed package is what is measured.
        command = [sys.executable, "-S", "-c", LAUNCHER, self.python, *self.case.arguments]
        done = subprocess.run(command, cwd=cache, env=environment, capture_output=True, text=True, check=False)
        if done.returncode:
            raise CollideError(f"{self.case.name} failed:\n{done.stderr}")
        seconds, peak = map(float, done.stdout.split())
        self.peak = max(self.peak, peak / (2**20 if sys.platform == "darwin" else 2**10))
        return Seconds(seconds)


def measure(options: Options, case: str, cache: str) -> Race:
    pythons = {"this": sys.executable} | ({"other": options.against} if options.against else {})
    of = next(known for known in CASES if known.name == case)
    runs = {name: Runs(of, python, cache == "cold") for name, python in pythons.items()}
    beside: dict = {name: {"peak_MiB": run.peak} for name, run in runs.items()}
    return Race(dict(runs), beside=beside, close=lambda: [run.folder.cleanup() for run in runs.values()])


def cases(options: Options, state: str):
    for case in CASES[: 4 if options.quick else None]:
        if case.needs and find_spec(case.needs.replace("-", "_")) is None:
            say(f"left out: {case.name} ({case.needs} is not installed)")
        elif case.cached or state == "warm":
            yield from grid(case=[case.name], cache=[state if case.cached else "-"])


def arguments(parser) -> None:
    parser.add_argument("--against", metavar="PYTHON", help="an interpreter with another version of collide installed")


wall = partial(Claim, measure=measure, unit="s", clock=time.perf_counter, seconds=600.0)
CLAIMS = [
    wall("warm", "s of whole processes", partial(cases, state="warm"), turns=7, file="startup"),
    wall("cold", "s of whole processes, an empty cache", partial(cases, state="cold"), turns=3, file="startup-cold"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
