"""The configurations of a sweep: drawn, in memory, or in a file; blocks of them are made when they are needed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, MissingExtra, SceneError, brief, listing
from collide.robots.robot import Robot
from collide.sweeps.content_digest import digest
from collide.sweeps.random_configurations import random_configurations

#: Endings of files of configurations.
SUFFIXES = (".npy", ".csv", ".parquet")
_DIGEST_ROWS = 1_000_000
#: Numbers of one array of drawn configurations: 16 GiB.
_MAX_DRAWN = 2**31


class DrawnConfigurations:
    """Random configurations of a seed: each process draws its own blocks, so that no rows are sent.

    Parameters
    ----------
    rows : int
        Number of rows, at least 1.
    seed : int
        Not negative; other seeds draw other rows. A row does not depend on the number of rows.

    Raises
    ------
    InvalidArgument
        For numbers out of range.
    """

    def __init__(self, rows: int, seed: int = 0):
        self.rows = checks.integer("DrawnConfigurations: rows", rows, 1)
        self.seed = checks.integer("DrawnConfigurations: seed", seed, 0)

    def of(self, robot: Robot) -> np.ndarray:
        """All of them, for a robot.

        Parameters
        ----------
        robot : Robot
            Whose limits are kept to.

        Returns
        -------
        (rows, dof) float64
            [rad or m], columns as in `Robot.joint_names`.

        Raises
        ------
        InvalidArgument
            For what is no robot, and for more rows than memory holds.
        """
        checks.instance("DrawnConfigurations.of: robot", robot, Robot, "a collide.Robot")
        if self.rows * max(robot.dof, 1) > _MAX_DRAWN:
            raise InvalidArgument(f"{brief(self.rows)} rows are too many for memory: draw blocks")
        return random_configurations(robot, 0, self.rows, self.seed)

    def about(self) -> dict[str, Any]:
        """What a sweep must find unchanged to go on.

        Returns
        -------
        dict
            Plain data.
        """
        return {"random": self.rows, "seed": self.seed}

    def block(self, start: int, stop: int) -> DrawnBlock:
        """Rows start to stop, to be drawn later.

        Parameters
        ----------
        start, stop : int
            The first row, and the row after the last.

        Returns
        -------
        DrawnBlock
            Small: the answering process draws the rows.
        """
        start, stop = checks.integer("block: start", start, 0), checks.integer("block: stop", stop, 0)
        return DrawnBlock(start, stop, self.seed)


class DrawnBlock:
    """Rows of random configurations, drawn when asked for."""

    def __init__(self, start: int, stop: int, seed: int):
        self.start, self.stop, self.seed = start, stop, seed

    def of(self, robot: Robot) -> np.ndarray:
        """(n, dof) float64 configurations."""
        return random_configurations(robot, self.start, self.stop, self.seed)


class GivenConfigurations:
    """An array of configurations, or a file mapped as one.

    Q : (N, dof) float64, NaN allowed.   source : where they come from, for messages.
    """

    def __init__(self, Q: np.ndarray, source: str = "the array"):
        self.Q, self.rows, self.source = Q, len(Q), source
        self._digest: str | None = None

    def about(self) -> dict[str, Any]:
        """What a sweep must find unchanged to go on."""
        if self._digest is None:
            steps = range(0, max(self.rows, 1), _DIGEST_ROWS)
            self._digest = digest(*(np.asarray(self.Q[k : k + _DIGEST_ROWS], dtype=np.float64) for k in steps))
        return {"rows": self.rows, "digest": self._digest}

    def block(self, start: int, stop: int) -> GivenBlock:
        """Rows start to stop, a copy."""
        return GivenBlock(np.array(self.Q[start:stop], dtype=np.float64))


class GivenBlock:
    """Rows of configurations that travel with the question."""

    def __init__(self, Q: np.ndarray):
        self.Q = Q

    def of(self, robot: Robot) -> np.ndarray:
        """(n, dof) float64 configurations."""
        return self.Q


def as_configurations(value, robot: Robot) -> DrawnConfigurations | GivenConfigurations:
    """Configurations from what a caller has: an array (N, dof), a path, or drawn ones as they are.

    Raises InvalidArgument for another width, SceneError for what cannot be read.
    """
    if isinstance(value, (DrawnConfigurations, GivenConfigurations)):
        return value
    if isinstance(value, (str, Path)):
        return read_configurations(Path(value), robot)
    Q = checks.array("configurations", value, f"(N, {robot.dof})", InvalidArgument)
    _check_width(Q, robot, "configurations")
    return GivenConfigurations(Q)


def _check_width(Q: np.ndarray, robot: Robot, what: str) -> None:
    if Q.ndim != 2 or Q.shape[1] != robot.dof:
        raise InvalidArgument(
            f"{what} must have shape (N, {robot.dof}), one column for each of {listing(robot.joint_names)} of robot "
            f"{robot.name}; got {Q.shape}"
        )


def read_configurations(path: Path, robot: Robot) -> GivenConfigurations:
    """Configurations from a file.

    Parameters
    ----------
    path : Path
        ``.npy``, an array (N, dof) in the order of `Robot.joint_names`; ``.csv`` or ``.parquet``, a column for each
        joint, by name and in any order; what is not a joint is refused. Empty cells and "nan" are NaN.
    robot : Robot
        Whose joints.

    Returns
    -------
    GivenConfigurations
        A ``.npy`` file is mapped, not read.

    Raises
    ------
    SceneError
        Naming file, row or column of what cannot be read.
    MissingExtra
        Where Parquet is asked for and pyarrow is not installed.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise SceneError(f"configurations are read from {', '.join(SUFFIXES)}, got {brief(path.name)}", path=path)
    if not path.is_file():
        raise SceneError("there is no such file", path=path)
    try:
        Q = {".npy": _read_npy, ".csv": _read_csv, ".parquet": _read_parquet}[suffix](path, robot)
        _check_width(Q, robot, "configurations")
    except InvalidArgument as error:
        raise SceneError(str(error), path=path) from None
    return GivenConfigurations(Q, str(path))


