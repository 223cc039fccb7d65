"""Two posed surfaces: whether they meet, and every pair of meeting facets.

The traversal goes depth first and opens the larger box. A leaf much larger than the box compared with the leaf becomes
its triangles; boxes too small to be told apart in floats of the leaf's tree are compared with the triangles in doubles
(`small_boxes.py`). Leaves end in pairs of triangles, tested in doubles with error bounds, and exactly where the bounds
leave the answer open. The order is fixed, so the first pair found is, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.kernels import entry, kernel, view_f64, view_i64
from collide.mesh.box_overlap import FRAME, PRISM, boxes_meeting_prism
from collide.mesh.bvh import NODE, WIDTH, box_size, link_of, open_tree
from collide.narrowphase.facets.box_probes import set_prism
from collide.narrowphase.facets.exact_corners import CORNERS
from collide.narrowphase.facets.posed_surfaces import PLACING, UNITS, balls_apart, is_swapped_order, put_in_frame_of_a
from collide.narrowphase.facets.posed_trees import (
    MAX_FACET_PAIRS,
    PosedTrees,
    facets_meet,
    make_open_larger,
    pose_trees,
)
from collide.narrowphase.facets.small_boxes import is_small, without_missed
from collide.narrowphase.facets.traversal import OF_A, OF_B, BoxPair, make_traversal, push_children, word_of

# Counters, a row of integers a pose: nodes compared with a box or a triangle, one against the eight of a node; pairs of
# triangles tested; of them decided exactly.
NODES, TRIANGLES, EXACT = range(3)
COUNTERS = 3

#: Doubles and floats of workspace; integers are `exact_triangles.INTEGERS`.
DOUBLES = PLACING + CORNERS
FLOATS = 2 * FRAME + PRISM

# Progress, integers: the pose, the stack's height, the facet pairs found, and where the last one's triangles stand in
# the trees (`traversal.word_of`).
POSE, TOP, N_PAIRS, LAST = range(4)
PROGRESS = 4
#: Status: all poses done, no room for more pairs, or a matrix that cannot be inverted.
DONE, FULL, SINGULAR = range(3)
#: A reference with this bit is to a triangle: leaves that are compared with small boxes become their triangles.
_TRIANGLE = 1 << 30
#: A leaf is compared triangle by triangle where it is so many times as large as the box that is opened.
_LARGE = 2.0


class _Query(NamedTuple):
    """One pair of poses.

    swapped : the trees are equal, and were exchanged by the order of their poses.
    pairs : out, room for ``capacity`` facet pairs.   progress, counters : as above.
    """

    trees: PosedTrees
    swapped: bool
    first_only: bool
    pairs: np.ndarray
    capacity: int
    progress: np.ndarray
    counters: np.ndarray


@kernel(inline=True)
def _unless_full(query, _stack, top):
    """The stack's height; negative where two leaves might find more facet pairs than there is room for."""
    return -top if query.progress[N_PAIRS] + MAX_FACET_PAIRS > query.capacity else top


@kernel(inline=True)
def _link_behind(links, ref):
    """The link behind a reference to a box; for one to a triangle, the link of a leaf of its own."""
    return ~(((ref ^ _TRIANGLE) << 3) | 1) if ref & _TRIANGLE else link_of(links, ref)


@kernel(inline=True)
def _pair_behind(query, word):
    a = word >> 32
    b = word & 0xFFFFFFFF
    return BoxPair(a, b, _link_behind(query.trees.A.links, a), _link_behind(query.trees.B.links, b))


@kernel(inline=True)
def _visit_leaves(query, pair):
    """Find the meeting facet pairs of two leaves; returns whether the traversal ends."""
    trees, progress = query.trees, query.progress
    A, B = trees.A, trees.B
    run_a = ~pair.link_a
    run_b = ~pair.link_b
    for b in range(run_b >> 3, (run_b >> 3) + (run_b & 7)):
        put_in_frame_of_a(trees.placing, B.triangles, 9 * b, trees.corners, 9)
        for a in range(run_a >> 3, (run_a >> 3) + (run_a & 7)):
            query.counters[TRIANGLES] += 1
            if facets_meet(trees, a, b, query.counters, EXACT):
                facet_a = int(A.ids[a])
                facet_b = int(B.ids[b])
                n_pairs = progress[N_PAIRS]
                query.pairs[n_pairs] = (
                    facet_b * len(B.ids) + facet_a if query.swapped else facet_a * len(B.ids) + facet_b
                )
                progress[N_PAIRS] = n_pairs + 1
                progress[LAST] = word_of(b, a) if query.swapped else word_of(a, b)
                if query.first_only:
                    return True
    return False


@kernel(inline=True)
def _widen_nothing(query, _which, _probe):
    query.counters[NODES] += 1


