"""What a build takes from the one before: nothing that an edit concerns, and with what it makes anew the same bytes as
a build from nothing."""

from __future__ import annotations

import ctypes
import json
import multiprocessing
import os
import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import pytest
from installed_copy import child, copied, environment

from collide.kernels import kept_lowered

NATIVE = Path(__file__).resolve().parents[2] / "native"
pytest.importorskip("numba", reason="kernels are compiled by numba: pip install 'collide-robotics[jit]'")
if multiprocessing.get_start_method() != "fork" or shutil.which("cc") is None:
    pytest.skip("needs processes that share what is imported, and a C compiler", allow_module_level=True)

PARTS = '''"""Kernels of a test."""

from collide.kernels import kernel

STEP = 2.0


@kernel
def near(x):
    """A step ahead."""
    return x + STEP


@kernel(cold=True)
def far(x):
    return near(x) * 3.0, x


@kernel
def alone(x):
    return x - 1.0
'''
ONE = '''"""Entries of a test."""

from collide.kernels import entry
from collide.narrowphase.tried_parts import alone, far


@entry("float64(float64)")
def first(x):
    return far(x)[0]


@entry("float64(float64)")
def second(x):
    return alone(x)
'''
TWO = '''"""An entry of a test."""

from collide.kernels import entry
from collide.narrowphase.tried_parts import far


@entry("float64(float64)")
def third(x):
    return far(x)[0] + x
'''
#: The build of these entries alone, by the very functions that build the library.
BUILD = """
import json, sys
from pathlib import Path

sys.path.insert(0, {native!r})
import compile_kernels
from collide.kernels import jit, sources
from collide.narrowphase import tried_one, tried_two

files = [Path(module.__file__) for module in (tried_one, tried_two)]
sources._files_of_entries = lambda: files
entries = [entry for entry in jit.entries if "tried" in entry.function.__module__]
compile_kernels._entries = lambda: entries
compile_kernels.UNITS = {{"one": ("narrowphase.tried_one",), "two": ("narrowphase.tried_two",)}}
compile_kernels.APART = ("narrowphase.tried_parts.far",)
made = compile_kernels.compile_kernels(Path({out!r}))
((level, places),) = made.objects.items()
print(json.dumps([level, [str(place) for place in places]]))
"""


class Builds:
    """A copy of the package with three entries beside its own, and builds of these three."""

    def __init__(self, folder: Path):
        self.folder, self.site = folder, copied(folder / "site")
        self.parts = self.site / "collide" / "narrowphase" / "tried_parts.py"
        self.parts.write_text(PARTS, encoding="utf-8")
        for name, text in (("tried_one", ONE), ("tried_two", TWO)):
            self.parts.with_name(f"{name}.py").write_text(text, encoding="utf-8")
        self.level = ""

    def edit(self, old: str, new: str) -> None:
        assert PARTS.count(old) == 1
        self.parts.write_text(PARTS.replace(old, new), encoding="utf-8")

    def build(self, out: str = "kept") -> dict[str, bytes]:
        """Objects by the names that people give them."""
        code = BUILD.format(native=str(NATIVE), out=str(self.folder / out))
        done = child(["-c", code], environment(self.site, COLLIDE_JIT="1", PYTHONHASHSEED="0"))
        assert done.returncode == 0, done.stderr[-3000:]
        self.level, places = json.loads(done.stdout)
        return {Path(place).name.removeprefix("tried_")[:3]: Path(place).read_bytes() for place in places}

    def files(self) -> list[Path]:
        """Lowered kernels, and objects."""
        return [*(self.folder / "kept" / "lowered").glob("*.ll"), *(self.folder / "kept").glob("*.o")]

    def rebuild(self) -> tuple[dict[str, bytes], set[str]]:
        """A build beside what is kept, and what it made anew; its objects are those of a build from nothing."""
        before = self.folder / "before"
        for folder in (before, self.folder / "cold"):
            shutil.rmtree(folder, ignore_errors=True)
        before.mkdir()
        for file in self.files():
            os.link(file, before / file.name)  # which stays when another file takes the name
        objects = self.build()
        assert objects == self.build("cold"), "bytes of objects depend on what was kept"
        old = {file.name: file for file in before.iterdir()}
        anew = [file.name for file in self.files() if file.name not in old or not old[file.name].samefile(file)]
        return objects, {name.split("-")[0] for name in anew}

    def answers(self, x: float) -> tuple[float, ...]:
        """What the entries say, linked with C."""
        source, library = self.folder / "asks.c", self.folder / f"asks{len(list(self.folder.glob('*.so')))}.so"
        names = ("first", "second", "third")
        source.write_text("".join(
            f"double collide_{self.level}_{name}(double); "
            f"double {name}(double x) {{ return collide_{self.level}_{name}(x); }}\n" for name in names
        ), encoding="utf-8")
        objects = [str(place) for place in (self.folder / "kept").glob("*.o")]
        subprocess.run(["cc", "-shared", "-fPIC", "-o", str(library), str(source), *objects], check=True)
        loaded = ctypes.CDLL(str(library))
        for name in names:
            getattr(loaded, name).restype, getattr(loaded, name).argtypes = ctypes.c_double, [ctypes.c_double]
        return tuple(getattr(loaded, name)(x) for name in names)


