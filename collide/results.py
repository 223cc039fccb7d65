"""What queries return: structured arrays with documented dtypes, and the names that go with them.

One row of `PAIR_DTYPE` is one pair of bodies A and B; vectors are in the world W, lengths in metres:

=============== ============ ======================================================================================
distance        float64      signed: the gap, or minus the depth (the length of a translation that separates A and B)
lower, upper    float64      proven bounds of the true signed distance, rounding included
normal          float64 (3,) unit vector nhat_AB_W: moving B by −distance·normal brings the pair to touch
point_a         float64 (3,) witness point p_WAa of A
point_b         float64 (3,) witness point p_WBb of B
a, b            int32        ids of the bodies, a < b; 0 and 1 for a pair query
part_a, part_b  int32        which convex part (of a mesh, which facet) of A and of B is meant; 0 for one convex set
vertices_a      int32 (4,)   ids of the core vertices of A that span the deciding feature: apart, the features nearest
                             each other; together, a simplex of A ⊖ B around the origin. −1 for curved cores
vertices_b      int32 (4,)   of B; pair by pair with vertices_a
iterations      int32        iterations of GJK (low 16 bits) and of EPA (high 16 bits), for diagnosis; of unions the
                             sum over all pairs of parts that were asked
count           int32        how many of the four vertex pairs count
how             int32        which argument decided: the value of a `How`, an index into `HOW`
exact           uint8        iterations of the exact stage, 0 where doubles decided
hit             bool         the closed sets A and B share a point
certified       bool         the sign is proven, and the bracket keeps the promise of `narrowphase/bounds.py`
beyond          bool         the pair is farther apart than the query's max_distance
=============== ============ ======================================================================================

Invariants, asserted in the tests; u is a few units in the last place of the largest coordinate of the two bodies:

    lower ≤ distance ≤ upper
    hit = (distance ≤ 0)                                   where certified
    |normal| = 1 ± u;  normal = 0                          for hits of ``distance(signed=False)``
    point_b − point_a = distance · normal ± u              unless beyond
    beyond:  max_distance ≤ lower = distance,  upper = ∞
    flipped(flipped(rows)) = rows                          byte for byte
    distance(B, A).rows = flipped(distance(A, B).rows)     byte for byte but for a and b, unless (A, X_WA) and (B, X_WB)
                                                           are the same: then the normal is a fixed one of the two
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from struct import Struct
from typing import TYPE_CHECKING, Any, Generic, Literal, overload

import numpy as np

from collide.base import argument_checks as checks
from collide.base.array_libraries import ToLibrary
from collide.base.lazy_modules import lazy_module
from collide.base.worded_enum import WordedEnum
from collide.errors import InvalidArgument

notebook_html = lazy_module("collide.base.notebook_html")

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from typing_extensions import TypeVar

    Floats = NDArray[np.float64]
    Ints = NDArray[np.int32]
    Bytes = NDArray[np.uint8]
    Bools = NDArray[np.bool_]
    #: `Single` or `Batch`; Any where a type checker cannot tell which, and values of fields are Any, too.
    Form = TypeVar("Form", default=Any)
    Scalar = TypeVar("Scalar")
    Column = TypeVar("Column")

    class Field(Generic[Scalar, Column]):
        """A field of a `PairResult` to a type checker: a scalar of a single result, a column of a batch."""

        @overload
        def __get__(self, result: PairResult[Single], owner: object) -> Scalar: ...
        @overload
        def __get__(self, result: PairResult[Batch], owner: object) -> Column: ...
        def __get__(self, result: Any, owner: object) -> Any: ...
else:
    from typing import TypeVar

    Form = TypeVar("Form")


class How(WordedEnum):
    """Which argument decided a pair. A proof stands against both poses as given, entries taken as exact reals.

    Members are the integers of the field ``how``, print as the words of a report, and say what they mean: ``How(1)``,
    ``str(How(1))`` = "separating plane", ``How(1).meaning``.
    """

    UNDECIDED = 0, "the bracket reaches to both sides of 0: touching within rounding"
    SEPARATING_PLANE = 1, "a plane with all of A on one side and all of B on the other"
    COMMON_POINT = 2, "a simplex of points of A ⊖ B around the origin, clear of rounding"
    SWEPT_OVERLAP = 3, "two core points nearer than the sum of the radii"
    CLOSED_FORM = 4, "a formula with an error bound: spheres, capsules, half-spaces"
    EXACT_ARITHMETIC = 5, "integers, where doubles leave the sign open or the last digit of a gap or depth"


#: Words of the arguments that decide, by the value of the field ``how``.
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
#: How a number of a row is read from memory, and where it begins; and what vectors are of, how long, and where.
_NUMBERS: dict[str, tuple[Callable, int]] = {}
_VECTORS: dict[str, tuple[np.dtype, int, int]] = {}
for _name, (_dtype, _at, *_) in (PAIR_DTYPE.fields or {}).items():
    if _dtype.shape:
        _VECTORS[_name] = _dtype.base, _dtype.shape[0], _at
    else:
        _NUMBERS[_name] = Struct("=" + _dtype.char).unpack_from, _at


def flipped(rows: np.ndarray) -> np.ndarray:
    """Rows of `PAIR_DTYPE` (n,) with A and B exchanged, exactly: fields of A and of B swapped, normals negated."""
    swapped = rows.copy()
    for of_a, of_b in (("a", "b"), ("part_a", "part_b"), ("point_a", "point_b"), ("vertices_a", "vertices_b")):
        swapped[of_a], swapped[of_b] = rows[of_b], rows[of_a]
    swapped["normal"] = 0.0 - rows["normal"]  # never −0.0
    return swapped


class Single:
    """``PairResult[Single]``, to type checkers: of single poses; fields are scalars and (3,) arrays."""


class Batch:
    """``PairResult[Batch]``, to type checkers: fields are arrays with a leading N."""


#: (A, B, X_WA, X_WB): shapes, or sequences of them, and poses (N, 4, 4) or (1, 4, 4).
Question = tuple[Any, Any, np.ndarray, np.ndarray]


class PairResult(ToLibrary, Generic[Form]):
    """Answer of a pair query: the fields of `PAIR_DTYPE` as attributes.

    Parameters
    ----------
    rows : (N,) `PAIR_DTYPE`, the structured array itself.
    is_single : whether the query was about a single pair of poses. Then attributes are scalars and (3,) arrays, and
        ``how`` is a `How`; of batches they are arrays with a leading N, and ``r[k]`` is the result of row k.
    question : (A, B, X_WA, X_WB) as asked: shapes, or sequences of them, and poses with a leading N or 1.
    certify : what makes certificates of it, `collide.certify`.
    """

    # A result of a single call has `_single` alone, (A, B, memory, certify), until another of these is asked for:
    # arrays take longer to set up than two boxes' distance. Memory holds its row, then the poses of A and of B.
    __slots__ = ("_certify", "_single", "is_single", "question", "rows")

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
        how: Field[How, Ints]
        iterations: Field[int, Ints]
        exact: Field[int, Bytes]
        count: Field[int, Ints]
        a: Field[int, Ints]
        b: Field[int, Ints]
        part_a: Field[int, Ints]
        part_b: Field[int, Ints]
        vertices_a: Field[Ints, Ints]
        vertices_b: Field[Ints, Ints]

    def __init__(self, rows: np.ndarray, is_single: bool, question: Question, certify: Callable):
        self.rows, self.is_single, self.question, self._certify = rows, is_single, question, certify
        self._single = None

    def __reduce__(self):
        return type(self), (self.rows, self.is_single, self.question, self._certify)

    @property
    def certificate(self):
        """Plain data as proof of the boolean, worked out on request: `collide.certify`.

        A tuple of `Certificate`, for each pair of parts in the proof; ``None`` for pairs without a certificate. A list
        of tuples for batches. `collide.verify` checks a certificate in Python integers.
        """
        return self._certify(*self.question, self)

    @overload
    def __getitem__(self, k: int) -> PairResult[Single]: ...
    @overload
    def __getitem__(self, k: slice) -> PairResult[Batch]: ...
    def __getitem__(self, k):
        """Result k of a batch, or a batch of those in a slice. Raises IndexError, InvalidArgument."""
        if isinstance(k, slice):
            return PairResult(self.rows[k], False, _questions_at(self.question, k), self._certify)
        k = row_number(k, len(self.rows))
        return PairResult(self.rows[k : k + 1], True, question_of_row(self.question, k), self._certify)

    if not TYPE_CHECKING:  # checkers are to know the fields above, and no others

        def __getattr__(self, name: str):
            if name in PairResult.__slots__:
                single = self._single
                if single is not None:
                    self._open(*single)
                return object.__getattribute__(self, name)  # another thread may have opened it meanwhile
            raise AttributeError(f"no field {name!r}; there are {', '.join(FIELDS)}")

        def _open(self, A, B, memory: bytearray, certify: Callable) -> None:
            poses = np.frombuffer(memory, np.float64, 32, PAIR_DTYPE.itemsize).reshape(2, 1, 4, 4)
            self.__init__(np.frombuffer(memory, PAIR_DTYPE, 1), True, (A, B, *poses), certify)

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        if self.is_single:
            row = self.rows[0]
            return (
                f"PairResult(distance={float(row['distance'])!r}, hit={bool(row['hit'])}, "
                f"certified={bool(row['certified'])}, how={HOW[row['how']]!r})"
            )
        return f"PairResult(<{len(self.rows)} rows>, hits={int(self.rows['hit'].sum())})"

    def _repr_html_(self) -> str:
        head = ("pair", "distance [m]", "lower", "upper", "hit", "decided by")
        listed = (
            (k, *(f"{row[name]:.6g}" for name in ("distance", "lower", "upper")), bool(row["hit"]), HOW[row["how"]])
            for k, row in enumerate(self.rows)
        )
        return notebook_html.page_of(repr(self), head, listed, len(self.rows))


def with_columns(dtype: np.dtype) -> Callable[[type], type]:
    """Decorates results of many rows: every field of their ``rows`` is an attribute, a column, as of a `PairResult`."""

    def decorate(cls: type) -> type:
        for name in dtype.names or ():
            if not hasattr(cls, name):
                setattr(cls, name, _column(name))
        return cls

    return decorate


def _column(name: str) -> property:
    def column(self: Any) -> np.ndarray:
        return self.rows[name]

    return property(column, doc=f"``{name}``, row by row.")


def field_at(dtype: np.dtype, field: str, unit: int) -> int:
    """Where a field of a record begins, in units of so many bytes."""
    assert dtype.fields is not None
    return dtype.fields[field][1] // unit


def zeroed_rows(n: int, dtype: np.dtype) -> np.ndarray:
    """n records of zeros: for single calls, where `np.zeros` takes half a microsecond to set up a dtype of fields."""
    return np.frombuffer(bytearray(n * dtype.itemsize), dtype)


def only_value(column: np.ndarray):
    """What a column of one row holds: a number of Python's, or a vector of its own."""
    return column[0].copy() if column.ndim > 1 else column[0].item()


