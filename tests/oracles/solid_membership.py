"""How often closed triangles wind around points, by solid angles, and in fractions where these are no whole number.

A. van Oosterom, J. Strackee, "The solid angle of a plane triangle" (1983). Shares no code with the engine.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from naive_triangles import winding


def windings(corners: list, points: np.ndarray) -> list[int | None]:
    """Winding number around each point (n, 3) of triangles whose corners are fractions; None on a triangle."""
    angles, is_near = solid_angles(as_doubles(corners), points)
    out: list[int | None] = []
    for number, near, point in zip((angles / (4.0 * np.pi)).tolist(), is_near.tolist(), points.tolist()):
        whole = round(number) if np.isfinite(number) else 0
        if abs(number - whole) < 1e-3 and not near:
            out.append(whole)
        else:
            out.append(winding(corners, [Fraction(x) for x in point]))
    return out


def as_doubles(corners: list) -> np.ndarray:
    """(k, 3, 3) of triangles of fractions."""
    return np.array([[[float(x) for x in p] for p in t] for t in corners]).reshape(-1, 3, 3)


def solid_angles(triangles: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """((n,) sums of the solid angles of triangles (k, 3, 3) seen from points (n, 3), (n,) bool: near one)."""
    if not len(triangles):
        return np.zeros(len(points)), np.zeros(len(points), dtype=bool)
    a, b, c = (triangles[None, :, k] - points[:, None] for k in range(3))
    la, lb, lc = (np.sqrt((v * v).sum(axis=2)) for v in (a, b, c))
    height = (a * np.cross(b, c)).sum(axis=2)
    base = la * lb * lc + (a * b).sum(axis=2) * lc + (b * c).sum(axis=2) * la + (c * a).sum(axis=2) * lb
    # Heights are off by the rounding of products, and of corners.
    largest = np.maximum(la, np.maximum(lb, lc))
    error = 4e-15 * (la * lb * lc + np.abs(triangles).max() * largest**2)
    near = (np.abs(height) < error) & (base < 1e-6 * la * lb * lc)
    return 2.0 * np.arctan2(height, base).sum(axis=1), near.any(axis=1)
