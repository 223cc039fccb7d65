"""What queries return: structured arrays with documented dtypes, and the names that go with them.

One row is one pair of bodies. The fields, with A the first body and B the second:

=============== ===================================================================================
a, b            ids of the bodies (0 and 1 for a pair query), a < b
part_a, part_b  which convex part of each decided (0 where a body is one convex set)
hit             the closed sets share a point
certified       the sign is proven and the bracket keeps the promise of `narrowphase/bounds.py`
beyond          the pair is farther apart than the query's max_distance; `distance` and `lower` are
                then a proven lower bound ≥ max_distance, and `upper` is infinite
how             which argument decided, a `How`: an index into `HOW`
iterations      rounds of GJK (low half) and of EPA (high half), for diagnosis; of unions those of all
                pairs of parts that were asked
exact           rounds of the exact stage, 0 where doubles decided
distance        signed [m]: the gap, or minus the depth
lower, upper    lower ≤ true signed distance ≤ upper, proven against rounding [m]
normal          (3,) unit vector nhat_AB_W: moving B by −distance·normal brings the pair to touch
point_a,point_b (3,) witness points p_WAa, p_WBb [m]: point_b − point_a = distance · normal
count           how many vertex pairs follow
vertices_a, _b  (4,) ids of the core vertices that span the deciding feature, pair by pair: apart,
                the features nearest each other; together, a simplex of A ⊖ B. −1 for curved cores
=============== ===================================================================================

Invariants, asserted in the tests: lower ≤ distance ≤ upper; hit ⇔ distance ≤ 0 where certified;
|normal| = 1; `flipped(flipped(r))` is r.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import IntEnum
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np

from collide.errors import InvalidArgument

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import Self, TypeVar

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]
    #: `Single` or `Batch`; Any where a type checker cannot tell which, and values of fields are Any, too.
    Asked = TypeVar("Asked", default=Any)
    One = TypeVar("One")
    Many = TypeVar("Many")

    class Field(Generic[One, Many]):
        """A field of a `PairResult` to a type checker: a scalar of a single result, a column of a batch."""

        @overload
        def __get__(self, result: PairResult[Single], owner: object) -> One: ...
        @overload
        def __get__(self, result: PairResult[Batch], owner: object) -> Many: ...
        def __get__(self, result: Any, owner: object) -> Any: ...
else:
    from typing import TypeVar

    Asked = TypeVar("Asked")


class How(IntEnum):
    """Which argument decided a pair. A proof stands against both poses as given, entries taken as exact reals.

    Members are the integers of the field ``how``, print as the words of a report, and say what they mean: ``How(1)``,
    ``str(How(1))`` = "separating plane", ``How(1).meaning``.
    """

    meaning: str

    UNDECIDED = 0, "the bracket reaches to both sides of 0: touching within rounding"
    SEPARATING_PLANE = 1, "a plane with all of A on one side and all of B on the other"
    COMMON_POINT = 2, "a simplex of points of A ⊖ B around the origin, clear of rounding"
    SWEPT_OVERLAP = 3, "two core points nearer than the sum of the radii"
    CLOSED_FORM = 4, "a formula with an error bound: spheres, capsules, half-spaces"
    EXACT_ARITHMETIC = 5, "integers, where doubles leave the sign open or the last digit of a gap or depth"

    def __new__(cls, value: int, meaning: str) -> Self:
        made = int.__new__(cls, value)
        made._value_ = value
        made.meaning = made.__doc__ = meaning
        return made

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")

    def __format__(self, spec: str) -> str:
        return format(str(self), spec)


#: Names of what `how` tells, by its value.
HOW: tuple[str, ...] = tuple(str(how) for how in How)
UNDECIDED, PLANE, SIMPLEX, SWEPT, FORMULA, EXACT = range(len(HOW))
#: Set by a kernel on a pair outside the range of sizes; never in a result.
REFUSED = 255

PAIR_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"),
        ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3),
        ("a", "i4"), ("b", "i4"), ("part_a", "i4"), ("part_b", "i4"),
        ("vertices_a", "i4", 4), ("vertices_b", "i4", 4),
        ("iterations", "i4"), ("count", "<i4"), ("how", "<i4"),  # kernels write the lowest byte of these two
        ("exact", "u1"), ("hit", "?"), ("certified", "?"), ("beyond", "?"),
    ],
    align=True,
)  # so wide that no byte is padding: numpy leaves padding as it finds it, and equal answers are to be equal bytes

#: Names of the fields of a row.
FIELDS: tuple[str, ...] = PAIR_DTYPE.names or ()


def flipped(rows: np.ndarray) -> np.ndarray:
    """The same results with the bodies' roles exchanged: points swapped, normals negated, exactly."""
    swapped = rows.copy()
    for one, other in (("a", "b"), ("part_a", "part_b"), ("point_a", "point_b"), ("vertices_a", "vertices_b")):
        swapped[one], swapped[other] = rows[other], rows[one]
    swapped["normal"] = 0.0 - rows["normal"]  # never −0.0
    return swapped


class Single:
    """``PairResult[Single]``, to type checkers: of single poses; fields are scalars and (3,) arrays."""


class Batch:
    """``PairResult[Batch]``, to type checkers: fields are arrays with a leading N."""


