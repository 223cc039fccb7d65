"""Balls within a solid of facets, and what two solids' balls say about the least translation that parts the solids.

A ball around a in solid A and a ball around b in solid B meet while B is moved by x nearer to a − b than the sum of
both radii: a ball of translations, each of which leaves the solids together. All pairs of balls make a union of balls
of translations, and the depth is no less than the radius of the largest ball around 0 in the union. Cubes around 0 are
looked at: a cube within a ball of the union is done with, all other cubes are cut in eight; the nearest cube too small
to be cut ends the bound.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from collide.base.poses_at import poses_at
from collide.kernels import address_of
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import Body, body_of, has_facets, is_halfspace, origin_body
from collide.narrowphase.facets.balls_within_balls import within_balls
from collide.narrowphase.facets.facet_queries import points_in_solid, surface_distances
from collide.narrowphase.facets.winding_numbers import INSIDE, ON_SURFACE
from collide.shapes.shape import Shape, kept_with_shape

#: Points of a grid along each axis, facets with points beneath, how deep beneath as parts of the size; balls kept, and
#: how much of a ball is to stand out of the others; vertices kept as balls of radius 0.
_GRID, _FACETS, _BENEATH, _MAX_BALLS, _OUT, _VERTICES = 20, 700, (0.003, 0.01, 0.03, 0.08), 800, 0.04, 200
#: The smallest cubes, as a part of the shortest translation known; cubes looked at in all, and at once.
_SMALLEST, _CUBES, _AT_ONCE = 2.0**-8, 120_000, 512

_NO_BALLS = np.zeros((0, 4))


@kept_with_shape("_inner_balls")
def inner_balls(shape: Shape) -> np.ndarray:
    """(k, 4) centres in the shape's frame and radii, proven, of balls within a shape's core, or, of a curved shape, the
    polytope within; vertices among them, and of surfaces, segments and points no other.

    Some thousand points of a solid are asked for their distance to the surface, once a shape.
    """
    body = body_within(shape)
    assert body is not None
    corners = body.tree.triangles.reshape(-1, 3, 3)
    if not body.solid:
        return _points_of_facets(corners)
    vertices = np.unique(corners.reshape(-1, 3), axis=0)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    steps = (np.arange(_GRID) + 0.5) / _GRID
    grid = low + (high - low) * np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
    some = corners[:: len(corners) // _FACETS + 1]
    normals = np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0])
    normals /= np.maximum(np.sqrt(np.square(normals).sum(axis=1)), 1e-300)[:, None]
    size = float((high - low).max())
    beneath = [some.mean(axis=1) - part * size * normals for part in _BENEATH]
    points = np.concatenate([grid, *beneath])
    radii = distances_within(body, np.eye(4), points)
    balls = np.column_stack([points, radii])[radii > 0.0]
    inner: list[np.ndarray] = []
    balls = balls[np.argsort(-balls[:, 3], kind="stable")]
    while len(balls) and len(inner) < _MAX_BALLS:
        inner.append(balls[0])
        apart = np.sqrt(np.square(balls[:, :3] - balls[0, :3]).sum(axis=1))
        balls = balls[apart + balls[:, 3] > balls[0, 3] + _OUT * balls[:, 3]]
    ends = vertices[(vertices @ directions(_VERTICES // 2).T).argmax(axis=0)]
    points = np.unique(np.concatenate([ends, vertices[:: 2 * len(vertices) // _VERTICES + 1]]), axis=0)
    return np.concatenate([np.array(inner).reshape(-1, 4), np.column_stack([points, np.zeros(len(points))])])


def _points_of_facets(corners: np.ndarray) -> np.ndarray:
    """(k, 4) corners and points of edges of facets (m, 3, 3), as balls of radius 0; of many facets some."""
    corners = corners[:: len(corners) // _VERTICES + 1]
    t = np.linspace(0.0, 1.0, max(2, min(_GRID, _MAX_BALLS // (3 * len(corners)))), endpoint=False)[:, None, None]
    ends = [corners[:, [k]] + t[:, :, None] * (corners[:, [k - 1]] - corners[:, [k]]) for k in range(3)]
    points = np.unique(np.concatenate(ends).reshape(-1, 3), axis=0)
    return np.column_stack([points, np.zeros(len(points))])


def body_within(shape: Shape) -> Body | None:
    """The body of facets of a shape, or within a curved shape; ``None`` of half-spaces, and where no polytope is
    found."""
    if is_halfspace(shape):
        return None
    return body_of(shape) if shape.is_field or has_facets(shape) else enclosure_of(shape).inner


def distances_within(body: Body, X: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(n,) proven lower bounds of the distances [m] from points (n, 3) in a body at a pose to its surface; −∞ of points
    outside."""
    distances = np.full(len(points), -math.inf)
    if not len(points):
        return distances
    poses = poses_at(points)
    sides = points_in_solid(body.tree, X, np.zeros(3), poses)
    some = np.flatnonzero((sides == INSIDE) | (sides == ON_SURFACE))
    if len(some):
        origin = origin_body().tree
        distances[some] = surface_distances(body.tree, origin, X, np.ascontiguousarray(poses[some])).lower
    return distances


