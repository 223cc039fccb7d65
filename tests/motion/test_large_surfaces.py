"""Impacts of bodies with many facets: the contact is that of all facets, few of which are looked at."""

from __future__ import annotations

import numpy as np
import pytest
from naive import random_pose, rng_of
from reproduction import reproducing

import collide
from collide.motion import surface_motions
from collide.motion.motions import Motions
from collide.motion.path_facets import facets_on_path

AGAIN = (
    "import collide, numpy as np\n"
    "from test_large_surfaces import bodies\n"
    "A, B = bodies({seed!r}, {ratio})\n"
    "print(collide.time_of_impact(A, B, *(np.array(X) for X in {poses})))"
)


def sheet(n: int) -> collide.Mesh:
    """A rough open surface of a metre."""
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.concatenate([np.stack([at, at + 1, at + n + 2], 1), np.stack([at, at + n + 2, at + n + 1], 1)])
    z = 0.05 * np.sin(9 * x) * np.cos(7 * y)
    return collide.Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces, solid=False)


def hull(n: int, size: float, seed: str) -> collide.ConvexHull:
    points = rng_of(f"hull {n} {seed}").normal(size=(n, 3))
    return collide.ConvexHull(size * points / (2 * np.linalg.norm(points, axis=1)[:, None]))


def bodies(seed: str, ratio: float) -> tuple[collide.Mesh, collide.ConvexHull]:
    return sheet(14), hull(400, ratio, seed)


def motion(rng, ratio: float) -> tuple[np.ndarray, ...]:
    """Poses at both ends of two bodies that come together, or pass, while they turn."""
    X_WA0, X_WA1, X_WB0, X_WB1 = (random_pose(rng, 1.0) for _ in range(4))
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    aside = 0.5 * (1.0 + ratio) * rng.normal(size=3) * rng.choice([0.1, 1.5])
    for X, t in ((X_WA0, 0.0 * n), (X_WA1, 0.0 * n), (X_WB0, 1.2 * (1 + ratio) * n), (X_WB1, aside - 1.2 * ratio * n)):
        X[:3, 3] = t
    return X_WA0, X_WA1, X_WB0, X_WB1


@pytest.mark.many(2)
@pytest.mark.parametrize("ratio", [0.01, 1.0, 100.0])
def test_the_first_contact_is_that_of_all_facets(ratio):
    """Each facet as a convex hull of its own, asked one by one."""
    rng = rng_of(f"impacts of large surfaces {ratio}")
    hits = []
    for seed in map(str, range(6)):
        A, B = bodies(seed, ratio)
        poses = motion(rng, ratio)
        with reproducing(AGAIN, seed=seed, ratio=ratio, poses=[X.tolist() for X in poses]):
            r = collide.time_of_impact(A, B, *poses)
            facets = [collide.ConvexHull(A.vertices[face]) for face in A.faces]
            each = collide.time_of_impact(facets, [B] * len(facets), *poses)
            hits.append(bool(r.hit))
            assert r.hit == each.hit.any() and r.certified
            if r.hit:
                assert r.lower <= each.upper.min() and each.lower.min() <= r.upper
                assert each.lower[r.part_a] <= r.upper
    assert 2 <= sum(hits) < len(hits), hits


@pytest.mark.parametrize("ratio", [0.01, 1.0, 100.0])
def test_nothing_touches_before_a_span_that_is_cut(ratio):
    """Distances at times before what `cut` says is free, of meshes too; what is free is most of what there is."""
    rng = rng_of(f"free time {ratio}")
    shares = []
    for seed in map(str, range(12)):
        A, B = bodies(seed, ratio)
        other = B if rng.integers(2) else collide.Mesh(*collide.tessellate(B)[:2])
        poses = motion(rng, ratio)
        (a,), (b,) = (surface_motions.pieces_of(side) for side in (A, other))
        spans = surface_motions._Spans(a, b, Motions(*(X[None] for X in poses), None, None))
        free_until, middle = spans.cut(0.0, 1.0)
        assert 0.0 < free_until <= middle <= 1.0
        times = free_until * np.linspace(0.0, 1.0, 12)
        X_WA, X_WB = (
            np.array([collide.poses_in_motion(poses[k], poses[k + 1], float(time)) for time in times]) for k in (0, 2)
        )
        with reproducing(AGAIN, seed=seed, ratio=ratio, poses=[X.tolist() for X in poses]):
            assert (collide.distance(A, other, X_WA, X_WB).distance > 0.0).all()
        impact = collide.time_of_impact(A, other, *poses)
        if impact.hit:
            assert free_until <= impact.lower
            shares.append(free_until / impact.time)
    assert len(shares) >= 4 and np.median(shares) > 0.1, shares


