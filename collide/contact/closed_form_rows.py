"""Half-spaces, spheres and capsules in closed form: rows of `distance` good enough for contacts.

What the narrowphase does besides, for the last digits of a gap, takes most of its time here, and contacts have no use
for it.
"""

from __future__ import annotations

from collide.kernels import kernel, view_i64
from collide.lowering.shape_table import COUNT, INTS, KIND
from collide.narrowphase.bounds import ERROR
from collide.narrowphase.convex_convex import closed_form_cores, write_witness_points
from collide.narrowphase.halfspace_convex import plane_gap, write_plane_points
from collide.narrowphase.kernel_dispatch import CONVEX, HALFSPACE_CONVEX, HALFSPACES, method
from collide.narrowphase.posed_pair import radius_of
from collide.narrowphase.rows import write_decision
from collide.results import FORMULA
from collide.transforms import SMALLEST

#: A bracket wider than this part of the size is left to the general narrowphase.
_WIDEST = 2.0**-40
#: And so are segments nearer to each other than this part of the size: doubles alone know their direction badly.
_NEAR = 2.0**-10


@kernel(inline=True)
def has_closed_form(ints_at, sa, sb):
    """Whether `put_closed_form` takes two rows of the `ShapeTable`: a half-space and a convex set, or two spheres or
    capsules.
    """
    a, b = view_i64(ints_at + 8 * INTS * sa, INTS), view_i64(ints_at + 8 * INTS * sb, INTS)
    how = method(a[KIND], a[COUNT], b[KIND], b[COUNT])
    return how != CONVEX and how != HALFSPACES


@kernel
def put_closed_form(ordered, limit, work, row):
    """Write the row, but for vertices; False where doubles tell neither the sign nor a gap beyond the limit.

    limit : larger gaps are said to be beyond, without bracket [m].   work : a `Workspace`.
    """
    pair = ordered.pair
    A, B = pair.A, pair.B
    if 0.0 < ordered.size < SMALLEST:
        return False
    how = method(A.kind, A.n, B.kind, B.n)
    if how == HALFSPACE_CONVEX:
        deepest = plane_gap(ordered)
        gap, error = deepest.gap, deepest.error
        if not _put_bracket(gap, gap - error, gap + error, deepest.size, limit, row):
            return False
        write_plane_points(ordered, deepest, gap, row)
        return True
    radius_a, radius_b = radius_of(pair, A), radius_of(pair, B)
    error = ERROR * ordered.size + ordered.slop
    core = closed_form_cores(pair, how, work, error)
    if -core.depth < _NEAR * ordered.size:
        return False
    radius = radius_a + radius_b
    distance, lower, upper = -core.depth - radius, core.lower - error - radius, core.upper + error - radius
    if not _put_bracket(distance, lower, upper, ordered.size, limit, row):
        return False
    write_witness_points(pair, core, work, row, radius_a, radius_b, 0.0, ordered.flip)
    return True


@kernel(inline=True)
def _put_bracket(distance, lower, upper, size, limit, row):
    """Write a row's numbers and flags; False, and nothing, where the bracket does not tell enough."""
    if lower > limit:
        write_decision(row, distance, lower, upper, FORMULA, limit)
        return True
    if not (lower > 0.0 or upper < 0.0) or upper > limit or upper - lower > _WIDEST * size:
        return False
    write_decision(row, distance, lower, upper, FORMULA, limit)
    return True
