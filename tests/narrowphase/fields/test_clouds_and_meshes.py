"""Point clouds beside meshes, by distances of all points from all facets and windings, in numpy and fractions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from facet_distances import nearest_square, to_facets
from mesh_shapes import block_ring, box, bumpy_sphere
from naive import pose, random_pose, rng_of, rotation
from reproduction import reproducing

import collide
from collide.narrowphase.fields import clouds_and_meshes, field_pairs
from collide.narrowphase.fields.clouds_and_meshes import APART, MEETS, CloudAndMesh
from collide.narrowphase.fields.items_of import items_of
from collide.results import PAIR_DTYPE

_SNIPPET = """
import collide, numpy as np
cloud = collide.PointCloud(np.array({points}), np.array({radius}))
mesh = collide.Mesh({vertices}, {faces}, solid={solid})
print(collide.distance(cloud, mesh, np.array({X_WC}), np.array({X_WM}), signed=False))
"""


def winds(points: np.ndarray, mesh: collide.Mesh) -> np.ndarray:
    """(n,) how often a closed surface winds around points, by solid angles (A. van Oosterom and J. Strackee, 1983)."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]][None] - points[:, None] for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=2) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(axis=2)
    below = la * lb * lc + (a * b).sum(axis=2) * lc + (b * c).sum(axis=2) * la + (c * a).sum(axis=2) * lb
    return np.rint(2.0 * np.arctan2(volume, below).sum(axis=1) / (4.0 * math.pi))


def meshes(rng):
    ring = block_ring()
    yield collide.Mesh(*ring)
    yield collide.Mesh(*box((-0.3, -0.2, -0.4), (0.3, 0.2, 0.4)))
    sheet = rng.uniform(-0.5, 0.5, (60, 3)) * (1.0, 1.0, 0.2)
    yield collide.Mesh(sheet, rng.permutation(60).reshape(-1, 3), solid=False)
    vertices, faces = bumpy_sphere(60)
    yield collide.Mesh(0.5 * vertices, faces)


def clouds(rng):
    places = rng.uniform(-2.0, 2.0, (200, 3))
    yield places, 0.03
    yield places, rng.uniform(0.0, 0.2, 200)
    yield places * (1.0, 1.0, 0.01), 0.0


@pytest.mark.many(2)
@pytest.mark.parametrize("seed", range(4))
def test_states_and_gaps_are_those_of_all_facets(seed):
    rng, counts, left = rng_of("clouds beside meshes", seed), np.zeros(3, dtype=int), 0
    for mesh in meshes(rng):
        for points, radius in clouds(rng):
            cloud = collide.PointCloud(points, radius)
            X_WC = np.array([random_pose(rng, 1.0) for _ in range(12)])
            X_CM = np.array([pose(rotation(rng), rng.uniform(-2.5, 2.5, 3) * rng.choice([1.0, 4.0])) for _ in X_WC])
            pair = CloudAndMesh(cloud, items_of(cloud).walked, mesh, X_WC, X_WC @ X_CM)
            states, (rows, written) = pair.states(), pair.gaps(math.inf)
            for k, X in enumerate(X_CM):
                q = (points - X[:3, 3]) @ X[:3, :3]
                gaps = to_facets(q, mesh) - radius
                inside = winds(q, mesh) > 0 if mesh.solid else np.zeros(len(q), dtype=bool)
                least, meets = float(gaps.min()), bool(inside.any() or gaps.min() < 0.0)
                with reproducing(_SNIPPET, points=points, radius=radius, vertices=mesh.vertices, faces=mesh.faces,
                                 solid=mesh.solid, X_WC=X_WC[k], X_WM=X_WC[k] @ X):
                    if abs(least) > 1e-9:
                        assert states[k] == (MEETS if meets else APART)
                        assert bool(written[k]) == (not meets)
                    if meets and pair.meeting[k] >= 0:
                        assert gaps[pair.meeting[k]] < 1e-9 or inside[pair.meeting[k]]
                    if written[k]:
                        row = rows[k]
                        assert row["certified"] and row["lower"] - 1e-12 <= least <= row["upper"] + 1e-12
                        assert abs(gaps[row["part_a"]] - least) <= 1e-12
                        away = row["point_b"] - row["point_a"]
                        assert np.abs(away - row["distance"] * row["normal"]).max() <= 1e-11
                        to_b = (row["point_b"] - (X_WC[k] @ X)[:3, 3]) @ (X_WC[k] @ X)[:3, :3]
                        facet = collide.Mesh(mesh.vertices, mesh.faces[row["part_b"]][None], solid=False)
                        assert to_facets(to_b[None], facet)[0] <= 1e-11
                counts += np.array([meets, not meets, bool(mesh.solid and inside.any() and (gaps > 0)[inside].any())])
                left += int(states[k] not in (MEETS, APART))
    assert counts.min() > 10 and left <= 2, (counts, left)


