"""Meshes and curved shapes, fields and convex sets from Python: states and gaps of batches, pairs for single calls."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collide.fields.cell_tree_kernel import STACK
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_row
from collide.lowering.extents import box_of
from collide.lowering.facet_bodies import Body, reach_of
from collide.lowering.facet_table import FacetTable
from collide.lowering.packed_convex import POINTS, PackedConvex
from collide.lowering.shape_table import COUNT, POSE, RADIUS
from collide.mesh.box_overlap import FRAME, PRISM
from collide.mesh.bvh import WIDTH
from collide.narrowphase.bounds import PROMISE_CURVED, PROMISE_STORED
from collide.narrowphase.convex_kernel_calls import scratch, space_of_single_calls
from collide.narrowphase.facets.facet_queries import points_in_solid
from collide.narrowphase.facets.item_questions import (
    BALLS,
    BOX_AT,
    CELLS,
    EXCHANGED,
    FACETS,
    HEADER,
    ITEMS_ARE,
    MAYBE_INSIDE,
    MEETS,
    PRISMS,
    PROBE_AT,
    RADII_AT,
    REACH_OF_ITEMS,
    STACK_AT,
    SURFACES_APART,
)
from collide.narrowphase.facets.nearest_item_kernel import (
    curved_gap_single,
    curved_gaps,
    curved_state_single,
    curved_states_of,
)
from collide.narrowphase.facets.winding_numbers import OUTSIDE
from collide.narrowphase.pair_kernel import answer_pairs
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE


def serves(packed: PackedConvex) -> bool:
    """Whether the kernel takes a shape: not polytopes of rounded corners."""
    return packed.kind != POINTS


#: Corners of items, by what they are.
_CORNERS = {FACETS: 3, BALLS: 1, CELLS: 8, PRISMS: 6}


class Items(NamedTuple):
    """The facets of a mesh, the balls of a cloud, the cells of a grid, or the prisms of terrain.

    tree : over facets, points or cells, or terrain.   reach : how far they reach from their origin [m].
    solid : whether they enclose an inside.   radius : the largest of balls, 0 of facets [m].   radii : (n,) of balls,
    where they differ.   are : FACETS, BALLS, CELLS or PRISMS.
    """

    tree: Any
    reach: float
    solid: bool
    radius: float = 0.0
    radii: np.ndarray | None = None
    are: int = FACETS


class GapQuestion:
    """Items and a shape as the kernel reads them, and the kernel's output.

    workspace : addresses of the doubles and integers that `answer_pairs` works in.
    """

    def __init__(self, items: Items, packed: PackedConvex, workspace: tuple[int, int]):
        self.items, self.table = items, FacetTable(np.zeros((1, 3, 3)), packed)
        self.table.ints[0, COUNT], self.table.numbers[0, RADIUS] = _CORNERS[items.are], items.radius
        self.table.build_trees(np.arange(2))
        n_stack = STACK if items.are == CELLS else WIDTH * (items.tree.depth + 2)
        self.poses, self.rows = np.zeros((2, POSE)), np.zeros(2, dtype=PAIR_DTYPE)
        self.numbers = np.array([0, 1])
        self.stack, self.bounds = np.zeros(n_stack, dtype=np.int64), np.zeros(n_stack)
        self.header = np.zeros(HEADER, dtype=np.int64)
        buffers = self.table.coordinates, self.poses, self.numbers, self.numbers, self.rows
        self.header[:STACK_AT] = (
            code_of(answer_pairs), items.tree.address, *self.table.addresses, *map(address_of, buffers), *workspace,
        )
        self.header[STACK_AT:EXCHANGED] = address_of(self.stack), address_of(self.bounds)
        self.header[ITEMS_ARE] = items.are
        self.box, self.probe = box_of(packed), np.zeros(FRAME + PRISM, dtype=np.float32)
        self.header[BOX_AT], self.header[PROBE_AT] = address_of(self.box), address_of(self.probe)
        self.header[RADII_AT] = 0 if items.radii is None else address_of(items.radii)
        promise = PROMISE_STORED if packed.kind == POINTS else PROMISE_CURVED
        self.header.view(np.float64)[REACH_OF_ITEMS:] = items.reach, items.radius, promise


def facets_of(A: Body) -> Items:
    """Those of a mesh."""
    return Items(A.tree, reach_of(A), A.solid)


class SurfaceStates(NamedTuple):
    """n poses of items and a shape.

    meets, apart : (n,) whether an item is known to meet the shape, or all to be farther apart than the margin; poses
    without either are left to another method.   maybe_inside : (n,) of items apart, whether the shape may lie inside
    the mesh.   place : (n,) the item meeting the shape, in the order of the tree.   how : (n,) index into
    `results.HOW`.
    """

    meets: np.ndarray
    apart: np.ndarray
    maybe_inside: np.ndarray
    place: np.ndarray
    how: np.ndarray


def surface_states(
    items: Items, packed: PackedConvex, X_WA: np.ndarray, X_WB: np.ndarray, margin: float = 0.0
) -> SurfaceStates:
    """Whether items and a shape meet at n poses (n, 4, 4).   margin : how far they may be apart [m]."""
    n = len(X_WA)
    state, place, how = np.empty((3, n), dtype=np.int64)
    X_WA, X_WB = np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB)
    question = GapQuestion(items, packed, scratch())
    curved_states_of(
        address_of(question.header), address_of(X_WA), address_of(X_WB), n, margin, address_of(state),
        address_of(place), address_of(how),
    )
    meets, maybe_inside = state == MEETS, state == MAYBE_INSIDE
    return SurfaceStates(meets, maybe_inside | (state == SURFACES_APART), maybe_inside, place, how)


class _SingleQuestion:
    """Items and a shape, asked pose by pose.

    exchanged : the shape stands first.   held : the kernel's arrays. All threads share the workspace: the kernel keeps
    Python's lock.
    """

    def __init__(self, items: Items, packed: PackedConvex, exchanged: bool):
        space = space_of_single_calls()
        question = GapQuestion(items, packed, space.addresses)
        question.header[EXCHANGED] = exchanged
        self.header, self.held = question.header, (space, question, packed)
        self._solid, self._state = items.solid, prepared_row(curved_state_single, question.header)

    def state(self, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> int | None:
        """MEETS, NEAR, SURFACES_APART or, of solids alone, MAYBE_INSIDE; None of pairs left to another method.

        margin : how far the bodies may be apart [m].
        """
        memory = bytearray(PAIR_DTYPE.itemsize)
        if self._state(X_WA, X_WB, memory, False, margin) is None:
            return None
        state = memory[0]
        return SURFACES_APART if state == MAYBE_INSIDE and not self._solid else state


def gap_rows(
    items: Items, packed: PackedConvex, X_WA: np.ndarray, X_WB: np.ndarray, depths: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """(rows, (n,) bool whether they are written) of items and a shape, apart at n poses (n, 4, 4), or, without depths,
    meeting.

    Unwritten rows need another method.
    """
    n = len(X_WA)
    rows, is_written = np.zeros(n, dtype=PAIR_DTYPE), np.zeros(n, dtype=bool)
    X_WA, X_WB = np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB)
    question = GapQuestion(items, packed, scratch())
    curved_gaps(
        address_of(question.header), address_of(X_WA), address_of(X_WB), n, depths, address_of(rows),
        address_of(is_written),
    )
    return rows, is_written


def prepared_items(
    items: Items, packed: PackedConvex, exchanged: bool, point: Any = None
) -> Prepared:
    """Items and a shape ready for single gaps without a limit; everything else is left to the long way.

    exchanged : the shape stands first.   point : (3,) of the shape, in its frame, where items enclose an inside.
    """
    single = _SingleQuestion(items, packed, exchanged)
    gap = prepared_row(curved_gap_single, single.header)

    def is_outside(X_WA, X_WB) -> bool:
        """Whether the shape, whose surface the mesh's does not meet, is outside of the mesh."""
        X_WM, X_WS = (X_WB, X_WA) if exchanged else (X_WA, X_WB)
        return bool(points_in_solid(items.tree, X_WM, point, X_WS)[0] == OUTSIDE)

    def distance(X_WA, X_WB, memory: bytearray, depths: bool, limit: float) -> bool | None:
        """True; None where a depth is wanted, where the bodies may meet, and of limits."""
        apart = gap(X_WA, X_WB, memory, depths, limit) if limit == math.inf else None
        if apart is False and items.solid:
            return True if is_outside(X_WA, X_WB) else None
        return None if apart is None else True

    def collide(X_WA, X_WB) -> bool | None:
        state = single.state(X_WA, X_WB, 0.0)
        if state == MAYBE_INSIDE:
            return not is_outside(X_WA, X_WB)
        return None if state is None else state == MEETS

    def within(X_WA, X_WB, margin: float) -> bool | None:
        state = single.state(X_WA, X_WB, margin)
        if state == MEETS or state == SURFACES_APART:
            return state == MEETS
        memory = bytearray(PAIR_DTYPE.itemsize)
        if distance(X_WA, X_WB, memory, False, math.inf) is None:
            return None
        row = np.frombuffer(memory, PAIR_DTYPE, 1)[0]
        return True if row["upper"] <= margin else False if row["lower"] > margin else None

    return Prepared(collide=collide, within=within, distance=distance, held=single.held)
