"""Casts of a mesh and another shape: candidates from the walk along box-trees, settled exactly where open."""

from __future__ import annotations

from threading import local
from typing import NamedTuple

import numpy as np

from collide.casts.cast_pairs import CAST_ROW, LOWER, NORMAL, QUESTION, SIZE, STATUS, TOUCHING, UPPER, VALUE
from collide.casts.cast_trees import (
    CANDIDATE,
    FACET_A,
    FACET_B,
    HEADER,
    OF_QUESTION,
    TREE_CAST_DOUBLES,
    TREE_CAST_INTEGERS,
    cast_into_tree,
)
from collide.casts.convex_casts import Marks, PairRows, answer_questions, settle_points
from collide.casts.leaves import Leaf
from collide.casts.portal import HIT, MISS, OPEN
from collide.casts.posed_parts import PartPairs, PosedParts
from collide.certificates.exact_parts import ExactPart, common_vertices, exact_part
from collide.kernels import address_of
from collide.lowering.facet_bodies import body_of
from collide.lowering.packed_convex import HALFSPACE, POINTS, PackedConvex, pack_points
from collide.lowering.parts import convex_set_of
from collide.lowering.shape_table import POSE, REACH, PoseTable, ShapeTable, pose_table
from collide.mesh.bvh import MeshTree
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.facets.facet_geometry import FacetCorners
from collide.shapes.mesh import Mesh, corners_of_facets


