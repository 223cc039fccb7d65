"""Pairs of convex parts of two bodies that are as near as the bodies are.

Facets of meshes, items of fields and items of compounds are looked at within the upper bound of the distance: others
are farther apart, by boxes around both. The parts left are asked in pairs, as convex sets.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.derivatives.derived_rows import Derived, SetTable, empty_derived, run_rows
from collide.derivatives.features import LEVEL
from collide.lowering.extents import extent_of
from collide.lowering.packed_convex import HALFSPACE, PackedConvex, pack_points
from collide.lowering.parts import bounding_parts_of, parts_of
from collide.lowering.shape_table import ShapeTable, pose_table
from collide.narrowphase.convex_kernel_calls import run_pairs
from collide.narrowphase.fields.field_items import items_within
from collide.narrowphase.fields.items_of import items_of
from collide.shapes.compound import Compound
from collide.shapes.height_field import HeightField
from collide.shapes.mesh import Mesh
from collide.shapes.primitives import Halfspace
from collide.shapes.shape import IDENTITY, Shape
from collide.shapes.swept_mesh import SweptMesh

#: More pairs of parts within reach of each other are not looked at.
MAX_PAIRS = 1 << 12
_AXES = np.concatenate([np.eye(3), -np.eye(3)])
#: Distances that differ by less than this part of the pair's size are equal; boxes are larger by as much.
_EQUAL, _SLACK = LEVEL, 2.0**-30


class Placed(NamedTuple):
    """Convex parts of a body: sets, and their poses (k, 4, 4) in the body's frame."""

    sets: list[PackedConvex]
    X_BP: np.ndarray


class Way(NamedTuple):
    """A direction n (3,) from a body towards B, and how far B reaches against n [m]."""

    n: np.ndarray
    reach_of_b: float


class ActivePairs(NamedTuple):
    """Pairs of parts as near as the bodies.

    derived : of each pair, by the poses of the bodies.   sets, X : of A and of B, for each pair its convex set and the
    set's pose (k, 4, 4) in the world.   rows : (k,) `PAIR_DTYPE`.
    """

    derived: Derived
    sets: tuple[list[PackedConvex], list[PackedConvex]]
    X: tuple[np.ndarray, np.ndarray]
    rows: np.ndarray


def active_pairs(
    A: Shape, B: Shape, X_WA: np.ndarray, X_WB: np.ndarray, upper: float, n: np.ndarray
) -> ActivePairs | None:
    """The `ActivePairs` of bodies apart by at most ``upper`` [m], or of a half-space and a body, at poses (4, 4);
    ``None`` where bodies are not made of convex parts, or more pairs are near than `MAX_PAIRS`.

    n : (3,) the normal. Facets that B's lowest point along n is farther from than ``upper`` are left out.
    """
    upper = max(upper, 0.0)
    ways = Way(n, _reach_along(B, X_WB, -n)), Way(-n, _reach_along(A, X_WA, n))
    of_a, of_b = _parts_near(A, X_WA, B, X_WB, upper, ways[0]), _parts_near(B, X_WB, A, X_WA, upper, ways[1])
    if of_a is None or of_b is None:
        return None
    sides = of_a, of_b
    X_W = [X @ side.X_BP for side, X in zip(sides, (X_WA, X_WB))]
    boxes = [_boxes(side.sets, X) for side, X in zip(sides, X_W)]
    gaps = np.maximum(boxes[0][:, None, 0] - boxes[1][None, :, 1], boxes[1][None, :, 0] - boxes[0][:, None, 1])
    pairs = np.argwhere(np.linalg.norm(np.maximum(gaps, 0.0), axis=2) <= upper * (1.0 + _SLACK))
    if not 0 < len(pairs) <= MAX_PAIRS:
        return None
    sets, n_a = [*sides[0].sets, *sides[1].sets], len(sides[0].sets)
    X_P = np.concatenate([side.X_BP for side in sides])
    X_B = np.concatenate([np.broadcast_to(X, side.X_BP.shape) for side, X in zip(sides, (X_WA, X_WB))])
    table, poses = ShapeTable(sets), pose_table(X_B, X_P, np.array([packed.reach for packed in sets]))
    pairs[:, 1] += n_a
    rows = run_pairs(table, poses, np.arange(len(sets)), pairs, boolean=False, limit=math.inf)
    size = np.abs(np.concatenate([rows["point_a"], rows["point_b"]])).max() + abs(upper)
    is_active = rows["distance"] <= rows["distance"].min() + _EQUAL * size
    rows, (a, b) = rows[is_active], pairs[is_active].T
    X = np.concatenate(X_W)
    derived = empty_derived(len(rows))
    bodies = X_WA[None], X_WB[None]
    run_rows(rows, SetTable(table.ints, table.numbers, table), (a, b), (X[a], X[b]), bodies, derived)
    return ActivePairs(derived, ([sets[k] for k in a], [sets[k] for k in b]), (X[a], X[b]), rows)


