"""How deep two overlapping bodies of facets are: a translation proven to separate them, as short as was found.

The shortest separating translation has no formula. A translation is proven where the exact test finds the bodies
apart after the move, whatever led to the translation; so directions are guessed, and lengths tried. A translation that
separates the hulls separates the bodies, too, and is the longest answer given.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from collide.lowering.facet_bodies import Body
from collide.narrowphase.facets.facet_queries import all_hits

#: Lengths tried in every direction: what separates the hulls, halved so many times; the same again from the last of
#: them where that separates the bodies, too: they touch, or nearly.
_HALVINGS, _AGAIN = 16, 3
#: Then, in the best direction, so many lengths between the best and its half, so many times.
_BETWEEN, _ROUNDS = 16, 3
#: So few translations are tried at once.
_FEWEST_TRIED = 16
#: Meeting pairs of facets whose normals are added up to a guess, about so many at most: large terrain has millions.
_MAX_GUESSED = 1 << 16
#: Pairs of facets whose normals are tried one by one.
_FACETS = 3
_UP = 1 + 2.0**-48

#: (A, B, poses of A, poses of B) → (n,) bool, False only where they are proven apart.
Hits = Callable[[Body, Body, np.ndarray, np.ndarray], np.ndarray]


class SeparatingTranslation(NamedTuple):
    """A translation of B that separates the bodies: its length, the length rounded upwards [m], and a unit direction
    (3,)."""

    length: float
    bound: float
    normal: np.ndarray


def separating_translation(
    A: Body, B: Body, X_WA, X_WB, hull_row: np.ndarray, candidates: list[np.ndarray], hits: Hits
) -> SeparatingTranslation:
    """A translation that separates two meeting bodies, at poses (4, 4).

    hull_row : the row of their hulls.   candidates : translations (3,) to be tried first.   hits : whether bodies meet.
    """
    best, bound, normal = -float(hull_row["distance"]), -float(hull_row["lower"]), hull_row["normal"].copy()
    known = SeparatingTranslation(max(best, 0.0), max(bound, 0.0), normal)
    if known.bound == 0.0:
        return known
    directions = _directions(A, B, X_WA, X_WB, [normal, *candidates])
    return shortened(lambda X, Y: hits(A, B, X, Y), X_WA, X_WB, known, directions, candidates)


def translation_to(moved: np.ndarray, X_WB: np.ndarray) -> SeparatingTranslation:
    """The translation from a pose (4, 4) to a moved pose, as the doubles of both are; the moved pose separates."""
    step = moved[:3, 3] - X_WB[:3, 3]
    length, bound = length_of_step(step)
    return SeparatingTranslation(length, bound, step / length)


def write_depth(row: np.ndarray, point: np.ndarray, translation: SeparatingTranslation) -> None:
    """Make the depth of a row of meeting bodies a translation's length, in place; point: a common point (3,)."""
    length, bound, normal = translation
    row["distance"], row["lower"], row["normal"] = 0.0 - length, 0.0 - bound, normal + 0.0
    row["point_a"], row["point_b"] = point + 0.5 * length * normal, point - 0.5 * length * normal
    row["certified"] &= bound == 0.0


