"""Which sources a kernel is made from: an edit that it can see makes old machine code stale, any other does not."""

from __future__ import annotations

import builtins
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from installed_copy import PACKAGE, child, copied, environment

from collide.kernels import sources

# --- the checksum of all ----------------------------------------------------------------------------


@pytest.fixture()
def copy(tmp_path, monkeypatch) -> Path:
    """A copy of the package, whose sources `fingerprint` reads."""
    package = copied(tmp_path / "site") / "collide"
    monkeypatch.setattr(sources, "PACKAGE", package)
    return package


def is_of_kernels(name: str) -> bool:
    """Whether a file of the package, "geometry/scan.py", belongs to what the library is compiled from."""
    return any(name == known or name.startswith(f"{known}/") for known in sources.KERNEL_SOURCES)


def test_the_checksum_changes_with_every_source_of_kernels_and_with_nothing_else(copy):
    first, changed, unchanged = sources.fingerprint(), [], []
    for file in sorted(file for file in copy.rglob("*") if file.is_file()):
        if file.suffix in (".so", ".dll", ".dylib"):
            continue
        content = file.read_bytes()
        file.write_bytes(content + b"\n")
        (unchanged if sources.fingerprint() == first else changed).append(file.relative_to(copy).as_posix())
        file.write_bytes(content)
    assert sources.fingerprint() == first
    assert [name for name in changed if not (is_of_kernels(name) and name.endswith(".py"))] == []
    assert [name for name in unchanged if is_of_kernels(name) and name.endswith(".py")] == []
    assert len(changed) > 80 and len(unchanged) > 80


def test_the_checksum_sees_files_that_come_go_and_change_their_names(copy):
    first, scan = sources.fingerprint(), copy / "geometry" / "scan.py"
    seen = {first}
    scan.rename(scan.with_name("scan_again.py"))
    seen.add(sources.fingerprint())
    scan.with_name("scan_again.py").rename(scan)
    (copy / "narrowphase" / "new.py").write_bytes(b"")
    seen.add(sources.fingerprint())
    (copy / "narrowphase" / "new.py").unlink()
    (copy / "narrowphase" / "a room").mkdir()
    (copy / "narrowphase" / "a room" / "new.py").write_bytes(b"")
    seen.add(sources.fingerprint())
    (copy / "narrowphase" / "a room" / "new.py").unlink()
    assert len(seen) == 4 and sources.fingerprint() == first


def test_the_checksum_does_not_depend_on_ends_of_lines_or_on_the_place(copy, tmp_path, monkeypatch):
    """A checkout on Windows, and what Python keeps beside its sources."""
    first = sources.fingerprint()
    scan = copy / "geometry" / "scan.py"
    scan.write_bytes(scan.read_bytes().replace(b"\n", b"\r\n"))
    (copy / "geometry" / "__pycache__").mkdir()
    (copy / "geometry" / "__pycache__" / "left.py").write_bytes(b"x = 1\n")
    assert sources.fingerprint() == first
    copy.rename(tmp_path / "elsewhere")
    monkeypatch.setattr(sources, "PACKAGE", tmp_path / "elsewhere")
    assert sources.fingerprint() == first


def test_the_checksum_reads_each_source_once_and_nothing_else(copy, monkeypatch):
    """It is part of every start."""
    opened, kept = [], builtins.open
    monkeypatch.setattr(builtins, "open", lambda file, *given, **named: opened.append(str(file)) or kept(file, *given, **named))
    sources.fingerprint()
    monkeypatch.undo()
    expected = [str(file) for file in copy.rglob("*.py") if is_of_kernels(file.relative_to(copy).as_posix())]
    assert sorted(opened) == sorted(expected)
    assert 80 < len(opened) < 160 and sum(os.path.getsize(file) for file in opened) < 2e6


# --- the hash of one kernel -------------------------------------------------------------------------

