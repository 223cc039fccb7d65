"""Exact arithmetic as an engine: polytopes, spheres, capsules and meshes, judged without rounding.

Bodies enter as the doubles they are, poses entry by entry, those of parts in a compound multiplied out exactly.
Cylinders, cones, ellipsoids and half-spaces have no exact answer here: not judged. Of meshes that meet no depth is
known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from collide.adapters.peers import exact, exact_meshes
from collide.adapters.peers.answers import Reply
from collide.adapters.peers.protocol import PairwisePeer
from collide.adapters.peers.question import Body, convex_parts, corners
from collide.errors import UnsupportedQuery
from collide.shapes import Compound, HPolytope, Mesh, Shape

#: The note of a pair in which no surfaces meet: one body, or a part of it, is inside the other.
INSIDE = "one lies inside the other"
#: Pairs of facets that are looked at without complaint.
MAX_PAIRS = 4_000_000_000


class ExactPeer(PairwisePeer):
    """`collide.adapters.peers.exact` behind the protocol; the distance is its Decimal, rounded once."""

    name = "exact"
    about = "rational arithmetic in plain Python"
    receives = ("doubles as they are, poses entry by entry",)
    cannot = ("cylinders, cones, ellipsoids, half-spaces", "depths of meshes that meet")

    def refuses(self, part: Shape) -> str | None:
        return (
            None
            if isinstance(part, Mesh) or corners(part)
            else f"not judged: {type(part).__name__} has no exact form here"
        )

    def build(self, part: Shape) -> tuple | Mesh:
        if isinstance(part, Mesh):
            return part
        corner_points = corners(part)
        if corner_points is None:
            raise UnsupportedQuery(str(self.refuses(part)))
        return corner_points

    def parts(self, body: Body) -> Iterator[tuple]:
        """Corners of a compound's parts in its own frame, no pose rounded; meshes where a rounded pose puts them."""
        if not isinstance(body.shape, Compound) or _has(body, Mesh):
            yield from super().parts(body)
            return
        for part, poses in _placed(body.shape, ()):
            built = corners(part)
            if built is None:
                raise UnsupportedQuery(str(self.refuses(part)))
            points, radius = built
            yield (_moved(points, poses), radius), body.X_WB

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        if isinstance(A, Mesh) or isinstance(B, Mesh):
            return _with_mesh(A, X_WA, B, X_WB)
        (P, radius_a), (Q, radius_b) = A, B
        pair = P, X_WA[:3, :3], X_WA[:3, 3], Q, X_WB[:3, :3], X_WB[:3, 3]
        hit = exact.hit(*pair, radius_a=radius_a, radius_b=radius_b)
        distance = exact.signed_distance(*pair, radius_a=radius_a, radius_b=radius_b)
        return Reply(hit, float(distance), certified=True)


def _with_mesh(A, X_WA, B, X_WB) -> Reply:
    if math.prod(len(body.faces) if isinstance(body, Mesh) else 1 for body in (A, B)) > MAX_PAIRS:
        raise UnsupportedQuery("not judged: so many facets would take exact arithmetic in Python too long")
    a, b = (
        exact_meshes.mesh_cells(body.vertices, body.faces, body.solid, X) if isinstance(body, Mesh)
        else exact_meshes.convex_cells(body[0], body[1], X)
        for body, X in ((A, X_WA), (B, X_WB))
    )
    verdict = exact_meshes.judge(a, b)
    if verdict.hit:
        return Reply(True, certified=True, note="" if verdict.surfaces else INSIDE)
    assert verdict.distance is not None
    return Reply(False, verdict.distance, certified=True)


def is_rounded(*bodies: Body) -> bool:
    """True where what exact arithmetic sees of a pair is itself rounded once.

    Corners of an HPolytope are, and poses of parts in a compound where a mesh takes part: verdicts nearer to touching
    than that rounding say nothing.
    """
    meshed = any(_has(body, Mesh) for body in bodies)
    return any(_has(body, HPolytope) or (meshed and isinstance(body.shape, Compound)) for body in bodies)


def _has(body: Body, kind: type) -> bool:
    return any(isinstance(part, kind) for part, _ in convex_parts(body.shape, np.eye(4)))


def _placed(shape: Shape, poses: tuple) -> Iterator[tuple[Shape, tuple]]:
    """The parts of a compound, each with the poses that lead out of it, the innermost first."""
    if isinstance(shape, Compound):
        for part, X in shape.items:
            yield from _placed(part, (X, *poses))
    else:
        yield shape, poses


def _moved(points: np.ndarray, poses: tuple) -> list[list[Fraction]]:
    """Points (n, 3) under poses (4, 4), one after the other, without any rounding."""
    moved = [[Fraction(float(x)) for x in point] for point in points]
    for X in poses:
        rows = [[Fraction(float(x)) for x in row] for row in X[:3]]
        moved = [[sum((a * x for a, x in zip(row, point)), row[3]) for row in rows] for point in moved]
    return moved
