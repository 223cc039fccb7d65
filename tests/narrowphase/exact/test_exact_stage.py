"""The exact stage alone, on lattices where touching is planted: whatever it settles is right, and nothing else is
touched."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import naive
import numpy as np
import pytest
from curved_oracle import bracket
from exact_simplex import exact, inner
from naive import LATTICE_ROTATIONS, Case, pose, reproducible, rng_of
from naive_triangles import world_points

import collide
from collide.kernels import address_of
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.exact.depth_requests import REQUESTS
from collide.narrowphase.exact.exact_stage import settle_rows
from collide.narrowphase.exact.settle_space import WORKSPACE
from collide.results import EXACT, PAIR_DTYPE, PLANE, UNDECIDED

SHAPES = (
    collide.Box((1.0, 1.0, 2.0)), collide.Box((0.5, 1.0, 1.0)), collide.Sphere(0.5), collide.Capsule(0.25, 1.0),
    collide.ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]), collide.ConvexHull([(0, 0, 0), (0, 1, 1)]),
    collide.Halfspace((0.0, 0.0, 1.0), 0.5), collide.Halfspace((0.0, 0.0, -1.0), 0.25), collide.Cylinder(0.5, 1.0),
)
CURVED = (8,)
HALFSPACES = (6, 7)


class Scene:
    """Bodies at lattice poses, an ulp off now and then, and all rows of pairs open as if doubles knew nothing."""

    def __init__(self, rng, n: int):
        self.shape_of = rng.integers(0, len(SHAPES), n)
        ulps = rng.choice([0.0] * 6 + [2.0**-52, -(2.0**-53)], (n, 1))
        shifts = rng.integers(-2, 3, size=(n, 3)) * 0.5 * (1.0 + ulps)
        turns = rng.integers(0, 24, n)
        self.X = np.array([pose(LATTICE_ROTATIONS[turn], shift) for turn, shift in zip(turns, shifts)])
        packed = [parts_of(shape)[0] for shape in SHAPES]
        self.table = ShapeTable([p for p, _ in packed])
        X_BP = np.array([packed[k][1] for k in self.shape_of])
        self.poses = pose_table(self.X, X_BP, np.array([packed[k][0].reach for k in self.shape_of]))
        self.pairs = rng.integers(0, n, size=(4 * n, 2))
        self.pairs = np.ascontiguousarray(self.pairs[self.pairs[:, 0] != self.pairs[:, 1]])
        self.rows = np.zeros(len(self.pairs), dtype=PAIR_DTYPE)
        self.rows["how"], self.rows["lower"], self.rows["upper"] = UNDECIDED, -np.inf, np.inf
        self.rows["vertices_a"] = self.rows["vertices_b"] = -1

    def settle(self, **asked) -> np.ndarray:
        rows, digits = self.rows.copy(), np.zeros(WORKSPACE, dtype=np.int64)
        requests = np.zeros(REQUESTS, dtype=np.int64)
        settle_rows(
            rows, self.pairs, self.table, self.poses, self.shape_of, **asked, limit=np.inf, digits=digits,
            requests_at=address_of(requests),
        )
        return rows

    def case(self, k: int) -> Case:
        a, b = self.pairs[k]
        return Case(SHAPES[self.shape_of[a]], SHAPES[self.shape_of[b]], self.X[a], self.X[b])


def distance(case: Case) -> Fraction | None:
    """Exactly, but for a root's 40 digits; None for two half-spaces that meet without end."""
    A, B, X_WA, X_WB = case
    if isinstance(B, collide.Halfspace):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    if not isinstance(A, collide.Halfspace):
        return naive.exact_distance(case)
    n, p = exact([X_WA[:3, :3] @ A.normal])[0], exact([X_WA[:3, 3]])[0]  # turns of lattices round nothing
    offset = Fraction(A.offset) + inner(n, p)
    if isinstance(B, collide.Halfspace):
        m, q = exact([X_WB[:3, :3] @ B.normal])[0], exact([X_WB[:3, 3]])[0]
        return -(Fraction(B.offset) + inner(m, q)) - offset if inner(n, m) == -1 else None
    points, radius = naive.corners(B)
    return min(inner(n, x) for x in world_points(points, X_WB)) - offset - Fraction(radius)


@pytest.mark.parametrize(("boolean", "depths"), [(True, False), (False, False), (False, True)])
def test_planted_ties(boolean, depths):
    rng = rng_of("exact stage", boolean, depths)
    scene = Scene(rng, 160)
    rows = scene.settle(boolean=boolean, depths=depths)
    seen: Counter = Counter()
    for k, row in enumerate(rows):
        case = scene.case(k)
        kinds = scene.shape_of[scene.pairs[k]]
        if np.isin(kinds, CURVED).any():
            known = bracket(*case, depths=False)
            assert row == scene.rows[k] or (row["how"] == EXACT and known.hit in (None, row["hit"]))
            seen["curved" if row["how"] == EXACT else "curved, open"] += 1
            continue
        with reproducible(case):
            true = distance(case)
            assert row["how"] == EXACT and row["hit"] == (true is None or true <= 0)
            if true is None:
                seen["endless"] += 1
                continue
            assert Fraction(float(row["upper"])) >= true if row["upper"] < np.inf else boolean
            assert row["lower"] == -np.inf or Fraction(float(row["lower"])) <= true
            halfspaces = int(np.isin(kinds, HALFSPACES).sum())
            seen["touching" if true == 0 else "meeting" if true < 0 else "apart", halfspaces] += 1
            if not boolean and (true > 0 or depths):
                if not row["certified"]:  # more planes are level than are tried: doubles would have grown a surface
                    assert true <= 0 and min(len(naive.corners(shape)[0]) for shape in case[:2]) > 2
                    seen["too many planes"] += 1
                    continue
                assert abs(Fraction(float(row["distance"])) - true) <= 1e-15 * abs(true)
                gap = row["point_b"] - row["point_a"] - row["distance"] * row["normal"]
                assert true <= 0 or halfspaces == 1 or np.abs(gap).max() <= 1e-14
    for halfspaces in (0, 1):
        assert all(seen[what, halfspaces] >= 5 for what in ("touching", "meeting", "apart")), seen
    assert min(seen["curved"], seen["curved, open"]) >= 10 and seen["endless"] >= 1, seen
    assert seen["too many planes"] <= (40 if depths else 0), seen


def test_decided_rows_are_left_alone():
    scene = Scene(rng_of("decided rows"), 30)
    scene.rows["how"][::2] = PLANE
    scene.rows["distance"] = 7.0
    rows = scene.settle(boolean=False, depths=True)
    assert (rows[::2] == scene.rows[::2]).all() and (rows["how"][1::2] == EXACT).sum() >= 20
    scene.rows["how"] = PLANE
    assert (scene.settle(boolean=False, depths=True) == scene.rows).all()
