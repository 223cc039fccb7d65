"""Libraries of macOS and of Windows are read as their linkers wrote them, and a library with a fault is refused."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import dynamic_libraries as libraries
import pytest

SOURCE = """
#include <string.h>
#if defined(_WIN32)
#define SHOWN __declspec(dllexport)
#else
#define SHOWN __attribute__((visibility("default")))
#endif
extern int of_others(int);
int hidden(int k) { return k + 1; }
static int local(int k) { return 2 * hidden(k); }
SHOWN int shown_counter = 4;
SHOWN int shown(const char *text) { return (int)strlen(text) + local(shown_counter); }
SHOWN int shown_again(int k) { return of_others(k); }
"""
SYSTEM = "/usr/lib/libSystem.B.dylib"


def linked(folder: Path, target: str, *options: str, source: str = SOURCE, name: str = "probe") -> Path:
    pytest.importorskip("ziglang", reason="the C compiler for others: pip install 'collide-robotics[machines]'")
    (folder / f"{name}.c").write_text(source, encoding="utf-8")
    command = [sys.executable, "-m", "ziglang", "cc", "-target", target, "-O1", "-fvisibility=hidden", f"{name}.c"]
    done = subprocess.run([*command, *options], cwd=folder, check=False, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return folder / options[-1]


@pytest.mark.slow
@pytest.mark.parametrize(("target", "machine"), [("aarch64-macos.11.0", "arm64"), ("x86_64-macos.12.3", "x86_64")])
def test_a_library_of_macos_is_read_as_it_was_linked(tmp_path, target, machine):
    named = "-install_name", "@rpath/libprobe.dylib", "-undefined", "dynamic_lookup"
    found = libraries.read(linked(tmp_path, target, "-dynamiclib", *named, "-o", "probe.dylib").read_bytes())
    assert found.machine == machine and found.name == "@rpath/libprobe.dylib"
    assert found.oldest == ((11, 0) if machine == "arm64" else (12, 3))
    assert found.signed or machine != "arm64"
    assert found.exports - libraries.LINKERS == {"shown", "shown_again", "shown_counter"}
    bound = {name: path for name, path in found.imports.items() if name != "dyld_stub_binder"}
    assert bound == {"strlen": SYSTEM, "of_others": "the whole process"}


@pytest.mark.slow
def test_a_library_of_windows_is_read_as_it_was_linked(tmp_path):
    others = "__declspec(dllexport) int of_others(int k) { return k; }"
    options = "-shared", "-Wl,--out-implib,others.lib", "-o", "others.dll"
    linked(tmp_path, "x86_64-windows-gnu", *options, source=others, name="others")
    probe = linked(tmp_path, "x86_64-windows-gnu", "-shared", "others.lib", "-o", "probe.dll")
    found = libraries.read(probe.read_bytes())
    assert (found.machine, found.name) == ("amd64", "probe.dll")
    assert found.exports == {"shown", "shown_again", "shown_counter"}
    assert found.imports["of_others"] == "others.dll" and "hidden" not in found.imports
    assert libraries._of_others(found, "win") == {"of_others of others.dll"}


def test_other_files_are_refused_by_their_beginning(tmp_path):
    with pytest.raises(ValueError, match=r"neither a Mach-O file of 64 bits for one processor nor a DLL: .* 7f454c46"):
        libraries.read(b"\x7fELF" + bytes(100))
    with pytest.raises(ValueError, match="neither a Mach-O file"):
        libraries.read(b"MZ")


CALLS = {"PyLong_FromLong", "Py_BuildValue"}


def of_a_wheel(tag: str) -> tuple[libraries.Library, libraries.Library]:
    """libcollide and its module without a fault."""
    if tag == "win_amd64":
        system, python, machine, name, more = "KERNEL32.dll", "python3.dll", "amd64", "collide.dll", {}
    else:
        system, python, machine, name = SYSTEM, "the whole process", "arm64", "@rpath/libcollide.dylib"
        more = {"oldest": (11, 0), "signed": True}
    library = libraries.Library(machine, frozenset(libraries.exported_names()), {"memcpy": system}, name, **more)
    imports = {"memcpy": system, **dict.fromkeys(CALLS, python)}
    return library, library._replace(exports=frozenset({"PyInit__glue"}), imports=imports, name="")


@pytest.mark.parametrize("tag", ["macosx_11_0_arm64", "win_amd64"])
def test_libraries_as_they_should_be_have_no_fault(tag):
    assert len(libraries.exported_names()) > 100 and "collide_distance" in libraries.exported_names()
    assert libraries.faults(tag, *of_a_wheel(tag), CALLS) == []


@pytest.mark.parametrize(
    ("harm", "wanted"),
    [
        ({"machine": "x86_64"}, ["libcollide is for x86_64, the wheel for arm64"]),
        ({"oldest": (12, 0)}, ["libcollide needs macOS (12, 0), the wheel says (11, 0)"]),
        ({"signed": False}, ["libcollide has no signature: arm64 ends a process that loads the file"]),
        ({"name": "collide.so"}, ["libcollide calls itself 'collide.so', not @rpath/libcollide.dylib"]),
        ({"imports": {"qsort": "libother.dylib"}}, ["libcollide imports too much: qsort of libother.dylib"]),
        (
            {"exports": frozenset(libraries.exported_names() - {"collide_cast"} | {"epa"})},
            ["libcollide exports too much: epa", "libcollide exports too little: collide_cast"],
        ),
    ],
)
def test_a_fault_of_the_library_is_named(harm, wanted):
    library, module = of_a_wheel("macosx_11_0_arm64")
    assert libraries.faults("macosx_11_0_arm64", library._replace(**harm), module, CALLS) == wanted


@pytest.mark.parametrize("tag", ["macosx_11_0_arm64", "win_amd64"])
def test_functions_of_python_that_are_missing_or_from_elsewhere_are_named(tag):
    library, module = of_a_wheel(tag)
    place = libraries.PYTHONS["win" if tag == "win_amd64" else "macosx"]
    assert libraries.faults(tag, library, module, CALLS | {"PyList_New"}) == [
        f"_glue imports too little: PyList_New of {place}"
    ]
    elsewhere = module._replace(imports={**module.imports, "Py_BuildValue": "python313.dll"})
    assert f"_glue imports too little: Py_BuildValue of {place}" in libraries.faults(tag, library, elsewhere, CALLS)