def test_impacts_of_large_surfaces_list_and_search_few_facets(monkeypatch):
    """A hull of 60,000 facets that comes down on a sheet of 20,000: facets of one body alone are listed, and few of
    them are jobs."""
    searched, listed = [], []
    find, list_pairs = surface_motions.find_impacts, surface_motions.facets_within
    monkeypatch.setattr(surface_motions, "find_impacts", lambda *a: (searched.append(a[2]), find(*a))[1])
    monkeypatch.setattr(surface_motions, "facets_within", lambda *a: (listed.append(1), list_pairs(*a))[1])
    spans = []
    cut = surface_motions._Spans.cut
    monkeypatch.setattr(surface_motions._Spans, "cut", lambda *a: (spans.append(1), cut(*a))[1])
    A, B = sheet(100), hull(30_000, 1.0, "comes down")
    start, end = (collide.pose(p, rpy=(0.1, 0.2, 0.3)) for p in ((0.1, 0.05, 3.0), (0.0, 0.0, -3.0)))
    r = collide.time_of_impact(A, B, np.eye(4), np.eye(4), start, end)
    assert r.hit and r.certified and 0.3 < r.time < 0.5
    assert not listed and 0 < sum(searched) < 400 and len(spans) < 12, (searched, listed, len(spans))


def test_impacts_of_large_meshes_list_few_spans(monkeypatch):
    """Two spheres of 20,000 facets: spans begin where their hulls meet, not in half over and over."""
    spans = []
    near = surface_motions._Spans.near_facets
    monkeypatch.setattr(surface_motions._Spans, "near_facets", lambda *a: (spans.append(1), near(*a))[1])
    ball = collide.Mesh(*collide.tessellate(collide.Sphere(0.5), tolerance=1e-4)[:2])
    assert len(ball.faces) > 5000
    start, end = collide.pose((0.3, 0.2, 1000.0)), collide.pose((0.1, 0.2, -1000.0))
    r = collide.time_of_impact(ball, ball, np.eye(4), np.eye(4), start, end)
    assert r.hit and r.certified and 0.499 < r.time < 0.5
    assert 0 < len(spans) < 6, len(spans)  # one: it begins where the hulls meet


def test_a_small_body_that_grazes_a_large_surface_is_asked_about_the_facets_on_its_way(monkeypatch):
    """At two degrees to the facets that it meets in the end; distances along the way would be hundreds."""
    spans = []
    cut, near = surface_motions._Spans.cut, surface_motions._Spans.near_facets
    monkeypatch.setattr(surface_motions._Spans, "cut", lambda *a: (spans.append("cut"), cut(*a))[1])
    monkeypatch.setattr(surface_motions._Spans, "near_facets", lambda *a: (spans.append("near"), near(*a))[1])
    A, B = sheet(100), hull(400, 1e-6, "grazes")
    ends = collide.pose((-1.0, 0.01, 0.12)), collide.pose((1.0, 0.02, -0.06))
    r = collide.time_of_impact(A, B, np.eye(4), np.eye(4), *ends)
    assert r.hit and r.certified and 0.2 < r.time < 0.8
    assert 0 < len(spans) < 12, spans


def turned(omega: np.ndarray) -> np.ndarray:
    angle = np.linalg.norm(omega)
    x, y, z = omega / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


