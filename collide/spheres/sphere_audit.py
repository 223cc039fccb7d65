"""What spheres leave outside of a body, and how far they exceed it: both bracketed, whatever the spheres are."""

from __future__ import annotations

import numpy as np

from collide.certificates.exact_parts import leaves_of
from collide.certificates.sphere_cover import PartCover, ball_around, flaw_of_cover
from collide.shapes.shape import Shape
from collide.spheres.body_facets import BodyPart, Reach, body_parts
from collide.spheres.convex_pieces import Balls
from collide.spheres.facet_cover import certificate_of, cover_facets
from collide.spheres.facets_outside import PieceAudit, area_outside
from collide.spheres.sphere_excess import excess_bracket
from collide.spheres.union_corners import union_corners

#: The bracket of the greatest distance outside is this narrow, in parts of the body's size.
_NARROW = 1e-4


def audit_spheres(shape: Shape, centers: np.ndarray, radii: np.ndarray) -> PieceAudit:
    """How spheres (n, 3), (n,) in the frame of a shape enclose it [m], n ≥ 1; curved parts are taken by facets around.

    Raises UnsupportedQuery for shapes without facets. O(m log m) for m facets; tenths of a second for a robot's link.
    """
    parts = body_parts(shape)
    excess = excess_bracket(shape, parts, centers, radii)
    balls = [ball_around(leaf, poses, centers, radii) for leaf, poses in leaves_of(shape)]
    rest = [part for part, ball in zip(parts, balls) if ball < 0]
    if not rest:
        return PieceAudit(True, (0.0, 0.0), np.zeros(3), (0.0, 0.0), 0.0, excess, *np.zeros((2, 0, 3, 3)))
    corners = np.concatenate([part.corners for part in rest])
    size, largest = float(np.ptp(corners.reshape(-1, 3), axis=0).max()), float(np.abs(corners).max())
    covers = [cover_facets(part.corners, Balls(centers, radii), _NARROW * size, least=0.0) for part in rest]
    area, share, patches = area_outside(corners, Balls(centers, radii))
    farthest = max(covers, key=lambda cover: cover.lower).farthest
    is_inside = max(cover.upper for cover in covers) <= 0.0
    holes = _holes(rest, centers, radii, size) if is_inside else np.zeros((0, 3))
    if is_inside and not len(holes):
        made = iter([certificate_of([part], cover, np.arange(len(radii)))[0] for part, cover in zip(rest, covers)])
        none = np.zeros(0, dtype=np.int32)
        certificate = [next(made) if ball < 0 else PartCover(ball, None, None, none) for ball in balls]
        if flaw_of_cover(shape, centers, radii, certificate) is None:
            return PieceAudit(True, (0.0, 0.0), farthest, (0.0, 0.0), area, excess, holes, patches[:0])
    # Distances are sums and roots of numbers up to the largest, rounded by 2^-50 of it; the surface of a curved part is
    # no farther than the deviation from the facets around, and distances from balls change no faster.
    slack = [2.0**-46 * largest + part.deviation for part in rest]
    lower, upper = (max(getattr(cover, name) + sign * off for cover, off in zip(covers, slack))
                    for name, sign in (("lower", -1.0), ("upper", 1.0)))
    return PieceAudit(False, (max(lower, 0.0), max(upper, 0.0)), farthest, share, area, excess, holes, patches)


def _holes(parts: list[BodyPart], centers: np.ndarray, radii: np.ndarray, size: float) -> np.ndarray:
    corners, solids = union_corners(centers, radii), [part for part in parts if part.solid]
    return corners[Reach(solids)(corners) <= 1e-9 * size] if len(corners) and solids else np.zeros((0, 3))
