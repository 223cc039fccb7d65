"""Files that are there whole, as they were before, or not at all: for everything that `collide` writes."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

#: A file that nobody else has made; Windows would translate the ends of its lines.
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)


@contextmanager
def whole_file(
    place: str | Path, *, private: bool = False, durable: bool = False, prefix: str = "."
) -> Iterator[BinaryIO]:
    """A stream whose content becomes the file at the end of the block; an error in the block leaves what was there.

    Parameters
    ----------
    place : the file. A link is followed; a file that is there keeps its mode.
    private : for nobody but this user, whatever the process's mask says.
    durable : on the disk before it takes the other's place, should the machine lose power.
    prefix : begins the name of the file beside it, which a killed process leaves there.

    Raises
    ------
    OSError : with the name of ``place``, also where a full disk told none.
    """
    place = os.path.realpath(place)
    beside = os.path.join(os.path.dirname(place), f"{prefix}{os.getpid()}-{secrets.token_hex(6)}.part")
    try:
        try:
            with open(os.open(beside, _NEW, 0o600 if private else 0o666), "wb") as file:
                yield file
                if durable:
                    file.flush()
                    os.fsync(file.fileno())
            if not private and os.path.exists(place):
                os.chmod(beside, os.stat(place).st_mode & 0o777)
            os.replace(beside, place)
        except BaseException:
            with suppress(OSError):
                os.remove(beside)
            raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, place) from None


def write_whole(place: str | Path, text: str) -> None:
    """A text in UTF-8; see `whole_file`."""
    with whole_file(place) as file:
        file.write(text.encode())
