"""A scene as binary glTF for viewers and modellers: a node a body, in the colour of the body's verdict.

glTF has y up: a root node turns the scene, whose z is up. Numbers are of 32 bits; a shape is written once, for all its
bodies of a verdict.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from collide.errors import UnsupportedQuery
from collide.pages.body_verdicts import FREE, NEVER_TESTED, NOT_ANSWERED, body_verdicts
from collide.reports import classes
from collide.reports.classes import body_sizes
from collide.reports.report import Report
from collide.shapes.mesh_formats import glb_file
from collide.shapes.tessellation import tessellate

#: Verdict → red, green and blue of 255: the colours of the page.
COLOURS = {
    classes.COLLIDING: (213, 94, 0), classes.SHALLOW: (230, 159, 0), classes.TOUCHING: (239, 227, 82),
    NOT_ANSWERED: (90, 90, 90), classes.NEAR: (86, 180, 233), FREE: (121, 194, 170), NEVER_TESTED: (226, 226, 226),
}
#: A quarter turn about x: z, which is up here, becomes y.
_UPRIGHT = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
_FLOAT, _UINT = 5126, 5125


def scene_glb(scene, report: Report) -> Iterator[bytes]:
    """The file, piece by piece.

    scene : `collide.scenes.Scene`.   report : of the scene, source of the verdicts.

    Shapes without triangles (clouds) are left out; ``extras`` of a node has verdict and approximation of its body. A
    half-space is a square twice as large as the scene.
    """
    verdicts = body_verdicts(scene, report)
    file, size = _File(), 2.0 * (float(body_sizes(scene.bodies).max(initial=0.0)) or 1.0)
    nodes: list[dict] = [{"name": scene.name, "rotation": _UPRIGHT}]
    for body in scene.bodies:
        verdict = verdicts[body.name]
        mesh = file.mesh_of(body.shape, verdict, size)
        about = {"verdict": verdict, **({"approximation": body.approximation} if body.approximation else {})}
        matrix = np.asarray(body.X_WB, dtype=np.float64).T.ravel().tolist()  # column after column
        drawn = {} if mesh is None else {"mesh": mesh}
        nodes.append({"name": body.name, "matrix": matrix, "extras": about, **drawn})
    if len(nodes) > 1:
        nodes[0]["children"] = list(range(1, len(nodes)))
    return glb_file(file.header(nodes), file.chunks)


class _File:
    """Meshes, materials and the buffer of a file, each shape and each verdict once."""

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self._views: list[dict] = []
        self._accessors: list[dict] = []
        self._meshes: list[dict] = []
        self._materials: list[dict] = []
        self._rows: dict[tuple, int | None] = {}
        self._size = 0

    def mesh_of(self, shape, verdict: str, size: float) -> int | None:
        """The row of a shape in a colour; ``None`` without triangles.   size : of a square for a half-space [m]."""
        if (id(shape), verdict) not in self._rows:
            primitive = self._triangles_of(shape, size)
            if primitive is not None:
                primitive["material"] = self._material(verdict)
                self._meshes.append({"primitives": [primitive]})
            self._rows[id(shape), verdict] = None if primitive is None else len(self._meshes) - 1
        return self._rows[id(shape), verdict]

    def _triangles_of(self, shape, size: float) -> dict | None:
        try:
            triangles = tessellate(shape, size=size)
        except UnsupportedQuery:
            return None
        if not len(triangles.faces):
            return None
        corners = np.ascontiguousarray(triangles.vertices, dtype="<f4")
        limits = {"min": corners.min(axis=0).tolist(), "max": corners.max(axis=0).tolist()}
        position = self._add(corners.tobytes(), _FLOAT, "VEC3", len(corners), limits)
        ids = np.ascontiguousarray(triangles.faces, dtype="<u4")
        return {"attributes": {"POSITION": position}, "indices": self._add(ids.tobytes(), _UINT, "SCALAR", ids.size)}

    def _add(self, chunk: bytes, kind: int, layout: str, count: int, limits: dict | None = None) -> int:
        """The accessor of numbers of four bytes, appended to the buffer."""
        self._views.append({"buffer": 0, "byteOffset": self._size, "byteLength": len(chunk)})
        view = len(self._views) - 1
        self._accessors.append(
            {"bufferView": view, "componentType": kind, "count": count, "type": layout, **(limits or {})}
        )
        self.chunks.append(chunk)
        self._size += len(chunk)
        return view

    def _material(self, verdict: str) -> int:
        row = next((k for k, material in enumerate(self._materials) if material["name"] == verdict), None)
        if row is not None:
            return row
        linear = [(channel / 255.0) ** 2.2 for channel in COLOURS[verdict]]  # glTF has linear factors
        surface = {"baseColorFactor": [*linear, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.8}
        self._materials.append({"name": verdict, "pbrMetallicRoughness": surface, "doubleSided": True})
        return len(self._materials) - 1

    def header(self, nodes: list[dict]) -> dict:
        lists = {
            "meshes": self._meshes, "materials": self._materials, "accessors": self._accessors,
            "bufferViews": self._views, "buffers": [{"byteLength": self._size}] if self._size else [],
        }
        return {
            "asset": {"version": "2.0", "generator": "collide"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": nodes, **{name: rows for name, rows in lists.items() if rows},  # empty lists are not allowed
        }
