"""python-fcl's `DynamicAABBTreeCollisionManager` over a box-tree of collide's broadphase."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from collide.adapters.hosts.fcl_geometry import CollisionObject, latest_change
from collide.broadphase.box_tree import BoxTree

#: Boxes are wider than the bodies by this part of their coordinates, for rounding.
_SLACK = 1e-12
#: How many boxes' gaps are looked at together.
_BLOCK = 1 << 20


class DynamicAABBTreeCollisionManager:
    """Objects, and callbacks for pairs of them whose boxes meet.

    ``collide`` and ``distance`` take ``(cdata, callback)``, ``(object, cdata, callback)`` or ``(manager, cdata,
    callback)``. A callback of ``collide`` returns whether that is all; of ``distance``, that and the least distance so
    far, beyond which pairs are not asked. Objects that moved are noticed without `update`; exceptions of callbacks are
    raised, where python-fcl prints and drops them.
    """

    def __init__(self):
        self._objects: list[CollisionObject] = []
        self._moved: set[CollisionObject] = set()
        self._tree: BoxTree | None = None
        self._known_change = 0
        #: Settings of FCL's tree: kept, and without effect.
        self.max_tree_nonbalanced_level = self.tree_incremental_balance_pass = 10
        self.tree_topdown_balance_threshold = 2
        self.tree_topdown_level = self.tree_init_level = 0
        self.octree_as_geometry_collide, self.octree_as_geometry_distance = True, False

    def registerObject(self, obj):
        """Add a `CollisionObject`; twice where it is added twice."""
        if not isinstance(obj, CollisionObject):
            raise TypeError(f"registerObject takes a CollisionObject, got {type(obj).__name__}")
        self._objects.append(obj)
        self._tree = None
        if not any(moved is self._moved for moved in obj._watchers):
            obj._watchers += (self._moved,)

    def registerObjects(self, other_objs):
        """Add several."""
        for obj in list(other_objs):
            self.registerObject(obj)

    def unregisterObject(self, obj):
        """Take an object out; nothing happens where it is not in."""
        if obj in self._objects:
            self._objects.remove(obj)
            self._tree = None
            if obj not in self._objects:
                self._let_go(obj)

    def _let_go(self, obj: CollisionObject) -> None:
        obj._watchers = tuple(moved for moved in obj._watchers if moved is not self._moved)
        self._moved.discard(obj)

    def clear(self):
        """Take all objects out."""
        for obj in self._objects:
            self._let_go(obj)
        self._objects, self._tree = [], None

    def setup(self):
        """Build the tree now, rather than at the next question."""
        self._refresh()

    def update(self, arg=None):
        """Take in what moved; arg : an object, several, or None for all. Poses are watched, so that all are."""
        self._refresh()

    def getObjects(self):
        """The objects, a list of its own, in the order in which they came."""
        return list(self._objects)

    def empty(self):
        """Whether there are no objects."""
        return not self._objects

    def size(self):
        """How many objects there are."""
        return len(self._objects)

    def collide(self, *args):
        """Call back for pairs whose boxes meet; see the class. Raises ValueError for any other arguments."""
        body, manager, cdata, callback = _asked(args)
        if body is not None:
            tree = self._refresh()
            if tree is None:
                return
            objects = self._objects
            for k in tree.touching(_boxes([body])[0], 0.0).tolist():
                if callback(objects[k], body, cdata):
                    return
            return
        for a, b in self._pairs(self if manager is None else manager):
            if callback(a, b, cdata):
                return

    def distance(self, *args):
        """Call back for pairs, near ones first; see the class. Raises ValueError for any other arguments."""
        body, manager, cdata, callback = _asked(args)
        least = np.inf
        mine = self._objects
        boxes = self._fresh_boxes()
        if body is not None:
            theirs, their_boxes = [body], _boxes([body])
        elif manager is None or manager is self:
            theirs, their_boxes = mine, boxes
        else:
            theirs, their_boxes = manager._objects, manager._fresh_boxes()
        if not mine or not theirs:
            return
        step = max(1, _BLOCK // len(theirs))
        for begin in range(0, len(mine), step):
            gaps = _gaps(boxes[begin : begin + step], their_boxes)
            if theirs is mine:
                gaps[np.arange(len(mine))[None, :] <= np.arange(begin, begin + len(gaps))[:, None]] = np.nan
            flat = gaps.ravel()
            wanted = np.flatnonzero(flat <= least)
            for k in wanted[np.argsort(flat[wanted], kind="stable")].tolist():
                if flat[k] > least or (flat[k] >= least > 0.0):
                    break
                i, j = divmod(k, len(theirs))
                is_done, least = callback(mine[begin + i], theirs[j], cdata)
                if is_done:
                    return

    def _pairs(self, manager: DynamicAABBTreeCollisionManager) -> Iterator[tuple[CollisionObject, CollisionObject]]:
        mine, theirs = self._objects, manager._objects
        if not mine or not theirs:
            return
        if manager is self:
            tree = self._refresh()
            assert tree is not None  # there are objects
            all_rows = np.ones(len(mine), dtype=np.int64)
            for i, j in tree.pairs(0.0, 0 * all_rows, all_rows, all_rows).tolist():
                yield mine[i], mine[j]
            return
        boxes = np.concatenate([self._fresh_boxes(), manager._fresh_boxes()])
        group = np.repeat(np.array([1, 2], dtype=np.int64), [len(mine), len(theirs)])
        for i, j in BoxTree(boxes).pairs(0.0, 0 * group, group, 3 - group).tolist():
            yield mine[i], theirs[j - len(mine)]

    def _fresh_boxes(self) -> np.ndarray:
        tree = self._refresh()
        return np.empty((0, 6)) if tree is None else tree.boxes

    def _refresh(self) -> BoxTree | None:
        """The tree over the boxes as they are; None without objects."""
        if not self._objects:
            self._moved.clear()
            return None
        if self._tree is None or self._known_change != latest_change[0] or 4 * len(self._moved) > len(self._objects):
            self._tree = BoxTree(_boxes(self._objects))
            self._known_change = latest_change[0]
        elif self._moved:
            rows = [k for k, obj in enumerate(self._objects) if obj in self._moved]
            boxes = self._tree.boxes.copy()
            boxes[rows] = _boxes([self._objects[k] for k in rows])
            self._tree.refit(boxes)
        self._moved.clear()
        return self._tree


def _asked(args: tuple):
    """(object or None, manager or None, cdata, callback). Raises ValueError."""
    if len(args) == 2 and callable(args[1]):
        return None, None, *args
    if len(args) == 3 and callable(args[2]):
        if isinstance(args[0], DynamicAABBTreeCollisionManager):
            return None, *args
        if isinstance(args[0], CollisionObject):
            return args[0], None, *args[1:]
    raise ValueError("give (cdata, callback), (object, cdata, callback) or (manager, cdata, callback)")


def _boxes(objects: list[CollisionObject]) -> np.ndarray:
    """Boxes (n, 6) around posed geometries, without end where these have none."""
    corners = np.array([obj._geometry._corners for obj in objects])
    X = np.array([obj._X for obj in objects])
    unbounded = ~np.isfinite(corners).all(axis=(1, 2))
    corners[unbounded] = 0.0
    middle = np.einsum("nij,nj->ni", X[:, :3, :3], 0.5 * (corners[:, 0] + corners[:, 1])) + X[:, :3, 3]
    half = np.einsum("nij,nj->ni", np.abs(X[:, :3, :3]), 0.5 * (corners[:, 1] - corners[:, 0]))
    half += _SLACK * (np.abs(middle) + half)
    half[unbounded] = np.inf
    return np.concatenate([middle - half, middle + half], axis=1)


def _gaps(boxes: np.ndarray, their_boxes: np.ndarray) -> np.ndarray:
    """Least distances (n, m) between boxes (n, 6) and (m, 6); 0 where they meet."""
    gaps = np.zeros((len(boxes), len(their_boxes)))
    for axis in range(3):
        low, high = boxes[:, axis, None], boxes[:, axis + 3, None]
        apart = np.maximum(their_boxes[None, :, axis] - high, low - their_boxes[None, :, axis + 3])
        gaps += np.maximum(apart, 0.0) ** 2
    return np.sqrt(gaps) * (1.0 - _SLACK)
