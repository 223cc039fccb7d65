"""Small hulls, eight pairs at a time: what portals decide or propose is right, proven, and nobody's neighbour's."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import naive
import numpy as np
import pytest
from naive import Case, pose, random_pose, rng_of

import collide
from collide.kernels import address_of, entry
from collide.lowering.parts import convex_set_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.gjk import mpr_batch as small_hulls
from collide.narrowphase.gjk.mpr import MAX_ITERATIONS
from collide.narrowphase.posed_pair import Tables
from collide.results import HOW, PAIR_DTYPE, flipped

#: Gaps and depths to ask about, in metres, of bodies about one metre long.
GAPS = (0.3, 0.02, 1e-4, 1e-9, 1e-13, 1e-16, -1e-16, -1e-13, -1e-9, -1e-4, -0.02, -0.2)


@entry("int64(int64, int64, int64, int64, int64, int64, boolean, float64, int64, int64, int64)")
def _answer(ints, numbers, poses, shape_of, pairs, n, boolean, limit, rows, doubles, integers):
    tables = Tables(ints, numbers, poses, shape_of)
    return small_hulls.answer_small_hulls(tables, pairs, n, boolean, limit, rows, doubles, integers)


def small_shape(rng) -> collide.Shape:
    """A box, a prism whose rim takes portals many rounds, or a hull of 4 to 32 points, one in eight of them flat."""
    kind = int(rng.integers(8))
    if kind < 2:
        return collide.Box(rng.uniform(0.2, 1.5, 3))
    if kind == 2:
        angle = np.arange(16) * (np.pi / 8)
        ring = np.column_stack([np.cos(angle), np.sin(angle), np.full(16, 0.2)])
        return collide.ConvexHull(np.concatenate([ring, ring * (1.0, 1.0, -1.0)]) * rng.uniform(0.3, 1.0))
    points = naive.hull_points(rng, int(rng.integers(4, 33)))
    if kind == 3:
        points[:, 2] = 0.25
    return collide.ConvexHull(points)


def asked(n: int, *words) -> list[Case]:
    """Pairs at every gap there is, and on a lattice, where they touch exactly."""
    rng = rng_of("portals", *words)
    cases = []
    for k in range(n):
        A, B = small_shape(rng), small_shape(rng)
        case = Case(A, B, random_pose(rng, 0.3), random_pose(rng, 1.2))
        if k % 13 == 12:
            box = collide.Box((1.0, 0.5, 0.25))
            t = rng.choice([-1.0, 1.0], 3) * [1.0, 0.5, 0.25] * (rng.integers(3) != np.arange(3))
            cases.append(Case(box, box, pose(t=(0.5, 2.0, 1.0)), pose(t=t + np.array([0.5, 2.0, 1.0]))))
        else:
            cases.append(naive.with_gap(case, GAPS[k % 13]))
    return cases


def rows_of(cases: list[Case], limit: float = 0.0, boolean: bool = True) -> np.ndarray:
    """What portals alone make of the rows."""
    packed = [convex_set_of(shape) for case in cases for shape in (case.A, case.B)]
    table = ShapeTable(packed)
    X = np.stack([X for case in cases for X in (case.X_WA, case.X_WB)])
    poses = pose_table(X, np.tile(np.eye(4), (len(X), 1, 1)), np.array([p.reach for p in packed]))
    shape_of, pairs = np.arange(len(packed)), np.arange(len(packed)).reshape(-1, 2)
    rows = np.zeros(len(cases), dtype=PAIR_DTYPE)
    doubles, integers = np.zeros(small_hulls.DOUBLES), np.zeros(small_hulls.TICKETS, dtype=np.int64)
    buffers = *table.addresses, address_of(poses.rows), address_of(shape_of), address_of(pairs)
    _answer(*buffers, len(pairs), boolean, limit, address_of(rows), address_of(doubles), address_of(integers))
    return rows


def decided(rows: np.ndarray) -> np.ndarray:
    return rows["how"] != HOW.index("undecided")


@pytest.mark.own_kernels
def test_what_portals_decide_is_right_and_proven():
    cases = asked(520, "right")
    rows = rows_of(cases)
    for case, row in zip(cases, rows):
        if decided(row):
            with naive.reproducible(case):
                signed = naive.exact_distance(case) if not row["hit"] else None
                assert bool(row["hit"]) == naive.exact_hit(case)
                if row["hit"]:
                    assert row["upper"] <= 0.0 and row["upper"] >= collide.distance(*case).lower
                else:
                    assert 0.0 < row["lower"] <= signed
                    assert naive.clearance_along(case, row["normal"]) >= row["lower"] * (1.0 - 1e-12)
    # All but those that are nearer to touching than rounding, and flat ones that overlap.
    gaps = np.array([abs(GAPS[k % 13]) if k % 13 < 12 else 0.0 for k in range(len(cases))])
    assert not decided(rows[gaps == 0.0]).any()
    assert naive.share(decided(rows[gaps > 1e-9])) > 0.95
    assert 0.3 < naive.share(rows["hit"][decided(rows)]) < 0.7
    assert (rows["iterations"][decided(rows)] <= MAX_ITERATIONS).all()


@pytest.mark.slow
def test_batches_answer_as_single_calls_and_exact_arithmetic_do():
    cases = asked(390, "batches")
    A, B = [case.A for case in cases], [case.B for case in cases]
    X_WA, X_WB = np.stack([case.X_WA for case in cases]), np.stack([case.X_WB for case in cases])
    hits = collide.collide(A, B, X_WA, X_WB)
    swapped = collide.collide(B, A, X_WB, X_WA)
    for k, case in enumerate(cases):
        with naive.reproducible(case):
            assert hits[k] == swapped[k] == collide.collide(*case) == naive.exact_hit(case)
    assert 0.3 < naive.share(hits) < 0.7


@pytest.mark.own_kernels
def test_gaps_are_right_and_common_points_are_common():
    """Without depths: brackets against exact arithmetic, points on both bodies, certificates."""
    cases = asked(260, "gaps")
    A, B = [case.A for case in cases], [case.B for case in cases]
    X_WA, X_WB = np.stack([case.X_WA for case in cases]), np.stack([case.X_WB for case in cases])
    gaps = collide.distance(A, B, X_WA, X_WB, signed=False)
    swapped = collide.distance(B, A, X_WB, X_WA, signed=False)
    back = flipped(swapped.rows)
    back["a"], back["b"] = 0, 1
    of_portals = decided(rows_of(cases, boolean=False))
    for k, case in enumerate(cases):
        with naive.reproducible(case):
            one = gaps[k]
            assert one.certified and one.hit == naive.exact_hit(case)
            if one.hit:
                assert one.lower == one.distance == one.upper == 0.0 and not one.normal.any()
                assert np.array_equal(one.point_a, one.point_b)
            else:
                assert one.lower <= naive.exact_distance(case) <= one.upper
            for shape, X, point in ((case.A, case.X_WA, one.point_a), (case.B, case.X_WB, one.point_b)):
                assert collide.distance(shape, collide.ConvexHull([(0.0, 0.0, 0.0)]), X, pose(t=point)).distance < 1e-13
            collide.verify(*case, one)
            alone = collide.distance(*case, signed=False)
            assert alone.rows.tobytes() == gaps.rows[k : k + 1].tobytes() and back[k] == gaps.rows[k]
    assert 0.3 < naive.share(gaps.hit) < 0.7
    deep = collide.distance(A, B, X_WA, X_WB).distance < -1e-8
    assert naive.share(of_portals[deep]) > 0.9 and not of_portals[~gaps.hit].any()


@pytest.mark.own_kernels
def test_portals_are_mostly_the_nearest_face():
    """What gaps are given to begin with leaves them one or two rounds near touching, where GJK alone takes five."""
    cases = [case for case in asked(390, "nearest") if 0.0 < collide.distance(*case).distance < 1e-3]
    rows = rows_of(cases, boolean=False)
    named = rows["count"] == 3
    assert len(cases) > 100 and naive.share(named) > 0.9
    sides = [case.A for case in cases], [case.B for case in cases]
    poses = np.stack([case.X_WA for case in cases]), np.stack([case.X_WB for case in cases])
    with_portals = collide.distance(*sides, *poses, signed=False)
    without = collide.distance(*sides, *poses)
    assert (np.maximum(with_portals.lower, without.lower) <= np.minimum(with_portals.upper, without.upper)).all()
    assert with_portals.iterations[named].mean() < 2.0 and without.iterations[named].mean() > 4.0


@pytest.mark.own_kernels
def test_no_row_depends_on_its_neighbours():
    cases = asked(96, "neighbours")
    gaps = rows_of(cases, boolean=False)
    for k, case in enumerate(cases):
        with naive.reproducible(case):
            assert rows_of([case], boolean=False).tobytes() == gaps[k : k + 1].tobytes()
    rows = rows_of(cases)
    rng = rng_of("neighbours, shuffled")
    for _ in range(4):
        order = rng.permutation(len(cases))[: int(rng.integers(40, 97))]
        for row, k in zip(rows_of([cases[k] for k in order]), order):
            if decided(row) or order[-8:].tolist().count(k) == 0:  # fewer than three at the end are left to GJK
                with naive.reproducible(cases[k]):
                    assert row.tobytes() == rows[k].tobytes()
    assert naive.share(decided(rows)) > 0.5


@pytest.mark.own_kernels
def test_few_pairs_and_other_shapes_are_left_alone():
    cases = [case for case in asked(60, "few") if abs(collide.distance(*case).distance) < 0.1]
    assert not decided(rows_of(cases[:2])).any()
    rounded = [
        Case(collide.ConvexHull(c.A.points, radius=0.1), c.B, c.X_WA, c.X_WB) for c in cases if hasattr(c.A, "points")
    ]
    large = collide.ConvexHull(naive.hull_points(rng_of("large"), 80))
    for others in (rounded, [c._replace(A=collide.Sphere(1.0)) for c in cases], [c._replace(A=large) for c in cases]):
        assert len(others) > 7 and not decided(rows_of(others)).any()


@pytest.mark.many(2)
@pytest.mark.parametrize("scale", (2.0**-100, 2.0**-60, 2.0**60, 2.0**100, 2.0**150))
def test_sizes_that_portals_cannot_multiply_are_answered_all_the_same(scale):
    cases = asked(26, "scale")
    A = [collide.ConvexHull(naive.corners(case.A)[0] * scale) for case in cases]
    B = [collide.ConvexHull(naive.corners(case.B)[0] * scale) for case in cases]
    X_WA, X_WB = ([pose(X[:3, :3], X[:3, 3] * scale) for X in side] for side in zip(*((c.X_WA, c.X_WB) for c in cases)))
    hits = collide.collide(A, B, np.stack(X_WA), np.stack(X_WB))
    for case, hit in zip(cases, hits):
        with naive.reproducible(case):
            assert hit == naive.exact_hit(case)


@pytest.mark.own_kernels
def test_a_limit_leaves_open_what_is_nearer():
    cases = asked(104, "limit")
    rows = rows_of(cases, limit=0.05)
    apart = decided(rows) & ~rows["hit"]
    assert apart.any() and (rows["lower"][apart] > 0.05).all() and rows["beyond"][apart].all()


def test_axes_that_come_back_part_the_bodies():
    rng = rng_of("portal axes")
    A, B = collide.Box((0.5, 0.4, 0.3)), collide.ConvexHull(naive.hull_points(rng, 12))
    X_WB = np.stack([random_pose(rng, 1.0) for _ in range(200)])
    axes = np.zeros((200, 3))
    hits = collide.collide(A, B, np.eye(4), X_WB, axes=axes)
    assert 0.1 < naive.share(hits) < 0.9
    for k in np.flatnonzero(~hits):
        assert naive.clearance_along(Case(A, B, np.eye(4), X_WB[k]), axes[k]) > 0.0
    assert not axes[hits].any()
    again = axes.copy()
    assert np.array_equal(collide.collide(A, B, np.eye(4), X_WB, axes=again), hits)


CHILD = """
import sys
sys.path[:0] = sys.argv[1:]
import test_mpr_batch as portals
for boolean in (True, False):
    sys.stdout.buffer.write(portals.rows_of(portals.asked(40, "plain"), boolean=boolean).tobytes())
"""


@pytest.mark.own_kernels
def test_without_compilation_the_bits_are_the_same():
    child = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", CHILD, *(str(Path(file).parent) for file in (__file__, naive.__file__))],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"}, cwd=Path(collide.__file__).parents[1], capture_output=True,
        timeout=300, check=False,
    )
    assert child.returncode == 0, child.stderr.decode()[-3000:]
    rows, gaps = (rows_of(asked(40, "plain"), boolean=boolean) for boolean in (True, False))
    assert child.stdout == rows.tobytes() + gaps.tobytes()
    assert naive.share(decided(rows)) > 0.5 and (gaps["count"] == 3).sum() > 20 and decided(gaps).sum() > 10
