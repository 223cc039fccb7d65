"""Octomaps as FCL and coal take them: bytes and files of octomap, to the boxes that are occupied."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument, InvalidShape
from collide.fields.octree_files import leaves_of_file, leaves_of_message


class OccupiedBoxes(NamedTuple):
    """edge : of the smallest box [m].   boxes : (middle, edge) of the occupied leaves."""

    edge: float
    boxes: list[tuple[np.ndarray, float]]


def occupied_boxes(data: bytes, r: float | None = None) -> OccupiedBoxes:
    """The boxes of a whole file of octomap, or of nodes in its binary form alone.

    r : edge of the smallest box [m], to be that of the file; needed with nodes alone.
    Raises InvalidArgument, saying what is wrong.
    """
    try:
        if data.startswith(b"#") or r is None:
            leaves = leaves_of_file(data, "OcTree: data", r)
        else:
            leaves = leaves_of_message({"id": "OcTree", "resolution": repr(r), "binary": True, "data": data})
    except InvalidShape as error:
        raise InvalidArgument(f"OcTree: no octomap: {error}") from None
    corners, sides = leaves.corners[leaves.occupied], 1 << leaves.exponents[leaves.occupied].astype(np.int64)
    middles = (2 * corners + sides[:, None]) * (0.5 * leaves.resolution)
    return OccupiedBoxes(leaves.resolution, list(zip(middles, (sides * leaves.resolution).tolist())))
