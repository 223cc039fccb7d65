"""What the command ``collide`` writes: reports, copies of scenes. No scene is overwritten by a report."""

from __future__ import annotations

import os
import sys

from collide.base.whole_file import whole_file, write_whole
from collide.errors import InvalidArgument
from collide.reports.number_format import count

#: What meshes are written as (`collide.shapes.mesh_formats`).
MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".3mf", ".glb")
#: What is larger is read as a scene by no loader (`scenes/loaders/documents.py`), and need not be looked into.
_LARGEST_SCENE = 256 * 2**20


def copy_scene(words: list[str], force: bool) -> str:
    """Copy a shipped scene's file; gives the path of the copy."""
    from pathlib import Path

    from collide.scenes import path

    if len(words) > 2:
        raise InvalidArgument(f"--copy takes a name and at most one destination, got {' '.join(words)}")
    source = path(words[0])
    target = Path(words[1] if len(words) == 2 else source.name)
    if target.is_dir():
        target = target / source.name
    if target.exists() and not target.is_file():
        raise InvalidArgument(f"{target} is no file: a scene is not copied there")
    if target.exists() and not force:
        raise InvalidArgument(f"{target} exists already: give another destination, or --force to overwrite it")
    with whole_file(target) as copy:
        copy.write(source.read_bytes())
    return str(target)


def first_words(file) -> str:
    """A scene file's description: its ``about``, else its first comment, else the counts of its elements."""
    text = file.read_text(encoding="utf-8")
    if file.suffix == ".json":
        import json

        data = json.loads(text)
        robots, bodies = (len(data.get(key, [])) for key in ("robots", "bodies"))
        return data.get("about") or f"{count(robots, 'robot')}, {count(bodies, 'body', 'bodies')}"
    for start in ("about:", "#"):
        for line in text.splitlines():
            if line.startswith(start) and line[len(start):].strip():
                return line[len(start):].strip().strip("\"'")
    return ""


def write_json(items, place: str) -> None:
    """One JSON object, (key, value) after (key, value), to a .json file or to standard output."""
    from collide.reports.json_text import pieces

    if place == "-":
        for text in pieces(items, ascii_only=True):
            sys.stdout.write(text)
        return
    write_whole(place, pieces(items))


def check_place(option: str, place: str, suffix: str) -> None:
    """``--json a.yaml b.yaml`` must not overwrite a scene; devices and pipes are written to as they are."""
    if not place.lower().endswith(suffix) and (os.path.isfile(place) or not os.path.exists(place)):
        otherwise = ", or be - for standard output" if option in ("--json", "--html") else ""
        raise InvalidArgument(f"{option}: {place!r} must end in {suffix}{otherwise}")
    if _is_scene(place):
        raise InvalidArgument(f"{option}: {place!r} is a scene; it is not overwritten by a report")


def _is_scene(place: str) -> bool:
    import json

    if not os.path.isfile(place) or os.path.getsize(place) > _LARGEST_SCENE:
        return False
    try:
        with open(place, encoding="utf-8") as file:
            data = json.load(file)
    except (ValueError, RecursionError):
        return False
    return isinstance(data, dict) and ("collide" in data or "robot_model_name" in data)


def print_lines(lines) -> None:
    """Many lines to standard output, a few thousand at a time."""
    from itertools import islice

    from collide.reports import terminal

    lines = iter(lines)
    while some := list(islice(lines, 4096)):
        terminal.write_text("".join(line + "\n" for line in some))
    sys.stdout.flush()
