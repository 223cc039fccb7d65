"""Steps of the repair of a surface: vertices joined, repeated facets and inner walls left out, cycles of open edges
closed, facets without area replaced by their neighbours' parts.

All steps work on a chain of oriented triangles, `Chain`, with a source facet for every triangle.
"""

from __future__ import annotations

from collections import defaultdict
from heapq import heapify, heappop, heappush
from typing import NamedTuple

import numpy as np

from collide.mesh.mesh_survey import Survey, survey_surface
from collide.mesh.mesh_topology import COLLAPSED, ONE_SIDED, TURNED
from collide.mesh.nearest_neighbours import MAX_NEIGHBOURS, PointTree
from collide.mesh.shell_volumes import without_area
from collide.solids.border_cycles import border_edges, cycles_of
from collide.solids.joined_parts import components
from collide.solids.least_triangulation import closing_triangles

#: Edges of a cycle, at most, for triangles of the least area: n³ steps.
LONGEST_CYCLE = 1000
#: The source of a triangle that closes a hole.
NEW = -1
_TRIANGLE = np.arange(3, dtype=np.int32)[None]


class Chain(NamedTuple):
    """Oriented triangles over n vertices.

    vertices : (n, 3) float64.   corners : (f, 3) int32.   source : (f,) int64, a number for each, −1 of new triangles.
    """

    vertices: np.ndarray
    corners: np.ndarray
    source: np.ndarray

    def only(self, rows: np.ndarray) -> Chain:
        """These triangles, by rows or as (f,) bool."""
        return self._replace(corners=self.corners[rows], source=self.source[rows])

    def survey(self) -> Survey:
        """The survey of the triangles; O(f)."""
        return survey_surface(self.vertices, self.corners)


class Hole(NamedTuple):
    """A cycle of open edges.

    facets : (k,) numbers of the facets along the edges.   edges : their number.
    length : diagonal of the box around the cycle, in the unit of the vertices.
    width : twice the area of triangles over the hole, divided by the length: the diagonal of a square hole, twice the
        width of a slit, 0 of a vertex on an edge. Of holes that stay open a lower bound.
    """

    facets: np.ndarray
    edges: int
    length: float
    width: float


def with_joined_vertices(chain: Chain, reach: float) -> tuple[Chain, np.ndarray, float]:
    """(the chain with unbalanced edges' vertices joined within a reach, ids (k,) of moved vertices, the farthest move).

    A vertex goes to the vertex with the least id among its neighbours that stay: no move is longer than the reach.
    """
    edges, _ = border_edges(chain.corners)
    ids = np.unique(edges)
    target = np.arange(len(chain.vertices), dtype=np.int32)
    if reach <= 0.0 or len(ids) < 2:
        return chain, ids[:0], 0.0
    points = chain.vertices[ids]
    squares, near = PointTree(points).nearest_to(points, min(MAX_NEIGHBOURS, len(ids)))
    stays = np.ones(len(ids), dtype=bool)
    for k in np.flatnonzero((squares <= reach * reach).sum(axis=1) > 1).tolist():
        lower = [j for j in near[k, squares[k] <= reach * reach].tolist() if j < k and stays[j]]
        if lower:
            target[ids[k]], stays[k] = ids[min(lower)], False
    moved = ids[~stays]
    steps = chain.vertices[moved] - chain.vertices[target[moved]]
    farthest = float(np.sqrt(np.square(steps).sum(axis=1)).max(initial=0.0))
    return chain._replace(corners=target[chain.corners]), moved, farthest


def without_repeats(chain: Chain) -> Chain:
    """The chain with every triangle once, and without pairs of opposite triangles.

    In a connected part of pairs alone, a surface drawn from both sides, the first triangle of each pair remains.
    """
    corners = chain.corners
    proper = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    chain = chain.only(proper)
    if not len(chain.corners):
        return chain
    _, first, which = np.unique(np.sort(chain.corners, axis=1), axis=0, return_index=True, return_inverse=True)
    which = which.ravel()
    if len(first) == len(which):
        return chain
    sense = _sense(chain.corners)
    total = np.bincount(which, weights=sense)
    paired = (total == 0)[which]
    part = _parts(chain.corners, only_two=False)
    only_pairs = np.ones(len(which), dtype=bool)
    only_pairs[part[~paired]] = False
    stands = np.where(total == 0, 0, np.sign(total))[which]
    rows = np.flatnonzero(np.where(paired, only_pairs[part], sense == stands))
    _, earliest = np.unique(which[rows], return_index=True)
    return chain.only(np.sort(rows[earliest]))


def _sense(corners: np.ndarray) -> np.ndarray:
    """(f,) 1 for triangles with ids running upwards around them, −1 for others."""
    a, b, c = corners.T
    return np.where((a < b).astype(np.int8) + (b < c) + (c < a) == 2, 1, -1)


