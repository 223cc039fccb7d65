"""The verdict of a page on every body, by a single rule: the worst class of any pair with the body.

A body is ``free`` where all its tested pairs are proven farther apart than the clearance, and ``never tested`` where
every pair of the body was left out: by static bodies, groups and masks, or by name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

from collide.reports import classes
from collide.reports.report import Report

NOT_ANSWERED, FREE, NEVER_TESTED = "not answered", "free", "never tested"
#: The worst first.
ORDER = (classes.COLLIDING, classes.SHALLOW, classes.TOUCHING, NOT_ANSWERED, classes.NEAR, FREE, NEVER_TESTED)
_RANK = {verdict: rank for rank, verdict in enumerate(ORDER)}


def worst(verdicts: Iterable[str]) -> str:
    """The worst of several; ``free`` of none."""
    return min(verdicts, key=_RANK.__getitem__, default=FREE)


def body_verdicts(scene, report: Report) -> dict[str, str]:
    """Body name → one of `ORDER`, for every body of a scene in their order. O(bodies + pairs listed + allowed pairs).

    report : of this scene, by `collide.reports.report.make`.
    """
    tested = bodies_in_tested_pairs(scene, (tuple(pair) for pair in report.query["ignored"]))
    verdicts = {body.name: FREE if body.name in tested else NEVER_TESTED for body in scene.bodies}
    members = {
        name: {body for body, _ in getattr(report, name).busiest()} for name in classes.NAMES
    } | {NOT_ANSWERED: {entry[side] for entry in report.unanswered for side in ("a", "b")}}
    for verdict in reversed(ORDER):
        verdicts.update(dict.fromkeys(members.get(verdict, ()), verdict))
    return verdicts


def bodies_in_tested_pairs(scene, ignored: Iterable[tuple[str, str]] = ()) -> set[str]:
    """Names of the bodies in tested pairs, answered or not, as `collide.World` chooses its pairs.

    Bodies with equal filters are counted together; only pairs left out by name are visited.
    """
    filters = {body.name: (bool(body.static), body.group, body.mask) for body in scene.bodies}
    sizes = Counter(filters.values())
    partners = {
        kind: sum(size for partner, size in sizes.items() if _is_tested(kind, partner)) - _is_tested(kind, kind)
        for kind in sizes
    }
    remaining = {name: partners[kind] for name, kind in filters.items()}
    left_out = {frozenset(pair[:2]) for pair in (*scene.allowed, *ignored)}
    for a, b in (tuple(pair) for pair in left_out if len(pair) == 2):
        if a in filters and b in filters and _is_tested(filters[a], filters[b]):
            remaining[a] -= 1
            remaining[b] -= 1
    return {name for name, count in remaining.items() if count > 0}


def _is_tested(a: tuple[bool, int, int], b: tuple[bool, int, int]) -> bool:
    """Whether two bodies of these filters (static, group, mask) are tested."""
    return not (a[0] and b[0]) and bool(a[1] & b[2]) and bool(b[1] & a[2])


def verdict_columns(verdicts: Mapping[str, str], rows: Mapping[str, int]) -> list[list]:
    """``[body row, verdict]`` of the bodies that are neither free nor never tested, by row."""
    return sorted([rows[name], verdict] for name, verdict in verdicts.items() if verdict not in (FREE, NEVER_TESTED))
