"""Numbers, arrays and file paths as callers hand them in, read by the same rules: anything but a number is refused by
name.

Any holder of real numbers will do: Python's own, fractions and decimals, numpy's of any width, nested sequences,
objects with ``__array__``. Not complex numbers (a part would be lost), masked entries (they would be unmasked), text,
dates and times, ``None``. A number too large for a double is refused as not finite, not as an overflow.
"""

from __future__ import annotations

import contextlib
import math
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from collide.base import array_libraries
from collide.errors import CollideError, InvalidArgument, brief

#: Array kinds read directly; arrays of objects are read entry by entry.
_REAL = "fiub"
_KINDS = {
    "c": "complex numbers", "m": "time spans", "M": "dates", "U": "text", "S": "bytes", "V": "records", "T": "text",
    "O": "objects",
}


def number(value: Any) -> float | None:
    """A real number as a double, infinite for numbers beyond doubles; ``None`` for anything else."""
    if isinstance(
        value, (str, bytes, bytearray, complex, np.complexfloating, np.timedelta64, np.datetime64, np.character)
    ):
        return None
    if _is_masked(value) or (isinstance(value, np.ndarray) and (value.ndim or value.dtype.kind not in _REAL + "O")):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
    except (TypeError, ValueError, ArithmeticError, RecursionError):
        return None


def limit(what: str, value: Any, unit: str = " [m]") -> float:
    """A limit: a number ≥ 0, or infinity where given as infinity. Raises InvalidArgument."""
    if type(value) is float and value >= 0.0:  # what single calls come with
        return value
    read = number(value)
    if read is None or not read >= 0.0 or (math.isinf(read) and value != read):
        raise InvalidArgument(f"{what} must be a number ≥ 0{unit}, at most 1.8e308 or infinite, got {brief(value)}")
    return read


def length(what: str, value: Any) -> float:
    """A finite length ≥ 0 [m]. Raises InvalidArgument."""
    read = number(value)
    if read is None or not 0.0 <= read < math.inf:
        raise InvalidArgument(f"{what} must be a number, finite and not negative [m], got {brief(value)}")
    return read


def number_within(what: str, value: Any, lowest: float, highest: float, error: type[CollideError]) -> float:
    """A number from ``lowest`` to ``highest``, no True or False; −0 as 0. Raises ``error``."""
    read = None if isinstance(value, (bool, np.bool_)) else number(value)
    if read is None or not lowest <= read <= highest:
        raise error(f"{what} must lie within [{lowest:g}, {highest:g}], got {brief(value)}")
    return read + 0.0


def is_integer(value: Any) -> bool:
    """Whether the value is an integer: neither a bool nor a time span, an integer to numpy."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.timedelta64))


def integer(what: str, value: Any, least: int, error: type[CollideError] = InvalidArgument) -> int:
    """An integer. Raises ``error``."""
    if not is_integer(value) or value < least:
        raise error(f"{what} must be an integer ≥ {least}, got {brief(value)}")
    return int(value)


def checked_index(what: str, value: Any, count: int) -> int:
    """A place among ``count``, from the end where it is negative, as 0 … count − 1. Raises InvalidArgument."""
    if not is_integer(value) or not -count <= value < count:
        raise InvalidArgument(f"{what} must be an integer, one of {count}: 0 … {count - 1}, got {brief(value)}")
    return int(value) % count


def true_or_false(what: str, value: Any) -> bool:
    """True or False, also as 1 or 0 or numpy's; nothing whose truth is a guess. Raises InvalidArgument."""
    if value.__class__ is bool:
        return value
    if isinstance(value, np.bool_) or (is_integer(value) and value in (0, 1)):
        return bool(value)
    raise InvalidArgument(f"{what} must be True or False, got {brief(value)}")


def text(what: str, value: Any, error: type[CollideError] = InvalidArgument) -> str:
    """A text. Raises ``error``."""
    if not isinstance(value, str):
        raise error(f"{what} must be a text, got {brief(value)}")
    return value


def instance(what: str, value: Any, kind: Any, example: str, error: type[CollideError] = InvalidArgument) -> Any:
    """A value of a kind. example : how to come by one, for messages. Raises ``error``."""
    if not isinstance(value, kind):
        raise error(f"{what} must be {example}, got {brief(value)}")
    return value


def listed_entries(what: str, value: Any, wanted: str, error: type[CollideError] = InvalidArgument) -> list:
    """The entries of whatever can be gone through but text, bytes and sets. wanted : for messages. Raises ``error``."""
    if not isinstance(value, (str, bytes, bytearray, set, frozenset)):
        with contextlib.suppress(TypeError):
            return list(value)
    raise error(f"{what} must be {wanted}, got {brief(value)}")


def listed_texts(what: str, value: Any, wanted: str, error: type[CollideError] = InvalidArgument) -> list[str]:
    """The entries, each a text, of whatever can be gone through but a text. wanted : for messages. Raises ``error``."""
    entries = listed_entries(what, value, wanted, error)
    for k, entry in enumerate(entries):
        if not isinstance(entry, str):
            raise error(f"{what} must be {wanted}, got {brief(entry)} as entry {k}")
    return [str(entry) for entry in entries]


def mapping(what: str, value: Any, wanted: str, error: type[CollideError] = InvalidArgument) -> Mapping:
    """A mapping. wanted : for messages. Raises ``error``."""
    return instance(what, value, Mapping, f"a mapping, {wanted}", error)


