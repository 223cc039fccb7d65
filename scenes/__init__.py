"""Scenes: files and generators in, bodies with poses out.

    from collide.scenes import load, generate
    scene = load("panda_workbench")         # a shipped scene, a path, or several paths
    scene.world().distances(max_distance=0.05)

`load` reads URDF with SRDF, MJCF, MoveIt planning scenes, meshes and the project's own scene files
(docs/scene-format.md); `generate` makes seeded scenes; `save` writes a scene
or a World as such a file. Importing this package imports numpy alone:
each format's library is loaded when a file needs it.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from collide.errors import SceneError, brief

if TYPE_CHECKING:
    from collide.scenes.description import Scene, SceneBody
    from collide.scenes.generators import generate
    from collide.scenes.loaders.allowed_pairs import allow_pairs
    from collide.scenes.loaders.load_scene import load
    from collide.scenes.write_scene import save

__all__ = ["Scene", "SceneBody", "allow_pairs", "generate", "load", "path", "save", "shipped"]

_HOME = {
    "Scene": "collide.scenes.description",
    "SceneBody": "collide.scenes.description",
    "allow_pairs": "collide.scenes.loaders.allowed_pairs",
    "generate": "collide.scenes.generators",
    "load": "collide.scenes.loaders.load_scene",
    "save": "collide.scenes.write_scene",
}
_SUFFIXES = (".yaml", ".json")


def shipped() -> list[str]:
    """The scenes that come with collide.

    Returns
    -------
    list of str
        Names, sorted; `load` takes each of them.
    """
    return sorted(file.stem for file in _assets().iterdir() if file.suffix in _SUFFIXES)


def path(name: str) -> Path:
    """The file of a shipped scene, to be copied and changed.

    Parameters
    ----------
    name : str
        One of `shipped`.

    Returns
    -------
    Path
        Inside the installed package.

    Raises
    ------
    SceneError
        For an unknown name; the known ones are listed.
    """
    for file in _assets().iterdir() if isinstance(name, str) else ():
        if file.suffix in _SUFFIXES and file.stem == name:
            return file
    raise SceneError(f"no shipped scene has the name {brief(name)}; there are {', '.join(shipped())}")


def _assets() -> Path:
    return Path(__file__).resolve().parent / "assets"


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'collide.scenes' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
