"""Files of points, by their suffix: PCD, PLY, LAS and LAZ, and text; ``.gz`` behind it is unpacked."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from collide.base.given_files import LARGEST_CLOUD
from collide.errors import InvalidShape, SceneError, cut
from collide.scenes.loaders import las, pcd, ply, point_text
from collide.scenes.loaders.files import read_mesh_bytes
from collide.shapes.point_cloud import PointCloud

READERS: dict[str, Callable[[bytes, Path], np.ndarray]] = {
    ".pcd": pcd.read_points, ".ply": ply.read_points, ".las": las.read_points, ".laz": las.read_points,
    **dict.fromkeys((".xyz", ".txt", ".asc", ".csv"), point_text.read_points),
}


def read_points(path: Path) -> np.ndarray:
    """(n, 3) float64 coordinates as they stand in a file, finite or not. Raises SceneError, MissingExtra."""
    inner = Path(path.stem).suffix.lower() if path.suffix.lower() == ".gz" else path.suffix.lower()
    if inner not in READERS:
        raise SceneError(f"unknown format of points {cut(inner)!r}; known are .npz, {', '.join(READERS)}", path=path)
    return READERS[inner](read_mesh_bytes(path, LARGEST_CLOUD, "cloud")[1], path)


def read_cloud(
    path: Path, radius: float | np.ndarray | None = None, scale: float = 1.0, *, drop_invalid: bool = False
) -> PointCloud:
    """The cloud of a file, as of `PointCloud.from_file`.

    radius : of the balls [m]; by default that of the file, 0 where it has none.   scale : metres in its unit of length.
    Raises SceneError for what is no such file, MissingExtra.
    """
    try:
        of_file = None if radius is None else radius / scale
        cloud = PointCloud.from_file(path, of_file, drop_invalid=drop_invalid)
        made = PointCloud(cloud.points * scale, cloud.radius * scale) if scale != 1.0 else cloud
    except InvalidShape as error:
        raise SceneError(str(error), path=path) from None
    made._store(dropped=cloud.dropped)
    return made
