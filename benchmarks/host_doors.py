"""Single calls through the interfaces of python-fcl and coal, beside python-fcl and coal themselves.

    python benchmarks/host_doors.py            # three minutes
    python benchmarks/host_doors.py --quick    # half a minute; no file

doors   µs a call: whether two bodies meet; with one contact, and its place read; the distance, read. Bodies are apart,
        1 cm deep, and 0.35 m from each other's middles. Meshes are surfaces: knots, rough balls, a plate with holes
"""

from __future__ import annotations

import time
from functools import cache, partial
from importlib import import_module

import numpy as np
from inputs import ball, rotations

import collide
from collide.adapters.bench.claims import Claim, Options, Race, grid, installed, main
from collide.adapters.hosts import coal_api
from collide.adapters.peers.hull_facets import triangulate

#: Calls a turn.
CALLS = 40
PAIRS = (
    "box, box", "ball, box", "hull, hull", "capsule, box", "can, box", "rough 1k, knot 1k", "rough 1k, hull",
    "knot 1k, hull", "rough 1k, ball", "plate 2k, capsule", "plate 2k, can", "rough 50k, knot 50k", "rough 50k, box",
    "knot 50k, box", "plate 100k, box",
)
SIZES = {"1k": 1_000, "2k": 2_000, "50k": 50_000, "100k": 100_000}
PEERS = {"python-fcl": "fcl", "coal": "coal"}
ALONG, ROTATION = np.array([0.6, 0.3, 0.74]), rotations(np.array([[0.9, 0.2, -0.1, 0.3]]))[0]


