"""LAS and LAZ, the files of aerial surveys, read by laspy piece by piece: no more is held than points that came.

Headers, the table of chunks and the lengths of layers are checked before laspy sees them: lazrs reserves what they ask
for, and ends the process where it cannot.
"""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

from collide.base.given_files import LARGEST_CLOUD
from collide.errors import MissingExtra, SceneError, cut
from collide.scenes.loaders.polygons import refuse

#: Bytes of the least header, and of that of a record before the points.
_HEADER, _RECORD = 227, 54
#: Where the header has the format of points, and a bit for LAZ; bytes of a chunk at least: its first point is as it is.
_FORMAT, _CHUNK = 104, 20
#: Bytes of a point and layers of a chunk, by the format of points; every extra byte has a layer.
_LAYERED = {6: (30, 9), 7: (36, 10), 8: (38, 11), 9: (59, 10), 10: (67, 12)}
#: Points read at once.
_PIECE = 2**16


def read_points(content: bytes, path: Path) -> np.ndarray:
    """(n, 3) float64, the file's whole numbers times its scales, and its offsets; SceneError where points lack."""
    purpose = f"read the points of {path.name}"
    try:
        import laspy
    except ImportError:
        raise MissingExtra("laspy", extra="clouds", purpose=purpose) from None
    _check_header(content, path)
    try:
        # lazrs in several threads reserves what a damaged file asks for, and ends the process.
        with laspy.open(io.BytesIO(content), laz_backend=laspy.LazBackend.Lazrs, read_evlrs=False) as file:
            if file.header.are_points_compressed and not laspy.LazBackend.Lazrs.is_available():
                raise MissingExtra("lazrs", extra="clouds", purpose=purpose)
            n_points = file.header.point_count
            if 24 * n_points > LARGEST_CLOUD:
                refuse(path, f"declares {n_points} points, more than the {LARGEST_CLOUD >> 20} MiB held of a cloud")
            pieces = [np.stack([piece.x, piece.y, piece.z], axis=1) for piece in file.chunk_iterator(_PIECE)]
    except (MissingExtra, SceneError):
        raise
    except BaseException as error:  # lazrs raises panics of its own
        if isinstance(error, (KeyboardInterrupt, SystemExit)):
            raise
        raise SceneError(f"laspy cannot read it: {cut(' '.join(str(error).split()))}", path=path) from None
    points = np.concatenate([np.zeros((0, 3)), *pieces])
    if len(points) != n_points:
        refuse(path, f"its header declares {n_points} points, but {len(points)} follow")
    return points


def _check_header(content: bytes, path: Path) -> None:
    """Refuse what laspy would look for at length: records that the file has no bytes for."""
    if not content.startswith(b"LASF") or len(content) < _HEADER:
        refuse(path, "is no LAS: it must begin with LASF and a whole header")
    size, begin, n_records = struct.unpack_from("<HII", content, 94)
    if not size + _RECORD * n_records <= begin <= len(content):
        refuse(
            path, f"its header of {size} bytes declares {n_records} records before points from byte {begin} on, but "
            f"the file has {len(content)} bytes"
        )
    if content[_FORMAT] & 128:
        _check_chunks(content, begin, path)


def _check_chunks(content: bytes, begin: int, path: Path) -> None:
    """Refuse a table of more chunks than the file has points' bytes for: lazrs reserves memory for as many, or dies."""
    place, end = begin, len(content) - 8
    if begin <= end:
        (place,) = struct.unpack_from("<q", content, begin)
        if place == -1:  # written as a stream: it stands at the end
            (place,) = struct.unpack_from("<q", content, end)
    if not begin <= place <= end:
        refuse(path, f"its table of chunks is said to stand at byte {place} of {len(content)}: was it cut short?")
    n_chunks = struct.unpack_from("<I", content, place + 4)[0]
    if n_chunks * _CHUNK > len(content):
        refuse(path, f"its table has {n_chunks} chunks, more than its {len(content)} bytes can hold")
    _check_layers(content, begin + 8, place, n_chunks, path)


def _check_layers(content: bytes, at: int, end: int, n_chunks: int, path: Path) -> None:
    """Refuse a layer longer than the chunks: of points of formats 6 to 10, whose chunks begin with a point, the number
    of points, and the length of each layer.
    """
    kind, size = struct.unpack_from("<BH", content, _FORMAT)
    least, n_layers = _LAYERED.get(kind & 63, (size, 0))
    n_layers += size - least
    head = size + 4 + 4 * n_layers
    for _ in range(n_chunks if n_layers > 0 else 0):
        if at + head <= end:
            at += head + int(np.frombuffer(content, "<u4", n_layers, at + size + 4).sum(dtype=np.int64))
            if at > end:
                refuse(path, f"a chunk of points ends at byte {at}, beyond {end}: the file is damaged")
