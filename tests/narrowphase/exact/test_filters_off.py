"""Doubles switched off: every boolean of hulls and half-spaces from the exact stage alone, equal to the filtered
one."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import collide
from collide.narrowphase import convex_kernel_calls as run
from collide.results import HOW
from collide.scenes.families import generate, names

#: Families whose bodies are so large that the exact stage takes long on every pair.
LARGE = {"spheres_big", "cyl1000", "bipyramids", "repeats"}


@pytest.mark.many(6)
@pytest.mark.parametrize("family", sorted(set(names()) - LARGE))
def test_booleans_without_doubles_are_the_same(family, monkeypatch):
    cases = generate(family, 25, 5)
    filtered = [collide.collide(*case.shapes()) for case in cases]
    monkeypatch.setattr(run, "distrust_doubles", True)
    for case, hit in zip(cases, filtered):
        A, B, X, Y = case.shapes()
        poses = np.asarray(X)[None], np.asarray(Y)[None]  # a batch: single calls trust doubles
        assert collide.collide(A, B, *poses)[0] == hit, case.snippet()
        assert HOW[collide.distance(A, B, *poses, max_distance=0.0)[0].how] == "exact arithmetic", case.snippet()


def test_depths_without_doubles_are_the_same(monkeypatch):
    """No surface has been grown then: all planes of both hulls are looked at, and the nearest is the one that EPA
    found."""
    rng = np.random.default_rng(29)
    asked = []
    for k in range(60):
        A = (
            collide.ConvexHull(rng.normal(size=(rng.integers(4, 13), 3)))
            if k % 3
            else collide.Box(rng.uniform(0.3, 2.0, 3))
        )
        B = collide.ConvexHull(rng.normal(size=(rng.integers(4, 13), 3)), radius=0.1 * (k % 4 == 0))
        X, Y = (collide.pose(rng.normal(size=3) * 0.25, rpy=rng.uniform(-3, 3, 3) * (k % 5 > 0)) for _ in range(2))
        asked.append((A, B, X, Y, collide.distance(A, B, X, Y)))
    deep = [case for case in asked if case[4].hit]
    assert 40 < len(deep) < 60
    monkeypatch.setattr(run, "distrust_doubles", True)
    for A, B, X, Y, grown in deep:
        told = f"A, B, X, Y = {A!r}, {B!r}, {X.tolist()}, {Y.tolist()}"
        r = collide.distance(A, B, X[None], Y[None])[0]  # a batch: what is prepared for single calls trusts doubles
        assert r.certified and r.how == HOW.index("exact arithmetic"), told
        assert abs(r.distance - grown.distance) <= 1e-12 * abs(r.distance), told
        assert r.lower <= grown.upper and grown.lower <= r.upper, told
        assert np.abs(r.normal - grown.normal).max() < 1e-13, told
        assert np.abs(r.point_b - r.point_a - r.distance * r.normal).max() < 1e-14, told
        for shape, X_WS, point in ((A, X, r.point_a), (B, Y, r.point_b)):
            assert collide.distance(shape, collide.Sphere(1e-14), X_WS, collide.pose(point)).distance <= 0.0, told
        open_ended = collide.distance(A, B, X[None], Y[None], signed=False)[0]
        assert open_ended.hit and open_ended.distance == 0.0, told


def test_each_exact_stage_is_reached():
    """Counted, so that a filter that grows too sharp or too blunt shows."""
    hulls = [collide.distance(*case.shapes()) for case in generate("touch_ff", 40, 2)]
    planes = [collide.distance(*case.shapes()) for case in generate("halfspace_touch", 40, 2)]
    ordinary = [collide.distance(*case.shapes()) for case in generate("rand_pen", 40, 2)]
    assert all(r.exact > 0 for r in hulls) and all(r.exact > 0 for r in planes)
    assert not any(r.exact for r in ordinary)
    half = collide.Halfspace((0, 0, 1), 0.0)
    assert collide.distance(half, collide.Halfspace((0, 0, -1), 0.0), np.eye(4), np.eye(4)).exact == 1


@pytest.mark.parametrize("threads", [1, 2, 8])
def test_threads_and_batches_of_any_size_give_the_same_bits(threads):
    rng = np.random.default_rng(11)
    A, B = collide.ConvexHull(rng.normal(size=(30, 3))), collide.Box((1, 1, 1))
    poses = np.array([collide.pose(rng.normal(size=3), rpy=rng.uniform(-3, 3, 3)) for _ in range(600)])
    poses[::3] = np.array([collide.pose((0, 0, 0.5 + k / 64)) for k in range(200)])
    whole = collide.distance(A, B, np.eye(4), poses).rows
    parts: list = [None] * threads

    def work(t):
        own = poses[t::threads]
        sizes = [1, 7, 64, len(own)]
        rows, start = [], 0
        while start < len(own):
            size = sizes[len(rows) % 4]
            rows.append(collide.distance(A, B, np.eye(4), own[start : start + size]).rows)
            start += size
        parts[t] = np.concatenate(rows)

    workers = [threading.Thread(target=work, args=(t,)) for t in range(threads)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for t in range(threads):
        for field in whole.dtype.names:
            assert np.array_equal(parts[t][field], whole[t::threads][field]), field