def _edges(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """((3 f,) the edge of every half-edge, (e,) numbers of half-edges, (3 f,) half-edges in the order of edges)."""
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    keys = np.stack([np.minimum(starts, ends), np.maximum(starts, ends)], axis=1)
    _, edge, counts = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    return edge, counts, np.argsort(edge, kind="stable")


def _parts(corners: np.ndarray, only_two: bool) -> np.ndarray:
    """(f,) a number for every triangle, equal within a part: joined along all edges, or edges of two triangles."""
    edge, counts, order = _edges(corners)
    same = edge[order[1:]] == edge[order[:-1]]
    if only_two:
        same &= counts[edge[order[1:]]] == 2
    facets = order // 3
    return components(len(corners), facets[:-1][same], facets[1:][same])


def consistently_oriented(chain: Chain) -> tuple[Chain, np.ndarray]:
    """(the chain with the rarer of two senses of every part turned over, rows of the turned triangles)."""
    flags = chain.survey().flags
    rows = np.flatnonzero(flags & (TURNED | ONE_SIDED) == TURNED)
    return _turned(chain, rows), rows


def _turned(chain: Chain, rows: np.ndarray) -> Chain:
    corners = chain.corners.copy()
    corners[rows] = corners[rows, ::-1]
    return chain._replace(corners=corners)


def turned_outside(chain: Chain, inside_out: int) -> tuple[Chain, np.ndarray]:
    """(a closed chain with parts of negative volume turned over, rows of the turned triangles).

    inside_out : the flag of their facets. Where all parts turned together have cavities and no part inside out, all
    are turned: a solid given with its inside outside keeps its cavities.
    """
    survey = chain.survey()
    wrong = survey.flags & inside_out != 0
    if not wrong.any():
        return chain, np.flatnonzero(wrong)
    everything = np.arange(len(chain.corners))
    reverse = _turned(chain, everything)
    if survey.volumes.sum() < 0.0 and not (reverse.survey().flags & inside_out).any():
        return reverse, everything
    rows = np.flatnonzero(wrong)
    return _turned(chain, rows), rows


# --- walls --------------------------------------------------------------------------------------


def without_walls(chain: Chain) -> Chain:
    """The chain without patches whose whole border is unbalanced: walls inside, and fins.

    A patch is a part joined along edges of two triangles. Of patches with the same border the inner patch goes, the
    patch of least volume towards any point; of all inner patches the smallest goes first.
    """
    while len(chain.corners):
        edges, _ = border_edges(chain.corners)
        patch, borders = _patches(chain.corners)
        surplus = set(map(tuple, edges.tolist()))
        groups: dict[frozenset, list[int]] = defaultdict(list)
        for number, border in borders.items():
            if border and border <= surplus:
                groups[border].append(number)
        if not groups:
            break
        volume, area = _measures(chain, patch)
        inner = [min(numbers, key=lambda k: volume[k]) for numbers in groups.values()]
        chain = chain.only(patch != min(inner, key=lambda k: area[k]))
    return chain


def _patches(corners: np.ndarray) -> tuple[np.ndarray, dict[int, frozenset]]:
    """((f,) a number for every triangle's patch, patch → its border as directed edges; empty at open edges)."""
    patch = _parts(corners, only_two=True)
    edge, counts, _ = _edges(corners)
    starts, ends = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    borders: dict[int, set] = defaultdict(set)
    for half_edge in np.flatnonzero(counts[edge] > 2).tolist():
        borders[int(patch[half_edge // 3])].add((int(starts[half_edge]), int(ends[half_edge])))
    is_open = set(patch[np.flatnonzero(counts[edge] == 1) // 3].tolist())
    return patch, {number: frozenset(() if number in is_open else border) for number, border in borders.items()}


def _measures(chain: Chain, patch: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(six times the volume of every patch towards the vertices' middle, twice its area)."""
    points = chain.vertices - chain.vertices[chain.corners].mean(axis=(0, 1))
    a, b, c = (points[chain.corners[:, k]] for k in range(3))
    volume = (a * np.cross(b, c)).sum(axis=1)
    area = np.sqrt(np.square(np.cross(b - a, c - a)).sum(axis=1))
    n = len(patch)
    return np.bincount(patch, volume, n), np.bincount(patch, area, n)


# --- holes --------------------------------------------------------------------------------------


def holes_of(chain: Chain, widest: float) -> list[tuple[Hole, np.ndarray]]:
    """The holes of a chain, each with triangles (k, 3) over the hole; no triangles over holes not to be closed: wider
    than ``widest``, or of more than `LONGEST_CYCLE` edges.
    """
    edges, along = border_edges(chain.corners)
    return [
        _hole(chain.vertices, edges[cycle[::-1], 0], np.unique(chain.source[along[cycle]]), widest)
        for cycle in cycles_of(edges)
    ]


def _hole(vertices: np.ndarray, ring: np.ndarray, facets: np.ndarray, widest: float) -> tuple[Hole, np.ndarray]:
    """ring : ids around a hole, against the directions of its edges."""
    points = vertices[ring] - vertices[ring[0]]
    length = float(np.sqrt(np.square(np.ptp(points, axis=0)).sum()))
    # Any surface over the ring has at least the length of its area vector, half the sum of p × q, as its area.
    area = 0.5 * float(np.sqrt(np.square(np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)).sum()))
    triangles = np.zeros((0, 3), dtype=np.int64)
    if len(ring) <= LONGEST_CYCLE and 2.0 * area <= widest * length:
        triangles = closing_triangles(points)
        a, b, c = (points[triangles[:, k]] for k in range(3))
        area = 0.5 * float(np.sqrt(np.square(np.cross(b - a, c - a)).sum(axis=1)).sum())
        triangles = triangles[: len(triangles) if 2.0 * area <= widest * length else 0]
    width = 2.0 * area / length if length else 0.0
    return Hole(facets, len(ring), length, width), ring[triangles]


def with_holes_closed(chain: Chain, triangles: list[np.ndarray]) -> Chain:
    """The chain with the triangles of `holes_of`."""
    corners = np.concatenate([chain.corners, *triangles]).astype(np.int32)
    source = np.concatenate([chain.source, np.full(len(corners) - len(chain.source), NEW)])
    return chain._replace(corners=corners, source=source)


# --- facets without area --------------------------------------------------------------------------


def without_flat_facets(chain: Chain) -> Chain:
    """The chain without triangles whose corners lie on a line: the same surface, the same border.

    All triangles at the longest edge of such a triangle are split at its middle corner, and the triangle itself falls
    into two with equal corners. The longest goes first: edges only become shorter, and the work ends.
    """
    chain = chain.only(chain.survey().flags & COLLAPSED == 0)
    flat = np.flatnonzero(without_area(chain.vertices, chain.corners)) if len(chain.corners) else np.zeros(0, int)
    if not len(flat):
        return chain
    near = np.isin(chain.corners, np.unique(chain.corners[flat])).sum(axis=1) >= 2
    pool = {int(row): tuple(chain.corners[row].tolist()) for row in np.flatnonzero(near)}
    sources = {row: int(chain.source[row]) for row in pool}
    _split_at_flat(chain.vertices, pool, sources, flat.tolist(), len(chain.corners))
    rows = sorted(pool)
    corners = np.array([pool[row] for row in rows], dtype=np.int32).reshape(-1, 3)
    order = np.argsort(np.concatenate([np.flatnonzero(~near), rows]), kind="stable")
    return chain._replace(
        corners=np.concatenate([chain.corners[~near], corners])[order],
        source=np.concatenate([chain.source[~near], np.array([sources[row] for row in rows], dtype=np.int64)])[order],
    )


def _split_at_flat(
    vertices: np.ndarray, pool: dict[int, tuple], sources: dict[int, int], flat: list[int], n: int
) -> None:
    """Split until no triangle of the pool is flat.   flat : rows of the flat ones.   n : the next row."""
    at_edge: dict[tuple, set[int]] = defaultdict(set)

    def put(row: int, triangle: tuple, source: int) -> None:
        pool[row], sources[row] = triangle, source
        for k in range(3):
            at_edge[tuple(sorted((triangle[k], triangle[k - 1])))].add(row)

    def take(row: int) -> tuple:
        triangle = pool.pop(row)
        for k in range(3):
            at_edge[tuple(sorted((triangle[k], triangle[k - 1])))].discard(row)
        return triangle

    for row in list(pool):
        put(row, pool[row], sources[row])
    longest = [(-_length(vertices, pool[row]), row) for row in flat]
    heapify(longest)
    while longest:
        row = heappop(longest)[1]
        if row not in pool:
            continue
        # corners on a line are in order as their coordinates are
        low, middle, high = sorted(pool[row], key=lambda v: tuple(vertices[v].tolist()))
        for neighbour in sorted(at_edge[tuple(sorted((low, high)))]):
            source = sources[neighbour]
            triangle = take(neighbour)
            for end in (low, high):
                made = tuple(middle if v == end else v for v in triangle)
                if len(set(made)) == 3:
                    put(n, made, source)
                    if without_area(vertices[list(made)], _TRIANGLE)[0]:
                        heappush(longest, (-_length(vertices, made), n))
                    n += 1


def _length(vertices: np.ndarray, triangle: tuple) -> float:
    return float(np.square(np.ptp(vertices[list(triangle)], axis=0)).sum())
