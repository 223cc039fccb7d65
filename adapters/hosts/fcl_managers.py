"""python-fcl's `DynamicAABBTreeCollisionManager` over collide's broadphase."""

from __future__ import annotations

import numpy as np

from collide.adapters.hosts.fcl_batches import collide_in_batches, distance_in_batches
from collide.adapters.hosts.fcl_geometry import CollisionObject
from collide.adapters.hosts.fcl_queries import defaultCollisionCallback, defaultDistanceCallback
from collide.adapters.hosts.fcl_requests import CollisionData, DistanceData
from collide.adapters.hosts.object_tree import ObjectTree

#: One object that meets at most so many boxes is asked pair by pair, which is sooner.
_MAX_SINGLE = 24


class DynamicAABBTreeCollisionManager:
    """Objects, and callbacks for pairs of them whose boxes meet.

    ``collide`` and ``distance`` take ``(cdata, callback)``, ``(object, cdata, callback)`` or ``(manager, cdata,
    callback)``. A callback of ``collide`` returns whether that is all; of ``distance``, that and the least distance so
    far, beyond which pairs are not asked. Objects that moved are noticed without `update`; exceptions of callbacks are
    raised, where python-fcl prints and drops them. `defaultCollisionCallback` and `defaultDistanceCallback` are not
    called: many pairs are answered together, with the results that they would have had.
    """

    def __init__(self):
        self._tree = ObjectTree()
        #: Settings of FCL's tree: kept, and without effect.
        self.max_tree_nonbalanced_level = self.tree_incremental_balance_pass = 10
        self.tree_topdown_balance_threshold = 2
        self.tree_topdown_level = self.tree_init_level = 0
        self.octree_as_geometry_collide, self.octree_as_geometry_distance = True, False

    def registerObject(self, obj):
        """Add a `CollisionObject`; twice where it is added twice."""
        if not isinstance(obj, CollisionObject):
            raise TypeError(f"registerObject takes a CollisionObject, got {type(obj).__name__}")
        self._tree.add(obj)

    def registerObjects(self, other_objs):
        """Add several."""
        for obj in list(other_objs):
            self.registerObject(obj)

    def unregisterObject(self, obj):
        """Take an object out; nothing happens where it is not in."""
        self._tree.remove(obj)

    def clear(self):
        """Take all objects out."""
        self._tree.remove_all()

    def setup(self):
        """Build the tree now, rather than at the next question."""
        self._tree.refresh()

    def update(self, arg=None):
        """Nothing to do, for poses are watched: the next question brings the tree up to date.

        arg : an object, several, or None for all. Raises TypeError for anything else.
        """
        if arg is not None and not isinstance(arg, CollisionObject):
            for obj in arg:
                if not isinstance(obj, CollisionObject):
                    raise TypeError(f"update takes CollisionObjects, got {type(obj).__name__}")

    def getObjects(self):
        """The objects, a list of its own, in the order in which they came."""
        return list(self._tree.objects)

    def empty(self):
        """Whether there are no objects."""
        return not self._tree.objects

    def size(self):
        """How many objects there are."""
        return len(self._tree.objects)

    def collide(self, *args):
        """Call back for pairs whose boxes meet; see the class. Raises ValueError for any other arguments."""
        against, cdata, callback = self._asked(args)
        tree = self._tree
        mine = tree.objects
        is_default = callback is defaultCollisionCallback and isinstance(cdata, CollisionData)
        if isinstance(against, CollisionObject):
            rows = tree.touching(against)
            if is_default and len(rows) > _MAX_SINGLE:
                block = np.stack([rows, np.zeros(len(rows), dtype=np.int64)], axis=1)
                collide_in_batches(tree, against, [block], cdata)
                return
            for k in rows:
                if callback(mine[k], against, cdata):
                    return
            return
        blocks = tree.pairs(against)
        if is_default:
            collide_in_batches(tree, against, blocks, cdata)
            return
        theirs = mine if against is None else against.objects
        for block in blocks:
            for i, j in block.tolist():
                if callback(mine[i], theirs[j], cdata):
                    return

    def distance(self, *args):
        """Call back for pairs, near ones first; see the class. Raises ValueError for any other arguments."""
        against, cdata, callback = self._asked(args)
        if callback is defaultDistanceCallback and isinstance(cdata, DistanceData):
            distance_in_batches(self._tree, against, cdata)
            return
        least = [np.inf]
        mine = self._tree.objects
        theirs = [against] if isinstance(against, CollisionObject) else mine if against is None else against.objects
        for gaps, rows in self._tree.near(against, least):
            for gap, (i, j) in zip(gaps.tolist(), rows.tolist()):
                if gap >= least[0]:
                    break
                is_done, least[0] = callback(mine[i], theirs[j], cdata)
                if is_done:
                    return

    def _asked(self, args: tuple):
        """(object, tree of another manager, or None; cdata, callback). Raises ValueError."""
        if len(args) == 2 and callable(args[1]):
            return None, *args
        if len(args) == 3 and callable(args[2]):
            against, cdata, callback = args
            if isinstance(against, DynamicAABBTreeCollisionManager):
                return None if against is self else against._tree, cdata, callback
            if isinstance(against, CollisionObject):
                return against, cdata, callback
        raise ValueError("give (cdata, callback), (object, cdata, callback) or (manager, cdata, callback)")
