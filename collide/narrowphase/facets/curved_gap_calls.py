"""Meshes and cylinders, cones and ellipsoids from Python: states and gaps of batches, and pairs for single calls."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_row
from collide.lowering.enclosures import Enclosure
from collide.lowering.facet_bodies import Body, reach_of
from collide.lowering.facet_table import FacetTable
from collide.lowering.packed_convex import POINTS, PackedConvex
from collide.lowering.shape_table import POSE
from collide.mesh.bvh import WIDTH
from collide.narrowphase.convex_kernel_calls import scratch, space_of_single_calls
from collide.narrowphase.facets.curved_gap_kernel import (
    EXCHANGED,
    HEADER,
    MAYBE_INSIDE,
    MEETS,
    REACH_OF_MESH,
    STACK_AT,
    SURFACES_APART,
    curved_gap_single,
    curved_gaps,
    curved_state_single,
    curved_states_of,
)
from collide.narrowphase.facets.facet_queries import points_in_solid
from collide.narrowphase.facets.winding_numbers import OUTSIDE
from collide.narrowphase.pair_kernel import answer_pairs
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import PAIR_DTYPE


def serves(packed: PackedConvex) -> bool:
    """Whether the kernel takes a shape: not polytopes of rounded corners."""
    return packed.kind != POINTS


class GapQuestion:
    """A mesh and a shape as the kernel reads them, and the kernel's output.

    workspace : addresses of the doubles and integers that `answer_pairs` works in.
    """

    def __init__(self, A: Body, E: Enclosure, workspace: tuple[int, int]):
        self.table = FacetTable(np.zeros((1, 3, 3)), E.packed)
        n_stack = WIDTH * (A.tree.depth + 2)
        self.poses, self.rows = np.zeros((2, POSE)), np.zeros(2, dtype=PAIR_DTYPE)
        self.numbers = np.array([0, 1])
        self.stack, self.bounds = np.zeros(n_stack, dtype=np.int64), np.zeros(n_stack)
        self.header = np.zeros(HEADER, dtype=np.int64)
        buffers = self.table.coordinates, self.poses, self.numbers, self.numbers, self.rows
        self.header[:STACK_AT] = (
            code_of(answer_pairs), A.tree.address, *self.table.addresses, *map(address_of, buffers), *workspace,
        )
        self.header[STACK_AT:EXCHANGED] = address_of(self.stack), address_of(self.bounds)
        self.header.view(np.float64)[REACH_OF_MESH] = reach_of(A)


class SurfaceStates(NamedTuple):
    """n poses of a mesh and a shape.

    meets, apart : (n,) whether the mesh's surface is known to meet the shape, or to be farther apart than the margin;
    poses without either are left to another method.   maybe_inside : (n,) of surfaces apart, whether the shape may lie
    inside the mesh.   place : (n,) the triangle meeting the shape, in the order of the tree.   how : (n,) index into
    `results.HOW`.
    """

    meets: np.ndarray
    apart: np.ndarray
    maybe_inside: np.ndarray
    place: np.ndarray
    how: np.ndarray


def surface_states(
    A: Body, E: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray, margin: float = 0.0
) -> SurfaceStates:
    """Whether a mesh and a shape meet at n poses (n, 4, 4).   margin : how far they may be apart [m]."""
    n = len(X_WA)
    state, place, how = np.empty((3, n), dtype=np.int64)
    X_WA, X_WB = np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB)
    question = GapQuestion(A, E, scratch())
    curved_states_of(
        address_of(question.header), address_of(X_WA), address_of(X_WB), n, margin, address_of(state),
        address_of(place), address_of(how),
    )
    meets, maybe_inside = state == MEETS, state == MAYBE_INSIDE
    return SurfaceStates(meets, maybe_inside | (state == SURFACES_APART), maybe_inside, place, how)


class _SingleQuestion:
    """A mesh and a shape, asked pose by pose.

    exchanged : the shape stands first.   held : the kernel's arrays. All threads share the workspace: the kernel keeps
    Python's lock.
    """

    def __init__(self, A: Body, E: Enclosure, exchanged: bool):
        space = space_of_single_calls()
        question = GapQuestion(A, E, space.addresses)
        question.header[EXCHANGED] = exchanged
        self.header, self.held = question.header, (space, question, A, E)
        self._solid, self._state = A.solid, prepared_row(curved_state_single, question.header)

    def state(self, X_WA: np.ndarray, X_WB: np.ndarray, margin: float) -> int | None:
        """MEETS, NEAR, SURFACES_APART or, of solids alone, MAYBE_INSIDE; None of pairs left to another method.

        margin : how far the bodies may be apart [m].
        """
        memory = bytearray(PAIR_DTYPE.itemsize)
        if self._state(X_WA, X_WB, memory, False, margin) is None:
            return None
        state = memory[0]
        return SURFACES_APART if state == MAYBE_INSIDE and not self._solid else state


def gap_rows(A: Body, E: Enclosure, X_WA: np.ndarray, X_WB: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(rows, (n,) bool whether they are written) of a mesh and a shape, apart at n poses (n, 4, 4).

    Unwritten rows need another method.
    """
    n = len(X_WA)
    rows, is_written = np.zeros(n, dtype=PAIR_DTYPE), np.zeros(n, dtype=bool)
    X_WA, X_WB = np.ascontiguousarray(X_WA), np.ascontiguousarray(X_WB)
    question = GapQuestion(A, E, scratch())
    curved_gaps(
        address_of(question.header), address_of(X_WA), address_of(X_WB), n, address_of(rows), address_of(is_written)
    )
    return rows, is_written


def prepared_curved(A: Body, E: Enclosure, exchanged: bool) -> Prepared:
    """A mesh and a shape ready for single gaps without a limit; everything else is left to the long way.

    exchanged : the shape stands first.
    """
    single = _SingleQuestion(A, E, exchanged)
    gap = prepared_row(curved_gap_single, single.header)

    def is_outside(X_WA, X_WB) -> bool:
        """Whether the shape, whose surface the mesh's does not meet, is outside of the mesh."""
        X_WM, X_WS = (X_WB, X_WA) if exchanged else (X_WA, X_WB)
        return bool(points_in_solid(A.tree, X_WM, E.outer.points[0], X_WS)[0] == OUTSIDE)

    def distance(X_WA, X_WB, memory: bytearray, depths: bool, limit: float) -> bool | None:
        """True; None where a depth is wanted, where the bodies may meet, and of limits."""
        apart = gap(X_WA, X_WB, memory, depths, limit) if limit == math.inf else None
        if apart is False and A.solid:
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
