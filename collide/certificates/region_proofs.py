"""Certificates of a region of half-spaces (`HPolytope` kept as planes) and points swept by a ball: made, and checked.

With points p and half-spaces {x : n·x ≤ b} in the world, y = Σ weights·p and u = Σ multipliers·n, all numbers ≥ 0:

together  x = y − u lies in every half-space, and |u| is at most the radius.
apart     u·p − Σ multipliers·b exceeds the radius times |u| for every point p: u·x is at most that sum in the region.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base.lazy_modules import lazy_module
from collide.certificates.certificate import APART, TOGETHER, CertificateRefused
from collide.least_distance.posed_sets import (
    ExactRow,
    exact_pose,
    planes_at,
    planes_near,
    point_seen_from,
    points_at,
)
from collide.lowering.convex_sets import ConvexSet, convex_set
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.numerics.exact_points import integers
from collide.numerics.exact_vectors import dot, inner
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape

if TYPE_CHECKING:
    from collide.least_distance import nearest_pair, pair_proposals, posed_rows
else:  # with kernels, needed for making certificates, not for checking
    nearest_pair = lazy_module("collide.least_distance.nearest_pair")
    pair_proposals = lazy_module("collide.least_distance.pair_proposals")
    posed_rows = lazy_module("collide.least_distance.posed_rows")


class RegionCertificate(NamedTuple):
    """Proof of a boolean about a region and points swept by a ball, as plain data.

    Parameters
    ----------
    kind : "apart" or "together".
    vertices : rows of the points, at most four; as of `Certificate`.
    weights : fractions ≥ 0 of sum 1, one a vertex.
    halfspaces : rows of ``normals`` and ``offsets``, at most three.
    multipliers : fractions ≥ 0, one a half-space, for the half-spaces as they stand in the world: normals times the
        cofactors of the pose's rotation.
    """

    kind: str
    vertices: tuple[int, ...]
    weights: tuple[Fraction, ...]
    halfspaces: tuple[int, ...]
    multipliers: tuple[Fraction, ...]


def make_region_certificate(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> RegionCertificate | None:
    """The certificate of a region and points swept by a ball, at poses (4, 4); ``None`` for other bodies."""
    sides = _sides(A, B, X_WA, X_WB)
    if sides is None:
        return None
    region, body, X_WR, X_WO = sides
    # Rounded upwards: a sum of three squares and a root are good to 4 ulp.
    reach = float(np.sqrt(np.square(body.points).sum(axis=1).max())) * (1 + 1e-15)
    near = planes_near(region.normals, region.offsets, X_WR, X_WO, reach + body.radius)
    if not len(near):
        return RegionCertificate(TOGETHER, (0,), (Fraction(1),), (), ())
    planes = planes_at(region.normals[near], region.offsets[near], exact_pose(X_WR))
    halfspaces = posed_rows.rows_of_planes(planes)
    points = posed_rows.rows_of_points(points_at(body.points, exact_pose(X_WO)))
    pair = nearest_pair.nearest_pair(points, halfspaces, pair_proposals.Work())
    if pair.kind == nearest_pair.EMPTY:
        return None
    u_square = sum(v * v for v in pair.u)
    kind = APART if u_square > (Fraction(body.radius) * pair.denominator) ** 2 else TOGETHER
    multipliers = []
    for row, multiplier in zip(pair.halfspaces, pair.multipliers):
        axis = int(np.argmax(np.abs(halfspaces.values[row])))
        multipliers.append(halfspaces.integers(row)[axis] * multiplier / (planes[row][axis] * pair.denominator))
    return RegionCertificate(
        kind, tuple(pair.points), tuple(Fraction(weight, pair.denominator) for weight in pair.weights),
        tuple(int(near[row]) for row in pair.halfspaces), tuple(multipliers),
    )


def flaw_of_region_certificate(A: Shape, B: Shape, X_WA, X_WB, certificate, claim: str) -> str | None:
    """Why a certificate fails to prove a region and another body "together" or "apart"; ``None`` for a proof.

    Raises CertificateRefused for anything but a region's certificate.
    """
    kind, vertices, weights, rows, multipliers = _read(certificate)
    sides = _sides(A, B, X_WA, X_WB)
    if sides is None:
        return "only points swept by a ball are certified against a region"
    region, body, X_WR, X_WO = sides
    if kind != claim:
        return f"the result says {claim}, the certificate {kind!r}"
    if not all(0 <= v < len(body.points) for v in vertices) or not all(0 <= k < len(region.offsets) for k in rows):
        return "it names vertices or half-spaces that are not there"
    if min((*weights, *multipliers), default=Fraction(0)) < 0:
        return "a weight or multiplier is negative"
    pose = exact_pose(X_WR)
    named = planes_at(region.normals[list(rows)], region.offsets[list(rows)], pose)
    u = [_total(multipliers, (plane[k] for plane in named)) for k in range(3)]
    if kind == APART:
        behind = _total(multipliers, (plane[3] for plane in named))
        return _flaw_of_plane(u, behind, points_at(body.points, exact_pose(X_WO)), Fraction(body.radius))
    if sum(weights) != 1:
        return "weights do not add up to 1"
    points = points_at(body.points[list(vertices)], exact_pose(X_WO))
    if dot(u, u) > Fraction(body.radius) ** 2:
        return "the two points are farther apart than the radius"
    x = [_total(weights, (point[k] for point in points)) - u[k] for k in range(3)]
    return _flaw_of_point(region, point_seen_from(x, pose))


def _flaw_of_plane(u: ExactRow, behind: Fraction, points: list[ExactRow], radius: Fraction) -> str | None:
    least = min(dot(u, point) for point in points) - behind
    if least <= 0 or least * least <= radius * radius * dot(u, u):
        return "a vertex is not beyond the plane by more than the radius"
    return None


def _flaw_of_point(region: HPolytope, x: ExactRow) -> str | None:
    denominator = int(np.lcm.reduce(np.array([v.denominator for v in x], dtype=object)))
    numerators = [int(v * denominator) for v in x]
    for k, row in enumerate(np.column_stack((region.normals, region.offsets)).tolist()):
        (x_normal, y_normal, z_normal, offset), _ = integers(row)
        if inner((x_normal, y_normal, z_normal), numerators) > offset * denominator:
            return f"the point is not in half-space {k}"
    return None


def _total(factors: Sequence[Fraction], values) -> Fraction:
    return sum((factor * value for factor, value in zip(factors, values)), Fraction(0))


def _sides(A: Shape, B: Shape, X_WA, X_WB) -> tuple[HPolytope, ConvexSet, np.ndarray, np.ndarray] | None:
    """(region, the other body, their poses) where that is points swept by a ball."""
    region, partner, X_WR, X_WO = (A, B, X_WA, X_WB) if A.is_region else (B, A, X_WB, X_WA)
    if not isinstance(region, HPolytope) or kind_of(partner) not in (Kind.SPHERE, Kind.CAPSULE, Kind.POLYTOPE):
        return None
    return region, convex_set(partner), X_WR, X_WO


def _read(values) -> RegionCertificate:
    try:
        kind, vertices, weights, rows, multipliers = values
        read = RegionCertificate(
            kind, tuple(map(int, vertices)), tuple(map(Fraction, weights)), tuple(map(int, rows)),
            tuple(map(Fraction, multipliers)),
        )
    except (TypeError, ValueError, ZeroDivisionError):
        read = None
    if read is None or len(read.vertices) != len(read.weights) or len(read.halfspaces) != len(read.multipliers):
        raise CertificateRefused(
            "a certificate beside a region is (kind, vertices, weights, half-spaces, multipliers), weights and "
            "multipliers fractions, or texts of them"
        )
    return read
