"""What programs that were built against `libcollide` go by: its symbols, prototypes, structures and constants.

    python tests/c_interface/abi.py            how they differ from native/abi.txt
    python tests/c_interface/abi.py --write    write native/abi.txt anew

Sizes and offsets are a C compiler's of this machine, 64 bits; symbols are those that ``nm -D`` finds in the library.
"""

from __future__ import annotations

import difflib
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HEADER, FILE = ROOT / "native" / "collide.h", ROOT / "native" / "abi.txt"
ADVICE = """The binary interface of libcollide is not that of native/abi.txt.
Lines that were only added (functions, constants): programs built before still run. The minor version rises with the
next release.
Lines that are gone or different (an argument, an offset, a size, a value): programs built before break. Go back, or add
a function under a new name; else the major version rises (before 1.0 the minor one), in collide/__init__.py and as
COLLIDE_VERSION, and CHANGELOG.md names the change.
Then: python tests/c_interface/abi.py --write
"""


def _without_comments(text: str) -> str:
    return re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)


def prototypes(header: str) -> dict[str, str]:
    """Declarations of functions by name, on one line each."""
    declared = re.findall(r"^COLLIDE_API\b([^;]*);", _without_comments(header), re.MULTILINE)
    lines = [" ".join(text.split()) for text in declared]
    return {re.search(r"(\w+)\(", line)[1]: line for line in lines}


def structures(header: str) -> dict[str, list[str]]:
    """Names of the fields of every public structure, in order."""
    made = {}
    for name, body in re.findall(r"typedef struct (\w+) \{(.*?)\} \1;", _without_comments(header), re.DOTALL):
        fields = [part for line in body.split(";") for part in line.split(",") if part.strip()]
        made[name] = [re.search(r"(\w+)(\[\w+\])?\s*$", part.strip())[1] for part in fields]
    return made


def constants(header: str) -> list[str]:
    bodies = re.findall(r"enum(?: \w+)? \{(.*?)\}", _without_comments(header), re.DOTALL)
    return [part.split("=")[0].strip() for body in bodies for part in body.split(",")]


def program(header: str) -> str:
    """A program in C that prints a line for each structure, field and constant."""
    lines = []
    for name, fields in structures(header).items():
        lines.append(f'printf("structure %s: %zu bytes\\n", "{name}", sizeof({name}));')
        for field in fields:
            size = f"sizeof(({name} *)0)->{field}".replace("sizeof(", "sizeof((", 1) + ")"
            lines.append(f'printf("    %s at %zu: %zu bytes\\n", "{field}", offsetof({name}, {field}), {size});')
    lines += [f'printf("constant %s %d\\n", "{name}", (int){name});' for name in constants(header)]
    body = "\n    ".join(lines)
    return f'#include "collide.h"\n#include <stddef.h>\n#include <stdio.h>\nint main(void)\n{{\n    {body}\n}}\n'


def described(library: Path, compiler: str, folder: Path, header: str | None = None) -> str:
    """The text of the interface of a library, by the header, or by another text of it."""
    header = HEADER.read_text(encoding="utf-8") if header is None else header
    (folder / "collide.h").write_text(header, encoding="utf-8")
    (folder / "abi.c").write_text(program(header), encoding="utf-8")
    _run(compiler, "-std=c99", folder / "abi.c", "-o", folder / "abi")
    symbols = {line.split()[-1] for line in _run("nm", "-D", "--defined-only", library).splitlines()}
    declared = prototypes(header)
    lines = [f"function {declared[name]}" for name in sorted(symbols & set(declared))]
    lines += [f"missing {name}" for name in sorted(set(declared) - symbols)]
    lines += [f"private symbol {name}" for name in sorted(symbols - set(declared))]
    return "\n".join([*lines, *_run(folder / "abi").splitlines()]) + "\n"


def differences(found: str) -> str:
    """Lines that were added (+) to native/abi.txt and that are gone (-); empty where none are."""
    kept = FILE.read_text(encoding="utf-8") if FILE.exists() else ""
    lines = difflib.unified_diff(kept.splitlines(), found.splitlines(), "native/abi.txt", "now", n=0, lineterm="")
    return "\n".join(lines)


def _run(*command: object) -> str:
    return subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout


def main(arguments: list[str]) -> int:
    import tempfile

    from collide.kernels.library import library_path

    with tempfile.TemporaryDirectory() as folder:
        found = described(Path(library_path()), "cc", Path(folder))
    told = differences(found)
    print(told or "the binary interface is that of native/abi.txt")
    if arguments == ["--write"]:
        FILE.write_text(found, encoding="utf-8")
        return 0
    return int(bool(told))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
