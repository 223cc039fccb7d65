"""Frames with a given axis."""

from __future__ import annotations

import numpy as np


def frame_along(normal: np.ndarray) -> np.ndarray:
    """(3, 3) a rotation, but for rounding, whose first row is a unit vector."""
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.sqrt(np.square(across).sum())
    return np.stack([normal, across, np.cross(normal, across)])
