"""Faults planted in the code around kernels, one at a time, each of which the tests of its room must notice.

    python tests/mutants/planted_faults.py --faults 200 --seed 1          two at a time, seven minutes
    python tests/mutants/planted_faults.py --rooms sweeps --faults 20
    python tests/mutants/planted_faults.py --seed 1 --fault 17            one again, with what pytest says

A fault exchanges a comparison for its neighbour (``<`` for ``<=``, ``==`` for ``!=``, ``in`` for ``not in``), a sum
for a difference, ``and`` for ``or``, or loses a ``not`` or a minus sign. Places are drawn over all rooms, of kernels
none: those have mutants of their own. A copy of the package has the fault and is asked by tests until one fails: first
by those that call the function, the quickest first, and where they pass by all of the room. A run that takes ten times
as long as the room's without a fault counts as noticed. What is not noticed is printed as a difference. Some faults
change nothing that a caller can see, such as ``<`` for ``<=`` where both branches agree: those that were judged so,
with a reason, are lines of `no_change.txt`, and do not count. Ends with status 1 where fewer than the share asked for
were noticed, and where the tests fail without a fault.
"""

from __future__ import annotations

import argparse
import ast
import collections
import itertools
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests" / "kernels"))

from installed_copy import copied

#: Faults that change nothing: ``file | function | code before | code after | why``.
NO_CHANGE = Path(__file__).with_name("no_change.txt")
#: Rooms: modules of the package, and their tests.
ROOMS = {
    "robots": (["collide/robots"], ["tests/robots"]),
    "worlds": (
        ["collide/worlds"], ["tests/worlds", "tests/test_regions_everywhere.py", "tests/engine/test_hollow_worlds.py"],
    ),
    "reports": (["collide/reports"], ["tests/reports", "tests/cli/test_cli.py"]),
    "sweeps": (["collide/sweeps"], ["tests/sweeps"]),
}
NEIGHBOURS = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==", ast.Is: "is not",
    ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in", ast.Add: "-", ast.Sub: "+", ast.And: "or", ast.Or: "and",
}
RESULTS = ("noticed", "missed", "no change")
#: Seconds that a run of tests may take, whatever it took without a fault.
PATIENCE = 60.0
#: So many tests that call a function are asked before all of its room's.
FIRST = 40
#: What pytest returns where a test failed, or a test's file could not be read. Of tests that a fault gave other names
#: nothing was asked.
FAILED = (1, 2)


@dataclass(frozen=True)
class Fault:
    room: str
    file: Path
    function: str
    #: Of characters in the file's text.
    begin: int
    end: int
    code: str

    def text(self) -> str:
        """The whole file with the fault."""
        sound = self.file.read_text(encoding="utf-8")
        return sound[: self.begin] + self.code + sound[self.end :]

    def line(self) -> int:
        return self.file.read_text(encoding="utf-8")[: self.begin].count("\n")

    def name(self) -> str:
        """As `no_change.txt` has it: of what stands there, not where."""
        lines = [text.split("\n")[self.line()].strip() for text in (self.file.read_text(encoding="utf-8"), self.text())]
        return " | ".join([self.file.relative_to(ROOT).as_posix(), self.function, *lines])


def faults_of(room: str, file: Path) -> Iterator[Fault]:
    """All that can be planted in a file."""
    text = file.read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    at = lambda line, column: starts[line - 1] + len(text.splitlines()[line - 1].encode()[:column].decode())

    def between(left: ast.expr, right: ast.expr) -> tuple[int, int]:
        """The operator between two operands, without brackets and blanks around it."""
        begin, end = at(left.end_lineno, left.end_col_offset), at(right.lineno, right.col_offset)
        while text[begin] in ") \n\\":
            begin += 1
        while text[end - 1] in "( \n\\":
            end -= 1
        return begin, end

    def visit(node: ast.AST, function: str) -> Iterator[Fault]:
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            if any(word in ast.unparse(decorator) for decorator in node.decorator_list for word in ("kernel", "entry")):
                return
            function = node.name
            children: list[ast.AST] = list(node.body)
        else:
            children = list(ast.iter_child_nodes(node))
        if function:
            for begin, end, code in exchanges(node):
                if "#" not in text[begin:end] and "\n" not in text[begin:end]:
                    yield Fault(room, file, function, begin, end, code)
        for child in children:
            yield from visit(child, function)

    def exchanges(node: ast.AST) -> Iterator[tuple[int, int, str]]:
        if isinstance(node, ast.Compare):
            for left, operator, right in zip([node.left, *node.comparators], node.ops, node.comparators):
                yield (*between(left, right), NEIGHBOURS[type(operator)])
        elif isinstance(node, ast.BinOp) and type(node.op) in NEIGHBOURS and not _of_text(node):
            yield (*between(node.left, node.right), NEIGHBOURS[type(node.op)])
        elif isinstance(node, ast.BoolOp):
            yield (*between(*node.values[:2]), NEIGHBOURS[type(node.op)])
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.Not, ast.USub)):
            begin = at(node.lineno, node.col_offset)
            yield begin, begin + (3 if isinstance(node.op, ast.Not) else 1), ""

    yield from visit(ast.parse(text), "")


