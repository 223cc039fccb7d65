"""The library of kernels: the same bits on every level of processors, and what happens where it is not as the build
left it.

Copies of the installed package are damaged; processes of their own use them. A process that died, or answered
wrongly, would
be the fault met: a library cut short ends the process that loads it, and one of other sources answers wrongly.
"""

from __future__ import annotations

import json
import stat
import zlib
from pathlib import Path

import pytest
from installed_copy import PACKAGE, child, copied, environment, why_no_library
from naive import rng_of

pytestmark = pytest.mark.skipif(bool(why_no_library()), reason=why_no_library() or "there is a library")

HERE = Path(__file__).parent
#: What digests are taken of: see answers_digest.py.
KINDS = ("pairs", "hulls", "meshes", "worlds")

#: Asks for a bounding box, the smallest of kernels, whose callee `support_vertex` stands in another file. A function,
#: for tests that ask after something else.
BOX = """
import json, sys
import numpy as np
import collide
from collide.kernels import library, mode

def box():
    from collide.broadphase.bounding_boxes import boxes_of
    from collide.lowering.parts import parts_of
    from collide.lowering.shape_table import ShapeTable, pose_table

    packed, X = parts_of(collide.ConvexHull([(k, k * k, k**3) for k in range(20)]))[0]
    poses = pose_table(np.eye(4)[None], X[None], np.array([packed.reach]))
    return boxes_of(ShapeTable([packed]), poses.rows, np.zeros(1, dtype=np.int64)).round(6).tolist()
"""
TOLD = (
    BOX
    + "import os\nexec(os.environ.get('ASK', ''))\n"
    "print(json.dumps({'box': box(), 'mode': mode.MODE, 'why': mode.WHY, 'at': collide.__file__, 'level': "
    "library.level, 'edited': sorted(library.edited), 'entries': sorted(library.entries())}))"
)
RIGHT = [[0, 0, 0, 19, 361, 6859]]


@pytest.fixture(scope="session")
def compiled_cache(tmp_path_factory) -> Path:
    """Where copies that have no library of use keep kernels compiled just in time: the first one compiles, the others
    load."""
    return tmp_path_factory.mktemp("kernels")


@pytest.fixture()
def site(tmp_path) -> Path:
    return copied(tmp_path / "site")


@pytest.fixture()
def ask(site, compiled_cache):
    """(what a process tells that uses the copy, what it writes to stderr)."""

    def asked(*before: Path, **more: str) -> tuple[dict, str]:
        done = child(["-c", TOLD], environment(site, *before, **{"COLLIDE_CACHE_DIR": str(compiled_cache), **more}))
        assert done.returncode == 0, (done.returncode, done.stderr[-3000:])
        told = json.loads(done.stdout)
        assert Path(told["at"]).is_relative_to(site), "another package was asked"
        return told, done.stderr

    return asked


def files() -> list[str]:
    """The library and its module, as paths in the package."""
    from collide.kernels import built

    return sorted(built.FILES)


def library_of(site: Path) -> Path:
    (name,) = (name for name in files() if name.startswith("lib/"))
    return site / "collide" / name


def glue_of(site: Path) -> Path:
    (name,) = (name for name in files() if not name.startswith("lib/"))
    return site / "collide" / name


def rewritten(file: Path, content: bytes) -> None:
    """Under the file's name, and not in its place: another process may have it in use."""
    file.unlink()
    file.write_bytes(content)


def as_built(site: Path) -> None:
    """Have built.py say of the files that they are as they should be."""
    package = site / "collide"
    known = {name: ((package / name).stat().st_size, zlib.crc32((package / name).read_bytes())) for name in files()}
    about = package / "kernels" / "built.py"
    lines = [line for line in about.read_text(encoding="utf-8").splitlines() if not line.startswith("FILES = ")]
    about.write_text("\n".join([*lines, f"FILES = {known!r}", ""]), encoding="utf-8")


# --- as the build left it ---------------------------------------------------------------------------


@pytest.mark.parametrize("named", ["site", "a site of Zoë's, with spaces"])
def test_a_copy_elsewhere_is_used_and_says_nothing(tmp_path, named):
    done = child(["-c", TOLD], environment(copied(tmp_path / named)))
    assert done.returncode == 0 and done.stderr == "", done.stderr[-3000:]
    told = json.loads(done.stdout)
    assert told["mode"] == "compiled" and told["why"] == "" and told["box"] == RIGHT and named in told["at"]


