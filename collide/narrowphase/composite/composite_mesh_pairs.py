"""A part of a union against another body, the part or the body a mesh, at poses that may be rounded products.

Exact poses are answered as for any pair. Where a product of two poses was rounded, a part stands within its slop of
its rounded place: gaps wider than the slop are proven, and so are facets crossing each other by more, and points
deeper inside. All else is left open here, for `facets/touching_facets.py`, where products are exact.
"""

from __future__ import annotations

import math

import numpy as np

from collide.lowering.enclosures import Enclosure, enclosure_of
from collide.lowering.facet_bodies import Body, PosesWithSlop, body_of, is_halfspace
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import WITH_FACETS
from collide.lowering.parts import bounding_parts_of
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.facets.facet_kernel_calls import body_rows, core_hits
from collide.narrowphase.facets.facet_queries import all_hits, first_hits, surface_distances
from collide.narrowphase.facets.mesh_collide_kernel import APART, FARTHER, HIT, OPEN
from collide.narrowphase.facets.mesh_curved import curved_rows, settle_curved
from collide.narrowphase.facets.mesh_distance_kernel import PROMISE
from collide.narrowphase.facets.mesh_pairs import hull_shape, mesh_rows, mesh_states
from collide.results import EXACT, FORMULA, PAIR_DTYPE, UNDECIDED, flipped
from collide.shapes.shape import Shape

#: Rounding of a determinant of differences, of the product of their lengths; and of a coordinate, of the size.
_DETERMINANT, _COORDINATE = 2.0**-46, 2.0**-48
#: Pairs of facets of a pose that meet and are looked at for a crossing that no rounding undoes; so many at once.
_MAX_PAIRS, _PAIRS_AT_ONCE = 4096, 64


def part_states(A: Shape, B: Shape, X_WA: PosesWithSlop, X_WB: PosesWithSlop) -> np.ndarray:
    """(n,) APART, HIT or OPEN, for a mesh and another single body."""
    slop = X_WA.slop + X_WB.slop
    states = np.full(len(slop), OPEN)
    exact = slop == 0.0
    if exact.any():
        states[exact] = mesh_states(A, B, X_WA.X[exact], X_WB.X[exact])
    if not exact.all():
        PA, PB = X_WA.of(~exact), X_WB.of(~exact)
        states[~exact] = _STATES[method_of(kind_of(A), kind_of(B))](A, B, PA, PB)
    return states


