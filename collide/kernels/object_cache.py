"""Machine code of entries kept on disk: object files, checked before use.

Whoever writes an object file decides what runs. So nobody else may be able to write in the folder
(`cache_folder.own_folder`), and a file begins with a digest of the rest: a truncated file, or a file with a flipped
bit, is noticed before being loaded, and compiled anew. The digest is no signature: whoever may write in the folder may
write a matching digest as well.

The cache is a convenience. Its failures are no errors of the query: a line of the log says what failed, and the kernel
is compiled.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from collide.base.cache_folder import cache_folder, own_folder, read_own, say_once
from collide.base.log import log
from collide.base.whole_file import whole_file

#: Raised with every change of what a file holds.
_VERSION = 2
_DIGEST = hashlib.sha256().digest_size
_WITHOUT = "they are compiled again in every process"


def kept_or_made(name: str, key: str, compiled: Callable[[], bytes]) -> bytes:
    """The object file of this key: from the folder, else from ``compiled``, whose result is kept.

    name : for people who look into the folder.   key : all inputs of the machine code.
    """
    folder = own_folder(kernel_folder(), "compiled kernels, which are code,", _WITHOUT)
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
            say_once(
                f"compiled kernels cannot be kept in {folder} ({error}); {_WITHOUT}. Set COLLIDE_CACHE_DIR to a folder "
                "that can be written."
            )
    return code


def kernel_folder() -> Path:
    """Where kernels compiled just in time are kept."""
    return cache_folder("kernels")


def _read_kept(file: Path, identity: bytes) -> bytes | None:
    """The code in a file; None where the file is missing or damaged."""
    try:
        content = read_own(file)
        code = content[_DIGEST:]
        if content[:_DIGEST] != _digest(identity, code):
            raise ValueError("its digest is another")
        return code
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        log.warning(
            "a compiled kernel in %s is damaged (%s: %s); it is compiled anew", file.parent, type(error).__name__, error
        )
        with suppress(OSError):
            file.unlink(missing_ok=True)
        return None


def _digest(identity: bytes, code: bytes) -> bytes:
    return hashlib.sha256(identity + code).digest()
