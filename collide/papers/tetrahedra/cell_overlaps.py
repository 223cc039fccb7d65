"""Pairs of tetrahedra of two meshes whose interiors meet, and the volumes that they share."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.threads import check_threads
from collide.errors import InvalidArgument, InvalidPose
from collide.numerics.exact_points import on_one_grid, placed, rounded
from collide.papers.tetrahedra import exact_cells, walk_cells
from collide.papers.tetrahedra.overlap_kernel import CENTROIDS, MEET, VOLUME_OPEN, VOLUMES, WITH_ITSELF
from collide.papers.tetrahedra.placed_corners import determinant_of
from collide.papers.tetrahedra.tet_mesh import TetMesh
from collide.transforms import as_poses

if TYPE_CHECKING:
    from collections.abc import Callable


class CellOverlaps(NamedTuple):
    """Pairs of cells of two tetrahedral meshes whose interiors meet, at N pairs of poses.

    pairs : (k, 2) int64 cell numbers of A and of B; the pairs of a pose stand together, sorted.
    starts : (N + 1,) int64: the pairs of pose i are rows starts[i] to starts[i + 1].
    volumes : (k,) [m³] of each pair's common part; ``None`` unless asked for.
    volume_errors : (k,) [m³] proven bounds of |volume − truth|: at most half a unit in the last place of volumes
        rounded once: all volumes unless ``settle=False``. ``None`` unless asked for.
    centroids : (k, 3) in W [m] of each pair's common part, off by at most 4 units in the last place of the largest
        coordinate of its cells in W; ``None`` unless asked for.
    counters : (N, 4) int64: nodes compared with the box of a cell, pairs of cells whose boxes meet, pairs decided in
        integers, volumes worked out in fractions.
    """

    pairs: np.ndarray
    starts: np.ndarray
    volumes: np.ndarray | None
    volume_errors: np.ndarray | None
    centroids: np.ndarray | None
    counters: np.ndarray


def overlapping_cells(
    A: TetMesh, B: TetMesh, X_WA, X_WB, *, volumes: bool = False, centroids: bool = False, settle: bool = True,
    threads: int = 1, progress: Callable | None = None, check_poses: bool = True,
) -> CellOverlaps:
    """Overlay of two tetrahedral meshes: every pair of cells whose interiors meet, and their common volume.

    Parameters
    ----------
    A, B : TetMesh
        The meshes.
    X_WA, X_WB : (4, 4) poses in the world W [m], or batches (N, 4, 4)
        A single pose goes with every pose of the other's batch. Entries are taken as exact.
    volumes : bool
        Also the volume of each pair's common part.
    centroids : bool
        Also its centroid, and the volume.
    settle : bool
        ``False`` leaves volumes with an error bound above their last place, where cells overlap
        by less than some 1e-12 of the smaller cell. ``True`` works these volumes out in fractions, some milliseconds
        each.
    threads : int
        At most so many; answers are the same bits.
    progress : callable, optional
        Called with a label, returns a context manager, as `collide.reports.progress.Progress` does.
    check_poses : bool
        Refuse matrices other than rotations.

    Returns
    -------
    CellOverlaps
        Touching cells, in a face, an edge or a corner, are no pair. Pairs are decided exactly, and volumes
        are exact before their rounding. Swapped arguments give the same pairs, swapped, and the same bits.

    Raises
    ------
    InvalidArgument
        For anything but two TetMesh, and batches of different lengths.
    InvalidPose
        For matrices other than poses, and with ``check_poses=False`` for matrices without an inverse.

    Notes
    -----
    The pieces of a cell of A within a mesh B that fills the space around the cell add up to the cell: transfer of
    fields (J. Erickson, "Local polyhedra and geometric graphs" (2005), section 3.3; examples/27_field_transfer.py). O(n
    log n + k) for local meshes; about 1 µs a pair, 4 µs with volumes. Doubles with error bounds settle most pairs,
    double-doubles with a proven bound the volumes, integers the rest (docs/overlays.md).
    """
    for name, mesh in (("A", A), ("B", B)):
        if not isinstance(mesh, TetMesh):
            raise InvalidArgument(
                f"overlapping_cells: {name} must be a TetMesh, got {type(mesh).__name__}; surfaces have collide.overlay"
            )
    X_WA, X_WB = (as_poses(X, name, check=check_poses) for X, name in ((X_WA, "X_WA"), (X_WB, "X_WB")))
    n = checks.matched_count("overlapping_cells", X_WA=len(X_WA), X_WB=len(X_WB))
    X_WA, X_WB = (np.broadcast_to(X, (n, 4, 4)) for X in (X_WA, X_WB))
    for name, poses in (("X_WA", X_WA), ("X_WB", X_WB)):
        if not check_poses and any(determinant_of(X) == 0 for X in poses):
            raise InvalidPose(f"overlapping_cells: {name} has a matrix without an inverse: its cells have no volume")
    volumes, centroids, settle = (
        checks.true_or_false(f"overlapping_cells: {name}", value)
        for name, value in (("volumes", volumes), ("centroids", centroids), ("settle", settle))
    )
    flags = (VOLUMES if volumes or centroids else 0) | (CENTROIDS if centroids else 0)
    workers = check_threads(threads)
    parts = [_at_pose(A, B, X, Y, flags, settle, workers, progress) for X, Y in zip(X_WA, X_WB)]
    return _joined(parts, flags)


def self_overlapping_cells(mesh: TetMesh, *, threads: int = 1, progress: Callable | None = None) -> np.ndarray:
    """Pairs of cells of a tetrahedral mesh whose interiors meet: an empty list for a mesh without overlap.

    Parameters
    ----------
    mesh : TetMesh
        The mesh.
    threads : int
        At most so many.
    progress : callable, optional
        As of `overlapping_cells`.

    Returns
    -------
    (k, 2) int64
        Cell numbers, the smaller first, sorted; decided exactly.

    Raises
    ------
    InvalidArgument
        For anything but a TetMesh.

    Notes
    -----
    O(n log n + k) for local meshes, about 15 µs a cell.
    """
    if not isinstance(mesh, TetMesh):
        raise InvalidArgument(
            f"self_overlapping_cells: mesh must be a TetMesh, got {checks.brief(mesh)}; surfaces have self_collisions"
        )
    eye = np.eye(4)
    return _at_pose(mesh, mesh, eye, eye, WITH_ITSELF, True, check_threads(threads), progress).pairs


class _Rows(NamedTuple):
    """The answer at one pair of poses: pairs; volumes, errors and centroids as asked for; and counters."""

    pairs: np.ndarray
    answers: np.ndarray
    counters: list[int]


def _at_pose(A, B, X_WA, X_WB, flags: int, settle: bool, workers: int, progress) -> _Rows:
    walked = walk_cells.walk(A, B, X_WA, X_WB, flags, workers, progress)
    pairs, status, answers = walked.pairs, walked.status, walked.answers
    undecided = ~np.isin(status, (MEET, VOLUME_OPEN))
    unsettled = undecided | ((status == VOLUME_OPEN) if settle else False)
    holds = np.ones(len(pairs), dtype=bool)
    for row in np.flatnonzero(unsettled).tolist():
        a, b = pairs[row].tolist()
        shared = exact_overlap(A, B, X_WA, X_WB, a, b)
        holds[row] = shared.centroid is not None
        if holds[row]:
            answers[row] = _rounded_once(shared)[: answers.shape[1]]
    order = np.argsort(pairs[:, 0] * len(B.cells) + pairs[:, 1])
    order = order[holds[order]]
    counters = [*walked.counters, int(undecided.sum()), int(unsettled.sum())]
    return _Rows(pairs[order], answers[order], counters)


def exact_overlap(A: TetMesh, B: TetMesh, X_WA, X_WB, a: int, b: int) -> exact_cells.Shared:
    """What cell a of A and cell b of B share at poses (4, 4), as fractions in W: volume [m³] and centroid [m]."""
    groups = []
    for X, mesh, cell in ((X_WA, A, a), (X_WB, B, b)):
        points, grid = placed(X, mesh.vertices[mesh.cells[cell]])
        if exact_cells.determinant(points) < 0:  # a matrix that mirrors
            points[2], points[3] = points[3], points[2]
        groups.append((points, grid))
    (cell_a, cell_b), grid = on_one_grid(*groups)
    shared = exact_cells.shared_part(cell_a, cell_b)
    unit = Fraction(2) ** grid
    centroid = shared.centroid and tuple(x * unit for x in shared.centroid)
    return exact_cells.Shared(shared.volume * unit**3, centroid)  # type: ignore[arg-type]


def _rounded_once(shared: exact_cells.Shared) -> list[float]:
    """Volume, its rounding, and centroid."""
    assert shared.centroid is not None
    volume = rounded(shared.volume)[0]
    off = rounded(abs(Fraction(volume) - shared.volume))[2]
    return [volume, off, *(rounded(x)[0] for x in shared.centroid)]


def _joined(parts: list[_Rows], flags: int) -> CellOverlaps:
    starts = np.concatenate([[0], np.cumsum([len(part.pairs) for part in parts])]).astype(np.int64)
    pairs = np.concatenate([np.zeros((0, 2), np.int64), *(part.pairs for part in parts)])
    counters = np.array([part.counters for part in parts], dtype=np.int64).reshape(-1, 4)
    nothing = np.zeros((0, walk_cells.answers_width(flags)))
    answers = np.concatenate([nothing, *(part.answers for part in parts)])
    volumes = answers[:, 0].copy() if flags & VOLUMES else None
    errors = answers[:, 1].copy() if flags & VOLUMES else None
    return CellOverlaps(pairs, starts, volumes, errors, answers[:, 2:].copy() if flags & CENTROIDS else None, counters)
