"""Motions of bodies of convex parts, from Python: jobs for `impact_jobs.py`, in as many threads as asked for."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from threading import local
from typing import Any, NamedTuple

import numpy as np

from collide.base.threads import pieces_of, share
from collide.kernels import address_of, code_of
from collide.lowering.compound_layout import layout_of
from collide.lowering.compound_table import PART, CompoundTable
from collide.lowering.packed_convex import pack_points
from collide.lowering.shape_table import POSE, RANK, ShapeTable
from collide.motion.convex_impact import CONTACT, FREE, OPEN, OPEN_START
from collide.motion.impact_jobs import OMEGA_A_AT, XA0_STEP, begin_single, find_impacts
from collide.motion.impact_rows import TimeOfImpact, free_rows, single_result
from collide.motion.motions import Motions
from collide.motion.moving_body import BODY
from collide.motion.parts_ahead import MAX_ASKED, balls_meet, parts_ahead, spans_of
from collide.motion.union_impact import (
    COMPOSITE,
    IMPACT,
    KERNEL,
    SIZE,
    SMALLER,
    SPAN,
    UNION_DOUBLES,
    UNION_HEADER,
    UNION_INTEGERS,
    first_impact_of_unions,
)
from collide.narrowphase.composite.composite import of_thread
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_kernel_calls import scratch
from collide.narrowphase.pair_kernel import answer_pairs
from collide.narrowphase.prepared_pairs import kept_pair, prepared_pair
from collide.results import PAIR_DTYPE
from collide.shapes.shape import IDENTITY, Shape

#: Jobs done in one call of the kernel: their list stays small beside the motions.
JOBS_AT_ONCE = 1 << 16
#: Pairs of parts of unions that are searched before a span of time is cut, to tell which of them come first.
_PARTS_TOGETHER = 1024
#: A union is small beside a shape that reaches so many times as far.
TIMES_SMALLER = 8.0
#: A thread is handed at least so many motions.
_MIN_MOTIONS_PER_THREAD = 200


class Tables(NamedTuple):
    """addresses : of a `ShapeTable`'s integers and numbers.   n_shapes : its rows.   parts : (k, PART)."""

    addresses: tuple[int, int]
    n_shapes: int
    parts: np.ndarray


class _Workspace:
    """Scratch memory of the kernels."""

    def __init__(self) -> None:
        self.poses, self.shape_of = np.zeros((2, POSE)), np.zeros(2, dtype=np.int64)
        self.pair, self.bodies = np.array([0, 1], dtype=np.int64), np.zeros(2 * BODY)
        self.rows = np.zeros(2, dtype=PAIR_DTYPE)


class _OfThread(local):
    def __init__(self) -> None:
        self.space = _Workspace()


class SinglePair:
    """Two shapes of a single convex part each, prepared for single motions."""

    def __init__(self, bodies: _Bodies, a: int, b: int):
        self._table, self._parts = bodies.table, bodies.parts  # the bodies hold this pair
        self._jobs = np.array([[0, bodies.first[a], bodies.first[a], bodies.first[b], bodies.first[b]]], dtype=np.int64)
        self._of_thread = local()

    def ask(self, matrices: tuple, tolerance: float) -> TimeOfImpact | None:
        """The answer for poses (4, 4) of A and B at both ends; None where the general way must answer: bodies in
        contact at the start, undecided starts, arguments to refuse."""
        for X in matrices:
            if type(X) is not np.ndarray or X.dtype != np.float64 or X.shape != (4, 4) or not X.flags.c_contiguous:
                return None
        space = getattr(self._of_thread, "space", None) or self._prepare()
        if begin_single(space.header_at, *map(address_of, matrices), space.row_at) != 0:
            return None
        find_impacts(space.header_at, space.jobs_at, 1, 0.0, 1.0, tolerance, space.row_at)
        return single_result(space.row, tolerance)

    def _prepare(self) -> _SingleSpace:
        here = np.eye(4)[None]
        tables = Tables(self._table.addresses, len(self._table.packed), self._parts)
        header, row = header_of(tables, Motions(here, here, here, here, None, None)), free_rows(1)
        space = _SingleSpace(header, row, address_of(header), address_of(self._jobs), address_of(row))
        self._of_thread.space = space
        return space


