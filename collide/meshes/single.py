"""Pairs with a mesh made ready for single booleans."""

from __future__ import annotations

from collide.meshes.bodies import Body, body_of, is_halfspace
from collide.narrowphase.triangles.single import Side, SingleMeshPair
from collide.shapes.base import Shape


def single_pair(A: Shape, B: Shape) -> SingleMeshPair | None:
    """The pair, or None where single calls are answered as batches of one: half-spaces, very many parts.

    It holds trees and points, not the shapes. Raises UnsupportedQuery.
    """
    if is_halfspace(A) or is_halfspace(B):
        return None
    one, other = body_of(A), body_of(B)
    exchanged = other.key < one.key
    if exchanged:
        one, other = other, one
    sides = _side(one), _side(other)
    return SingleMeshPair(*sides, exchanged, one.radius + other.radius) if SingleMeshPair.serves(*sides) else None


def _side(body: Body) -> Side:
    return Side(body.tree, body.solid, body.points, body.centre, body.reach)
