"""The least translation known of two overlapping bodies with meshes among their parts, and a proven lower bound.

Unions with meshes, half-spaces on one side at most, and meshes beside curved shapes. B clear of A has every part of B
clear of every part of A, so a separating translation is at least as long as

- the depth of any part of A and any part of B, of a point at depths a and b in both at least a + b: while B moves by
  less, the balls around the point meet;
- the depth of the unions of all convex parts alone (`least_depth.py`);
- d, where B reaches d deep into a half-space of A;
- the radius around 0 that is covered by balls of translations, each of which leaves two parts together
  (`facets/inner_balls.py`): of a ball in a part of A and a ball in a part of B, and, for a half-space reached d deep
  into, of any size, touching the plane at distance d. A curved shape holds the balls of the polytope within.

From above the shortest translation is shortened as of two solids (`facets/least_facet_depth.py`): tried, and taken
where the bodies are proven apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from collide.lowering.extents import extent_of
from collide.lowering.facet_bodies import body_of
from collide.lowering.parts import parts_of
from collide.narrowphase.composite import least_depth as of_convex_parts
from collide.narrowphase.composite.composite_meshes import meets, planes_of
from collide.narrowphase.composite.composite_parts import CompoundParts, Part, compound_parts
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.convex_kernel_calls import leaving_touching_open
from collide.narrowphase.facets.inner_balls import balls_at, body_within, depth_of_balls, inner_balls
from collide.narrowphase.facets.least_facet_depth import largest_sum, shorter_depth
from collide.narrowphase.known_depth import Depth
from collide.results import UNDECIDED
from collide.shapes.shape import Shape

#: Balls of a body that are paired with balls of the next: so many of the largest, and of the rest, of so many parts;
#: pairs of parts whose common points are looked at.
_LARGEST, _OTHERS, _PARTS, _PAIRS = 800, 200, 12, 6
#: Radius of the ball in a half-space, in lengths L of the shortest translation known: within L of 0 the ball is nowhere
#: farther than 2⁻¹³ L from the plane.
_OF_PLANE = 2.0**12


def key_of(shape: Shape) -> bytes:
    """Orders the bodies of a pair, so that swapped questions are worked out on the same numbers."""
    return compound_parts(shape).key


def least_depth(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, known: Depth) -> Depth:
    """The depth of two overlapping bodies at poses (4, 4), no worse than a known one."""
    a, b = compound_parts(A), compound_parts(B)
    if a.unbounded and b.unbounded:
        return known
    planes = _planes(a, b, X_WA, X_WB)
    known = known.at_least(float(planes[:, 3].max(initial=0.0)))
    known = known.at_least(max(_of_parts(a, b, X_WA, X_WB), _of_convex_parts(a, b, X_WA, X_WB)))
    with leaving_touching_open():
        known = shorter_depth(meets(a, b), X_WA, X_WB, known)
    balls = _balls(a, X_WA, b, X_WB, known.proven), _balls(b, X_WB, a, X_WA, known.proven)
    size = a.radius + b.radius + float(np.abs(X_WA[:3, 3]).max() + np.abs(X_WB[:3, 3]).max())
    return known.at_least(depth_of_balls(*balls, size, known.proven, _balls_in_planes(planes, known.proven)))


def _planes(A: CompoundParts, B: CompoundParts, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(k, 4) outward normals of half-spaces, in which direction B has to go, and the least way along the normal [m],
    rounded down.

    Points p of a body clear of the half-space have n · p ≥ c: the lowest, at n · p = c − d, goes d along n. A matrix R
    with RᵀR off 1 by e turns R n off the image's normal by 2e at most, which moves heights by 2e of the size.
    """
    if not (A.unbounded or B.unbounded):
        return np.zeros((0, 4))
    sign, (H, X_WH), (S, X_WS) = (1.0, (A, X_WA), (B, X_WB)) if A.unbounded else (-1.0, (B, X_WB), (A, X_WA))
    normals, offsets = planes_of(H, X_WH)
    depths = offsets - _heights(S, X_WS, normals).min(axis=0)
    size = float(np.abs(depths).max() + np.nanmax(H.columns.plane) + np.abs(X_WA[:3, 3]).max())
    size += float(np.abs(X_WB[:3, 3]).max()) + H.radius + S.radius
    turns = X_WH[:3, :3] @ H.columns.X[:, :3, :3]
    off = float(np.abs(turns.transpose(0, 2, 1) @ turns - np.eye(3)).sum(axis=2).max())
    slop = H.slop + S.slop + float(S.columns.slop.max())
    return np.column_stack([sign * normals, depths - (2.0**-40 + 4.0 * off) * size - slop])


