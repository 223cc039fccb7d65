"""Files of tetrahedra, read by meshio."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from collide.base import argument_checks as checks
from collide.errors import MissingExtra, SceneError


def read_cells(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """(vertices (n, 3), cells (m, 4)) of a file. Raises SceneError, MissingExtra."""
    path = checks.file_path("TetMesh.from_file: path", path, SceneError)
    try:
        import meshio
    except ImportError:
        raise MissingExtra("meshio", extra="tets", purpose="read files of tetrahedra") from None
    if not path.is_file():
        raise SceneError("there is no such file", path=path)
    try:
        read = meshio.read(path)
    except SystemExit:  # how meshio ends where no reader of its takes the file
        raise SceneError("meshio cannot read it: by its name it is of another kind, or of none", path=path) from None
    except Exception as error:
        raise SceneError(f"meshio cannot read it: {error}", path=path) from error
    kinds = sorted({block.type for block in read.cells})
    higher = [kind for kind in kinds if kind.startswith("tetra") and kind != "tetra"]
    if higher:
        raise SceneError(f"it has cells of kind {', '.join(higher)}; make them linear: four corners a cell", path=path)
    cells = [block.data for block in read.cells if block.type == "tetra"]
    if not cells:
        raise SceneError(f"it has no tetrahedra; its cells are: {', '.join(kinds) or 'none'}", path=path)
    return np.asarray(read.points, dtype=np.float64), np.concatenate(cells)
