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
    """Two spheres of 20,000 facets: spans are cut where the distance says, not in half over and over."""
    spans = []
    near = surface_motions._Spans.near_facets
    monkeypatch.setattr(surface_motions._Spans, "near_facets", lambda *a: (spans.append(1), near(*a))[1])
    ball = collide.Mesh(*collide.tessellate(collide.Sphere(0.5), tolerance=1e-4)[:2])
    assert len(ball.faces) > 5000
    start, end = collide.pose((0.3, 0.2, 1000.0)), collide.pose((0.1, 0.2, -1000.0))
    r = collide.time_of_impact(ball, ball, np.eye(4), np.eye(4), start, end)
    assert r.hit and r.certified and 0.499 < r.time < 0.5
    assert 1 < len(spans) < 12, len(spans)


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
