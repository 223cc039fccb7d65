"""What all shapes share: immutability, value equality, pickling, and checks of their numbers."""

from __future__ import annotations

import math
import weakref
from collections.abc import Callable
from functools import cache, wraps
from typing import Any, TypeVar

import numpy as np

from collide.base import argument_checks as checks
from collide.base.foreign_arguments import foreign_names
from collide.base.fork_safe_lock import ForkSafeLock
from collide.base.lazy_modules import lazy_module
from collide.errors import InvalidArgument, InvalidShape, brief
from collide.transforms import LARGEST, SMALLEST

T = TypeVar("T")
#: With triangles, for notebooks alone.
shape_html = lazy_module("collide.shapes.shape_html")


class Shape:
    """A set of points in its own frame; immutable, picklable, compared by value.

    Subclasses name their constructor arguments in ``_fields`` and store each under its name.
    """

    __slots__ = (
        "__weakref__", "_as_solid", "_bounds", "_convex_parts", "_crossings", "_facet_edges",
        "_hulls_instead", "_inner_balls", "_items", "_kind", "_laid_out", "_leaves", "_link_spheres", "_meshed_leaves",
        "_partners", "_parts", "_pieces", "_prepared", "_ray_way", "_reach", "_serial", "_single_facets",
        "_sphere_rows", "_surface", "_topology", "_union", "_vertex_set", "_walk",
    )
    _fields: tuple[str, ...] = ()
    #: Convex parts, and sets that hold them (`lowering/parts.py`).
    _parts: tuple
    _bounds: tuple
    #: The same with meshes that are convex as what they are (`robots/check_tables.py`).
    _convex_parts: Any
    _hulls_instead: Any
    #: Spheres around and within it, for links (`robots/body_spheres.py`), and as kernels read them, by padding.
    _link_spheres: Any
    _sphere_rows: dict[float, tuple]
    #: Pairs made ready for single calls, by the number of the other shape (`query.py`).
    _prepared: dict[Any, Any]
    _serial: int
    #: Weak references to those other shapes, by their number (`narrowphase/prepared_pairs.py`).
    _partners: dict[Any, Any]
    #: For rays that miss by the ball around the body (`composite/balls_on_ways.py`).
    _ray_way: Any
    #: What a union comes down to, and which of that are meshes (`casts/leaves.py`).
    _leaves: list
    _meshed_leaves: Any
    #: Hierarchies for the walk of Barba and Langerman, made when it is first asked for (`hierarchy_queries.py`).
    _walk: Any
    #: The shape as meshes meet it: facets under a tree, and a radius (`lowering/facet_bodies.py`), or two polytopes.
    _surface: Any
    #: Facets with the shape, one by one (`narrowphase/facets/single_facets.py`).
    _single_facets: Any
    #: Which facets of that share corners, for contacts (`contact/contact_facets.py`).
    _topology: Any
    #: Its parts, as unions with meshes ask about them (`narrowphase/composite/composite_parts.py`).
    _union: Any
    #: Balls within a solid, for least depths (`narrowphase/facets/inner_balls.py`).
    _inner_balls: Any
    #: Its parts in the rows that kernels of compounds read (`lowering/compound_layout.py`).
    _laid_out: Any
    #: Meshes and convex shapes that it is made of, with their trees (`motion/surface_motions.py`).
    _pieces: tuple
    #: How far it reaches from its origin (`lowering/closed_regions.py`).
    _reach: float
    #: A mesh's vertices as one convex set, for the same.
    _vertex_set: Any
    #: A mesh of the same facets (`solids/solid_operands.py`).
    _as_solid: Any
    #: Which facets of a mesh share which edge (`solids/facet_edges.py`).
    _facet_edges: Any
    #: Facets of a mesh that cross each other (`solids/arrangement.py`).
    _crossings: Any
    #: What a field is made of (`narrowphase/fields/field_items.py`).
    _items: Any
    #: Row and column of the pair table (`lowering/kinds.py`).
    _kind: Any

    #: False where the set is not convex: its overlapping distance is a proven bound, not a minimum.
    convex = True
    #: True where triangles are in it (`Mesh`, a `Compound` with one): `parts_of` has no convex parts for those.
    meshed = False
    #: True of an `HPolytope` that is kept as planes: it has no convex parts either, until a box closes it.
    is_region = False
    #: True of point clouds and voxel grids: their balls and cells are parts that nobody lists.
    is_field = False

    @property
    def is_asked_whole(self) -> bool:
        """Whether `parts_of` has no convex parts for it."""
        return self.meshed or self.is_region or self.is_field

    def _store(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; make a new one instead of setting {name}")

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} is immutable; {name} cannot be deleted")

    def __copy__(self) -> Shape:
        return self  # nothing about it can change

    def __deepcopy__(self, memo: dict) -> Shape:
        return self

    def __reduce__(self):
        return _rebuild, (type(self), tuple(getattr(self, f) for f in self._fields))

    def scaled(self, factors: Any) -> Any:
        """The image under factors along the axes of the frame: unequal, negative (a mirror image), or one for all.

        Parameters
        ----------
        factors : float or (3,) array_like
            Along x, y, z, none 0, without a unit.

        Returns
        -------
        Shape
            The image, where a shape of the library is the image: of a `Sphere` with unequal factors an `Ellipsoid`,
            of a `Cone` turned over a `Compound` of one. Poses of the items of a `Compound` stay rotations.

        Raises
        ------
        InvalidShape
            Where a factor is 0 or not finite, numbers leave the supported range, or the image is no shape: unequal
            factors of what is swept by balls, of the base of a cylinder or cone, of a turned item of a `Compound`.

        Notes
        -----
        O(size of the shape). Lengths, points and offsets are products rounded once, normals rounded twice: exact where
        factors are powers of two, ± 1 among them.
        """
        what = f"{type(self).__name__}.scaled"
        s = _scale_factors(what, factors)
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # infinite numbers are refused by the image
                return self._scaled(s)
        except InvalidShape as error:
            raise InvalidShape(f"{what}: factors {s.tolist()}: {error}") from None

    def _scaled(self, s: np.ndarray) -> Any:
        """The image under factors (3,) other than 0."""
        raise InvalidShape(f"no rule for a {type(self).__name__}{POINTS_INSTEAD}")

    def _key(self) -> tuple:
        return tuple(_hashable(getattr(self, f)) for f in self._fields)

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._key() == other._key()

    def __hash__(self) -> int:
        return hash((type(self).__name__, self._key()))

    def _repr_html_(self) -> str:
        return shape_html.shape_html(self)

    def __repr__(self) -> str:
        fields = ", ".join(f"{f}={_brief(getattr(self, f))}" for f in self._fields)
        return f"{type(self).__name__}({fields})"