class _Workspace(local):
    """Scratch memory of one thread."""

    def __init__(self) -> None:
        self.doubles = np.zeros(TREE_CAST_DOUBLES)
        self.integers = np.zeros(TREE_CAST_INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_workspace = _Workspace()


class _Side(NamedTuple):
    """A side of n questions, meshes or convex sets.

    packed : the sets; empty for meshes.   trees : of meshes.   which : (n,) the set or tree of each question.
    poses : (n,) rows.   X, X_item : (n, 4, 4) body and item.   corners : of trees, once asked for.
    """

    packed: list[PackedConvex]
    trees: list[MeshTree]
    which: np.ndarray
    poses: PoseTable
    X: np.ndarray
    X_item: np.ndarray
    corners: dict[int, FacetCorners]

    def exact(self, k: int, facet: int) -> ExactPart | None:
        """The body of question k, or its facet, as exact numbers; None for curved bodies."""
        if self.trees:
            return ExactPart(POINTS, self._corners(self.which[k])[facet], 0.0, None, self.X[k], self.X_item[k])
        packed = self.packed[self.which[k]]
        if packed.kind != POINTS or packed.radius or packed.slop:
            return None
        return exact_part(packed, self.X[k], self.X_item[k])

    def _corners(self, tree: int) -> FacetCorners:
        if tree not in self.corners:
            self.corners[tree] = FacetCorners(self.trees[tree])
        return self.corners[tree]


class Casts(NamedTuple):
    """Casts of k questions.

    number : (k,) of each question's cast.   vectors : (k, 3) directions.   limits : (k,) of t.
    best : (n,) of all casts, upper bounds of their first contacts. A question whose contact is later does not matter.
    """

    number: np.ndarray
    vectors: np.ndarray
    limits: np.ndarray
    best: np.ndarray


def cast_leaves(A: list[Leaf], B: list[Leaf], X_WA, X_WB, casts: Casts, *, into_a: bool = False) -> PairRows:
    """Rows of k questions of bodies apart at the start, by question, the last two fields empty.

    A, B : a leaf for all questions, or on a single side k leaves: all meshes or all convex sets, no half-spaces but B.
    At least A or B is a mesh.   X_WA, X_WB : (k, 4, 4).   into_a : of two meshes walk the tree of A, a single leaf.
    """
    if not B[0].shape.meshed and convex_set_of(B[0].shape).kind == HALFSPACE:
        return _onto_plane(A[0], B[0], X_WA, X_WB, casts.vectors, casts.limits)
    side_a, side_b = _side(A, X_WA), _side(B, X_WB)
    if side_b.trees and not into_a:
        return _cast(side_a, side_b, casts)
    # The mesh moves: what stands is moved the other way instead.
    vectors = casts.vectors
    rows = _cast(side_b, side_a, casts._replace(vectors=-vectors))
    t = rows.rows[:, VALUE, None]
    rows.rows[:, NORMAL : NORMAL + 3] *= -1.0
    rows.rows[:, TOUCHING : TOUCHING + 3] += t * vectors[rows.owner]
    return rows


def _onto_plane(A: Leaf, B: Leaf, X_WA, X_WB, vectors, limits) -> PairRows:
    """A mesh meets a half-space where its corners do."""
    assert isinstance(A.shape, Mesh)
    packed = [pack_points(corners_of_facets(A.shape)), convex_set_of(B.shape)]
    n = len(limits)
    table, shape_of = ShapeTable(packed), np.repeat([0, 1], n)
    body_poses, part_poses = np.concatenate([X_WA, X_WB]), np.repeat([A.X, B.X], n, axis=0)
    poses = pose_table(body_poses, part_poses, table.numbers[shape_of, REACH])
    parts = PosedParts(table, poses, shape_of, body_poses, part_poses)
    none = np.zeros(n, dtype=np.int64)
    pairs = np.stack([np.arange(n), np.arange(n, 2 * n)], axis=1)
    return answer_questions(PartPairs(parts, pairs, np.arange(n), none, none), vectors, limits)


def _side(leaves: list[Leaf], X: np.ndarray) -> _Side:
    k = len(X)
    X_item = np.array([leaf.X for leaf in leaves])
    shapes = {id(leaf.shape): leaf.shape for leaf in leaves}
    row_of = {key: row for row, key in enumerate(shapes)}
    which = np.array([row_of[id(leaf.shape)] for leaf in leaves], dtype=np.int64)
    packed, trees = [], []
    if leaves[0].shape.meshed:
        trees = [body_of(shape).tree for shape in shapes.values()]
        reach = np.array([float(np.linalg.norm(tree.numbers[3:6])) for tree in trees])[which]
    else:
        packed = [convex_set_of(shape) for shape in shapes.values()]
        reach = np.array([part.reach for part in packed])[which]
    if len(leaves) < k:
        X_item, which, reach = np.repeat(X_item, k, axis=0), np.resize(which, k), np.resize(reach, k)
    return _Side(packed, trees, which, pose_table(X, X_item, reach, terms=False), X, X_item, {})


def _cast(A: _Side, B: _Side, casts: Casts) -> PairRows:
    """Rows of casts into a mesh B."""
    candidates = _candidates(A, B, casts)
    owner = candidates[:, OF_QUESTION].astype(np.int64)
    rows = np.ascontiguousarray(candidates[:, :CAST_ROW])
    k = len(rows)
    marks = Marks(rows[:, STATUS] == HIT, np.zeros(k, dtype=bool), np.zeros(k, dtype=bool))
    curved = np.array([packed.kind != POINTS for packed in A.packed] or [False] * len(A.trees))
    width = np.where(curved[A.which[owner]], PROMISE_CURVED, PROMISE_STORED) * rows[:, SIZE]
    _settle(A, B, candidates, rows, owner, marks, width, casts)
    marks.certified[:] = marks.proven & (rows[:, UPPER] - rows[:, LOWER] <= width)
    none = np.zeros(k, dtype=np.int64)
    return PairRows(rows, marks, owner, none, none)


def _candidates(A: _Side, B: _Side, casts: Casts) -> np.ndarray:
    """(k, CANDIDATE) what may be the first contacts."""
    n = len(casts.limits)
    questions = np.ascontiguousarray(np.hstack([casts.vectors, casts.limits[:, None]]))
    table = ShapeTable(A.packed or [pack_points(np.zeros((1, 3)))])
    table.build_trees(A.which if A.packed else np.zeros(1, dtype=np.int64))
    trees = np.array([tree.address for tree in A.trees], dtype=np.int64)[A.which] if A.trees else None
    shape_of = A.which if A.packed else np.zeros(n, dtype=np.int64)
    best = casts.best.copy()
    count, done, answered = np.zeros(2, dtype=np.int64), 0, []
    capacity = 1024 + 8 * n
    while True:
        candidates = np.empty((capacity, CANDIDATE))
        header = np.array(
            [
                0 if trees is None else address_of(trees), B.trees[0].address, *table.addresses,
                address_of(A.poses.rows), address_of(B.poses.rows), POSE, POSE, address_of(questions),
                address_of(candidates), capacity, address_of(shape_of), address_of(casts.number), address_of(best),
            ],
            dtype=np.int64,
        )
        assert len(header) == HEADER
        before, count[0] = done, 0
        done = cast_into_tree(address_of(header), done, n, address_of(count), *_workspace.addresses)
        answered.append(candidates[: count[0]].copy())
        if done == n:
            return np.concatenate(answered)
        if done == before:
            capacity *= 4


def _settle(A: _Side, B: _Side, candidates, rows, owner, marks: Marks, width: np.ndarray, casts: Casts) -> None:
    """Decide open candidates, nearest first, as long as they may be nearer than what is proven; drop the others."""
    best, limits, cast = casts.best.copy(), casts.limits, casts.number[owner]
    np.minimum.at(best, cast[marks.proven], rows[marks.proven, UPPER])
    rows[rows[:, LOWER] > best[cast], STATUS] = MISS
    wide = marks.proven & (rows[:, UPPER] - rows[:, LOWER] > width)
    unsettled = np.flatnonzero(((rows[:, STATUS] == OPEN) | wide) & (rows[:, STATUS] != MISS))
    for k in unsettled[np.argsort(rows[unsettled, LOWER], kind="stable")].tolist():
        q = owner[k]
        if rows[k, LOWER] > best[cast[k]]:
            rows[k, STATUS] = MISS
            continue
        facet_a, facet_b = (int(candidates[k, column]) for column in (FACET_A, FACET_B))
        exact_a, exact_b = A.exact(q, facet_a), B.exact(q, facet_b)
        if exact_a is None or exact_b is None:
            if not marks.proven[k]:
                rows[k, STATUS] = HIT
                rows[k, [LOWER, VALUE]] = np.minimum(rows[k, [LOWER, VALUE]], limits[q])
            continue
        question = np.empty(QUESTION)
        question[:3], question[3] = casts.vectors[q], limits[q]
        settle_points(*common_vertices(exact_a, exact_b), question, rows[k])
        if rows[k, STATUS] == HIT:
            marks.proven[k] = True
            best[cast[k]] = min(best[cast[k]], rows[k, UPPER])
