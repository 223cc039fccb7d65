"""Clouds of a drawing: points as 16-bit numbers in the box around them, six bytes a point.

A coordinate is rounded to the nearest of 65,536 steps along its side of the box: a point is drawn at most half the
diagonal of a step away, 0.13 mm in a room of 10 m. Points keep their order: row k of the page is row k · every of the
cloud.
"""

from __future__ import annotations

import base64
from typing import NamedTuple

import numpy as np

#: Points that a page holds, of all its clouds: of more each k-th is drawn. 8 bytes a point in the file.
MAX_POINTS = 2_000_000
_STEPS = 65535
#: Coordinates beyond are drawn there [m]: graphics cards compute in single precision.
_LARGEST = 1e30


class Points(NamedTuple):
    """Balls before writing: their centres (n, 3) in the frame of the body, and their radii (n,) [m]."""

    centres: np.ndarray
    radii: np.ndarray

    @property
    def box(self) -> np.ndarray:
        """(2, 3) lowest and highest corner of all balls [m]."""
        r = self.radii[:, None]
        return np.array([(self.centres - r).min(axis=0), (self.centres + r).max(axis=0)])


def together(parts: list[Points]) -> Points | None:
    """The balls of several clouds in their order; ``None`` for an empty list."""
    return Points(*map(np.concatenate, zip(*parts))) if parts else None


def written(points: Points, cap: int) -> tuple[dict, float]:
    """Points as plain data, at most ``cap`` of them, and how far they are drawn from where they are [m]."""
    every = -(-len(points.centres) // cap)
    centres, radii = np.clip(points.centres[::every], -_LARGEST, _LARGEST), points.radii[::every]
    low = centres.min(axis=0)
    extent = centres.max(axis=0) - low
    steps = np.rint((centres - low) / np.where(extent > 0.0, extent / _STEPS, 1.0)).astype("<u2")
    off = np.sqrt(np.square(low + steps * (extent / _STEPS) - centres).sum(axis=1)).max()
    same_radius = bool((radii == radii[0]).all())
    data = {
        "count": len(centres), "of": len(points.centres), "every": every, "low": low.tolist(),
        "extent": extent.tolist(), "positions": as_base64(steps), "radius": float(radii[0]) if same_radius else None,
        "radii": None if same_radius else as_base64(radii.astype("<f4")),
    }
    return data, float(off)


def as_base64(array: np.ndarray) -> str:
    """The bytes of an array, row by row, as text."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
