"""Sweeps: many configurations asked in processes or on Dask, in chunks that are written once, and gone on with."""

from __future__ import annotations

import json
import math
import os
import time
from collections.abc import Callable, Iterator
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

from collide import __version__
from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, SceneError, brief
from collide.robots.robot import Robot
from collide.sweeps.configurations import DrawnConfigurations, GivenConfigurations, as_configurations
from collide.sweeps.content_digest import digest
from collide.sweeps.dask_pool import DaskPool
from collide.sweeps.process_pool import ProcessPool
from collide.sweeps.sweep_directory import SCHEMA, SweepDirectory, parquet_module
from collide.sweeps.sweep_question import CHANGED, Chunk, OneQuestion, ScenesQuestion, question_digest
from collide.sweeps.sweep_results import SweepResults, read_sweep

#: Rows of a chunk where nobody says how many: small sweeps have chunks enough for many workers.
_MIN_CHUNK, _MAX_CHUNK, _AIMED_CHUNKS = 500, 50_000, 64
#: Of processes, of chunks, and of rows of one: numbers of chunks are listed, and the rows of a chunk are in memory.
MAX_WORKERS = 10_000
MAX_CHUNKS, MAX_CHUNK_ROWS = 1_000_000, 10_000_000
#: Time between two checks for a changed scene [s].
_LOOK_EVERY = 1.0


def sweep(
    checker: Any, configurations: Any, folder: str | Path, *, distances: bool = False, values: bool = False,
    workers: int | None = None, scheduler: Any = None, chunk: int | None = None, restart: bool = False,
    progress: Callable | None = None,
) -> SweepResults:
    """Ask a checker about many configurations, in processes or on Dask, and write the answers as Parquet.

    The rows are split into chunks, with numbers and files independent of the answering process. Each is written once,
    whole. An unfinished run is continued by the same call: only missing chunks are asked.

    Parameters
    ----------
    checker : RobotChecker
        Robot and surroundings. Sent to the workers once, in the present state.
    configurations : (N, dof) array_like, str, Path or DrawnConfigurations
        Rows [rad or m] in the order of `Robot.joint_names`; a .npy, .csv or .parquet file; or
        ``DrawnConfigurations(rows, seed)``. Rows with numbers not finite get no answer and are named; rows outside the
        limits are answered and named.
    folder : str or Path
        Folder of the files; made where missing.
    distances : bool
        Write the least distance and its two bodies, too.
    values : bool
        Write the configurations, too.
    workers : int, optional
        Processes of this machine, by default a process for each core; 0 answers in this process.
    scheduler : str or distributed.Client, optional
        Dask: an address or a client; its workers answer, this process writes.
    chunk : int, optional
        Rows of a chunk.
    restart : bool
        Delete files of a former run in the folder.
    progress : callable, optional
        ``with progress(label) as rename``: called with the share done, the speed, and the time left.

    Returns
    -------
    SweepResults
        The answers in the folder: counts, and the rows.

    Raises
    ------
    InvalidArgument
        For configurations of another width, and where the folder holds the answers of another question.
    SceneError
        Where the scene changed while the sweep ran.
    MissingExtra
        Without pyarrow, and for Dask without distributed.
    """
    if not isinstance(getattr(checker, "robot", None), Robot):
        raise InvalidArgument(f"sweep: checker must be a RobotChecker, got {brief(checker)}")
    folder, restart = checks.file_path("sweep: folder", folder), checks.true_or_false("sweep: restart", restart)
    Q = as_configurations(configurations, checker.robot)
    distances = checks.true_or_false("sweep: distances", distances)
    question = OneQuestion(checker, distances, checks.true_or_false("sweep: values", values))
    run = SweepRun(question, 1, Q, folder, lambda final: question_digest(checker), chunk=chunk)
    return run.go(workers=workers, scheduler=scheduler, restart=restart, progress=progress)


