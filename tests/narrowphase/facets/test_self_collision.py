"""A surface against itself: clean meshes have no pairs, and crossings, folds and doubled facets are all found."""

from __future__ import annotations

import numpy as np
from mesh_families import grid, soup
from mesh_shapes import block_ring, box, bumpy_sphere
from naive_triangles import as_integers, cross, inner, minus, triangles_meet, world_points

from collide.mesh.build_bvh import build_mesh_tree
from collide.narrowphase.facets.facet_queries import self_hits, steady_facets


def shares_more(P, Q) -> bool:
    """Whether two integer triangles share more than common corners and edges."""
    of_q = [q for q in Q if q in P]
    if not of_q:
        return triangles_meet(P, Q)
    if len(of_q) == 1:
        v = of_q[0]
        rest_p, rest_q = _without(P, v), _without(Q, v)
        return triangles_meet([*rest_p, rest_p[1]], Q) or triangles_meet([*rest_q, rest_q[1]], P)
    if len(of_q) > 2:
        return True
    free_p, free_q = [p for p in P if p not in Q], [q for q in Q if q not in P]
    if not free_p or not free_q:
        return False
    v, w = of_q
    n, k = (cross(minus(w, v), minus(x, v)) for x in (free_p[0], free_q[0]))
    return cross(n, k) == [0, 0, 0] and inner(n, k) > 0


def _without(P, v):
    i = max(k for k in range(3) if P[k] == v)
    return [P[(i + 1) % 3], P[(i + 2) % 3]]


def proper(vertices, faces):
    """Facets with an area."""
    corners = vertices[faces]
    return faces[np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])).max(axis=1) > 1e-9]


def test_pairs_are_those_of_brute_force():
    rng = np.random.default_rng(41)
    found_pairs = tested = 0
    for case in range(60):
        vertices, faces = grid(rng, 24, 3) if case % 3 else soup(rng, 20)
        if case % 3 == 1:
            vertices = vertices + rng.normal(size=vertices.shape) * 0.2
        faces = proper(vertices, faces)
        points = as_integers(world_points(vertices, np.eye(4)))[0]
        corners = [[points[v] for v in f] for f in faces.tolist()]
        want = [
            (i, j) for i in range(len(faces)) for j in range(i + 1, len(faces)) if shares_more(corners[i], corners[j])
        ]
        pairs, _ = self_hits(build_mesh_tree(vertices, faces))
        assert list(map(tuple, pairs.tolist())) == want, (case, vertices.tolist(), faces.tolist())
        found_pairs += len(want)
        tested += len(faces) ** 2 // 2
    assert 0.1 < found_pairs / tested < 0.9


def test_tiny_meshes_far_away_and_facets_that_nearly_touch():
    """Coordinates of few digits: boxes are then much wider than facets, and most signs next to nothing."""
    rng = np.random.default_rng(43)
    found_pairs = tested = 0
    for case in range(40):
        vertices, faces = soup(rng, 16, 0.5) if case % 2 else grid(rng, 20, 3)
        offset, scale = rng.choice([0.0, 1.0, 1e6, 1e12]), 10.0 ** rng.integers(-14, 3)
        vertices = offset + vertices * scale
        faces = faces[
            np.abs(np.cross(*(vertices[faces][:, 1:] - vertices[faces][:, :1]).transpose(1, 0, 2))).max(axis=1) > 0.0
        ]
        if not len(faces):
            continue
        points = as_integers(world_points(vertices, np.eye(4)))[0]
        corners = [[points[v] for v in f] for f in faces.tolist()]
        proper_ones = [k for k, (a, b, c) in enumerate(corners) if cross(minus(b, a), minus(c, a)) != [0, 0, 0]]
        faces, corners = faces[proper_ones], [corners[k] for k in proper_ones]
        if not len(faces):
            continue
        want = [
            (i, j) for i in range(len(faces)) for j in range(i + 1, len(faces)) if shares_more(corners[i], corners[j])
        ]
        pairs, _ = self_hits(build_mesh_tree(vertices, faces))
        assert list(map(tuple, pairs.tolist())) == want, (case, vertices.tolist(), faces.tolist())
        found_pairs, tested = found_pairs + len(want), tested + len(faces) ** 2 // 2
    assert 0.05 < found_pairs / tested < 0.95


