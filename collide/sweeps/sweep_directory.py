"""The folder of a sweep: a manifest, a lock, and a Parquet file for each chunk, written once, whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from collide.base.given_files import read_text
from collide.base.log import log
from collide.base.whole_file import whole_file
from collide.errors import InvalidArgument, MissingExtra, SceneError, listing

#: Readers of Parquet leave out names with a leading underscore, so the folder reads as a single table.
MANIFEST, LOCK, PARTIAL = "_sweep.json", "_sweep.lock", "_partial-"
SCHEMA = "collide-sweep/2"
#: What of a manifest a second run must share, and how a difference is told.
_COMPARED = {
    "schema": "it was written by another version of collide, in another form",
    "version": "it was written by another version of collide",
    "question": "the scene or the robot changed",
    "configurations": "the configurations are others",
    "columns": "other columns were asked for",
    "chunk": "the chunks were of another size",
}


def parquet_module():
    """``pyarrow`` and its Parquet module. Raises MissingExtra where it is not installed."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise MissingExtra("pyarrow", extra="sweep", purpose="write the results of a sweep") from None
    return pyarrow, parquet


class SweepDirectory:
    """Folder of a sweep's finished chunks.

    Parameters
    ----------
    path : Path
        Made where missing.
    """

    def __init__(self, path: Path):
        self.path = Path(path)
        self._lock: Any = None

    def chunk_file(self, number: int) -> Path:
        """The file of a chunk; its name never depends on who computed it, or when."""
        return self.path / f"chunk-{number:08d}.parquet"

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Held while a run writes here: a second run at the same time is refused.

        The lock is the operating system's and ends with the process, however that ends.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            file = _opened_lock(self.path / LOCK)
        except OSError as error:
            raise InvalidArgument(f"{self.path}: cannot be written to: {error.strerror}") from None
        with file:
            if not _lock(file):
                raise InvalidArgument(f"{self.path}: another sweep is writing here; wait, or take another folder")
            yield

    def begin(self, manifest: dict[str, Any], restart: bool) -> list[int]:
        """Start or continue a sweep: the numbers of finished chunks.

        Parameters
        ----------
        manifest : dict
            Of this run, with the keys of the form and ``chunks``.
        restart : bool
            Delete the files in the folder.

        Returns
        -------
        list of int
            Numbers of complete chunks.

        Raises
        ------
        InvalidArgument
            Naming the differences from the run begun here, and files of no sweep.
        """
        file = self.path / MANIFEST
        if restart and file.exists():
            self._remove_all()
        if not file.exists():
            strangers = [entry.name for entry in self.path.iterdir() if entry.name != LOCK]
            if strangers:
                raise InvalidArgument(
                    f"{self.path}: holds {listing(strangers, 4)} and is no folder of a sweep; choose another"
                )
            _write_whole(file, json.dumps(manifest, indent=1).encode())
            return []
        before = self.manifest()
        for key, complaint in _COMPARED.items():
            if before.get(key) != manifest[key]:
                raise InvalidArgument(
                    f"{self.path}: {complaint} since this sweep began: choose another folder, or --restart "
                    "(restart=True) to throw away what it has"
                )
        for leftover in self.path.glob(f"{PARTIAL}*"):  # of a run killed while writing
            leftover.unlink()
        return [number for number, _ in self.tables(manifest)]

    def manifest(self) -> dict[str, Any]:
        """The sweep's question, as begun. Raises SceneError for a folder without a manifest, or with a broken
        manifest.
        """
        file = self.path / MANIFEST
        if not file.exists():
            raise SceneError("is no folder of a sweep: it has no manifest", path=self.path)
        try:
            manifest = json.loads(read_text(file))
        except RecursionError:
            manifest = None
        except ValueError as error:
            if isinstance(error, SceneError):
                raise
            raise SceneError(f"is not JSON: {error}; --restart begins anew", path=file) from None
        if not _is_manifest(manifest):
            raise SceneError(f"is no manifest of a sweep in the form {SCHEMA}; --restart begins anew", path=file)
        return manifest

    def tables(self, manifest: dict[str, Any]) -> Iterator[tuple[int, Any]]:
        """(number, pyarrow.Table) of every complete chunk, in ascending order.

        Files appear whole. A file damaged later counts as missing and is made again: a chunk is known by its content,
        its number, the digest of the sweep's manifest and the digest of its own columns.
        """
        pyarrow, parquet = parquet_module()
        of_sweep = _digest_of(manifest)
        for file in sorted(self.path.glob("chunk-*.parquet")):
            number = _number_of(file)
            if number is None or file != self.chunk_file(number) or number >= manifest["chunks"]:
                continue
            try:
                table = None if file.is_symlink() or not file.is_file() else parquet.read_table(file)
            except (pyarrow.ArrowException, OSError, ValueError, MemoryError):
                table = None
            rows = min(manifest["chunk"], manifest["rows"] - number * manifest["chunk"])
            if table is not None and table.num_rows == rows and _is_chunk(table, number, of_sweep):
                yield number, table
            else:
                log.warning("%s is not the chunk that its name says, or damaged: it counts as missing", file)

    def write_chunk(self, number: int, columns: dict[str, Any], manifest: dict[str, Any]) -> None:
        """Write a chunk: under another name first, to the disk, and then in one step under its own."""
        pyarrow, parquet = parquet_module()
        table = pyarrow.table({name: _arrow_column(pyarrow, values) for name, values in columns.items()})
        table = table.replace_schema_metadata(_stamp(table, number, _digest_of(manifest)))
        sink = pyarrow.BufferOutputStream()
        parquet.write_table(table, sink)
        _write_whole(self.chunk_file(number), sink.getvalue())

    def _remove_all(self) -> None:
        for file in [*self.path.glob("chunk-*.parquet"), *self.path.glob(f"{PARTIAL}*"), self.path / MANIFEST]:
            file.unlink(missing_ok=True)


