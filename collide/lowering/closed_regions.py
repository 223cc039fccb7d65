"""Regions of half-spaces, closed by a box that changes no answer.

A region FH keeps its planes. For a question it becomes K = FH ∩ [−s, s]³, an `HPolytope` with corners, taken by every
method of the pair table. Write ρ for a bound of how far points of the other body B lie from the origin of the
region's frame, and m for `HPolytope.boundary_within`. With s ≥ 2ρ + m answers are the answers of FH:

- Apart: FH has a point within m of the origin or holds the origin, so the gap is at most ρ + m, and the point of
  FH nearest B within 2ρ + m of the origin, in K.
- Meeting: a plane is within m of the origin, so B has to move by at most ρ + m to be behind the plane. Over any motion
  of this length B stays in the box, where K and FH are the same: a translation separates B from both or from neither.

Sizes s are powers of two, and K is kept with the region (`HPolytope.closed`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from collide.errors import UnsupportedQuery
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import bounding_parts_of
from collide.shapes.compound import Compound
from collide.shapes.hpolytope import HPolytope
from collide.shapes.shape import Shape, kept_with_shape
from collide.shapes.shape_set import have_any
from collide.transforms import LARGEST, ROTATION_TOLERANCE

#: More than what a sum of lengths rounds, and what poses that are nearly rotations stretch.
_UP = 1 + 4 * ROTATION_TOLERANCE


def closings(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Iterator[tuple[Shape, Shape, np.ndarray]]:
    """(A or A closed, B or B closed, numbers of the poses served) of a region and another body.

    X_WA, X_WB : (n, 4, 4).   Raises UnsupportedQuery where the other body is unbounded, too, or too far away.
    """
    sizes = sizes_at(A, B, X_WA, X_WB)
    for size in np.unique(sizes).tolist():
        some = np.flatnonzero(sizes == size)
        yield (closed(A, size), B, some) if A.is_region else (A, closed(B, size), some)


def closed_shapes(A, B, X_WA: np.ndarray, X_WB: np.ndarray, n: int, leeway: np.ndarray | float = 0.0):
    """(A, B) of n pairs with regions closed: unchanged without regions, else sequences of n shapes.

    A, B : shapes, or sequences of n.   X_WA, X_WB : poses (n, 4, 4) or (1, 4, 4).
    leeway : a number or (n,): A may be moved this far, or bodies up to this far from A matter, too [m].
    Raises as `closings`.
    """
    if not (have_any(A, "is_region") or have_any(B, "is_region")):
        return A, B
    sides = [[S] * n if isinstance(S, Shape) else S for S in (A, B)]
    pairs: dict[tuple[int, int], list[int]] = {}
    for k, (a, b) in enumerate(zip(*sides)):
        if a.is_region or b.is_region:
            pairs.setdefault((id(a), id(b)), []).append(k)
    X_WA, X_WB, leeway = (np.broadcast_to(v, (n, *np.shape(v)[1:])) for v in (X_WA, X_WB, np.atleast_1d(leeway)))
    out_a, out_b = list(sides[0]), list(sides[1])
    for some in pairs.values():
        a, b = sides[0][some[0]], sides[1][some[0]]
        for k, size in zip(some, sizes_at(a, b, X_WA[some], X_WB[some], leeway[some]).tolist()):
            if a.is_region:
                out_a[k] = closed(a, size)
            else:
                out_b[k] = closed(b, size)
    return out_a, out_b


def sizes_at(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, leeway: np.ndarray | float = 0.0) -> np.ndarray:
    """(n,) box sizes for a region and another body at poses (n, 4, 4), or up to ``leeway`` [m] from there."""
    region, body, X_WR, X_WO = (A, B, X_WA, X_WB) if A.is_region else (B, A, X_WB, X_WA)
    reach = reach_of(body)
    if not reach < math.inf:
        names = " and ".join(map(name_of, (A, B)))
        answered = "ask about the items of the Compound" if isinstance(body, Compound) else (
            "collide() and distance() answer"
        )
        raise UnsupportedQuery(f"{names}: neither has an end, which this query needs; {answered}")
    apart = np.sqrt(np.square(X_WO[:, :3, 3] - X_WR[:, :3, 3]).sum(axis=1)) + leeway
    assert isinstance(region, HPolytope)
    return box_sizes(region, _stretch(X_WR) * (apart + _stretch(X_WO) * reach + region.boundary_within))


def name_of(shape: Shape) -> str:
    """What messages call a shape."""
    return "HPolytope(bounded=False)" if shape.__class__ is HPolytope and shape.is_region else type(shape).__name__


def _stretch(X: np.ndarray) -> np.ndarray | float:
    """(n,) bounds of what a pose and its inverse stretch lengths by, one after the other: 1 of rotations."""
    R = X[:, :3, :3]
    if np.abs(np.swapaxes(R, 1, 2) @ R - np.eye(3)).max(initial=0.0) <= 3.0 * ROTATION_TOLERANCE:
        return _UP
    with np.errstate(divide="ignore"):
        values = np.linalg.svd(R, compute_uv=False)
        return _UP * np.maximum(values[:, 0], 1.0) ** 2 / np.minimum(values[:, 2], 1.0) ** 2


def closed(region: Shape, size: float) -> HPolytope:
    """A region within the box [−size, size]³ of its frame."""
    assert isinstance(region, HPolytope)
    return region.closed(size)


@kept_with_shape("_reach")
def reach_of(shape: Shape) -> float:
    """How far points of a shape are from its origin, at most [m]: infinite of half-spaces and regions."""
    if shape.is_region:
        return math.inf
    lengths = [
        math.inf if packed.kind == HALFSPACE else _UP * (packed.reach + packed.slop + np.linalg.norm(X[:3, 3]))
        + packed.radius for packed, X in bounding_parts_of(shape)
    ]
    return float(max(lengths))


def box_sizes(region: HPolytope, distances: np.ndarray) -> np.ndarray:
    """(n,) half the edges of boxes that close a region for bodies with no point farther than ``distances`` (n,) from
    the origin of its frame [m].

    Raises UnsupportedQuery where a size is out of range.
    """
    wanted = _UP * (2.0 * distances + region.boundary_within)
    if not (wanted <= LARGEST / 4.0).all():
        raise UnsupportedQuery(
            f"HPolytope(bounded=False): a body may be {float(np.max(wanted)):g} m away, more than {LARGEST / 4.0:g} m"
        )
    return np.ldexp(1.0, np.frexp(np.maximum(wanted, 1e-45))[1] + 1)
