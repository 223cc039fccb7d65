"""The walk of Barba and Langerman from Python: arguments in, answers out.

Polytopes only. The body with an interior plays R, whose polar is prepared; B if both or neither have an interior: a
flat R is thickened for the walk, and the walk's end in integers reads R as given. Answers unproven in doubles are
proven in integers from the walk's last vertices (`exact_end.py`). Walks lost to rounding go to the default narrowphase.
"""

from __future__ import annotations

import numpy as np

from collide.base import argument_checks as checks
from collide.certificates.certificate import VertexPair
from collide.certificates.make_certificate import certificate_from_normal, certificate_from_pairs
from collide.errors import InvalidArgument, UnsupportedQuery
from collide.lowering.packed_convex import POINTS
from collide.lowering.parts import convex_set_of, is_single_convex
from collide.narrowphase.convex_batches import Question
from collide.narrowphase.convex_kernel_calls import number_of_poses
from collide.pairs.batches import answer_batch
from collide.pairs.pair_arguments import asked_poses, pose_batch
from collide.papers.hierarchies.exact_end import ExactEnds, end_exactly, last_corners
from collide.papers.hierarchies.run_walk import no_walks, run_walks
from collide.papers.hierarchies.walk import APART, MEETING, OPEN_APART, OPEN_MEETING
from collide.papers.hierarchies.walk_bodies import WalkBody
from collide.shapes.shape import Shape, checked_shape
from collide.transforms import as_poses


class Walks:
    """Answers of the walk, a row a pose.

    hit : (n,) bool.
    walked : (n,) bool, whether the walk proved the answer; elsewhere the default narrowphase did.
    exact_rounds : (n,) int64, simplices evaluated in integers at the end; 0 where doubles sufficed.
    rows : (n,) `WALK_DTYPE`: rounds, constant-size tests, small linear programs and their pivots, levels reached, and
        the proving plane or point. Zeros where neither body has a polar.
    exchanged : A plays R, and B plays P, since B has no interior.
    depth_p, depth_q : levels of P's hierarchy and of the hierarchy of Q = ρ0(R); 0 where neither body has a polar.
    trace : the rounds of the last pose, where asked for.
    """

    __slots__ = (
        "_ends", "_question", "depth_p", "depth_q", "exact_rounds", "exchanged", "hit", "rows", "trace", "walked",
    )

    def __init__(self, question, hit, rows, exchanged, depths, trace):
        self._question, self.hit, self.rows, self.exchanged, self.trace = question, hit, rows, exchanged, trace
        self.walked = rows["status"] >= APART
        self.exact_rounds = np.zeros(len(rows), dtype=np.int64)
        self.depth_p, self.depth_q = depths
        self._ends: dict[int, list[VertexPair]] = {}

    def _take_ends(self, ids: np.ndarray, ends: ExactEnds) -> None:
        """Enter what integers have proven of the walks of these numbers; the status says which invariant was."""
        proven = ids[ends.proven]
        self.walked[proven] = True
        self.hit[proven] = ends.hit[ends.proven]
        self.exact_rounds[proven] = ends.rounds[ends.proven]
        for k, p, r, count in zip(ids[ends.proven].tolist(), *(
            field[ends.proven].tolist() for field in (ends.vertices_p, ends.vertices_r, ends.counts)
        )):
            self._ends[k] = [(j, i) if self.exchanged else (i, j) for i, j in zip(p[:count], r[:count])]

    def __len__(self) -> int:
        return len(self.hit)

    @property
    def certificate(self):
        """Proof of the boolean of a single pose as plain data: vertex pairs, as of `distance`.

        The walk's own plane where exactly separating ("plane"), its numbers taken as exact; else the
        deciding simplex of its end in integers, or, for hits proven by a ball, a simplex found from the
        walk's last vertices. ``collide.verify(A, B, X_WA, X_WB, walks)`` puts all vertices in.
        """
        if len(self) != 1:
            raise InvalidArgument(f"a certificate is for one pose, and there are {len(self)}")
        A, B, X_WA, X_WB = self._question
        row, hit = self.rows[0], bool(self.hit[0])
        if not hit and row["status"] in (APART, OPEN_APART):
            toward_a = row["axis"] if self.exchanged else -row["axis"]
            certificate = certificate_from_normal(A, B, X_WA[0], X_WB[0], toward_a)
            if certificate is not None:
                return certificate
        pairs = self._ends.get(0)
        if pairs is None:
            body_p, body_r = (walk_body(S) for S in ((B, A) if self.exchanged else (A, B)))
            vertex, corners = last_corners(body_p, body_r, row) if body_r.polar is not None else (0, [0])
            pairs = [(c, vertex) if self.exchanged else (vertex, c) for c in corners]
        return certificate_from_pairs(A, B, X_WA[0], X_WB[0], pairs, hit=hit)

    def __repr__(self) -> str:
        return f"Walks(<{len(self)} poses>, hits={int(self.hit.sum())}, walked={int(self.walked.sum())})"


