"""Exact arithmetic as an engine: polytopes, spheres and capsules, judged without rounding.

Bodies enter as the doubles they are, poses entry by entry. Cylinders, cones, ellipsoids and
half-spaces have no exact answer here: not judged.
"""

from __future__ import annotations

from collide.adapters.peers.protocol import PairwisePeer, Reply
from collide.adapters.peers.question import Body, corners
from collide.errors import UnsupportedQuery
from collide.shapes import Compound, HPolytope, Shape


class ExactPeer(PairwisePeer):
    """`collide.adapters.peers.exact` behind the protocol; the distance is its Decimal, rounded once."""

    name = "exact"

    def refuses(self, part: Shape) -> str | None:
        return None if corners(part) else f"not judged: {type(part).__name__} has no exact form here"

    def build(self, part: Shape) -> tuple:
        found = corners(part)
        if found is None:
            raise UnsupportedQuery(str(self.refuses(part)))
        return found

    def ask(self, A, X_WA, B, X_WB) -> Reply:
        from collide.adapters.peers import exact

        (P, radius_a), (Q, radius_b) = A, B
        pair = P, X_WA[:3, :3], X_WA[:3, 3], Q, X_WB[:3, :3], X_WB[:3, 3]
        hit = exact.hit(*pair, radius_a=radius_a, radius_b=radius_b)
        distance = exact.signed_distance(*pair, radius_a=radius_a, radius_b=radius_b)
        return Reply(hit, float(distance), certified=True)


def is_rounded(body: Body) -> bool:
    """True where what exact arithmetic sees of a body is itself rounded once.

    Corners of an HPolytope and poses of parts in a Compound are: verdicts nearer to touching than
    that rounding say nothing.
    """
    return isinstance(body.shape, Compound | HPolytope)
