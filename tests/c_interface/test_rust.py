"""The library called from Rust: examples/rust is built offline and answers as Python does."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from naive import rng_of
from random_robots import random_robot

import collide
from collide.kernels import mode

if mode.MODE != mode.COMPILED:
    pytest.skip(f"kernels are not those of the library: {mode.WHY}", allow_module_level=True)

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "rust"


def test_the_example_is_built_offline_and_has_pythons_answers(folder):
    cargo = shutil.which("cargo")
    if cargo is None or sys.platform == "win32":
        pytest.skip("no cargo on this machine")
    shutil.copytree(EXAMPLE, folder / "rust", ignore=shutil.ignore_patterns("target"))
    world = collide.World()
    world.add(collide.Sphere(0.2), collide.pose([0.3, 0.0, 0.0]), name="ball")
    checker = collide.RobotChecker(random_robot(rng_of("a robot for Rust")), world)
    checker.save(folder / "robot.collide")
    bare = {**os.environ, "PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "RUSTFLAGS": "-D warnings"}
    done = subprocess.run(
        [cargo, "run", "--offline", "--locked", "--quiet", "--", str(folder / "robot.collide")],
        cwd=folder / "rust", env=bare, capture_output=True, text=True, check=False, timeout=300,
    )
    if "rustup" in done.stderr or "no default" in done.stderr:
        pytest.skip(f"no Rust on this machine: {done.stderr.splitlines()[0]}")
    assert done.returncode == 0, done.stderr
    pair, refused, robot = done.stdout.splitlines()
    row = collide.distance(collide.Box(1, 2, 0.5), collide.Sphere(0.25), np.eye(4), collide.pose([2.0, 0.0, 0.0]))
    assert pair == f"collide {collide.__version__}: {row.distance} m apart, within [{row.lower}, {row.upper}]"
    assert refused == "a sphere of radius -1: these numbers make no such shape"
    dof = checker.robot.dof
    hits = [checker.collides(np.full(dof, value)) for value in (0.0, 0.1)]
    assert robot == f"robot of {dof} columns: [" + ", ".join(f"[Some({str(hit).lower()})]" for hit in hits) + "]"
