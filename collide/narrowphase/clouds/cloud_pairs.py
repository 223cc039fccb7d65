"""A point cloud and another shape, at n pairs of poses.

Convex sets walk down the tree over the points (`nearest_item_kernel.py`). Open rests of the walk, and all other
questions (depths, half-spaces, meshes, unions, other clouds), go to the union of the balls within the upper bound of
the gap, or within the depth, of a box around the other shape.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from collide.kernels import address_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import convex_set_of, is_single_convex, parts_of
from collide.lowering.shape_table import moved_pose
from collide.narrowphase.clouds.ball_walk_kernel import MEETS, OPEN, WORK, clouds_meet_balls
from collide.narrowphase.clouds.balls_nearby import BoxAround, balls_within, box_in_frame, lowest_balls, union_of
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.facets.nearest_item_calls import Items, gap_rows, prepared_items, surface_states
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE, flipped
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import Shape

#: Rows of two shapes: ``rows_of_pair(A, B, X_WA, X_WB, limit, depths=)``.
RowsOfPair = Callable[..., np.ndarray]


def answer_cloud(
    rows_of: RowsOfPair, out: np.ndarray, A: Shape, B: Shape, poses: tuple[np.ndarray, np.ndarray], question: Question
) -> None:
    """Answers of a cloud and another shape, in either order, at checked poses (n, 4, 4).

    rows_of : what answers two other shapes.   out, question : as of `convex_batches.answer_sets`.
    """
    if not isinstance(A, PointCloud):
        rows = np.zeros_like(out)
        answer_cloud(rows_of, rows, B, A, poses[::-1], question)
        out[:] = rows if question.boolean else flipped(rows)
        return
    X_WA, X_WB = (np.ascontiguousarray(X) for X in poses)
    is_open = np.ones(len(out), dtype=bool)
    if walks(B):
        items, packed = balls_of(A), convex_set_of(B)
        if question.boolean:
            states = surface_states(items, packed, X_WA, X_WB)
            out[states.meets] = True
            is_open = ~(states.meets | states.apart)
        else:
            rows, is_written = gap_rows(items, packed, X_WA, X_WB, question.depths)
            out[is_written] = _beyond_limit(rows[is_written], question.limit)
            is_open = ~is_written
    elif question.boolean and kind_of(B) is Kind.COMPOUND:
        is_open = _may_meet_parts(balls_of(A), B, X_WA, X_WB)
    for k in np.flatnonzero(is_open).tolist():
        row = _union_row(rows_of, A, B, X_WA[k : k + 1], X_WB[k : k + 1], question)
        out[k] = bool(row["hit"][0]) if question.boolean else _beyond_limit(row, question.limit)[0]


def _may_meet_parts(items: Items, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool: whether balls may meet a part of a union; False where all parts, whose poses are rounded, are farther
    from all balls than rounding may have moved a part.
    """
    may_meet = np.zeros(len(X_WA), dtype=bool)
    for packed, X_BP in parts_of(B):
        if packed.kind == HALFSPACE:
            return np.ones(len(X_WA), dtype=bool)
        some = np.flatnonzero(~may_meet)
        if not len(some):
            break
        X_WP, slop = moved_pose(X_WB[some], X_BP, np.full(len(some), packed.reach))
        states = surface_states(items, packed, X_WA[some], X_WP, 2.0 * float(slop.max()))
        may_meet[some[~states.apart]] = True
    return may_meet


def are_balls(A: Shape, B: Shape) -> bool:
    """Whether a pair is a cloud of equal balls and a ball."""
    cloud, ball_shape = (A, B) if isinstance(A, PointCloud) else (B, A)
    is_uniform = isinstance(cloud, PointCloud) and np.ndim(cloud.radius) == 0
    return is_uniform and kind_of(ball_shape) is Kind.SPHERE