def test_brackets_hold_the_distance_in_fractions():
    """Far from the origin, and of needles; a ball's radius is taken off exactly."""
    rng, n = rng_of("brackets of clouds and meshes"), 0
    for _ in range(40):
        offset = rng.choice([0.0, 2.0**20]) * np.ones(3)
        vertices = rng.normal(size=(6, 3)) * (1.0, 1e-3, 1.0) + offset
        mesh = collide.Mesh(vertices, [[0, 1, 2], [3, 4, 5]], solid=False)
        points = rng.normal(size=(40, 3)) + offset
        cloud, X = collide.PointCloud(points, 0.01), np.eye(4)[None]
        rows, written = CloudAndMesh(cloud, items_of(cloud).walked, mesh, X, X).gaps(math.inf)
        if not written[0]:
            continue
        least = min(nearest_square(p, vertices[mesh.faces]) for p in points)
        lower, upper = rows["lower"][0] + 0.01, rows["upper"][0] + 0.01
        assert lower * lower * (1.0 - 1e-15) <= float(least) <= upper * upper * (1.0 + 1e-15)
        n += 1
    assert n > 25


def test_limits_and_margins_tell_no_more_than_they_know():
    rng, n_beyond, n_near = rng_of("limits of clouds and meshes"), 0, 0
    mesh, places = collide.Mesh(*block_ring()), rng.uniform(-2.0, 2.0, (300, 3))
    cloud = collide.PointCloud(places, 0.01)
    poses = np.array([pose(rotation(rng), rng.uniform(-3.0, 3.0, 3)) for _ in range(200)])
    full = collide.distance(cloud, mesh, np.eye(4), poses, signed=False)
    for limit in (0.0, 0.05, 0.3):
        rows = collide.distance(cloud, mesh, np.eye(4), poses, max_distance=limit, signed=False)
        within = collide.collide(cloud, mesh, np.eye(4), poses, security_margin=limit)
        for k in range(len(poses)):
            if rows.beyond[k]:
                assert limit < rows.lower[k] <= full.upper[k] and rows.upper[k] == math.inf and not within[k]
                n_beyond += 1
            else:
                assert rows.lower[k] <= full.upper[k] and full.lower[k] <= rows.upper[k] and within[k]
                n_near += 1
    assert min(n_beyond, n_near) > 30, (n_beyond, n_near)


def test_matrices_off_rotations_and_touching_pairs_are_left_to_the_union(monkeypatch):
    """A matrix off by 1e-6, and a point on a facet, are decided all the same."""
    mesh, X = collide.Mesh(*box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))), np.eye(4)[None]
    on_a_face = collide.PointCloud([(0.5, 0.25, 0.125)], 0.0)
    assert CloudAndMesh(on_a_face, items_of(on_a_face).walked, mesh, X, X).states()[0] == clouds_and_meshes.OPEN
    assert collide.collide(on_a_face, mesh, X[0], X[0])
    touching = collide.PointCloud([(0.75, 0.25, 0.125)], 0.25)
    assert CloudAndMesh(touching, items_of(touching).walked, mesh, X, X).states()[0] == clouds_and_meshes.OPEN
    assert collide.collide(touching, mesh, X[0], X[0])
    bent = X.copy()
    bent[0, 0, 1] = 1e-6
    assert CloudAndMesh(touching, items_of(touching).walked, mesh, bent, X).states()[0] == clouds_and_meshes.OPEN
    asked = []
    monkeypatch.setattr(field_pairs, "_union_row", lambda *args: asked.append(args) or np.zeros(1, PAIR_DTYPE))
    collide.collide(touching, mesh, X[0], X[0])
    assert len(asked) == 1
