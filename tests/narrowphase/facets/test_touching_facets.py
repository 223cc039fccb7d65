"""Bodies that touch meshes within rounding, swept meshes and parts of unions among them: decided, and rightly."""

from __future__ import annotations

import numpy as np
import pytest
from curved_oracle import bracket
from resting_radii import OTHERS, resting, separation

import collide
from collide.results import UNDECIDED


def mesh_of(name: str, rng) -> collide.Mesh:
    """A box, a random hull, or an L: all solid."""
    if name == "hull":
        shape = collide.ConvexHull(rng.normal(size=(12, 3)))
        return collide.Mesh(*collide.tessellate(shape, tolerance=0.1)[:2])
    box = collide.Mesh(*collide.tessellate(collide.Box((2.0, 1.0, 0.5)), tolerance=0.1)[:2])
    if name == "box":
        return box
    leg = collide.Mesh(box.vertices[:, ::-1].copy(), box.faces[:, ::-1].copy())
    return collide.boolean(box, leg, np.eye(4), collide.pose((0.75, 0.0, 0.5)), "union").mesh


def swept(name: str, rng):
    if name == "sphere":
        return collide.Sphere(rng.uniform(0.1, 0.5))
    if name == "capsule":
        return collide.Capsule(rng.uniform(0.1, 0.5), rng.uniform(0.2, 1.0))
    return collide.ConvexHull(rng.normal(size=(3, 3)), radius=rng.uniform(0.1, 0.5))


@pytest.mark.many(3)
@pytest.mark.parametrize("kind", ["sphere", "capsule", "rounded"])
@pytest.mark.parametrize("mesh", ["box", "hull", "L"])
def test_touching_is_decided(mesh, kind):
    rng = np.random.default_rng([46, len(mesh), len(kind)])
    n_hits = n_gaps = n_near = 0
    for _ in range(12):
        A, B = mesh_of(mesh, rng), swept(kind, rng)
        X_WA = collide.pose(rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        X_WB = collide.pose(3.0 * rng.normal(size=3), quat_wxyz=rng.normal(size=4))
        for _ in range(3):
            r = collide.distance(A, B, X_WA, X_WB)
            X_WB[:3, 3] -= r.distance * r.normal
        X_WB[:3, 3] += rng.integers(-1, 2, size=3) * np.spacing(X_WB[:3, 3])
        r = collide.distance(A, B, X_WA, X_WB)
        swapped = collide.distance(B, A, X_WB, X_WA)
        known = bracket(A, B, X_WA, X_WB, depths=False)
        case = (A, B, X_WA.tolist(), X_WB.tolist())
        assert r.how != UNDECIDED and r.hit == swapped.hit, case
        assert known.upper <= 0 if r.hit else known.lower > 0, case
        assert collide.collide(A, B, X_WA, X_WB) == r.hit == collide.distance([A], [B], X_WA, X_WB).hit[0], case
        assert r.lower <= r.distance <= r.upper and (r.upper <= 0.0 if r.hit else r.lower > 0.0), case
        n_hits, n_gaps, n_near = n_hits + r.hit, n_gaps + (not r.hit), n_near + (abs(r.distance) < 1e-14)
    assert n_hits >= 2 and n_gaps >= 2 and n_near >= 10, (n_hits, n_gaps, n_near)


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("how", ["plain", "swept", "in unions", "swept beside unions"])
@pytest.mark.many(8)
def test_resting_bodies_are_decided(kind, how):
    """Touching exactly, and an ulp beside: fractions judge each pair."""
    rng, seen = np.random.default_rng([53, OTHERS.index(kind), len(how)]), []
    options = {"swept": "swept" in how, "unions": "unions" in how}
    for k in range(16):
        pair = resting(rng, kind, exact=k % 2 == 0, **options)
        question = pair.A, pair.B, pair.X_WA, pair.X_WB
        r, apart = collide.distance(*question), separation(pair)
        swapped = collide.distance(pair.B, pair.A, pair.X_WB, pair.X_WA, signed=False)
        assert apart == 0 or k % 2, f"not made to touch: {pair!r}"
        assert r.how != UNDECIDED and r.hit == (apart <= 0), pair
        assert r.hit == collide.collide(*question) == swapped.hit == collide.distance(*question, signed=False).hit, pair
        assert r.lower <= r.distance <= r.upper and (r.upper <= 0.0 if r.hit else r.lower >= 0.0 < r.distance), pair
        assert not r.hit or collide.distance(*question, max_distance=0.0).hit, pair
        seen.append(apart)
    assert seen.count(0) >= 8 and 1 in seen, seen


@pytest.mark.slow
def test_cans_in_unions_stand_on_meshes():
    """A can among the parts of a union, on a table of facets: exactly there, and an ulp above."""
    table = collide.Mesh(*collide.tessellate(collide.Box((2.0, 2.0, 0.5)), tolerance=0.1)[:2])
    rng, n_rounded = np.random.default_rng(54), 0
    for _ in range(12):
        item = collide.pose(quat_wxyz=rng.normal(size=4))  # shifted by nothing: the can's middle is the union's
        can = collide.Compound([(collide.Cylinder(0.25, 0.5), item), (collide.Sphere(0.1), collide.pose((0, 0, 9.0)))])
        X_WB = np.eye(4)
        X_WB[:3, :3], X_WB[2, 3] = item[:3, :3].T, 0.5
        r = collide.distance(table, can, np.eye(4), X_WB)
        height = bracket(table, collide.Cylinder(0.25, 0.5), np.eye(4), X_WB @ item, depths=False)
        assert abs(r.distance) < 1e-13 and abs(height.lower) < 1e-13, (r, height)
        assert r.how != UNDECIDED and (r.upper <= 0.0 if r.hit else r.lower > 0.0), (r, item.tolist())
        for above, hit in ((1e-12, False), (-1e-12, True)):
            X_WB[2, 3] = 0.5 + above
            assert collide.collide(table, can, np.eye(4), X_WB) is hit
        n_rounded += (X_WB @ item != collide.pose((0, 0, 0.5))).any()
    assert n_rounded >= 6
