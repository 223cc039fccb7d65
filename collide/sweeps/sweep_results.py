"""What a sweep has written: counts of all rows, and the rows themselves."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
        Where they are: ``chunk-00000000.parquet`` and so on.
    rows, done : int
        Of all, and those in chunks that are there.
    colliding, free : int
        Rows by their answers.
    unanswered : int
        Rows that are not numbers, or have no pose.
    outside : int
        Rows that are answered and outside the limits.
    named : list of (int, str)
        The first rows that are unanswered, then those that are outside, and what is to be said of them.
    least : (float, int, str, str) or None
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
            By default all: ``row``, ``scene`` (of several), ``collides`` (null where there is no answer), ``distance``,
            ``body_a`` and ``body_b`` (of sweeps with distances), ``note``, joints (of sweeps with values).

        Returns
        -------
        pyarrow.Table
            The chunks one after the other.
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
    """The answers that a folder holds, be the sweep done or not.

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
        Where it is no folder of a sweep.
    MissingExtra
        Where pyarrow is not installed.
    """
    pyarrow, _ = parquet_module()
    from pyarrow import compute

    folder = Path(folder)
    manifest = SweepDirectory(folder).manifest()
    with_distances = manifest["columns"]["distances"]
    table = _read(folder, ["row", "collides", "note", *(["distance", "body_a", "body_b"] if with_distances else [])])
    colliding = compute.sum(table["collides"]).as_py() or 0
    unanswered = table["collides"].null_count
    noted = table.select(["row", "note"]).filter(compute.is_valid(table["note"]))
    no_answer = table.select(["row", "note"]).filter(compute.is_null(table["collides"]))
    first = pyarrow.concat_tables([no_answer.slice(0, _MAX_NAMED), noted.slice(0, 2 * _MAX_NAMED)]).to_pydict()
    return SweepResults(
        folder, manifest["rows"], table.num_rows, colliding, table.num_rows - unanswered - colliding, unanswered,
        noted.num_rows - unanswered, list(dict.fromkeys(zip(first["row"], first["note"])))[:_MAX_NAMED],
        _least(table) if with_distances else None,
    )  # fmt: skip


def _least(table) -> tuple[float, int, str, str] | None:
    distance = table["distance"].to_numpy()
    if not np.isfinite(distance).any():
        return None
    k = int(np.nanargmin(distance))
    return float(distance[k]), *(table[name][k].as_py() for name in ("row", "body_a", "body_b"))


def _read(folder: Path, columns: list[str] | None) -> Any:
    pyarrow, parquet = parquet_module()
    files = sorted(folder.glob("chunk-*.parquet"))
    if not files:
        raise InvalidArgument(f"{folder}: no chunk is done yet")
    wanted = None if columns is None else list(columns)
    names = parquet.read_schema(files[0]).names
    if wanted is not None and (strangers := [name for name in wanted if name not in names]):
        raise InvalidArgument(f"{folder}: no column {listing(strangers)}; it has {listing(names)}")
    return pyarrow.concat_tables([parquet.read_table(file, columns=wanted) for file in files]).unify_dictionaries()
