"""A field carried from one tetrahedral mesh to another: nothing is lost, and no value goes beyond those there were."""

import logging
from itertools import permutations

import numpy as np

import collide
from collide.tetrahedra.cell_overlaps import exact_overlap

logging.getLogger("collide").setLevel(logging.ERROR)  # half of the cells below run the other way round, and are turned


def block(cubes: int, shaken: float, seed: int) -> collide.TetMesh:
    """The unit cube, cut into cubes and these into six cells each, with the vertices inside moved about."""
    side = np.linspace(0, 1, cubes + 1)
    vertices = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    moves = np.random.default_rng(seed).uniform(-shaken, shaken, vertices.shape) / cubes
    vertices += np.where((vertices > 0) & (vertices < 1), moves, 0)
    corners = np.stack(np.meshgrid(*[np.arange(cubes)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    strides, cells = np.array([(cubes + 1) ** 2, cubes + 1, 1]), []
    for axes in permutations(range(3)):
        steps = np.cumsum([np.zeros(3, int), *np.eye(3, dtype=int)[list(axes)]], axis=0)
        cells.append((corners[:, None] + steps) @ strides)
    return collide.TetMesh(vertices, np.concatenate(cells))


# A part, simulated on one mesh; its heat is wanted on another one. Both fill the same cube, at the same pose.
old, new = block(6, 0.25, 0), block(9, 0.25, 1)
X = collide.pose((0.4, 0.1, 0.8), rpy=(0.1, 0.2, 0.3))
shared = collide.overlapping_cells(old, new, X, X, volumes=True, centroids=True)
a, b = shared.pairs.T
print(f"{len(old.cells)} and {len(new.cells)} cells, {len(a)} pairs overlap; {shared.counters[0, 3]} took fractions")


def sums(of: np.ndarray, weights: np.ndarray, n: int) -> np.ndarray:
    return np.bincount(of, weights, n)


# Values constant in every cell: a new cell takes the mean of the old ones, by the volumes that it shares with them.
middles = old.vertices[old.cells].mean(axis=1)
heat = np.where(middles[:, 0] + middles[:, 1] < 0.9, 100.0, 20.0)
whole = sums(b, shared.volumes, len(new.cells))
carried = sums(b, shared.volumes * heat[a], len(new.cells)) / whole
before = (sums(a, shared.volumes, len(old.cells)) * heat).sum()
after = (whole * carried).sum()
print(f"constant in cells: total before {before:.13f}, after {after:.13f};", end=" ")
print("conserved:", bool(abs(after - before) < 1e-14 * before))
print(f"from {heat.min():.0f} … {heat.max():.0f} to {carried.min():.0f} … {carried.max():.0f}: no new extremes",
      bool(carried.min() >= heat.min() * (1 - 1e-15) and carried.max() <= heat.max() * (1 + 1e-15)))  # fmt: skip

# Linear in every cell: the integral over a piece is its volume times the value at its centroid.
gradient = np.array([3.0, -2.0, 5.0])
integrals = sums(b, shared.volumes * (shared.centroids @ gradient + 1.0), len(new.cells))
centres = (new.vertices[new.cells].mean(axis=1) @ X[:3, :3].T + X[:3, 3]) @ gradient + 1.0
print(f"a linear field comes over to {np.abs(integrals / whole - centres).max():.0e} of itself")

# The pieces of a cell are the cell: as fractions, not to the last digit only.
still = np.eye(4)
pieces = [exact_overlap(old, new, still, still, 0, cell).volume for cell in b[a == 0].tolist()]
print(f"cell 0 has {len(pieces)} pieces, which sum to its volume in fractions: {sum(pieces) == old.exact_volume(0)}")
