"""Motions of bodies with meshes among their pieces: spans of time, facets that may meet in them, and a job a facet.

A piece is a mesh or a convex shape at a pose in its body. In a span of length h the bodies come nearer by at most μ h /
2 on either side of its middle, μ a bound of relative speed, seen from the world, from A or from B (motion bounds,
Mirtich 1996). Facets farther apart at the middle are free in all of the span (facets_within: a traversal of both
trees). The others, if they are few, are jobs for `impact_jobs.py`, in this span alone; else the span is cut in two.
Spans come in order of time, so the first span with a contact holds the first contact: bodies apart at the start first
meet in their surfaces, and a surface is its facets. Where facets prove no meeting, as of bodies coming together flush,
points inside do (`common_points.py`).

A half-space meets a mesh where it meets the mesh's hull.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from collide.base.poses_at import poses_at
from collide.kernels import address_of
from collide.lowering.compound_table import PART, TURNED
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import as_given, body_of, is_halfspace
from collide.lowering.facet_table import Facets, FacetTable
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import WITH_FACETS
from collide.lowering.packed_convex import PackedConvex, pack_points
from collide.lowering.parts import bounding_parts_of, convex_set_of
from collide.lowering.shape_table import RANK, SLOP, ShapeTable
from collide.mesh.bvh import MeshTree
from collide.motion.common_points import CommonPoints, Placed
from collide.motion.convex_impact import CONTACT, OPEN
from collide.motion.convex_motions import (
    JOBS_AT_ONCE,
    TIMES_SMALLER,
    Tables,
    bounds_of,
    earliest_of,
    earliest_times,
    first_pair,
    header_of,
    parts_in_turn,
)
from collide.motion.impact_jobs import find_impacts
from collide.motion.impact_rows import flipped_impacts, free_rows
from collide.motion.motions import Motions
from collide.motion.parts_ahead import MAX_ASKED, Spans
from collide.motion.path_facets import earliest_by_facets, facets_on_path
from collide.motion.span_bounds import REACH
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.convex_kernel_calls import run_poses
from collide.narrowphase.facets.facet_geometry import facet_normals
from collide.narrowphase.facets.facet_queries import facets_within
from collide.narrowphase.facets.mesh_batches import pair_rows
from collide.narrowphase.facets.near_facets import near_facets_up_to
from collide.results import PAIR_DTYPE
from collide.shapes.compound import Compound
from collide.shapes.mesh import Mesh, corners_of_facets
from collide.shapes.primitives import Sphere
from collide.shapes.shape import IDENTITY, Shape, held_by, kept_with_shape
from collide.transforms import SMALLEST

#: So many pairs of facets at most are jobs of one span, and in proportion more where it is shorter than _SHORT: where
#: flat and finely cut surfaces come together at once, no span is short enough for few.
_MAX_JOBS, _SHORT, _MAX_JOBS_OF_ALL = 96, 2.0**-6, 1 << 20
#: A span is cut to this part of it at least, and to so many times as long as is known to be free before it.
_LARGEST_CUT, _FREE_TIMES = 16, 4.0
#: So much of the time that is known to be free is left out: jobs begin where the bodies are still apart.
_SHARE_OF_FREE = 31 / 32
#: A span that begins before bodies are about to meet ends behind that by so much of it, and is so much of the time in
#: which the smaller body may move by its own size at least.
_BEHIND_MEETING, _LEAST_CUT = 1 / 4, 2.0**-12
#: So many times the jobs are done in a part of a span rather than cut it again: a distance costs as much as hundreds.
_MORE = 4
#: Spans shorter than this are not cut any more.
_SHORTEST = 2.0**-46
#: Of fewer pairs of a small union's pieces and a mesh together each is looked at by itself.
_TOGETHER = 8
#: So many facets on a way are looked at, and so many pairs of them and of pieces.
_MAX_ON_THE_WAY, _JOBS_ON_THE_WAY = 1024, 1 << 16
#: Facets of a mesh that are few beside another mesh of so many at least: for a walk each, and for one together.
_MAX_EACH, _MAX_TOGETHER, _FINELY_CUT = 8, 256, 1024
#: So many pairs of them are looked at rather than walk both trees, which costs as much as thousands.
_JOBS_BEFORE_WALKS = 1 << 13
#: Normals are asked for where sets meet in these parts of the time in which the smaller moves by its own size.
_BEFORE_MEETING = 2.0 ** -np.array([0.0, 4.0, 7.0, 10.0])
#: Matrices at both ends may miss each other's rotation by 4e-4 an entry, and so lengthen what they place.
_BALLS_OUTWARD = 1e-2
_ULP = 2.0**-53
#: Pairs of pieces of unions whose earliest times are asked for before a span of time is cut, to leave most of them out.
_PIECES_TOGETHER = 4096
#: Jobs of two meshes that are done before it is looked whether one came to nothing; twice as many each time.
_JOBS_IN_TURN = 4


class Piece(NamedTuple):
    """A mesh or a convex shape in a body.

    X_CS : (4, 4) its pose in the body.   number : of the part in a compound.
    reach : greatest distance of its points from its own origin, a swept radius included [m].
    slop : how far rounding of X_CS may have moved the piece [m].
    tree, radius : facets of the piece, or of a polytope around the piece, and how far its surface may be from the
    facets: a swept ball, or the polytope's distance. None for half-spaces.
    is_curved : whether the facets belong to a polytope around the piece.   packed : as a convex set; None of meshes.
    """

    of: Callable[[], Any]
    X_CS: np.ndarray
    number: int
    reach: float
    slop: float
    tree: MeshTree | None
    radius: float
    is_curved: bool
    packed: PackedConvex | None

    @property
    def shape(self) -> Any:
        return self.of()

    @property
    def is_mesh(self) -> bool:
        return self.packed is None

    @property
    def has_many_facets(self) -> bool:
        """Whether the piece is a hull with more facets than a span has jobs: a single facet of a mesh may be near too
        many."""
        return not (self.is_mesh or self.is_curved or self.tree is None) and len(self.tree.ids) > _MAX_JOBS

    def corners(self, facets: np.ndarray) -> np.ndarray:
        """(k, 3, 3) of a mesh's facets by their numbers."""
        mesh = self.shape
        return mesh.vertices[mesh.faces[facets]]


