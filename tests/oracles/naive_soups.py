"""Distances of bodies as soups of triangles swept by balls, in numpy: every triangle against every other."""

from __future__ import annotations

import numpy as np

import collide

#: Triangles (n, 3, 3) in the body's frame, and the radius of the ball that sweeps them [m].
Soup = tuple[np.ndarray, float]


def soups_of(shape: collide.Shape) -> list[Soup] | None:
    """What a shape's surface is, exactly; None of curved shapes, which no such soup is."""
    if isinstance(shape, collide.Compound):
        soups = []
        for item, X in shape.items:
            of_item = soups_of(item)
            if of_item is None:
                return None
            soups += [(corners @ X[:3, :3].T + X[:3, 3], radius) for corners, radius in of_item]
        return soups
    if isinstance(shape, (collide.Mesh, collide.HeightField)):
        return [(np.asarray(shape.vertices)[shape.faces], 0.0)]
    if isinstance(shape, collide.Sphere):
        return [(np.zeros((1, 3, 3)), shape.radius)]
    if isinstance(shape, collide.Capsule):
        end = np.array([0.0, 0.0, 0.5 * shape.length])
        return [(np.array([[-end, end, end]]), shape.radius)]
    if isinstance(shape, (collide.Box, collide.ConvexHull)):
        vertices, faces = collide.tessellate(shape)[:2]
        return [(np.asarray(vertices)[faces], 0.0)]
    return None


def gap(A: collide.Shape, B: collide.Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float = np.inf) -> float | None:
    """The distance of two bodies that are apart [m], infinite where balls around them are farther apart than a limit;
    None where one is a curved shape."""
    if isinstance(A, collide.Halfspace):
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    soups = soups_of(A)
    if soups is None:
        return None
    placed = [(corners @ X_WA[:3, :3].T + X_WA[:3, 3], radius) for corners, radius in soups]
    if isinstance(B, collide.Halfspace):
        n = X_WB[:3, :3] @ B.normal
        return min((T @ n - n @ X_WB[:3, 3] - B.offset).min() / np.linalg.norm(n) - radius for T, radius in placed)
    others = soups_of(B)
    if others is None:
        return None
    least = np.inf
    for P, radius in placed:
        for corners, other_radius in others:
            Q = corners @ X_WB[:3, :3].T + X_WB[:3, 3]
            (p, reach), (q, other_reach) = _ball_around(P), _ball_around(Q)
            if np.linalg.norm(q - p) - reach - other_reach - radius - other_radius <= limit:
                least = min(least, triangle_gap(P, Q) - radius - other_radius)
    return least


def triangle_gap(P: np.ndarray, Q: np.ndarray) -> float:
    """The least distance of triangles (n, 3, 3) and (m, 3, 3) that do not meet: corners to faces, edges to edges."""
    edges_p, edges_q = P.reshape(-1, 3), Q.reshape(-1, 3)
    ends_p, ends_q = np.roll(P, -1, axis=1).reshape(-1, 3), np.roll(Q, -1, axis=1).reshape(-1, 3)
    of_edges = _between_segments(edges_p[:, None], ends_p[:, None], edges_q[None], ends_q[None]).min()
    return float(min(of_edges, _above_faces(edges_p, Q), _above_faces(edges_q, P)))


def _ball_around(T: np.ndarray) -> tuple[np.ndarray, float]:
    centre = T.reshape(-1, 3).mean(axis=0)
    return centre, float(_length(T - centre).max())


def _between_segments(a, b, c, d) -> np.ndarray:
    """The least of: both ends of either on the other, and the nearest points of the lines where both are inside."""
    u, v, w = b - a, d - c, a - c
    uu, vv, uv, uw, vw = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, w), _dot(v, w)
    least = np.minimum(
        np.minimum(_to_segment(a, c, d), _to_segment(b, c, d)), np.minimum(_to_segment(c, a, b), _to_segment(d, a, b))
    )
    determinant = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (uv * vw - vv * uw) / determinant, (uu * vw - uv * uw) / determinant
        inside = (determinant > 1e-14 * uu * vv) & (s > 0) & (s < 1) & (t > 0) & (t < 1)
        crossing = _length(w + s[..., None] * u - t[..., None] * v)
    return np.where(inside, np.minimum(least, crossing), least)


def _to_segment(p, a, b) -> np.ndarray:
    u = b - a
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.nan_to_num(np.clip(_dot(p - a, u) / _dot(u, u), 0.0, 1.0))
    return _length(p - a - t[..., None] * u)


def _above_faces(points: np.ndarray, T: np.ndarray) -> float:
    """The least height of points over faces that hold their feet; infinite where there is no such pair."""
    n = np.cross(T[:, 1] - T[:, 0], T[:, 2] - T[:, 0])
    length = _length(n)
    T, n = T[length > 0.0], n[length > 0.0] / length[length > 0.0][:, None]
    inside = np.ones((len(points), len(T)), dtype=bool)
    for k in range(3):
        across = np.cross(n, T[:, (k + 1) % 3] - T[:, k])
        inside &= _dot(points[:, None] - T[None, :, k], across[None]) >= 0.0
    heights = np.abs(_dot(points[:, None] - T[None, :, 0], n[None]))
    return float(heights[inside].min(initial=np.inf))


def _dot(u, v) -> np.ndarray:
    return (u * v).sum(axis=-1)


def _length(v) -> np.ndarray:
    return np.sqrt(_dot(v, v))
