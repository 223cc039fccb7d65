"""The scripts of a clone's `benchmarks/`, explained by their own first sentences, and run.

A wheel has none of them: what needs them says so.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from collide.errors import CollideError, InvalidArgument

#: In a clone; a wheel's own folders have nothing there.
FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"
#: What `collide bench` measures itself, from a wheel too.
PACKAGED = {
    "pareto": "Run time against error: every engine and setting on the same pairs, by class, as one picture.",
    "scaling": "Run time and operations against the size of hulls, with fitted slopes.",
}


class Script(NamedTuple):
    """name : without .py.   about : the first sentence of its docstring; empty where it has none.
    runs : False for a part that other scripts import.
    """

    name: str
    about: str
    runs: bool


def scripts(folder: Path = FOLDER) -> list[Script]:
    """Every file of the folder; empty where there is none."""
    return [_script(file) for file in sorted(folder.glob("*.py"))]


def _script(file: Path) -> Script:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    words = " ".join((ast.get_docstring(tree) or "").split("\n\n")[0].split())
    runs = any(isinstance(node, ast.If) and "__main__" in ast.unparse(node.test) for node in tree.body)
    return Script(file.stem, words, runs)


def run_script(name: str, arguments: list[str], folder: Path = FOLDER) -> int:
    """Run one script with this interpreter; gives its exit status.

    Raises CollideError in a wheel, InvalidArgument for a name that is no script.
    """
    known = [script.name for script in scripts(folder) if script.runs]
    if not known:
        raise CollideError(
            f"bench run {name}: the scripts of benchmarks/ are not part of the installed package: clone the repository "
            "and install it with pip install -e . there (collide bench pareto and scaling need no clone)"
        )
    if name not in known:
        raise InvalidArgument(f"no benchmark {name!r}; there are {', '.join(known)}")
    return subprocess.run([sys.executable, str(folder / f"{name}.py"), *arguments], check=False).returncode