_open_larger = make_open_larger(_widen_nothing)


@kernel(inline=True)
def _open_pair(query, pair, stack, top):
    trees = query.trees
    A, B, placing, probe = trees.A, trees.B, trees.placing, trees.probe
    a, b, link_a, link_b = pair
    units = placing[UNITS]
    if link_a < 0 and (a & _TRIANGLE or box_size(A.boxes, a) * units > _LARGE * box_size(B.boxes, b)):
        for t in range(~link_a >> 3, (~link_a >> 3) + (~link_a & 7)):
            query.counters[NODES] += 1
            set_prism(placing, 0, A, t, B, link_b, probe)
            mask = boxes_meeting_prism(B.boxes, NODE * link_b, trees.frame_a, probe)
            if is_small(box_size(B.boxes, b), units):
                mask = without_missed(placing, 0, A, t, B, link_b, mask)
            top = push_children(stack, top, mask, word_of(_TRIANGLE | t, WIDTH * link_b), OF_B)
        return top
    if link_b < 0 and (b & _TRIANGLE or box_size(B.boxes, b) > _LARGE * units * box_size(A.boxes, a)):
        for t in range(~link_b >> 3, (~link_b >> 3) + (~link_b & 7)):
            query.counters[NODES] += 1
            set_prism(placing, 1, B, t, A, link_a, probe)
            mask = boxes_meeting_prism(A.boxes, NODE * link_a, trees.frame_b, probe)
            if is_small(box_size(A.boxes, a) * units, 1.0):
                mask = without_missed(placing, 1, B, t, A, link_a, mask)
            top = push_children(stack, top, mask, word_of(WIDTH * link_a, _TRIANGLE | t), OF_A)
        return top
    return _open_larger(query, pair, stack, top)


_traverse = make_traversal(_unless_full, _pair_behind, _visit_leaves, _open_pair)


#: Of `walk_surfaces`.
SIGNATURE = (
    "int64(int64, int64, int64, int64, int64, int64, int64, boolean, boolean, int64, int64, int64, int64, int64, int64,"
    " int64, int64, int64, int64)"
)


@entry(SIGNATURE)
def walk_surfaces(
    header_a_at, header_b_at, XA_at, step_a, XB_at, step_b, n, same_tree, first_only, pairs_at, capacity, starts_at,
    counters_at, progress_at, stack_at, n_stack, doubles_at, integers_at, exact_at,
):
    """Facet pairs of two surfaces at n pairs of poses, from where an earlier call stopped; DONE, FULL or SINGULAR.

    Arguments are flat: entries are called by address, from C too.

    XA, XB : matrices of 16 doubles; step 16 or, for a single pose, 0.
    same_tree : the trees are equal; they are then taken in the order of their poses, and answers exchanged.
    pairs : out, facet of A times the number of B's facets plus facet of B; of pose k those from starts[k] to
        starts[k + 1]. With ``first_only`` at most one a pose.
    counters : COUNTERS integers a pose.   progress : PROGRESS integers; zeros at first.
    """
    A = open_tree(header_a_at)
    B = open_tree(header_b_at)
    pairs = view_i64(pairs_at, capacity)
    starts = view_i64(starts_at, n + 1)
    progress = view_i64(progress_at, PROGRESS)
    stack = view_i64(stack_at, n_stack)
    while progress[POSE] < n:
        k = progress[POSE]
        pose_a = XA_at + 8 * step_a * k
        pose_b = XB_at + 8 * step_b * k
        swapped = same_tree and is_swapped_order(view_f64(pose_a, 12), view_f64(pose_b, 12))
        if swapped:
            pose_a, pose_b = pose_b, pose_a
        XA = view_f64(pose_a, 16)
        XB = view_f64(pose_b, 16)
        if progress[TOP] > 0 or not balls_apart(XA, A.numbers, XB, B.numbers, 0.0):
            trees, invertible = pose_trees(
                A, pose_a, B, pose_b, doubles_at, doubles_at + 8 * DOUBLES, PRISM, integers_at, exact_at
            )
            if not invertible:
                return SINGULAR
            counters = view_i64(counters_at + 8 * COUNTERS * k, COUNTERS)
            if progress[TOP] == 0:
                starts[k] = progress[N_PAIRS]
                stack[0] = 0
                progress[TOP] = 1
            query = _Query(trees, swapped, first_only, pairs, capacity, progress, counters)
            progress[TOP] = -_traverse(query, stack, progress[TOP])
            if progress[TOP] > 0:
                return FULL
        else:
            starts[k] = progress[N_PAIRS]
        starts[k + 1] = progress[N_PAIRS]
        progress[POSE] = k + 1
    return DONE
