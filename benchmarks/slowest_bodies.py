"""Bodies, placements and questions of `slowest_calls.py`: everything that is asked, made from a line of text.

A case is a line "question A B ratio place": bodies are "kind" or "kind:size", about a metre across; B is ``ratio``
times as large. Along one direction, by their extents: far (10 sizes apart), near (a gap of a hundredth of the smaller),
touching, deep (a third of the smaller within the other), inside (centre in centre).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

import collide
from collide.robots.kinematic_tree import Joint
from collide.robots.robot import LinkShape

PLACES = ("far", "near", "touching", "deep", "inside")
#: The direction from A to B, and the turns of both: nothing is parallel to anything.
ALONG = np.array([0.6, 0.48, 0.64])
TURN_A, TURN_B = (0.3, -0.2, 0.5), (-0.4, 0.7, 0.1)


def ball_facets(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a ball of 20 · 4^k facets, the least that are so many."""
    t = (1 + 5**0.5) / 2
    signs = [(-1, t), (1, t), (-1, -t), (1, -t)]
    vertices = np.array([np.roll((a, b, 0), shift) for shift in range(3) for a, b in signs], dtype=float)
    vertices /= 2 * np.linalg.norm(vertices, axis=1)[:, None]
    vertices, faces = collide.tessellate(collide.ConvexHull(vertices))
    while len(faces) < size:
        edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].transpose(1, 0, 2).reshape(-1, 2), axis=1)
        unique, which = np.unique(edges, axis=0, return_inverse=True)
        a, b, c = len(vertices) + which.reshape(3, -1)
        middles = vertices[unique].sum(axis=1)
        vertices = np.concatenate([vertices, middles / (2 * np.linalg.norm(middles, axis=1)[:, None])])
        i, j, k = faces.T
        faces = np.concatenate([np.stack(f, axis=1) for f in ((i, a, c), (j, b, a), (k, c, b), (a, b, c))])
    return vertices, faces


def slab_facets(size: int) -> tuple[np.ndarray, np.ndarray]:
    """A flat slab of 1 × 1 × 0.1 m whose six sides are grids; coplanar facets by the thousand."""
    n = max(1, round((size / 4) ** 0.5))
    grid = collide.tessellate(collide.HeightField(np.zeros((n + 1, n + 1)), (1 / n, 1 / n), bottom=-0.1))
    return grid.vertices, grid.faces


def sheet(size: int) -> collide.Mesh:
    """A rough open surface of a metre."""
    n = max(1, round((size / 2) ** 0.5))
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    z = 0.05 * np.sin(9 * x) * np.cos(7 * y)
    at = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = [np.stack([at, at + 1, at + n + 2], axis=1), np.stack([at, at + n + 2, at + n + 1], axis=1)]
    return collide.Mesh(np.stack([x, y, z], axis=-1).reshape(-1, 3), np.concatenate(faces), solid=False)


def hull(size: int) -> collide.ConvexHull:
    points = np.random.default_rng(size).normal(size=(size, 3))
    return collide.ConvexHull(points / (2 * np.linalg.norm(points, axis=1)[:, None]))


def planes(size: int) -> collide.HPolytope:
    normals = np.random.default_rng(size).normal(size=(size, 3))
    return collide.HPolytope(normals / np.linalg.norm(normals, axis=1)[:, None], np.full(size, 0.5))


def clutter(size: int, make: Callable[[float], collide.Shape]) -> collide.Compound:
    """So many small shapes spread over a ball of a metre."""
    rng = np.random.default_rng(size)
    places, turns = rng.normal(size=(size, 3)), rng.uniform(-3, 3, (size, 3))
    places *= (0.5 * rng.uniform(0, 1, size) ** (1 / 3) / np.linalg.norm(places, axis=1))[:, None]
    width = 0.5 / size ** (1 / 3)
    return collide.Compound(
        [(make(width * w), collide.pose(p, rpy=r)) for w, p, r in zip(rng.uniform(0.5, 1, size), places, turns)]
    )


def terrain(size: int) -> collide.HeightField:
    n = max(1, round((size / 4) ** 0.5))
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, n + 1)] * 2)
    return collide.HeightField(0.05 * np.sin(9 * x) * np.cos(7 * y), (1 / n, 1 / n), bottom=-0.3)


_small_mesh = cache(lambda: ball_facets(320))

