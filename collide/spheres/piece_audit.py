"""What convex pieces leave outside of a body, and how far they exceed it: decompositions, hulls, boxes, spheres."""

from __future__ import annotations

import numpy as np

from collide.errors import UnsupportedQuery
from collide.mesh.convex_surface import is_own_hull
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Sphere
from collide.shapes.shape import Shape, checked_shape
from collide.spheres.body_facets import BodyPart, body_parts, reach_bounds
from collide.spheres.convex_pieces import ConvexPieces
from collide.spheres.facet_cover import cover_facets
from collide.spheres.facets_outside import PieceAudit, area_outside
from collide.spheres.piece_excess import piece_excess
from collide.spheres.sphere_audit import audit_spheres

#: The bracket of the greatest distance outside is this narrow, in parts of the body's size.
_NARROW = 1e-4
#: Boxes asked at most whether a hole is left inside.
_MAX_BOXES = 40_000
_SIGNS = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def audit_pieces(shape: Shape, pieces: Shape) -> PieceAudit:
    """What convex pieces leave outside of a body, and how far they exceed the body.

    Parameters
    ----------
    shape : Shape
        The body: a primitive, a `ConvexHull`, an `HPolytope` with an end, a `Mesh`, or a `Compound` of these.
    pieces : Shape
        A convex shape, or a `Compound` of convex shapes, in the frame of the body; a `Mesh` has to be convex.

    Returns
    -------
    PieceAudit
        Whether the pieces contain the body; brackets of what they miss and of how far they exceed the body [m].

    Raises
    ------
    InvalidArgument
        For anything but shapes.
    UnsupportedQuery
        For shapes without an end, clouds, grids and large terrain, and for pieces that are not convex.

    Notes
    -----
    Brackets are proven, whatever the pieces are. Facets of the body are cut until the greatest distance from the pieces
    is known to a ten thousandth of the body's size; tetrahedra of the pieces until the excess is known to a hundredth,
    or the limit of work is met. A body with an open mesh has a lower bound of 0 for the excess. A body in more than a
    single piece is known to be contained if boxes small enough lie in the pieces; not so where pieces lie flush.

    O(m log m) for m facets; tenths of a second for the link of a robot. docs/spheres.md has measured numbers.
    """
    checked_shape("audit_pieces: shape", shape)
    checked_shape("audit_pieces: pieces", pieces)
    placed = body_parts(_convex(pieces), "audit_pieces: pieces")
    if all(isinstance(piece.shape, Sphere) for piece in placed):
        centers = np.array([piece.X[:3, 3] for piece in placed])
        return audit_spheres(shape, centers, np.array([piece.shape.radius for piece in placed]))  # type: ignore[attr-defined]
    parts = body_parts(shape, "audit_pieces: shape")
    slack = 2.0**-46 * max(float(np.abs(part.mesh.vertices).max()) for part in (*parts, *placed))
    return _audit(parts, ConvexPieces(placed, slack))


def _audit(parts: list[BodyPart], cover: ConvexPieces) -> PieceAudit:
    excess = piece_excess(parts, cover.parts)
    rest = [part for part in parts if not cover.contain(part)]
    if not rest:
        return PieceAudit(True, (0.0, 0.0), np.zeros(3), (0.0, 0.0), 0.0, excess, *np.zeros((2, 0, 3, 3)))
    corners = np.concatenate([part.corners for part in rest])
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    covers = [cover_facets(part.corners, cover, _NARROW * size, least=-cover.slack) for part in rest]
    area, share, patches = area_outside(corners, cover)
    holes, is_full = np.zeros((0, 3)), False
    farthest = max(covers, key=lambda judged: judged.lower).farthest
    if max(judged.upper for judged in covers) <= -cover.slack:
        holes, is_full = _holes([part for part in rest if part.solid], cover)
        if is_full:
            return PieceAudit(True, (0.0, 0.0), farthest, (0.0, 0.0), area, excess, holes, patches[:0])
    # The surface of a curved part is no farther than the deviation from the facets around, and distances from pieces
    # change no faster.
    lower = max(float(cover.nearest(judged.farthest[None])[0]) - part.deviation for judged, part in zip(covers, rest))
    upper = max(judged.upper + part.deviation for judged, part in zip(covers, rest)) + cover.slack
    return PieceAudit(False, (max(lower, 0.0), max(upper, 0.0)), farthest, share, area, excess, holes, patches)


def _holes(solids: list[BodyPart], cover: ConvexPieces) -> tuple[np.ndarray, bool]:
    """(places (k, 3) inside of solids and outside of pieces; whether all of the solids is proven inside the pieces).

    Boxes around the solids are cut in eight. Nothing is left out of a box with all corners in a piece, since the piece
    is convex, or with the middle farther from the solids than from the corners.
    """
    if not solids:
        return np.zeros((0, 3)), True
    vertices = np.concatenate([part.mesh.vertices for part in solids])
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    middles, half, n_boxes = 0.5 * (low + high)[None], 0.5 * (high - low) + cover.slack, 0
    while len(middles) and n_boxes + len(middles) <= _MAX_BOXES:
        n_boxes += len(middles)
        lower, upper = reach_bounds(solids, middles)
        missed = (upper < -cover.slack) & (cover.nearest(middles) > cover.slack)
        if missed.any():
            return middles[missed], False
        rest = lower <= float(np.sqrt(np.square(half).sum())) + cover.slack
        corners = middles[rest, None] + half * _SIGNS
        inside = cover.away(corners).max(axis=1).min(axis=1) <= -cover.slack
        half = 0.5 * half
        middles = (middles[rest][~inside][:, None] + half * _SIGNS).reshape(-1, 3)
    return np.zeros((0, 3)), not len(middles)


def _convex(pieces: Shape) -> Shape:
    """The pieces, convex meshes as their hulls. Raises UnsupportedQuery for any other mesh."""
    if isinstance(pieces, Compound):
        return Compound([(_convex(item), X) for item, X in pieces.items])
    if isinstance(pieces, Mesh):
        if not (pieces.solid and is_own_hull(pieces.vertices, pieces.faces)):
            raise UnsupportedQuery(
                f"audit_pieces: pieces: a Mesh of {len(pieces.faces)} facets is not convex: give "
                "ConvexHull(mesh.vertices), or a Compound of convex parts"
            )
        return pieces.convex_hull
    return pieces
