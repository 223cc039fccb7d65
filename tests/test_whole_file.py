"""Files appear whole or not at all, and those that were there keep what others may do with them."""

import errno
import os
import stat
import sys

import pytest

from collide.whole_file import whole_file, write_whole

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
