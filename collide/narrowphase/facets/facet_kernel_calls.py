"""Two bodies of facets at many pairs of poses: whether they share a point, and rows of results.

Kernels answer whole batches (`mesh_collide_kernel.py`, `mesh_distance_kernel.py`). Completed here, pose by pose, is
what a row may still lack: depths, the direction of bodies that all but touch, and gaps too large for boxes of floats.
Gaps are the surfaces' distance less the radii, in brackets below 2⁻⁴³ of the size. Overlaps are minus the length of a
translation that is proven to separate the bodies (`separating_translation.py`); how much shorter another may be is not
known, so the bracket reaches up to 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from collide.base.free_threads import workspace_under_lock
from collide.kernels import address_of, code_of
from collide.kernels.prepared import prepared_boolean, prepared_row
from collide.lowering.facet_bodies import Body, hull_of, reach_of
from collide.mesh.bvh_slabs import make_slabs
from collide.narrowphase.bounds import PROMISE_STORED
from collide.narrowphase.convex_batches import convex_rows
from collide.narrowphase.convex_kernel_calls import number_of_poses
from collide.narrowphase.facets import surface_collision, surface_distance, winding_numbers
from collide.narrowphase.facets.ball_depths import ball_depth
from collide.narrowphase.facets.exact_triangles import decide_exactly
from collide.narrowphase.facets.facet_queries import (
    HEAP,
    Workspace,
    not_invertible,
    stack_of,
    surface_distances,
    workspace,
)
from collide.narrowphase.facets.mesh_collide_kernel import (
    APART,
    NO_POSE,
    RADIUS_A,
    RADIUS_B,
    cull_poses,
    meet_poses,
    meet_single,
)
from collide.narrowphase.facets.mesh_distance_kernel import (
    FARTHEST,
    LEFT_OPEN,
    NEARLY_TOUCH,
    PROMISE,
    RADII_MEET,
    ROW_NO_POSE,
    TOO_FAR,
    gap_poses,
    gap_single,
)
from collide.narrowphase.facets.separating_translation import separating_translation, translation_to, write_depth
from collide.narrowphase.prepared_pairs import Prepared
from collide.results import FORMULA, PAIR_DTYPE, UNDECIDED, flipped
from collide.transforms import as_poses

#: Points of parts, more than which keep single calls from holding Python's lock.
_MAX_POINTS = 64


class Hits(NamedTuple):
    """What is known of two bodies without their radii, at n poses.

    core : (n,) bool, whether facets or insides meet.
    inside : (n, 3) a point of the world in both bodies, NaN unless a part of one lies inside the other, surfaces apart.
    """

    core: np.ndarray
    inside: np.ndarray


def core_hits(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> Hits:
    """Exactly, for poses (n, 4, 4) or (1, 4, 4), whether two bodies without their radii share a point.

    check : as in `states`.
    """
    inside = np.full((number_of_poses(X_WA, X_WB), 3), np.nan)
    return Hits(FacetPair(A, B, exchanged=False).states(X_WA, X_WB, check=check, inside=inside)[0] != APART, inside)


def balls_farther(
    numbers_a: np.ndarray,
    numbers_b: np.ndarray,
    X_WA: np.ndarray,
    X_WB: np.ndarray,
    margin: float,
    *,
    check: bool = False,
) -> np.ndarray:
    """(n,) bool: whether balls around two bodies are certainly farther apart than a margin [m].

    numbers_a, numbers_b : (7,) as of a `MeshTree`.   poses, check : as of `states`. Raises InvalidPose.
    """
    out = np.zeros(number_of_poses(X_WA, X_WB), dtype=np.uint8)

    def ask_from(first: int, check: bool) -> int:
        return cull_poses(
            address_of(numbers_a), address_of(X_WA), step_of(X_WA), address_of(numbers_b), address_of(X_WB),
            step_of(X_WB), first, len(out), check, margin, address_of(out),
        )

    _ask_all(ask_from, len(out), X_WA, X_WB, check, lambda k: out[k] == NO_POSE)
    return out == APART


def states(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool = False) -> np.ndarray:
    """(n,) APART, HIT or OPEN for poses (n, 4, 4) or (1, 4, 4): rounding leaves open only bodies swept by balls.

    check : refuse matrices that are no rotation. Raises InvalidPose.
    """
    return pair_of(A, B).states(X_WA, X_WB, check=check)[0]


def hits(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(n,) bool: False only where the bodies are proven apart."""
    return states(A, B, X_WA, X_WB) != APART


