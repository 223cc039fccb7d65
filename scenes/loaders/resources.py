"""Where a file name in a description points: relative paths, ``file://``, ``package://`` and ``model://``.

A package or model is looked for, in this order: the folders given by ``package_path``, the folders above
the description, ROS_PACKAGE_PATH and Gazebo's lists of folders, AMENT_PREFIX_PATH, and the data that Python packages
install (``cmeel.prefix/share`` of example-robot-data, ``pybullet_data``).
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path, PurePosixPath
from urllib.parse import unquote, urlsplit

from collide.base.given_files import is_file
from collide.errors import SceneError, brief, cut

#: Environment variables that list folders of packages and models.
_FOLDER_LISTS = (
    "ROS_PACKAGE_PATH", "GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH",
)


class NotFound(SceneError):
    """A file name that points nowhere; the message lists the places searched."""


def find(filename: str, beside: Path, package_path: Iterable = (), *, element: str | None = None) -> Path:
    """The file that ``filename``, written in the file ``beside``, points to.

    package_path : folders that hold packages, or that are one.

    Raises NotFound (a SceneError) with every place searched, and SceneError for remote files.
    """
    scheme, rest = _split(filename, beside, element)
    if scheme in ("package", "model"):
        candidates: Iterable[Path] = _package_candidates(rest, beside, package_path)
    elif scheme in ("", "file"):
        candidates = _plain_candidates(rest, beside, package_path)
    else:
        raise SceneError(
            f'"{cut(filename)}": files are not fetched over {cut(scheme)}; download it first',
            path=beside,
            element=element,
        )
    searched: dict[str, None] = {}
    for candidate in candidates:
        if is_file(candidate):
            return candidate
        searched[str(candidate)] = None
    advice = ""
    if scheme == "model":
        advice = "; say where models lie with package_path (--package-path) or GZ_SIM_RESOURCE_PATH"
    if scheme == "package":
        advice = "; say where packages lie with package_path (--package-path) or ROS_PACKAGE_PATH"
        if rest.startswith("example-robot-data/"):
            advice = "; it comes with pip install 'collide-robotics[demo]'"
    places = "".join(f"\n    {cut(place, 240)}" for place in searched)
    raise NotFound(f'cannot find "{cut(filename, 240)}"{advice}. Searched:{places}', path=beside, element=element)


def named(path, package_path: Iterable = ()):
    """The path, or the file that a name such as ``package://panda/panda.urdf`` points to, as from the working folder.

    Raises NotFound, and SceneError for remote files.
    """
    is_name = isinstance(path, str) and "://" in path
    return find(path, Path.cwd() / "named by the caller", package_path) if is_name else path


def _split(filename: str, beside: Path, element: str | None) -> tuple[str, str]:
    name = filename.strip().replace("\\", "/")
    if "://" not in name:
        return "", name
    scheme, rest = name.split("://", 1)
    if scheme == "file":
        try:
            rest = unquote(urlsplit(name).path)
        except ValueError as error:  # brackets of an address that is none
            raise SceneError(f"{brief(filename)} is no file:// name: {error}", path=beside, element=element) from None
        # file:///C:/part.stl names C:/part.stl
        rest = rest[1:] if len(rest) > 2 and rest[0] == "/" and rest[2] == ":" else rest
    return scheme.lower(), rest


def _plain_candidates(name: str, beside: Path, package_path: Iterable) -> Iterator[Path]:
    folder = beside.parent
    yield folder / name
    if PurePosixPath(name).is_absolute():  # which Bullet takes for a path from the file's folder
        yield folder / name.lstrip("/")
    else:
        for base in package_path:
            yield Path(base) / name


def _package_candidates(name: str, beside: Path, package_path: Iterable) -> Iterator[Path]:
    package, _, inside = name.partition("/")
    for base in map(Path, package_path):
        yield base / name
        yield base / inside
    above = list(beside.resolve().parents)
    for base in above:
        yield base / name
    for base in _environment_folders():
        yield base / name
        if base.name == package:
            yield base / inside
    for base in installed_folders():
        yield base / name
    # Last, because it could meet a file of another package: the package's folder was renamed, and
    # its inside stands above the description. How far from the name it was found is noted by the
    # loader.
    for base in above:
        yield base / inside


def _environment_folders() -> Iterator[Path]:
    for variable in _FOLDER_LISTS:
        yield from map(Path, filter(None, os.environ.get(variable, "").split(os.pathsep)))
    for base in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(base) / "share"


def installed_folders() -> list[Path]:
    """Folders in which Python packages install robots."""
    folders = []
    for site in dict.fromkeys(sys.path):
        for inside in ("cmeel.prefix/share", "pybullet_data"):
            folder = Path(site or ".") / inside
            if folder.is_dir():
                folders.append(folder)
    return folders