def _of_text(node: ast.BinOp) -> bool:
    """Texts and lists are only ever added."""
    return any(isinstance(part, (ast.JoinedStr, ast.List, ast.Tuple)) or (isinstance(part, ast.Constant)
               and isinstance(part.value, str)) for part in ast.walk(node))


def drawn(rooms: list[str], many: int, seed: int) -> list[Fault]:
    """As many of each room, in an order of their own."""
    generator = random.Random(seed)
    found = []
    for place, room in enumerate(rooms):
        files = sorted(file for folder in ROOMS[room][0] for file in (ROOT / folder).rglob("*.py"))
        all_of_room = [fault for file in files for fault in faults_of(room, file)]
        share = many // len(rooms) + (place < many % len(rooms))
        found += generator.sample(all_of_room, min(share, len(all_of_room)))
    generator.shuffle(found)
    return found


class Copy:
    """The package as it is installed, and its tests, in a folder of its own."""

    def __init__(self, folder: Path):
        self.folder, self.moments = folder, itertools.count(int(time.time()))
        package = copied(folder / "package") / "collide"
        shutil.copytree(ROOT / "tests", folder / "checkout" / "tests", ignore=shutil.ignore_patterns("__pycache__"))
        for name, place in (("collide", package), ("adapters", package / "adapters"), ("scenes", package / "scenes")):
            (folder / "checkout" / name).symlink_to(place)
        for file in ("pyproject.toml", "README.md"):
            shutil.copy(ROOT / file, folder / "checkout")
        for name in ("docs", "examples", "benchmarks", "native"):
            (folder / "checkout" / name).symlink_to(ROOT / name)
        if (shared := ROOT.parent / "shared").is_dir():
            (folder / "shared").symlink_to(shared)

    def test(self, tests: list[str], patience: float, *more: str) -> tuple[int, str]:
        """What pytest returns for tests, and what it says. Bytecode is kept: a run would take twice as long without."""
        path = [self.folder / "package", self.folder / "checkout" / "tests" / "mutants"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, path)), "REACHED": str(self.reached)}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--tb=line", *more, *tests]
        where = {"cwd": self.folder / "checkout", "env": environment}
        try:
            done = subprocess.run(command, **where, capture_output=True, text=True, check=False, timeout=patience)
        except subprocess.TimeoutExpired:
            return FAILED[0], f"no end within {patience:.0f} s"
        return done.returncode, done.stdout[-2000:] + done.stderr[-500:]

    @property
    def reached(self) -> Path:
        return self.folder / "reached.json"

    def planted(self, fault: Fault, sound: Sound) -> tuple[bool, str]:
        """Whether all tests pass with a fault, and what pytest says."""
        self._write(fault, fault.text())
        try:
            if first := sound.tests_of(fault):
                status, said = self.test(first, sound.patience)
                if status in FAILED:
                    return False, said
            status, said = self.test(ROOMS[fault.room][1], sound.patience)
            return status == 0, said
        finally:
            self._write(fault, fault.file.read_text(encoding="utf-8"))

    def _write(self, fault: Fault, text: str) -> None:
        """With a time of its own: bytecode is taken for a file's where its time and size are those it was made of."""
        place = self.folder / "package" / fault.file.relative_to(ROOT)
        place.write_text(text, encoding="utf-8")
        os.utime(place, (moment := next(self.moments), moment))


