"""Convex cells for other programs: their surfaces as a mesh file, and the graph of cells and portals as JSON."""

from __future__ import annotations

import numpy as np

from collide.papers.partitions.cell_records import ConvexCells
from collide.papers.partitions.portals import Portals
from collide.shapes.mesh import Mesh, save_triangles


def save_cells(path, cells: ConvexCells) -> None:
    """Write the surfaces of all cells to a mesh file, a colour for each cell in turn. Raises InvalidShape."""
    mesh, cell = cell_surfaces(cells)
    save_triangles("ConvexCells", path, mesh.vertices, mesh.faces, cell)


def cell_surfaces(cells: ConvexCells) -> tuple[Mesh, np.ndarray]:
    """(the triangles of all cells as a mesh, (f,) the cell of each)."""
    n_corners = np.diff(cells.loop_starts)
    cell = np.repeat(np.arange(len(cells)), np.diff(cells.face_starts))
    fans = n_corners - 2
    first = np.repeat(cells.loop_starts[:-1], fans)
    k = np.arange(len(first)) - np.repeat(np.cumsum(fans) - fans, fans)
    faces = cells.loops[np.stack([first, first + k + 1, first + k + 2], axis=1)]
    return Mesh(cells.vertices, faces), np.repeat(cell, fans)


def cell_graph(cells: ConvexCells, portals: Portals) -> dict:
    """Cells and portals as JSON: faces by rows of the cell's own vertices, counter-clockwise from outside."""
    listed = []
    for i in range(len(cells)):
        faces = [
            cells.loops[cells.loop_starts[j] : cells.loop_starts[j + 1]]
            for j in range(cells.face_starts[i], cells.face_starts[i + 1])
        ]
        ids, rows = np.unique(np.concatenate(faces), return_inverse=True)
        ends = np.cumsum([len(face) for face in faces])[:-1]
        listed.append(
            {
                "vertices": cells.vertices[ids].tolist(), "volume": float(cells.volumes[i]),
                "faces": [face.tolist() for face in np.split(rows, ends)],
            }
        )
    doors = [
        {"cells": pair, "middle": middle, "area": area}
        for pair, middle, area in zip(portals.cells.tolist(), portals.middle.tolist(), portals.area.tolist())
    ]
    return {"convex_cells": listed, "portals": doors}
