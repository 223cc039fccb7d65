"""Boxes of configurations certified: from lowest and highest corners to one verdict each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from collide.robots.certified_edges import open_names, prove
from collide.robots.check_workspace import CheckWorkspace, MotionWorkspace
from collide.robots.checker_scene import CheckerScene
from collide.robots.motion_bounds import OPEN_INTERVAL


@dataclass(frozen=True)
class CertifiedBoxes:
    """Verdicts on boxes of configurations lo ≤ q ≤ hi: free, colliding, or open.

    Parameters
    ----------
    free : (N,) bool
        Proven: no tested pair meets at any configuration of the box.
    configuration : (N, dof) float64
        A configuration of the box that collides [rad or m]; NaN where none was met.
    share : (N,) float64
        Share of the box's volume that is proven free, at least; 1.0 where all is proven, 0.0 where the box collides.
    open_box : (k,) int64
        For each open cell the number of its box.
    open_lo, open_hi : (k, dof) float64
        Lowest and highest corners of the open cells [rad or m].
    open_names : list of (str, str)
        For each open cell two bodies not proven apart.
    n_checked : int
        Configurations asked.
    """

    free: np.ndarray
    configuration: np.ndarray
    share: np.ndarray
    open_box: np.ndarray
    open_lo: np.ndarray
    open_hi: np.ndarray
    open_names: list[tuple[str, str]]
    n_checked: int

    @property
    def collides(self) -> np.ndarray:
        """(N,) bool: boxes with a colliding ``configuration``."""
        return ~self.free & ~self.is_open

    @property
    def is_open(self) -> np.ndarray:
        """(N,) bool: boxes neither proven free nor colliding."""
        return np.isin(np.arange(len(self.free)), self.open_box)

    def __len__(self) -> int:
        return len(self.free)

    def __repr__(self) -> str:
        return (
            f"CertifiedBoxes({len(self)} boxes: {int(self.free.sum())} proven free, {int(self.collides.sum())} "
            f"collide, {int(self.is_open.sum())} open)"
        )


def certify_boxes(
    checker: CheckerScene, lo: np.ndarray, hi: np.ndarray, resolution: float, max_cells: int, threads: int, progress
) -> CertifiedBoxes:
    """`RobotChecker.certify_boxes` of checked corners (N, dof)."""
    hits, times = np.full(lo.shape, np.nan), np.full(len(lo), np.nan)

    def ask(space: CheckWorkspace, work: MotionWorkspace, piece: slice) -> None:
        work.ask_about_boxes(hits[piece], max_cells)

    rows, n_checked = prove(checker, lo, hi, times, resolution, threads, progress, ask)
    box, cells = rows[:, 0].astype(np.int64), rows[:, OPEN_INTERVAL:].reshape(-1, 2, lo.shape[1])
    free = np.isnan(times)
    share = free.astype(np.float64)
    free[box] = False
    # Columns without width have no say in a volume.
    widths = hi - lo
    parts = np.where(widths[box] > 0.0, (cells[:, 1] - cells[:, 0]) / np.where(widths > 0.0, widths, 1.0)[box], 1.0)
    np.subtract.at(share, box, parts.prod(axis=1))
    share = np.where(free, 1.0, np.clip(share, 0.0, np.nextafter(1.0, 0.0)))
    return CertifiedBoxes(free, hits, share, box, cells[:, 0], cells[:, 1], open_names(checker, rows), n_checked)
