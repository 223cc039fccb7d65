"""Two half-spaces with opposite normals: the gap of parallel planes, in Fractions, also at composed poses."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction

import numpy as np
import pytest
from exact_simplex import exact, inner
from naive import LATTICE_ROTATIONS, Case, pose, random_pose, reproducible, rng_of, same_bits

import collide
from collide.results import EXACT


def opposite(rng) -> Case:
    """Normals that are opposite exactly, or off by an ulp: a frame common to both, of a lattice or any."""
    X = random_pose(rng) if rng.random() < 0.5 else pose(LATTICE_ROTATIONS[int(rng.integers(24))])
    n = np.eye(3)[int(rng.integers(3))]
    A, B = collide.Halfspace(n, float(rng.normal())), collide.Halfspace(-n, float(rng.normal()))
    X_WB = X.copy()
    X_WB[:3, 3] += rng.normal(size=3)
    if rng.random() < 0.3:
        X_WB[int(rng.integers(3)), int(rng.integers(3))] *= 1 + 2.0**-52
    if rng.random() < 0.3:  # planes in one place
        A, B = collide.Halfspace(n, 0.0), collide.Halfspace(-n, 0.0)
        X_WB[:3, 3] = X[:3, 3]
    return Case(A, B, X, X_WB)


def plane(half: collide.Halfspace, X: np.ndarray) -> tuple[list[Fraction], Fraction]:
    """(n, b) of {x : n·x ≤ b} in the world, up to a positive factor: n = cof(R) m, b = b·det R + n·p."""
    R, p, m = exact(X[:3, :3]), exact([X[:3, 3]])[0], exact([half.normal])[0]
    cofactor = [[R[i - 2][j - 2] * R[i - 1][j - 1] - R[i - 2][j - 1] * R[i - 1][j - 2] for j in range(3)]
                for i in range(3)]
    n = [inner(row, m) for row in cofactor]
    return n, Fraction(half.offset) * inner(R[0], cofactor[0]) + inner(n, p)


def test_gaps_of_parallel_planes():
    rng = rng_of("opposite halfspaces")
    seen: Counter = Counter()
    for _ in range(150):
        case = opposite(rng)
        with reproducible(case):
            (n, a), (m, b) = plane(case.A, case.X_WA), plane(case.B, case.X_WB)
            parallel = not any(n[k - 2] * m[k - 1] - n[k - 1] * m[k - 2] for k in range(3))
            if not parallel:
                with pytest.raises(collide.UnsupportedQuery, match="no end"):
                    collide.distance(*case)
                assert collide.collide(*case)
                seen["askew"] += 1
                continue
            r = collide.distance(*case)
            factor = -inner(n, m) / inner(n, n)
            gap, square = -b / factor - a, inner(n, n)  # the distance is gap / √square
            assert r.how == EXACT and r.certified and r.hit == (gap <= 0) == collide.collide(*case)
            low, high = Fraction(r.lower), Fraction(r.upper)
            assert low * abs(low) * square <= gap * abs(gap) <= high * abs(high) * square
            assert r.lower <= r.distance <= r.upper <= r.lower + 4 * np.spacing(abs(r.distance)) * 4
            normal = np.array([float(x) for x in n]) / float(square) ** 0.5
            assert np.abs(r.normal - normal).max() <= 1e-15
            assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() <= 1e-15 * 8
            assert abs(float(inner(exact([r.point_a])[0], n) - a)) <= 1e-14
            seen["apart" if gap > 0 else "in one plane" if gap == 0 else "meeting"] += 1
            swapped = collide.distance(*case.swapped())
            assert not same_bits(swapped.rows[0], r.rows[0], ("distance", "lower", "upper", "hit"))
            assert (swapped.normal == -r.normal).all() and (swapped.point_a == r.point_b).all()
    assert all(seen[what] >= 8 for what in ("apart", "in one plane", "meeting", "askew")), seen


def test_numbers_of_all_sizes():
    """Offsets, shifts and normals of 10⁻³⁰⁰ to 10⁴⁹: the bracket holds the gap, but for the smallest doubles."""
    rng = rng_of("opposite halfspaces of all sizes")
    seen: Counter = Counter()
    for _ in range(60):
        sizes = [*10.0 ** rng.choice([0, -300, -160, 20, 49], 2), *10.0 ** rng.choice([0, -30, 20, 49], 2)]
        n = np.array([0.0, float(rng.uniform(1e-5, 1e5)), float(rng.normal()) * 10.0 ** rng.choice([0, -280])])
        offsets = (rng.normal(size=2) * sizes[:2]).tolist()
        A, B = collide.Halfspace(n, offsets[0]), collide.Halfspace(-n, offsets[1])
        X_WA, X_WB = (pose(LATTICE_ROTATIONS[0], rng.normal(size=3) * size) for size in sizes[2:])
        case = Case(A, B, X_WA, X_WB)
        with reproducible(case):
            (n_A, a), (n_B, b) = plane(A, X_WA), plane(B, X_WB)
            gap, square = b * inner(n_A, n_A) / inner(n_A, n_B) - a, inner(n_A, n_A)
            r = collide.distance(*case)
            assert r.how == EXACT and r.certified and r.hit == (gap <= 0) == collide.collide(*case)
            low, high = Fraction(r.lower), Fraction(r.upper)
            tiny = Fraction(5e-324) ** 2 * square * 16
            assert low * abs(low) * square - tiny <= gap * abs(gap) <= high * abs(high) * square + tiny
            seen["apart" if gap > 0 else "meeting"] += 1
    assert min(seen["apart"], seen["meeting"]) >= 10, seen