@kept_with_shape("_pieces")
def pieces_of(shape: Shape) -> tuple[Piece, ...]:
    """The meshes and convex shapes that a shape is made of."""
    flat = list(_flattened(shape, IDENTITY, 0.0))
    return tuple(_piece(item, held_by(shape, item), X, slop, k) for k, (item, X, slop) in enumerate(flat))


def _flattened(shape: Shape, X: np.ndarray, slop: float) -> Iterator[tuple[Shape, np.ndarray, float]]:
    if not isinstance(shape, Compound):
        yield shape, X, slop
        return
    for item, X_CS in shape.items:
        exact = np.array_equal(X, IDENTITY)
        lost = 0.0 if exact else 16 * _ULP * float(np.abs(X_CS[:3, 3]).sum() + np.abs(X[:3, 3]).sum() + _extent(item))
        yield from _flattened(item, X_CS if exact else X @ X_CS, slop + lost)


def _extent(shape: Shape) -> float:
    """Greatest distance of a shape's points from its origin; 0 of a half-space."""
    if isinstance(shape, Compound):
        return max(float(np.linalg.norm(X[:3, 3])) + 1.001 * _extent(item) for item, X in shape.items)
    if isinstance(shape, Mesh):
        return float(np.sqrt(np.square(shape.vertices).sum(axis=1).max()))
    packed = convex_set_of(shape)
    return packed.reach + packed.radius


def _piece(shape: Shape, of: Callable[[], Any], X_CS: np.ndarray, slop: float, number: int) -> Piece:
    reach = _extent(shape) * (1 + 1e-12)
    if isinstance(shape, Mesh):
        return Piece(of, X_CS, number, reach, slop, body_of(shape).tree, 0.0, False, None)
    packed = convex_set_of(shape)
    if is_halfspace(shape):
        return Piece(of, X_CS, number, reach, slop, None, 0.0, False, packed)
    if kind_of(shape) in WITH_FACETS:
        body = body_of(shape)
        return Piece(of, X_CS, number, reach, slop, body.tree, body.radius, False, packed)
    tree = enclosure_of(shape).outer.tree
    return Piece(of, X_CS, number, reach, slop, tree, _thickness(shape, tree), True, packed)


def _around(piece: Piece) -> PackedConvex:
    """A convex set around a piece."""
    return bounding_parts_of(piece.shape)[0][0] if piece.packed is None else piece.packed


def _hull_of(piece: Piece) -> PackedConvex:
    """The hull of a piece, widened by the rounding of its pose."""
    packed = _vertices_of(piece.shape) if piece.packed is None else piece.packed
    return packed._replace(slop=packed.slop + piece.slop)


@kept_with_shape("_vertex_set")
def _vertices_of(mesh: Mesh) -> PackedConvex:
    """The vertices of a mesh's facets, whose hull is the mesh's."""
    return pack_points(corners_of_facets(mesh))


def _thickness(shape: Shape, tree: MeshTree) -> float:
    """How far a polytope around a convex shape is from it at most, at its corners [m]; its surface is as far from the
    shape's."""
    corners = np.unique(tree.triangles.reshape(-1, 3), axis=0)
    rows = convex_rows(Sphere(SMALLEST), shape, poses_at(corners), np.eye(4)[None], depths=False)
    return float(rows["upper"].max(initial=0.0)) * (1 + 1e-12) + 1e-12 * _extent(shape)


def surface_impacts(A: Shape, B: Shape, motions: Motions, tolerance: float, rows: np.ndarray) -> None:
    """Fill rows of `IMPACT_DTYPE` for n motions of two bodies that are apart at the start.

    motions : poses (n, 4, 4).   rows : (n,) as `clear_impacts` leaves them.
    """
    order_a, order_b = _order(A), _order(B)
    exchanged = motions.exchanged(np.full(len(rows), order_a > order_b), np.full(len(rows), order_a == order_b))
    for flip in (False, True):  # swapped questions are worked out on the same numbers
        some = np.flatnonzero(exchanged == flip)
        if not len(some):
            continue
        part = rows[some]
        if flip:
            _search_all(B, A, motions.picked(some).swapped(), tolerance, part)
        else:
            _search_all(A, B, motions.picked(some), tolerance, part)
        rows[some] = flipped_impacts(part) if flip else part


