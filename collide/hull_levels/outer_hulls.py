"""Bodies of few planes around a convex body: each plane touches the body, and cuts off a corner far from the body.

Begun with the six sides of the body's box. A corner of the present planes is at some distance from the body; the plane
through the body's nearest point, across the line between the two, cuts the corner off. Corners are cut farthest first,
a fifth more of them in a round, no two on an edge: the distances of the rest are then still as they were.

The planes are moved outwards by a margin, part of the body's size, and corners are rounded, so that nothing is proven
here: `nested_hulls.py` proves with exact hulls, and asks again with a wider margin where rounding was larger.
"""

from __future__ import annotations

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.hull_levels.body_hull import BodyHull

#: Where the planes' margin begins, in parts of the body's size; corners within so many margins are not cut.
FIRST_MARGIN, _NEAR = 2.0**-42, 8.0
#: So many more planes a round.
_GROWTH = 1.2
#: The sine of the angle, the product of two sines for three planes, below which no corner is computed: planes of such
#: corners meet the others nearby, too.
_FLAT = 2.0**-40

Key = tuple[int, ...]


class OuterPlanes:
    """Planes, ``normals`` (m, 3) @ x ≤ ``heights`` (m,), around a body; they grow in number."""

    def __init__(self, body: BodyHull, margin: float):
        self.body, self.margin = body, margin * body.size
        self.centre = body.vertices.mean(axis=0)
        self.normals = np.empty((0, 3))
        self.heights = np.empty(0)
        self._add(np.vstack([np.eye(3), -np.eye(3)]))
        #: Planes of a corner → its distance from the body, and the direction from the body to the corner.
        self._seen: dict[Key, tuple[float, np.ndarray]] = {}

    def _add(self, normals: np.ndarray) -> None:
        touched = self.body.vertices[self.body.farthest(normals)]
        heights = np.einsum("ij,ij->i", normals, touched) + self.margin
        self.normals, self.heights = np.vstack([self.normals, normals]), np.append(self.heights, heights)

    def grow(self, count: int) -> None:
        """Add planes until there are so many, or until corners are as near the body as rounding lets them be."""
        while len(self.heights) < count:
            corners, keys = self.corners()
            self._look_at(corners, keys)
            n_more = min(count - len(self.heights), max(1, int((_GROWTH - 1.0) * len(self.heights))))
            cut = self._farthest_apart(keys, n_more)
            if not cut:
                return
            self._add(np.array([self._seen[key][1] for key in cut]))

    def corners(self) -> tuple[np.ndarray, list[Key]]:
        """(corners (c, 3), the three planes of each): facets of the hull of the planes' polars about the centre."""
        heights = self.heights - self.normals @ self.centre
        triples = np.sort(convex_hull(self.normals / heights[:, None]).facets, axis=1)
        n, h = self.normals[triples], heights[triples]
        across = [np.cross(n[:, 1], n[:, 2]), np.cross(n[:, 2], n[:, 0]), np.cross(n[:, 0], n[:, 1])]
        volume = np.einsum("ij,ij->i", n[:, 0], across[0])
        steep = np.abs(volume) > _FLAT
        place = sum(h[:, k, None] * across[k] for k in range(3))
        return place[steep] / volume[steep, None] + self.centre, [tuple(key) for key in triples[steep].tolist()]

    def _look_at(self, corners: np.ndarray, keys: list[Key]) -> None:
        new = [k for k, key in enumerate(keys) if key not in self._seen]
        rows = self.body.nearest(corners[new])
        for k, far, normal in zip(new, rows["distance"].tolist(), rows["normal"]):
            self._seen[keys[k]] = far, normal

    def _farthest_apart(self, keys: list[Key], n_more: int) -> list[Key]:
        """The corners farthest from the body, at most so many, no two of them on a common edge."""
        cut: list[Key] = []
        edges: set[Key] = set()
        for key in sorted(keys, key=lambda key: -self._seen[key][0]):
            a, b, c = key
            if self._seen[key][0] <= _NEAR * self.margin or len(cut) == n_more:
                break
            if edges.isdisjoint(sides := {(a, b), (a, c), (b, c)}):
                edges |= sides
                cut.append(key)
        return cut


def outer_corners(body: BodyHull, counts: list[int], margin: float) -> dict[int, np.ndarray]:
    """Number of planes → corners (c, 3): bodies of at most so many planes, for each of these counts, ascending; fewer
    bodies where the last planes are as near the body as rounding lets them be.

    margin : of the planes, in parts of the body's size. A body's corners are moved outwards by more than what rounding
        moves the corners of the next one.
    """
    planes = OuterPlanes(body, margin)
    made: dict[int, np.ndarray] = {}
    for count in counts:
        planes.grow(count)
        if len(planes.heights) not in made:
            made[len(planes.heights)] = planes.corners()[0]
    return {
        n: planes.centre + (1.0 + 4.0 * margin * (len(made) - 1 - k)) * (corners - planes.centre)
        for k, (n, corners) in enumerate(made.items())
    }