@pytest.mark.parametrize("side", [0, 1])
def test_a_body_touches_no_facet_beside_its_way(side):
    """Points of facets that are not named, and a ball that is placed at many times; both bodies turn."""
    rng = rng_of(f"facets beside a way {side}")
    named = reached = 0
    for _ in range(30):
        mesh, ball, place = sheet(14), collide.Sphere(0.02), random_pose(rng, 0.7)
        large, small = (surface_motions.pieces_of(collide.Compound([(of, X)]))[0] for of, X in (
            (mesh, np.eye(4)), (ball, place)))
        starts, ends = np.tile(np.eye(4), (2, 2, 1, 1))
        omegas = rng.normal(size=(2, 3)) * rng.choice([0.05, 0.5])
        begin = rng.uniform(0.0, 0.7)
        end = begin + rng.uniform(0.02, 0.3)
        R, velocities = [turned(0.5 * (begin + end) * omega) for omega in omegas], rng.normal(size=(2, 3))
        on_surface = mesh.vertices[rng.integers(len(mesh.vertices))]  # the ball is there at the middle
        for k, t in enumerate((np.zeros(3), R[0] @ on_surface - R[1] @ place[:3, 3])):
            starts[k, :3, 3] = t - 0.5 * (begin + end) * velocities[k]
            ends[k] = collide.moved_poses(starts[k], velocities[k], omegas[k])
        order = [0, 1] if side == 0 else [1, 0]
        poses = [X[k][None] for k in order for X in (starts, ends)]
        motion = Motions(*poses, *(omegas[k][None] for k in order))
        spans = surface_motions._Spans(*((large, small) if side == 0 else (small, large)), motion)
        facets = facets_on_path(spans, large.tree, side, begin, end, 10_000)
        if facets is None:
            continue
        shares = rng.dirichlet(np.ones(3), 20)
        points = np.einsum("sk,fkj->fsj", shares, mesh.vertices[mesh.faces])
        others = np.setdiff1d(np.arange(len(mesh.faces)), facets)
        for t in np.linspace(begin, end, 9):
            R = [turned(t * omega) for omega in omegas]
            p = [starts[k, :3, 3] + t * (ends[k, :3, 3] - starts[k, :3, 3]) for k in (0, 1)]
            centre = R[0].T @ (R[1] @ place[:3, 3] + p[1] - p[0])
            touched = (np.linalg.norm(points - centre, axis=2) < 0.02).any(axis=1)
            assert not touched[others].any(), (starts.tolist(), ends.tolist(), omegas.tolist(), begin, end)
            reached += bool(touched.any())
        named += len(facets) < 0.5 * len(mesh.faces)
    assert named >= 15 and reached >= 5, (named, reached)


def counted(monkeypatch, *names: str) -> list[str]:
    """Calls of functions of the module of surfaces, by name."""
    calls: list[str] = []

    def recorded(name: str, of):
        return lambda *args, **options: (calls.append(name), of(*args, **options))[1]

    for name in names:
        monkeypatch.setattr(surface_motions, name, recorded(name, getattr(surface_motions, name)))
    return calls


def small_mesh(kind: str, size: float) -> collide.Mesh:
    """A finely cut mesh."""
    if kind == "ball":
        vertices, faces = collide.tessellate(collide.Sphere(0.5 * size), tolerance=3e-4 * size)[:2]
        return collide.Mesh(vertices, faces)
    rough = sheet(30)
    return collide.Mesh(size * rough.vertices, rough.faces, solid=False)


@pytest.mark.parametrize("size", [1e-7, 1e-3])
@pytest.mark.parametrize("kind", ["ball", "sheet"])
def test_a_finely_cut_mesh_that_grazes_a_large_facet_is_asked_no_distance(monkeypatch, kind, size):
    """It comes down on a face at two degrees, without turning: its lowest vertex says when, in closed form."""
    calls = counted(monkeypatch, "pair_rows", "facets_within", "near_facets_up_to")
    face = collide.Mesh([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 3.0, 0.0]], [[0, 1, 2]], solid=False)
    rng = rng_of(f"grazes a facet {kind} {size}")
    for _ in range(4):
        small, R = small_mesh(kind, size), random_pose(rng, 0.0)
        assert len(small.faces) > 1024
        start, end = R.copy(), R.copy()
        start[:3, 3], end[:3, 3] = (-0.5, 0.1, 0.02), (0.5, 0.1, -0.015)
        r = collide.time_of_impact(face, small, np.eye(4), np.eye(4), start, end)
        met = (0.02 + (small.vertices @ R[:3, :3].T)[:, 2].min()) / 0.035
        assert r.hit and r.certified, (R.tolist(),)
        assert r.lower - 1e-14 <= met <= r.upper + 1e-14, (R.tolist(), r, met)
    assert "pair_rows" not in calls and "facets_within" not in calls, calls
    assert 4 <= len(calls) <= 24, calls


