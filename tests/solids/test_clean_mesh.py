"""Clean rounding: no facets that cross, none without area, few facets, and results that any operation takes again."""

from __future__ import annotations

import numpy as np
import pytest
from manifold_solids import manifold_of
from soak_solids import edges_balance, facets_of, has_flat_facets

import collide
from collide.errors import InvalidArgument
from collide.solids import clean_mesh

I = np.eye(4)
CUBE = collide.Box((1, 1, 1))


def in_frame(rng, steps) -> tuple[np.ndarray, np.ndarray]:
    """(the pose of a cube in a turned frame, that of one some steps away in the same frame)."""
    X = collide.pose((0, 0, 0), rpy=rng.uniform(-3, 3, 3))
    Y = X.copy()
    Y[:3, 3] = X[:3, :3] @ np.asarray(steps, dtype=float)
    return X, Y


def is_clean(mesh) -> bool:
    crossing = len(collide.self_collisions(mesh).pairs)
    return mesh.solid and not crossing and edges_balance(mesh.faces) and not has_flat_facets(mesh)


def flush_pairs(seed: int, n: int):
    """n pairs of poses of cubes flush in one turned frame, with what they have in common."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        steps = rng.choice([0.0, 0.5, 1.0], 3, p=[0.4, 0.3, 0.3])
        yield (*in_frame(rng, steps), float(np.prod(1.0 - steps)))


def test_flush_cubes_are_clean():
    """The paper's rows had facets that cross in 45 of 100, exact rounding still has; clean rounding has none."""
    crossing = 0
    for k, (X, Y, common) in enumerate(flush_pairs(1, 60)):
        for op, volume in (("union", 2.0 - common), ("difference", 1.0 - common)):
            r = collide.boolean(CUBE, CUBE, X, Y, op)
            crossing += len(collide.boolean(CUBE, CUBE, X, Y, op, rounding="exact").self_collisions) > 0
            if volume == 0.0:
                assert r.empty, k
                continue
            assert is_clean(r.mesh) and not len(r.self_collisions), (k, op)
            assert r.mesh.report.volume == pytest.approx(volume, abs=12 * r.moved + 1e-15)
    assert crossing >= 20


def test_flush_assemblies_have_no_more_facets_than_the_peers():
    """All together; cubes in touch along an edge have four more, where the peer's facets touch each other."""
    pytest.importorskip("manifold3d")
    ours, peers = [], []
    for X, Y, _ in flush_pairs(2, 60):
        ours.append(len(collide.boolean(CUBE, CUBE, X, Y, "union").mesh.faces))
        peers.append((manifold_of(*facets_of(np.ones(3), X)) + manifold_of(*facets_of(np.ones(3), Y))).num_tri())
    fewer, more = (int((np.sign(np.subtract(ours, peers)) == sign).sum()) for sign in (-1, 1))
    assert sum(ours) <= sum(peers) and fewer > more, (sum(ours), sum(peers), fewer, more)


@pytest.mark.slow
def test_the_surface_moves_as_far_as_told():
    """Points of the clean surface lie as near to the exact one as told; of the exact one, thin gaps vanish."""
    farthest = 0.0
    for X, Y, _ in flush_pairs(3, 16):
        exact = collide.boolean(CUBE, CUBE, X, Y, "union", rounding="exact")
        r = collide.boolean(CUBE, CUBE, X, Y, "union")
        unit = np.spacing(np.abs(r.mesh.vertices).max())
        surface = collide.Mesh(exact.mesh.vertices, exact.mesh.faces, solid=False)
        points = np.concatenate([r.mesh.vertices, r.mesh.vertices[r.mesh.faces].mean(axis=1)])
        gaps = [collide.distance(collide.PointCloud([p], 0.0), surface, I, I).lower for p in points]
        assert max(gaps) <= r.moved + exact.moved and r.moved <= 8 * unit
        farthest = max(farthest, r.moved / unit)
    assert farthest > 0.5


def test_a_membrane_of_no_thickness_opens():
    """A cut flush with a face, an ulp within or beyond in a turned frame: a notch, not a hollow under a skin."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        X, Y = in_frame(rng, (0.25, 0.25, 0.25))
        cut = collide.Box((0.5, 0.25, 0.5))
        r = collide.boolean(CUBE, cut, X, Y, "difference")
        assert r.mesh.report.shells == 1 and is_clean(r.mesh)
        assert r.mesh.report.volume == pytest.approx(1.0 - 0.0625, abs=12 * r.moved)


def test_a_union_an_ulp_from_equal_is_an_operand_again():
    """Two cubes an ulp from coinciding: the result, exact or clean, goes through any operation."""
    rng = np.random.default_rng(5)
    for k in range(60):
        X, Y = in_frame(rng, (0, 0, 0))
        Y[:3, 3] += rng.integers(-2, 3, 3) * np.spacing(0.5)
        r = collide.boolean(CUBE, CUBE, X, Y, "union")
        assert len(r.mesh.faces) <= 20 and is_clean(r.mesh), k
        far = collide.boolean(r.mesh, CUBE, I, collide.pose((50, 0, 0)), "union")
        assert far.mesh.report.volume == pytest.approx(2.0, abs=1e-12)


def test_twelve_cubes_in_one_frame_stay_few_facets():
    """Union, union, difference, … at half steps: 106,022 facets without merging."""
    for seed in range(3):
        rng = np.random.default_rng([6, seed])
        X, _ = in_frame(rng, (0, 0, 0))
        made = collide.Mesh(*facets_of(np.ones(3), X))
        for k in range(12):
            Y = X.copy()
            Y[:3, 3] = X[:3, :3] @ (rng.integers(-2, 3, 3) * 0.5)
            r = collide.boolean(made, CUBE, I, Y, "difference" if k % 3 == 2 else "union")
            if r.empty:
                continue
            assert is_clean(r.mesh) and len(r.mesh.faces) <= 250, (seed, k, len(r.mesh.faces))
            made = r.mesh


def test_facets_of_different_bodies_stay_apart():
    """Of two boxes side by side every facet says whose it was, and which bodies are behind it."""
    r = collide.boolean(CUBE, CUBE, I, collide.pose((1, 0, 0)), "union")
    assert len(r.mesh.faces) == 20 and r.mesh.report.volume == 2.0
    middle = r.mesh.vertices[r.mesh.faces].mean(axis=1)[:, 0]
    assert ((middle > 0.5) == (r.body == 1)).all() and (r.behind[:, 1] == (r.body == 1)).all()


def test_what_no_merging_resolves_is_told(monkeypatch):
    """Without rounds enough the crossings are named."""
    monkeypatch.setattr(clean_mesh, "_ROUNDS", 1)
    monkeypatch.setattr(clean_mesh, "REACH", 2.0**-20)
    told = sum(len(collide.boolean(CUBE, CUBE, X, Y, "union").self_collisions) > 0 for X, Y, _ in flush_pairs(7, 30))
    assert told >= 5


def test_unknown_rounding_is_refused():
    with pytest.raises(InvalidArgument, match="rounding must be 'clean' or 'exact', got 'none'"):
        collide.boolean(CUBE, CUBE, I, I, "union", rounding="none")
    with pytest.raises(InvalidArgument, match="rounding must be"):
        collide.combine([CUBE], [I], "union", rounding=None)
