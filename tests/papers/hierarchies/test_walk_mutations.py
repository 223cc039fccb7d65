"""Tests of the walk that could fail: small faults put into a copy of it, each of which its checks must notice.

The copies run as plain Python, so that nothing is compiled.
"""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from installed_copy import copied

CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
import collide
assert collide.__file__.startswith(sys.argv[1]), collide.__file__
from collide.adapters.peers import exact
from collide.papers.hierarchies.validate_walk import validate_rounds
from collide.scenes.families import generate
until_noticed = sys.argv[2] == "until noticed"
wrong = broken = unproven = 0
for name in ("touch_vf", "touch_1ulp", "near_pen", "near_sep", "rand_pen", "box_lattice"):
    for case in generate(name, 7 if name == "box_lattice" else 4, 4):
        A, B, X_WA, X_WB = case.shapes()
        found = collide.walk(A, B, X_WA, X_WB, trace=True)
        unproven += not found.walked[0] or min(found.rows["level_p"][0], found.rows["level_q"][0]) > 0
        wrong += bool(found.hit[0]) != exact.hit(case.P, case.R1, case.t1, case.Q, case.R2, case.t2)
        try:
            validate_rounds(A._walk, B._walk, X_WA, X_WB, found.trace)
        except AssertionError:
            broken += 1
        if until_noticed and wrong + broken + unproven:
            print(wrong, broken, unproven)
            sys.exit()
numbers = np.random.default_rng(1).standard_normal((120, 3))
ball = collide.ConvexHull(numbers / np.linalg.norm(numbers, axis=1)[:, None])
beside = np.eye(4)
beside[:3, 3] = 1.5, 1.2, 1.0
(row,) = collide.walk(ball, ball, beside, np.eye(4)).rows
large = row["tests"] > 20 * row["rounds"]  # a round looks at a few vertices, not at a level
print(wrong, broken, unproven + int(large))
"""

MUTATIONS = {
    "none": ("walk_proof.py", "", ""),
    "planes need no room for rounding": ("walk_proof.py", "> 1.000001 * error", "> -1e-3"),
    "points need no room": ("walk_proof.py", "+ error < radius", "- 1e-3 < radius"),
    "the ball does not shrink towards the facet": ("walk_proof.py", "radius = (1.0 - s) * ", "radius = 1.0 * "),
    "cones are not looked at": ("walk_steps.py", "t = min(t, before / (before - after))", "t = 1.0"),
    "case 1 in the primal space always": ("walk_steps.py", "if height + shift > 1.0:", "if height + shift > -1e300:"),
    "case 1 in the polar space always": ("walk_steps.py", "if -height <= 1.0:", "if -height <= 1e300:"),
    "the vertex beyond is not looked for": (
        "packed_hierarchy.py", "        if lower < height:", "        if lower < -1e300:",
    ),
    "gives up always": ("walk_steps.py", "    outcome = _play(walk)\n", "    return NEITHER\n"),
    "scans a whole level": (
        "packed_hierarchy.py", "    if levels.birth[v] == level:\n        v = levels.parent[v]\n",
        "    if level > 0:\n        return lowest_of_level(levels, level - 1, d)\n        v = levels.parent[v]\n",
    ),
    "the star keeps the old plane": (
        "walk_steps.py", "put_vec3(state, Z_STAR, z)", "put_vec3(state, Z_STAR, vec3_at(state, Z_STAR))",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(MUTATIONS))
def test_faults_are_noticed(name, tmp_path):
    file, old, new = MUTATIONS[name]
    copied(tmp_path)
    source = tmp_path / "collide/papers/hierarchies" / file
    text = source.read_text(encoding="utf-8")
    assert old in text, f"{file} no longer has {old!r}"
    source.write_text(text.replace(old, new, 1) if old else text, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD, str(tmp_path), "all" if name == "none" else "until noticed"],
        capture_output=True, text=True, check=False,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1", "PYTHONPATH": str(tmp_path)}, timeout=300,
    )
    assert done.returncode == 0, done.stderr
    wrong, broken, unproven = map(int, done.stdout.split())
    assert (wrong + broken + unproven == 0) == (name == "none"), done.stdout
