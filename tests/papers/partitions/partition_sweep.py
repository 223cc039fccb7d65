"""Many solids partitioned and judged: more than tests have time for.

    python tests/papers/partitions/partition_sweep.py 4 40 200     seeds a family, cells judged and points asked of each
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

FOLDERS = ("families", "solids", "oracles", "papers/partitions")
sys.path[:0] = [str(Path(__file__).parents[2] / name) for name in FOLDERS]
from partition_judge import Judge
from solid_families import SOLIDS
from test_space_partition import around, mesh_of, points_near, some_cells

import collide


def main(n_seeds: int, n_cells: int, n_points: int) -> None:
    cells = facets = points = meshes = held = 0
    wrong: list = []
    for family in SOLIDS:
        for seed in range(100, 100 + n_seeds):
            mesh = mesh_of(family, seed)
            partition = collide.SpacePartition(mesh, kappa=(8, 24, 64)[seed % 3], seed=seed)
            chosen = some_cells(partition.cells(around(mesh)), n_cells, np.random.default_rng(seed))
            verdict = Judge(mesh.vertices, mesh.faces, around(mesh)).judge(chosen)
            every = points_near(partition, n_points // 14 + 1, seed)
            inside = collide.contains(mesh, np.eye(4), every)
            differ = int((partition.locate(every).inside != inside).sum())
            if verdict.wrong or differ:
                wrong.append((family, seed, verdict.wrong[:2], differ))
            meshes, cells, facets = meshes + 1, cells + verdict.n_cells, facets + verdict.n_facet_tests
            points, held = points + len(every), held + int(inside.sum())
        print(f"{family}: {meshes} meshes, {cells:,} cells, {facets:,} facets against cells, {points:,} points, "
              f"{held:,} inside; wrong: {wrong}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:4] or ("4", "40", "200")))
