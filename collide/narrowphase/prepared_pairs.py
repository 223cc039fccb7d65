"""Pairs of shapes made ready for single calls: kept with A, under B's number, for as long as both live.

A pair goes with A, its holder. The pair goes with B by a weak reference, held by A as well: nothing outside of the two
shapes knows of the pair, and the callback at the end of B refers to A weakly. The trees and tables of a pair must not
hold the shapes.

Single calls write into workspaces of the pair and of its kernels. Python's lock keeps them for one thread at a time.
Without the lock a pair is kept under B's number and the thread, and its workspaces are the thread's
(`base/free_threads.py`): threads share shapes and trees, which do not change.
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable
from functools import partial
from threading import get_ident
from typing import Any

from collide.base.fork_safe_lock import ForkSafeLock
from collide.base.free_threads import FREE_THREADED
from collide.kernels import PLAIN_PYTHON
from collide.shapes.shape import Shape

#: Answers of a question about two poses (4, 4), or None where it is left to the long way.
Single = Callable[..., Any]

#: Numbers of shapes within this process, never used again.
_serials = itertools.count()
_set, _ref = object.__setattr__, weakref.ref
#: Held where a shape gets its number or its first partner: threads that ask at once must see the same.
_beginning = ForkSafeLock()
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
    pairs, key = getattr(A, "_prepared", None), getattr(B, "_serial", None)
    if FREE_THREADED:
        key = key, get_ident()
    return pairs.get(key) if pairs.__class__ is dict else None  # a class has a descriptor there


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
    with _beginning.now:
        if getattr(A, "_partners", None) is None:
            _set(A, "_partners", {})
            _set(A, "_prepared", {})
        if getattr(B, "_serial", None) is None:
            _set(B, "_serial", next(_serials))
    prepared, partners, key = A._prepared, A._partners, (B._serial, get_ident()) if FREE_THREADED else B._serial
    if len(prepared) >= _MAX_PARTNERS:
        # a list: other threads add, and partners that go take
        for oldest in list(prepared)[: len(prepared) + 1 - _MAX_PARTNERS]:
            _forget(lambda: A, oldest)
    prepared[key] = pair
    partners[key] = _ref(B, partial(_forget, _ref(A), key))


def _forget(A: Callable[[], Shape | None], key: Any, _: Any = None) -> None:
    """A partner is gone. Nothing of this module is called: at the end of the process its names are gone before."""
    shape = A()
    if shape is not None:
        shape._prepared.pop(key, None)
        shape._partners.pop(key, None)
