"""What a type checker makes of a user's program: right ones are clean, misspelt names are told."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.skipif(find_spec("mypy") is None, reason="mypy is not installed")

RIGHT = '''
from typing import Any
import numpy as np
import collide
from collide import PairResult
from collide.results import Batch

box, ball = collide.Box(1, 1, 1), collide.Sphere(0.25)
X = collide.pose((2.0, 0, 0), quat_xyzw=(0, 0, 0, 1))
r = collide.distance(box, ball, collide.pose(), X, max_distance=5.0)
gap: float = r.distance + 1.0
how: collide.How = r.how
print(f"{gap:.3f}", r.point_a.shape, how is collide.How.SEPARATING_PLANE, collide.results.HOW[how])
hit: bool = collide.collide(box, ball, X, X, security_margin=0.01)

Xs = np.array([collide.pose((x, 0, 0)) for x in range(3)])
many: PairResult[Batch] = collide.distance(box, ball, np.eye(4), Xs)
print(many.distance.min(), many[0].distance + 1.0, many[:2].hit.sum())
print(collide.distance(box, ball, np.eye(4), Xs).distance)
c = collide.contacts([box] * 3, [ball] * 3, Xs, Xs, margin=0.1)
print(c.normal.shape, c[0].distance.sum(), c.starts)
collide.Cylinder(0.1, height=0.2), collide.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
world = collide.World()
world.add(box, X, name="box")
near = world.distances(0.5)
print(near["distance"].sum(), near.names)
'''
#: A line in place of the last one, and what is said of it.
WRONG = {
    "r.distnace": "has no attribute",
    "many.lowest": "has no attribute",
    "collide.distance(box, ball, np.eye(4), Xs).certfied": "has no attribute",
    "many[0].pont_a": "has no attribute",
    "c.nromal": "has no attribute",
    "near['distnace']": "Invalid index type",
    "collide.Bxo(1, 1, 1)": "has no attribute",
    "collide.Cylinder(0.1, lenght=0.2)": "Unexpected keyword",
    "collide.Sphere(raduis=1.0)": "Unexpected keyword",
    "collide.distance(box, ball, X, X, max_distnace=1.0)": "No overload",
    "collide.distance(box, 3, X, X)": "No overload",
    "collide.How.PLANE": "has no attribute",
    "r.distance.min()": "has no attribute",
    "x: str = r.how": "Incompatible types",
}


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """(status, lines) of mypy over a right program, and the same with one wrong line more, in one run."""
    folder = tmp_path_factory.mktemp("typed")
    # As it is installed: the packages stand inside each other, with their marker.
    shutil.copytree(ROOT / "collide", folder / "site" / "collide", ignore=shutil.ignore_patterns("__pycache__"))
    files = {"right.py": RIGHT, **{f"wrong{k}.py": f"{RIGHT}\n{line}\n" for k, line in enumerate(WRONG)}}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--follow-imports=silent", "--ignore-missing-imports",
         "--cache-dir", str(folder / "cache"), *files],
        cwd=folder, env={**os.environ, "MYPYPATH": str(folder / "site")}, capture_output=True, text=True, check=False,
        timeout=300,
    )
    assert done.returncode == 1, done.stdout + done.stderr
    return done.stdout.splitlines()


@pytest.mark.slow
def test_a_right_program_is_clean(checked):
    assert not [line for line in checked if line.startswith("right.py")]


@pytest.mark.parametrize("line", WRONG)
def test_what_is_misspelt_is_told(checked, line):
    k, at = list(WRONG).index(line), RIGHT.count("\n") + 2
    said = [told for told in checked if told.startswith(f"wrong{k}.py") and ": error:" in told]
    assert said and all(told.startswith(f"wrong{k}.py:{at}: error:") for told in said), said
    assert any(re.search(WRONG[line], told) for told in said), said