def _heights(of: CompoundParts, X_W: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """(parts, k) the least products of points of each part and unit vectors (k, 3), but for rounding [m]."""
    heights = []
    for part in of.parts:
        X = part.at(X_W[None], np.zeros(1)).X[0]
        if part.shape.meshed:  # what bounds a mesh may be larger
            corners = body_of(part.shape).tree.triangles.reshape(-1, 3)
            heights.append(((corners @ X[:3, :3].T + X[:3, 3]) @ normals.T).min(axis=0))
        else:
            heights.append(np.array([-extent_of(part.bound, X, -n) for n in normals]))
    return np.array(heights)


def _balls_in_planes(planes: np.ndarray, length: float) -> np.ndarray:
    """(k, 4) balls of translations that leave B in a half-space, of normals and depths (k, 4): the ball's plane is the
    half-space's, moved to where B comes free."""
    radius = _OF_PLANE * length
    return np.column_stack([(planes[:, 3:] - radius) * planes[:, :3], np.full(len(planes), radius)])


def _of_parts(A: CompoundParts, B: CompoundParts, X_WA: np.ndarray, X_WB: np.ndarray) -> float:
    """The largest sum of distances to both surfaces [m] from a point in two parts, of the pairs with a mesh whose boxes
    overlap the most; a part that rounding moves by a slop has its surface nearer by the slop."""
    some_a, some_b = (np.flatnonzero(np.isnan(side.columns.plane)) for side in (A, B))
    a, b = A.boxes(X_WA[None], some_a)[0][:, None], B.boxes(X_WB[None], some_b)[0][None]
    gaps = np.maximum(b[..., :3] - a[..., 3:], a[..., :3] - b[..., 3:]).max(axis=2)
    gaps[~(A.columns.meshed[some_a, None] | B.columns.meshed[some_b])] = np.inf  # the row has depths of convex pairs
    largest = 0.0
    for pair in np.argsort(gaps, axis=None, kind="stable")[:_PAIRS].tolist():
        i, j = divmod(pair, len(some_b))
        sides = [(side.parts[k], X) for side, k, X in ((A, int(some_a[i]), X_WA), (B, int(some_b[j]), X_WB))]
        body_a, body_b = (body_within(part.shape) for part, _ in sides)
        if gaps[i, j] < 0.0 and body_a is not None and body_b is not None and body_a.solid and body_b.solid:
            PA, PB = (part.at(X[None], np.zeros(1)) for part, X in sides)
            distances = largest_sum(body_a, body_b, PA.X[0], PB.X[0])
            largest = max(largest, distances - 1.001 * float(PA.slop[0] + PB.slop[0]))
    return largest


def _of_convex_parts(A: CompoundParts, B: CompoundParts, X_WA: np.ndarray, X_WB: np.ndarray) -> float:
    """A lower bound of the depth of the unions of both bodies' convex parts [m]; 0 of a single pair: the row has its
    depth."""
    if A.convex is None or B.convex is None or len(parts_of(A.convex)) * len(parts_of(B.convex)) == 1:
        return 0.0
    row = convex_rows(A.convex, B.convex, X_WA[None], X_WB[None])[0]
    if not row["hit"] or row["how"] == UNDECIDED or not np.isfinite(row["lower"]):
        return 0.0
    known = Depth(-float(row["distance"]), -float(row["lower"]), row["normal"].copy(), max(-float(row["upper"]), 0.0))
    return of_convex_parts.least_depth(A.convex, B.convex, X_WA, X_WB, known).least


def _balls(of: CompoundParts, X_W: np.ndarray, near: CompoundParts, X_WN: np.ndarray, length: float) -> np.ndarray:
    """(k, 4) balls in the world within the parts of a body, near a body moved by less than ``length``: the largest, and
    some others. A slop shrinks balls, below 0 where points are unsure: two of them meet by the sum of radii."""
    low, high = np.full(3, -math.inf), np.full(3, math.inf)
    if not near.unbounded:
        ends = near.boxes(X_WN[None])[0]
        low, high = ends[:, :3].min(axis=0), ends[:, 3:].max(axis=0)
    some = np.flatnonzero(np.isnan(of.columns.plane))
    boxes = of.boxes(X_W[None], some)[0]
    gaps = np.maximum(low - boxes[:, 3:], boxes[:, :3] - high).max(axis=1)
    nearest = some[np.argsort(gaps, kind="stable")[:_PARTS]]
    balls = np.concatenate([np.zeros((0, 4)), *(b for k in nearest for b in _balls_of_part(of.parts[k], X_W))])
    if not near.unbounded:
        away = np.maximum(np.maximum(low - balls[:, :3], balls[:, :3] - high), 0.0)
        balls = balls[np.sqrt(np.square(away).sum(axis=1)) <= length + np.maximum(balls[:, 3], 0.0)]
    order = np.argsort(-balls[:, 3], kind="stable")
    largest, rest = order[:_LARGEST], order[_LARGEST:]
    return balls[np.concatenate([largest, rest[:: len(rest) // _OTHERS + 1]])]


def _balls_of_part(part: Part, X_W: np.ndarray) -> Iterator[np.ndarray]:
    """The balls in the world within a part, of a part with a polytope within."""
    body = body_within(part.shape)
    if body is not None:
        placed = part.at(X_W[None], np.zeros(1))
        balls = balls_at(inner_balls(part.shape), placed.X[0])
        balls[:, 3] += body.radius - 1.001 * float(placed.slop[0])
        yield balls
