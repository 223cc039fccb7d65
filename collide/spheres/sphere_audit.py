"""What spheres leave outside of a body, and how far they exceed it: both bracketed, whatever the spheres are."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.certificates.sphere_cover import PartCover, ball_around, flaw_of_cover, leaves_of
from collide.shapes.shape import Shape
from collide.spheres.body_facets import BodyPart, Reach, body_parts
from collide.spheres.facet_cover import bisected, certificate_of, cover_facets
from collide.spheres.sphere_excess import excess_bracket
from collide.spheres.union_corners import union_corners

#: The bracket of the greatest distance outside is this narrow, in parts of the body's size.
_NARROW = 1e-4
#: The share of the surface is known to this part; pieces are at most so many.
_SHARE, _MAX_PIECES = 0.005, 200_000
_BLOCK = 1 << 20


class SphereAudit(NamedTuple):
    """Spheres beside a body, all in the frame of the body.

    encloses : whether the spheres contain the body, proven by a certificate checked in integers.
    outside : (lower, upper) of the greatest distance of a point of the surface from the spheres [m], proven; 0, 0 for
        spheres with all of it inside.
    farthest : (3,) a point of the facets outside by ``outside[0]``, for curved parts of the facets around.
    share : (lower, upper) of the share of the facets' area outside, proven; of curved parts of the facets around.
    area : of the facets [m²].
    excess : (lower, upper) of the greatest distance of a point of the spheres from the body [m], as of
        `EnclosingSpheres`.
    holes : (k, 3) places inside a solid left out by spheres around all its facets, at corners of the union.
    pieces : (l, 3, 3) pieces of facets outside the spheres, for pictures.
    """

    encloses: bool
    outside: tuple[float, float]
    farthest: np.ndarray
    share: tuple[float, float]
    area: float
    excess: tuple[float, float]
    holes: np.ndarray
    pieces: np.ndarray


def audit_spheres(shape: Shape, centers: np.ndarray, radii: np.ndarray) -> SphereAudit:
    """How spheres (n, 3), (n,) in the frame of a shape enclose it [m], n ≥ 1; curved parts are taken by facets around.

    Raises UnsupportedQuery for shapes without facets. O(m log m) for m facets; tenths of a second for a robot's link.
    """
    parts = body_parts(shape)
    excess = excess_bracket(shape, parts, centers, radii)
    balls = [ball_around(leaf, poses, centers, radii) for leaf, poses in leaves_of(shape)]
    rest = [part for part, ball in zip(parts, balls) if ball < 0]
    if not rest:
        return SphereAudit(True, (0.0, 0.0), np.zeros(3), (0.0, 0.0), 0.0, excess, *np.zeros((2, 0, 3, 3)))
    corners = np.concatenate([part.corners for part in rest])
    size, largest = float(np.ptp(corners.reshape(-1, 3), axis=0).max()), float(np.abs(corners).max())
    covers = [cover_facets(part.corners, centers, radii, _NARROW * size, least=0.0) for part in rest]
    area, share, pieces = _area_outside(corners, centers, radii)
    farthest = max(covers, key=lambda cover: cover.lower).farthest
    is_inside = max(cover.upper for cover in covers) <= 0.0
    holes = _holes(rest, centers, radii, size) if is_inside else np.zeros((0, 3))
    if is_inside and not len(holes):
        made = iter([certificate_of([part], cover, np.arange(len(radii)))[0] for part, cover in zip(rest, covers)])
        none = np.zeros(0, dtype=np.int32)
        certificate = [next(made) if ball < 0 else PartCover(ball, None, None, none) for ball in balls]
        if flaw_of_cover(shape, centers, radii, certificate) is None:
            return SphereAudit(True, (0.0, 0.0), farthest, (0.0, 0.0), area, excess, holes, pieces[:0])
    # Distances are sums and roots of numbers up to the largest, rounded by 2^-50 of it; the surface of a curved part is
    # no farther than the deviation from the facets around, and distances from balls change no faster.
    slack = [2.0**-46 * largest + part.deviation for part in rest]
    lower, upper = (max(getattr(cover, name) + sign * off for cover, off in zip(covers, slack))
                    for name, sign in (("lower", -1.0), ("upper", 1.0)))
    return SphereAudit(False, (max(lower, 0.0), max(upper, 0.0)), farthest, share, area, excess, holes, pieces)


def _holes(parts: list[BodyPart], centers: np.ndarray, radii: np.ndarray, size: float) -> np.ndarray:
    corners, solids = union_corners(centers, radii), [part for part in parts if part.solid]
    return corners[Reach(solids)(corners) <= 1e-9 * size] if len(corners) and solids else np.zeros((0, 3))


def _area_outside(
    corners: np.ndarray, centers: np.ndarray, radii: np.ndarray
) -> tuple[float, tuple[float, float], np.ndarray]:
    """(area, bracket of the share outside all balls, pieces outside). Pieces on both sides are cut until their area is
    small: inside are pieces with all corners in a ball, outside those whose middle is farther from all balls than from
    its corners.
    """
    area = float(_areas(corners).sum())
    if not area > 0.0:
        return 0.0, (0.0, 0.0), corners[:0]
    outside, n_pieces = [corners[:0]], 0
    while len(corners):
        inside, off = _sides(corners, centers, radii)
        outside.append(corners[off])
        corners = corners[~inside & ~off]
        n_pieces += 2 * len(corners)
        if _areas(corners).sum() <= _SHARE * area or n_pieces > _MAX_PIECES:
            break
        corners, _ = bisected(corners)
    pieces = np.concatenate(outside)
    known, open_area = float(_areas(pieces).sum()), float(_areas(corners).sum())
    middle = corners.mean(axis=1)
    poking = _distances(middle, centers, radii) > 0.0
    # Sums of thousands of rounded areas: 1e-9 is far above their rounding.
    bracket = max(known / area - 1e-9, 0.0), min((known + open_area) / area + 1e-9, 1.0)
    return area, bracket if len(pieces) or len(corners) else (0.0, 0.0), np.concatenate([pieces, corners[poking]])


def _sides(corners: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m,) whether a piece is in a ball, and whether it is off all balls."""
    inside, off = np.empty(len(corners), dtype=bool), np.empty(len(corners), dtype=bool)
    step = max(1, _BLOCK // (3 * len(centers)))
    for start in range(0, len(corners), step):
        some = corners[start : start + step]
        away = np.sqrt(np.square(some[:, :, None] - centers).sum(axis=3)) - radii
        inside[start : start + step] = away.max(axis=1).min(axis=1) <= 0.0
        middle = some.mean(axis=1)
        reach = np.sqrt(np.square(some - middle[:, None]).sum(axis=2)).max(axis=1)
        off[start : start + step] = _distances(middle, centers, radii) > reach * (1.0 + 1e-12)
    return inside, off


def _distances(points: np.ndarray, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(n,) distances of points from a union of balls, negative inside a ball."""
    out = np.full(len(points), np.inf)
    for c, r in zip(centers, radii.tolist()):
        np.minimum(out, np.sqrt(np.square(points - c).sum(axis=1)) - r, out=out)
    return out


def _areas(corners: np.ndarray) -> np.ndarray:
    n = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return 0.5 * np.sqrt(np.square(n).sum(axis=1))
