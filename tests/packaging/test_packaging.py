"""What is installed is what stands in the folders: the wheel is built, opened and compared.

The wheel is made by the build backend itself, in a copy of the tree, offline: nothing is fetched
and nothing is left behind in the checkout.
"""

from __future__ import annotations

import email
import importlib.metadata
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest

import collide

ROOT = Path(__file__).resolve().parents[2]
#: Folder of the repository → folder of the installed package.
FOLDERS = {"collide": "collide", "adapters": "collide/adapters", "scenes": "collide/scenes"}
LITTER = shutil.ignore_patterns(
    "__pycache__", "*.pyc", ".*", "_glue*", "built.py", "libcollide*", "pkgconfig", "include", "lib"
)
#: The backend that pyproject.toml asks for.
SETUPTOOLS = 77


def _setuptools() -> int:
    try:
        return int(importlib.metadata.version("setuptools").split(".")[0])
    except importlib.metadata.PackageNotFoundError:
        return 0


#: What the build makes, and no folder of the repository holds.
LIBRARY = {"so": "collide/lib/libcollide.so", "dylib": "collide/lib/libcollide.dylib", "dll": "collide/lib/collide.dll"}
MADE = re.compile(r"collide/(lib/.+|include/.+|kernels/built\.py|kernels/_glue\..+)")


def _built(tree: Path, **environment: str) -> subprocess.CompletedProcess:
    """Make a wheel of a copy of the checkout; object files of kernels that lie there need not be compiled again."""
    if _setuptools() < SETUPTOOLS:
        pytest.skip(f"building a wheel needs setuptools>={SETUPTOOLS}; pip install 'setuptools>={SETUPTOOLS}'")
    tree.mkdir(exist_ok=True)
    for folder in (*FOLDERS, "native"):
        shutil.copytree(ROOT / folder, tree / folder, ignore=LITTER)
    if (ROOT / "build" / "kernels").is_dir():
        shutil.copytree(ROOT / "build" / "kernels", tree / "build" / "kernels")
    for file in ROOT.iterdir():
        if file.is_file() and not file.name.startswith("."):
            shutil.copy(file, tree)
    build = "from setuptools.build_meta import build_wheel; build_wheel('dist')"
    own = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("COLLIDE_") and name != "NUMBA_DISABLE_JIT"
    }
    return subprocess.run(
        [sys.executable, "-c", build],
        cwd=tree,
        env={**own, **environment},
        check=False,
        capture_output=True,
        text=True,
        timeout=400,
    )


@pytest.fixture(scope="module")
def wheel_file(tmp_path_factory) -> Path:
    pytest.importorskip("numba", reason="kernels are compiled by numba: pip install 'collide-robotics[jit]'")
    tree = tmp_path_factory.mktemp("one") / "tree"
    done = _built(tree)
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = (tree / "dist").glob("*.whl")
    if made.name.endswith("-none-any.whl"):
        pytest.skip(f"no C compiler here: {[line for line in done.stderr.splitlines() if '***' in line]}")
    return made


@pytest.fixture(scope="module")
def wheel(wheel_file) -> Iterator[zipfile.ZipFile]:
    with zipfile.ZipFile(wheel_file) as opened:
        yield opened