class FacetPair:
    """Two bodies of facets for questions about many poses; the kernels' header is written once a thread.

    A, B : in the order in which kernels work on bodies.   exchanged : callers name B first, and its poses.
    """

    __slots__ = ("A", "B", "_has_slabs", "_laid_out", "_n_stack", "exchanged")

    def __init__(self, A: Body, B: Body, *, exchanged: bool):
        self.A, self.B, self.exchanged = A, B, exchanged
        self._n_stack = stack_of(A.tree, B.tree)
        self._laid_out: tuple[Any, Any] = None, None
        self._has_slabs = False

    def need_slabs(self) -> None:
        """Distances look at slabs around the boxes' facets, made at most once."""
        if not self._has_slabs:
            self.A.tree.need_slabs(make_slabs)
            self.B.tree.need_slabs(make_slabs)
            self._has_slabs = True

    def header(self) -> np.ndarray:
        """What kernels read first, with this thread's workspace."""
        space = workspace(self._n_stack)
        laid_out = self._laid_out  # read once: other threads put their own there
        if laid_out[0] is not space:
            laid_out = self._laid_out = space, pair_header(self.A, self.B, self.exchanged, space)
        return laid_out[1]

    def states(
        self, X_WA: np.ndarray, X_WB: np.ndarray, *, check: bool, inside: np.ndarray | None = None
    ) -> tuple[np.ndarray, bool]:
        """((n,) uint8 APART, HIT or OPEN, whether some are OPEN); arguments as of `states`.

        inside : as of `Hits`, of bodies without radii.
        """
        n = number_of_poses(X_WA, X_WB)
        out = np.zeros(n + 1, dtype=np.uint8)
        if self.A.radius + self.B.radius > 0.0 and inside is None:
            self.need_slabs()
        header = self.header()

        def ask_from(first: int, check: bool) -> int:
            return meet_poses(
                address_of(header), address_of(X_WA), step_of(X_WA), address_of(X_WB), step_of(X_WB), first, n, check,
                inside is not None, 0 if inside is None else address_of(inside), address_of(out),
            )

        _ask_all(ask_from, n, X_WA, X_WB, check, lambda k: out[k] == NO_POSE)
        return out[:n], bool(out[n])

    def rows(
        self, rows: np.ndarray, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool, check: bool,
        hulls: np.ndarray | None = None,
    ) -> np.ndarray:
        """(n + 1,) uint8: what rows lack (`gap_poses`), and last what any row lacks, having written them.

        rows : (n,) zeroed.   hulls : their hulls' rows, for directions.
        """
        n = len(rows)
        lacks = np.zeros(n + 1, dtype=np.uint8)
        self.need_slabs()
        header, reach = self.header(), _reach_of_search(self.A, self.B, limit)

        def ask_from(first: int, check: bool) -> int:
            return gap_poses(
                address_of(header), address_of(X_WA), step_of(X_WA), address_of(X_WB), step_of(X_WB), first, n, check,
                limit, reach, depths, 0 if hulls is None else address_of(hulls), address_of(rows), address_of(lacks),
            )

        _ask_all(ask_from, n, X_WA, X_WB, check, lambda k: lacks[k] == ROW_NO_POSE)
        return lacks


def pair_of(A: Body, B: Body) -> FacetPair:
    """Two bodies as asked about, worked on in the order of their contents."""
    exchanged = B.key < A.key
    return FacetPair(B, A, exchanged=True) if exchanged else FacetPair(A, B, exchanged=False)


def _ask_all(
    ask_from: Callable[[int, bool], int], n: int, X_WA, X_WB, check: bool, is_no_pose: Callable[[int], bool]
) -> None:
    """Have a kernel answer n poses. The kernel stops at an invalid or singular matrix: raises InvalidPose."""
    done = ask_from(0, check)
    while done < n:
        if not is_no_pose(done):
            raise not_invertible(done)
        for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")):
            as_poses(X, name, check=check)
        if not check:
            raise AssertionError("a pose that is none")
        check = False  # a pose after all, on the brink of the tolerance
        done = ask_from(done, check)


def step_of(X: np.ndarray) -> int:
    """Doubles from each pose to the next: 16, or 0 for a single pose that goes with all of the other body's."""
    return 16 * (len(X) > 1)