#: Hashes of two entries, before and after each of some files is edited, by paths in the package.
HASHES = """
import json, os, sys
from pathlib import Path
from collide.geometry.boxes import bounding_boxes
from collide.kernels import PLAIN_PYTHON, sources
from collide.narrowphase.answer import answer_pairs

assert PLAIN_PYTHON, "entries are functions"

def hashes():
    return [sources.of_function(entry) for entry in (bounding_boxes, answer_pairs)]

first, found = hashes(), {}
for name in json.loads(sys.argv[1]):
    file = sources.PACKAGE / name
    content = file.read_bytes()
    file.write_bytes(content + b"\\n")
    found[name] = [one != two for one, two in zip(first, hashes())]
    file.write_bytes(content)
assert hashes() == first
print(json.dumps([first, found]))
"""


def hashes(site: Path, names: list[str]) -> tuple[list[str], dict[str, list[bool]]]:
    done = child(["-c", HASHES, json.dumps(names)], environment(site, NUMBA_DISABLE_JIT="1"))
    assert done.returncode == 0, done.stderr[-3000:]
    first, found = json.loads(done.stdout)
    return first, found


def imported_by(module: str) -> set[str]:
    """Files of the package that Python loads for a module, by running it."""
    code = f"import sys, {module}\nfor m in list(sys.modules.values()): print(getattr(m, '__file__', None))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(PACKAGE.parent)}
    said = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=True).stdout
    files = (Path(line) for line in said.splitlines() if line.endswith(".py"))
    return {file.relative_to(PACKAGE).as_posix() for file in files if file.is_relative_to(PACKAGE)}


def test_an_edit_of_what_a_kernel_imports_makes_it_stale_and_no_other_does(tmp_path):
    site = copied(tmp_path / "site")
    names = sorted(file.relative_to(site / "collide").as_posix() for file in (site / "collide").rglob("*.py"))
    _, found = hashes(site, names)
    boxes, pairs = ({name for name, stale in found.items() if stale[k]} for k in range(2))
    assert {"geometry/boxes.py", "geometry/supports.py", "geometry/scan.py", "kernels/vectors.py"} <= boxes
    assert {"narrowphase/answer.py", "narrowphase/epa/prove.py", "geometry/double_double.py"} <= pairs
    assert not {"narrowphase/answer.py", "geometry/mesh_tree/build.py"} & boxes
    elsewhere = {name for name in names if name.split("/")[0] in ("world.py", "query.py", "manifolds", "reports", "meshes", "cli.py")}
    assert not elsewhere & pairs
    # `collide` itself, and rooms' own files, which import nothing that kernels use, may be missing; and what only decides how
    # kernels run.
    deciding = {f"kernels/{name}.py" for name in ("jit", "library", "mode", "plain", "sources", "object_cache")} | {"errors.py", "journal.py", "cache_folder.py"}
    for module, stale in (("collide.geometry.boxes", boxes), ("collide.narrowphase.answer", pairs)):
        missing = {name for name in imported_by(module) - stale - deciding if not name.endswith("__init__.py")}
        assert not missing, f"{module} imports what its kernels' hash does not see: {sorted(missing)}"


def test_hashes_are_those_of_any_copy_and_process(tmp_path):
    """So that kernels kept on disk are found again; and an edit of a function beside counts, being of the same file."""
    one, two = copied(tmp_path / "one"), copied(tmp_path / "two")
    first, _ = hashes(one, [])
    assert hashes(two, [])[0] == first
    boxes = two / "collide" / "geometry" / "boxes.py"
    boxes.write_text(boxes.read_text(encoding="utf-8") + "\n\ndef beside():\n    return 0\n", encoding="utf-8")
    edited, _ = hashes(two, [])
    assert edited[0] != first[0]


def of_lines(k: int):
    """Functions alike but for a number of theirs."""

    def shifted(x):
        return x + k

    return shifted


def test_functions_made_of_one_source_differ_by_what_they_hold():
    found = {sources.of_function(of_lines(k)) for k in range(4)}
    assert len(found) == 4 and sources.of_function(of_lines(2)) in found


def test_functions_typed_in_by_hand_have_hashes(monkeypatch):
    """In a session there is a module, and no file that tells what it imports."""
    made = {}
    monkeypatch.setitem(sys.modules, "typed_in", ModuleType("typed_in"))
    for text in ("x + 1", "x + 2", "x + 1.0", "x - 1", "abs(x)"):
        space = {"__name__": "typed_in"}
        exec(f"def typed(x):\n    return {text}\n", space)  # noqa: S102
        made[text] = sources.of_function(space["typed"])
    assert len(set(made.values())) == 5
