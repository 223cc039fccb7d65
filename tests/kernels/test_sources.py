"""Which sources a kernel is made from: an edit that it can see makes old machine code stale, any other does not."""

from __future__ import annotations

import builtins
import json
import os
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
    assert not {"__init__.py", "pairs/query.py", "shapes/mesh.py", "kernels/jit.py", "kernels/library.py"} & set(names)
    assert 80 < len(names) < 380 and sum(os.path.getsize(copy / name) for name in names) < 3e6


@pytest.mark.slow
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


def forget() -> None:
    for known in (
        sources._parsed, sources._imported, sources._compiler_parts, sources._definitions_seen_by, sources._faces,
        sources.of_compiler,
    ):
        known.cache_clear()


@pytest.fixture()
def hashes(copy, monkeypatch):
    """Hashes of all entries, from the sources as they are in the copy at the time of the call."""

    def file_of(module: str) -> Path | None:
        relative = Path(*module.split(".")[1:])
        places = (copy / relative.with_suffix(".py"), copy / relative / "__init__.py")
        return next((place for place in places if module.startswith("collide.") and place.is_file()), None)

    def read() -> dict[str, str]:
        forget()
        return sources.entry_hashes()

    monkeypatch.setattr(sources, "_file", file_of)
    yield read
    forget()


#: Hashes of the sources as they are, the same for each copy of them.
UNEDITED: dict[str, str] = {}


def changed_by(hashes, file: Path, old: str, new: str) -> set[str]:
    """Entries whose hash changes with an edit of a file."""
    if not UNEDITED:
        UNEDITED.update(hashes())
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1, f"{old!r} is {text.count(old)} times in {file.name}"
    file.write_text(text.replace(old, new), encoding="utf-8")
    after = hashes()
    file.write_text(text, encoding="utf-8")
    assert set(UNEDITED) == set(after)
    return {name for name in UNEDITED if UNEDITED[name] != after[name]}


@pytest.mark.slow
@pytest.mark.many(2)
@pytest.mark.parametrize(
    ("name", "old", "new", "stale", "fresh"),
    [
        # a function that another calls, of another file
        ("support/support_mapping.py", "    return k\n", "    return 0\n", {"bounding_boxes"}, {"build_mesh"}),
        # a function that few call
        ("contact/reduce_points.py", "    n_taken = 1\n", "    n_taken = 3\n", {"contacts_single"}, {"answer_pairs"}),
        # a number of a module
        ("numerics/double_double.py", "2.0**-102", "2.0**-101", {"bound_motions"}, {"bounding_boxes"}),
        # what makes code of all
        ("kernels/back_end.py", "speed_level=0", "speed_level=1", {"answer_pairs", "build_mesh"}, set()),
        # where a name comes from
        ("narrowphase/pair_kernel.py", "annotations\n", "annotations\nimport collide.casts\n", set(), {"answer_pairs"}),
    ],
)
def test_an_edit_makes_stale_what_reaches_it_and_nothing_else(copy, hashes, name, old, new, stale, fresh):
    changed = changed_by(hashes, copy / name, old, new)
    assert stale <= changed and not fresh & changed


#: Functions that an entry reaches as Python finds them: globals of functions, and what functions hold, by module and
#: name; beside them what the sources say.
REACHED = """
import importlib, json
from pathlib import Path
from collide.kernels import PLAIN_PYTHON, sources

assert PLAIN_PYTHON, "entries are functions"

def inner(code):
    yield code
    for constant in code.co_consts:
        if hasattr(constant, "co_code"):
            yield from inner(constant)

def reached(entry):
    found, waiting = set(), [entry]
    while waiting:
        function = waiting.pop()
        module = getattr(function, "__module__", None) or ""
        if not hasattr(function, "__code__") or not module.startswith("collide.") or function in found:
            continue
        found.add(function)
        names = {name for code in inner(function.__code__) for name in code.co_names}
        waiting += [function.__globals__[name] for name in names if name in function.__globals__]
        waiting += [cell.cell_contents for cell in function.__closure__ or ()]
    return found

modules = [sources._module_of(path) for path in sources._files_of_entries()]
missing, count = [], 0
for module in modules:
    for name in (name for name, part in sources._parsed(module).definitions.items() if part.is_entry):
        told = {*sources.definitions_reached(module, (name,))}
        for function in reached(getattr(importlib.import_module(module), name)):
            count += 1
            outermost = function.__module__, function.__qualname__.split(".")[0]
            if not outermost[0].startswith("collide.kernels") and outermost not in told:
                missing.append((name, *outermost))
print(json.dumps([count, missing]))
"""


@pytest.mark.slow
def test_every_function_that_python_finds_from_an_entry_is_in_its_hash():
    """Read from the sources alone, the hash must see what Python's own look-up of names sees."""
    done = child(["-c", REACHED], environment(PACKAGE.parent, NUMBA_DISABLE_JIT="1"))
    assert done.returncode == 0, done.stderr[-3000:]
    count, missing = json.loads(done.stdout)
    assert count > 3000 and not missing, missing[:10]


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
