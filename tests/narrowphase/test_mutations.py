"""Tests that could fail: small faults put into a copy of the engine, each of which the hard families must notice.

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
import collide
assert collide.__file__.startswith(sys.argv[1]), collide.__file__
from collide.adapters.peers.stress import run
names = ["touch_vf", "touch_ff", "touch_1ulp", "boxes_flush", "swept_1ulp", "halfspace_touch", "near_pen"]
wrong = undecided = 0
for name in names:
    table = run([name], n=int(sys.argv[2]), seed=4)
    wrong, undecided = wrong + table.wrong + table.failed, undecided + table.undecided
    if sys.argv[3] == "until noticed" and wrong + undecided:
        break
print(wrong, undecided)
"""

MUTATIONS = {
    "none": ("bounds.py", "", ""),
    "error bound a hundredth": ("bounds.py", "ERROR = 64 * 2.0**-53", "ERROR = 0.64 * 2.0**-53"),
    "a sign swapped": (
        "exact/exact_directions.py",
        "    if side < 0:\n        reverse",
        "    if side > 0:\n        reverse",
    ),
    "the exact stage skipped": ("exact/settle_hulls.py", "if view_u8(row_at, ROW)[HOW] != UNDECIDED:", "if True:"),
    "the exact half-space inverted": (
        "exact/exact_halfspace.py",
        "return PlaneContact(TOUCHING if sign <= 0",
        "return PlaneContact(TOUCHING if sign < 0",
    ),
    "an error of a sum dropped": ("gap/precise_pair.py", "rest += x.low + error", "rest += x.low"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTATIONS)
def test_mutation_is_noticed(name, tmp_path):
    file, old, new = MUTATIONS[name]
    copied(tmp_path)
    source = tmp_path / "collide" / "narrowphase" / file
    text = source.read_text(encoding="utf-8")
    assert old in text, f"{file} no longer contains {old!r}"
    source.write_text(text.replace(old, new, 1) if old else text, encoding="utf-8")
    run = subprocess.run(
        [sys.executable, "-c", CHILD, str(tmp_path), "60" if "bound" in name else "8",
         "all" if name == "none" else "until noticed"], check=False,
        capture_output=True, text=True, cwd=tmp_path,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, timeout=300,
    )
    assert run.returncode == 0, run.stderr[-2000:]
    wrong, undecided = (int(word) for word in run.stdout.split())
    if name == "none":
        assert (wrong, undecided) == (0, 0)
    else:
        assert wrong or undecided, "the families did not notice"
