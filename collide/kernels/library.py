"""The library of kernels made when the package was built: checked, loaded, and its functions.

A truncated library ends the process when loaded, and a function of other sources answers wrongly. So sizes and
checksums of its files are compared with the build's record, and the sources with the sources of the build: a few
milliseconds of a start. Where sources were edited, the library serves the entries not touched by the edit.
"""

from __future__ import annotations

import os
import sys
import zlib
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from typing import Any

from collide.base.free_threads import FREE_THREADED
from collide.errors import InvalidArgument
from collide.kernels import sources

#: Processors' levels of all platforms: what ``COLLIDE_CPU`` may name.
LEVELS = ("v2", "v3", "v4", "arm64")
#: The level in use; empty where there is no library in this process.
level = ""
#: The module of C, its functions those of the entries; None likewise.
glue: Any = None
#: Names of entries that were edited since the library was made: compiled just in time, though the others are in it.
edited: frozenset[str] = frozenset()
_UNBUILT = "this installation was built without compiled kernels, for want of a C compiler"
_UNBUILT_CLONE = (
    "the kernels of this clone are not built: with a C compiler `pip install -e .` builds them, and in any other folder"
    " Python imports what `pip install .` installed"
)


def load() -> str:
    """Load the library into this process. Returns why the library, or some of its kernels, cannot be used; empty where
    all can.

    Raises InvalidArgument where ``COLLIDE_CPU`` names no level, or a level missing here.
    """
    global edited, glue, level
    wanted = os.environ.get("COLLIDE_CPU", "")
    if wanted and wanted not in LEVELS:
        raise InvalidArgument(
            f"COLLIDE_CPU={wanted!r} is no level of processors: it may be {', '.join(LEVELS)}, or unset"
        )
    built = _built()
    if built is None:
        return _why_unbuilt()
    if "free-threading" in sys.version and any(".abi3." in name for name in built.FILES):
        return "it is for builds of Python with the lock; install collide-robotics again, for this Python"
    edited = _edited(built)
    for name, (size, checksum) in built.FILES.items():
        if why := _why_damaged(_path(name), size, checksum):
            return f"it is damaged, {why}; install collide-robotics again"
    try:
        functions = import_module("collide.kernels._glue")
        level = functions.load(_path(_library_of(built.FILES)), wanted, FREE_THREADED)
    except ValueError as error:  # no such level
        if wanted:
            raise InvalidArgument(
                f"COLLIDE_CPU={wanted!r}: {error}; levels of this library: {', '.join(built.LEVELS)}"
            ) from None
        return str(error)
    except (ImportError, OSError) as error:
        return f"it cannot be loaded: {error}; install collide-robotics again"
    glue = functions
    if not edited:
        return ""
    names = ", ".join(sorted(edited)[:3]) + (", …" if len(edited) > 3 else "")
    return (
        f"{len(edited)} of its {len(built.ENTRIES)} kernels were edited since it was made ({names}); "
        "`pip install --no-build-isolation --no-deps -e .` makes them anew"
    )


def exists() -> bool:
    """Whether this installation has a library, to be used or not."""
    return _built() is not None


def fits_sources() -> bool:
    """Whether the sources equal, byte by byte, the sources of the library. False without a library."""
    built = _built()
    with suppress(OSError):  # a source that has moved since
        return built is not None and sources.fingerprint(built.SOURCE_FILES) == built.SOURCES
    return False


def about() -> dict[str, str]:
    """Origin of the library: ``level``, ``levels``, ``compiler``, ``sources`` (a hash), ``path``; {} without a library.
    """
    built = _built()
    if built is None:
        return {}
    return {
        "level": level, "levels": ", ".join(built.LEVELS), "compiler": built.COMPILER,
        "sources": f"{built.SOURCES:08x}",
        "path": library_path(),
    }


def entries() -> tuple[str, ...]:
    """Names of the library's kernels; () without a library."""
    built = _built()
    return () if built is None else tuple(built.ENTRIES)


def library_path() -> str:
    """The file of libcollide, whether or not this process uses it.

    Returns
    -------
    str
        Inside the installed package.

    Raises
    ------
    FileNotFoundError
        Where the package was installed without its library.
    """
    built = _built()
    if built is None:
        raise FileNotFoundError(f"there is no libcollide: {_why_unbuilt()}")
    return _path(_library_of(built.FILES))


def _why_unbuilt() -> str:
    """Why the library is missing: Python imports a clone's sources where Python is started in the clone."""
    is_clone = os.path.exists(os.path.join(os.path.dirname(sources.PACKAGE), "pyproject.toml"))
    return _UNBUILT_CLONE if is_clone else _UNBUILT


def include_folder() -> str:
    """Folder of ``collide.h``, for ``cc -I``.

    Returns
    -------
    str
        Inside the installed package.

    Raises
    ------
    FileNotFoundError
        Where the package was installed without its library.
    """
    library_path()
    return _path("include")


def _built() -> Any:
    try:
        from collide.kernels import built
    except ImportError:
        return None
    return built


def _edited(built: Any) -> frozenset[str]:
    """Names of entries whose code differs from the library's. An installation without sources, as a frozen program, has
    no edits.

    A checksum of all files' bytes, 2 ms, settles most starts; where the checksum differs, the entries' own hashes
    decide, in a second.
    """
    if not os.path.exists(os.path.join(sources.PACKAGE, "results.py")):
        return frozenset()
    if fits_sources():
        return frozenset()
    hashes = sources.entry_hashes()
    return frozenset(name for name, known in hashes.items() if built.ENTRIES.get(name) != known)


def _library_of(files: dict) -> str:
    (name_of_library,) = (name for name in files if name.startswith("lib/") and not name.endswith(".lib"))
    return name_of_library


def _path(name: str) -> str:
    return os.path.join(sources.PACKAGE, *name.split("/"))


def _why_damaged(path: str, size: int, checksum: int) -> str:
    try:
        with open(path, "rb") as file:
            content = file.read()
    except OSError as error:
        return str(error)
    if len(content) != size:
        return f"{path} has {len(content)} bytes, not {size}"
    return "" if zlib.crc32(content) == checksum else f"{path} has another checksum"


def entry(_signature: str, *, nogil: bool = True) -> Callable[[Callable], Callable]:
    """As `collide.kernels.entry`: the library's function of that name."""
    return lambda function: function_of(function) or _Absent(function)


def function_of(function: Callable) -> Callable | None:
    """The library's function of an entry, if made of the entry's present source; else None."""
    name = function.__name__
    if glue is None or name in edited or not (function.__module__ or "").startswith("collide."):
        return None
    return getattr(glue, name, None)


class _Absent:
    """An entry that the library does not have: of a test, or typed in by hand."""

    def __init__(self, function: Callable):
        self.__name__ = function.__name__

    def __call__(self, *_args):
        raise RuntimeError(
            f"{self.__name__} is no kernel of the library; with COLLIDE_JIT=1 kernels are compiled at their first call"
        )


def code_of(entry) -> int:
    """Address of an entry's machine code."""
    return glue.code_of(entry.__name__)
