"""Shapes, Worlds and scenes in a notebook: a small picture, and a table of bodies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from collide.base.notebook_html import page_of
from collide.errors import UnsupportedQuery
from collide.shapes.shape import IDENTITY, Shape
from collide.shapes.tessellation import tessellate

#: Bodies that a picture has at most, the first of a World.
MAX_DRAWN = 500
#: Edge of what is drawn for a shape without end, beside nothing else [m].
_ALONE = 2.0


def shape_html(shape: Shape) -> str:
    """A shape as HTML: its repr and a picture."""
    return page_of(repr(shape), triangles=_placed([(shape, IDENTITY)]))


def bodies_html(title: str, bodies: Sequence[Any], n_bodies: int) -> str:
    """Bodies as HTML: a picture of the first `MAX_DRAWN`, and the first rows of a table.

    bodies : with ``name``, ``shape``, ``X_WB`` and ``static``, the first of ``n_bodies``.
    """
    head = ("body", "shape", "x y z [m]", "")
    triangles = _placed([(body.shape, body.X_WB) for body in bodies[:MAX_DRAWN]])
    return page_of(title, head, map(_row, bodies), n_bodies, triangles)


def _row(body: Any) -> tuple[str, str, str, str]:
    place = " ".join(f"{x:.3f}" for x in body.X_WB[:3, 3].tolist())
    return body.name, repr(body.shape), place, "static" if body.static else ""


def _placed(bodies: Iterable[tuple[Shape, np.ndarray]]) -> np.ndarray:
    """(n, 3, 3) triangles of posed shapes; clouds and rectangles without triangles have none."""
    bounded, unbounded = [], []
    made: dict[int, np.ndarray | None] = {}
    for shape, X in bodies:
        if id(shape) not in made:
            made[id(shape)] = _triangles(shape)
        triangles = made[id(shape)]
        if triangles is None:
            unbounded.append((shape, X))
        else:
            bounded.append(triangles @ X[:3, :3].T + X[:3, 3])
    whole = np.concatenate(bounded) if bounded else np.zeros((0, 3, 3))
    size = 1.5 * float(np.ptp(whole.reshape(-1, 3), axis=0).max()) if len(whole) else _ALONE
    sheets = [_triangles(shape, size or _ALONE) for shape, _ in unbounded]
    return np.concatenate(
        [whole, *(t @ X[:3, :3].T + X[:3, 3] for t, (_, X) in zip(sheets, unbounded) if t is not None)]
    )


def _triangles(shape: Shape, size: float | None = None) -> np.ndarray | None:
    """(n, 3, 3) triangles in the shape's frame; ``None`` where an unbounded shape needs a size [m]."""
    try:
        made = tessellate(shape, size=size)
    except UnsupportedQuery:
        return np.zeros((0, 3, 3)) if size is not None or shape.is_field else None
    return np.asarray(made.vertices, dtype=np.float64).reshape(-1, 3)[made.faces]
