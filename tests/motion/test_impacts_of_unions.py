"""Impacts of unions with many parts: the contact is that of all pairs of parts, few of which are searched."""

from __future__ import annotations

import numpy as np
import pytest
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.lowering import closed_regions
from collide.motion import convex_motions, parts_ahead, surface_motions

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
    searched, few = [], surface_motions._search_few
    monkeypatch.setattr(surface_motions, "_search_few", lambda *args: (searched.append(1), few(*args))[1])
    ends = collide.pose((0.1, 0.0, 20.0)), collide.pose((0.0, 0.1, -20.0))
    eye = np.eye(4)
    r = collide.time_of_impact(clutter(150, False, "a"), clutter(150, False, "b"), eye, eye, *ends)
    assert r.hit and 0 < r.queries < 400, r.queries
    assert collide.time_of_impact(clutter(150, True, "a"), collide.Box((0.3, 0.3, 0.3)), eye, eye, *ends).hit
    assert 0 < len(searched) < 40, len(searched)


def small(union: collide.Compound, size: float) -> collide.Compound:
    """The same boxes, so many times as large."""
    items = []
    for part, X in union.items:
        of = collide.Mesh(size * part.vertices, part.faces) if part.meshed else collide.Box(size * part.size)
        at = X.copy()
        at[:3, 3] *= size
        items.append((of, at))
    return collide.Compound(items)


def counted(monkeypatch, *names: str) -> list[str]:
    """Calls of functions of the module of surfaces, by name."""
    calls: list[str] = []

    def recorded(name: str, of):
        return lambda *args, **options: (calls.append(name), of(*args, **options))[1]

    for name in names:
        monkeypatch.setattr(surface_motions, name, recorded(name, getattr(surface_motions, name)))
    return calls


@pytest.mark.parametrize(("meshed", "size"), [(True, 1e-5), (False, 1e-5), (True, 0.01)])
def test_parts_that_come_to_one_face_are_searched_in_order_of_their_convex_sets(monkeypatch, meshed, size):
    """All 150 parts of a small union are about as near a large, turned face: the sets around them tell the first."""
    calls = counted(monkeypatch, "_search", "_search_few")
    union = small(clutter(150, meshed, "before a face"), size)
    octahedron = collide.ConvexHull(np.concatenate([np.eye(3), -np.eye(3)]))  # its faces are oblique to its box
    large = collide.Mesh(*collide.tessellate(octahedron)[:2])
    ends = (collide.pose(t, rpy=(0.1, 0.7, 0.3)) for t in ((0.9, 1.3, 1.1), (-0.9, -1.3, -1.1)))
    r = collide.time_of_impact(union, large, np.eye(4), np.eye(4), *ends)
    assert r.hit and r.certified
    assert 0 < len(calls) < 8, len(calls)


@pytest.mark.parametrize("meshed", [False, True])
def test_a_small_union_beside_a_surface_is_asked_about_the_facets_on_its_way(monkeypatch, meshed):
    """70 parts that fly through the hull of a rough surface and graze it: few pieces are searched, few spans cut."""
    calls = counted(monkeypatch, "_search", "_search_few", "pair_rows")
    union = small(clutter(70, meshed, "grazes"), 1e-5)
    ends = collide.pose((-1.0, 0.01, 0.12)), collide.pose((1.0, 0.02, -0.06))
    r = collide.time_of_impact(union, rough_sheet(20), *ends, np.eye(4), np.eye(4))
    assert r.hit and r.certified and 0.2 < r.time < 0.8
    assert 0 < len(calls) < 20, len(calls)


def rough_sheet(n: int) -> collide.Mesh:
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([at, at + 1, at + n + 2], 1), np.stack([at, at + n + 2, at + n + 1], 1)])
    z = 0.05 * np.sin(9 * x) * np.cos(7 * y)
    return collide.Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, solid=False)


