"""What a sweep has written: counts of all rows, and the rows themselves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, listing
from collide.sweeps.sweep_directory import SweepDirectory, parquet_module

#: Rows that a summary names.
_MAX_NAMED = 10


@dataclass(frozen=True)
class SweepResults:
    """The answers in a folder.

    Parameters
    ----------
    folder : Path
        Folder of the files ``chunk-00000000.parquet`` and so on.
    rows, done : int
        Number of all rows, and of rows in finished chunks.
    colliding, free : int
        Rows by their answers.
    unanswered : int
        Rows with NaN or infinity, or without poses.
    outside : int
        Answered rows outside the limits.
    named : list of (int, str)
        The first unanswered rows, then rows outside the limits, each with a note.
    least : (float, int, str, str) or ``None``
        Of sweeps with distances: the least [m], its row and its two bodies.
    """

    folder: Path
    rows: int
    done: int
    colliding: int
    free: int
    unanswered: int
    outside: int
    named: list[tuple[int, str]]
    least: tuple[float, int, str, str] | None

    def table(self, columns: list[str] | None = None) -> Any:
        """The rows, in their order.

        Parameters
        ----------
        columns : list of str, optional
            By default all: ``row``, ``scene`` (of several), ``collides`` (null without an answer), ``distance``,
            ``body_a`` and ``body_b`` (of sweeps with distances), ``note``, joints (of sweeps with values).

        Returns
        -------
        pyarrow.Table
            The chunks in sequence.
        """
        return _read(self.folder, columns)

    def collides(self) -> np.ndarray:
        """The verdicts.

        Returns
        -------
        (rows,) bool
            In the order of the rows.

        Raises
        ------
        InvalidArgument
            Where rows have no answer: `table` has nulls there.
        """
        if self.unanswered or self.done < self.rows:
            raise InvalidArgument(
                f"{self.folder}: {self.unanswered + self.rows - self.done} rows have no answer: "
                "take table()['collides'], which has nulls there"
            )
        return _read(self.folder, ["collides"]).column("collides").to_numpy()


def read_sweep(folder: str | Path) -> SweepResults:
    """The answers in a folder, of a finished or unfinished sweep.

    Parameters
    ----------
    folder : str or Path
        Of a sweep.

    Returns
    -------
    SweepResults
        Counts; its ``table`` has the rows.

    Raises
    ------
    SceneError
        For any other folder.
    MissingExtra
        Where pyarrow is not installed.
    """
    folder = checks.file_path("read_sweep: folder", folder)
    directory = SweepDirectory(folder)
    manifest = directory.manifest()
    counts = _Counts(manifest["columns"]["distances"])
    for _, table in directory.tables(manifest):
        counts.add(table)
    first = [*counts.no_answer, *counts.outside][:_MAX_NAMED]
    return SweepResults(
        folder, manifest["rows"], counts.done, counts.colliding, counts.done - counts.n_no_answer - counts.colliding,
        counts.n_no_answer, counts.n_outside, first, counts.least,
    )


class _Counts:
    """What a summary says, chunk by chunk: a sweep may be larger than memory."""

    def __init__(self, with_distances: bool):
        self._with_distances = with_distances
        self.done = self.colliding = self.n_no_answer = self.n_outside = 0
        self.no_answer: list[tuple[int, str]] = []
        self.outside: list[tuple[int, str]] = []
        self.least: tuple[float, int, str, str] | None = None

    def add(self, table: Any) -> None:
        """Count a chunk."""
        is_answer = ~table["collides"].is_null().to_numpy()
        has_note = ~table["note"].is_null().to_numpy()
        self.done += table.num_rows
        self.colliding += int(table["collides"].fill_null(False).to_numpy().sum())
        self.n_no_answer += int((~is_answer).sum())
        self.n_outside += int((is_answer & has_note).sum())
        for named, rows in ((self.no_answer, ~is_answer), (self.outside, is_answer & has_note)):
            first = np.flatnonzero(rows)[:_MAX_NAMED].tolist()
            named += [(table["row"][k].as_py(), table["note"][k].as_py()) for k in first]
            del named[_MAX_NAMED:]
        if self._with_distances:
            self._look_for_least(table)

    def _look_for_least(self, table) -> None:
        distance = table["distance"].to_numpy()
        if np.isfinite(distance).any():
            k = int(np.nanargmin(distance))
            if self.least is None or distance[k] < self.least[0]:
                row, a, b = (table[name][k].as_py() for name in ("row", "body_a", "body_b"))
                self.least = float(distance[k]), row, a, b


def _read(folder: Path, columns: list[str] | None) -> Any:
    pyarrow, _ = parquet_module()
    directory = SweepDirectory(folder)
    wanted = None if columns is None else list(columns)
    tables = []
    for _, table in directory.tables(directory.manifest()):
        names = table.column_names
        if wanted is not None and (strangers := [name for name in wanted if name not in names]):
            raise InvalidArgument(f"{folder}: no column {listing(strangers)}; it has {listing(names)}")
        tables.append((table if wanted is None else table.select(wanted)).replace_schema_metadata(None))
    if not tables:
        raise InvalidArgument(f"{folder}: no chunk is done yet")
    return pyarrow.concat_tables(tables).unify_dictionaries()
