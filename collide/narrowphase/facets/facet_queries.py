"""Questions about two mesh trees from Python: poses in, arrays out.

Bodies are taken in the order of their contents, so swapped questions are worked out on the same numbers; of equal
bodies the kernels look at the poses. Every thread keeps its workspaces: making them anew, and asking numpy for their
addresses, takes longer than most booleans.
"""

from __future__ import annotations

import math
import threading
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidPose
from collide.kernels import address_of, code_of
from collide.mesh.bvh import RADIUS, WIDTH, MeshTree
from collide.mesh.bvh_slabs import make_slabs
from collide.narrowphase.facets import facets_within as near_pairs
from collide.narrowphase.facets import ray_surface as rays
from collide.narrowphase.facets import self_collision as self_contact
from collide.narrowphase.facets import surface_collision as surfaces
from collide.narrowphase.facets import surface_distance as distances
from collide.narrowphase.facets import winding_numbers as inside
from collide.narrowphase.facets.exact_triangles import INTEGERS, decide_exactly
from collide.narrowphase.facets.mesh_collide_kernel import SCRATCH
from collide.narrowphase.facets.surface_collision import (
    COUNTERS,
    DONE,
    FULL,
    N_PAIRS,
    PROGRESS,
    SINGULAR,
    walk_surfaces,
)

#: Pairs of boxes that wait in order; beyond them the walk of distances goes depth first.
HEAP = 1 << 14


class SurfacePairs(NamedTuple):
    """Pairs of facets that meet, at N pairs of poses.

    pairs : (k, 2) int64 facet numbers of A and of B, sorted pose by pose.
    starts : (N + 1,) int64, where the pairs of each pose begin and end.
    counters : (N, 3) int64: nodes compared with a box (a node holds up to eight boxes), pairs of triangles tested, and
        pairs of triangles decided exactly.
    """

    pairs: np.ndarray
    starts: np.ndarray
    counters: np.ndarray


class SurfaceDistances(NamedTuple):
    """Distances of two surfaces at N pairs of poses [m].

    distance, lower, upper : (N,) with lower ≤ truth ≤ upper proven; 0 where they meet; the limit, with an infinite
        upper, where everything is proven farther.
    point_a, point_b, normal : (N, 3) nearest points in the world and the unit vector from A's to B's; a common point
        and 0 where they meet.
    facets : (N, 2) int64 facet numbers of A and of B; −1 where everything is proven farther than the limit.
    meets : (N,) bool, decided exactly.
    counters : (N, 3) int64: nodes compared with a box, pairs of triangles, of them decided exactly.
    """

    distance: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    normal: np.ndarray
    facets: np.ndarray
    meets: np.ndarray
    counters: np.ndarray


class NearPairs(NamedTuple):
    """Pairs of facets within a distance of each other at one pair of poses, sorted by facets.

    facets : (k, 2) int64 facet numbers of A and of B.   meets : (k,) bool, decided exactly.
    length : (k,) distance of the nearest points found, an upper bound but for rounding; 0 where they meet [m].
    lower : (k,) proven lower bound of the distance.
    point_a, point_b : (k, 3) nearest points in the world's axes seen from A's origin; the same where they meet.
    """

    facets: np.ndarray
    meets: np.ndarray
    length: np.ndarray
    lower: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray


