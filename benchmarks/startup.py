"""How long a user waits, and how much memory it takes: start-up, first answers, reports.

    python benchmarks/startup.py                 # everything; a few minutes
    python benchmarks/startup.py --runs 1 --cold-runs 1 --no-csv
    python benchmarks/startup.py --against ../older/.venv/bin/python      # another installation, in turns with this one

Each case runs in processes of its own. Cold means an empty cache folder: meshes are read, and kernels compiled where
    they come
in no library. Warm means a folder that one run has filled. Wall time is taken from outside, the interpreter's own start
included; peak memory is the process's largest resident set.
"""

from __future__ import annotations

import argparse
import csv
import os
import platform
import re
import statistics
import subprocess
import sys
import tempfile
import time
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

RESULTS = Path(__file__).resolve().parent / "results"


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


class Run(NamedTuple):
    seconds: float
    peak: float
    """Largest resident set [MiB], NaN where the system does not tell."""


def run(case: Case, cache: str, python: str) -> Run:
    """One process from start to end; its output is thrown away."""
    environment = {**os.environ, "COLLIDE_CACHE_DIR": cache}
    command = [python, *case.arguments]
    started = time.perf_counter()
    # Away from the checkout, so that the installed package is what is measured.
    with subprocess.Popen(
        command, cwd=cache, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as process:
        assert process.stderr is not None
        complaint = process.stderr.read()
        peak = _wait(process)
        seconds = time.perf_counter() - started
    if process.returncode:
        raise SystemExit(f"{case.name} failed:\n{complaint.decode(errors='replace')}")
    return Run(seconds, peak)


def _wait(process: subprocess.Popen) -> float:
    """Wait for a process and tell its peak memory [MiB]."""
    if not hasattr(os, "wait4"):
        process.wait()
        return float("nan")
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)


def measure(case: Case, runs: int, cold_runs: int, pythons: list[str]) -> dict[tuple[str, str], list[Run]]:
    """Runs of a case by interpreter and by the state of the cache: "-" where it does not matter, else "cold" and
    "warm".

    Interpreters take turns, so that what else the machine does meets all of them.
    """
    taken: dict[tuple[str, str], list[Run]] = {}
    with tempfile.TemporaryDirectory() as folder:
        last = {python: folder for python in pythons}
        for k in range(cold_runs if case.cached else 1):
            for j, python in enumerate(pythons):
                last[python] = fresh = str(Path(folder) / f"{j}-{k}")
                Path(fresh).mkdir(mode=0o700)
                first = run(case, fresh, python)  # where the cache does not matter, this fills the file system's
                if case.cached:
                    taken.setdefault((python, "cold"), []).append(first)
        for _ in range(runs):
            for python in pythons:
                taken.setdefault((python, "warm" if case.cached else "-"), []).append(run(case, last[python], python))
    return taken


def machine() -> dict[str, str]:
    """What the numbers depend on, without the machine's name."""
    versions = {name: metadata.version(package) for name, package in
                (("collide", "collide-robotics"), ("numpy", "numpy"))}  # fmt: skip
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return {
        "cpu": _cpu(),
        "cores": str(cores),
        "system": platform.system(),
        "python": platform.python_version(),
        **versions,
    }


def _cpu() -> str:
    try:
        models = re.findall(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(), flags=re.MULTILINE)
    except OSError:
        models = []
    return models[0] if models else platform.processor() or platform.machine()


def _installed(distribution: str) -> bool:
    try:
        metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return False
    return True


def rows(runs: int, cold_runs: int, pythons: list[str], only: str) -> list[dict[str, str]]:
    """One row per case and state of the cache; cases whose package is missing are left out, with a word."""
    rows = []
    for case in [case for case in CASES if only in case.name]:
        if case.needs and not _installed(case.needs):
            print(f"left out: {case.name} ({case.needs} is not installed)", file=sys.stderr)
            continue
        for (python, state), taken in measure(case, runs, cold_runs, pythons).items():
            seconds = [run_k.seconds for run_k in taken]
            rows.append({
                "case": case.name, "of": "this" if python == sys.executable else "other", "cache": state,
                "runs": str(len(taken)),
                "median_s": f"{statistics.median(seconds):.3f}", "min_s": f"{min(seconds):.3f}",
                "max_s": f"{max(seconds):.3f}", "peak_MiB": f"{max(run_k.peak for run_k in taken):.0f}",
            })  # fmt: skip
    return rows


def show(table: list[dict[str, str]]) -> None:
    widths = {key: max(len(key), *(len(row[key]) for row in table)) for key in table[0]}
    for line in [{key: key for key in widths}, *table]:
        left_columns = {"case", "of", "cache"}
        print(
            "  ".join(line[k].ljust(w) if k in left_columns else line[k].rjust(w) for k, w in widths.items()).rstrip()
        )


def write(table: list[dict[str, str]], about: dict[str, str]) -> Path:
    """The CSV of this kind of machine; a later run on it takes its place."""
    slug = re.sub(r"[^a-z0-9]+", "-", about["cpu"].lower()).strip("-")
    RESULTS.mkdir(exist_ok=True)
    place = RESULTS / f"startup_{slug}_{about['cores']}-cores.csv"
    with place.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*table[0], *about], lineterminator="\n")
        writer.writeheader()
        writer.writerows({**row, **about} for row in table)
    return place


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=7, help="runs of each case, of the warm ones too (default: 7)")
    parser.add_argument("--cold-runs", type=int, default=3, help="runs with an empty cache (default: 3)")
    parser.add_argument(
        "--against", metavar="PYTHON", help="an interpreter that has another version of collide installed"
    )
    parser.add_argument("--only", default="", help="cases whose names hold this")
    parser.add_argument("--no-csv", action="store_true", help="print the table alone")
    args = parser.parse_args()
    if min(args.runs, args.cold_runs) < 1:
        parser.error("at least one run of each kind is needed")
    about = machine()
    print(", ".join(f"{name} {value}" for name, value in about.items()))
    table = rows(args.runs, args.cold_runs, [sys.executable, *([args.against] if args.against else [])], args.only)
    show(table)
    if not args.no_csv:
        print("written to", write(table, about).relative_to(RESULTS.parent.parent))


if __name__ == "__main__":
    main()