@pytest.fixture(scope="module")
def metadata(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/METADATA"))
    return email.message_from_bytes(wheel.read(name))


def _folder_files() -> set[str]:
    """Every file of the packages' folders, under the name it is installed by."""
    return {
        f"{package}/{file.relative_to(ROOT / folder).as_posix()}"
        for folder, package in FOLDERS.items()
        for file in (ROOT / folder).rglob("*")
        if file.is_file() and file.suffix != ".pyc" and not any(part.startswith(".") for part in file.parts[-2:])
    } - {
        f"{package}/{file.relative_to(ROOT / folder).as_posix()}"
        for folder, package in FOLDERS.items()
        for file in (ROOT / folder).rglob("*")
        if MADE.fullmatch(f"{package}/{file.relative_to(ROOT / folder).as_posix()}")
    }


# --- the wheel ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_wheel_holds_the_folders_and_nothing_else(wheel):
    installed = {name for name in wheel.namelist() if ".dist-info/" not in name and not MADE.fullmatch(name)}
    missing, extra = sorted(_folder_files() - installed), sorted(installed - _folder_files())
    assert not missing, f"not in the wheel; name their package in pyproject.toml: {missing}"
    assert not extra, f"in the wheel, but not in the folders: {extra}"


def test_wheel_holds_what_is_no_module(wheel):
    names = wheel.namelist()
    for file in ("collide/py.typed", "collide/reports/schema.json", "collide/scenes/assets/workcell.json",
                 "collide/scenes/assets/panda_workbench.yaml"):
        assert file in names


def test_files_are_the_folders_own(wheel):
    for folder, package in FOLDERS.items():
        inner = wheel.read(f"{package}/__init__.py")
        assert inner == (ROOT / folder / "__init__.py").read_bytes()


def _required(metadata) -> list[str]:
    required = [line for line in metadata.get_all("Requires-Dist") if "extra ==" not in line]
    return sorted(re.match(r"[\w-]+", line).group() for line in required)


def test_engine_alone_needs_numpy(metadata):
    assert _required(metadata) == ["numpy"]


def test_wheel_is_of_its_platform_and_of_every_python(wheel_file):
    """cp310-abi3: one wheel for Python 3.10 and all that come after it."""
    assert "-cp310-abi3-" in wheel_file.name
    assert wheel_file.stat().st_size < 5_000_000  # half of it machine code; debugging symbols alone would be more


def test_wheel_has_the_library_and_what_c_programs_need(wheel):
    made = sorted(name for name in wheel.namelist() if MADE.fullmatch(name))
    assert {"collide/include/collide.h", "collide/include/collide.hpp"} <= set(made)
    assert "collide/kernels/built.py" in made
    assert "collide/lib/pkgconfig/collide.pc" in made and set(LIBRARY.values()) & set(made)
    assert f"Version: {collide.__version__}\n".encode() in wheel.read("collide/lib/pkgconfig/collide.pc")
    cmake = {name.rpartition("/")[2]: wheel.read(name).decode() for name in made if "/lib/cmake/collide/" in name}
    assert set(cmake) == {"collideConfig.cmake", "collideConfigVersion.cmake"}
    assert f'set(PACKAGE_VERSION "{collide.__version__}")' in cmake["collideConfigVersion.cmake"]
    assert not re.search(r"@[A-Z]+@", "".join(cmake.values())), "a place left open by the build"


def test_library_leaves_nothing_open_but_the_c_library(wheel, tmp_path):
    """No Python, no numba, no C++; and no path of the machine that built it."""
    if not shutil.which("readelf") or LIBRARY["so"] not in wheel.namelist():
        pytest.skip("for Linux, with readelf: apt install binutils")
    file = wheel.extract(LIBRARY["so"], tmp_path)
    dynamic = subprocess.run(["readelf", "-d", file], capture_output=True, text=True, check=True).stdout
    needed = set(re.findall(r"NEEDED.*\[([^.\]]+)", dynamic))
    assert needed <= {"libc", "libm", "libpthread"} and "RPATH" not in dynamic and "RUNPATH" not in dynamic, dynamic
    assert "TEXTREL" not in dynamic
    symbols = subprocess.run(["readelf", "--dyn-syms", "-W", file], capture_output=True, text=True, check=True).stdout
    undefined = set(re.findall(r" UND ([\w.]+)", symbols))
    assert not [name for name in undefined if name.startswith(("Py", "_Py", "numba", "NRT"))], undefined
    assert str(ROOT).encode() not in Path(file).read_bytes()


@pytest.mark.slow
def test_same_sources_give_the_same_bytes(wheel_file, tmp_path):
    """Built again in another folder, from the same object files: C code, links and archive are reproducible. That the
    object files are, too, is the other half: test_kernels_compile_to_the_same_bytes."""
    again = tmp_path / "elsewhere"
    done = _built(again)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (again / "dist" / wheel_file.name).read_bytes() == wheel_file.read_bytes()


@pytest.fixture()
def without_compilers(tmp_path) -> dict[str, str]:
    """An environment with neither a C compiler nor the package ziglang."""
    (tmp_path / "sitecustomize.py").write_text("import sys\nsys.modules['ziglang'] = None\n", encoding="utf-8")
    return {"CC": str(tmp_path / "no-such-compiler"), "PYTHONPATH": str(tmp_path)}


@pytest.mark.slow
def test_without_a_compiler_the_wheel_needs_numba_and_says_so(tmp_path, without_compilers):
    done = _built(tmp_path / "tree", **without_compilers)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = (line for line in done.stderr.splitlines() if "***" in line)
    assert "NO COMPILED KERNELS" in line and "collide doctor" in line and "no-such-compiler" in line
    (made,) = (tmp_path / "tree" / "dist").glob("*.whl")
    assert made.name.endswith("-py3-none-any.whl")
    with zipfile.ZipFile(made) as opened:
        assert not [name for name in opened.namelist() if MADE.fullmatch(name)]
        (name,) = (name for name in opened.namelist() if name.endswith(".dist-info/METADATA"))
        assert _required(email.message_from_bytes(opened.read(name))) == ["llvmlite", "numba", "numpy"]


def test_releases_never_lack_kernels(tmp_path, without_compilers):
    done = _built(tmp_path / "tree", **without_compilers, COLLIDE_REQUIRE_COMPILED="1")
    assert done.returncode != 0 and not list((tmp_path / "tree").glob("dist/*.whl"))
    assert "COLLIDE_REQUIRE_COMPILED is set" in done.stderr and "apt install gcc" in done.stderr


@pytest.mark.slow
def test_ziglang_compiles_where_there_is_no_compiler_and_the_wheel_has_the_same_files(tmp_path, wheel):
    pytest.importorskip("ziglang", reason="the C compiler for others: pip install 'collide-robotics[machines]'")
    done = _built(tmp_path / "tree", CC=str(tmp_path / "no-such-compiler"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "by the package ziglang" in done.stderr and "NO COMPILED KERNELS" not in done.stderr
    (made,) = (tmp_path / "tree" / "dist").glob("*.whl")
    with zipfile.ZipFile(made) as opened:
        assert opened.namelist() == wheel.namelist()
        opened.extractall(tmp_path / "installed")
    asked = "import collide, collide.kernels.mode as m; b = collide.Box((1, 1, 1)); "
    asked += "print(m.describe_mode(), collide.distance(b, b, collide.pose(), collide.pose((2, 0, 0))).distance)"
    run = subprocess.run(
        [sys.executable, "-c", asked], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path / "installed")},
        check=False, capture_output=True, text=True, timeout=60,
    )
    assert run.returncode == 0 and run.stdout.startswith("library, ") and run.stdout.endswith(" 1.0\n"), run


def test_metadata_names_version_python_and_licence(metadata):
    assert metadata["Name"] == "collide-robotics"
    assert metadata["Version"] == collide.__version__
    assert metadata["Requires-Python"] == ">=3.10"
    assert metadata["License-Expression"] == "Apache-2.0"


def test_extras(metadata):
    assert {"robots", "demo", "decompose", "peers", "plots", "jit", "dev"} <= set(metadata.get_all("Provides-Extra"))
    pybullet = [line for line in metadata.get_all("Requires-Dist") if line.startswith("pybullet")]
    assert len(pybullet) == 2, "of the extras peers and pybullet"
    for line in pybullet:
        assert re.search(r"python_version < ['\"]3\.12['\"]", line), "pybullet has no wheels from Python 3.12 on"


def test_extras_that_errors_name_exist(metadata):
    """`MissingExtra` prints a command; the extra in it must be one that pip knows."""
    extras = set(metadata.get_all("Provides-Extra"))
    for folder in FOLDERS:
        for file in (ROOT / folder).rglob("*.py"):
            for named in re.findall(
                r"extra=[\"'](\w+)[\"']|collide-robotics\[([a-z]+)\]", file.read_text(encoding="utf-8")
            ):
                assert (named[0] or named[1]) in extras, f"{file.name} names the extra {named}"


def test_console_script(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt"))
    assert "collide = collide.cli.main:main" in wheel.read(name).decode()


def test_installed_wheel_imports_from_itself(wheel, tmp_path):
    """Unpacked away from the repository, every package is found, and the shipped scenes with it."""
    wheel.extractall(tmp_path)
    code = (
        "import collide, collide.scenes, collide.adapters.peers, collide.reports.report as report\n"
        "print(collide.__file__, collide.scenes.__file__, collide.adapters.peers.__file__, report.__file__)\n"
        "print(len(collide.scenes.load('workcell').bodies))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path)},
        check=False, capture_output=True, text=True, timeout=60,
    )
    assert done.returncode == 0, done.stderr
    files, bodies = done.stdout.splitlines()
    assert all(Path(file).is_relative_to(tmp_path) for file in files.split())
    assert int(bodies) > 10


# --- the checkout -------------------------------------------------------------------------------


def test_version_is_the_same_everywhere():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'version = "{collide.__version__}"' in text


def test_every_folder_with_modules_is_a_package():
    for folder in FOLDERS:
        for file in (ROOT / folder).rglob("*.py"):
            assert (file.parent / "__init__.py").is_file(), f"{file.parent.name} has modules and no __init__.py"


def test_continuous_integration_calls_the_test_command():
    assert "tests/run.sh" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert (ROOT / "tests" / "run.sh").is_file()
