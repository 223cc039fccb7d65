"""The least translation that parts two overlapping unions of convex parts, between two proven bounds.

B moved by x meets A where x lies in A ⊖ B of a pair of parts, a convex set K, without end where a part is a half-space.
The depth is the distance from 0 to the nearest point outside of all K. Directions are cut into cones of three rays from
0. A cone is covered up to a triangle with a corner on each ray where a K holds 0 and the three corners; and from a
covered triangle to a farther triangle where a K holds the corners of both: K is convex, and each ray of the cone runs
from triangle to triangle within their hull. So every x in the cone nearer to 0 than the last triangle leaves the bodies
together, and the nearest of all last triangles is a lower bound of the depth. Cones with near triangles are cut in
four, until all triangles are as far as the shortest translation known, but for a part. Shorter translations are looked
for from the rays on (`shorter_ways.py`).

Where K begins and ends along a ray is worked out in doubles, as a proposal. The narrowphase is asked about all corners
at the moved poses: booleans, certain, with the rounding of the moved pose in them. Rays of the cones asked about stand
farther apart than rays of the cones, by more than rounding turns a ray.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of
from collide.lowering.packed_convex import HALFSPACE
from collide.lowering.parts import parts_of
from collide.lowering.shape_table import PoseTable, ShapeTable, pose_table
from collide.narrowphase.composite.tried_ways import TRYING, WAY, shorten_ways, spans_along
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.known_depth import Depth
from collide.results import UNDECIDED
from collide.shapes.shape import Shape

#: The bracket's width that ends the search, as a part of the length.
TOLERANCE = 2.0**-10
#: Rays along which pairs of parts are looked at, at most, over all pairs; and never fewer rays than the second number.
_MAX_SPANS, _FEWEST_RAYS, _MAX_RAYS = 600_000, 400, 6_000
#: Triangles of a cone, and ways followed after each cut.
_LAYERS, _FOLLOWED = 6, 4
#: How often cones are covered anew after the narrowphase refused a corner, and the span of a ray no longer proposed.
_TRIES, _NO_SPAN = 12, (math.inf, -math.inf)
#: How far within a K points are taken, as a part of the length; triangles are no nearer to 0 than the second part, and
#: reach no farther than the third.
_WITHIN, _NEAREST, _FARTHEST = 2.0**-20, 2.0**-10, 4.0
#: How far the cones asked about reach beyond the cones, as an angle; more where a moved pose's rounding is more.
_WIDER, _WIDEST = 2.0**-30, 2.0**-20
#: Cones with an edge no wider than this angle are not cut.
_NARROWEST = 2.0**-24


def least_depth(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, known: Depth) -> Depth:
    """The depth of two overlapping bodies of convex parts at poses (4, 4), no worse than a known depth: the known depth
    itself where both bodies have half-spaces, since two half-spaces overlap without end."""
    if known.least >= known.proven * (1.0 - TOLERANCE):
        return known
    pairs = _Pairs(A, B, X_WA, X_WB, known)
    return known if pairs.unbounded else pairs.searched(known)


def key_of(shape: Shape) -> bytes:
    """Orders the bodies of a pair, so that swapped questions are worked out on the same numbers."""
    return b"".join(part.content + (X + 0.0).tobytes() for part, X in parts_of(shape))


class _Pairs:
    """The pairs of parts of two posed bodies that may bar a way no longer than the shortest known."""

    def __init__(self, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, known: Depth):
        sides = parts_of(A), parts_of(B)
        packed = [part for side in sides for part, _ in side]
        self.n_a, self.n_b, self.X_WB = len(sides[0]), len(sides[1]), X_WB
        self.unbounded = all(any(part.kind == HALFSPACE for part, _ in side) for side in sides)
        self.table = ShapeTable(packed)
        self.table.build_trees(np.arange(len(packed)))
        self.X_BP = np.array([X for side in sides for _, X in side])
        self.reach = np.array([part.reach for part in packed])
        X = np.concatenate([np.repeat(X_WA[None], self.n_a, axis=0), np.repeat(X_WB[None], self.n_b, axis=0)])
        self.poses = pose_table(X, self.X_BP, self.reach)
        self.size = float(np.abs(X[:, :3, 3]).max() + self.reach.max() + np.abs(self.X_BP[:, :3, 3]).max())
        if self.unbounded:
            return
        i, j = np.divmod(np.arange(self.n_a * self.n_b), self.n_b)
        pairs, shape_of = np.stack([i, self.n_a + j], axis=1), np.arange(len(packed))
        rows = run_pairs(
            self.table, self.poses, shape_of, pairs, boolean=False, limit=known.proven, depths=False
        )
        near = rows["lower"] <= known.proven  # no other K comes nearer to 0 than the shortest way known
        self.pairs, self.holds_0 = np.ascontiguousarray(pairs[near]), (rows["hit"] & (rows["how"] != UNDECIDED))[near]
        self._shape_of, self._work = shape_of, np.zeros(TRYING)

    def _addresses(self) -> tuple[int, ...]:
        return *self.table.addresses, address_of(self.poses.rows), address_of(self._shape_of)

    def spans(self, directions: np.ndarray) -> np.ndarray:
        """(n, pairs, 2) from where to where each pair bars the ways along unit vectors (n, 3) [m]."""
        out = np.empty((len(directions), len(self.pairs), 2))
        spans_along(
            *self._addresses(), self.n_a + self.n_b, address_of(self.pairs), len(self.pairs), address_of(directions),
            len(directions), address_of(self._work), address_of(out),
        )
        return out

    def ways(self, directions: np.ndarray) -> np.ndarray:
        """(n, WAY) ways out found from unit vectors (n, 3) on."""
        out = np.empty((len(directions), WAY))
        shorten_ways(
            *self._addresses(), self.n_a, self.n_b, address_of(directions), len(directions), address_of(self._work),
            address_of(out),
        )
        return out

    def hold(self, which: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(n,) bool: whether K of pairs (n,) by number holds translations (n, 3) of B, rounded as poses are."""
        i, part = self.pairs[which].T
        X = np.repeat(self.X_WB[None], len(x), axis=0)
        X[:, :3, 3] += x
        moved = pose_table(X, self.X_BP[part], self.reach[part])
        poses = PoseTable(self.poses.rows[: self.n_a], self.poses.terms).followed_by(moved)
        shape_of = np.concatenate([self._shape_of[: self.n_a], part])
        pairs = np.stack([i, self.n_a + np.arange(len(x))], axis=1)
        rows = run_pairs(self.table, poses, shape_of, pairs, boolean=True, limit=0.0)
        return rows["hit"] & (rows["how"] != UNDECIDED)

    def searched(self, known: Depth) -> Depth:
        best, rays = known, _Rays(self)
        cells, least = rays.first_cells(), math.inf
        for tries_left in reversed(range(_TRIES)):
            best, leaves = self._cut(best, rays, cells)
            wanted, refused = best.proven * (1.0 - 2.0 * TOLERANCE), [cells[:0]]
            for leaf in leaves:
                distance = self._proven(leaf, best, rays)
                again = (distance < wanted) & (leaf.distance >= wanted) & (tries_left > 0)
                least = min(least, distance[~again].min(initial=math.inf))
                refused.append(leaf.cells[again])
            cells = np.concatenate(refused)
            if not len(cells):
                break
        return best.at_least(least)

    def _cut(self, best: Depth, rays: _Rays, cells: np.ndarray) -> tuple[Depth, list[_Covered]]:
        """Cones cut until each is covered as far as the shortest way known, or rays run out."""
        leaves: list[_Covered] = []
        n_rays = int(np.clip(_MAX_SPANS / max(len(self.pairs), 1), _FEWEST_RAYS, _MAX_RAYS))
        while len(cells):
            best = self._followed(best, rays)
            covered = _covered(rays, cells, self.holds_0, best.proven)
            is_near = covered.distance < best.proven * (1.0 - TOLERANCE)
            near = np.flatnonzero(is_near & (_narrowest_edges(covered.U) > _NARROWEST))
            near = near[np.argsort(covered.distance[near], kind="stable")][: max((n_rays - len(rays.U)) // 2, 0)]
            cut = np.zeros(len(cells), dtype=bool)
            cut[near] = True
            leaves.append(covered.of(~cut))
            cells = rays.cut(cells[cut])
        return best, leaves

    def _followed(self, best: Depth, rays: _Rays) -> Depth:
        """The shortest way known after the new rays with the first gaps have been followed."""
        new = np.arange(rays.n_followed, len(rays.U))
        rays.n_followed = len(rays.U)
        gaps = _first_gaps(rays.spans[new])
        first = new[np.argsort(gaps, kind="stable")[:_FOLLOWED]]
        for way in self.ways(np.ascontiguousarray(rays.U[first])):
            proven = float(way[4]) * (1.0 + 2.0**-50)
            if proven < best.proven:
                best = Depth(float(way[3]), proven, way[:3].copy(), best.least)
        return best

    def _proven(self, covered: _Covered, best: Depth, rays: _Rays) -> np.ndarray:
        """(c,) how far the narrowphase says cones are covered [m].

        Rays that all but touch a K lose the span proposed in doubles where the narrowphase refuses its end.
        """
        angle = max(_WIDER, 2.0**-44 * (self.size + best.proven) / best.proven)
        if angle > _WIDEST:
            return np.zeros(len(covered.cells))
        U = covered.U
        outwards = U - U.mean(axis=1, keepdims=True)
        U = U + angle * outwards / np.sqrt(np.square(outwards).sum(axis=2, keepdims=True))
        U /= np.sqrt(np.square(U).sum(axis=2, keepdims=True))
        good, distance = np.ones(len(U), dtype=bool), np.full(len(U), best.least)
        before = None
        for pair, r in zip(covered.pairs, covered.radii):
            good &= pair >= 0
            some = np.flatnonzero(good)
            x = (U * r[:, :, None])[some]
            asked = [x] if before is None else [x, (U * before[:, :, None])[some]]
            for points in asked:
                held = self.hold(np.repeat(pair[some], 3), points.reshape(-1, 3)).reshape(-1, 3)
                good[some] &= held.all(axis=1)
                cone, corner = np.nonzero(~held)
                rays.spans[covered.cells[some[cone], corner], pair[some[cone]]] = _NO_SPAN
            some = some[good[some]]
            triangles = _distance_of_triangles((U * r[:, :, None])[some])
            distance[some] = np.maximum(distance[some], triangles * (1.0 - 2.0**-40))
            before = r
        return distance


class _Covered(NamedTuple):
    """Cones, and how far they are covered.

    cells : (c, 3) numbers of their edges.   U : (c, 3, 3) these.   distance : (c,) of the last triangle [m].
    pairs, radii : of each layer (c,) the pair whose K holds the triangle, −1 beyond the last, and (c, 3) the corners'
    distances [m].
    """

    cells: np.ndarray
    U: np.ndarray
    distance: np.ndarray
    pairs: list[np.ndarray]
    radii: list[np.ndarray]

    def of(self, some: np.ndarray) -> _Covered:
        layers = [pair[some] for pair in self.pairs], [r[some] for r in self.radii]
        return _Covered(self.cells[some], self.U[some], self.distance[some], *layers)


class _Rays:
    """Unit vectors and where pairs bar the ways along them, made when first needed."""

    def __init__(self, pairs: _Pairs):
        self._pairs, self.n_followed = pairs, 0
        self._middles: dict[tuple[int, int], int] = {}
        self.U, self.spans = np.zeros((0, 3)), np.zeros((0, len(pairs.pairs), 2))

    def _add(self, directions: np.ndarray) -> None:
        directions = np.ascontiguousarray(directions / np.sqrt(np.square(directions).sum(axis=1))[:, None])
        self.U = np.concatenate([self.U, directions])
        self.spans = np.concatenate([self.spans, self._pairs.spans(directions)])

    def first_cells(self) -> np.ndarray:
        """An octahedron's sides, turned off the axes, cut twice."""
        p, q = np.array([0.36, 0.48, 0.8]), np.array([0.8, -0.6, 0.0])
        self._add(np.array([p, q, np.cross(p, q), -p, -q, -np.cross(p, q)]))
        sides = [(i, j, k) for i in (0, 3) for j in (1, 4) for k in (2, 5)]
        return self.cut(self.cut(np.array(sides)))

    def cut(self, cells: np.ndarray) -> np.ndarray:
        """(4c, 3) cones of cones (c, 3), cut at the middles of their edges."""
        edges = np.sort(np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]]), axis=1)
        new = [edge for edge in dict.fromkeys(map(tuple, edges.tolist())) if edge not in self._middles]
        self._middles.update(zip(new, range(len(self.U), len(self.U) + len(new))))
        if new:
            i, j = np.array(new).T
            self._add(self.U[i] + self.U[j])
        m = np.array([self._middles[edge] for edge in map(tuple, edges.tolist())], dtype=np.int64).reshape(3, -1).T
        a, b, c = cells.T
        corners = [(a, m[:, 0], m[:, 2]), (m[:, 0], b, m[:, 1]), (m[:, 2], m[:, 1], c), m.T]
        return np.concatenate([np.stack(of, axis=1) for of in corners]) if len(cells) else cells


