"""Types of editable installs. Their modules are found by code that runs, which tools that check types do not run.

They find a stub package instead (PEP 561), `collide-stubs`, by a path file in the wheel: a folder of links to this
checkout's modules, adapters and scenes among them. Python itself finds no module of that name.
"""

from __future__ import annotations

import base64
import hashlib
import os
import shutil
import zipfile
from pathlib import Path

FOLDER, PATH_FILE = Path("build") / "typing", "__collide_types__.pth"


def link_tree(root: Path) -> Path | None:
    """The folder that holds the stub package, made anew; ``None`` where links may not be made (Windows)."""
    folder = root / FOLDER
    package = folder / "collide-stubs"
    shutil.rmtree(folder, ignore_errors=True)
    package.mkdir(parents=True)
    wanted = {place.name: place for place in (root / "collide").iterdir() if place.name != "__pycache__"}
    wanted |= {"adapters": root / "adapters", "scenes": root / "scenes"}
    wanted["__init__.pyi"] = wanted.pop("__init__.py")  # mypy knows a stub package by it
    try:
        for name, place in wanted.items():
            os.symlink(place, package / name)
    except OSError:
        return None
    return folder


def add_types(wheel: Path, root: Path) -> None:
    """Add the path file to an editable wheel, in place."""
    folder = link_tree(root)
    if folder is None:
        return
    line = f"{folder}\n".encode()
    digest = base64.urlsafe_b64encode(hashlib.sha256(line).digest()).rstrip(b"=").decode()
    made = wheel.with_suffix(".tmp")
    with zipfile.ZipFile(wheel) as old, zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename.endswith(".dist-info/RECORD"):
                content += f"{PATH_FILE},sha256={digest},{len(line)}\n".encode()
            new.writestr(entry, content)
        new.writestr(PATH_FILE, line)
    made.replace(wheel)
