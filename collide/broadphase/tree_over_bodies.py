"""A box-tree over bodies, brought up to date as bodies are moved, added and removed.

A sequence of graded trees (`graded_boxes.py`): first the tree of fixed bodies, then a tree of the others, then smaller
and smaller trees of bodies added later; a walk goes through all of them. A leaf's box may be larger than its body's: a
body moving within changes nothing. Changed bodies are noted, so that pairs of the others are kept.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.broadphase.allowed_rows import allowed_rows
from collide.broadphase.graded_boxes import BODY, LINK, STACK, grow_graded
from collide.broadphase.moved_leaves import fit_inner_nodes, fit_paths, take_boxes
from collide.broadphase.tree_in_memory import (
    ALLOWED_AT,
    CHANGED_BIT,
    FLAGS,
    GROUP,
    MASK,
    N_CHANGED,
    STATIC_BIT,
    STILL_BIT,
)
from collide.kernels import address_of
from collide.numerics.growing_rows import GrowingRows

if TYPE_CHECKING:
    from typing_extensions import Self

#: A tree is made anew once all sides of its nodes, added up, have grown by this factor: in metres, or in sides of the
#: box around all.
_GROWN = 1.5
#: Below this number of bodies all nodes are fitted at once; from there on the paths above changed leaves alone, if at
#: most one leaf in _SHARE_OF_PATHS changed.
_MIN_PATHS, _SHARE_OF_PATHS = 64, 8
_NO_WORK = {"trees made": 0, "nodes fitted": 0, "leaves changed": 0}
#: A box that meets no box, and a box that meets all others.
_NOTHING = np.array([np.inf] * 3 + [-np.inf] * 3)
_EVERYTHING = -_NOTHING


class CachedPairs(NamedTuple):
    """Keys (k,) of pairs whose leaves' boxes are within the margin, ascending, less pairs of bodies changed since."""

    margin: float
    keys: np.ndarray


