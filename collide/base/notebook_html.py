"""What notebooks show of an object: a small picture of triangles and a table, as one piece of HTML without scripts."""

from __future__ import annotations

import base64
import html
import struct
import zlib
from collections.abc import Iterable, Sequence
from itertools import islice

import numpy as np

_WIDTH, _HEIGHT, _BORDER = 320, 220, 8
#: Rows: right, up and towards the reader, of a view from above at the right.
_VIEW = np.array([[0.8, 0.6, 0.0], [-0.3, 0.4, 0.8660254], [0.5196152, -0.6928203, 0.5]])
_LIGHT = np.array([0.35, 0.45, 0.82])
#: Triangles that are filled; of all others, smaller than these, the corners are drawn.
_MAX_FILLED = 4_000
#: Corners that are drawn at most.
_MAX_POINTS = 600_000
#: Rows of a table.
_MAX_ROWS = 12
_GREY = (121, 160, 190)


def page_of(
    title: str, head: Sequence[str] = (), rows: Iterable[Sequence] = (), n_rows: int = 0,
    triangles: np.ndarray | None = None,
) -> str:
    """A title, a picture where triangles are given, and the first rows of a table.

    rows : cells, a sequence a row; of ``n_rows`` the first `_MAX_ROWS` are read.   triangles : (n, 3, 3) corners [m].
    """
    picture = ""
    if triangles is not None and len(triangles):
        data = base64.b64encode(_png(_drawn(triangles, np.tile(_GREY, (len(triangles), 1))))).decode()
        picture = f'<img width="{_WIDTH}" height="{_HEIGHT}" alt="" src="data:image/png;base64,{data}"/>'
    table = _table(head, list(islice(rows, _MAX_ROWS)), n_rows)
    return f"<div><code>{html.escape(title)}</code><br/>{picture}{table}</div>"


def _table(head: Sequence[str], rows: list, n_rows: int) -> str:
    if not rows:
        return ""

    def line(tag, cells):
        return "<tr>" + "".join(f"<{tag}>{html.escape(str(cell))}</{tag}>" for cell in cells) + "</tr>"

    more = f"<p>… and {n_rows - _MAX_ROWS} more</p>" if n_rows > _MAX_ROWS else ""
    return f"<table>{line('th', head)}{''.join(line('td', row) for row in rows)}</table>{more}"


def _drawn(triangles: np.ndarray, colours: np.ndarray) -> np.ndarray:
    """(height, width, 4) a picture by a depth buffer, transparent where nothing is."""
    seen = triangles.reshape(-1, 3) @ _VIEW.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    space = np.array([_WIDTH, _HEIGHT]) - 2.0 * _BORDER
    scale = float((space / np.maximum(high - low, 1e-300)[:2]).min())
    at = (seen - 0.5 * (low + high)) * min(scale, 1e300) * [1.0, -1.0, 1.0]
    at = at.reshape(-1, 3, 3) + np.array([0.5 * _WIDTH, 0.5 * _HEIGHT, 0.0])
    normals = np.cross(at[:, 1] - at[:, 0], at[:, 2] - at[:, 0])
    lengths = np.maximum(np.linalg.norm(normals, axis=1), 1e-300)
    bright = 0.35 + 0.65 * np.abs(normals @ _LIGHT) / lengths
    shades = np.concatenate([colours * bright[:, None], np.full((len(colours), 1), 255.0)], axis=1).astype(np.uint8)
    picture, depth = np.zeros((_HEIGHT, _WIDTH, 4), np.uint8), np.full((_HEIGHT, _WIDTH), -np.inf)
    by_size = np.argsort(-np.abs(normals[:, 2]), kind="stable")
    _dot(picture, depth, at[by_size[_MAX_FILLED:]], shades[by_size[_MAX_FILLED:]])
    for k in by_size[:_MAX_FILLED]:
        _fill(picture, depth, at[k], shades[k])
    return picture


def _dot(picture: np.ndarray, depth: np.ndarray, corners: np.ndarray, shades: np.ndarray) -> None:
    """Draw the corners of triangles (n, 3, 3), the nearest last."""
    step = max(1, 3 * len(corners) // _MAX_POINTS)
    points, shades = corners[::step].reshape(-1, 3), np.repeat(shades[::step], 3, axis=0)
    order = np.argsort(points[:, 2], kind="stable")
    x, y = points[order, :2].astype(int).T
    picture[y, x], depth[y, x] = shades[order], points[order, 2]


def _fill(picture: np.ndarray, depth: np.ndarray, corners: np.ndarray, shade: np.ndarray) -> None:
    """Draw a triangle (3, 3) where it is nearest."""
    (x0, y0), (x1, y1) = corners[:, :2].min(axis=0).astype(int), corners[:, :2].max(axis=0).astype(int) + 1
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners.tolist()
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if area == 0.0:
        return
    x, y = np.arange(x0, x1)[None, :] + 0.5, np.arange(y0, y1)[:, None] + 0.5
    v = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
    w = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
    z = az + v * (bz - az) + w * (cz - az)
    behind = depth[y0:y1, x0:x1]
    nearer = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0) & (z > behind)
    behind[nearer] = z[nearer]
    picture[y0:y1, x0:x1][nearer] = shade


def _png(picture: np.ndarray) -> bytes:
    """A PNG file of (height, width, 4) uint8."""
    height, width, _ = picture.shape
    rows = np.zeros((height, 1 + 4 * width), np.uint8)  # a filter of 0 before each row
    rows[:, 1:] = picture.reshape(height, -1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 6, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows.tobytes()))
        + chunk(b"IEND", b"")
    )
