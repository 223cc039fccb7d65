"""Checked reading of mappings: every complaint names the file, the element and the value."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn, TypeVar

import numpy as np

from collide.base.units import UNIT_NAMES, UNITS
from collide.errors import LONGEST_MESSAGE, LONGEST_PLACE, CollideError, InvalidPose, SceneError, brief, cut
from collide.transforms import as_poses, pose

T = TypeVar("T")
U = TypeVar("U")


class Fields:
    """One mapping of a document, with its place in the file.

    path : of the file.   element : ``bodies[3] "mug".pose``; empty for the document itself.
    """

    def __init__(self, data: Any, path: object, element: str = "", known: Iterable[str] = ()):
        self.path, self.element, self.data = path, element, data
        if not isinstance(data, Mapping):
            self.fail(f"must be a mapping{_listing(known)}, got {brief(data)}")
        known = tuple(known)
        for key in data:
            if known and key not in known:
                self.fail(f"unknown key {brief(key)}{did_you_mean(key, known)}; known keys are {', '.join(known)}")

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def get(self, key: str, default: Any = None) -> Any:
        return self.data.get(key, default)

    def named(self, name: str) -> Fields:
        """This mapping, its place told with its name: ``bodies[3] "mug"``."""
        self.element = f'{self.element} "{cut(name)}"'
        return self

    def place(self, key: str) -> str:
        return f"{self.element}.{key}" if self.element else key

    def fail(self, what: str, key: str | None = None) -> NoReturn:
        raise SceneError(what, path=self.path, element=(self.place(key) if key else self.element) or None)

    def sub(self, key: str, known: Iterable[str]) -> Fields:
        return Fields(self.data[key], self.path, self.place(key), known)

    def items(self, key: str) -> list[tuple[Any, str]]:
        """The entries of a list, each with its place; an absent or empty key gives none."""
        value = self.data.get(key)
        if value is None:
            return []
        if not isinstance(value, list):
            self.fail(f"must be a list, got {brief(value)}", key)
        return [(entry, f"{self.place(key)}[{k}]") for k, entry in enumerate(value)]

    def words(self, key: str) -> list[str]:
        """A list of names; an absent or empty key gives none."""
        items = self.items(key)
        for word, place in items:
            if isinstance(word, bool) or not isinstance(word, (str, int)):
                raise SceneError(f"must be a name, got {brief(word)}", path=self.path, element=place)
        return [str(word) for word, _ in items]

    def text(self, key: str, default: str | None = None) -> str:
        value = self.data.get(key, default)
        if value is None and default is None:
            self.fail(f"{key!r} is missing")
        if isinstance(value, bool) or not isinstance(value, (str, int)) or not str(value).strip():
            self.fail(f"must be text, got {brief(value)}", key)
        return str(value)

    def choice(self, key: str, options: Iterable[str], default: str) -> str:
        value = self.data.get(key, default)
        options = tuple(options)
        if value not in options:
            self.fail(f"must be one of {', '.join(options)}, got {brief(value)}{did_you_mean(value, options)}", key)
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.data.get(key, default)
        if not isinstance(value, bool):
            self.fail(f"must be true or false, got {brief(value)}", key)
        return value

    def bits(self, key: str, default: int) -> int:
        value = self.data.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 0xFFFF:
            self.fail(f"must be a whole number from 0 to 65535 (16 bits), got {brief(value)}", key)
        return value

    def number(self, key: str, default: float | None = None) -> float:
        if key not in self.data and default is None:
            self.fail(f"{key!r} is missing")
        return self.checked_number(self.data.get(key, default), key)

    def checked_number(self, value: Any, key: str) -> float:
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fail(f"must be a number, got {brief(value)}", key)
        number = _to_float(value)
        if not math.isfinite(number):
            self.fail(f"must be a finite number, got {brief(value)}", key)
        return number

    def scale(self) -> float:
        """The key "scale", 1 by default: a number, or the unit of the numbers to be scaled, as "mm"."""
        value = self.data.get("scale", 1.0)
        if not isinstance(value, str):
            return self.checked_number(value, "scale")
        if not value or value not in UNITS:
            self.fail(f"must be a number or a unit, one of {UNIT_NAMES}; got {brief(value)}", "scale")
        return UNITS[value]

    def numbers(self, key: str, shape: tuple[int | None, ...]) -> np.ndarray:
        """A finite float64 array; None in ``shape`` stands for any length."""
        if key not in self.data:
            self.fail(f"{key!r} is missing")
        expected = " × ".join("N" if n is None else str(n) for n in shape)
        if stranger := _no_number(self.data[key], len(shape)):
            self.fail(f"must be {expected} numbers, got {stranger}", key)
        try:
            array = np.array(self.data[key], dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            self.fail(f"must be {expected} numbers, got {brief(self.data[key])}", key)
        if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape)):
            self.fail(f"must be {expected} numbers, got {brief(self.data[key])}", key)
        if not np.isfinite(array).all():
            self.fail(f"must be finite numbers, got {brief(self.data[key])}", key)
        return array


def read_each(entries: Iterable[T], read: Callable[[T], U]) -> list[U]:
    """What is read of each entry. Raises what the reading of an entry raised, of several entries a single SceneError
    with all complaints, so that everything damaged is known at once.
    """
    results: list[U] = []
    errors: dict[str, CollideError] = {}
    for entry in entries:
        try:
            results.append(read(entry))
        except CollideError as error:
            errors.setdefault(str(error), error)
    if len(errors) == 1:
        raise next(iter(errors.values()))
    if errors:
        raise SceneError.of_several(errors)
    return results


def read_pose(parent: Fields, key: str, metres: float = 1.0) -> np.ndarray:
    """A pose mapping as a (4, 4) matrix; the identity where it is absent.

    metres : how many metres one unit of length is, as a divisor where it is below 1 (see `scaled`).
    """
    if parent.get(key) is None:
        return np.eye(4)
    fields = parent.sub(key, ("xyz", "rpy", "rpy_deg", "quat_wxyz", "quat_xyzw", "matrix"))
    rotations = [name for name in fields.data if name != "xyz"]
    if len(rotations) > 1:
        fields.fail(f"give one of rpy, rpy_deg, quat_wxyz, quat_xyzw and matrix, got {' and '.join(rotations)}")
    try:
        if "matrix" in fields:
            return _matrix(fields, metres)
        xyz = scaled(fields.numbers("xyz", (3,)), metres) if "xyz" in fields else np.zeros(3)
        if "rpy" in fields:
            return pose(xyz, rpy=fields.numbers("rpy", (3,)))
        if "rpy_deg" in fields:
            return pose(xyz, rpy_deg=fields.numbers("rpy_deg", (3,)))
        if "quat_wxyz" in fields:
            return pose(xyz, quat_wxyz=fields.numbers("quat_wxyz", (4,)))
        if "quat_xyzw" in fields:
            return pose(xyz, quat_wxyz=fields.numbers("quat_xyzw", (4,))[[3, 0, 1, 2]])
        return pose(xyz)
    except InvalidPose as error:
        raise InvalidPose(placed(error, fields.path, fields.element)) from None


def placed(error: Exception, path: object, element: str) -> str:
    """A message with the place it is about before it."""
    return f"{path}: {cut(element, LONGEST_PLACE)}: {cut(str(error), LONGEST_MESSAGE)}"


def _matrix(fields: Fields, metres: float) -> np.ndarray:
    if "xyz" in fields:
        fields.fail("a matrix holds the translation already; leave out xyz")
    X = fields.numbers("matrix", (4, 4)).copy()
    X[:3, 3] = scaled(X[:3, 3], metres)
    return as_poses(X, "matrix")[0]


def scaled(values, metres: float):
    """Lengths in metres. Units below the metre are divided out: 250 / 1000 is the float nearest 0.25."""
    return values / round(1.0 / metres) if metres < 1.0 else values * metres


def did_you_mean(word: object, known: Iterable[str]) -> str:
    close = difflib.get_close_matches(cut(str(word)), [str(name) for name in known], n=1)
    return f" (did you mean {brief(close[0])}?)" if close else ""


def _no_number(value: Any, depth: int) -> str:
    """What stands among numbers and is none, in words; lists are ``depth`` deep. Empty where all are numbers.

    numpy would take the text "1.5" and the truth value true as numbers.
    """
    if isinstance(value, np.ndarray):
        return ""
    if depth and isinstance(value, (list, tuple)):
        kinds = set(map(type, value)) - {float, int}
        return next(filter(None, (_no_number(entry, depth - 1) for entry in value)), "") if kinds else ""
    if not depth and isinstance(value, (int, float)) and not isinstance(value, bool):
        return ""
    if isinstance(value, str) and not depth:
        return f"the text {brief(value)}; numbers stand without quotes"
    return brief(value)


def _listing(known: Iterable[str]) -> str:
    known = tuple(known)
    return f" with the keys {', '.join(known)}" if known else ""


def _to_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf
