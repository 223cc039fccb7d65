"""Depths below rounding: planes of A ⊖ B that doubles cannot tell apart, exactly."""

from __future__ import annotations

import math
from typing import NamedTuple

from collide.kernels import kernel
from collide.narrowphase.exact.exact_directions import (
    direction_length,
    height_along,
    reverse_direction,
    set_normal,
    side_of,
)
from collide.narrowphase.exact.exact_supports import support_pair
from collide.narrowphase.exact.exact_workspace import exact_pair, fits, load_poses, point_at, set_point
from collide.numerics import double_double as dd
from collide.numerics.digits import add_number, carry
from collide.numerics.double_double import DD

#: Distances nearer to each other than this part are the same to all digits that are worked out.
_SAME = 2.0**-70


class ExactDepth(NamedTuple):
    """The depth of cores sharing a point [m], to a relative EXACT_ERROR however small the depth, if proven."""

    proven: bool
    depth: DD


class FacetDistance(NamedTuple):
    """Distance of the origin from a facet's plane, and its side: 1 behind, −1 before, 0 in the plane."""

    side: int
    distance: DD


@kernel
def nearest_plane(ordered, terms, digits, requests, request_at):
    """The `ExactDepth` of an `OrderedPair`.

    requests, request_at : where an entry of `depth_requests.py` begins, or 0.   Other arguments as in `touch_exactly`.

    A plane through the origin with no vertex beyond settles the depth: nothing is less than 0. Otherwise the entry
    names all possibly nearest facets of a closed surface within A ⊖ B; the least of their exact distances is a lower
    bound of the depth, and an upper bound if no vertex lies beyond this facet's plane.
    """
    if ordered.pair.A.n * ordered.pair.B.n <= 3:
        return ExactDepth(True, DD(0.0, 0.0))  # so few points span no volume
    if request_at == 0:
        return ExactDepth(False, DD(0.0, 0.0))
    exact = exact_pair(ordered, terms, digits, 0.0, 0.0)
    if not fits(exact):
        return ExactDepth(False, DD(0.0, 0.0))
    load_poses(exact)
    complete = requests[request_at] == 1
    n_facets = requests[request_at + 1]
    least = DD(math.inf, 0.0)
    for k in range(n_facets):
        side, distance = _set_facet(exact, requests, request_at + 2 + 6 * k)
        if side == 0 and distance.high == 0.0 and (_is_outermost(exact) or _is_outermost(exact)):
            return ExactDepth(True, DD(0.0, 0.0))
        complete = complete and side > 0
        if dd.less(distance, least):
            least = distance
    if not complete:
        return ExactDepth(False, DD(0.0, 0.0))
    for k in range(n_facets):
        distance = least
        if n_facets > 1:  # a single facet still stands
            _, distance = _set_facet(exact, requests, request_at + 2 + 6 * k)
        is_least = (distance.high - least.high) + (distance.low - least.low) <= _SAME * least.high
        if is_least and _is_outermost(exact):
            return ExactDepth(True, least)
    return ExactDepth(False, DD(0.0, 0.0))


@kernel
def depth_of_facet(ordered, terms, digits, requests, request_at):
    """The `ExactDepth` by the first facet of an entry, proven to be nearest.   Arguments as in `nearest_plane`."""
    exact = exact_pair(ordered, terms, digits, 0.0, 0.0)
    if not fits(exact):
        return ExactDepth(False, DD(0.0, 0.0))
    load_poses(exact)
    return ExactDepth(True, _set_facet(exact, requests, request_at + 2).distance)


@kernel
def _set_facet(exact, requests, at):
    """Points 0, 1, 2 and the direction become a facet, counter-clockwise from outside, and its normal.

    Points in line are as far as can be, and behind.
    """
    for k in range(3):
        set_point(exact, k, requests[at + 2 * k], requests[at + 2 * k + 1])
    n, side = set_normal(exact)
    length = direction_length(exact, n)
    if length.value.high == 0.0:
        return FacetDistance(1, DD(math.inf, 0.0))
    return FacetDistance(side, height_along(exact, n, length, 0))


@kernel
def _is_outermost(exact):
    """Whether no vertex of A ⊖ B lies beyond the plane of points 0 … 2, whose normal is the direction, which is
    reversed."""
    digits, d = exact.digits, exact.d
    n = 2 * d
    reverse_direction(exact, n)
    i, j, _ = support_pair(exact, n)
    set_point(exact, 3, i, j)
    for axis in range(3):
        add_number(digits, point_at(d, 3, axis), point_at(d, 0, axis), d, -1)
        carry(digits, point_at(d, 3, axis), d)
    return side_of(exact, n, 3) == 0
