"""`collide.contacts` of random meshes, every row judged in rational arithmetic, and against `collide` and
`distance`."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from contact_oracle import check_row, facet
from mesh_families import (
    degenerate_case,
    flat_case,
    grid_case,
    identical_case,
    random_case,
    random_pose,
    right_angle_pose,
    soup,
    turned_grid_case,
)
from mesh_shapes import block_ring, box
from naive_triangles import as_integers, squared_distance, triangles_meet, world_points

import collide
from collide.contact.contact_rows import TRANSLATION

POINT, LINE = np.zeros((1, 3)), np.array([[0, 0, -0.25], [0, 0, 0.25]])
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def exact_distances(a, b, X_WA, X_WB) -> np.ndarray:
    exact = [world_points(a[0], X_WA), world_points(b[0], X_WB)]
    P, Q = as_integers(*exact)
    scale = max(x.denominator for points in exact for p in points for x in p)
    return np.array(
        [
            [float(squared_distance([P[v] for v in f], [Q[v] for v in g]) / scale**2) ** 0.5 for g in b[1].tolist()]
            for f in a[1].tolist()
        ]
    )


def test_every_pair_of_loose_facets():
    """Facets that share no corners hang together with nothing: every pair within the margin is a patch of its own."""
    patches = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        a, b = soup(rng, 6, 1.0, 0.3), soup(rng, 6, 1.0, 0.3)
        X_WA, X_WB = random_pose(rng), random_pose(rng)
        X_WB[:3, 3] = X_WA[:3, 3] + rng.normal(size=3) * 0.5
        truth = exact_distances(a, b, X_WA, X_WB)
        if (truth == 0).any():
            continue
        margin = float(rng.uniform(0.1, 0.6))
        A, B = collide.Mesh(*a, solid=False), collide.Mesh(*b, solid=False)
        c = collide.contacts(A, B, X_WA, X_WB, margin=margin)
        where = f"seed {seed}, margin {margin}"
        wanted = sorted(truth[truth <= margin].tolist())
        got = sorted(c.patches["distance"].tolist())
        assert len(got) == len(wanted) and np.abs(np.subtract(got, wanted)).max(initial=0.0) < 1e-12, where
        for row in c:
            check_row(row, a, b, X_WA, X_WB, nearest=True)
        for row in c.patches:
            own = truth[row["facet_a"], row["facet_b"]]
            assert row["lower"] <= own * (1 + 1e-15) and own <= row["upper"] * (1 + 1e-15), where
        patches += len(got)
    assert patches > 60


def solids_and_balls(rng):
    """Solids, surfaces and swept cores, (shape, vertices, faces, radius)."""
    pool = [
        (collide.Mesh(*box()), *box(), 0.0), (collide.Mesh(*block_ring()), *block_ring(), 0.0),
        (collide.Mesh(*TETRAHEDRON), *TETRAHEDRON, 0.0),
        (collide.Sphere(0.25), POINT, np.array([[0, 0, 0]]), 0.25),
        (collide.Capsule(0.125, 0.5), LINE, np.array([[0, 1, 1]]), 0.125),
    ]
    return pool[rng.integers(3)], pool[rng.integers(len(pool))]


def surfaces(family):
    def made(rng):
        a, b, X_WA, X_WB = family(rng)
        if rng.random() < 0.4:
            X_WB = X_WB.copy()
            X_WB[:3, 3] += rng.normal(size=3) * 3
        return (collide.Mesh(*a, solid=False), *a, 0.0), (collide.Mesh(*b, solid=False), *b, 0.0), X_WA, X_WB
    made.__name__ = family.__name__
    return made


def solids(rng):
    A, B = solids_and_balls(rng)
    return A, B, random_pose(rng, 0.0), random_pose(rng, 1.2)


def solids_on_a_grid(rng):
    A, B = solids_and_balls(rng)
    return A, B, right_angle_pose(rng), right_angle_pose(rng, (-1.5, -1.0, 0.0, 0.5, 1.5))


def nearly_touching(rng):
    """Solids brought together along the normal of their distance, to gaps and overlaps that are small."""
    while True:
        A, B, X_WA, X_WB = solids(rng)
        X_WB[:3, 3] *= 3
        r = collide.distance(A[0], B[0], X_WA, X_WB)
        if not r.hit:
            X_WB[:3, 3] -= (r.distance + rng.choice([1e-2, 1e-5, 1e-9, 0.0, -1e-9, -1e-5, -1e-2])) * r.normal
            return A, B, X_WA, X_WB


FAMILIES = [
    *map(surfaces, (random_case, grid_case, flat_case, turned_grid_case, degenerate_case, identical_case)), solids,
    solids_on_a_grid,
    nearly_touching,
]


@pytest.mark.many(6)
@pytest.mark.parametrize("family", FAMILIES, ids=lambda f: f.__name__)
def test_rows_are_what_they_promise(family):
    seen: Counter = Counter()
    for seed in range(24):
        judge(family, seed, seen)
    print(family.__name__, dict(seen))
    assert seen["rows"] > 20 and seen["hit"] + seen["gap"] > 6


def judge(family, seed, seen) -> None:
    """One case of a family; counts what came of it."""
    rng = np.random.default_rng(seed)
    A, B, X_WA, X_WB = family(rng)
    margin = float(rng.choice([0.0, 0.1, 0.3]))
    where = f"{family.__name__}(np.random.default_rng({seed})), margin {margin}"
    c = collide.contacts(A[0], B[0], X_WA, X_WB, margin=margin)
    r, hit = collide.distance(A[0], B[0], X_WA, X_WB), collide.collide(A[0], B[0], X_WA, X_WB)
    if hit:
        assert len(c) and c.lower.min() <= 0.0, where
    elif r.distance <= margin:
        assert len(c) and abs(c.distance.min() - r.distance) < 1e-12, where
    else:
        assert not len(c), where
    for row in c:
        if row["kind"] == TRANSLATION:
            assert row["distance"] == r.distance and (row["normal"] == r.normal).all(), where
            continue
        try:
            check_row(row, A[1:3], B[1:3], X_WA, X_WB, (A[3], B[3]), nearest=row["distance"] > 0 or A[3] + B[3] > 0)
        except AssertionError as error:
            raise AssertionError(f"{where}: {row}: {error}") from None
    for patch in np.unique(c.patch):
        own = c.rows[c.patch == patch]
        assert (own["normal"] == own["normal"][0]).all() and (own["apart"] == own["apart"][0]).all(), where
        assert own["distance"][0] <= own["distance"].min() + 1e-12 and len(own) <= 8, where
        if A[3] + B[3] == 0.0 and 0 < own["apart"][0] < np.inf and own["kind"][0] != TRANSLATION:
            assert clear_of_each_other(own, A, B, X_WA, X_WB), f"{where}, patch {patch}"
            seen["parted"] += 1
    seen["hit" if hit else "gap" if len(c) else "far"] += 1
    seen["rows"] += len(c)
    seen["way out"] += int((c.kind == TRANSLATION).any())
    flipped = collide.contacts(B[0], A[0], X_WB, X_WA, margin=margin)
    if A[0] != B[0] or not np.array_equal(X_WA, X_WB):
        assert np.array_equal(flipped.point_a, c.point_b) and np.array_equal(flipped.normal, -c.normal), where
        assert np.array_equal(flipped.facet_b, c.facet_a) and np.array_equal(flipped.upper, c.upper), where


def clear_of_each_other(rows, A, B, X_WA, X_WB) -> bool:
    """Whether the facets of a patch's rows are apart once B is moved by ``apart`` along the normal, exactly."""
    moved = X_WB.copy()
    moved[:3, 3] += rows["apart"][0] * rows["normal"][0]
    for i in np.unique(rows["facet_a"]):
        for j in np.unique(rows["facet_b"]):
            if not ((rows["facet_a"] == i) & (rows["facet_b"] == j)).any():
                continue
            P, Q = as_integers(facet(A[1], A[2], X_WA, i), facet(B[1], B[2], moved, j))
            if triangles_meet(P, Q):
                return False
    return True
