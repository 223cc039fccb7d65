"""The engine's answers byte by byte, over all families, kinds of shapes and ways of asking: see golden.py."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from collide.kernels import PLAIN_PYTHON, library

GOLDEN = Path(__file__).with_name("golden.py")


def _levels() -> list[str]:
    about = library.about()
    return about["levels"].split(", ") if about and library.level else [""]


@pytest.mark.skipif(PLAIN_PYTHON, reason="takes hours without compilation")
@pytest.mark.parametrize("level", _levels())
def test_answers_are_those_kept(level):
    """On every level of processors that this one has. ``python tests/golden.py --write`` after a change that is
    meant."""
    environment = {**os.environ, **({"COLLIDE_CPU": level} if level else {})}
    done = subprocess.run(
        [sys.executable, str(GOLDEN)], env=environment, capture_output=True, text=True, check=False, timeout=600
    )
    if "no such level" in done.stderr:
        pytest.skip(f"this processor has no {level}")
    summary = done.stdout.splitlines()[-1] if done.stdout else done.stderr
    assert done.returncode == 0, done.stdout + done.stderr
    many, others = int(summary.split()[0]), int(summary.split(", ")[2].split()[0])
    if others > many // 2:
        pytest.skip(f"questions are other doubles here: {summary}")
    assert many == len(json.loads(GOLDEN.with_suffix(".json").read_text(encoding="utf-8"))) > 300
