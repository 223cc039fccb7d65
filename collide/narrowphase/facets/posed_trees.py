"""Two posed box-trees as the traversals of pairs see them: their record, a test of facets, a way to open a node."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.kernels import kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, boxes_meeting
from collide.mesh.bvh import NODE, WIDTH, TreeView
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.box_probes import set_node_probe
from collide.narrowphase.facets.exact_corners import B_LOCAL_AT, CORNERS, STATE, invalidate_pose_cache
from collide.narrowphase.facets.exact_triangles import MEET, ExactCall, ask_exactly
from collide.narrowphase.facets.filtered_triangles import AMBIGUOUS, MEETING, meeting_in_doubles
from collide.narrowphase.facets.posed_surfaces import ERROR, PLACING, UNITS, extent_of, place
from collide.narrowphase.facets.traversal import OF_A, OF_B, opens_b, push_children, word_of

#: Facet pairs of two leaves at most.
MAX_FACET_PAIRS = 64


class PosedTrees(NamedTuple):
    """Two trees in relation, with what every question about them works on.

    XA, XB : poses, 16 doubles each.
    placing : of `posed_surfaces.py`.   frame_a, frame_b, probe : of `mesh/box_overlap.py`.
    corners : of `exact_corners.py`.   exact : how to call the exact stage.
    """

    A: TreeView
    B: TreeView
    XA: np.ndarray
    XB: np.ndarray
    placing: np.ndarray
    corners: np.ndarray
    frame_a: np.ndarray
    frame_b: np.ndarray
    probe: np.ndarray
    exact: ExactCall


@kernel(inline=True)
def pose_trees(A, XA_at, B, XB_at, doubles_at, floats_at, n_probe, integers_at, exact_at):
    """(the `PosedTrees` of two trees and poses, False where a matrix is not clearly invertible).

    doubles_at : room for PLACING + CORNERS doubles.   floats_at : for 2 FRAME + n_probe floats.
    """
    exact = ExactCall(exact_at, doubles_at + 8 * PLACING, doubles_at, integers_at, XA_at, XB_at)
    trees = PosedTrees(
        A, B, view_f64(XA_at, 16), view_f64(XB_at, 16), view_f64(doubles_at, PLACING),
        view_f64(doubles_at + 8 * PLACING, CORNERS), view_f32(floats_at, FRAME), view_f32(floats_at + 4 * FRAME, FRAME),
        view_f32(floats_at + 8 * FRAME, n_probe), exact,
    )
    invertible = place(extent_of(A), trees.XA, extent_of(B), trees.XB, trees.placing, trees.frame_a, trees.frame_b)
    invalidate_pose_cache(view_i64(integers_at, STATE))
    return trees, invertible


@kernel
def facets_meet(trees, a, b, counters, exact_at):
    """Whether facet a of A meets facet b of B, whose corners in A's frame are corners 9 … 17: in doubles, else exactly.

    counters[exact_at] counts the pairs that doubles leave open.
    """
    corners = trees.corners
    verdict = meeting_in_doubles(trees.A.triangles, 9 * a, corners, 9, trees.placing[ERROR])
    if verdict == AMBIGUOUS:
        counters[exact_at] += 1
        put_triangle(corners, 0, triangle_at(trees.A.triangles, 9 * a))
        put_triangle(corners, B_LOCAL_AT, triangle_at(trees.B.triangles, 9 * b))
        return ask_exactly(trees.exact, MEET) != 0
    return verdict == MEETING


def make_open_larger(widen_probe: Callable) -> Callable:
    """`open_pair` of a traversal that opens the larger box and keeps the children meeting the other box.

    widen_probe(query, …, probe) : may enlarge the probe of a box of A (``which`` 0) or of B (1).
    """

    @kernel(inline=True)
    def open_larger(query, pair, stack, top):
        trees = query.trees
        A, B, placing, probe = trees.A, trees.B, trees.placing, trees.probe
        if opens_b(A, B, pair, placing[UNITS]):
            set_node_probe(placing, 0, A, pair.a, pair.link_a, B, pair.link_b, probe)
            widen_probe(query, 0, probe)
            mask = boxes_meeting(B.boxes, NODE * pair.link_b, trees.frame_a, probe)
            return push_children(stack, top, mask, word_of(pair.a, WIDTH * pair.link_b), OF_B)
        set_node_probe(placing, 1, B, pair.b, pair.link_b, A, pair.link_a, probe)
        widen_probe(query, 1, probe)
        mask = boxes_meeting(A.boxes, NODE * pair.link_a, trees.frame_b, probe)
        return push_children(stack, top, mask, word_of(WIDTH * pair.link_a, pair.b), OF_A)

    return open_larger
