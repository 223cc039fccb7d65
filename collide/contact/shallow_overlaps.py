"""Separating translations of shallow overlaps: along which normals, and how far, meeting facets come apart.

No single translation may separate two bodies gripping each other, so pairs of facets are separated group by group.
Candidates are normals of facets and cross products of edges (`candidate_normals.py`). Two facets share points along a
normal over an interval of translations, whose end is their depth along the normal (`contact_points.depth_along`).
"""

from __future__ import annotations

import math

from collide.contact.candidate_normals import (
    AS_GOOD,
    MAX_NORMALS,
    MAX_TRANSLATIONS,
    N_CANDIDATES,
    N_WAYS,
    add_guesses,
    best_candidate,
    first_candidates,
)
from collide.contact.contact_pairs import (
    PASSABLE,
    REACHED,
    SEED,
    TOUCHING,
    facing_a,
    facing_b,
    pair_meets,
    spread,
)
from collide.contact.contact_points import View, depth_along
from collide.contact.support_face import axes_across
from collide.kernels import kernel
from collide.numerics.vec3 import put_vec3, vec3_at

#: A longer translation is preferred where it separates more pairs, up to so many times the length needed for all.
_LONGER = 4.0
#: Sines below which all facets of the pairs count as lying on their side of a plane.
_PLANE = 2.0**-6
#: A facet may turn away from the normal of its patch by this cosine.
_TURNED = 0.25
#: A translation is longer than the depth measured by so many errors of a coordinate.
STEP_ERRORS = 64.0


@kernel
def separate_pairs(pairs, A, B, error, limit, translations, points):
    """Find translations, no longer than ``limit`` [m], to part the TOUCHING pairs, and put the number of each pair's
    translation into ``groups``; whether meeting pairs are left without a translation.
    """
    n_looked_at = first_candidates(pairs, translations)
    translations.counts[N_WAYS] = 0
    for attempt in range(2):
        best = best_candidate(translations)
        # A plane that all but separates them as they are: no normal is much shorter.
        if best >= 0 and translations.worths[best] >= -_PLANE and _part_at_once(
            pairs, A, B, error, limit, vec3_at(translations.normals, 3 * best), translations, points
        ):
            return False
        if attempt == 0:
            add_guesses(pairs, A, B, n_looked_at, translations)
    if _part_all(pairs, A, B, error, limit, translations, points):
        return False
    if translations.counts[N_CANDIDATES] > 0:
        _measure_depths(pairs, A, B, error, limit, translations, points)
        _group_pairs(pairs, A, B, error, translations)
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING and pairs.groups[k] < 0 and pair_meets(pairs, k):
            return True
    return False


# --- depths and groups --------------------------------------------------------------------------


@kernel(inline=True)
def any_side_view(axes, error):
    """A view along which depths are measured."""
    return View(axes, error, -math.inf, math.inf, True, False)


@kernel(inline=True)
def _is_before(pairs, k, n, A, B):
    """Whether A's facet of the pair does not look against n, nor B's along n, by much: other pairs come apart by going
    deeper in.
    """
    return facing_a(pairs, k, n, A) >= -_TURNED and facing_b(pairs, k, n, B) >= -_TURNED


@kernel
def _part_at_once(pairs, A, B, error, limit, n, translations, points):
    """Whether a translation along n parts all touching pairs; stores the translation alone then."""
    view = any_side_view(axes_across(n), error)
    deepest = 0.0
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            if not _is_before(pairs, k, n, A, B):
                return False
            deepest = max(deepest, depth_along(pairs, k, A, B, view, points, deepest))
            if deepest > limit:
                return False
    length = _length_for(deepest, error)
    if length > limit:
        return False
    _take_all(pairs, n, length, translations)
    return True


@kernel
def _take_all(pairs, n, length, translations):
    """Assign a translation to all touching pairs."""
    _add_translation(n, length, translations)
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            pairs.groups[k] = 0


# --- one translation for all --------------------------------------------------------------------


@kernel
def _part_all(pairs, A, B, error, limit, translations, points):
    """Whether `_group_pairs` would take the same translation for all touching pairs; stores the translation alone then.

    Taken is the shortest translation to part all, with at least half of the pairs facing along its normal, unless too
    long for the deepest pair's need. Most candidates are given up at the previous candidate's deepest pair.
    """
    best, best_length, best_faces_all, deepest = -1, math.inf, False, -1
    for i in range(translations.counts[N_CANDIDATES]):
        max_length = min(limit, best_length * (1.0 + 2.0**-20) + STEP_ERRORS * error)
        n = vec3_at(translations.normals, 3 * i)
        length, faces_all, k = _length_for_all(pairs, A, B, error, max_length, n, deepest, points)
        if not length < math.inf:
            continue
        shorter = length < best_length * (1.0 - 2.0**-20) - STEP_ERRORS * error
        if shorter or translations.worths[i] > translations.worths[best] + AS_GOOD:
            best, best_length, best_faces_all, deepest = i, length, faces_all, k
    if best < 0 or not best_faces_all:
        return False
    shortest = math.inf
    for i in range(translations.counts[N_CANDIDATES]):
        n = vec3_at(translations.normals, 3 * i)
        if _is_before(pairs, deepest, n, A, B):
            view = any_side_view(axes_across(n), error)
            length = _length_for(depth_along(pairs, deepest, A, B, view, points, 0.0), error)
            shortest = min(shortest, length)
    if best_length > _LONGER * shortest:
        return False
    _take_all(pairs, vec3_at(translations.normals, 3 * best), best_length, translations)
    return True


