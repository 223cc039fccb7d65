"""`build_ext` of setuptools: kernels to object files, those and C to libcollide, and its Python module.

Where there is no C compiler, or it cannot link, the compiler of the package ziglang takes its place
(`platforms.py`). Without either the package is installed without a library, and then needs numba and compiles kernels
at their first call. ``COLLIDE_REQUIRE_COMPILED=1``, as for releases, makes that an error.

    COLLIDE_REQUIRE_COMPILED=1    no library, no installation
    COLLIDE_LEVELS="v3 v4"        these levels of processors, or "all", as for releases; by default this machine's alone
    COLLIDE_NO_LIBRARY=1          none, on purpose: a pure wheel
    COLLIDE_PLATFORM=NAME         for another platform: `platforms.py`
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import sysconfig
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import backend
import describe_kernels
import platforms
from compile_kernels import say
from setuptools import Extension
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent.parent
NATIVE = ROOT / "native"
BUILD = ROOT / "build" / "kernels"
#: Modules of C in libcollide.
C_SOURCES = [
    "kernels.c", "capi_arena.c", "capi_mesh.c", "capi_mesh_pairs.c", "capi_pairs.c", "capi_shapes.c", "capi_status.c",
    "capi_tree.c", "capi_contacts.c", "capi_axis.c", "capi_faces.c", "capi_contact_queries.c",
    "capi_casts.c", "capi_impact.c", "capi_rays.c", "capi_within.c", "capi_compound.c", "capi_compound_pairs.c",
    "capi_compound_casts.c",
    "capi_height_field.c", "capi_mesh_contacts.c", "capi_mesh_shapes.c", "capi_curved_contacts.c",
    "capi_compound_contacts.c",
    "capi_robot.c", "capi_robot_around.c", "capi_robot_checks.c", "capi_robot_file.c", "capi_robot_meshes.c",
    "capi_robot_motions.c", "capi_robot_objects.c",
    "capi_field.c", "capi_field_casts.c", "capi_field_cells.c", "capi_field_contacts.c", "capi_field_items.c",
    "capi_field_pairs.c", "capi_field_rays.c", "capi_field_unions.c", "capi_field_ways.c",
    "capi_world.c", "capi_world_shapes.c", "capi_world_tree.c", "capi_world_pairs.c", "capi_world_outside.c",
    "capi_world_wholes.c", "capi_world_margins.c", "capi_world_casts.c", "capi_world_rays.c",
    "host_mujoco.c", "host_slots.c", "host_terrain.c",
    "host_terrain_bodies.c", "host_terrain_deep.c", "host_terrain_facets.c", "host_terrain_near.c",
    "host_terrain_prisms.c", "host_terrain_rows.c",
]
#: Headers of programs that use it.
HEADERS = ["collide.h", "collide.hpp"]
#: What is built for.
FOR = platforms.chosen()


def _asked(name: str) -> bool:
    return os.environ.get(name, "0") not in ("", "0")


def why_not() -> str:
    """Why no library can be made here; empty where one can. Raises SystemExit where one was required."""
    reason = "COLLIDE_NO_LIBRARY is set" if _asked("COLLIDE_NO_LIBRARY") else platforms.why_no_compiler(FOR)
    if reason and _asked("COLLIDE_REQUIRE_COMPILED"):
        raise SystemExit(
            f"collide: kernels cannot be built: {reason}\nCOLLIDE_REQUIRE_COMPILED is set, so this is an error. "
            f"Install a C compiler: pip install {platforms.ZIG}, "
            "apt install gcc, dnf install gcc, xcode-select --install, or the Build Tools of Visual Studio"
        )
    if reason:
        say(
            f"*** collide: NO COMPILED KERNELS: {reason}. The package will need numba, and compile kernels at their "
            "first call "
            "(half a minute). Install a C compiler, then collide-robotics again; `collide doctor` tells. ***"
        )
    return reason


def extension() -> Extension:
    """What makes wheels those of a platform; `BuildLibrary` knows what is in it."""
    return Extension("collide.kernels._glue", [], py_limited_api=bool(platforms.interface().wheel))


class BuildLibrary(build_ext):
    """Makes the library, its Python module, and what tells of them, where setuptools collects the package's files."""

    def build_extension(self, ext) -> None:
        if self.by_zig:
            say(f"C is compiled for {FOR.name} by the package ziglang")
            self.compiler = platforms.zig_compiler(FOR)
        made = _compiled_kernels(FOR.triple if self.by_zig else "")
        generated = BUILD / "generated"
        _generate(generated, made["entries"], list(made["objects"]))
        place, python = Path(self.build_lib) / "collide", platforms.interface()
        library, module = place / "lib" / FOR.library, place / "kernels" / f"_glue{python.suffix}"
        for folder in (library.parent, module.parent):
            folder.mkdir(parents=True, exist_ok=True)
        say(f"linking {FOR.library}")
        kernels = [file for files in made["objects"].values() for file in files]
        self._link([*self._compiled(C_SOURCES, generated), *kernels], library, _exported())
        objects = self._compiled(["python_module.c"], generated, *([f"-D{python.macro}"] if python.macro else []))
        self._link(objects, module, ["PyInit__glue"], calls_python=True)
        self._write_interface(place)
        _write_about(place, [library, module], made)

    @property
    def by_zig(self) -> bool:
        return platforms.uses_zig(FOR)

    def copy_extensions_to_source(self) -> None:
        """For editable installations: the same files in the checkout."""
        for file in map(Path, self.get_outputs()):
            target = ROOT / file.relative_to(self.build_lib)
            target.parent.mkdir(parents=True, exist_ok=True)
            # A process may have the old file in use: it keeps it, and the new one takes its name.
            shutil.copy(file, part := target.with_suffix(".part"))
            part.replace(target)

    def get_outputs(self) -> list[str]:
        place = Path(self.build_lib) / "collide"
        made = (
            *place.glob("lib/**/*"),
            *place.glob("include/*"),
            place / "kernels" / "built.py",
            *place.glob("kernels/_glue*"),
        )
        return [str(file) for file in made if file.is_file()]

    def get_source_files(self) -> list[str]:
        return [
            file.relative_to(ROOT).as_posix()
            for file in sorted(NATIVE.rglob("*"))
            if file.suffix in (".py", ".c", ".h", ".hpp", ".in")
        ]

    def _write_interface(self, place: Path) -> None:
        """What programs in C need beside the library: headers, and files by which pkg-config and CMake find both."""
        places = {"collide.pc": "pkgconfig", "collideConfig.cmake": "cmake/collide"}
        places["collideConfigVersion.cmake"] = places["collideConfig.cmake"]
        filled = {"@VERSION@": self.distribution.get_version(), "@LIBRARY@": FOR.library}
        (place / "include").mkdir(parents=True, exist_ok=True)
        for header in HEADERS:
            shutil.copy(NATIVE / header, place / "include")
        for name, folder in places.items():
            text = (NATIVE / f"{name}.in").read_text(encoding="utf-8")
            for word, value in filled.items():
                text = text.replace(word, value)
            (place / "lib" / folder).mkdir(parents=True, exist_ok=True)
            (place / "lib" / folder / name).write_text(text, encoding="utf-8")

    def _compiled(self, names: list[str], generated: Path, *more: str) -> list[str]:
        """Object files of modules of C, each kept under a hash of all that it is made from."""
        import numpy

        flags = (
            ["/O2"]
            if self._is_msvc
            else ["-O2", "-g0", "-std=c99", "-ffp-contract=off", "-fvisibility=hidden", f"-ffile-prefix-map={ROOT}=."]
        )
        flags += more
        include = [str(generated), str(NATIVE), *filter(None, os.environ.get("COLLIDE_INCLUDE", "").split(os.pathsep))]
        include += [numpy.get_include(), sysconfig.get_path("include")]
        headers = sorted([*NATIVE.glob("*.h"), *generated.iterdir()])
        common = hashlib.sha256(repr((flags, include, numpy.__version__, sys.version, self._c_compiler())).encode())
        for header in headers:
            common.update(header.name.encode() + header.read_bytes())

        def compiled(name: str) -> str:
            made_from = common.copy()
            made_from.update(name.encode() + (NATIVE / name).read_bytes())
            place = BUILD / "c" / f"{name}-{made_from.hexdigest()[:16]}{self.compiler.obj_extension}"
            if not place.exists():
                for old in place.parent.glob(f"{name}-*"):
                    old.unlink()
                place.parent.mkdir(parents=True, exist_ok=True)
                out = str(Path(self.build_temp) / name)
                source = [str(NATIVE / name)]
                (made,) = self.compiler.compile(source, output_dir=out, include_dirs=include, extra_postargs=flags)
                shutil.copy(made, part := place.with_suffix(f".{os.getpid()}"))
                part.replace(place)
            return str(place)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            return list(pool.map(compiled, names))

    def _c_compiler(self) -> str:
        """The C compiler and its version, in its own words."""
        command = getattr(self.compiler, "compiler_so", None)
        if not command:
            return self.compiler.compiler_type  # of Windows: whose version is that of the build's environment
        # Asked as clang is, zig leaves an empty file in the folder.
        asked = [sys.executable, "-m", "ziglang", "version"] if self.by_zig else [*self._c_command, "--version"]
        return repr(command) + subprocess.run(asked, stdout=subprocess.PIPE, check=True, text=True).stdout

    @property
    def _is_msvc(self) -> bool:
        return FOR.system == "win32" and not self.by_zig

    @property
    def _c_command(self) -> list[str]:
        return FOR.zig() if self.by_zig else self.compiler.compiler_so[:1]

    def _link(self, objects: list[str], out: Path, exported: list[str], calls_python: bool = False) -> None:
        """A shared library that leaves nothing open but the C library's functions, and Python's where it calls them.

        Not as Python links its modules: that writes paths of this machine into them.
        """
        if self._is_msvc:
            names = [f"/EXPORT:{name}" for name in exported]
            names += [] if calls_python else [f"/IMPLIB:{out.with_suffix('.lib')}"]
            self.compiler.link_shared_object(objects, str(out), extra_postargs=names)
            return
        strip = [] if os.environ.get("COLLIDE_SYMBOLS") else ["-s"]
        if FOR.system == "darwin":
            of_python = ["-undefined", "dynamic_lookup", *([] if self.by_zig else ["-bundle"])]
            kind = of_python if calls_python else ["-install_name", f"@rpath/{FOR.library}"]
            kind += ["-dynamiclib"] if "-bundle" not in kind else []
        elif FOR.system == "win32":
            python = self._python_library(objects) if calls_python else f"-Wl,--out-implib,{out.with_suffix('.lib')}"
            kind = ["-shared", *strip, python]
        else:
            of_python = ["-ldl"] if calls_python else ["-lm", "-Wl,-z,defs", f"-Wl,-soname,{FOR.library}"]
            kind = ["-shared", *strip, "-Wl,-z,relro", *of_python]
        self.spawn([*self._c_command, "-o", str(out), *objects, *kind])


    def _python_library(self, objects: list[str]) -> str:
        """An import library of python3.dll, the stable interface of Windows: of the functions that objects call."""
        folder = BUILD / "python3"
        folder.mkdir(parents=True, exist_ok=True)
        names = sorted({name for file in objects for name in platforms.imported_names(Path(file)) if "Py" in name})
        lines = ["LIBRARY python3.dll", "EXPORTS", *names]
        (folder / "python3.def").write_text("\n".join(lines) + "\n", encoding="utf-8")
        zig, made = [sys.executable, "-m", "ziglang"], folder / "python3.lib"
        self.spawn([*zig, "dlltool", "-m", "i386:x86-64", "-d", str(folder / "python3.def"), "-l", str(made)])
        return str(made)


