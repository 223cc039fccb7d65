"""Octomap's binary form: bytes and files of it, to the boxes that are occupied."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from collide.errors import InvalidArgument

#: Levels of an octomap, and what two bits of a child say: bit 0, then bit 1.
_DEPTH = 16
_OCCUPIED, _INNER = 2, 3


#: What octomap's files begin with: of the binary form, and of the one with probabilities.
_BINARY, _FULL = b"# Octomap OcTree binary file", b"# Octomap OcTree file"


class OctomapFile(NamedTuple):
    """What a file of octomap's binary form (.bt) holds.

    edge : of the smallest box [m].   tree : its nodes, as bytes.   n_nodes : how many it says there are.
    """

    edge: float
    tree: bytes
    n_nodes: int


def octomap_file(data: bytes) -> OctomapFile:
    """The header of a whole file, read. Raises InvalidArgument, saying what is wrong with it."""
    if data.startswith(_FULL):
        raise InvalidArgument(
            "OcTree: a file with probabilities (.ot) is not read; write the binary form (.bt) by octomap's writeBinary "
            "or convert_octree"
        )
    if not data.startswith(_BINARY):
        raise InvalidArgument(f"OcTree: no binary octomap: it begins with {data[:32]!r}, not {_BINARY.decode()!r}")
    head, mark, tree = data.partition(b"\ndata\n")
    lines = [line.split(None, 1) for line in head.decode("latin-1").splitlines() if not line.startswith("#")]
    fields = {line[0]: line[1].strip() for line in lines if len(line) == 2}
    try:
        edge, n_nodes = float(fields["res"]), int(fields["size"])
    except (KeyError, ValueError):
        edge, n_nodes = 0.0, -1
    if not mark or fields.get("id") != "OcTree" or not 0.0 < edge < np.inf or n_nodes < 0:
        raise InvalidArgument(f"OcTree: a binary octomap's header has id OcTree, size, res and data, got {fields}")
    return OctomapFile(edge, tree, n_nodes)


def tree_of(r: float, data: bytes) -> tuple[float, bytes, int | None]:
    """Arguments of `occupied_boxes` for what a program gives: nodes alone, or a whole file."""
    if not data.startswith(b"# Octomap"):
        return r, data, None
    file = octomap_file(data)
    if not math.isclose(r, file.edge, rel_tol=1e-6):
        raise InvalidArgument(f"OcTree: r is {r} m, and data a file whose smallest boxes have {file.edge} m")
    return file


def occupied_boxes(r: float, data: bytes, n_nodes: int | None = None) -> list[tuple[np.ndarray, float]]:
    """(middle, edge) of the occupied leaves. Raises InvalidArgument where data ends too early or too late, or is not of
    ``n_nodes`` nodes, leaves among them.
    """
    boxes_read: list[tuple[np.ndarray, float]] = []
    at, n_read = 0, 1

    def read(middle: np.ndarray, depth: int) -> None:
        nonlocal at, n_read
        if at + 2 > len(data) or depth >= _DEPTH:
            raise InvalidArgument(f"OcTree: data is no binary octomap: a node at byte {at} of {len(data)} is not there")
        word = data[at] | data[at + 1] << 8
        at += 2
        edge = r * 2.0 ** (_DEPTH - depth - 1)
        inner = []
        for child in range(8):
            state = word >> 2 * child & 3
            n_read += state != 0
            corner = middle + 0.5 * edge * np.array([2 * (child >> k & 1) - 1 for k in range(3)])
            if state == _OCCUPIED:
                boxes_read.append((corner, edge))
            elif state == _INNER:
                inner.append(corner)
        for corner in inner:
            read(corner, depth + 1)

    if not 0.0 < r < np.inf:
        raise InvalidArgument(f"OcTree: r must be > 0 and finite [m], got {r}")
    if data:
        read(np.zeros(3), 0)
    if at < len(data):
        raise InvalidArgument(f"OcTree: data is no binary octomap: its last node ends at byte {at} of {len(data)}")
    if n_nodes is not None and n_nodes != (n_read if data else 0):
        raise InvalidArgument(f"OcTree: the file has {n_read} nodes, and says that there are {n_nodes}")
    return boxes_read
