"""Shapes in ``.npz`` files: the arrays that define them, by name, the version of their format, and a digest of
everything.

A file holds what a shape is made from and nothing that proofs rest on: hulls, trees and what is known of an inside are
worked out anew, so a file can describe another shape but not make the library lie about the shape described.
The digest tells damage, but is no signature. Before any array is read its header is held against what the format has,
and its length against the file's: arrays are stored uncompressed, so a small file cannot ask for much memory.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.whole_file import whole_file
from collide.errors import InvalidShape

if TYPE_CHECKING:
    import zipfile


class Field(NamedTuple):
    """An array of a format: its type ("f8", or "i" for integers of any width) and shape, ``None`` for any length;
    whether every file must have the array."""

    type: str
    shape: tuple[int | None, ...]
    needed: bool = True


_STAMPS = {"format": Field("i", ()), "digest": Field("u1", (16,))}
#: An array of numbers, of whatever shape.
ANY = Field("", ())
#: Bytes of a header, at most: ours have some 128.
_LONGEST_HEADER = 1024


def shape_suffix(who: str, path, *others: str) -> str:
    """The suffix of a file to save a shape to, in small letters: ".npz", empty, or from ``others``.

    who : the calling class, for messages.
    Raises InvalidShape for any other: a file named like a mesh would hold arrays that no mesh reader takes.
    """
    suffix = checks.file_path(f"{who}.save: path", path, InvalidShape).suffix.lower()
    if suffix not in ("", ".npz", *others):
        known = ", ".join((".npz", *others))
        remedy = "" if others else ". Triangles of any shape: Mesh(*collide.tessellate(shape)).save"
        raise InvalidShape(f"{who}.save: {checks.brief(path)}: the suffix must be one of {known}{remedy}")
    return suffix


@contextmanager
def refused_as_shape(what: str, path) -> Iterator[None]:
    """What cannot be opened or written is told as the library's error. what : "Mesh.save", for messages."""
    try:
        yield
    except InvalidShape:
        raise
    except (OSError, TypeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InvalidShape(f"{what}: {checks.brief(path)}: {reason}") from None


def write_arrays(who: str, path, version: int, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays to a file, whole or not at all. who : the calling class, for messages."""
    shape_suffix(who, path)
    with refused_as_shape(f"{who}.save", path), whole_file(path) as file:
        pack(file, version, arrays)


def pack(file: IO[bytes], version: int, arrays: dict[str, np.ndarray]) -> None:
    """Write arrays, the version of their format and their digest to a stream; `unpack` reads them."""
    np.savez(file, format=np.array(version), digest=_digest(arrays), **arrays)  # type: ignore[arg-type]


#: What reads other files, for messages.
_OF_MESHES = "Files of meshes (STL, OBJ, PLY, …) are read by collide.scenes.load(path).bodies[0].shape"


def read_arrays(
    who: str, path, version: int, fields: dict[str, Field], dropped: str, others: str = _OF_MESHES
) -> dict[str, np.ndarray]:
    """The arrays of a file that `write_arrays` wrote.

    version : changes whenever files written before would be read wrongly.   fields : what the format has.
    dropped : prefix of further arrays in older files; they count for the digest alone.   others : what reads other
    files, for messages.
    Raises InvalidShape where the file is of another kind or version, or damaged.
    """
    path = checks.file_path(f"{who}.load: path", path, InvalidShape)
    named = f"{who}.load: {path}"
    try:
        if path.exists() and not path.is_file():
            raise InvalidShape(f"{named} is no regular file")
        with path.open("rb") as file:
            if file.read(2) != b"PK":
                raise InvalidShape(f"{named} is no .npz file of {who}.save. {others}")
            older = {True: ANY, False: None}
            needed = [name for name, field in fields.items() if field.needed]
            field_of = lambda name: fields.get(name, older[name.startswith(dropped)])
            arrays = unpack(file, version, named, field_of, needed)
    except InvalidShape:
        raise
    except (OSError, TypeError, ValueError) as error:
        raise InvalidShape(f"{named}: {getattr(error, 'strerror', None) or error}") from None
    return {name: array for name, array in arrays.items() if name in fields}


def unpack(
    file: IO[bytes], version: int, named: str, field_of: Callable[[str], Field | None], needed: Iterable[str] = ()
) -> dict[str, np.ndarray]:
    """The arrays written by `pack`, once every header fits its field and the file's length, and all their digest.

    named : what is read, for messages.   field_of : the field of this name; ``None`` for what the format has not.
    needed : names of arrays to insist on.
    Raises InvalidShape where the file is of another kind or version, or damaged.
    """
    import zipfile  # here, and below: a start of the library need not load it

    complaint = f"{named} is of another format; save the shape again"
    arrays: dict[str, np.ndarray] = {}
    try:
        with zipfile.ZipFile(file) as members:
            for member in members.infolist():
                name = member.filename.removesuffix(".npy")
                field = _STAMPS.get(name) or field_of(name)
                if name in arrays or field is None:
                    raise InvalidShape(complaint)
                arrays[name] = _read(members, member, field, complaint)
    except InvalidShape:
        raise
    except (
        OSError, TypeError, AttributeError, ValueError, EOFError, KeyError, IndexError, OverflowError, MemoryError,
        RuntimeError, SyntaxError, struct.error, zipfile.BadZipFile,
    ) as error:
        raise InvalidShape(f"{named} is no file that collide wrote, or was cut short ({error})") from None
    if not {*_STAMPS, *needed} <= arrays.keys() or int(arrays.pop("format")) != version:
        raise InvalidShape(complaint)
    digest = arrays.pop("digest")
    if not np.array_equal(digest, _digest(arrays)):
        raise InvalidShape(f"{named} is damaged: its contents do not fit their digest")
    return arrays


def _read(members: zipfile.ZipFile, member: zipfile.ZipInfo, field: Field, complaint: str) -> np.ndarray:
    """One array, once its header and its length are what they should be."""
    import zipfile

    if member.compress_type != zipfile.ZIP_STORED or member.flag_bits & 1 or not member.filename.endswith(".npy"):
        raise InvalidShape(complaint)  # nothing we write is compressed or encrypted
    with members.open(member) as file:
        if np.lib.format.read_magic(file) != (1, 0):
            raise InvalidShape(complaint)
        shape, _, dtype = np.lib.format.read_array_header_1_0(file, max_header_size=_LONGEST_HEADER)
        begin = file.tell()
    if field is ANY:
        known = dtype.kind in "iuf"
    else:
        known = f"{dtype.kind}{dtype.itemsize}".startswith(field.type) and len(shape) == len(field.shape)
        known = known and all(want in (None, have) for want, have in zip(field.shape, shape))
    if not known:
        raise InvalidShape(complaint)
    if begin + math.prod(shape) * dtype.itemsize != member.file_size:
        raise ValueError(f"{member.filename} has another length than it says")
    with members.open(member) as file:
        return np.lib.format.read_array(file, allow_pickle=False)


def _digest(arrays: dict[str, np.ndarray]) -> np.ndarray:
    """Of all arrays by name: a file that was damaged must not lend its numbers to a proof."""
    digest = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return np.frombuffer(digest.digest(), dtype=np.uint8)
