"""Distances of a batch of configurations: what the kernels find, then what they leave to others, and gradients."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument, brief
from collide.kernels import address_of
from collide.results import PAIR_DTYPE, flipped
from collide.robots import open_pairs
from collide.robots.check_scene import N_OPEN, OPEN_LOWER
from collide.robots.check_tables import Setting
from collide.robots.check_workspace import CheckWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.configuration_batches import asked_poses, both_bodies
from collide.robots.distance_gradients import WITNESS, distance_gradients, point_jacobians
from collide.robots.nearest_pairs import (
    AMONG_ROBOT,
    FIRST_LIMIT,
    GROWTH,
    LAST_LIMIT,
    NONE,
    OF_BODY,
    OF_PAIR,
    OF_ROBOT,
    WITH_AROUND,
    near_pairs,
    nearest_pairs,
)
from collide.robots.robot_distances import NEAREST_DTYPE, RobotDistances

#: What a row is of, and between which bodies pairs are asked, by the words of `RobotChecker.distances`.
PER = {"robot": OF_ROBOT, "link": OF_BODY, "pair": OF_PAIR}
BETWEEN = {"all": WITH_AROUND | AMONG_ROBOT, "world": WITH_AROUND, "self": AMONG_ROBOT}
#: Slots for rows of pairs that a search begins with.
_PAIR_SLOTS = 4096
#: Slots that a workspace keeps for the next search, at most: 13 MB.
_MAX_KEPT_SLOTS = 1 << 16


class DistanceQuestion(NamedTuple):
    """limit : max_distance [m].   per, between : of `nearest_pairs.py`."""

    limit: float = math.inf
    per: int = OF_ROBOT
    between: int = WITH_AROUND | AMONG_ROBOT


def distance_question(caller: str, max_distance, per, between) -> DistanceQuestion:
    """The question of `RobotChecker.distances`, its words checked."""
    limit = checks.limit(f"{caller}: max_distance", max_distance)
    return DistanceQuestion(limit, _word(caller, "per", per, PER), _word(caller, "between", between, BETWEEN))


def _word(caller: str, name: str, value, words: dict[str, int]) -> int:
    if not isinstance(value, str) or value not in words:
        known = ", ".join(f'"{word}"' for word in words)
        raise InvalidArgument(f"{caller}: {name} must be one of {known}, got {brief(value)}")
    return words[value]


class Slots:
    """Buffers of a search, of `nearest_pairs.SEARCH` words.

    is_asked : (slots,) bool, slots with a tested pair.   rows : (slots,) PAIR_DTYPE for rows of pairs.
    """

    def __init__(self, question: DistanceQuestion, setting: Setting, n_slots: int = 1):
        self.is_asked = _are_tested(question, setting) if question.per == OF_BODY else np.ones(n_slots, dtype=bool)
        self.rows = np.zeros(n_slots, dtype=PAIR_DTYPE)
        n_slots = len(self.is_asked)
        self._reaches = np.zeros(n_slots)
        self._slot_of = np.zeros(setting.allowed.shape[1] + 1, dtype=np.int64)
        buffers = map(address_of, (self._reaches, self.is_asked, self._slot_of))
        reaches, is_asked, slot_of = buffers
        self._words = np.array([question.per, question.between, n_slots, reaches, is_asked, 0, slot_of], dtype=np.int64)
        self.address = address_of(self._words)

    def __len__(self) -> int:
        return len(self.is_asked)

    @classmethod
    def of(cls, question: DistanceQuestion, space: CheckWorkspace, least: int = 1) -> Slots:
        """Those kept with a workspace, or others where these have fewer than ``least`` rows."""
        kind = question.per, question.between
        slots = space.slots.get(kind)
        if slots is None or len(slots.rows) < least:
            slots = cls(question, space.setting, least)
            if least <= _MAX_KEPT_SLOTS:
                space.slots[kind] = slots
        return slots


def _are_tested(question: DistanceQuestion, setting: Setting) -> np.ndarray:
    """(bodies,) bool: bodies of the robot with any tested pair."""
    out = np.zeros(len(setting.bodies), dtype=bool)
    if question.between & WITH_AROUND:
        out |= (setting.allowed == 0).any(axis=1)
    if question.between & AMONG_ROBOT:
        out[setting.self_pairs.ravel()] = True
    return out


def measure(checker: CheckerScene, q: np.ndarray, question: DistanceQuestion, threads: int, progress) -> RobotDistances:
    """Distances of configurations q (n, dof); arguments as of `RobotChecker.distances`."""
    n = len(q)
    if question.per == OF_PAIR:
        pieces: dict[int, tuple] = {}

        def put(space: CheckWorkspace, piece: slice) -> None:
            pieces[piece.start] = near_piece(checker, space, q[piece], question)

        checker.in_pieces(n, threads, progress, put)
        rows, gradient, witness, counts = joined_pieces([pieces[start] for start in sorted(pieces)], q.shape[1])
        starts = np.zeros(n + 1, dtype=np.int64)
        np.cumsum(counts, out=starts[1:])
        return RobotDistances(rows, gradient, checker.bodies, checker.around, starts, witness)
    width = len(checker.setting.bodies) if question.per == OF_BODY else 1
    rows, gradient = np.zeros(n * width, dtype=NEAREST_DTYPE), np.empty((n * width, q.shape[1]))
    witness = np.empty((n * width, WITNESS))

    def fill(space: CheckWorkspace, piece: slice) -> None:
        to = slice(width * piece.start, width * piece.stop)
        measure_piece(checker, space, q[piece], rows[to], gradient[to], witness[to], question)

    checker.in_pieces(n, threads, progress, fill)
    return RobotDistances(rows, gradient, checker.bodies, checker.around, width * np.arange(n + 1), witness)


def joined_pieces(pieces: list[tuple], dof: int) -> tuple:
    """(rows, gradients, witnesses, counts) of pieces one after the other."""
    if len(pieces) == 1:
        return pieces[0]
    nothing = np.zeros(0, dtype=NEAREST_DTYPE), np.zeros((0, dof)), np.zeros((0, WITNESS)), np.zeros(0, dtype=np.int64)
    return tuple(map(np.concatenate, zip(nothing, *pieces)))


def measure_piece(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, out: np.ndarray, gradient: np.ndarray,
    witness: np.ndarray, question: DistanceQuestion,
) -> None:
    """``out`` (n·slots,) NEAREST_DTYPE, ``gradient`` (n·slots, dof) and ``witness`` (n·slots, WITNESS) become those of
    the nearest pairs of configurations q (n, dof), a slot a configuration or a slot a body of the robot.
    """
    rows, of = nearest_rows(checker, space, q, question), np.arange(len(q))
    rows = put_gradients(checker, space, q, of, rows, gradient, witness, question)
    finish_rows(rows.reshape(-1), out, question.limit)


def put_gradients(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, of: np.ndarray, rows: np.ndarray,
    gradient: np.ndarray, witness: np.ndarray, question: DistanceQuestion,
) -> np.ndarray:
    """Rows (n, slots) of `nearest_rows`, each slot's body first; gradients and witnesses are written, a row a slot.

    of : (n,) numbers of the rows' configurations among q.
    """
    if question.per == OF_BODY:  # the slot's body comes first
        is_second = (rows["a"] != NONE) & (rows["a"] != np.arange(rows.shape[1]))
        rows[is_second] = flipped(rows[is_second])
    if rows.shape[1] > 1:
        of = np.repeat(of, rows.shape[1])
    _put_gradients(checker, space, q, of, rows.reshape(-1), gradient, witness)
    return rows


def near_piece(checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, question: DistanceQuestion) -> tuple:
    """((m,) NEAREST_DTYPE, (m, dof) gradients, (m, WITNESS), (n,) numbers of rows) of all pairs within the limit, of
    configurations q (n, dof).
    """
    starts, done, least, pieces = np.zeros(len(q) + 1, dtype=np.int64), 0, _PAIR_SLOTS, []
    while done < len(q):
        slots = Slots.of(question, space, least)
        first, done = done, near_pairs(
            space.address, address_of(q), checker.robot.dof, done, len(q), question.limit, address_of(starts),
            slots.address, address_of(slots.rows),
        )
        if done == first:
            least = 2 * len(slots.rows)
            continue
        of = np.repeat(np.arange(first, done), np.diff(starts[first : done + 1]))
        of, near = _with_open(checker, space, q, of, slots.rows[: len(of)], question.limit)
        rows, gradient = np.zeros(len(near), dtype=NEAREST_DTYPE), np.empty((len(near), q.shape[1]))
        witness = np.empty((len(near), WITNESS))
        _put_gradients(checker, space, q, of, near, gradient, witness)
        finish_rows(near, rows, question.limit)
        pieces.append((rows, gradient, witness, np.bincount(of - first, minlength=done - first)))
    return joined_pieces(pieces, q.shape[1])


def _with_open(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, of: np.ndarray, rows: np.ndarray, limit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Rows (m,) with configurations ``of`` (m,), and the rows of pairs left to others: sorted by configuration, then by
    bodies, those around last; a row for every two bodies.
    """
    opened = space.open_pairs
    if len(opened):
        pairs = np.unique(opened[:, :OPEN_LOWER], axis=0)
        numbered, X_WLs = asked_poses(checker, pairs, q)
        measured = open_pairs.distances(numbered, X_WLs, *both_bodies(checker), limit=limit, by_parts=True)
        measured["part_a"] = measured["part_b"] = NONE
        is_near = ~measured["beyond"]
        of, rows = np.append(of, pairs[is_near, 0]), np.concatenate([rows, measured[is_near]])
    a, b = rows["a"], rows["b"]
    order = np.lexsort((np.where(b >= 0, b, len(checker.setting.bodies) - 1 - b), a, of))
    of, rows = of[order], rows[order]
    if not len(opened):
        return of, rows
    keys = np.stack([of, rows["a"], rows["b"]])
    is_second = np.append(False, (keys[:, 1:] == keys[:, :-1]).all(axis=0))[: len(of)]
    second = np.flatnonzero(is_second)
    rows[second - 1] = open_pairs.nearer_of(rows[second - 1], rows[second])
    return of[~is_second], rows[~is_second]


