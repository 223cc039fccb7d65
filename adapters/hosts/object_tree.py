"""Objects of a host under a box-tree of collide's broadphase: what managers of FCL and its kin ask.

Pairs come in blocks, few first: a question that ends at its first answer looks at few boxes, and one that wants all
pairs has them in arrays, to be answered in batches (`batch`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from collide.adapters.hosts.posed_objects import HostObject, box_of, boxes_of_objects, latest_change
from collide.broadphase.box_tree import BoxTree
from collide.broadphase.boxes_ahead import SWEEP, bodies_ahead
from collide.broadphase.graded_boxes import BODY
from collide.broadphase.walk_boxes import boxes_met
from collide.kernels import address_of
from collide.shapes.shape import Shape
from collide.shapes.shape_set import Picked, ShapeSet

#: The pairs of so many leaves are looked for first, then those of so many times more, before those of all.
_FIRST_LEAVES, _MORE_LEAVES = 32, 8
#: Up to so many pairs are sorted by their gaps all at once.
_MAX_SORTED = 2048
#: Gaps of boxes are less than this part below what they are in doubles.
_ROUNDING = 1e-12


class ObjectTree:
    """Objects, each once or more often, and a tree over their boxes that is brought up to date when asked.

    objects : in the order in which they came; rows are places in it. Add, remove and clear by methods.
    """

    def __init__(self) -> None:
        self.objects: list[HostObject] = []
        self._moved: set[HostObject] = set()
        self._tree: _Tree | None = None
        self._rows_of: dict[HostObject, list[int]] = {}
        self._known_change = 0
        self._shapes: tuple[ShapeSet | None, np.ndarray] | None = None

    def add(self, obj: HostObject) -> None:
        """One more object; twice where it is added twice."""
        self.objects.append(obj)
        self._forget()
        if not any(moved is self._moved for moved in obj._watchers):
            obj._watchers += (self._moved,)

    def remove(self, obj: HostObject) -> bool:
        """Take an object out, once; whether it was in."""
        if obj not in self.objects:
            return False
        self.objects = list(self.objects)  # another one: questions under way go on with the list they have
        self.objects.remove(obj)
        self._forget()
        if obj not in self.objects:
            self._let_go(obj)
        return True

    def remove_all(self) -> None:
        """Take all objects out."""
        for obj in self.objects:
            self._let_go(obj)
        self.objects = []
        self._forget()

    def _let_go(self, obj: HostObject) -> None:
        obj._watchers = tuple(moved for moved in obj._watchers if moved is not self._moved)
        self._moved.discard(obj)

    def _forget(self) -> None:
        self._tree = self._shapes = None

    # --- the tree -------------------------------------------------------------------------------

    def refresh(self) -> _Tree | None:
        """The tree over the boxes as they are; None without objects.

        O(n log n) where objects came or went or geometries changed, else O(n) where k objects moved, of which O(k) in
        Python.
        """
        if not self.objects:
            self._moved.clear()
            return None
        if self._tree is None or self._known_change != latest_change[0]:
            self._build()
        elif self._moved:
            self._refit(self._tree)
        self._moved.clear()
        return self._tree

    def _build(self) -> None:
        self._known_change, self._shapes = latest_change[0], None
        self._corners = np.array([obj._geometry._corners for obj in self.objects])
        self.X_W = _poses(self.objects)
        self._tree = _Tree(boxes_of_objects(self._corners, self.X_W))
        self._rows_of = {}
        for row, obj in enumerate(self.objects):
            self._rows_of.setdefault(obj, []).append(row)

    def _refit(self, tree: _Tree) -> None:
        if len(self._moved) == len(self._rows_of) == len(self.objects):
            self.X_W = _poses(self.objects)
            tree.refit(boxes_of_objects(self._corners, self.X_W))
            return
        rows = [row for obj in self._moved for row in self._rows_of[obj]]
        X = self.X_W[rows] = _poses([self.objects[row] for row in rows])
        tree.boxes[rows] = boxes_of_objects(self._corners[rows], X)
        tree.refit(tree.boxes)

    # --- who meets whom -------------------------------------------------------------------------

    def touching(self, obj: HostObject) -> list[int]:
        """Rows, ascending, of objects whose boxes meet that of an outside object."""
        tree = self.refresh()
        return [] if tree is None else tree.touching_one(box_of(obj))

    def pairs(self, against: ObjectTree | None = None) -> Iterator[np.ndarray]:
        """Blocks (k, 2) of rows whose boxes meet: i < j of this tree, or i of this one and j of that.

        Objects that move between two blocks may or may not be found where they went; no pair comes twice.
        """
        tree = self.refresh()
        if against is None:
            return iter(()) if tree is None else tree.blocks(0.0)
        theirs = against.refresh()
        return iter(()) if tree is None or theirs is None else tree.blocks_with(theirs.as_guests(), 0.0)

    def near(
        self, against: ObjectTree | HostObject | None, least: list[float]
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Blocks (gaps (k,), rows (k, 2)), of pairs whose boxes are so far apart, near ones first.

        against : another tree, None for this one; or one object, whose row is 0.
        least : one number, to be lowered between blocks: no pair at least so far apart is wanted, though some may be
            there.
        """
        tree = self.refresh()
        if tree is None:
            return iter(())
        if isinstance(against, HostObject):
            return _near_one(tree, box_of(against), least)
        theirs = None if against is None else against.refresh()
        if against is not None and theirs is None:
            return iter(())
        return _near_first(tree, None if theirs is None else theirs.as_guests(), least)

    # --- batches --------------------------------------------------------------------------------

    def batch(self, rows: np.ndarray, against: ObjectTree | HostObject | None, their_rows: np.ndarray):
        """(A, B, X_WA, X_WB) of pairs as `collide.collide` and its kin take them: this tree's objects are A.

        against : whose rows the others are, or one object.   Objects that are not `is_single` must not be among them.
        """
        A, X_WA = self._picked(rows), self.X_W[rows]
        if isinstance(against, HostObject):
            return A, against._geometry._shapes[0], X_WA, against._X[None].copy()
        theirs = self if against is None else against
        return A, theirs._picked(their_rows), X_WA, theirs.X_W[their_rows]

    def is_single(self, rows: np.ndarray) -> np.ndarray:
        """(k,) bool: which of these are one shape each."""
        return self._shape_rows()[1][rows] >= 0

    def _picked(self, rows: np.ndarray) -> Picked:
        shape_set, shape_of = self._shape_rows()
        assert shape_set is not None
        return Picked(shape_set, shape_of[rows])

    def _shape_rows(self) -> tuple[ShapeSet | None, np.ndarray]:
        """The distinct shapes, and which of them each object has; −1 of objects of more shapes or none."""
        if self._shapes is None:
            numbers: dict[int, int] = {}
            shapes: list[Shape] = []
            shape_of = np.empty(len(self.objects), dtype=np.int64)
            for row, obj in enumerate(self.objects):
                of_object = obj._geometry._shapes
                number = -1
                if len(of_object) == 1:
                    number = numbers.setdefault(id(of_object[0]), len(shapes))
                    if number == len(shapes):
                        shapes.append(of_object[0])
                shape_of[row] = number
            self._shapes = (ShapeSet(shapes) if shapes else None), shape_of
        return self._shapes


