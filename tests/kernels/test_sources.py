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


def test_the_list_holds_what_defines_kernels_and_what_these_see(copy):
    names = sources.kernel_sources()
    assert {"narrowphase/gjk/gjk.py", "numerics/digits.py", "results.py", "kernels/vectors.py"} <= set(names)
    assert not {"__init__.py", "query.py", "shapes/mesh.py", "kernels/jit.py", "kernels/library.py"} & set(names)
    assert 80 < len(names) < 250 and sum(os.path.getsize(copy / name) for name in names) < 2e6


def test_the_checksum_changes_with_every_source_of_kernels_and_with_nothing_else(copy):
    names = sources.kernel_sources()
    first, changed = sources.fingerprint(names), []
    others = {file for file in copy.rglob("*.py") if file.relative_to(copy).as_posix() not in names}
    assert len(others) > 100
    for file in others:  # all at once: none of them is read
        file.write_bytes(file.read_bytes() + b"\n")
    assert sources.fingerprint(names) == first
    for file in sorted({*copy.rglob("*.py")} - others):
        content = file.read_bytes()
        file.write_bytes(content + b"\n")
        if sources.fingerprint(names) != first:
            changed.append(file.relative_to(copy).as_posix())
        file.write_bytes(content)
    assert sources.fingerprint(names) == first and tuple(changed) == names


def test_the_list_follows_files_that_come_and_go_and_change_their_names(copy):
    names, scan = sources.kernel_sources(), copy / "support" / "block_scan.py"
    scan.rename(scan.with_name("scan_again.py"))
    with pytest.raises(FileNotFoundError):
        sources.fingerprint(names)
    scan.with_name("scan_again.py").rename(scan)
    (copy / "narrowphase" / "new.py").write_bytes(
        b"from collide.kernels import entry\n\n\n@entry('int64()')\ndef new():\n    return 0\n"
    )
    assert set(sources.kernel_sources()) - set(names) == {"narrowphase/new.py"}


def test_the_checksum_does_not_depend_on_ends_of_lines_or_on_the_place(copy, tmp_path, monkeypatch):
    """A checkout on Windows."""
    names = sources.kernel_sources()
    first = sources.fingerprint(names)
    scan = copy / "support" / "block_scan.py"
    scan.write_bytes(scan.read_bytes().replace(b"\n", b"\r\n"))
    assert sources.fingerprint(names) == first
    copy.rename(tmp_path / "elsewhere")
    monkeypatch.setattr(sources, "PACKAGE", tmp_path / "elsewhere")
    assert sources.fingerprint(names) == first


def test_the_checksum_reads_each_source_once_and_nothing_else(copy, monkeypatch):
    """It is part of every start."""
    names, opened, kept = sources.kernel_sources(), [], builtins.open
    monkeypatch.setattr(
        builtins, "open", lambda file, *given, **named: opened.append(str(file)) or kept(file, *given, **named)
    )
    sources.fingerprint(names)
    monkeypatch.undo()
    assert opened == [str(copy / name) for name in names]


# --- the hash of one kernel -------------------------------------------------------------------------

#: Hashes of two entries, before and after some files are edited, a group of them at once, by paths in the package.
HASHES = """
import json, os, sys
from pathlib import Path
from collide.broadphase.bounding_boxes import bounding_boxes
from collide.kernels import PLAIN_PYTHON, sources
from collide.narrowphase.pair_kernel import answer_pairs

assert PLAIN_PYTHON, "entries are functions"

def hashes():
    return [sources.of_function(entry) for entry in (bounding_boxes, answer_pairs)]

first, found = hashes(), {}
for names in json.loads(sys.argv[1]):
    content = {name: (sources.PACKAGE / name).read_bytes() for name in names}
    for name in names:
        (sources.PACKAGE / name).write_bytes(content[name] + b"\\n")
    told = [one != two for one, two in zip(first, hashes())]
    found.update({name: told for name in names})
    for name in names:
        (sources.PACKAGE / name).write_bytes(content[name])
assert hashes() == first
print(json.dumps([first, found]))
"""


def hashes(site: Path, groups: list[list[str]]) -> tuple[list[str], dict[str, list[bool]]]:
    done = child(["-c", HASHES, json.dumps(groups)], environment(site, NUMBA_DISABLE_JIT="1"))
    assert done.returncode == 0, done.stderr[-3000:]
    first, found = json.loads(done.stdout)
    return first, found


def imported_by(module: str) -> set[str]:
    """Files of the package that Python loads for a module, by running it."""
    code = f"import sys, {module}\nfor m in list(sys.modules.values()): print(getattr(m, '__file__', None))"
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(PACKAGE.parent)}
    said = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, timeout=60, check=True
    ).stdout
    files = (Path(line) for line in said.splitlines() if line.endswith(".py"))
    return {file.relative_to(PACKAGE).as_posix() for file in files if file.is_relative_to(PACKAGE)}


def test_an_edit_of_what_a_kernel_imports_makes_it_stale_and_no_other_does(tmp_path):
    site = copied(tmp_path / "site")
    names = sorted(file.relative_to(site / "collide").as_posix() for file in (site / "collide").rglob("*.py"))
    kernels = set(sources.kernel_sources())
    others = [name for name in names if name not in kernels]
    _, found = hashes(site, [*([name] for name in names if name in kernels), others])
    assert len(others) > 100 and not any(found[others[0]]), "an edit of what is no source of any kernel"
    boxes, pairs = ({name for name, stale in found.items() if stale[k]} for k in range(2))
    assert {
        "broadphase/bounding_boxes.py",
        "support/support_mapping.py",
        "support/block_scan.py",
        "kernels/vectors.py",
    } <= boxes
    assert {"narrowphase/pair_kernel.py", "narrowphase/epa/prove_facets.py", "numerics/double_double.py"} <= pairs
    assert not {"narrowphase/pair_kernel.py", "mesh/build_bvh.py"} & boxes
    elsewhere = {
        name
        for name in names
        if name.split("/")[0] in ("world.py", "query.py", "manifolds", "reports", "meshes", "cli.py")
    }
    assert not elsewhere & pairs
    # `collide` itself, and rooms' own files, which import nothing that kernels use, may be missing; and what only
    # decides how kernels run.
    deciding = {f"kernels/{name}.py" for name in ("jit", "library", "mode", "plain", "sources", "object_cache")} | {
        "errors.py",
        "log.py",
        "cache_folder.py",
    }
    for module, stale in (("collide.broadphase.bounding_boxes", boxes), ("collide.narrowphase.pair_kernel", pairs)):
        missing = {name for name in imported_by(module) - stale - deciding if not name.endswith("__init__.py")}
        assert not missing, f"{module} imports what its kernels' hash does not see: {sorted(missing)}"


def test_hashes_are_those_of_any_copy_and_process(tmp_path):
    """So that kernels kept on disk are found again; and an edit of a function beside counts, being of the same file."""
    one, two = copied(tmp_path / "one"), copied(tmp_path / "two")
    first, _ = hashes(one, [])
    assert hashes(two, [])[0] == first
    boxes = two / "collide" / "broadphase" / "bounding_boxes.py"
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
