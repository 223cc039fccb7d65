"""Files are new and complete, or as before: for everything written by `collide`.

A file is written under another name in its own folder and takes its place by `os.replace`, in a single step: a full
disk, an error or a signal in between leaves the old file. `tests/base/test_whole_file.py` asserts that no other code
opens a file to write.
"""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

#: A file that nobody else has made; Windows would translate the ends of its lines.
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


@contextmanager
def whole_file(
    place: str | Path, *, private: bool = False, durable: bool = False, follow: bool = True, prefix: str = "."
) -> Iterator[BinaryIO]:
    """A stream whose content becomes the file at the end of the block; an error in the block leaves the old file.

    Parameters
    ----------
    place : the file. An existing file keeps its mode. A device or a pipe is written directly: no file could take
        its place.
    private : for nobody but this user, whatever the process's mask. A link is not followed.
    durable : on the disk before the new file takes the old file's place, should the machine lose power.
    follow : whether a link stands for its target; otherwise the link itself is replaced. Folders of the library's
        own names (caches, sweeps) are not asked for links: whoever could place a link would choose the file.
    prefix : begins the name of the temporary file beside ``place``, left over by a killed process.

    Raises
    ------
    OSError : with the name of ``place``, also where a full disk gave no name.
    """
    follow = follow and not private
    folder, name = os.path.split(os.fspath(place))
    path = os.path.realpath(place) if follow else os.path.join(os.path.realpath(folder), name)
    try:
        before = _status(path)
        if before is not None and follow and not stat.S_ISREG(before.st_mode):
            with open(path, "wb") as stream:
                yield stream
            return
        beside = os.path.join(os.path.dirname(path), f"{prefix}{os.getpid()}-{secrets.token_hex(6)}.part")
        try:
            with open(os.open(beside, _NEW, 0o600 if private else 0o666), "wb") as file:
                yield file
                if durable:
                    file.flush()
                    os.fsync(file.fileno())
            if not private and before is not None and stat.S_ISREG(before.st_mode):
                os.chmod(beside, before.st_mode & 0o777)
            os.replace(beside, path)
        except BaseException:
            with suppress(OSError):
                os.remove(beside)
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, path) from None


def _status(path: str) -> os.stat_result | None:
    """Status of the file, of a link itself and not of its target; ``None`` for a missing file."""
    try:
        return os.lstat(path)
    except FileNotFoundError:
        return None


def write_whole(place: str | Path, text: str | Iterable[str]) -> None:
    """A text, or pieces of text one behind the other, in UTF-8; see `whole_file`."""
    with whole_file(place) as file:
        for piece in (text,) if isinstance(text, str) else text:
            file.write(piece.encode())