#: Stands for what a shape does not keep: a default costs a fifth of an exception.
_NOT_MADE: Any = object()
_keeping = ForkSafeLock()


def kept_with_shape(slot: str) -> Callable[[Callable[[Any], T]], Callable[[Any], T]]:
    """Decorates what makes something of a shape: made when first asked for, and kept in this slot of the shape."""

    def decorate(make: Callable[[Any], T]) -> Callable[[Any], T]:
        @wraps(make)
        def of(shape: Any) -> T:
            known = getattr(shape, slot, _NOT_MADE)
            if known is not _NOT_MADE:
                return known
            made = make(shape)
            with _keeping.now:  # of two threads that ask at once both may make one: the first counts
                known = getattr(shape, slot, _NOT_MADE)
                if known is _NOT_MADE:
                    object.__setattr__(shape, slot, made)
            return made if known is _NOT_MADE else known

        return of

    return decorate


def held_by(owner: Shape, shape: Shape) -> Callable[[], Any]:
    """How what is kept with ``owner`` refers to a shape: to the owner weakly, to others strongly.

    A shape with references to itself in what the shape keeps would stay, with its tables and trees, until cycles are
    collected.
    """
    return weakref.ref(shape) if shape is owner else lambda: shape


IDENTITY = np.eye(4)
IDENTITY.flags.writeable = False