@pytest.mark.parametrize("kind", ["ball", "sheet"])
def test_a_finely_cut_mesh_that_ends_on_a_large_facet_is_not_said_to_be_free(kind):
    """At the end of the way it is within a billionth of its size of touching: farther it is free, else it is not."""
    face = collide.Mesh([[-2.0, -2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 3.0, 0.0]], [[0, 1, 2]], solid=False)
    small = small_mesh(kind, 1e-3)
    low, start = float(small.vertices[:, 2].min()), collide.pose((0.0, 0.0, 0.5))
    for above, hit in ((-1e-12, True), (0.0, True), (1e-12, False)):
        r = collide.time_of_impact(face, small, np.eye(4), np.eye(4), start, collide.pose((0.0, 0.0, above - low)))
        assert r.hit == hit and r.lower <= 1.0 and r.upper <= 1.0, (above, r)


def test_a_ball_of_facets_that_meets_the_rim_of_a_large_cylinder_is_asked_no_distance(monkeypatch):
    """Normals before it meets turn with it: of several one leaves few facets."""
    calls = counted(monkeypatch, "pair_rows")
    ball, cylinder = small_mesh("ball", 1e-7), collide.Cylinder(0.3, 0.8)
    rng = rng_of("rim of a cylinder")
    for _ in range(6):
        R, outwards = random_pose(rng, 0.0), np.array([0.3, 0.0, 0.4]) + np.append(rng.normal(size=2) * 2e-8, 0.0)
        start, end = R.copy(), R.copy()
        aside = rng.uniform(0.2, 0.8, 3) * (1.0, 0.5, 1.0)
        start[:3, 3], end[:3, 3] = outwards + aside, outwards - aside
        r = collide.time_of_impact(cylinder, ball, np.eye(4), np.eye(4), start, end)
        assert r.hit and r.certified and abs(r.time - 0.5) < 1e-6, (start.tolist(), end.tolist())
    assert not calls, calls


def fan(n: int, rng) -> collide.Mesh:
    """n facets about a corner that stands out, by other lengths each."""
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, n))
    reach = rng.uniform(0.5, 2.0, n)
    rim = np.stack([reach * np.cos(angles), reach * np.sin(angles), -rng.uniform(0.1, 1.0, n)], axis=1)
    at = np.arange(n)
    faces = np.stack([np.full(n, n), at, (at + 1) % n], axis=1)
    return collide.Mesh(np.vstack([rim, np.zeros(3)]), faces, solid=False)