@pytest.mark.parametrize("size", [0.001, 0.05])
def test_the_first_contact_of_a_small_union_and_a_surface_is_that_of_all_parts_and_facets(size):
    """Each part against each facet as a hull of its own; both bodies turn."""
    rng = rng_of(f"small unions beside a surface {size}")
    sheet, hits = rough_sheet(6), []
    facets = [collide.ConvexHull(sheet.vertices[face]) for face in sheet.faces]
    for seed in map(str, range(5)):
        union = small(clutter(66, False, seed), size)
        poses = [random_pose(rng, 0.0) for _ in range(4)]
        n = rng.normal(size=3)
        poses[2][:3, 3], poses[3][:3, 3] = n / np.linalg.norm(n), -n / np.linalg.norm(n) + rng.normal(size=3) * 0.4
        r = collide.time_of_impact(sheet, union, *poses)
        i, j = np.divmod(np.arange(len(facets) * 66), 66)
        parts = [collide.Compound([item]) for item in union.items]
        each = collide.time_of_impact([facets[k] for k in i], [parts[k] for k in j], *poses)
        hits.append(bool(r.hit))
        assert r.hit == each.hit.any() and r.certified, (seed, [X.tolist() for X in poses])
        if r.hit:
            assert r.lower <= each.upper.min() and each.lower.min() <= r.upper, (seed, [X.tolist() for X in poses])
    assert 2 <= sum(hits), hits


@pytest.mark.parametrize(("meshed", "size"), [(False, 0.05), (False, 1e-5), (True, 0.05)])
def test_the_first_contact_of_a_small_union_and_a_large_one_is_that_of_all_parts(meshed, size):
    """All pairs of parts one by one; which union is A changes nothing; every other one is aimed at a part."""
    rng, hits = rng_of(f"small and large unions {meshed} {size}"), []
    for seed in map(str, range(6)):
        large, tiny = clutter(12, meshed, seed), small(clutter(9, False, seed), size)
        poses = [random_pose(rng, 0.0) for _ in range(4)]
        n = rng.normal(size=3)
        n *= 1.5 / np.linalg.norm(n)
        poses[2][:3, 3], poses[3][:3, 3] = n, rng.normal(size=3) - n
        if int(seed) % 2:
            poses[1] = poses[0]
            poses[3][:3, 3] = 2.0 * poses[0][:3, :3] @ large.items[0][1][:3, 3] - poses[2][:3, 3]
        i, j = np.divmod(np.arange(12 * 9), 9)
        ones = [[collide.Compound([item]) for item in union.items] for union in (large, tiny)]
        each = collide.time_of_impact([ones[0][k] for k in i], [ones[1][k] for k in j], *poses)
        r = collide.time_of_impact(large, tiny, *poses)
        swapped = collide.time_of_impact(tiny, large, *poses[2:], *poses[:2])
        at = seed, [X.tolist() for X in poses]
        hits.append(bool(r.hit))
        assert r.hit == each.hit.any() and r.certified, at
        assert (swapped.hit, swapped.lower, swapped.upper) == (r.hit, r.lower, r.upper), at
        if r.hit:
            assert r.lower <= each.upper.min() and each.lower.min() <= r.upper, at
    assert 2 <= sum(hits) < len(hits), hits


def test_a_small_union_is_searched_beside_those_parts_of_a_large_one_that_a_ball_around_it_meets(monkeypatch):
    """Through 100 boxes of a metre: one ball a part, then all parts of the small union beside the first that it meets;
    beside a miss there is nothing more."""
    jobs, find = [], convex_motions.find_impacts
    large, tiny, eye = clutter(100, False, "a"), small(clutter(120, False, "b"), 1e-6), np.eye(4)
    away = collide.pose((9.0, 0.0, 0.0))
    assert not collide.time_of_impact(large, tiny, eye, eye, away, away).hit  # ready: the kernel itself is asked for
    monkeypatch.setattr(convex_motions, "find_impacts", lambda *args: (jobs.append(args[2]), find(*args))[1])
    x, y, _ = large.items[0][1][:3, 3]
    ends = collide.pose((x, y, 20.0)), collide.pose((x, y, -20.0))
    assert collide.time_of_impact(large, tiny, eye, eye, *ends).hit
    assert 100 < sum(jobs) <= 100 + 3 * 120, jobs
    jobs.clear()
    ends = collide.pose((0.9, 0.0, 20.0)), collide.pose((0.0, 0.9, -20.0))
    assert not collide.time_of_impact(large, tiny, eye, eye, *ends).hit
    assert sum(jobs) <= 100, jobs


