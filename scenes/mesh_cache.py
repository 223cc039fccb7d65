"""Prepared inputs, kept between runs: meshes as arrays, so that the next run needs no mesh library.

An entry is one ``.npz`` of plain arrays, named by a hash of everything it was made from: the bytes
of the file, the options, and `VERSION`. It is a convenience: an entry that is missing, damaged or
cannot be written is passed over, with a word at logging level DEBUG, and the work is done again.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from collide.cache_folder import cache_folder
from collide.whole_file import whole_file

#: Raised with every change in what a loader stores; old entries are then never read again.
VERSION = 3

_log = logging.getLogger(__name__)


def directory() -> Path:
    """Where entries are kept, within the user's cache folder for collide."""
    return cache_folder("scenes")


def key(contents: Iterable[bytes], options: Mapping[str, object]) -> str:
    """Name of the entry made from these bytes under these options (plain data)."""
    digest = hashlib.sha256(json.dumps([VERSION, dict(options)], sort_keys=True).encode())
    for blob in contents:
        digest.update(len(blob).to_bytes(8, "little"))
        digest.update(blob)
    return digest.hexdigest()


def fetch(name: str) -> dict[str, np.ndarray] | None:
    """The arrays kept under a key, or None."""
    try:
        # Read whole before parsing: a file that shrinks meanwhile must not end in a half-read array.
        blob = (directory() / f"{name}.npz").read_bytes()
        with np.load(io.BytesIO(blob), allow_pickle=False) as entry:
            return {field: entry[field] for field in entry.files}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, NotImplementedError) as error:
        _log.debug("prepared input %s passed over: %s", name, error)
        return None


def store(name: str, arrays: Mapping[str, Any]) -> bool:
    """Keep arrays under a key; True when they were written. Readers see all of it or nothing."""
    try:
        folder = directory()
        folder.mkdir(parents=True, exist_ok=True)
        with whole_file(folder / f"{name}.npz", private=True) as file:
            np.savez(file, **arrays)
        return True
    except OSError as error:
        _log.debug("prepared input %s not kept: %s", name, error)
        return False