def answer_balls(
    rows_of: RowsOfPair, out: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> bool:
    """Booleans of a cloud of equal balls and a ball; False where a matrix is no pose.

    out, poses : as of `convex_batches.answer_sets`.
    """
    if not isinstance(A, PointCloud):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    assert isinstance(A, PointCloud)
    packed, n, work = convex_set_of(B), len(out), np.empty(WORK)
    states, centre = np.empty(n, dtype=np.uint8), np.ascontiguousarray(packed.points[0])
    (XA, step_a), (XB, step_b) = ((np.ascontiguousarray(X), 16 * (len(X) > 1)) for X in (X_WA, X_WB))
    done = clouds_meet_balls(
        A.tree.address, A.radius, address_of(centre), packed.radius, address_of(XA), step_a, address_of(XB), step_b, n,
        question.check, address_of(states), address_of(work),
    )
    if done < n:
        return False
    out[:] = states == MEETS
    for k in np.flatnonzero(states == OPEN).tolist():
        X_A, X_B = (X[k : k + 1] if len(X) > 1 else X for X in (XA, XB))
        out[k] = bool(_union_row(rows_of, A, B, X_A, X_B, question)["hit"][0])
    return True


def walks(shape: Shape) -> bool:
    """Whether a shape is a convex set with an end."""
    return is_single_convex(shape) and not isinstance(shape, Halfspace)


def balls_of(cloud: PointCloud) -> Items:
    """As the kernel of walks takes them."""
    tree, radius = cloud.tree, float(np.max(cloud.radius))
    reach = math.sqrt(float(np.square(np.maximum(np.abs(tree.low), np.abs(tree.high))).sum())) * (1.0 + 2.0**-50)
    return Items(tree, reach + radius, False, radius, cloud.radius if np.ndim(cloud.radius) else None, True)


def prepare_cloud(A: Shape, B: Shape) -> Prepared | None:
    """A cloud and a convex set with an end made ready for single calls; ``None`` of other pairs."""
    exchanged = not isinstance(A, PointCloud)
    cloud, shape = (B, A) if exchanged else (A, B)
    if not (isinstance(cloud, PointCloud) and walks(shape)):
        return None
    return prepared_items(balls_of(cloud), convex_set_of(shape), exchanged)


def _beyond_limit(rows: np.ndarray, limit: float) -> np.ndarray:
    """Rows farther apart than a limit [m] say no more than that they are."""
    beyond = rows["lower"] > limit
    rows["beyond"], rows["certified"] = beyond, rows["certified"] | beyond
    rows["distance"][beyond], rows["upper"][beyond] = rows["lower"][beyond], math.inf
    return rows


# --- unions of the balls nearby ------------------------------------------------------------------


def _union_row(
    rows_of: RowsOfPair, A: PointCloud, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, question: Question
) -> np.ndarray:
    """The row of a cloud and another shape at a pair of poses (1, 4, 4)."""
    if isinstance(B, Halfspace):
        some = lowest_balls(A, B, X_WA[0], X_WB[0])
        return _named(rows_of(union_of(A, some), B, X_WA, X_WB, math.inf, depths=question.depths), some)
    box = box_in_frame(B, X_WA[0], X_WB[0])
    some = balls_within(A, box, 0.0)
    row = None
    if len(some):
        row = _row_of(rows_of, A, B, X_WA, X_WB, some, box, depths=False)
    if row is not None and row["hit"][0]:
        return row if question.boolean or not question.depths else _depth(rows_of, A, B, X_WA, X_WB, some, box)
    if question.boolean:
        return np.zeros(1, dtype=PAIR_DTYPE) if row is None else row
    upper = math.inf if row is None else float(row["upper"][0])
    if row is None:
        middle = np.array([0.5 * (box.low + box.high)])
        first = A.tree.nearest(np.ascontiguousarray(middle), 1, math.inf)[1][0]
        upper = float(_row_of(rows_of, A, B, X_WA, X_WB, first, box, depths=False)["upper"][0])
    return _row_of(rows_of, A, B, X_WA, X_WB, balls_within(A, box, upper), box, depths=False)


def _row_of(
    rows_of: RowsOfPair, A: PointCloud, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, some: np.ndarray,
    box: BoxAround, *, depths: bool,
) -> np.ndarray:
    """The row of some balls and the other shape; of another cloud with its balls that may be nearest."""
    if not isinstance(B, PointCloud):
        return _named(rows_of(union_of(A, some), B, X_WA, X_WB, math.inf, depths=depths), some)
    # the other cloud stands first, and sees a union
    row = np.zeros(1, dtype=PAIR_DTYPE)
    question = Question(False, math.inf, depths)
    answer_cloud(rows_of, row, B, union_of(A, some), (X_WB, X_WA), question)
    return _named(flipped(row), some)


def _named(row: np.ndarray, some: np.ndarray) -> np.ndarray:
    """Rows that name balls of the cloud, not of the union."""
    row["part_a"] = some[row["part_a"]]
    row["vertices_a"], row["count"] = -1, 0
    return row


def _depth(
    rows_of: RowsOfPair, A: PointCloud, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, some: np.ndarray, box: BoxAround
) -> np.ndarray:
    """The row of an overlap: all balls within its depth have a say."""
    while True:
        row = _row_of(rows_of, A, B, X_WA, X_WB, some, box, depths=True)
        depth = max(-float(row["lower"][0]), -float(row["distance"][0]), 0.0)
        more = balls_within(A, box, depth)
        if len(more) <= len(some):
            return row
        some = more
