"""Bodies of few vertices within a convex body: hulls of the body's vertices, each level's among the next level's.

The body's vertex farthest along the normal of each facet of the present hull, and along the bisector at each edge, is
looked at; vertices farthest from the hull are added first, a fifth more of them in a round, no two beside one facet.
Normals alone would not see what is missing at the rim of a thin body, whose facets all face its two sides.
"""

from __future__ import annotations

import numpy as np

from collide.hull.exact_hull import convex_hull
from collide.hull_levels.body_hull import BodyHull, rows_beside
from collide.shapes.convex_hull import ConvexHull

#: So many more vertices a round.
_GROWTH = 1.2
#: Normals of two facets that add up to less are of opposite sides.
_OPPOSITE = 1e-6
#: Directions equal to so many digits are asked once: a flat side has many facets.
_SAME = 9


def inner_vertices(body: BodyHull, counts: list[int]) -> list[np.ndarray]:
    """Rows of ``body.vertices``, ascending, for each of these counts (≥ 8, ascending): at most so many, the rows of a
    count among those of the next. O(log n) for each facet and edge of each round."""
    present = _first(body)
    made = []
    for count in counts:
        while len(present) < min(count, len(body.vertices)):
            more = _next(body, present, min(count - len(present), int((_GROWTH - 1.0) * len(present)) + 1))
            if not more:  # the other vertices are within rounding of the hull
                more = np.setdiff1d(np.arange(len(body.vertices)), present)[: count - len(present)].tolist()
            present = np.append(present, more)
        made.append(np.sort(present))
    return made


def _first(body: BodyHull) -> np.ndarray:
    """Rows of at most eight vertices: the ends of the body along three axes, and where all are in a line, the ends
    across."""
    axes = np.eye(3)
    rows = np.unique(body.farthest(np.vstack([axes, -axes])))
    if body.dimension >= 2 and convex_hull(body.vertices[rows]).dimension == 1:
        along = np.ptp(body.vertices[rows], axis=0)
        across = np.cross(along, axes[np.abs(along).argmin()])
        both = _unit(np.array([across, np.cross(along, across)]))
        rows = np.unique(np.append(rows, body.farthest(np.vstack([both, -both]))))
    return rows


def _next(body: BodyHull, present: np.ndarray, n_more: int) -> list[int]:
    """At most so many vertices, the farthest from the hull of the present vertices."""
    corners = body.vertices[present]
    directions, beside = _directions(corners, convex_hull(corners).facets)
    beyond = body.farthest(directions)
    rows = rows_beside(ConvexHull(corners), body.vertices[beyond])
    facets, more = set[int](), list[int]()
    for k in np.argsort(-rows["distance"], kind="stable").tolist():
        if rows["distance"][k] <= 0.0 or len(more) == n_more:
            break
        if facets.isdisjoint(beside[k]) and (vertex := int(beyond[k])) not in more:
            facets.update(beside[k])
            more.append(vertex)
    return more


def _directions(corners: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """(unit vectors, the facets that each stands for): the normal of each facet (f, 3), and at each edge the bisector
    of two; where these are opposite, of a flat hull, the way out in the plane."""
    a, b, c = (corners[facets[:, k]] for k in range(3))
    normals = _unit(np.cross(b - a, c - a))
    starts, ends = facets.ravel(), np.roll(facets, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    first, second = np.lexsort((high, low)).reshape(-1, 2).T  # every edge is run along twice
    sums = normals[first // 3] + normals[second // 3]
    outwards = np.cross(corners[ends[first]] - corners[starts[first]], normals[first // 3])
    flat = np.abs(sums).max(axis=1) < _OPPOSITE
    directions = np.vstack([normals, _unit(np.where(flat[:, None], outwards, sums))])
    beside = [(f,) for f in range(len(facets))] + list(zip((first // 3).tolist(), (second // 3).tolist()))
    _, asked = np.unique(directions.round(_SAME), axis=0, return_index=True)
    asked = np.sort(asked[directions[asked].any(axis=1)])
    return directions[asked], [beside[k] for k in asked.tolist()]


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Of length 1; of a facet too thin for a normal, 0."""
    lengths = np.linalg.norm(vectors, axis=1)
    return vectors / np.where(lengths > 0.0, lengths, np.inf)[:, None]