def _poses(objects: list[HostObject]) -> np.ndarray:
    return np.concatenate([obj._X for obj in objects]).reshape(-1, 4, 4)


class _Tree(BoxTree):
    """A box-tree that gives pairs in blocks."""

    def __init__(self, boxes: np.ndarray):
        super().__init__(boxes)
        self._is_bounded = np.isfinite(boxes).all(axis=1)
        self._hits = np.empty((64, 2), dtype=np.int64)
        self._keep_addresses()

    def refit(self, boxes: np.ndarray) -> None:
        """As of `BoxTree`, which may sort anew."""
        super().refit(boxes)
        self._keep_addresses()

    def _keep_addresses(self) -> None:
        """Of single boxes: arguments of the kernel that stay, and room for what it finds."""
        self._held = self.header()
        self._fixed_arguments = address_of(self._hits), 64

    def touching_one(self, box: np.ndarray) -> list[int]:
        """As `touching` without a margin, sooner for a box that meets few."""
        count = boxes_met(address_of(self._held), address_of(box), 1, 0.0, *self._fixed_arguments)
        if count > len(self._hits) or len(self.unbounded):
            return self.touching(box, 0.0).tolist()
        hits = self._hits[:count, 1].tolist()
        hits.sort()
        return hits

    def blocks(self, margin: float) -> Iterator[np.ndarray]:
        """Blocks (k, 2) of rows i < j whose boxes come within margin along every axis."""
        n, done, more = len(self.boxes), 0, _FIRST_LEAVES
        bodies = self.links[: self.n_nodes, BODY]
        leaves = np.flatnonzero(bodies >= 0)  # ascending
        is_done = np.zeros(n, dtype=bool)
        while done < len(leaves) or done == 0:
            end = int(leaves[min(more, len(leaves)) - 1]) + 1 if len(leaves) else 0
            hits = self.pairs_among(0, end, margin)  # one of each at the first leaves
            hits = hits[~is_done[hits].any(axis=1)] if done else hits
            if len(hits):
                yield _sorted_pairs(hits, n)
            if not done and len(self.unbounded):
                yield _all_with(self.unbounded, n)
            is_done[bodies[leaves[done:more]]] = True
            done, more = more, _MORE_LEAVES * more if len(hits) else n

    def blocks_with(self, guests: _Guests, margin: float) -> Iterator[np.ndarray]:
        """Blocks (k, 2) of rows, of this tree and of guests."""
        which = np.flatnonzero(guests.is_bounded)
        n = len(guests.boxes)
        for some in (which[:_FIRST_LEAVES], which[_FIRST_LEAVES:]):
            if len(some):
                hits = self.bounded_met(guests.boxes[some], margin)
                if len(hits):
                    yield _sorted_keys(hits[:, 1] * n + some[hits[:, 0]], n)
        if len(self.unbounded) or len(which) < n:
            yield np.argwhere(~(self._is_bounded[:, None] & guests.is_bounded[None, :]))

    def as_guests(self) -> _Guests:
        """These boxes, to be compared with another tree's."""
        return _Guests(self.boxes, self._is_bounded, *self.around.reshape(2, 3))

    def near_gap(self, guests: _Guests | None) -> float:
        """A margin within which there is a pair, if there is one at all: of boxes at leaves side by side, or of a guest
        and the box near its middle.
        """
        if guests is None:
            ordered = self.boxes[self.order]
            return float(_gaps(ordered[:-1], ordered[1:]).min(initial=np.inf))
        bounded = guests.boxes[guests.is_bounded]
        if not len(bounded) or not len(self.order):
            return np.inf
        return float(_gaps(self.boxes[self.nearest_to(0.5 * (bounded[0, :3] + bounded[0, 3:]))], bounded[0]))

    def nearest_to(self, point: np.ndarray) -> int:
        """The row of a bounded box, of which there is one, that is nearest to a point (3,)."""
        question = np.zeros((1, SWEEP))
        question[0, :3], question[0, 9] = point, np.inf
        rows = bodies_ahead(self, question, of_points=True)[0][:, 1]
        return int(rows[self._is_bounded[rows]][0])


