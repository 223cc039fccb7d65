"""What is asked of pairs of convex sets, and where one thread's kernels work on them."""

from __future__ import annotations

from typing import Any, NamedTuple

from collide.kernels import kernel, view_f64, view_i64
from collide.narrowphase.epa.polytope_surface import DOUBLES as EPA_DOUBLES
from collide.narrowphase.epa.polytope_surface import INTEGERS as EPA_INTEGERS
from collide.narrowphase.exact.depth_requests import ENTRY, REQUESTS
from collide.narrowphase.gap.curved_features import DOUBLES as CURVED_DOUBLES
from collide.narrowphase.gap.gap_queue import QUEUE_DOUBLES, QUEUE_INTEGERS
from collide.narrowphase.gap.precise_pair import LOW_PARTS_OF_PAIR
from collide.narrowphase.gap.tied_vertices import MAX_TIES
from collide.narrowphase.gjk.minkowski_difference import POINT
from collide.numerics.double_double import STRIDE
from collide.numerics.exact_dot_sign import PRODUCT_TERMS

# Workspace of one thread, in doubles: difference points and their weights; GJK's simplex, while EPA goes on from it;
# last digits of depths and heights (four points, a direction, low parts of two poses; or a step of Newton's method);
# EPA's; the queue of gaps.
_WEIGHTS_AT = 5 * POINT
_SIMPLEX_AT = 64
#: Of a simplex: four points, their weights, a vertex of A and of B of each.
SIMPLEX = 4 * POINT + 4 + 8
_FINE_AT = _SIMPLEX_AT + SIMPLEX
_EPA_DOUBLES_AT = _FINE_AT + max(5 * STRIDE + LOW_PARTS_OF_PAIR, CURVED_DOUBLES)
_QUEUE_DOUBLES_AT = _EPA_DOUBLES_AT + EPA_DOUBLES
DOUBLES = _QUEUE_DOUBLES_AT + QUEUE_DOUBLES
# In integers: vertex pairs of the difference points; of the nearest facet; ties, or the terms of a sum; one request to
# the exact stage; EPA's; the queue of gaps; all requests of a call.
_NEAREST_AT, _TIES_AT = 10, 16
_REQUEST_AT = _TIES_AT + max(MAX_TIES + 1, PRODUCT_TERMS)
_EPA_INTEGERS_AT = _REQUEST_AT + ENTRY
_QUEUE_INTEGERS_AT = _EPA_INTEGERS_AT + EPA_INTEGERS
REQUESTS_AT = _QUEUE_INTEGERS_AT + QUEUE_INTEGERS
INTEGERS = REQUESTS_AT + REQUESTS


class Query(NamedTuple):
    """What is asked of every pair.

    boolean : only whether it meets.   depths : how deep an overlap is, too.   limit : gaps larger than this [m] are not
    measured.   terms_at : address of the `PoseTable`'s exact terms.
    resumes : rows name the normal and the vertices of the same pair at a pose before, to begin with.
    """

    boolean: bool
    depths: bool
    limit: float
    terms_at: int
    resumes: bool


class Workspace(NamedTuple):
    """Views and addresses of the workspace of a thread.

    points : five points of A ⊖ B, POINT doubles each.   weights : of four of them; from NEAREST_POINT on their
    weighted point, nearest the origin; from AXIS on a unit axis.   ids : a vertex of A and of B a point.
    simplex : SIMPLEX doubles.   request : an entry of `depth_requests.py`, and requests : all entries of a call.
    fine_at, nearest_at, ties_at : for last digits (`refine_depth.py`, `refine_height`).
    epa_at, epa_integers_at, queue_at, queue_integers_at : of EPA and of the queue of gaps.
    """

    points: Any
    weights: Any
    ids: Any
    simplex: Any
    request: Any
    requests: Any
    fine_at: int
    nearest_at: int
    ties_at: int
    epa_at: int
    epa_integers_at: int
    queue_at: int
    queue_integers_at: int


@kernel(inline=True)
def workspace_at(doubles_at, integers_at):
    """The `Workspace` in DOUBLES doubles and INTEGERS int64."""
    return Workspace(
        view_f64(doubles_at, 5 * POINT), view_f64(doubles_at + 8 * _WEIGHTS_AT, 10), view_i64(integers_at, 10),
        view_f64(doubles_at + 8 * _SIMPLEX_AT, SIMPLEX), view_i64(integers_at + 8 * _REQUEST_AT, ENTRY),
        view_i64(integers_at + 8 * REQUESTS_AT, REQUESTS),
        doubles_at + 8 * _FINE_AT, integers_at + 8 * _NEAREST_AT, integers_at + 8 * _TIES_AT,
        doubles_at + 8 * _EPA_DOUBLES_AT, integers_at + 8 * _EPA_INTEGERS_AT,
        doubles_at + 8 * _QUEUE_DOUBLES_AT, integers_at + 8 * _QUEUE_INTEGERS_AT,
    )
