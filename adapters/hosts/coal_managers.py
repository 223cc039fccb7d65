"""coal's broadphase managers and their callbacks: all managers are one, over collide's broadphase."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from collide.adapters.hosts.coal_geometry import CollisionObject
from collide.adapters.hosts.coal_queries import collide_posed, distance_posed
from collide.adapters.hosts.coal_requests import CollisionData, DistanceData, DistanceResult
from collide.adapters.hosts.object_tree import ObjectTree


class CollisionCallBackBase:
    """What a manager's `collide` calls: classes of users may derive from it."""

    def init(self):
        """Called before each traversal."""

    def collide(self, o1, o2):
        """Asks one pair whose boxes meet; returns whether that is all."""
        raise NotImplementedError(f"{type(self).__name__}.collide(o1, o2) is to return whether that is all")


class DistanceCallBackBase:
    """What a manager's `distance` calls: classes of users may derive from it."""

    def init(self):
        """Called before each traversal."""

    def distance(self, o1, o2, dist):
        """Asks one pair; puts the least distance so far into ``dist[0]`` [m]; returns whether that is all."""
        raise NotImplementedError(f"{type(self).__name__}.distance(o1, o2, dist) is to return whether that is all")


class CollisionCallBackDefault(CollisionCallBackBase):
    """Collects contacts into ``data.result``, up to ``data.request.num_max_contacts``."""

    def __init__(self):
        self.data = CollisionData()

    def init(self):
        """The result as new."""
        self.data.clear()

    def collide(self, o1, o2):
        """Asks one pair; True once there are as many contacts as asked for."""
        data = self.data
        if not data.done:
            n = collide_posed(o1._geometry, o1._X, o2._geometry, o2._X, data.request, data.result)
            data.done = n >= data.request.num_max_contacts
        return data.done


class CollisionCallBackCollect(CollisionCallBackBase):
    """Collects pairs whose boxes meet; the argument is a hint."""

    def __init__(self, max_size):
        self._pairs: list[tuple[CollisionObject, CollisionObject]] = []

    def init(self):
        """No pairs."""
        self._pairs = []

    def collide(self, o1, o2):
        """Takes the pair."""
        self._pairs.append((o1, o2))
        return False

    def numCollisionPairs(self):
        """How many pairs there are."""
        return len(self._pairs)

    def getCollisionPairs(self):
        """The pairs, a list of its own."""
        return list(self._pairs)

    def exist(self, pair):
        """Whether a pair is there, in this order."""
        return any(a is pair[0] and b is pair[1] for a, b in self._pairs)


class DistanceCallBackDefault(DistanceCallBackBase):
    """Keeps the nearest pair in ``data.result``."""

    def __init__(self):
        self.data = DistanceData()

    def init(self):
        """The result as new."""
        self.data.clear()

    def distance(self, o1, o2, dist):
        """Asks one pair; True where it overlaps, or once ``data.done`` is set."""
        data = self.data
        if not data.done:
            nearest = DistanceResult()
            distance_posed(o1._geometry, o1._X, o2._geometry, o2._X, data.request, nearest)
            if nearest.min_distance < data.result.min_distance:
                data.result.__dict__.update(nearest.__dict__)
        dist[0] = data.result.min_distance
        return data.done or data.result.min_distance <= 0.0


class BroadPhaseCollisionManager:
    """Objects, and callbacks for pairs of them whose boxes meet, or come within the request's margin.

    ``collide`` and ``distance`` take ``(callback)``, ``(object, callback)`` or ``(manager, callback)``. Objects that
    moved are noticed without `update`; exceptions of callbacks are raised.
    """

    def __init__(self):
        if type(self) is BroadPhaseCollisionManager:
            raise RuntimeError("BroadPhaseCollisionManager cannot be instantiated: it is a base class")
        self._tree = ObjectTree()

    def registerObject(self, obj):
        """Add a `CollisionObject`."""
        if not isinstance(obj, CollisionObject):
            raise TypeError(f"registerObject takes a CollisionObject of this module, got {type(obj).__name__}")
        self._tree.add(obj)

    def registerObjects(self, objs):
        """Add several."""
        for obj in objs:
            self.registerObject(obj)

    def unregisterObject(self, obj):
        """Take an object out; nothing happens where it is not in."""
        self._tree.remove(obj)

    def setup(self):
        """Build the tree now, rather than at the next question."""
        self._tree.refresh()

    def update(self, arg=None):
        """Nothing to do, for poses are watched; arg : an object, several, or None for all."""

    def clear(self):
        """Take all objects out."""
        self._tree.remove_all()

    def getObjects(self):
        """The objects, a list of its own."""
        return list(self._tree.objects)

    def empty(self):
        """Whether there are no objects."""
        return not self._tree.objects

    def size(self):
        """How many objects there are."""
        return len(self._tree.objects)

    def collide(self, *args):
        """See the class. Raises TypeError for other arguments."""
        body, callback = self._asked("collide", args, CollisionCallBackBase)
        callback.init()
        mine = self._tree.objects
        theirs = [body] if isinstance(body, CollisionObject) else mine if body is None else body.objects
        margin = callback.data.request.security_margin if isinstance(callback, CollisionCallBackDefault) else 0.0
        for block in self._blocks(body, margin):
            for i, j in block.tolist():
                if callback.collide(mine[i], theirs[j]):
                    return

    def _blocks(self, body, margin: float) -> Iterator[np.ndarray]:
        """Blocks (k, 2) of rows of pairs that may be at most the margin apart; an object's row is 0."""
        if margin > 0.0:
            for _, rows in self._tree.near(body, [np.nextafter(margin, np.inf)]):
                yield rows
        elif isinstance(body, CollisionObject):
            rows = self._tree.touching(body)
            yield np.column_stack([rows, np.zeros(len(rows), dtype=np.int64)]).astype(np.int64)
        else:
            yield from self._tree.pairs(body)

    def distance(self, *args):
        """See the class; pairs whose boxes are near come first. Raises TypeError for other arguments."""
        body, callback = self._asked("distance", args, DistanceCallBackBase)
        callback.init()
        mine = self._tree.objects
        theirs = [body] if isinstance(body, CollisionObject) else mine if body is None else body.objects
        least, dist = [np.inf], np.array([np.inf])
        for gaps, rows in self._tree.near(body, least):
            for gap, (i, j) in zip(gaps.tolist(), rows.tolist()):
                if gap >= least[0]:
                    break
                if callback.distance(mine[i], theirs[j], dist):
                    return
                least[0] = float(dist[0])

    def _asked(self, name: str, args: tuple, kind: type) -> tuple[Any, Any]:
        """(an object, the tree of another manager, or None; the callback). Raises TypeError."""
        if len(args) in (1, 2) and isinstance(args[-1], kind):
            if len(args) == 1 or args[0] is self:
                return None, args[-1]
            if isinstance(args[0], BroadPhaseCollisionManager):
                return args[0]._tree, args[1]
            if isinstance(args[0], CollisionObject):
                return args
        raise TypeError(f"{name} takes (callback), (object, callback) or (manager, callback), with a {kind.__name__}")


class DynamicAABBTreeCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class DynamicAABBTreeArrayCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class IntervalTreeCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class NaiveCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class SaPCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class SSaPCollisionManager(BroadPhaseCollisionManager):
    __doc__ = BroadPhaseCollisionManager.__doc__


class SpatialHashingCollisionManager(BroadPhaseCollisionManager):
    """As the other managers; cells and corners of the scene have no effect."""

    def __init__(self, cell_size, scene_min, scene_max, table_size=1000):
        super().__init__()