MAKERS: dict[str, Callable[[int], collide.Shape]] = {
    "box": lambda _: collide.Box((1.0, 0.8, 0.6)), "sphere": lambda _: collide.Sphere(0.5),
    "capsule": lambda _: collide.Capsule(0.2, 0.6), "cylinder": lambda _: collide.Cylinder(0.3, 0.8),
    "cone": lambda _: collide.Cone(0.4, 0.8), "ellipsoid": lambda _: collide.Ellipsoid((0.5, 0.3, 0.2)),
    "halfspace": lambda _: collide.Halfspace((0.0, 0.0, 1.0), 0.0), "hull": hull, "planes": planes,
    "region": lambda _: collide.HPolytope(((1, 0, 0), (0, 1, 0), (0, 0, 1.0)), (0.3, 0.3, 0.3), bounded=False),
    "rounded": lambda size: collide.ConvexHull(0.8 * hull(size).points, radius=0.1),
    "ball": lambda size: collide.Mesh(*ball_facets(size)), "slab": lambda size: collide.Mesh(*slab_facets(size)),
    "sheet": sheet, "terrain": terrain, "boxes": lambda size: clutter(size, lambda w: collide.Box((w, w, w))),
    "balls": lambda size: clutter(size, collide.Sphere),
    "cans": lambda size: clutter(size, lambda w: collide.Cylinder(0.5 * w, w)),
    "meshes": lambda size: clutter(size, lambda w: collide.Mesh(w * _small_mesh()[0], _small_mesh()[1])),
}
#: Sizes that are tried, of kinds that have any: facets, points, planes, or parts.
SIZES = {
    **dict.fromkeys(("hull", "rounded"), (10, 1000, 100_000)), "planes": (10, 300),
    **dict.fromkeys(("ball", "slab", "sheet", "terrain"), (300, 10_000, 80_000)),
    **dict.fromkeys(("boxes", "balls", "cans"), (3, 100, 1000)), "meshes": (3, 100, 1000),
}
RATIOS = (1e-7, 1e-2, 1.0, 1e2, 1e7)


def all_bodies() -> list[str]:
    return [f"{kind}:{size}" if size else kind for kind in MAKERS for size in SIZES.get(kind, (0,))]


@cache
def body(name: str, ratio: float = 1.0) -> collide.Shape:
    """The shape of a name, so many times as large."""
    kind, _, size = name.partition(":")
    shape = MAKERS[kind](int(size or 0))
    return shape if ratio == 1.0 else scaled(shape, ratio)


def scaled(shape: collide.Shape, s: float) -> collide.Shape:
    if isinstance(shape, collide.Compound):
        items = [(scaled(part, s), collide.pose(s * X[:3, 3]) @ _rotation_of(X)) for part, X in shape.items]
        return collide.Compound(items)
    if isinstance(shape, collide.HeightField):
        return collide.HeightField(s * shape.heights, s * np.asarray(shape.cell), bottom=s * shape.bottom)
    if isinstance(shape, collide.Mesh):
        return collide.Mesh(s * shape.vertices, shape.faces, solid=shape.solid)
    if isinstance(shape, collide.ConvexHull):
        return collide.ConvexHull(s * shape.points, radius=s * shape.radius)
    if isinstance(shape, collide.HPolytope):
        return collide.HPolytope(shape.normals, s * shape.offsets, bounded=not shape.is_region)
    if isinstance(shape, collide.Halfspace):
        return collide.Halfspace(shape.normal, s * shape.offset)
    return type(shape)(*(s * getattr(shape, field) for field in shape._fields))


def _rotation_of(X: np.ndarray) -> np.ndarray:
    R = X.copy()
    R[:3, 3] = 0.0
    return R


@cache
def _extent(name: str, ratio: float, back: bool) -> float:
    """How far a turned body reaches along ALONG, or against it [m]; unbounded ones reach nowhere."""
    kind = name.partition(":")[0]
    if kind in ("halfspace", "region"):
        return 0.0
    R = collide.pose((0, 0, 0), rpy=TURN_B if back else TURN_A)[:3, :3]
    shape = body(name)
    points = shape.points if isinstance(shape, collide.ConvexHull) else collide.tessellate(shape).vertices
    return ratio * float((points @ R.T @ (-ALONG if back else ALONG)).max())


def placed(A: str, B: str, ratio: float, place: str) -> tuple[np.ndarray, np.ndarray]:
    """X_WA, X_WB."""
    smaller = min(1.0, ratio)
    reach = _extent(A, 1.0, False) + _extent(B, ratio, True)
    apart = {
        "far": reach + 10 * max(1.0, ratio), "near": reach + 0.01 * smaller, "touching": reach,
        "deep": reach - 0.33 * smaller, "inside": 0.01 * smaller,
    }[place]
    return collide.pose((0, 0, 0), rpy=TURN_A), collide.pose(apart * ALONG, rpy=TURN_B)


# --- questions ----------------------------------------------------------------------------------


def _impact(A, B, X, Y, small: float):
    moved = Y.copy()
    moved[:3, 3] -= 2.0 * np.linalg.norm(Y[:3, 3]) * ALONG
    return collide.time_of_impact(A, B, X, X, Y, moved)


def _rays(A, B, X, Y, small: float):
    """Ten rays from around B's origin at A."""
    aside = small * np.random.default_rng(0).normal(size=(10, 3))
    return collide.raycast(A, X, Y[:3, 3] + aside, np.tile(-ALONG, (10, 1)))


