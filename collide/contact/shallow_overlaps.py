"""Separating translations of shallow overlaps: along which normals, and how far, facets that meet come apart.

No single translation may separate two bodies that grip each other, so pairs of facets are separated group by group.
Candidates for normals are those of facets and cross products of edges, lengths are gaps measured along them, and the
exact test on the moved body decides which pairs come apart.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.contact.contact_facets import MAX_PAIRS, ContactFrame, Pairs, cross, facing, lengths_of, topology_of
from collide.contact.contact_points import points_along
from collide.contact.internal_edges import Links
from collide.narrowphase.facets.facet_queries import all_hits, facets_within

#: Normals tried, and pairs looked at to choose them.
_NORMALS, _LOOKED_AT = 6, 48
#: So many of the most frequent facet normals of either body are tried in any case.
_FREQUENT = 3
#: Lengths tried along each: gaps sorted into classes of this ratio, the shortest and the longest classes.
_RATIO, _SHORTEST, _LONGEST = 4.0, 4, 4
#: A longer translation is preferred where it separates more pairs, up to so many times the length needed for all.
_LONGER = 4.0
#: Sines below which all facets of the pairs count as lying on their side of a plane.
_PLANE = 2.0**-8
#: A facet may turn away from the normal of its patch by this cosine.
_TURNED = 0.25
#: A translation is longer than the gap measured by so many errors of a coordinate.
STEP_ERRORS = 64.0


class SeparatingTranslation(NamedTuple):
    """B moved by ``length`` [m] along the unit vector ``normal`` clears A in a group of pairs (mask over those
    asked).
    """

    normal: np.ndarray
    length: float
    pairs: np.ndarray


def separating_translations(frame: ContactFrame, pairs: Pairs) -> tuple[list[SeparatingTranslation], np.ndarray]:
    """Translations for pairs of facets that meet, or nearly, and the mask of pairs that none of them separates."""
    normals, worth = _normals(frame, pairs)
    if not normals:
        return [], np.ones(len(pairs), dtype=bool)
    limit = 0.5 * min(frame.A.reach, frame.B.reach)
    if min(frame.A.reach, frame.B.reach) == 0.0:
        limit = max(frame.A.reach, frame.B.reach)
    best = int(np.argmax(worth))
    if worth[best] >= -_PLANE:  # a plane all but separates them as they are: no other normal is much shorter
        plain = _at_once(frame, pairs, normals[best], limit)
        if plain is not None:
            return [plain], np.zeros(len(pairs), dtype=bool)
    tried = [(k, s) for k, n in enumerate(normals) for s in _lengths(frame, pairs, n, limit)]
    if not tried:
        return [], np.ones(len(pairs), dtype=bool)
    lengths = np.array([s for _, s in tried])
    # Facets that face away from the normal come apart by going deeper in.
    before = np.array([_is_before(frame, pairs, n) for n in normals])
    parted = _parted(frame, pairs, np.array([normals[k] * s for k, s in tried]))
    free = parted & before[[k for k, _ in tried]]
    shortest = _enough(free, lengths)
    usable = lengths <= _LONGER * shortest
    links = Links(pairs, topology_of(frame.B).n_corners)
    translations, unparted = [], np.ones(len(pairs), dtype=bool)
    while unparted.any():
        # Pairs connected with a group come apart with it; but at least half must face along the normal.
        forward, gained = (free & unparted).sum(axis=1), (parted & unparted).sum(axis=1)
        gained = np.where(usable & (2 * forward >= gained), gained, 0)
        if not gained.max():
            gained = np.where(usable, forward, 0)
        if not gained.max():
            break
        best_ones = np.flatnonzero(gained == gained.max())
        short = lengths[best_ones].min() * (1.0 + 2.0**-20) + STEP_ERRORS * frame.error
        best = max(best_ones[lengths[best_ones] <= short].tolist(), key=lambda k: (worth[tried[k][0]], -lengths[k], -k))
        group = free[best] & unparted
        group = links.reached(group, parted[best] & unparted)  # and pairs connected with it, whichever way they face
        translations.append(SeparatingTranslation(normals[tried[best][0]], float(lengths[best]), group))
        unparted &= ~group
    return translations, unparted


def _at_once(frame: ContactFrame, pairs: Pairs, n: np.ndarray, limit: float) -> SeparatingTranslation | None:
    """The shortest translation along n that separates all of the pairs, None where none does."""
    lengths = _lengths(frame, pairs, n, limit)
    if not lengths or not _is_before(frame, pairs, n).all():
        return None
    all_free = _parted(frame, pairs, np.array([n * s for s in lengths])).all(axis=1)
    if not all_free.any():
        return None
    return SeparatingTranslation(n, lengths[int(np.argmax(all_free))], np.ones(len(pairs), dtype=bool))


def _is_before(frame: ContactFrame, pairs: Pairs, n: np.ndarray) -> np.ndarray:
    """(k,) bool: A's facet of the pair does not look against n, nor B's along it, by much."""
    along_a, along_b = facing(pairs.a.normals, n, frame.A.solid), facing(pairs.b.normals, -n, frame.B.solid)
    return (along_a >= -_TURNED) & (along_b >= -_TURNED)


def _enough(free: np.ndarray, lengths: np.ndarray) -> float:
    """The least length [m] within which every pair that some translation separates is separated by one."""
    wanted = free.any(axis=0)
    shortest = np.where(free, lengths[:, None], np.inf).min(axis=0)
    return float(shortest[wanted].max(initial=0.0))


def _parted(frame: ContactFrame, pairs: Pairs, steps: np.ndarray) -> np.ndarray:
    """(steps, pairs) bool: whether a pair no longer meets after a translation of B."""
    moved = np.repeat(frame.X_WB[None], len(steps), axis=0)
    moved[:, :3, 3] += steps
    hits = all_hits(frame.A.tree, frame.B.tree, np.repeat(frame.X_WA[None], len(steps), axis=0), moved)
    n_facets_b = len(frame.B.tree.ids)
    asked = pairs.near.facets[:, 0] * n_facets_b + pairs.near.facets[:, 1]  # ascending, as `facets_within` gives them
    keys = hits.pairs[:, 0] * n_facets_b + hits.pairs[:, 1]
    at = np.minimum(np.searchsorted(asked, keys), len(asked) - 1)
    is_asked = asked[at] == keys
    free = np.ones((len(steps), len(asked)), dtype=bool)
    free[np.repeat(np.arange(len(steps)), np.diff(hits.starts))[is_asked], at[is_asked]] = False
    return free


def clearing_length(frame: ContactFrame, pairs: Pairs, n: np.ndarray, depth: float) -> float:
    """A length [m] along n by which B moved is proven to clear all of these pairs; infinite where none is known.

    Proven of the poses with the translation ``X_WB[:3, 3] + length * n``, as doubles add up, and of A moved against n
    as well. Swept bodies are clear where their cores are farther apart than both radii.
    """
    for factor in (1.0, 1.0 + 2.0**-20, 1.0 + 2.0**-7, 1.25, 2.0, 4.0):
        length = max(depth, 0.0) * factor + STEP_ERRORS * frame.error
        moved_a, moved_b = frame.X_WA.copy(), frame.X_WB.copy()
        moved_b[:3, 3] += length * n
        moved_a[:3, 3] -= length * n
        if _no_pair_meets(frame, pairs, frame.X_WA, moved_b) and _no_pair_meets(frame, pairs, moved_a, frame.X_WB):
            return length
    return np.inf


def _no_pair_meets(frame: ContactFrame, pairs: Pairs, X_WA: np.ndarray, X_WB: np.ndarray) -> bool:
    """Whether none of these pairs meets at other poses, nor their radii."""
    radius = frame.A.radius + frame.B.radius
    if radius == 0.0:
        meeting = all_hits(frame.A.tree, frame.B.tree, X_WA, X_WB).pairs
    else:
        near = facets_within(frame.A.tree, frame.B.tree, X_WA, X_WB, radius, MAX_PAIRS)
        if near is None:
            return False
        meeting = near.facets
    n_facets_b = len(frame.B.tree.ids)
    asked = pairs.near.facets[:, 0] * n_facets_b + pairs.near.facets[:, 1]
    return not np.isin(asked, meeting[:, 0] * n_facets_b + meeting[:, 1]).any()


def _lengths(frame: ContactFrame, pairs: Pairs, n: np.ndarray, limit: float) -> list[float]:
    """Lengths along n at which pairs may come apart, ascending."""
    points = points_along(pairs, n, frame.A.solid, frame.B.solid, frame.error)
    least = STEP_ERRORS * frame.error
    depths = np.maximum(-points.gap, 0.0) * (1.0 + 2.0**-30) + least
    depths = depths[depths <= limit]
    if not len(depths):
        return []
    classes = np.floor(np.log2(depths / least) / np.log2(_RATIO)).astype(np.int64)
    lengths = [float(depths[classes == c].max()) for c in np.unique(classes)]
    lengths = sorted({*lengths[:_SHORTEST], *lengths[-_LONGEST:]})
    return [*lengths, 1.5 * lengths[-1], 4.0 * lengths[-1]]


def _normals(frame: ContactFrame, pairs: Pairs) -> tuple[list[np.ndarray], np.ndarray]:
    """Unit vectors along which these pairs may part by little, and how likely each is."""
    some = pairs.take(slice(None, None, -(-len(pairs) // _LOOKED_AT)))
    guesses = [*some.a.normals, *-some.b.normals]
    if not frame.A.solid:
        guesses += list(-some.a.normals)
    if not frame.B.solid:
        guesses += list(some.b.normals)
    edges_a, edges_b = (side.corners[:, [1, 2, 0]] - side.corners for side in (some.a, some.b))
    crosses = cross(edges_a[:, :, None], edges_b[:, None]).reshape(-1, 3)
    guesses += [*crosses, *-crosses]
    mean = pairs.a.normals.sum(axis=0) - pairs.b.normals.sum(axis=0)
    first = [*_frequent(pairs.a.normals, mean), *_frequent(-pairs.b.normals, mean), mean]
    candidates = np.array([*first, *guesses])
    size = lengths_of(candidates)
    is_vector = size > 1e-12 * size.max(initial=0.0)
    n_first = int(is_vector[: len(first)].sum())
    candidates = candidates[is_vector] / size[is_vector][:, None]
    _, distinct = np.unique(np.round(candidates * 2.0**24), axis=0, return_index=True)
    distinct.sort()
    candidates, n_first = candidates[distinct], int((distinct < n_first).sum())
    if not len(candidates):
        return [], np.zeros(0)
    worth = _support(some, candidates)
    order = np.lexsort((np.arange(len(candidates)), -np.round(worth * 2.0**20)))[:_NORMALS].tolist()
    selected = list(dict.fromkeys([*range(n_first), *order]))
    return [candidates[k] + 0.0 for k in selected], worth[selected]


def _frequent(normals: np.ndarray, towards: np.ndarray) -> list[np.ndarray]:
    """The commonest of these normals, of those that do not point away from ``towards``."""
    fit = normals[((normals * towards).sum(axis=1) >= 0.0) & normals.any(axis=1)]
    if not len(fit):
        return []
    _, first, counts = np.unique(np.round(fit * 2.0**24), axis=0, return_index=True, return_counts=True)
    order = np.lexsort((first, -counts))[:_FREQUENT]
    return [fit[k] for k in first[order]]


def _support(pairs: Pairs, normals: np.ndarray) -> np.ndarray:
    """(m,) mean over the pairs of how far A stays behind, and B before, the plane through their common point: 0 …
    −1.
    """
    middle = 0.5 * (pairs.near.point_a + pairs.near.point_b)
    worst = np.zeros((len(normals), len(pairs)))
    for side, sign in ((pairs.a, -1.0), (pairs.b, 1.0)):
        away = sign * (side.corners - middle[:, None])
        size = lengths_of(away).max(axis=1)
        away = away / np.where(size > 0.0, size, 1.0)[:, None, None]
        rise = (normals[:, None, None] * away[None]).sum(axis=3).min(axis=2)
        worst = np.minimum(worst, rise)
    return worst.mean(axis=1)
