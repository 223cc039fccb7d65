"""How kernels see a `BoxTree`: one row of integers, most of them addresses, and what each body says about its pairs."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.broadphase.graded_boxes import LINK
from collide.kernels import kernel, view_f64, view_i64

#: Integers of a body: bits (below), group, mask, and where its row of allowed pairs begins (−1: no row).
FLAGS, GROUP, MASK, ALLOWED_AT = range(4)
TRAITS = 4
#: Bits of FLAGS: static; static or asleep: pairs of these are not tested; changed: since the last pairs were looked
#: for.
STATIC_BIT, STILL_BIT, CHANGED_BIT = 1, 2, 4

# Integers of a tree in memory.
(
    NODES_AT, LINKS_AT, N_NODES, N_FIXED, BOXES_AT, N_BOXES, TRAITS_AT, ALLOWED_ROWS_AT, N_ALLOWED, LEAF_OF_AT,
    CHANGED_AT, N_CHANGED,
) = range(12)
TREE = 12


class TreeInMemory(NamedTuple):
    """A forest of box-trees in preorder, as views of its arrays.

    header : TREE integers; kernels write the number of changed bodies alone.
    n_fixed : number of nodes of the first tree, the tree of fixed bodies.   boxes, traits, leaf_of : of bodies.
    allowed : as of `allowed_rows.py`.   changed : numbers of the bodies with CHANGED_BIT.
    """

    header: Any
    nodes: Any
    links: Any
    n_nodes: int
    n_fixed: int
    boxes: Any
    traits: Any
    allowed: Any
    leaf_of: Any
    changed: Any


@kernel(inline=True)
def tree_in_memory(header_at):
    header = view_i64(header_at, TREE)
    n, n_boxes = header[N_NODES], header[N_BOXES]
    return TreeInMemory(
        header, view_f64(header[NODES_AT], 6 * n), view_i64(header[LINKS_AT], LINK * n), n, header[N_FIXED],
        view_f64(header[BOXES_AT], 6 * n_boxes), view_i64(header[TRAITS_AT], TRAITS * n_boxes),
        view_i64(header[ALLOWED_ROWS_AT], header[N_ALLOWED]), view_i64(header[LEAF_OF_AT], n_boxes),
        view_i64(header[CHANGED_AT], n_boxes),
    )
