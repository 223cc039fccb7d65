"""Makes a support tree from a hull: nested subsets of its vertices, and candidate lists between them.

Any subset of a hull's vertices is in convex position; `nested_subsets.py` chooses. What stands between two subsets
is worked out by `candidate_lists.py`, from the edges of the hull of the finer one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from collide.kernels import address_of
from collide.support.candidate_lists import STACK, candidate_lists, order_rings
from collide.support.nested_subsets import nested_order
from collide.support.support_tree import FEWEST, SupportTree, list_coordinates_of

#: Vertices to one of the next coarser subset: at the finest level, where lists decide the memory, and above.
#: Measured on spheres, where lists of 24 have 37 entries: 32 makes gaps 5 to 10 % slower and takes 3 bytes less, 16
#: is as fast and takes 5 more.
FINE_RATIO, RATIO = 24, 16
#: Scanned as a whole: a hull of at most so many vertices, and a subset.
SMALL_HULL, LARGEST_SCAN = 160, 100
#: A vertex with more neighbours stays out of coarse subsets: all its neighbours would be its candidates.
HIGHEST_DEGREE = 48
#: Owners of longer lists are moved out of the coarse subsets, and the tree is built again, a few times.
LONGEST_LIST = 384
_ATTEMPTS = 6


class Rings:
    """Neighbours of every vertex of a closed surface, in cyclic order, and the facets' unit normals.

    corner (n,) : whether a vertex is extreme in a range of directions, as far as rounded normals tell.
    """

    def __init__(self, points: np.ndarray, facets: np.ndarray):
        self.flat = False
        self._order(points, facets)
        if self.status == 1:
            self._as_polygon(points, facets)
        elif self.status:
            raise ValueError("support tree: the facets are no closed surface")

    def _order(self, points: np.ndarray, facets: np.ndarray) -> None:
        n, f = len(points), len(facets)
        self.starts = np.empty(n + 1, dtype=np.int32)
        self.ring, self.ring_facets = np.empty(3 * f, dtype=np.int32), np.empty(3 * f, dtype=np.int32)
        self.normals = np.empty((f, 3))
        following, place = np.empty(6 * f, dtype=np.int32), np.empty(n, dtype=np.int32)
        self.status = order_rings(
            address_of(points), n, address_of(facets), f, address_of(self.starts), address_of(self.ring),
            address_of(self.ring_facets), address_of(following), address_of(place), address_of(self.normals),
        )
        self.corner = place >= 3

    def _as_polygon(self, points: np.ndarray, facets: np.ndarray) -> None:
        """A flat hull, both sides triangulated in one way.

        One side, closed by triangles from its border to a point of its own, is a surface that can be put in
        order; without that point, rings are those of one side. Where all vertices are corners of the border,
        the border alone is kept: diagonals may have thousands of ends.
        """
        self.flat = True
        half = len(facets) // 2
        if np.array_equal(facets[half:], facets[:half, ::-1]):  # as `convex_hull` gives them; normals of slivers round
            upward = np.arange(len(facets)) < half
        else:
            first = self.normals[np.abs(self.normals).sum(axis=1).argmax()]
            upward = (self.normals * first).sum(axis=1) > 0
        normal = (self.normals * np.where(upward, 1.0, -1.0)[:, None]).sum(axis=0)
        upper, n = facets[upward], len(points)
        edges = np.concatenate([upper[:, [0, 1]], upper[:, [1, 2]], upper[:, [2, 0]]]).astype(np.int64)
        border = edges[~np.isin(edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0])]
        following, previous = np.full(n, -1), np.full(n, -1)
        following[border[:, 0]], previous[border[:, 1]] = border[:, 1], border[:, 0]
        on_it = following >= 0
        if 2 * len(upper) != len(facets) or not np.array_equal(on_it, previous >= 0):
            raise ValueError("support tree: edges with more than two facets, on a hull that is not flat")
        used = np.zeros(n, dtype=bool)
        used[facets] = True
        self.corner = on_it & _bent(points, following, previous)
        if np.array_equal(self.corner, used):
            self.starts = np.concatenate([[0], 2 * np.cumsum(on_it)]).astype(np.int32)
            self.ring = np.stack([following[on_it], previous[on_it]], axis=1).astype(np.int32).ravel()
            self.ring_facets = np.tile(np.array([0, 1], dtype=np.int32), int(on_it.sum()))
        else:
            corner = self.corner
            closing = np.stack([border[:, 1], border[:, 0], np.full(len(border), n)], axis=1)
            self._order(np.concatenate([points, points[:1]]), np.concatenate([upper, closing]).astype(np.int32))
            if self.status:
                raise ValueError("support tree: one side of a flat hull is no disc")
            self.corner = corner
            self._leave_out(n, len(upper))
        self.normals = np.stack([normal, -normal]) / np.sqrt((normal * normal).sum())

    def vertex_normals(self) -> np.ndarray:
        """(n, 3) a direction in which each vertex is extreme: the sum of its facets' unit normals, 0 without facets."""
        sums = np.concatenate([np.zeros((1, 3)), np.cumsum(self.normals[self.ring_facets], axis=0)])
        return sums[self.starts[1:]] - sums[self.starts[:-1]]

    def _leave_out(self, point: int, n_upper: int) -> None:
        """Forget the last point, which closed a disc, and name the two sides as facets 0 and 1."""
        keep = self.ring != point
        keep[self.starts[point] :] = False
        # A neighbour just before the point loses the facet between them: what follows is the lower side.
        self.ring_facets = np.where(self.ring_facets < n_upper, 0, 1).astype(np.int32)[keep]
        sums = np.concatenate([[0], np.cumsum(keep)])
        self.starts = sums[self.starts[: point + 1]].astype(np.int32)
        self.ring = self.ring[keep]


