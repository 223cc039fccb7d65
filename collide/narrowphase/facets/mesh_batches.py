"""Two shapes with a mesh in one or both, at n pairs of poses: what pair queries and worlds ask.

Unions are taken apart into single bodies (`composite/`), single bodies go by their kinds (`mesh_pairs.py`). Hulls
settle what facets leave open: the convex engine gives them the last digit, and takes the poses of parts without
rounding them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from collide.errors import InvalidPose
from collide.lowering.enclosures import enclosure_of
from collide.lowering.facet_bodies import body_of
from collide.lowering.kind_of_shape import kind_of
from collide.lowering.kinds import Kind
from collide.narrowphase.composite.composite_meshes import compound_rows, compound_states
from collide.narrowphase.composite.composite_parts import compound_parts
from collide.narrowphase.convex_batches import convex_hits, convex_rows
from collide.narrowphase.convex_kernel_calls import finish_distances, number_of_poses
from collide.narrowphase.dispatch import Method, method_of
from collide.narrowphase.facets.facet_kernel_calls import (
    FacetPair,
    balls_farther,
    pair_of,
    prepared_facets,
    serves_single_calls,
    write_rows,
)
from collide.narrowphase.facets.mesh_collide_kernel import APART, OPEN
from collide.narrowphase.facets.mesh_pairs import checked_poses, hull_shape, mesh_rows, mesh_states
from collide.narrowphase.facets.nearest_item_calls import facets_of, prepared_items, serves
from collide.narrowphase.facets.touching_facets import PosedPart, make_gaps, settle_rows, settle_states
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE, UNDECIDED
from collide.shapes.shape import Shape


def pair_hits(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> np.ndarray:
    """(n,) bool: whether two shapes share a point; True where the answer is open.

    X_WA, X_WB : C-contiguous float64 (n, 4, 4), or (1, 4, 4) for a pose shared by all pairs.
    check : refuse matrices that are no rotation. Raises InvalidPose, UnsupportedQuery.
    Costs 0.2 µs a pose of bodies of facets far apart.
    """
    return _states(A, B, X_WA, X_WB, check, parts_open=False) != APART


def pair_states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) APART, HIT or OPEN: what `pair_hits` says, and whether that is proven."""
    return _states(A, B, X_WA, X_WB, False, parts_open=True)


def _states(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, check: bool, *, parts_open: bool) -> np.ndarray:
    """States of two shapes; parts_open: tell OPEN from HIT among convex parts, too."""
    if _has_compound(A, B):
        states = _compound_states(A, B, X_WA, X_WB, check, parts_open)
    else:
        states = mesh_states(A, B, X_WA, X_WB, check=check)
    _settle_states(states, A, B, X_WA, X_WB)
    return states


