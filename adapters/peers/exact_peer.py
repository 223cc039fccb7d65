"""Exact arithmetic as an engine: polytopes, spheres, capsules and meshes, judged without rounding.

Bodies enter as the doubles they are, poses entry by entry. Cylinders, cones, ellipsoids and
half-spaces have no exact answer here: not judged. Of meshes that meet no depth is known.
"""

from __future__ import annotations

import math

from collide.adapters.peers.protocol import PairwisePeer, Reply
from collide.adapters.peers.question import Body, corners
from collide.errors import UnsupportedQuery
from collide.shapes import Compound, HPolytope, Mesh, Shape

#: The note of a pair in which no surfaces meet: one body, or a part of it, is inside the other.
INSIDE = "one lies inside the other"
#: Pairs of facets that are looked at without complaint.
MOST_PAIRS = 4_000_000_000


class ExactPeer(PairwisePeer):
    """`collide.adapters.peers.exact` behind the protocol; the distance is its Decimal, rounded once."""

    name = "exact"

    def refuses(self, part: Shape) -> str | None:
        return None if isinstance(part, Mesh) or corners(part) else f"not judged: {type(part).__name__} has no exact form here"

    def build(self, part: Shape) -> tuple | Mesh:
        if isinstance(part, Mesh):
            return part
        found = corners(part)
        if found is None:
            raise UnsupportedQuery(str(self.refuses(part)))
        return found

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        from collide.adapters.peers import exact

        if isinstance(A, Mesh) or isinstance(B, Mesh):
            return _with_mesh(A, X_WA, B, X_WB)
        (P, radius_a), (Q, radius_b) = A, B
        pair = P, X_WA[:3, :3], X_WA[:3, 3], Q, X_WB[:3, :3], X_WB[:3, 3]
        hit = exact.hit(*pair, radius_a=radius_a, radius_b=radius_b)
        distance = exact.signed_distance(*pair, radius_a=radius_a, radius_b=radius_b)
        return Reply(hit, float(distance), certified=True)


def _with_mesh(A, X_WA, B, X_WB) -> Reply:
    from collide.adapters.peers import exact_meshes

    if math.prod(len(body.faces) if isinstance(body, Mesh) else 1 for body in (A, B)) > MOST_PAIRS:
        raise UnsupportedQuery("not judged: so many facets would take exact arithmetic in Python too long")
    a, b = (
        exact_meshes.mesh_cells(body.vertices, body.faces, body.solid, X) if isinstance(body, Mesh)
        else exact_meshes.convex_cells(body[0], body[1], X)
        for body, X in ((A, X_WA), (B, X_WB))
    )  # fmt: skip
    verdict = exact_meshes.judge(a, b)
    if verdict.hit:
        return Reply(True, certified=True, note="" if verdict.surfaces else INSIDE)
    assert verdict.distance is not None
    return Reply(False, verdict.distance, certified=True)


def is_rounded(body: Body) -> bool:
    """True where what exact arithmetic sees of a body is itself rounded once.

    Corners of an HPolytope and poses of parts in a Compound are: verdicts nearer to touching than
    that rounding say nothing.
    """
    return isinstance(body.shape, Compound | HPolytope)
