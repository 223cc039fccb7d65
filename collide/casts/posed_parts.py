"""Shapes at many poses as rows of convex parts, for kernels that take parts by number."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from collide.certificates.exact_parts import ExactPart, exact_part
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.parts import Part, parts_of
from collide.lowering.shape_table import REACH, PoseTable, ShapeTable, has_own_pose, pose_table
from collide.shapes.shape import Shape

#: Convex sets of a shape and their poses in it.
PartsOf = Callable[[Shape], Sequence[Part]]


class PosedParts(NamedTuple):
    """Parts of two sides, A's first, each in the world.

    table : of their shapes.   poses : a row a part.   shape_of : (parts,) their rows of the table.
    body_poses, part_poses : (parts, 4, 4) of the body in W, and of the part in it.
    """

    table: ShapeTable
    poses: PoseTable
    shape_of: np.ndarray
    body_poses: np.ndarray
    part_poses: np.ndarray

    def packed(self, part: int) -> PackedConvex:
        return self.table.packed[int(self.shape_of[part])]

    def exact(self, part: int) -> ExactPart:
        """A part as exact numbers."""
        return exact_part(self.packed(part), self.body_poses[part], self.part_poses[part])


class PartPairs(NamedTuple):
    """Pairs of parts that n questions come down to.

    parts : the parts of both sides.   pairs : (k, 2) part numbers.   owner : (k,) the question each belongs to.
    item_a, item_b : (k,) the numbers of the parts in their own bodies.
    """

    parts: PosedParts
    pairs: np.ndarray
    owner: np.ndarray
    item_a: np.ndarray
    item_b: np.ndarray


def posed_parts(items: list[tuple[PackedConvex, np.ndarray]], X_WA: np.ndarray) -> PosedParts:
    """Convex parts (packed, pose in A) of one body at its poses (n, 4, 4): all of the first pose, then of the next."""
    m, n = len(items), len(X_WA)
    table = ShapeTable([packed for packed, _ in items])
    shape_of = np.tile(np.arange(m), n)
    table.build_trees(shape_of)
    body_poses = np.repeat(X_WA, m, axis=0)
    part_poses = np.tile(np.array([X for _, X in items]).reshape(-1, 4, 4), (n, 1, 1))
    poses = pose_table(body_poses, part_poses, table.numbers[shape_of, REACH])
    return PosedParts(table, poses, shape_of, body_poses, part_poses)


class _Side(NamedTuple):
    """A side of n questions: parts of a shape for all, or of a shape for each.

    shape_of, body_poses, part_poses : of all parts.   first, counts : (n,) the parts of each question.
    """

    shape_of: np.ndarray
    body_poses: np.ndarray
    part_poses: np.ndarray
    first: np.ndarray
    counts: np.ndarray


class PosedSides(NamedTuple):
    """Parts of both sides of n questions.

    parts : of A's side, then of B's.   first, counts : (n, 2) where the parts of A and of B of each question begin, and
    how many they are.
    """

    parts: PosedParts
    first: np.ndarray
    counts: np.ndarray

    def all_pairs(self, some: np.ndarray) -> PartPairs:
        """Every pair of parts of questions, by their numbers, question by question."""
        n_pairs = self.counts[some].prod(axis=1)
        owner = np.repeat(some, n_pairs)
        within = np.arange(len(owner)) - np.repeat(np.cumsum(n_pairs) - n_pairs, n_pairs)
        return self.pairs(owner, *np.divmod(within, np.maximum(self.counts[owner, 1], 1)))

    def pairs(self, owner: np.ndarray, item_a: np.ndarray, item_b: np.ndarray) -> PartPairs:
        """Pairs of parts by question and numbers in their own bodies."""
        pairs = np.ascontiguousarray(self.first[owner] + np.stack([item_a, item_b], axis=1))
        return PartPairs(self.parts, pairs, owner, item_a, item_b)


def posed_sides(
    A, B, X_WA: np.ndarray, X_WB: np.ndarray, n: int, parts_of: PartsOf = parts_of,
    some: tuple[np.ndarray | None, np.ndarray | None] = (None, None),
) -> PosedSides:
    """Parts of A and B in n questions.

    A, B : a shape, or n of them.   X_WA, X_WB : (n, 4, 4), or (1, 4, 4) for all.
    parts_of : convex parts of a shape, or sets around them.   some : numbers of parts of A, and of B, where each is a
    single shape; ``None`` for all.
    """
    packed: list[PackedConvex] = []
    rows: dict[tuple[bytes, float], int] = {}

    def row_of(part: PackedConvex) -> int:
        key = part.content, part.slop
        if key not in rows:
            rows[key] = len(packed)
            packed.append(part)
        return rows[key]

    side_a, side_b = _side(A, X_WA, n, row_of, parts_of, some[0]), _side(B, X_WB, n, row_of, parts_of, some[1])
    shape_of = np.concatenate([side_a.shape_of, side_b.shape_of])
    body_poses = np.concatenate([side_a.body_poses, side_b.body_poses])
    part_poses = np.concatenate([side_a.part_poses, side_b.part_poses])
    table = ShapeTable(packed)
    table.build_trees(shape_of)
    reach = table.numbers[shape_of, REACH]
    poses = pose_table(body_poses, part_poses, reach, has_own_pose(part_poses))
    return PosedSides(
        PosedParts(table, poses, shape_of, body_poses, part_poses),
        np.stack([side_a.first, len(side_a.shape_of) + side_b.first], axis=1),
        np.stack([side_a.counts, side_b.counts], axis=1),
    )


def _side(shapes, X: np.ndarray, n: int, row_of, parts_of: PartsOf, some: np.ndarray | None) -> _Side:
    if isinstance(shapes, Shape):
        parts = parts_of(shapes)
        if some is not None:
            parts = tuple(parts[k] for k in some.tolist())
        m, k = len(parts), len(X)
        shape_of = np.tile(np.array([row_of(packed) for packed, _ in parts], dtype=np.int64), k)
        part_poses = np.tile(np.array([pose for _, pose in parts]).reshape(-1, 4, 4), (k, 1, 1))
        first = m * np.arange(n) if k == n else np.zeros(n, dtype=np.int64)
        return _Side(shape_of, np.repeat(X, m, axis=0), part_poses, first, np.full(n, m))
    numbers: dict[int, int] = {}
    distinct: list[Shape] = []
    for shape in shapes:
        if id(shape) not in numbers:
            numbers[id(shape)] = len(distinct)
            distinct.append(shape)
    which = np.array([numbers[id(shape)] for shape in shapes], dtype=np.int64)
    of_shapes = [parts_of(shape) for shape in distinct]
    all_rows = np.array([row_of(packed) for parts in of_shapes for packed, _ in parts], dtype=np.int64)
    all_poses = np.array([pose for parts in of_shapes for _, pose in parts]).reshape(-1, 4, 4)
    sizes = np.array([len(parts) for parts in of_shapes], dtype=np.int64)
    counts = sizes[which]
    first = np.cumsum(counts) - counts
    at = np.repeat((np.cumsum(sizes) - sizes)[which] - first, counts) + np.arange(counts.sum())
    body_poses = np.repeat(np.broadcast_to(X, (n, 4, 4)), counts, axis=0)
    return _Side(all_rows[at], body_poses, all_poses[at], first, counts)
