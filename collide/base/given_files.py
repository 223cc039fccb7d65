"""Files named by users, read within limits: anything but a file (a pipe, a device, a folder) is refused before the
opening, and so is a file larger than the limit of its kind.
"""

from __future__ import annotations

import os
import stat
from pathlib import Path

from collide.errors import SceneError

#: Bytes of a description (a scene, a robot, joint values, a report), and of all files that a scene includes together.
LARGEST_TEXT = 256 * 2**20
#: Bytes of a mesh file, unpacked.
LARGEST_MESH = 512 * 2**20
#: Bytes of a file of points, or of an octree, unpacked.
LARGEST_CLOUD = 2048 * 2**20

_KINDS = (
    (stat.S_ISFIFO, "a named pipe"), (stat.S_ISCHR, "a device"), (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def read_bytes(path: Path, largest: int = LARGEST_TEXT, what: str = "description") -> bytes:
    """The bytes of a regular file; SceneError where it is missing, something else, or larger than ``largest``."""
    try:
        _refuse_other_than_files(path, os.stat(path))
        # Between the two looks a file may have become a pipe: opening one must not wait for its writer.
        handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(handle, "rb") as file:
            about = os.fstat(handle)
            _refuse_other_than_files(path, about)
            content = b"" if about.st_size > largest else file.read(about.st_size + 1)
            if len(content) > about.st_size:  # it grows, or is one of the kernel's, whose size is 0
                content += file.read(largest + 1 - len(content))
            if about.st_size > largest or len(content) > largest:
                raise SceneError(f"is larger than {largest >> 20} MiB, the most that is read of a {what}", path=path)
            return content
    except FileNotFoundError:
        raise SceneError("no such file", path=path) from None
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"is no name of a file: {error}", path=repr(str(path))) from None
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror or error}", path=path) from None


def read_text(path: Path) -> str:
    """A file as UTF-8 text."""
    return as_text(read_bytes(path), path)


def as_text(content: bytes, path: Path) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise SceneError(f"is not UTF-8 text (byte {error.start})", path=path) from None


def starts_like_xml(path: Path) -> bool:
    """Whether a regular file starts like an XML element; ``False`` for unreadable files."""
    return head(path, 256).lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<")


def head(path: Path, count: int) -> bytes:
    """The first bytes of a regular file; an empty string for unreadable or other files."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            return b""
        with path.open("rb") as file:
            return file.read(count)
    except (OSError, ValueError):
        return b""


def is_file(path: Path) -> bool:
    """Whether a regular file exists; ``False`` too for impossible file names."""
    try:
        return stat.S_ISREG(os.stat(path).st_mode)
    except (OSError, ValueError):
        return False


def _refuse_other_than_files(path: Path, about: os.stat_result) -> None:
    if stat.S_ISDIR(about.st_mode):
        raise SceneError("is a folder; name a file in it", path=path)
    if not stat.S_ISREG(about.st_mode):
        kind = next((name for test, name in _KINDS if test(about.st_mode)), "something else")
        raise SceneError(f"is {kind}, not a file: write what it gives to a file first", path=path)
