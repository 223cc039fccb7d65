"""Fine meshes that have sunk into curved sets: few facets are asked about, and rows keep their promises.

Judges: formulas of the sets in long doubles, dense samples of facets (`test_curved_contacts.py`), and the same calls
with every facet asked about.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from contact_scenes import table
from test_curved_contacts import judge_scene, same_rows

import collide
from collide.contact import curved_contacts, swallowed_facets
from collide.contact.contact_rows import OVERLAP, TRANSLATION
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import as_given, body_of

EYE = np.eye(4)


def rough(n, solid=False, depth=0.05):
    """(mesh, vertices, faces): a rough surface of a metre, 2·n² facets; solid: closed by a floor below."""
    vertices, faces = table(n, size=1.0, thick=0.3)
    top = vertices[:, 2] == 0.0
    vertices[:, 2] += np.where(top, depth * np.sin(9 * vertices[:, 0]) * np.cos(7 * vertices[:, 1]), 0.0)
    if not solid:
        faces = faces[top[faces].all(axis=1)]
    return collide.Mesh(vertices, faces, solid=solid), vertices, faces


def curved(rng, scale=1.0):
    """A curved set of random sizes."""
    a, b, c = scale * rng.uniform(0.2, 0.6, 3)
    return [collide.Cylinder(a, 2 * b), collide.Cone(a, 2 * b), collide.Ellipsoid((a, b, c))][rng.integers(3)]


def how_far_within(shape, points):
    """(k,) how far points of a set's frame are within its surface, at least, in long doubles; negative outside."""
    x, y, z = points.astype(np.longdouble).T
    r = np.sqrt(x * x + y * y)
    if isinstance(shape, collide.Cylinder):
        return np.minimum(shape.radius - r, np.longdouble(shape.length) / 2 - abs(z))
    if isinstance(shape, collide.Cone):
        half = np.longdouble(shape.length) / 2
        slant = np.sqrt(np.longdouble(shape.radius) ** 2 + np.longdouble(shape.length) ** 2)
        return np.minimum((shape.radius * (half - z) - shape.length * r) / slant, half + z)
    q = points.astype(np.longdouble) / np.asarray(shape.radii, dtype=np.longdouble)
    return (1 - np.sqrt((q * q).sum(axis=1))) * min(shape.radii)


def placed(X_WA, X_WB, points):
    """Points of A's frame in B's, in long doubles, the matrices taken as exact."""
    away = X_WA[:3, 3] - X_WB[:3, 3].astype(np.longdouble)
    return (points.astype(np.longdouble) @ X_WA[:3, :3].T + away) @ np.linalg.inv(X_WB[:3, :3]).T


@pytest.fixture
def asked(monkeypatch):
    """Counts of facets asked about, by what of them: "row" or "meets"."""
    counts: Counter = Counter()
    ask = curved_contacts.facet_rows

    def counted(*arguments, boolean, **more):
        counts["meets" if boolean else "row"] += len(arguments[5])
        return ask(*arguments, boolean=boolean, **more)

    monkeypatch.setattr(curved_contacts, "facet_rows", counted)
    return counts


