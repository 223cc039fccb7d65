"""The hull of points as half-edges, in plain Python, judged by dictionaries."""

from __future__ import annotations

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.numerics.orientation import CloudView
from collide.papers.hierarchies.half_edges import FREE, USED, HalfEdges, following, preceding
from collide.papers.hierarchies.true_facets import Cloud, twins_of


def view_of(cloud: Cloud) -> CloudView:
    """A cloud as kernels see it."""
    originals, scaled = cloud.originals.ravel(), cloud.scaled.ravel()
    return CloudView(scaled, originals, cloud.work, cloud.digits, cloud.count, cloud.exponent)


class Surface:
    """The hull of points as half-edges, its cloud, and rings by dictionaries."""

    def __init__(self, points: np.ndarray, n: int | None = None, room: int = 0):
        """Of the first n points, with room for more triangles."""
        triangles = np.ascontiguousarray(convex_hull(points[:n]).facets, dtype=np.int32)
        cloud = Cloud(points)
        self.points, self.kept, self.cloud = points, cloud, view_of(cloud)
        leaving = np.full(len(points), -1)
        leaving[triangles.ravel()] = np.arange(triangles.size)
        state = np.array([-1, len(triangles), *[-1] * 4, 0])
        more = np.full(3 * room, -1)
        corners, twins = (np.concatenate([x.ravel(), more]).astype(np.int64) for x in (triangles, twins_of(triangles)))
        self.mesh = HalfEdges(corners, twins, leaving, state)
        self.vertices = sorted(set(triangles.ravel().tolist()))

    def triangles(self) -> list[tuple[int, int, int]]:
        rows = self.mesh.corners[: 3 * self.mesh.state[USED]].reshape(-1, 3).tolist()
        return [tuple(row) for row in rows if row[0] >= 0]

    def ring(self, v: int) -> list[int]:
        """Neighbours in order, from the triangles alone, beginning with the least."""
        after = {}
        for a, b, c in self.triangles():
            for x, y, z in ((a, b, c), (b, c, a), (c, a, b)):
                if x == v:
                    after[y] = z
        ring = [min(after)]
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        assert len(ring) == len(after)
        return ring

    def check(self) -> None:
        corners, twins, leaving, state = self.mesh
        free, t = set(), state[FREE]
        while t >= 0:
            assert corners[3 * t] == -1 and t not in free
            free.add(t)
            t = twins[3 * t]
        there = [h for h in range(3 * state[USED]) if h // 3 not in free]
        for h in there:
            g = twins[h]
            assert twins[g] == h and corners[g] == corners[following(h)] and corners[following(g)] == corners[h]
            assert following(preceding(h)) == h == preceding(following(h)) and h // 3 == following(h) // 3
        for v in self.vertices:
            assert corners[leaving[v]] == v and leaving[v] // 3 not in free
        assert len(self.vertices) - len(there) // 2 + len(there) // 3 == 2, "Euler"

    def is_hull(self, slack: float) -> bool:
        """Every vertex is behind every triangle."""
        P = self.points
        return all(
            ((P[self.vertices] - P[a]) @ np.cross(P[b] - P[a], P[c] - P[a])).max() <= slack
            for a, b, c in self.triangles()
        )