def _bent(points: np.ndarray, following: np.ndarray, previous: np.ndarray) -> np.ndarray:
    """Whether a border certainly turns at a vertex."""
    after, before = points[following] - points, points[previous] - points
    bound = 4e-15 * np.abs(after).sum(axis=1) * np.abs(before).sum(axis=1)
    return np.abs(np.cross(after, before)).max(axis=1) > bound


def build_support_tree(
    points: np.ndarray,
    vertices: np.ndarray,
    facets: np.ndarray,
    hull_of: Callable[[np.ndarray], np.ndarray],
    ratio: int = FINE_RATIO,
) -> SupportTree:
    """A support tree over a convex hull.

    points : (n, 3) finite. vertices : (h,) rows of the hull's vertices. facets : (f, 3) rows; its surface,
    closed, triangulated, counter-clockwise from outside, without facets of no area. A flat hull has both
    sides, triangulated alike. Vertices may lie on an edge or a facet of the hull; they take no part in queries.
    hull_of : points (m, 3) in convex position → such facets, rows of what it was given. It is asked for the
    hulls of subsets, of h / ratio vertices and fewer; a vertex it leaves out costs speed only.
    ratio : vertices to one of the first coarser subset; memory goes down with it, time up.

    Raises ValueError where the surface is not closed. Expected O(h log h) without the hulls.
    """
    points = np.ascontiguousarray(points, dtype=np.float64)
    vertices = np.ascontiguousarray(vertices, dtype=np.int32)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise ValueError("points must be (n, 3) and finite")
    facets = _checked(points, vertices, facets)
    # Cones keep their order under scaling along axes, and powers of two round nothing: normals of pancakes and
    # needles are then as good as those of balls.
    extent = np.ptp(points[vertices], axis=0)
    scaled = np.ldexp(points, -np.frexp(np.where(extent > 0, extent, 1.0))[1])
    rings = Rings(scaled, facets)
    degree = np.diff(rings.starts)[vertices]
    if degree.min() == 0:
        raise ValueError("support tree: a vertex without facets")
    corner = rings.corner[vertices]
    if corner.sum() >= 3:
        vertices, degree = vertices[corner], degree[corner]
    late = degree > HIGHEST_DEGREE
    normals, sizes = rings.vertex_normals()[vertices], subset_sizes(len(vertices), ratio)
    for attempt in range(_ATTEMPTS):
        tree = _built(points, scaled, nested_order(vertices, normals, late, sizes), sizes, rings, hull_of)
        long = _owners_of_long_lists(tree)
        if not len(long) or attempt == _ATTEMPTS - 1:
            return tree
        late |= np.isin(vertices, long)
    raise AssertionError("unreachable")