def test_steady_facets_share_nothing_more_when_corners_are_moved():
    """Corners stand a few margins from where facets touch; all of them are moved by the margin along every axis."""
    rng = np.random.default_rng(44)
    margin = 2.0**-41
    steady = parted = met = 0
    for case in range(160):
        vertices, faces = grid(rng, int(rng.integers(3, 9)), 3)
        vertices = vertices + margin * rng.integers(-12, 13, vertices.shape) * rng.choice([0, 1], (len(vertices), 1))
        faces = proper(vertices, faces)
        if len(faces) < 2:
            continue
        _, is_steady = steady_facets(build_mesh_tree(vertices, faces), margin)
        assert not steady_facets(build_mesh_tree(vertices, faces), 0.0)[1].any()
        pairs = [(i, j) for i in range(len(faces)) for j in range(i + 1, len(faces))]
        for _ in range(4):
            moved = vertices + margin * rng.choice([-1.0, 1.0], vertices.shape)
            before, after = (as_integers(world_points(v, np.eye(4)))[0] for v in (vertices, moved))
            for i, j in pairs:
                now = shares_more([after[v] for v in faces[i]], [after[v] for v in faces[j]])
                assert not (is_steady[i] and is_steady[j] and now), (case, i, j, vertices.tolist(), faces.tolist())
                parted += now and not shares_more([before[v] for v in faces[i]], [before[v] for v in faces[j]])
                met += now
        steady += int(is_steady.sum())
    assert steady > 40 and parted > 20 and met > 200, (steady, parted, met)


def test_clean_meshes_have_none():
    for vertices, faces in (box(), block_ring(), bumpy_sphere(5000)):
        for scale in (1.0, 1e-9, 1e9):
            tree = build_mesh_tree(vertices * scale, faces)
            pairs, is_steady = steady_facets(tree, 2.0**-48 * scale)
            assert len(self_hits(tree)[0]) == len(pairs) == 0
            # In a ring of blocks facets of one plane share but a corner, and sides of both go through the other.
            assert is_steady.mean() >= (0.75 if len(faces) == 64 else 1.0)


def test_crossings_folds_and_doubles_are_found():
    (va, fa), (vb, fb) = box(), box((-0.5, -0.5, 0.5), (0.5, 0.5, 1.5))
    pairs, _ = self_hits(build_mesh_tree(np.concatenate([va, vb]), np.concatenate([fa, fb + len(va)])))
    assert len(pairs) > 4 and (pairs[:, 0] < 12).all() and (pairs[:, 1] >= 12).all()
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0.25, 0.5, 0]])
    for faces, want in (
        ([[0, 1, 2], [0, 2, 3]], []),  # a square that is nearly one
        ([[0, 1, 2], [0, 1, 3]], [(0, 1)]),  # folded flat
        ([[0, 1, 2], [2, 0, 1]], [(0, 1)]),  # one facet twice
    ):
        assert list(map(tuple, self_hits(build_mesh_tree(square, np.array(faces)))[0].tolist())) == want


def test_many_pairs_are_not_lost():
    n = 120
    faces = np.arange(3 * n).reshape(n, 3)
    vertices = np.array([[1.0, 0, 0], [-1, 1, 0], [-1, -1, 0]])[None] + 0.01 * np.random.default_rng(1).normal(
        size=(n, 3, 3)
    )
    vertices[::2] = vertices[::2, :, [2, 0, 1]]
    pairs, _ = self_hits(build_mesh_tree(vertices.reshape(-1, 3), faces))
    assert len(pairs) >= (n // 2) ** 2 and len(np.unique(pairs, axis=0)) == len(pairs)


def test_facets_without_area_are_what_their_corners_span():
    """In either order: a facet that is no more than a common edge or corner is no pair, a longer one is."""
    line = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [5, 5, 5], [2, 0, 0], [3, 0, 0], [-1, 0, 0]])
    for a, b, want in (
        ([0, 1, 2], [0, 0, 1], False), ([0, 1, 2], [1, 0, 0], False), ([0, 1, 2], [0, 0, 0], False),
        ([0, 1, 2], [0, 3, 1], False),
        ([0, 1, 2], [0, 3, 3], True), ([0, 1, 2], [0, 4, 4], False), ([0, 1, 2], [5, 1, 6], False),
        ([0, 1, 2], [7, 0, 5], True),
        ([0, 1, 2], [7, 0, 7], False), ([2, 4, 0], [7, 0, 1], False), ([0, 3, 1], [0, 3, 3], False),
        ([0, 1, 5], [0, 1, 6], True),
        ([0, 1, 5], [0, 1, 7], False), ([3, 1, 5], [0, 3, 5], False), ([0, 0, 1], [0, 1, 1], False),
        ([0, 1, 4], [0, 0, 3], True),
    ):
        for faces in ([a, b], [b, a], [a[::-1], b[1:] + b[:1]], [b[2:] + b[:2], a]):
            pairs, _ = self_hits(build_mesh_tree(line, np.array(faces)))
            assert (len(pairs) == 1) is want, faces


def test_the_order_of_facets_says_nothing():
    rng = np.random.default_rng(47)
    for _ in range(40):
        vertices, faces = grid(rng, 20, 3)
        pairs, _ = self_hits(build_mesh_tree(vertices, faces))
        turned, _ = self_hits(build_mesh_tree(vertices, faces[::-1]))
        last = len(faces) - 1
        assert sorted(map(tuple, pairs.tolist())) == sorted((last - j, last - i) for i, j in turned.tolist()), (
            faces.tolist()
        )