class SweepRun:
    """A run of a sweep.

    question : `OneQuestion` or `ScenesQuestion`.   n_scenes : number of scenes.
    configurations : asked in every scene; ``None``: each scene has its own.
    look : called with whether the call is the last; returns the digest of the question in its present state.
    """

    def __init__(
        self, question: OneQuestion | ScenesQuestion, n_scenes: int,
        configurations: DrawnConfigurations | GivenConfigurations | None, folder: str | Path,
        look: Callable[[bool], str], *, chunk: int | None = None, about: dict[str, Any] | None = None,
    ):
        self.question, self.n_scenes, self.Q, self.look = question, n_scenes, configurations, look
        self.rows_each = 1 if configurations is None else configurations.rows
        self.rows = n_scenes * self.rows_each
        if self.rows == 0:
            raise InvalidArgument("there are no configurations to ask about")
        self.directory = SweepDirectory(Path(folder))
        self.chunk = self._chunk_rows(chunk)
        self.digest = look(False)
        self.manifest = self._manifest(about or {})

    def _chunk_rows(self, chunk: int | None) -> int:
        if chunk is not None:
            rows = checks.integer("chunk", chunk, 1)
        else:
            rows = min(max(-(-self.rows // _AIMED_CHUNKS), _MIN_CHUNK), _MAX_CHUNK)
        if rows > MAX_CHUNK_ROWS:
            raise InvalidArgument(
                f"chunk must be at most {MAX_CHUNK_ROWS:,} rows, which are in memory, got {brief(rows)}"
            )
        if self.rows > rows * MAX_CHUNKS:
            raise InvalidArgument(
                f"{brief(self.rows)} rows are more than {MAX_CHUNKS:,} chunks of {rows:,}: ask fewer, or take larger "
                f"chunks, of at most {MAX_CHUNK_ROWS:,} rows (--chunk, chunk=)"
            )
        return rows

    def _manifest(self, about: dict[str, Any]) -> dict[str, Any]:
        question = self.question
        joints = list(question.robot.joint_names) if isinstance(question, OneQuestion) else None
        manifest = {
            "schema": SCHEMA, "version": __version__, **about, "question": self.digest,
            "configurations": None if self.Q is None else self.Q.about(), "joints": joints,
            "columns": {"distances": question.distances, "values": question.values}, "rows": self.rows,
            "chunk": self.chunk, "chunks": -(-self.rows // self.chunk),
        }
        return json.loads(json.dumps(manifest))

    def go(
        self, *, workers: int | None = None, scheduler: Any = None, restart: bool = False,
        progress: Callable | None = None,
    ) -> SweepResults:
        """Ask what is missing, and give everything."""
        if workers is not None:
            checks.integer("workers", workers, 0)
            if workers > MAX_WORKERS:
                raise InvalidArgument(f"workers must be at most {MAX_WORKERS:,} processes, got {brief(workers)}")
        parquet_module()
        with self.directory.locked(), (progress or _silent)("sweeping") as rename:
            done = set(self.directory.begin(self.manifest, restart))
            missing = [number for number in range(self.manifest["chunks"]) if number not in done]
            if missing:
                with closing(self._pool(workers, scheduler, len(missing))) as pool:
                    self._ask(pool, missing, rename or (lambda label: None))
            self._refuse_change(final=True)
        return read_sweep(self.directory.path)

    def _pool(self, workers: int | None, scheduler: Any, n_missing: int) -> Any:
        if scheduler is not None:
            return DaskPool(self.question, scheduler, digest(self.manifest))
        if workers == 0:
            return _ThisProcess(self.question)
        return ProcessPool(self.question, min(workers or os.cpu_count() or 1, n_missing))

    def _ask(self, pool: Any, missing: list[int], rename: Callable[[str], None]) -> None:
        pace, looked = _Pace(self.rows, self._rows_of(missing)), time.monotonic()
        rename(str(pace))
        for chunk, columns in pool.answers(map(self._chunk_of, missing)):
            self.directory.write_chunk(chunk.number, columns, self.manifest)
            rename(pace.after(chunk.stop - chunk.start))
            if time.monotonic() - looked > _LOOK_EVERY:
                self._refuse_change(final=False)
                looked = time.monotonic()

    def _rows_of(self, numbers: list[int]) -> int:
        return sum(min(self.chunk, self.rows - number * self.chunk) for number in numbers)

    def _chunk_of(self, number: int) -> Chunk:
        start = number * self.chunk
        stop = min(start + self.chunk, self.rows)
        blocks = []
        for scene in range(start // self.rows_each, (stop - 1) // self.rows_each + 1):
            first = scene * self.rows_each
            rows = max(start - first, 0), min(stop - first, self.rows_each)
            blocks.append((scene, None if self.Q is None else self.Q.block(*rows)))
        return Chunk(number, start, stop, blocks)

    def _refuse_change(self, final: bool) -> None:
        if self.look(final) != self.digest:
            raise SceneError(f"the scene {CHANGED}", path=self.directory.path)


class _ThisProcess:
    """Chunks answered where they are asked."""

    n_workers = 0

    def __init__(self, question: Any):
        self._question = question

    def answers(self, chunks: Iterator) -> Iterator[tuple[Any, Any]]:
        return ((chunk, self._question.answer(chunk)) for chunk in chunks)

    def close(self) -> None:
        """Nothing is open."""


class _Pace:
    """How far, how fast, how long: rows of all, of which so many are missing when the run begins."""

    def __init__(self, rows: int, missing: int):
        self._rows, self._missing, self._answered, self._started = rows, missing, 0, time.monotonic()

    def after(self, rows: int) -> str:
        self._answered += rows
        return str(self)

    def __str__(self) -> str:
        done = self._rows - self._missing + self._answered
        text = f"sweeping: {done:,} of {self._rows:,} rows"
        seconds = time.monotonic() - self._started
        if not self._answered or seconds <= 0:
            return text
        rate = self._answered / seconds
        return f"{text}, {rate:,.0f}/s, {_duration((self._missing - self._answered) / rate)} to go"


def _duration(seconds: float) -> str:
    whole = math.ceil(seconds)
    if whole < 100:
        return f"{whole} s"
    return f"{whole // 60} min" if whole < 6000 else f"{whole // 3600} h {whole // 60 % 60} min"


def _silent(label: str):
    return nullcontext()