def subset_sizes(h: int, ratio: int = FINE_RATIO) -> list[int]:
    """Sizes of the nested subsets, finest first; the last is scanned as a whole."""
    sizes = [h]
    while sizes[-1] > (SMALL_HULL if len(sizes) == 1 else LARGEST_SCAN):
        sizes.append(-(-sizes[-1] // (ratio if len(sizes) == 1 else RATIO)))
    return sizes


class _TreeInProgress:
    """The tree while levels are added to it, coarsest first."""

    def __init__(self, points: np.ndarray):
        self.points = points
        self.nodes = np.zeros(1, dtype=np.int32)
        self.entries = np.zeros(0, dtype=np.int32)
        self.coordinates = np.zeros(0)
        self.rows: list[np.ndarray] = []
        self.depth = 0

    def add_level(self, list_starts: np.ndarray, rows: np.ndarray, numbers: np.ndarray) -> None:
        """Lists of rows of the points, with the numbers that entries carry, filled up where too short."""
        lengths = np.diff(list_starts)
        if (lengths < FEWEST).any():
            filled = np.maximum(lengths, FEWEST)
            within = np.arange(filled.sum()) - np.repeat(np.cumsum(filled) - filled, filled)
            places = np.repeat(list_starts[:-1], filled) + np.where(within < np.repeat(lengths, filled), within, 0)
            rows, numbers, lengths = rows[places], numbers[places], filled
        nodes = np.concatenate([[0], np.cumsum(lengths)])
        coordinates = list_coordinates_of(self.points, nodes, rows)
        self.nodes = np.concatenate([self.nodes, (self.nodes[-1] + nodes[1:]).astype(np.int32)])
        self.entries = np.concatenate([self.entries, numbers.astype(np.int32)])
        self.coordinates = np.concatenate([self.coordinates, coordinates])
        self.rows.append(rows)
        self.depth += 1


def _built(points, scaled, ordered, sizes, rings: Rings, hull_of) -> SupportTree:
    """The tree whose subsets are the first so many of ``ordered``; worked out on ``scaled`` points."""
    place = np.full(len(points), -1, dtype=np.int64)
    place[ordered] = np.arange(len(ordered))
    partial = _TreeInProgress(scaled)
    top = ordered[: sizes[-1]]
    partial.add_level(np.array([0, len(top)]), top, 1 + place[top] if len(sizes) > 1 else top)
    owners = [np.array([-1])]
    first_node = 1
    for level in range(len(sizes) - 2, -1, -1):
        coarse, fine = ordered[: sizes[level + 1]], ordered[: sizes[level]]
        if level > 0:
            fine_rings = Rings(scaled, _checked(scaled, fine, fine[hull_of(np.ascontiguousarray(scaled[fine]))]))
        else:
            fine_rings = rings
        list_starts, rows = _lists(partial, fine, fine_rings, coarse, first_node)
        partial.add_level(list_starts, rows, first_node + len(coarse) + place[rows] if level > 0 else rows)
        first_node += len(coarse)
        owners.append(coarse)
    rows = np.concatenate(partial.rows)
    return SupportTree(
        points, rings.flat, partial.depth, partial.nodes, np.concatenate(owners), partial.entries,
        list_coordinates_of(points, partial.nodes, rows), rings.starts, rings.ring,
    )


def _lists(partial: _TreeInProgress, fine, rings: Rings, coarse, first_node) -> tuple[np.ndarray, np.ndarray]:
    """(list_starts, rows): candidates of every coarse vertex among the fine ones."""
    n = len(partial.points)
    capacity = 8 * len(fine) + 4 * len(coarse)
    list_starts = np.empty(len(coarse) + 1, dtype=np.int32)
    while True:
        pairs, work = np.empty(2 * capacity, dtype=np.int32), np.empty(n + capacity + 2 * STACK)
        n_pairs = candidate_lists(
            address_of(partial.points), n, address_of(fine), len(fine), address_of(rings.starts),
            address_of(rings.ring), address_of(rings.ring_facets), address_of(rings.normals), len(rings.normals),
            address_of(partial.nodes), address_of(partial.entries), address_of(partial.coordinates),
            len(partial.nodes) - 1, partial.depth, address_of(coarse), len(coarse), first_node,
            address_of(pairs), capacity, address_of(list_starts), address_of(work),
        )
        if n_pairs <= capacity:
            return list_starts.astype(np.int64), pairs[: list_starts[-1]]
        capacity = n_pairs


def _owners_of_long_lists(tree: SupportTree) -> np.ndarray:
    """Rows of the coarse vertices whose lists are longer than LONGEST_LIST."""
    return np.unique(tree.owners[1:][np.diff(tree.nodes[1:]) > LONGEST_LIST])


def _checked(points, vertices, facets) -> np.ndarray:
    facets = np.ascontiguousarray(facets, dtype=np.int32)
    if facets.ndim != 2 or facets.shape[1] != 3 or len(facets) < 2 or len(vertices) < 3:
        raise ValueError("support tree: a hull has at least 3 vertices and 2 facets (f, 3)")
    known = np.zeros(len(points), dtype=bool)
    if vertices.min() < 0 or vertices.max() >= len(points) or facets.min() < 0 or facets.max() >= len(points):
        raise ValueError("support tree: vertices and facets are rows of the points")
    known[vertices] = True
    if known.sum() != len(vertices) or not known[facets].all():
        raise ValueError("support tree: vertices must differ from each other and hold all corners of facets")
    return facets
