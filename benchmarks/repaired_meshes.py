"""How many mesh files are no solids as they are, and how many are once repaired: counts by folder.

    python benchmarks/repaired_meshes.py FOLDER... [--every 5]      # minutes for a thousand files; trimesh reads some

A file counts as a robot's link takes it: all of its meshes together. Times are seconds of the processor.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import collide
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


def counted(folder: Path, every: int) -> Counter:
    """What becomes of every n-th mesh file below a folder."""
    files = [file for file in sorted(folder.rglob("*")) if file.suffix.lower() in SUFFIXES and file.is_file()]
    result: Counter = Counter()
    for file in files[every // 2 :: every]:
        try:
            result["files"] += 1
            if not solid_as(file, "mesh"):
                result["no solids"] += 1
                start = time.process_time()
                result["repaired"] += solid_as(file, "repaired")
                result["seconds"] += time.process_time() - start
        except CollideError:
            result["unread"] += 1
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="every n-th file only (1)")
    args = parser.parse_args()
    print("| folder | files | no solids | of these repaired | unread | s a repair |")
    print("| --- | --- | --- | --- | --- | --- |")
    for folder in args.folders:
        counts_of = counted(folder, args.every)
        seconds = counts_of["seconds"] / max(counts_of["no solids"], 1)
        counts = " | ".join(str(counts_of[name]) for name in ("files", "no solids", "repaired", "unread"))
        print(f"| {folder.name} | {counts} | {seconds:.2g} |")


if __name__ == "__main__":
    main()
