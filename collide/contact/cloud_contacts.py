"""Contacts of point clouds: those of the balls within the margin, as a union."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.contact.contact_rows import no_rows
from collide.narrowphase.clouds.balls_nearby import balls_within, box_in_frame, union_of
from collide.pairs.pair_arguments import pose_at
from collide.shapes.point_cloud import PointCloud
from collide.shapes.shape import Shape

#: Rows of a pair: ``rows_of(A, B, X_WA, X_WB)``, poses (1, 4, 4).
RowsOf = Callable[[Shape, Shape, np.ndarray, np.ndarray], np.ndarray]


def cloud_contacts(
    rows_of: RowsOf, A, B, X_WA: np.ndarray, X_WB: np.ndarray, n: int, margin: float
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, ends) of n pairs, in some of which a cloud stands; parts of clouds are rows of ``points``.

    rows_of : what answers two other shapes.   A, B : shapes, or sequences of n.   X_WA, X_WB : checked.
    """
    pieces = []
    for k in range(n):
        shapes = [S if isinstance(S, Shape) else S[k] for S in (A, B)]
        poses = [np.ascontiguousarray(pose_at(X, k)) for X in (X_WA, X_WB)]
        pieces.append(_contacts_of(rows_of, shapes, poses, margin))
    rows = np.concatenate(pieces) if pieces else no_rows()
    return rows, np.cumsum([len(piece) for piece in pieces])


def _contacts_of(rows_of: RowsOf, shapes: list, poses: list, margin: float) -> np.ndarray:
    balls: list[np.ndarray | None] = [None, None]
    for side in range(2):
        cloud, B = shapes[side], shapes[1 - side]
        if isinstance(cloud, PointCloud):
            some = balls_within(cloud, box_in_frame(B, poses[side], poses[1 - side]), margin)
            if not len(some):
                return no_rows()
            balls[side], shapes[side] = some, union_of(cloud, some)
    rows = rows_of(*shapes, *(X[None] for X in poses)).copy()  # a single call's rows may be read-only
    for field, numbers in zip(("part_a", "part_b"), balls):
        if numbers is not None:
            rows[field] = numbers[rows[field]]
    return rows
