"""The cache of meshes: what is taken from it is this user's, of its own key, as it was written, and no link."""

from __future__ import annotations

import io
import os
import sys

import numpy as np
import pytest

import collide
from collide.base.cache_folder import say_once
from collide.scenes import load
from collide.scenes import mesh_cache as cache
from collide.shapes.shape_files import pack

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no modes of files")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / "cache"))
    say_once.cache_clear()
    return tmp_path / "cache" / "scenes"


@pytest.fixture
def ball(tmp_path):
    vertices, faces = collide.tessellate(collide.Sphere(1.0), tolerance=0.05)
    collide.Mesh(vertices, faces[:-1]).save(tmp_path / "ball.ply")
    return tmp_path / "ball.ply"


def size(file) -> float:
    return float(np.abs(load(file).bodies[0].shape.vertices).max())


def test_meshes_are_kept(folder, ball, monkeypatch):
    """As docs/cache.md says: the second run reads no mesh file."""
    assert size(ball) == 1.0
    (entry,) = folder.glob("*.npz")
    assert oct(entry.stat().st_mode & 0o777) == "0o600" and oct(folder.stat().st_mode & 0o777) == "0o700"
    monkeypatch.setattr("collide.scenes.loaders.mesh_file.triangles_of", lambda _: pytest.fail("it was read again"))
    assert size(ball) == 1.0


def test_a_planted_link_does_not_choose_what_is_written(folder, ball, tmp_path):
    """In a folder of our own, as where one was copied together with its links."""
    size(ball)
    (entry,) = folder.glob("*.npz")
    letter = tmp_path / "letter.txt"
    letter.write_text("dear")
    for target in (letter, tmp_path / "absent"):
        entry.unlink()
        entry.symlink_to(target)
        assert size(ball) == 1.0
        assert not entry.is_symlink() and letter.read_text() == "dear" and not (tmp_path / "absent").exists()


def forged(entry, factor: float, key: str | None = None) -> bytes:
    """A right entry for a ball of another size, digest and all."""
    with np.load(entry) as found:
        arrays = {name: found[name] for name in found.files if name not in ("format", "digest")}
    arrays["points0"] = arrays["points0"] * factor
    if key is not None:
        arrays["key"] = np.frombuffer(key.encode(), dtype=np.uint8)
    stream = io.BytesIO()
    pack(stream, cache.VERSION, arrays)
    return stream.getvalue()


@pytest.mark.parametrize("who", ["folder", "file", "above", "link to a folder of others"])
def test_what_others_may_write_is_not_believed(folder, ball, tmp_path, who, caplog):
    size(ball)
    (entry,) = folder.glob("*.npz")
    entry.write_bytes(forged(entry, 0.01))
    if who == "link to a folder of others":
        folder.rename(tmp_path / "theirs")
        (tmp_path / "theirs").chmod(0o777)
        folder.symlink_to(tmp_path / "theirs")
    else:
        {"folder": folder, "file": entry, "above": folder.parent}[who].chmod(0o777)
    before = entry.read_bytes()
    assert size(ball) == 1.0
    if who == "file":
        assert entry.read_bytes() != before, "it is written anew"
    else:
        assert entry.read_bytes() == before and "may be written by others (mode 777)" in caplog.text


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="giving a file away takes root")
def test_entries_of_another_user_are_not_believed(folder, ball):
    size(ball)
    (entry,) = folder.glob("*.npz")
    entry.write_bytes(forged(entry, 0.01))
    os.chown(entry, 12345, -1)
    assert size(ball) == 1.0
    os.chown(folder, 12345, -1)
    assert size(ball) == 1.0


def test_entries_are_looked_at(folder, ball):
    """Of another key, with a flipped bit, with counts that the file has no room for: read again, and mended."""
    size(ball)
    (entry,) = folder.glob("*.npz")
    right = entry.read_bytes()
    at = right.index(b"'shape': (", right.index(b"points0")) + len(b"'shape': (")
    comma = right.index(b",", at)
    header_end = right.index(b"\n", at)
    grown = b"9" * 12 + right[comma:header_end]
    huge = right[:at] + grown[: header_end - at] + right[header_end:]
    bad = {"another key": forged(entry, 0.01, "0" * 64), "a huge count": huge, "empty": b"", "no zip": b"x" * 900,
           "cut": right[:-80]}
    for k in range(60, len(right), len(right) // 20):
        bad[f"bit {k}"] = right[:k] + bytes([right[k] ^ 1]) + right[k + 1:]
    read = 0
    for name, blob in bad.items():
        entry.write_bytes(blob)
        assert size(ball) == 1.0, name
        read += entry.read_bytes() == right
    assert read >= len(bad) - 5, "all but flips of what nobody reads are written anew"


def test_a_cache_folder_that_cannot_be(ball, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("~nouser/x", str(ball), "/dev/null/x"):
        monkeypatch.setenv("COLLIDE_CACHE_DIR", name)
        assert size(ball) == 1.0
