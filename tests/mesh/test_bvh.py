"""Trees over meshes: both kinds against their definitions, kept and read again, and their steps in plain numbers."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from mesh_families import grid, soup
from mesh_shapes import bumpy_sphere
from validate_bvh import validate_mesh_tree

from collide.kernels import address_of, entry, view_f32
from collide.mesh.box_overlap import (
    NEAR_PROBE,
    PRISM,
    boxes_meeting,
    boxes_meeting_one_by_one,
    boxes_meeting_prism,
    boxes_meeting_prism_one_by_one,
    boxes_nearest,
    boxes_nearest_one_by_one,
    boxes_within,
    boxes_within_one_by_one,
    points_within,
    points_within_one_by_one,
)
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import NODE, NOTHING, SLAB, MeshTree
from collide.narrowphase.facets.facet_queries import all_hits
from collide.papers.hierarchies.graded_tree import graded_tree
from collide.papers.hierarchies.validate_graded_tree import validate_graded_tree


def meshes():
    rng = np.random.default_rng(1)
    yield "one facet", np.eye(3), np.array([[0, 1, 2]])
    yield "a point", np.full((1, 3), 2.5), np.zeros((1, 3), dtype=int)
    yield "one facet often", np.eye(3), np.array([[0, 1, 2]] * 40)
    yield "one point often", np.full((1, 3), 1e6), np.zeros((50, 3), dtype=int)
    yield "soup", *soup(rng, 500)
    yield "needles", *soup(rng, 300, 1.0, np.array([1.0, 1e-6, 1e-9]))
    yield "grid", *grid(rng, 400, 4)
    yield "sphere", *bumpy_sphere(3000)
    vertices, faces = bumpy_sphere(2000)
    yield "tiny and far", vertices * 1e-12 + 1.0, faces
    yield "huge", vertices * 1e40, faces
    mixed = np.concatenate([vertices * 1e3, vertices * 1e-12 + [500.0, 0.0, 0.0]])
    yield "millimicrons beside kilometres", mixed, np.concatenate([faces, faces + len(vertices)])
    yield (
        "all on one line",
        np.cumsum(rng.exponential(size=(300, 1)), axis=0) * [1.0, 2.0, 3.0],
        rng.integers(0, 300, (200, 3)),
    )
    yield "ever smaller", 0.5 ** np.arange(600)[:, None] * rng.normal(size=(600, 3)), np.arange(600).reshape(200, 3)


@pytest.mark.parametrize(("name", "vertices", "faces"), list(meshes()), ids=[m[0] for m in meshes()])
def test_trees_are_what_they_say(name, vertices, faces):
    tree = build_mesh_tree(vertices, faces)
    validate_mesh_tree(tree, vertices, faces)
    again = build_mesh_tree(vertices, faces)
    assert np.array_equal(tree.nodes, again.nodes) and np.array_equal(tree.ids, again.ids)
    validate_graded_tree(graded_tree(vertices, faces), vertices, faces)


def test_size_and_depth():
    for n in (2000, 8000, 32000):
        vertices, faces = bumpy_sphere(n)
        tree = build_mesh_tree(vertices, faces)
        assert tree.nbytes < 130 * len(faces) + 1000
        assert tree.depth <= 2 + np.log2(n) / 2
        graded = graded_tree(vertices, faces)
        edges = vertices[faces] - np.roll(vertices[faces], 1, axis=1)
        shortest = np.sqrt(np.square(edges).sum(axis=2)).min()
        assert graded.deepest_level() <= np.ceil(np.log2(graded.width / shortest)) + 3
        assert graded.size() <= 2 * len(faces) - 1


def test_validators_see_damage():
    vertices, faces = bumpy_sphere(500)
    tree = build_mesh_tree(vertices, faces)
    for word, value in ((0 + 3, 5.0), (24 + 3, 1e-3)):
        nodes = tree.nodes.copy()
        nodes[2, word : word + 1].view(np.float32)[:] = value
        damaged = MeshTree(nodes, tree.triangles, tree.ids, tree.centre, tree.exponent, tree.depth)
        with pytest.raises(AssertionError, match="does not hold"):
            validate_mesh_tree(damaged, vertices, faces)
    graded = graded_tree(vertices, faces)
    for change in (
        {"order": np.roll(graded.order, 1)},
        {"owner": np.where(np.arange(len(faces)) == 7, graded.owner[8] - 1, graded.owner)},
        {"outlier": ~graded.outlier},
        {"width": graded.width * 0.9},
        {"levels": 1},
    ):
        with pytest.raises(AssertionError):
            validate_graded_tree(graded._replace(**change), vertices, faces)


def test_pickled_and_refused_where_it_is_none():
    vertices, faces = bumpy_sphere(800)
    tree = build_mesh_tree(vertices, faces)
    pickled = pickle.loads(pickle.dumps(tree))
    assert pickled.content == tree.content and pickled.address != tree.address
    assert np.array_equal(
        all_hits(pickled, tree, np.eye(4), np.eye(4)).pairs, all_hits(tree, tree, np.eye(4), np.eye(4)).pairs
    )
    links = tree.links()
    inner = np.argwhere((links > 0) & tree.used())[3]
    leaf = np.argwhere((links < 0) & tree.used())[3]
    parts = {"nodes": tree.nodes, "triangles": tree.triangles, "ids": tree.ids, "centre": tree.centre}
    for damage, message in (
        ({"ids": tree.ids[:-1]}, "triangles of another shape"),
        ({"nodes": tree.nodes[:-1]}, "link|node|leaves"),
        ({"nodes": _changed(tree.nodes, inner, 1)}, "parents|down"),
        ({"nodes": _changed(tree.nodes, inner, 10**6)}, "down"),
        ({"nodes": _changed(tree.nodes, leaf, -2)}, "leaf|leaves"),
        ({"depth": 1}, "depth"),
        ({"centre": tree.centre * np.nan}, "centre"),
    ):
        with pytest.raises(ValueError, match=message):
            MeshTree(**{**parts, "exponent": tree.exponent, "depth": tree.depth, **damage})


def _changed(nodes, place, link):
    changed = nodes.copy()
    changed[place[0], 48 + place[1]] = link
    return changed


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [(np.zeros((3, 3)), np.zeros((0, 3), dtype=int)), (np.zeros((3, 3)), [[0, 1, 3]]), (np.zeros((3, 2)), [[0, 1, 2]])],
)
def test_bad_arrays_are_refused(vertices, faces):
    with pytest.raises(ValueError, match="mesh tree"):
        build_mesh_tree(vertices, faces)


@entry("int64(int64, int64, int64)")
def _meeting(node_at, frame_at, probe_at):
    return boxes_meeting(view_f32(node_at, NODE), 0, view_f32(frame_at, 9), view_f32(probe_at, NEAR_PROBE))


@entry("int64(int64, int64, int64)")
def _meeting_prism(node_at, frame_at, probe_at):
    return boxes_meeting_prism(view_f32(node_at, NODE), 0, view_f32(frame_at, 9), view_f32(probe_at, PRISM))


@entry("int64(int64, int64, int64)")
def _within(node_at, frame_at, probe_at):
    frame, probe = view_f32(frame_at, 9), view_f32(probe_at, PRISM)
    boxes, points = view_f32(node_at, NODE), view_f32(node_at, 24)
    return boxes_within(boxes, 0, frame, probe) | points_within(points, 0, frame, probe) << 8


@entry("void(int64, int64, int64, int64, int64)")
def _nearest(node_at, slab_at, frame_at, probe_at, out_at):
    boxes_nearest(
        view_f32(node_at, NODE), 0, view_f32(slab_at, SLAB), 0, view_f32(frame_at, 9), view_f32(probe_at, NEAR_PROBE),
        view_f32(out_at, 16),
    )


@pytest.mark.own_kernels
def test_eight_boxes_are_eight_boxes():
    """Compiled vectors say what plain numbers say, bit by bit, with infinities and slots that are not used."""
    rng = np.random.default_rng(2)
    masks, by_edges = [], []
    for case in range(3000):
        node = rng.normal(size=NODE).astype(np.float32)
        node[24:48] = np.abs(node[24:48]) * np.float32(0.5)
        node[24:48].reshape(3, 8)[:, rng.random(8) < 0.2] = NOTHING
        slab, frame, probe = (rng.normal(size=k).astype(np.float32) for k in (SLAB, 9, NEAR_PROBE))
        probe[[3, 4, 5, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18]] = np.abs(
            probe[[3, 4, 5, 9, 10, 11, 12, 13, 14, 15, 16, 17, 18]]
        )
        if case % 10 == 0:
            frame *= np.float32(10.0 ** rng.integers(-38, 38))
            probe[rng.integers(NEAR_PROBE)] = rng.choice([np.inf, 0.0, 1e30])
        mask = _meeting(address_of(node), address_of(frame), address_of(probe))
        assert mask == boxes_meeting_one_by_one(node, 0, frame, probe)
        masks.append(mask)
        prism = np.concatenate([probe[:17], rng.normal(size=PRISM - 17).astype(np.float32)])
        prism[3:6] += 2.0  # parted by its edges, if at all
        mask = _meeting_prism(address_of(node), address_of(frame), address_of(prism))
        assert mask == boxes_meeting_prism_one_by_one(node, 0, frame, prism)
        mask = _within(address_of(node), address_of(frame), address_of(prism))
        assert mask & 0xFF == boxes_within_one_by_one(node, 0, frame, prism)
        assert mask >> 8 == points_within_one_by_one(node, 0, frame, prism)
        by_edges.append(mask != boxes_meeting_one_by_one(node, 0, frame, prism))
        outs = np.zeros((2, 16), dtype=np.float32)
        _nearest(*(address_of(x) for x in (node, slab, frame, probe, outs[0])))
        boxes_nearest_one_by_one(node, 0, slab, 0, frame, probe, outs[1])
        assert np.array_equal(outs[0], outs[1], equal_nan=True), (case, outs)
    assert len(set(masks)) > 50 and 0.2 < np.mean(by_edges) < 0.9