def _rebuild(cls, values):
    return cls._from_fields(*values) if hasattr(cls, "_from_fields") else cls(*values)


def _hashable(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.shape, (value + 0.0).tobytes()  # + 0.0: −0.0 and 0.0 are one number
    return value


def _brief(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"<{'×'.join(map(str, value.shape))} array>"
    if isinstance(value, tuple) and len(value) > 2:
        return f"<{len(value)} items>"
    return str(value.tolist()) if isinstance(value, np.ndarray) else repr(value)


# --- checks, each naming shape, field and value -------------------------------------------------


#: What to do about factors that a shape cannot be scaled by.
POINTS_INSTEAD = "; scale the points of a ConvexHull or of a Mesh instead, of tessellate(shape) for example"


def _scale_factors(what: str, factors: Any) -> np.ndarray:
    """(3,) factors along x, y, z other than 0, given as one number or as three."""
    single = checks.number(factors) is not None
    s = rows(what, "factors", (factors,) * 3 if single else factors, (3,))
    if not s.all():
        raise InvalidShape(
            f"{what}: factors must not be 0, got {checks.brief(factors)}; for a flat shape make a ConvexHull of points "
            "in a plane"
        )
    return s


def equal_but_for_signs(s: np.ndarray, why: str) -> float:
    """The magnitude of scale factors. why : what unequal factors would make of a shape, for messages."""
    if not (np.abs(s) == abs(s[0])).all():
        raise InvalidShape(f"they must be equal but for signs, since {why}{POINTS_INSTEAD}")
    return abs(float(s[0]))


def mirrors(factors: Any) -> bool:
    """Whether scale factors make a mirror image; their product could leave the range of numbers."""
    return bool(np.prod(np.sign(factors)) < 0.0)


_PLAIN = float, int, np.float64


def positive(shape: str, field: str, value: Any, *, zero: bool = False) -> float:
    """A finite length [m]: > 0, or ≥ 0 where ``zero`` allows it, of a magnitude we can square."""
    if _is_plain_length(value):
        return float(value)
    number = scalar(shape, field, value)
    if zero and number == 0.0:
        return 0.0
    if not number > 0:
        raise InvalidShape(f"{shape}: {field} must be {'≥ 0' if zero else '> 0'}, got {checks.brief(value)}")
    if not SMALLEST <= number <= LARGEST:
        raise InvalidShape(
            f"{shape}: {field} must lie within [{SMALLEST:g}, {LARGEST:g}] m, got {checks.brief(value)}; scale the "
            "scene"
        )
    return number


def scalar(shape: str, field: str, value: Any) -> float:
    """A finite real number."""
    number = checks.number(value)
    if number is None:
        raise InvalidShape(f"{shape}: {field} must be a number, got {checks.brief(value)}")
    if not math.isfinite(number):
        raise InvalidShape(f"{shape}: {field} must be finite, got {checks.brief(value)}")
    if abs(number) > LARGEST:
        raise InvalidShape(
            f"{shape}: {field} must not exceed {LARGEST:g}, got {checks.brief(value)}; scale the scene"
        )
    return number


def checked_shape(what: str, value: Any, example: str = "collide.Box((1, 1, 1))") -> Shape:
    """A shape. what : "raycast: shape", for messages.   Raises InvalidArgument."""
    if not isinstance(value, Shape):
        advice = foreign_names.advice_on_shape(value)
        raise InvalidArgument(f"{what} must be a shape, for example {example}, got {brief(value)}{advice}")
    return value


def three_lengths(shape: str, field: str, value: Any, y: Any, z: Any, *, zero: bool = False) -> np.ndarray:
    """Lengths > 0, or ≥ 0 where ``zero`` allows 0, along x, y, z: a sequence, or three arguments."""
    if (y is None) != (z is None):
        got = brief((value, y, z))
        raise InvalidShape(f"{shape}: {field} must be three lengths, ({field}) or (x, y, z), got {got}")
    values = value if y is None else (value, y, z)
    numbers = values.tolist() if values.__class__ is np.ndarray else values
    if numbers.__class__ in (tuple, list) and len(numbers) == 3 and all(map(_is_plain_length, numbers)):
        lengths = np.array(numbers, dtype=np.float64)
        lengths.setflags(write=False)
        return lengths
    read = rows(shape, field, values, (3,))
    lengths = np.array([positive(shape, f"{field}.{axis}", length, zero=zero) for axis, length in zip("xyz", read)])
    lengths.setflags(write=False)
    return lengths


def plane_numbers(shape: str, normal: Any, offset: Any) -> tuple[np.ndarray, float]:
    """A normal (3,) with a direction, its length within [1e-6, 1e6], and a finite offset."""
    normal = rows(shape, "normal", normal, (3,))
    length = math.hypot(*normal.tolist())
    if not 1e-6 <= length <= 1e6:
        raise InvalidShape(
            f"{shape}: normal must have a length within [1e-6, 1e6] (1 is usual), got {length:g}"
        )
    return normal, scalar(shape, "offset", offset)


def _is_plain_length(value: Any) -> bool:
    """Whether it is a number of Python's own within the range of lengths: nothing is left to check, or to say."""
    return value.__class__ in _PLAIN and SMALLEST <= value <= LARGEST


def rows(shape: str, field: str, value: Any, wanted: tuple) -> np.ndarray:
    """Finite numbers of a shape (None stands for any length), as a read-only float64 copy."""
    expected = _in_words(wanted)
    array = np.array(checks.array(f"{shape}: {field}", value, expected, InvalidShape), order="C")
    if wanted[0] is None and not len(np.atleast_1d(array)):
        raise InvalidShape(f"{shape}: {field} is empty; at least one row is needed")
    if array.ndim != len(wanted) or any(w not in (None, s) for w, s in zip(wanted, array.shape)):
        raise InvalidShape(f"{shape}: {field} must have shape {expected}, got {array.shape}")
    if not np.abs(array).max(initial=0.0) <= LARGEST:  # NaN, too
        bad = ~(np.abs(array) <= LARGEST)
        where = tuple(int(k) for k in np.argwhere(bad)[0])
        raise InvalidShape(
            f"{shape}: {field}{list(where)} is {array[where]}; entries must be finite and within ±{LARGEST:g}"
        )
    array.setflags(write=False)
    return array


@cache
def _in_words(wanted: tuple) -> str:
    """The shape of an array, for messages."""
    return "(" + ", ".join("N" if w is None else str(w) for w in wanted) + ("," if len(wanted) == 1 else "") + ")"


def facet_ids(shape: str, value: Any, n: int, dtype: type, corners: str) -> np.ndarray:
    """(m, 3) ids of corners 0 … n − 1, as a read-only copy. corners : what the ids count, for messages."""
    array = checks.plain_array(f"{shape}: faces", value, "(m, 3)", InvalidShape)
    if array.ndim != 2 or array.shape[1] != 3:
        cut = "; cut polygons into triangles" if array.ndim == 2 and array.shape[1] > 3 else ""
        raise InvalidShape(f"{shape}: faces must have shape (m, 3), got {array.shape}{cut}")
    if array.dtype.kind not in "iu":
        raise InvalidShape(f"{shape}: faces must be integers, got {_first_odd(array)}")
    outside = ((array < 0) | (array >= n)).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        n_outside = int(outside.sum())
        raise InvalidShape(
            f"{shape}: faces[{row}] is {array[row].tolist()}, but there are {corners.format(n=n, last=n - 1)}"
            f" ({n_outside} such facet{'s' * (n_outside != 1)})"
        )
    array = np.array(array, dtype=dtype, order="C")
    array.flags.writeable = False
    return array


def _first_odd(array: np.ndarray) -> str:
    """What is wrong with ids that are no integers: the first NaN or fraction with its facet, else the type."""
    if array.dtype.kind == "f":
        odd = ~np.isfinite(array) | (array != np.floor(array))
        if odd.any():
            row, k = (int(i) for i in np.argwhere(odd)[0])
            return f"faces[{row}, {k}] = {array[row, k]}"
    return f"{array.dtype} (ids that are whole: faces.astype(int))"