def is_least_of_parts(row, A: Shape, B: Shape) -> bool:
    """Whether the signed distance of two bodies is the least of their parts': apart, and beside half-spaces."""
    return not row["hit"] or isinstance(A, Halfspace) or isinstance(B, Halfspace)


def _parts_near(shape: Shape, X_WS: np.ndarray, B: Shape, X_WB: np.ndarray, upper: float, way: Way) -> Placed | None:
    """The convex parts of a shape that may be within a distance of B; ``None`` of regions and terrain."""
    if isinstance(shape, Compound):
        return _items_near(shape, X_WS, B, X_WB, upper, way)
    if shape.is_region or (shape.is_field and isinstance(shape, HeightField)):
        return None
    if isinstance(shape, Mesh):
        return _facets_near(shape, 0.0, X_WS, B, X_WB, upper, way)
    if isinstance(shape, SweptMesh):
        return _facets_near(shape.mesh, shape.radius, X_WS, B, X_WB, upper, way)
    if shape.is_field:
        items = items_of(shape)
        hulls = items.hulls(items_within(items, B, X_WS, X_WB, upper * (1.0 + _SLACK)))
        sets = [parts_of(hull)[0][0] for hull in hulls]
        return Placed(sets, np.broadcast_to(items.X_FG, (len(sets), 4, 4)))
    packed, X_SP = parts_of(shape)[0]
    return Placed([packed], X_SP[None])


def _items_near(shape: Compound, X_WS: np.ndarray, B: Shape, X_WB: np.ndarray, upper: float, way: Way) -> Placed | None:
    sets: list[PackedConvex] = []
    poses: list[np.ndarray] = []
    for item, X_SI in shape.items:
        parts = _parts_near(item, X_WS @ X_SI, B, X_WB, upper, way)
        if parts is None:
            return None
        sets += parts.sets
        poses.append(X_SI @ parts.X_BP)
    return Placed(sets, np.concatenate(poses))


def _facets_near(
    mesh: Mesh, radius: float, X_WM: np.ndarray, B: Shape, X_WB: np.ndarray, upper: float, way: Way
) -> Placed:
    """Facets by their boxes beside the box around B, and along a way; by heights beside half-spaces. O(facets)."""
    corners = (mesh.vertices @ X_WM[:3, :3].T + X_WM[:3, 3])[mesh.faces]
    slack = _SLACK * (np.abs(corners).max() + np.abs(X_WB[:3, 3]).max() + upper)
    is_near = np.zeros(len(corners), dtype=bool)
    for packed, X_BP in bounding_parts_of(B):
        X = X_WB @ X_BP
        if packed.kind == HALFSPACE:
            heights = corners @ (X[:3, :3] @ packed.params[:3])
            is_near |= heights.min(axis=1) <= heights.min() + slack * np.linalg.norm(packed.params[:3])
            continue
        low, high = _boxes([packed], X[None])[0]
        gaps = np.maximum(corners.min(axis=1) - high, low - corners.max(axis=1))
        is_near |= np.linalg.norm(np.maximum(gaps, 0.0), axis=1) <= upper + radius + slack
    if math.isfinite(way.reach_of_b):
        # No point of B is lower along n than −reach: a facet lower than that by more than ``upper`` is farther.
        is_near &= (corners @ way.n).max(axis=1) + radius >= -way.reach_of_b - upper - slack
    facets = np.flatnonzero(is_near)
    sets = [pack_points(mesh.vertices[mesh.faces[k]], radius) for k in facets.tolist()]
    return Placed(sets, np.broadcast_to(IDENTITY, (len(sets), 4, 4)))


def _reach_along(shape: Shape, X_WS: np.ndarray, n: np.ndarray) -> float:
    """How far a shape reaches along a unit vector, at most [m]; infinite with a half-space."""
    return max(extent_of(packed, X_WS @ X_SP, n) for packed, X_SP in bounding_parts_of(shape))


def _boxes(sets: list[PackedConvex], X: np.ndarray) -> np.ndarray:
    """(k, 2, 3) boxes around posed sets, a little larger."""
    extents = np.array([[extent_of(packed, X_k, axis) for axis in _AXES] for packed, X_k in zip(sets, X)])
    boxes = np.stack([-extents.reshape(-1, 6)[:, 3:], extents.reshape(-1, 6)[:, :3]], axis=1)
    slack = _SLACK * np.where(np.isfinite(boxes), np.abs(boxes), 0.0).max(initial=0.0)
    return boxes + np.array([-slack, slack])[:, None]