class PairResult(Generic[Asked]):
    """Answer of a pair query: the fields of `PAIR_DTYPE` as attributes.

    Scalars and (3,) arrays for single poses, ``how`` a `How`; arrays with a leading N for batches, of which ``r[k]``
    is one result. ``rows`` is the structured array itself.
    """

    __slots__ = ("_question", "_single", "rows")

    if TYPE_CHECKING:
        distance: Field[float, Floats]
        lower: Field[float, Floats]
        upper: Field[float, Floats]
        normal: Field[Floats, Floats]
        point_a: Field[Floats, Floats]
        point_b: Field[Floats, Floats]
        hit: Field[bool, Bools]
        certified: Field[bool, Bools]
        beyond: Field[bool, Bools]
        how: Field[How, Bytes]
        iterations: Field[int, Ints]
        exact: Field[int, Bytes]
        count: Field[int, Bytes]
        a: Field[int, Ints]
        b: Field[int, Ints]
        part_a: Field[int, Ints]
        part_b: Field[int, Ints]
        vertices_a: Field[Ints, Ints]
        vertices_b: Field[Ints, Ints]

    def __init__(self, rows: np.ndarray, single: bool, question: tuple):
        self.rows, self._single, self._question = rows, single, question

    @property
    def certificate(self):
        """Plain data that proves the boolean, worked out when asked for; see `collide.certificates.certificates`.

        A tuple of `Certificate`, one for each pair of parts it takes; None where there is none. A
        list of these for batches. `collide.verify` checks it in Python integers.
        """
        from collide.certificates.certificates import certificate_of

        asked = (self._asked(k) for k in range(len(self.rows)))
        found = [certificate_of(A, B, X_WA[0], X_WB[0], row) for (A, B, X_WA, X_WB), row in zip(asked, self.rows)]
        return found[0] if self._single else found

    def _asked(self, k: int) -> tuple:
        """(A, B, X_WA, X_WB) of row k, poses (1, 4, 4)."""
        A, B, X_WA, X_WB = self._question
        shapes = (S[k] if isinstance(S, Sequence) else S for S in (A, B))
        poses = (X if len(X) == 1 else X[k : k + 1] for X in (X_WA, X_WB))
        return (*shapes, *poses)

    @property
    def question(self) -> tuple:
        """(A, B, X_WA, X_WB) as asked: shapes, or sequences of them, and poses with a leading N or 1."""
        return self._question

    @overload
    def __getitem__(self, k: int) -> PairResult[Single]: ...
    @overload
    def __getitem__(self, k: slice) -> PairResult[Batch]: ...
    def __getitem__(self, k):
        """Result k of a batch, or a batch of those in a slice."""
        if isinstance(k, slice):
            A, B, X_WA, X_WB = self._question
            shapes = (S[k] if isinstance(S, Sequence) else S for S in (A, B))
            poses = (X if len(X) == 1 else X[k] for X in (X_WA, X_WB))
            return PairResult(self.rows[k], False, (*shapes, *poses))
        k = _row_number(k, len(self.rows))
        return PairResult(self.rows[k : k + 1], True, self._asked(k))

    if not TYPE_CHECKING:  # checkers are to know the fields above, and no others

        def __getattr__(self, name: str):
            if name not in FIELDS:
                raise AttributeError(f"no field {name!r}; there are {', '.join(FIELDS)}")
            values = self.rows[name]
            if not self._single:
                return values
            if name == "how":
                return How(values[0])
            return values[0].copy() if values.ndim > 1 else values[0].item()

    def __dir__(self):
        return [*super().__dir__(), *FIELDS]

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        if self._single:
            row = self.rows[0]
            return (
                f"PairResult(distance={float(row['distance'])!r}, hit={bool(row['hit'])}, "
                f"certified={bool(row['certified'])}, how={HOW[row['how']]!r})"
            )
        return f"PairResult(<{len(self.rows)} rows>, hits={int(self.rows['hit'].sum())})"


def _row_number(k, count: int) -> int:
    try:
        return range(count)[k]
    except IndexError:
        raise IndexError(f"there are results 0 … {count - 1}, not {k}" if count else "there are no results") from None
    except TypeError:
        raise InvalidArgument(f"a result is named by its number, got {k!r}") from None


class WorldResult:
    """Rows of a World query, sorted by (a, b), with the bodies as they stood.

    Indexing by a field name gives that column; ``names`` resolves the ids; ``pair(k)`` is row k as a
    `PairResult`, with its certificate.
    """

    __slots__ = ("_bodies", "rows")

    def __init__(self, rows: np.ndarray, bodies: dict):
        self.rows, self._bodies = rows, bodies

    def pair(self, k: int) -> PairResult[Single]:
        """Row k as the result of a pair query: ``collide.verify(*r.question, r)`` checks its certificate."""
        row = self.rows[_row_number(k, len(self.rows))]
        a, b = self._bodies[int(row["a"])], self._bodies[int(row["b"])]
        return PairResult(row.reshape(1), True, (a.shape, b.shape, a.X_WB[None], b.X_WB[None]))

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    @overload
    def __getitem__(self, key: Literal["distance", "lower", "upper", "normal", "point_a", "point_b"]) -> Floats: ...
    @overload
    def __getitem__(self, key: Literal["hit", "certified", "beyond"]) -> Bools: ...
    @overload
    def __getitem__(self, key: Literal["how", "exact", "count"]) -> Bytes: ...
    @overload
    def __getitem__(
        self, key: Literal["a", "b", "part_a", "part_b", "vertices_a", "vertices_b", "iterations"]
    ) -> Ints: ...
    @overload
    def __getitem__(self, key: int) -> np.void: ...
    @overload
    def __getitem__(self, key: slice | Bools | Sequence[int] | NDArray[np.integer]) -> np.ndarray: ...
    def __getitem__(self, key):
        return self.rows[key]

    @property
    def names(self) -> list[tuple[str, str]]:
        """(name of a, name of b), row by row."""
        return [(self._bodies[int(a)].name, self._bodies[int(b)].name) for a, b in zip(self.rows["a"], self.rows["b"])]

    def __repr__(self) -> str:
        return f"WorldResult({len(self.rows)} rows, {int(self.rows['hit'].sum())} hits)"
