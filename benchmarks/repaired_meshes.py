"""How many mesh files are no solids as they are, and how many are once repaired: counts by folder.

    python benchmarks/repaired_meshes.py --folders FOLDER... [--every 5]   # minutes for 1,000 files; trimesh reads some

Without folders, of pybullet_data. A file counts as a robot's link takes it: all of its meshes together. Times are
seconds of the processor.
"""

from __future__ import annotations

import time
from importlib.util import find_spec
from pathlib import Path

import collide
from collide.adapters.bench.claims import Claim, Options, main
from collide.errors import CollideError
from collide.scenes.loaders.mesh_file import read_mesh
from collide.scenes.loaders.mesh_shapes import element_shapes
from collide.scenes.loaders.triangles import SUFFIXES


def is_solid(shape: collide.Shape) -> bool:
    """Whether every mesh of a shape has an inside."""
    if isinstance(shape, collide.Compound):
        return all(is_solid(part) for part, _ in shape.items)
    return shape.solid if isinstance(shape, collide.Mesh) else True


def solid_as(file: Path, meshes: str) -> bool:
    return all(is_solid(taken.shape) for taken in element_shapes(read_mesh(file, meshes), 1.0, file.name))


def counted(options: Options, folder: Path) -> list[dict]:
    """What becomes of every n-th mesh file below a folder."""
    files = [file for file in sorted(folder.rglob("*")) if file.suffix.lower() in SUFFIXES and file.is_file()]
    row = {"files": 0, "no solids": 0, "repaired": 0, "unread": 0, "s a repair": 0.0}
    for file in files[options.every // 2 :: options.every]:
        row["files"] += 1
        try:
            if not solid_as(file, "mesh"):
                row["no solids"] += 1
                start = time.process_time()
                row["repaired"] += solid_as(file, "repaired")
                row["s a repair"] += time.process_time() - start
        except CollideError:
            row["unread"] += 1
    return [{**row, "s a repair": row["s a repair"] / max(row["no solids"], 1)}]


def cases(options: Options):
    data = find_spec("pybullet_data")
    known = [Path(data.origin).parent] if data is not None and data.origin else []
    for folder in options.folders or known:
        yield {"folder": folder}


def arguments(parser) -> None:
    parser.add_argument("--folders", nargs="+", type=Path, default=[], metavar="FOLDER", help="of mesh files")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every n-th file only (1)")


CLAIMS = [Claim("repaired", "mesh files that are no solids, and are once repaired", cases, counted, everywhere=True)]


if __name__ == "__main__":
    main(__doc__, CLAIMS, arguments)
