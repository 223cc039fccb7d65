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

ROOT = Path(__file__).resolve().parent.parent
#: Folder of the repository → folder of the installed package.
FOLDERS = {"collide": "collide", "adapters": "collide/adapters", "scenes": "collide/scenes"}
LITTER = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
#: The backend that pyproject.toml asks for.
SETUPTOOLS = 77


def _setuptools() -> int:
    try:
        return int(importlib.metadata.version("setuptools").split(".")[0])
    except importlib.metadata.PackageNotFoundError:
        return 0


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Iterator[zipfile.ZipFile]:
    if _setuptools() < SETUPTOOLS:
        pytest.skip(f"building a wheel needs setuptools>={SETUPTOOLS}; pip install 'setuptools>={SETUPTOOLS}'")
    tree = tmp_path_factory.mktemp("tree")
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, tree / folder, ignore=LITTER)
    for file in ROOT.iterdir():
        if file.is_file() and not file.name.startswith("."):
            shutil.copy(file, tree)
    build = "from setuptools.build_meta import build_wheel; build_wheel('dist')"
    done = subprocess.run([sys.executable, "-c", build], cwd=tree, check=False, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    (made,) = (tree / "dist").glob("*.whl")
    with zipfile.ZipFile(made) as opened:
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
    }


# --- the wheel ----------------------------------------------------------------------------------


def test_wheel_holds_the_folders_and_nothing_else(wheel):
    installed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    missing, extra = sorted(_folder_files() - installed), sorted(installed - _folder_files())
    assert not missing, f"not in the wheel; name their package in pyproject.toml: {missing}"
    assert not extra, f"in the wheel, but not in the folders: {extra}"


def test_wheel_holds_what_is_no_module(wheel):
    names = wheel.namelist()
    for file in ("collide/py.typed", "collide/reports/schema.json", "collide/scenes/assets/workcell.json",
                 "collide/scenes/assets/panda_workbench.yaml"):  # fmt: skip
        assert file in names


def test_files_are_the_folders_own(wheel):
    for folder, package in FOLDERS.items():
        inner = wheel.read(f"{package}/__init__.py")
        assert inner == (ROOT / folder / "__init__.py").read_bytes()


def test_engine_alone_needs_numpy_and_numba(metadata):
    required = [line for line in metadata.get_all("Requires-Dist") if "extra ==" not in line]
    assert sorted(re.match(r"[\w-]+", line).group() for line in required) == ["numba", "numpy"]


def test_metadata_names_version_python_and_licence(metadata):
    assert metadata["Name"] == "collide-robotics"
    assert metadata["Version"] == collide.__version__
    assert metadata["Requires-Python"] == ">=3.10"
    assert metadata["License-Expression"] == "Apache-2.0"


def test_extras(metadata):
    assert {"robots", "demo", "decompose", "peers", "plots", "dev"} <= set(metadata.get_all("Provides-Extra"))
    (pybullet,) = (line for line in metadata.get_all("Requires-Dist") if line.startswith("pybullet"))
    assert re.search(r"python_version < ['\"]3\.12['\"]", pybullet), "pybullet has no wheels from Python 3.12 on"


def test_extras_that_errors_name_exist(metadata):
    """`MissingExtra` prints a command; the extra in it must be one that pip knows."""
    extras = set(metadata.get_all("Provides-Extra"))
    for folder in FOLDERS:
        for file in (ROOT / folder).rglob("*.py"):
            for named in re.findall(r"extra=[\"'](\w+)[\"']|collide-robotics\[([a-z]+)\]", file.read_text(encoding="utf-8")):
                assert (named[0] or named[1]) in extras, f"{file.name} names the extra {named}"


def test_console_script(wheel):
    (name,) = (name for name in wheel.namelist() if name.endswith(".dist-info/entry_points.txt"))
    assert "collide = collide.cli:main" in wheel.read(name).decode()


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
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    files, bodies = done.stdout.splitlines()
    assert all(Path(file).is_relative_to(tmp_path) for file in files.split())
    assert int(bodies) > 10


# --- the checkout -------------------------------------------------------------------------------


def _pages() -> list[Path]:
    return [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "benchmarks").glob("*.md"))]


def test_version_is_the_same_everywhere():
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert f'version = "{collide.__version__}"' in text


def test_every_folder_with_modules_is_a_package():
    for folder in FOLDERS:
        for file in (ROOT / folder).rglob("*.py"):
            assert (file.parent / "__init__.py").is_file(), f"{file.parent.name} has modules and no __init__.py"


def test_links_between_pages_lead_somewhere():
    for page in _pages():
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
            if "://" not in link and not link.startswith("mailto:"):
                assert (page.parent / link).exists(), f"{page.name} links to {link}"


def test_files_that_pages_name_exist():
    """``examples/01_two_shapes.py``, ``bash tests/run.sh``, ``collide/narrowphase/bounds.py``: as code, so as files."""
    named = re.compile(r"(?:\.ci|adapters|benchmarks|collide|docs|examples|scenes|tests)/[\w./-]*\w")
    for page in _pages():
        for code in re.findall(r"`[^`]+`|```.*?```", page.read_text(encoding="utf-8"), flags=re.DOTALL):
            for path in named.findall(code):
                places = [ROOT / path, *(ROOT / folder / path for folder in FOLDERS)]
                assert any(place.exists() for place in places), f"{page.name} names {path}"


def test_commands_that_pages_show_exist():
    from collide.arguments import parser

    (commands,) = (set(action.choices) for action in parser()._actions if action.dest == "command")
    for page in _pages():
        for word in re.findall(r"^(?:\$ )?collide ([a-z]+)\b", page.read_text(encoding="utf-8"), flags=re.MULTILINE):
            assert word in commands, f"{page.name} shows `collide {word}`"


def test_continuous_integration_calls_the_test_command():
    assert "tests/run.sh" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert os.access(ROOT / ".ci" / "run", os.X_OK)
    assert (ROOT / "tests" / "run.sh").is_file()