def _search_all(A: Shape, B: Shape, motions: Motions, tolerance: float, rows: np.ndarray) -> None:
    """`surface_impacts` in the order worked on."""
    pieces_a, pieces_b = pieces_of(A), pieces_of(B)
    is_part = isinstance(A, Compound), isinstance(B, Compound)
    numbers = np.divmod(np.arange(len(pieces_a) * len(pieces_b)), len(pieces_b))
    is_small = len(numbers[0]) <= MAX_ASKED
    if is_small:
        pairs = [(pieces_a[i], pieces_b[j]) for i, j in zip(*(of.tolist() for of in numbers))]
        is_large = _search_small(pairs, motions, (0.0, 1.0), tolerance, rows, is_part)
        numbers = numbers[0][is_large], numbers[1][is_large]
        some = np.flatnonzero(_come_near(motions, [pair for pair, large in zip(pairs, is_large) if large]))
    for k in some.tolist() if is_small else range(len(rows)):
        motion, row = motions.picked(np.array([k])), rows[k : k + 1]

        def upper(row: np.ndarray = row) -> float:
            return float(row["upper"][0])

        def search(a: Piece, b: Piece, begin: float, motion: Motions = motion, row: np.ndarray = row) -> None:
            if _search_small([(a, b)], motion, (begin, 1.0), tolerance, row, is_part)[0]:
                _search(a, b, motion, tolerance, row, is_part, begin)

        ahead = [numbers] if is_small else parts_in_turn(A, B, motion, upper, _PIECES_TOGETHER, tolerance)
        for i, j in ahead:
            # No contact of two pieces is earlier than that of the convex sets around both, nor than that of one set and
            # the facets on its way: in the order of these, the first contact found leaves out all later ones.
            earliest, some, end = np.zeros(len(i)), np.arange(len(i)), min(upper(), 1.0)
            first = first_pair(A, B, motion, (i, j), end, tolerance) if len(i) >= _TOGETHER else None
            if first is not None:  # what comes first by its sets is searched first: all others end with its contact
                n, some = first[0], np.delete(some, first[0])
                search(pieces_a[i[n]], pieces_b[j[n]], first[1])
                earliest[n], end = math.inf, min(upper(), 1.0)
            earliest[some] = earliest_times(A, B, motion, (i[some], j[some]), end, tolerance)
            known_until = 0.0 if len(i) >= _TOGETHER else math.inf
            while len(earliest):
                n, end = int(earliest.argmin()), min(upper(), 1.0)
                if not earliest[n] <= end:
                    break
                if earliest[n] >= known_until:
                    known_until = _ask_on_the_way((A, B), (i, j), motion, earliest, end, tolerance)
                    continue
                search(pieces_a[i[n]], pieces_b[j[n]], float(earliest[n]))
                earliest[n] = math.inf


def _ask_on_the_way(
    shapes: tuple[Shape, Shape], pairs: tuple[np.ndarray, np.ndarray], motion: Motions, earliest: np.ndarray,
    end: float, tolerance: float,
) -> float:
    """Raise the ``earliest`` times (k,) of pairs of pieces, in place, of a large mesh and a piece of a small union, by
    the facets on the union's way; returns the time until which the raised times hold."""
    bounds, known_until = bounds_of(*shapes), math.inf
    for side in (0, 1):
        pieces, union = pieces_of(shapes[side]), compound_parts(shapes[1 - side])
        numbers, counts = np.unique(pairs[side][earliest <= end], return_counts=True)
        reach = math.inf if union.unbounded else union.radius
        for number in numbers[counts >= _TOGETHER].tolist():
            mesh = pieces[number]
            if not mesh.is_mesh or TIMES_SMALLER * reach > mesh.reach:
                continue
            some = np.flatnonzero((pairs[side] == number) & (earliest <= end))
            ball = pack_points(np.zeros((1, 3)), reach)
            body = Piece(lambda: None, IDENTITY, -1, reach, union.slop, None, 0.0, False, ball)
            spans = _Spans(mesh, body, motion) if side == 0 else _Spans(body, mesh, motion)
            first = bounds.first[1 - side if len(bounds.first) > 1 else 0]
            rows = first + pairs[1 - side][some]
            sets = bounds.table, rows, bounds.parts[rows]
            times, until = spans.times_on_the_way(sets, float(earliest[some].min()), end, tolerance)
            earliest[some] = np.maximum(earliest[some], times)
            known_until = min(known_until, until)
    return known_until


def _search_small(
    pairs: list[tuple[Piece, Piece]], motions: Motions, span: tuple[float, float], tolerance: float, rows: np.ndarray,
    is_part: tuple[bool, bool],
) -> np.ndarray:
    """Search pairs of pieces that are convex or of few facets, in a span of time, for all motions; returns the other
    pairs' mask (k,)."""
    is_large = np.zeros(len(pairs), dtype=bool)
    convex = [(a, b) for a, b in pairs if not _needs_facets(a, b)]
    for a, b in convex:
        _convex_pieces(a, b, motions, tolerance, rows)
    for k, (a, b) in enumerate(pairs):
        if not _needs_facets(a, b):
            continue
        facets = _all_facets(a, b)
        if facets is None:
            is_large[k] = True
        else:
            _search_few(a, b, facets, motions, span, tolerance, rows, is_part)
    return is_large


def _all_facets(a: Piece, b: Piece) -> np.ndarray | None:
    """(k, 2) all pairs of facets, a convex piece counting as one, where few enough to need no cut of a span."""
    ids: list[Any] = [p.tree.ids if p.is_mesh else np.zeros(1, dtype=np.int64) for p in (a, b)]  # type: ignore[union-attr]
    if len(ids[0]) * len(ids[1]) > _MAX_JOBS:
        return None
    ids = [np.unique(of) for of in ids]
    return np.stack(np.meshgrid(*ids, indexing="ij"), axis=-1).reshape(-1, 2)


