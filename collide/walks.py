"""The walk of Barba and Langerman from Python: which body plays which part, and what it leaves open.

Polytopes only. The body that has an interior plays R, whose polar is prepared; B where both have one. Where neither
has, the default narrowphase answers. What the walk cannot prove clear of rounding it hands over to the default
narrowphase too, which settles it exactly.
"""

from __future__ import annotations

import numpy as np

from collide.errors import InvalidArgument, UnsupportedQuery
from collide.geometry.packing import POINTS
from collide.narrowphase.barba_langerman.bodies import WalkBody
from collide.narrowphase.barba_langerman.run import TracedRound, no_walks, run_walks
from collide.narrowphase.barba_langerman.walk import APART, MEETING, OPEN_MEETING
from collide.shapes.base import Shape, is_plain


class Walks:
    """Answers of the walk, a row a pose.

    hit : (n,) bool.
    walked : (n,) bool, whether the walk proved the answer; elsewhere the default narrowphase gave it.
    rows : (n,) `WALK_DTYPE`: rounds, constant-size tests, small linear programs and their pivots, levels reached, and
        the plane or the point that proves the answer. Zeros where neither body has an interior.
    exchanged : A plays R, and B plays P, since B has no interior.
    depth_p, depth_q : levels of P's hierarchy and of that of Q = ρ0(R); 0 where neither body has an interior.
    trace : of the last pose, where it was asked for: its rounds one by one.
    """

    __slots__ = ("_question", "depth_p", "depth_q", "exchanged", "hit", "rows", "trace", "walked")

    def __init__(self, question, hit, rows, exchanged, depths, trace):
        self._question, self.hit, self.rows, self.exchanged, self.trace = question, hit, rows, exchanged, trace
        self.walked = rows["said"] >= APART
        self.depth_p, self.depth_q = depths

    def __len__(self) -> int:
        return len(self.hit)

    @property
    def certificate(self):
        """Of a single pose, plain data that proves the boolean: vertex pairs, as `distance` has them.

        Found from the vertices where the walk ended, in integers; ``collide.verify(A, B, X_WA, X_WB, found)``
        checks it against all vertices. The plane or the point in ``rows`` proves the answer too, in doubles.
        """
        from collide.certificates import certificate_from

        if len(self) != 1:
            raise InvalidArgument(f"a certificate is for one pose, and there are {len(self)}")
        A, B, X_WA, X_WB = self._question
        row, hit = self.rows[0], bool(self.hit[0])
        size_a, size_b = len(walk_body(A).points), len(walk_body(B).points)
        size_p = size_b if self.exchanged else size_a
        own = int(row["vertex_p"]) if row["vertex_p"] < size_p else 0
        corners = dict.fromkeys(row["corners"].tolist()) if row["said"] in (MEETING, OPEN_MEETING) else (0,)
        pairs = [(c, own) if self.exchanged else (own, c) for c in corners]
        return certificate_from(A, B, X_WA[0], X_WB[0], pairs, hit=hit)

    def __repr__(self) -> str:
        return f"Walks(<{len(self)} poses>, hits={int(self.hit.sum())}, walked={int(self.walked.sum())})"


def walk_body(shape: Shape) -> WalkBody:
    """What the walk keeps of a shape, made once. Raises UnsupportedQuery for all but polytopes."""
    if not isinstance(shape, Shape):
        raise InvalidArgument(f'algorithm="barba-langerman" takes two shapes, got {type(shape).__name__}')
    try:
        return shape._walk
    except AttributeError:
        pass
    name = type(shape).__name__
    if not is_plain(shape):
        raise UnsupportedQuery(f'{name}: algorithm="barba-langerman" takes one convex polytope, not a union')
    packed = shape.parts()[0][0]
    if packed.kind != POINTS or packed.radius != 0.0:
        raise UnsupportedQuery(
            f'{name}: algorithm="barba-langerman" takes convex polytopes (ConvexHull without a radius, Box, HPolytope); '
            "leave the algorithm out"
        )
    body = WalkBody(packed.points, getattr(shape, "_hull", None))
    object.__setattr__(shape, "_walk", body)
    return body


def walk_poses(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, answer_open, *, trace: bool = False) -> Walks:
    """Answers for poses (n, 4, 4) or (1, 4, 4), checked by the caller.

    answer_open : called with the numbers of the poses that the walk leaves open; gives their booleans.
    """
    first, second = walk_body(A), walk_body(B)
    n = max(len(X_WA), len(X_WB)) if min(len(X_WA), len(X_WB)) else 0
    exchanged = second.polar is None
    if exchanged and first.polar is None:
        rows, depths = no_walks(n), (0, 0)
        rounds: tuple[TracedRound, ...] = ()
    else:
        P, R = (B, A) if exchanged else (A, B)
        X_WP, X_WR = (X_WB, X_WA) if exchanged else (X_WA, X_WB)
        body_p, body_r = walk_body(P), walk_body(R)
        rows, rounds = run_walks(
            body_p, body_r, P.parts()[0][0], R.parts()[0][0], np.broadcast_to(X_WP, (n, 4, 4)),
            np.broadcast_to(X_WR, (n, 4, 4)), trace=trace,
        )  # fmt: skip
        depths = body_p.ladder.depth, body_r.depth_of_polar
    hit = rows["said"] == MEETING
    found = Walks((A, B, X_WA, X_WB), hit, rows, exchanged, depths, rounds)
    if not found.walked.all():
        left = np.flatnonzero(~found.walked)
        hit[left] = answer_open(left)
    return found
