"""Files appear whole or not at all, and those that were there keep what others may do with them."""

from __future__ import annotations

import ast
import errno
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest
from house_sources import nodes

from collide.base.whole_file import whole_file, write_whole

posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no modes of files")


def test_nothing_is_there_before_the_end(tmp_path):
    place = tmp_path / "made.txt"
    with whole_file(place, prefix="_partial-") as file:
        file.write(b"whole")
        assert not place.exists() and [path.name[:9] for path in tmp_path.iterdir()] == ["_partial-"]
    assert place.read_bytes() == b"whole" and os.listdir(tmp_path) == ["made.txt"]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_what_was_there(tmp_path, failure):
    place = tmp_path / "kept.txt"
    write_whole(place, "before\n")
    with pytest.raises(failure), whole_file(place) as file:
        file.write(b"half")
        raise failure
    assert place.read_text() == "before\n" and os.listdir(tmp_path) == ["kept.txt"]


def test_a_full_disk_is_told_with_the_file(tmp_path):
    place = tmp_path / "full.txt"
    with pytest.raises(OSError, match=r"full\.txt"), whole_file(place):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with pytest.raises(OSError, match="absent"):
        write_whole(tmp_path / "absent" / "file.txt", "")


@posix
def test_modes_and_links(tmp_path):
    old_mask = os.umask(0o022)
    try:
        place, link = tmp_path / "file.txt", tmp_path / "link.txt"
        write_whole(place, "a")
        assert stat.S_IMODE(place.stat().st_mode) == 0o644
        place.chmod(0o640)
        link.symlink_to(place)
        write_whole(link, "b")
        assert link.is_symlink() and place.read_text() == "b" and stat.S_IMODE(place.stat().st_mode) == 0o640
        with whole_file(place, private=True) as file:
            file.write(b"c")
        assert stat.S_IMODE(place.stat().st_mode) == 0o600
    finally:
        os.umask(old_mask)


# --- nothing else writes ----------------------------------------------------------------------------

ROOT = Path(__file__).resolve().parents[2]
#: What opens a file to write, by file and function: the one place, and those that write no file of a user's.
WRITERS = {
    ("collide/base/whole_file.py", "whole_file"): "the one place",
    ("collide/sweeps/sweep_directory.py", "_opened_lock"): "a lock, without content",
}
#: Functions that write to the path that they are given; those of the second row take a stream as well.
_WRITE = {"write_bytes", "tofile", "copyfile", "copy2", "savetxt", "NamedTemporaryFile"}
_SAVE = {"savez", "savez_compressed", "savefig"}
_MODE = re.compile(r"[rbt]*[wax+][bt+]*")


def _writes(call: ast.Call) -> bool:
    """Whether a call opens a file to write."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    module = getattr(getattr(call.func, "value", None), "id", "")
    if name == "open":
        values = [*call.args, *(keyword.value for keyword in call.keywords)]
        words = [value.value for value in values if isinstance(value, ast.Constant) and isinstance(value.value, str)]
        flags = ast.dump(call)
        return any(map(_MODE.fullmatch, words)) or any(flag in flags for flag in ("O_WRONLY", "O_RDWR", "'_NEW'"))
    if name in _SAVE:
        return getattr(call.args[0], "id", "") != "file"
    is_text = name == "write_text" and module != "terminal" and isinstance(call.func, ast.Attribute)
    return name in _WRITE or is_text or (name == "save" and module == "np")


def test_nothing_else_opens_a_file_to_write():
    """A file opened to write is empty from then on: a full disk would leave that in place of the old one."""
    found = {}
    for room in ("collide", "scenes", "adapters"):
        for file in sorted((ROOT / room).rglob("*.py")):
            shown = file.relative_to(ROOT).as_posix()
            for function in nodes(file):
                if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
                    for call in ast.walk(function):
                        if isinstance(call, ast.Call) and _writes(call) and "devnull" not in ast.dump(call):
                            found[shown, function.name] = call.lineno
    assert set(found) == set(WRITERS), found


FULL_DISK = """
import resource, signal, sys, warnings
import numpy as np, collide
from collide.cli.main import main
from collide.base.whole_file import whole_file
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
t = np.linspace(0, 2 * np.pi, 2000, endpoint=False)
hull = collide.ConvexHull(np.stack([np.cos(t), np.sin(t), 0 * t], axis=1))
mesh = collide.Mesh(*collide.tessellate(collide.Sphere(1), tolerance=1e-3))
field = collide.HeightField(np.zeros((60, 60)), 1.0)
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))
kept = sys.argv[1]
for save in (hull.save, mesh.save, field.save, lambda place: mesh.save(place.replace("npz", "stl")),
             lambda place: mesh.save(place.replace("npz", "obj"))):
    try:
        save(kept + "/old.npz")
    except collide.InvalidShape as error:
        print(error)
for words in (["report", "workcell", "--json", kept + "/old.json", "--quiet"],
              ["report", "workcell", "--html", kept + "/old.html", "--quiet"],
              ["scenes", "--copy", "panda_workbench", kept + "/old.yaml", "--force"],
              ["check", "workcell", "--junit", kept + "/old.xml", "--quiet"]):
    print(main(words))
"""


@posix
def test_a_full_disk_leaves_every_old_file(tmp_path):
    """Files of at most 2,000 bytes stand for the full disk: writing more fails in the middle."""
    names = ["old.npz", "old.stl", "old.obj", "old.json", "old.html", "old.yaml", "old.xml"]
    for name in names:
        (tmp_path / name).write_text("the good old file")
    # -B: Python cuts the bytecode that it keeps, and every process after this one would fail over it
    done = subprocess.run(
        [sys.executable, "-B", "-c", FULL_DISK, str(tmp_path)], check=False, capture_output=True, text=True, timeout=200
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("File too large") == 5 and done.stdout.split()[-4:] == ["2"] * 4, done.stdout + done.stderr
    assert done.stderr.count("File too large") == 4
    assert sorted(os.listdir(tmp_path)) == sorted(names)
    assert all((tmp_path / name).read_text() == "the good old file" for name in names)


@posix
def test_links_are_replaced_where_they_are_not_followed(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    for options in ({"private": True}, {"follow": False}):
        target.write_text("somebody's")
        link.unlink(missing_ok=True)
        link.symlink_to(target)
        with whole_file(link, **options) as file:
            file.write(b"ours")
        assert not link.is_symlink() and link.read_text() == "ours" and target.read_text() == "somebody's"


@posix
def test_devices_and_pipes_are_written_to_as_they_are(tmp_path):
    write_whole("/dev/null", "gone")
    assert stat.S_ISCHR(os.stat("/dev/null").st_mode)
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    write_whole(pipe, ["a", "b"])
    assert os.read(reader, 9) == b"ab" and stat.S_ISFIFO(os.stat(pipe).st_mode)
    os.close(reader)
    with pytest.raises(OSError, match="directory"):
        write_whole(tmp_path, "")
