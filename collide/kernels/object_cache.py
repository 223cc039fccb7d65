"""Machine code of entries kept on disk: object files, looked at before they are believed.

Whoever writes an object file decides what runs. So the folder must be one that nobody else may write in
(`cache_folder.why_distrusted`), and a file begins with a digest of the rest: one that is cut, or has a bit flipped, is
noticed before it is loaded, and compiled anew. The digest is no signature: whoever may write in the folder may write
that as well.

The cache is a convenience. Nothing that goes wrong with it is an error of the question that was asked: it is said in a
line, and the kernel is compiled.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path

from collide.cache_folder import TRUST, cache_folder, make_private, why_distrusted
from collide.log import log
from collide.whole_file import whole_file

#: Raised with every change of what a file holds.
_VERSION = 2
_DIGEST = hashlib.sha256().digest_size
_REMEDY = "they are compiled again in every process. Set COLLIDE_CACHE_DIR to a folder"


def kept_or_made(name: str, key: str, compiled: Callable[[], bytes]) -> bytes:
    """The object file of this key: as it was kept, else what ``compiled`` gives, which is kept.

    name : for people who look into the folder.   key : all that the machine code depends on.
    """
    folder = _folder()
    if folder is None:
        return compiled()
    identity = repr((_VERSION, name, key)).encode()
    file = folder / f"{name}.{hashlib.sha256(identity).hexdigest()[:16]}.o"
    code = _read_kept(file, identity)
    if code is None:
        code = compiled()
        try:
            with whole_file(file, private=True) as written:
                written.write(_digest(identity, code) + code)
        except OSError as error:
            say_once(f"compiled kernels cannot be kept in {folder} ({error}); {_REMEDY} that can be written.")
    return code


def kernel_folder() -> Path:
    """Where kernels compiled just in time are kept."""
    return cache_folder("kernels")


def _folder() -> Path | None:
    """`kernel_folder`, made where it is missing; None where it is not to be used."""
    folder = kernel_folder()
    try:
        why = why_distrusted(folder)
        if why is None:
            make_private(folder)
            why = why_distrusted(folder)  # somebody else may have made it meanwhile
    except (OSError, RuntimeError, ValueError) as error:
        say_once(f"compiled kernels cannot be kept in {folder} ({error}); {_REMEDY} that can be written.")
        return None
    if why is not None:
        say_once(
            f"compiled kernels are neither kept in {folder} nor read from there, for they are code: {why}; {_REMEDY} "
            "of your own."
        )
        return None
    return folder


def _read_kept(file: Path, identity: bytes) -> bytes | None:
    """The code in a file, None where there is none to be used."""
    try:
        content = _read(file)
        if content is None:
            return None
        code = content[_DIGEST:]
        if content[:_DIGEST] != _digest(identity, code):
            raise ValueError("its digest is another")
        return code
    except (OSError, ValueError) as error:
        log.warning(
            "a compiled kernel in %s is damaged (%s: %s); it is compiled anew", file.parent, type(error).__name__, error
        )
        with suppress(OSError):
            file.unlink(missing_ok=True)
        return None


def _digest(identity: bytes, code: bytes) -> bytes:
    return hashlib.sha256(identity + code).digest()


def _read(file: Path) -> bytes | None:
    """What a file holds, None where there is none. Raises PermissionError where somebody else may have written it."""
    try:
        with open(file, "rb") as opened:
            status = os.fstat(opened.fileno())
            if TRUST and (status.st_uid != os.geteuid() or stat.S_IMODE(status.st_mode) & 0o022):
                raise PermissionError("others may have written it")
            return opened.read()
    except FileNotFoundError:
        return None


@cache
def say_once(message: str) -> None:
    log.warning(message)