def pair_header(A: Body, B: Body, exchanged: bool, space: Workspace) -> np.ndarray:
    """What the kernels of `mesh_collide_kernel.py` read first; the caller keeps bodies and workspace alive."""
    same_tree = A.tree.content == B.tree.content
    header = np.array(
        [
            A.tree.address, B.tree.address, A.solid, B.solid, address_of(A.points), address_of(B.points), len(A.points),
            len(B.points), 0, 0, same_tree, same_tree and A.key == B.key, exchanged,
            code_of(surface_collision.walk_surfaces), code_of(winding_numbers.points_inside),
            code_of(surface_distance.near_surfaces), code_of(decide_exactly), *space.addresses[:4],
            space.heap_address, HEAP, space.scratch_address,
        ],
        dtype=np.int64,
    )
    header.view(np.float64)[RADIUS_A : RADIUS_B + 1] = A.radius, B.radius
    return header


# --- rows ---------------------------------------------------------------------------------------


def body_rows(
    A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool, check: bool = False,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """Rows (PAIR_DTYPE) for poses (n, 4, 4) or (1, 4, 4); part_a and part_b are facets, 0 where none decided.

    limit, depths : as in `distance`.   check : as in `states`.   out : rows to fill, zeroed. Raises InvalidPose.
    """
    rows = np.zeros(number_of_poses(X_WA, X_WB), dtype=PAIR_DTYPE) if out is None else out
    write_rows(rows, pair_of(A, B), X_WA, X_WB, limit=limit, depths=depths, check=check)
    return rows


def write_rows(
    rows: np.ndarray, pair: FacetPair, X_WA: np.ndarray, X_WB: np.ndarray, *, limit: float, depths: bool, check: bool
) -> bool:
    """`body_rows` of a pair into rows, zeroed; whether some may be undecided."""
    lacks = pair.rows(rows, X_WA, X_WB, limit=limit, depths=depths, check=check)
    if not lacks[-1]:
        return False
    lacks = lacks[:-1]
    A, B = (pair.B, pair.A) if pair.exchanged else (pair.A, pair.B)
    near = np.flatnonzero(lacks & NEARLY_TOUCH)
    if len(near):
        XA, XB = _poses_of(X_WA, near), _poses_of(X_WB, near)
        again, hulls = np.zeros(len(near), dtype=PAIR_DTYPE), hull_rows(A, B, XA, XB, math.inf)
        lacks[near] = pair.rows(again, XA, XB, limit=limit, depths=depths, check=False, hulls=hulls)[:-1]
        rows[near] = again
    for k in np.flatnonzero(lacks & ~np.uint8(LEFT_OPEN)).tolist():
        XA, XB = (X[k if len(X) > 1 else 0] for X in (X_WA, X_WB))
        rows[k] = _completed(A, B, XA, XB, rows[k : k + 1], int(lacks[k]), limit)
    return True


def _poses_of(X: np.ndarray, some: np.ndarray) -> np.ndarray:
    return X if len(X) == 1 else X[some]


def _reach_of_search(A: Body, B: Body, limit: float) -> float:
    """How far apart cores may be and bodies no farther than the limit, rounded upwards [m]."""
    return math.nextafter(math.nextafter(limit, math.inf) + (A.radius + B.radius), math.inf)


def farthest_gap(A: Body, B: Body) -> float:
    """The largest gap [m] that the boxes of two trees measure."""
    return FARTHEST * math.ldexp(1.0, min(A.tree.exponent, B.tree.exponent))


def hull_rows(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray, limit: float) -> np.ndarray:
    """Rows of the bodies' hulls."""
    return convex_rows(hull_of(A), hull_of(B), X_WA, X_WB, limit=limit)


def _completed(A: Body, B: Body, X_WA, X_WB, row: np.ndarray, lacks: int, limit: float) -> np.ndarray:
    """The completed row (1,) of a pair of poses (4, 4), worked on in the kernel's order of the bodies."""
    if B.key < A.key or (B.key == A.key and X_WA[:3].tolist() > X_WB[:3].tolist()):
        return flipped(_completed_in_order(B, A, X_WB, X_WA, flipped(row), lacks, limit))
    return _completed_in_order(A, B, X_WA, X_WB, row.copy(), lacks, limit)


def _completed_in_order(A: Body, B: Body, X_WA, X_WB, row: np.ndarray, lacks: int, limit: float) -> np.ndarray:
    """A far gap, or a row of bodies that meet, with a depth."""
    if lacks & TOO_FAR:
        return _far_gap(A, B, X_WA, X_WB, limit)
    point = 0.5 * (row["point_a"][0] + row["point_b"][0])
    steps: list[np.ndarray] = []
    if lacks & RADII_MEET:
        lower = surface_distances(A.tree, B.tree, X_WA, X_WB, _reach_of_search(A, B, limit)).lower[0]
        overlap = (A.radius + B.radius - float(lower)) * (1 + 1e-12) + 1e-300
        steps = [overlap * row["normal"][0]] if overlap > 0.0 else []
    row["certified"] = decided = row["how"][0] != UNDECIDED
    row["upper"] = 0.0 if decided else max(float(row["upper"][0]), 0.0)
    row["beyond"] = False
    ball = ball_depth(A, B, X_WA, X_WB) if decided else None
    if ball is not None:
        row["upper"] = -ball.least
        moved = _moved(X_WB, ball.step)
        if not hits(A, B, X_WA[None], moved[None])[0]:
            translation = translation_to(moved, X_WB)
            write_depth(row, point, translation._replace(length=min(ball.length, translation.length)))
            row["certified"] = translation.bound - ball.least <= PROMISE_STORED * _size_of(A, B, X_WA, X_WB)
            return row
    hulls = hull_rows(A, B, X_WA[None], X_WB[None], math.inf)[0]
    write_depth(row, point, separating_translation(A, B, X_WA, X_WB, hulls, steps, hits))
    return row


def _moved(X: np.ndarray, step: np.ndarray) -> np.ndarray:
    moved = X.copy()
    moved[:3, 3] += step
    return moved


def _size_of(A: Body, B: Body, X_WA: np.ndarray, X_WB: np.ndarray) -> float:
    """How large a pair of bodies is [m]."""
    x, y, z = X_WB[:3, 3] - X_WA[:3, 3]
    return (reach_of(A) + reach_of(B)) + math.sqrt(x * x + y * y + z * z)


def _far_gap(A: Body, B: Body, X_WA, X_WB, limit: float) -> np.ndarray:
    """The row of bodies too far apart for boxes of floats: the distance of their hulls, and of one point of each."""
    row = hull_rows(A, B, X_WA[None], X_WB[None], limit)
    row["count"], row["part_a"], row["part_b"] = 0, 0, 0
    row["vertices_a"] = row["vertices_b"] = -1
    if not row["beyond"][0]:
        p, q = (X[:3, 3] + (X[:3, :3] * body.points[0]).sum(axis=1) for body, X in ((A, X_WA), (B, X_WB)))
        length = float(np.sqrt(np.square(q - p).sum()))
        upper = length * (1 + 2.0**-45) - A.radius - B.radius
        row["upper"] = max(upper, float(row["upper"][0]))
        if row["lower"][0] <= 0.0:  # the hulls meet, and these points are all that is known
            row["normal"] = (q - p) / length if length > 0.0 else (0.0, 0.0, 1.0)
            row["lower"], row["distance"] = 0.0, row["upper"]
            row["point_a"], row["point_b"] = p + A.radius * row["normal"], q - B.radius * row["normal"]
        size = _size_of(A, B, X_WA, X_WB)
        row["certified"] = bool(row["lower"][0] > 0.0 and row["upper"][0] <= row["lower"][0] + PROMISE * size)
    row["hit"], row["how"] = False, FORMULA
    return row


# --- single calls -------------------------------------------------------------------------------


def serves_single_calls(A: Body, B: Body) -> bool:
    """Whether single calls are short enough to keep Python's lock."""
    return max(len(A.points) if B.solid else 0, len(B.points) if A.solid else 0) <= _MAX_POINTS


def workspace_of_single_calls(A: Body, B: Body) -> Workspace:
    """The workspace of all single calls, deep enough for these bodies: a power of two, in entries."""
    return _workspace_of_depth(1 << max(9, (stack_of(A.tree, B.tree) - 1).bit_length()))


@workspace_under_lock
def _workspace_of_depth(n_stack: int) -> Workspace:
    return Workspace(n_stack)


def prepared_facets(A: Body, B: Body) -> Prepared:
    """Two bodies ready for one call at a time: booleans, and distances without a limit."""
    pair = pair_of(A, B)
    A, B = pair.A, pair.B
    space = workspace_of_single_calls(A, B)
    if A.radius + B.radius > 0.0:
        pair.need_slabs()
    header = pair_header(A, B, pair.exchanged, space)
    gap = prepared_row(gap_single, header)

    def distance(X_WA, X_WB, memory: bytearray, depths: bool, limit: float) -> bool | None:
        if limit < math.inf:
            return None
        pair.need_slabs()
        return gap(X_WA, X_WB, memory, depths, limit)

    # Kernels use the bodies' and the workspace's buffers; bodies hold their shapes weakly.
    return Prepared(collide=prepared_boolean(meet_single, header), distance=distance, held=(A, B, space))
