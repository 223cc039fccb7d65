"""Compiled kernels on disk: found again, dropped with any edit of a source, done without where nothing can be written.

Each test runs a copy of the package in processes of its own, with a cache folder of its own.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import collide
from collide import _lean_compile
from collide.geometry.tables import moved_pose
from collide.kernels import PLAIN_PYTHON, address_of, entry, view_f64

#: Asks for a bounding box: the smallest kernel, whose callee `support_vertex` stands in another file.
CHILD = """
import json, sys
import numpy as np
import collide
from collide import _jit
from collide.geometry.tables import ShapeTable, pose_table
from collide.geometry.boxes import boxes_of

packed, X = collide.ConvexHull([(0, 0, 0), (1, 2, 3), (-4, -5, -6)]).parts()[0]
poses = pose_table(np.eye(4)[None], X[None], np.array([packed.reach]))
box = boxes_of(ShapeTable([packed]), poses.rows, np.zeros(1, dtype=np.int64))
print(json.dumps({
    "box": box.round(6).tolist(), "hash": _jit.source_hash(), "folder": str(_jit.kernel_cache_folder()),
    "package": collide.__file__,
}))
"""


def ask(site: Path, cache: Path):
    """(answer, what was written to stderr) of a process that uses the package under ``site``."""
    child = subprocess.run(
        [sys.executable, "-c", CHILD], env={**os.environ, "COLLIDE_CACHE_DIR": str(cache), "PYTHONPATH": str(site)},
        cwd=site, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert child.returncode == 0, child.stderr[-3000:]
    answer = json.loads(child.stdout)
    assert Path(answer["package"]).resolve().is_relative_to(site.resolve())
    return answer, child.stderr


@pytest.fixture()
def site(tmp_path) -> Path:
    shutil.copytree(
        Path(collide.__file__).parent, tmp_path / "site" / "collide",
        ignore=shutil.ignore_patterns("__pycache__", "adapters", "scenes"),
    )  # fmt: skip
    return tmp_path / "site"


def files_in(folder: str) -> dict[str, int]:
    return {file.name: file.stat().st_mtime_ns for file in Path(folder).iterdir() if file.suffix == ".kernel"}


def test_an_edit_in_a_callee_is_seen_and_the_old_kernels_stay_apart(site, tmp_path):
    cache = tmp_path / "cache"
    first, said = ask(site, cache)
    assert first["box"] == [[-4, -5, -6, 1, 2, 3]] and not said
    kept = files_in(first["folder"])
    assert kept and Path(first["folder"]).is_relative_to(cache)

    again, _ = ask(site, cache)
    assert again == first and files_in(first["folder"]) == kept, "the second process compiled anew"

    callee = site / "collide" / "geometry" / "supports.py"
    source = callee.read_text()
    assert source.count("    return k\n") == 1
    callee.write_text(source.replace("    return k\n", "    return 0\n"))
    edited, _ = ask(site, cache)
    assert edited["hash"] != first["hash"] and edited["folder"] != first["folder"]
    assert edited["box"] == [[0, 0, 0, 0, 0, 0]], "an answer of the old source"
    assert files_in(first["folder"]) == kept

    callee.write_text(source)
    assert ask(site, cache)[0] == first


def test_edits_that_no_kernel_reads_keep_the_cache(site, tmp_path):
    first, _ = ask(site, tmp_path / "cache")
    kept = files_in(first["folder"])
    world = site / "collide" / "world.py"
    world.write_text(world.read_text() + "\n# a remark\n")
    again, _ = ask(site, tmp_path / "cache")
    assert again["folder"] == first["folder"] and files_in(first["folder"]) == kept


def test_a_folder_that_cannot_be_written_is_said_and_done_without(site, tmp_path):
    blocked = tmp_path / "a file"
    blocked.write_text("not a folder")
    answer, said = ask(site, blocked)
    assert answer["box"] == [[-4, -5, -6, 1, 2, 3]]
    assert "COLLIDE_CACHE_DIR" in said and str(blocked) in said
    assert said.count("cannot be kept") == 1


def test_importing_the_package_does_not_import_numba(site):
    code = "import sys, collide, collide.errors, collide.shapes; collide.Box((1, 1, 1)); print('numba' in sys.modules)"
    child = subprocess.run([sys.executable, "-c", code], cwd=site, capture_output=True, text=True, timeout=60, check=True)
    assert child.stdout.strip() == "False"


@pytest.mark.parametrize("damage", ["cut", "empty"])
def test_a_damaged_kernel_is_compiled_anew(site, tmp_path, damage):
    cache = tmp_path / "kernels"
    first, _ = ask(site, cache)
    (file,) = cache.rglob("*bounding_boxes*.kernel")
    file.write_bytes(b"" if damage == "empty" else file.read_bytes()[:500])
    again, said = ask(site, cache)
    assert again["box"] == first["box"] and "damaged" in said
    last, said = ask(site, cache)
    assert last["box"] == first["box"] and "damaged" not in said


#: Compiles a kernel, and one that cannot be, and compares what `_lean_compile.py` exchanges before and after.
COMPILES = """
import gc, sys
import collide._lean_compile as lean
from collide import _jit

