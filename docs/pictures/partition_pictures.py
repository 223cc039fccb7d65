"""The picture of docs/partitions.md: free space among pillars as convex cells, from above, and a path through portals.

    python docs/pictures/partition_pictures.py           # needs matplotlib; writes docs/pictures/partitions.png
"""

from __future__ import annotations

import heapq
from pathlib import Path

import matplotlib
import numpy as np

import collide

matplotlib.use("Agg")
from matplotlib import pyplot
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

FILE = Path(__file__).parent / "partitions.png"
LOW, HIGH = np.zeros(3), np.array([8.0, 5.0, 1.0])
START, GOAL = np.array([0.4, 0.4, 0.5]), np.array([7.6, 4.6, 0.5])
RED, BODY = "#c0504d", "#4a4a4a"


def pillars() -> collide.Mesh:
    """Upright prisms of three to six corners, through floor and ceiling of the box."""
    rng = np.random.default_rng(4)
    vertices, faces = [], []
    for x, y in ((1.6, 1.2), (1.4, 3.6), (3.6, 2.4), (5.2, 0.9), (5.4, 3.8), (6.9, 2.5)):
        n = int(rng.integers(3, 7))
        angles = 2 * np.pi * (np.arange(n) + rng.uniform()) / n
        radius = rng.uniform(0.5, 0.9)
        rim = np.stack((x + radius * np.cos(angles), y + radius * np.sin(angles)), axis=1)
        begin = sum(len(v) for v in vertices)
        vertices += [np.column_stack((rim, np.full(n, z))) for z in (-0.5, 1.5)]
        i, j = np.arange(n), (np.arange(n) + 1) % n
        caps = np.stack((np.zeros(n - 2, dtype=int), i[1:-1], i[2:]), axis=1)
        sides = np.concatenate((np.stack((i, j, j + n), axis=1), np.stack((i, j + n, i + n), axis=1)))
        faces.append(np.concatenate((caps[:, ::-1], caps + n, sides)) + begin)
    return collide.Mesh(np.concatenate(vertices), np.concatenate(faces), solid=True)


def shortest(free: collide.ConvexCells, portals: collide.Portals, first: int, last: int) -> np.ndarray:
    """(k, 3) from start to goal through the middles of portals."""
    done, queue = set(), [(0.0, 0, first, [START])]
    while queue:
        length, _, cell, path = heapq.heappop(queue)
        if cell == last:
            return np.array([*path, GOAL])
        if cell in done:
            continue
        done.add(cell)
        for k in np.flatnonzero((portals.cells == cell).any(axis=1) & (portals.area > 0.05)).tolist():
            far = length + float(np.linalg.norm(portals.middle[k] - path[-1]))
            heapq.heappush(queue, (far, len(queue), int(portals.cells[k].sum()) - cell, [*path, portals.middle[k]]))
    raise RuntimeError("no way through")


def draw_cells(axes, cells: collide.ConvexCells, colours, alpha: float, shrunk: float) -> None:
    """The faces of cells, each cell drawn a little smaller about its middle."""
    for i in range(len(cells)):
        middle = cells.corners(i).mean(axis=0)
        polygons = []
        for j in range(cells.face_starts[i], cells.face_starts[i + 1]):
            at = cells.vertices[cells.loops[cells.loop_starts[j] : cells.loop_starts[j + 1]]]
            polygons.append(middle + shrunk * (at - middle))
        axes.add_collection3d(Poly3DCollection(polygons, facecolor=colours[i % len(colours)], edgecolor="#333333",
                                               linewidth=0.4, alpha=alpha))


def main() -> None:
    partition = collide.SpacePartition(pillars(), kappa=2000)
    free, solid = partition.convex_pieces(False, box=(LOW, HIGH)), partition.convex_pieces(True, box=(LOW, HIGH))
    portals = partition.portals(free)
    first, last = free.rows_of(partition.locate([START, GOAL]).cell).tolist()
    path = shortest(free, portals, first, last)
    figure = pyplot.figure(figsize=(11, 6.2))
    axes = figure.add_axes((-0.24, -0.3, 1.48, 1.58), projection="3d", computed_zorder=False, proj_type="ortho")
    draw_cells(axes, free, [matplotlib.colormaps["tab20"](k) for k in range(20)], 0.5, 0.95)
    draw_cells(axes, solid, [BODY], 1.0, 1.0)
    axes.plot(*(path + np.array([0.0, 0.0, 1.0])).T, color=RED, linewidth=2.5, marker="o", markersize=4)
    axes.set(xlim=(0, 8), ylim=(0, 5), zlim=(0, 1))
    axes.set_box_aspect((8, 5, 1))
    axes.set_axis_off()
    axes.view_init(elev=90, azim=-90)
    figure.text(0.02, 0.03, f"{partition.size.facets} facets of 6 pillars: {len(free)} convex cells of free space, "
                f"{len(portals.area)} portals; in red a path through {len(path) - 2} of them", fontsize=10)
    figure.savefig(FILE, dpi=110)
    print(FILE, len(free), len(portals.area))


if __name__ == "__main__":
    main()
