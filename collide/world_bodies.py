"""The bodies of a World in columns: adding, moving and naming them makes no object a body.

A `Body` is made when somebody asks for one. What a query answers about is a `Roster`, which no change of the World
reaches: results stay true of the bodies as they stood.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from collide import argument_checks as checks
from collide.errors import InvalidArgument, InvalidPose, UnknownBody
from collide.shapes.shape import Shape
from collide.transforms import as_pose, as_poses

#: Groups and masks are bit sets of this many bits.
_BITS = 32
_IDENTITY = np.eye(4)


@dataclass(frozen=True)
class Body:
    """One body of a World, as it stands now.

    Parameters
    ----------
    id : never used again in this World.   name : unique in it.
    shape : any shape.   X_WB : (4, 4) its pose in the world [m], read-only.
    static : never tested against other static bodies.   group, mask : bit sets of 32 bits.
    """

    id: int
    name: str
    shape: Shape
    X_WB: np.ndarray
    static: bool
    group: int
    mask: int

    def __post_init__(self) -> None:
        self.X_WB.flags.writeable = False  # of a copy as well

    def __reduce__(self):
        return Body, (self.id, self.name, self.shape, self.X_WB, self.static, self.group, self.mask)


class Roster(NamedTuple):
    """Bodies by position, in the order of their ids: what stays while bodies only move. Never changed once made.

    ids : (n,) int32, ascending.   names, shapes : of each.   static, group, mask : (n,) int64.
    """

    ids: np.ndarray
    names: list[str]
    shapes: list[Shape]
    static: np.ndarray
    group: np.ndarray
    mask: np.ndarray

    def body(self, position: int, X_WB: np.ndarray) -> Body:
        return Body(
            int(self.ids[position]), self.names[position], self.shapes[position], X_WB.copy(),
            bool(self.static[position]), int(self.group[position]), int(self.mask[position]),
        )  # fmt: skip


class BodiesAsTheyStood(dict):
    """{id: `Body`} of those bodies of a query that its rows name, made when asked for."""

    def __init__(self, roster: Roster, positions: np.ndarray, X_WBs: np.ndarray):
        """positions : (k,) of the bodies named, ascending.   X_WBs : (k, 4, 4) their poses, kept."""
        self._roster, self._positions, self._X_WBs = roster, positions, X_WBs

    def __missing__(self, identity: int) -> Body:
        position = int(np.searchsorted(self._roster.ids, identity))
        body = self._roster.body(position, self._X_WBs[np.searchsorted(self._positions, position)])
        self[identity] = body
        return body

    def __reduce__(self):
        return BodiesAsTheyStood, (self._roster, self._positions, self._X_WBs), None, None, iter(self.items())


class WorldBodies:
    """Bodies in columns that grow; row k of each is one body, in the order of ids.

    Rows of removed bodies stay empty until the next `roster`.
    """

    def __init__(self) -> None:
        self._row_of: dict[int, int] = {}
        self._id_of: dict[str, int] = {}
        self._next = 0
        self._ids: list[int] = []
        self._names: list[str | None] = []
        self._shapes: list[Shape] = []
        self._flags: list[tuple[bool, int, int]] = []
        self._X_WBs = np.empty((16, 4, 4))
        self._moved = np.zeros(16, dtype=bool)
        self._made: dict[int, Body] = {}
        self._roster: Roster | None = None

    def __getstate__(self) -> dict:
        """For copies and pickles: the lists are changed in place."""
        roster = self.roster()
        return {
            "_row_of": dict(self._row_of), "_id_of": dict(self._id_of), "_next": self._next, "_ids": list(self._ids),
            "_names": list(self._names), "_shapes": list(self._shapes), "_flags": list(self._flags),
            "_X_WBs": self.poses().copy(), "_moved": np.zeros(len(self), dtype=bool), "_made": {}, "_roster": roster,
        }  # fmt: skip

    def __len__(self) -> int:
        return len(self._row_of)

    @property
    def ids(self) -> list[int]:
        return list(self._row_of)

    @property
    def names(self) -> dict[int, str]:
        return {identity: name for name, identity in self._id_of.items()}

    # --- one body -------------------------------------------------------------------------------

    def add(self, shape: Shape, X_WB, name: str | None, static: bool, group: int, mask: int) -> int:
        """The id of a new body; arguments as of `World.add`. Raises InvalidArgument, InvalidPose."""
        if not isinstance(shape, Shape):
            raise InvalidArgument(
                f"World.add: shape must be a shape, for example collide.Sphere(0.1), got {checks.describe(shape)}"
            )
        X_WB = _IDENTITY if X_WB is None else as_pose(X_WB, "World.add: X_WB")
        identity, row = self._next, len(self._ids)
        if name is None:
            name = f"body {identity}"
        elif not isinstance(name, str) or not name:
            raise InvalidArgument(f"World.add: name must be a non-empty string, got {checks.describe(name)}")
        if name in self._id_of:
            raise InvalidArgument(f'World.add: there is a body named "{name}" already (id {self._id_of[name]})')
        flags = _flag("static", static), _bits("group", group), _bits("mask", mask)
        if row == len(self._X_WBs):
            self._X_WBs = np.concatenate([self._X_WBs, np.empty((max(16, row), 4, 4))])
            self._moved = np.zeros(len(self._X_WBs), dtype=bool)
        self._X_WBs[row] = X_WB
        self._ids.append(identity)
        self._names.append(name)
        self._shapes.append(shape)
        self._flags.append(flags)
        self._row_of[identity], self._id_of[name] = row, identity
        self._next, self._roster = identity + 1, None
        return identity

    def remove(self, identity: int) -> None:
        row = self._row_of.pop(identity)
        del self._id_of[self._names[row]]  # type: ignore[arg-type]
        self._names[row] = None
        self._made.pop(identity, None)
        self._roster = None

    def move(self, identity: int, X_WB) -> None:
        """Give a body another pose. Raises InvalidPose."""
        X_WB = as_pose(X_WB, "World.set_pose: X_WB")
        row = self._row_of[identity]
        self._X_WBs[row] = X_WB
        self._moved[row] = True
        self._made.pop(identity, None)

    def body(self, identity: int) -> Body:
        """The same object until it is moved."""
        body = self._made.get(identity)
        if body is None:
            row = self._row_of[identity]
            X_WB = self._X_WBs[row].copy()
            name = self._names[row]
            assert name is not None
            body = Body(identity, name, self._shapes[row], X_WB, *self._flags[row])
            self._made[identity] = body
        return body

    def id_of(self, body: int | str) -> int:
        """The id of a body by its id or name. Raises UnknownBody."""
        if type(body) is int and body in self._row_of:
            return body
        if isinstance(body, str):
            if body in self._id_of:
                return self._id_of[body]
            known = ", ".join(sorted(self._id_of)[:12]) or "none"
            raise UnknownBody(
                f'no body is named "{body}"; there are: {known}{", …" if len(self._id_of) > 12 else ""}'
            )
        if not checks.is_integer(body):
            raise UnknownBody(f"a body is named by its id or its name, got {checks.describe(body)}")
        if body not in self._row_of:
            raise UnknownBody(f"no body has id {checks.describe(body)}; it may have been removed")
        return int(body)

    def name_of(self, identity: int) -> str:
        return self._names[self._row_of[identity]]  # type: ignore[return-value]

    # --- all of them ----------------------------------------------------------------------------

    def move_many(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Give k bodies other poses (k, 4, 4). Raises UnknownBody, InvalidPose: then none has moved."""
        rows = self._rows_of(bodies)
        X_WBs = as_poses(X_WBs, "World.set_poses: X_WBs")
        if len(X_WBs) != len(rows):
            raise InvalidPose(f"World.set_poses: {len(rows)} bodies but {len(X_WBs)} poses")
        self._X_WBs[rows] = X_WBs
        self._moved[rows] = True
        self._made.clear()

    def take_moved(self) -> np.ndarray:
        """Rows of the bodies that moved since this was last called, ascending."""
        rows = np.flatnonzero(self._moved)
        self._moved[rows] = False
        return rows

    def _rows_of(self, bodies: Iterable[int | str]) -> np.ndarray:
        if not (isinstance(bodies, np.ndarray) and bodies.ndim == 1 and bodies.dtype.kind in "iu"):
            bodies = list(bodies)
            if set(map(type, bodies)) - {int}:
                bodies = [self.id_of(body) for body in bodies]
        n = self._next
        if len(self._row_of) == n and len(bodies):  # none was ever removed: ids are rows
            with contextlib.suppress(OverflowError):
                rows = np.asarray(bodies, dtype=np.int64)
                if 0 <= rows.min() and rows.max() < n:
                    return rows
        return np.array([self._row_of[self.id_of(body)] for body in bodies], dtype=np.int64)

    def roster(self) -> Roster:
        """The bodies as they are now, poses apart. Rows are positions of it from then on."""
        if self._roster is None:
            if len(self._row_of) < len(self._ids):
                self._close_gaps()
            flags = np.array(self._flags, dtype=np.int64).reshape(-1, 3).T.copy()
            ids = np.array(self._ids, dtype=np.int32)
            self._roster = Roster(ids, list(self._names), list(self._shapes), *flags)  # type: ignore[arg-type]
        return self._roster

    def poses(self) -> np.ndarray:
        """(n, 4, 4) poses by row: a view, changed when bodies move."""
        return self._X_WBs[: len(self._ids)]

    def _close_gaps(self) -> None:
        """Drop the rows of removed bodies."""
        rows = list(self._row_of.values())
        self._X_WBs, self._moved = self._X_WBs[rows], self._moved[rows]
        self._ids, self._names = [self._ids[row] for row in rows], [self._names[row] for row in rows]
        self._shapes, self._flags = [self._shapes[row] for row in rows], [self._flags[row] for row in rows]
        self._row_of = {identity: row for row, identity in enumerate(self._ids)}


def _flag(field: str, value) -> bool:
    if value is True or value is False:
        return value
    if isinstance(value, np.bool_) or (isinstance(value, (int, np.integer)) and value in (0, 1)):
        return bool(value)
    raise InvalidArgument(f"World.add: {field} must be True or False, got {checks.describe(value)}")


def _bits(field: str, value) -> int:
    if not checks.is_integer(value) or not 0 <= int(value) < 2**_BITS:
        raise InvalidArgument(
            f"World.add: {field} must be an integer of up to {_BITS} bits, got {checks.describe(value)}"
        )
    return int(value)