def rings(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The closed surface through rings of points (k, m, 3)."""
    k, m = points.shape[:2]
    i, j = np.arange(k)[:, None], np.arange(m)
    a, b = i * m + j, (i + 1) % k * m + j
    c, d = (i + 1) % k * m + (j + 1) % m, i * m + (j + 1) % m
    facets = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return points.reshape(-1, 3), np.concatenate(facets)


def knot(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A tube along a trefoil knot, of about n facets."""
    sides = 12
    t, angles = np.linspace(0, 2 * np.pi, n // (2 * sides), endpoint=False), np.linspace(0, 2 * np.pi, sides, False)
    middle = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1) / 6
    along = np.roll(middle, -1, axis=0) - np.roll(middle, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(along, [0, 0, 1.0])
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(along, across)
    spokes = np.cos(angles)[None, :, None] * across[:, None] + np.sin(angles)[None, :, None] * up[:, None]
    return rings(middle[:, None] + 0.08 * spokes)


def rough_ball(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A ball of half a metre with dents of up to 1.5 cm, of about n facets."""
    k = np.arange(n // 2 + 2) + 0.5
    height, angle = 1.0 - 2.0 * k / len(k), np.pi * (1.0 + 5.0**0.5) * k
    level = np.sqrt(1.0 - height**2)
    points, facets = triangulate(0.5 * np.stack([level * np.cos(angle), level * np.sin(angle), height], axis=1))
    return points * np.random.default_rng(0).uniform(0.97, 1.0, (len(points), 1)), facets


def plate(n: int) -> tuple[np.ndarray, np.ndarray]:
    """A square metre, 4 cm thick, with nine round holes, of about n facets."""
    m = int(np.sqrt(n / 4 * 1.25))
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, m), np.linspace(-0.5, 0.5, m), indexing="ij")
    layers = [np.stack([x, y, np.full_like(x, z)], axis=-1).reshape(-1, 3) for z in (-0.02, 0.02)]
    i, j = np.meshgrid(np.arange(m - 1), np.arange(m - 1), indexing="ij")
    middles = np.stack([(i + 0.5) / (m - 1) - 0.5, (j + 0.5) / (m - 1) - 0.5], axis=-1)
    holes = np.stack(np.meshgrid([-0.3, 0.0, 0.3], [-0.3, 0.0, 0.3]), axis=-1).reshape(-1, 2)
    solid = (np.linalg.norm(middles[:, :, None] - holes, axis=-1) > 0.08).all(axis=-1)
    a = (i * m + j)[solid]
    top = np.concatenate([np.stack([a, a + m, a + m + 1], 1), np.stack([a, a + m + 1, a + 1], 1)])
    edges = np.concatenate([top[:, [0, 1]], top[:, [1, 2]], top[:, [2, 0]]])
    keys, back = edges[:, 0] * m * m + edges[:, 1], edges[:, 1] * m * m + edges[:, 0]
    p, q = edges[~np.isin(back, keys)].T
    walls = np.concatenate([np.stack([p + m * m, p, q], 1), np.stack([p + m * m, q, q + m * m], 1)])
    return np.concatenate(layers), np.concatenate([top + m * m, top[:, ::-1], walls])


@cache
def surface(name: str) -> tuple[np.ndarray, np.ndarray]:
    kind, size = name.split()
    return {"knot": knot, "rough": rough_ball, "plate": plate}[kind](SIZES[size])


def hull_of(module):
    points, facets = triangulate(0.5 * ball(100))
    if not hasattr(module, "Transform3s"):
        return module.Convex(points, len(facets), np.column_stack([np.full(len(facets), 3), facets]).ravel())
    vertices, triangles = module.StdVec_Vec3s(), module.StdVec_Triangle()
    for point in points:
        vertices.append(point)
    for facet in facets.tolist():
        triangles.append(module.Triangle(*facet))
    return module.Convex(vertices, triangles)


@cache
def geometry(module, name: str):
    """A geometry of python-fcl's interface or of coal's."""
    if name == "hull":
        return hull_of(module)
    if " " not in name:
        return {"box": lambda: module.Box(0.7, 0.6, 0.5), "ball": lambda: module.Sphere(0.35),
                "capsule": lambda: module.Capsule(0.25, 0.6), "can": lambda: module.Cylinder(0.3, 0.6)}[name]()
    vertices, facets = surface(name)
    if hasattr(module, "Transform3s"):
        model = module.BVHModelOBBRSS()
        model.beginModel(len(facets), len(vertices))
        model.addVertices(vertices)
        model.addTriangles(facets)
    else:
        model = module.BVHModel()
        model.beginModel(len(facets), len(vertices))
        model.addSubModel(vertices, facets)
    model.endModel()
    return model


@cache
def places(pair: str) -> dict[str, np.ndarray]:
    """Where the second body stands [m]; 1 cm deep by bisection along a line."""
    a, b = (geometry(coal_api, name)._shape for name in pair.split(", "))
    apart, meeting = 1.6, 0.2
    for _ in range(40):
        middle = 0.5 * (apart + meeting)
        meets = collide.collide(a, b, np.eye(4), collide.pose(middle * ALONG) @ np.block([
            [ROTATION, np.zeros((3, 1))], [np.zeros((1, 3)), np.ones((1, 1))]
        ]))
        apart, meeting = (apart, middle) if meets else (middle, meeting)
    return {"apart": 1.6 * ALONG, "1 cm deep": (meeting - 0.01) * ALONG, "deep": 0.35 * ALONG}


def call_of(module, pair: str, t: np.ndarray, question: str):
    """CALLS calls of a question in a row, as a program of that host asks."""
    a, b = (geometry(module, name) for name in pair.split(", "))
    if hasattr(module, "Transform3s"):
        who = a, module.Transform3s(), b, module.Transform3s(ROTATION, t)
        result = module.DistanceResult() if question == "distance" else module.CollisionResult()
        request = module.DistanceRequest() if question == "distance" else module.CollisionRequest()
        new, contact = (lambda: result.clear() or result), lambda r: r.getContact(0).pos
    else:
        who = module.CollisionObject(a), module.CollisionObject(b, module.Transform(ROTATION, t))
        new = module.DistanceResult if question == "distance" else module.CollisionResult
        request = module.DistanceRequest(True) if question == "distance" else module.CollisionRequest(
            1, question == "contact")
        contact = lambda r: r.contacts[0].pos

    def calls() -> None:
        for _ in range(CALLS):
            into = new()
            if question == "distance":
                module.distance(*who, request, into)
                into.min_distance  # noqa: B018 - reads it
            elif module.collide(*who, request, into) and question == "contact":
                contact(into)

    return calls


def doors(options: Options, host: str, pair: str, where: str, question: str) -> Race:
    stand_in = import_module("collide.adapters.hosts." + ("fcl_api" if host == "python-fcl" else "coal_api"))
    tasks = {name: call_of(module, pair, places(pair)[where], question)
             for name, module in (("collide", stand_in), (host, import_module(PEERS[host])))}
    return Race(tasks, CALLS)


def door_cases(options: Options):
    pairs = PAIRS[:8:3] if options.quick else PAIRS
    yield from grid(host=installed(**PEERS), pair=pairs, where=("apart", "1 cm deep", "deep"),
                    question=("boolean", "contact", "distance"))


claim = partial(Claim, clock=time.thread_time, turns=15, seconds=0.6)
CLAIMS = [claim("doors", "µs a call", door_cases, doors, file="host-doors")]


if __name__ == "__main__":
    main(__doc__, CLAIMS)
