"""Numbers as people read them: lengths with a unit, coordinates, seconds.

JSON carries full precision; these are for the terminal. Every length keeps at least three
significant digits and its unit, so that a 1 µm part and a 1 km terrain both read well.
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


def volume(cubic_metres: float) -> str:
    """A volume inside a sentence: ``1.5 m³``, ``12.3 cm³``, ``0.4 mm³``."""
    for unit, size in (("m³", 1.0), ("cm³", 1e-6)):
        if cubic_metres >= 0.1 * size:
            return f"{cubic_metres / size:.4g} {unit}"
    return f"{cubic_metres / 1e-9:.4g} mm³"


def lengths(values) -> list[str]:
    """A column of lengths, decimal points aligned, each with its own unit."""
    split = [_split(float(v)) for v in values]
    digits = max((len(number) for number, _ in split), default=0)
    units = max((len(unit) for _, unit in split), default=0)
    return [f"{number:>{digits}} {unit:<{units}}" for number, unit in split]


def _split(metres: float) -> tuple[str, str]:
    size = abs(metres)
    if not math.isfinite(size):
        return "unbounded", ""
    if size >= 1e6 or 0 < size < 1e-7:
        return f"{metres:.2e}", "m"
    if size >= 10:
        return f"{metres:.3f}", "m"
    if 0 < size < 1e-4:
        return f"{metres * 1e6:.3f}", "µm"
    return f"{metres * 1e3:.3f}", "mm"


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
