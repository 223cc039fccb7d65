"""Normals along which meeting pairs of facets may come apart by little: of facets, and of crossed edges."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from collide.contact.contact_pairs import TOUCHING
from collide.contact.internal_edges import cross_of_edges
from collide.kernels import kernel, view_f64, view_i64
from collide.kernels.lanes import LANES, select, view_lanes
from collide.narrowphase.facets.facets_within import NUMBERS_OF_PAIR, POINT_A, POINT_B
from collide.numerics.vec3 import Vec3, add, dot, neg, norm, put_vec3, scale, sub, vec3_at

#: Normals tried, of which so many are the most frequent of each body; pairs looked at to choose them, and those whose
#: facets and edges are tried.
MAX_NORMALS, _FREQUENT, _LOOKED_AT, _GUESSED_FROM = 14, 3, 24, 16
#: Different normals of a body that are counted; components nearer than this are the same.
_MAX_DISTINCT, _SAME = 16, 2.0**-24
#: Candidates whose worth differs by less are as good: the first counts.
AS_GOOD = 2.0**-20

# Workspace: normals, worths; translations' normals, lengths; looked-at corners; counted normals. Then depths,
# MAX_NORMALS a pair.
N_CANDIDATES, N_WAYS = range(2)
MAX_TRANSLATIONS = 64
_NUMBERS = 4 * MAX_NORMALS + 4 * MAX_TRANSLATIONS + 18 * _LOOKED_AT + 4 * _MAX_DISTINCT + LANES
TRANSLATION_WORDS = _NUMBERS + 8


class Translations(NamedTuple):
    """What is known of ways to part pairs that meet, or nearly.

    normals, worths : candidates.   lengths : of the translations [m], along ``ways``.   depths : MAX_NORMALS a pair.
    looked_at : corners of some pairs seen from where they touch, in units of the farthest: of eight pairs a block of
    18 coordinates, in each the eight beside each other; `lanes` is the same memory.   behind : eight numbers, out of
    lanes.   counted : normals.
    counts : N_CANDIDATES, N_WAYS.
    """

    normals: Any
    worths: Any
    ways: Any
    lengths: Any
    looked_at: Any
    lanes: Any
    counted: Any
    behind: Any
    behind_lanes: Any
    depths: Any
    counts: Any


@kernel
def open_translations(words_at, depths_at, capacity):
    at = words_at
    normals, worths = view_f64(at, 3 * MAX_NORMALS), view_f64(at + 24 * MAX_NORMALS, MAX_NORMALS)
    at += 32 * MAX_NORMALS
    ways, lengths = view_f64(at, 3 * MAX_TRANSLATIONS), view_f64(at + 24 * MAX_TRANSLATIONS, MAX_TRANSLATIONS)
    at += 32 * MAX_TRANSLATIONS
    looked_at, lanes = view_f64(at, 18 * _LOOKED_AT), view_lanes(at, 18 * _LOOKED_AT // LANES)
    at += 144 * _LOOKED_AT
    counted, behind_at = view_f64(at, 4 * _MAX_DISTINCT), at + 32 * _MAX_DISTINCT
    counts = view_i64(words_at + 8 * _NUMBERS, 8)
    depths = view_f64(depths_at, MAX_NORMALS * capacity)
    return Translations(
        normals, worths, ways, lengths, looked_at, lanes, counted, view_f64(behind_at, LANES), view_lanes(behind_at, 1),
        depths, counts,
    )


@kernel
def first_candidates(pairs, translations):
    """The most frequent normals of both bodies and the mean of all; how many pairs are looked at."""
    n_looked_at = _look_at_some(pairs, translations)
    mean = _mean_normal(pairs)
    translations.counts[N_CANDIDATES] = 0
    _add_frequent(pairs, 0, mean, n_looked_at, translations)
    _add_frequent(pairs, 1, mean, n_looked_at, translations)
    _add_candidate(mean, n_looked_at, translations)
    return n_looked_at


@kernel
def _look_at_some(pairs, translations):
    """Keep the corners of some touching pairs, as `Translations` has them; how many pairs."""
    n_touching = 0
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            n_touching += 1
    stride = (n_touching + _LOOKED_AT - 1) // _LOOKED_AT
    n, number = 0, 0
    for k in range(pairs.n):
        if not pairs.states[k] & TOUCHING:
            continue
        number += 1
        if (number - 1) % stride != 0:
            continue
        near = NUMBERS_OF_PAIR * k
        middle = scale(0.5, add(vec3_at(pairs.near, near + POINT_A), vec3_at(pairs.near, near + POINT_B)))
        for side in range(2):
            at, to = 18 * k + 9 * side, LANES * (18 * (n // LANES) + 9 * side) + n % LANES
            size = 0.0
            for j in range(0, 9, 3):
                away = sub(vec3_at(pairs.corners, at + j), middle)
                size = max(size, dot(away, away))
                _put_across(translations.looked_at, to + LANES * j, away)
            unit = (1.0 if side == 0 else -1.0) / math.sqrt(size) if size > 0.0 else 0.0
            for j in range(9):
                translations.looked_at[to + LANES * j] *= unit
        n += 1
    return n


@kernel(inline=True)
def _put_across(values, at, v):
    """A vector among the coordinates of eight."""
    values[at] = v.x
    values[at + LANES] = v.y
    values[at + 2 * LANES] = v.z


@kernel
def _mean_normal(pairs):
    """Sum of A's normals less that of B's."""
    total = Vec3(0.0, 0.0, 0.0)
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            total = add(total, sub(vec3_at(pairs.normals, 6 * k), vec3_at(pairs.normals, 6 * k + 3)))
    return total


@kernel
def _worth(n, n_looked_at, translations, floor):
    """Mean over the pairs of how far A stays behind, and B before, the plane through their common point: 0 … −1.

    floor : what is surely worth less is not worked out: something below it is returned.
    """
    total, least, corners = 0.0, (floor - 2.0**-40) * n_looked_at, translations.lanes
    for first in range(0, n_looked_at, LANES):
        at = 18 * (first // LANES)
        highest = n.x * corners[at] + n.y * corners[at + 1] + n.z * corners[at + 2]
        for j in range(at + 3, at + 18, 3):
            height = n.x * corners[j] + n.y * corners[j + 1] + n.z * corners[j + 2]
            highest = select(height > highest, height, highest)
        translations.behind_lanes[0] = highest
        for i in range(min(LANES, n_looked_at - first)):
            total += min(0.0, -translations.behind[i])
        if total < least:
            break
    return total / n_looked_at


@kernel
def _add_candidate(v, n_looked_at, translations):
    """Append the unit vector along v and its worth to the candidates, unless v is 0, the vector is among them, or they
    are full."""
    length = norm(v)
    n = translations.counts[N_CANDIDATES]
    if not length > 0.0 or n == MAX_NORMALS:
        return
    v = scale(1.0 / length, v)
    for i in range(n):
        if _are_same(v, vec3_at(translations.normals, 3 * i)):
            return
    put_vec3(translations.normals, 3 * n, v)
    translations.worths[n] = _worth(v, n_looked_at, translations, -math.inf)
    translations.counts[N_CANDIDATES] = n + 1


@kernel(inline=True)
def _are_same(a, b):
    return abs(a.x - b.x) <= _SAME and abs(a.y - b.y) <= _SAME and abs(a.z - b.z) <= _SAME


@kernel
def _add_frequent(pairs, side, mean, n_looked_at, translations):
    """Append the commonest facet normals of a body, out of normals n with n·mean ≥ 0, to the candidates."""
    sign = 1.0 if side == 0 else -1.0
    counted = translations.counted
    n = 0
    for k in range(pairs.n):
        normal = scale(sign, vec3_at(pairs.normals, 6 * k + 3 * side))
        if not pairs.states[k] & TOUCHING or dot(normal, mean) < 0.0 or dot(normal, normal) == 0.0:
            continue
        i = 0
        while i < n and not _are_same(normal, vec3_at(counted, 4 * i)):
            i += 1
        if i < n:
            counted[4 * i + 3] += 1.0
        elif n < _MAX_DISTINCT:
            put_vec3(counted, 4 * n, normal)
            counted[4 * n + 3] = 1.0
            n += 1
    for _ in range(_FREQUENT):
        best, number = 0.0, -1
        for i in range(n):
            if counted[4 * i + 3] > best:
                best, number = counted[4 * i + 3], i
        if number < 0:
            return
        counted[4 * number + 3] = 0.0
        _add_candidate(vec3_at(counted, 4 * number), n_looked_at, translations)


@kernel
def add_guesses(pairs, A, B, n_looked_at, translations):
    """The best of normals and crossed edges of some pairs, as candidates."""
    first = translations.counts[N_CANDIDATES]
    n_touching = 0
    for k in range(pairs.n):
        if pairs.states[k] & TOUCHING:
            n_touching += 1
    stride = (n_touching + _GUESSED_FROM - 1) // _GUESSED_FROM
    number = 0
    for k in range(pairs.n):
        if not pairs.states[k] & TOUCHING:
            continue
        number += 1
        if (number - 1) % stride != 0:
            continue
        normal_a, normal_b = vec3_at(pairs.normals, 6 * k), neg(vec3_at(pairs.normals, 6 * k + 3))
        _replace_worst(normal_a, first, n_looked_at, translations)
        _replace_worst(normal_b, first, n_looked_at, translations)
        if not A.solid:
            _replace_worst(neg(normal_a), first, n_looked_at, translations)
        if not B.solid:
            _replace_worst(neg(normal_b), first, n_looked_at, translations)
        for i in range(9):
            n = cross_of_edges(pairs.corners, 18 * k, i // 3, i % 3)
            _replace_worst(n, first, n_looked_at, translations)
            _replace_worst(neg(n), first, n_looked_at, translations)


@kernel
def _replace_worst(n, first, n_looked_at, translations):
    """Append a unit vector to the candidates; where these are full, replace a worse candidate from ``first`` on."""
    if dot(n, n) == 0.0:
        return
    if translations.counts[N_CANDIDATES] < MAX_NORMALS:
        _add_candidate(n, n_looked_at, translations)
        return
    worst = first
    for i in range(first, MAX_NORMALS):
        if translations.worths[i] < translations.worths[worst]:
            worst = i
    if first == MAX_NORMALS:
        return
    floor = translations.worths[worst] + AS_GOOD
    worth = _worth(n, n_looked_at, translations, floor)
    if worth <= floor:
        return
    for i in range(MAX_NORMALS):
        if _are_same(n, vec3_at(translations.normals, 3 * i)):
            return
    put_vec3(translations.normals, 3 * worst, n)
    translations.worths[worst] = worth


@kernel
def best_candidate(translations):
    best = -1
    for i in range(translations.counts[N_CANDIDATES]):
        if best < 0 or translations.worths[i] > translations.worths[best] + AS_GOOD:
            best = i
    return best
