"""Programs that find the library by the lines of docs/c-interface.md: the compiler's flags, pkg-config, CMake."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from naive import rng_of
from random_robots import random_configurations, random_robot

import collide
from collide.cli import main as cli
from collide.kernels import library, mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)
if sys.platform == "win32":
    pytest.skip("the page's lines are of a shell", allow_module_level=True)

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "c-interface.md").read_text(encoding="utf-8")
PROGRAM = '#include <collide.h>\n#include <stdio.h>\nint main(void) { return puts(collide_version()) < 0; }\n'


def _lines(tool: str) -> str:
    """The page's block of shell lines that calls a tool."""
    (block,) = (block for block in re.findall(r"```sh\n(.*?)```", PAGE, re.DOTALL) if tool in block)
    return block


@pytest.fixture(autouse=True)
def source(folder):
    (folder / "program.c").write_text(PROGRAM, encoding="utf-8")


def _run(folder: Path, lines: str, *, needs: tuple[str, ...]) -> subprocess.CompletedProcess:
    """The lines in a shell, with nothing else of Python's in the environment."""
    for tool in needs:
        if shutil.which(tool) is None:
            pytest.skip(f"no {tool} on this machine")
    bare = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "HOME": str(folder)}
    return subprocess.run(
        ["sh", "-e", "-c", lines], cwd=folder, env=bare, capture_output=True, text=True, check=False, timeout=300
    )


@pytest.mark.parametrize(
    "tool, needs, program",
    [
        ("program.c $(collide config", ("cc",), "program"),
        ("pkg-config --cflags", ("cc", "pkg-config"), "program"),
        ("cmake -B build", ("cc", "cmake"), "build/program"),
    ],
    ids=["compiler", "pkg-config", "cmake"],
)
def test_the_pages_lines_build_a_program(folder, tool, needs, program):
    (listed,) = re.findall(r"```cmake\n(.*?)```", PAGE, re.DOTALL)
    (folder / "CMakeLists.txt").write_text(listed, encoding="utf-8")
    done = _run(folder, _lines(tool), needs=needs)
    assert done.returncode == 0, done.stdout + done.stderr
    told = subprocess.run([folder / program], env={}, capture_output=True, text=True, check=True).stdout
    assert told == f"{collide.__version__}\n"


@pytest.mark.parametrize(
    "asked, is_found", [("0.1", True), ("0.1.0 EXACT", True), ("0.1.7", False), ("0.2", False), ("1.0", False)]
)
def test_cmake_takes_versions_that_fit(folder, asked, is_found):
    text = f"cmake_minimum_required(VERSION 3.15)\nproject(asks NONE)\nfind_package(collide {asked} CONFIG REQUIRED)\n"
    (folder / "CMakeLists.txt").write_text(text, encoding="utf-8")
    done = _run(folder, "cmake -B build -Dcollide_DIR=$(collide config --cmakedir)", needs=("cmake",))
    assert (done.returncode == 0) == is_found, done.stdout + done.stderr
    assert is_found or "version: 0.1.0" in done.stderr


def test_cmake_finds_a_copy_by_its_prefix_and_names_what_is_missing(folder):
    """A copied installation is found in its new place; without its library CMake says so."""
    source, copied = Path(collide.__file__).parent, folder / "elsewhere"
    for part in ("include", "lib"):
        shutil.copytree(source / part, copied / part)
    text = "cmake_minimum_required(VERSION 3.15)\nproject(asks NONE)\nfind_package(collide CONFIG REQUIRED)\n"
    (folder / "CMakeLists.txt").write_text(f'{text}message("${{collide_LIBRARY}}")\n', encoding="utf-8")
    asked = f"cmake -B build -DCMAKE_PREFIX_PATH={copied}"
    done = _run(folder, asked, needs=("cmake",))
    assert done.returncode == 0 and str(copied / "lib") in done.stderr, done.stderr
    (copied / "lib" / Path(collide.get_library()).name).unlink()
    shutil.rmtree(folder / "build")
    done = _run(folder, asked, needs=("cmake",))
    assert done.returncode != 0 and "is missing: install collide-robotics again" in " ".join(done.stderr.split())


def test_config_tells_places_that_exist(capsys):
    assert cli.main(["config"]) == 0
    told = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert list(told) == ["cflags", "libs", "cmakedir", "pkgconfigdir", "version"]
    assert told["version"] == collide.__version__
    assert (Path(told["cmakedir"]) / "collideConfig.cmake").is_file()
    assert (Path(told["pkgconfigdir"]) / "collide.pc").is_file()
    assert cli.main(["config", "--version", "--libs", "--cflags"]) == 0
    assert capsys.readouterr().out.splitlines() == [f"{told['cflags']} {told['libs']}", told["version"]]


def test_config_without_a_library_says_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr(library, "_built", lambda: None)
    assert cli.main(["config", "--libs"]) == 2
    assert "there is no libcollide" in (told := capsys.readouterr().err) and "install a C compiler" in told


def test_cmake_builds_the_examples_and_a_planners_states_are_judged_as_in_python(folder):
    """`examples/c/validity.cpp` of a robot that Python saved."""
    shutil.copytree(Path(__file__).resolve().parents[2] / "examples" / "c", folder / "examples")
    lines = "cd examples\ncmake -B build -Dcollide_DIR=$(collide config --cmakedir)\ncmake --build build"
    done = _run(folder, lines, needs=("cmake", "cc", "c++"))
    assert done.returncode == 0, done.stdout + done.stderr
    rng = rng_of("validity")
    robot, world = random_robot(rng, types=("revolute", "continuous")), collide.World()
    world.add(collide.Box(0.4, 0.4, 0.4), collide.pose([0.5, 0.0, 0.3]), name="crate")
    world.add(collide.Halfspace([0.0, 0.0, 1.0], -0.6), name="floor")
    checker, q = collide.RobotChecker(robot, world), random_configurations(rng, robot, 40)
    q[1::2] = q[::2] + 0.02 * rng.normal(size=q[::2].shape)
    checker.save(folder / "arm.collide")
    np.savetxt(folder / "states.csv", q, delimiter=",", fmt="%.17g")
    validity = [folder / "examples" / "build" / "validity", folder / "arm.collide", folder / "states.csv"]
    told = subprocess.run(validity, env={}, capture_output=True, text=True, check=True).stdout.splitlines()
    hits, clearances, free = checker.collides(q), checker.distances(q).lower, checker.certify_edges(q[:-1], q[1:]).free
    assert 5 < hits.sum() < 35 and 3 < free.sum() < 36
    wanted = [
        line for k in range(len(q)) for line in (
            f"state {k}: {'invalid' if hits[k] else 'valid'}, clearance {max(clearances[k], 0.0):.6f} m",
            f"motion {k - 1}: {'free' if k and free[k - 1] else 'not proven free'}",
        )
    ]
    assert told == [wanted[0], *wanted[2:]]
    absent = [validity[0], folder / "none", folder / "none"]
    done = subprocess.run(absent, env={}, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "no such file" in done.stderr
