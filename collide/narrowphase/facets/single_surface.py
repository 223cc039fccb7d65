"""The boolean of two bodies of facets at one pair of poses, from matrices to the answer inside one kernel.

What `narrowphase/facets/mesh_hits.py` does for batches: surfaces first, then a point of every part of one body in the other. Python
and numpy take fifty times as long over one pair as this does over two bodies that are far apart. Kernels are called
where they were compiled.
"""

from __future__ import annotations

import math

import numpy as np

from collide.kernels import address_of, code_of, entry, kernel, native_call, prepared, view_f64, view_i64
from collide.mesh.bvh import WIDTH, MeshTree
from collide.mesh.bvh_slabs import make_slabs
from collide.narrowphase.facets import surface_collision as surfaces
from collide.narrowphase.facets import surface_distance as distances
from collide.narrowphase.facets import winding_numbers as inside
from collide.narrowphase.facets.exact_triangles import decide_exactly
from collide.narrowphase.facets.facet_queries import FARTHER, HEAP, Workspace
from collide.narrowphase.facets.surface_collision import DONE
from collide.narrowphase.facets.winding_numbers import OUTSIDE, UNDECIDED
from collide.narrowphase.pose_batches import is_pose

_walk = native_call(surfaces.SIGNATURE)
_ask_inside = native_call(inside.SIGNATURE)
_measure = native_call(distances.SIGNATURE)

# Header, integers: trees and kernels, both sides' solids and points, buffers.
(
    TREE_A, TREE_B, ALIKE, EXCHANGED, WALK_AT, INSIDE_AT, SOLID_A, SOLID_B, POINTS_A, POINTS_B, MANY_A, MANY_B, BALLS_AT,
    KEYS_AT, MARKS_AT, STACK_AT, N_STACK, DOUBLES_AT, INTEGERS_AT, DECIDE, SWEPT,
    DISTANCES_AT, ROOM_AT, HEAP_AT, N_HEAP,
) = range(25)  # fmt: skip
HEADER = 25
# Doubles of the room for distances: the sum of the radii, how far to look, the result.
_RADIUS, _LIMIT, _RESULT = range(3)
#: Room for facet pairs: what a walk that stops at the first asks for.
_KEYS = 128
#: More points than this are left to a batch.
_MOST_POINTS = 64


@kernel
def _checked(X):
    return X[12] == 0.0 and X[13] == 0.0 and X[14] == 0.0 and X[15] == 1.0 and is_pose(X, True)


@kernel
def _may_hold(X, Y, ball, point):
    """Whether a point of the body at Y may be within the ball (centre, reach) of the one at X, both rotations."""
    square = 0.0
    size = 0.0
    for i in range(3):
        centre = X[4 * i + 3]
        placed = Y[4 * i + 3]
        size += abs(centre) + abs(placed)
        for j in range(3):
            centre += X[4 * i + j] * ball[j]
            placed += Y[4 * i + j] * point[j]
            size += abs(X[4 * i + j] * ball[j]) + abs(Y[4 * i + j] * point[j])
        square += (placed - centre) * (placed - centre)
    return math.sqrt(square) <= 1.001 * ball[3] + 1e-9 * size


@kernel
def _part_inside(header, tree_at, solid, ball, X_at, points_at, many, Y_at):
    """1 where a point of the other body lies in this one, 0 where none does, −1 where that is left open."""
    if header[solid] == 0:
        return 0
    X = view_f64(X_at, 16)
    Y = view_f64(Y_at, 16)
    marks_at = header[MARKS_AT]
    marks = view_i64(marks_at, 8)
    for k in range(header[many]):
        point_at = header[points_at] + 24 * k
        if not _may_hold(X, Y, view_f64(header[BALLS_AT] + 32 * ball, 4), view_f64(point_at, 3)):
            continue
        for i in range(8):
            marks[i] = 0
        _ask_inside(
            header[INSIDE_AT],
            (
                header[tree_at], X_at, 0, Y_at, 0, point_at, 0, 1, marks_at, marks_at + 8, header[STACK_AT], header[N_STACK],
                header[DOUBLES_AT], header[INTEGERS_AT], header[DECIDE],
            ),
        )  # fmt: skip
        if marks[0] >= UNDECIDED:
            return -1
        if marks[0] != OUTSIDE:
            return 1
    return 0


@kernel
def _posed(header, XA_at, XB_at):
    """Addresses of both matrices, the bodies in the order of their contents; 0 where one is no pose."""
    if not _checked(view_f64(XA_at, 16)) or not _checked(view_f64(XB_at, 16)):
        return 0, 0
    if header[EXCHANGED] != 0:
        return XB_at, XA_at
    return XA_at, XB_at


@kernel
def _cores_meet(header, XA_at, XB_at):
    """1 where bodies meet without their radii, 0 where they do not, −1 where that is left open."""
    marks_at = header[MARKS_AT]
    marks = view_i64(marks_at, 8)
    for i in range(8):
        marks[i] = 0
    said = _walk(
        header[WALK_AT],
        (
            header[TREE_A], header[TREE_B], XA_at, 0, XB_at, 0, 1, header[ALIKE] != 0, True, header[KEYS_AT], _KEYS,
            marks_at + 24, marks_at + 40, marks_at, header[STACK_AT], header[N_STACK], header[DOUBLES_AT],
            header[INTEGERS_AT], header[DECIDE],
        ),
    )  # fmt: skip
    if said != DONE:
        return -1
    if marks[4] > marks[3]:
        return 1
    within = _part_inside(header, TREE_A, SOLID_A, 0, XA_at, POINTS_B, MANY_B, XB_at)
    if within == 0:
        within = _part_inside(header, TREE_B, SOLID_B, 1, XB_at, POINTS_A, MANY_A, XA_at)
    return within