def parts():
    return [
        (owner.__name__, name, vars(owner)[name])
        for owner, name, _ in lean._translated_once("x", True) + lean._without_idle_work() + lean._silent_events()
    ]

@_jit.kernel
def twice(x):
    return 2.0 * x

@_jit.entry("float64(float64, int64)")
def power(x, n):
    '''x to the power 2ⁿ, doubled.'''
    for _ in range(n):
        x = x * x
    return twice(max(x, 0.0))

@_jit.entry("float64(float64)")
def wrong(x):
    return nobody_knows_this(x)

before, thresholds = parts(), gc.get_threshold()
assert len(before) >= 15, before
assert power(3.0, 2) == 162.0
try:
    wrong(1.0)
except Exception as error:
    assert "nobody_knows_this" in str(error), error
else:
    raise AssertionError("compiled what is not there")
assert parts() == before and gc.get_threshold() == thresholds
print("as before")
"""


def test_compiling_leaves_numba_and_the_garbage_collector_as_they_were(tmp_path):
    script = tmp_path / "compiles.py"
    script.write_text(COMPILES)
    root = str(Path(collide.__file__).parent.parent)
    child = subprocess.run(
        [sys.executable, script], env={**os.environ, "COLLIDE_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": root},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert child.stdout == "as before\n", child.stderr[-3000:]


def _statements(function):
    from numba.core import compiler

    return [statement for block in compiler.run_frontend(function).blocks.values() for statement in block.body]


def test_variables_of_statements_are_those_numba_finds():
    from numba.core import ir

    statements = [statement for function in (moved_pose, _doubled) for statement in _statements(function)]
    assert len(statements) > 100
    for statement in statements:
        own = _lean_compile._variables_of(statement, vars(statement))
        assert [v.name for v in own] == [v.name for v in ir.Inst._rec_list_vars(statement, vars(statement))]


@pytest.mark.skipif(PLAIN_PYTHON, reason="nothing is compiled")
def test_who_listens_to_numba_hears_of_kernels(monkeypatch, tmp_path):
    from numba.core import event

    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path))
    heard = event.RecordingListener()
    with event.install_listener("numba:run_pass", heard):
        assert entry("float64(float64)")(_doubled)(1.5) == 3.0
    assert heard.buffer


def _doubled(x):
    return 2.0 * x


@pytest.mark.skipif(PLAIN_PYTHON, reason="nothing is compiled")
def test_hasty_entries_give_the_same_bits(monkeypatch, tmp_path):
    small, make_smaller = [], _lean_compile._make_smaller
    monkeypatch.setattr(_lean_compile, "_make_smaller", lambda *given: small.append(1) or make_smaller(*given))
    found = []
    for hasty in (False, True):
        monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / str(hasty)))
        wave = entry("float64(float64, int64)", hasty=hasty)(_wave)
        found.append([wave(0.1 * k, k).hex() for k in range(60)])
        assert bool(small) == (hasty and _lean_compile._CAN_CHOOSE)
    assert found[0] == found[1] and len(set(found[0])) > 50


def _wave(x, n):
    total = 0.0
    for k in range(n):
        total = x - total * total / 3.0 if total < 1.0 else total / (k + x)
    return total


#: Compiles an entry, and a function of somebody else's, while another entry is compiled: as a signal's handler would.
NESTED = """
import numba
import numpy as np
from numba.core.cpu import CPUContext
from collide import _jit

@_jit.entry("float64(float64)")
def outer(x):
    return 2.0 * x

@_jit.entry("float64(float64)")
def inner(x):
    return 3.0 * x

@numba.njit
def somebody_elses(numbers, i):
    return numbers[i]

went_on, meanwhile = CPUContext.post_lowering, []

def interrupted(self, module, library):
    CPUContext.post_lowering = went_on
    meanwhile.extend([inner(1.0), somebody_elses(np.array([1.0, 5.0]), -1)])
    return went_on(self, module, library)

CPUContext.post_lowering = interrupted
assert outer(1.0) == 2.0
assert meanwhile == [3.0, 5.0] == [inner(1.0), somebody_elses(np.array([1.0, 5.0]), -1)], meanwhile
print("both")
"""


def _of_a_kernel(at, n, i):
    return view_f64(at, n)[i]


def _of_another(at, n, i):
    return view_f64(at, n)[i]


@pytest.mark.skipif(PLAIN_PYTHON, reason="Python counts from the end")
def test_indices_of_kernels_do_not_count_from_the_end(monkeypatch, tmp_path):
    """They are used as they are: what lies before a view is read. Other functions keep numba's way."""
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path))
    numbers = np.arange(10.0)
    ask = entry("float64(int64, int64, int64)")
    assert ask(_of_another)(address_of(numbers) + 40, 3, -1) == 7.0
    monkeypatch.setattr(_lean_compile, "_OF_COLLIDE", "_ZN")
    assert ask(_of_a_kernel)(address_of(numbers) + 40, 3, -1) == 4.0


def test_what_else_is_compiled_meanwhile_is_compiled_as_well(tmp_path):
    script = tmp_path / "nested.py"
    script.write_text(NESTED)
    root = str(Path(collide.__file__).parent.parent)
    child = subprocess.run(
        [sys.executable, script], env={**os.environ, "COLLIDE_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": root},
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert child.stdout == "both\n", child.stderr[-3000:]
