"""The bodies of a World in columns: adding, moving and naming them makes no object a body.

A `Body` is made on demand. A query answers about a `Roster`, beyond the reach of changes of the World: results stay
true of the bodies as they stood. Rows of removed bodies stay, empty, until they are as many as the others: then all
are closed up at once, so the cost of a removal does not grow with the number of bodies.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.broadphase.moved_bodies import store_poses
from collide.errors import InvalidArgument, InvalidPose, UnknownBody
from collide.numerics.growing_rows import GrowingRows
from collide.numerics.rigid_poses import are_rigid_matrices
from collide.pairs.security_margin import checked_margin
from collide.shapes.shape import Shape, checked_shape
from collide.transforms import LARGEST, SAFE_TOLERANCE, as_pose, as_poses

#: Groups and masks are bit sets of this many bits.
_BITS = 32
_IDENTITY = np.eye(4)
#: So many rows of removed bodies stay whatever the number of others.
_MIN_ROWS = 64
#: What is no row of any body.
_NO_ROWS = np.array([-1])


@dataclass(frozen=True)
class Body:
    """A body of a World, in its present state.

    Parameters
    ----------
    id : never used again in this World.   name : unique in the World.
    shape : any shape.   X_WB : (4, 4) its pose in the world [m], read-only.
    static : never tested against other static bodies.   group, mask : bit sets of 32 bits.
    margin : [m], as of `World.set_margin`.   sleeping : as of `World.sleep`.
    """

    id: int
    name: str
    shape: Shape
    X_WB: np.ndarray
    static: bool
    group: int
    mask: int
    margin: float = 0.0
    sleeping: bool = False

    def __post_init__(self) -> None:
        self.X_WB.flags.writeable = False  # of a copy as well

    def __reduce__(self):
        return Body, (
            self.id, self.name, self.shape, self.X_WB, self.static, self.group, self.mask, self.margin, self.sleeping,
        )


class Roster(NamedTuple):
    """Bodies by position, in the order of their ids: what stays while bodies only move. Never changed once made.

    ids : (n,) int32, ascending.   names, shapes : of each; these lists may go on with bodies added later.
    static, group, mask : (n,) int64.   alive : (n,) bool, False of removed bodies.
    margin : (n,) float64 [m].   sleeping : (n,) bool.   generation : a number that changes with the positions.
    """

    ids: np.ndarray
    names: list[str]
    shapes: list[Shape]
    static: np.ndarray
    group: np.ndarray
    mask: np.ndarray
    alive: np.ndarray
    margin: np.ndarray
    sleeping: np.ndarray
    generation: int

    def body(self, position: int, X_WB: np.ndarray) -> Body:
        return Body(
            int(self.ids[position]), self.names[position], self.shapes[position], X_WB.copy(),
            bool(self.static[position]), int(self.group[position]), int(self.mask[position]),
            float(self.margin[position]), bool(self.sleeping[position]),
        )


class BodiesAsTheyStood(dict):
    """{id: `Body`} of the bodies named in a query's rows, made when asked for."""

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
    """Bodies in columns that grow; row k of every column is the same body, in the order of ids."""

    def __init__(self) -> None:
        self._row_of: dict[int, int] = {}
        self._id_of: dict[str, int] = {}
        self._next = self._generation = 0
        self._ids: list[int] = []
        self._names: list[str] = []
        self._shapes: list[Shape] = []
        self._flags: list[tuple[bool, int, int]] = []
        self._X_WBs = np.empty((16, 4, 4))
        self._moved, self._alive, self._asleep = (np.zeros(16, dtype=bool) for _ in range(3))
        self._margins = np.zeros(16)
        self._made: dict[int, Body] = {}
        self._columns = _columns_of([], [])
        self._roster: Roster | None = None
        self._shapes_are_shared = False  # whether a roster holds this very list

    def __getstate__(self) -> dict:
        """For copies and pickles: lists and arrays are changed in place."""
        self._close_gaps()
        n = len(self)
        return {
            "_row_of": dict(self._row_of), "_id_of": dict(self._id_of), "_next": self._next,
            "_generation": self._generation, "_ids": list(self._ids), "_names": list(self._names),
            "_shapes": list(self._shapes), "_flags": list(self._flags), "_X_WBs": self.poses().copy(),
            "_moved": np.zeros(n, dtype=bool), "_alive": np.ones(n, dtype=bool), "_asleep": self._asleep[:n].copy(),
            "_margins": self._margins[:n].copy(), "_made": {}, "_columns": _columns_of(self._ids, self._flags),
            "_roster": None, "_shapes_are_shared": False,
        }

    def __len__(self) -> int:
        return len(self._row_of)

    @property
    def ids(self) -> list[int]:
        return list(self._row_of)

    @property
    def names(self) -> dict[int, str]:
        return {identity: name for name, identity in self._id_of.items()}

    # --- one body -------------------------------------------------------------------------------

    def add(
        self, shape: Shape, X_WB, name: str | None, static: bool, group: int, mask: int, margin: float = 0.0
    ) -> int:
        """The id of a new body; arguments as of `World.add`. Raises InvalidArgument, InvalidPose."""
        if isinstance(shape, str) and isinstance(X_WB, Shape):
            raise InvalidArgument(f"World.add: the shape comes first: World.add(shape, X_WB, name={shape!r})")
        checked_shape("World.add: shape", shape, "collide.Sphere(0.1)")
        X_WB = _IDENTITY if X_WB is None else _pose("World.add: X_WB", X_WB)
        identity, row = self._next, len(self._ids)
        name = _name_or_none("World.add: name", name) or f"body {identity}"
        if name in self._id_of:
            raise InvalidArgument(f'World.add: there is a body named "{name}" already (id {self._id_of[name]})')
        flags = _flag("World.add: static", static), _bits("World.add: group", group), _bits("World.add: mask", mask)
        if row == len(self._X_WBs):
            self._reserve(1)
        self._X_WBs[row], self._margins[row], self._alive[row] = X_WB, margin, True
        self._ids.append(identity)
        self._names.append(name)
        self._shapes.append(shape)
        self._flags.append(flags)
        self._row_of[identity], self._id_of[name] = row, identity
        self._next, self._roster = identity + 1, None
        return identity

    def add_many(self, shapes, X_WBs, names, static, group, mask, margin) -> np.ndarray:
        """Ids (n,) int64 of new bodies; arguments as of `World.add_many`. Raises InvalidArgument, InvalidPose: then
        none has been added.
        """
        caller = "World.add_many"
        if isinstance(shapes, Shape):
            shapes = [shapes]
        elif isinstance(shapes, dict):
            got = f"got {checks.brief(shapes)}"
            raise InvalidArgument(f"{caller}: shapes must be a shape or a sequence of shapes, {got}")
        else:
            shapes = checks.listed_entries(f"{caller}: shapes", shapes, "a shape or a sequence of shapes")
            if not all(issubclass(kind, Shape) for kind in set(map(type, shapes))):
                for k, shape in enumerate(shapes):
                    checked_shape(f"{caller}: shapes[{k}]", shape, "collide.Sphere(0.1)")
        if not _are_rigid_matrices(X_WBs):
            X_WBs = as_poses(X_WBs, f"{caller}: X_WBs")
        n = checks.matched_count(caller, shapes=len(shapes), X_WBs=len(X_WBs))
        static = _of_each(f"{caller}: static", static, n, _flag)
        group, mask = _of_each(f"{caller}: group", group, n, _bits), _of_each(f"{caller}: mask", mask, n, _bits)
        margin = _of_each(f"{caller}: margin", margin, n, checked_margin)
        row, ids = len(self._ids), range(self._next, self._next + n)
        names = self._names_of(names, ids, caller)
        self._reserve(n)
        rows = slice(row, row + n)
        self._X_WBs[rows], self._margins[rows], self._alive[rows] = X_WBs, margin, True
        self._ids.extend(ids)
        self._names.extend(names)
        self._shapes.extend(shapes if len(shapes) == n else shapes * n)
        self._flags.extend(zip(static, group, mask))
        self._row_of.update(zip(ids, range(row, row + n)))
        self._id_of.update(zip(names, ids))
        self._next, self._roster = self._next + n, None
        return np.arange(ids.start, ids.stop)

    def _names_of(self, names, ids: range, caller: str) -> list[str]:
        """A name for each of these new ids. Raises InvalidArgument."""
        if names is None:
            names = [f"body {identity}" for identity in ids]
        else:
            names = checks.listed_entries(f"{caller}: names", names, "a sequence of names, or None")
            if len(names) != len(ids):
                raise InvalidArgument(f"{caller}: names must be {len(ids)}, one a body, got {checks.brief(names)}")
            names = _read(f"{caller}: names", names, _name_or_none)
            if None in names:
                names = [f"body {identity}" if name is None else name for name, identity in zip(names, ids)]
        if len(set(names)) < len(names) or not self._id_of.keys().isdisjoint(names):
            taken = dict(self._id_of)
            for k, (name, identity) in enumerate(zip(names, ids)):
                if taken.setdefault(name, identity) != identity:
                    raise InvalidArgument(
                        f'{caller}: names[{k}]: there is a body named "{name}" already (id {taken[name]})'
                    )
        return names

    def _reserve(self, n: int) -> None:
        """Memory for n more bodies at the least."""
        used = len(self._ids)
        if used + n > len(self._X_WBs):
            for column in ("_X_WBs", "_moved", "_alive", "_asleep", "_margins"):
                rows = getattr(self, column)
                grown = np.zeros((used + max(n, used, 16), *rows.shape[1:]), rows.dtype)
                grown[:used] = rows[:used]
                setattr(self, column, grown)

    def replace(self, identity: int, shape: Shape) -> None:
        """Give a body another shape. Rosters handed out keep the former shape."""
        if self._shapes_are_shared:
            self._shapes, self._shapes_are_shared = list(self._shapes), False
        self._shapes[self._row_of[identity]] = shape
        self._made.pop(identity, None)
        self._generation += 1
        self._roster = None

    def remove(self, identity: int) -> None:
        row = self._row_of.pop(identity)
        del self._id_of[self._names[row]]
        self._alive[row] = self._moved[row] = False
        self._made.pop(identity, None)
        self._roster = None

    def move(self, identity: int, X_WB) -> None:
        """Give a body another pose. Raises InvalidPose."""
        X_WB = _pose("World.set_pose: X_WB", X_WB)
        row = self._row_of[identity]
        self._X_WBs[row] = X_WB
        self._moved[row] = True
        self._made.pop(identity, None)

    def set_margin(self, identity: int, margin: float) -> None:
        self._margins[self._row_of[identity]] = margin
        self._made.pop(identity, None)
        self._roster = None

    def set_sleeping(self, bodies: Iterable[int | str], asleep: bool) -> None:
        """Raises UnknownBody: then nothing has changed."""
        self._asleep[self._rows_of(bodies)] = asleep
        self._made.clear()
        self._roster = None

    def body(self, identity: int) -> Body:
        """The same object until it is moved, or its margin or sleep changes."""
        body = self._made.get(identity)
        if body is None:
            row = self._row_of[identity]
            X_WB = self._X_WBs[row].copy()
            margin, asleep = float(self._margins[row]), bool(self._asleep[row])
            body = Body(identity, self._names[row], self._shapes[row], X_WB, *self._flags[row], margin, asleep)
            self._made[identity] = body
        return body

    def id_of(self, body: int | str, what: str = "body") -> int:
        """The id of a body by its id or name. what : the argument's name, for messages. Raises UnknownBody."""
        if type(body) is int and body in self._row_of:
            return body
        if isinstance(body, str):
            if body in self._id_of:
                return self._id_of[body]
            known = ", ".join(sorted(self._id_of)[:12]) or "none"
            raise UnknownBody(
                f"{what}: no body is named {checks.brief(body)}; there are: {known}"
                f"{', …' if len(self._id_of) > 12 else ''}"
            )
        if not checks.is_integer(body):
            raise UnknownBody(f"{what} must be the id or the name of a body, got {checks.brief(body)}")
        if body not in self._row_of:
            raise UnknownBody(f"{what}: no body has id {checks.brief(body)}; it may have been removed")
        return int(body)

    def name_of(self, identity: int) -> str:
        return self._names[self._row_of[identity]]

    # --- all of them ----------------------------------------------------------------------------

    def move_many(self, bodies: Iterable[int | str], X_WBs) -> None:
        """Give k bodies other poses (k, 4, 4). Raises UnknownBody, InvalidPose: then none has moved."""
        rows = self._rows_of(bodies)
        if not _are_rigid_matrices(X_WBs):
            X_WBs = as_poses(X_WBs, "World.set_poses: X_WBs")
        if len(X_WBs) != len(rows):
            named = f"{len(rows)} bodies {checks.brief(bodies)}"
            raise InvalidPose(f"World.set_poses: {named}, but X_WBs {X_WBs.shape} are {len(X_WBs)} poses")
        store_poses(rows, X_WBs, self._X_WBs, self._moved)
        self._made.clear()

    @property
    def is_moved(self) -> np.ndarray:
        """(n,) bool by row: bodies that moved since their flags were last cleared; a view."""
        return self._moved[: len(self._ids)]

    def _rows_of(self, bodies: Iterable[int | str]) -> np.ndarray:
        if not (isinstance(bodies, np.ndarray) and bodies.ndim == 1 and bodies.dtype.kind in "iu"):
            bodies = checks.listed_entries("bodies", bodies, "a sequence of ids or names")
            if set(map(type, bodies)) - {int}:
                bodies = [self.id_of(body, "bodies") for body in bodies]
        n = self._next
        if len(self._row_of) == n == len(self._ids) and len(bodies):  # none was ever removed: ids are rows
            try:
                rows = np.ascontiguousarray(bodies, dtype=np.int64)
            except OverflowError:
                rows = _NO_ROWS
            if int(np.maximum.reduce(rows.view(np.uint64))) < n:  # one below 0 is above 2⁶³ there
                return rows
        if isinstance(bodies, np.ndarray) and bodies.dtype.kind == "i" and self._row_of:
            ids = self.roster().ids
            rows = np.searchsorted(ids, bodies).clip(max=len(ids) - 1)
            if (ids[rows] == bodies).all() and self._alive[rows].all():
                return rows
        return np.array([self._row_of[self.id_of(body, "bodies")] for body in bodies], dtype=np.int64)

    def roster(self) -> Roster:
        """The bodies as they are now, poses apart. Rows are positions of it, until its generation is another."""
        if self._roster is None:
            if len(self._ids) > _MIN_ROWS + 2 * len(self._row_of):
                self._close_gaps()
            n, known = len(self._ids), len(self._columns[0].rows)
            for column, rows in zip(self._columns, _columns_of(self._ids[known:], self._flags[known:])):
                column.extend(rows.rows)
            ids, static, group, mask = (column.rows for column in self._columns)
            alive, margins, asleep = (column[:n].copy() for column in (self._alive, self._margins, self._asleep))
            self._shapes_are_shared = True
            self._roster = Roster(
                ids, self._names, self._shapes, static, group, mask, alive, margins, asleep, self._generation
            )
        return self._roster

    def poses(self) -> np.ndarray:
        """(n, 4, 4) poses by row: a view, changed when bodies move, until `leave_poses`."""
        return self._X_WBs[: len(self._ids)]

    def leave_poses(self) -> None:
        """Views of poses handed out stay as they are from now on."""
        self._X_WBs = self._X_WBs.copy()

    def _close_gaps(self) -> None:
        """Drop the rows of removed bodies."""
        rows = list(self._row_of.values())
        if len(rows) == len(self._ids):
            return
        for column in ("_X_WBs", "_moved", "_alive", "_asleep", "_margins"):
            setattr(self, column, getattr(self, column)[rows])
        self._ids, self._names = [self._ids[row] for row in rows], [self._names[row] for row in rows]
        self._shapes, self._flags = [self._shapes[row] for row in rows], [self._flags[row] for row in rows]
        self._row_of = {identity: row for row, identity in enumerate(self._ids)}
        self._columns, self._roster = _columns_of([], []), None
        self._generation += 1