def shortened(
    meet: Callable, X_WA, X_WB, known: SeparatingTranslation, directions: np.ndarray, candidates: list[np.ndarray]
) -> SeparatingTranslation:
    """The shortest translation found that separates two bodies, at most as long as a known separating translation.

    meet : (n, 4, 4), (n, 4, 4) → (n,) bool, False only where the bodies are proven apart.   directions : (k, 3) unit
    vectors to be tried.   candidates : translations (3,) to be tried first.
    """
    best, bound, normal = known

    def try_shorter(steps: np.ndarray) -> np.ndarray | None:
        """The shortest separating step of (n, 3), now the best, if shorter than the best so far; else ``None``."""
        nonlocal best, bound
        shortest = shortest_separating(meet, X_WA, X_WB, steps, best)
        if shortest is not None:
            best, bound = length_of_step(shortest)
        return shortest

    longest = bound
    tried = np.array(candidates).reshape(-1, 3)
    for _ in range(_AGAIN):
        lengths = longest * 2.0 ** -np.arange(1, _HALVINGS + 1)
        steps = (directions[:, None] * lengths[None, :, None]).reshape(-1, 3)
        for some in (tried, steps):
            shortest = try_shorter(some)
            normal = normal if shortest is None else shortest / best
        if best > 1.5 * lengths[-1]:
            break
        longest, tried = lengths[-1], tried[:0]
    low = 0.5 * best
    for _ in range(_ROUNDS):
        lengths = low + (best - low) * np.arange(1, _BETWEEN) / _BETWEEN
        step = (best - low) / _BETWEEN
        try_shorter(normal * lengths[:, None])
        low = max(low, best - step)
    return SeparatingTranslation(best, bound, normal)


def shortest_separating(meet: Callable, X_WA, X_WB, steps: np.ndarray, below: float) -> np.ndarray | None:
    """The shortest of the translations (n, 3) that separates the bodies and is shorter than ``below`` [m], as the
    rounded pose really moves B; ``None`` where no translation does.

    The shorter half is asked about first, then half of the rest: translations longer than a separating translation are
    not asked about. Long translations are the dear ones: bodies apart have to be proven apart everywhere.

    Far from the world's origin a short step rounds to 0: the moved bodies would stand as before, and a step of 0 has no
    direction.
    """
    moved = np.repeat(X_WB[None], len(steps), axis=0)
    moved[:, :3, 3] += steps
    really = moved[:, :3, 3] - X_WB[:3, 3]
    squares = np.square(really).sum(axis=1)
    order = np.argsort(squares, kind="stable")
    order = order[(squares[order] > 0.0) & (np.sqrt(squares[order]) < below)]
    while len(order):
        some = order[: max(_FEWEST_TRIED, len(order) // 2)]
        apart = some[~meet(np.repeat(X_WA[None], len(some), axis=0), moved[some])]
        if len(apart):
            return really[apart[0]]
        order = order[len(some) :]
    return None


def length_of_step(step: np.ndarray) -> tuple[float, float]:
    """(length, proven upper bound) of a difference of doubles, each coordinate rounded once."""
    length = float(np.sqrt(np.square(step).sum()))
    return length, length * _UP + 5e-324


def _directions(A: Body, B: Body, X_WA, X_WB, first: list[np.ndarray]) -> np.ndarray:
    """(k, 3) unit vectors along which a separating translation may be short: of hulls, of meeting facets, of axes."""
    pairs = all_hits(A.tree, B.tree, X_WA, X_WB, _MAX_GUESSED).pairs
    guesses = list(first)
    if len(pairs):
        of_a, of_b = _normals(A, X_WA, pairs[:, 0]), -_normals(B, X_WB, pairs[:, 1])
        means = of_a.sum(axis=0), of_b.sum(axis=0)
        guesses += [*means, means[0] + means[1], *of_a[:_FACETS], *of_b[:_FACETS]]
    guesses += [*np.eye(3), *-np.eye(3), *X_WA[:3, :3].T, *-X_WA[:3, :3].T, *X_WB[:3, :3].T, *-X_WB[:3, :3].T]
    lengths = np.sqrt(np.square(guesses).sum(axis=1))
    nonzero = lengths > 1e-100
    return np.array(guesses)[nonzero] / lengths[nonzero, None]


def _normals(body: Body, X: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(k, 3) unit normals of facets in the world, 0 of those without area."""
    corners = body.tree.triangles[body.tree.places[facets]].reshape(-1, 3, 3)
    u, v = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    u, v = ((X[:3, :3] * w[:, None]).sum(axis=2) for w in (u, v))
    n = np.cross(u, v)
    lengths = np.sqrt(np.square(n).sum(axis=1))[:, None]
    return np.where(lengths > 0.0, n / np.where(lengths > 0.0, lengths, 1.0), 0.0)
