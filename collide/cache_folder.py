"""Where collide keeps what it has prepared: compiled kernels and parsed inputs."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder(*parts: str) -> Path:
    """The user's cache folder for collide, not necessarily existing yet.

    ``COLLIDE_CACHE_DIR`` if set; else the platform's place: ``%LOCALAPPDATA%``,
    ``~/Library/Caches``, ``$XDG_CACHE_HOME`` or ``~/.cache``.
    """
    chosen = os.environ.get("COLLIDE_CACHE_DIR")
    if chosen:
        return Path(chosen).expanduser().joinpath(*parts)
    home = Path(os.path.expanduser("~"))
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache")
    return base.joinpath("collide", *parts)