def _columns_of(ids: list[int], flags: list[tuple[bool, int, int]]) -> list[GrowingRows]:
    """Columns: ids, static, group, mask."""
    columns = np.array(flags, dtype=np.int64).reshape(-1, 3).T
    return [GrowingRows(np.array(ids, dtype=np.int32)), *(GrowingRows(column) for column in columns)]


def _are_rigid_matrices(X) -> bool:
    """Whether X is an array of rigid poses for certain; all else is looked at by `as_poses`."""
    return type(X) is np.ndarray and are_rigid_matrices(X, SAFE_TOLERANCE, LARGEST)


def _pose(what: str, X_WB) -> np.ndarray:
    """(4, 4). Raises InvalidPose."""
    is_rigid = type(X_WB) is np.ndarray and X_WB.ndim == 2 and _are_rigid_matrices(X_WB[None])
    return X_WB if is_rigid else as_pose(X_WB, what)


def _name_or_none(what: str, value) -> str | None:
    if value is not None and (not isinstance(value, str) or not value):
        raise InvalidArgument(f"{what} must be a non-empty string, got {checks.brief(value)}")
    return value


def _flag(what: str, value) -> bool:
    if value is True or value is False:
        return value
    if isinstance(value, np.bool_) or (isinstance(value, (int, np.integer)) and value in (0, 1)):
        return bool(value)
    raise InvalidArgument(f"{what} must be True or False, got {checks.brief(value)}")


