"""The queue of gaps: rows finished eight at a time have the bits of rows finished alone, and their gaps are exact."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, Case, pose, random_pose, reproducible, rng_of

import collide
from collide.kernels import address_of, view_i64
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.convex_convex import convex_convex
from collide.narrowphase.gap import gap_queue as Q
from collide.narrowphase.kernel_dispatch import method
from collide.narrowphase.pair_workspace import DOUBLES, INTEGERS, Query, workspace_at
from collide.narrowphase.posed_pair import ordered_pair
from collide.narrowphase.rows import ROW, blank_row
from collide.results import PAIR_DTYPE, UNDECIDED

pytestmark = pytest.mark.plain_kernels

LANES = 8


class Pairs:
    """Bodies apart from each other, of one table; every fourth is a part with a pose of its own, at a body whose pose
    rounds nothing."""

    def __init__(self, rng, n: int):
        self.shapes, self.X, packed, X_WB, X_BP = [], [], [], [], []
        for k in range(2 * n):
            shape = (collide.Box(tuple(rng.uniform(0.3, 0.8, 3))), collide.Box((0.3, 0.9, 0.9)),
                     collide.ConvexHull(naive.hull_points(rng, 7) * 0.4, radius=float(rng.choice([0.0, 0.1]))),
                     collide.Capsule(0.1, 0.6), collide.Sphere(0.3))[
                int(rng.choice(5, p=[0.3, 0.3, 0.2, 0.1, 0.1]))]
            X = random_pose(rng, 0.3)
            if k % 2:
                X[:3, 3] += (0.0, 0.0, 2.0)
            if k % 6 == 1:  # level faces
                X[:3, :3] = self.X[-1][:3, :3]
                X[:3, 3] = self.X[-1][:3, 3] + X[:3, :3] @ (0.1, 0.2, 1.5)
            if k // 2 % 4 == 3 and k % 2:
                body = pose(LATTICE_ROTATIONS[int(rng.integers(1, 24))])
                X_WB.append(body)
                X_BP.append(X)
                X = body @ X
            else:
                X_WB.append(X)
                X_BP.append(np.eye(4))
            packed.append(parts_of(shape)[0][0])
            self.shapes.append(shape)
            self.X.append(X)
        self.table = ShapeTable(packed)
        self.poses = pose_table(np.array(X_WB), np.array(X_BP), np.array([p.reach for p in packed]))
        self.shape_of = np.arange(2 * n)
        self.doubles, self.integers = np.zeros(DOUBLES), np.zeros(INTEGERS, dtype=np.int64)
        self.work = workspace_at(address_of(self.doubles), address_of(self.integers))
        self.tables = *self.table.addresses, address_of(self.poses.rows)

    def case(self, k: int) -> Case:
        return Case(self.shapes[2 * k], self.shapes[2 * k + 1], self.X[2 * k], self.X[2 * k + 1])

    def enqueue(self, rows: np.ndarray, k: int) -> int:
        """The kind of gap that pair k is queued as."""
        ordered = ordered_pair(*self.tables, address_of(self.shape_of), 2 * k, 2 * k + 1)
        A, B = ordered.pair.A, ordered.pair.B
        query = Query(False, True, np.inf, address_of(self.poses.terms), False)
        row = blank_row(address_of(rows) + ROW * k)
        return convex_convex(ordered, method(A.kind, A.n, B.kind, B.n), query, row, k, 0, self.work)

    def refine(self, rows: np.ndarray, kind: int) -> None:
        queue = self.work.queue_at, self.work.queue_integers_at
        with np.errstate(all="ignore"):  # lanes that hold no question are zeros
            Q.refine_queued(*self.tables, kind, True, np.inf, address_of(rows), *queue)

    def answer(self, order, together: int) -> tuple[np.ndarray, list[int]]:
        """Rows of the pairs in some order, so many of a kind finished at once; their kinds."""
        rows = np.zeros(len(self.shapes) // 2, dtype=PAIR_DTYPE)
        n_queued = view_i64(self.work.queue_integers_at, Q.KINDS)
        Q.clear_queue(self.work.queue_integers_at)
        kinds = [-1] * len(rows)
        for k in order:
            kinds[k] = self.enqueue(rows, k)
            assert 0 <= kinds[k] < Q.KINDS
            if n_queued[kinds[k]] == together:
                self.refine(rows, kinds[k])
                assert n_queued[kinds[k]] == 0
        for kind in range(Q.KINDS):
            self.refine(rows, kind)
        return rows, kinds


def test_rows_do_not_depend_on_their_block():
    """Alone, in eights, in eights of another order with what earlier rows left in the lanes: the same bits."""
    rng = rng_of("gap queue")
    pairs = Pairs(rng, 120)
    n = len(pairs.shapes) // 2
    rows, kinds = pairs.answer(range(n), 1)
    for together in (LANES, 3):
        again, same_kinds = pairs.answer(rng.permutation(n).tolist(), together)
        assert kinds == same_kinds
        for k in range(n):
            with reproducible(pairs.case(k)):
                assert again[k].tobytes() == rows[k].tobytes()
    seen = Counter(kinds)
    assert sum(kind >= 6 for kind in kinds) == n // 4 and min(seen[0], seen[1], seen[2], seen[7]) >= LANES, seen
    assert seen[4] + seen[5] >= 3, "edges of two parts"


def test_gaps_are_exact():
    """The bracket of a certified row holds the exact gap; its points and normal are those of the bodies as asked."""
    rng = rng_of("gaps of queue")
    pairs = Pairs(rng, 60)
    rows, _ = pairs.answer(range(60), LANES)
    n_open = 0
    for k, row in enumerate(rows):
        case = pairs.case(k)
        with reproducible(case):
            true = naive.exact_distance(case)
            assert true > 0 and row["hit"] == 0
            assert Fraction(float(row["lower"])) <= true <= Fraction(float(row["upper"]))
            n_open += row["how"] == UNDECIDED
            if row["how"] != UNDECIDED:
                assert row["certified"] and row["upper"] - row["lower"] <= 4 * np.spacing(row["distance"])
            assert np.abs(row["point_b"] - row["point_a"] - row["distance"] * row["normal"]).max() <= 1e-13
            assert abs(naive.clearance_along(case, row["normal"]) - float(true)) <= 1e-13
    assert n_open <= 3, n_open


def test_common_corners():
    """A vertex pair with a vertex in common with each of the others, the first one; else two parts."""
    rng = rng_of("common corners")
    seen: Counter = Counter()
    for _ in range(400):
        n = int(rng.integers(1, 4))
        pairs = [tuple(ij) for ij in rng.integers(0, 3, size=(n, 2)).tolist()]
        joined = [k for k, p in enumerate(pairs) if all(p[0] == q[0] or p[1] == q[1] for q in pairs)]
        feature = [x for ij in pairs for x in ij] + [-1] * (6 - 2 * n)
        assert Q._common_corner(feature, n) == ((joined[0], 1) if joined else (0, 2)), pairs
        seen[n, joined[0] if joined else None] += 1
    assert min(seen[2, None], seen[3, None], seen[3, 1], seen[3, 2], seen[2, 0]) >= 5, seen
