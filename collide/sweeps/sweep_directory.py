"""The folder of a sweep: a manifest, a lock, and a Parquet file for each chunk, written once, whole or not at all."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from collide.errors import InvalidArgument, MissingExtra, SceneError, listing
from collide.whole_file import whole_file

#: Readers of Parquet leave out what begins with an underscore, so that the folder is one table to them.
MANIFEST, LOCK, PARTIAL = "_sweep.json", "_sweep.lock", "_partial-"
SCHEMA = "collide-sweep/1"
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
    """Where a sweep keeps what it has done.

    Parameters
    ----------
    path : Path
        Made where it is not there.
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
            file = open(self.path / LOCK, "a+b")  # noqa: SIM115 - closed below
        except OSError as error:
            raise InvalidArgument(f"{self.path}: cannot be written to: {error.strerror}") from None
        with file:
            if not _lock(file):
                raise InvalidArgument(f"{self.path}: another sweep is writing here; wait, or take another folder")
            yield

    def begin(self, manifest: dict[str, Any], restart: bool) -> list[int]:
        """Start, or go on: which chunks are done.

        Parameters
        ----------
        manifest : dict
            Of this run, with the keys of the form and ``chunks``.
        restart : bool
            Throw away what is there.

        Returns
        -------
        list of int
            Numbers of chunks that are complete.

        Raises
        ------
        InvalidArgument
            Naming what differs from the run that began here, and where files are there that are no sweep's.
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
        for leftover in self.path.glob(f"{PARTIAL}*"):  # of a run that was killed while it wrote
            leftover.unlink()
        return [number for number in range(manifest["chunks"]) if self._is_complete(number, manifest)]

    def manifest(self) -> dict[str, Any]:
        """What the sweep asks, as it began."""
        file = self.path / MANIFEST
        try:
            return json.loads(file.read_text(encoding="utf-8"))
        except OSError:
            raise SceneError("is no folder of a sweep: it has no manifest", path=self.path) from None
        except ValueError as error:
            raise SceneError(f"is not JSON: {error}; --restart begins anew", path=file) from None

    def _is_complete(self, number: int, manifest: dict[str, Any]) -> bool:
        """Files appear whole; what a disk or a person did to one later makes it missing, and it is made again."""
        file = self.chunk_file(number)
        if not file.exists():
            return False
        pyarrow, parquet = parquet_module()
        try:
            rows = parquet.read_metadata(file).num_rows
        except (pyarrow.ArrowException, OSError):
            return False
        return rows == min(manifest["chunk"], manifest["rows"] - number * manifest["chunk"])

    def write_chunk(self, number: int, columns: dict[str, Any]) -> None:
        """Write a chunk: under another name first, to the disk, and then in one step under its own."""
        pyarrow, parquet = parquet_module()
        table = pyarrow.table(
            {name: _arrow_column(pyarrow, values) for name, values in columns.items()},
            metadata={b"collide": SCHEMA.encode(), b"chunk": str(number).encode()},
        )
        sink = pyarrow.BufferOutputStream()
        parquet.write_table(table, sink)
        _write_whole(self.chunk_file(number), sink.getvalue())

    def _remove_all(self) -> None:
        for file in [*self.path.glob("chunk-*.parquet"), *self.path.glob(f"{PARTIAL}*"), self.path / MANIFEST]:
            file.unlink(missing_ok=True)


def _arrow_column(pyarrow, values):
    """Lists of text are dictionaries: of few different entries."""
    if isinstance(values, list):
        return pyarrow.array(values, pyarrow.string()).dictionary_encode()
    if isinstance(values, tuple):  # booleans, and which of them are answers
        return pyarrow.array(values[0], mask=~values[1])
    return pyarrow.array(values)


def _write_whole(file: Path, content) -> None:
    with whole_file(file, durable=True, prefix=PARTIAL) as stream:
        stream.write(content)


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