class SingleUnions:
    """Two bodies of several convex parts, prepared for one motion at a time."""

    def __init__(self, bodies: _Bodies, A: Shape, B: Shape):
        self._layouts, self._table = (layout_of(A), layout_of(B)), kept_pair(A, B).table
        self._tables = Tables(bodies.table.addresses, len(bodies.table.packed), bodies.parts)
        self._held, self._first = bodies.table, (int(bodies.first[0]), int(bodies.first[-1]))
        self._larger = int(bodies.ranks[0] > bodies.ranks[-1]) - int(bodies.ranks[0] < bodies.ranks[-1])
        here, unions = IDENTITY[None], (compound_parts(A), compound_parts(B))
        self._spans = spans_of(*unions, Motions(here, here, here, here, None, None))
        self._sizes = sum(union.radius for union in unions), min(union.radius for union in unions)
        self._of_thread = local()

    def ask(self, matrices: tuple, tolerance: float) -> TimeOfImpact | None:
        """As of `SinglePair`."""
        for X in matrices:
            if X.__class__ is not np.ndarray or X.dtype is not _FLOAT64 or X.shape != (4, 4) or not X.flags.carray:
                return None
        space = self.ready()
        at = map(address_of, matrices)
        if first_impact_of_unions(space.header_at, *at, 0, 0, True, tolerance, space.row_at) != 0:
            return None
        return single_result(space.row, tolerance, self._first)

    def search(self, motions: Motions, k: int, tolerance: float, rows: np.ndarray) -> bool:
        """Write row k of motions, already checked; False where too many parts come near together."""
        at = [0 if X is None else address_of(X[k % len(X)]) for X in motions]
        space = self.ready()
        return first_impact_of_unions(space.header_at, *at, False, tolerance, address_of(rows[k : k + 1])) == 0

    def ready(self) -> _SingleSpace:
        """This thread's workspace, made when first asked for."""
        return getattr(self._of_thread, "space", None) or self._prepare()

    def _prepare(self) -> _SingleSpace:
        if not isinstance(self._table, CompoundTable):
            self._table = CompoundTable(self._layouts)
        composite, here = of_thread.space_for(self._table), IDENTITY[None]
        doubles, integers = np.zeros(UNION_DOUBLES), np.zeros(UNION_INTEGERS, dtype=np.int64)
        doubles[[SIZE, SMALLER]] = self._sizes
        is_searched = self._sizes[0] < (1.0 + TIMES_SMALLER) * self._sizes[1]  # else as `parts_in_turn` does
        header, row = np.zeros(UNION_HEADER, dtype=np.int64), free_rows(1)
        at = address_of(doubles), address_of(integers)
        header[KERNEL:IMPACT] = code_of(find_impacts), *self._first, self._larger, is_searched, *at
        header[IMPACT:SPAN] = header_of(self._tables, Motions(here, here, here, here, None, None))
        header[IMPACT + XA0_STEP : IMPACT + OMEGA_A_AT] = 0
        header[SPAN:COMPOSITE] = self._spans.header
        header[COMPOSITE:] = composite.header_of(self._table, scratch())
        space = _SingleSpace(header, row, address_of(header), 0, address_of(row), (doubles, integers, composite))
        self._of_thread.space = space
        return space


_FLOAT64 = np.dtype(np.float64)


class _SingleSpace(NamedTuple):
    """Header and row of one thread's single motions, and addresses, of the jobs, too; arrays in use besides."""

    header: np.ndarray
    row: np.ndarray
    header_at: int
    jobs_at: int
    row_at: int
    held: Any = None


_of_thread = _OfThread()


def header_of(tables: Tables, motions: Motions) -> np.ndarray:
    """What `find_impacts` reads first; it works in the scratch memory of this thread."""
    space, poses, omegas = _of_thread.space, motions[:4], motions[4:]
    return np.array(
        (
            code_of(answer_pairs), *tables.addresses, address_of(space.poses), address_of(space.shape_of),
            address_of(space.pair), *scratch(), address_of(space.bodies), address_of(space.rows),
            address_of(space.rows[1:]), address_of(tables.parts), len(tables.parts),
            *(address_of(X) for X in poses), *(16 * (len(X) > 1) for X in poses),
            *(0 if w is None else address_of(w) for w in omegas),
            *(0 if w is None else 3 * (len(w) > 1) for w in omegas), tables.n_shapes,
        ),
        dtype=np.int64,
    )