def file_path(what: str, value: Any, error: type[CollideError] = InvalidArgument) -> Path:
    """A path that files can have. Raises ``error``."""
    if not isinstance(value, (str, os.PathLike)) or "\0" in str(value):
        raise error(f"{what} must be the path of a file, a text or a pathlib.Path, got {brief(value)}")
    return Path(value)


def array(what: str, value: Any, wanted: str, error: type[CollideError]) -> np.ndarray:
    """Real numbers as a float64 array of any shape; the caller's own array where already float64.

    what : "Box: size", for messages.   wanted : the wanted shape, for messages.
    Raises ``error`` for anything but real numbers. The caller has to check for finite numbers.
    """
    numbers_given = plain_array(what, value, wanted, error)
    if numbers_given.dtype == np.float64:
        return numbers_given
    if numbers_given.dtype.kind in _REAL:
        return numbers_given.astype(np.float64)
    if numbers_given.dtype.kind != "O":
        raise error(
            f"{what} must be real numbers {wanted}, got {_KINDS.get(numbers_given.dtype.kind, numbers_given.dtype)}: "
            f"{brief(value)}"
        )
    read = [number(entry) for entry in numbers_given.ravel().tolist()]
    if None in read:
        k = read.index(None)
        where = list(map(int, np.unravel_index(k, numbers_given.shape))) if numbers_given.ndim else ""
        raise error(
            f"{what}{where} must be a real number (all of it {wanted}), got {brief(numbers_given.ravel()[k])}"
        )
    return np.array(read, dtype=np.float64).reshape(numbers_given.shape)


def whole_numbers(what: str, value: Any) -> np.ndarray:
    """(n,) int64 numbers of things, from one or many. Raises InvalidArgument."""
    read = plain_array(what, value, "(n,) integers", InvalidArgument)
    if read.size == 0:
        return np.zeros(0, dtype=np.int64)
    if read.dtype.kind not in "iu" or read.ndim > 1 or (read.dtype.kind == "u" and (read > 2**63 - 1).any()):
        raise InvalidArgument(f"{what} must be integers (n,) below 2**63, got {brief(value)}")
    return read.astype(np.int64).reshape(-1)


def vectors(caller: str, name: str, values) -> tuple[np.ndarray, bool]:
    """((n, 3) finite float64, whether a single vector was handed in). Raises InvalidArgument."""
    read = array(f"{caller}: {name}", values, "(3,) or (N, 3)", InvalidArgument)
    if read.ndim not in (1, 2) or read.shape[-1] != 3:
        raise InvalidArgument(f"{caller}: {name} must be (3,) or (N, 3), got {read.shape}")
    rows = np.ascontiguousarray(read.reshape(-1, 3))
    are_finite = np.isfinite(rows)
    if not are_finite.all():
        refuse_rows(caller, name, rows, ~are_finite.all(axis=1), "has entries that are not finite")
    return rows, read.ndim == 1


def refuse_rows(caller: str, name: str, rows: np.ndarray, bad: np.ndarray, complaint: str) -> None:
    """Raises InvalidArgument naming the first bad row, if any."""
    if bad.any():
        k = int(np.argmax(bad))
        raise InvalidArgument(f"{caller}: {name}[{k}] {complaint}, got {rows[k].tolist()}")


def matched_count(caller: str, **counts: int) -> int:
    """The length of a batch, given or single in every argument; sequences of shapes, A and B, are never
    single. Raises InvalidArgument, naming the caller if given."""
    n = max(counts.values()) if min(counts.values()) else 0
    if any(count != n and (count != 1 or name in ("A", "B")) for name, count in counts.items()):
        lengths = ", ".join(f"{name} {count}" for name, count in counts.items())
        by = f"{caller}: " if caller else ""
        raise InvalidArgument(f"{by}lengths do not match: {lengths}; batches must be equally long, or a single one")
    return n


def plain_array(what: str, value: Any, wanted: str, error: type[CollideError]) -> np.ndarray:
    """Any array or array-like, of any type: nothing ragged, masked, or nested without end."""
    if _is_masked(value) or (isinstance(value, (list, tuple)) and any(map(_is_masked, value))):
        raise error(f"{what} has masked entries; fill them or leave them out ({wanted} is wanted)")
    if (refusal := array_libraries.refusal(value)) is not None:
        raise error(f"{what} {refusal}; got {brief(value)}")
    try:
        return array_libraries.read(value)
    except (TypeError, ValueError, OverflowError, RecursionError, MemoryError, RuntimeError) as reason:
        if hasattr(value, "__array__"):  # a sparse tensor, for instance: its own words tell more
            raise error(f"{what} must be an array of numbers {wanted}: {reason}; got {brief(value)}") from None
        # numpy's own words for rows of different lengths are long, and tell no more
        raise error(
            f"{what} must be numbers of shape {wanted}, and no rows of different lengths, got {brief(value)}"
        ) from None


def no_path(what: str, value: Any, reader: str, error: type[CollideError]) -> None:
    """Raises ``error`` for a path or text where numbers are wanted.   reader : what reads files, for the message."""
    if isinstance(value, (str, os.PathLike)):
        raise error(f"{what} must be numbers, got {brief(value)}; files are read by {reader}")


def _is_masked(value: Any) -> bool:
    # Whoever has a masked array has imported the module, all of it; importing it costs a tenth of numpy's own start.
    masks = sys.modules.get("numpy.ma")
    masked = getattr(masks, "MaskedArray", None)  # another thread may be importing it at this moment
    return masked is not None and isinstance(value, masked) and bool(masks.getmaskarray(value).any())  # type: ignore[union-attr]
