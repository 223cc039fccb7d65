"""binvox files as arrays: voxels in runs of at most 255 (P. Min, https://www.patrickmin.com/binvox/binvox.html)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np

from collide.base import argument_checks as checks
from collide.base.whole_file import whole_file
from collide.errors import InvalidShape
from collide.fields.headed_files import content_of, first_line, header_of, numbers_of

_MAX_RUN = 255
#: Cells of a file at most, those added up to a cube included: a byte each in memory.
_MAX_CELLS = (1 << 31) - 1


class Voxels(NamedTuple):
    """A grid of cells.

    occupied : (nx, ny, nz) bool.
    cell_sizes : (3,) float64, sides of a cell along x, y and z, > 0 [m].
    origin : (3,) float64, the least corner of cell (0, 0, 0) [m].
    """

    occupied: np.ndarray
    cell_sizes: np.ndarray
    origin: np.ndarray


def read_voxel_file(path: str | Path) -> Voxels:
    """The voxels of a binvox file.

    Parameters
    ----------
    path : str or Path
        The file, at most 2 GiB. Its scale is the length of the grid along every axis; coordinates are metres.

    Returns
    -------
    Voxels

    Raises
    ------
    InvalidShape
        For a missing or damaged file: an incomplete header, voxels besides 0 and 1, runs too short or long for the
        grid.

    Notes
    -----
    O(n) for n cells, a byte each; before any memory is asked for, all runs are added up: a byte of the file makes 128
    cells at most.
    """
    return voxels_of_file(content_of("binvox", path), f"binvox {path}")


def voxels_of_file(content: bytes, what: str) -> Voxels:
    """The voxels in the bytes of a file; see `read_voxel_file`. what : for messages."""
    if first_line(content) != "#binvox 1":
        raise InvalidShape(f"{what}: must begin with '#binvox 1', got {checks.brief(first_line(content))}")
    entries, begin = header_of(content, what)
    counts_given, translate, (scale,) = (
        numbers_of(entries, name, n, what) for name, n in (("dim", 3), ("translate", 3), ("scale", 1))
    )
    dims = [int(count) for count in counts_given]
    if not 1 <= min(dims) <= max(dims) < 2**32 or dims != counts_given or not scale > 0.0:
        raise InvalidShape(
            f"{what}: dim must be three integers ≥ 1 and scale > 0, got {checks.brief(entries['dim'])} and {scale:g}"
        )
    if math.prod(dims) > _MAX_CELLS:
        raise InvalidShape(f"{what}: dim of {math.prod(dims)} cells: {_MAX_CELLS} are the most")
    runs = np.frombuffer(content, dtype=np.uint8, offset=begin)
    values, counts = runs[0::2], runs[1::2]
    if len(runs) % 2 or (values > 1).any() or int(counts.sum(dtype=np.int64)) != math.prod(dims):
        raise InvalidShape(
            f"{what}: {math.prod(dims)} voxels must follow in pairs of a value, 0 or 1, and a length; got "
            f"{int(counts.sum(dtype=np.int64))} in {len(runs)} bytes: was it cut short?"
        )
    nx, nz, ny = dims  # depth, height, width: y runs fastest, then z
    occupied = np.repeat(values.astype(bool), counts).reshape(nx, nz, ny).transpose(0, 2, 1)
    sizes = scale / np.array(occupied.shape, dtype=np.float64)
    if not sizes.min() > 0.0:
        raise InvalidShape(f"{what}: scale must make cells of a length above 0, got {scale:g}")
    return Voxels(np.ascontiguousarray(occupied), sizes, np.array(translate, dtype=np.float64))


def write_voxel_file(path: str | Path, voxels: Voxels) -> None:
    """Write voxels to a binvox file, whole or not at all, with free cells added at the far ends up to a cube.

    The format has one length for three axes: cells must be cubes. Raises InvalidShape, OSError.
    """
    occupied = np.asarray(voxels.occupied, dtype=bool)
    sizes, origin = (np.asarray(numbers, dtype=np.float64).tolist() for numbers in (voxels.cell_sizes, voxels.origin))
    if occupied.ndim != 3 or not occupied.size:
        raise InvalidShape(f"binvox: occupied must be (nx, ny, nz) with a cell at least, got {occupied.shape}")
    if len({*sizes}) != 1 or not 0.0 < sizes[0] < math.inf:
        raise InvalidShape(f"binvox: cell_sizes must be one number > 0 thrice: cells are cubes; got {sizes}")
    n = max(occupied.shape)
    if n**3 > _MAX_CELLS:
        raise InvalidShape(f"binvox: a cube of {n}³ cells, as the format has them, is more than {_MAX_CELLS}")
    cube = np.zeros((n, n, n), dtype=bool)
    cube[tuple(slice(count) for count in occupied.shape)] = occupied
    flat = cube.transpose(0, 2, 1).ravel()
    starts = np.flatnonzero(np.concatenate([[True], flat[1:] != flat[:-1]]))
    lengths = np.diff(starts, append=len(flat))
    pieces = -(-lengths // _MAX_RUN)
    runs = np.full((int(pieces.sum()), 2), _MAX_RUN, dtype=np.uint8)
    runs[:, 0] = np.repeat(flat[starts], pieces)
    runs[np.cumsum(pieces) - 1, 1] = lengths - (pieces - 1) * _MAX_RUN
    translate = " ".join(map(repr, origin))
    with whole_file(path) as file:
        file.write(f"#binvox 1\ndim {n} {n} {n}\ntranslate {translate}\nscale {sizes[0] * n!r}\ndata\n".encode())
        file.write(runs.tobytes())
