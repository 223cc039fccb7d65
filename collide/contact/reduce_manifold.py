"""Manifold reduction: of a patch's points the deepest, and those that span the greatest area."""

from __future__ import annotations

import numpy as np

#: A point is on a wall where it lies more than _STEEP times as far above one of the _LOWEST lowest points as aside of
#: it.
_STEEP, _LOWEST = 2.0, 512


def reduce_manifold(
    flat: np.ndarray, gap: np.ndarray, error: np.ndarray, max_points: int, tolerance: float
) -> list[int]:
    """Indices of at most ``max_points`` points, the one of least gap first, then around the patch.

    flat : (k, 2) places in the plane across the normal.   gap, error : (k,).   tolerance : lengths below it are
    rounding [m].
    Corners of the convex hull are kept, and the point of least gap where no corner is as deep; of more than
    ``max_points`` of them those that span the greatest area, taken one by one. Equal input gives equal output. O(k log
    k).
    """
    order = np.lexsort((flat[:, 1], flat[:, 0], gap))
    corners = _open_hull(flat, gap, order[:_LOWEST], tolerance)
    deepest = int(order[0])
    known = float(gap[deepest] + error[deepest]) + tolerance
    as_deep = [k for k in corners if gap[k] - error[k] <= known]
    if as_deep:
        deepest = min(as_deep, key=lambda k: (np.round(gap[k] / max(tolerance, 1e-300)), *flat[k]))
        at = corners.index(deepest)
        selected = corners[at:] + corners[:at]
    else:
        selected = [deepest, *corners]
    return selected if len(selected) <= max_points else _widest(flat, selected, max_points)


def _open_hull(flat: np.ndarray, gap: np.ndarray, lowest: np.ndarray, tolerance: float) -> list[int]:
    """Corners of the hull of what is on no wall: that rises steeply from one of the lowest points."""
    remaining = np.arange(len(gap))
    while True:
        corners = remaining[_hull(flat[remaining], gap[remaining], tolerance)]
        rise = gap[corners][:, None] - gap[lowest][None]
        aside = np.sqrt(np.square(flat[corners][:, None] - flat[lowest][None]).sum(axis=2))
        steep = (rise > _STEEP * aside + tolerance).any(axis=1)
        if not steep.any():
            return corners.tolist()
        remaining = np.setdiff1d(remaining, corners[steep])


def _hull(flat: np.ndarray, gap: np.ndarray, tolerance: float) -> list[int]:
    """Corners of the hull, counter-clockwise, none nearer than the tolerance to the line through its neighbours.

    A. M. Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979). Of points in one place
    the one of least gap is taken.
    """
    step = max(tolerance, 1e-300)
    cells = np.round(flat / step) if np.abs(flat).max() < 2.0**50 * step else flat
    order = np.lexsort((gap, cells[:, 1], cells[:, 0])).tolist()
    x, y = flat[:, 0].tolist(), flat[:, 1].tolist()
    distinct: list[int] = []
    for k in order:
        if not distinct or max(abs(x[k] - x[distinct[-1]]), abs(y[k] - y[distinct[-1]])) > step:
            distinct.append(k)
    if len(distinct) < 3:
        return distinct

    def chain(points: list[int]) -> list[int]:
        out: list[int] = []
        for k in points:
            while len(out) >= 2:
                i, j = out[-2], out[-1]
                ex, ey = x[k] - x[i], y[k] - y[i]
                wide = ex * (y[j] - y[i]) - ey * (x[j] - x[i])
                if -wide > step * (ex * ex + ey * ey) ** 0.5:
                    break
                out.pop()
            out.append(k)
        return out

    lower, upper = chain(distinct), chain(distinct[::-1])
    return lower[:-1] + upper[:-1] if len(lower) + len(upper) > 4 else [distinct[0], distinct[-1]]


def _widest(flat: np.ndarray, selected: list[int], max_points: int) -> list[int]:
    """The first, the farthest from it, then those that add most area, in the order given."""
    x, y = flat[:, 0].tolist(), flat[:, 1].tolist()
    taken = [0]
    while len(taken) < max_points:
        best, at = -1.0, -1
        for k in range(len(selected)):
            if k in taken:
                continue
            value = _added(x, y, [selected[i] for i in sorted(taken)], selected[k])
            if value > best:
                best, at = value, k
        taken.append(at)
    return [selected[i] for i in sorted(taken)]


def _added(x, y, ring: list[int], k: int) -> float:
    """Area between a point and the nearest side of a ring it is beyond; its squared distance from a single point."""
    if len(ring) == 1:
        return (x[k] - x[ring[0]]) ** 2 + (y[k] - y[ring[0]]) ** 2
    best = 0.0
    for i, j in zip(ring, ring[1:] + ring[:1]):
        value = (x[j] - x[i]) * (y[k] - y[i]) - (y[j] - y[i]) * (x[k] - x[i])
        best = max(best, abs(value) if len(ring) == 2 else -value)
    return best