def _compiled_kernels(triple: str) -> dict:
    """As they came with the source archive, or as `compile_kernels.compile_kernels` makes them, in a process of its
    own: it imports the package."""
    import json

    levels = os.environ.get("COLLIDE_LEVELS", "").strip()
    if (ready := backend.emitted(levels)) is not None:
        return ready
    command = [sys.executable, str(NATIVE / "compile_kernels.py"), "--out", str(BUILD), "--levels", levels, "--json"]
    done = subprocess.run([*command, "--triple", triple], stdout=subprocess.PIPE, check=False)
    if done.returncode:
        raise SystemExit("collide: kernels could not be compiled: see above")
    return json.loads(done.stdout)


def _generate(folder: Path, entries, levels: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "kernels.h").write_text(describe_kernels.table(entries, levels), encoding="utf-8")
    (folder / "entries.inc").write_text(describe_kernels.python_functions(entries), encoding="utf-8")


def _exported() -> list[str]:
    """Names of what leaves the library, for linkers that want a list."""
    import re

    headers = ("collide.h", "kernels_of_level.h", "host_mujoco.h")
    text = "".join((NATIVE / name).read_text(encoding="utf-8") for name in headers)
    return re.findall(r"^COLLIDE_(?:API|EXPORT)\b[^;(]*?(\w+)\(", text, re.MULTILINE)


def _write_about(place: Path, files: list[Path], made: dict) -> None:
    """built.py: what this library was made from, and what its files must be like."""
    known = {file.relative_to(place).as_posix(): (file.stat().st_size, zlib.crc32(file.read_bytes())) for file in files}
    (place / "kernels" / "built.py").write_text(
        '"""What the library of this installation was made from. Written by the build."""\n\n'
        "#: Checksum of the kernels' sources (`sources.fingerprint`), and which files they are.\nSOURCES = "
        f"{made['sources']}\n"
        f"SOURCE_FILES = {made['source_files']!r}\n"
        f"#: Hashes of the entries (`sources.entry_hashes`), by name.\nENTRIES = {made['hashes']!r}\n"
        f"#: Levels of processors.\nLEVELS = {tuple(made['objects'])!r}\n"
        f"#: Numba and LLVM, as they were.\nCOMPILER = {made['versions']!r}\n"
        f"#: Sizes and checksums of files.\nFILES = {known!r}\n",
        encoding="utf-8",
    )