def _put_gradients(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, of: np.ndarray, rows: np.ndarray, out: np.ndarray,
    witness: np.ndarray,
) -> None:
    """``out`` (m, dof) becomes gradients of rows (m,) of PAIR_DTYPE, of the configurations ``of`` (m,) among q, and
    ``witness`` (m, WITNESS) their normals and points.
    """
    distance_gradients(
        space.address, address_of(q), checker.robot.dof, len(q), address_of(of), len(of),
        address_of(checker.robot.moves), address_of(rows), address_of(witness), address_of(out),
    )


def jacobians(checker: CheckerScene, q: np.ndarray, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(m, 3, dof) derivatives of points (m, 3) in W that move with bodies (m,) of the robot, of configurations q
    (m, dof).
    """
    out = np.empty((len(q), 3, q.shape[1]))

    def put(space: CheckWorkspace, piece: slice) -> None:
        asked = [np.ascontiguousarray(array[piece]) for array in (q, bodies, points)]
        at = [address_of(array) for array in asked]
        moves = address_of(checker.robot.moves)
        point_jacobians(space.address, at[0], q.shape[1], len(asked[0]), moves, at[1], at[2], address_of(out[piece]))

    checker.in_pieces(len(q), 1, None, put)
    return out


def finish_rows(rows: np.ndarray, out: np.ndarray, limit: float) -> None:
    """``out`` (m,) NEAREST_DTYPE becomes rows (m,) of PAIR_DTYPE, ``beyond`` where there is no pair."""
    for field in NEAREST_DTYPE.names or ():
        out[field] = rows[field]
    far = rows["a"] < 0
    out["beyond"], out["certified"] = far, rows["certified"] | far
    out["distance"][far] = out["upper"][far] = np.inf
    out["lower"][far] = limit


def nearest_rows(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, question: DistanceQuestion
) -> np.ndarray:
    """(n, slots) rows of PAIR_DTYPE of the nearest pairs within the limit; ``a`` is NONE where no pair is within.

    Where a pair left to others turns out farther apart than the kernel's limit, the kernel searches once more, up to
    the distance of the nearest known pair.
    """
    slots, limit = Slots.of(question, space), question.limit
    rows, within = np.zeros((len(q), len(slots)), dtype=PAIR_DTYPE), np.full(len(q), min(FIRST_LIMIT, limit))
    asked = _search(checker, space, q, within, rows, None, np.zeros((0, 3), dtype=np.int64), slots, limit)
    while len(asked):
        known = open_pairs.distances_of(rows)
        is_unsettled = (known > within[:, None]) & slots.is_asked
        some = np.flatnonzero(is_unsettled.any(axis=1) & (within < limit))
        if not len(some):
            break
        wider = np.where(within < LAST_LIMIT, GROWTH * within, limit)[:, None]
        wider = np.where(is_unsettled, np.where(np.isfinite(known), known, wider), 0.0).max(axis=1)
        within[some] = wider[some].clip(max=limit)
        asked = _search(checker, space, q, within, rows, some, asked, slots, limit)
    return rows


def nearest_at(
    space: CheckWorkspace, q: np.ndarray, k: int, within: np.ndarray, rows: np.ndarray, slots: Slots, limit: float
) -> bool:
    """Write row k of `nearest_rows` into ``rows`` (n, slots), of configuration k among q; False where pairs are left to
    others, of which `nearest_rows` has to be asked.   within : (n,) limits to begin with.
    """
    done = nearest_pairs(
        space.address, address_of(q), q.shape[1], k, k + 1, limit, address_of(within), slots.address, address_of(rows)
    )
    return done > k and not space.header[N_OPEN]


def _search(
    checker: CheckerScene, space: CheckWorkspace, q: np.ndarray, within: np.ndarray, rows: np.ndarray,
    some: np.ndarray | None, asked: np.ndarray, slots: Slots, limit: float,
) -> np.ndarray:
    """Write into ``rows`` (n, slots) the nearest pairs of configurations q (n, dof), or of ``some`` (k,), within
    limits ``within`` (n,), which become the limits searched. Returns (m, 3) all pairs left to others and asked so far.
    """
    nearest = rows if some is None else np.zeros((len(some), len(slots)), dtype=PAIR_DTYPE)
    q_some, limits = (q, within) if some is None else (np.ascontiguousarray(q[some]), within[some])
    done = 0
    while done < len(nearest):
        first, done = done, nearest_pairs(
            space.address, address_of(q_some), checker.robot.dof, done, len(nearest), limit, address_of(limits),
            slots.address, address_of(nearest),
        )
        if some is not None:
            rows[some[first:done]] = open_pairs.nearer_of(rows[some[first:done]], nearest[first:done])
        if len(space.open_pairs):
            pairs = space.open_pairs.copy()
            pairs[:, 0] = pairs[:, 0] if some is None else some[pairs[:, 0]]
            asked = _measure_open(checker, rows, pairs, asked, q, limit)
    if some is not None:
        within[some] = limits
    return asked


def _measure_open(
    checker: CheckerScene, rows: np.ndarray, pairs: np.ndarray, asked: np.ndarray, q: np.ndarray, limit: float
) -> np.ndarray:
    """Replace each row by an open pair's where the open pair is nearer; returns (k, 3) all open pairs asked so far.

    Pairs with the least lower bounds are measured first; pairs whose lower bounds exceed the result are not measured.
    """
    # A pair of bodies is left to others once for every two of their parts: the nearest of these speaks for it.
    pairs = pairs[np.lexsort((pairs[:, OPEN_LOWER].view(np.float64), *pairs[:, 2::-1].T))]
    is_new = (np.diff(pairs[:, :3], axis=0, prepend=-1) != 0).any(axis=1)
    is_new[is_new] = ~_are_among(pairs[is_new, :3], asked)
    pairs = np.ascontiguousarray(pairs[is_new])
    lowers, flat = pairs[:, OPEN_LOWER].view(np.float64), rows.reshape(-1)
    which, at = _slots_of(pairs, rows.shape[1])
    while True:
        may_be_nearer = lowers[which] < open_pairs.distances_of(flat[at])
        which, at = which[may_be_nearer], at[may_be_nearer]
        if not len(which):
            return asked
        order = np.lexsort((lowers[which], at))
        first_of_slots = order[np.flatnonzero(np.diff(at[order], prepend=-1))]
        to_ask = np.unique(which[first_of_slots])
        numbered, X_WLs = asked_poses(checker, pairs[to_ask], q)
        measured = open_pairs.distances(numbered, X_WLs, *both_bodies(checker), limit=limit, by_parts=True)
        measured["a"][measured["beyond"]] = NONE
        measured["part_a"] = measured["part_b"] = NONE
        is_asked = np.isin(which, to_ask)
        _put_nearer(flat, at[is_asked], measured[np.searchsorted(to_ask, which[is_asked])])
        asked = np.concatenate([asked, pairs[to_ask, :3]])
        which, at = which[~is_asked], at[~is_asked]


def _slots_of(pairs: np.ndarray, n_slots: int) -> tuple[np.ndarray, np.ndarray]:
    """((m,) numbers of pairs, (m,) rows to be filled by the pair), n_slots rows a configuration: a single row, or the
    rows of both bodies.
    """
    which = np.arange(len(pairs))
    if n_slots == 1:
        return which, pairs[:, 0].copy()
    both = np.flatnonzero(pairs[:, 2] >= 0)
    at = n_slots * np.concatenate([pairs[:, 0], pairs[both, 0]]) + np.concatenate([pairs[:, 1], pairs[both, 2]])
    return np.concatenate([which, both]), at


def _put_nearer(rows: np.ndarray, at: np.ndarray, measured: np.ndarray) -> None:
    """Rows (k,) become the nearest of themselves and of measured rows (m,), each for row ``at`` (m,)."""
    while len(at):
        to, first = np.unique(at, return_index=True)
        rows[to] = open_pairs.nearer_of(rows[to], measured[first])
        at, measured = np.delete(at, first), np.delete(measured, first)


def _are_among(pairs: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(k,) bool: which rows of integers (k, 3) are among (m, 3)."""
    if not len(others):
        return np.zeros(len(pairs), dtype=bool)
    numbers = np.unique(np.concatenate([pairs, others]), axis=0, return_inverse=True)[1].reshape(-1)
    return np.isin(numbers[: len(pairs)], numbers[len(pairs) :])