def from_triangle(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """(k,) distances of points from a triangle: from its plane where they stand above it, else from its edges."""
    edges = np.roll(corners, -1, axis=0) - corners
    normal = np.cross(edges[0], edges[1])
    offsets = points[:, None] - corners
    share = np.clip((offsets * edges).sum(axis=2) / (edges * edges).sum(axis=1), 0.0, 1.0)
    beside = np.linalg.norm(offsets - share[:, :, None] * edges, axis=2).min(axis=1)
    is_above = ((np.cross(edges, offsets) @ normal) > 0.0).all(axis=1)
    return np.where(is_above, np.abs(offsets[:, 0] @ normal) / np.linalg.norm(normal), beside)


def test_a_finely_cut_mesh_before_a_corner_of_many_facets_is_not_walked_beside_all_of_them(monkeypatch):
    """A ball comes down on a corner of 130 facets: all pairs of these and its own nearest facets are jobs."""
    calls, rng = counted(monkeypatch, "pair_rows", "facets_within"), rng_of("corner of many facets")
    ends = collide.pose((0.0, 0.0, 0.5)), collide.pose((0.0, 0.0, -0.5))
    r = collide.time_of_impact(fan(130, rng), small_mesh("ball", 1e-6), np.eye(4), np.eye(4), *ends)
    assert r.hit and r.certified and abs(r.time - 0.5) < 1e-6
    assert not calls, calls


@pytest.mark.parametrize("n", [5, 60])
@pytest.mark.parametrize("side", [0, 1])
def test_facets_near_large_facets_large_ones_are_all_that_are_near(side, n):
    """Corners of small facets are measured from the large ones at the middle of a span: what is within its reach is
    listed."""
    rng = rng_of(f"near few facets {side} {n}")
    small, listed, near = small_mesh("sheet", 0.01), 0, 0
    for _ in range(8 if n < 20 else 3):
        large = fan(n, rng)
        pieces = [surface_motions.pieces_of(of)[0] for of in (large, small)]
        X_L, X_S = random_pose(rng, 0.0), random_pose(rng, 0.0)
        X_S[:3, 3] = X_L[:3, :3] @ (rng.normal(size=3) * 0.002 + (0.0, 0.0, rng.uniform(-0.001, 0.002)))
        later = X_S.copy()
        later[:3, 3] += rng.normal(size=3) * 0.01
        ends = [X[None] for X in (X_L, X_L, X_S, later)]
        motion = Motions(*(ends if side == 0 else ends[2:] + ends[:2]), None, None)
        spans = surface_motions._Spans(*(pieces if side == 0 else pieces[::-1]), motion)
        begin = rng.uniform(0.0, 0.5)
        end = begin + rng.choice([0.03, 0.1])
        few = spans._large_facets_ahead(begin, end)
        pairs = None if few is None else spans._near_large_facets(few, begin, end, 1 << 20)
        if pairs is None or not len(few):
            continue
        reach = spans.describe(begin, end)[32]
        X = X_S.copy()
        X[:3, 3] += 0.5 * (begin + end) * (later[:3, 3] - X_S[:3, 3])
        facets = (large.vertices @ X_L[:3, :3].T)[large.faces[few]]
        points = (small.vertices @ X[:3, :3].T + X[:3, 3])[small.faces]
        named = np.zeros((len(large.faces), len(small.faces)), dtype=bool)
        named[tuple(pairs.T[:: 1 if side == 0 else -1])] = True
        gaps = np.stack([from_triangle(points.reshape(-1, 3), of).reshape(-1, 3).min(axis=1) for of in facets])
        is_near = gaps < reach * (1.0 - 1e-9)
        near += int(is_near.sum())
        listed += int((~named[few]).sum())
        assert named[few][is_near].all(), (X_L.tolist(), X_S.tolist(), later.tolist(), begin, end)
    assert listed >= 1000 and near >= 300, (listed, near)


@pytest.mark.parametrize("curved", ["cylinder", "ellipsoid", "cone"])
def test_a_small_mesh_beside_a_large_curved_body_is_asked_no_distance(monkeypatch, curved):
    """A flat, finely cut slab: facets are told by the normal of sets around both shortly before they meet."""
    calls, jobs = counted(monkeypatch, "pair_rows", "facets_within"), []
    look = surface_motions._look_at
    monkeypatch.setattr(surface_motions, "_look_at", lambda near, *a: (jobs.append(len(near)), look(near, *a))[1])
    grid = collide.tessellate(collide.HeightField(np.zeros((9, 9)), (1 / 8, 1 / 8), bottom=-0.1))
    small = collide.Mesh(1e-7 * grid.vertices, grid.faces)
    bodies = {"cylinder": collide.Cylinder(0.3, 0.8), "ellipsoid": collide.Ellipsoid((0.5, 0.3, 0.2))}
    large = bodies.get(curved, collide.Cone(0.4, 0.8))
    rng = rng_of(f"small beside {curved}")
    for _ in range(3):
        X_A, start = random_pose(rng, 0.0), random_pose(rng, 0.0)
        n, end = rng.normal(size=3), start.copy()
        start[:3, 3], end[:3, 3] = n / np.linalg.norm(n), 0.1 * rng.normal(size=3)
        r = collide.time_of_impact(large, small, X_A, X_A, start, end)
        facets = [collide.ConvexHull(small.vertices[face]) for face in small.faces]
        each = collide.time_of_impact([large] * len(facets), facets, X_A, X_A, start, end)
        assert r.hit and r.certified and each.hit.any(), (X_A.tolist(), start.tolist(), end.tolist())
        assert r.lower <= each.upper.min() and each.lower.min() <= r.upper, (X_A.tolist(), start.tolist(), end.tolist())
    assert "pair_rows" not in calls, calls
    assert 0 < sum(jobs) < 300, jobs
