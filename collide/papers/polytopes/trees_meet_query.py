"""`trees_meet`: whether two preprocessed polytopes in R^d meet where they are."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy.typing import ArrayLike

from collide.base import argument_checks as checks
from collide.errors import InvalidArgument
from collide.least_distance.nearest_pair import nearest_pair
from collide.least_distance.pair_proposals import Work
from collide.papers.polytopes.exact_answers import make_meeting
from collide.papers.polytopes.exclusion import Exclusion, exclusion_of
from collide.papers.polytopes.hierarchical_tree import HierarchicalTree
from collide.papers.polytopes.meeting import MeetingCertificate
from collide.papers.polytopes.posed_facet_trees import posed_rows, relative_of
from collide.papers.polytopes.relative_pose import affine_map, inverse, product
from collide.papers.polytopes.tree_walk import HIT, MISS, OPEN, TreeWalk


@dataclass(frozen=True)
class TreeMeeting:
    """Whether two preprocessed bodies meet.

    Attributes
    ----------
    hit : bool
        Whether the bodies have a common point; touching is a hit.
    settled : bool
        Whether the trees left the answer open (within some 1e-13 of touching) and integers over all rows decided.
    certificate : MeetingCertificate or ``None``
        Where asked for: weights of the points and multipliers of the half-spaces, checked by `verify_trees`.
    exclusion : Exclusion or ``None``
        Of a miss found by the trees, the O(log n + log m) planes that exclude the hull, in the order of the rounds;
        checked by `verify_exclusion`.
    counters : mapping
        ``origin_rounds``, ``rounds``, ``simplices_read``, ``net_rows``; of the certificate ``rows_read``.
    """

    hit: bool
    settled: bool
    certificate: MeetingCertificate | None
    exclusion: Exclusion | None
    counters: Mapping[str, int]

    def __bool__(self) -> bool:
        return self.hit


def trees_meet(
    A: HierarchicalTree,
    B: HierarchicalTree,
    X_WA: ArrayLike | None = None,
    X_WB: ArrayLike | None = None,
    *,
    certificate: bool = True,
) -> TreeMeeting:
    """Whether two bodies meet, in O(log n + log m) rounds down their trees.

    Parameters
    ----------
    A, B : HierarchicalTree
        A tree of points and a tree of half-spaces.
    X_WA : (k, k) array_like, float64, optional
    X_WB : (k, k) array_like, float64, optional
        Their poses, k = d + 1: any invertible affine maps, entries taken as exact; the identity by default.
    certificate : bool
        Whether to make a certificate: an exact search over all rows, begun with the trees' rows.

    Returns
    -------
    TreeMeeting

    Raises
    ------
    InvalidArgument
        Where both are of points or both of half-spaces, or dimensions differ.
    InvalidPose
        Where a map is not finite, not affine or not invertible.
    UnsupportedQuery
        Where a tree would need more memory than its limit.
    """
    for name, body in (("A", A), ("B", B)):
        checks.instance(f"trees_meet: {name}", body, HierarchicalTree, "a HierarchicalTree")
    certificate = checks.true_or_false("trees_meet: certificate", certificate)
    if A.points is None:
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    if A.points is None or B.points is not None:
        raise InvalidArgument("trees_meet: one body must be made from points and the other from half-spaces")
    if A.dimension != B.dimension:
        raise InvalidArgument(f"trees_meet: A has {A.dimension} dimensions, B {B.dimension}: give both the same")
    d = A.dimension
    X_BA = product(inverse("X_WB", affine_map("X_WB", X_WB, d)), affine_map("X_WA", X_WA, d))
    X_AB = inverse("X_WA", X_BA)
    relative = relative_of(A, B, X_BA, X_AB)
    walk = TreeWalk(A.tree, B.tree, B.grid, relative).run()
    counters = {
        "origin_rounds": walk.origin_rounds, "rounds": walk.rounds, "simplices_read": walk.simplices_read,
        "net_rows": walk.net_rows,
    }
    exclusion = exclusion_of(A, B, walk, relative.o) if walk.status == MISS else None
    if walk.status != OPEN and not certificate:
        return TreeMeeting(walk.status == HIT, False, None, exclusion, counters)
    rows = posed_rows(A, B, X_BA)
    start = walk.points[-2 * (d + 1) :], walk.halfspaces[-2 * (d + 1) :]
    pair = nearest_pair(rows.points, rows.halfspaces, Work(), start=start)
    meeting = make_meeting(pair, rows, {})
    if walk.status != OPEN and meeting.hit != (walk.status == HIT):
        raise AssertionError(f"trees_meet: the trees say {walk.status}, the exact search hit={meeting.hit}")
    counters["rows_read"] = rows.points.n_read + rows.halfspaces.n_read
    proof = meeting.certificate if certificate else None
    return TreeMeeting(meeting.hit, walk.status == OPEN, proof, exclusion, counters)
