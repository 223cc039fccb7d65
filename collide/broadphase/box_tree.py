"""A box-tree over bodies: sorted by size class and Morton code, then an implicit binary tree.

Boxes of one size class stand together, as the graded box-tree of Erickson's local polyhedra keeps
facets near cubes of their own size ("Local polyhedra and geometric graphs", section 3.2): a floor
slab does not widen the boxes of the cups on it. Within a class, order along the Z-curve.

Leaf k of the tree is the k-th body in that order; node i has children 2i and 2i + 1, node 1 is the
root, and the leaves start at a power of two. Empty places hold boxes that meet nothing.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, entry, kernel, view_f64, view_i64

#: Bits of a Morton code along each axis.
_BITS = 16
#: Bodies that have moved are sorted anew once all sides of the tree's boxes, added up, have grown by this factor: in
#: metres, or in sides of the box around all.
_GROWN = 1.5


class BoxTree:
    """The tree, over boxes (n, 6): low x, y, z, high x, y, z.

    Boxes without end (half-spaces) are kept apart and meet everything; ``nodes`` (2·leaves, 6)
    holds the rest, ``order`` (m,) the body at each leaf.
    """

    def __init__(self, boxes: np.ndarray):
        finite = np.isfinite(boxes).all(axis=1)
        self.boxes = np.ascontiguousarray(boxes)
        self.unbounded, self._bounded = np.flatnonzero(~finite), np.flatnonzero(finite)
        self.leaves = 1 << max(0, (len(self._bounded) - 1).bit_length())
        self.nodes = np.empty((2 * self.leaves, 6))
        self._least_sides = np.zeros(2)
        self._sort()

    def refit(self, boxes: np.ndarray) -> None:
        """Take moved boxes. Bodies are sorted anew where the tree has become much worse than it was when they were
        last: what is near in the order is to be near in space.
        """
        if len(boxes) != len(self.boxes):
            raise ValueError("refit needs the same bodies; build a new tree")
        self.boxes = np.ascontiguousarray(boxes)
        sides = self._fit()
        if (sides > _GROWN * self._least_sides).any():
            self._sort()
        self._least_sides = np.minimum(self._least_sides, sides)

    def _sort(self) -> None:
        bounded = self._bounded
        self.order = bounded[_sorted_order(self.boxes[bounded])] if len(bounded) else bounded
        self._least_sides = self._fit()

    def _fit(self) -> np.ndarray:
        """Make all nodes; (2,) the sum of their boxes' sides, in metres and in sides of the box around all."""
        sides = fit_nodes(
            address_of(self.boxes), len(self.boxes), address_of(self.order), len(self.order), address_of(self.nodes),
            self.leaves,
        )  # fmt: skip
        if sides < 0.0 or np.isfinite(self.boxes[self.unbounded]).all(axis=1).any():
            raise ValueError("refit needs the same bodies, bounded and unbounded ones; build a new tree")
        around_all = float((self.nodes[1, 3:] - self.nodes[1, :3]).sum()) if len(self.order) else 0.0
        return np.array([sides, sides / around_all if around_all > 0.0 else 0.0])

    def pairs(self, margin: float, static: np.ndarray, group: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """(k, 2) bodies i < j, sorted, whose boxes come within ``margin`` along every axis.

        Pairs of static bodies, and pairs whose groups and masks exclude each other, are left out.
        """
        pairs = self._search(self.boxes[self.order], margin, True, static, group, mask)
        if len(self.unbounded):
            pairs = np.concatenate([pairs, _with_unbounded(self.unbounded, len(self.boxes), static, group, mask)])
        n = len(self.boxes)
        keys = np.minimum(pairs[:, 0], pairs[:, 1]) * n + np.maximum(pairs[:, 0], pairs[:, 1])
        keys.sort()
        return np.stack(np.divmod(keys, n), axis=1)

    def touching(self, box: np.ndarray, margin: float) -> np.ndarray:
        """Bodies, sorted, whose boxes come within ``margin`` of one outside box (6,)."""
        everything = np.zeros(len(self.boxes), dtype=np.int64)
        pairs = self._search(box.reshape(1, 6), margin, False, everything, everything + 1, everything + 1)
        return np.sort(np.concatenate([pairs[:, 1], self.unbounded]))

    def _search(self, queries, margin, among_themselves, static, group, mask) -> np.ndarray:
        queries = np.ascontiguousarray(queries)
        capacity = 64 + 8 * len(queries)
        while True:
            pairs = np.empty((capacity, 2), dtype=np.int64)
            count = meeting_boxes(
                address_of(queries), len(queries), address_of(self.nodes), self.leaves, address_of(self.order),
                len(self.order), margin, among_themselves, address_of(static), address_of(group), address_of(mask),
                address_of(pairs), capacity,
            )  # fmt: skip
            if count <= capacity:
                return pairs[:count]
            capacity = count


def _sorted_order(boxes: np.ndarray) -> np.ndarray:
    """Size class first, then the Z-curve through the centres; ties by body, so that it is reproducible."""
    centres = 0.5 * boxes[:, :3] + 0.5 * boxes[:, 3:]
    low = centres.min(axis=0)
    extent = float((centres.max(axis=0) - low).max())
    scale = (2**_BITS - 1) / extent if extent > 0.0 and math.isfinite(2**_BITS / extent) else 0.0
    cells = np.clip((centres - low) * scale, 0, 2**_BITS - 1).astype(np.uint64)
    x, y, z = (_spread_bits(cells[:, axis]) for axis in range(3))
    size = (boxes[:, 3:] - boxes[:, :3]).max(axis=1)
    size_class = np.frexp(np.maximum(size, np.finfo(float).tiny))[1]
    smaller = (int(size_class.max()) - size_class).astype(np.uint64)  # at most 2,100: twelve bits
    code = x | (y << np.uint64(1)) | (z << np.uint64(2))
    return np.argsort((smaller << np.uint64(3 * _BITS)) | code, kind="stable")


def _spread_bits(values: np.ndarray) -> np.ndarray:
    """Numbers of _BITS bits with two zeros between any two bits (H. S. Warren, "Hacker's Delight", 7-2)."""
    for shift, mask in ((32, 0xFFFF00000000FFFF), (16, 0x00FF0000FF0000FF), (8, 0xF00F00F00F00F00F),
                        (4, 0x30C30C30C30C30C3), (2, 0x9249249249249249)):  # fmt: skip
        values = (values | (values << np.uint64(shift))) & np.uint64(mask)
    return values


def _with_unbounded(unbounded, n, static, group, mask) -> np.ndarray:
    i = np.repeat(unbounded, n)
    j = np.tile(np.arange(n), len(unbounded))
    is_unbounded = np.zeros(n, dtype=bool)
    is_unbounded[unbounded] = True
    keep = (i != j) & ~(is_unbounded[j] & (j < i))
    keep &= ~((static[i] != 0) & (static[j] != 0))
    keep &= ((group[i] & mask[j]) != 0) & ((group[j] & mask[i]) != 0)
    return np.stack([i[keep], j[keep]], axis=1)


@kernel(inline=True)
def _next_subtree(node):
    """The next subtree to the right: sibling of the node's nearest ancestor that is a left child; 0 at the end."""
    while node & 1:
        node >>= 1
    return node + 1 if node > 0 else 0


@entry("float64(int64, int64, int64, int64, int64, int64)")
def fit_nodes(boxes_at, n_boxes, order_at, n_order, nodes_at, leaves):
    """Write all nodes of a tree; the sum of their boxes' sides, or −1 where the box of a leaf is not finite.

    boxes : 6·n_boxes doubles, low x, y, z, high x, y, z.   order : the body of each leaf.   nodes : 12·leaves doubles
        out.
    """
    boxes = view_f64(boxes_at, 6 * n_boxes)
    order = view_i64(order_at, n_order)
    nodes = view_f64(nodes_at, 12 * leaves)
    is_bounded = True
    sides = 0.0
    for leaf in range(leaves):
        at = 6 * (leaves + leaf)
        for axis in range(3):
            nodes[at + axis] = math.inf
            nodes[at + 3 + axis] = -math.inf
        if leaf < n_order:
            for k in range(6):
                value = boxes[6 * order[leaf] + k]
                nodes[at + k] = value
                is_bounded = is_bounded and -math.inf < value < math.inf
    for node in range(leaves - 1, 0, -1):
        at = 6 * node
        child = 12 * node
        for axis in range(3):
            nodes[at + axis] = min(nodes[child + axis], nodes[child + 6 + axis])
            nodes[at + 3 + axis] = max(nodes[child + 3 + axis], nodes[child + 9 + axis])
            side = nodes[at + 3 + axis] - nodes[at + axis]
            sides += max(side, 0.0)  # of empty places it is −inf
    return sides if is_bounded else -1.0


@entry("int64(int64, int64, int64, int64, int64, int64, float64, boolean, int64, int64, int64, int64, int64)")
def meeting_boxes(
    queries_at, n_queries, nodes_at, leaves, order_at, n_order, margin, among_themselves, static_at, group_at, mask_at,
    pairs_at, capacity,
):  # fmt: skip
    """Pairs (query, body) of boxes within ``margin`` along every axis; returns how many there are.

    Only the first ``capacity`` are stored. Among themselves, query k is leaf k: it looks at later
    leaves only, and names its body.
    Arguments are flat: entries take integers, doubles and booleans alone.
    """
    queries = view_f64(queries_at, 6 * n_queries)
    nodes = view_f64(nodes_at, 12 * leaves)
    order = view_i64(order_at, n_order)
    pairs = view_i64(pairs_at, 2 * capacity)
    n_bodies = 0
    for k in range(n_order):
        n_bodies = max(n_bodies, order[k] + 1)
    static = view_i64(static_at, n_bodies)
    group = view_i64(group_at, n_bodies)
    mask = view_i64(mask_at, n_bodies)
    count = 0
    for k in range(n_queries):
        low0 = queries[6 * k] - margin
        low1 = queries[6 * k + 1] - margin
        low2 = queries[6 * k + 2] - margin
        high0 = queries[6 * k + 3] + margin
        high1 = queries[6 * k + 4] + margin
        high2 = queries[6 * k + 5] + margin
        # Depth first without a stack: down to the left while boxes meet, else on to the next subtree to the right.
        # Among themselves, it begins to the right of the query's own leaf.
        node = _next_subtree(leaves + k) if among_themselves else 1
        while node > 0:
            at = 6 * node
            meets = (
                nodes[at] <= high0 and nodes[at + 3] >= low0
                and nodes[at + 1] <= high1 and nodes[at + 4] >= low1
                and nodes[at + 2] <= high2 and nodes[at + 5] >= low2
            )  # fmt: skip
            if meets and node < leaves:
                node = 2 * node
                continue
            if meets and node - leaves < n_order:
                i = order[k] if among_themselves else k
                j = order[node - leaves]
                tested = True
                if among_themselves:
                    tested = (
                        not (static[i] != 0 and static[j] != 0)
                        and (group[i] & mask[j]) != 0 and (group[j] & mask[i]) != 0
                    )  # fmt: skip
                if tested:
                    if count < capacity:
                        pairs[2 * count] = i
                        pairs[2 * count + 1] = j
                    count += 1
            node = _next_subtree(node)
    return count