def _search_few(
    a: Piece, b: Piece, pairs: np.ndarray, motions: Motions, span: tuple[float, float], tolerance: float, rows, is_part
) -> None:
    """`_search` for all motions at once, in a span of time, by all pairs of facets."""
    near = np.flatnonzero(_come_near(motions, [(a, b)]))
    if not len(near):
        return
    job = _FacetJobs(a, b, pairs, is_part)
    at_once = max(JOBS_AT_ONCE // len(pairs), 1)
    for first in range(0, len(near), at_once):
        job.search(motions, near[first : first + at_once], span, tolerance, rows)


def _come_near(motions: Motions, pieces: list[tuple[Piece, Piece]]) -> np.ndarray:
    """(n,) bool: motions in which balls around both bodies' origins, with all pieces inside, meet; rounding counts as
    meeting."""
    if not pieces:
        return np.zeros(1, dtype=bool)
    reach = max(sum(p.reach + float(np.linalg.norm(p.X_CS[:3, 3])) for p in pair) for pair in pieces)
    (a0, a1), (b0, b1) = (tuple(X[:, :3, 3] for X in ends) for ends in (motions[:2], motions[2:4]))
    d0 = b0 - a0
    v = (b1 - a1) - d0
    square = (v * v).sum(axis=1)
    middle = np.clip(-(d0 * v).sum(axis=1) / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    farthest = np.linalg.norm(d0, axis=1) + np.linalg.norm(v, axis=1)
    rounding = 2.0**-30 * (reach + farthest + sum(p.slop for pair in pieces for p in pair))
    stretch = np.maximum(_stretches(motions.X_WA0), _stretches(motions.X_WB0)) + _BALLS_OUTWARD
    return np.linalg.norm(d0 + middle[:, None] * v, axis=1) <= reach * stretch + rounding


def _stretches(X: np.ndarray) -> np.ndarray:
    """(n,) bounds of |R|: 1 of rotations, but matrices may be unchecked."""
    products = np.abs(X[:, :3, :3].transpose(0, 2, 1) @ X[:, :3, :3])
    return np.sqrt(products.sum(axis=2).max(axis=1))


def _order(shape: Shape) -> list[bytes]:
    contents: list[Any] = [piece.tree if piece.packed is None else piece.packed for piece in pieces_of(shape)]
    return [of.content for of in contents]


def _needs_facets(a: Piece, b: Piece) -> bool:
    return (a.is_mesh and b.tree is not None) or (b.is_mesh and a.tree is not None)


def _convex_pieces(a: Piece, b: Piece, motions: Motions, tolerance: float, rows: np.ndarray) -> None:
    """Pieces that are convex, or a half-space and a mesh, for all motions."""
    packed = [p.packed if p.packed is not None else convex_set_of(p.shape.convex_hull) for p in (a, b)]
    table = ShapeTable([p._replace(slop=p.slop + piece.slop) for p, piece in zip(packed, (a, b))])
    table.build_trees(np.arange(2))
    n = len(rows)
    jobs = np.zeros((n, 5), dtype=np.int64)
    jobs[:, 0], jobs[:, 3:] = np.arange(n), 1
    before = _clear_parts(rows)
    _do(table, 2, _parts(a, b), motions, jobs, 0.0, 1.0, tolerance, rows)
    _name_parts(rows, before, np.full(2, a.number), np.full(2, b.number))


def _clear_parts(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The parts named by rows, which are set to −1 to tell the parts written by a kernel."""
    before = rows["part_a"].copy(), rows["part_b"].copy()
    rows["part_a"] = rows["part_b"] = -1
    return before


def _name_parts(rows: np.ndarray, before: tuple[np.ndarray, np.ndarray], a: np.ndarray, b: np.ndarray) -> None:
    """Rows name the parts a and b of the table's rows where a kernel wrote any; else the parts before."""
    for name, old, numbers in zip(("part_a", "part_b"), before, (a, b)):
        at = rows[name]
        rows[name] = np.where(at < 0, old, numbers[at])


def _parts(a: Piece, b: Piece) -> np.ndarray:
    parts = np.zeros((2, PART))
    for row, piece in zip(parts, (a, b)):
        row[:9], row[9:12] = piece.X_CS[:3, :3].ravel(), piece.X_CS[:3, 3]
        row[TURNED] = not np.array_equal(piece.X_CS, IDENTITY)
    return parts


def _do(table, n_shapes: int, parts, motions: Motions, jobs, begin: float, end: float, tolerance: float, rows) -> None:
    header = header_of(Tables(table.addresses, n_shapes, parts), motions)
    find_impacts(address_of(header), address_of(jobs), len(jobs), begin, end, tolerance, address_of(rows))


class _Spans(Spans):
    """Spans of a motion of two pieces, and the facets that may meet in them."""

    def __init__(self, a: Piece, b: Piece, motion: Motions):
        super().__init__(_parts(a, b), (a.reach, b.reach, a.slop + b.slop), motion)
        self.a, self.b = a, b
        self._normal, self._faced = np.zeros((1, 3)), np.zeros((0, 3))

    def placed(self, time: float) -> Placed:
        """Where the pieces are at a time; of a span without a length the reach is what poses miss the motion by."""
        out = self.describe(time, time)
        return Placed(out[:16].reshape(4, 4).copy(), out[16:32].reshape(4, 4).copy(), float(out[REACH]))

    def near_facets(self, begin: float, end: float, max_pairs: int) -> np.ndarray | None:
        """(k, 2) facets with possible contact in a span of time; None for more than ``max_pairs``."""
        out = self.describe(begin, end)
        convex = None if self.a.is_mesh and self.b.is_mesh else self.b if self.a.is_mesh else self.a
        if convex is not None and (convex.has_many_facets or (convex.is_curved and out[REACH] < convex.radius)):
            return self._near_convex(convex, out, max_pairs)
        large_facets = self._large_facets_ahead(begin, end) if convex is None else None
        if large_facets is not None:
            pairs = self._near_large_facets(large_facets, begin, end, max_pairs)
            if pairs is not None:
                return pairs
        out = self.describe(begin, end)
        X_A, X_B = out[:16].reshape(4, 4), out[16:32].reshape(4, 4)
        reach = float(out[REACH]) + self.a.radius + self.b.radius
        near = facets_within(self.a.tree, self.b.tree, X_A, X_B, reach, max_pairs)  # type: ignore[arg-type]
        return None if near is None or len(near.facets) > max_pairs < _MAX_JOBS_OF_ALL else near.facets

    def _large_facets_ahead(self, begin: float, end: float) -> np.ndarray | None:
        """(k,) facets of the larger mesh on the way of the other, finely cut mesh, if few; else None.

        Boxes of the small mesh all lie in the box of a large facet: a walk of both trees comes to all of these boxes,
        where a walk of the small tree leaves out all boxes far from the facet's plane.
        """
        if not (self.a.is_mesh and self.b.is_mesh and self.is_small_beside()):
            return None
        large, small = self._by_size()
        if len(small.tree.ids) < _FINELY_CUT:  # type: ignore[union-attr]
            return None
        side = 0 if large is self.a else 1
        return facets_on_path(self, large.tree, side, begin, end, _MAX_TOGETHER)  # type: ignore[arg-type]

    def _near_large_facets(self, ahead: np.ndarray, begin: float, end: float, max_pairs: int) -> np.ndarray | None:
        """(k, 2) facets with possible contact in a span, of the larger mesh only ``ahead``; None where planes leave
        more than ``max_pairs``.

        A set around facets is no farther from the small mesh than its facets are: first all together, then each.
        """
        (large, small), out = self._by_size(), self.describe(begin, end)
        side, corners, reach = 0 if large is self.a else 1, large.corners(ahead), float(out[REACH])
        X = out[:32].reshape(2, 4, 4).copy()
        at = as_given(X[1 - side, None]), as_given(X[side, None])

        def near(of: np.ndarray) -> np.ndarray | None:
            along = self._normal if self._normal.any() else facet_normals(X[side, None], of).sum(axis=0)[None]
            packed = pack_points(of.reshape(-1, 3))
            rows = near_facets_up_to(small.tree, packed, *at, along, reach, max_pairs)  # type: ignore[arg-type]
            return None if rows is None else small.tree.ids[rows.place]  # type: ignore[union-attr]

        together = near(corners) if len(ahead) else np.zeros(0, dtype=np.int64)
        each = [together] * len(ahead)
        max_pairs = max(max_pairs, _JOBS_BEFORE_WALKS)
        if len(ahead) > 1 and (together is None or len(together) * len(ahead) > max_pairs):
            each = [near(of[None]) for of in corners] if len(ahead) <= _MAX_EACH else [None]
        if any(of is None for of in each) or sum(map(len, each)) > max_pairs:  # type: ignore[arg-type]
            return None
        of_large = np.repeat(ahead, [len(of) for of in each])  # type: ignore[arg-type]
        of_small = np.concatenate(each) if len(ahead) else of_large  # type: ignore[arg-type]
        return np.stack([of_large, of_small][:: 1 if side == 0 else -1], axis=1)

    def _by_size(self) -> tuple[Piece, Piece]:
        """The larger piece and the smaller one."""
        return (self.a, self.b) if self.a.reach > self.b.reach else (self.b, self.a)

    def _near_convex(self, convex: Piece, out: np.ndarray, max_pairs: int) -> np.ndarray | None:
        """`near_facets` of a mesh and a convex piece as a whole: where the polytope around a curved piece is farther
        from its surface than anything moves in the span, and where a facet of the mesh may be near more facets of a
        hull than a span has jobs.

        Planes between the two rule facets out, also along known normals, until few are left: normals of the sets around
        both pieces before these first meet, or of the last `cut`; any direction is right. For a curved piece without a
        known normal the distance gives the normal, and whether anything is near at all.
        """
        matrices, reach = (out[:16].reshape(1, 4, 4), out[16:32].reshape(1, 4, 4)), float(out[REACH])
        side = 0 if self.a.is_mesh else 1
        mesh: Any = self.a if side == 0 else self.b
        X_M, X_C = matrices[side].copy(), matrices[1 - side].copy()
        if convex.is_curved and not (self._normal.any() or len(self._faced)):
            row = pair_rows(mesh.shape, convex.shape, X_M, X_C, limit=reach, depths=False)[0]
            if row["lower"] > reach:
                return np.zeros((0, 2), dtype=np.int64)
            self._take_normal(row)
        at, near = (as_given(X_M), as_given(X_C)), None
        is_known = self._normal.any() or not len(self._faced)
        for normal in np.concatenate([self._normal, self._faced]) if is_known else self._faced:
            near = near_facets_up_to(mesh.tree, convex.packed, *at, normal[None], reach, max_pairs)  # type: ignore[arg-type]
            if near is not None:
                break
        else:
            return None
        facets = np.zeros((len(near.place), 2), dtype=np.int64)
        facets[:, side] = mesh.tree.ids[near.place]
        return facets

    def face_each_other(self, time: float) -> None:
        """Keep the normals between sets around both pieces at some times before the sets meet at ``time``.

        Times from the smaller piece's motion by its own size down to ever less: near an edge the normal turns until the
        contact, and shortly before the contact rounding decides its direction.
        """
        passed = self.scale(time, 1.0) * _BEFORE_MEETING
        placed = [self.placed(max(time - before, 0.0)) for before in passed]
        table, rows = ShapeTable([_around(self.a), _around(self.b)]), np.zeros(len(placed), dtype=PAIR_DTYPE)
        X = np.stack([at.X_A for at in placed]), np.stack([at.X_B for at in placed])
        run_poses(rows, table, None, *X, boolean=False, limit=np.inf, check=False, axes=None, depths=False)
        self._faced = rows["normal"][rows["normal"].any(axis=1)]

    def _take_normal(self, row: np.void) -> None:
        """Keep the normal of a row as the known normal, unless 0, as of overlapping bodies."""
        if row["normal"].any():
            self._normal = row["normal"][None].copy()

    def scale(self, begin: float, end: float) -> float:
        """The time in which the smaller piece may move by its own size."""
        return min(self.a.reach, self.b.reach) / float(self.describe(begin, end)[REACH]) * 0.5 * (end - begin)

    def time_of_hulls(self, begin: float, end: float, tolerance: float) -> float:
        """A time before which the hulls of both pieces do not meet, infinity where they do not up to ``end``."""
        table = ShapeTable([_hull_of(piece) for piece in (self.a, self.b)])
        table.build_trees(np.arange(2))
        jobs, row = np.array([[0, 0, 0, 1, 1]], dtype=np.int64), free_rows(1)
        _do(table, 2, self.parts, self.motion, jobs, begin, end, self.fine(begin, end, tolerance), row)
        return max(float(earliest_of(row)[0]), begin)

    def fine(self, begin: float, end: float, tolerance: float) -> float:
        """A tolerance of times: a small part of the time in which the smaller piece moves by its own size, where the
        tolerance asked for may be larger."""
        return max(min(tolerance, _LEAST_CUT * self.scale(begin, end)), _SHORTEST)

    def smaller_set(self, tight: bool = False) -> tuple[ShapeTable, np.ndarray, np.ndarray]:
        """A convex set around the smaller piece, as `earliest_by_facets` takes sets; tight: the hull of a mesh's
        vertices, in contact with a plane exactly when the mesh is."""
        side = 1 if self.a.reach > self.b.reach else 0
        piece, row = (self.a, self.b)[side], np.zeros(1, dtype=np.int64)
        packed = _around(piece)
        table = ShapeTable([_hull_of(piece) if tight else packed._replace(slop=packed.slop + piece.slop)])
        table.build_trees(row)
        return table, row, self.parts[side : side + 1]

    def is_small_beside(self) -> bool:
        """Whether a piece is small beside the other, a mesh."""
        large, small = self._by_size()
        return large.is_mesh and TIMES_SMALLER * small.reach <= large.reach

    def time_on_the_way(self, begin: float, end: float, tolerance: float) -> float:
        """A time before which the smaller piece meets no facet of the larger piece, infinity without contact up to
        ``end``: first by a simple set around the smaller piece, then, for a mesh, from the time of this set on by its
        hull."""
        width = self.fine(begin, end, tolerance)
        for tight in (False, True) if self._by_size()[1].is_mesh else (False,):
            begin = float(self.times_on_the_way(self.smaller_set(tight), begin, end, width)[0][0])
            if not begin < end:  # at the end there may be a contact
                return begin
        return begin

    def times_on_the_way(self, sets: Any, begin: float, end: float, tolerance: float) -> tuple[np.ndarray, float]:
        """((n,) times before which convex sets, all in the smaller piece, meet no facet of the larger piece on the way,
        infinity without contact up to ``end``; the end of the time searched, infinity for ``end``).

        sets : as of `earliest_by_facets`.
        """
        side = 0 if self.a.reach > self.b.reach else 1
        mesh, n = self.a if side == 0 else self.b, len(sets[1])
        facets, until = self._facets_ahead(side, begin, end, _MAX_ON_THE_WAY)
        if facets is not None and len(facets) * n > _JOBS_ON_THE_WAY:  # when the first of all may be met
            at = self, mesh.corners(facets), mesh.slop, side, self.smaller_set(), (begin, until), tolerance
            begin = min(max(begin, float(earliest_by_facets(*at)[0])), until)
            if begin < until:
                facets, until = self._facets_ahead(side, begin, until, _JOBS_ON_THE_WAY // n)
        known = until if until < end else math.inf
        if facets is None:
            return np.full(n, begin), known
        times = earliest_by_facets(self, mesh.corners(facets), mesh.slop, side, sets, (begin, until), tolerance)
        return np.minimum(np.maximum(times, begin), known), known

    def _facets_ahead(self, side: int, begin: float, end: float, max_facets: int) -> tuple[np.ndarray | None, float]:
        """(facets of the mesh of a side on the way of the other piece until a time, None for more than ``max_facets``;
        the time: the end, or as early as the facets are few, but not before the piece may have moved by its own
        size)."""
        mesh, until, least = (self.a, self.b)[side], end, 2.0 * self.scale(begin, end)
        while True:
            facets = facets_on_path(self, mesh.tree, side, begin, until, max_facets)  # type: ignore[arg-type]
            shorter = begin + max(0.25 * (until - begin), least)
            if facets is not None or not shorter < until:
                return facets, until
            until = shorter

    def cut(self, begin: float, end: float) -> tuple[float, float]:
        """(begin, end) of the part of a span to be looked at first.

        No contact is before the begin: distances shrink by μ in unit time at most (conservative advancement, Mirtich
        1996).
        """
        reach, half = float(self.describe(begin, end)[REACH]), 0.5 * (end - begin)
        at = self.placed(begin)
        shapes = (self.a, self.b) if self.a.is_mesh else (self.b, self.a)
        X = (at.X_A, at.X_B) if self.a.is_mesh else (at.X_B, at.X_A)
        row = pair_rows(*(piece.shape for piece in shapes), *(x[None] for x in X), limit=np.inf, depths=False)[0]
        self._take_normal(row)
        in_reach = max((float(row["lower"]) - at.error) / reach * half, 0.0)
        free = min(in_reach * _SHARE_OF_FREE, end - begin)
        rest = end - begin - free
        scale = self.scale(begin, end)
        length = max(scale if rest > 2.0 * scale else rest / _LARGEST_CUT, _FREE_TIMES * free, _SHORTEST)
        until_met = self._time_until_met(row, *X, begin, min(in_reach, end - begin))
        length = min(length, max((1.0 + _BEHIND_MEETING) * (until_met - free), _LEAST_CUT * scale, _SHORTEST))
        return begin + free, begin + free + min(length, 0.5 * rest)

    def _time_until_met(self, row: np.void, X_0: np.ndarray, X_1: np.ndarray, begin: float, passed: float) -> float:
        """When the points nearest at ``begin`` meet along the normal, extrapolated from their gap when some time has
        passed; infinity where the gap does not shrink. A guess: no proof depends on this time.

        row : of the pieces at ``begin``, at poses X_0 and X_1, the mesh's first.
        """
        at = self.placed(begin + passed)
        later = (at.X_A, at.X_B) if self.a.is_mesh else (at.X_B, at.X_A)
        moved = [
            X[:3, :3] @ (X0[:3, :3].T @ (row[point] - X0[:3, 3])) + X[:3, 3]
            for point, X0, X in zip(("point_a", "point_b"), (X_0, X_1), later)
        ]
        gap = float(row["normal"] @ (row["point_b"] - row["point_a"]))
        nearer = gap - float(row["normal"] @ (moved[1] - moved[0]))
        return passed * gap / nearer if gap > 0.0 and nearer > 0.0 else math.inf


def _max_jobs(span: float) -> int:
    return int(min(_MAX_JOBS * max(_SHORT / max(span, 1e-9), 1.0), _MAX_JOBS_OF_ALL))


class _Span(NamedTuple):
    """A span of time to be searched.

    max_pairs : with more pairs of facets that may meet the span is cut.   may_meet : whether bodies convex at the
    contact may meet as the span begins: its first part is searched before the cut.   is_timed : whether the span begins
    when a set around the smaller body first meets a facet on its way.
    """

    begin: float
    end: float
    max_pairs: int
    may_meet: bool = False
    is_timed: bool = False


def _search(
    a: Piece, b: Piece, motion: Motions, tolerance: float, row: np.ndarray, is_part: tuple[bool, bool], earliest: float
) -> None:
    """Search contacts of two pieces in a motion, span by span; ``row`` keeps the earliest found so far.

    is_part : whether rows name the part of A and B, compounds; else the facet.   earliest : time before which no
    contact is.
    """
    spans = _Spans(a, b, motion)
    begin, end = spans.time_of_balls()
    max_pairs, begin, end = _max_jobs(end - begin), max(begin, earliest), min(end, float(row["upper"][0]))
    if 0.0 < earliest and begin <= end and not spans.is_small_beside():  # else facets on the way tell more than a hull
        begin = spans.time_of_hulls(begin, end, tolerance)
        spans.face_each_other(min(begin, end))
    to_do = [_Span(begin, end, max_pairs, earliest > 0.0)]
    while to_do:
        span = to_do.pop()
        span = span._replace(end=min(span.end, float(row["upper"][0])))
        if span.begin > span.end:
            continue
        scale, length = spans.scale(span.begin, span.end), span.end - span.begin
        is_long = length > 4.0 * scale and spans.is_small_beside()  # of so long a way a ball holds too many facets
        if is_long and not span.is_timed:
            first = max(spans.time_on_the_way(span.begin, span.end, tolerance), span.begin)
            may_meet = span.may_meet or first > span.begin + _LEAST_CUT * scale
            to_do.append(span._replace(begin=first, may_meet=may_meet, is_timed=True))
            continue
        if span.may_meet and length > 2.0 * scale:
            to_do.append(span._replace(may_meet=False))
            more = min(_MORE * span.max_pairs, _MAX_JOBS_OF_ALL)
            for part in (_LEAST_CUT, _LEAST_CUT / _LARGEST_CUT):  # a shorter part costs less than a distance
                end = min(span.begin + max(part * scale, _SHORTEST), span.end)
                near = spans.near_facets(span.begin, end, more)
                if near is not None:
                    to_do[-1] = _Span(end, span.end, span.max_pairs)
                    _look_at(near, a, b, motion, (span.begin, end), tolerance, row, is_part)
                    break
            continue
        max_pairs, near = _MAX_JOBS_OF_ALL if length < _SHORTEST else span.max_pairs, None
        if not is_long or length < _SHORTEST:
            near = spans.near_facets(span.begin, span.end, max_pairs)
        if near is not None:
            _look_at(near, a, b, motion, (span.begin, span.end), tolerance, row, is_part)
        elif length < _SHORTEST:  # more facets together than can be looked at: open from here on
            if span.begin < row["lower"][0]:
                row["lower"], row["status"] = span.begin, OPEN
        else:
            begin, middle = spans.cut(span.begin, span.end)
            more = span.max_pairs * (_MORE if span.end - begin <= 2.0 * scale else 1)
            to_do += [_Span(middle, span.end, span.max_pairs), _Span(begin, middle, min(more, _MAX_JOBS_OF_ALL))]


def _look_at(
    near: np.ndarray, a: Piece, b: Piece, motion: Motions, span: tuple[float, float], tolerance: float, row, is_part
) -> None:
    """Search pairs of facets (k, 2) that may meet in a span of time."""
    if len(near):
        _FacetJobs(a, b, near, is_part).search(motion, np.zeros(1, dtype=np.int64), span, tolerance, row)


class _FacetJobs:
    """Pairs of facets that are near, to be searched in motions of two pieces."""

    def __init__(self, a: Piece, b: Piece, near: np.ndarray, is_part: tuple[bool, bool]):
        """near : (k, 2) facets.   is_part : as of `_search`."""
        self._a, self._b, self._near = a, b, near
        self._table, self._jobs, ids = _jobs(a, b, near)
        self._parts = _parts(a, b)
        self._names = [np.full(len(ids), p.number) if of else ids for p, of in zip((a, b), is_part)]
        self._points: CommonPoints | None = None

    def search(self, motions: Motions, some: np.ndarray, span: tuple[float, float], tolerance: float, rows) -> None:
        """Search motions, by their numbers (n,), in a span of time; ``rows`` keep the earliest found so far.

        Where a mesh is solid, a job of two facets about to touch, without a proven contact, has points asked, before
        all other jobs of this kind look far ahead for a proof: after a proven contact no job has to.
        """
        before, known = _clear_parts(rows), rows["lower"].copy()
        may_ask = self._a.is_mesh and self._b.is_mesh and any(_is_solid(p) for p in (self._a, self._b))
        asked = known.copy()
        first, size = 0, _JOBS_IN_TURN if may_ask else len(self._jobs)
        while first < len(self._jobs):
            jobs = self._jobs[first : first + size]
            these = np.tile(jobs, (len(some), 1))
            these[:, 0] = np.repeat(some, len(jobs))
            _do(self._table, len(self._table.ints), self._parts, motions, these, *span, tolerance, rows)
            first, size = first + size, 2 * size
            if may_ask:
                is_last = first >= len(self._jobs)
                lower, upper = rows["lower"][some], rows["upper"][some]
                is_open = (lower < (known if is_last else asked)[some]) & ~(upper <= lower + tolerance)
                for k in some[is_open].tolist():
                    self._ask_points(motions.picked(np.array([k])), rows[k : k + 1], far=is_last)
                asked[some] = lower
        _name_parts(rows, before, *self._names)

    def _ask_points(self, motion: Motions, row: np.ndarray, far: bool) -> None:
        """Lower a row's upper bound to the first time found when a body holds a point of the other."""
        a, b = self._a, self._b
        if self._points is None:
            trees: list[Any] = [a.tree, b.tree]
            corners = [p.corners(np.unique(column)) for p, column in zip((a, b), self._near.T)]
            self._points = CommonPoints(trees, corners, [_is_solid(a), _is_solid(b)])
        time = self._points.first_time(float(row["lower"][0]), _Spans(a, b, motion).placed, far)
        if time < row["upper"][0]:
            row["upper"], row["status"] = time, CONTACT


def _is_solid(piece: Piece) -> bool:
    shape: Any = piece.shape
    return piece.is_mesh and shape.solid


def _jobs(a: Piece, b: Piece, near: np.ndarray) -> tuple[Any, np.ndarray, np.ndarray]:
    """(table of facets, jobs of a motion, facet of each row of the table) for pairs of near facets.

    A convex piece is a single shape beside the facets of the mesh, not facet by facet.
    """
    if a.is_mesh and b.is_mesh:
        (ids_a, which_a), (ids_b, which_b) = (np.unique(column, return_inverse=True) for column in near.T)
        table: Any = Facets(np.concatenate([a.corners(ids_a), b.corners(ids_b)]))
        table.ints[len(ids_a) :, RANK] = 1
        table.numbers[: len(ids_a), SLOP] = a.slop
        table.numbers[len(ids_a) :, SLOP] = b.slop
        ids = np.concatenate([ids_a, ids_b])
        rows_a, rows_b = which_a.ravel(), which_b.ravel() + len(ids_a)
    else:
        mesh, convex = (a, b) if a.is_mesh else (b, a)
        facets = np.unique(near[:, 0 if a.is_mesh else 1])
        table = FacetTable(mesh.corners(facets), convex.packed)  # type: ignore[arg-type]
        table.numbers[:-1, SLOP] = mesh.slop
        table.numbers[-1, SLOP] += convex.slop
        table.build_trees(np.array([len(facets)]))
        ids = np.append(facets, 0)
        of_mesh, of_convex = np.arange(len(facets)), np.full(len(facets), len(facets))
        rows_a, rows_b = (of_mesh, of_convex) if a.is_mesh else (of_convex, of_mesh)
    zeros = np.zeros(len(rows_a), dtype=np.int64)
    jobs = np.ascontiguousarray(np.stack([zeros, rows_a, zeros, rows_b, zeros + 1], axis=1), dtype=np.int64)
    return table, jobs, ids
