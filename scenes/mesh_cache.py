"""Prepared inputs, kept between runs: meshes as arrays, so that the next run needs no mesh library.

An entry is one ``.npz`` of plain arrays, named by a hash of everything it was made from: the bytes
of the file, the options, and `VERSION`. It is a convenience: an entry that is missing, damaged or
cannot be written is passed over, with a word at logging level DEBUG, and the work is done again.

What stands in an entry is believed to be the mesh. So the folder must be one that nobody else may write in
(`cache_folder.own_folder`), entries are files of this user and no links, and hold the key that they were kept under
and a digest of all.
"""

from __future__ import annotations

import hashlib
import io
import json
import logging
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from collide.base.cache_folder import cache_folder, own_folder, read_own
from collide.base.whole_file import whole_file
from collide.errors import InvalidShape
from collide.shapes.shape_files import ANY, pack, unpack

#: Raised with every change in what a loader stores; old entries are then never read again.
VERSION = 5
#: The array that holds the key.
_KEY = "key"

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
    folder = _folder()
    if folder is None:
        return None
    try:
        # Read whole before parsing: a file that shrinks meanwhile must not end in a half-read array.
        blob = read_own(folder / f"{name}.npz")
        arrays = unpack(io.BytesIO(blob), VERSION, name, lambda _: ANY, [_KEY])
        if arrays.pop(_KEY).tobytes() != name.encode():
            raise InvalidShape(f"{name} is the entry of another key")
        return arrays
    except FileNotFoundError:
        return None
    except (OSError, InvalidShape) as error:
        _log.debug("prepared input %s passed over: %s", name, error)
        return None


def store(name: str, arrays: Mapping[str, np.ndarray]) -> bool:
    """Keep arrays of numbers under a key; True when they were written. Readers see all of it or nothing."""
    folder = _folder()
    if folder is None:
        return False
    try:
        with whole_file(folder / f"{name}.npz", private=True) as file:
            pack(file, VERSION, {**arrays, _KEY: np.frombuffer(name.encode(), dtype=np.uint8)})
        return True
    except OSError as error:
        _log.debug("prepared input %s not kept: %s", name, error)
        return False


def _folder() -> Path | None:
    return own_folder(directory(), "meshes that were read", "they are read anew in every process")
