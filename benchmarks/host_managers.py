"""What python-fcl's managers, single calls and trimesh's CollisionManager cost on collide, beside python-fcl.

python benchmarks/host_managers.py [--part managers|calls|trimesh] [--rounds 15] [--objects 10 100 1000 5000]

Both engines answer in one process, in turns; of trimesh, which keeps the fcl that it finds, each in a child process, in
turns, too. Medians of a thread's own time in µs, which other work on the machine lengthens little, and their ratio:
above 1 collide is faster.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable

import host_agreement
import numpy as np

from collide.adapters.hosts import fcl_api

#: Objects a cubic metre: each meets about one other box.
DENSITY = 1.0
#: Single calls: what bodies, and how far apart the overlapping and the separated ones stand [m].
PAIRS = [
    ("Box", "Box"), ("Sphere", "Sphere"), ("Box", "Sphere"), ("Capsule", "Capsule"), ("Capsule", "Box"),
    ("Cylinder", "Box"), ("Cone", "Cone"), ("Ellipsoid", "Box"), ("Convex", "Convex"), ("BVHModel", "Box"),
    ("BVHModel", "BVHModel"), ("BVHModel", "Sphere"),
]  # fmt: skip
PLACES = {"apart": 1.6, "meeting": 0.5}
WAY = np.array([0.6, 0.3, 0.74])


def median_times(contestants: dict[str, Callable[[], object]], rounds: int, repeats: int) -> dict[str, float]:
    """Median microseconds a call, contestants in turns; each round calls each of them ``repeats`` times."""
    spent: dict[str, list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, function in contestants.items():
            begin = time.thread_time()
            for _ in range(repeats):
                function()
            spent[name].append((time.thread_time() - begin) / repeats)
    return {name: 1e6 * statistics.median(times) for name, times in spent.items()}


def show(what: str, times: dict[str, float]) -> None:
    ours, theirs = times["collide"], times["python-fcl"]
    print(f"  {what:44} {ours:10.1f} {theirs:10.1f} {theirs / ours:8.2f}", flush=True)


# --- managers -----------------------------------------------------------------------------------


def scene(fcl, n: int, is_separated: bool, seed: int = 1) -> list:
    """n objects of four kinds in a cube; of separated ones the gaps are as wide as they."""
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(12, 3))
    points *= 0.3 / np.linalg.norm(points, axis=1)[:, None]
    facets = _facets(points)
    shapes = [fcl.Box(0.5, 0.4, 0.3), fcl.Sphere(0.3), fcl.Capsule(0.1, 0.5),
              fcl.Convex(points, len(facets), np.concatenate([[3, *facet] for facet in facets]))]  # fmt: skip
    edge = (n / DENSITY) ** (1 / 3)
    places = rng.uniform(0.0, edge, (n, 3))
    if is_separated:
        side = int(np.ceil(n ** (1 / 3)))
        places = 1.5 * np.stack(np.unravel_index(rng.permutation(side**3)[:n], (side,) * 3), axis=1)
    quaternions = rng.normal(size=(n, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1)[:, None]
    return [fcl.CollisionObject(shapes[k % 4], fcl.Transform(quaternions[k], places[k])) for k in range(n)]


def _facets(points: np.ndarray) -> list[list[int]]:
    """Triangles of the hull of a few points in general position: those with all others behind them."""
    n, facets = len(points), []
    for i in range(n):
        for j in range(i + 1, n):
            for k in range(j + 1, n):
                normal = np.cross(points[j] - points[i], points[k] - points[i])
                sides = (points - points[i]) @ normal
                sides[[i, j, k]] = 0.0
                if (sides <= 0.0).all():
                    facets.append([i, j, k])
                elif (sides >= 0.0).all():
                    facets.append([i, k, j])
    return facets


class Managed:
    """Questions to one engine's manager."""

    def __init__(self, fcl, n: int, is_separated: bool):
        self.fcl = fcl
        self.objects = scene(fcl, n, is_separated)
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects(self.objects)
        self.manager.setup()
        middle = np.mean([obj.getTranslation() for obj in self.objects], axis=0)
        self.guest = fcl.CollisionObject(fcl.Sphere(0.4), fcl.Transform(middle))

    def _asked(self, *who, contacts: bool = False, limit: int = 10**6):
        cdata = self.fcl.CollisionData(self.fcl.CollisionRequest(limit, contacts))
        self.manager.collide(*who, cdata, self.fcl.defaultCollisionCallback)
        return len(cdata.result.contacts)

    def any_pair(self):
        return self._asked(limit=1)

    def all_pairs(self):
        return self._asked()

    def all_contacts(self):
        return self._asked(contacts=True)

    def own_callback(self):
        self.manager.collide(None, lambda a, b, cdata: False)

    def all_moved(self):
        for obj in self.objects:
            obj.setTranslation(obj.getTranslation())
        self.manager.update()
        return self._asked()

    def one_to_all(self):
        return self._asked(self.guest)

    def least_distance(self):
        cdata = self.fcl.DistanceData()
        self.manager.distance(cdata, self.fcl.defaultDistanceCallback)
        return cdata.result.min_distance

    def distance_of_one(self):
        cdata = self.fcl.DistanceData()
        self.manager.distance(self.guest, cdata, self.fcl.defaultDistanceCallback)
        return cdata.result.min_distance