def digests(site: Path, *names: str, **more: str) -> dict:
    done = child([str(HERE / "answers_digest.py"), *names], environment(site, **more))
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


def test_every_level_gives_the_same_bits():
    from collide.kernels import built

    own = digests(PACKAGE.parent)
    assert own["mode"] == "compiled" and set(own["digests"]) == set(KINDS)
    asked = 0
    for level in built.LEVELS:
        if built.LEVELS.index(level) > built.LEVELS.index(own["level"]):
            continue  # this processor has it not: see below
        found = digests(PACKAGE.parent, COLLIDE_CPU=level)
        assert found["level"] == level and found["mode"] == "compiled"
        assert found["digests"] == own["digests"], level
        asked += 1
    assert asked >= 1


@pytest.mark.parametrize("command", ["a query", "collide"])
def test_a_level_that_does_not_exist_is_an_error_that_names_those_there_are(command):
    from collide.kernels import built

    given = (
        ["-c", "import collide; collide.Box((1, 1, 1)); import collide.kernels"]
        if command == "a query"
        else ["-m", "collide", "report", "workcell"]
    )
    done = child(given, environment(PACKAGE.parent, COLLIDE_CPU="v5"))
    assert done.returncode == (1 if command == "a query" else 2), done.stderr
    (line,) = (line for line in done.stderr.splitlines() if "COLLIDE_CPU='v5'" in line)
    assert all(level in line for level in built.LEVELS) and "bug" not in line
    assert command == "a query" or "Traceback" not in done.stderr


def test_a_level_that_is_not_to_be_had_here_is_an_error_too():
    from collide.kernels import built, library

    strange = [level for level in library.LEVELS if level not in built.LEVELS]
    assert strange, "levels of other platforms"
    for level in strange:
        done = child(["-c", "import collide.kernels"], environment(PACKAGE.parent, COLLIDE_CPU=level))
        assert done.returncode == 1 and f"InvalidArgument: COLLIDE_CPU={level!r}" in done.stderr
        assert all(there in done.stderr.splitlines()[-1] for there in built.LEVELS)


def test_a_package_that_cannot_be_written_is_used(site, ask):
    places = [site, *site.rglob("*")]
    for place in places:
        place.chmod(stat.S_IMODE(place.stat().st_mode) & ~0o222)
    try:
        told, said = ask(PYTHONDONTWRITEBYTECODE="")
        assert told["mode"] == "compiled" and told["box"] == RIGHT and said == ""
        made = [place for place in {*site.rglob("*")} - {*places} if "__pycache__" not in place.parts]
        assert not made, "written beside the library"
    finally:
        for place in places:
            place.chmod(stat.S_IMODE(place.stat().st_mode) | 0o200)


# --- not as the build left it -----------------------------------------------------------------------


def flipped(content: bytes, seed: str) -> bytes:
    rng = rng_of("damaged library", seed)
    at = int(rng.integers(len(content)))
    return content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :]


