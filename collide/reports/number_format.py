"""Numbers as people read them: lengths with a unit, coordinates, seconds.

JSON carries full precision; these are for the terminal. Every length keeps at least three significant digits and its
unit, the same for all of a column, so that a 1 µm part and a 1 km terrain both read well.
"""

from __future__ import annotations

import math

from collide.base.units import UNIT_NAMES, UNITS
from collide.errors import InvalidArgument


def parse_length(text: str, what: str = "length") -> float:
    """Metres from ``"0.05"``, ``"50mm"`` or ``"5 cm"``; refuses what is negative or not finite."""
    stripped = text.strip()
    unit = stripped.lstrip("+-.0123456789eE")  # no unit starts with an e, so "1e-3m" splits rightly
    number = stripped[: len(stripped) - len(unit)]
    try:
        value = float(number) * UNITS[unit.strip()]
    except (ValueError, KeyError):
        raise InvalidArgument(
            f"{what} must be a number of metres or carry one of the units {UNIT_NAMES}, got {text!r}"
        ) from None
    if not (math.isfinite(value) and value >= 0):
        raise InvalidArgument(f"{what} must be finite and not negative, got {text!r}")
    return value


def brief_length(metres: float) -> str:
    """A length inside a sentence: ``50 mm``, ``1.5 m``, ``20 µm``."""
    size = abs(metres)
    if size == 0 or 1e-3 <= size < 1:
        return f"{metres * 1e3:.6g} mm"
    if size >= 1:
        return f"{metres:.6g} m"
    if size >= 1e-7:
        return f"{metres * 1e6:.6g} µm"
    return f"{metres:.3g} m"


def parted(distance: float) -> str:
    """A signed distance in words: ``4 mm deep``, ``20 mm apart``."""
    return f"{brief_length(abs(distance))} {'deep' if distance < 0.0 else 'apart'}"


def volume(cubic_metres: float) -> str:
    """A volume inside a sentence: ``1.5 m³``, ``12.3 cm³``, ``0.4 mm³``."""
    for unit, size in (("m³", 1.0), ("cm³", 1e-6)):
        if cubic_metres >= 0.1 * size:
            return f"{cubic_metres / size:.4g} {unit}"
    return f"{cubic_metres / 1e-9:.4g} mm³"


def lengths(values) -> list[str]:
    """A column of lengths, all in the unit of the largest, aligned to the right."""
    sizes = [float(v) for v in values]
    finite = [abs(v) for v in sizes if math.isfinite(v)]
    unit, factor = _unit_of(max(finite)) if finite else ("", None)
    numbers = [_in_unit(v, factor) if math.isfinite(v) else "unbounded" for v in sizes]
    width = max(map(len, numbers), default=0)
    return [f"{number:>{width}} {unit if math.isfinite(v) else '':<{len(unit)}}" for number, v in zip(numbers, sizes)]


def _unit_of(largest: float) -> tuple[str, float | None]:
    """(unit, units in a metre) of a column; ``None`` where numbers are powers of ten of a metre."""
    if largest >= 1e6 or 0.0 < largest < 1e-7:
        return "m", None
    if largest >= 10.0:
        return "m", 1.0
    return ("mm", 1e3) if largest >= 1e-4 or largest == 0.0 else ("µm", 1e6)


def _in_unit(metres: float, factor: float | None) -> str:
    """Three decimals, more where these would be less than three significant digits."""
    if factor is None:
        return f"{metres:.2e}" if metres else "0.000"
    value = metres * factor
    size = abs(value)
    if size == 0.0 or size >= 0.0995:
        return f"{value:.3f}"
    return f"{value:.2e}" if size < 1e-4 else f"{value:.{2 - math.floor(math.log10(size))}f}"


def widths(values) -> list[str]:
    """Widths of proven brackets [m], with a single digit."""
    return ["exact" if v == 0 else "unbounded" if not math.isfinite(v) else f"{v:.0e} m" for v in values]


def coordinates(points) -> tuple[str, list[str]]:
    """``(unit, texts)`` for a column of positions: one unit for all, numbers aligned axis by axis.

    points : list of (x, y, z) [m].
    """
    largest = max((abs(c) for point in points for c in point), default=1.0)
    for unit, metres in (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6)):
        if largest >= metres * 0.05 or largest == 0:
            return unit, _triples([[c / metres for c in point] for point in points], ".3f")
    return "m", _triples(points, ".2e")


def directions(normals) -> list[str]:
    """A column of unit vectors, two decimals."""
    return _triples(normals, ".2f")


def _triples(points, form: str) -> list[str]:
    texts = [[_number(c, form) for c in point] for point in points]
    wide = [max((len(row[k]) for row in texts), default=0) for k in range(3)]
    return [" ".join(f"{c:>{w}}" for c, w in zip(row, wide)) for row in texts]


def _number(value: float, form: str) -> str:
    text = format(value, form)
    return text[1:] if text.startswith("-") and float(text) == 0 else text


def seconds(value: float) -> str:
    """``0.3 ms``, ``12 ms``, ``1.23 s``."""
    if value >= 0.9995:
        return f"{value:.2f} s"
    return f"{value * 1e3:.1f} ms" if value < 0.00995 else f"{value * 1e3:.0f} ms"


def count(n: int, singular: str, plural: str | None = None) -> str:
    """``1 pair``, ``3 pairs``."""
    return f"{n} {singular if n == 1 else plural or singular + 's'}"
