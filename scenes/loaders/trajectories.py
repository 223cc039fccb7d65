"""Trajectories from CSV, YAML or JSON: joint values by joint name, waypoint after waypoint."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from collide.errors import SceneError
from collide.scenes.loaders.documents import read_document, read_text
from collide.scenes.loaders.fields import Fields, brief
from collide.scenes.loaders.states import state_of

#: What the column, or key, of times is called.
TIMES = ("time", "time_from_start", "t")
FORMS = (
    "a CSV file of joint names and values, a list of {joint: value}, {joint: [values]}, "
    "or ROS's JointTrajectory (joint_names and points)"
)


@dataclass(frozen=True)
class Trajectory:
    """Waypoints to go through in a straight line of joint values, one after the other.

    waypoints : joint -> value [rad] or [m]; joints that a waypoint does not name keep their value.
    times : of each waypoint [s], rising; None where the file gives none.
    """

    source: str
    waypoints: list[dict[str, float]]
    times: list[float] | None = None


def read_trajectory(path) -> Trajectory:
    """A trajectory from a file.

    Accepted: CSV with a header of joint names; YAML or JSON holding a list of ``{joint: value}``, a mapping of
    joints to lists of values, or ``joint_names`` beside ``points`` with ``positions``, as ROS and MoveIt print a
    JointTrajectory, also under ``joint_trajectory`` or ``trajectory``. Times, where there are any: a column ``time``,
        or
    ``time_from_start``.

    Raises SceneError naming file, row or element, and value.
    """
    path = Path(path)
    rows = _read_csv(path) if path.suffix.lower() in (".csv", ".tsv", ".txt") else _rows(read_document(path), path, "")
    if not rows:
        raise SceneError(f"holds no waypoint; a trajectory is {FORMS}", path=path)
    times = [row.pop(_TIME) for row in rows if _TIME in row]
    if len(times) < len(rows):
        return Trajectory(str(path), rows)
    for k, (before, after) in enumerate(pairwise(times)):
        if after < before:
            raise SceneError(
                f"times must rise, got {after:g} s after {before:g} s", path=path, element=f"waypoint {k + 1}"
            )
    return Trajectory(str(path), rows, times)


#: Where a waypoint keeps its time until all of them are read; no joint has an empty name.
_TIME = ""


def _read_csv(path: Path) -> list[dict[str, float]]:
    lines = [line for line in read_text(path).splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if not lines:
        return []
    delimiter = next((mark for mark in ("\t", ";") if mark in lines[0]), ",")
    try:
        header, *body = (list(map(str.strip, row)) for row in csv.reader(lines, delimiter=delimiter))
    except csv.Error as error:  # a field of more than 131,072 characters, and what else is no table
        raise SceneError(f"is no CSV: {error}", path=path) from None
    if len(set(header)) != len(header) or not all(header):
        raise SceneError(f"the first line must name every column once, got {brief(header)}", path=path)
    rows = []
    for k, cells in enumerate(body):
        if len(cells) != len(header):
            raise SceneError(
                f"has {len(cells)} values, the header {len(header)} columns", path=path, element=f"row {k + 1}"
            )
        values = {name: _number(cell, path, f'row {k + 1} "{name}"') for name, cell in zip(header, cells)}
        rows.append(_timed(values))
    return rows


def _number(text: str, path: Path, element: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise SceneError(f"must be a finite number, got {text!r}", path=path, element=element)
    return value


def _timed(values: dict[str, float]) -> dict[str, float]:
    """The waypoint with its time, if it has one, under `_TIME`."""
    name = next((name for name in TIMES if name in values), None)
    return values if name is None else {_TIME: values.pop(name), **values}


def _rows(data: Any, path: Path, element: str) -> list[dict[str, float]]:
    """The waypoints that a piece of a document holds."""
    if isinstance(data, list):
        return [row for k, entry in enumerate(data) for row in _entry(entry, path, f"{element}[{k}]")]
    fields = Fields(data, path, element)
    several = fields.get("multi_dof_joint_trajectory")
    if isinstance(several, Mapping) and several.get("points"):
        fields.fail(
            "joints of several degrees of freedom are not read: give their values by column",
            "multi_dof_joint_trajectory",
        )
    for key in ("trajectory", "joint_trajectory", "waypoints"):
        if key in fields:
            return _rows(data[key], path, fields.place(key))
    if "points" in fields:
        return _points(fields)
    return _columns(fields)


def _entry(entry: Any, path: Path, element: str) -> list[dict[str, float]]:
    """One entry of a list: a waypoint, or a trajectory of its own."""
    if isinstance(entry, Mapping) and not {"joint_trajectory", "points", "multi_dof_joint_trajectory"} & entry.keys():
        timed = next((key for key in TIMES if key in entry), None)
        values = state_of({key: value for key, value in entry.items() if key != timed}, path, element)
        return [values if timed is None else {_TIME: _seconds(Fields(entry, path, element), timed), **values}]
    return _rows(entry, path, element)


def _points(fields: Fields) -> list[dict[str, float]]:
    names = fields.get("joint_names")
    if not isinstance(names, list) or not names:
        fields.fail(f"must list the joints, got {brief(names)}", "joint_names")
    rows = []
    for data, place in fields.items("points"):
        point = Fields(data, fields.path, place)
        values = point.get("positions")
        if not isinstance(values, list) or len(values) != len(names):
            point.fail(f"must hold one value for each of the {len(names)} joints, got {brief(values)}", "positions")
        row = {str(name): point.checked_number(value, "positions") for name, value in zip(names, values)}
        rows.append({_TIME: _seconds(point, "time_from_start"), **row} if "time_from_start" in point else row)
    return rows


def _seconds(fields: Fields, key: str) -> float:
    """A number of seconds, or ROS's {secs, nsecs} or {sec, nanosec}."""
    value = fields.get(key)
    if not isinstance(value, Mapping):
        return fields.checked_number(value, key)
    parts = Fields(value, fields.path, fields.place(key))
    whole, rest = (
        next((n for n in names if n in parts), names[0]) for names in (("secs", "sec"), ("nsecs", "nanosec"))
    )
    return parts.number(whole, 0.0) + 1e-9 * parts.number(rest, 0.0)


def _columns(fields: Fields) -> list[dict[str, float]]:
    columns = {str(name): values for name, values in fields.data.items()}
    lengths = {len(values) if isinstance(values, list) else -1 for values in columns.values()}
    if len(lengths) != 1 or -1 in lengths:
        fields.fail(f"is no trajectory: it must be {FORMS}")
    rows = zip(*([fields.checked_number(value, name) for value in values] for name, values in columns.items()))
    return [_timed(dict(zip(columns, row))) for row in rows]