@entry(prepared.BOOLEAN, nogil=False)
def meet_single(header_at, XA_at, XB_at):
    """Whether the bodies meet, 0 or 1; −1 where the long way answers, or says what is wrong.

    All threads share the workspace: this keeps Python's lock.
    """
    header = view_i64(header_at, HEADER)
    XA_at, XB_at = _posed(header, XA_at, XB_at)
    if XA_at == 0:
        return -1
    said = _cores_meet(header, XA_at, XB_at)
    if said == 0 and header[SWEPT] != 0:
        said = _swept(header, XA_at, XB_at)
    return said


@entry(prepared.ROW, nogil=False)
def near_single(header_at, XA_at, XB_at, result_at, _depths):
    """1 where the cores are apart, with the row and then the marks of `distances.near_surfaces`; else −1, as `meet_single`."""
    header = view_i64(header_at, HEADER)
    XA_at, XB_at = _posed(header, XA_at, XB_at)
    if XA_at == 0 or _cores_meet(header, XA_at, XB_at) != 0:
        return -1
    marks_at = result_at + 8 * distances.RESULT
    marks = view_i64(marks_at, distances.MARKS)
    for i in range(distances.MARKS):
        marks[i] = 0
    return _measured(header, XA_at, XB_at, math.inf, result_at, marks_at)


@kernel
def _swept(header, XA_at, XB_at):
    """1 where cores that are apart are no farther than the radii, 0 where they are, −1 where that is left open."""
    marks_at = header[MARKS_AT]
    room_at = header[ROOM_AT]
    room = view_f64(room_at, _RESULT + distances.RESULT)
    marks = view_i64(marks_at, 8)
    for i in range(8):
        marks[i] = 0
    if _measured(header, XA_at, XB_at, room[_LIMIT], room_at + 8 * _RESULT, marks_at) < 1:
        return -1
    if room[_RESULT + distances.LOWER] > room[_RADIUS]:
        return 0
    return 1 if room[_RESULT + distances.UPPER] <= room[_RADIUS] else -1


@kernel
def _measured(header, XA_at, XB_at, limit, result_at, marks_at):
    return _measure(
        header[DISTANCES_AT],
        (
            header[TREE_A], header[TREE_B], XA_at, 0, XB_at, 0, 1, header[ALIKE] != 0, limit, result_at, marks_at,
            header[STACK_AT], header[N_STACK], header[HEAP_AT], header[N_HEAP], header[DOUBLES_AT], header[INTEGERS_AT],
            header[DECIDE],
        ),
    )  # fmt: skip


class Side:
    """What a single call needs to know of a body: its tree, the points of its parts if it may be inside, a ball."""

    def __init__(self, tree: MeshTree, solid: bool, points: np.ndarray, centre: np.ndarray, reach: float):
        self.tree, self.solid, self.points, self.ball = tree, solid, points, np.array([*centre, reach])


class SingleMeshPair:
    """Two bodies prepared for one boolean at a time; the bodies in the order of their contents."""

    #: One for all single calls: their kernel keeps Python's lock. A larger one takes its place where trees are deeper.
    _work: Workspace | None = None

    def __init__(self, A: Side, B: Side, exchanged: bool, radius: float):
        n_stack = WIDTH * (A.tree.depth + B.tree.depth + 4)
        work = SingleMeshPair._work
        if work is None or work.n_stack < n_stack:
            work = SingleMeshPair._work = Workspace(max(512, n_stack))
        self._held = A, B, work
        self.exchanged = exchanged
        if radius > 0.0:
            self._prepare_distances()
        self._room = np.zeros(_RESULT + distances.RESULT)
        self._room[_RADIUS], self._room[_LIMIT] = radius, radius * FARTHER
        self._balls = np.concatenate([A.ball, B.ball])
        self._keys, self._marks = np.zeros(_KEYS, dtype=np.int64), np.zeros(8, dtype=np.int64)
        header = self._header = np.zeros(HEADER, dtype=np.int64)
        header[:] = (
            A.tree.address, B.tree.address, A.tree.content == B.tree.content, exchanged, code_of(surfaces.walk_surfaces),
            code_of(inside.points_inside), A.solid, B.solid, address_of(A.points), address_of(B.points), len(A.points),
            len(B.points), address_of(self._balls), address_of(self._keys), address_of(self._marks), *work.addresses[:4],
            code_of(decide_exactly), radius > 0.0, code_of(distances.near_surfaces), address_of(self._room),
            self._heap_address if radius > 0.0 else 0, HEAP,
        )  # fmt: skip
        self.collide = prepared.prepared_boolean(meet_single, header)
        self._near = prepared.prepared_row(near_single, header)

    @staticmethod
    def serves(A: Side, B: Side) -> bool:
        return max(len(A.points) if B.solid else 0, len(B.points) if A.solid else 0) <= _MOST_POINTS

    def _prepare_distances(self) -> None:
        A, B, work = self._held
        for side in (A, B):
            side.tree.ask_slabs(make_slabs)
        self._heap_address = work.heap_address

    def near(self, X_WA, X_WB) -> tuple[np.ndarray, np.ndarray] | None:
        """(row, marks) of `distances.near_surfaces` for poses (4, 4), the bodies in the order given here.

        None where the cores meet, or poses are none for single calls.
        """
        if self._header[HEAP_AT] == 0:
            self._prepare_distances()
            self._header[HEAP_AT] = self._heap_address
        found = np.empty(distances.RESULT + distances.MARKS)
        if self._near(X_WA, X_WB, found, True) is None:
            return None
        return found[: distances.RESULT], found[distances.RESULT :].view(np.int64)
