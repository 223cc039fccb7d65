"""The convex parts of a World's bodies as kernels read them: tables, poses and boxes, body after body.

New parts go behind the present parts, so the cost of adding does not grow with their number; parts of removed bodies
stay in place.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np

from collide.broadphase.bounding_boxes import boxes_of
from collide.broadphase.moved_bodies import SingleParts
from collide.lowering.packed_convex import PackedConvex
from collide.lowering.parts import bounding_parts_of, is_single_convex
from collide.lowering.shape_table import (
    NO_TERMS,
    POSE,
    POSE_TERMS,
    TERM_ROW,
    PoseTable,
    ShapeTable,
    has_own_pose,
    pose_table,
)
from collide.numerics.growing_rows import GrowingRows
from collide.shapes.shape import Shape

#: Two bodies with fewer pairs of parts than this are compared part by part.
MIN_BY_TREE = 1024


class WorldParts:
    """Parts of bodies by position (0 … n − 1).

    Attributes
    ----------
    shapes : the distinct shapes.   shape_of : (n,) which of them each body has.
    meshed, single_convex : (n,) bool: bodies asked as a whole, meshes above all; bodies with a single convex set in
        their own frame.
    counts, first : (n,), (n + 1,) how many parts each body has, and where they begin.   body_of : (parts,).
    table, row_of, poses : as `run_pairs` takes them.   X_BP : (parts, 4, 4).   boxes : (parts, 6).
    all_of_one_part, are_single : whether parts are bodies; and whether no part has a pose of its own besides.
    single : if so, the parts for moves; else ``None``.
    """

    def __init__(self) -> None:
        self.shapes: list[Shape] = []
        self._number_of: dict[int, int] = {}
        self.table = ShapeTable([])
        self._rows: dict[tuple[bytes, float], int] = {}
        # Of distinct shapes: first of their parts, how many, meshed, single_convex. Of these parts: row, X_SP, reach,
        # whether they have a pose of their own.
        self._of_shapes = _columns((np.int64,), (np.int64,), (bool,), (bool,))
        self._shape_parts = _columns((np.int64,), (float, 4, 4), (float,), (bool,))
        # shape_of, meshed, single_convex, counts.
        self._of_bodies = _columns((np.int64,), (bool,), (bool,), (np.int64,))
        # body_of, row_of, X_BP, reach, has_pose, rows of poses, boxes.
        self._of_parts = _columns((np.int64,), (np.int64,), (float, 4, 4), (float,), (bool,), (float, POSE), (float, 6))
        self._first = GrowingRows(np.zeros(1, dtype=np.int64))
        self._terms = GrowingRows.empty(float, TERM_ROW)
        self.all_of_one_part = self.are_single = True
        self._is_table_shared = False
        self._take_columns()

    def _take_columns(self) -> None:
        self.shape_of, self.meshed, self.single_convex, self.counts = (column.rows for column in self._of_bodies)
        self.first = self._first.rows
        self.body_of, self.row_of, self.X_BP, self._reach, self._has_pose, rows, self.boxes = (
            column.rows for column in self._of_parts
        )
        self.poses = PoseTable(rows, self._terms.rows if len(self._terms.rows) else NO_TERMS)
        self.single = SingleParts(self.table, self.row_of, rows, self.boxes) if self.are_single else None

    # --- adding and moving ----------------------------------------------------------------------

    def append(self, shapes: Sequence[Shape], X_WBs: np.ndarray) -> None:
        """Add bodies of these shapes at poses (k, 4, 4)."""
        n, n_parts = len(self.shape_of), len(self.body_of)
        shape_of = self._numbers_of(shapes)
        first, counts, meshed, single = (column.rows[shape_of] for column in self._of_shapes)
        of_shape = runs(first, counts)
        row_of, X_BP, reach, has_pose = (column.rows[of_shape] for column in self._shape_parts)
        body_of = np.repeat(np.arange(n, n + len(shapes)), counts)
        poses = pose_table(X_WBs[body_of - n], X_BP, reach, has_pose)
        boxes = boxes_of(self.table, poses.rows, row_of)
        moved = poses.rows[:, POSE_TERMS]
        moved[moved >= 0.0] += len(self._terms.rows)
        self._terms.extend(poses.terms)
        self._first.extend(n_parts + np.cumsum(counts))
        for column, rows in zip(self._of_bodies, (shape_of, meshed, single, counts)):
            column.extend(rows)
        for column, rows in zip(self._of_parts, (body_of, row_of, X_BP, reach, has_pose, poses.rows, boxes)):
            column.extend(rows)
        self.all_of_one_part = self.all_of_one_part and bool((counts == 1).all())
        self.are_single = self.are_single and self.all_of_one_part and not has_pose.any()
        self._take_columns()

    def copied(self) -> WorldParts:
        """The same parts, to be changed beside these, which do not change any more: what is only added to is shared."""
        made = copy.copy(self)
        made._of_shapes, made._shape_parts, made._of_bodies, made._of_parts = (
            [copy.copy(column) for column in columns]
            for columns in (self._of_shapes, self._shape_parts, self._of_bodies, self._of_parts)
        )
        made._of_parts[-2:] = [GrowingRows(column.rows.copy()) for column in self._of_parts[-2:]]  # poses and boxes
        made._first, made._terms = copy.copy(self._first), GrowingRows(self._terms.rows.copy())
        made._is_table_shared = True
        made._take_columns()
        return made

    def _own_table(self) -> None:
        """Shapes and their table become those of these parts alone, before shapes are added."""
        if self._is_table_shared:
            self.shapes, self.table, self._is_table_shared = list(self.shapes), self.table.copied(), False
            self._number_of, self._rows = dict(self._number_of), dict(self._rows)

    def _numbers_of(self, shapes: Sequence[Shape]) -> np.ndarray:
        """(k,) the number of each shape among the distinct shapes; new shapes are added."""
        self._own_table()
        keys, number_of = list(map(id, shapes)), self._number_of
        distinct = {key: shape for key, shape in dict(zip(keys, shapes)).items() if key not in number_of}
        parts = [bounding_parts_of(shape) for shape in distinct.values()]
        row_of = self._rows_of([packed for of_shape in parts for packed, _ in of_shape])
        X_SP = np.array([X for of_shape in parts for _, X in of_shape]).reshape(-1, 4, 4)
        reach = np.array([packed.reach for of_shape in parts for packed, _ in of_shape])
        counts = np.array([len(of_shape) for of_shape in parts], dtype=np.int64)
        first = len(self._shape_parts[0].rows) + np.cumsum(counts) - counts
        meshed, single = [s.is_asked_whole for s in distinct.values()], [is_single_convex(s) for s in distinct.values()]
        for column, values in zip(self._of_shapes, (first, counts, meshed, single)):
            column.extend(np.asarray(values, dtype=column.rows.dtype))
        for column, rows in zip(self._shape_parts, (row_of, X_SP, reach, has_own_pose(X_SP))):
            column.extend(rows)
        for key, shape in distinct.items():
            number_of[key] = len(self.shapes)
            self.shapes.append(shape)
        return np.fromiter(map(number_of.__getitem__, keys), dtype=np.int64, count=len(keys))

    def _rows_of(self, packed: list[PackedConvex]) -> np.ndarray:
        """The table row of every convex set; new sets are added."""
        new: list[PackedConvex] = []
        row_of = np.empty(len(packed), dtype=np.int64)
        for k, part in enumerate(packed):
            key = part.content, part.slop
            if key not in self._rows:
                self._rows[key] = len(self._rows)
                new.append(part)
            row_of[k] = self._rows[key]
        if new:
            self.table.append(new)
        return row_of

    def move(self, bodies: np.ndarray, X_WBs: np.ndarray) -> None:
        """Take new poses of bodies (k,), ascending, from those of all (n, 4, 4). Others' boxes are not made again."""
        parts: np.ndarray | slice = bodies if self.all_of_one_part else self.parts_of(bodies)
        if len(bodies) == len(self.shape_of):
            parts = slice(None)  # all of them: nothing is gathered
        X_WB = X_WBs[self.body_of[parts]]
        moved = pose_table(X_WB, self.X_BP[parts], self._reach[parts], self._has_pose[parts])
        before = self.poses.rows[parts, POSE_TERMS].copy()
        has_terms = before >= 0.0
        if np.array_equal(has_terms, moved.rows[:, POSE_TERMS] >= 0.0):  # exact terms of products keep their places
            if has_terms.any():
                self.poses.terms[before[has_terms].astype(np.int64)] = moved.terms
                moved.rows[has_terms, POSE_TERMS] = before[has_terms]
            self.poses.rows[parts] = moved.rows
        else:
            self._pose_anew(X_WBs)
        self.boxes[parts] = boxes_of(self.table, moved.rows, self.row_of[parts])

    def _pose_anew(self, X_WBs: np.ndarray) -> None:
        poses = pose_table(X_WBs[self.body_of], self.X_BP, self._reach, self._has_pose)
        self.poses.rows[:] = poses.rows
        self._terms = GrowingRows(poses.terms)
        self._take_columns()

    # --- what there is --------------------------------------------------------------------------

    def parts_of(self, bodies: np.ndarray) -> np.ndarray:
        """Parts of bodies, one body after another."""
        return runs(self.first[bodies], self.counts[bodies])

    def spans(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 2): first part and number of parts of bodies."""
        return np.stack([self.first[bodies], self.counts[bodies]], axis=1)

    def body_boxes(self, bodies: np.ndarray) -> np.ndarray:
        """(k, 6) boxes around the parts of each body."""
        if self.all_of_one_part:
            return self.boxes[bodies]
        boxes, counts = self.boxes[self.parts_of(bodies)], self.counts[bodies]
        starts = np.cumsum(counts) - counts
        low, high = np.minimum.reduceat(boxes[:, :3], starts), np.maximum.reduceat(boxes[:, 3:], starts)
        return np.hstack([low, high])

    @property
    def nbytes(self) -> int:
        """Memory of the columns [bytes], without that of shapes."""
        columns = [*self._of_bodies, *self._of_parts, *self._of_shapes, *self._shape_parts, self._first, self._terms]
        return sum(column.nbytes for column in columns) + self.table.ints.nbytes + self.table.numbers.nbytes


def _columns(*kinds: tuple) -> list[GrowingRows]:
    """Empty columns of kinds (dtype, *shape of a row)."""
    return [GrowingRows.empty(dtype, *shape) for dtype, *shape in kinds]


def runs(starts: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Numbers starts[k], …, starts[k] + counts[k] − 1, one run after another."""
    return np.repeat(starts - (np.cumsum(counts) - counts), counts) + np.arange(counts.sum())
