"""`enclosing_spheres`: balls whose union contains a body, proven, and exceeds it by little."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.poses_at import poses_at
from collide.certificates.certificate import CertificateRefused
from collide.certificates.exact_parts import leaves_of
from collide.certificates.sphere_cover import PartCover, flaw_of_cover
from collide.errors import InvalidArgument
from collide.shapes.compound import Compound
from collide.shapes.point_cloud import PointCloud
from collide.shapes.primitives import Sphere
from collide.shapes.shape import Shape, checked_shape
from collide.spheres.body_facets import BodyPart, Reach, body_parts
from collide.spheres.convex_pieces import Balls
from collide.spheres.facet_cover import certificate_of, cover_facets
from collide.spheres.place_spheres import (
    Placement,
    Samples,
    best_addition,
    greedy_cover,
    moved_centers,
    placement_of,
    placements,
    sampled,
    with_points,
    without_least_missed,
)
from collide.spheres.sphere_excess import excess_bracket
from collide.spheres.union_corners import union_corners

#: Without a count or an excess.
_USUAL_COUNT = 8
_MAX_SPHERES = 1000
#: Facets are cut until it is known to this part of the excess how large the balls have to be.
_TOLERANCE = 0.02
#: Rounds in which samples are added where facets need more.
_ROUNDS = 5
#: Centres and radii are multiples of this part of the body's size, so that integers of proofs are short.
_GRID = 2.0**-26
#: Corners of the union this near a solid, in parts of its size, are taken into a ball.
_NEAR = 1e-7
_MARGIN_GROWTH = 1.5


class EnclosingSpheres(NamedTuple):
    """Balls with a body in their union.

    centers, radii : (n, 3) and (n,) float64 in the frame of the body [m].
    excess : (lower, upper) of the greatest distance of a point of the balls from the body [m], proven. Space wrapped by
        an open mesh counts as body: points the mesh winds half around or more, with the empty balls around these
        points. ``lower`` is 0 then.
    certificate : a `PartCover` for each part, from which `verify` proves the body contained.
    """

    centers: np.ndarray
    radii: np.ndarray
    excess: tuple[float, float]
    certificate: tuple[PartCover, ...]

    def as_shape(self) -> Compound:
        """The union as a shape for every query.

        Returns
        -------
        Compound
            Of a `Sphere` for each ball, in the frame of the body [m]. O(n).
        """
        return Compound([(Sphere(r), X) for r, X in zip(self.radii.tolist(), poses_at(self.centers))])

    def as_cloud(self) -> PointCloud:
        """The union as a cloud, for hundreds of balls and more.

        Returns
        -------
        PointCloud
            With a radius for each point, in the frame of the body [m]. O(n).
        """
        return PointCloud(self.centers, self.radii)

    def verify(self, shape: Shape) -> None:
        """Check in Python integers the certificate's proof: the balls contain a shape.

        Parameters
        ----------
        shape : Shape
            The body.

        Raises
        ------
        CertificateRefused
            Where nothing is proven; the message names part and facet, or a hole left inside.

        Notes
        -----
        No kernel is imported. The proof: `collide.certificates.sphere_cover`. O(pieces + n³) integers for n balls, all
        of them meeting; a second for 20,000 facets.
        """
        checked_shape("EnclosingSpheres.verify: shape", shape)
        flaw = flaw_of_cover(shape, self.centers, self.radii, self.certificate)
        if flaw:
            raise CertificateRefused(f"the spheres are not proven to contain the body: {flaw}")


def enclosing_spheres(shape: Shape, count: int | None = None, excess: float | None = None) -> EnclosingSpheres:
    """Spheres whose union contains a body, proven: at most so many, or exceeding it by at most so much.

    Parameters
    ----------
    shape : Shape
        A primitive, a `ConvexHull`, an `HPolytope` with an end, a `Mesh`, or a `Compound` of these. Of a solid the
        inside is contained as well, of an open mesh the facets.
    count : int, optional
        At most so many spheres, with the least excess found; 8 where neither is said.
    excess : float, optional
        > 0 [m]: no point of the spheres is farther from the body, with as few spheres as found.

    Returns
    -------
    EnclosingSpheres
        Centres and radii in the frame of the shape [m], a bracket of the excess, and the certificate.

    Raises
    ------
    InvalidArgument
        For both count and excess, for values out of range, and where an excess would take more than 1,000 spheres.
    UnsupportedQuery
        For shapes without an end, clouds, grids and large terrain.

    Notes
    -----
    The number of spheres is the least found, and no proof that fewer would not do. A body and a count give the same
    spheres each time. Around curved shapes facets are laid, off by 0.8 % of their radius: the proof is about these.
    An `HPolytope` is taken as the hull of its ``vertices``.

    A k-centre problem in the distance |p − c| + s(c), s the signed distance of the centre c from the body: greedy
    covers over candidates on the medial axis and a grid, then moves and swaps. Facets are cut until each piece is in a
    ball. O(m log m) for m facets; a second for ten spheres around a robot's link. docs/spheres.md has measured numbers.
    """
    checked_shape("enclosing_spheres: shape", shape)
    if count is not None and excess is not None:
        raise InvalidArgument("enclosing_spheres: give a count or an excess, not both")
    if excess is not None:
        excess = checks.length("enclosing_spheres: excess", excess)
        if not 0.0 < excess < math.inf:
            raise InvalidArgument(f"enclosing_spheres: excess must be a length above 0 [m], got {excess!r}")
    n = checks.integer("enclosing_spheres: count", _USUAL_COUNT if count is None else count, 1)
    if n > _MAX_SPHERES:
        raise InvalidArgument(f"enclosing_spheres: count must be at most {_MAX_SPHERES}, got {checks.brief(n)}")
    spheres = _spheres_of(shape)
    if spheres is not None and (excess is not None or len(spheres.radii) <= n):
        return spheres
    parts = body_parts(shape)
    reach = Reach(parts)
    made = _within(shape, reach, excess) if excess is not None else _best_of(shape, reach, n)
    flaw = flaw_of_cover(shape, made.centers, made.radii, made.certificate)
    if flaw:
        raise AssertionError(f"enclosing_spheres: the cover made is not proven: {flaw}; please report it")
    return made


def _spheres_of(shape: Shape) -> EnclosingSpheres | None:
    """The spheres of a body of nothing else."""
    leaves = list(leaves_of(shape))
    if not all(isinstance(leaf, Sphere) for leaf, _ in leaves):
        return None
    centers, radii = np.zeros((len(leaves), 3)), np.empty(len(leaves))
    for k, (leaf, poses) in enumerate(leaves):
        for X in poses:
            centers[k] = X[:3, :3] @ centers[k] + X[:3, 3]
        # Centres of nested poses are rounded, each by less than 2^-50 of the largest number on the way.
        largest = max((float(np.abs(X[:3, 3]).max()) for X in poses), default=0.0)
        radii[k] = leaf.radius + (len(poses) > 1) * len(poses) * 2.0**-48 * largest  # type: ignore[attr-defined]
    covers = [PartCover(k, None, None, np.zeros(0, dtype=np.int32)) for k in range(len(leaves))]
    grown = max(float(r - leaf.radius) for r, (leaf, _) in zip(radii, leaves))  # type: ignore[attr-defined]
    return EnclosingSpheres(centers, radii, (0.0, 2.0 * grown), tuple(covers))


# --- how many -----------------------------------------------------------------------------------


def _best_of(shape: Shape, reach: Reach, count: int) -> EnclosingSpheres:
    samples = sampled(reach, _scale_of(count))
    refined = [_refined(reach, samples, place) for place in placements(reach, samples, count)]
    best = min(refined, key=lambda made: made.needed)
    return _proven(shape, reach, best.samples, best.place)


def _scale_of(count: int) -> int:
    """More spheres are placed by more samples."""
    return 1 if count <= 32 else 2 if count <= 128 else 4


def _within(shape: Shape, reach: Reach, excess: float) -> EnclosingSpheres:
    """As few spheres as found that exceed the body by no more than an excess."""
    for scale in (1, 2, 4):
        samples = sampled(reach, scale)
        rows = greedy_cover(samples, 0.97 * excess, _MAX_SPHERES)
        if rows is not None and _scale_of(len(rows)) <= scale:
            break
    if rows is None:
        raise _too_small(excess)
    rng = np.random.default_rng(len(rows))
    place = moved_centers(reach, samples, placement_of(samples, rows), rng)
    step = max(1, len(rows) // 8)
    while step and len(place.centers) > 1:
        fewer = place
        for _ in range(min(step, len(place.centers) - 1)):
            fewer = without_least_missed(samples, fewer)
        fewer = moved_centers(reach, samples, fewer, rng)
        place, step = (fewer, step) if fewer.excess <= 0.98 * excess else (place, step // 2)
    while True:
        samples, place, _ = _refined(reach, samples, place)
        made = _proven(shape, reach, samples, place)
        if made.excess[1] <= excess:
            return made
        if len(place.centers) >= _MAX_SPHERES:
            raise _too_small(excess)
        for _ in range(max(1, len(place.centers) // 16)):
            place = best_addition(samples, place)
        place = moved_centers(reach, samples, place, rng)


def _too_small(excess: float) -> InvalidArgument:
    return InvalidArgument(
        f"enclosing_spheres: an excess of {excess:g} m would take more than {_MAX_SPHERES} spheres; give a larger one, "
        "or a count"
    )


# --- from samples to facets ---------------------------------------------------------------------


def _all_corners(parts: list[BodyPart]) -> np.ndarray:
    return np.concatenate([part.corners for part in parts])


class _Refined(NamedTuple):
    """More samples, the best placement, and the excess needed by facets and the inside for this placement."""

    samples: Samples
    place: Placement
    needed: float


def _refined(reach: Reach, samples: Samples, place: Placement) -> _Refined:
    """Samples added where facets and the inside need larger balls than the samples, and centres moved for them."""
    corners, rng = _all_corners(reach.parts), np.random.default_rng(1)
    best, least = place, math.inf
    for _ in range(_ROUNDS):
        cover = cover_facets(corners, Balls(place.centers, -place.reaches), _tolerance(samples, place))
        holes = _holes(reach, samples, place.centers, np.maximum(cover.upper - place.reaches, 0.0))
        away = np.sqrt(np.square(holes[:, None] - place.centers).sum(axis=2)) + place.reaches
        needed = max(cover.upper, float(away.min(axis=1).max(initial=-math.inf)))
        if needed < least:
            best, least = place, needed
        if needed <= place.excess * (1.0 + 1.5 * _TOLERANCE):
            break
        worst = np.argsort(-cover.values)[: min(150, int((cover.values > place.excess).sum()))]
        samples = with_points(samples, np.unique(np.vstack([*cover.corners[worst], holes]), axis=0))
        place = moved_centers(reach, samples, place, rng)
    return _Refined(samples, best, least)


def _tolerance(samples: Samples, place: Placement) -> float:
    return _TOLERANCE * max(place.excess, 1e-6 * samples.size)


def _holes(reach: Reach, samples: Samples, centers: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """(k, 3) the corners of a union of balls in a solid part, or next to a solid part."""
    solids = [part for part in reach.parts if part.solid]
    corners = union_corners(centers, radii) if solids else np.zeros((0, 3))
    return corners[Reach(solids)(corners) <= _NEAR * samples.size] if len(corners) else corners


def _proven(shape: Shape, reach: Reach, samples: Samples, place: Placement) -> EnclosingSpheres:
    """Radii as large as facets need, grown where a hole is left inside; with the certificate."""
    parts = reach.parts
    corners = _all_corners(parts)
    largest = float(np.abs(corners).max())
    grid = math.ldexp(1.0, math.frexp(max(_GRID * samples.size, 2.0**-45 * largest, 1e-300))[1])
    centers = np.rint(place.centers / grid) * grid
    reaches = reach(centers)
    cover = cover_facets(corners, Balls(centers, -reaches), _tolerance(samples, place))
    away = np.sqrt(np.square(cover.corners - centers[cover.owners][:, None]).sum(axis=2)).max(axis=1)
    needed = np.zeros(len(centers))
    np.maximum.at(needed, cover.owners, away)
    used = np.flatnonzero(needed > 0.0)
    if not len(used):  # a body without extent
        used = np.zeros(1, dtype=np.int64)
    centers, reaches = centers[used], reaches[used]
    radii = _rounded_up(needed[used], largest, grid)
    margin = 2.0 * _NEAR * samples.size
    while len(holes := _holes(reach, samples, centers, radii)):
        # Each is taken in by the ball that exceeds the body least then, and by a margin that grows: a ball with the
        # corner on its sphere would creep. In the end a ball holds the body, and there are no corners in it.
        away = np.sqrt(np.square(holes[:, None] - centers).sum(axis=2))
        balls = (away + reaches).argmin(axis=1)
        grown = _rounded_up(away[np.arange(len(holes)), balls] + margin, largest, grid)
        np.maximum.at(radii, balls, grown)
        margin *= _MARGIN_GROWTH
    bracket = excess_bracket(shape, parts, centers, radii)
    return EnclosingSpheres(centers, radii, bracket, certificate_of(parts, cover, used))


def _rounded_up(distances: np.ndarray, largest: float, grid: float) -> np.ndarray:
    """Radii on a grid, above distances by more than corners and distances were rounded: 2^-44 of the largest number."""
    return np.ceil((distances * (1.0 + 2.0**-44) + 2.0**-44 * largest) / grid) * grid
