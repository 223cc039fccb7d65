"""Where EPA begins: four points of A ⊖ B as far apart as can be hoped for, or how flat it is."""

from __future__ import annotations

from collections import Counter

import naive
import numpy as np
import pytest
from exact_simplex import determinant, exact
from naive import Case, pose, random_pose, rng_of, rotation
from posed_bodies import PosedBodies

import collide
from collide.hull.exact_hull import convex_hull
from collide.narrowphase.epa import initial_polytope as I
from collide.narrowphase.epa.polytope_surface import POINTS
from collide.narrowphase.gjk.minkowski_difference import POINT

pytestmark = pytest.mark.plain_kernels


def of_rank(rng, rank: int) -> Case:
    """Two hulls whose difference has this dimension, one of which may have less."""
    frame = rotation(rng)[:rank]
    A, B = (
        collide.ConvexHull(rng.normal(size=(int(rng.integers(rank + 1, rank + 8)), rank)) @ frame) for _ in range(2)
    )
    if rank == 3 and rng.random() < 0.3:
        B = collide.Sphere(0.5)
    if rng.random() < 0.3:
        A = collide.ConvexHull(naive.corners(B)[0][:1])
        B = collide.ConvexHull(rng.normal(size=(rank + 4, rank)) @ frame)
    X = random_pose(rng)
    return Case(A, B, X, X @ pose(t=rng.normal(size=rank) @ frame))


@pytest.mark.parametrize("start", [0, 1, 3])
@pytest.mark.parametrize("rank", [0, 1, 2, 3])
def test_rank_and_extremes(rank, start):
    """As numpy counts it; where it is less than 3, the normal is orthogonal to all of A ⊖ B. Points are its points."""
    rng = rng_of("extremal tetrahedron", rank, start)
    for _ in range(25):
        case = of_rank(rng, rank)
        bodies = PosedBodies(*case)
        points, ids = [0.0] * (POINT * POINTS), [0] * (2 * POINTS)
        with naive.reproducible(case):
            found = I.extremal_tetrahedron(bodies.pair, points, ids, bodies.error, start)
            assert found.rank == rank
            difference = bodies.difference()
            corners = np.array([[float(x) for x in point] for point in difference.values()])
            spread, size = corners - corners[0], float(np.abs(corners).max())
            assert rank == np.linalg.matrix_rank(spread, tol=1e-9 * size)
            for k in range(min(rank + 1, 4)):
                true = difference[ids[2 * k], ids[2 * k + 1]]
                assert all(abs(x - float(y)) <= bodies.error for x, y in zip(points[POINT * k : POINT * k + 3], true))
            n = np.array(found.nhat)
            assert abs(np.linalg.norm(n) - 1.0) <= 1e-15
            if rank < 3:
                assert np.abs(spread @ n).max() <= 16 * bodies.error
                continue
            a, b, c, d = exact(np.array(points).reshape(-1, POINT)[:4, :3])
            e, f, g = ([x - y for x, y in zip(p, a)] for p in (b, c, d))
            assert determinant(e, f, g) != 0
            # The last point is the farthest there is from the first one, along the normal.
            heights = corners @ n - float(sum(float(x) * y for x, y in zip(a, n)))
            last = sum(float(x) * y for x, y in zip(g, n))
            assert abs(abs(last) - np.abs(heights).max()) <= 4 * bodies.error


def test_caps():
    """Vertices of A ⊖ B that span much; refused where it is flat, or where the origins are in one place."""
    rng = rng_of("capped tetrahedron")
    seen: Counter = Counter()
    for k in range(60):
        A, B = (collide.ConvexHull(naive.hull_points(rng, 40)) for _ in range(2))
        flat = collide.ConvexHull(naive.hull_points(rng, 30) * (1.0, 1.0, 0.0))
        case = Case(flat, collide.Sphere(0.2), pose(), pose(t=(0.1, 0.0, 0.0))) if k % 6 == 0 else Case(
            A, B, random_pose(rng, 0.3), random_pose(rng, 0.3)
        )
        if k % 6 == 1:
            case = case._replace(X_WB=pose(rotation(rng), case.X_WA[:3, 3]))
        bodies = PosedBodies(*case)
        size = bodies.ordered.size
        points, ids = [0.0] * (POINT * POINTS), [0] * (2 * POINTS)
        with naive.reproducible(case):
            capped = I.capped_tetrahedron(bodies.pair, points, ids, size)
            seen[k % 6, bool(capped)] += 1
            if not capped:
                continue
            four = np.array(points).reshape(-1, POINT)[:4, :3]
            volume = np.linalg.det(four[1:] - four[0])
            assert abs(volume) > 2.0**-17 * size**3
            difference = bodies.difference()
            true = np.array([[float(x) for x in difference[ids[2 * j], ids[2 * j + 1]]] for j in range(4)])
            assert np.abs(true - four).max() <= bodies.error
            corners = np.array([[float(x) for x in point] for point in difference.values()])
            hull = corners[np.unique(convex_hull(corners).facets)]
            assert all(np.abs(hull - p).max(axis=1).min() <= bodies.error for p in true)
    assert seen[0, False] == 10 and seen[1, False] == 10 and seen[2, True] >= 5, seen
