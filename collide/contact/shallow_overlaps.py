"""Ways out of shallow overlaps: along which normals, and how far, facets that meet come apart.

One translation may not part two bodies that grip each other, so pairs of facets are parted group by group. Normals are
guessed, lengths are gaps measured along them, and the exact test on the moved body says which pairs come apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.contact.contact_facets import MOST_PAIRS, Pairs, Posed, crossed, facing, lengths_of, topology_of
from collide.contact.contact_points import points_along
from collide.contact.internal_edges import Links
from collide.narrowphase.facets.facet_queries import all_hits, facets_within

#: Normals tried, and pairs looked at to choose them.
_NORMALS, _LOOKED_AT = 6, 48
#: Of normals that many of the facets have, so many from either body are tried in any case.
_FREQUENT = 3
#: Lengths tried along each: gaps sorted into classes of this ratio, the shortest and the longest classes.
_RATIO, _SHORTEST, _LONGEST = 4.0, 4, 4
#: A longer way is preferred where it parts more pairs, up to so many times the shortest that parts all in some way.
_LONGER = 4.0
#: Sines below which all facets of the pairs lie on their side of a plane, as good as.
_PLANE = 2.0**-8
#: A facet may turn away from the normal of its patch by this cosine.
_TURNED = 0.25
#: Errors of a coordinate that a step is longer than the gap measured.
CLEAR = 64.0


class WayApart(NamedTuple):
    """A group of pairs (mask over those asked) that the translation of B by ``length`` along ``normal`` parts."""

    normal: np.ndarray
    length: float
    pairs: np.ndarray


def ways_apart(here: Posed, pairs: Pairs) -> tuple[list[WayApart], np.ndarray]:
    """(ways, mask of pairs that none of them parts) for pairs of facets that meet, or nearly."""
    normals, worth = _normals(here, pairs)
    if not normals:
        return [], np.ones(len(pairs), dtype=bool)
    limit = 0.5 * min(here.A.reach, here.B.reach)
    if min(here.A.reach, here.B.reach) == 0.0:
        limit = max(here.A.reach, here.B.reach)
    best = int(np.argmax(worth))
    if worth[best] >= -_PLANE:  # a plane all but parts them as they are: no other way is much shorter
        plain = _at_once(here, pairs, normals[best], limit)
        if plain is not None:
            return [plain], np.zeros(len(pairs), dtype=bool)
    tried = [(k, s) for k, n in enumerate(normals) for s in _lengths(here, pairs, n, limit)]
    if not tried:
        return [], np.ones(len(pairs), dtype=bool)
    lengths = np.array([s for _, s in tried])
    # What turns its back on the normal comes apart by going deeper in.
    before = np.array([_is_before(here, pairs, n) for n in normals])
    parted = _parted(here, pairs, np.array([normals[k] * s for k, s in tried]))
    free = parted & before[[k for k, _ in tried]]
    shortest = _enough(free, lengths)
    usable = lengths <= _LONGER * shortest
    links = Links(pairs, topology_of(here.B).many)
    ways, left = [], np.ones(len(pairs), dtype=bool)
    while left.any():
        # What hangs on to a group comes apart with it; but most must face along the normal.
        forward, gained = (free & left).sum(axis=1), (parted & left).sum(axis=1)
        gained = np.where(usable & (2 * forward >= gained), gained, 0)
        if not gained.max():
            gained = np.where(usable, forward, 0)
        if not gained.max():
            break
        most = np.flatnonzero(gained == gained.max())
        short = lengths[most].min() * (1.0 + 2.0**-20) + CLEAR * here.error
        best = max(most[lengths[most] <= short].tolist(), key=lambda k: (worth[tried[k][0]], -lengths[k], -k))
        group = free[best] & left
        group = links.reached(group, parted[best] & left)  # and what hangs on to it, whichever way it looks
        ways.append(WayApart(normals[tried[best][0]], float(lengths[best]), group))
        left &= ~group
    return ways, left


def _at_once(here: Posed, pairs: Pairs, n: np.ndarray, limit: float) -> WayApart | None:
    """The shortest way along n that parts all of them, if one does."""
    lengths = _lengths(here, pairs, n, limit)
    if not lengths or not _is_before(here, pairs, n).all():
        return None
    all_free = _parted(here, pairs, np.array([n * s for s in lengths])).all(axis=1)
    if not all_free.any():
        return None
    return WayApart(n, lengths[int(np.argmax(all_free))], np.ones(len(pairs), dtype=bool))


def _is_before(here: Posed, pairs: Pairs, n: np.ndarray) -> np.ndarray:
    """(k,) bool: A's facet of the pair does not look against n, nor B's along it, by much."""
    return (facing(pairs.a.normals, n, here.A.solid) >= -_TURNED) & (facing(pairs.b.normals, -n, here.B.solid) >= -_TURNED)


def _enough(free: np.ndarray, lengths: np.ndarray) -> float:
    """The least length up to which all that comes apart at all comes apart in some way."""
    wanted = free.any(axis=0)
    shortest = np.where(free, lengths[:, None], np.inf).min(axis=0)
    return float(shortest[wanted].max(initial=0.0))


def _parted(here: Posed, pairs: Pairs, steps: np.ndarray) -> np.ndarray:
    """(steps, pairs) bool: whether a pair no longer meets after a translation of B."""
    moved = np.repeat(here.X_WB[None], len(steps), axis=0)
    moved[:, :3, 3] += steps
    hits = all_hits(here.A.tree, here.B.tree, np.repeat(here.X_WA[None], len(steps), axis=0), moved)
    many = len(here.B.tree.ids)
    asked = pairs.near.facets[:, 0] * many + pairs.near.facets[:, 1]  # ascending, as `facets_within` gives them
    keys = hits.pairs[:, 0] * many + hits.pairs[:, 1]
    at = np.minimum(np.searchsorted(asked, keys), len(asked) - 1)
    found = asked[at] == keys
    free = np.ones((len(steps), len(asked)), dtype=bool)
    free[np.repeat(np.arange(len(steps)), np.diff(hits.starts))[found], at[found]] = False
    return free


def translation_that_parts(here: Posed, pairs: Pairs, n: np.ndarray, depth: float) -> float:
    """A length that is proven to clear all of these pairs; infinite where none was found.

    Proven of the poses with the translation ``X_WB[:3, 3] + length * n``, as doubles add up, and of A moved against n as
    well. Bodies with radii are clear where their cores are farther apart than both radii.
    """
    for factor in (1.0, 1.0 + 2.0**-20, 1.0 + 2.0**-7, 1.25, 2.0, 4.0):
        length = max(depth, 0.0) * factor + CLEAR * here.error
        moved_a, moved_b = here.X_WA.copy(), here.X_WB.copy()
        moved_b[:3, 3] += length * n
        moved_a[:3, 3] -= length * n
        if _clear(here, pairs, here.X_WA, moved_b) and _clear(here, pairs, moved_a, here.X_WB):
            return length
    return np.inf


def _clear(here: Posed, pairs: Pairs, X_WA: np.ndarray, X_WB: np.ndarray) -> bool:
    """Whether none of these pairs meets at other poses, nor their radii."""
    radius = here.A.radius + here.B.radius
    if radius == 0.0:
        left = all_hits(here.A.tree, here.B.tree, X_WA, X_WB).pairs
    else:
        near = facets_within(here.A.tree, here.B.tree, X_WA, X_WB, radius, MOST_PAIRS)
        if near is None:
            return False
        left = near.facets
    many = len(here.B.tree.ids)
    asked = pairs.near.facets[:, 0] * many + pairs.near.facets[:, 1]
    return not np.isin(asked, left[:, 0] * many + left[:, 1]).any()


def _lengths(here: Posed, pairs: Pairs, n: np.ndarray, limit: float) -> list[float]:
    """Lengths along n at which pairs may come apart, ascending."""
    points = points_along(pairs, n, here.A.solid, here.B.solid, here.error)
    least = CLEAR * here.error
    depths = np.maximum(-points.gap, 0.0) * (1.0 + 2.0**-30) + least
    depths = depths[depths <= limit]
    if not len(depths):
        return []
    classes = np.floor(np.log2(depths / least) / np.log2(_RATIO)).astype(np.int64)
    found = [float(depths[classes == c].max()) for c in np.unique(classes)]
    found = sorted({*found[:_SHORTEST], *found[-_LONGEST:]})
    return [*found, 1.5 * found[-1], 4.0 * found[-1]]


def _normals(here: Posed, pairs: Pairs) -> tuple[list[np.ndarray], np.ndarray]:
    """Unit vectors along which these pairs may part by little, and how likely each is."""
    some = pairs.take(slice(None, None, -(-len(pairs) // _LOOKED_AT)))
    guesses = [*some.a.normals, *-some.b.normals]
    if not here.A.solid:
        guesses += list(-some.a.normals)
    if not here.B.solid:
        guesses += list(some.b.normals)
    edges_a, edges_b = (side.corners[:, [1, 2, 0]] - side.corners for side in (some.a, some.b))
    crosses = crossed(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 3)
    guesses += [*crosses, *-crosses]
    mean = pairs.a.normals.sum(axis=0) - pairs.b.normals.sum(axis=0)
    first = [*_frequent(pairs.a.normals, mean), *_frequent(-pairs.b.normals, mean), mean]
    found = np.array([*first, *guesses])
    size = lengths_of(found)
    clear = size > 1e-12 * size.max(initial=0.0)
    sure = int(clear[: len(first)].sum())
    found = found[clear] / size[clear][:, None]
    _, kept = np.unique(np.round(found * 2.0**24), axis=0, return_index=True)
    kept.sort()
    found, sure = found[kept], int((kept < sure).sum())
    if not len(found):
        return [], np.zeros(0)
    worth = _support(some, found)
    order = np.lexsort((np.arange(len(found)), -np.round(worth * 2.0**20)))[:_NORMALS].tolist()
    taken = list(dict.fromkeys([*range(sure), *order]))
    return [found[k] + 0.0 for k in taken], worth[taken]


def _frequent(normals: np.ndarray, towards: np.ndarray) -> list[np.ndarray]:
    """The commonest of these normals, of those that do not point away from ``towards``."""
    fit = normals[((normals * towards).sum(axis=1) >= 0.0) & normals.any(axis=1)]
    if not len(fit):
        return []
    _, first, counts = np.unique(np.round(fit * 2.0**24), axis=0, return_index=True, return_counts=True)
    order = np.lexsort((first, -counts))[:_FREQUENT]
    return [fit[k] for k in first[order]]


def _support(pairs: Pairs, normals: np.ndarray) -> np.ndarray:
    """(m,) mean over the pairs of how far A stays behind, and B before, the plane through their common point: 0 … −1."""
    middle = 0.5 * (pairs.near.point_a + pairs.near.point_b)
    worst = np.zeros((len(normals), len(pairs)))
    for side, sign in ((pairs.a, -1.0), (pairs.b, 1.0)):
        away = sign * (side.corners - middle[:, None])
        size = lengths_of(away).max(axis=1)
        away = away / np.where(size > 0.0, size, 1.0)[:, None, None]
        rise = (normals[:, None, None] * away[None]).sum(axis=3).min(axis=2)
        worst = np.minimum(worst, rise)
    return worst.mean(axis=1)
