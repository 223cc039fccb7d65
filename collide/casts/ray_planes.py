"""Rays against a region of half-spaces: where they enter and leave the region, exactly.

Doubles with error bounds name the planes that may decide; fractions decide among these. A facet is the row of its
half-space.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from collide.casts.directions import Directions
from collide.casts.ray_hits import RayEvents
from collide.least_distance.posed_sets import exact_pose, planes_at
from collide.numerics.exact_points import rounded
from collide.numerics.exact_vectors import dot
from collide.shapes.hpolytope import HPolytope

#: What doubles are off, relative to the numbers that are added: far more than they can be.
_ERROR = 2.0**-44


class _Span(NamedTuple):
    """The interval of t in which a line is in a region, and the least rows of half-spaces at its ends.

    along : the least row of a plane through the whole line, −1 without.
    """

    enters: Fraction | None
    leaves: Fraction | None
    row_entered: int
    row_left: int
    along: int


def planes_met(
    region: HPolytope, X_WA: np.ndarray, origins: np.ndarray, directions: Directions, limit: float, *, every: bool
) -> RayEvents:
    """Events of n rays and a region at checked poses (n, 4, 4) or (1, 4, 4), in order, as `surfaces_met` has them."""
    places: list[tuple[int, Fraction, int]] = []
    for k in range(len(origins)):
        X, exponent = X_WA[k if len(X_WA) > 1 else 0], int(directions.exponents[k])
        span = _span_of(region, X, origins[k], directions.vectors[k])
        for at, row in _places(span, every):
            t = at / Fraction(2) ** exponent
            if t <= limit:
                places.append((k, t, row))
    ray = np.array([k for k, _, _ in places], dtype=np.int64)
    facet = np.array([row for _, _, row in places], dtype=np.int64)
    brackets = np.array([rounded(t) for _, t, _ in places]).reshape(-1, 3)
    proven = np.ones(len(places), dtype=bool)
    normals = np.linalg.solve(
        np.swapaxes((X_WA[ray] if len(X_WA) > 1 else np.broadcast_to(X_WA, (len(ray), 4, 4)))[:, :3, :3], 1, 2),
        region.normals[facet][:, :, None],
    )[:, :, 0]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True) + 0.0
    return RayEvents(ray, brackets, normals, facet, np.zeros(len(ray), dtype=np.int64), proven, proven.copy())


def _places(span: _Span | None, every: bool) -> list[tuple[Fraction, int]]:
    """(t, facet) where a ray meets the surface, in order."""
    if span is None or (span.leaves is not None and span.leaves < 0):
        return []
    places: list[tuple[Fraction, int]] = []
    if span.along >= 0:
        start = max(span.enters, Fraction(0)) if span.enters is not None else Fraction(0)
        facet = min(span.along, span.row_entered) if span.enters == start else span.along
        places.append((start, facet))
    elif span.enters is not None and span.enters >= 0:
        places.append((span.enters, span.row_entered))
    if span.leaves is not None and not (places and places[0][0] == span.leaves):
        places.append((span.leaves, span.row_left))
    return places if every else places[:1]


def _span_of(region: HPolytope, X_WA: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> _Span | None:
    """Where the line origin + t·direction is in a region; None where nowhere, or only at t < 0."""
    rows = _candidates(region, X_WA, origin, direction)
    if rows is None:
        return None
    start, step = ([Fraction(v) for v in vector.tolist()] for vector in (origin, direction))
    enters: tuple[Fraction, int] | None = None
    leaves: tuple[Fraction, int] | None = None
    along = -1
    planes = planes_at(region.normals[rows], region.offsets[rows], exact_pose(X_WA))
    for row, (*normal, offset) in zip(rows.tolist(), planes):
        height, rate = offset - dot(normal, start), dot(normal, step)
        if rate == 0:
            if height < 0:
                return None
            along = row if height == 0 and along < 0 else along
            continue
        t = Fraction(height) / Fraction(rate)
        if rate < 0 and (enters is None or t > enters[0]):
            enters = t, row
        elif rate > 0 and (leaves is None or t < leaves[0]):
            leaves = t, row
    if enters is not None and leaves is not None and enters[0] > leaves[0]:
        return None
    return _Span(
        enters[0] if enters else None, leaves[0] if leaves else None, enters[1] if enters else -1,
        leaves[1] if leaves else -1, along,
    )


def _candidates(region: HPolytope, X_WA: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray | None:
    """Rows of half-spaces through whose planes a ray may enter or leave; None for a certain miss."""
    R, t = X_WA[:3, :3], X_WA[:3, 3]
    inverse = np.linalg.inv(R)
    o, v = inverse @ (origin - t), inverse @ direction
    lengths = np.abs(region.normals).sum(axis=1)
    height, rate = region.offsets - region.normals @ o, region.normals @ v
    size = np.abs(inverse).sum() * (np.abs(origin).max() + np.abs(t).max())
    height_error = _ERROR * (lengths * size + np.abs(region.offsets))
    rate_error = _ERROR * lengths * np.abs(inverse).sum() * np.abs(direction).max()
    enters, leaves = rate < -rate_error, rate > rate_error
    low, high = _quotients(height, height_error, rate, rate_error)
    first = float(low[enters].max(initial=0.0))
    last = float(high[leaves].min(initial=math.inf))
    if first > last:
        return None
    end = last if math.isfinite(last) else math.inf
    beside = ~(enters | leaves)
    with np.errstate(invalid="ignore", over="ignore"):
        drift = np.where(rate_error > 0.0, (np.abs(rate) + rate_error) * end, 0.0)
    keep = (enters & (high >= first)) | (leaves & (low <= last)) | (beside & ~(height - height_error > drift))
    return np.flatnonzero(keep)


def _quotients(height, height_error, rate, rate_error) -> tuple[np.ndarray, np.ndarray]:
    """(least, largest) height / rate, wherever the rate is clear of 0."""
    with np.errstate(all="ignore"):
        corners = [
            (height + i * height_error) / (rate + j * rate_error) for i in (-1.0, 1.0) for j in (-1.0, 1.0)
        ]
        slack = 2.0**-50 * np.abs(corners).max(axis=0)
    return np.min(corners, axis=0) - slack, np.max(corners, axis=0) + slack
