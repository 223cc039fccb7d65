"""The walk over two meshes of tetrahedra at a pair of poses: pieces for threads, space for pairs, and the results."""

from __future__ import annotations

import math
from contextlib import nullcontext
from typing import NamedTuple

import numpy as np

from collide.base.threads import share
from collide.kernels import address_of
from collide.mesh.bvh import WIDTH
from collide.papers.tetrahedra import overlap_kernel as kernel
from collide.papers.tetrahedra.placed_corners import PlacedCorners, map_between, place_corners
from collide.papers.tetrahedra.tet_mesh import TetMesh

#: Cells of A in a call of the kernel, and initial space for pairs a cell.
_CELLS_A_CALL, _PAIRS_A_CELL = 4096, 32
#: Of a query's size, beside the rounding of the map to the tree's frame: six sums and products and two differences.
_QUERY_ERROR = 2.0**-45


class Walked(NamedTuple):
    """Pairs (k, 2) int64, what the kernel knows of each (k,), its answers in W, and counters: nodes, boxes that meet.

    answers : (k, 5) volumes, errors and centroids; (k, 2) without centroids, (k, 0) without volumes.
    """

    pairs: np.ndarray
    status: np.ndarray
    answers: np.ndarray
    counters: list[int]


class _Piece(NamedTuple):
    pairs: np.ndarray
    status: np.ndarray
    answers: np.ndarray
    counts: np.ndarray


def walk(A: TetMesh, B: TetMesh, X_WA, X_WB, flags: int, workers: int, progress) -> Walked:
    """All pairs of cells that the kernel does not prove to share no inner point; flags as the kernel has them."""
    corners = place_corners(A.vertices, B.vertices, X_WA, X_WB)
    flags |= (kernel.PLAIN if corners.plain else 0) | (kernel.EXACT if corners.exact else 0)
    job, keep = _job(A, B, X_WA, X_WB, corners, flags)
    n = len(A.cells)
    pieces: dict[int, list[_Piece]] = {}
    done = 0
    with (progress or _silent)(f"overlaying {n} and {len(B.cells)} cells") as rename:

        def work(first: int) -> None:
            nonlocal done
            last = min(first + _CELLS_A_CALL, n)
            pieces[first] = _walk_piece(job, first, last, B.tree.depth, flags)
            done += last - first
            if rename is not None:
                rename(f"overlaying cells: {done} of {n}")

        share(range(0, n, _CELLS_A_CALL), work, workers)
    del keep
    parts = [part for first in sorted(pieces) for part in pieces[first]]
    counts = np.sum([part.counts for part in parts], axis=0)
    answers = np.concatenate([part.answers for part in parts])
    if answers.size:
        _to_world(answers, corners, X_WA)
    pairs = np.concatenate([part.pairs for part in parts]).astype(np.int64)
    return Walked(pairs, np.concatenate([part.status for part in parts]), answers, [int(counts[1]), int(counts[2])])


def _silent(label: str):
    return nullcontext()


def _job(A: TetMesh, B: TetMesh, X_WA, X_WB, corners: PlacedCorners, flags: int) -> tuple[np.ndarray, list]:
    """(the kernel's header, arrays to keep while it is used)."""
    tree = B.tree
    queries, margin = _queries(A.vertices, X_WA, X_WB, tree)
    numbers = np.array([corners.error, corners.wide_error, margin, *corners.scale])
    cells = [_oriented(mesh.cells, X, corners.local) for mesh, X in ((A, X_WA), (B, X_WB))]
    order = A.tree.ids
    job = np.zeros(kernel.JOB, dtype=np.int64)
    job[kernel.NODES_AT], job[kernel.N_NODES] = address_of(tree.nodes), len(tree.nodes)
    job[kernel.IDS_AT] = address_of(tree.ids)
    job[kernel.CELLS_A], job[kernel.N_CELLS_A] = address_of(cells[0]), len(cells[0])
    job[kernel.CELLS_B], job[kernel.N_CELLS_B] = address_of(cells[1]), len(cells[1])
    job[kernel.CORNERS_A], job[kernel.N_CORNERS_A] = address_of(corners.A), len(corners.A)
    job[kernel.CORNERS_B], job[kernel.N_CORNERS_B] = address_of(corners.B), len(corners.B)
    job[kernel.ORDER_AT], job[kernel.QUERIES_AT] = address_of(order), address_of(queries)
    job[kernel.FLAGS], job[kernel.NUMBERS_AT] = flags, address_of(numbers)
    return job, [queries, numbers, cells, order, corners, tree]


def _oriented(cells: np.ndarray, X: np.ndarray, local: bool) -> np.ndarray:
    """Cells that are positively oriented where the kernel sees them: a matrix may mirror."""
    if local or np.linalg.det(X[:3, :3]) > 0:
        return cells
    return np.ascontiguousarray(cells[:, [0, 1, 3, 2]])


def _queries(vertices: np.ndarray, X_WA, X_WB, tree) -> tuple[np.ndarray, float]:
    """(vertices (n, 3) of A in the units of B's tree, how far they may be off)."""
    if (X_WA == X_WB).all():
        matrix, shift = np.eye(3), np.zeros(3)
    else:
        matrix, shift = map_between(X_WB, X_WA)
    local = np.zeros_like(vertices)
    for k in range(3):
        local += vertices[:, k : k + 1] * matrix[:, k]
    reach = np.abs(matrix) @ np.abs(vertices).max(axis=0) + np.abs(shift) + np.abs(tree.centre)
    scale = math.ldexp(1.0, -tree.exponent)
    queries = (local + shift - tree.centre) * scale
    return np.ascontiguousarray(queries), float(reach.max()) * scale * _QUERY_ERROR + 1e-30


def _walk_piece(job: np.ndarray, first: int, last: int, depth: int, flags: int) -> list[_Piece]:
    """The pairs of cells first … last − 1 of A, in the order of its tree."""
    stack = np.empty(WIDTH * (depth + 2), dtype=np.int32)
    work = np.zeros(kernel.WORK)
    capacity = _PAIRS_A_CELL * (last - first)
    width = answers_width(flags)
    pieces = []
    while first < last:
        pairs, status = np.empty((capacity, 2), dtype=np.int32), np.empty(capacity, dtype=np.uint8)
        answers = np.empty((capacity if width else 1, kernel.ANSWER))
        counts = np.zeros(3, dtype=np.int64)
        stopped = kernel.overlap_cells(
            address_of(job), first, last, address_of(pairs), address_of(status), address_of(answers), capacity,
            address_of(stack), len(stack), address_of(work), address_of(counts),
        )
        n = int(counts[0])
        kept_answers = answers[:n, :width].copy() if width else np.empty((n, 0))
        pieces.append(_Piece(pairs[:n].copy(), status[:n].copy(), kept_answers, counts))
        if stopped == first:
            capacity *= 4
        first = stopped
    return pieces


def answers_width(flags: int) -> int:
    """Columns of `Walked.answers`."""
    if flags & kernel.CENTROIDS:
        return kernel.ANSWER
    return 2 if flags & kernel.VOLUMES else 0


def _to_world(answers: np.ndarray, corners: PlacedCorners, X_WA) -> None:
    """Volumes and centroids from the kernel's frame and units to W's."""
    answers[:, :2] = np.ldexp(answers[:, :2], 3 * corners.exponent)
    centroids = np.ldexp(answers[:, 2:], corners.exponent)
    if corners.local and centroids.size:
        centroids = centroids @ X_WA[:3, :3].T + X_WA[:3, 3]
    answers[:, 2:] = centroids