def walk_body(shape: Shape) -> WalkBody:
    """What the walk keeps of a shape, made once. Raises UnsupportedQuery for all but polytopes."""
    try:
        return shape._walk
    except AttributeError:
        pass
    name = type(shape).__name__
    if not is_single_convex(shape):
        raise UnsupportedQuery(f'{name}: algorithm="barba-langerman" takes one convex polytope, no union and no mesh')
    packed = convex_set_of(shape)
    if packed.kind != POINTS or packed.radius != 0.0:
        raise UnsupportedQuery(
            f'{name}: algorithm="barba-langerman" takes convex polytopes (ConvexHull without a radius, Box, HPolytope);'
            " leave the algorithm out"
        )
    body = WalkBody(packed.points, getattr(shape, "_hull", None))
    object.__setattr__(shape, "_walk", body)
    return body


def walk(A, B, X_WA, X_WB, *, check_poses: bool = True, trace: bool = False) -> Walks:
    """What `collide.collide` says with ``algorithm="barba-langerman"``, with its counts and proofs.

    Parameters
    ----------
    A, B : convex polytopes: `ConvexHull` without a radius, `Box`, `HPolytope`. Their hierarchies are built when first
        needed, in O(n log n), and stay with the shapes.
    X_WA, X_WB : (4, 4) poses in the world, or batches (N, 4, 4), as `collide.collide` takes them.
    check_poses : refuse matrices that are no rotation.
    trace : also return the rounds of the last pose one by one.

    Returns
    -------
    Walks : a row a pose, also for a single pose.

    Raises InvalidPose, InvalidArgument; UnsupportedQuery for other shapes. O(log n + log m) rounds a pose (L. Barba and
    S. Langerman, "Optimal detection of intersections between convex polyhedra", SODA 2015, Theorem 5.8).
    """
    for name, shape in (("A", A), ("B", B)):
        walk_body(checked_shape(f"walk: {name}", shape))
    X_WA, X_WB, _ = asked_poses(A, B, X_WA, X_WB)
    # Copies: a certificate worked out later is for these poses.
    X_WA, X_WB = (as_poses(X, name, check=check_poses).copy() for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))

    def ask_default(ids: np.ndarray) -> np.ndarray:
        X_A, X_B = (X if len(X) == 1 else np.ascontiguousarray(X[ids]) for X in (X_WA, X_WB))
        return np.broadcast_to(answer_batch(A, B, X_A, X_B, Question(True, 0.0)), (len(ids),))

    return walk_poses(A, B, X_WA, X_WB, ask_default, trace=checks.true_or_false("trace", trace))


def collide_by_walk(A, B, X_WA, X_WB, check_poses: bool):
    """``collide(..., algorithm="barba-langerman")``: bool for single poses, bool[N] otherwise."""
    walks = walk(A, B, X_WA, X_WB, check_poses=check_poses)
    single = pose_batch(X_WA, "X_WA")[1] and pose_batch(X_WB, "X_WB")[1]
    return bool(walks.hit[0]) if single else walks.hit


def walk_poses(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, answer_open, *, trace: bool = False) -> Walks:
    """Answers for poses (n, 4, 4) or (1, 4, 4), checked by the caller.

    answer_open : called with the numbers of the poses that the walk leaves open; gives their booleans.
    """
    body_a, body_b = walk_body(A), walk_body(B)
    n = number_of_poses(X_WA, X_WB)
    exchanged = not body_b.has_own_polar and body_a.has_own_polar
    sides = (A, body_a, X_WA), (B, body_b, X_WB)
    (P, body_p, X_WP), (R, body_r, X_WR) = reversed(sides) if exchanged else sides
    if body_r.polar is None:
        rows = no_walks(n)
        walks = Walks((A, B, X_WA, X_WB), rows["status"] == MEETING, rows, exchanged, (0, 0), ())
    else:
        bodies = body_p, body_r, convex_set_of(P), convex_set_of(R)
        X_WP, X_WR = (np.broadcast_to(X, (n, 4, 4)) for X in (X_WP, X_WR))
        rows, rounds = run_walks(*bodies, X_WP, X_WR, trace=trace)
        depths = body_p.hierarchy.depth, body_r.depth_of_polar
        walks = Walks((A, B, X_WA, X_WB), rows["status"] == MEETING, rows, exchanged, depths, rounds)
        open_ids = np.flatnonzero((rows["status"] == OPEN_APART) | (rows["status"] == OPEN_MEETING))
        if len(open_ids):
            walks._take_ends(open_ids, end_exactly(*bodies, X_WP[open_ids], X_WR[open_ids], rows[open_ids]))
    hit = walks.hit
    if not walks.walked.all():
        open_ids = np.flatnonzero(~walks.walked)
        hit[open_ids] = answer_open(open_ids)
    return walks
