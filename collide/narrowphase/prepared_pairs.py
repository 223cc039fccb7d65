"""Pairs of shapes made ready for single calls: kept with A, by the number that B has, for as long as both live.

A pair goes with A, which holds it. It goes with B by a weak reference, which A holds as well: nothing outside of the
two shapes knows of the pair, and what the end of B calls refers to A weakly. The trees and tables of shapes that a pair
holds must not hold the shapes.
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable
from functools import partial
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
    prepared, partners = _dictionary(A, slot), _dictionary(A, "_partners")
    serial = getattr(B, "_serial", None)
    if serial is None:
        serial = next(_serials)
        object.__setattr__(B, "_serial", serial)
    if len(prepared) >= _MAX_PARTNERS:
        # a list: other threads add, and partners that go take
        for oldest in list(prepared)[: len(prepared) + 1 - _MAX_PARTNERS]:
            _forget(lambda: A, slot, oldest)
    prepared[serial] = pair
    partners[slot, serial] = weakref.ref(B, partial(_forget, weakref.ref(A), slot, serial))


def _dictionary(A: Shape, slot: str) -> dict:
    entries = getattr(A, slot, None)
    if entries is None:
        entries = {}
        object.__setattr__(A, slot, entries)
    return entries


def _forget(A: Callable[[], Shape | None], slot: str, serial: int, _: Any = None) -> None:
    """A partner is gone. Nothing of this module is called: at the end of the process its names are gone before."""
    shape = A()
    if shape is not None:
        getattr(shape, slot).pop(serial, None)
        shape._partners.pop((slot, serial), None)
