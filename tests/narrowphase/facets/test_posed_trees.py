"""Two posed trees: boxes hold their facets, probes cull no pair of facets that meets, and cull most that do not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from mesh_families import soup
from mesh_shapes import bumpy_sphere
from naive import random_pose, rng_of
from naive_triangles import facet_pairs
from posed_facets import FAMILIES, meet, posed_pair, told

from collide.kernels import address_of
from collide.kernels.plain import code_of
from collide.mesh.box_overlap import FRAME, PRISM, PROBE, boxes_meeting, boxes_meeting_prism
from collide.mesh.build_bvh import build_mesh_tree
from collide.mesh.bvh import NODE, WIDTH, MeshTree, open_tree
from collide.mesh.fine_boxes import with_origins
from collide.narrowphase.facets.box_probes import set_node_probe, set_prism
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.exact_triangles import INTEGERS, decide_exactly
from collide.narrowphase.facets.posed_surfaces import PLACING, put_in_frame_of_a
from collide.narrowphase.facets.posed_trees import PosedTrees, facets_meet, make_open_larger, pose_trees
from collide.narrowphase.facets.traversal import any_pair, make_traversal, pair_of_trees

pytestmark = pytest.mark.plain_kernels


class Workspace:
    """`PosedTrees` and the buffers that it stands on."""

    def __init__(self, A: MeshTree, B: MeshTree, X_WA, X_WB):
        self.kept = A, B, X_WA.ravel().copy(), X_WB.ravel().copy()
        self.doubles = np.zeros(PLACING + CORNERS)
        self.floats = np.zeros(2 * FRAME + PRISM, dtype=np.float32)
        self.integers = np.zeros(INTEGERS, dtype=np.int64)
        self.trees, self.invertible = pose_trees(
            open_tree(A.address), address_of(self.kept[2]), open_tree(B.address), address_of(self.kept[3]),
            address_of(self.doubles), address_of(self.floats), PRISM, address_of(self.integers),
            code_of(decide_exactly),
        )


class Query(NamedTuple):
    trees: PosedTrees
    visited: list


def visit(query, pair):
    query.visited.append((~pair.link_a, ~pair.link_b))
    return False


def run_of(link: int) -> range:
    return range(link >> 3, (link >> 3) + (link & 7))


traverse = make_traversal(any_pair, pair_of_trees, visit, make_open_larger(lambda query, which, probe: None))


def built(vertices, faces, with_origin: int) -> MeshTree:
    tree = build_mesh_tree(vertices, faces)
    return with_origins(tree) if with_origin else tree


def posed_meshes(rng, k: int):
    """Two small meshes: soups, one of them scaled or with one facet as large as all of the other; spheres."""
    a, b = soup(rng, 40, 1.2, 0.4), soup(rng, 30, 1.2, 0.4)
    if k % 3 == 2:
        a, b = bumpy_sphere(60, k), bumpy_sphere(80, k + 1)
    elif k % 3 == 1:
        b = (np.concatenate([0.05 * b[0], rng.normal(size=(3, 3))]), np.concatenate([b[1], [[90, 91, 92]]]))
    scale = 10.0 ** rng.integers(-6, 7)
    X, Y = random_pose(rng, 0.7), random_pose(rng, 0.7)
    X[:3, 3] *= scale
    Y[:3, 3] *= scale
    return (a[0] * scale, a[1]), (b[0] * scale, b[1]), X, Y


def test_the_traversal_comes_to_every_pair_that_meets():
    rng = rng_of("posed trees")
    looked = all_pairs = found = 0
    for k in range(18):
        (va, fa), (vb, fb), X, Y = posed_meshes(rng, k)
        A, B = built(va, fa, k & 1), built(vb, fb, k & 2)
        w = Workspace(A, B, X, Y)
        assert w.invertible
        query, stack = Query(w.trees, []), np.zeros(WIDTH * (A.depth + B.depth + 2), dtype=np.int64)
        traverse(query, stack, 1)
        counters = np.zeros(1, dtype=np.int64)
        pairs = []
        for link_a, link_b in query.visited:
            looked += len(run_of(link_a)) * len(run_of(link_b))
            for b in run_of(link_b):
                put_in_frame_of_a(w.trees.placing, w.trees.B.triangles, 9 * b, w.trees.corners, 9)
                pairs += [(A.ids[a], B.ids[b]) for a in run_of(link_a) if facets_meet(w.trees, a, b, counters, 0)]
        want = facet_pairs(va, fa, X, vb, fb, Y)
        assert sorted(pairs) == want, f"va, fa, X, vb, fb, Y = {[x.tolist() for x in (va, fa, X, vb, fb, Y)]}"
        found += len(want)
        all_pairs += len(fa) * len(fb)
    assert found > 200 and looked < 0.35 * all_pairs, (found, looked, all_pairs)


def bits_at_corners(rng):
    """A mesh of bits, each where a facet of the other one has a corner: at the rim of what any probe of it may keep."""
    (vb, fb), X, Y = soup(rng, 20, 1.0, 0.6), random_pose(rng, 0.5), random_pose(rng, 0.5)
    there = (vb @ Y[:3, :3].T + Y[:3, 3] - X[:3, 3]) @ X[:3, :3]
    bits = there[:, None] + 2e-3 * rng.normal(size=(len(there), 3, 3))
    return (bits.reshape(-1, 3), np.arange(3 * len(bits)).reshape(-1, 3)), (vb, fb), X, Y


def runs_below(tree: MeshTree, link: int) -> list[int]:
    """Facets behind a link, in the order of the leaves."""
    if link < 0:
        return list(run_of(~link))
    slots = np.flatnonzero(tree.used()[link])
    return [facet for slot in slots for facet in runs_below(tree, int(tree.links()[link, slot]))]


def test_probes_keep_what_meets_and_prisms_are_the_sharper_ones():
    """Of every facet of B and the leaf that it is in against every node of A, by the facets of all below."""
    rng = rng_of("probes")
    kept = {"box": 0, "leaf": 0, "prism": 0, "true": 0}
    for k in range(8):
        (va, fa), (vb, fb), X, Y = posed_meshes(rng, k) if k < 5 else bits_at_corners(rng)
        A, B = built(va, fa, k & 2), built(vb, fb, k & 4)
        kept_alive = Workspace(A, B, X, Y)
        trees = kept_alive.trees
        place_of_a, place_of_b = np.argsort(A.ids), np.argsort(B.ids)
        meeting = {(int(place_of_a[i]), int(place_of_b[j])) for i, j in facet_pairs(va, fa, X, vb, fb, Y)}
        below = {
            (node, slot): runs_below(A, int(A.links()[node, slot])) for node, slot in zip(*np.nonzero(A.used()))
        }
        leaves = [(WIDTH * node + slot, int(B.links()[node, slot])) for node, slot in zip(*np.nonzero(B.used()))]
        for ref, link in ((ref, link) for ref, link in leaves if link < 0):
            for node in range(len(A.nodes)):
                set_node_probe(trees.placing, 1, trees.B, ref, link, trees.A, node, trees.probe)
                leaf = boxes_meeting(trees.A.boxes, NODE * node, trees.frame_b, trees.probe[:PROBE])
                set_node_probe(trees.placing, 1, trees.B, ref, 0, trees.A, node, trees.probe)  # as of a node: no slab
                box = boxes_meeting(trees.A.boxes, NODE * node, trees.frame_b, trees.probe[:PROBE])
                prism = 0
                for b in run_of(~link):
                    set_prism(trees.placing, 1, trees.B, b, trees.A, node, trees.probe)
                    prism |= boxes_meeting_prism(trees.A.boxes, NODE * node, trees.frame_b, trees.probe)
                need = sum(
                    1 << slot
                    for slot in range(WIDTH)
                    if any((a, b) in meeting for a in below.get((node, slot), ()) for b in run_of(~link))
                )
                assert need & ~leaf == need & ~box == need & ~prism == 0, (k, ref, node)
                assert leaf & ~box == 0, "a slab does not add boxes"
                for name, mask in (("box", box), ("leaf", leaf), ("prism", prism), ("true", need)):
                    kept[name] += mask.bit_count()
    assert kept["box"] > kept["leaf"] > kept["prism"] > kept["true"] > 50, kept


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_facets_meet_as_exact_arithmetic_says(family):
    rng = rng_of("facets meet", family)
    met = 0
    for _ in range(200 if family in ("random", "degenerate") else 60):
        P, Q, X, Y = posed_pair(rng, family)
        w = Workspace(build_mesh_tree(P, [[0, 1, 2]]), build_mesh_tree(Q, [[0, 1, 2]]), X, Y)
        put_in_frame_of_a(w.trees.placing, w.trees.B.triangles, 0, w.trees.corners, 9)
        counters = np.zeros(2, dtype=np.int64)
        want = meet(P, Q, X, Y)
        assert facets_meet(w.trees, 0, 0, counters, 1) == want, told(P, Q, X, Y)
        met += want
    assert 3 < met < 190