def _is_manifest(manifest: Any) -> bool:
    """Whether it has what a summary needs, in the form of this version."""
    if not isinstance(manifest, dict) or manifest.get("schema") != SCHEMA:
        return False
    counts: list[Any] = [manifest.get(key) for key in ("rows", "chunk", "chunks")]
    if not all(type(count) is int and 0 < count < 2**62 for count in counts):
        return False
    columns, (rows, chunk, chunks) = manifest.get("columns"), counts
    names = {"distances", "values"}
    is_fine = isinstance(columns, dict) and columns.keys() == names and all(type(columns[k]) is bool for k in names)
    return is_fine and chunks == -(-rows // chunk)


def _digest_of(manifest: dict[str, Any]) -> bytes:
    """Of all that a sweep asks: seed, rows, chunk, scene and robot."""
    return hashlib.sha256(json.dumps(manifest, sort_keys=True).encode()).hexdigest()[:32].encode()


def _number_of(file: Path) -> int | None:
    digits = file.stem.removeprefix("chunk-")
    return int(digits) if digits.isascii() and digits.isdigit() and len(digits) < 19 else None


def _stamp(table: Any, number: int, of_sweep: bytes) -> dict[bytes, bytes]:
    """What a chunk says of itself, beside its columns."""
    return {
        b"collide": SCHEMA.encode(), b"chunk": str(number).encode(), b"sweep": of_sweep,
        b"content": _content_digest(table),
    }


def _is_chunk(table: Any, number: int, of_sweep: bytes) -> bool:
    stamp = table.schema.metadata or {}
    return {key: stamp.get(key) for key in (b"collide", b"chunk", b"sweep", b"content")} == _stamp(
        table, number, of_sweep
    )


def _content_digest(table: Any) -> bytes:
    """Of names and values of all columns, whatever pages and dictionaries a file has them in."""
    pyarrow, _ = parquet_module()
    digest = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns):
        digest.update(f"{name} {len(column)}\n".encode())
        digest.update(column.is_null().to_numpy().tobytes())
        if pyarrow.types.is_dictionary(column.type) or pyarrow.types.is_string(column.type):
            # encoded anew, in the order in which texts first appear
            texts = column.cast(pyarrow.string()).combine_chunks().dictionary_encode()
            column = texts.indices
            digest.update(json.dumps(texts.dictionary.to_pylist()).encode())
        if column.null_count:
            column = column.fill_null(False if pyarrow.types.is_boolean(column.type) else 0)
        digest.update(f"{column.type}\n".encode() + column.to_numpy(zero_copy_only=False).tobytes())
    return digest.hexdigest()[:32].encode()


def _arrow_column(pyarrow, values):
    """Lists of text are dictionaries: of few different entries."""
    if isinstance(values, list):
        return pyarrow.array(values, pyarrow.string()).dictionary_encode()
    if isinstance(values, tuple):  # booleans, and which of them are answers
        return pyarrow.array(values[0], mask=~values[1])
    return pyarrow.array(values)


def _write_whole(file: Path, content) -> None:
    with whole_file(file, durable=True, follow=False, prefix=PARTIAL) as stream:
        stream.write(content)


def _opened_lock(place: Path) -> Any:
    """The file of the lock, made where missing; a link at its path is refused, since a link would choose the file."""
    flags = os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    if place.is_symlink() or (place.exists() and not place.is_file()):
        raise InvalidArgument(f"{place} is a link or no file: remove it, or take another folder")
    return open(os.open(place, flags, 0o666), "r+b")


def _lock(file) -> bool:
    """Take the operating system's lock of a file; False where another process has it."""
    try:
        import fcntl
    except ImportError:
        import msvcrt

        try:
            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
        except OSError:
            return False
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