@pytest.mark.parametrize(("part", "n"), [("boxes", 30), ("balls", 90)])
def test_motions_of_unions_inside_a_kernel_have_the_answers_of_the_long_way(part, n, monkeypatch):
    """Single, in batches, with A and B exchanged, and turning: all bits but the number of questions."""
    rng, hits = rng_of(f"unions in a kernel {part}"), 0

    def union(m: int) -> collide.Compound:
        makers = (lambda: collide.Box(rng.uniform(0.2, 0.6, 3))), (lambda: collide.Sphere(rng.uniform(0.1, 0.3)))
        poses = [random_pose(rng, 0.5 * m ** (1 / 3)) for _ in range(m)]
        return collide.Compound([(makers[part == "balls"](), X) for X in poses])

    def bits(r) -> list:
        return [np.array(of).ravel().tolist() for of in r[:10]]

    for case in range(12):
        A, B, size = union(n), union(int(rng.integers(9, n))), 2.6 * n ** (1 / 3)
        start, end = (random_pose(rng, 1.0) for _ in "ab")
        start[:3, 3] = size, 0.2 * size, -0.1 * size
        end[:3, 3] = size * rng.uniform((-1.0, -0.8, -0.8), (0.0, 0.8, 0.8))
        omega = None
        if case % 3 == 2:
            omega = rng.normal(size=3) * 5.0
            end = collide.moved_poses(start, end[:3, 3] - start[:3, 3], omega)
        eye = np.eye(4)
        for _ in range(2):  # the second call is prepared
            r = collide.time_of_impact(A, B, eye, eye, start, end, omega_WB=omega)
        many = collide.time_of_impact(A, B, eye, eye, start[None], end[None], omega_WB=omega)
        swapped = collide.time_of_impact(B, A, start, end, eye, eye, omega_WA=omega)
        with monkeypatch.context() as m:
            m.setattr(convex_motions.SingleUnions, "search", lambda *_: False)
            long_way = collide.time_of_impact(A, B, eye, eye, start[None], end[None], omega_WB=omega)
        assert bits(r) == bits(many) == bits(long_way) and r.queries == many.queries[0]
        assert bits(swapped)[:5] == bits(r)[:5] and (swapped.part_b, swapped.part_a) == (r.part_a, r.part_b)
        hits += bool(r.hit)
    assert 3 <= hits < 12, hits


def test_boxes_of_two_unions_are_not_listed_where_most_are_near(monkeypatch):
    """150 parts beside 150 that fly through them: lists of pairs stay short."""
    lengths, near = [], parts_ahead.boxes_near

    def listed(*args):
        found = near(*args)
        lengths.append(len(found[0]))
        return found

    monkeypatch.setattr(parts_ahead, "boxes_near", listed)
    # the long way, of more pairs than kernels list
    monkeypatch.setattr(convex_motions.SingleUnions, "search", lambda *_: False)
    ends = collide.pose((0.1, 0.0, 20.0)), collide.pose((0.0, 0.1, -20.0))
    assert collide.time_of_impact(clutter(150, False, "a"), clutter(150, False, "b"), np.eye(4), np.eye(4), *ends).hit
    assert lengths and max(lengths) < 0.3 * 150 * 150, lengths


def test_parts_of_a_small_union_are_told_apart_by_the_facets_that_it_passes(monkeypatch):
    """300 parts that come down on a rough surface: times of all beside the facets on the way leave few to search."""
    calls = counted(monkeypatch, "_search", "_search_few")
    union = small(clutter(300, False, "comes down"), 0.03)
    ends = collide.pose((-1.0, 0.01, 0.12)), collide.pose((1.0, 0.02, -0.06))
    r = collide.time_of_impact(union, rough_sheet(120), *ends, np.eye(4), np.eye(4))
    assert r.hit and r.certified
    assert 0 < len(calls) < 40, len(calls)


def test_how_far_a_union_reaches_is_asked_of_its_parts_once(monkeypatch):
    calls, of = [], closed_regions.bounding_parts_of
    monkeypatch.setattr(closed_regions, "bounding_parts_of", lambda shape: (calls.append(1), of(shape))[1])
    union, ends = clutter(20, False, "reach"), [np.eye(4), np.eye(4), collide.pose((0, 0, 9)), collide.pose((0, 0, -9))]
    for _ in range(3):
        collide.time_of_impact(union, union, *ends)
    assert len(calls) == 1, calls
