"""What `distance` says of two shapes at one pair of poses, as plain numbers and arrays."""

from __future__ import annotations

import numpy as np

from collide.kernels.prepared import nearest_of_pair, row_fields
from collide.pairs.query import distance
from collide.shapes.shape import Shape


def nearest_points(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, signed: bool = True) -> tuple:
    """(distance, normal, point_a, point_b, their middle, part_a, part_b, hit) of `distance` of A and B:
    floats [m], arrays (3,), ints, a bool. For programs that read these fields of every pair: the object returned by
    `distance` takes longer to set up than the distance of two boxes.
    """
    fields = None if nearest_of_pair is None else nearest_of_pair(A, B, X_WA, X_WB, signed)
    if fields is None:
        fields = row_fields(distance(A, B, X_WA, X_WB, signed=signed).rows.tobytes())
    return fields
