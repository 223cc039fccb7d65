"""Pairs with a mesh made ready for single booleans."""

from __future__ import annotations

import numpy as np

from collide.meshes.bodies import Body, body_of, has_facets, is_halfspace
from collide.meshes.curved import APART, HIT
from collide.meshes.pairs import pair_states
from collide.meshes.union_parts import is_union
from collide.narrowphase import run
from collide.narrowphase.triangles.single import Side, SingleMeshPair
from collide.shapes.base import Shape


def single_pair(A: Shape, B: Shape) -> SingleMeshPair | None:
    """The pair, or None where single calls are answered as batches of one: unions, half-spaces, curved shapes, very many parts.

    It holds trees and points, not the shapes. Raises UnsupportedQuery.
    """
    if is_union(A) or is_union(B) or is_halfspace(A) or is_halfspace(B) or not (has_facets(A) and has_facets(B)):
        return None
    one, other = body_of(A), body_of(B)
    exchanged = other.key < one.key
    if exchanged:
        one, other = other, one
    sides = _side(one), _side(other)
    return SingleMeshPair(*sides, exchanged, one.radius + other.radius) if SingleMeshPair.serves(*sides) else None


def one_state(A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, kept: dict[int, SingleMeshPair | None], key: int) -> int:
    """APART, HIT or OPEN at one pair of checked poses (4, 4). kept : pairs made ready, by numbers of the caller's."""
    if key not in kept:
        kept[key] = single_pair(A, B) if run.single_calls_are_safe() else None
    pair = kept[key]
    said = pair.collide(pair.address, id(X_WA), id(X_WB)) if pair is not None else -1
    return int(pair_states(A, B, X_WA[None], X_WB[None])[0]) if said < 0 else HIT if said else APART


def _side(body: Body) -> Side:
    return Side(body.tree, body.solid, body.points, body.centre, body.reach)
