"""A segment and a posed tree: what rays and winding numbers have in common.

The segment is a body of its own: a frame in which its ends are doubles, and a pose. So the segment is posed without
rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import kernel, view_f32, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PROBE
from collide.mesh.bvh import NUMBERS, TreeView
from collide.mesh.triangle import put_triangle, triangle_at
from collide.narrowphase.facets.exact_corners import B_LOCAL_AT, CORNERS, STATE, invalidate_pose_cache
from collide.narrowphase.facets.exact_triangles import ExactCall, ask_exactly
from collide.narrowphase.facets.posed_surfaces import EXTENT, PLACING, Extent, extent_of, place, put_in_frame_of_a

# Counters, integers: nodes compared with the segment, triangles tested, of them decided exactly.
NODES, TRIANGLES, EXACT = range(3)
COUNTERS = 3
#: Doubles and floats of workspace.
SEGMENT_DOUBLES = PLACING + CORNERS + NUMBERS
SEGMENT_FLOATS = 2 * FRAME + 2 * PROBE


class PosedSegment(NamedTuple):
    """A tree, a segment, and the arrays that every question about them works on.

    XA, XB : poses of the tree and of the segment's frame, 16 doubles each.
    ends : both ends in the segment's frame, and an end again (9).   numbers : the segment's, as of a tree
        (`mesh/bvh.py`).
    placing, corners, frame_a, frame_b, probe, exact : as in `posed_trees.PosedTrees`; corners 3 and 4 are the ends.
    moved : room for the probe of a node with an origin.
    """

    tree: TreeView
    XA: np.ndarray
    XB: np.ndarray
    ends: np.ndarray
    numbers: np.ndarray
    placing: np.ndarray
    corners: np.ndarray
    frame_a: np.ndarray
    frame_b: np.ndarray
    probe: np.ndarray
    moved: np.ndarray
    exact: ExactCall
    counters: np.ndarray


@kernel(inline=True)
def open_segment(tree, XA_at, XB_at, doubles_at, floats_at, integers_at, exact_at, counters_at):
    """The record of a tree, two poses and a workspace; ends and numbers have to be set, and the segment placed."""
    invalidate_pose_cache(view_i64(integers_at, STATE))
    corners_at = doubles_at + 8 * PLACING
    return PosedSegment(
        tree, view_f64(XA_at, 16), view_f64(XB_at, 16), view_f64(corners_at + 8 * B_LOCAL_AT, 9),
        view_f64(corners_at + 8 * CORNERS, NUMBERS), view_f64(doubles_at, PLACING), view_f64(corners_at, CORNERS),
        view_f32(floats_at, FRAME), view_f32(floats_at + 4 * FRAME, FRAME), view_f32(floats_at + 8 * FRAME, PROBE),
        view_f32(floats_at + 8 * FRAME + 4 * PROBE, PROBE),
        ExactCall(exact_at, corners_at, doubles_at, integers_at, XA_at, XB_at), view_i64(counters_at, COUNTERS),
    )


@kernel
def place_segment(segment, exponent):
    """Relate tree and segment, and take its ends to the tree's frame; False where a matrix is not clearly invertible.

    exponent : of the unit of the segment's box.
    """
    A = extent_of(segment.tree)
    B = Extent(segment.numbers, exponent, EXTENT)
    if not place(A, segment.XA, B, segment.XB, segment.placing, segment.frame_a, segment.frame_b):
        return False
    put_in_frame_of_a(segment.placing, segment.ends, 0, segment.corners, 9)
    return True


@kernel
def ask_segment_exactly(segment, facet, what):
    """What the exact stage says about the segment and a facet, counted."""
    segment.counters[EXACT] += 1
    put_triangle(segment.corners, 0, triangle_at(segment.tree.triangles, 9 * facet))
    return ask_exactly(segment.exact, what)
