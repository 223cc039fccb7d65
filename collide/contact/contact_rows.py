"""What `contacts` returns: a row for each contact.

=============== ===================================================================================
a, b            ids of the bodies (0 and 1 for a pair query)
part_a, part_b  number of each body's part in a Compound, 0 otherwise
patch           number of the patch among its pair's patches, from 0
kind            index into `KINDS`
facet_a,facet_b facet each point lies on: of a Mesh rows of ``faces``, of a convex shape triangles of its
                hull (of a Box ``facet // 2`` is the face: −x, +x, −y, +y, −z, +z), −1 where a curved or a
                plane surface has none
normal          (3,) unit vector nhat_AB_W, one for all contacts of a patch
point_a,point_b (3,) points of A's and B's surfaces [m]: point_b − point_a = distance · normal
distance        signed, along the normal [m]: the gap there, or minus the overlap
lower, upper    lower ≤ true value ≤ upper: how far these two facets are apart along the normal, there, with
                normal, poses and shapes as handed in, against rounding [m]; of "translation" those of `distance`
apart           of overlaps: moving B by this length along the normal is proven to clear the patch's facets of
                each other, or the bodies where they are convex, but for touching [m]; inf where no length
                is known, 0 of gaps
=============== ===================================================================================

Rows of a patch stand together, the deepest first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Literal, NamedTuple, overload

import numpy as np

from collide.errors import InvalidArgument
from collide.results import with_columns

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]

#: Contacts of n pairs, pair after pair, and where those of each pair end (n,).
Rows = tuple[np.ndarray, np.ndarray]


class Slack(NamedTuple):
    """By how much rounding may have moved the bodies of n pairs towards each other [m].

    each : (n,).   largest : no less than any slack, and the same whatever else is in the batch.
    """

    each: np.ndarray
    largest: float

    def take(self, some) -> Slack:
        return Slack(self.each[some], self.largest)


#: What `kind` indexes: the patch is apart; it meets, or its radii overlap; or no patch describes the overlap, and the
#: row is the answer of `distance`: a translation that separates the bodies, and no place.
KINDS = ("gap", "overlap", "translation")
GAP, OVERLAP, TRANSLATION = range(3)

CONTACT_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"), ("apart", "f8"),
        ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3),
        ("a", "i4"), ("b", "i4"), ("part_a", "i4"), ("part_b", "i4"),
        ("facet_a", "i4"), ("facet_b", "i4"), ("feature_a", "i4"), ("feature_b", "i4"), ("patch", "i4"), ("kind", "i4"),
    ],
    align=True,
)
#: Names of the fields of a row.
FIELDS: tuple[str, ...] = CONTACT_DTYPE.names or ()


def no_rows() -> np.ndarray:
    return np.zeros(0, dtype=CONTACT_DTYPE)


def joined_rows(pieces: Sequence[Rows]) -> Rows:
    """The rows of pieces of a batch, piece after piece."""
    if len(pieces) == 1:
        return pieces[0]
    counts = [np.diff(ends, prepend=0) for _, ends in pieces]
    return np.concatenate([rows for rows, _ in pieces]), np.cumsum(np.concatenate(counts))


def _middles(rows: np.ndarray) -> np.ndarray:
    return 0.5 * rows["point_a"] + 0.5 * rows["point_b"]


@with_columns(CONTACT_DTYPE)
class WorldContacts:
    """Contacts of a World: ``rows`` (CONTACT_DTYPE) sorted by (a, b), with ids of bodies; ``names`` resolves them.

    Every field is an attribute, a column, as of `Contacts`; indexing by the name of a field gives the column, too.
    """

    __slots__ = ("_bodies", "rows")

    if TYPE_CHECKING:
        distance: Floats
        lower: Floats
        upper: Floats
        apart: Floats
        normal: Floats
        point_a: Floats
        point_b: Floats
        a: Ints
        b: Ints
        part_a: Ints
        part_b: Ints
        facet_a: Ints
        facet_b: Ints
        feature_a: Ints
        feature_b: Ints
        patch: Ints
        kind: Ints

    def __init__(self, rows: np.ndarray, bodies: dict):
        self.rows, self._bodies = rows, bodies

    @property
    def point(self) -> np.ndarray:
        """(k, 3) the middles between ``point_a`` and ``point_b`` [m]."""
        return _middles(self.rows)

    @property
    def names(self) -> list[tuple[str, str]]:
        """(name of a, name of b), row by row."""
        return [(self._bodies[int(a)].name, self._bodies[int(b)].name) for a, b in zip(self.rows["a"], self.rows["b"])]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    @overload
    def __getitem__(
        self, key: Literal["distance", "lower", "upper", "apart", "normal", "point_a", "point_b"]
    ) -> Floats: ...
    @overload
    def __getitem__(
        self, key: Literal["a", "b", "part_a", "part_b", "facet_a", "facet_b", "patch", "kind"]
    ) -> Ints: ...
    @overload
    def __getitem__(self, key: int) -> np.void: ...
    @overload
    def __getitem__(self, key: slice | NDArray[np.bool_] | Sequence[int] | NDArray[np.integer]) -> np.ndarray: ...
    def __getitem__(self, key):
        return self.rows[key]

    def __repr__(self) -> str:
        pairs = len(np.unique(np.stack([self.rows["a"], self.rows["b"]], axis=1), axis=0)) if len(self.rows) else 0
        return f"WorldContacts({len(self.rows)} contacts of {pairs} pairs)"


class Contacts:
    """Contact manifolds of one pair of bodies, or of a batch: the fields of `CONTACT_DTYPE` as columns.

    Parameters
    ----------
    rows : (k,) `CONTACT_DTYPE`, all contacts, pair after pair, and in each patch after patch, the deepest first.
    starts : (N + 1,) int64: the contacts of pair k are ``rows[starts[k]:starts[k + 1]]``; None of a single pair.

    Notes
    -----
    ``result[k]`` is a result of pair k alone. ``len(result)`` is the number of contacts; the number of pairs is
    ``len(starts) − 1``. Iterating gives the rows.
    """

    # Contacts of a single call have `_single` alone, the bytes of their rows, until they are asked for.
    __slots__ = ("_single", "_starts", "rows")

    if TYPE_CHECKING:
        distance: Floats
        lower: Floats
        upper: Floats
        apart: Floats
        normal: Floats
        point_a: Floats
        point_b: Floats
        a: Ints
        b: Ints
        part_a: Ints
        part_b: Ints
        facet_a: Ints
        facet_b: Ints
        patch: Ints
        kind: Ints

    def __init__(self, rows: np.ndarray, starts: np.ndarray | None = None):
        self.rows, self._starts, self._single = rows, starts, None
        rows.setflags(write=False)
        if starts is not None:
            starts.setflags(write=False)

    def __reduce__(self):
        return type(self), (self.rows, self._starts)

    @property
    def starts(self) -> np.ndarray:
        """(N + 1,) int64: the contacts of pair k are ``rows[starts[k]:starts[k + 1]]``."""
        if self._starts is None:
            self._starts = np.array([0, len(self.rows)])
            self._starts.setflags(write=False)
        return self._starts

    if not TYPE_CHECKING:  # checkers are to know the fields above, and no others

        def __getattr__(self, name: str):
            if name in FIELDS:
                return self.rows[name]
            if name in Contacts.__slots__:
                single = self._single
                if single is not None:
                    self.__init__(np.frombuffer(single, CONTACT_DTYPE))
                return object.__getattribute__(self, name)  # another thread may have opened it meanwhile
            raise AttributeError(f"no field {name!r}; there are {', '.join(FIELDS)}")

    def __dir__(self):
        return [*super().__dir__(), *FIELDS]

    @property
    def point(self) -> np.ndarray:
        """(k, 3) the middles between ``point_a`` and ``point_b``, where a simulator has one point a contact [m]."""
        return _middles(self.rows)

    @property
    def patches(self) -> np.ndarray:
        """(p,) the deepest row of every patch, pose after pose."""
        if not len(self.rows):
            return self.rows
        pose = np.repeat(np.arange(len(self.starts) - 1), np.diff(self.starts))
        changes = (np.diff(pose, prepend=-1) != 0) | (np.diff(self.rows["patch"], prepend=-1) != 0)
        changes |= np.diff(self.rows["part_a"], prepend=0) != 0
        return self.rows[changes | (np.diff(self.rows["part_b"], prepend=0) != 0)]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    def __getitem__(self, k: int) -> Contacts:
        """The contacts of pose k."""
        poses = len(self.starts) - 1
        if isinstance(k, bool) or not isinstance(k, (int, np.integer)):
            raise InvalidArgument(
                f"contacts of a pose are named by its number, got {k!r}; rows[…] takes fields and slices"
            )
        if not -poses <= k < poses:
            raise IndexError(f"there are poses 0 … {poses - 1}, not {k}" if poses else "there are no poses")
        begin, end = self.starts[k % poses], self.starts[k % poses + 1]
        return Contacts(self.rows[begin:end])

    def __repr__(self) -> str:
        kinds = ", ".join(f"{int((self.rows['kind'] == k).sum())} {name}" for k, name in enumerate(KINDS))
        return f"Contacts({len(self.rows)} rows of {len(self.starts) - 1} poses: {kinds})"