@kernel
def _length_for_all(pairs, A, B, error, max_length, n, first, points):
    """(the length along n to part all touching pairs, whether all face along n, the pair in need of the length);
    infinite beyond ``max_length`` [m] and where fewer than half face along n.

    first : a pair to begin with, or −1.
    """
    view = any_side_view(axes_across(n), error)
    depth, deepest = 0.0, max(first, 0)
    if first >= 0:
        depth = depth_along(pairs, first, A, B, view, points, 0.0)
        if _length_for(depth, error) > max_length:
            return math.inf, False, first
    n_touching, n_before = 0, 0
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            n_touching += 1
            if _is_before(pairs, k, n, A, B):
                n_before += 1
            of_k = depth_along(pairs, k, A, B, view, points, depth)
            if of_k > depth or (n_touching == 1 and first < 0):
                depth, deepest = of_k, k
                if _length_for(depth, error) > max_length:
                    return math.inf, False, deepest
    if n_before == 0 or 2 * n_before < n_touching:
        return math.inf, False, deepest
    return _length_for(depth, error), n_before == n_touching, deepest


@kernel(inline=True)
def _length_for(depth, error):
    return depth * (1.0 + 2.0**-30) + STEP_ERRORS * error


@kernel
def _add_translation(n, length, translations):
    number = translations.counts[N_WAYS]
    put_vec3(translations.ways, 3 * number, n)
    translations.lengths[number] = length
    translations.counts[N_WAYS] = number + 1
    return number


@kernel
def _measure_depths(pairs, A, B, error, limit, translations, points):
    """Lengths of the translations along each candidate that part each touching pair; infinite beyond the limit."""
    for i in range(translations.counts[N_CANDIDATES]):
        view = any_side_view(axes_across(vec3_at(translations.normals, 3 * i)), error)
        for k in range(pairs.n):
            if pairs.states[k] & TOUCHING:
                length = _length_for(depth_along(pairs, k, A, B, view, points, 0.0), error)
                translations.depths[MAX_NORMALS * k + i] = length if length <= limit else math.inf


@kernel
def _longest_needed(pairs, A, B, translations):
    """The least length within which every separable pair is separated by some translation [m]."""
    longest = 0.0
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            shortest = math.inf
            for i in range(translations.counts[N_CANDIDATES]):
                length = translations.depths[MAX_NORMALS * k + i]
                if length < shortest and _is_before(pairs, k, vec3_at(translations.normals, 3 * i), A, B):
                    shortest = length
            if shortest < math.inf:
                longest = max(longest, shortest)
    return longest


@kernel
def _gain(pairs, A, B, i, limit, translations):
    """Gain of candidate i for pairs without a group, within a length: (number of pairs separated, length to separate
    them, number of these facing along the normal, length to separate these).
    """
    n = vec3_at(translations.normals, 3 * i)
    gained, needed, forward, needed_forward = 0, 0.0, 0, 0.0
    for k in range(pairs.n):
        length = translations.depths[MAX_NORMALS * k + i]
        if pairs.states[k] & TOUCHING and pairs.groups[k] < 0 and length <= limit:
            gained += 1
            needed = max(needed, length)
            if _is_before(pairs, k, n, A, B):
                forward += 1
                needed_forward = max(needed_forward, length)
    return gained, needed, forward, needed_forward


@kernel
def _group_pairs(pairs, A, B, error, translations):
    """Choose translations, always the next to part most pairs, and put its number into their ``groups``."""
    limit = _LONGER * _longest_needed(pairs, A, B, translations)
    while translations.counts[N_WAYS] < MAX_TRANSLATIONS:
        best, best_gain, best_length = -1, 0, math.inf
        for attempt in range(2):
            # Pairs connected with a group come apart with it; but at least half must face along the normal.
            for i in range(translations.counts[N_CANDIDATES]):
                gain, length, forward, needed_forward = _gain(pairs, A, B, i, limit, translations)
                if attempt == 1:
                    gain, length = forward, needed_forward
                if forward == 0 or 2 * forward < gain or gain < best_gain:
                    continue
                shorter = length < best_length * (1.0 - 2.0**-20) - STEP_ERRORS * error
                as_long = not shorter and length <= best_length * (1.0 + 2.0**-20) + STEP_ERRORS * error
                better = as_long and best >= 0 and translations.worths[i] > translations.worths[best] + AS_GOOD
                if gain > best_gain or shorter or better:
                    best, best_gain, best_length = i, gain, length
            if best >= 0:
                break
        if best < 0:
            return
        _take_group(pairs, A, B, best, best_length, translations)


@kernel
def _take_group(pairs, A, B, i, length, translations):
    """Make candidate i the translation of pairs parted within a length and facing along its normal, and of parted pairs
    linked with them, whichever way these face.
    """
    n = vec3_at(translations.normals, 3 * i)
    for k in range(pairs.n):
        pairs.states[k] &= ~(SEED | PASSABLE)
        if pairs.states[k] & TOUCHING and pairs.groups[k] < 0 and translations.depths[MAX_NORMALS * k + i] <= length:
            pairs.states[k] |= PASSABLE
            if _is_before(pairs, k, n, A, B):
                pairs.states[k] |= SEED
    spread(pairs)
    number = _add_translation(n, length, translations)
    for k in range(pairs.n):
        if pairs.states[k] & REACHED:
            pairs.groups[k] = number