def surfaces_meet(A: MeshTree, B: MeshTree, X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """(N,) bool: whether two surfaces share a point; parameters as for `first_hits`, which says where."""
    if B.content < A.content:
        A, B, X_WA, X_WB = B, A, X_WB, X_WA
    _, starts, _ = _hit_keys(A, B, X_WA, X_WB, True)
    return starts[1:] > starts[:-1]


def first_hits(A: MeshTree, B: MeshTree, X_WA: np.ndarray, X_WB: np.ndarray) -> SurfacePairs:
    """The first pair of meeting facets, if any, for each pair of poses: the same pair every time.

    X_WA, X_WB : (4, 4) or (N, 4, 4) float64, either or both; entries are exact reals. Surfaces only: a mesh inside
    another meets nothing. Raises InvalidPose where a matrix is singular or nearly so.
    """
    if B.content < A.content:
        keys, starts, counters = _hit_keys(B, A, X_WB, X_WA, True)
        return SurfacePairs(np.stack(np.divmod(keys, len(A.ids))[::-1], axis=1), starts, counters)
    keys, starts, counters = _hit_keys(A, B, X_WA, X_WB, True)
    return SurfacePairs(np.stack(np.divmod(keys, len(B.ids)), axis=1), starts, counters)


def all_hits(
    A: MeshTree, B: MeshTree, X_WA: np.ndarray, X_WB: np.ndarray, max_pairs: int | None = None
) -> SurfacePairs:
    """All pairs of meeting facets; parameters as for `first_hits`. No pair is lost, however many meet.

    max_pairs : at a single pair of poses stop at so many pairs, or at up to four times as many (never before some
    4,000), in the order of the trees.
    """
    if B.content < A.content:
        keys, starts, counters = _hit_keys(B, A, X_WB, X_WA, False, max_pairs)
        b, a = np.divmod(keys, len(A.ids))
        keys = a * len(B.ids) + b
    else:
        keys, starts, counters = _hit_keys(A, B, X_WA, X_WB, False, max_pairs)
    for begin, end in zip(starts[:-1].tolist(), starts[1:].tolist()):
        keys[begin:end].sort()
    return SurfacePairs(np.stack(np.divmod(keys, len(B.ids)), axis=1), starts, counters)


def _hit_keys(
    A: MeshTree, B: MeshTree, X_WA, X_WB, first_only: bool, max_pairs: int | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(keys, starts, counters) of bodies in order; a key is a facet of A times B's number of facets, and one of B."""
    X_WA, X_WB, n = matched(X_WA, X_WB)
    work = workspace(stack_of(A, B))
    keys = np.empty(64 + n if first_only else 4096, dtype=np.int64)
    progress = np.zeros(PROGRESS, dtype=np.int64)
    starts, counters = np.zeros(n + 1, dtype=np.int64), np.zeros((n, COUNTERS), dtype=np.int64)
    while True:
        status = walk_surfaces(
            A.address, B.address, address_of(X_WA), step(X_WA), address_of(X_WB), step(X_WB), n, A.content == B.content,
            first_only, address_of(keys), len(keys), address_of(starts), address_of(counters), address_of(progress),
            *work.addresses,
        )
        if status == SINGULAR:
            raise not_invertible(int(progress[0]))
        if status == FULL and max_pairs is not None and progress[N_PAIRS] >= max_pairs:
            starts[1], status = progress[N_PAIRS], DONE
        if status != FULL:
            return keys[: starts[-1]], starts, counters
        keys = np.concatenate([keys, np.empty(3 * len(keys), dtype=np.int64)])


def surface_distances(A: MeshTree, B: MeshTree, X_WA, X_WB, limit: float = np.inf) -> SurfaceDistances:
    """How far two surfaces are apart; parameters as for `first_hits`.

    limit : nothing farther than this is looked for [m].
    """
    if B.content < A.content:
        r = surface_distances(B, A, X_WB, X_WA, limit)
        return r._replace(point_a=r.point_b, point_b=r.point_a, normal=-r.normal, facets=r.facets[:, ::-1])
    for tree in (A, B):
        tree.need_slabs(make_slabs)
    X_WA, X_WB, n = matched(X_WA, X_WB)
    results, marks = _near(A, B, X_WA, X_WB, n, limit)
    # Facets that rounding leaves on either side of the limit: not found within it, nor proven beyond.
    between = np.flatnonzero((marks[:, 0] < 0) & (results[:, 1] < limit) & (limit < np.inf))
    if len(between):
        some_A, some_B = (X if X.ndim == 2 else np.ascontiguousarray(X[between]) for X in (X_WA, X_WB))
        results[between], marks[between] = _near(A, B, some_A, some_B, len(between), np.inf)
    return SurfaceDistances(
        results[:, 0], results[:, 1], results[:, 2], results[:, 3:6], results[:, 6:9], results[:, 9:12], marks[:, :2],
        marks[:, 2] != 0, marks[:, 3:],
    )


def _near(A: MeshTree, B: MeshTree, X_WA, X_WB, n: int, limit: float) -> tuple[np.ndarray, np.ndarray]:
    """(results, marks) of `distances.near_surfaces`."""
    results = np.empty((n, distances.RESULT))
    marks = np.zeros((n, distances.MARKS), dtype=np.int64)
    work = workspace(stack_of(A, B))
    done = distances.near_surfaces(
        A.address, B.address, address_of(X_WA), step(X_WA), address_of(X_WB), step(X_WB), n, A.content == B.content,
        float(limit), distances.IN_FULL, address_of(results), address_of(marks), *work.addresses[:2],
        work.heap_address, HEAP, *work.addresses[2:],
    )
    if done < n:
        raise not_invertible(done)
    return results, marks


def facets_within(
    A: MeshTree, B: MeshTree, X_WA: np.ndarray, X_WB: np.ndarray, reach: float, max_pairs: int
) -> NearPairs | None:
    """All pairs of facets at most ``reach`` [m] apart, and a few farther apart by rounding; poses (4, 4).

    max_pairs : ``None`` is returned for more pairs than about this. Raises InvalidPose where a matrix is singular.
    Costs about 0.1 µs a pair of boxes and 0.3 µs a pair listed.
    """
    X_WA, X_WB = (np.ascontiguousarray(X, dtype=np.float64) for X in (X_WA, X_WB))
    work = workspace(WIDTH * (A.depth + B.depth + 2))
    # Room for all at once: memory that nobody touches costs nothing, a second walk as much as the first.
    capacity = max(512, max_pairs)
    out = np.empty((capacity, near_pairs.NUMBERS_OF_PAIR))
    marks = np.empty((capacity, near_pairs.INTS_OF_PAIR), dtype=np.int64)
    count = near_pairs.list_near_pairs(
        A.address, B.address, address_of(X_WA), address_of(X_WB), float(reach), address_of(out), address_of(marks),
        capacity, *work.addresses, True, 0,
    )
    if count == -SINGULAR:
        raise not_invertible(0)
    if count == -FULL:
        return None
    order = np.lexsort((marks[:count, 1], marks[:count, 0]))
    out, marks = out[order], marks[order]
    return NearPairs(marks[:, :2], marks[:, 2] != 0, out[:, 0], out[:, 1], out[:, 2:5], out[:, 5:8])


def points_in_solid(A: MeshTree, X_WA, points: np.ndarray, X_WB) -> np.ndarray:
    """(N,) int64: whether points are OUTSIDE (0) of a closed surface, ON it (1) or INSIDE (2), without rounding.

    points : (3,) or (N, 3), in a frame of pose X_WB: points of the world with ``np.eye(4)``, vertices of another mesh
        with its pose. X_WA, X_WB : (4, 4) or (N, 4, 4). Inside is where the surface winds once or more: it must be
        closed, facets counter-clockwise from outside. Points on facets without area may be said to be off the surface.
        UNDECIDED (3) where every segment tried passes an edge: not met so far.
    """
    X_WA, X_WB, n = matched(X_WA, X_WB)
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.shape[-1:] != (3,) or points.ndim > 2:
        raise ValueError(f"points must be (3,) or (N, 3), not {points.shape}")
    if points.ndim == 2:
        if n not in (1, len(points)):
            raise ValueError(f"{len(points)} points for {n} poses")
        n = len(points)
    answers = np.zeros(n, dtype=np.int64)
    counters = np.zeros((n, 3), dtype=np.int64)
    work = workspace(WIDTH * (A.depth + 2))
    inside.points_inside(
        A.address, address_of(X_WA), step(X_WA), address_of(X_WB), step(X_WB), address_of(points),
        3 if points.ndim == 2 else 0, n, address_of(answers), address_of(counters), *work.addresses,
    )
    singular = np.flatnonzero(answers == inside.SINGULAR)
    if len(singular):
        raise not_invertible(int(singular[0]))
    return answers


def self_hits(tree: MeshTree) -> tuple[np.ndarray, np.ndarray]:
    """((k, 2) sorted facet pairs i < j of a surface that share more than common corners and edges, counters (3,)).

    Decided exactly on the coordinates given; corners are common where their coordinates are equal. Two facets with the
    same three corners are among the pairs.
    """
    return _self_hits(tree, 0.0, np.zeros(1, dtype=np.uint8))


def steady_facets(tree: MeshTree, margin: float) -> tuple[np.ndarray, np.ndarray]:
    """((k, 2) pairs as of `self_hits`, (n,) bool: steady facets, in the time of the pairs).

    Steady facets share nothing more with each other either when all corners are moved by no more than the margin [m]
    along each axis, equal corners alike. No facet is steady in trees with origins and for margins over 2⁻⁴⁰ of the size
    of the tree.
    """
    is_steady = np.zeros(len(tree.ids), dtype=np.uint8)
    fits = 0.0 < margin <= 2.0**-40 * min(tree.numbers[RADIUS], math.ldexp(1.0, tree.exponent))
    return _self_hits(tree, float(margin) if fits else 0.0, is_steady)[0], is_steady.view(bool)


def _self_hits(tree: MeshTree, margin: float, is_steady: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """As `self_hits`.   is_steady : out, per facet, for a margin above 0."""
    keys = np.empty(4096, dtype=np.int64)
    counters, progress = np.zeros(3, dtype=np.int64), np.zeros(2, dtype=np.int64)
    planes = np.empty(self_contact.PLANE * len(tree.ids))
    work = workspace(WIDTH * WIDTH * (tree.depth + 2))
    while True:
        status = self_contact.walk_itself(
            tree.address, address_of(keys), len(keys), address_of(counters), address_of(progress), address_of(planes),
            margin, address_of(is_steady), *work.addresses,
        )
        if status != self_contact.FULL:
            break
        keys = np.concatenate([keys, np.empty(3 * len(keys), dtype=np.int64)])
    return np.stack(np.divmod(np.sort(keys[: progress[1]]), len(tree.ids)), axis=1), counters


def facets_on_rays(A: MeshTree, X_WA, rays_T: np.ndarray, first_only: bool) -> tuple[np.ndarray, np.ndarray]:
    """(hits (k, rays.HIT), counters (N, 3): nodes, triangles, exact decisions) of N rays, each ray's together.

    X_WA : (4, 4) or (N, 4, 4).   rays_T : (N, rays.RAY) as `rays.cast_rays` takes them, t in units of T.
    first_only : only facets that may be the first of their ray, by brackets; otherwise all facets met.
    """
    X_WA = np.ascontiguousarray(X_WA, dtype=np.float64)
    n = len(rays_T)
    hits = np.empty((n + 64, rays.HIT))
    counters, progress = np.zeros((n, 3), dtype=np.int64), np.zeros(2, dtype=np.int64)
    work = workspace(WIDTH * (A.depth + 2))
    while True:
        status = rays.cast_rays(
            A.address, address_of(X_WA), step(X_WA), address_of(rays_T), n, first_only, address_of(hits), len(hits),
            address_of(counters), address_of(progress), *work.addresses,
        )
        if status == rays.SINGULAR:
            raise not_invertible(int(progress[0]))
        if status != rays.FULL:
            return hits[: progress[1]], counters
        hits = np.concatenate([hits, np.empty((3 * len(hits), rays.HIT))])


# --- poses and workspaces -----------------------------------------------------------------------


def matched(X_WA, X_WB) -> tuple[np.ndarray, np.ndarray, int]:
    """Both as C-contiguous float64, and the number of poses they make."""
    X_WA = np.ascontiguousarray(X_WA, dtype=np.float64)
    X_WB = np.ascontiguousarray(X_WB, dtype=np.float64)
    if X_WA.shape == (4, 4) and X_WB.shape == (4, 4):
        return X_WA, X_WB, 1
    for X in (X_WA, X_WB):
        if X.shape[-2:] != (4, 4) or X.ndim not in (2, 3):
            raise InvalidPose(f"poses must be (4, 4) or (N, 4, 4), not {X.shape}")
    lengths = {len(X) for X in (X_WA, X_WB) if X.ndim == 3}
    if len(lengths) > 1:
        raise InvalidPose(f"batches of different lengths: {len(X_WA)} and {len(X_WB)}")
    return X_WA, X_WB, lengths.pop()


def step(X: np.ndarray) -> int:
    """Doubles from one pose to the next."""
    return 16 if X.ndim == 3 else 0


class Workspace:
    """What kernels write on besides answers."""

    def __init__(self, n_stack: int):
        self._stack = np.empty(2 * n_stack + 32, dtype=np.int64)
        doubles = max(
            module.DOUBLES + module.FLOATS for module in (surfaces, distances, inside, near_pairs, rays, self_contact)
        )
        self._doubles = np.empty(doubles)
        self._integers = np.empty(INTEGERS, dtype=np.int64)
        self._heap = np.empty(2 * HEAP, dtype=np.int64)  # memory that nobody touches costs nothing
        self.n_stack = n_stack
        #: Stack, its length, doubles, integers, and where the exact stage stands.
        self.addresses = (
            address_of(self._stack), n_stack, address_of(self._doubles), address_of(self._integers),
            code_of(decide_exactly),
        )
        self._scratch = np.empty(SCRATCH, dtype=np.int64)
        self.heap_address, self.scratch_address = address_of(self._heap), address_of(self._scratch)


_of_thread = threading.local()


def workspace(n_stack: int) -> Workspace:
    """This thread's workspace, with room for a stack of this many entries."""
    work = getattr(_of_thread, "workspace", None)
    if work is None or work.n_stack < n_stack:
        work = _of_thread.workspace = Workspace(max(n_stack, 512))
    return work


def stack_of(A: MeshTree, B: MeshTree) -> int:
    """How many pairs of boxes may wait on the stack of a traversal of two trees."""
    return WIDTH * (A.depth + B.depth + 4)


def not_invertible(k: int) -> InvalidPose:
    """The error of a pose, number k of its batch, at which a mesh cannot be placed."""
    return InvalidPose(f"pose {k}: a matrix that is singular, nearly so, or mirrors, cannot place a mesh")
