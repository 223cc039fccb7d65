"""What lies outside of convex sets: the answer of an audit, and the share of facets outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.spheres.convex_pieces import Balls, ConvexPieces
from collide.spheres.facet_cover import bisected

#: The share of the surface is known to this part; pieces are at most so many.
_SHARE, _MAX_PIECES = 0.005, 200_000
_BLOCK = 1 << 20


class PieceAudit(NamedTuple):
    """Convex pieces beside a body, all in the frame of the body.

    encloses : whether the pieces contain the body, proven; of spheres by a certificate checked in integers.
    outside : (lower, upper) of the greatest distance of a point of the surface from the pieces [m], proven; 0, 0 for
        pieces with all of it inside.
    farthest : (3,) a point of the facets outside by ``outside[0]``, for curved parts of the facets around.
    share : (lower, upper) of the share of the facets' area outside, proven; of curved parts of the facets around. Of
        pieces other than spheres flush facets count as inside: up to 2⁻⁴⁶ of the largest coordinate.
    area : of the facets [m²].
    excess : (lower, upper) of the greatest distance of a point of the pieces from the body [m], proven, as of
        `EnclosingSpheres`.
    holes : (k, 3) places inside a solid left out by pieces around all its facets; of spheres corners of the union.
    patches : (l, 3, 3) parts of facets outside the pieces, for pictures.
    """

    encloses: bool
    outside: tuple[float, float]
    farthest: np.ndarray
    share: tuple[float, float]
    area: float
    excess: tuple[float, float]
    holes: np.ndarray
    patches: np.ndarray


def area_outside(
    corners: np.ndarray, cover: Balls | ConvexPieces
) -> tuple[float, tuple[float, float], np.ndarray]:
    """(area, bracket of the share outside all sets, pieces outside). Pieces on both sides are cut until their area
    is small: inside are pieces with all corners in a set, outside pieces off all sets.
    """
    area = float(_areas(corners).sum())
    if not area > 0.0:
        return 0.0, (0.0, 0.0), corners[:0]
    outside, n_pieces = [corners[:0]], 0
    while len(corners):
        inside, off = _sides(corners, cover)
        outside.append(corners[off])
        corners = corners[~inside & ~off]
        n_pieces += 2 * len(corners)
        if _areas(corners).sum() <= _SHARE * area or n_pieces > _MAX_PIECES:
            break
        corners, _ = bisected(corners)
    pieces = np.concatenate(outside)
    known, open_area = float(_areas(pieces).sum()), float(_areas(corners).sum())
    middle = corners.mean(axis=1)
    poking = cover.nearest(middle) > 0.0
    # Sums of thousands of rounded areas: 1e-9 is far above their rounding.
    bracket = max(known / area - 1e-9, 0.0), min((known + open_area) / area + 1e-9, 1.0)
    return area, bracket if len(pieces) or len(corners) else (0.0, 0.0), np.concatenate([pieces, corners[poking]])


def _sides(corners: np.ndarray, cover: Balls | ConvexPieces) -> tuple[np.ndarray, np.ndarray]:
    """(m,) whether a piece is in a set, and whether it is off all sets."""
    inside, off = np.empty(len(corners), dtype=bool), np.empty(len(corners), dtype=bool)
    step = max(1, _BLOCK // (3 * cover.size))
    for start in range(0, len(corners), step):
        some = corners[start : start + step]
        inside[start : start + step] = cover.away(some).max(axis=1).min(axis=1) <= cover.slack
        off[start : start + step] = cover.off(some)
    return inside, off


def _areas(corners: np.ndarray) -> np.ndarray:
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * np.sqrt(np.square(n).sum(axis=1))