class _Guests(NamedTuple):
    """boxes : (n, 6), to be compared with a tree's.   is_bounded : (n,).   low, high : (3,) corners around these."""

    boxes: np.ndarray
    is_bounded: np.ndarray
    low: np.ndarray
    high: np.ndarray


def _near_one(
    tree: _Tree, box: np.ndarray, least: list[float]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Blocks of pairs with one box: those that meet it, else the one nearest its middle; then all within the least."""
    if len(tree.boxes) <= _MAX_SORTED // 8:
        yield from _all_by_gap(tree.boxes, box[None], least[0])
        return
    rows = np.array(tree.touching_one(box), dtype=np.int64)
    if len(rows):
        yield np.zeros(len(rows)), _with_zero(rows)
    if least[0] <= 0.0 or not np.isfinite(box).all():
        return
    done = rows
    if not len(rows):  # then all boxes are bounded
        done = np.array([tree.nearest_to(0.5 * (box[:3] + box[3:]))])
        yield _gaps(tree.boxes[done], box), _with_zero(done)
    slack = _ROUNDING * float(np.abs(box).max() + min(least[0], 1e300))
    rows = tree.touching(box, least[0] + slack)
    rows = rows[~np.isin(rows, done)]
    gaps = _gaps(tree.boxes[rows], box)
    order = np.argsort(gaps, kind="stable")
    if len(rows):
        yield gaps[order], _with_zero(rows[order])


def _all_by_gap(
    boxes: np.ndarray, guests: np.ndarray | None, least: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """All pairs nearer than the least in one block, of boxes with guests or among themselves: sooner than a tree where
    they are few.
    """
    gaps = _gaps(boxes[:, None], (boxes if guests is None else guests)[None])
    if guests is None:
        gaps[np.tri(len(boxes), dtype=bool)] = np.inf
    flat = gaps.ravel()
    order = np.argsort(flat, kind="stable")
    order = order[: int((flat < least).sum())]
    if len(order):
        yield flat[order], np.stack(np.divmod(order, gaps.shape[1]), axis=1)


def _with_zero(rows: np.ndarray) -> np.ndarray:
    return np.stack([rows, np.zeros_like(rows)], axis=1)


def _near_first(
    tree: _Tree, guests: _Guests | None, least: list[float]
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Blocks of pairs by their gaps: those whose boxes meet, those within a margin, within four times that, and so on
    up to the least.
    """
    theirs = tree.as_guests() if guests is None else guests
    if len(tree.boxes) * len(theirs.boxes) <= _MAX_SORTED:
        yield from _all_by_gap(tree.boxes, None if guests is None else guests.boxes, least[0])
        return
    low, high = np.minimum(tree.nodes[1, :3], theirs.low), np.maximum(tree.nodes[1, 3:], theirs.high)
    extent = float(np.linalg.norm(high - low)) if (low <= high).all() else 0.0
    slack = _ROUNDING * float(np.abs([low, high]).max()) if extent else 0.0
    done, margin = -np.inf, 0.0
    while True:
        for rows in tree.blocks(margin + slack) if guests is None else tree.blocks_with(guests, margin + slack):
            gaps = _gaps(tree.boxes[rows[:, 0]], theirs.boxes[rows[:, 1]])
            if len(rows) > 1 or margin:
                wanted = np.flatnonzero((gaps > done) & (gaps <= margin))
                wanted = wanted[np.argsort(gaps[wanted], kind="stable")]
                gaps, rows = gaps[wanted], rows[wanted]
            if len(rows):
                yield gaps, rows
            if least[0] <= 0.0:
                return
        if margin >= extent or margin >= least[0]:
            return
        wider = 4.0 * margin or min(tree.near_gap(guests), least[0]) * (1.0 + 4 * _ROUNDING)
        done, margin = margin, min(least[0], extent, max(wider, 1e-3 * extent))


def _gaps(boxes: np.ndarray, their_boxes: np.ndarray) -> np.ndarray:
    """Least distances between boxes (…, 6), from below; 0 where they meet."""
    apart = np.maximum(their_boxes[..., :3] - boxes[..., 3:], boxes[..., :3] - their_boxes[..., 3:])
    np.maximum(apart, 0.0, out=apart)
    return np.sqrt((apart * apart).sum(axis=-1)) * (1.0 - _ROUNDING)


def _sorted_pairs(pairs: np.ndarray, n: int) -> np.ndarray:
    """Pairs (k, 2) of numbers below n, each with the lower one first, sorted."""
    return _sorted_keys(pairs.min(axis=1) * n + pairs.max(axis=1), n)


def _sorted_keys(keys: np.ndarray, n: int) -> np.ndarray:
    keys.sort()
    return np.stack(np.divmod(keys, n), axis=1)


def _all_with(unbounded: np.ndarray, n: int) -> np.ndarray:
    """Pairs (k, 2) of each of these with all below n, each pair once."""
    pairs = np.stack([np.repeat(unbounded, n), np.tile(np.arange(n), len(unbounded))], axis=1)
    is_unbounded = np.zeros(n, dtype=bool)
    is_unbounded[unbounded] = True
    keep = (pairs[:, 0] != pairs[:, 1]) & ~(is_unbounded[pairs[:, 1]] & (pairs[:, 1] < pairs[:, 0]))
    return _sorted_pairs(pairs[keep], n)


def in_chunks(blocks: Iterable[np.ndarray], first: int, max_size: int) -> Iterator[np.ndarray]:
    """Blocks, cut: the first piece has ``first`` rows, each further one four times as many, up to ``max_size``."""
    size = first
    for block in blocks:
        begin = 0
        while begin < len(block):
            yield block[begin : begin + size]
            begin += size
            size = min(4 * size, max_size)