def _settle_states(states: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> None:
    """Settle in place bodies left open: by their hulls, if these are apart, else facet by facet."""
    undecided = np.flatnonzero(states == OPEN)
    covers = _convex_covers(A, B) if len(undecided) else None  # a mesh's hull is made when it is first needed
    if covers is not None:
        hulls_meet = convex_hits(*covers, _poses_of(X_WA, undecided), _poses_of(X_WB, undecided))
        states[undecided[~hulls_meet]] = APART
    if method_of(kind_of(A), kind_of(B)) is Method.FACETS:  # unions are settled part by part
        settle_states(states, _parts_at(A, B, X_WA, X_WB))


def _parts_at(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray) -> Callable[[int], tuple[PosedPart, PosedPart]]:
    """Both bodies of pair k."""
    return lambda k: (PosedPart(A, X_WA[k if len(X_WA) > 1 else 0]), PosedPart(B, X_WB[k if len(X_WB) > 1 else 0]))


def _compound_states(A: Shape, B: Shape, X_WA, X_WB, check: bool, parts_open: bool) -> np.ndarray:
    """States of compounds; only compounds left open by the balls around them are taken apart."""
    parts_a, parts_b = compound_parts(A), compound_parts(B)
    if parts_a.ball is None or parts_b.ball is None:
        return compound_states(A, B, *checked_poses(X_WA, X_WB, check), open_ones=parts_open)
    near = np.flatnonzero(~balls_farther(parts_a.ball, parts_b.ball, X_WA, X_WB, 0.0, check=check))
    states = np.full(number_of_poses(X_WA, X_WB), APART)
    if len(near):
        poses = (np.broadcast_to(X, (len(states), 4, 4))[near] for X in (X_WA, X_WB))
        states[near] = compound_states(A, B, *poses, open_ones=parts_open)
    return states


def pair_rows(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool = True, check: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Rows (PAIR_DTYPE) of two shapes; poses and check as of `pair_hits`, limit and depths as in `distance`.

    part_a, part_b : of a `Compound` the number of its part, in the order of its items, nested ones in their place; of
    any other shape the facet.   out : (n,) zeroed rows, to be filled and returned.
    """
    if _has_compound(A, B):
        rows = compound_rows(A, B, *checked_poses(X_WA, X_WB, check), limit=limit, depths=depths)
    else:
        rows = mesh_rows(A, B, X_WA, X_WB, limit=limit, depths=depths, check=check, out=out)
    _settle_rows(rows, A, B, X_WA, X_WB, limit)
    if out is not None and rows is not out:
        out[:] = rows
        rows = out
    return rows


def _settle_rows(rows: np.ndarray, A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> None:
    """Settle in place rows left undecided: by hulls, if these are apart, else facet by facet."""
    undecided = np.flatnonzero(rows["how"] == UNDECIDED)
    covers = _convex_covers(A, B) if len(undecided) else None
    if covers is not None:
        poses = _poses_of(X_WA, undecided), _poses_of(X_WB, undecided)
        hulls = convex_rows(*covers, *poses, depths=False)
        apart = hulls["lower"] > 0.0
        make_gaps(rows, undecided[apart], hulls[apart], limit)
    if method_of(kind_of(A), kind_of(B)) is Method.FACETS:
        settle_rows(rows, _parts_at(A, B, X_WA, X_WB), limit)


def rows_within(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> np.ndarray:
    """Rows as of `pair_rows` for checked poses; rows of pairs beyond ``limit`` [m] may have any proven bound.

    Hulls proven farther apart answer for the bodies in them: no facet is looked at, and no tree is built. Raises
    UnsupportedQuery where the hulls are not enough and the shapes are not answered.
    """
    covers = _convex_covers(A, B) if limit < math.inf else None
    if covers is None:
        return pair_rows(A, B, X_WA, X_WB, limit=limit)
    rows = convex_rows(*covers, X_WA, X_WB, limit=limit, depths=False)
    beyond = rows["beyond"] | (rows["lower"] > limit)
    rows["count"], rows["vertices_a"], rows["vertices_b"] = 0, -1, -1  # of the hulls, not of the meshes
    rows["part_a"], rows["part_b"] = 0, 0
    near = np.flatnonzero(~beyond)
    if len(near):
        rows[near] = pair_rows(A, B, _poses_of(X_WA, near), _poses_of(X_WB, near), limit=limit)
    return rows


def single_pair(A: Shape, B: Shape) -> Prepared:
    """Two bodies of facets made ready for batches and, unless they are of very many parts, for single calls.

    The pair holds trees and points, not the shapes.
    """
    bodies = body_of(A), body_of(B)
    prepared = prepared_facets(*bodies) if serves_single_calls(*bodies) else Prepared()
    pair = prepared.table = pair_of(*bodies)
    prepared.collide_poses, prepared.distance_poses = partial(_hits_of_batch, pair), partial(_rows_of_batch, pair)
    return prepared


def _hits_of_batch(pair: FacetPair, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray | None:
    """`Prepared.collide_poses`; ``None`` where a matrix is no pose, for the long way to say which."""
    X_WA, X_WB = _as_batch(X_WA), _as_batch(X_WB)
    try:
        states, some_open = pair.states(X_WA, X_WB, check=True)
    except InvalidPose:
        return None
    if not some_open:
        return states.view(np.bool_)
    _settle_states(states, *_shapes_of(pair), X_WA, X_WB)
    return states != APART


def _rows_of_batch(
    pair: FacetPair, X_WA: np.ndarray, X_WB: np.ndarray, depths: bool, limit: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """`Prepared.distance_poses`; ``None`` as of `_hits_of_batch`."""
    X_WA, X_WB = _as_batch(X_WA).copy(), _as_batch(X_WB).copy()
    rows = np.zeros(number_of_poses(X_WA, X_WB), dtype=PAIR_DTYPE)
    try:
        some_open = write_rows(rows, pair, X_WA, X_WB, limit=limit, depths=depths, check=True)
    except InvalidPose:
        return None
    if some_open:
        _settle_rows(rows, *_shapes_of(pair), X_WA, X_WB, limit)
    finish_distances(rows, depths=depths)  # no depth of bounded bodies is without end
    return rows, X_WA, X_WB


def _as_batch(X: np.ndarray) -> np.ndarray:
    return X if X.ndim == 3 else X[None]


def _shapes_of(pair: FacetPair) -> tuple[Shape, Shape]:
    """As asked about, and alive while they are."""
    bodies = (pair.B, pair.A) if pair.exchanged else (pair.A, pair.B)
    return bodies[0].shape, bodies[1].shape


def curved_pair(A: Shape, B: Shape) -> Prepared | None:
    """A mesh and a curved shape, in either order, made ready for single gaps; ``None`` of pairs answered as batches."""
    exchanged = kind_of(A) is not Kind.MESH
    if exchanged:
        A, B = B, A
    E = enclosure_of(B)
    if not serves(E.packed):
        return None
    return prepared_items(facets_of(body_of(A)), E.packed, exchanged, E.outer.points[0])


def _has_compound(A: Shape, B: Shape) -> bool:
    """Whether one is a `Compound`, to be taken apart."""
    return method_of(kind_of(A), kind_of(B)) is Method.MESH_PARTS


def _convex_covers(A: Shape, B: Shape) -> tuple[Shape, Shape] | None:
    """Two shapes of convex parts that hold the given shapes; ``None`` where a shape has no cover."""
    cover_a, cover_b = _convex_cover(A), _convex_cover(B)
    return None if cover_a is None or cover_b is None else (cover_a, cover_b)


def _convex_cover(shape: Shape) -> Shape | None:
    return None if kind_of(shape) is Kind.MESH_COMPOUND else hull_shape(shape)


def _poses_of(X: np.ndarray, some: np.ndarray | list[int]) -> np.ndarray:
    return X if len(X) == 1 else X[some]
