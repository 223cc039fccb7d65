"""The library of kernels that was made when the package was built: looked at, loaded, and its functions.

A library cut short ends the process when it is loaded, and one of other sources answers wrongly. So sizes and checksums of
its files are compared with those that the build wrote down, and the sources with those that it was made from: three
milliseconds of a start.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable

from collide.errors import InvalidArgument
from collide.kernels import sources

#: Processors' levels of all platforms: what ``COLLIDE_CPU`` may name.
LEVELS = ("v2", "v3", "v4", "arm64")
#: The level in use; empty where there is no library in this process.
level = ""
#: Where the files stand; the module of C.
FOLDER = str(sources.PACKAGE)
glue = None


def load() -> str:
    """Bring the library into this process. Why not, in words, where it is not to be used; empty where it is.

    Raises InvalidArgument where ``COLLIDE_CPU`` names no level, or one that is not to be had here.
    """
    global glue, level
    wanted = os.environ.get("COLLIDE_CPU", "")
    if wanted and wanted not in LEVELS:
        raise InvalidArgument(f"COLLIDE_CPU={wanted!r}: no such level of processors; levels are {', '.join(LEVELS)}, or leave it unset")
    try:
        from collide.kernels import built
    except ImportError:
        return "this installation was built without compiled kernels"
    if sources.fingerprint() != built.SOURCES:
        return "the sources of kernels differ from those that the library was made from"
    for name, (size, checksum) in built.FILES.items():
        if why := _why_damaged(os.path.join(FOLDER, name), size, checksum):
            return f"the library is damaged: {why}; install collide-robotics again"
    try:
        from collide.kernels import _glue

        level = _glue.load(_library(built.FILES), wanted)
    except ValueError as error:
        if wanted:
            raise InvalidArgument(f"COLLIDE_CPU={wanted!r}: {error}; this library has {', '.join(built.LEVELS)}") from None
        return str(error)
    except (ImportError, OSError) as error:
        return f"the library cannot be loaded: {error}"
    glue = _glue
    return ""


def library_path() -> str:
    """Where libcollide stands, whether or not this process uses it. Raises FileNotFoundError where there is none."""
    try:
        from collide.kernels import built
    except ImportError:
        raise FileNotFoundError("this installation was built without libcollide: see `collide doctor`") from None
    return _library(built.FILES)


def _library(files: dict) -> str:
    (found,) = (name for name in files if name.startswith("lib/"))
    return os.path.join(FOLDER, *found.split("/"))


def _why_damaged(path: str, size: int, checksum: int) -> str:
    try:
        if os.stat(path).st_size != size:
            return f"{path} has {os.stat(path).st_size} bytes, not {size}"
        with open(path, "rb") as file:
            return "" if zlib.crc32(file.read()) == checksum else f"{path} has another checksum"
    except OSError as error:
        return str(error)


def entry(_signature: str, *, nogil: bool = True) -> Callable[[Callable], Callable]:
    """As `collide.kernels.entry`: the library's function of that name."""
    return lambda function: getattr(glue, function.__name__, None) or _Absent(function)


class _Absent:
    """An entry that the library does not have: of tests, say, or typed in by hand."""

    def __init__(self, function: Callable):
        self.__name__ = function.__name__

    def __call__(self, *_args):
        raise RuntimeError(f"{self.__name__} is no kernel of the library; with COLLIDE_JIT=1 kernels are compiled at their first call")


def code_of(entry) -> int:
    return glue.code_of(entry.__name__)  # type: ignore[attr-defined]


def __getattr__(name: str):
    """``address_of``, as the module of C has it."""
    if name == "address_of" and glue is not None:
        return glue.address_of
    raise AttributeError(name)
