"""OctoMap's files and messages as arrays of leaves: .bt (free or occupied), .ot (log-odds), octomap_msgs/Octomap.

The stream has each node before its children (`octree_stream_kernel.py`); space without a leaf is unknown. Sizes are
checked before memory is asked for: a byte stands for four leaves at most. Format: K. Wurm and A. Hornung, OctoMap 1.9.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.whole_file import whole_file
from collide.errors import InvalidShape
from collide.fields.headed_files import content_of, first_line, header_of, numbers_of
from collide.fields.octree_stream_kernel import (
    CHILDLESS,
    CUT_SHORT,
    LEVELS,
    STACK,
    TOO_DEEP,
    walk_binary_stream,
    walk_full_stream,
)
from collide.fields.sensor_messages import message_bytes, message_field
from collide.kernels import address_of

#: First lines of files, and whether what follows is binary.
_FIRST_LINES = {"# Octomap OcTree binary file": True, "# Octomap OcTree file": False}
#: Bytes of a node of a full stream, by the tree's id: log-odds, a colour that is passed over, a bit for each child.
_NODES = {
    "OcTree": np.dtype([("log_odds", "<f4"), ("children", "u1")]),
    "ColorOcTree": np.dtype([("log_odds", "<f4"), ("colour", "u1", 3), ("children", "u1")]),
}
#: How many leaves a byte of a binary stream says.
_LEAVES_OF_BYTE = np.array(
    [sum(byte >> shift & 3 in (1, 2) for shift in (0, 2, 4, 6)) for byte in range(256)], dtype=np.uint8
)
_WRONG = {
    CUT_SHORT: "ends before its last node: was it cut short?", TOO_DEEP: f"has nodes more than {LEVELS} levels deep",
    CHILDLESS: "has a node without children",
}
_HALF = 1 << LEVELS - 1


class StreamLeaves(NamedTuple):
    """The leaves of an octree of 2¹⁶ finest cells a side around its origin, in the order of their stream.

    resolution : side of a finest cell, > 0 [m].
    corners : (n, 3) int32, the least cell of each leaf, from −32768 (OctoMap's keys less 32768): leaf i begins at
        ``resolution * corners[i]`` [m].
    exponents : (n,) int32, 0 … 16: a leaf covers 2^exponent cells a side.
    occupied : (n,) bool; free otherwise. Of log-odds those of at least 0 are occupied.
    log_odds : (n,) float32, ``None`` where only occupied and free are known.
    """

    resolution: float
    corners: np.ndarray
    exponents: np.ndarray
    occupied: np.ndarray
    log_odds: np.ndarray | None = None


def read_octree_file(path: str | Path, resolution: float | None = None) -> StreamLeaves:
    """The leaves of a .bt or .ot file, by its first line.

    Parameters
    ----------
    path : str or Path
        A file of an OcTree or a ColorOcTree, whose colours are left out; at most 2 GiB.
    resolution : float, optional
        What the file must say, to five digits: OctoMap writes six [m].

    Returns
    -------
    StreamLeaves

    Raises
    ------
    InvalidShape
        For a missing or damaged file, another id, a resolution not above 0 or another one, sizes that do not match.

    Notes
    -----
    O(n) for n nodes, 20 to 40 ns each.
    """
    return leaves_of_file(content_of("octree", path), f"octree {path}", resolution)


def leaves_of_file(content: bytes, what: str, resolution: float | None = None) -> StreamLeaves:
    """The leaves in the bytes of a .bt or .ot file; see `read_octree_file`. what : for messages."""
    first = first_line(content)
    if first not in _FIRST_LINES:
        raise InvalidShape(f"{what}: must begin with {' or '.join(map(repr, _FIRST_LINES))}, got {checks.brief(first)}")
    entries, begin = header_of(content, what)
    is_binary = _FIRST_LINES[first]
    leaves, n_nodes = _leaves(np.frombuffer(content, dtype=np.uint8, offset=begin), is_binary, entries, what)
    if numbers_of(entries, "size", 1, what)[0] != n_nodes:
        raise InvalidShape(
            f"{what}: size must be its number of nodes, {n_nodes}, got {checks.brief(entries['size'])}"
        )
    return _at_resolution(leaves, resolution, what)


def leaves_of_message(message: Any, resolution: float | None = None) -> StreamLeaves:
    """The leaves of an octomap_msgs/Octomap.

    message : an object, or a mapping, with ``id``, ``resolution``, ``binary`` and ``data``, int8 or any form that
    `sensor_messages.message_bytes` takes.   resolution : as of `read_octree_file`.   Raises InvalidShape.
    """
    what = "Octomap message"
    names = ("id", "resolution")
    entries = {{"resolution": "res"}.get(name, name): str(message_field(what, message, name)) for name in names}
    is_binary = checks.true_or_false(f"{what}: binary", message_field(what, message, "binary"))
    data = message_bytes(f"{what}: data", message_field(what, message, "data"))
    return _at_resolution(_leaves(data, is_binary, entries, what)[0], resolution, what)


def write_octree_file(path: str | Path, leaves: StreamLeaves) -> None:
    """Write leaves to a .bt file, whole or not at all: occupied and free alone. Raises InvalidShape, OSError."""
    stream, n_nodes = binary_stream(leaves)
    header = (
        "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first line as it is!)\n#\n"
        f"id OcTree\nsize {n_nodes}\nres {leaves.resolution!r}\ndata\n"
    )
    with whole_file(path) as file:
        file.write(header.encode())
        file.write(stream)


# --- reading ------------------------------------------------------------------------------------


def _leaves(data: np.ndarray, is_binary: bool, entries: dict[str, str], what: str) -> tuple[StreamLeaves, int]:
    """(leaves, number of nodes, the root's too) of a stream."""
    side, layout = _checked_header(entries, what)
    step = 2 if is_binary else layout.itemsize
    n_records, rest = divmod(len(data), step)
    if rest:
        raise InvalidShape(f"{what}: {len(data)} bytes of data are no whole number of nodes of {step} bytes")
    data = np.ascontiguousarray(data)
    if is_binary:
        log_odds, occupied = None, np.empty(int(_LEAVES_OF_BYTE[data].sum(dtype=np.int64)), dtype=bool)
        corners, exponents = _walked(data, n_records, len(occupied), what, occupied)
        return StreamLeaves(side, corners, exponents, occupied), n_records + len(occupied)
    nodes = data.view(layout)
    children = np.ascontiguousarray(nodes["children"])
    log_odds = nodes["log_odds"][children == 0].astype(np.float32)
    if not np.isfinite(log_odds).all():
        raise InvalidShape(f"{what}: a leaf has log-odds of {log_odds[~np.isfinite(log_odds)][0]}")
    corners, exponents = _walked(children, n_records, len(log_odds), what)
    return StreamLeaves(side, corners, exponents, log_odds >= 0.0, log_odds), n_records


def _checked_header(entries: dict[str, str], what: str) -> tuple[float, np.dtype]:
    """(resolution, layout of a node of a full stream)."""
    layout, (side,) = _NODES.get(entries.get("id", "")), numbers_of(entries, "res", 1, what)
    if layout is None:
        raise InvalidShape(f"{what}: id must be one of {', '.join(_NODES)}, got {checks.brief(entries.get('id'))}")
    if not side > 0.0:
        raise InvalidShape(f"{what}: res, the resolution, must be > 0 m, got {checks.brief(entries['res'])}")
    return side, layout


def _walked(
    stream: np.ndarray, n_nodes: int, n_leaves: int, what: str, occupied: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """(corners, exponents) of the leaves of a stream; of a binary stream their states are written to ``occupied``."""
    corners, exponents = np.empty((n_leaves, 3), dtype=np.int32), np.empty(n_leaves, dtype=np.int32)
    if not n_nodes:
        return corners, exponents
    stack = np.empty(STACK, dtype=np.int64)
    into, work = (address_of(corners), address_of(exponents)), address_of(stack)
    if occupied is None:
        n_read = walk_full_stream(address_of(stream), n_nodes, *into, n_leaves, work)
    else:
        states = address_of(occupied.view(np.uint8))
        n_read = walk_binary_stream(address_of(stream), n_nodes, *into, states, n_leaves, work)
    if n_read != n_nodes:
        raise InvalidShape(f"{what}: its data {_WRONG.get(n_read) or f'have {n_nodes - n_read} nodes after the last'}")
    return corners, exponents


def _at_resolution(leaves: StreamLeaves, resolution: float | None, what: str) -> StreamLeaves:
    if resolution is None:
        return leaves
    wanted = checks.number(resolution)
    if wanted is None or not math.isclose(wanted, leaves.resolution, rel_tol=1e-5):
        raise InvalidShape(
            f"{what}: its resolution is {leaves.resolution:g} m, not {checks.brief(resolution)}; without resolution "
            "any is taken"
        )
    return leaves


# --- writing ------------------------------------------------------------------------------------


def binary_stream(leaves: StreamLeaves) -> tuple[bytes, int]:
    """(the .bt stream of leaves in any order, its number of nodes).

    Level by level from the finest: children are put in order along Morton's curve, and states of eight make a word of
    their parent. O(n log n). Raises InvalidShape for leaves that overlap, or do not lie on the cells of their size.
    """
    exponents = np.asarray(leaves.exponents, dtype=np.int64)
    cells = np.asarray(leaves.corners, dtype=np.int64).reshape(-1, 3) + _HALF
    _check_cells(cells, exponents)
    place, states = _interleaved(cells), 1 + np.asarray(leaves.occupied, dtype=np.int64)
    codes, words = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    starts, depths, streams = [], [], []
    for exponent in range(LEVELS):
        here = exponents == exponent
        children = np.concatenate([codes, place[here] >> 3 * exponent])
        of_children = np.concatenate([np.full(len(codes), 3, dtype=np.int64), states[here]])
        order = np.argsort(children, kind="stable")
        children, of_children = children[order], of_children[order]
        twice = np.flatnonzero(children[1:] == children[:-1])
        if len(twice):
            raise InvalidShape(f"octree: leaves overlap in the cell of 2^{exponent} cells a side at "
                               f"{_cell_of(int(children[twice[0]]) << 3 * exponent)}")
        codes, first = np.unique(children >> 3, return_index=True)
        shifted = of_children << 2 * (children & 7)
        words = np.add.reduceat(shifted, first) if len(first) else shifted
        starts.append(codes << 3 * (exponent + 1))
        depths.append(np.full(len(codes), LEVELS - exponent))
        streams.append(words)
    order = np.lexsort((np.concatenate(depths), np.concatenate(starts)))
    stream = np.concatenate(streams)[order].astype("<u2").tobytes()
    return stream, len(order) + len(exponents)


def _check_cells(cells: np.ndarray, exponents: np.ndarray) -> None:
    if ((exponents < 0) | (exponents >= LEVELS)).any():
        raise InvalidShape(f"octree: exponents must lie within 0 … {LEVELS - 1}, got {checks.brief(exponents)}")
    outside = ((cells < 0) | (cells >> LEVELS != 0) | (cells & (1 << exponents)[:, None] - 1 != 0)).any(axis=1)
    if outside.any():
        k = int(np.argmax(outside))
        raise InvalidShape(
            f"octree: corners[{k}] must lie within ±{_HALF} on multiples of 2^{exponents[k]}, got "
            f"{(cells[k] - _HALF).tolist()}"
        )


def _interleaved(cells: np.ndarray) -> np.ndarray:
    """Bits of x, y and z by turns, the lowest is x's."""
    codes = np.zeros(len(cells), dtype=np.int64)
    for axis in range(3):
        x = cells[:, axis]
        for shift, mask in ((16, 0xFF0000FF), (8, 0xF00F00F00F), (4, 0xC30C30C30C3), (2, 0x249249249249)):
            x = (x | x << shift) & mask
        codes |= x << axis
    return codes


def _cell_of(code: int) -> list[int]:
    return [sum((code >> 3 * bit + axis & 1) << bit for bit in range(LEVELS)) - _HALF for axis in range(3)]
