"""The build backend: setuptools, and beside it machine code that travels in the source archive.

A source archive holds object files of all kernels for the platforms of `EMITTED`, in the folder ``emitted``: building
from such an archive needs a C compiler and seconds, and neither Numba nor llvmlite. Everywhere else, kernels are
compiled by these two, which are asked for then.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import editable_types
import platforms
from setuptools import build_meta
from setuptools.build_meta import *

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "emitted"
#: What compiles kernels: the versions that were tested.
COMPILERS = ["numba==0.68.1", "llvmlite==0.50.0"]
#: Platforms whose objects travel.
EMITTED = ("linux-x86_64", "linux-aarch64")


def get_requires_for_build_wheel(config_settings=None) -> list[str]:
    return build_meta.get_requires_for_build_wheel(config_settings) + _compilers()


def get_requires_for_build_editable(config_settings=None) -> list[str]:
    return build_meta.get_requires_for_build_editable(config_settings) + _compilers()


def get_requires_for_build_sdist(config_settings=None) -> list[str]:
    return build_meta.get_requires_for_build_sdist(config_settings) + _compilers()


def build_editable(wheel_directory, config_settings=None, metadata_directory=None) -> str:
    name = build_meta.build_editable(wheel_directory, config_settings, metadata_directory)
    editable_types.add_types(Path(wheel_directory) / name, ROOT)
    return name


def build_sdist(sdist_directory, config_settings=None) -> str:
    try:
        if emitted() is None:
            emit()
        return build_meta.build_sdist(sdist_directory, config_settings)
    finally:
        if (ROOT / ".git").exists():  # in a checkout the next edit would make them stale
            shutil.rmtree(FOLDER, ignore_errors=True)


def _compilers() -> list[str]:
    if os.environ.get("COLLIDE_NO_LIBRARY", "0") not in ("", "0"):
        return []
    of_kernels = [] if emitted() is not None else COMPILERS
    return [*of_kernels, platforms.ZIG] if platforms.needs_zig(platforms.chosen()) else of_kernels


def emit(names: tuple[str, ...] = EMITTED, levels: str = "all") -> None:
    """Object files of platforms' levels in `FOLDER`, and what is known of them.   levels : as in ``COLLIDE_LEVELS``."""
    FOLDER.mkdir(exist_ok=True)
    about: dict = {"platforms": {}}
    for name in names:
        command = [sys.executable, str(ROOT / "native" / "compile_kernels.py"), "--json", "--levels", levels]
        command += ["--triple", platforms.PLATFORMS[name].triple]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=ROOT)
        made = json.loads(done.stdout)
        about["platforms"][name] = {
            level: [[_kept(Path(place)), _digest(Path(place))] for place in places]
            for level, places in made.pop("objects").items()
        }
        about.update(made)
    (FOLDER / "about.json").write_text(json.dumps(about, indent=1), encoding="utf-8")


def _kept(place: Path) -> str:
    shutil.copy(place, FOLDER / place.name)
    return place.name


def _digest(place: Path) -> str:
    return hashlib.sha256(place.read_bytes()).hexdigest()


def emitted(levels: str = "") -> dict | None:
    """What `compile_kernels` would make, as it came with the source archive; None where there is nothing that fits: no
    folder, another platform, an edited source, a damaged file, or a level that is missing.

    levels : as in ``COLLIDE_LEVELS``; by default all.
    """
    try:
        about = json.loads((FOLDER / "about.json").read_text(encoding="utf-8"))
        of_levels = about["platforms"][platforms.chosen().name]
        wanted = list(of_levels) if levels in ("", "all") else levels.replace(",", " ").split()
        files = {level: of_levels[level] for level in wanted}
        sound = all(_digest(FOLDER / name) == known for pairs in files.values() for name, known in pairs)
        sources = _sources()
        if not sound or sources.fingerprint(tuple(about["source_files"])) != about["sources"]:
            return None
    except (OSError, ValueError, KeyError):
        return None
    objects = {level: [str(FOLDER / name) for name, _ in pairs] for level, pairs in files.items()}
    return {**about, "objects": objects, "hashes": sources.entry_hashes()}


def _sources():
    """`collide.kernels.sources` without the package around it, which would look for a library, or for Numba."""
    place = ROOT / "collide" / "kernels" / "sources.py"
    found = importlib.util.spec_from_file_location("collide.kernels.sources", place)
    assert found is not None and found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module
