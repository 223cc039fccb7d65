"""Boxes on boxes, as in every workcell: flush, exactly flush, at rest, and turned by 90°."""

from __future__ import annotations

import numpy as np

from collide.scenes.families.case import Body, Case, pair
from collide.scenes.families.ingredients import (
    EXACT_ROTATIONS,
    box,
    decimals,
    direction,
    power,
    prism,
    rotation,
    rotation_about,
    sign,
)


def stacked(rng, lower, upper, gap: float = 0.0, *, turned: bool = False) -> np.ndarray:
    """Where the upper box's centre stands, seen from the lower one's: on top, overlapping it in plan.

    lower, upper : full lengths (3,). Two decimals sideways, so that only the height is delicate.
    turned : they may be turned about z, and overlap all the same.
    """
    lower, upper = np.asarray(lower), np.asarray(upper)
    free = 0.3 * (lower[:2].min() + upper[:2].min()) if turned else 0.45 * (lower + upper)[:2]
    return np.array([*np.round(rng.uniform(-1, 1, 2) * free, 2), lower[2] / 2 + upper[2] / 2 + gap])


def boxes_flush(rng, index) -> Case:
    """Stacked boxes with two-decimal sizes, nominally flush: axis-aligned, turned about z, tilted
    together, tilted and turned in turn; input rounding decides the exact answer."""
    lower, upper = decimals(rng, 0.1, 2), decimals(rng, 0.1, 2)
    base = decimals(rng, -2, 2)
    turned, tilted = index % 4 in (1, 3), index % 4 in (2, 3)
    between = stacked(rng, lower, upper, turned=turned)
    R = rotation(rng) if tilted else np.eye(3)
    R1, R2 = (R @ rotation_about(2, rng.uniform(0, 2 * np.pi)) if turned else R for _ in range(2))
    return pair(Body(box(lower), R1, R @ base), Body(box(upper), R2, R @ (base + between)))


def boxes_exact(rng, index) -> Case:
    """Dyadic boxes exactly flush: face to face (full and partial), edge to edge, corner to corner."""
    a, b = rng.integers(1, 33, 3) / 8.0, rng.integers(1, 33, 3) / 8.0
    flush = (1, 1, 2, 3)[index % 4]  # along how many axes they are flush
    if index % 4 == 0:
        b[1:] = a[1:]
    touching = (a + b) / 2 * rng.choice((-1.0, 1.0), 3)
    # Elsewhere the offset is any dyadic one for which they overlap along that axis.
    inside = np.trunc(rng.uniform(-0.9, 0.9, 3) * (a + b) / 2 * 16) / 16
    between = np.where(np.arange(3) < flush, touching, inside)
    if index % 4 == 0:
        between[1:] = 0.0
    order = rng.permutation(3)
    a, b, between = a[order], b[order], between[order]
    base, G = rng.integers(-64, 65, 3) / 16.0, EXACT_ROTATIONS[rng.integers(24)]
    bodies = []
    for size, centre in ((a, base), (b, base + between)):
        R = EXACT_ROTATIONS[rng.integers(24)]
        bodies.append(Body(box(np.abs(R.T @ size)), G @ R, G @ centre))
    return pair(*bodies)


def boxes_rest(rng, index) -> Case:
    """Stacked boxes with gap ±10^U(-9,-2) of the smallest side, as a simulator leaves them, half of
    them tilted."""
    lower, upper = decimals(rng, 0.1, 2), decimals(rng, 0.1, 2)
    gap = sign(rng) * power(rng, -9, -2) * min(*lower, *upper)
    R = rotation(rng) if index % 2 else np.eye(3)
    base = decimals(rng, -2, 2)
    between = stacked(rng, lower, upper, gap, turned=True)
    R1, R2 = (R @ rotation_about(2, rng.uniform(0, 2 * np.pi)) for _ in range(2))
    return pair(Body(box(lower), R1, R @ base), Body(box(upper), R2, R @ (base + between)))


def rot90(rng, index) -> Case:
    """Boxes and octagonal prisms nearly flush (gap 0, ±1e-9, ±1e-4) under 90° rotations made from
    cosines (6e-17), tilts of 1e-9 rad, tilts of 10^U(-12,-5) rad."""
    gap = float(rng.choice((0.0, 1e-9, -1e-9, 1e-4, -1e-4)))
    lower, upper = decimals(rng, 0.1, 2), decimals(rng, 0.1, 2)
    axis, quarters = int(rng.integers(3)), int(rng.integers(4))
    R2 = rotation_about(axis, quarters * np.pi / 2)
    seen = np.abs(np.round(R2)) @ upper  # its lengths along the world's axes
    between = stacked(rng, lower, seen, gap)
    tilt = (0.0, 1e-9, power(rng, -12, -5))[index % 3]
    d = direction(rng) * [1, 1, 0]
    R2 = rotation_about(0, tilt * d[0]) @ rotation_about(1, tilt * d[1]) @ R2
    A = _octagonal(lower) if rng.random() < 0.3 else box(lower)
    B = _octagonal(upper) if rng.random() < 0.3 else box(upper)
    return pair(Body(A, np.eye(3), np.zeros(3)), Body(B, R2, between))


def _octagonal(size: np.ndarray) -> np.ndarray:
    """An octagonal prism that just fits a box of these lengths, flush with all its sides."""
    unit = prism(8, 0.5, 1.0) @ rotation_about(2, np.pi / 8).T
    return unit / (2 * np.abs(unit).max(axis=0)) * size


FAMILIES = (boxes_flush, boxes_exact, boxes_rest, rot90)
