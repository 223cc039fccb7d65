"""What an MJCF file makes MuJoCo read and build, looked at before MuJoCo does: it has no limits of its own."""

from __future__ import annotations

import math
import os
import stat
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from collide.base.given_files import LARGEST_MESH, read_bytes
from collide.errors import SceneError, brief
from collide.scenes.loaders.files import DEEPEST, MAX_INCLUDED
from collide.scenes.loaders.xml_text import parse_xml

#: Copies that <replicate>, <composite> and <flexcomp> make of what is in them, all of a file: MuJoCo takes a time that
#: grows as their square (1,000: 0.15 s, 10,000: 20 s on a shared core).
MAX_COPIES = 10_000
#: Samples of one height field, and numbers in any count: MuJoCo allocates before it looks.
MAX_SAMPLES = 2**24

_COPYING = ("replicate", "composite", "flexcomp")
_FOLDERS = ("meshdir", "texturedir", "assetdir")


def check_mjcf(path: Path, root: ET.Element) -> None:
    """Refuse a model that would not end, or wait: too many copies or samples, files that are none, endless includes.

    root : the outermost element of the file.   Raises SceneError naming file and element.
    """
    files = list(_with_includes(path, root))
    folders = {file.parent for file, _ in files}
    for _, tree in files:
        for compiler in tree.iter("compiler"):
            named = [compiler.get(key) for key in _FOLDERS]
            folders |= {folder / name for folder in list(folders) for name in named if name and "\0" not in name}
    copies = 0
    for file, tree in files:
        copies += _copies(tree, file)
        if copies > MAX_COPIES:
            raise SceneError(
                f"makes {brief(copies)} copies, at most {MAX_COPIES:,} are read: write what is needed", path=file,
                element="count",
            )
        for element in tree.iter():
            if element.tag == "hfield":
                _check_samples(element, file)
            for key, name in element.attrib.items():
                if key.startswith("file") and element.tag != "include":
                    _check_file(name, folders, file, element.tag)


def _with_includes(path: Path, root: ET.Element) -> Iterator[tuple[Path, ET.Element]]:
    """The file and those that it includes, each as often as it is included."""
    waiting, count = [(path, root, 0)], 0
    while waiting:
        file, tree, depth = waiting.pop()
        yield file, tree
        for element in tree.iter("include"):
            name, count = element.get("file"), count + 1
            if count > MAX_INCLUDED or depth >= DEEPEST:
                raise SceneError(f"with this the model includes more than {MAX_INCLUDED:,} files", path=file)
            # MuJoCo looks beside the model, then beside the file that includes
            candidates = [folder / name for folder in (path.parent, file.parent) if name and "\0" not in name]
            target = next((place for place in candidates if os.path.exists(place)), None)
            if target is not None:
                waiting.append((target, parse_xml(target, []), depth + 1))


def _copies(root: ET.Element, path: Path) -> int:
    """How many elements are made besides those that stand in the file."""
    made, waiting = 0, [(root, 1)]
    while waiting:
        element, times = waiting.pop()
        if element.tag in _COPYING:
            times *= max(1, math.prod(max(1, n) for n in _numbers(element, "count", path)))
        made += times if times > 1 else 0
        waiting += [(child, times) for child in element]
        if made > MAX_COPIES:
            break
    return made


def _check_samples(element: ET.Element, path: Path) -> None:
    rows, columns = ((_numbers(element, key, path) or [1])[0] for key in ("nrow", "ncol"))
    if max(rows, 1) * max(columns, 1) > MAX_SAMPLES:
        raise SceneError(
            f"has nrow × ncol = {brief(rows)} × {brief(columns)} samples, at most {MAX_SAMPLES:,} are read", path=path,
            element="<hfield>",
        )


def _numbers(element: ET.Element, key: str, path: Path) -> list[int]:
    """Counts, rounded up; what is no number is MuJoCo's to refuse."""
    numbers = []
    for word in element.get(key, "").split()[:8]:
        try:
            numbers.append(math.ceil(min(float(word), 1e18)))
        except ValueError:
            return []
    return numbers


def _check_file(name: str, folders: set[Path], path: Path, tag: str) -> None:
    """Refuse a pipe, a device, and what is too large, wherever MuJoCo may look for it."""
    if "\0" in name:
        return
    for place in {folder / part for folder in folders for part in (name, Path(name).name)}:
        try:
            about = os.stat(place)
        except (OSError, ValueError):
            continue
        if stat.S_ISDIR(about.st_mode):
            continue
        if not stat.S_ISREG(about.st_mode) or about.st_size > LARGEST_MESH:
            try:
                read_bytes(place, LARGEST_MESH, "mesh")
            except SceneError as error:
                raise SceneError(str(error), path=path, element=f"<{tag}>") from None
