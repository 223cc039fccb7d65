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
#: Connected surfaces asked whether they are inside a solid, at most.
_MAX_SURFACES = 1000


def parted(A: BodyGroups, B: BodyGroups, guesses: Sequence[np.ndarray]) -> tuple[Certificate, ...] | None:
    """Planes between all items of A and B; ``None`` where they meet, or pairs are too many. O(pairs of near groups)."""
    planes = _planes_or_meeting(A, B, guesses)
    if not isinstance(planes, dict) or flaw_of_outside(A, B, planes) is not None:
        return None
    return tuple(Certificate(PLANE, i, j, (n,)) for (i, j), n in planes.items())


def meeting(
    A: BodyGroups, B: BodyGroups, points: Sequence[np.ndarray], guesses: Sequence[np.ndarray], named: tuple[int, int]
) -> tuple[Certificate, ...] | None:
    """A common point of two items, or of an item and the inside of a solid. named : the items tried first."""
    a, b = A.item(named[0]), B.item(named[1])
    point = None if a is None or b is None else common_point(a, b, points, guesses)
    if point:
        return (Certificate(POINT, *named, (point,)),)
    for certificate in _insides(A, B, named):
        return (certificate,)
    items = _planes_or_meeting(A, B, guesses)
    if items is None or isinstance(items, dict):
        return None
    i, j = items
    point = common_point(A.item(i), B.item(j), points, guesses)  # type: ignore[arg-type]
    return (Certificate(POINT, i, j, (point,)),) if point else None


def _insides(A: BodyGroups, B: BodyGroups, named: tuple[int, int]) -> Iterator[Certificate]:
    """For each solid that holds a point of a surface of the other body, the item named first."""
    for solids, body, side in ((A, B, 1), (B, A, 0)):
        for number in (named[side], *body.surfaces[:_MAX_SURFACES]) if solids.solids else ():
            part = body.item(number)
            point = None if part is None else point_of(part)
            for k, solid in solids.solids if point else ():
                if solid.holds(point):  # type: ignore[arg-type]
                    pair = (-1 - k, number) if side else (number, -1 - k)
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
                return A.numbers(i)[0], B.numbers(j)[0]
        planes[i, j] = n
        recent = [np.array(leading_digits(n)), *recent][:_RECENT]
    return planes