def managers(sizes: list[int], rounds: int) -> None:
    import fcl

    for n in sizes:
        for is_separated in (False, True):
            engines = {"collide": Managed(fcl_api, n, is_separated), "python-fcl": Managed(fcl, n, is_separated)}
            print(f"{n} objects, {'apart' if is_separated else 'crowded'}: collide, python-fcl [µs], ratio")
            names = ["any_pair", "all_pairs", "all_contacts", "own_callback", "all_moved", "one_to_all"]
            names += ["least_distance", "distance_of_one"]
            for name in names:
                questions = {key: getattr(engine, name) for key, engine in engines.items()}
                begin = time.perf_counter()
                replies = {key: question() for key, question in questions.items()}
                repeats = max(1, min(50, int(0.01 / (time.perf_counter() - begin))))
                difference = "" if replies["collide"] == replies["python-fcl"] else f" {replies}"
                show(name.replace("_", " ") + difference, median_times(questions, rounds, repeats))


# --- single calls -------------------------------------------------------------------------------


def calls(rounds: int) -> None:
    import fcl

    q = np.random.default_rng(0).normal(size=4)
    q /= np.linalg.norm(q)
    print("single calls: collide, python-fcl [µs], ratio")
    for kinds in PAIRS:
        for place, way in PLACES.items():
            questions: dict[str, dict[str, Callable]] = {"collide": {}, "one contact": {}, "distance": {}}
            for name, module in (("collide", fcl_api), ("python-fcl", fcl)):
                shapes = [host_agreement.geometry(module, kind, np.array([0.8, 0.9, 1.0])) for kind in kinds]
                a = module.CollisionObject(shapes[0])
                b = module.CollisionObject(shapes[1], module.Transform(q, way * WAY))
                for what, function in single_calls(module, a, b).items():
                    questions[what][name] = function
            for what, contestants in questions.items():
                show(f"{what} of {'–'.join(kinds)}, {place}", median_times(contestants, rounds, 100))


def single_calls(fcl, a, b) -> dict[str, Callable]:
    """What is asked of two objects."""
    request, near = fcl.CollisionRequest(1, True), fcl.DistanceRequest(True)

    def one_contact():
        fcl.collide(a, b, request, fcl.CollisionResult())

    def distance():
        fcl.distance(a, b, near, fcl.DistanceResult())

    return {"collide": lambda: fcl.collide(a, b), "one contact": one_contact, "distance": distance}


# --- trimesh ------------------------------------------------------------------------------------


def trimesh_times(n: int, rounds: int) -> dict[str, float]:
    """Median microseconds of each question to trimesh's manager, with the fcl that it finds."""
    import trimesh
    from trimesh.collision import CollisionManager

    rng = np.random.default_rng(3)
    meshes = [trimesh.creation.icosphere(2, 0.3), trimesh.creation.annulus(0.1, 0.3, 0.3)]
    manager, guests = CollisionManager(), CollisionManager()
    edge = (n / DENSITY) ** (1 / 3)
    for k in range(n):
        X = trimesh.transformations.random_rotation_matrix(rng.random(3))
        X[:3, 3] = rng.uniform(0.0, edge, 3)
        manager.add_object(f"body {k}", meshes[k % 2], X)
        if k % 5 == 0:
            X = X.copy()
            X[:3, 3] += 0.2
            guests.add_object(f"guest {k}", meshes[(k + 1) % 2], X)
    names = manager.in_collision_internal(return_names=True)[1]
    questions = {
        "in_collision_internal": manager.in_collision_internal,
        "with names": lambda: manager.in_collision_internal(return_names=True),
        "min_distance_internal": manager.min_distance_internal,
        "in_collision_other, with names": lambda: manager.in_collision_other(guests, return_names=True),
        "in_collision_single": lambda: manager.in_collision_single(meshes[0], np.eye(4)),
    }
    times = {name: median_times({name: function}, rounds, 1)[name] for name, function in questions.items()}
    return times | {"pairs": len(names)}


def trimesh_managers(sizes: list[int], rounds: int) -> None:
    for n in sizes:
        runs: dict[str, list[dict]] = {"collide": [], "python-fcl": []}
        for _ in range(3):
            for engine, replies in runs.items():
                command = [sys.executable, __file__, "--child", engine, "--objects", str(n), "--rounds", str(rounds)]
                done = subprocess.run(command, capture_output=True, text=True, check=True)
                replies.append(json.loads(done.stdout.split("TIMES")[1]))
        pairs = {engine: replies[0]["pairs"] for engine, replies in runs.items()}
        print(f"trimesh, {n} bodies, pairs that meet {pairs}: collide, python-fcl [µs], ratio")
        for what in runs["collide"][0]:
            if what != "pairs":
                show(what, {engine: statistics.median(r[what] for r in replies) for engine, replies in runs.items()})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", choices=("managers", "calls", "trimesh"))
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--objects", type=int, nargs="+", default=[10, 100, 1000, 5000])
    parser.add_argument("--child", help="answer for trimesh with this engine, as JSON")
    arguments = parser.parse_args()
    if arguments.child:
        if arguments.child == "collide":
            fcl_api.install()
        print("TIMES", json.dumps(trimesh_times(arguments.objects[0], arguments.rounds)))
        return
    if arguments.part in (None, "managers"):
        managers(arguments.objects, arguments.rounds)
    if arguments.part in (None, "calls"):
        calls(arguments.rounds)
    if arguments.part in (None, "trimesh"):
        trimesh_managers([n for n in arguments.objects if n <= 1000], 5)


if __name__ == "__main__":
    main()
