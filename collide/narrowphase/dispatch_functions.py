"""Every method of the table (`dispatch.py`) with its functions."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.lowering.kind_of_shape import OF_CLASS, kind_of
from collide.narrowphase.convex_batches import Question, answer_parts, answer_sets, prepare_parts, prepare_sets
from collide.narrowphase.dispatch import OF_SETS, TABLE, Method, cells_of
from collide.narrowphase.region_pairs import Batch, answer_closed, answer_unbounded
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape
from collide.transforms import as_poses

#: Half of the engine, which scenes without meshes never load.
mesh_batches = lazy_module("collide.narrowphase.facets.mesh_batches")
field_pairs = lazy_module("collide.narrowphase.fields.field_pairs")


class Answer(NamedTuple):
    """The functions of a method.

    batch : ``batch(out, A, B, X_WA, X_WB, question)``, as described in `convex_batches.answer_sets`.
    prepare : ``prepare(A, B)`` gives the pair ready for single calls, or ``None``: a single call is then a batch of
    size 1.
    of_one_pair : whether a batch has a single pair of shapes; else shapes may be `Picked` from a set, pose by pose.
    """

    batch: Callable[..., bool]
    prepare: Callable[[Shape, Shape], Any]
    of_one_pair: bool


def _answer_meshes(out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    if question.boolean:
        out[:] = mesh_batches.pair_hits(A, B, X_WA, X_WB, check=question.check)
    else:
        limit, depths, check = question.limit, question.depths, question.check
        mesh_batches.pair_rows(A, B, X_WA, X_WB, limit=limit, depths=depths, check=check, out=out)
    return True


def _prepare_facets(A: Shape, B: Shape) -> Any:
    return mesh_batches.single_pair(A, B)


def _prepare_curved(A: Shape, B: Shape) -> Any:
    return mesh_batches.curved_pair(A, B)


def _answer_field(out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    if field_pairs.are_balls(A, B) and question.boolean:
        return field_pairs.answer_balls(rows_of_pair, out, A, B, X_WA, X_WB, question)
    field_pairs.answer_field(rows_of_pair, out, A, B, _poses_of(out, X_WA, X_WB, question), question)
    return True


def _prepare_field(A: Shape, B: Shape) -> Any:
    return field_pairs.prepare_field(A, B)


def _answer_region(out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> bool:
    answer_closed(_batch_of, out, A, B, _poses_of(out, X_WA, X_WB, question), question)
    return True


def _answer_regions(
    out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> bool:
    answer_unbounded(_batch_of, out, A, B, _poses_of(out, X_WA, X_WB, question), question)
    return True


def _batch_of(A: Shape, B: Shape) -> Batch:
    return answer_of(A, B).batch


def _poses_of(out: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray, question: Question) -> tuple[np.ndarray, np.ndarray]:
    """Both batches as long as the answers, checked as the question wants."""
    X_WA, X_WB = as_poses(X_WA, "X_WA", check=question.check), as_poses(X_WB, "X_WB", check=question.check)
    return np.broadcast_to(X_WA, (len(out), 4, 4)), np.broadcast_to(X_WB, (len(out), 4, 4))


def _unprepared(A: Shape, B: Shape) -> None:
    return None


ANSWERS: dict[Method, Answer] = {
    **dict.fromkeys(OF_SETS, Answer(answer_sets, prepare_sets, False)),
    Method.PARTS: Answer(answer_parts, prepare_parts, False),
    Method.FACETS: Answer(_answer_meshes, _prepare_facets, True),
    Method.CURVED: Answer(_answer_meshes, _prepare_curved, True),
    Method.HULL: Answer(_answer_meshes, _unprepared, True),
    Method.MESH_PARTS: Answer(_answer_meshes, _unprepared, True),
    Method.FIELD: Answer(_answer_field, _prepare_field, True),
    Method.REGION: Answer(_answer_region, _unprepared, True),
    Method.REGIONS: Answer(_answer_regions, _unprepared, True),
}


#: [kind of A][kind of B]: the same by the table.
_ANSWER_TABLE = tuple(tuple(ANSWERS[method] for method in row) for row in TABLE)
#: [kind of A, kind of B]: whether a batch is of one pair of shapes.
OF_ONE_PAIR = cells_of([method for method, answer in ANSWERS.items() if answer.of_one_pair])


def answer_of(A: Shape, B: Shape) -> Answer:
    """What answers a pair of shapes."""
    kind_a, kind_b = OF_CLASS.get(A.__class__), OF_CLASS.get(B.__class__)
    return _ANSWER_TABLE[kind_of(A) if kind_a is None else kind_a][kind_of(B) if kind_b is None else kind_b]


def rows_of_pair(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float, *, depths: bool = True
) -> np.ndarray:
    """Rows of `PAIR_DTYPE` of two shapes, whatever they are, at checked poses (n, 4, 4); limit [m] as of `distance`,
    depths as of `Question`.

    Raises UnsupportedQuery.
    """
    rows = np.zeros(len(X_WA), dtype=PAIR_DTYPE)
    answer_of(A, B).batch(rows, A, B, X_WA, X_WB, Question(False, limit, depths))
    return rows
