"""Pairs of parts of two unions in a motion, in the order of the spans of time in which they may first meet.

In a span of length h points of the two unions come nearer each other by at most μ h / 2 from the middle of the span on
(`span_bounds.py`, for the unions as a whole). Parts whose boxes are farther apart at the middle do not meet in the
span. Spans with too many remaining pairs are cut in half.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from collide.kernels import address_of
from collide.lowering.compound_table import PART
from collide.motion.motions import Motions
from collide.motion.moving_body import BODY
from collide.motion.span_bounds import BEGIN, END, HEADER, OUT, REACH, WORKSPACE, balls_meet_in_motion, describe_span
from collide.narrowphase.composite.composite_parts import CompoundParts, boxes_near

#: Of so few pairs of parts all are asked.
MAX_ASKED = 64
#: Spans are cut until bodies move by so much of the smaller one's reach in half of them, or are so short.
_LEAST_MOVED, _SHORTEST = 2.0**-6, 2.0**-46


#: Doubles, or addresses, from one motion to the next: of matrices, and of angular velocities.
_STRIDES = (16, 16, 16, 16, 3, 3)


class Spans:
    """Spans of one motion of two pieces.

    parts : (2, PART) where they are in their bodies.   reaches : how far each reaches from its own origin, and their
    slop [m].
    """

    def __init__(self, parts: np.ndarray, reaches: tuple[float, float, float], motion: Motions):
        self.parts, self.reaches, self.motion = parts, np.array(reaches), motion
        self._work, self._out = np.zeros(WORKSPACE), np.zeros(OUT)
        addresses = [0 if X is None else address_of(X) for X in motion]
        self.header = np.array([*addresses, address_of(self.parts), address_of(self.reaches)], dtype=np.int64)

    def describe(self, begin: float, end: float) -> np.ndarray:
        """What `describe_span` gives, until it is called again."""
        describe_span(address_of(self.header), begin, end, address_of(self._work), address_of(self._out))
        return self._out

    @property
    def bodies(self) -> np.ndarray:
        """(2, BODY) of both pieces (`moving_body.py`), once a span was described."""
        return self._work[: 2 * BODY].reshape(2, BODY)

    def between_origins(self, time: float) -> np.ndarray:
        """(3,) from the origin of body A to that of B."""
        a0, a1, b0, b1 = (X[0, :3, 3] for X in self.motion[:4])
        return (b0 - a0) + time * ((b1 - a1) - (b0 - a0))

    def time_of_balls(self) -> tuple[float, float]:
        """The time in which balls about both bodies' origins meet; begin > end where they never do."""
        return tuple(self.describe(0.0, 1.0)[BEGIN : END + 1].tolist())


def balls_meet(A: CompoundParts, B: CompoundParts, motions: Motions, n: int) -> np.ndarray:
    """(n,) bool: in which of n motions balls about the origins of two unions meet; `parts_ahead` is empty in all
    others.

    About a microsecond a motion.
    """
    if A.unbounded or B.unbounded:
        return np.ones(n, dtype=bool)
    spans = spans_of(A, B, motions)
    strides = [0 if X is None or len(X) == 1 else 8 * doubles for X, doubles in zip(motions, _STRIDES)]
    steps, of_motion = np.array([*strides, 0, 0], dtype=np.int64), np.empty(HEADER, dtype=np.int64)
    work, met = np.zeros(WORKSPACE + OUT), np.empty(n, dtype=bool)
    balls_meet_in_motion(
        address_of(spans.header), address_of(steps), n, address_of(work), address_of(of_motion), address_of(met)
    )
    return met


def spans_of(A: CompoundParts, B: CompoundParts, motion: Motions) -> Spans:
    """Of two unions as a whole."""
    parts = np.zeros((2, PART))
    parts[:, [0, 4, 8]] = 1.0
    return Spans(parts, (A.radius, B.radius, A.slop + B.slop), motion)


def parts_ahead(
    A: CompoundParts, B: CompoundParts, motion: Motions, upper: Callable[[], float], max_pairs: int
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yields (parts of A, parts of B) (k,), ascending, of pairs not yielded before, span by span: no other pairs
    meet before a time.

    upper : gives the time, which may shrink meanwhile.   max_pairs : a span with more pairs is cut.
    """
    named = np.zeros((len(A.parts), len(B.parts)), dtype=bool)
    spans = spans_of(A, B, motion)
    least = _LEAST_MOVED * min(A.radius, B.radius)
    is_unbounded = A.unbounded or B.unbounded
    begin, end = (0.0, 1.0) if is_unbounded else spans.time_of_balls()
    # while balls of this size meet, parts that are spread over them are near in about the third power of the reach
    size = math.inf if is_unbounded else A.radius + B.radius
    to_do = [(begin, end)] if begin <= end else []
    while to_do:
        begin, end = to_do.pop()
        end = min(end, upper())
        if begin > end:
            continue
        out = spans.describe(begin, end)
        may_cut = end - begin > _SHORTEST and out[REACH] > least
        near = None if may_cut and (out[REACH] / size) ** 3 * named.size > max_pairs else _boxes_near(A, B, out)
        if near is not None:
            a, b = near[:, ~named[near[0], near[1]]]
        if near is None or (len(a) > max_pairs and may_cut):
            middle = 0.5 * (begin + end)
            to_do += [(middle, end), (begin, middle)]
            continue
        named[a, b] = True
        if len(a):
            order = np.lexsort((b, a))
            yield a[order], b[order]


def _boxes_near(A: CompoundParts, B: CompoundParts, out: np.ndarray) -> np.ndarray:
    """(2, k) parts of A and of B that may meet in a span, described by ``out``."""
    X_A, X_B = out[:16].reshape(4, 4).copy(), out[16:32].reshape(4, 4).copy()
    reach = float(out[REACH]) + _turn_together(A, B, X_A, X_B)
    return np.stack(boxes_near(A, B, X_A[None], X_B[None], reach)[1:])


def _turn_together(A: CompoundParts, B: CompoundParts, X_A: np.ndarray, X_B: np.ndarray) -> float:
    """Turn both, in place, until a body of a single part stands along the axes, where its box is tight; returns how
    much rounding of the turn may take from distances [m]."""
    if len(A.parts) > 1 and len(B.parts) > 1:
        return 0.0
    Q, _ = np.linalg.qr(X_B[:3, :3] if len(B.parts) == 1 else X_A[:3, :3])  # a rotation or mirror, to rounding
    X_A[:3], X_B[:3] = Q.T @ X_A[:3], Q.T @ X_B[:3]
    return 2.0**-44 * (A.radius + B.radius + float(np.abs(X_B[:3, 3]).sum()))