def _read_npy(path: Path, robot: Robot) -> np.ndarray:
    try:
        Q = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise SceneError(f"is no array of numbers: {error}", path=path) from None
    if Q.dtype.kind not in "fiu":
        raise SceneError(f"must hold real numbers, got {Q.dtype}", path=path)
    return Q


def _read_csv(path: Path, robot: Robot) -> np.ndarray:
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        header = [name.strip().strip('"') for name in file.readline().split(",")]
        order = _order(header, robot, path)
        rows = []
        for number, line in enumerate(file, 2):
            cells = line.rstrip("\r\n").split(",")
            if line.isspace() and len(header) > 1:
                continue
            if len(cells) != len(header):
                raise SceneError(
                    f"has {len(cells)} values, the header {len(header)} columns", path=path, element=f"line {number}"
                )
            try:
                rows.append([float(cells[k].strip() or "nan") for k in order])
            except ValueError:
                wrong = next(cells[k] for k in order if not _is_number(cells[k]))
                raise SceneError(f"must be numbers, got {brief(wrong)}", path=path, element=f"line {number}") from None
    return np.array(rows, dtype=np.float64).reshape(len(rows), len(order))


def _is_number(text: str) -> bool:
    try:
        float(text.strip() or "nan")
    except ValueError:
        return False
    return True


def _read_parquet(path: Path, robot: Robot) -> np.ndarray:
    try:
        from pyarrow import ArrowException, parquet
    except ImportError:
        raise MissingExtra("pyarrow", extra="sweep", purpose="read Parquet files") from None
    try:
        table = parquet.read_table(path)
        order = _order(table.column_names, robot, path)
        columns = [table.column(k).to_numpy(zero_copy_only=False).astype(np.float64) for k in order]
    except (ArrowException, OSError, TypeError, ValueError) as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(f"is no table of numbers: {error}", path=path) from None
    return np.stack(columns, axis=1) if columns else np.zeros((table.num_rows, 0))


def _order(names: list[str], robot: Robot, path: Path) -> list[int]:
    """Where each joint of the robot stands among the columns."""
    missing = [name for name in robot.joint_names if name not in names]
    strangers = [name for name in names if name not in robot.joint_names]
    repeated = [name for k, name in enumerate(names) if name in names[:k]]
    for what, wrong in (("lacks columns for", missing), ("has columns that are no joints:", strangers),
                        ("names columns twice:", repeated)):
        if wrong:
            raise SceneError(f"{what} {listing(wrong)}; robot {robot.name} has {listing(robot.joint_names)}", path=path)
    return [names.index(name) for name in robot.joint_names]
