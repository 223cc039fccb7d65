"""Casts of bodies of convex parts: kernels in doubles, and what these leave open decided exactly or said to be open."""

from __future__ import annotations

from fractions import Fraction
from threading import local
from typing import NamedTuple

import numpy as np

from collide.casts.cast_pairs import CAST_ROW, LOWER, NORMAL, QUESTION, STATUS, TOUCHING, UPPER, VALUE, cast_pairs
from collide.casts.close_casts import (
    MARKS,
    PACE_TERMS,
    close_casts,
    list_starts,
    meet_at_start,
    part_starts,
    settle_levels,
)
from collide.casts.exact_cast import cast_exactly, corners_of
from collide.casts.portal import BEHIND, HIT, LEVEL, MISS, OPEN
from collide.casts.posed_parts import PartPairs, PosedParts
from collide.casts.silhouette import CAST_DOUBLES, CAST_INTEGERS
from collide.certificates.exact_parts import common_vertices
from collide.kernels import address_of
from collide.lowering.packed_convex import HALFSPACE
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.numerics.exact_points import in_integers, integers, rounded
from collide.numerics.exact_vectors import inner


class CastRows(NamedTuple):
    """Answers of n questions.

    hit, proven, certified, at_start : (n,) bool.   t : (n, 3) value, from below, from above.
    normal : (n, 3) from A to B.   point : (n, 3) in W.   item_a, item_b : (n,) parts that touch.
    """

    hit: np.ndarray
    proven: np.ndarray
    certified: np.ndarray
    at_start: np.ndarray
    t: np.ndarray
    normal: np.ndarray
    point: np.ndarray
    item_a: np.ndarray
    item_b: np.ndarray


class Marks(NamedTuple):
    """(k,) bool each: proven, the row's status is proven; certified, the bracket is as narrow as promised, too;
    at_start, the bodies touch before they move.
    """

    proven: np.ndarray
    certified: np.ndarray
    at_start: np.ndarray


class PairRows(NamedTuple):
    """Rows of pairs of parts (k, CAST_ROW), what is known of them, the question of each, and which parts they are."""

    rows: np.ndarray
    marks: Marks
    owner: np.ndarray
    item_a: np.ndarray
    item_b: np.ndarray


