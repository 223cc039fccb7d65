"""The command ``collide config``: how a program in C or C++ is built with libcollide, for compilers and build tools."""

from __future__ import annotations

import argparse
import os
import shlex

EPILOG = """examples:
  cc program.c $(collide config --cflags --libs) -o program
  cmake -B build -Dcollide_DIR=$(collide config --cmakedir)
  export PKG_CONFIG_PATH=$(collide config --pkgconfigdir)
  collide config                                     everything, a line each

Compiler flags share a line, in the order of a command; folders and the version
take a line each. --libs names the library's folder for the linker and, by
-Wl,-rpath, for the start of the program: a wheel lies where no loader looks.
pkg-config leaves that out; CMake does it by itself. In CMakeLists.txt:
  find_package(collide CONFIG REQUIRED)
  target_link_libraries(program PRIVATE collide::collide)

docs/c-interface.md is the manual, collide.h says what every function takes.

exit status: 0 told, 2 error: this installation has no library"""

#: Options, in the order of the answer, with their help.
_OPTIONS = {
    "cflags": "flags of the compiler: the folder of collide.h",
    "libs": "flags of the linker: libcollide, and where programs find it when they start",
    "cmakedir": "the folder of collideConfig.cmake, for collide_DIR",
    "pkgconfigdir": "the folder of collide.pc, for PKG_CONFIG_PATH",
    "version": "the version of library and header",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    for name, summary in _OPTIONS.items():
        parser.add_argument(f"--{name}", action="store_true", help=summary)


def run(args: argparse.Namespace) -> int:
    """Print what is asked for; 0. Raises UnsupportedQuery where the package was installed without its library."""
    asked = [name for name in _OPTIONS if getattr(args, name)]
    known = _answers()
    if not asked:
        width = max(map(len, known))
        print("\n".join(f"{name:<{width}}  {value}" for name, value in known.items()))
        return 0
    flags = [known[name] for name in asked if name in ("cflags", "libs")]
    lines = [known[name] for name in asked if name not in ("cflags", "libs")]
    print("\n".join([*([" ".join(flags)] if flags else []), *lines]))
    return 0


def _answers() -> dict[str, str]:
    from collide import __version__, get_include, get_library
    from collide.errors import UnsupportedQuery

    try:
        include, library = get_include(), get_library()
    except FileNotFoundError as error:
        raise UnsupportedQuery(f"{error}; install a C compiler, then collide-robotics again") from None
    folder = os.path.dirname(library)
    return {
        "cflags": shlex.quote(f"-I{include}"),
        "libs": f"{shlex.quote(f'-L{folder}')} -lcollide {shlex.quote(f'-Wl,-rpath,{folder}')}",
        "cmakedir": os.path.join(folder, "cmake", "collide"),
        "pkgconfigdir": os.path.join(folder, "pkgconfig"),
        "version": __version__,
    }
