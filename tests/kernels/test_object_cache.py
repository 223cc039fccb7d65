"""Compiled kernels on disk are code: nobody else may write them, and what is damaged is noticed before it is run.

What is kept here is any bytes, for the cache looks at none of them; tests of kernels that are kept stand in
test_first_calls.py.
"""

from __future__ import annotations

import errno
import os
import stat
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest
from naive import rng_of

from collide.base.cache_folder import TRUST, make_private, say_once, why_distrusted
from collide.kernels import object_cache

needs_modes = pytest.mark.skipif(not TRUST, reason="modes of files say nothing here")

CODE = rng_of("machine code").bytes(3000)


def came_from_disk(name: str = "collide.a_kernel", key: str = "all it depends on", code: bytes = CODE) -> bool:
    """Ask for a kernel; whether it need not be compiled."""
    compiled = []
    assert object_cache.kept_or_made(name, key, lambda: compiled.append(name) or code) == code
    return not compiled


@pytest.fixture()
def folder(tmp_path, monkeypatch, caplog) -> Path:
    """Where kernels are kept."""
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / "cache"))
    say_once.cache_clear()
    return object_cache.kernel_folder()


def kept(folder: Path) -> Path:
    """The one file of the one kernel."""
    (file,) = folder.iterdir()
    return file


def test_a_kernel_is_compiled_once_and_another_key_is_another_kernel(folder, caplog):
    assert not came_from_disk() and came_from_disk() and not list(folder.parent.parent.glob("*.o"))
    assert not came_from_disk(key="another source", code=b"other code") and came_from_disk(
        key="another source", code=b"other code"
    )
    assert not came_from_disk(name="collide.another", code=b"another") and came_from_disk()
    assert len(list(folder.iterdir())) == 3 and not caplog.records


# --- damage -----------------------------------------------------------------------------------------


def test_flipped_bits_and_cut_files_are_noticed_and_healed(folder, caplog):
    assert not came_from_disk() and came_from_disk()
    content, rng = kept(folder).read_bytes(), rng_of("damaged kernels")
    assert len(content) > len(CODE)
    damaged = [b"", content[:20], content[:-1], content + b"\0", content[:500], rng.bytes(len(content)), content[::-1]]
    for at in rng.integers(len(content), size=30).tolist():
        damaged.append(content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :])
    for harm in damaged:
        kept(folder).write_bytes(harm)
        caplog.clear()
        assert not came_from_disk(), "a damaged kernel was used"
        assert [record.getMessage().count("damaged") for record in caplog.records] == [1]
        caplog.clear()
        assert came_from_disk() and not caplog.records, "it was not healed"


def test_a_kernel_under_the_name_of_another_is_not_used(folder, caplog):
    assert not came_from_disk()
    own = kept(folder)
    assert not came_from_disk(key="another", code=b"code of another")
    (other,) = (file for file in folder.iterdir() if file != own)
    own.write_bytes(other.read_bytes())
    assert not came_from_disk() and "damaged" in caplog.text


def test_a_folder_in_the_place_of_a_file_is_said_and_done_without(folder, caplog):
    assert not came_from_disk()
    file = kept(folder)
    file.unlink()
    file.mkdir()
    for _ in range(2):
        assert not came_from_disk()
    assert file.is_dir() and "damaged" in caplog.text and "cannot be kept" in caplog.text


# --- nothing can be kept ----------------------------------------------------------------------------


@pytest.mark.parametrize("how", ["full disk", "no file", "a file of that name", "no name", "read-only"])
def test_a_kernel_that_cannot_be_kept_is_said_and_used(folder, caplog, monkeypatch, how):
    make = os.open

    def full(place, flags, *mode):
        if not flags & os.O_CREAT:
            return make(place, flags, *mode)
        if how == "no file" or not Path("/dev/full").exists():
            raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))
        return make("/dev/full", flags & ~(os.O_CREAT | os.O_EXCL))  # the error comes when it is closed

    def refuse(number):
        def none(*_given, **_named):
            raise OSError(number, os.strerror(number))

        return none

    if how in ("full disk", "no file"):
        monkeypatch.setattr(os, "open", full)
    elif how == "a file of that name":
        folder.parent.mkdir(parents=True)
        folder.write_text("no folder")
    elif how == "no name":
        monkeypatch.setattr(os, "replace", refuse(errno.EIO))
    else:
        monkeypatch.setattr(Path, "mkdir", refuse(errno.EROFS))  # as root nothing is
    assert not came_from_disk() and not came_from_disk()
    (record,) = caplog.records
    assert "cannot be kept" in record.getMessage() and "COLLIDE_CACHE_DIR" in record.getMessage()
    assert "\n" not in record.getMessage()
    assert not folder.is_dir() or not list(folder.iterdir()), "half a file was left"


def test_an_interrupt_while_a_kernel_is_kept_leaves_no_half_file(folder, monkeypatch):
    def interrupted(_from, _to):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        with pytest.raises(KeyboardInterrupt):
            came_from_disk()
    assert not list(folder.iterdir())
    assert not came_from_disk() and came_from_disk()


def test_what_a_compiler_raises_is_the_askers(folder):
    """And nothing is kept of it."""

    def fails():
        raise NotImplementedError("of a compiler")

    with pytest.raises(NotImplementedError, match="of a compiler"):
        object_cache.kept_or_made("collide.a_kernel", "key", fails)
    assert not list(folder.iterdir())


