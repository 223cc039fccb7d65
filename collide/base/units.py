"""Units of length by their spellings, and scale factors as numbers or as the unit of what is scaled."""

from __future__ import annotations

import math
from typing import Any

from collide.base.lazy_modules import lazy_module
from collide.errors import CollideError, InvalidArgument, brief

#: With numpy, which ``collide --help`` does without.
checks = lazy_module("collide.base.argument_checks")

#: Spellings accepted from a user, in metres.
UNITS = {
    "": 1.0, "m": 1.0, "km": 1e3, "dm": 0.1, "cm": 1e-2, "mm": 1e-3,
    "um": 1e-6, "µm": 1e-6, "μm": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048,
}
#: The same for messages.
UNIT_NAMES = ", ".join(unit for unit in UNITS if unit.isascii() and unit)


def scale_factor(what: str, value: Any, error: type[CollideError] = InvalidArgument) -> float:
    """The factor that ``0.001`` or ``"mm"`` stands for: metres in a unit of the numbers to be scaled.

    what : "scale", for messages.   Raises ``error`` for all but a finite number other than 0, or a unit.
    """
    if isinstance(value, str) and value.strip() and value.strip() in UNITS:
        return UNITS[value.strip()]
    number = None if isinstance(value, bool) else checks.number(value)
    if number is None or not math.isfinite(number) or number == 0.0:
        raise error(f"{what} must be a finite number other than 0, or a unit, one of {UNIT_NAMES}; got {brief(value)}")
    return number
