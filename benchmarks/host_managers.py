"""What python-fcl's managers and trimesh's CollisionManager cost on collide, beside python-fcl.

    python benchmarks/host_managers.py --table managers trimesh

managers   all that a manager of 10 to 5,000 objects is asked, crowded and apart; both engines answer in one process
trimesh    its CollisionManager, which keeps the fcl that it finds: each engine in a child process

µs of the thread's own time; a ratio above 1 says that collide is faster. "differ" counts answers unlike ours.
"""

from __future__ import annotations

import time
from functools import cache, partial

import numpy as np
from inputs import ball, rotations

from collide.adapters.bench.child_contestant import InChild
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.bench.turns import Seconds
from collide.adapters.hosts import fcl_api
from collide.adapters.peers.fcl_peer import triangulate


def modules() -> dict:
    import fcl

    return {"collide": fcl_api, "python-fcl": fcl}


def scene(fcl, n: int, is_separated: bool) -> list:
    """n objects of four kinds in a cube, one a cubic metre; of separated ones the gaps are as wide as they."""
    rng = np.random.default_rng(1)
    points, facets = triangulate(0.3 * ball(12))
    padded = np.column_stack([np.full(len(facets), 3), facets]).ravel()
    shapes = [fcl.Box(0.5, 0.4, 0.3), fcl.Sphere(0.3), fcl.Capsule(0.1, 0.5), fcl.Convex(points, len(facets), padded)]
    places = rng.uniform(0.0, n ** (1 / 3), (n, 3))
    if is_separated:
        side = int(np.ceil(n ** (1 / 3)))
        places = 1.5 * np.stack(np.unravel_index(rng.permutation(side**3)[:n], (side,) * 3), axis=1)
    R = rotations(rng.normal(size=(n, 4)))
    return [fcl.CollisionObject(shapes[k % 4], fcl.Transform(R[k], places[k])) for k in range(n)]


class Managed:
    """Questions to one engine's manager."""

    def __init__(self, fcl, n: int, is_separated: bool):
        self.fcl, self.objects = fcl, scene(fcl, n, is_separated)
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects(self.objects)
        self.manager.setup()
        middle = np.mean([obj.getTranslation() for obj in self.objects], axis=0)
        self.guest = fcl.CollisionObject(fcl.Sphere(0.4), fcl.Transform(middle))

    def asked(self, *who, contacts: bool = False, limit: int = 10**6):
        cdata = self.fcl.CollisionData(self.fcl.CollisionRequest(limit, contacts))
        self.manager.collide(*who, cdata, self.fcl.defaultCollisionCallback)
        return len(cdata.result.contacts)

    def all_moved(self):
        for obj in self.objects:
            obj.setTranslation(obj.getTranslation())
        self.manager.update()
        return self.asked()

    def nearest(self, *who):
        cdata = self.fcl.DistanceData()
        self.manager.distance(*who, cdata, self.fcl.defaultDistanceCallback)
        return cdata.result.min_distance

    def questions(self) -> dict:
        return {
            "any pair": partial(self.asked, limit=1), "all pairs": self.asked,
            "all contacts": partial(self.asked, contacts=True), "all moved": self.all_moved,
            "own callback": lambda: self.manager.collide(None, lambda a, b, cdata: False),
            "one to all": partial(self.asked, self.guest), "least distance": self.nearest,
            "distance of one": partial(self.nearest, self.guest),
        }


@cache
def managed(objects: int, where: str) -> dict[str, dict]:
    return {name: Managed(fcl, objects, where == "apart").questions() for name, fcl in modules().items()}


def managers(options: Options, objects: int, where: str, question: str) -> Race:
    tasks = {name: questions[question] for name, questions in managed(objects, where).items()}
    answers = {name: task() for name, task in tasks.items()}
    return Race(tasks, columns={"same_answers": answers["collide"] == answers["python-fcl"]})


def manager_cases(options: Options):
    if installed(fcl="fcl"):
        sizes, questions = (10, 100) if options.quick else (10, 100, 1000, 5000), managed(10, "apart")["collide"]
        yield from grid(objects=sizes, where=("crowded", "apart"), question=questions)


class Trimesh:
    """trimesh's manager with the fcl that it finds."""

    def __init__(self, engine: str, n: int):
        if engine == "collide":
            fcl_api.install()
        import trimesh
        from trimesh.collision import CollisionManager

        rng, meshes = np.random.default_rng(3), [trimesh.creation.icosphere(2, 0.3)]
        meshes.append(trimesh.creation.annulus(0.1, 0.3, 0.3))
        manager, guests = CollisionManager(), CollisionManager()
        for k in range(n):
            X = trimesh.transformations.random_rotation_matrix(rng.random(3))
            X[:3, 3] = rng.uniform(0.0, n ** (1 / 3), 3)
            manager.add_object(f"body {k}", meshes[k % 2], X)
            if k % 5 == 0:
                X = X.copy()
                X[:3, 3] += 0.2
                guests.add_object(f"guest {k}", meshes[(k + 1) % 2], X)
        self.calls = {
            "internal": manager.in_collision_internal, "distance": manager.min_distance_internal,
            "internal, names": partial(manager.in_collision_internal, return_names=True),
            "other, names": partial(manager.in_collision_other, guests, return_names=True),
            "single": partial(manager.in_collision_single, meshes[0], np.eye(4)),
        }

    def seconds(self, question: str) -> float:
        begin = time.thread_time()
        self.calls[question]()
        return time.thread_time() - begin


def of_trimesh(options: Options, objects: int, question: str) -> Race:
    children = {name: InChild(Trimesh, name, objects) for name in ("collide", "python-fcl")}
    tasks = {name: lambda c=child: Seconds(c.call("seconds", question) or np.nan) for name, child in children.items()}
    return Race(tasks, close=lambda: [child.close() for child in children.values()])


def trimesh_cases(options: Options):
    questions = ("internal", "internal, names", "distance", "other, names", "single")
    sizes = (10,) if options.quick else (10, 100, 1000)
    return grid(objects=sizes if installed(trimesh="trimesh", fcl="fcl") else (), question=questions)


claim = partial(Claim, clock=time.thread_time, turns=15)
CLAIMS = [
    claim("managers", "µs a question to a manager", manager_cases, managers, file="host-managers"),
    claim("trimesh", "µs a question to trimesh's manager", trimesh_cases, of_trimesh, file="host-managers-trimesh"),
]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
