"""Lowered kernels kept in a folder, so that the next build lowers only the kernels changed by an edit.

A file for each kernel and types of its arguments. The file is taken where the kernel's own code is the same
(`sources.of_own_code`), and where each callee still gives the same types of results: the inside of a callee is no part
of its callers' code. So an edit of a kernel lowers this kernel anew, and its callers only where its results have other
types.

Files begin with a digest of the rest: a truncated file, or a file with a flipped bit, counts as missing.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from collide.base.whole_file import whole_file

_DIGEST = hashlib.sha256().digest_size


class Called(NamedTuple):
    """A kernel as another calls it."""

    name: tuple[str, str, str]
    """Module, qualified name, and what tells it from others made of one source."""
    arguments: tuple
    asked: Any
    """Numba's type of what it was asked to return; None where its code decides."""
    options: tuple

    @property
    def file_name(self) -> str:
        types = [str(kind) for kind in self.arguments]
        text = repr((self.name, types, str(self.asked), self.options))
        return f"{self.name[1].split('.')[-1]}-{hashlib.sha256(text.encode()).hexdigest()[:20]}.ll"


class Record(NamedTuple):
    """A lowered kernel."""

    code_hash: str
    """Hash of its own code, and the compilers' versions."""
    symbol: str
    environment: str
    parameters: tuple[str, ...]
    result: Any
    modules: tuple[bytes, ...]
    """Bitcode."""
    calls: tuple[tuple[Called, str], ...]
    """What it calls, and the type of each result, in the order in which they are put together."""


def read(folder: Path, called: Called, code_hash: str) -> Record | None:
    """The record of a kernel; None where no file is kept, the file is damaged, or its code hash differs."""
    # the last three: types of arguments and results are pickled by name, and an edit may have renamed a class
    with suppress(OSError, AttributeError, ImportError, TypeError):
        place = folder / called.file_name
        content = place.read_bytes()
        rest = content[_DIGEST:]
        if hashlib.sha256(rest).digest() == content[:_DIGEST]:
            record = Record(*pickle.loads(rest))
            if record.code_hash == code_hash:
                os.utime(place)
                return record
    return None


def write(folder: Path, called: Called, record: Record) -> None:
    rest = pickle.dumps(tuple(record))
    with whole_file(folder / called.file_name) as file:  # link units are lowered side by side
        file.write(hashlib.sha256(rest).digest() + rest)
