"""A point within a cell of an arrangement, exactly."""

from __future__ import annotations

import numpy as np

from collide.errors import CollideError
from collide.numerics.exact_points import Point
from collide.numerics.exact_vectors import cross, inner, minus
from collide.solids.arrangement import Arrangement
from collide.solids.cut_points import Rational, reduced


class CellPoints:
    """From the middle of a sheet a little way off, so little that no other sheet lies between."""

    def __init__(self, arrangement: Arrangement):
        self.arrangement = arrangement
        points, triangles = arrangement.points, arrangement.sheets.triangles
        ids, which = np.unique(triangles, return_inverse=True)
        near = np.array([points.near(p) for p in ids.tolist()])
        corners = near[which.reshape(triangles.shape)]
        slack = 2.0**-48 * np.abs(near).max(initial=0.0)
        self.low, self.high = corners.min(axis=1) - slack, corners.max(axis=1) + slack

    def within(self, cell: int) -> Rational:
        """A point of the cell, in units of the grid less the origin."""
        sides = self.arrangement.cells.sides
        rows = np.flatnonzero((sides == cell).any(axis=1) & (sides[:, 0] != sides[:, 1]))
        row = int(rows[np.argmax((self.high[rows] - self.low[rows]).min(axis=1))])
        return self._beside(row, int(sides[row, 1] == cell))

    def _beside(self, row: int, side: int) -> Rational:
        points, sheets = self.arrangement.points, self.arrangement.sheets
        corners = [points.exact(p) for p in sheets.triangles[row].tolist()]
        w = corners[0][3] * corners[1][3] * corners[2][3]
        at: Point = tuple(sum(c[k] * (w // c[3]) for c in corners) for k in range(3))  # type: ignore[assignment]
        middle = reduced(at[0], at[1], at[2], 3 * w)
        n = points.facets.normal(int(sheets.facet[row]))
        ahead = n if side == 0 else (-n[0], -n[1], -n[2])
        size = int(max(self.high[row] - self.low[row])) + 1
        longest = max(abs(x) for x in n)
        for halvings in range(8, 1 << 14, 24):
            # middle + ahead · size / (longest · 2^halvings)
            below = longest << halvings
            x, y, z, v = (c * below for c in middle)
            far = [c + size * d * middle[3] for c, d in zip((x, y, z), ahead)]
            end = reduced(far[0], far[1], far[2], v)
            if not any(self._between(middle, end, k) for k in self._close(middle, end, row)):
                return end
        raise CollideError("no point is found within a cell of an arrangement; please report it")

    def _close(self, a: Rational, b: Rational, row: int) -> list[int]:
        ends = np.array([[x / p[3] for x in p[:3]] for p in (a, b)])
        near_rows = ((self.low <= ends.max(axis=0)) & (self.high >= ends.min(axis=0))).all(axis=1)
        near_rows[row] = False
        return np.flatnonzero(near_rows).tolist()

    def _between(self, a: Rational, b: Rational, row: int) -> bool:
        """False only if a sheet certainly misses the segment from a to b."""
        points, sheets = self.arrangement.points, self.arrangement.sheets
        facet = int(sheets.facet[row])
        n, start = points.facets.normal(facet), points.facets.exact(int(points.facets.corners[facet, 0]))
        at_a, at_b = (inner(n, p[:3]) - inner(n, start) * p[3] for p in (a, b))
        if (at_a > 0 and at_b > 0) or (at_a < 0 and at_b < 0):
            return False
        d = minus(_scaled(b, a[3]), _scaled(a, b[3]))
        signs = set()
        corners = [points.exact(p) for p in sheets.triangles[row].tolist()]
        for p, q in zip(corners, [*corners[1:], corners[0]]):
            from_p, along = minus(_scaled(a, p[3]), _scaled(p, a[3])), minus(_scaled(q, p[3]), _scaled(p, q[3]))
            value = inner(cross(along, d), from_p)
            signs.add((value > 0) - (value < 0))
        return not {1, -1} <= signs


def _scaled(p: Rational, factor: int) -> Point:
    return p[0] * factor, p[1] * factor, p[2] * factor