def _plane_states(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    rows = _plane_rows(A, B, PA, PB, math.inf)
    return np.where(rows["how"] == UNDECIDED, OPEN, np.where(rows["hit"], HIT, APART))


def _facet_states(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    return loose_states(body_of(A), body_of(B), PA, PB)


def _curved_states(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    if kind_of(A) not in WITH_FACETS:
        A, B, PA, PB = B, A, PB, PA
    body, E = body_of(A), enclosure_of(B)
    # What is apart from a polytope around the shape is apart, what meets one inside it meets the shape: facets are
    # looked at one by one only between the two.
    states = np.where(loose_states(body, E.outer, PA, PB) == APART, APART, OPEN)
    for settle in (_meets_inner, _settled):
        remaining = np.flatnonzero(states == OPEN)
        if len(remaining):
            states[remaining] = settle(body, E, PA.of(remaining), PB.of(remaining))
    return states


def _meets_inner(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n,) HIT where a mesh meets the polytope inside a shape, else OPEN."""
    if E.inner is None:
        return np.full(len(PA.X), OPEN)
    return np.where(loose_states(A, E.inner, PA, PB) == HIT, HIT, OPEN)


def _settled(A: Body, E: Enclosure, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    return settle_curved(A, E, PA, PB).state


_STATES = {Method.HULL: _plane_states, Method.FACETS: _facet_states, Method.CURVED: _curved_states}


def part_rows(A: Shape, B: Shape, X_WA: PosesWithSlop, X_WB: PosesWithSlop, limit: float) -> np.ndarray:
    """Rows of a mesh and another single body, without depths, but against half-spaces; where open, how is "undecided".

    A bracket is widened by how far rounding may have moved the parts.
    """
    slop = X_WA.slop + X_WB.slop
    exact = slop == 0.0
    rows = np.zeros(len(slop), dtype=PAIR_DTYPE)
    method = method_of(kind_of(A), kind_of(B))
    if exact.any():
        rows[exact] = mesh_rows(A, B, X_WA.X[exact], X_WB.X[exact], limit=limit, depths=method is Method.HULL)
    if not exact.all():
        PA, PB = X_WA.of(~exact), X_WB.of(~exact)
        rows[~exact] = _ROWS[method](A, B, PA, PB, limit)
    return rows


def _curved_rows(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop, limit: float) -> np.ndarray:
    if kind_of(A) in WITH_FACETS:
        return curved_rows(body_of(A), enclosure_of(B), PA, PB, limit=limit, depths=False)
    return flipped(curved_rows(body_of(B), enclosure_of(A), PB, PA, limit=limit, depths=False))


def _plane_rows(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop, limit: float) -> np.ndarray:
    rows = convex_rows(hull_shape(A), hull_shape(B), PA.X, PB.X)
    rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1
    size = _size(A, B, PA, PB)
    _widen(rows, size, PA.slop + PB.slop, limit)
    rows["certified"] &= rows["beyond"] | (rows["upper"] - rows["lower"] <= PROMISE * size)  # of depths, too
    crossing = (rows["lower"] <= 0.0) & (rows["upper"] > 0.0)
    rows["how"][crossing] = UNDECIDED
    rows["hit"] = ~(rows["lower"] > 0.0)
    return rows


def _size(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n,) of pairs of parts, as `narrowphase/bounds.py` has it."""
    size = np.sqrt(np.square(PB.X[:, :3, 3] - PA.X[:, :3, 3]).sum(axis=1))
    for shape in (A, B):
        bound = bounding_parts_of(shape)[0][0]
        size = size + (abs(float(bound.params[3])) if is_halfspace(shape) else bound.reach + bound.radius)
    return size


def _widen(rows: np.ndarray, size: np.ndarray, slop: np.ndarray, limit: float) -> None:
    """Brackets that hold however rounding moved the parts, in place; far from the world's origin they are wide."""
    rows["lower"] = np.nextafter(rows["lower"] - slop, -np.inf)
    rows["upper"] = np.nextafter(rows["upper"] + slop, np.inf)
    rows["certified"] &= (rows["lower"] > 0.0) | (rows["upper"] < 0.0)
    rows["certified"] &= (rows["upper"] - rows["lower"] <= PROMISE * size) | (rows["lower"] <= 0.0)
    beyond = rows["lower"] > limit
    rows["beyond"] = beyond
    rows["distance"][beyond], rows["upper"][beyond] = rows["lower"][beyond], np.inf


def _loose_rows(A: Shape, B: Shape, PA: PosesWithSlop, PB: PosesWithSlop, limit: float) -> np.ndarray:
    states = loose_states(body_of(A), body_of(B), PA, PB)
    rows = body_rows(body_of(A), body_of(B), PA.X, PB.X, limit=math.inf, depths=False)
    hit = rows["hit"].copy()
    _widen(rows, _size(A, B, PA, PB), PA.slop + PB.slop, limit)
    apart = states == APART
    rows["lower"][~apart & hit] = 0.0  # no depth is told
    rows["upper"][states == HIT] = 0.0
    rows["distance"][~apart] = 0.0
    rows["lower"][~apart] = np.minimum(rows["lower"][~apart], 0.0)
    rows["hit"], rows["how"] = ~apart, np.where(states == OPEN, UNDECIDED, np.where(apart, FORMULA, EXACT))
    rows["certified"] &= states != OPEN
    rows["beyond"] &= apart
    return rows


_ROWS = {Method.HULL: _plane_rows, Method.FACETS: _loose_rows, Method.CURVED: _curved_rows}


def loose_states(A: Body, B: Body, PA: PosesWithSlop, PB: PosesWithSlop) -> np.ndarray:
    """(n,) states of two bodies of facets whose poses are known to within their slops."""
    slop, radius = PA.slop + PB.slop, A.radius + B.radius
    states = np.full(len(slop), OPEN)
    core, inside = core_hits(A, B, PA.X, PB.X)
    margin = 1.001 * slop
    distances = surface_distances(A.tree, B.tree, PA.X, PB.X, (radius + 4.0 * float(slop.max())) * FARTHER)
    within = ~np.isnan(inside[:, 0])
    states[~core & (distances.lower - radius > margin)] = APART
    states[(core & within & (distances.lower > margin)) | (distances.upper + margin <= radius)] = HIT
    remaining = np.flatnonzero((states == OPEN) & core & ~within)
    if len(remaining):
        first = first_hits(A.tree, B.tree, PA.X[remaining], PB.X[remaining])
        met = first.starts[1:] > first.starts[:-1]
        remaining = remaining[met]
        crossing = _crossing(A, B, first.pairs, PA.X[remaining], PB.X[remaining], slop[remaining])
        states[remaining[crossing]] = HIT
        remaining = remaining[~crossing]
        if len(remaining):
            every = all_hits(A.tree, B.tree, PA.X[remaining], PB.X[remaining])
            starts, count = every.starts[:-1], np.diff(every.starts)
            of_pair, rank = np.repeat(remaining, count), np.arange(len(every.pairs)) - np.repeat(starts, count)
            for begin in range(0, min(int(count.max()), _MAX_PAIRS), _PAIRS_AT_ONCE):
                some = (rank >= begin) & (rank < begin + _PAIRS_AT_ONCE) & (states[of_pair] == OPEN)
                k = of_pair[some]
                states[k[_crossing(A, B, every.pairs[some], PA.X[k], PB.X[k], slop[k])]] = HIT
    return states


def _crossing(A: Body, B: Body, pairs: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray, slop: np.ndarray) -> np.ndarray:
    """(k,) bool: whether an edge of either facet passes through the other by more than rounding and the slop can undo.

    pairs : (k, 2) facets, at poses (k, 4, 4). The deciding signs are determinants of differences of corners; each
    determinant is bounded away from 0 by the most that moved corners can change.
    """
    shift = X_WB[:, :3, 3] - X_WA[:, :3, 3]
    U, V = _corners(A, pairs[:, 0], X_WA, np.zeros_like(shift)), _corners(B, pairs[:, 1], X_WB, shift)
    moved = 1.001 * slop + _COORDINATE * (
        _terms(A, pairs[:, 0], X_WA) + _terms(B, pairs[:, 1], X_WB) + np.abs(shift).max(axis=1)
    )
    edges = [(S[:, k], S[:, k - 2], T[:, 0], T[:, 1], T[:, 2], moved) for T, S in ((U, V), (V, U)) for k in range(3)]
    passes: np.ndarray = _passes(*map(np.concatenate, zip(*edges))).reshape(6, -1)
    return np.logical_or.reduce(passes)


def _corners(body: Body, facets: np.ndarray, X: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """(k, 3, 3) corners in the world's axes, relative to the origin of A's frame."""
    return (_own_corners(body, facets)[:, :, None] * X[:, None, :3, :3]).sum(axis=3) + shift[:, None]


def _terms(body: Body, facets: np.ndarray, X: np.ndarray) -> np.ndarray:
    """(k,) size of the terms that a coordinate of these corners is the sum of."""
    terms = (np.abs(_own_corners(body, facets))[:, :, None] * np.abs(X[:, None, :3, :3])).sum(axis=3)
    return terms.max(axis=(1, 2)) if len(terms) else np.zeros(0)


def _own_corners(body: Body, facets: np.ndarray) -> np.ndarray:
    return body.tree.triangles[body.tree.places[facets]].reshape(-1, 3, 3)


def _passes(p, q, a, b, c, moved) -> np.ndarray:
    """(k,) whether segments pq pass through triangles abc, (k, 3) each, whoever moves any corner by ``moved`` (k,)."""
    corners = (a, b, c, p), (a, b, c, q), (p, q, a, b), (p, q, b, c), (p, q, c, a)
    of, to, by, at = map(np.concatenate, zip(*corners))
    below, above, *sides = _sign(of, to, by, at, np.tile(moved, 5)).reshape(5, -1)
    return (below * above < 0) & (sides[0] != 0) & (sides[0] == sides[1]) & (sides[1] == sides[2])


def _sign(a, b, c, d, moved) -> np.ndarray:
    """(k,) sign of the volume of abcd, 0 where moving corners by ``moved`` might change it."""
    u, v, w = b - a, c - a, d - a
    value = sum(u[:, i] * (v[:, j] * w[:, k] - v[:, k] * w[:, j]) for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)))
    x, y, z = (np.sqrt(np.square(edge).sum(axis=1)) for edge in (u, v, w))
    m = 2.0 * moved
    error = m * (x * y + y * z + z * x) + m * m * (x + y + z) + m * m * m
    error = error * 1.001 + _DETERMINANT * (x + m) * (y + m) * (z + m) + 1e-300
    return np.where(value > error, 1, np.where(value < -error, -1, 0))
