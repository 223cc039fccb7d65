"""What comes back from an engine: replies, events on the way, and the table that holds them.

An answer of its own kind is kept apart from right and wrong ones: `MISHAPS`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.adapters.peers.question import Question

#: One row per pair asked. `a`, `b` index the question's bodies. `answered`: the engine gave a boolean.
#: `has_distance`: and a usable number; else `distance` is NaN. `certified`: the engine claims a proof
#: (collide only). `undecided`: it says itself that rounding leaves the boolean open, and calls it a hit
#: (collide only). `lower`, `upper` [m]: its proven bracket. `failed`: it crashed, raised or ran out of
#: time. `unsupported`: it has no such shape or question. Numbers that the engine does not give are NaN.
#: `seconds` is wall time inside this interface, for orientation: Python overhead included, never a
#: benchmark.
TABLE_DTYPE = np.dtype(
    [
        ("distance", "f8"), ("lower", "f8"), ("upper", "f8"),
        ("normal", "f8", 3), ("point_a", "f8", 3), ("point_b", "f8", 3), ("seconds", "f8"),
        ("a", "i4"), ("b", "i4"),
        ("hit", "?"), ("answered", "?"), ("has_distance", "?"), ("certified", "?"), ("undecided", "?"),
        ("failed", "?"), ("unsupported", "?"),
    ],
    align=True,
)

#: Answers of their own kind, neither right nor wrong. RAISED: an exception. ABORTED: the engine ended its process.
#: HUNG: no answer within the time limit. NOT_A_NUMBER: the distance is NaN where the engine gives distances.
#: NO_LENGTH: it is infinite, or ±1.8e308, as engines write what they do not know.
MISHAPS = RAISED, ABORTED, HUNG, NOT_A_NUMBER, NO_LENGTH = "exception", "abort", "hang", "NaN", "no length"
#: Distances from here on are no lengths [m].
_LONGEST = 1e300

#: The note of meshes that meet, of engines that look at one pair of facets at a time.
NO_DEPTH = "boolean only: it gives no depth of meshes"

ANSWERED, FAILED, UNSUPPORTED = STATUSES = "answered", "failed", "unsupported"
BUILDING, ASKING = "building", "asking"
_NOWHERE = (math.nan,) * 3


class Reply(NamedTuple):
    """What an engine says about one pair; plain data, since it crosses process borders.

    distance : signed [m]; None where the engine gives none by its nature, NaN where it gave that.
    normal, point_a, point_b : (3,) in the world; NaN where the engine gives none.
    certified, undecided, lower, upper : as in `TABLE_DTYPE`; only collide fills them.
    note : a remark that belongs to an answer ("the distance was no number").
    """

    hit: bool
    distance: float | None = None
    normal: tuple = _NOWHERE
    point_a: tuple = _NOWHERE
    point_b: tuple = _NOWHERE
    certified: bool = False
    note: str = ""
    undecided: bool = False
    lower: float = math.nan
    upper: float = math.nan


class Event(NamedTuple):
    """One step of an engine at work.

    kind : a row's status (ANSWERED, FAILED, UNSUPPORTED), or where the engine is now: BUILDING a
        body, ASKING a row. A child process that dies is known to have died there.
    at : index of the body for BUILDING, of the row otherwise.
    mishap : of FAILED: one of `MISHAPS`; RAISED where nothing else is said.
    """

    kind: str
    at: int
    reply: Reply | None = None
    reason: str = ""
    seconds: float = 0.0
    mishap: str = ""


class Table:
    """Answers of one engine: ``rows`` of `TABLE_DTYPE` in the order asked, ``reasons`` and ``mishaps``.

    ``reasons`` has one text per row: empty, or why there is no answer, or a remark about it. ``mishaps`` has one of
    `MISHAPS` per row, or an empty text.

    Parameters
    ----------
    question : Question
        What was asked.
    engine, version : str
        Who answers.
    """

    def __init__(self, question: Question, engine: str, version: str):
        self.engine, self.version = engine, version
        self.rows = np.zeros(len(question.pairs), TABLE_DTYPE)
        self.reasons = [""] * len(question.pairs)
        self.mishaps = [""] * len(question.pairs)
        for name in ("distance", "lower", "upper", "normal", "point_a", "point_b"):
            self.rows[name] = np.nan
        if question.pairs:
            self.rows["a"], self.rows["b"] = np.array(question.pairs).T

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        counts = ", ".join(f"{int(self.rows[n].sum())} {n}" for n in STATUSES)
        return f"Table({self.engine} {self.version}: {len(self)} rows, {counts})"

    def record(self, event: Event) -> None:
        """Write one row's event down; distances that are no finite length are dropped, with a remark.

        Parameters
        ----------
        event : Event
            About one row.
        """
        row = self.rows[event.at]
        row["seconds"], row[event.kind] = event.seconds, True
        self.reasons[event.at] = event.reason
        if event.reply is None:
            self.mishaps[event.at] = (event.mishap or RAISED) if event.kind == FAILED else ""
            return
        reply = event.reply
        for name in ("hit", "certified", "undecided", "lower", "upper", "normal", "point_a", "point_b"):
            row[name] = getattr(reply, name)
        remark = reply.note
        if reply.distance is None:
            pass
        elif abs(reply.distance) < _LONGEST:
            row["distance"], row["has_distance"] = reply.distance, True
        else:
            self.mishaps[event.at] = NOT_A_NUMBER if math.isnan(reply.distance) else NO_LENGTH
            remark = f"the distance {reply.distance:g} is no length"
        self.reasons[event.at] = remark or event.reason


def nearest(replies: list[Reply]) -> Reply:
    """The reply of a union: it hits where any part hits, and is as far as its nearest part."""
    if len(replies) == 1:
        return replies[0]
    hit = any(reply.hit for reply in replies)
    for reply in replies:
        if reply.distance is None or math.isnan(reply.distance):  # the nearest part may be the one without a number
            return Reply(hit, reply.distance, note=reply.note)
    return min(replies, key=_distance)._replace(hit=hit)


def _distance(reply: Reply) -> float:
    return math.nan if reply.distance is None else reply.distance


def counted(mishaps: dict[str, int]) -> str:
    """Mishaps by kind in a cell: "2 abort, 1 NaN"."""
    return ", ".join(f"{mishaps[kind]} {kind}" for kind in MISHAPS if kind in mishaps) or "0"
