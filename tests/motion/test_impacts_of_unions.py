"""Impacts of unions with many parts: the contact is that of all pairs of parts, few of which are searched."""

from __future__ import annotations

import numpy as np
import pytest
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.motion import convex_motions, surface_motions

AGAIN = (
    "import collide, numpy as np\n"
    "from test_impacts_of_unions import clutter\n"
    "A, B = clutter({a}, {meshed}, {seed!r}), clutter({b}, False, {seed!r})\n"
    "print(collide.time_of_impact(A, B, *(np.array(X) for X in {poses})))"
)
CORNERS, FACES = collide.tessellate(collide.Box((1.0, 0.8, 0.6)))[:2]


def clutter(n: int, meshed: bool, seed: str) -> collide.Compound:
    """So many small boxes, of facets or not, spread over a ball of a metre."""
    rng = rng_of(f"clutter in motion {n} {seed}")
    places = rng.uniform(-0.5, 0.5, (n, 3))
    poses = [collide.pose(p, rpy=r) for p, r in zip(places, rng.uniform(-3, 3, (n, 3)))]
    w = 0.4 / n ** (1 / 3)
    part = collide.Mesh(w * CORNERS, FACES) if meshed else collide.Box((w, 0.8 * w, 0.6 * w))
    return collide.Compound([(part, X) for X in poses])


@pytest.mark.parametrize(("a", "meshed", "b"), [(10, False, 12), (70, False, 1), (9, True, 8), (66, True, 1)])
def test_the_first_contact_is_that_of_all_pairs_of_parts(a, meshed, b):
    rng = rng_of(f"impacts of unions {a} {meshed} {b}")
    hits = []
    for seed in map(str, range(5)):
        A, B = clutter(a, meshed, seed), clutter(b, False, seed)
        poses = [random_pose(rng, 1.0) for _ in range(4)]
        n, aside = rng.normal(size=3), rng.normal(size=3) * rng.choice([0.2, 1.0])
        for X, t in zip(poses, (0.0 * n, 0.0 * n, 1.5 * n / np.linalg.norm(n), aside - 1.5 * n / np.linalg.norm(n))):
            X[:3, 3] = t
        with reproducing(AGAIN, a=a, meshed=meshed, b=b, seed=seed, poses=[X.tolist() for X in poses]):
            r = collide.time_of_impact(A, B, *poses)
            ones = [[collide.Compound([item]) for item in union.items] for union in (A, B)]
            i, j = np.divmod(np.arange(a * b), b)
            each = collide.time_of_impact([ones[0][k] for k in i], [ones[1][k] for k in j], *poses)
            hits.append(bool(r.hit))
            assert r.hit == each.hit.any() and r.certified
            if r.hit:
                assert r.lower <= each.upper.min() and each.lower.min() <= r.upper
                assert each.lower[r.part_a * b + r.part_b] <= r.upper
    assert 2 <= sum(hits), hits


def test_impacts_of_unions_search_few_pairs_of_parts(monkeypatch):
    """Of 150 × 150 convex parts, and of 150 meshes and a box."""
    jobs, searched = [], []
    find, few = convex_motions.find_impacts, surface_motions._search_few
    monkeypatch.setattr(convex_motions, "find_impacts", lambda *args: (jobs.append(args[2]), find(*args))[1])
    monkeypatch.setattr(surface_motions, "_search_few", lambda *args: (searched.append(1), few(*args))[1])
    ends = collide.pose((0.1, 0.0, 20.0)), collide.pose((0.0, 0.1, -20.0))
    eye = np.eye(4)
    assert collide.time_of_impact(clutter(150, False, "a"), clutter(150, False, "b"), eye, eye, *ends).hit
    assert 0 < sum(jobs) < 0.2 * 150 * 150, jobs
    assert collide.time_of_impact(clutter(150, True, "a"), collide.Box((0.3, 0.3, 0.3)), eye, eye, *ends).hit
    assert 0 < len(searched) < 40, len(searched)
