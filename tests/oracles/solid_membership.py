"""How often closed triangles wind around points: how often a ray passes them, in doubles where their error leaves no
doubt, and else in integers. Every number is exact. Shares no code with the engine.

With all coordinates scaled to at most 1 and u = 2^-53, a difference w of a corner and the point is off by at most 3 u:
the corner was rounded once, and so is the difference, which is at most 2. For M no less than 3 u nor any entry of three
such rows, their determinant is off by at most 75 u M² + 48 u M³: each of its six products changes by 9 u M², by 12.5 u
M² with terms of higher order, and is rounded at most eight times, those of the sums included. The determinant of two
such rows and an exact one, whose entries are at most 1, is off by at most 42 u M + 48 u M² by the same count.
"""

from __future__ import annotations

from fractions import Fraction
from math import lcm

import numpy as np
from naive_triangles import cross, inner, minus

#: Rays, tried in turn where an edge is grazed; in doubles they are divided by `_LENGTH`, which is exact.
_RAYS = ((5437, -2963, 7919), (-7001, 4243, 3581), (2999, 6997, -5003), (1, -6151, 7703))
_LENGTH = 2.0**13
_U = 2.0**-53
#: Entries of (points, triangles) looked at in one go.
_CHUNK = 4_000_000


def windings(corners: list, points: np.ndarray) -> list[int | None]:
    """Winding number around each point (n, 3) of triangles whose corners are fractions; None on a triangle."""
    out: list[int | None] = [0] * len(points)
    if not corners or not len(points):
        return out
    surface, left = _Surface(corners, points), np.arange(len(points))
    for ray in _RAYS:
        numbers, grazed = surface.passed(left, ray)
        for k, number in zip(left.tolist(), numbers):
            out[k] = number
        left = left[grazed]
        if not len(left):
            return out
    raise AssertionError("every ray grazed an edge: choose other rays")


def as_doubles(corners: list) -> np.ndarray:
    """(k, 3, 3) of triangles of fractions."""
    return np.array([[[float(x) for x in p] for p in t] for t in corners]).reshape(-1, 3, 3)


class _Surface:
    """Triangles and points, exact, and in doubles of at most 1."""

    def __init__(self, corners: list, points: np.ndarray):
        self.corners, self.points = corners, points
        triangles = as_doubles(corners)
        exponent = int(np.frexp(max(np.abs(triangles).max(), np.abs(points).max()))[1])
        # In two steps: a power of two that scales the smallest doubles to 1 is none itself.
        self.triangles, self.at = (np.ldexp(np.ldexp(x, -(exponent // 2)), exponent // 2 - exponent)
                                   for x in (triangles, points))
        self._whole: dict[int, tuple[list[list[int]], int]] = {}

    def passed(self, some: np.ndarray, ray: tuple[int, int, int]) -> tuple[list[int | None], np.ndarray]:
        """(how often triangles are passed from inside by the ray of each point less from outside, None on a triangle;
        (len(some),) bool: an edge was grazed)."""
        p, t = self._near(some, ray)
        sign, open_ = _signs(self.triangles[t] - self.at[some[p], None], np.array(ray) / _LENGTH)
        numbers: list[int | None] = np.bincount(p, weights=sign, minlength=len(some)).astype(int).tolist()
        grazed = np.zeros(len(some), dtype=bool)
        for i, j in zip(p[open_].tolist(), t[open_].tolist()):
            if numbers[i] is None:
                continue
            found = self._exact(j, self.points[some[i]].tolist(), ray)
            if found == "on":
                numbers[i] = None
            elif found == "grazed":
                grazed[i] = True
            else:
                numbers[i] += found
        return numbers, grazed & np.array([number is not None for number in numbers])

    def _near(self, some: np.ndarray, ray: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
        """Pairs of points and triangles that no projection parts. Across the ray the line of a point is one value, and
        a triangle that it meets has that between its corners' values; along the ray some corner is not behind. The
        axes are exact; of |x| ≤ 1 an inner product with e is off by at most 4 u ‖e‖₁, the corners' rounding included.
        """
        x, y, z = ray
        axes = np.array([(y, -x, 0), (x * z, y * z, -x * x - y * y), ray], dtype=float)
        slack = 16 * _U * np.abs(axes).sum(axis=1)
        low, high = (bound(self.triangles @ axes.T, axis=1) for bound in (np.min, np.max))
        low, high, at = low - slack, high + slack, self.at[some] @ axes.T
        pairs = []
        step = max(1, _CHUNK // len(low))
        for start in range(0, len(at), step):
            q = at[start : start + step, None]
            meets = q[..., 2] <= high[:, 2]
            for k in range(2):
                meets &= (q[..., k] >= low[:, k]) & (q[..., k] <= high[:, k])
            p, t = np.nonzero(meets)
            pairs.append((p + start, t))
        return tuple(np.concatenate(ids) for ids in zip(*pairs))

    def _exact(self, j: int, point: list[float], ray: tuple[int, int, int]) -> int | str:
        """Triangle j and the ray of a point, in integers: 1, -1 or 0, "on" the triangle or an edge "grazed"."""
        if j not in self._whole:
            scale = lcm(*(Fraction(v).denominator for corner in self.corners[j] for v in corner))
            self._whole[j] = [[int(v * scale) for v in corner] for corner in self.corners[j]], scale
        corners, scale = self._whole[j]
        ratios = [v.as_integer_ratio() for v in point]
        unit = max(bottom for _, bottom in ratios)  # powers of two
        p = [top * (unit // bottom) * scale for top, bottom in ratios]
        w = [minus([v * unit for v in corner], p) for corner in corners]
        edges = [(w[k], w[(k + 1) % 3]) for k in range(3)]
        n = cross(minus(w[1], w[0]), minus(w[2], w[0]))
        if not any(n):
            return 0  # neighbours close over what has no area
        height, slope = inner(n, w[0]), inner(n, ray)
        if height == 0 and min(inner(n, cross(x, y)) for x, y in edges) >= 0:
            return "on"
        sides = [inner(cross(x, y), ray) for x, y in edges]
        if min(sides) > 0 or max(sides) < 0:
            return (1 if slope > 0 else -1) if height * slope > 0 else 0
        return "grazed" if (min(sides) >= 0 or max(sides) <= 0) and height * slope >= 0 else 0


def _signs(w: np.ndarray, ray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For corners less points (m, 3, 3): ((m,) 1, -1 or 0 as the ray passes a triangle, (m,) bool: doubles leave it
    open). The line misses a triangle where two of its sides have different signs, by more than they may be off; where
    all three have one sign, that of the height says whether the triangle is ahead. Bounds: the module's, rounded up."""
    size = np.abs(w).max(axis=(1, 2)) + 8 * _U
    normals = np.cross(w, np.roll(w, -1, axis=1))
    sides = normals @ ray
    height = (normals[:, 0] * w[:, 2]).sum(axis=1)
    error = 100 * _U * size * (1 + size)
    up, down = sides.min(axis=1) > error, sides.max(axis=1) < -error
    misses = (sides.min(axis=1) < -error) & (sides.max(axis=1) > error)
    sure = np.abs(height) > error * size
    turn = np.where(up, 1, np.where(down, -1, 0))
    return np.where(sure & (turn * height > 0), turn, 0), ~(misses | (sure & (up | down)))
