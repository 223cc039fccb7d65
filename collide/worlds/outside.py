"""Shapes from outside a World against its bodies: one, or a batch of shapes and poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.base.threads import answers_in_order
from collide.broadphase.bounding_boxes import boxes_of
from collide.lowering.parts import bounding_parts_of
from collide.lowering.shape_table import POSE_TERMS, PoseTable, ShapeTable, pose_table
from collide.narrowphase.composite.composite import combine
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.dispatch_functions import rows_of_pair
from collide.results import PAIR_DTYPE
from collide.shapes.shape import Shape
from collide.worlds.packed_world import PackedWorld
from collide.worlds.posed_bodies import batches_of_shapes
from collide.worlds.world_parts import MIN_BY_TREE, runs

#: Half of the engine, which scenes without meshes never load.
mesh_batches = lazy_module("collide.narrowphase.facets.mesh_batches")

#: Pairs of a question and a body that are answered at once, by one thread.
_PAIRS_AT_ONCE = 2048


class Questions(NamedTuple):
    """n posed shapes as parts, one question after another.

    shapes : the distinct ones.   shape_of : (n,).   X_WS : (n, 4, 4).
    table, row_of, poses : of all parts.   first, counts : (n,) the parts of each.   boxes : (n, 6).
    """

    shapes: list[Shape]
    shape_of: np.ndarray
    X_WS: np.ndarray
    table: ShapeTable
    row_of: np.ndarray
    poses: PoseTable
    first: np.ndarray
    counts: np.ndarray
    boxes: np.ndarray


def questions_of(shapes: Sequence[Shape], X_WS: np.ndarray) -> Questions:
    """Shapes, one for all or n, at poses (n, 4, 4)."""
    distinct = {id(shape): shape for shape in shapes}
    number_of = {key: k for k, key in enumerate(distinct)}
    shape_of = np.array([number_of[id(shape)] for shape in shapes], dtype=np.int64)
    shape_of = np.broadcast_to(shape_of, len(X_WS))
    parts = [bounding_parts_of(shape) for shape in distinct.values()]
    n_parts = np.array([len(of_shape) for of_shape in parts], dtype=np.int64)
    counts = n_parts[shape_of]
    rows = runs((np.cumsum(n_parts) - n_parts)[shape_of], counts)
    table = ShapeTable([packed for of_shape in parts for packed, _ in of_shape])
    X_SP = np.array([X for of_shape in parts for _, X in of_shape]).reshape(-1, 4, 4)
    reach = np.array([packed.reach for packed in table.packed])
    owner = np.repeat(np.arange(len(X_WS)), counts)
    poses = pose_table(X_WS[owner], X_SP[rows], reach[rows])
    of_parts = boxes_of(table, poses.rows, rows)
    first = np.cumsum(counts) - counts
    boxes = np.empty((len(X_WS), 6))
    if len(X_WS):
        boxes[:, :3] = np.minimum.reduceat(of_parts[:, :3], first)
        boxes[:, 3:] = np.maximum.reduceat(of_parts[:, 3:], first)
    return Questions(list(distinct.values()), shape_of, X_WS, table, rows, poses, first, counts, boxes)


def answer_outside(packed: PackedWorld, questions: Questions, limit: float, threads: int = 1) -> np.ndarray:
    """Rows of questions and the bodies near them, by both: a is the number of the question, b a position.

    limit : [m].   threads : at most so many answer; the answers are the same bits.
    """
    if packed.tree is None or not len(questions.boxes):
        return np.zeros(0, dtype=PAIR_DTYPE)
    pairs = packed.tree.boxes_met(questions.boxes, limit)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    is_meshed = np.array([shape.is_asked_whole for shape in questions.shapes], dtype=bool)
    whole = is_meshed[questions.shape_of[pairs[:, 0]]] | packed.meshed[pairs[:, 1]]
    whole |= questions.counts[pairs[:, 0]] * packed.parts.counts[pairs[:, 1]] >= MIN_BY_TREE
    answered = [np.zeros(0, dtype=PAIR_DTYPE), _of_convex(packed, questions, pairs[~whole], limit, threads)]
    shape_of = np.concatenate([questions.shape_of, len(questions.shapes) + packed.shape_of])
    n = len(questions.boxes)
    for batch in batches_of_shapes(pairs[whole] + [0, n], shape_of, len(questions.shapes) + len(packed.shapes)):
        answered.append(_of_shapes(packed, questions, batch - [0, n], limit))
    rows = np.concatenate(answered)
    return rows[np.lexsort((rows["b"], rows["a"]))]


def _of_shapes(packed: PackedWorld, questions: Questions, pairs: np.ndarray, limit: float) -> np.ndarray:
    """Rows of pairs (k, 2) of the same two shapes."""
    q, b = pairs.T
    A, B = questions.shapes[questions.shape_of[q[0]]], packed.shapes[packed.shape_of[b[0]]]
    is_of_meshes = (A.meshed or B.meshed) and not any(S.is_region or S.is_field for S in (A, B))
    rows_of = mesh_batches.rows_within if is_of_meshes else rows_of_pair
    rows = rows_of(A, B, questions.X_WS[q], packed.X_WBs[b], limit)
    rows["a"], rows["b"] = q, b
    return rows


def _of_convex(
    packed: PackedWorld, questions: Questions, pairs: np.ndarray, limit: float, threads: int
) -> np.ndarray:
    """Rows of pairs (k, 2), sorted, of shapes that are convex or made of convex parts."""
    if not len(pairs):
        return np.zeros(0, dtype=PAIR_DTYPE)
    parts, n_own = packed.parts, len(questions.row_of)
    bodies, of_body = np.unique(pairs[:, 1], return_inverse=True)
    used = parts.parts_of(bodies)
    rows_used, row_of_used = np.unique(parts.row_of[used], return_inverse=True)
    table = ShapeTable([*questions.table.packed, *(parts.table.packed[row] for row in rows_used.tolist())])
    row_of = np.concatenate([questions.row_of, len(questions.table.packed) + row_of_used.reshape(-1)])
    poses = questions.poses.followed_by(_some_poses(parts.poses, used))
    table.build_trees(row_of)
    counts_b = parts.counts[bodies]
    spans = np.stack(
        [
            questions.first[pairs[:, 0]], questions.counts[pairs[:, 0]],
            (n_own + np.cumsum(counts_b) - counts_b)[of_body.reshape(-1)], counts_b[of_body.reshape(-1)],
        ], axis=1,
    )
    pieces = [slice(start, start + _PAIRS_AT_ONCE) for start in range(0, len(pairs), _PAIRS_AT_ONCE)]
    return np.concatenate(answers_in_order(
        pieces, lambda some: _rows_of(table, poses, row_of, pairs[some], spans[some], limit), threads
    ))


def _rows_of(table: ShapeTable, poses: PoseTable, row_of, pairs, spans, limit: float) -> np.ndarray:
    """Rows of pairs (k, 2) whose parts are these spans (k, 4): first and number, of both."""
    n_pairs = spans[:, 1] * spans[:, 3]
    owner = np.repeat(np.arange(len(pairs)), n_pairs)
    within = runs(np.zeros_like(n_pairs), n_pairs)
    part_b, part_a = np.divmod(within, spans[owner, 1])
    of_parts = np.stack([spans[owner, 0] + part_a, spans[owner, 2] + part_b], axis=1)
    rows = run_pairs(table, poses, row_of, of_parts, boolean=False, limit=limit)
    rows["a"], rows["b"] = pairs[owner, 0], pairs[owner, 1]
    rows["part_a"], rows["part_b"] = part_a, part_b
    return combine(rows, np.cumsum(n_pairs) - n_pairs, spans, table, poses, row_of)


def _some_poses(poses: PoseTable, parts: np.ndarray) -> PoseTable:
    """The poses of some parts."""
    rows = poses.rows[parts]
    has_terms = rows[:, POSE_TERMS] >= 0.0
    terms = poses.terms[rows[has_terms, POSE_TERMS].astype(np.int64)]
    rows[has_terms, POSE_TERMS] = np.arange(len(terms))
    return PoseTable(rows, terms)