class TreeOverBodies:
    """The tree, over boxes (n, 6): low x, y, z, high x, y, z.

    Parameters
    ----------
    boxes : (n, 6), copied. Unbounded boxes (of half-spaces) are kept apart and meet every box.
    fixed : (n,) bool: bodies that stay, in a tree of their own; no query reports pairs of two fixed bodies.

    Notes
    -----
    ``nodes`` (m, 6) are boxes in preorder, ``links`` (m, LINK) as of `graded_boxes.py`, the first ``n_fixed`` of
        the tree of fixed bodies. ``sections``: the first node of each tree, then the number of all nodes. ``leaf_of``
        (n,) is the node of each body, −1 for bodies without a leaf.
    """

    def __init__(self, boxes: np.ndarray, fixed: np.ndarray | None = None):
        n = len(boxes)
        fixed = np.zeros(n, dtype=bool) if fixed is None else np.array(fixed, dtype=bool)
        leaf_of, changed = np.full((2, n), -1)
        boxes = np.array(_comparable(boxes), dtype=np.float64)
        columns = boxes, fixed, np.ones(n, dtype=bool), _traits_of(fixed), leaf_of, changed
        self._columns = [GrowingRows(column) for column in columns]
        self._allowed = np.zeros(1, dtype=np.int64)
        self._header: np.ndarray | None = None
        self._n_changed = 0
        self._take_columns()
        self._cached: CachedPairs | None = None
        self._too_wide = math.inf
        self._n_holes = 0
        self._work = dict(_NO_WORK)
        self.sections = [0]
        self.nodes, self.links = np.empty((0, 6)), np.empty((0, LINK), dtype=np.int64)
        self._make()

    # --- making ---------------------------------------------------------------------------------

    def take_work(self) -> dict[str, int]:
        """What has been done since this was last called: trees made, nodes fitted, leaves given other boxes."""
        work, self._work = self._work, dict(_NO_WORK)
        return work

    def copied(self) -> Self:
        """The same tree, to be changed beside this one, about whose pairs nobody asks meanwhile."""
        made = object.__new__(type(self))
        made.__dict__ = dict(self.__dict__)
        made._columns = [GrowingRows(column.rows.copy()) for column in self._columns]
        made.nodes, made.links, made._work = self.nodes.copy(), self.links.copy(), dict(_NO_WORK)
        made.sections, made._sides, made._n_inner = list(self.sections), list(self._sides), list(self._n_inner)
        made._take_columns()
        return made

    def _take_columns(self) -> None:
        """Other rows than before, and so another header."""
        self._forget_header()
        self.boxes, self._fixed, self._alive, self.traits, self.leaf_of, self._changed = (
            column.rows for column in self._columns
        )

    def _make(self) -> None:
        """Build all trees anew over the bodies not removed."""
        is_bounded = np.isfinite(self.boxes).all(axis=1) & self._alive
        self.unbounded = np.flatnonzero(self._alive & ~is_bounded)
        self.sections = [0]
        self._resize(2 * int(is_bounded.sum()))
        self.leaf_of[:] = -1
        self._sides: list[float] = []
        self._n_inner: list[int] = []
        self._n_holes = 0
        for bodies in (np.flatnonzero(is_bounded & self._fixed), np.flatnonzero(is_bounded & ~self._fixed)):
            if len(bodies):
                self._add_section(bodies)
        self.n_fixed = self.sections[1] if (is_bounded & self._fixed).any() else 0
        self._least = self._quality()
        self._too_wide = math.inf
        self._work["trees made"] += 1

    def _resize(self, capacity: int) -> None:
        """Memory for so many nodes."""
        nodes, links = np.empty((max(capacity, 2), 6)), np.empty((max(capacity, 2), LINK), dtype=np.int64)
        used = min(self.sections[-1], capacity)
        nodes[:used], links[:used] = self.nodes[:used], self.links[:used]
        self.nodes, self.links = nodes, links
        self._forget_header()

    def _add_section(self, bodies: np.ndarray) -> None:
        """A tree over bodies behind the others."""
        begin, m = self.sections[-1], len(bodies)
        if begin + 2 * m > len(self.nodes):
            self._resize(begin + begin // 2 + 2 * m)
        bodies = np.array(bodies, dtype=np.int64)
        scratch = np.empty(2 * m + 34 + STACK, dtype=np.int64)
        end = grow_graded(
            address_of(bodies), m, address_of(self.boxes), len(self.boxes), begin, address_of(self.links),
            len(self.links), address_of(scratch),
        )
        leaves = begin + np.flatnonzero(self.links[begin:end, BODY] >= 0)
        self.leaf_of[bodies], self.nodes[leaves] = leaves, self.boxes[bodies]
        self.sections.append(end)
        self._sides.append(self._fit(begin, end))
        self._n_inner.append(end - begin - m)
        self._forget_header()

    def _fit(self, begin: int, end: int) -> float:
        self._work["nodes fitted"] += end - begin
        return fit_inner_nodes(address_of(self.links), address_of(self.nodes), begin, end)

    def _quality(self) -> tuple[float, float]:
        """All sides of inner nodes added up: in metres, and in sides of the box around all. By the way, how far apart
        bodies are: the mean side of an inner node.
        """
        sides = sum(self._sides)
        self.spacing = sides / max(3 * sum(self._n_inner), 1)
        if not self._sides:
            return 0.0, 0.0
        x0, y0, z0, x1, y1, z1 = self.around.tolist()
        extent = (x1 - x0) + (y1 - y0) + (z1 - z0)
        return sides, sides / extent if 0.0 < extent < math.inf else 0.0

    @property
    def n_nodes(self) -> int:
        return self.sections[-1]

    @property
    def order(self) -> np.ndarray:
        """Bodies that have leaves, in their order."""
        bodies = self.links[: self.n_nodes, BODY]
        return bodies[bodies >= 0]

    @property
    def around(self) -> np.ndarray:
        """(6,) box around all bounded bodies; without bounded bodies a box that meets nothing."""
        if len(self.sections) == 2:
            return self.nodes[0]
        roots = self.nodes[self.sections[:-1]]
        return np.concatenate([roots[:, :3].min(axis=0, initial=np.inf), roots[:, 3:].max(axis=0, initial=-np.inf)])

    # --- changes --------------------------------------------------------------------------------

    def refit(self, boxes: np.ndarray) -> None:
        """Take boxes (n, 6) of all bodies."""
        if len(boxes) != len(self.boxes):
            raise ValueError("refit needs the same bodies; build a new tree")
        self.move(np.arange(len(boxes)), boxes)

    def move(self, bodies: np.ndarray, boxes: np.ndarray) -> None:
        """Store boxes (k, 6) of moved bodies (k,). The tree is built anew once its quality is much worse than after the
        last build: bodies near in the tree are to be near in space.
        """
        bodies, boxes = np.ascontiguousarray(bodies), np.ascontiguousarray(boxes)
        header, escaped = self.header(), np.empty(len(bodies), dtype=np.int64)
        n = take_boxes(
            address_of(header), address_of(bodies), len(bodies), address_of(boxes), self.spacing, address_of(escaped)
        )
        self.fit_above(escaped, n)

    def fit_above(self, escaped: np.ndarray, n: int) -> None:
        """Fit the nodes above the first n of these bodies, whose leaves have changed: n as `take_boxes` tells it."""
        if n < 0:
            raise ValueError("bodies keep their ends, or have none; build a new tree")
        if n:
            self._refit_above(escaped[:n])

    def _refit_above(self, bodies: np.ndarray) -> None:
        """Fit the nodes above bodies whose leaves have other boxes."""
        self._work["leaves changed"] += len(bodies)
        n_leaves = len(self.boxes)
        if n_leaves < _MIN_PATHS or _SHARE_OF_PATHS * len(bodies) > n_leaves:
            ends = zip(self.sections[:-1], self.sections[1:])
            self._sides = [self._fit(begin, end) for begin, end in ends]
        else:
            leaves, out = self.leaf_of[bodies], np.empty(1)
            self._sides[0] += fit_paths(
                address_of(leaves), len(leaves), address_of(self.links), address_of(self.nodes), self.n_nodes,
                address_of(out),
            )
            self._work["nodes fitted"] += int(out[0])
        sides, relative = self._quality()
        if sides > _GROWN * self._least[0] or relative > _GROWN * self._least[1]:
            self._make()
        self._least = min(self._least[0], sides), min(self._least[1], relative)

    def append(self, boxes: np.ndarray, fixed: np.ndarray, group=1, mask=1) -> None:
        """Add bodies (k,), numbered on from the last, with groups and masks. The last trees are made one with theirs
        where they are not much larger: each body is sorted O(log n) times in all.
        """
        first, k, boxes = len(self.boxes), len(boxes), _comparable(boxes)
        fixed = np.asarray(fixed, dtype=bool)
        traits = _traits_of(fixed)
        traits[:, GROUP], traits[:, MASK] = group, mask
        added = boxes, fixed, np.ones(k, dtype=bool), traits, *np.full((2, k), -1)
        for column, rows in zip(self._columns, added):
            column.extend(rows)
        self._take_columns()
        new = np.arange(first, first + k)
        is_bounded = np.isfinite(boxes).all(axis=1)
        self.unbounded = np.append(self.unbounded, new[~is_bounded])
        bodies = new[is_bounded]
        if not len(bodies):
            return
        before = sum(self._sides)
        n_first = 1 if self.n_fixed else 0
        while len(self._sides) > n_first and self.sections[-1] - self.sections[-2] <= 4 * len(bodies):
            in_last = self.links[self.sections[-2] : self.sections[-1], BODY]
            bodies = np.append(bodies, in_last[in_last >= 0])
            del self.sections[-1], self._sides[-1], self._n_inner[-1]
        self._add_section(bodies)
        growth = 1.0 - before / max(sum(self._sides), 1e-300)
        sides, relative = self._quality()
        self._least = self._least[0] + growth * sides, self._least[1] + growth * relative
        self._note_changed(new[is_bounded])

    def remove(self, bodies: np.ndarray) -> None:
        """Take bodies out; their numbers stay unused."""
        self._alive[bodies] = False
        self.boxes[bodies] = _NOTHING
        self.unbounded = self.unbounded[self._alive[self.unbounded]]
        bodies = bodies[self.leaf_of[bodies] >= 0]
        leaves = self.leaf_of[bodies]
        self.nodes[leaves], self.links[leaves, BODY] = _NOTHING, -1
        self._n_holes += len(bodies)
        self._note_changed(bodies)
        if 2 * self._n_holes > self.n_nodes // 2 + 64:
            self._make()
        else:
            self._refit_above(bodies)
        self.leaf_of[bodies] = -1

    def _note_changed(self, bodies: np.ndarray) -> None:
        """Bodies, each once, whose leaves have other boxes."""
        header = self.header()
        new = bodies[(self.traits[bodies, FLAGS] & CHANGED_BIT) == 0]
        self.traits[new, FLAGS] |= CHANGED_BIT
        first = int(header[N_CHANGED])
        self._changed[first : first + len(new)] = new
        header[N_CHANGED] += len(new)

    # --- filters --------------------------------------------------------------------------------

    def set_groups(self, bodies: np.ndarray, group: np.ndarray, mask: np.ndarray) -> None:
        """Groups and masks (k,) of bodies: pairs with ``(group_i & mask_j) == 0`` either way are not found."""
        self.traits[bodies, GROUP], self.traits[bodies, MASK] = group, mask
        self._forget_pairs()

    def set_allowed(self, allowed: np.ndarray) -> None:
        """Pairs (k, 2) of bodies, each once, that are not found."""
        row_at, self._allowed = allowed_rows(allowed, len(self.boxes))
        self.traits[:, ALLOWED_AT] = row_at
        self._forget_header()
        self._forget_pairs()

    def _forget_pairs(self) -> None:
        self._cached, self._too_wide = None, math.inf

    def set_asleep(self, bodies: np.ndarray, asleep: bool) -> None:
        """Pairs of which both are fixed or asleep are not found."""
        flags = self.traits[bodies, FLAGS]
        still = asleep | ((flags & STATIC_BIT) != 0)
        self.traits[bodies, FLAGS] = (flags & ~STILL_BIT) | STILL_BIT * still.astype(np.int64)

    # --- as kernels see it ----------------------------------------------------------------------

    def header(self) -> np.ndarray:
        """The tree as kernels take it, until rows, nodes or filters are others."""
        if self._header is None:
            self._header = np.array(
                [
                    address_of(self.nodes), address_of(self.links), self.n_nodes, self.n_fixed, address_of(self.boxes),
                    len(self.boxes), address_of(self.traits), address_of(self._allowed), len(self._allowed),
                    address_of(self.leaf_of), address_of(self._changed), self._n_changed,
                ],
                dtype=np.int64,
            )
        return self._header

    def _forget_header(self) -> None:
        if self._header is not None:
            self._n_changed, self._header = int(self._header[N_CHANGED]), None

    def __getstate__(self) -> dict:
        """Copies and pickles have their arrays elsewhere."""
        self._forget_header()
        return self.__dict__

    @property
    def nbytes(self) -> int:
        """Memory that is held [bytes]."""
        cached = 0 if self._cached is None else self._cached.keys.nbytes
        columns = sum(column.nbytes for column in self._columns)
        return self.nodes.nbytes + self.links.nbytes + self._allowed.nbytes + columns + cached


def _comparable(boxes: np.ndarray) -> np.ndarray:
    """(k, 6) boxes with every box that holds a NaN bound replaced by the unbounded box. Walks skip boxes whose
    comparisons fail, and comparisons with NaN fail: a body is to be tested too often rather than missed.
    """
    unknown = np.isnan(boxes)
    if not np.count_nonzero(unknown):  # a quarter of the time of `any` along rows
        return boxes
    return np.where(unknown.any(axis=1)[:, None], _EVERYTHING, boxes)


def _traits_of(fixed: np.ndarray) -> np.ndarray:
    """(n, TRAITS) of bodies in group 1 that are tested with all others."""
    traits = np.tile(np.array([0, 1, 1, -1], dtype=np.int64), (len(fixed), 1))
    traits[:, FLAGS] = (STATIC_BIT | STILL_BIT) * fixed.astype(np.int64)
    return traits
