"""Boxes relative to origins of their nodes: they hold what is below, are no fatter than their own size asks, and come
only where floats from the mesh's middle are too coarse; then the worst cases grow as the theorem says."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import bumpy_sphere
from naive import rng_of
from validate_bvh import validate_mesh_tree

import collide
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import MeshTree
from collide.mesh.fine_boxes import with_origins, with_origins_if_needed
from collide.narrowphase.facets.facet_queries import all_hits
from collide.scenes.worst_cases import accordion, harpsicordia


def plant(n: int = 40, facets: int = 200, size: float = 100.0):
    """Bolts of a centimetre all over a hall of 100 m, as one mesh."""
    rng = np.random.default_rng(7)
    (v, f), at = bumpy_sphere(facets), rng.uniform(-size / 2, size / 2, (n, 3))
    vertices = (0.005 * v[None] + at[:, None]).reshape(-1, 3)
    return vertices, np.concatenate([f + k * len(v) for k in range(n)])


def meshes():
    rng = rng_of("fine boxes")
    yield "one facet", np.eye(3), np.array([[0, 1, 2]])
    yield "one point often", np.full((1, 3), 1e6), np.zeros((50, 3), dtype=int)
    yield "soup", *soup(rng, 500)
    yield "needles", *soup(rng, 300, 1.0, np.array([1.0, 1e-6, 1e-9]))
    yield "grid", *grid(rng, 400, 4)
    yield "tiny and far", bumpy_sphere(2000)[0] * 1e-12 + 1.0, bumpy_sphere(2000)[1]
    yield "plant", *plant()
    yield "ever smaller", 0.5 ** np.arange(600)[:, None] * rng.normal(size=(600, 3)), np.arange(600).reshape(200, 3)
    A, _, _ = harpsicordia(2000, 10.0)
    yield "harpsicordia", A.vertices, A.faces


@pytest.mark.parametrize(("name", "vertices", "faces"), list(meshes()), ids=[m[0] for m in meshes()])
def test_trees_with_origins_are_what_they_say(name, vertices, faces):
    plain = build_mesh_tree(vertices, faces)
    tree = with_origins(plain)
    validate_mesh_tree(tree, vertices, faces)
    assert tree.has_origins and not plain.has_origins
    assert np.array_equal(tree.links(), plain.links()) and np.array_equal(tree.ids, plain.ids)
    assert tree.nbytes == plain.nbytes and np.array_equal(tree.used(), plain.used())
    assert not tree.origins()[0].any() and not plain.origins().any()
    again = pickle.loads(pickle.dumps(tree))
    assert again.has_origins and np.array_equal(again.nodes, tree.nodes)
    assert np.array_equal(again.boxes()[0], tree.boxes()[0])


def test_a_plant_in_one_mesh_is_told_from_itself_microns_away():
    """Cubes of a centimetre all over a hall of 100 m: queries enlarge plain boxes by 0.2 to 0.4 mm."""
    cube, faces = collide.tessellate(collide.Box((0.01, 0.01, 0.01)))
    at = np.random.default_rng(7).uniform(-50.0, 50.0, (60, 3))
    vertices = (cube[None] + at[:, None]).reshape(-1, 3)
    faces = np.concatenate([faces + k * len(cube) for k in range(len(at))])
    mesh, X = collide.Mesh(vertices, faces), np.eye(4)
    plain = build_mesh_tree(vertices, faces)
    assert mesh.tree.has_origins and mesh.tree.nbytes == plain.nbytes
    X[2, 3] = 0.01 + 5e-6
    tested = [int(all_hits(tree, tree, np.eye(4), X).counters[0, 1]) for tree in (mesh.tree, plain)]
    # Leaves that stand beside others far away are as coarse as their node is wide: some stay.
    assert tested[0] < 0.1 * tested[1] and tested[1] > len(faces), tested
    X[2, 3] = 0.01 - 5e-6
    assert collide.collide(mesh, mesh, np.eye(4), X)


def test_ordinary_meshes_keep_their_trees():
    rng = rng_of("ordinary trees")
    for vertices, faces in (bumpy_sphere(20000), grid(rng, 2000, 40), soup(rng, 2000)):
        tree = build_mesh_tree(vertices, faces)
        assert with_origins_if_needed(tree) is tree
    # A plate whose facets lie in one plane but for rounding: as STL files have it.
    x, y = (k.ravel() for k in np.meshgrid(np.arange(40.0), np.arange(40.0)))
    z = 0.3 + 1e-8 * rng.integers(-1, 2, len(x))
    cell = (np.arange(39)[:, None] * 40 + np.arange(39)).ravel()
    faces = np.concatenate([np.stack([cell, cell + 1, cell + 40], 1), np.stack([cell + 1, cell + 41, cell + 40], 1)])
    tree = build_mesh_tree(np.stack([x, y, z], 1), faces)
    assert len(tree.nodes) > 200 and with_origins_if_needed(tree) is tree
    few = build_mesh_tree(np.eye(3), np.array([[0, 1, 2]]))
    assert with_origins_if_needed(few) is few and not accordion(64).tree.has_origins


def counts(A: MeshTree, B: MeshTree) -> np.ndarray:
    """Nodes compared with a box, pairs of facets tested."""
    return all_hits(A, B, np.eye(4), np.eye(4)).counters[0, :2]


def test_queries_of_harpsicordia_grow_like_n_log_n():
    """Theorem 3.6, Σ = n: both counts a constant a meeting, which is n log n; by plain boxes they rise."""
    of_meeting, plain, of_bound = [], [], []
    for n in (1000, 4000, 16_000):
        A, B, meetings = harpsicordia(n, 10.0)
        assert A.tree.has_origins and B.tree.has_origins
        of_meeting.append(counts(A.tree, B.tree) / meetings)
        plain.append(counts(*(build_mesh_tree(mesh.vertices, mesh.faces) for mesh in (A, B))) / meetings)
        of_bound.append(of_meeting[-1] * meetings / (len(A.vertices) * np.log2(len(A.vertices))))
    of_meeting, plain, of_bound = np.array(of_meeting), np.array(plain), np.array(of_bound)
    assert (of_meeting.max(axis=0) < 1.15 * of_meeting.min(axis=0)).all(), of_meeting
    assert (of_meeting[1:, 1] < 13.0).all() and (of_bound < (1.8, 6.0)).all(), (of_meeting, of_bound)
    assert (plain > 1.2 * of_meeting).all(), "a tree that keeps no origins would be noticed"