#: Ways to spoil a file's bytes.
HARMS = {
    "a bit flipped": lambda content: flipped(content, "first"),
    "another bit flipped": lambda content: flipped(content, "second"),
    "cut in half": lambda content: content[: len(content) // 2], "empty": lambda content: b"",
    "its head flipped": lambda content: b"\x7eELF" + content[4:], "longer": lambda content: content + b"\0",
    "one byte short": lambda content: content[:-1],
}


@pytest.mark.many(5)
@pytest.mark.parametrize("of", ["library", "module"])
@pytest.mark.parametrize("harm", HARMS)
def test_what_is_damaged_is_not_loaded(site, ask, of, harm):
    file = library_of(site) if of == "library" else glue_of(site)
    content = file.read_bytes()
    spoilt = HARMS[harm](content)
    assert spoilt != content
    rewritten(file, spoilt)
    told, said = ask()
    assert told["mode"] == "just in time" and told["box"] == RIGHT
    assert "damaged" in said, "it is said in every process, also where kernels come from the disk"
    assert "damaged" in told["why"] and str(file) in told["why"] and "install" in told["why"], told["why"]
    rewritten(file, content)
    assert ask()[0]["mode"] == "compiled"


@pytest.mark.many(2)
@pytest.mark.parametrize("of", ["library", "module", "built.py"])
def test_what_is_missing_is_done_without(site, ask, of):
    file = {
        "library": library_of(site),
        "module": glue_of(site),
        "built.py": site / "collide" / "kernels" / "built.py",
    }[of]
    file.unlink()
    told, _ = ask()
    assert told["mode"] == "just in time" and told["box"] == RIGHT
    assert ("without compiled kernels" if of == "built.py" else str(file)) in told["why"], told["why"]


@pytest.mark.parametrize("of", ["library", "module"])
def test_what_is_no_library_is_done_without(site, ask, of):
    """Its checksum is right: the build itself has left it so, or somebody has meant well."""
    rewritten(library_of(site) if of == "library" else glue_of(site), b"no library at all")
    as_built(site)
    told, _ = ask()
    assert told["mode"] == "just in time" and told["box"] == RIGHT
    assert "cannot be loaded" in told["why"] and "install" in told["why"], told["why"]


def edit_a_kernel(site: Path) -> None:
    """Have each shape's support point be its first: its bounding box is a point then."""
    callee = site / "collide" / "support" / "support_mapping.py"
    source = callee.read_text(encoding="utf-8")
    assert source.count("    return k\n") == 1
    callee.write_text(source.replace("    return k\n", "    return 0\n"), encoding="utf-8")


def test_an_edited_kernel_answers_as_it_is_written_now_and_the_library_serves_the_others(site, ask):
    edit_a_kernel(site)
    told, said = ask()
    assert told["mode"] == "just in time" and told["box"] == [[0, 0, 0, 0, 0, 0]], "an answer of the old source"
    assert "kernels were edited" in told["why"] and "compiled at their first call" in said
    assert "bounding_boxes" in told["edited"] and 20 < len(told["edited"]) < len(told["entries"]) - 20
    callee = site / "collide" / "support" / "support_mapping.py"
    callee.write_text(callee.read_text(encoding="utf-8").replace("    return 0\n", "    return k\n"), encoding="utf-8")
    assert ask()[0]["mode"] == "compiled"


@pytest.mark.slow
def test_a_new_entry_is_compiled_and_the_library_serves_the_others(site, ask):
    with open(site / "collide" / "broadphase" / "bounding_boxes.py", "a", encoding="utf-8") as file:
        file.write("\n\n@entry('int64()')\ndef answer_of_all():\n    return 42\n")
    told, _ = ask(ASK="from collide.broadphase.bounding_boxes import answer_of_all; assert answer_of_all() == 42")
    assert told["mode"] == "just in time" and told["edited"] == ["answer_of_all"] and told["box"] == RIGHT


@pytest.mark.slow
@pytest.mark.parametrize("edit", ["docstrings", "comments and lines"])
def test_words_in_every_source_keep_the_library(site, ask, edit):
    from collide.kernels import sources

    edited = 0
    for name in sources.kernel_sources():
        file = site / "collide" / name
        text = file.read_text(encoding="utf-8")
        found = text.replace('"""', '"""Or so. ', 1) if edit == "docstrings" else f"# so\n\n{text}\n# and so on\n"
        edited += found != text
        file.write_text(found, encoding="utf-8")
    told, said = ask()
    assert edited > 200 and told["mode"] == "compiled" and told["box"] == RIGHT and said == ""


def test_edits_that_no_kernel_reads_keep_the_library(site, ask):
    world = site / "collide" / "worlds" / "world.py"
    world.write_text(world.read_text(encoding="utf-8") + "\n# a remark\n", encoding="utf-8")
    assert ask()[0]["mode"] == "compiled"


@pytest.mark.parametrize("variable", ["COLLIDE_JIT", "NUMBA_DISABLE_JIT"])
def test_variables_choose_how_kernels_run(ask, variable):
    told, _ = ask(**{variable: "1"})
    assert told["mode"] == {"COLLIDE_JIT": "just in time", "NUMBA_DISABLE_JIT": "python"}[variable]
    assert variable in told["why"] and told["box"] == RIGHT and told["level"] == ""
    for nothing in ("", "0"):
        assert ask(**{variable: nothing})[0]["mode"] == "compiled"


# --- Numba is not needed ----------------------------------------------------------------------------


@pytest.fixture()
def no_numba(tmp_path) -> Path:
    """A folder that, first on the path, stands for an environment without Numba and LLVM."""
    folder = tmp_path / "without numba"
    folder.mkdir()
    for name in ("numba", "llvmlite"):
        text = f"raise ModuleNotFoundError(\"No module named '{name}'\", name={name!r})\n"
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder


def test_the_library_needs_no_numba(ask, no_numba):
    told, said = ask(no_numba)
    assert told["mode"] == "compiled" and told["box"] == RIGHT and said == ""


@pytest.mark.many(6)
@pytest.mark.parametrize("harm", ["damaged", "missing", "other sources"])
def test_without_library_and_numba_it_is_said_what_to_do(site, no_numba, harm):
    if harm == "damaged":
        rewritten(library_of(site), b"")
    elif harm == "missing":
        (site / "collide" / "kernels" / "built.py").unlink()
    else:
        edit_a_kernel(site)
    for given in (["-c", BOX + "box()"], ["-m", "collide", "report", "workcell"]):
        done = child(given, environment(site, no_numba))
        assert done.returncode in (1, 2), (done.returncode, done.stdout)
        last = done.stderr.strip().splitlines()[-1]
        why = {
            "damaged": "damaged",
            "missing": "without compiled kernels",
            "other sources": "kernels were edited",
        }[harm]
        assert why in last and "numba" in last and "pip install" in last, last
        assert "bug" not in last


#: Everything that kernels are asked for, and what is loaded then.
EVERYTHING = """
import sys
import numpy as np
sys.path.insert(0, sys.argv[1])
import answers_digest
import collide
from collide.cli.main import main

answers_digest.told(["pairs", "hulls", "meshes", "worlds"])
A, B, X = collide.Box((1, 1, 1)), collide.Box((1, 1, 1)), collide.pose((0, 0, 0.9))
assert len(collide.contacts(A, B, np.eye(4), X).rows)
collide.verify(A, B, np.eye(4), X, collide.distance(A, B, np.eye(4), X))
world = collide.World()
for k in range(3):
    world.add(A, collide.pose((0.9 * k, 0, 0)))
assert world.collides() and len(world.contacts().rows)
assert main(["report", "workcell"]) in (0, 1)
bad = sorted(name for name in sys.modules if name.split(".")[0] in ("numba", "llvmlite"))
assert not bad, bad
"""


def test_nothing_of_numba_is_loaded_whatever_is_asked(tmp_path):
    script = tmp_path / "everything.py"
    script.write_text(EVERYTHING, encoding="utf-8")
    done = child([str(script), str(HERE)], environment(PACKAGE.parent))
    assert done.returncode == 0, done.stderr[-3000:]


def test_a_start_loads_little():
    """Modules of the package that make code are not loaded, nor what they need; and what takes long to load is not."""
    done = child(["-c", TOLD + "\nprint(*sys.modules)"], environment(PACKAGE.parent))
    assert done.returncode == 0, done.stderr[-3000:]
    told, names = done.stdout.splitlines()
    loaded = {name for name in names.split() if name.startswith("collide.kernels.")}
    assert json.loads(told)["mode"] == "compiled"
    makers = {"jit", "front_end", "back_end", "views", "vectors", "box_vectors", "compiled_lanes", "object_cache"}
    assert not {f"collide.kernels.{name}" for name in makers} & loaded
    assert not {"asyncio", "email", "multiprocessing", "setuptools", "sqlite3", "unittest"} & set(names.split())


# --- compiled just in time --------------------------------------------------------------------------


@pytest.mark.own_kernels
def test_kernels_compiled_just_in_time_give_the_bits_of_the_library():
    """For this very processor, and one module an entry: what the library has for a level of processors, all in one."""
    library = digests(PACKAGE.parent, "pairs")
    compiled = digests(PACKAGE.parent, "pairs", COLLIDE_JIT="1")
    assert (library["mode"], compiled["mode"]) == ("compiled", "just in time")
    assert library["digests"] == compiled["digests"]
