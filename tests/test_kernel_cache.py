"""Compiled kernels on disk are code: nobody else may write them, and what is damaged is noticed before it is run."""

from __future__ import annotations

import errno
import os
import pickle
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest
from naive import rng_of

from collide import _kernel_cache
from collide.cache_folder import TRUST, make_private, why_distrusted
from collide.kernels import PLAIN_PYTHON, entry, kernel_cache_folder

needs_modes = pytest.mark.skipif(not TRUST, reason="modes of files say nothing here")
needs_compiler = pytest.mark.skipif(PLAIN_PYTHON, reason="nothing is compiled")


def doubled(x):
    return 2.0 * x


def answer(function=doubled) -> bool:
    """Ask an entry made anew; whether its kernel came from the disk."""
    asked = entry("float64(float64)")(function)
    assert asked(1.5) == 3.0
    return sum(asked.ready.stats.cache_hits.values()) == 1


@pytest.fixture()
def folder(tmp_path, monkeypatch, caplog) -> Path:
    """Where kernels are kept."""
    monkeypatch.setenv("COLLIDE_CACHE_DIR", str(tmp_path / "cache"))
    _kernel_cache.say_once.cache_clear()
    return kernel_cache_folder()


def kept(folder: Path) -> Path:
    """The one file of the one kernel."""
    (file,) = folder.iterdir()
    return file


# --- damage -----------------------------------------------------------------------------------------


@needs_compiler
def test_flipped_bits_and_cut_files_are_noticed_and_healed(folder, caplog):
    assert not answer() and answer()
    content, rng = kept(folder).read_bytes(), rng_of("damaged kernels")
    assert len(content) > 1000
    damaged = [b"", content[:20], content[:-1], content + b"\0", content[:500], os.urandom(len(content))]
    for at in rng.integers(len(content), size=10).tolist():
        damaged.append(content[:at] + bytes([content[at] ^ 1 << int(rng.integers(8))]) + content[at + 1 :])
    for harm in damaged:
        kept(folder).write_bytes(harm)
        caplog.clear()
        assert not answer(), "a damaged kernel was used"
        assert [record.getMessage().count("damaged") for record in caplog.records] == [1]
        caplog.clear()
        assert answer() and not caplog.records, "it was not healed"


@needs_compiler
def test_a_kernel_under_the_name_of_another_is_not_used(folder, caplog):
    def tripled_and_more(x):
        return 3.0 * x - x

    assert not answer()
    own = kept(folder)
    assert not answer(tripled_and_more)
    (other,) = (file for file in folder.iterdir() if file != own)
    own.write_bytes(other.read_bytes())
    assert not answer() and "damaged" in caplog.text


@needs_compiler
@pytest.mark.parametrize(
    "error",
    [
        AttributeError, EOFError, ImportError, IndexError, KeyError, MemoryError, NotImplementedError, OSError, OverflowError,
        RecursionError, SystemError, TypeError, UnicodeDecodeError, ValueError, pickle.UnpicklingError,
    ],
)  # fmt: skip
def test_whatever_a_pickle_raises_is_healed(folder, caplog, monkeypatch, error):
    def fails(_content):
        raise error(*(("utf-8", b"", 0, 1, "") if error is UnicodeDecodeError else ("of a pickle",)))

    assert not answer()
    with monkeypatch.context() as patch:
        patch.setattr(_kernel_cache, "pickle", SimpleNamespace(loads=fails))
        assert not answer() and caplog.text.count("damaged") == 1
    assert answer()


@needs_compiler
@pytest.mark.parametrize("how", ["full disk", "no file", "a file of that name", "error without number"])
def test_a_kernel_that_cannot_be_kept_is_said_and_used(folder, caplog, monkeypatch, how):
    def full(handle, mode):
        os.close(handle)
        if Path("/dev/full").exists():
            return open("/dev/full", mode)  # the error comes when it is closed
        raise OSError(errno.ENOSPC, "No space left on device")

    def none(**_given):
        raise OSError(errno.ENOSPC, "No space left on device") if how == "no file" else RuntimeError("who knows")

    if how == "full disk":
        monkeypatch.setattr(_kernel_cache.os, "fdopen", full)
    elif how == "a file of that name":
        folder.parent.mkdir(parents=True)
        folder.write_text("no folder")
    else:
        monkeypatch.setattr(_kernel_cache.tempfile, "mkstemp", none)
    assert not answer() and not answer()
    (record,) = caplog.records
    assert "cannot be kept" in record.getMessage() and "COLLIDE_CACHE_DIR" in record.getMessage()
    assert not folder.is_dir() or not list(folder.iterdir()), "half a file was left"


# --- whose folder it is -----------------------------------------------------------------------------


class Planted:
    """A pickle that runs code when it is read."""

    def __init__(self, mark: Path):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def plant(file: Path, mark: Path, monkeypatch) -> None:
    """Replace a kept kernel by code, with a digest that fits: whoever may write in the folder can do as much."""
    keys = []
    digest = _kernel_cache._digest
    with monkeypatch.context() as patch:
        patch.setattr(_kernel_cache, "_digest", lambda key, body: keys.append(key) or digest(key, body))
        assert answer()
    body = pickle.dumps(Planted(mark))
    file.write_bytes(digest(keys[0], body) + body)


@needs_compiler
@needs_modes
@pytest.mark.parametrize("shared", ["the folder", "a folder above", "the file", None])
def test_what_others_may_write_is_not_run(folder, caplog, monkeypatch, tmp_path, shared):
    mark = tmp_path / "planted code was run"
    assert not answer()
    file = kept(folder)
    plant(file, mark, monkeypatch)
    before = file.read_bytes()
    if shared is not None:
        {"the folder": folder, "a folder above": tmp_path / "cache", "the file": file}[shared].chmod(0o777)
    assert not answer()
    assert answer() == (shared in ("the file", None)), "kept anew where it may be, and nowhere else"
    assert mark.exists() == (shared is None), "this test can fail: in a folder of one's own it is believed"
    if shared in ("the folder", "a folder above"):
        (record,) = caplog.records
        told = record.getMessage()
        assert "may be written by others (mode 777)" in told and str(folder) in told and "COLLIDE_CACHE_DIR" in told
        assert "\n" not in told and file.read_bytes() == before
    else:
        assert "damaged" in caplog.text


@needs_compiler
@needs_modes
def test_folders_and_files_are_made_for_their_user_alone(folder):
    mask = os.umask(0)
    try:
        assert not answer()
    finally:
        os.umask(mask)
    modes = [stat.S_IMODE(place.stat().st_mode) for place in (folder, folder.parent, folder.parent.parent, kept(folder))]
    assert modes == [0o700, 0o700, 0o700, 0o600]


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
    for name, members, alone in (("ann", [], True), ("ann", ["ann"], True), ("ann", ["bob"], False), ("staff", [], False)):
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
    monkeypatch.setattr("collide.cache_folder.TRUST", False)
    assert why_distrusted(tmp_path) is None