class _Bodies:
    """Distinct shapes, part by part, in the tables that kernels read."""

    def __init__(self, shapes: list[Shape]):
        layouts = [layout_of(shape) for shape in shapes]
        self.counts = np.array([len(layout.packed) for layout in layouts], dtype=np.int64)
        self.first = np.cumsum(self.counts) - self.counts
        self.is_simple = len(layouts) == int(self.counts.sum())
        contents = [b"".join(packed.content for packed in layout.packed) for layout in layouts]
        self.ranks = np.array([sorted(contents).index(content) for content in contents], dtype=np.int64)
        self.parts = np.ascontiguousarray(np.concatenate([layout.parts for layout in layouts]))
        self.table = ShapeTable([packed for layout in layouts for packed in layout.packed])
        self.table.build_trees(np.arange(len(self.table.packed)))
        self.single: SinglePair | SingleUnions | None = None
        if len(shapes) <= 2 and self.is_simple:
            self.single = SinglePair(self, 0, len(shapes) - 1)
        elif len(shapes) <= 2 and int(self.counts[0] * self.counts[-1]) > MAX_ASKED:
            unions = [compound_parts(shape) for shape in (shapes[0], shapes[-1])]
            if not any(union.unbounded for union in unions):
                self.single = SingleUnions(self, shapes[0], shapes[-1])

    def jobs(self, a: np.ndarray, b: np.ndarray, first: int, motions: Motions) -> np.ndarray:
        """(k, JOB) every part of A with every part of B, motion by motion, for shapes a and b of motions from ``first``
        on; in an order independent of the shapes' roles as A and B."""
        if self.is_simple:
            row_a, row_b = self.first[a], self.first[b]
            return np.ascontiguousarray(np.array([np.arange(first, first + len(a)), row_a, row_a, row_b, row_b]).T)
        n_b, counts = self.counts[b], self.counts[a] * self.counts[b]
        motion = np.repeat(np.arange(len(a)), counts)
        which = np.arange(len(motion)) - np.repeat(np.cumsum(counts) - counts, counts)
        some = motions.picked(np.arange(first, first + len(a)))
        flip = some.exchanged(self.ranks[a] > self.ranks[b], self.ranks[a] == self.ranks[b])[motion]
        n_a, n_b = self.counts[a][motion], n_b[motion]
        part_a = self.first[a][motion] + np.where(flip, which % n_a, which // n_b)
        part_b = self.first[b][motion] + np.where(flip, which // n_a, which % n_b)
        return np.ascontiguousarray(np.stack([motion + first, part_a, part_a, part_b, part_b], axis=1))


    def jobs_ahead(
        self, shapes: list[Shape], a: int, b: int, k: int, motions: Motions, tolerance: float, rows: np.ndarray
    ) -> Iterator[np.ndarray]:
        """`jobs` of motion k, of shapes a and b, in which parts may meet before what its row has found, in turn."""
        motion, ranks = motions.picked(np.array([k])), (self.ranks[a : a + 1], self.ranks[b : b + 1])
        flip = bool(motion.exchanged(ranks[0] > ranks[1], ranks[0] == ranks[1])[0])
        ahead = parts_in_turn(
            shapes[a], shapes[b], motion, lambda: float(rows["upper"][k]), _PARTS_TOGETHER, tolerance
        )
        for i, j in ahead:
            order = np.lexsort((i, j)) if flip else np.arange(len(i))
            part_a, part_b = self.first[a] + i[order], self.first[b] + j[order]
            yield np.ascontiguousarray(np.stack([np.full(len(i), k), part_a, part_a, part_b, part_b], axis=1))


def parts_in_turn(
    A: Shape, B: Shape, motion: Motions, upper: Callable[[], float], max_pairs: int, tolerance: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """`parts_ahead` of two shapes; beside a far smaller union part by part of the larger union, by the time of meeting
    a ball around the smaller: all parts of the smaller union lie within the ball, so no contact is earlier."""
    unions = compound_parts(A), compound_parts(B)
    reaches = [math.inf if union.unbounded else union.radius for union in unions]
    large = 0 if reaches[0] > reaches[1] else 1
    small = unions[1 - large]
    if not (TIMES_SMALLER * reaches[1 - large] <= reaches[large] < math.inf and len(small.parts) > 1):
        yield from parts_ahead(*unions, motion, upper, max_pairs)
        return
    end = min(upper(), 1.0)
    times = _times_of_ball(A, B, large, (reaches[1 - large], small.slop), motion, end, tolerance)
    every = np.arange(len(small.parts))
    for number in np.argsort(times, kind="stable").tolist():
        if not times[number] <= min(upper(), 1.0):
            return
        pair = np.full(len(every), number), every
        yield pair if large == 0 else pair[::-1]


def _times_of_ball(
    A: Shape, B: Shape, large: int, ball: tuple[float, float], motion: Motions, end: float, tolerance: float
) -> np.ndarray:
    """(k,) times before which the parts of A, or B where ``large`` is 1, do not meet a ball around the other's origin:
    infinity without contact up to ``end``.

    ball : (radius, slop) [m].
    """
    bodies = bounds_of(A, B)
    which = large if len(bodies.counts) > 1 else 0
    k, n = int(bodies.counts[which]), len(bodies.table.packed)
    around = ShapeTable([pack_points(np.zeros((1, 3)), ball[0])._replace(slop=ball[1])])
    ints = np.concatenate([bodies.table.ints, around.ints])
    numbers = np.concatenate([bodies.table.numbers, around.numbers])
    ints[n, RANK] = n
    parts = np.concatenate([bodies.parts, np.zeros((1, PART))])
    parts[n, [0, 4, 8]] = 1.0
    ends = np.full((2, k), n)
    ends[large] = bodies.first[which] + np.arange(k)
    jobs, rows = np.ascontiguousarray(np.stack([np.arange(k), *np.repeat(ends, 2, axis=0)], axis=1)), free_rows(k)
    header = header_of(Tables((address_of(ints), address_of(numbers)), n + 1, parts), motion)
    find_impacts(address_of(header), address_of(jobs), k, 0.0, end, tolerance, address_of(rows))
    return earliest_of(rows)


def _bodies_of(shapes: list[Shape], part: str = "impact") -> _Bodies:
    """Bodies of a list of shapes; of a pair kept as a part of its `Prepared`: a simulator asks about the same two again
    and again."""
    if len(shapes) > 2:
        return _Bodies(shapes)
    pair = kept_pair(shapes[0], shapes[-1])
    bodies = getattr(pair, part)
    if bodies is None:
        bodies = _Bodies(shapes)
        setattr(pair, part, bodies)
    return bodies


def earliest_times(
    A: Shape, B: Shape, motion: Motions, pairs: tuple[np.ndarray, np.ndarray], end: float, tolerance: float
) -> np.ndarray:
    """(k,) times before which parts of A and of B, pair by pair, have no contact in a motion: infinity without contact
    up to ``end``.

    pairs : parts of A and of B (k,). A mesh is replaced by the convex set around its points: time of contact of the
    sets ≤ time of contact of the parts. Some microseconds a pair.
    """
    return earliest_of(_search_bounds(A, B, motion, pairs, np.arange(len(pairs[0])), end, tolerance)[1])


def first_pair(
    A: Shape, B: Shape, motion: Motions, pairs: tuple[np.ndarray, np.ndarray], end: float, tolerance: float
) -> tuple[int, float] | None:
    """(number of the pair of parts, as of `earliest_times`, whose convex sets meet first; a lower bound of the
    contact's time); None without a contact.

    Each pair is searched no farther than to the first contact of the pairs before: less work than the times of all.
    """
    which, row = _search_bounds(A, B, motion, pairs, np.zeros(len(pairs[0]), dtype=np.int64), end, tolerance)
    at = np.flatnonzero((which == (row["part_a"][0], row["part_b"][0])).all(axis=1)) if len(row) else row
    return (int(at[0]), float(row["lower"][0])) if len(at) and row["status"][0] in (CONTACT, OPEN) else None


def _search_bounds(A: Shape, B: Shape, motion: Motions, pairs, numbers: np.ndarray, end: float, tolerance: float):
    """(rows of the table (k, 2) of pairs of convex sets, rows of `IMPACT_DTYPE`) of one motion, pair by pair in the row
    of these numbers."""
    bodies = bounds_of(A, B)
    which = np.stack([bodies.first[0] + pairs[0], bodies.first[-1] + pairs[1]], axis=1)
    jobs = np.ascontiguousarray(np.stack([numbers, *np.repeat(which.T, 2, axis=0)], axis=1))
    rows = free_rows(len(np.unique(numbers)))
    header = header_of(Tables(bodies.table.addresses, len(bodies.table.packed), bodies.parts), motion)
    find_impacts(address_of(header), address_of(jobs), len(jobs), 0.0, end, tolerance, address_of(rows))
    return which, rows


def bounds_of(A: Shape, B: Shape) -> _Bodies:
    """Convex sets around the parts of two shapes, kept with A."""
    return _bodies_of([A, B], "impact_bounds")


def earliest_of(rows: np.ndarray) -> np.ndarray:
    """(k,) times before which rows have no contact; infinity of rows proven free."""
    is_open = rows["status"] > OPEN_START  # nothing is known of these; what is wrong with them is for others to say
    return np.where(rows["status"] == FREE, math.inf, np.where(is_open, 0.0, rows["lower"]))


def single_impact(A: Any, B: Any, matrices: tuple, tolerance: float) -> TimeOfImpact | None:
    """The answer for two shapes asked about before; None where not prepared, or as in `SinglePair.ask`."""
    pair = prepared_pair(A, B)
    bodies = None if pair is None else pair.impact
    return None if bodies is None or bodies.single is None else bodies.single.ask(matrices, tolerance)


def convex_impacts(
    shapes: list[Shape], a: np.ndarray, b: np.ndarray, motions: Motions, tolerance: float, threads: int
) -> np.ndarray:
    """Rows of `IMPACT_DTYPE` for n motions of bodies of convex parts.

    shapes : distinct ones.   a, b : (n,) int64, which of them A and B are.
    """
    n = len(a)
    rows = free_rows(n)
    bodies = _bodies_of(shapes)
    per_motion = max(int((bodies.counts[a] * bodies.counts[b]).max(initial=1)), 1)
    at_once = max(JOBS_AT_ONCE // per_motion, 1) if per_motion <= MAX_ASKED else 1

    of_one_pair = per_motion > MAX_ASKED and (a == a[0]).all() and (b == b[0]).all()
    near = unions = None
    if of_one_pair:
        is_pair = a[0] == 0 and b[0] == len(shapes) - 1
        unions = bodies.single if is_pair and isinstance(bodies.single, SingleUnions) else None
        if unions is not None:
            unions.ready()
        near = balls_meet(compound_parts(shapes[a[0]]), compound_parts(shapes[b[0]]), motions, n)

    def work(piece: slice) -> None:
        header = header_of(Tables(bodies.table.addresses, len(bodies.table.packed), bodies.parts), motions)
        for first in range(piece.start, piece.stop, at_once):
            if near is not None and not near[first]:
                continue
            if unions is not None:
                if unions.search(motions, first, tolerance, rows):
                    continue
                rows[first] = free_rows(1)[0]
            some = slice(first, min(first + at_once, piece.stop))
            for jobs in (
                [bodies.jobs(a[some], b[some], first, motions)] if per_motion <= MAX_ASKED
                else bodies.jobs_ahead(shapes, int(a[first]), int(b[first]), first, motions, tolerance, rows)
            ):
                find_impacts(address_of(header), address_of(jobs), len(jobs), 0.0, 1.0, tolerance, address_of(rows))

    workers = min(threads, n * per_motion // _MIN_MOTIONS_PER_THREAD)
    if workers < 2:
        work(slice(0, n))
    else:
        share(pieces_of(n, workers, max(_MIN_MOTIONS_PER_THREAD // per_motion, 1)), work, workers)
    rows["part_a"] -= np.where(rows["status"] == FREE, 0, bodies.first[a])
    rows["part_b"] -= np.where(rows["status"] == FREE, 0, bodies.first[b])
    return rows
