"""Two half-spaces whose normals are opposite within rounding, settled in Python's fractions.

Only exactly opposite ones can miss each other: the slightest tilt lets them meet, however far away.
A scene has a handful of half-spaces at most, so this needs no kernel.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.shape_table import PoseTable, ShapeTable
from collide.results import EXACT


def settle(rows: np.ndarray, open_rows: np.ndarray, pairs: np.ndarray, table: ShapeTable, poses: PoseTable, shape_of) -> None:
    """Settle those of the open rows (their numbers) that are pairs of half-spaces, in place."""
    for k in open_rows:
        one, other = (int(part) for part in pairs[k])
        packed = table.packed[shape_of[one]], table.packed[shape_of[other]]
        if packed[0].kind != HALFSPACE or packed[1].kind != HALFSPACE:
            continue
        # Worked out on the same numbers whichever way the pair is asked.
        flip = (packed[0].content, poses.rows[one].tobytes()) > (packed[1].content, poses.rows[other].tobytes())
        if flip:
            one, other = other, one
        _settle(rows[k : k + 1], *(_plane(table.packed[shape_of[part]].params, poses.exact(part)) for part in (one, other)))
        if flip:
            rows["normal"][k] = 0.0 - rows["normal"][k]
            rows["point_a"][k], rows["point_b"][k] = rows["point_b"][k].copy(), rows["point_a"][k].copy()


def _settle(row: np.ndarray, A, B) -> None:
    (n, a, p), (m, b, _) = A, B
    cross = [n[(i + 1) % 3] * m[(i + 2) % 3] - n[(i + 2) % 3] * m[(i + 1) % 3] for i in range(3)]
    row["how"], row["certified"], row["hit"], row["exact"] = EXACT, True, True, 1
    if any(cross):
        return  # they meet, and the overlap has no end: as the kernel left it
    # m = −c n: B is {x : n·x ≥ −b/c}, so the gap is (−b/c − a)/|n|.
    square = sum(v * v for v in n)
    c = -sum(u * v for u, v in zip(n, m)) / square
    gap = -b / c - a
    length = math.sqrt(float(square))
    distance = float(gap) / length
    slack = 4 * 2.0**-53 * abs(distance)
    row["hit"] = gap <= 0
    row["distance"], row["lower"], row["upper"] = distance, distance - slack, distance + slack
    row["normal"] = [float(v) / length for v in n]
    down = (sum(u * v for u, v in zip(n, p)) - a) / square
    row["point_a"] = [float(v - down * u) for u, v in zip(n, p)]
    row["point_b"] = row["point_a"] + distance * row["normal"]


def _plane(params: np.ndarray, pose: list[Fraction]):
    """(n, offset, p): the half-space is {x : n·x ≤ offset} in the world; p is its frame's origin."""
    R, p = [pose[0:3], pose[3:6], pose[6:9]], pose[9:12]
    cofactor = [
        [
            R[(i + 1) % 3][(j + 1) % 3] * R[(i + 2) % 3][(j + 2) % 3]
            - R[(i + 1) % 3][(j + 2) % 3] * R[(i + 2) % 3][(j + 1) % 3]
            for j in range(3)
        ]
        for i in range(3)
    ]
    n = [sum(c * Fraction(v) for c, v in zip(row, params[:3].tolist())) for row in cofactor]
    determinant = sum(a * b for a, b in zip(R[0], cofactor[0]))
    return n, Fraction(float(params[3])) * determinant + sum(u * v for u, v in zip(n, p)), p
