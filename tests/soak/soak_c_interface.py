"""A seeded caller of all of `collide.h` from several threads: no fault of memory, no answer that contradicts.

    python tests/soak/soak_c_interface.py --calls 10000000 [--seed 1] [--threads 4] [--repeat ROUND.THREAD.CALL]

Builds `soak_c_interface.c` with the C sources of the library under the sanitizers of addresses and undefined
behaviour, where the compiler has these (``--plain``: linked to the library as installed), beside files of random
robots. Prints calls so far and calls per status. Ends with status 1 at a violation, which names the call to repeat.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path += [str(ROOT / "native"), str(ROOT / "tests" / "oracles")]

import numpy as np
from naive import random_pose
from random_robots import random_robot

import collide

SANITIZERS = ["-fsanitize=address,undefined", "-fno-sanitize-recover=undefined"]
SOURCE = Path(__file__).with_suffix(".c")


class NoTools(RuntimeError):
    """A compiler or its sanitizers are missing."""


def _compile(*command: object) -> None:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    if done.returncode:
        raise NoTools(done.stderr.strip().splitlines()[-1] if "cannot find" in done.stderr else done.stderr)


def build(folder: Path, sanitized: bool, *options: object) -> Path:
    """The program in ``folder``: with the C sources and sanitizers, or linked to the library as installed.

    options : more of the compiler's, for the program. Raises NoTools where no compiler, or no sanitizer, is to be
    had."""
    tool = shutil.which("gcc") or shutil.which("cc")
    if tool is None or not sys.platform.startswith("linux"):
        raise NoTools("the program needs a C compiler of Linux")
    program = folder / "soak_c_interface"
    common = [tool, "-std=gnu99", "-O1", "-Wall", "-Wextra", "-Werror", "-pthread", f"-I{ROOT / 'native'}"]
    if not sanitized:
        library = Path(collide.get_library())
        _compile(*common, *options, SOURCE, library, f"-Wl,-rpath,{library.parent}", "-lm", "-o", program)
        return program
    import build_library

    made = build_library._compiled_kernels("")
    build_library._generate(folder, made["entries"], list(made["objects"]))
    objects = []
    for source in [ROOT / "native" / name for name in build_library.C_SOURCES] + [SOURCE]:
        objects.append(folder / f"{source.stem}.o")
        sources = ["-g", "-ffp-contract=off", f"-I{folder}", "-DWITH_SOURCES", *SANITIZERS]
        _compile(*common, *sources, "-c", source, "-o", objects[-1])
    kernels = [file for files in made["objects"].values() for file in files]
    _compile(tool, *SANITIZERS, "-pthread", *objects, *kernels, "-lm", "-o", program)
    return program


def save_robots(folder: Path, seed: int, n: int = 3) -> list[Path]:
    """Files of n random robots among bodies."""
    random, files = np.random.default_rng([seed, 9]), []
    for k in range(n):
        world = collide.World()
        for shape in (collide.Box(0.3, 0.2, 0.2), collide.Sphere(0.1), collide.Cylinder(0.1, 0.4)):
            world.add(shape, random_pose(random, 0.6))
        files.append(folder / f"robot{k}.collide")
        collide.RobotChecker(random_robot(random, 4 + k), world).save(files[-1])
    return files


def soak(
    program: Path, calls: int, seed: int, threads: int, repeat: str = "", *, capture: bool = True
) -> subprocess.CompletedProcess:
    """One run of the program. repeat : a call as a violation names it. capture : output is kept, not printed."""
    robots = [part for file in save_robots(program.parent, seed) for part in ("--robots", str(file))]
    asked = ["--calls", str(calls), "--seed", str(seed), "--threads", str(threads), *robots]
    # allocations that a file of a robot asks for are refused by size, as a program without sanitizers has them
    env = {**os.environ, "ASAN_OPTIONS": "allocator_may_return_null=1:abort_on_error=1",
           "UBSAN_OPTIONS": "print_stacktrace=1:abort_on_error=1"}
    command = [str(program), *asked, *(["--repeat", repeat] if repeat else [])]
    return subprocess.run(command, capture_output=capture, text=True, check=False, env=env)


def main(arguments=None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--threads", type=int, default=4)
    parser.add_argument("--repeat", default="", help="ROUND.THREAD.CALL of a violation")
    parser.add_argument("--plain", action="store_true", help="the library as installed, without sanitizers")
    asked = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as folder:
        try:
            program = build(Path(folder), not asked.plain)
        except NoTools as error:
            print(f"nothing is asked: {error}", file=sys.stderr)
            return 2
        done = soak(program, asked.calls, asked.seed, asked.threads, asked.repeat, capture=False)
    return int(done.returncode != 0)


if __name__ == "__main__":
    sys.exit(main())
