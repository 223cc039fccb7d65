"""Where collide keeps what it has prepared: compiled kernels and parsed inputs."""

from __future__ import annotations

import os
import stat
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from collide.base.log import log

#: Whether files have owners and modes that say who may write them. On Windows they say nothing: there a user's folders
#: are the user's by their access lists.
TRUST = hasattr(os, "geteuid")
#: As many links as the system itself follows.
_MAX_LINKS = 40


def cache_folder(*parts: str) -> Path:
    """The user's cache folder for collide, not necessarily existing yet.

    ``COLLIDE_CACHE_DIR`` if set; else the platform's place: ``%LOCALAPPDATA%``,
    ``~/Library/Caches``, ``$XDG_CACHE_HOME`` or ``~/.cache``.
    """
    folder_named = os.environ.get("COLLIDE_CACHE_DIR")
    if folder_named:
        # "~name" of a user whom nobody knows stays as it is, as in a shell
        return Path(os.path.expanduser(folder_named)).joinpath(*parts)
    home = Path(os.path.expanduser("~"))
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base.joinpath("collide", *parts)


def make_private(folder: Path) -> None:
    """Make a folder, and missing folders above, with access for this user alone."""
    if not folder.is_dir():
        make_private(folder.parent)
        folder.mkdir(mode=0o700, exist_ok=True)


def why_unusable(folder: Path) -> str | None:
    """Why a folder cannot be used for reading and writing; ``None`` for a usable folder, made where missing."""
    try:
        why = why_distrusted(folder)
        if why is None:
            make_private(folder)
            why = why_distrusted(folder)  # somebody else may have made it meanwhile
        return why
    except (OSError, RuntimeError, ValueError) as error:
        return str(error)


def own_folder(folder: Path, what: str, use: str) -> Path | None:
    """A folder of the cache, made where missing; ``None``, with a single warning, where other users could put files
    inside.

    what : trusted content of the folder, for the warning: "compiled kernels".
    use : the consequence of doing without: "they are compiled again in every process".
    """
    why = why_unusable(folder)
    if why is None:
        return folder
    say_once(
        f"{what} cannot be kept in {folder}, nor taken from there: {why}; {use}. Set COLLIDE_CACHE_DIR to a folder of "
        "your own that can be written."
    )
    return None


@cache
def say_once(message: str) -> None:
    """A warning of the log, only at the first call with this message in this process."""
    log.warning(message)


def read_own(file: Path) -> bytes:
    """The bytes of a file writable by this user alone. No link is followed, and no pipe waited for.

    Raises FileNotFoundError for a missing file, PermissionError for a file writable by others, OSError.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    descriptor = os.open(file, flags)
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise PermissionError(f"{file} is no file")
        if TRUST and (status.st_uid != os.geteuid() or stat.S_IMODE(status.st_mode) & 0o022):
            raise PermissionError(f"others may have written {file}")
        with os.fdopen(descriptor, "rb", closefd=False) as opened:
            return opened.read()
    finally:
        os.close(descriptor)  # also of a folder: `os.fdopen` makes no stream of a folder and leaves the descriptor open


def why_distrusted(folder: Path) -> str | None:
    """Who else may write a folder's content: "… may be written by others", or ``None`` where nobody may.

    Every folder and link on the way must belong to this user, or to the owner of the machine, and be
    writable to nobody else. In a folder with the sticky bit, like /tmp, everyone may add files and only owners move
    their files, so a sticky folder may stand on the way, but not be the folder itself. Missing folders are passed over.
    """
    if not TRUST:
        return None
    owners = {0, os.geteuid(), os.stat("/").st_uid}  # who has the root folder has all there is
    for place, status, is_last in _way_to(folder):
        if status.st_uid not in owners:
            return f"{place} belongs to another user (id {status.st_uid})"
        shared = _others_may_write(status) and (is_last or not status.st_mode & stat.S_ISVTX)
        if shared and not stat.S_ISLNK(status.st_mode):  # of a link the mode says nothing
            return f"{place} may be written by others (mode {stat.S_IMODE(status.st_mode):o})"
    return None


def _others_may_write(status: os.stat_result) -> bool:
    return bool(status.st_mode & stat.S_IWOTH) or (
        bool(status.st_mode & stat.S_IWGRP) and not _is_own_group(status.st_gid)
    )


def _is_own_group(group: int) -> bool:
    """Whether a group is this user alone, as many systems make one for each user."""
    import grp
    import pwd

    try:
        name, entry = pwd.getpwuid(os.geteuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return False
    return entry.gr_name == name and set(entry.gr_mem) <= {name}


def _way_to(folder: Path) -> Iterator[tuple[Path, os.stat_result, bool]]:
    """(folder or link, its status, whether the end) from the root to a folder, as far as they exist."""
    waiting = list(reversed((Path.cwd() / folder).parts))
    at, links = Path(waiting.pop()), 0
    yield at, os.lstat(at), not waiting
    while waiting:
        part = waiting.pop()
        if part == "..":
            at = at.parent
            continue
        try:
            status = os.lstat(at / part)
        except (FileNotFoundError, NotADirectoryError):
            return
        if stat.S_ISLNK(status.st_mode):
            yield at / part, status, False
            links += 1
            if links > _MAX_LINKS:
                raise OSError(f"{folder}: too many links")
            target = Path(os.readlink(at / part))
            waiting += reversed(target.parts[1:] if target.is_absolute() else target.parts)
            at = Path(target.anchor) if target.is_absolute() else at
        else:
            at = at / part
            yield at, status, not waiting