@pytest.fixture(scope="module")
def builds(tmp_path_factory) -> Builds:
    made = Builds(tmp_path_factory.mktemp("builds"))
    objects = made.build()
    assert set(objects) == {"one", "two", "far"} and made.answers(1.0) == (9.0, 0.0, 10.0)
    return made


@pytest.fixture(autouse=True)
def as_it_was(builds):
    yield
    builds.parts.write_text(PARTS, encoding="utf-8")
    builds.build()


def made_anew(names: set[str]) -> set[str]:
    """Without the digits by which objects of kernels that stand apart are told from each other."""
    return {name if not name.startswith("far_") else "object of far" for name in names}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "anew", "answers"),
    [
        # words
        ("A step ahead.", "Another sentence,\n\n    of some lines.", set(), (9.0, 0.0, 10.0)),
        # a constant: the kernel that uses it is lowered, and the object that it stands in, for both units, compiled
        ("STEP = 2.0", "STEP = 5.0", {"near", "object of far"}, (18.0, 0.0, 19.0)),
        # a kernel that one entry calls
        ("x - 1.0", "x - 4.0", {"alone", "tried_one"}, (9.0, -3.0, 10.0)),
        # a result of another type: callers are lowered again as well
        ("return x + STEP", "return 7", {"near", "far", "object of far"}, (21.0, 0.0, 22.0)),
        # what stands before a kernel's name is seen where it is called
        ("@kernel\ndef alone", "@kernel(cold=True)\ndef alone", {"alone", "second", "tried_one"}, (9.0, 0.0, 10.0)),
    ],
)
def test_an_edit_makes_anew_what_it_concerns_and_the_bytes_are_those_of_a_build_from_nothing(
    builds, old, new, anew, answers
):
    builds.edit(old, new)
    _, names = builds.rebuild()
    assert made_anew(names) == anew and builds.answers(1.0) == answers


@pytest.mark.slow
def test_a_damaged_file_is_made_anew(builds):
    kept = builds.folder / "kept"
    for file in (kept / "lowered").glob("near-*"):
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(content)
    for file in kept.glob("*.json"):  # or nothing would be looked at
        file.unlink()
    objects, names = builds.rebuild()
    assert names == {"near"} and set(objects) == {"one", "two", "far"}


class Renamed(NamedTuple):
    """A type that a kernel returns, until an edit renames the class."""

    x: float


@pytest.mark.slow
def test_a_record_of_a_class_that_was_renamed_is_as_if_it_were_not_there(tmp_path, monkeypatch):
    """The build went no further until somebody deleted the folder."""
    called = kept_lowered.Called(("module", "kernel", "0"), (), None, ())
    record = kept_lowered.Record("hash", "symbol", "environment", (), Renamed(1.0), (b"code",), ())
    kept_lowered.write(tmp_path, called, record)
    assert kept_lowered.read(tmp_path, called, "hash") == record
    monkeypatch.delattr(f"{__name__}.Renamed")
    assert kept_lowered.read(tmp_path, called, "hash") is None