def test_threads_that_keep_the_same_kernel_at_once(folder, caplog):
    """Each writes a file of its own and gives it the name: readers see one whole."""
    together, told = threading.Barrier(6, timeout=60), []

    def ask():
        for k in range(30):
            together.wait()
            told.append(object_cache.kept_or_made("collide.a_kernel", str(k), lambda: CODE) == CODE)

    threads = [threading.Thread(target=ask) for _ in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert told == [True] * 180 and not caplog.records
    assert len(list(folder.iterdir())) == 30


# --- whose folder it is -----------------------------------------------------------------------------


def plant(file: Path, monkeypatch) -> bytes:
    """Replace a kept kernel by other code, with a digest that fits: whoever may write in the folder can do as much."""
    identities, digest, planted = [], object_cache._digest, b"planted code"
    with monkeypatch.context() as patch:
        patch.setattr(
            object_cache, "_digest", lambda identity, code: identities.append(identity) or digest(identity, code)
        )
        assert came_from_disk()
    file.write_bytes(digest(identities[0], planted) + planted)
    return planted


@needs_modes
@pytest.mark.parametrize("shared", ["the folder", "a folder above", "the file", None])
def test_what_others_may_write_is_not_run(folder, caplog, monkeypatch, tmp_path, shared):
    assert not came_from_disk()
    file = kept(folder)
    planted = plant(file, monkeypatch)
    before = file.read_bytes()
    if shared is not None:
        {"the folder": folder, "a folder above": tmp_path / "cache", "the file": file}[shared].chmod(0o777)
    if shared is None:
        assert came_from_disk(code=planted), "this test can fail: in a folder of one's own it is believed"
        return
    assert not came_from_disk()
    assert came_from_disk() == (shared == "the file"), "kept anew where it may be, and nowhere else"
    if shared == "the file":
        assert f"others may have written {file}" in caplog.text
        return
    (record,) = caplog.records
    told = record.getMessage()
    assert "may be written by others (mode 777)" in told and str(folder) in told and "COLLIDE_CACHE_DIR" in told
    assert "\n" not in told and file.read_bytes() == before


@needs_modes
def test_folders_and_files_are_made_for_their_user_alone(folder):
    mask = os.umask(0)
    try:
        assert not came_from_disk()
    finally:
        os.umask(mask)
    modes = [stat.S_IMODE(place.stat().st_mode) for place in (folder, folder.parent, kept(folder))]
    assert modes == [0o700, 0o700, 0o600]


@needs_modes
def test_who_else_may_decide_what_a_folder_holds(tmp_path):
    def made(path: str, mode: int = 0o700) -> Path:
        place = tmp_path / path
        make_private(place)
        place.chmod(mode)
        return place

    fine = made("fine/below")
    assert why_distrusted(fine) is None and why_distrusted(fine / "not there" / "yet") is None
    assert why_distrusted(fine / ".." / "below") is None
    made("fine", 0o755)
    assert why_distrusted(fine) is None

    open_to_all = made("open", 0o777)
    inside = made("open/inside")
    for place in (open_to_all, inside, inside / "not there"):
        assert f"{open_to_all} may be written by others (mode 777)" in str(why_distrusted(place))

    # As in /tmp: one's own folder stays one's own there, but who comes first makes it.
    sticky = made("sticky", 0o1777)
    assert why_distrusted(made("sticky/own")) is None and why_distrusted(sticky / "not there") is None
    assert "may be written by others (mode 1777)" in str(why_distrusted(sticky))

    links = made("links")
    (links / "good").symlink_to(fine)
    (links / "relative").symlink_to("../fine/../fine/below")
    (links / "bad").symlink_to(inside)
    (links / "chain").symlink_to(open_to_all / "link")
    (open_to_all / "link").symlink_to(fine)
    assert why_distrusted(links / "good") is None and why_distrusted(links / "relative") is None
    assert why_distrusted(links / "bad") and why_distrusted(links / "bad" / "below")
    assert why_distrusted(links / "chain"), "who may write where a link stands can turn it elsewhere"
    (links / "round").symlink_to(links / "round")
    with pytest.raises(OSError):
        why_distrusted(links / "round")


@needs_modes
def test_a_group_may_write_where_it_is_the_user_alone(tmp_path, monkeypatch):
    grp, pwd = pytest.importorskip("grp"), pytest.importorskip("pwd")
    place = tmp_path / "of a group"
    place.mkdir()
    place.chmod(0o770)
    monkeypatch.setattr(pwd, "getpwuid", lambda _uid: SimpleNamespace(pw_name="ann"))
    for name, members, alone in (
        ("ann", [], True),
        ("ann", ["ann"], True),
        ("ann", ["bob"], False),
        ("staff", [], False),
    ):
        monkeypatch.setattr(grp, "getgrgid", lambda _gid, g=(name, members): SimpleNamespace(gr_name=g[0], gr_mem=g[1]))
        assert (why_distrusted(place) is None) == alone, (name, members)


@needs_modes
@pytest.mark.skipif(not TRUST or os.geteuid() != 0, reason="only root can give a folder away")
def test_folders_and_links_of_somebody_else(tmp_path):
    theirs, link = tmp_path / "theirs", tmp_path / "link"
    (theirs / "below").mkdir(parents=True)
    (tmp_path / "own").mkdir()
    link.symlink_to(tmp_path / "own")
    assert why_distrusted(theirs / "below") is None and why_distrusted(link) is None
    os.chown(theirs, 12345, -1)
    os.lchown(link, 12345, -1)
    for place in (theirs, theirs / "below"):
        assert why_distrusted(place) == f"{theirs} belongs to another user (id 12345)"
    assert why_distrusted(link) == f"{link} belongs to another user (id 12345)"


def test_where_modes_say_nothing_everything_is_trusted(tmp_path, monkeypatch):
    tmp_path.chmod(0o777)
    monkeypatch.setattr("collide.base.cache_folder.TRUST", False)
    assert why_distrusted(tmp_path) is None
