"""The hook that judges messages of commits takes those that say why, and refuses others with what to do."""

from __future__ import annotations

import shutil
import subprocess

import pytest
from house_sources import ROOT

HOOK = ROOT / ".githooks" / "commit-msg"
pytestmark = pytest.mark.skipif(shutil.which("sh") is None, reason="there is no shell")
GOOD = "Boxes: half the time\n\nThe corners were turned twice.\n"


def judged(tmp_path, message: str) -> tuple[int, str]:
    """(exit code, what it says)."""
    file = tmp_path / "COMMIT_EDITMSG"
    file.write_text(message, encoding="utf-8")
    done = subprocess.run(["sh", str(HOOK), str(file)], capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


@pytest.mark.parametrize(
    "message",
    [
        GOOD, "x" * 100 + "\n\nbody", "ä→" * 50 + "\n\nbody", "Merge branch 'work'\n",
        'Revert "Boxes: half the time"\n', "fixup! Boxes: half the time\n", "squash! Boxes\n",
        GOOD + "# Please enter the commit message\n",
        GOOD + "# ------------------------ >8 ------------------------\ndiff --git a b\n" + "+" * 200,
    ],
)
def test_messages_that_are_taken(tmp_path, message):
    assert judged(tmp_path, message) == (0, "")


@pytest.mark.parametrize(
    "message, told",
    [
        ("x" * 101 + "\n\nbody", "101 characters; write at most 100"), ("ä→" * 51 + "\n\nbody", "102 characters"),
        ("Boxes: half the time\n", "write a body"), ("Boxes: half the time\n\n \n\n", "write a body"),
        ("Boxes: half the time\nThe corners were turned twice.\n", "second line blank"),
        ("Boxes: half the time\n\n# Please enter the commit message\n", "write a body"),
        ("Boxes\n\n# ------------------------ >8 ------------------------\ndiff --git a b\n", "write a body"),
        ("Merged boxes\n", "write a body"),
    ],
)
def test_messages_that_are_refused(tmp_path, message, told):
    code, said = judged(tmp_path, message)
    assert code == 1 and said.startswith("commit-msg: ") and told in said


def test_git_runs_it(tmp_path):
    """The file is executable, and git finds it where CONTRIBUTING says."""
    if shutil.which("git") is None:
        pytest.skip("there is no git")
    assert "git config core.hooksPath .githooks" in (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    shutil.copytree(HOOK.parent, tmp_path / ".githooks")

    def git(*words: str) -> subprocess.CompletedProcess:
        named = ["-c", "user.name=a", "-c", "user.email=a@b", "-c", "core.hooksPath=.githooks"]
        return subprocess.run(["git", *named, *words], cwd=tmp_path, capture_output=True, text=True, check=False)

    assert git("init").returncode == 0
    short = git("commit", "--allow-empty", "-m", "Boxes: half the time")
    assert short.returncode != 0 and "write a body" in short.stderr
    assert git("commit", "--allow-empty", "-m", "Boxes: half the time", "-m", "Turned once.").returncode == 0
