"""The search for planes between all items of two bodies, or for a common point; `body_groups.py` checks both."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from collide.certificates.body_groups import MAX_PAIRS, BodyGroups, Planes, cut_pair, flaw_of_outside, point_of
from collide.certificates.certificate import PLANE, POINT, Certificate
from collide.certificates.proof_search import RoughUnion, common_point, exact_normal, parting_of_unions
from collide.numerics.exact_points import leading_digits

#: The normals found last that are tried for the next pair.
_RECENT = 2


def parted(A: BodyGroups, B: BodyGroups, guesses: Sequence[np.ndarray]) -> tuple[Certificate, ...] | None:
    """Planes between all items of A and B; ``None`` where they meet, or pairs are too many. O(pairs of near groups)."""
    planes = _planes_or_meeting(A, B, guesses)
    if not isinstance(planes, dict) or flaw_of_outside(A, B) is not None:
        return None
    return tuple(Certificate(PLANE, i, j, (n,)) for (i, j), n in planes.items())


def meeting(
    A: BodyGroups, B: BodyGroups, points: Sequence[np.ndarray], guesses: Sequence[np.ndarray], named: tuple[int, int]
) -> tuple[Certificate, ...] | None:
    """A common point of two items, or of an item and the inside of a solid. named : the items tried first."""
    a, b = A.item(named[0]), B.item(named[1])
    point = common_point(a, b, points, guesses) if a and b else None
    if point:
        return (Certificate(POINT, *named, (point,)),)
    for certificate in _insides(A, B):
        return (certificate,)
    items = _planes_or_meeting(A, B, guesses)
    if items is None or isinstance(items, dict):
        return None
    i, j = items
    point = common_point(A.item(i), B.item(j), points, guesses)  # type: ignore[arg-type]
    return (Certificate(POINT, i, j, (point,)),) if point else None


def _insides(A: BodyGroups, B: BodyGroups) -> Iterator[Certificate]:
    """For each solid of a body that holds a point of a surface of the other."""
    for solids, body in ((A, B), (B, A)):
        for k, solid in solids.solids:
            for item, part in body.surfaces:
                point = point_of(part)
                if point and solid.holds(point):
                    pair = (-1 - k, item) if solids is A else (item, -1 - k)
                    yield Certificate(POINT, *pair, (point,))


def _planes_or_meeting(A: BodyGroups, B: BodyGroups, guesses: Sequence[np.ndarray]) -> Planes | tuple[int, int] | None:
    """Planes, or the numbers of two items that no plane parts; ``None`` where pairs are too many."""
    planes: Planes = {}
    recent = list(guesses)
    rough: dict[tuple[bool, int], RoughUnion] = {}
    stack, looked_at = [(0, 0)], 0
    while stack:
        i, j = stack.pop()
        looked_at += 1
        if looked_at > MAX_PAIRS:
            return None
        parts_a, parts_b = A.parts(i), B.parts(j)
        for key, parts in (((False, i), parts_a), ((True, j), parts_b)):
            if key not in rough:
                rough[key] = RoughUnion(parts)
        n = parting_of_unions(parts_a, parts_b, rough[False, i], rough[True, j], recent)
        if n is None:
            pairs = cut_pair(A, B, i, j)
            if pairs:
                stack += pairs
                continue
            (a,), (b,) = parts_a, parts_b
            n = exact_normal(a, b, recent)
            if n is None:
                return A.number(i), B.number(j)
        planes[i, j] = n
        recent = [np.array(leading_digits(n)), *recent][:_RECENT]
    return planes
