"""Pairs of shapes made ready for single calls: kept with A, by the number that B has."""

from __future__ import annotations

import itertools
import weakref
from typing import Any

from collide.kernels import PLAIN_PYTHON
from collide.shapes.shape import Shape

#: Numbers of shapes within this process, never used again.
_serials = itertools.count()
#: A shape keeps this many partners.
_MAX_PARTNERS = 512


def prepared_pair(A: Shape, B: Shape, slot: str = "_prepared") -> Any:
    """The pair, or None where it has not been prepared. `query.collide` reads the same two attributes by itself.

    slot : of A, for what it was prepared.
    """
    return getattr(A, slot, {}).get(getattr(B, "_serial", None))


def single_calls_are_safe() -> bool:
    return not PLAIN_PYTHON  # plain Python lets go of its lock in mid-kernel


def keep_prepared(A: Shape, B: Shape, pair: Any, slot: str = "_prepared") -> None:
    if not hasattr(A, slot):
        A._store(**{slot: {}})
    if not hasattr(B, "_serial"):
        B._store(_serial=next(_serials))
    prepared, serial = getattr(A, slot), B._serial
    # a list: other threads add and finalizers take
    for oldest in list(prepared)[: max(0, len(prepared) + 1 - _MAX_PARTNERS)]:
        prepared.pop(oldest, None)
    prepared[serial] = pair
    weakref.finalize(B, prepared.pop, serial, None)  # a partner that is gone is not held
