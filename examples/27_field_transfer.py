"""A field carried from one tetrahedral mesh to another: nothing is lost, and no value goes beyond those there were."""

from itertools import permutations

import numpy as np

import collide
from collide.papers.tetrahedra.cell_overlaps import exact_overlap


def block(cubes: int, seed: int) -> collide.TetMesh:
    """The unit cube, cut into cubes and these into six cells each, with the vertices inside moved about."""
    side = np.linspace(0, 1, cubes + 1)
    vertices = np.stack(np.meshgrid(side, side, side, indexing="ij"), axis=-1).reshape(-1, 3)
    moves = np.random.default_rng(seed).uniform(-0.25, 0.25, vertices.shape) / cubes
    vertices += np.where((vertices > 0) & (vertices < 1), moves, 0)
    corners = np.stack(np.meshgrid(*[np.arange(cubes)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    units = np.eye(3, dtype=int)
    steps = [np.cumsum([[0, 0, 0], *units[list(axes)]], axis=0) for axes in permutations(range(3))]
    steps = [s if np.linalg.det(s[1:]) > 0 else s[[0, 1, 3, 2]] for s in steps]
    return collide.TetMesh(vertices, np.concatenate([(corners + s) @ [(cubes + 1) ** 2, cubes + 1, 1] for s in steps]))


# A part, simulated on one mesh; its heat is wanted on another one. Both fill the same cube, at the same pose.
old, new = block(6, 0), block(9, 1)
X = collide.pose((0.4, 0.1, 0.8), rpy=(0.1, 0.2, 0.3))
shared = collide.overlapping_cells(old, new, X, X, volumes=True, centroids=True)
a, b = shared.pairs.T
print(f"{len(old.cells)} and {len(new.cells)} cells, {len(a)} pairs overlap")

# Constant in every cell: a new cell takes the mean of the old ones, by the volumes that it shares with them.
middles = old.vertices[old.cells].mean(axis=1)
heat = np.where(middles[:, 0] + middles[:, 1] < 0.9, 100.0, 20.0)
whole = np.bincount(b, shared.volumes)
carried = np.bincount(b, shared.volumes * heat[a]) / whole
before, after = np.bincount(a, shared.volumes) @ heat, whole @ carried
print(f"total before {before:.13f}, after {after:.13f}; conserved: {abs(after - before) < 1e-14 * before}")
print("no new extremes:", 20.0 * (1 - 1e-15) <= carried.min() and carried.max() <= 100.0 * (1 + 1e-15))

# Linear in every cell: the integral over a piece is its volume times the value at its centroid.
gradient = np.array([3.0, -2.0, 5.0])
means = np.bincount(b, shared.volumes * (shared.centroids @ gradient)) / whole
centres = new.vertices[new.cells].mean(axis=1) @ X[:3, :3].T + X[:3, 3]
print(f"a linear field comes over as it is: {np.abs(means - centres @ gradient).max() < 1e-13}")

# The pieces of a cell are the cell: as fractions, not to the last digit only.
pieces = [exact_overlap(old, new, np.eye(4), np.eye(4), 0, cell).volume for cell in b[a == 0].tolist()]
print(f"cell 0 has {len(pieces)} pieces, which sum to its volume in fractions: {sum(pieces) == old.exact_volume(0)}")