class _Workspace(local):
    """Scratch memory of one thread."""

    def __init__(self) -> None:
        self.doubles = np.zeros(CAST_DOUBLES)
        self.integers = np.zeros(CAST_INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_workspace = _Workspace()


def workspace() -> tuple[int, int]:
    """Addresses of this thread's scratch memory for casts: doubles, integers."""
    return _workspace.addresses


def answer_questions(pairs: PartPairs, directions: np.ndarray, limits: np.ndarray) -> PairRows:
    """Rows of all pairs of parts.

    directions : (n, 3), the largest component below 1 and at least ½.   limits : (n,) of t.
    """
    rows, marks = answer_part_pairs(pairs.parts, pairs.pairs, _questions(pairs.owner, directions, limits))
    return PairRows(rows, marks, pairs.owner, pairs.item_a, pairs.item_b)


def answer_part_pairs(parts: PosedParts, pairs: np.ndarray, questions: np.ndarray) -> tuple[np.ndarray, Marks]:
    """(rows (k, CAST_ROW) whose status is HIT or MISS, what is known of them) of k pairs of parts."""
    k = len(pairs)
    rows, columns = _kernel_rows(parts, pairs, questions), np.empty((MARKS, k), dtype=np.uint8)
    marks = Marks(*columns.view(bool))
    if not k:
        return rows, marks
    listed, terms = np.empty(k, dtype=np.int64), np.empty(PACE_TERMS)
    asked = *map(address_of, (parts.shape_of, pairs, questions)), k, address_of(rows)
    numbers_at, poses_at = parts.table.addresses[1], address_of(parts.poses.rows)
    _settle_starts(parts, pairs, rows, columns, listed)
    for i in listed[: settle_levels(numbers_at, poses_at, *asked, address_of(terms), address_of(listed))].tolist():
        _settle_level(parts, pairs[i], questions[i], rows[i])
    for i in listed[: close_casts(*parts.table.addresses, *asked, address_of(columns), address_of(listed))].tolist():
        settle_exactly(parts, pairs[i], questions[i], rows[i])
    return rows, marks


def earliest_contacts(pairs: PartPairs, directions: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(k,) t before which pairs of convex sets have no contact: infinity without a contact within the limit.

    First contacts of bodies within the sets are not earlier: where the bodies touch, so do the sets. Some
    microseconds a pair, nothing is decided exactly.
    """
    rows = _kernel_rows(pairs.parts, pairs.pairs, _questions(pairs.owner, directions, limits))
    bounds = np.where(rows[:, STATUS] == LEVEL, 0.0, np.maximum(rows[:, LOWER], 0.0))  # a gap's bracket, no t
    bounds[rows[:, STATUS] == MISS] = np.inf
    behind = np.flatnonzero((rows[:, STATUS] == BEHIND) & (rows[:, UPPER] <= 0.0))
    if len(behind):  # the way leads away from what they share a point with now, or never
        hits = run_pairs(
            pairs.parts.table, pairs.parts.poses, pairs.parts.shape_of, pairs.pairs[behind], boolean=True, limit=0.0
        )["hit"]
        bounds[behind] = np.where(hits, 0.0, np.inf)
    return bounds


def _questions(owner: np.ndarray, directions: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(k, QUESTION) of the casts that own pairs."""
    questions = np.empty((len(owner), QUESTION))
    questions[:, :3], questions[:, 3] = directions[owner], limits[owner]
    return questions


def _kernel_rows(parts: PosedParts, pairs: np.ndarray, questions: np.ndarray) -> np.ndarray:
    rows = np.zeros((len(pairs), CAST_ROW))
    if len(pairs):
        cast_pairs(
            *parts.table.addresses, address_of(parts.poses.rows), address_of(parts.shape_of), address_of(pairs),
            address_of(questions), len(pairs), address_of(rows), *workspace(),
        )
    return rows


def _settle_starts(parts: PosedParts, pairs, rows: np.ndarray, marks: np.ndarray, listed: np.ndarray) -> None:
    """Begin the marks, and decide by pair queries which rows touch at the start.   listed : (k,) int64 to work in."""
    of_rows = address_of(rows), address_of(marks), len(rows), address_of(listed)
    count = list_starts(*of_rows)
    for settle in (part_starts, meet_at_start):
        if count:
            answers = run_pairs(
                parts.table, parts.poses, parts.shape_of, pairs[listed[:count]], boolean=settle is part_starts,
                limit=0.0, depths=False,
            )
            count = settle(*of_rows, count, address_of(answers))


def settle_exactly(parts: PosedParts, pair: np.ndarray, question: np.ndarray, row: np.ndarray) -> None:
    """Decide a row in exact numbers: HIT, with the tightest doubles around t, or MISS."""
    if parts.packed(pair[1]).kind == HALFSPACE:
        _settle_plane(parts, pair, question, row)
    else:
        points_a, points_b, grid = common_vertices(parts.exact(pair[0]), parts.exact(pair[1]))
        settle_points(points_a, points_b, grid, question, row)


def settle_points(points_a, points_b, grid: int, question: np.ndarray, row: np.ndarray) -> None:
    """Write the row of two hulls of integer points times 2^grid."""
    d, exponent = integers(question[:3])
    contact = cast_exactly(corners_of(points_a), corners_of(points_b), d)
    if contact.t is None or contact.t * Fraction(2) ** (grid - exponent) > float(question[3]):
        row[STATUS] = MISS
        return
    row[STATUS] = HIT
    row[VALUE], row[LOWER], row[UPPER] = rounded(contact.t, grid - exponent)
    if any(contact.normal):
        largest = max(abs(v) for v in contact.normal)
        normal = np.array([float(v / largest) for v in contact.normal])
        row[NORMAL : NORMAL + 3] = normal / np.linalg.norm(normal)
    point = [sum(weight * points_b[j][axis] for (_, j), weight in contact.weights.items()) for axis in range(3)]
    row[TOUCHING : TOUCHING + 3] = [float(Fraction(v) * Fraction(2) ** grid) for v in point]


def _settle_level(parts: PosedParts, pair, question, row) -> None:
    """Decide exactly whether a body before a half-space comes nearer at all; t from the bracket of its gap."""
    normal, _ = parts.exact(pair[1]).plane
    pace = -inner(normal, [Fraction(v) for v in question[:3].tolist()])
    if pace <= 0:
        row[STATUS] = MISS
        return
    largest = max(abs(v) for v in normal)
    per_length = float(pace / largest) / float(np.linalg.norm([float(v / largest) for v in normal]))
    t = row[[LOWER, VALUE, UPPER]] / per_length * [1 - 2.0**-48, 1.0, 1 + 2.0**-48]
    row[STATUS] = MISS if t[0] > question[3] else HIT if t[2] <= question[3] else OPEN
    row[[LOWER, VALUE, UPPER]] = t


def _settle_plane(parts: PosedParts, pair, question, row) -> None:
    """Write the row of a hull A and a half-space B, by the height of its lowest vertex."""
    normal, offset = parts.exact(pair[1]).plane
    points = parts.exact(pair[0]).vertices
    lowest = points[points.first_along(in_integers(normal))]
    scale = Fraction(2) ** points.grid
    height = inner(normal, lowest) * scale - offset
    pace = -inner(normal, [Fraction(v) for v in question[:3].tolist()])
    if height <= 0:
        t = Fraction(0)
    elif pace <= 0:
        row[STATUS] = MISS
        return
    else:
        t = height / pace
    if t > float(question[3]):
        row[STATUS] = MISS
        return
    row[STATUS] = HIT
    row[VALUE], row[LOWER], row[UPPER] = rounded(t)
    row[TOUCHING : TOUCHING + 3] = [
        float(v * scale + t * Fraction(d)) for v, d in zip(lowest, question[:3].tolist())
    ]


def joined(some: list[PairRows]) -> PairRows:
    """Rows of all, in order."""
    nothing = np.zeros(0, dtype=np.int64)
    some = [PairRows(np.zeros((0, CAST_ROW)), Marks(*np.zeros((3, 0), dtype=bool)), nothing, nothing, nothing), *some]
    marks = Marks._make(np.concatenate(columns) for columns in zip(*(pairs.marks for pairs in some)))
    numbers = (np.concatenate([getattr(pairs, name) for pairs in some]) for name in ("owner", "item_a", "item_b"))
    return PairRows(np.concatenate([pairs.rows for pairs in some]), marks, *numbers)


def first_contacts(pairs: PairRows, n: int) -> CastRows:
    """Of each question the pair of parts that is met first; of several at the same t the first in order."""
    rows, marks = pairs.rows, pairs.marks
    hits = np.flatnonzero(rows[:, STATUS] == HIT)
    out = nothing_met(n)
    if not len(hits):
        return out
    owner = pairs.owner[hits]
    order = np.lexsort((pairs.item_b[hits], pairs.item_a[hits], rows[hits, VALUE], owner))
    hits, owner = hits[order], owner[order]
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    first, question = hits[starts], owner[starts]
    out.hit[question] = True
    out.t[question, 1] = np.minimum.reduceat(rows[hits, LOWER], starts)
    # What may be no hit bounds nothing from above, unless there is nothing else.
    upper = np.minimum.reduceat(np.where(marks.proven[hits], rows[hits, UPPER], np.inf), starts)
    out.t[question, 2] = np.where(np.isinf(upper), np.maximum.reduceat(rows[hits, UPPER], starts), upper)
    out.t[question, 0] = np.clip(rows[first, VALUE], out.t[question, 1], out.t[question, 2])
    # An open pair that is farther than the first contact has no say in it.
    matters = rows[hits, LOWER] <= np.repeat(out.t[question, 2], np.diff([*starts, len(hits)]))
    out.certified[question] = np.logical_and.reduceat(marks.certified[hits] | ~matters, starts)
    out.proven[question] = np.logical_or.reduceat(marks.proven[hits], starts)
    out.at_start[question] = marks.at_start[first]
    out.normal[question], out.point[question] = rows[first, NORMAL : NORMAL + 3], rows[first, TOUCHING : TOUCHING + 3]
    out.item_a[question], out.item_b[question] = pairs.item_a[first], pairs.item_b[first]
    return out


def nothing_met(n: int) -> CastRows:
    """Rows of n questions that are misses, proven."""
    yes, no, none = np.ones(n, dtype=bool), np.zeros(n, dtype=bool), np.full(n, -1, dtype=np.int64)
    return CastRows(
        no, yes, yes.copy(), no.copy(), np.full((n, 3), np.inf), np.zeros((n, 3)), np.zeros((n, 3)), none, none.copy()
    )
