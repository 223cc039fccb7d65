"""Poses of parts in the world: exact where they claim to be, and within their slop elsewhere."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from naive import LATTICE_ROTATIONS, pose, random_pose, rng_of
from naive_triangles import world_points

from collide.lowering.shape_table import POSE_SLOP, POSE_TERMS, moved_pose, pose_table


def in_fractions(X) -> list[list[Fraction]]:
    return [[Fraction(v) for v in row] for row in np.asarray(X).tolist()]


def product(X_WB, X_BP) -> list[Fraction]:
    """(R row by row, t) of the exact product."""
    W, P = in_fractions(X_WB), in_fractions(X_BP)
    entries = [[sum(W[i][m] * P[m][j] for m in range(4)) for j in range(4)] for i in range(3)]
    return [v for row in entries for v in row[:3]] + [row[3] for row in entries]


def drawn(rng, kind: str) -> np.ndarray:
    if kind == "identity":
        return np.eye(4)
    if kind == "lattice":
        return pose(LATTICE_ROTATIONS[int(rng.integers(24))], rng.integers(-4, 5, 3) * 0.5)
    if kind == "shift":
        return pose(t=rng.normal(size=3))
    return random_pose(rng, 10.0 ** rng.integers(-8, 9))


def test_every_row_is_what_it_says():
    rng = rng_of("pose table")
    kinds = [(a, b) for a in ("identity", "lattice", "shift", "any") for b in ("identity", "lattice", "shift", "any")]
    X_WB, X_BP = (np.array([drawn(rng, pair[k]) for pair in kinds]) for k in range(2))
    table = pose_table(X_WB, X_BP, np.ones(len(kinds)))
    with_terms = 0
    for k, (of_body, of_part) in enumerate(kinds):
        row, true = table.rows[k], product(X_WB[k], X_BP[k])
        assert table.exact(k) == true, kinds[k]
        if "identity" in (of_body, of_part):  # the numbers given, bit by bit
            assert (
                [Fraction(v) for v in row[:12].tolist()] == true and row[POSE_TERMS] == -1.0 and row[POSE_SLOP] == 0.0
            )
            continue
        with_terms += row[POSE_TERMS] >= 0.0
        off = [abs(Fraction(v) - t) for v, t in zip(row[:12].tolist(), true)]
        assert sum(off[:3], off[9]) + sum(off[3:6], off[10]) + sum(off[6:9], off[11]) <= 3 * Fraction(
            float(row[POSE_SLOP])
        ), kinds[k]
    assert with_terms == 9


def test_tables_follow_one_another():
    rng = rng_of("two tables")
    X_WB, X_BP = (np.array([drawn(rng, "any") for _ in range(6)]) for _ in range(2))
    X_BP[[1, 4]] = np.eye(4)
    whole = pose_table(X_WB, X_BP, np.ones(6))
    both = pose_table(X_WB[:3], X_BP[:3], np.ones(3)).followed_by(pose_table(X_WB[3:], X_BP[3:], np.ones(3)))
    assert np.array_equal(both.rows, whole.rows) and np.array_equal(both.terms, whole.terms) and len(both) == 6


@pytest.mark.parametrize("kind", ["lattice", "shift", "any"])
def test_moved_poses_keep_their_slop(kind):
    rng = rng_of("moved poses", kind)
    seen: Counter = Counter()
    for _ in range(30):
        X_BP, X_WB = drawn(rng, kind), np.array([drawn(rng, "lattice" if k % 2 else "any") for k in range(4)])
        points = rng.normal(size=(3, 3))
        reach = float(np.sqrt((points**2).sum(axis=1)).max()) * (1 + 1e-15)
        found, slop = moved_pose(X_WB, X_BP, np.full(4, reach))
        rows = pose_table(X_WB, np.repeat(X_BP[None], 4, axis=0), np.full(4, reach)).rows
        assert np.array_equal(found[:, :3, :3].reshape(4, 9), rows[:, :9]) and np.array_equal(
            found[:, :3, 3], rows[:, 9:12]
        )
        for k in range(4):
            W, in_body = in_fractions(X_WB[k]), world_points(points, X_BP)
            for p, q in zip(world_points(points, found[k]), in_body):
                true = [sum(w * c for w, c in zip(W[i], q)) + W[i][3] for i in range(3)]
                off = sum((x - y) ** 2 for x, y in zip(p, true))
                assert off <= Fraction(float(slop[k])) ** 2
                seen["exact" if slop[k] == 0.0 else "rounded"] += 1
    assert seen["exact"] > 20 and (kind == "lattice" or seen["rounded"] > 20), seen