def _field(name: str) -> property:
    """A field of a `PairResult`: a number of Python's, or a vector of its own; of batches a column."""
    unpack, at = _NUMBERS.get(name, (None, 0))
    dtype, length, begin = _VECTORS.get(name, (np.dtype("f8"), 0, 0))

    def field(self: PairResult) -> Any:
        single = self._single  # read once: another thread may open it meanwhile
        if single is None:
            value = only_value(self.rows[name]) if self.is_single else self.rows[name]
        elif unpack is None:
            return np.frombuffer(single[2], dtype, length, begin).copy()
        else:
            (value,) = unpack(single[2], at)
        return How(value) if name == "how" and value.__class__ is int else value  # type: ignore[call-arg]

    return property(field, doc=f"``{name}``, as in the table of `collide.results`.")


if not TYPE_CHECKING:
    for _name in FIELDS:
        setattr(PairResult, _name, _field(_name))


def question_of_row(question: Question, k: int) -> Question:
    """The question of row k of its results: two shapes, and poses (1, 4, 4)."""
    A, B, X_WA, X_WB = _questions_at(question, slice(k, k + 1))
    A, B = (S[0] if isinstance(S, Sequence) else S for S in (A, B))
    return A, B, X_WA, X_WB


def _questions_at(question: Question, rows: slice) -> Question:
    A, B, X_WA, X_WB = question
    A, B = (S[rows] if isinstance(S, Sequence) else S for S in (A, B))
    X_WA, X_WB = (X if len(X) == 1 else X[rows] for X in (X_WA, X_WB))
    return A, B, X_WA, X_WB