def _first_gaps(spans: np.ndarray) -> np.ndarray:
    """(n,) how far along rays (n, pairs, 2) from 0 on some pair bars the way, one after the other [m]."""
    reached = np.zeros(len(spans))
    for _ in range(spans.shape[1] + 1):
        bars = spans[:, :, 0] <= reached[:, None]
        farther = np.where(bars, spans[:, :, 1], 0.0).max(axis=1, initial=0.0)
        if not (farther > reached).any():
            break
        reached = np.maximum(reached, farther)
    return reached


def _covered(rays: _Rays, cells: np.ndarray, holds_0: np.ndarray, length: float) -> _Covered:
    """How far cones (c, 3) are covered, layer by layer: the K taken next reaches the farthest."""
    begin = rays.spans[cells][..., 0] + _WITHIN * length
    end = np.minimum(rays.spans[cells][..., 1] - _WITHIN * length, _FARTHEST * length)
    least_of = np.minimum(end, 1.5 * length).sum(axis=1)
    r, distance = np.zeros((len(cells), 3)), np.zeros(len(cells))
    pairs, radii = [], []
    for layer in range(_LAYERS):
        reach = r[:, :, None]
        bars = ((begin <= reach) & (end >= np.maximum(reach, _NEAREST * length))).all(axis=1)
        bars &= holds_0 if layer == 0 else (end > reach + _NEAREST * length).any(axis=1)
        gain = np.where(bars, least_of, -math.inf)
        pair = gain.argmax(axis=1)
        is_covered = bars[np.arange(len(cells)), pair]
        if not is_covered.any():
            break
        r = np.where(is_covered[:, None], end[np.arange(len(cells)), :, pair], r)
        pairs.append(np.where(is_covered, pair, -1))
        radii.append(r)
    U = rays.U[cells]
    distance = _distance_of_triangles(U * r[:, :, None])
    return _Covered(cells, U, distance, pairs, radii)


def _narrowest_edges(corners: np.ndarray) -> np.ndarray:
    """(c,) the shortest sides of triangles (c, 3, 3)."""
    return np.sqrt(np.square(np.roll(corners, -1, axis=1) - corners).sum(axis=2)).min(axis=1)


def _distance_of_triangles(corners: np.ndarray) -> np.ndarray:
    """(c,) distances of triangles (c, 3, 3) from 0."""
    ends = np.roll(corners, -1, axis=1)
    along = ends - corners
    squares = np.square(along).sum(axis=2)
    t = np.clip(-(corners * along).sum(axis=2) / np.where(squares > 0.0, squares, 1.0), 0.0, 1.0)
    of_edges = np.sqrt(np.square(corners + t[..., None] * along).sum(axis=2)).min(axis=1)
    n = np.cross(along[:, 0], along[:, 1])
    within = (np.cross(corners, ends) * n[:, None]).sum(axis=2)
    length = np.sqrt(np.square(n).sum(axis=1))
    of_plane = np.abs((corners[:, 0] * n).sum(axis=1)) / np.where(length > 0.0, length, 1.0)
    return np.where((within > 0.0).all(axis=1), np.minimum(of_edges, of_plane), of_edges)
