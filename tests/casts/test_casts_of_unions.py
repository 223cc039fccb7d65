"""`shape_cast` of unions with many items: the answer is that of all pairs of items, few of which are asked."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.casts import cast_batches, convex_casts
from collide.casts.union_cast import COMPOSITE
from collide.narrowphase.composite.composite_block import N_ANSWERED
from collide.narrowphase.prepared_pairs import prepared_pair

AGAIN = (
    "import collide, numpy as np\n"
    "from test_casts_of_unions import clutter\n"
    "A, B = clutter({kinds_a!r}, {a}, {seed!r}), clutter({kinds_b!r}, {b}, {seed!r})\n"
    "print(collide.shape_cast(A, np.array({X}), {d}, B, np.eye(4), max_distance={limit}))"
)

CORNERS, FACES = collide.tessellate(collide.Box((1.0, 1.0, 1.0)))[:2]
MAKERS = {
    "box": lambda w: collide.Box((w, 0.8 * w, 0.6 * w)), "sphere": lambda w: collide.Sphere(0.5 * w),
    "can": lambda w: collide.Cylinder(0.4 * w, w), "capsule": lambda w: collide.Capsule(0.2 * w, 0.6 * w),
    "mesh": lambda w: collide.Mesh(w * CORNERS, FACES),
}


def clutter(kinds: tuple[str, ...], n: int, seed: str) -> collide.Compound:
    """So many small shapes spread over a ball of a metre, kinds in turn."""
    rng = rng_of(f"{kinds} {n} {seed}")
    places = rng.normal(size=(n, 3))
    places *= (0.5 * rng.uniform(0, 1, n) ** (1 / 3) / np.linalg.norm(places, axis=1))[:, None]
    poses = [collide.pose(p, rpy=r) for p, r in zip(places, rng.uniform(-3, 3, (n, 3)))]
    return collide.Compound([(MAKERS[kinds[k % len(kinds)]](0.5 / n ** (1 / 3)), X) for k, X in enumerate(poses)])


def by_all_pairs(A: collide.Compound, B: collide.Compound, X, d, limit: float):
    """((items of A, items of B) t of the first contact of every pair of items, infinite of none; the casts)."""
    ones_a, ones_b = ([collide.Compound([item]) for item in union.items] for union in (A, B))
    n, m = len(ones_a), len(ones_b)
    a, b = np.divmod(np.arange(n * m), m)
    casts = collide.shape_cast(
        [ones_a[k] for k in a], X, d, [ones_b[k] for k in b], np.eye(4), max_distance=limit
    )
    return casts.distance.reshape(n, m), casts


@pytest.mark.many(2)
@pytest.mark.parametrize(
    ("kinds_a", "a", "kinds_b", "b"),
    [
        (("box", "sphere"), 12, ("box", "can", "capsule"), 15),
        (("can",), 1, ("box", "sphere"), 90),
        (("mesh",), 9, ("box", "can", "mesh"), 9),
        (("sphere", "box"), 20, ("mesh",), 4),
    ],
)
def test_the_first_contact_is_that_of_all_pairs_of_items(kinds_a, a, kinds_b, b):
    """Bit by bit: distance, normal and point, items; bodies that graze, miss, stop before, or overlap at the start."""
    outcomes: list[str] = []
    for seed in map(str, range(4 if "mesh" in kinds_a + kinds_b else 12)):  # pairs with a mesh are asked one by one
        rng = rng_of(f"casts of unions {kinds_a} {kinds_b} {seed}")
        A, B = clutter(kinds_a, a, seed), clutter(kinds_b, b, seed)
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        X = random_pose(rng, 1.0)
        X[:3, 3] = rng.uniform(-0.6, 0.6, 3) - rng.choice([0.3, 2.0]) * d
        limit = float(rng.choice([np.inf, 2.0, 1.6]))
        with reproducing(AGAIN, kinds_a=kinds_a, a=a, kinds_b=kinds_b, b=b, seed=seed, X=X, d=tuple(d), limit=limit):
            r = collide.shape_cast(A, X, d, B, np.eye(4), max_distance=limit)
            t, all_casts = by_all_pairs(A, B, X, d, limit)
            assert r.hit == np.isfinite(t).any() and r.certified
            assert r.distance == t.min() and r.at_start == (t.min() == 0.0)
            outcomes.append("miss" if not r.hit else "start" if r.at_start else "hit")
            if not r.hit:
                continue
            assert r.upper == np.where(all_casts.hit, all_casts.upper, np.inf).min()
            assert r.lower == all_casts.lower[all_casts.hit].min()
            if not r.at_start:
                first = int(t.argmin())
                assert (r.item_a, r.item_b) == divmod(first, t.shape[1])
                assert np.array_equal(r.point, all_casts.point[first])
                assert np.array_equal(r.normal, all_casts.normal[first])
    assert 2 <= outcomes.count("hit") < len(outcomes), outcomes


def test_a_batch_of_casts_of_unions_is_the_casts_one_by_one():
    """One body stands still, both move, or shapes differ from cast to cast: large unions, small ones, single bodies."""
    rng = rng_of("batches of casts of unions")
    unions = [clutter(("box", "sphere"), n, "of a batch") for n in (1, 30, 12)]
    n = 24
    X = np.array([random_pose(rng, 1.0) for _ in range(n)])
    X[:, :3, 3] = rng.normal(size=(n, 3))
    moving = [unions[k] for k in rng.integers(0, 3, n)]
    for A, B, X_WB in ((moving, unions[1], np.eye(4)), (unions[1], moving, X[::-1].copy())):
        d = X_WB[..., :3, 3] - X[:, :3, 3] + rng.normal(size=(n, 3)) * 0.3
        together = collide.shape_cast(A, X, d, B, X_WB)
        for k in range(n):
            A_k, B_k = (side if isinstance(side, collide.Shape) else side[k] for side in (A, B))
            one = collide.shape_cast(A_k, X[k], d[k], B_k, X_WB if X_WB.ndim == 2 else X_WB[k])
            for name, value in zip(one._fields, one):
                assert np.array_equal(getattr(together, name)[k], value), (k, name)
        assert 8 <= together.hit.sum() < n


def test_casts_of_unions_ask_few_pairs_of_parts(monkeypatch):
    """Of 200 × 200 convex parts, in a kernel, and where it leaves the cast to the long way."""
    asked = []
    answer = convex_casts.answer_part_pairs
    monkeypatch.setattr(
        convex_casts, "answer_part_pairs", lambda *args: (asked.append(len(args[1])), answer(*args))[1]
    )
    A, B = clutter(("can",), 200, "moves"), clutter(("box",), 200, "stands")
    question = A, collide.pose((-5.0, 0.1, 0.0)), (1, 0, 0), B, np.eye(4)
    r = collide.shape_cast(*question)
    way = prepared_pair(A, B).cast
    assert r.hit and not asked and 0 < way._header[COMPOSITE + N_ANSWERED] < 50
    monkeypatch.setattr(type(way), "first_contact", lambda *_: None)
    again = collide.shape_cast(*question)
    assert 0 < sum(asked) < 200, asked
    assert all(np.array_equal(x, y) for x, y in zip(r, again))


@pytest.mark.parametrize("kinds", [("box",), ("can",), ("box", "can", "sphere", "capsule")])
def test_casts_by_the_kernel_have_the_bits_of_the_long_way(kinds, monkeypatch):
    """Single and in batches, of every length of direction; touching at the start, and missing, too."""
    rng = np.random.default_rng(len(kinds[0]) + len(kinds))
    seen, by_kernel = Counter(), 0
    for case in range(6):
        A, B = clutter(kinds, int(rng.integers(2, 40)), f"moves {case}"), clutter(kinds, 30, f"stands {case}")
        places = rng.uniform(-1, 1, (12, 3)) * np.resize([0.3, 1.0, 2.0], (12, 1))
        X_WAs = np.array([collide.pose(p, rpy=rng.uniform(-3, 3, 3)) for p in places])
        d = (0.3 * rng.normal(size=(12, 3)) - X_WAs[:, :3, 3]) * 10.0 ** rng.integers(-3, 4, (12, 1))
        limit = math.inf if case % 2 else 0.02
        batch = collide.shape_cast(A, X_WAs, d, B, np.eye(4), max_distance=limit)
        singles = [collide.shape_cast(A, X, v, B, np.eye(4), max_distance=limit) for X, v in zip(X_WAs, d)]
        way = prepared_pair(A, B).cast
        by_kernel += sum(way.single_contact(X, np.eye(4), v, limit) is not None for X, v in zip(X_WAs, d))
        with monkeypatch.context() as without:
            without.setattr(type(way), "first_contact", lambda *_: None)
            long_way = collide.shape_cast(A, X_WAs, d, B, np.eye(4), max_distance=limit)
        for name in batch._fields:
            column = getattr(long_way, name)
            assert getattr(batch, name).tobytes() == column.tobytes(), (case, name)
            assert np.array([getattr(one, name) for one in singles], dtype=column.dtype).tobytes() == column.tobytes()
        seen.update(zip(batch.hit.tolist(), batch.at_start.tolist()))
    assert by_kernel > 0.85 * 72, by_kernel
    assert min(seen[True, False], seen[False, False]) > 8 and seen[True, True], seen


def test_casts_onto_many_meshes_walk_few_of_them(monkeypatch):
    walked = []
    cast = cast_batches.cast_leaves
    monkeypatch.setattr(
        cast_batches, "cast_leaves", lambda *args, **options: (walked.append(len(args[2])), cast(*args, **options))[1]
    )
    union = clutter(("mesh",), 300, "stands")
    far = collide.shape_cast(collide.Cylinder(0.1, 0.3), collide.pose((-5.0, 0.1, 0.0)), (1, 0, 0), union, np.eye(4))
    assert far.hit and 0 < sum(walked) < 30, walked
    walked.clear()
    inside = collide.shape_cast(collide.Cylinder(0.4, 0.8), np.eye(4), (1, 0, 0), union, np.eye(4))
    assert inside.at_start and not walked
