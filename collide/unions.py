"""Bodies that are unions of convex sets: one answer from the answers of their parts.

Apart, the distance of two unions is the least one of their parts. Overlapping, the smallest
separating translation has no such formula; what is reported is a translation that separates the
hulls of both bodies along the best of the parts' normals, which is a proven upper bound, beside
the proven lower bound that each overlapping pair of parts must come apart.
"""

from __future__ import annotations

import math

import numpy as np

from collide.geometry.extents import extent_of_row
from collide.geometry.packing import HALFSPACE, POINTS, PackedConvex
from collide.narrowphase.bounds import ERROR, PROMISE_CURVED, PROMISE_STORED
from collide.results import PAIR_DTYPE

#: Normals of overlapping parts that are tried as the way out of a union, deepest first.
_NORMALS_TRIED = 8


class Union:
    """The convex parts of one posed body: shapes, and their rows of a pose table."""

    def __init__(self, packed: list[PackedConvex], poses: np.ndarray):
        self.packed, self.poses = packed, poses

    def extent(self, n: np.ndarray) -> tuple[float, float]:
        """(support value of the whole body along unit n, its error), both in the world."""
        value, size = -math.inf, 0.0
        for packed, row in zip(self.packed, self.poses):
            value = max(value, extent_of_row(packed, row, n))
            size = max(size, 2 * packed.reach + packed.radius + float(np.abs(row[9:12]).sum()))
        slop = max(p.slop for p in self.packed) + float(self.poses[:, 12].max())
        return value, ERROR * size + slop


def combine(rows: np.ndarray, starts: np.ndarray, plural: np.ndarray, sides) -> np.ndarray:
    """One row a body pair from rows of part pairs.

    Parameters
    ----------
    rows : PAIR_DTYPE, the part pairs of a body pair standing together.
    starts : first row of each body pair.
    plural : bool, whether a body of the pair has several parts. Parts too far apart may have been
        left out of ``rows``, but they still bar the way out.
    sides : callable k → (Union A, Union B) of body pair k; asked only where unions overlap.
    """
    if not plural.any():
        return rows
    ends = np.append(starts[1:], len(rows))
    out = np.zeros(len(starts), dtype=PAIR_DTYPE)
    for k, (start, end) in enumerate(zip(starts, ends)):
        group = rows[start:end]
        out[k] = _nearest(group, lambda k=k: sides(k)) if plural[k] else group[0]
    return out


def _nearest(group: np.ndarray, sides) -> np.ndarray:
    """The row of the nearest pair of parts, its bracket widened to hold for the unions."""
    row = group[np.argmin(group["distance"])].copy()
    row["lower"], row["upper"] = group["lower"].min(), group["upper"].min()
    row["hit"] = group["hit"].any()
    rivals = group[group["lower"] <= row["upper"]]
    row["certified"] = bool(rivals["certified"].all())
    row["iterations"] = min(int((group["iterations"] & 0xFFFF).sum()), 0xFFFF) | (
        min(int((group["iterations"] >> 16).sum()), 0x7FFF) << 16
    )
    if row["upper"] < 0.0:
        promised = _way_out(row, group, *sides())
        row["certified"] = row["certified"] and float(row["upper"] - row["lower"]) <= promised
    return row


def _way_out(row: np.ndarray, group: np.ndarray, A: Union, B: Union) -> float:
    """Replace distance, lower and normal by the best translation that separates both unions.

    Returns the width of bracket that is promised for bodies of this size. Against one half-space the deepest part already tells it: there is one way out for all.
    """
    if any(len(body.packed) == 1 and body.packed[0].kind == HALFSPACE for body in (A, B)):
        return math.inf
    hits = group[group["upper"] < 0.0]
    best, error = math.inf, 0.0
    for k in np.argsort(hits["distance"], kind="stable")[:_NORMALS_TRIED]:
        n = hits["normal"][k]
        reach_a, error_a = A.extent(n)
        reach_b, error_b = B.extent(-n)
        depth, error = reach_a + reach_b, error_a + error_b
        if depth + error < best:
            best = depth + error
            row["normal"], row["point_a"], row["point_b"] = n, hits["point_a"][k], hits["point_b"][k]
            row["part_a"], row["part_b"] = hits["part_a"][k], hits["part_b"][k]
            row["distance"], row["lower"] = min(-depth, row["upper"]), -depth - error
    if math.isinf(best):
        row["distance"] = row["lower"] = -math.inf
    else:
        # The points of the deepest parts fit that normal's own depth: keep their middle.
        middle, half = 0.5 * (row["point_a"] + row["point_b"]), 0.5 * row["distance"] * row["normal"]
        row["point_a"], row["point_b"] = middle - half, middle + half
    curved = any(packed.kind != POINTS for body in (A, B) for packed in body.packed)
    return (PROMISE_CURVED if curved else PROMISE_STORED) / ERROR * error


