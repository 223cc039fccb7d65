"""Bodies at poses, and the rows of pairs of bodies: convex parts in one call, pairs with a mesh in batches of the same
two shapes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.base.threads import share
from collide.errors import UnsupportedQuery
from collide.narrowphase.composite.composite import combine, of_thread
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.dispatch_functions import rows_of_pair
from collide.results import EXACT, PAIR_DTYPE, UNDECIDED
from collide.shapes.shape import Shape
from collide.worlds.world_part_pairs import PartTrees
from collide.worlds.world_parts import WorldParts

#: Half of the engine, which scenes without meshes never load.
mesh_batches = lazy_module("collide.narrowphase.facets.mesh_batches")

#: Booleans about meshes that stop at the first hit ask so many pairs of the same two shapes at first, then twice as
#: many.
_FIRST_CHUNK = 8
#: Pairs of bodies that a thread takes at once; booleans that stop at a hit look whether there was one after so many.
_PAIRS_AT_ONCE = 2048
#: Of more candidates than this, booleans that stop at a hit ask first the so many whose boxes overlap most, of at most
#: so many, evenly taken: to look at all would take half as long as to ask them.
_MIN_SORTED, _LIKELIEST, _MAX_COMPARED = 512, 32, 2048


class Answer(NamedTuple):
    """Rows of a query, a and b positions of bodies.

    convex_pairs : pairs of convex parts answered.   body_pairs : of bodies.   mesh_pairs : of these, those with a mesh.
    """

    rows: np.ndarray
    convex_pairs: int
    body_pairs: int
    mesh_pairs: int


class PosedBodies:
    """Bodies by position (0 … n − 1), each a run of convex parts, at poses.

    parts : the parts.   X_WBs : (n, 4, 4) the poses.   has_margins : whether any body or pair has a margin.
    """

    X_WBs: np.ndarray
    has_margins = _any_meshed = False
    #: (k,) the margins [m] of pairs (k, 2) of positions, i < j: their own, or the sum of both bodies'.
    margins_of: Callable[[np.ndarray], np.ndarray]

    def __init__(self) -> None:
        self.parts = WorldParts()
        self._part_trees = PartTrees(self.parts)

    @property
    def shapes(self) -> list[Shape]:
        """The distinct ones.   shape_of : (n,) which of them each body has."""
        return self.parts.shapes

    @property
    def shape_of(self) -> np.ndarray:
        return self.parts.shape_of

    @property
    def meshed(self) -> np.ndarray:
        """(n,) bool: bodies without convex parts: meshes, bodies with a mesh, regions."""
        return self.parts.meshed

    def answer(
        self, candidates: np.ndarray, limit: float, *, boolean: bool, stop_at_hit: bool, threads: int = 1
    ) -> Answer:
        """Rows of candidates (k, 2).

        limit : [m], as of `collide.distance`.   stop_at_hit : rows after the first hit may be missing.
        boolean : rows tell no more than ``hit``, ``how`` and ``iterations``, in no order; with all pairs asked also the
            bodies a and b, a row for each pair of their parts.
        threads : at most so many answer; the answers are the same bits, whatever is missing with ``stop_at_hit``, too.
        """
        if stop_at_hit and len(candidates) > _MIN_SORTED:
            first = self._likeliest(candidates)
            answer = self._answer_in_pieces(candidates[first], limit, boolean, True, 1)
            if answer.rows["hit"].any():
                return answer
            rest = self._answer_in_pieces(np.delete(candidates, first, axis=0), limit, boolean, True, threads)
            return joined([answer, rest], boolean)
        return self._answer_in_pieces(candidates, limit, boolean, stop_at_hit, threads)

    def _likeliest(self, candidates: np.ndarray) -> np.ndarray:
        """Numbers of the candidates whose boxes overlap most, in sides of the smaller one."""
        some = np.arange(0, len(candidates), -(-len(candidates) // _MAX_COMPARED))
        a, b = (self.parts.body_boxes(bodies) for bodies in candidates[some].T)
        with np.errstate(invalid="ignore", divide="ignore"):
            overlap = (np.minimum(a[:, 3:], b[:, 3:]) - np.maximum(a[:, :3], b[:, :3])).min(axis=1)
            sides = np.minimum((a[:, 3:] - a[:, :3]).max(axis=1), (b[:, 3:] - b[:, :3]).max(axis=1))
            overlap = np.nan_to_num(overlap / sides, nan=0.0)
        return np.sort(some[np.argpartition(-overlap, _LIKELIEST)[:_LIKELIEST]])

    def _answer_in_pieces(
        self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool, threads: int
    ) -> Answer:
        """Pieces of the same sizes whatever the number of threads; after one with a hit, others are left out."""
        starts = range(0, len(candidates), _PAIRS_AT_ONCE)
        if len(starts) < 2 or (threads < 2 and not stop_at_hit):
            return self._answer_piece(candidates, limit, boolean, stop_at_hit)
        answers: dict[int, Answer] = {}
        first_hit = [len(candidates)]

        def work(start: int) -> None:
            if stop_at_hit and start > first_hit[0]:
                return
            piece = candidates[start : start + _PAIRS_AT_ONCE]
            answers[start] = self._answer_piece(piece, limit, boolean, stop_at_hit)
            if stop_at_hit and answers[start].rows["hit"].any():
                first_hit[0] = min(first_hit[0], start)

        share(starts, work, threads)
        return joined([answers[start] for start in starts if start in answers and start <= first_hit[0]], boolean)

    def _answer_piece(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        if not self._any_meshed:
            return self._answer_unions(candidates, limit, boolean, stop_at_hit)
        meshed = self.parts.meshed[candidates].any(axis=1)
        convex = self._answer_unions(candidates[~meshed], limit, boolean, stop_at_hit)
        if stop_at_hit and convex.rows["hit"].any():
            return convex
        of_meshes = self._answer_meshes(candidates[meshed], limit, boolean, stop_at_hit)
        return joined([convex, Answer(of_meshes, 0, len(of_meshes), len(of_meshes))], boolean)

    # --- pairs with a mesh ----------------------------------------------------------------------

    def _answer_meshes(self, pairs: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> np.ndarray:
        """Rows of pairs of bodies with a mesh: pairs of the same two shapes share a batch."""
        answered = [np.zeros(0, dtype=PAIR_DTYPE)]
        chunk = _FIRST_CHUNK if stop_at_hit else len(pairs)
        for batch in batches_of_shapes(pairs, self.shape_of, len(self.shapes), chunk):
            answered.append(self._mesh_rows(batch, limit, boolean))
            if stop_at_hit and answered[-1]["hit"].any():
                break
        return np.concatenate(answered)

    def _mesh_rows(self, pairs: np.ndarray, limit: float, boolean: bool) -> np.ndarray:
        """Rows of pairs (k, 2) of bodies of the same two shapes. Raises UnsupportedQuery."""
        a, b = pairs.T
        A, B = self.shapes[self.shape_of[a[0]]], self.shapes[self.shape_of[b[0]]]
        if any(shape.is_region or shape.is_field for shape in (A, B)):
            rows = rows_of_pair(A, B, self.X_WBs[a], self.X_WBs[b], limit, depths=not boolean)
        elif boolean:
            rows = np.zeros(len(pairs), dtype=PAIR_DTYPE)
            states = mesh_batches.pair_states(A, B, self.X_WBs[a], self.X_WBs[b])
            rows["hit"] = states != mesh_batches.APART
            rows["how"] = np.where(states == mesh_batches.OPEN, UNDECIDED, EXACT)
        else:
            rows = mesh_batches.rows_within(A, B, self.X_WBs[a], self.X_WBs[b], limit)
        rows["a"], rows["b"] = a, b
        return rows

    def refused(self, candidates: np.ndarray, limit: float) -> list[tuple[int, int, str]]:
        """(position, position, reason) of candidates for which `answer` raises UnsupportedQuery: pairs with a mesh."""
        refused = []
        with_mesh = candidates[self.parts.meshed[candidates].any(axis=1)]
        for pairs in batches_of_shapes(with_mesh, self.shape_of, len(self.shapes)):
            try:
                self._mesh_rows(pairs, limit, False)
            except UnsupportedQuery:
                refused += self._refused_of_batch(pairs, limit)
        return sorted(refused)

    def _refused_of_batch(self, pairs: np.ndarray, limit: float) -> list[tuple[int, int, str]]:
        refused = []
        for pair in pairs:
            try:
                self._mesh_rows(pair[None], limit, False)
            except UnsupportedQuery as error:
                refused.append((int(pair[0]), int(pair[1]), str(error)))
        return refused

    # --- convex bodies and unions of convex parts -----------------------------------------------

    def _answer_unions(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        """`_answer_convex`; but rows of two unions of many parts are those of the pair by itself, where the limit rules
        out few of their parts.
        """
        parts = self.parts
        if boolean or parts.all_of_one_part:
            return self._answer_convex(candidates, limit, boolean, stop_at_hit)
        whole = self._part_trees.are_mostly_near(candidates, limit)
        answers = [self._answer_convex(candidates[~whole], limit, boolean, stop_at_hit)]
        for batch in batches_of_shapes(candidates[whole], self.shape_of, len(self.shapes)):
            asked, (a, b) = of_thread.asked, batch.T
            A, B = self.shapes[self.shape_of[a[0]]], self.shapes[self.shape_of[b[0]]]
            rows = rows_of_pair(A, B, self.X_WBs[a], self.X_WBs[b], limit)
            rows["a"], rows["b"] = a, b
            answers.append(Answer(rows, of_thread.asked - asked, len(rows), 0))
        return answers[0] if len(answers) == 1 else joined(answers, boolean)

    def _answer_convex(self, candidates: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> Answer:
        parts = self.parts
        if parts.all_of_one_part:  # parts are bodies, and their rows those of bodies
            rows = self._rows_of_parts(candidates, limit, boolean, stop_at_hit)
            if not stop_at_hit:
                rows["a"], rows["b"] = candidates[:, 0], candidates[:, 1]
            return Answer(rows, len(rows), len(rows), 0)
        pairs, owner = self._part_trees.near(candidates, limit)
        rows = self._rows_of_parts(pairs, limit, boolean, stop_at_hit)
        pairs, owner = pairs[: len(rows)], owner[: len(rows)]
        starts = np.flatnonzero(np.diff(owner, prepend=-1))
        if not stop_at_hit:
            rows["a"], rows["b"] = candidates[owner, 0], candidates[owner, 1]
        if boolean:
            return Answer(rows, len(rows), len(starts), 0)
        rows["part_a"] = pairs[:, 0] - parts.first[rows["a"]]
        rows["part_b"] = pairs[:, 1] - parts.first[rows["b"]]
        spans = np.hstack([parts.spans(rows["a"][starts]), parts.spans(rows["b"][starts])])
        of_bodies = combine(rows, starts, spans, parts.table, parts.poses, parts.row_of)
        return Answer(of_bodies, len(rows), len(starts), 0)

    def _rows_of_parts(self, pairs: np.ndarray, limit: float, boolean: bool, stop_at_hit: bool) -> np.ndarray:
        parts = self.parts
        return run_pairs(
            parts.table, parts.poses, parts.row_of, pairs, boolean=boolean, limit=limit, stop_at_hit=stop_at_hit
        )


def joined(answers: list[Answer], boolean: bool) -> Answer:
    """One answer of several: rows by a and b, but of booleans."""
    rows = np.concatenate([np.zeros(0, dtype=PAIR_DTYPE), *(answer.rows for answer in answers)])
    if not boolean:
        rows = rows[np.lexsort((rows["b"], rows["a"]))]
    n_parts, n_bodies = sum(answer.convex_pairs for answer in answers), sum(answer.body_pairs for answer in answers)
    return Answer(rows, n_parts, n_bodies, sum(answer.mesh_pairs for answer in answers))


def batches_of_shapes(
    pairs: np.ndarray, shape_of: np.ndarray, n_shapes: int, chunk: int = 1 << 60
) -> Iterator[np.ndarray]:
    """Pairs (k, 2) of bodies in batches of the same two shapes; of each at most ``chunk`` first, then twice as many."""
    keys = shape_of[pairs[:, 0]] * n_shapes + shape_of[pairs[:, 1]]
    order = np.argsort(keys, kind="stable")
    for same in np.split(order, np.flatnonzero(np.diff(keys[order])) + 1):
        size = max(chunk, 1)
        while len(same):
            yield pairs[same[:size]]
            same, size = same[size:], 2 * size
