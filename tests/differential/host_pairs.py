"""Random pairs of bodies, a quarter of them on a grid, where bodies touch, as geometries of python-fcl and coal."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

import numpy as np

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
FACETS = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
    [1, 5, 7], [1, 7, 3],
]
KINDS = ("Box", "Sphere", "Capsule", "Cylinder", "Ellipsoid", "Convex", "Cone", "BVHModel")
#: Sets of infinite extent that take the place of the second body of every eighth pair with coal.
FLAT = ("Halfspace", "Plane")


def calls(n: int, seed: int, kinds: tuple[str, ...] = KINDS, flat: bool = False) -> Iterator[list]:
    """(kind, lengths, rotation, translation) of both bodies."""
    rng = np.random.default_rng(seed)
    for k in range(n):
        pair = []
        for _ in range(2):
            kind = kinds[rng.integers(len(kinds))]
            R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            s, t = rng.uniform(0.2, 1.0, 3), rng.uniform(-0.6, 0.6, 3)
            if k % 4 == 0:
                R, s, t = np.eye(3), np.round(4 * s + 0.5) / 4, np.round(4 * t) / 4
            pair.append((kind, s, R * np.sign(np.linalg.det(R)), t))
        if flat and k % 8 == 1:
            pair[1] = (FLAT[k // 8 % 2], *pair[1][1:])
        yield pair


def _common(module, kind: str, s: np.ndarray):
    """What both have alike, of a kind and three lengths."""
    if kind in FLAT:
        return getattr(module, kind)(s / np.linalg.norm(s), 0.1)
    if kind == "Sphere":
        return module.Sphere(s[0] / 2)
    if kind in ("Capsule", "Cylinder", "Cone"):
        return getattr(module, kind)(s[0] / 2, s[1])
    return module.Box(*s) if kind == "Box" else module.Ellipsoid(*(s / 2))


def fcl_geometry(fcl, kind: str, s: np.ndarray):
    """python-fcl's."""
    if kind == "Convex":
        return fcl.Convex(CORNERS * s, 12, np.concatenate([[3, *facet] for facet in FACETS]))
    if kind != "BVHModel":
        return _common(fcl, kind, s)
    model = fcl.BVHModel()
    model.beginModel(12, 8)
    model.addSubModel(CORNERS * s, np.array(FACETS))
    model.endModel()
    return model


def coal_geometry(coal, kind: str, s: np.ndarray):
    """coal's."""
    if kind == "Convex":
        points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
        for point in CORNERS * s:
            points.append(point)
        for facet in FACETS:
            triangles.append(coal.Triangle(*facet))
        return coal.Convex(points, triangles)
    if kind != "BVHModel":
        return _common(coal, kind, s)
    model = coal.BVHModelOBBRSS()
    model.beginModel(12, 8)
    model.addVertices(CORNERS * s)
    model.addTriangles(np.array(FACETS))
    model.endModel()
    return model


class Fcl:
    """python-fcl, or its stand-in, asked: hits, and gaps of pairs apart; hosts may abort, so a child asks them."""

    def __init__(self, module: str):
        self.fcl = import_module(module)

    def answers(self, n: int, seed: int) -> list[tuple[bool, float | None]]:
        fcl, replies = self.fcl, []
        for pair in calls(n, seed):
            a, b = (fcl.CollisionObject(fcl_geometry(fcl, kind, s), fcl.Transform(R, t)) for kind, s, R, t in pair)
            hit = fcl.collide(a, b) > 0
            replies.append((hit, None if hit else float(fcl.distance(a, b))))
        return replies


class Coal:
    """coal, or its stand-in: (hit, hit of Pinocchio's request without contacts, signed distance [m], facets)."""

    def __init__(self, module: str):
        self.coal = import_module(module)

    def answers(self, n: int, seed: int) -> list[tuple[bool, bool, float, tuple[int, int]]]:
        coal, replies = self.coal, []
        for pair in calls(n, seed, flat=True):
            a, b = (coal_geometry(coal, kind, s) for kind, s, _, _ in pair)
            X_a, X_b = (coal.Transform3s(R, t) for _, _, R, t in pair)
            request, no_contact = coal.CollisionRequest(), coal.CollisionRequest()
            no_contact.enable_contact = False
            asked, measured, result = coal.ComputeCollision(a, b), coal.ComputeDistance(a, b), coal.DistanceResult()
            hits = [asked(X_a, X_b, r, coal.CollisionResult()) > 0 for r in (request, no_contact)]
            gap = float(measured(X_a, X_b, coal.DistanceRequest(), result))
            replies.append((*hits, gap, (result.b1, result.b2)))
        return replies