@cache
def directions(n: int) -> np.ndarray:
    """(n, 3) unit vectors spread evenly, along a spiral of golden angles."""
    k = np.arange(n) + 0.5
    z, angle = 1.0 - 2.0 * k / n, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def depth_of_solids(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, known: float) -> float:
    """A proven lower bound [m] of the depth of two solids at poses (4, 4), no more than a known length."""
    a, b = (balls_at(inner_balls(shape), X) for shape, X in ((A, X_WA), (B, X_WB)))
    b[:, 3] += body_of(A).radius + body_of(B).radius
    return depth_of_balls(a, b, float(np.abs(X_WA[:3, 3]).max() + np.abs(X_WB[:3, 3]).max()), known)


def depth_of_balls(a: np.ndarray, b: np.ndarray, size: float, known: float, more: np.ndarray = _NO_BALLS) -> float:
    """A proven lower bound [m] of the depth of bodies, by balls (k, 4) within A and (m, 4) within B; a known length at
    most.

    size : the largest shift of the poses of the balls [m].   more : (j, 4) balls of translations of B, all of which
    leave the bodies together.
    """
    centres = (a[:, None, :3] - b[None, :, :3]).reshape(-1, 3)
    radii = (a[:, None, 3] + b[None, :, 3]).reshape(-1)
    # B moved by x: |a − (b + x)| < r + s, so x is within the sum of a − b; rounding is within 2⁻⁴⁵ of the size.
    centres, radii = np.concatenate([centres, more[:, :3]]), np.concatenate([radii, more[:, 3]])
    radii -= 2.0**-45 * (size + sum(np.abs(of[:, :3]).max(initial=0.0) for of in (a, b, centres)))
    reach = np.sqrt(np.square(centres).sum(axis=1)) - radii
    some = np.flatnonzero((reach < known) & (radii > _SMALLEST * known))
    some = some[np.argsort(-radii[some], kind="stable")]
    return _covered(np.ascontiguousarray(np.column_stack([centres, radii])[some]), known) if len(some) else 0.0


def balls_at(balls: np.ndarray, X: np.ndarray) -> np.ndarray:
    """Balls in the world: a matrix shrinks a ball by no more than the least of its stretches."""
    least = float(np.linalg.svd(X[:3, :3], compute_uv=False).min()) * (1.0 - 2.0**-40)
    return np.column_stack([balls[:, :3] @ X[:3, :3].T + X[:3, 3], balls[:, 3] * min(least, 1.0)])


def _covered(balls: np.ndarray, known: float) -> float:
    """The radius of a ball around 0 within the union of balls (k, 4), the largest first; up to a known length."""
    middles, half, end = np.zeros((1, 3)), np.array([known]), known
    offsets = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=np.float64)
    nearest, n_seen = np.zeros(1), 0
    while len(middles):
        order = np.argsort(nearest, kind="stable")
        now, later = order[:_AT_ONCE], order[_AT_ONCE:]
        if n_seen > _CUBES:
            return min(end, float(nearest[order[0]]))
        n_seen += len(now)
        inside = np.zeros(len(now), dtype=np.uint8)
        points = np.ascontiguousarray(np.column_stack([middles[now], half[now] * (math.sqrt(3.0) * (1.0 + 2.0**-40))]))
        within_balls(address_of(balls), len(balls), address_of(points), len(now), address_of(inside))
        uncovered = now[inside == 0]
        small = half[uncovered] <= _SMALLEST * known
        end = min(end, float(nearest[uncovered[small]].min(initial=math.inf)))
        uncovered = uncovered[~small]
        cut = (middles[uncovered][:, None] + 0.5 * half[uncovered][:, None, None] * offsets).reshape(-1, 3)
        half_edges = np.repeat(0.5 * half[uncovered], 8)
        away = np.sqrt(np.square(np.maximum(np.abs(cut) - half_edges[:, None], 0.0)).sum(axis=1)) * (1.0 - 2.0**-40)
        middles, half = np.concatenate([middles[later], cut]), np.concatenate([half[later], half_edges])
        nearest = np.concatenate([nearest[later], away])
        near = nearest < end
        middles, half, nearest = middles[near], half[near], nearest[near]
    return end
