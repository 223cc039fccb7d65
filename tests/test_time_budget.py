"""Processor time of tests: the limit of a tier fails what takes longer, and a file keeps what each took."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from time_budget import slower_than

HERE = Path(__file__).resolve().parent
TESTS = """
import time, pytest

def spin(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass

def test_quick():
    spin(0.01)

def test_sleeps():
    time.sleep(0.5)

def test_long():
    spin(0.5)

@pytest.mark.slow
def test_long_and_marked():
    spin(0.5)
"""
LONG = ("times.py::test_long", "times.py::test_long_and_marked")


def run(folder: Path, *options: str) -> str:
    """What pytest says of the tests above, with the hooks of this folder's conftest."""
    (folder / "test_times.py").write_text(TESTS, encoding="utf-8")
    (folder / "pytest.ini").write_text("[pytest]\nmarkers =\n    slow: so\n", encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(HERE)}
    given = ["-q", "-p", "time_budget", "-p", "no:cacheprovider", str(folder), *options]
    command = [sys.executable, "-m", "pytest", *given]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


@pytest.mark.slow
def test_a_test_over_the_budget_fails_and_names_itself(tmp_path):
    said = run(tmp_path, "--budget", "0.25")
    assert "1 failed, 3 passed" in said and "test_times.py::test_long took 0.5 s of processor time" in said


@pytest.mark.slow
def test_seconds_are_kept_and_told_where_they_grew(tmp_path):
    file = tmp_path / "seconds.json"
    file.write_text(json.dumps({"test_times.py::test_quick": 0.9, "test_gone.py::test_gone": 3.0}), encoding="utf-8")
    assert "4 passed" in run(tmp_path, "--durations-file", str(file))
    kept = json.loads(file.read_text(encoding="utf-8"))
    assert kept.keys() == {f"test_{name}" for name in ("gone.py::test_gone", *LONG)}
    assert kept["test_gone.py::test_gone"] == 3.0 and all(kept[f"test_{name}"] >= 0.5 for name in LONG)
    assert slower_than({"a": 1.0, "b": 1.0, "c": 10.0}, {"a": 2.1, "b": 1.9, "c": 12.0, "new": 9.0}) == [
        "slower: a, 1.0 s before, 2.1 s now"
    ]
