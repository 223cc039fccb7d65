"""Pairs of shapes made ready for single calls: kept with A, under B's number, for as long as both live.

A pair goes with A, its holder. The pair goes with B by a weak reference, held by A as well: nothing outside of the two
shapes knows of the pair, and the callback at the end of B refers to A weakly. The trees and tables of a pair must not
hold the shapes.
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable
from functools import partial
from typing import Any

from collide.kernels import PLAIN_PYTHON
from collide.shapes.shape import Shape

#: Answers of a question about two poses (4, 4), or None where it is left to the long way.
Single = Callable[..., Any]

#: Numbers of shapes within this process, never used again.
_serials = itertools.count()
_set, _ref = object.__setattr__, weakref.ref
#: A shape keeps this many partners.
_MAX_PARTNERS = 512


class Prepared:
    """Two shapes made ready for single calls: a function for each question, ``None`` where the question is not ready.

    Functions take poses X_WA, X_WB, C-contiguous (4, 4) float64, and return ``None`` where the answer is left to the
    long way: of other arrays, of invalid poses, and where the answer takes more than one call of a kernel.

    collide(X_WA, X_WB) : whether the bodies meet.
    within(X_WA, X_WB, margin) : whether they are at most so far apart [m].
    distance(X_WA, X_WB, memory, depths, limit) : any bool; ``memory``, a bytearray that begins with zeros, then begins
        with the pair's row of `PAIR_DTYPE`; depths and limit [m] as of `convex_batches.Question`.
    contacts(X_WA, X_WB, max_contacts, margin) : bytes of the rows of `CONTACT_DTYPE`.
    collide_poses(X_WA, X_WB) : of a batch, (N, 4, 4) both or a single pose (4, 4) with it: (N,) bool.
    distance_poses(X_WA, X_WB, depths, limit) : of a batch: its finished rows, and copies (N or 1, 4, 4) of the poses.
    table : read by batches of the pair: a `ShapeTable`, a `CompoundTable` or a `FacetPair`, or ``None``.
    header : of two shapes of a few numbers, the block of `lower_pair.py`.
    missing_faces : of two unions, `CompoundContacts`, which makes the faces that a call of ``contacts`` missed.
    cast : a `SingleWay`: casts that miss by the balls around the bodies.
    impact, impact_bounds : tables for motions (`motion/convex_motions.py`), of the shapes and of convex sets around.
    held : other objects in use by kernels.
    """

    __slots__ = (
        "__weakref__", "cast", "collide", "collide_poses", "contacts", "distance", "distance_poses", "header", "held",
        "impact", "impact_bounds", "missing_faces", "table", "within",
    )

    def __init__(
        self, *, collide: Single | None = None, within: Single | None = None, distance: Single | None = None,
        contacts: Single | None = None, collide_poses: Single | None = None, distance_poses: Single | None = None,
        table: Any = None, held: Any = None, header: Any = None, cast: Any = None,
    ):
        self.collide, self.within, self.distance, self.contacts = collide, within, distance, contacts
        self.collide_poses, self.distance_poses = collide_poses, distance_poses
        self.table, self.held, self.header, self.cast = table, held, header, cast
        self.impact = self.impact_bounds = None
        self.missing_faces: Any = None

    def take(self, made: Prepared) -> None:
        """Take what has been made ready, for questions not ready here."""
        for name in _PARTS:
            if getattr(self, name) is None:
                setattr(self, name, getattr(made, name))
        self.held = self.held, made.held


_PARTS = [name for name in Prepared.__slots__ if name not in ("__weakref__", "held")]


def prepared_pair(A: Shape, B: Shape) -> Prepared | None:
    """The pair, or ``None`` where not prepared. `native/python_module.c` reads the same two attributes."""
    pairs = getattr(A, "_prepared", None)
    return pairs.get(getattr(B, "_serial", None)) if pairs.__class__ is dict else None  # a class has a descriptor there


def single_calls_are_safe() -> bool:
    return not PLAIN_PYTHON  # plain Python lets go of its lock in mid-kernel


def kept_pair(A: Shape, B: Shape) -> Prepared:
    """The pair kept with A; a new pair with nothing ready where A keeps no pair."""
    pair = prepared_pair(A, B)
    if pair is None:
        pair = Prepared()
        keep_prepared(A, B, pair)
    return pair


def keep_prepared(A: Shape, B: Shape, pair: Prepared) -> None:
    prepared, partners = getattr(A, "_prepared", None), getattr(A, "_partners", None)
    if prepared is None:
        prepared = {}
        _set(A, "_prepared", prepared)
    if partners is None:
        partners = {}
        _set(A, "_partners", partners)
    serial = getattr(B, "_serial", None)
    if serial is None:
        serial = next(_serials)
        _set(B, "_serial", serial)
    if len(prepared) >= _MAX_PARTNERS:
        # a list: other threads add, and partners that go take
        for oldest in list(prepared)[: len(prepared) + 1 - _MAX_PARTNERS]:
            _forget(lambda: A, oldest)
    prepared[serial] = pair
    partners[serial] = _ref(B, partial(_forget, _ref(A), serial))


def _forget(A: Callable[[], Shape | None], serial: int, _: Any = None) -> None:
    """A partner is gone. Nothing of this module is called: at the end of the process its names are gone before."""
    shape = A()
    if shape is not None:
        shape._prepared.pop(serial, None)
        shape._partners.pop(serial, None)
