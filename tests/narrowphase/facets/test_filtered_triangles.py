"""Triangles in doubles: a verdict holds for every place that the error leaves to B's corners, and most are verdicts."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from naive import rng_of
from naive_triangles import as_integers, cross, inner, minus, triangles_meet, world_points
from posed_facets import FAMILIES, posed_pair

from collide.narrowphase.facets.filtered_triangles import (
    AMBIGUOUS,
    APART,
    MEETING,
    meeting_in_doubles,
    segment_against_triangle,
)

pytestmark = pytest.mark.plain_kernels

ERRORS = (0.0, 1e-15, 1e-9, 1e-3, 0.05)


def exact(*triangles):
    return as_integers(*(world_points(T, np.eye(4)) for T in triangles))


def perturbed(rng, Q, error: float) -> np.ndarray:
    """Every coordinate off by less than the error, mostly by all of it."""
    off = rng.choice([-1.0, -1.0, 1.0, 1.0, 0.0], (3, 3)) * error
    return Q + np.clip(off, -error, error) * (1 - 1e-9)


@pytest.mark.many(2)
@pytest.mark.parametrize("family", FAMILIES)
def test_verdicts_hold_within_the_error(family):
    rng = rng_of("filtered triangles", family)
    seen: Counter = Counter()
    for k in range(200):
        P, Q, X_WA, X_WB = posed_pair(rng, family)
        if family == "near touching":
            Q = (Q @ X_WB[:3, :3].T + X_WB[:3, 3] - X_WA[:3, 3]) @ X_WA[:3, :3]
        error = ERRORS[k % len(ERRORS)]
        verdict = meeting_in_doubles(P.ravel(), 0, Q.ravel(), 0, error)
        seen[verdict] += 1
        for where in (Q, perturbed(rng, Q, error), perturbed(rng, Q, error)):
            told = f"P, Q, B, error = {P.tolist()}, {Q.tolist()}, {where.tolist()}, {error}"
            assert verdict in (AMBIGUOUS, MEETING if triangles_meet(*exact(P, where)) else APART), told
    if family == "random":
        assert seen[AMBIGUOUS] < 80 and min(seen[APART], seen[MEETING]) > 20, seen
    elif family in ("lattice", "touching"):
        assert seen[APART] > 40 and seen[AMBIGUOUS] > 40, seen
    else:
        assert seen[AMBIGUOUS] > 100, seen


def axes_between(P, Q) -> np.ndarray:
    """Unit vectors among which one parts two triangles in general position, where they are apart."""
    edges = [T - np.roll(T, 1, axis=0) for T in (P, Q)]
    normals = [np.cross(e[0], e[1]) for e in edges]
    across = [np.cross(e, f) for e in edges[0] for f in edges[1]]
    within = [np.cross(n, e) for n, side in zip(normals, edges) for e in side]
    axes = np.array([*normals, *across, *within])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return np.concatenate([axes, -axes])


def test_verdicts_hold_on_the_brink():
    """B a few errors before or behind touching, moved by all of the error towards the other side."""
    rng = rng_of("brink of triangles")
    seen: Counter = Counter()
    for k in range(600):
        P, Q = rng.uniform(-1.0, 1.0, (2, 3, 3))
        if k % 3 == 0:  # no plane of either parts slender ones
            P[2], Q[2] = P[1] + 0.1 * P[2], Q[0] + 0.1 * Q[2]
        axes = axes_between(P, Q)
        gaps = (Q @ axes.T).min(axis=0) - (P @ axes.T).max(axis=0)
        best, error = int(np.argmax(gaps)), float(rng.choice([1e-3, 1e-9]))
        share = rng.uniform(-1.5, 1.5)
        # Rounded, so that the brink is where it is said to be.
        Q = Q + (share * np.abs(axes[best]).sum() * error - gaps[best]) * axes[best]
        verdict = meeting_in_doubles(P.ravel(), 0, Q.ravel(), 0, error)
        where = Q - np.copysign(error * (1 - 1e-9), share) * np.sign(axes[best])
        told = f"P, Q, B, error = {P.tolist()}, {Q.tolist()}, {where.tolist()}, {error}"
        assert verdict in (AMBIGUOUS, MEETING if triangles_meet(*exact(P, where)) else APART), told
        seen[verdict, triangles_meet(*exact(P, where)) != triangles_meet(*exact(P, Q))] += 1
    assert seen[AMBIGUOUS, True] > 200, seen


def test_random_pairs_are_nearly_all_decided():
    rng = rng_of("decided triangles")
    verdicts = [meeting_in_doubles(*rng.normal(size=9)[None], 0, rng.normal(size=9), 0, 1e-15) for _ in range(1000)]
    assert verdicts.count(AMBIGUOUS) <= 1 and min(verdicts.count(APART), verdicts.count(MEETING)) > 50


def test_segments():
    """MEETING is through the inside; which side the start is on is told of all that is certain."""
    rng = rng_of("segments against triangles")
    seen: Counter = Counter()
    for k in range(600):
        P, Q, _, _ = posed_pair(rng, ("lattice", "random")[k % 2])
        error = ERRORS[k % len(ERRORS)]
        verdict, above = segment_against_triangle(P.ravel(), 0, Q.ravel(), 3, 6, error)
        where = perturbed(rng, Q, error)
        (a, b, c), (_, p, q) = exact(P, where)
        n = cross(minus(b, a), minus(c, a))
        start, end = inner(n, minus(p, a)), inner(n, minus(q, a))
        told = f"T, S, error = {P.tolist()}, {where.tolist()}, {error}"
        if verdict == MEETING:
            rims = [inner(cross(minus(y, x), minus(p, x)), minus(q, x)) for x, y in ((a, b), (b, c), (c, a))]
            assert start * end < 0 and (min(rims) > 0 or max(rims) < 0) and above == (start > 0), told
        elif verdict == APART:
            assert not triangles_meet([a, b, c], [p, q, q]), told
        seen[verdict, k % 2] += 1
    assert min(seen[verdict, 1] for verdict in (APART, MEETING)) >= 10 and seen[AMBIGUOUS, 0] > 40, seen