def _bits(what: str, value) -> int:
    if value.__class__ is int and 0 <= value < 2**_BITS:
        return value
    if not checks.is_integer(value) or not 0 <= int(value) < 2**_BITS:
        raise InvalidArgument(f"{what} must be an integer of up to {_BITS} bits, got {checks.brief(value)}")
    return int(value)


def _of_each(what: str, value, n: int, read: Callable[[str, Any], Any]) -> list:
    """What n bodies have, by ``read(what, value)``: a value for all, or a list, a tuple or an array of n values.
    Raises InvalidArgument, naming the place.
    """
    if not isinstance(value, (list, tuple)) and not (isinstance(value, np.ndarray) and value.ndim):
        return [read(what, value)] * n
    values = value.tolist() if isinstance(value, np.ndarray) else value
    if len(values) != n:
        raise InvalidArgument(f"{what} must be one for all bodies or {n}, one a body, got {checks.brief(values)}")
    if len(kinds := set(map(type, values))) == 1 and kinds <= {bool, int, float}:  # 1 and True are equal, and two kinds
        distinct = list(set(values))
        with contextlib.suppress(InvalidArgument):
            known = dict(zip(distinct, [read(what, entry) for entry in distinct]))
            return list(map(known.__getitem__, values))
    return _read(what, values, read)


def _read(what: str, values, read: Callable[[str, Any], Any]) -> list:
    """``read(what, value)`` of each. Raises InvalidArgument, which names the place."""
    try:
        return [read(what, value) for value in values]
    except InvalidArgument:  # told once more by place: to write the places of all down takes as long as to read them
        return [read(f"{what}[{k}]", value) for k, value in enumerate(values)]
