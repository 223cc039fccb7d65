"""Rays, points, facets that meet, and what they share: a field carried between two triangulations of a square."""

import numpy as np

import collide


def square(cells: int, diagonal: int) -> collide.Mesh:
    """The unit square in the plane z = 0, cut into cells and these into triangles along one diagonal or the other."""
    side = np.linspace(0, 1, cells + 1)
    vertices = np.array([(x, y, 0.0) for y in side for x in side])
    corners = [k * (cells + 1) + i + np.array([0, 1, cells + 2, cells + 1]) for k in range(cells) for i in range(cells)]
    cuts = {0: ([0, 1, 2], [0, 2, 3]), 1: ([0, 1, 3], [1, 2, 3])}[diagonal]
    return collide.Mesh(vertices, [c[cut] for c in corners for cut in cuts], solid=False)


def areas(mesh: collide.Mesh) -> np.ndarray:
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


# A field with one value a facet is carried over by the areas that facets share: nothing of it is lost.
coarse, fine = square(3, 0), square(8, 1)
field = np.sin(np.arange(len(coarse.faces)))
shared = collide.overlay(coarse, fine, np.eye(4), np.eye(4))
polygons = shared.kind == 3
print(f"{len(shared.pairs)} pairs meet, {polygons.sum()} overlap; shared area {shared.size[polygons].sum():.15f}")
carried = np.zeros(len(fine.faces))
np.add.at(carried, shared.pairs[polygons, 1], field[shared.pairs[polygons, 0]] * shared.size[polygons])
carried /= areas(fine)
print(f"integral before {(field * areas(coarse)).sum():.12f}, after {(carried * areas(fine)).sum():.12f}")

# A cube of triangles: rays through an edge and a corner hit, one a hair beside it does not.
vertices = np.array([(x, y, z) for x in (-1.0, 1) for y in (-1.0, 1) for z in (-1.0, 1)])
faces = [
    [0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]
cube = collide.Mesh(vertices, faces)
beside = np.nextafter(1.0, 2.0)
rays = collide.raycast(cube, np.eye(4), [(3, 1, 0), (3, 1, 1), (3, beside, 0)], (-2, 0, 0))
print("through an edge, a corner, beside it:", rays.hit.tolist(), "at", rays.distance.tolist(), "ray lengths")
points = [(0, 0, 0), (1, 1, 1), (1, 1, beside)]
print("the centre and a corner are inside:", collide.contains(cube, np.eye(4), points).tolist())

# Two copies in one mesh cross; the facets say where.
both = collide.Mesh(np.concatenate([vertices, vertices + 0.5]), np.concatenate([faces, np.array(faces) + 8]))
crossing = collide.self_collisions(both)
print("crosses itself:", collide.self_collisions(cube).hit, crossing.hit, crossing.facets.tolist())
