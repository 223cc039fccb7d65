"""Platforms that libraries are made for: this machine's own, or another by the C compiler of the package ziglang.

    COLLIDE_PLATFORM=linux-aarch64 pip wheel .    # a wheel for a platform of `PLATFORMS`, on whatever machine
    COLLIDE_INCLUDE=folder:folder                 # headers of that platform's Python and numpy, where they differ
    COLLIDE_INTERFACE=abi3t                       # for Pythons without the lock, by headers of 3.15 and numpy 2.5

The package ziglang carries clang, linkers, and the C libraries of all platforms: it also compiles for this machine
where there is no C compiler.
"""

from __future__ import annotations

import os
import platform
import struct
import sys
import sysconfig
import tempfile
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import setuptools  # noqa: F401 - distutils is setuptools' own

from distutils.ccompiler import new_compiler  # isort: skip
from distutils.sysconfig import customize_compiler  # isort: skip

#: What compiles for other platforms, and where a C compiler is missing: the version that was tested.
ZIG = "ziglang==0.17.1"


class Platform(NamedTuple):
    """A system and a kind of processor."""

    name: str
    """``sys.platform`` and ``platform.machine()`` of its Pythons."""
    triple: str
    """LLVM's name."""
    target: str
    """Zig's name."""
    tag: str
    """That of wheels."""

    @property
    def system(self) -> str:
        """``linux``, ``darwin`` or ``win32``."""
        return self.name.split("-")[0]

    @property
    def library(self) -> str:
        """File name of libcollide."""
        return {"win32": "collide.dll", "darwin": "libcollide.dylib"}.get(self.system, "libcollide.so")

    def zig(self) -> list[str]:
        """The C compiler of ziglang for this platform."""
        # Where neither is given it compiles for this very processor.
        kind = ["-target", self.target] if _is_named() else ["-mcpu=baseline"]
        return [sys.executable, "-m", "ziglang", "cc", *kind]

    def options(self) -> dict:
        """Those of setuptools' commands."""
        options: dict = {"bdist_wheel": {"py_limited_api": interface().wheel}}
        if _is_named():
            options["bdist_wheel"]["plat_name"] = self.tag
        if _is_named() or os.environ.get("COLLIDE_INTERFACE"):  # wheels take in all that lies in their folder
            options["build"] = {"build_base": f"build/{self.name}{interface().suffix}"}
        return options


class Interface(NamedTuple):
    """An interface of CPython's to C."""

    macro: str
    """For C; empty of that of a single version."""
    suffix: str
    """Of the module's file name."""
    wheel: str | bool
    """The oldest Python of wheels, as setuptools takes it; False of a single version."""


def interface() -> Interface:
    """That of this Python: without the lock a stable one from 3.15 on, which builds with the lock load, too."""
    windows, free = chosen().system == "win32", bool(sysconfig.get_config_var("Py_GIL_DISABLED"))
    if os.environ.get("COLLIDE_INTERFACE") == "abi3t" or (free and sys.version_info >= (3, 15)):
        return Interface("Py_TARGET_ABI3T=0x030F0000", ".pyd" if windows else ".abi3t.so", "cp315")
    if not free:
        return Interface("Py_LIMITED_API=0x030A0000", ".pyd" if windows else ".abi3.so", "cp310")
    if _is_named():
        raise SystemExit(
            "collide: COLLIDE_PLATFORM: without the lock this Python has no stable interface; "
            "use python3.15t, or a build with the lock"
        )
    return Interface("", sysconfig.get_config_var("EXT_SUFFIX"), False)


PLATFORMS = {
    known.name: known
    for known in (
        Platform("linux-x86_64", "x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.28", "manylinux_2_28_x86_64"),
        Platform("linux-aarch64", "aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.28", "manylinux_2_28_aarch64"),
        Platform("darwin-arm64", "arm64-apple-macosx11.0", "aarch64-macos.11.0", "macosx_11_0_arm64"),
        Platform("darwin-x86_64", "x86_64-apple-macosx11.0", "x86_64-macos.11.0", "macosx_11_0_x86_64"),
        Platform("win32-amd64", "x86_64-w64-windows-gnu", "x86_64-windows-gnu", "win_amd64"),
    )
}