@dataclass(frozen=True)
class Sound:
    """A room without a fault. reached : of each test, the quickest first, the functions that it calls."""

    seconds: float
    patience: float
    reached: dict[str, list[str]]

    def tests_of(self, fault: Fault) -> list[str]:
        """The quickest that call the function with the fault."""
        function = f"{fault.file.relative_to(ROOT).as_posix()}:{fault.function}"
        return [test for test, functions in self.reached.items() if function in functions][:FIRST]


def sound_room(copy: Copy, room: str) -> tuple[Sound | None, str]:
    """The tests of a room without a fault, in two orders: whatever needs one order would notice every fault."""
    status, said = copy.test(ROOMS[room][1], 1200.0, "-p", "reached")
    if status:
        return None, said
    took = json.loads(copy.reached.read_text(encoding="utf-8"))
    reached = {test: functions for test, (_, functions) in sorted(took.items(), key=lambda item: item[1][0])}
    begun = time.perf_counter()
    status, said = copy.test(list(reached), 1200.0)
    seconds = time.perf_counter() - begun
    return (None if status else Sound(seconds, max(PATIENCE, 10 * seconds), reached)), said


def judged() -> dict[str, str]:
    """Faults that change nothing, and why."""
    lines = NO_CHANGE.read_text(encoding="utf-8").splitlines() if NO_CHANGE.is_file() else []
    return dict(line.rsplit(" | ", 1) for line in lines if line.strip() and not line.startswith("#"))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--faults", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", default=",".join(ROOMS), help="with commas between (%(default)s)")
    parser.add_argument("--share", type=float, default=0.92, help="of faults that are to be noticed (%(default)s)")
    parser.add_argument("--fault", type=int, help="plant this one alone")
    parser.add_argument("--processes", type=int, default=2)
    given = parser.parse_args()
    rooms = given.rooms.split(",")
    if unknown := set(rooms) - set(ROOMS):
        parser.error(f"--rooms: {', '.join(sorted(unknown))}: not among {', '.join(ROOMS)}")
    faults = list(enumerate(drawn(rooms, given.faults, given.seed)))
    if given.fault is not None:
        faults = [faults[given.fault]]
        rooms = [faults[0][1].room]
    with tempfile.TemporaryDirectory() as folder:
        status = _run(Path(folder), rooms, faults, given)
    sys.exit(status)


def _run(folder: Path, rooms: list[str], faults: list[tuple[int, Fault]], given: argparse.Namespace) -> int:
    copies = [Copy(folder / str(number)) for number in range(given.processes)]
    free, nothing, counts = list(copies), judged(), collections.Counter[tuple[str, str]]()

    def with_copy(ask: Callable[[Copy], Any]) -> Any:
        copy = free.pop()
        try:
            return ask(copy)
        finally:
            free.append(copy)

    sound: dict[str, Sound] = {}
    with ThreadPoolExecutor(given.processes) as pool:
        asked = pool.map(lambda room: with_copy(lambda copy: sound_room(copy, room)), rooms)
        for room, (found, said) in zip(rooms, asked):
            if found is None:
                print(f"{room}: its tests fail without a fault\n{said}")
                return 1
            sound[room] = found
            print(f"{room}: its {len(found.reached)} tests take {found.seconds:.0f} s", flush=True)

    def ask(numbered: tuple[int, Fault]) -> tuple[int, Fault, bool, str]:
        number, fault = numbered
        return number, fault, *with_copy(lambda copy: copy.planted(fault, sound[fault.room]))

    with ThreadPoolExecutor(given.processes) as pool:
        for number, fault, passed, said in pool.map(ask, faults):
            known = passed and fault.name() in nothing
            result = "no change" if known else "missed" if passed else "noticed"
            counts[fault.room, result] += 1
            if result == "missed" or given.fault is not None:
                place = f"{fault.file.relative_to(ROOT)}:{fault.line() + 1}"
                print(f"{number}: {result}: {place}\n    {fault.name()}", flush=True)
            if given.fault is not None:
                print(said)
    for room in rooms:
        print(f"{room:8}", ", ".join(f"{counts[room, result]} {result}" for result in RESULTS))
    noticed, missed, _ = (sum(counts[room, result] for room in rooms) for result in RESULTS)
    share = noticed / max(noticed + missed, 1)
    print(f"{noticed} of {noticed + missed} noticed: {share:.1%}, to be at least {given.share:.0%}")
    return int(share < given.share)


if __name__ == "__main__":
    main()