def row_number(k, count: int) -> int:
    try:
        return range(count)[k + 0]
    except IndexError:
        where = f", not {k}" if abs(k) < 10**18 else ""
        raise IndexError(f"there are results 0 … {count - 1}{where}" if count else "there are no results") from None
    except (TypeError, ValueError):
        raise InvalidArgument(f"k must be the number of a result, got {checks.brief(k)}") from None


@with_columns(PAIR_DTYPE)
class WorldResult(ToLibrary):
    """Rows of a World query, sorted by (a, b), with the bodies as they stood.

    Parameters
    ----------
    rows : (n,) `PAIR_DTYPE`, a and b the ids of bodies.
    bodies : {id: body as it stood}, with ``name``, ``shape`` and ``X_WB`` (4, 4).
    certify : makes the certificates of a row, `collide.certify`.

    Notes
    -----
    Every field is an attribute, a column, as of a `PairResult` of a batch. Indexing by the name of a field gives the
    column, by a number a row, by a slice or a mask rows. ``names`` resolves the ids; ``pair(k)`` is row k as a
    `PairResult`, with its certificate.
    """

    __slots__ = ("_bodies", "_certify", "rows")

    if TYPE_CHECKING:
        distance: Floats
        lower: Floats
        upper: Floats
        normal: Floats
        point_a: Floats
        point_b: Floats
        hit: Bools
        certified: Bools
        beyond: Bools
        how: Ints
        iterations: Ints
        exact: Bytes
        count: Ints
        a: Ints
        b: Ints
        part_a: Ints
        part_b: Ints
        vertices_a: Ints
        vertices_b: Ints

    def __init__(self, rows: np.ndarray, bodies: Mapping, certify: Callable):
        self.rows, self._bodies, self._certify = rows, bodies, certify

    def pair(self, k: int) -> PairResult[Single]:
        """Row k as the result of a pair query: ``collide.verify(*r.question, r)`` checks its certificate.

        Parameters
        ----------
        k : its number; negative ones count from the end.

        Returns
        -------
        PairResult : of the bodies as they stood.

        Raises
        ------
        IndexError, InvalidArgument
        """
        row = self.rows[row_number(k, len(self.rows))]
        a, b = self._bodies[int(row["a"])], self._bodies[int(row["b"])]
        return PairResult(row.reshape(1), True, (a.shape, b.shape, a.X_WB[None], b.X_WB[None]), self._certify)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[np.void]:
        return iter(self.rows)

    @overload
    def __getitem__(self, key: Literal["distance", "lower", "upper", "normal", "point_a", "point_b"]) -> Floats: ...
    @overload
    def __getitem__(self, key: Literal["hit", "certified", "beyond"]) -> Bools: ...
    @overload
    def __getitem__(self, key: Literal["exact"]) -> Bytes: ...
    @overload
    def __getitem__(
        self, key: Literal["a", "b", "part_a", "part_b", "vertices_a", "vertices_b", "iterations", "count", "how"]
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
        least = f", least distance {float(self.rows['distance'].min()):.6g} m" if len(self.rows) else ""
        return f"WorldResult({len(self.rows)} rows, {int(self.rows['hit'].sum())} hits{least})"

    def _repr_html_(self) -> str:
        order = np.argsort(self.rows["distance"], kind="stable")
        head = ("body a", "body b", "distance [m]", "known to [m]", "decided by")
        listed = (
            (
                *(self._bodies[int(row[body])].name for body in ("a", "b")),
                f"{row['distance']:.6g}", f"{row['upper'] - row['lower']:.0e}", HOW[row["how"]],
            )
            for row in self.rows[order]
        )
        return notebook_html.page_of(repr(self), head, listed, len(self.rows))
