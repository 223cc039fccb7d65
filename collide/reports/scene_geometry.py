"""Where every body stands and what it looks like, as plain data: enough to draw a scene without collide."""

from __future__ import annotations

import numpy as np

from collide.errors import UnsupportedQuery
from collide.reports.classes import body_sizes
from collide.shapes.tessellation import tessellate


def of_scene(scene) -> dict:
    """``{"bodies": [...], "shapes": [...]}``: shapes that bodies share stand once.

    A body has ``name``, ``static``, ``owner``, ``X_WB`` (4, 4) and ``shape``, a row of ``shapes``. A shape has
    ``kind``, ``parameters``, ``vertices`` (V, 3), ``faces`` (F, 3) and their ``deviation`` [m]. A half-space is drawn
    as a square twice as large as the scene, a region of half-spaces within a box as large at least.
    """
    size = 2.0 * _extent(scene)
    rows: dict[int, int] = {}
    shapes: list[dict] = []
    bodies: list[dict] = []
    for body in scene.bodies:
        if id(body.shape) not in rows:
            rows[id(body.shape)] = len(shapes)
            shapes.append(of_shape(body.shape, size))
        bodies.append({
            "name": body.name, "static": bool(body.static), "owner": body.owner, "X_WB": body.X_WB.tolist(),
            "shape": rows[id(body.shape)],
        })
    return {"bodies": bodies, "shapes": shapes}


def of_shape(shape, size: float) -> dict:
    """A shape as plain data. size : of the square that stands for a half-space [m]."""
    try:
        triangles = tessellate(shape, size=size)
        drawn = {
            "vertices": triangles.vertices.tolist(),
            "faces": triangles.faces.tolist(),
            "deviation": triangles.deviation,
        }
    except UnsupportedQuery:
        drawn = {"vertices": [], "faces": [], "deviation": None}
    return {"kind": type(shape).__name__, "parameters": _parameters(shape), **drawn}


def _parameters(shape) -> dict:
    """What the shape was made from; a mesh's vertices and faces stand beside, as they are."""
    if hasattr(shape, "items"):
        return {
            "items": [
                {"kind": type(part).__name__, "parameters": _parameters(part), "X_CS": X.tolist()}
                for part, X in shape.items
            ]
        }
    left_out = ("vertices", "faces") if shape.meshed else ("faces",)
    values = {name: getattr(shape, name, None) for name in shape._fields if name not in left_out}
    return {
        name: value.tolist() if isinstance(value, (np.ndarray, np.generic)) else value for name, value in values.items()
    }


def _extent(scene) -> float:
    return float(body_sizes(scene.bodies).max(initial=0.0)) or 1.0