def test_points_said_to_be_within_are():
    seen: Counter = Counter()
    for seed in range(60):
        rng = np.random.default_rng([1, seed])
        B = curved(rng)
        mesh = rough(12)[0]
        X_WA, X_WB = (
            collide.pose(rng.normal(size=3) * 10.0 ** rng.uniform(-2, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(2)
        )
        insides = swallowed_facets.Insides(
            body_of(mesh).tree, enclosure_of(B).packed, as_given(X_WA[None]), as_given(X_WB[None])
        )
        # About the surface: points of the set's frame, a little off it, in the mesh's.
        p = rng.normal(size=(200, 3))
        p *= rng.uniform(0, 0.6, (200, 1)) / np.linalg.norm(p, axis=1)[:, None]
        near = how_far_within(B, p)
        points = (p @ X_WB[:3, :3].T + (X_WB - X_WA)[:3, 3]) @ X_WA[:3, :3]
        within = insides.of_points(0, points)
        true = how_far_within(B, placed(X_WA, X_WB, points))
        assert (true[within] >= 0.0).all(), f"default_rng([1, {seed}]): {points[within & (true < 0)].tolist()}"
        assert within[true > 1e-6].all(), f"default_rng([1, {seed}]): {points[~within & (true > 1e-6)].tolist()}"
        seen["within"] += int(within.sum())
        seen["outside"] += int((near < 0).sum())
    assert seen["within"] > 2000 and seen["outside"] > 2000, seen


def test_meshes_said_to_be_within_are():
    """Boxes of the tree tell it where the mesh is well within, whatever lies beside the set is not."""
    seen: Counter = Counter()
    mesh, vertices, faces = rough(30)
    used = vertices[np.unique(faces)]
    for seed in range(200):
        rng = np.random.default_rng([2, seed])
        B = curved(rng, scale=rng.uniform(1.0, 8.0))
        X_WB = collide.pose(rng.normal(scale=0.3, size=3), rpy=rng.uniform(-3, 3, 3))
        within = swallowed_facets.meshes_within(
            body_of(mesh), enclosure_of(B).packed, as_given(EYE[None]), as_given(X_WB[None])
        )
        least = how_far_within(B, placed(EYE, X_WB, used)).min()
        told = within is not None and bool(within[0])
        assert not told or least >= 0.0, f"default_rng([2, {seed}]): {B} at {X_WB.tolist()}"
        seen[told] += 1
        seen["missed"] += least > 0.03 and not told
    assert seen[True] > 40 and seen[False] > 40 and seen["missed"] == 0, seen


@pytest.mark.parametrize(
    "shape", [collide.Cone(40, 80), collide.Cylinder(1.5, 2.0), collide.Ellipsoid((1.5, 1.4, 1.3))]
)
def test_of_a_mesh_within_no_facet_is_asked(shape, asked):
    """20,000 rows of `distance` were asked about; `distance` of the bodies is the answer."""
    mesh = rough(100)[0]
    X = collide.pose((0.01, 0.02, -0.02), rpy=(0.3, -0.2, 0.5))
    c, r = collide.contacts(mesh, shape, EYE, X), collide.distance(mesh, shape, EYE, X)
    assert not asked, asked
    assert c.kind.tolist() == [TRANSLATION] and c.distance[0] == r.distance
    assert c.lower[0] == r.lower and np.array_equal(c.normal[0], r.normal)


@pytest.mark.parametrize("solid", [True, False])
def test_of_facets_within_some_are_asked(solid, asked):
    """A can, a cone and an egg sunk into 20,000 facets, some thousands of which lie within: 512 of those are asked, and
    those that cross the surface; where no length parts, few facets are asked whether they meet."""
    mesh, vertices, faces = rough(100, solid)
    for seed in range(6):
        rng = np.random.default_rng([3, seed])
        B = curved(rng)
        X_WB = collide.pose(rng.uniform(-0.1, 0.1, 3), rpy=rng.uniform(-3, 3, 3))
        q = how_far_within(B, placed(EYE, X_WB, vertices))[faces]
        n_within = int((q > 1e-9).all(axis=1).sum())
        n_crossing = int(((q > -0.1).any(axis=1) & (q < 1e-9).any(axis=1)).sum())
        assert n_within > 1000, (seed, n_within)
        asked.clear()
        c = collide.contacts(mesh, B, EYE, X_WB)
        assert (c.kind == OVERLAP).all() and len(c), (seed, c.rows)
        assert asked["row"] <= swallowed_facets.MAX_ASKED + n_crossing, (seed, asked, n_within, n_crossing)
        assert asked["meets"] <= 2 * (n_within + n_crossing), (seed, asked, n_within, n_crossing)


@pytest.mark.many(2)
@pytest.mark.parametrize("solid", [True, False])
def test_rows_of_fine_meshes_are_what_they_promise(solid):
    seen: Counter = Counter()
    mesh = rough(40, solid)
    for seed in range(0 if solid else 1, 30, 2):
        rng = np.random.default_rng([4, seed])
        posed = mesh, curved(rng), EYE, collide.pose(rng.uniform(-0.3, 0.3, 3), rpy=rng.uniform(-3, 3, 3))
        margin = float(rng.choice([0.0, 0.01]))
        judge_scene(posed, margin, seen, f"default_rng([4, {seed}]), margin {margin}")
    assert seen["parted"] > 10 and seen["hit"] > 10, seen


@pytest.mark.parametrize("sunk", [1e-3, 0.01, 0.05])
def test_a_can_sunk_into_a_fine_table_stands_as_on_a_coarse_one(sunk):
    can = collide.Cylinder(0.3, 0.5)
    X = collide.pose((0.013, 0.021, 0.25 - sunk), rpy=(0, 0, 0.3))
    fine, coarse = (collide.contacts(collide.Mesh(*table(n)), can, EYE, X) for n in (60, 6))
    assert len(fine) == len(coarse) == 8 and np.abs(fine.normal - (0, 0, 1)).max() < 1e-12
    assert np.abs(fine.distance + sunk).max() < 1e-12 and fine.apart[0] < sunk * 1.01 + 1e-11
    a, b = (c.point_b[np.lexsort(c.point_b.round(6).T)] for c in (fine, coarse))
    assert np.abs(a - b).max() < 1e-9


def test_facets_that_the_normal_parts_are_not_asked(monkeypatch):
    """Whether all of a patch's facets are asked about, or those that may reach the set moved: the rows are the same."""
    seen: Counter = Counter()
    meshes = [rough(24, solid) for solid in (True, False)]
    heights = curved_contacts._heights_above

    def counted(*arguments):
        above = heights(*arguments)
        seen["facets"] += len(above)
        seen["parted"] += int((above < 0.0).sum())
        return above

    for seed in range(20):
        rng = np.random.default_rng([5, seed])
        B, X = curved(rng), collide.pose(rng.uniform(-0.3, 0.3, 3), rpy=rng.uniform(-3, 3, 3))
        monkeypatch.setattr(curved_contacts, "_heights_above", counted)
        culled = collide.contacts(meshes[seed % 2][0], B, EYE, X)
        monkeypatch.setattr(curved_contacts, "_heights_above", lambda *a: np.abs(heights(*a)))
        every = collide.contacts(meshes[seed % 2][0], B, EYE, X)
        assert same_rows(culled.rows, every.rows), f"default_rng([5, {seed}])"
    assert seen["facets"] > 2000 and seen["parted"] > 0.1 * seen["facets"], seen


def test_batches_and_threads_are_single_calls():
    mesh, rng = rough(40)[0], np.random.default_rng(6)
    X = np.stack([collide.pose(rng.uniform(-0.4, 0.4, 3), rpy=rng.uniform(-3, 3, 3)) for _ in range(5)])
    X[4, :3, 3] = 0.0
    for shape in (collide.Cylinder(0.4, 0.7), collide.Ellipsoid((0.8, 0.9, 1.0))):
        batch = collide.contacts(mesh, shape, EYE, X)
        for k in range(len(X)):
            assert same_rows(collide.contacts(mesh, shape, EYE, X[k]).rows, batch[k].rows), X[k].tolist()
        assert same_rows(collide.contacts(mesh, shape, EYE, X, threads=3).rows, batch.rows)
        kinds = set(batch.kind.tolist())
        assert OVERLAP in kinds and (TRANSLATION in kinds) == isinstance(shape, collide.Ellipsoid), kinds