def _own_name() -> str:
    return f"{sys.platform}-{platform.machine().lower()}"


def _is_named() -> bool:
    return bool(os.environ.get("COLLIDE_PLATFORM"))


def chosen() -> Platform:
    """What is built for. Raises SystemExit where ``COLLIDE_PLATFORM`` names none."""
    name = os.environ.get("COLLIDE_PLATFORM") or _own_name()
    if name not in PLATFORMS and name != _own_name():
        raise SystemExit(f"COLLIDE_PLATFORM: {name!r} is no platform; it may be {', '.join(PLATFORMS)}")
    return PLATFORMS.get(name, Platform(name, "", "", ""))


def imported_names(file: Path) -> set[str]:
    """Names that an object file of Windows, in the COFF format, takes from libraries."""
    data = file.read_bytes()
    at, n = struct.unpack_from("<II", data, 8)  # the table of symbols, 18 bytes each; long names follow it
    names, k = set(), 0
    while k < n:
        short, section, n_more = struct.unpack_from("<8s4xh3xB", data, at + 18 * k)
        if section == 0:
            begin = at + 18 * n + int.from_bytes(short[4:], "little")
            name = short if short[:4] != bytes(4) else data[begin : data.index(0, begin)]
            names.add(name.rstrip(b"\0").decode())
        k += 1 + n_more
    return {name.removeprefix("__imp_") for name in names if name.startswith("__imp_")}


def needs_zig(wanted: Platform) -> bool:
    """Whether ziglang's compiler is to be used: for platforms named, and where this machine's compiler cannot link."""
    return wanted.name in PLATFORMS and (_is_named() or bool(_why_own_fails()))


def uses_zig(wanted: Platform) -> bool:
    """Whether it is needed and installed."""
    return needs_zig(wanted) and find_spec("ziglang") is not None


def why_no_compiler(wanted: Platform) -> str:
    """Why a platform's library cannot be linked here; empty where it can be."""
    if uses_zig(wanted):
        return why_it_cannot_link(zig_compiler(wanted))
    if _is_named():
        return f"COLLIDE_PLATFORM needs the compiler of ziglang: pip install {ZIG}"
    return _why_own_fails()


def zig_compiler(wanted: Platform):
    """Ziglang's, as setuptools wants a compiler."""
    compiler = new_compiler(compiler="unix")
    compiler.set_executables(compiler_so=[*wanted.zig(), "-fPIC"], linker_so=[*wanted.zig(), "-shared"])
    return compiler


@cache
def _why_own_fails() -> str:
    compiler = new_compiler()
    customize_compiler(compiler)
    return why_it_cannot_link(compiler)


def why_it_cannot_link(compiler) -> str:
    """What goes wrong when a shared library of one line is made; empty where nothing does."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "probe.c"
        source.write_text("int collide_probe(void) { return 1; }\n", encoding="utf-8")
        quiet = os.open(os.devnull, os.O_WRONLY), os.dup(2)
        try:
            os.dup2(quiet[0], 2)
            objects = compiler.compile([str(source)], output_dir=folder)
            compiler.link_shared_object(objects, str(Path(folder) / "probe.so"))
        except Exception as error:  # noqa: BLE001 - whatever a compiler's absence looks like here
            tool = (getattr(compiler, "compiler_so", None) or ["the C compiler"])[0]
            said = str(error).splitlines()[0] if str(error) else type(error).__name__
            return f"no C compiler or linker ({tool}: {said})"
        finally:
            os.dup2(quiet[1], 2)
            for handle in quiet:
                os.close(handle)
    return ""
