"""Dynamic libraries of macOS and of Windows in a wheel, read without any tool of theirs and judged by native/abi.txt.

    python tests/machines/dynamic_libraries.py dist/….whl

Nothing is run. Judged is what a loader goes by: the processor, exported names, imported names and the libraries to
take them from; on macOS the oldest system, the install name, and the signature that arm64 demands, too.
"""

from __future__ import annotations

import re
import struct
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ABI = Path(__file__).resolve().parents[2] / "native" / "abi.txt"
#: Paths of libraries that are part of every system, and where functions of Python are taken from.
SYSTEMS = {"macosx": r"/usr/lib/libSystem\.B\.dylib", "win": r"KERNEL32\.dll|api-ms-win-crt-[\w-]+\.dll"}
PYTHONS = {"macosx": "the whole process", "win": "python3.dll"}
#: Exported by the linker of zig from every library of macOS, whatever the source says.
LINKERS = {"_mh_dylib_header", "__dso_handle"}

#: The Mach-O format: its beginning, processors, load commands.
MAGIC, MACHINES = 0xFEEDFACF, {0x01000007: "x86_64", 0x0100000C: "arm64"}
LOADED, OWN_NAME, SIGNATURE, OLDEST, INFO = 0x0C, 0x0D, 0x1D, 0x32, 0x80000022
#: Opcodes of bindings, in the upper four bits, and how many numbers follow those that have any.
BY_NUMBER, BY_LONG_NUMBER, SPECIAL, SYMBOL, BIND = 0x10, 0x20, 0x30, 0x40, 0x90
FOLLOWED = {0x20: 1, 0x60: 1, 0x70: 1, 0x80: 1, 0xA0: 1, 0xC0: 2}
ANYWHERE = 0x0E


class Library(NamedTuple):
    """What a loader reads in a dynamic library. Names are those of C."""

    machine: str
    """``arm64``, ``x86_64`` or ``amd64``, as in tags of wheels."""
    exports: frozenset[str]
    imports: dict[str, str]
    """Name → path of the library that has it."""
    name: str
    """Install name, empty for a module."""
    oldest: tuple[int, int] = (0, 0)
    """Version of macOS."""
    signed: bool = False


def read(data: bytes) -> Library:
    """The library in a file for one processor of 64 bits. Raises ValueError for a format that is none of the two."""
    if len(data) > 64 and data.startswith(struct.pack("<I", MAGIC)):
        return _mach_o(data)
    if len(data) > 64 and data.startswith(b"MZ"):
        return _dll(data)
    raise ValueError(f"neither a Mach-O file of 64 bits for one processor nor a DLL: it begins with {data[:4].hex()}")


def _mach_o(data: bytes) -> Library:
    _, machine, _, _, n_commands, _, _, _ = struct.unpack_from("<8I", data)
    oldest, name, signed, loads, info, at = (0, 0), "", False, [], None, 32
    for _ in range(n_commands):
        command, size = struct.unpack_from("<2I", data, at)
        if command in (LOADED, OWN_NAME):
            path = _text(data, at + struct.unpack_from("<I", data, at + 8)[0])
            loads, name = ([*loads, path], name) if command == LOADED else (loads, path)
        elif command == INFO:  # places and lengths: rebased, bound, bound weakly, bound late, exported
            info = struct.unpack_from("<10I", data, at + 8)
        elif command == OLDEST:
            version = struct.unpack_from("<I", data, at + 12)[0]
            oldest = version >> 16, version >> 8 & 0xFF
        signed |= command == SIGNATURE
        at += size
    if info is None:
        raise ValueError("a Mach-O file without the load command LC_DYLD_INFO_ONLY: its names are kept in another way")
    _, bound, _, late, trie = (data[info[k] : info[k] + info[k + 1]] for k in range(0, 10, 2))
    imports = {_c(word): path for part in (bound, late) for word, path in _bound(part, loads)}
    exports = frozenset(_c(word) for word in _words(trie))
    return Library(MACHINES.get(machine, hex(machine)), exports, imports, name, oldest, signed)


def _text(data: bytes, begin: int) -> str:
    return data[begin : data.index(0, begin)].decode()


def _c(word: str) -> str:
    return word.removeprefix("_")


