"""Managers of coal and python-fcl, for `worlds.py`: the same bodies, added, moved and asked."""

from __future__ import annotations

import numpy as np

ALL = 1 << 30


class Engine:
    """Bodies that go to and fro between two sets of poses (2, n, 4, 4), a tenth of a metre apart."""

    def __init__(self, X: np.ndarray):
        self.X, self.at, self.ids = X, 0, np.arange(len(X[0]))
        self.prepare()
        self.add()

    def prepare(self) -> None:
        """Shapes and transforms as the engine has them."""

    def there(self) -> int:
        self.at = 1 - self.at
        return self.at

    def task(self, name: str):
        ask = getattr(self, name)
        return ask if name in ("add", "move") else lambda: (self.move(), ask())


class Coal(Engine):
    """coal's `DynamicAABBTreeCollisionManager`, its callbacks in C++."""

    def prepare(self) -> None:
        import coal

        self.coal, self.geometries = coal, (coal.Box(1.0, 0.8, 0.6), coal.Sphere(0.5), coal.Capsule(0.3, 0.6))
        self.places = [[coal.Transform3s(np.array(x[:3, :3]), np.array(x[:3, 3])) for x in some] for some in self.X]

    def add(self) -> None:
        self.manager, place = self.coal.DynamicAABBTreeCollisionManager(), self.places[self.at]
        self.objects = [self.coal.CollisionObject(self.geometries[k % 3], place[k]) for k in self.ids.tolist()]
        for obj in self.objects:
            self.manager.registerObject(obj)
        self.manager.setup()

    def move(self) -> None:
        for obj, transform in zip(self.objects, self.places[self.there()]):
            obj.setTransform(transform)
            obj.computeAABB()
        self.manager.update()

    def collisions(self, max_contacts: int = ALL):
        callback = self.coal.CollisionCallBackDefault()
        callback.data.request.num_max_contacts = max_contacts
        self.manager.collide(callback)
        return callback.data.result

    def collides(self):
        return self.collisions(1)

    def hits(self) -> set[tuple[int, int]]:
        """Coal's contacts do not name their bodies in Python: every pair whose boxes meet, asked alone."""
        coal, boxes = self.coal, [obj.getAABB() for obj in self.objects]
        low, high = np.array([box.min_ for box in boxes]), np.array([box.max_ for box in boxes])
        hits, request = set(), coal.CollisionRequest()
        for i, obj in enumerate(self.objects):
            near = (low[i] <= high[i + 1 :]).all(axis=1) & (low[i + 1 :] <= high[i]).all(axis=1)
            for j in (np.flatnonzero(near) + i + 1).tolist():
                if coal.collide(obj, self.objects[j], request, coal.CollisionResult()):
                    hits.add((i, j))
        return hits


class Fcl(Engine):
    """python-fcl's `DynamicAABBTreeCollisionManager`, its default callbacks in Python."""

    def prepare(self) -> None:
        import fcl

        self.fcl, self.geometries = fcl, (fcl.Box(1.0, 0.8, 0.6), fcl.Sphere(0.5), fcl.Capsule(0.3, 0.6))
        self.places = [[fcl.Transform(x[:3, :3], x[:3, 3]) for x in some] for some in self.X]

    def add(self) -> None:
        self.manager, place = self.fcl.DynamicAABBTreeCollisionManager(), self.places[self.at]
        self.objects = [self.fcl.CollisionObject(self.geometries[k % 3], place[k]) for k in self.ids.tolist()]
        self.manager.registerObjects(self.objects)
        self.manager.setup()

    def move(self) -> None:
        for obj, transform in zip(self.objects, self.places[self.there()]):
            obj.setTransform(transform)
        self.manager.update()

    def collisions(self, max_contacts: int = ALL):
        data = self.fcl.CollisionData(request=self.fcl.CollisionRequest(num_max_contacts=max_contacts))
        self.manager.collide(data, self.fcl.defaultCollisionCallback)
        return data.result

    def collides(self):
        return self.collisions(1)

    def hits(self) -> set[tuple[int, int]]:
        # The callback gets objects of its own: they are known by where they are.
        place = {tuple(obj.getTranslation()): k for k, obj in enumerate(self.objects)}
        hits, request = set(), self.fcl.CollisionRequest()

        def ask(a, b, _data) -> bool:
            if self.fcl.collide(a, b, request, self.fcl.CollisionResult()):
                hits.add(tuple(sorted((place[tuple(a.getTranslation())], place[tuple(b.getTranslation())]))))
            return False

        self.manager.collide(None, ask)
        return hits
