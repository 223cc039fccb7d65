"""Shapes in ``.npz`` files: arrays by name, the version of their format, and a digest of everything."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import numpy as np

from collide.errors import InvalidShape


def write_arrays(who: str, path, version: int, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays to a file. who : the class that asks, for messages."""
    try:
        with Path(path).open("wb") as file:
            np.savez(file, format=np.array(version), digest=_digest(arrays), **arrays)  # type: ignore[arg-type]
    except (OSError, TypeError) as error:
        raise InvalidShape(f"{who}.save: {path!r}: {getattr(error, 'strerror', None) or error}") from None


def read_arrays(who: str, path, version: int, needed: set[str]) -> dict[str, np.ndarray]:
    """The arrays of a file that `write_arrays` wrote.

    version : changes whenever files written before would be read wrongly.   needed : names that must be there.
    Raises InvalidShape where the file is another one, of another version, or damaged.
    """
    try:
        with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as found:
            arrays = {name: found[name] for name in found.files}
    except OSError as error:
        raise InvalidShape(f"{who}.load: {path}: {error.strerror or error}") from None
    except (TypeError, AttributeError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InvalidShape(f"{who}.load: {path} is no file that {who}.save wrote ({error})") from None
    stamp, digest = arrays.pop("format", None), arrays.pop("digest", None)
    if stamp is None or digest is None or stamp.shape != () or int(stamp) != version or not needed <= set(arrays):
        raise InvalidShape(f"{who}.load: {path} is of another format; save the shape again")
    if not np.array_equal(digest, _digest(arrays)):
        raise InvalidShape(f"{who}.load: {path} is damaged: its contents do not fit their digest")
    return arrays


def _digest(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Of all arrays by name: a file that was damaged must not lend its numbers to a proof."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)