def _rays_through(A, B, X, Y, small: float):
    return collide.raycast(A, X, Y[:3, 3] + np.zeros((1, 3)), -ALONG[None], all_hits=True)


def _points(A, B, X, Y, small: float):
    return collide.contains(A, X, Y[:3, 3] + small * np.random.default_rng(0).normal(size=(10, 3)))


def _world_of(A, B, X, Y) -> collide.World:
    """A built World of the pair, B moved to its pose; of A alone without B."""
    world = _worlds.get((id(A), id(B)))
    if world is None:
        world = _worlds[id(A), id(B)] = collide.World()
        for shape, pose in ((A, X), (B, Y)):
            if shape is not None:
                world.add(shape, pose)
    if B is not None:
        world.set_pose(world.ids[1], Y)
    return world


def _world(question: str) -> Callable:
    return lambda A, B, X, Y, small: getattr(_world_of(A, B, X, Y), question)()


def _world_nearest(A, B, X, Y, small: float):
    return _world_of(A, B, X, Y).nearest(Y[None, :3, 3])


def _world_within(A, B, X, Y, small: float):
    return _world_of(A, B, X, Y).distances(0.05 * small)


def _world_rays(all_hits: bool) -> Callable:
    def ask(A, B, X, Y, small: float):
        aside = small * np.random.default_rng(0).normal(size=(10, 3))
        return _world_of(A, B, X, Y).raycast(Y[:3, 3] + aside, np.tile(-ALONG, (10, 1)), all_hits=all_hits)

    return ask


def _world_cast(A, B, X, Y, small: float):
    """B moved at a World of A."""
    return _world_of(A, None, X, X).shape_cast(B, Y, -ALONG)


def _world_query(A, B, X, Y, small: float):
    """B from outside, asked of a World of A."""
    return _world_of(A, None, X, X).query(B, Y, 0.05 * small)


def _verify(A, B, X, Y, small: float):
    """A result with its certificate, checked; pairs that have none are asked the distance only."""
    row = collide.distance(A, B, X, Y)
    certificate = row.certificate
    return None if certificate is None else collide.verify(A, B, X, Y, row, certificate=certificate)


def _certify_motion(A, B, X, Y, small: float):
    """B on a slide past A, by six sizes of the smaller across ALONG, proven free or not."""
    checker = _checkers.get((id(A), id(B), X.tobytes(), Y.tobytes()))
    if checker is None:
        slide = Joint("slide", "prismatic", "base", "body", np.eye(4), (0.8, -0.36, -0.48), -1e9, 1e9)
        geometry = {"body": [LinkShape(B, Y, None, "")]}
        robot = collide.Robot("slide", ["base", "body"], [slide], geometry)
        world = collide.World()
        world.add(A, X)
        checker = _checkers[id(A), id(B), X.tobytes(), Y.tobytes()] = collide.RobotChecker(robot, world)
    return checker.certify_edges(np.array([[-3.0 * small]]), np.array([[3.0 * small]]), resolution=0.01 * small)


#: Worlds and checkers of pairs, kept so that each call is that of one that is built.
_worlds: dict[tuple[int, int], collide.World] = {}
_checkers: dict[tuple, collide.RobotChecker] = {}

#: What is asked of shapes A, B at poses X, Y; ``small`` is the size of the smaller [m].
QUESTIONS: dict[str, Callable] = {
    "collide": lambda A, B, X, Y, small: collide.collide(A, B, X, Y),
    "distance": lambda A, B, X, Y, small: collide.distance(A, B, X, Y),
    "gap": lambda A, B, X, Y, small: collide.distance(A, B, X, Y, signed=False),
    "within": lambda A, B, X, Y, small: collide.distance(A, B, X, Y, max_distance=0.05 * small),
    "contacts": lambda A, B, X, Y, small: collide.contacts(A, B, X, Y),
    "contacts_margin": lambda A, B, X, Y, small: collide.contacts(A, B, X, Y, margin=0.02 * small),
    "impact": _impact,
    "shape_cast": lambda A, B, X, Y, small: collide.shape_cast(B, Y, -ALONG, A, X),
    "rays": _rays, "rays_through": _rays_through, "contains": _points,
    "certify": lambda A, B, X, Y, small: collide.distance(A, B, X, Y).certificate,
    "facet_pairs": lambda A, B, X, Y, small: collide.facet_pairs(A, B, X, Y),
    "world_collides": _world("collides"), "world_distances": _world("distances"), "world_contacts": _world("contacts"),
    "world_minimum": _world("minimum"), "world_nearest": _world_nearest, "world_collisions": _world("collisions"),
    "world_overlaps": _world("overlaps"), "world_within": _world_within, "world_rays": _world_rays(False),
    "world_rays_through": _world_rays(True), "world_cast": _world_cast, "world_query": _world_query,
    "verify": _verify, "certify_motion": _certify_motion,
}
#: Questions about A alone, whatever B is.
OF_ONE = frozenset(("rays", "rays_through", "contains"))
