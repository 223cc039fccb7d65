"""Casts of two shapes of which one is a mesh: candidates from the walk along box-trees, settled where they are open."""

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
from collide.shapes.mesh import Mesh


class _Workspace(local):
    """Scratch memory of one thread."""

    def __init__(self) -> None:
        self.doubles = np.zeros(TREE_CAST_DOUBLES)
        self.integers = np.zeros(TREE_CAST_INTEGERS, dtype=np.int64)
        self.addresses = address_of(self.doubles), address_of(self.integers)


_workspace = _Workspace()


class _Side(NamedTuple):
    """One body of n casts.

    packed : of a convex set; of a mesh, None.   tree : of a mesh.   poses : (n,) rows.   X, X_item : body and item.
    """

    packed: PackedConvex | None
    tree: MeshTree | None
    poses: PoseTable
    X: np.ndarray
    X_item: np.ndarray

    def exact(self, k: int, facet: int, corners: FacetCorners | None) -> ExactPart | None:
        """The body, or one of its facets, of cast k as exact numbers; None where it has none."""
        if corners is not None:
            return ExactPart(POINTS, corners[facet], 0.0, None, self.X[k], self.X_item)
        assert self.packed is not None
        if self.packed.kind != POINTS or self.packed.radius or self.packed.slop:
            return None
        return exact_part(self.packed, self.X[k], self.X_item)


def cast_leaves(A: Leaf, B: Leaf, X_WA, X_WB, vectors: np.ndarray, limits: np.ndarray) -> PairRows:
    """Rows of n casts of bodies that are apart at the start, the last two fields empty.

    X_WA, X_WB : (n, 4, 4).   vectors : (n, 3).   limits : (n,) of t.
    """
    if not B.shape.meshed and convex_set_of(B.shape).kind == HALFSPACE:
        return _onto_plane(A, B, X_WA, X_WB, vectors, limits)
    side_a, side_b = _side(A, X_WA), _side(B, X_WB)
    if side_b.tree is not None:
        return _cast(side_a, side_b, vectors, limits)
    # The mesh moves: the convex set is moved the other way instead.
    rows = _cast(side_b, side_a, -vectors, limits)
    t = rows.rows[:, VALUE, None]
    rows.rows[:, NORMAL : NORMAL + 3] *= -1.0
    rows.rows[:, TOUCHING : TOUCHING + 3] += t * vectors[rows.owner]
    return rows


def _onto_plane(A: Leaf, B: Leaf, X_WA, X_WB, vectors, limits) -> PairRows:
    """A mesh meets a half-space where its corners do."""
    assert isinstance(A.shape, Mesh)
    packed = [pack_points(A.shape.vertices[np.unique(A.shape.faces)]), convex_set_of(B.shape)]
    n = len(limits)
    table, shape_of = ShapeTable(packed), np.repeat([0, 1], n)
    body_poses, part_poses = np.concatenate([X_WA, X_WB]), np.repeat([A.X, B.X], n, axis=0)
    poses = pose_table(body_poses, part_poses, table.numbers[shape_of, REACH])
    parts = PosedParts(table, poses, shape_of, body_poses, part_poses)
    none = np.zeros(n, dtype=np.int64)
    pairs = np.stack([np.arange(n), np.arange(n, 2 * n)], axis=1)
    return answer_questions(PartPairs(parts, pairs, np.arange(n), none, none), vectors, limits)


def _side(leaf: Leaf, X: np.ndarray) -> _Side:
    packed, tree = (None, body_of(leaf.shape).tree) if leaf.shape.meshed else (convex_set_of(leaf.shape), None)
    if packed is not None:
        reach = packed.reach
    else:
        assert tree is not None
        reach = float(np.linalg.norm(tree.numbers[3:6]))
    poses = pose_table(X, np.repeat(leaf.X[None], len(X), axis=0), np.full(len(X), reach))
    return _Side(packed, tree, poses, X, leaf.X)


def _cast(A: _Side, B: _Side, vectors: np.ndarray, limits: np.ndarray) -> PairRows:
    """Rows of casts into a mesh B."""
    candidates = _candidates(A, B, vectors, limits)
    owner = candidates[:, OF_QUESTION].astype(np.int64)
    rows = np.ascontiguousarray(candidates[:, :CAST_ROW])
    k = len(rows)
    marks = Marks(rows[:, STATUS] == HIT, np.zeros(k, dtype=bool), np.zeros(k, dtype=bool))
    width = PROMISE_CURVED if A.packed is not None and A.packed.kind != POINTS else PROMISE_STORED
    _settle(A, B, candidates, rows, owner, marks, width, vectors, limits)
    marks.certified[:] = marks.proven & (rows[:, UPPER] - rows[:, LOWER] <= width * rows[:, SIZE])
    none = np.zeros(k, dtype=np.int64)
    return PairRows(rows, marks, owner, none, none)


def _candidates(A: _Side, B: _Side, vectors: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(k, CANDIDATE) what may be the first contacts."""
    assert B.tree is not None
    n = len(limits)
    questions = np.ascontiguousarray(np.hstack([vectors, limits[:, None]]))
    table = ShapeTable([A.packed if A.packed is not None else pack_points(np.zeros((1, 3)))])
    table.build_trees(np.zeros(1, dtype=np.int64))
    count, done, answered = np.zeros(2, dtype=np.int64), 0, []
    capacity = 1024 + 8 * n
    while True:
        candidates = np.empty((capacity, CANDIDATE))
        header = np.array(
            [
                0 if A.tree is None else A.tree.address, B.tree.address, *table.addresses, address_of(A.poses.rows),
                address_of(B.poses.rows), POSE, POSE, address_of(questions), address_of(candidates), capacity,
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


def _settle(A: _Side, B: _Side, candidates, rows, owner, marks: Marks, width: float, vectors, limits) -> None:
    """Decide open candidates, nearest first, as long as they may be nearer than what is proven; drop the others."""
    assert B.tree is not None
    best = limits.copy()
    np.minimum.at(best, owner[marks.proven], rows[marks.proven, UPPER])
    rows[rows[:, LOWER] > best[owner], STATUS] = MISS
    corners_a = None if A.tree is None else FacetCorners(A.tree)
    corners_b = FacetCorners(B.tree)
    wide = marks.proven & (rows[:, UPPER] - rows[:, LOWER] > width * rows[:, SIZE])
    unsettled = np.flatnonzero(((rows[:, STATUS] == OPEN) | wide) & (rows[:, STATUS] != MISS))
    for k in unsettled[np.argsort(rows[unsettled, LOWER], kind="stable")].tolist():
        q = owner[k]
        if rows[k, LOWER] > best[q]:
            rows[k, STATUS] = MISS
            continue
        facet_a, facet_b = (int(candidates[k, column]) for column in (FACET_A, FACET_B))
        exact_a, exact_b = A.exact(q, facet_a, corners_a), B.exact(q, facet_b, corners_b)
        if exact_a is None or exact_b is None:
            if not marks.proven[k]:
                rows[k, STATUS] = HIT
                rows[k, [LOWER, VALUE]] = np.minimum(rows[k, [LOWER, VALUE]], limits[q])
            continue
        question = np.empty(QUESTION)
        question[:3], question[3] = vectors[q], limits[q]
        settle_points(*common_vertices(exact_a, exact_b), question, rows[k])
        if rows[k, STATUS] == HIT:
            marks.proven[k] = True
            best[q] = min(best[q], rows[k, UPPER])