def _number(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, and the place after it."""
    value, shift = 0, 0
    while True:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 0x80:
            return value, at


def _bound(code: bytes, loads: list[str]) -> Iterator[tuple[str, str]]:
    """(symbol, path of its library), from the opcodes of bindings."""
    at, word, path = 0, "", ""
    while at < len(code):
        opcode, low = code[at] & 0xF0, code[at] & 0x0F
        numbers, at = [], at + 1
        if opcode == SYMBOL:
            word = _text(code, at)
            at += len(word) + 1
        for _ in range(FOLLOWED.get(opcode, 0)):
            number, at = _number(code, at)
            numbers.append(number)
        if opcode == SPECIAL:
            path = PYTHONS["macosx"] if low == ANYWHERE else "this file or the program"
        elif opcode in (BY_NUMBER, BY_LONG_NUMBER):
            path = loads[(low if opcode == BY_NUMBER else numbers[0]) - 1]
        elif opcode >= BIND:
            yield word, path


def _words(trie: bytes) -> Iterator[str]:
    """Symbols of an export trie. A node: the size of its ending, the ending, edges of a text and a node's place."""
    waiting = [("", 0)] if trie else []
    while waiting:
        word, at = waiting.pop()
        ending, at = _number(trie, at)
        if ending:
            yield word
        at += ending
        edges, at = trie[at], at + 1
        for _ in range(edges):
            text = _text(trie, at)
            node, at = _number(trie, at + len(text) + 1)
            waiting.append((word + text, node))


def _dll(data: bytes) -> Library:
    header = struct.unpack_from("<I", data, 0x3C)[0] + 4
    machine, n_sections, _, _, _, more = struct.unpack_from("<2H3IH", data, header)
    directories, sections = header + 20 + 112, header + 20 + more

    def place(address: int) -> int:
        """Where in the file a loaded address comes from."""
        for k in range(n_sections):
            size, begin, kept, at = struct.unpack_from("<4I", data, sections + 40 * k + 8)
            if begin <= address < begin + max(size, kept):
                return address - begin + at
        raise ValueError(f"a DLL whose address {address:#x} is in no section")

    exporting, _, importing, _ = struct.unpack_from("<4I", data, directories)
    name, exports, imports = "", frozenset(), {}
    if exporting:
        at = place(exporting)
        name = _text(data, place(struct.unpack_from("<I", data, at + 12)[0]))
        n, _, names = struct.unpack_from("<3I", data, at + 24)
        exports = frozenset(_text(data, place(word)) for word in struct.unpack_from(f"<{n}I", data, place(names)))
    at = place(importing) if importing else 0
    while at and any(table := struct.unpack_from("<5I", data, at)):
        words, library = place(table[0]), _text(data, place(table[3]))
        while word := struct.unpack_from("<Q", data, words)[0]:
            imports[_text(data, place(word) + 2) if word < 1 << 63 else f"number {word & 0xFFFF}"] = library
            words += 8
        at += 20
    return Library("amd64" if machine == 0x8664 else hex(machine), exports, imports, name)


def exported_names() -> set[str]:
    """Names that native/abi.txt says libcollide exports: functions of the header, and private symbols."""
    lines = ABI.read_text(encoding="utf-8").splitlines()
    functions = {re.search(r"(\w+)\(", line)[1] for line in lines if line.startswith("function ")}
    return functions | {line.split()[-1] for line in lines if line.startswith("private symbol ")}


def faults(tag: str, library: Library, module: Library, of_python: set[str]) -> list[str]:
    """What is wrong with the libraries of a wheel, a sentence each.

    tag : of the wheel, as ``macosx_11_0_arm64`` or ``win_amd64``
    of_python : functions of Python that the module calls on a machine where tests run
    """
    system, version, machine = re.fullmatch(r"(macosx|win)((?:_\d+)*)_(\w+)", tag).groups()
    oldest = tuple(int(part) for part in version.split("_")[1:]) or (0, 0)
    told = []
    for what, file in (("libcollide", library), ("_glue", module)):
        if file.machine != machine:
            told.append(f"{what} is for {file.machine}, the wheel for {machine}")
        if file.oldest > oldest:
            told.append(f"{what} needs macOS {file.oldest}, the wheel says {oldest}")
        if machine == "arm64" and not file.signed:
            told.append(f"{what} has no signature: arm64 ends a process that loads the file")
    wanted = {"macosx": "@rpath/libcollide.dylib", "win": "collide.dll"}[system]
    if library.name != wanted:
        told.append(f"libcollide calls itself {library.name!r}, not {wanted}")
    told += _compared("libcollide exports", library.exports - LINKERS, exported_names())
    told += _compared("_glue exports", module.exports - LINKERS, {"PyInit__glue"})
    told += _compared("libcollide imports", _of_others(library, system), set())
    calls = {f"{name} of {PYTHONS[system]}" for name in of_python}
    return told + _compared("_glue imports", _of_others(module, system), calls)


def _of_others(file: Library, system: str) -> set[str]:
    """Imports, but for those from the system's libraries."""
    return {f"{name} of {path}" for name, path in file.imports.items() if not re.fullmatch(SYSTEMS[system], path)}


def _compared(what: str, found: set[str] | frozenset[str], wanted: set[str]) -> list[str]:
    parts = ("too much", found - wanted), ("too little", wanted - found)
    return [f"{what} {how}: {', '.join(sorted(names))}" for how, names in parts if names]


def called_here() -> set[str]:
    """Functions of Python that the module of this machine calls, as the tool nm lists them."""
    from collide.kernels import library

    command = ["nm", "-D", "--undefined-only", library.glue.__file__]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return {line.split()[-1] for line in listed.splitlines() if "Py" in line}


def main() -> int:
    wheel = Path(sys.argv[1])
    with zipfile.ZipFile(wheel) as opened:
        files = [name for name in opened.namelist() if re.fullmatch(r".*(collide\.d\w+|/_glue\.\S+)", name)]
        module, library = (read(opened.read(name)) for name in sorted(files))
    of_python = called_here()
    if told := faults(wheel.stem.split("-")[-1], library, module, of_python):
        print(*told, sep="\n")
        return 1
    print(
        f"{wheel.name}: libcollide exports the {len(exported_names())} names of native/abi.txt and imports "
        f"{len(library.imports)} of the system; the module takes {len(of_python)} from Python, as on this machine"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
